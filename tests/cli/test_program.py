"""What a program of the command line does before and behind its command."""

from __future__ import annotations

import subprocess
import sys

START = """
import gc, threading
from bt_actions.cli import program

def dispatch(argv):
    began = gc.isenabled()
    for timer in threading.enumerate():
        if isinstance(timer, threading.Timer):
            timer.cancel()
            timer.function()
    print(began, gc.isenabled(), gc.get_freeze_count() > 10_000)
    return 0

program.START = 1000.0
program._dispatch = dispatch
program.main(["check"] if CALLED else None)
"""


def _said(*, called: bool) -> str:
    text = START.replace("CALLED", str(called))
    command = [sys.executable, "-c", text]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=True)
    return done.stdout.strip()


def test_garbage_is_collected_again_behind_the_start() -> None:
    assert _said(called=False) == "False True True"


def test_a_program_that_calls_main_keeps_its_collector_as_it_is() -> None:
    assert _said(called=True) == "True True False"
