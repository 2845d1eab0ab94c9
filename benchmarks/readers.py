"""Readers of a page, in a process of their own: twenty that read on, and one that stops.

`python -m benchmarks.readers ADDRESS` waits for a run on the page of `bt-actions view`, and reads
its stream until it is killed.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import selectors
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

READERS = 20


@contextlib.contextmanager
def readers(state: Path) -> Iterator[None]:
    """Serve the runs below a state directory to the readers of a page."""
    around = {**os.environ, "XDG_STATE_HOME": str(state)}
    view = [sys.executable, "-m", "bt_actions.cli", "view"]
    with subprocess.Popen(view, stdout=subprocess.PIPE, text=True, env=around) as served:
        assert served.stdout is not None
        read = [sys.executable, "-m", "benchmarks.readers", served.stdout.readline().strip()]
        with subprocess.Popen(read, stdout=subprocess.PIPE, text=True) as reading:
            assert reading.stdout is not None
            reading.stdout.readline()  # until it waits for the run
            try:
                yield
            finally:
                assert reading.poll() is None
                reading.kill()
                served.send_signal(signal.SIGINT)


def main(address: str) -> None:
    """Read the first run there is."""
    url = urlsplit(address)
    port, token = url.port, url.fragment.removeprefix("token=")
    headers = {"Cookie": f"bt_actions_{port}={token}"}

    def ask(path: str) -> http.client.HTTPConnection:
        connection = http.client.HTTPConnection("127.0.0.1", port)
        connection.request("GET", path, headers=headers)
        return connection

    print("waits", flush=True)
    while not (runs := json.load(ask("/runs").getresponse())["runs"]):
        time.sleep(0.05)
    place = f"/run/{runs[0]['run_id']}/events"
    stopped = ask(place)
    told = selectors.DefaultSelector()
    sockets = [connection.sock for _ in range(READERS) if (connection := ask(place))]
    for each in sockets:
        told.register(each, selectors.EVENT_READ)
    while told.get_map():
        for key, _ in told.select():
            assert isinstance(key.fileobj, socket.socket)
            if not key.fileobj.recv(1_000_000):
                told.unregister(key.fileobj)
    stopped.close()
    signal.pause()


if __name__ == "__main__":
    main(sys.argv[1])
