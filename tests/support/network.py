"""Two machines on one: network namespaces, the link between them, and what can go wrong with it.

Nothing outside these namespaces is touched. Needs root; otherwise an OSError says why not.
"""

from __future__ import annotations

import contextlib
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import threading
import time
from pathlib import Path

_TUNSETIFF = 0x400454CA
_TAP = 0x0002 | 0x1000  # IFF_TAP, IFF_NO_PI
_TUN = Path("/dev/net/tun")
_FRAME = 65536


def _ip(*words: str) -> None:
    done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"ip {' '.join(words)}: {done.stderr.strip()}")


class Machines:
    """The namespaces `a` and `b`, joined by a link that can be cut."""

    def __init__(self, *, loss: float = 0.0, delay: float = 0.0) -> None:
        """With loss (a share) or delay (seconds each way) a relay of ours is the link.

        Raises OSError where namespaces or links cannot be made.
        """
        number = os.getpid()
        self.a, self.b = (f"bt_{number}_{end}" for end in "ab")
        self._ends = {self.a: (f"bta{number}", "10.77.0.1"), self.b: (f"btb{number}", "10.77.0.2")}
        self._relay: _Relay | None = None
        try:
            for machine in (self.a, self.b):
                _ip("netns", "add", machine)
            devices = [device for device, _ in self._ends.values()]
            if loss or delay:
                self._relay = _Relay(devices, loss, delay)
            else:
                _ip("link", "add", devices[0], "type", "veth", "peer", "name", devices[1])
            for machine, (device, address) in self._ends.items():
                _ip("link", "set", device, "netns", machine)
                _ip("-n", machine, "address", "add", f"{address}/24", "dev", device)
                _ip("-n", machine, "link", "set", "lo", "up")
                _ip("-n", machine, "link", "set", device, "multicast", "on", "up")
                _ip("-n", machine, "route", "add", "239.0.0.0/8", "dev", device)
        except OSError:
            self.close()
            raise

    def on(self, machine: str) -> list[str]:
        """The command that runs another on this machine."""
        return ["ip", "netns", "exec", machine]

    def cut(self) -> float:
        """Cut the link; return the moment."""
        device, _ = self._ends[self.b]
        _ip("-n", self.b, "link", "set", device, "down")
        return time.monotonic()

    def join(self) -> float:
        """Mend the link; return the moment."""
        device, _ = self._ends[self.b]
        _ip("-n", self.b, "link", "set", device, "up")
        _ip("-n", self.b, "route", "replace", "239.0.0.0/8", "dev", device)
        return time.monotonic()

    def close(self) -> None:
        """Take it all down; the links go with their namespaces."""
        if self._relay is not None:
            self._relay.close()
        for machine in (self.a, self.b):
            with contextlib.suppress(OSError):
                _ip("netns", "delete", machine)


class _Relay:
    """A cable between two TAP devices that loses and delays frames; one thread carries them."""

    def __init__(self, devices: list[str], loss: float, delay: float) -> None:
        if not _TUN.exists():
            raise OSError(f"there is no {_TUN}")
        self._loss, self._delay = loss, delay
        self._chance = random.Random(1)
        self._over = threading.Event()
        self._ends = [_tap(device) for device in devices]
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def _carry(self) -> None:
        on_the_way: list[tuple[float, int, int, bytes]] = []
        number = 0
        while not self._over.is_set():
            left = max(0.0, on_the_way[0][0] - time.monotonic()) if on_the_way else 0.05
            ready, _, _ = select.select(self._ends, [], [], min(left, 0.05))
            now = time.monotonic()
            for end in ready:
                frame = os.read(end, _FRAME)
                other = self._ends[1 - self._ends.index(end)]
                number += 1
                if self._chance.random() >= self._loss:
                    heapq.heappush(on_the_way, (now + self._delay, number, other, frame))
            while on_the_way and on_the_way[0][0] <= now:
                _, _, end, frame = heapq.heappop(on_the_way)
                with contextlib.suppress(OSError):  # the device is down
                    os.write(end, frame)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        for end in self._ends:
            os.close(end)


def _tap(device: str) -> int:
    end = os.open(_TUN, os.O_RDWR | os.O_CLOEXEC)
    fcntl.ioctl(end, _TUNSETIFF, struct.pack("16sH", device.encode(), _TAP))
    return end
