"""`make soak`: one robot and its gripper, 20,000 goals, every fault at 5 %, none unaccounted for.

The servers run in another process and write a journal; it is compared with what the orchestrator
said, goal by goal. Memory, threads and open files of the orchestrator are measured after a warm-up
and at the end; before it, another server is lost on purpose, so that what the search for a lost
server loads once is loaded. Exit code 0 when all of it holds. Takes an hour or
two; `--goals` shortens it.
"""

from __future__ import annotations

import argparse
import gc
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import py_trees
from py_trees.common import Status

from bt_actions import (
    ActionBehaviour,
    End,
    Gripper,
    MoveRobot,
    Outcome,
    Retry,
    Timeouts,
    TreeRunner,
)
from bt_actions.events import Event, GoalChanged
from bt_actions.ros.environment import Reach, prepare
from bt_actions.simulation import journal

FAULTS = [
    "reject",
    "delay_accept=0.2",
    "drop_goal",
    "drop_accept",
    "abort",
    "slow=10",
    "no_feedback",
    "delay_cancel=0.2",
    "succeed_on_cancel",
    "abort_on_cancel",
    "delay_result=0.2",
    "drop_result=2",
    "restart=0.2",
]
NO_CANCEL = ["reject_cancel", "ignore_cancel", "drop_cancel"]
"""For the robot only: a gripper that stalls and will not be canceled is stuck for ever."""
TIMEOUTS = Timeouts(queue=60.0, server=60.0, accept=0.4, result=1.0, feedback=0.5, cancel=10.0)
GROWTH = 1.0
"""MB that 10,000 goals may leave behind."""
WARM = 0.2
"""Share of the goals before memory is first measured."""
SAID = {
    "succeeded": {End.SUCCEEDED},
    "aborted": {End.ABORTED},
    "canceled": {End.CANCELED},
    "rejected": {End.NEVER_STARTED, End.SERVER_GONE},
    "died": {End.SERVER_GONE},
    "None": {End.NEVER_STARTED, End.SERVER_GONE},
}
"""What the orchestrator may say of a goal, by how it ended on the server; UNKNOWN of none. Of a
request whose answer was lost, and its server after it, nobody can say that it never started."""


class Soak:
    """Counts goals, keeps what was said of each in a file, and measures."""

    def __init__(self, goals: int, said: Path) -> None:
        self.goals = goals
        self.outcomes: Counter[str] = Counter()
        self.measured: list[tuple[int, dict[str, float]]] = []
        self._said = said.open("w", encoding="utf-8")
        self._visits = 0

    def note_goal(self, event: Event) -> None:
        """Take note of a goal; in a file, so that the notes are no growth."""
        if isinstance(event, GoalChanged) and event.outcome is not None:
            self._said.write(f"{event.goal_id} {event.end} {event.outcome}\n")

    def visit(self) -> float:
        """Return a number between -1 and 1 for the next goal, measuring now and then."""
        step = max(1, self.goals // 20)
        if self._visits % step == 0:
            self.measured.append((self._visits, held()))
            print(self._visits, self.measured[-1][1], flush=True)
        self._visits += 1
        return random.uniform(-1.0, 1.0)

    def close(self) -> None:
        """Measure for the last time."""
        self.measured.append((self._visits, held()))
        self._said.close()


class AllAccountedFor(py_trees.behaviour.Behaviour):
    """RUNNING until these leaves know how each of their goals ended."""

    def __init__(self, name: str, *leaves: ActionBehaviour) -> None:
        super().__init__(name)
        self._leaves = leaves

    def update(self) -> Status:
        """Ask the leaves."""
        return Status.SUCCESS if all(each.drained for each in self._leaves) else Status.RUNNING


def held() -> dict[str, float]:
    """What this process holds."""
    gc.collect()
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return {
        "memory": int(status.partition("VmRSS:")[2].split()[0]) / 1024.0,
        "of it not of files": int(status.partition("RssAnon:")[2].split()[0]) / 1024.0,
        "threads": sum(1 for _ in Path("/proc/self/task").iterdir()),  # the middleware's, too
        "files": sum(1 for _ in Path("/proc/self/fd").iterdir()),
    }


def lose_a_server() -> None:
    """Kill a server under a goal, and want it for long enough that it is looked for."""
    command = [sys.executable, "-m", "bt_actions.cli", "sim", "--namespace", "/lost"]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    leaf = MoveRobot(
        "lost",
        9.0,
        action_name="/lost/move_robot",
        timeout=Timeouts(server=10.0),
        retry=Retry(2, outcomes=frozenset({Outcome.SERVER_LOST})),
        on_feedback=lambda feedback: server.kill(),
    )
    try:
        with TreeRunner(leaf) as runner:
            runner.run()
    finally:
        server.kill()
        server.wait(20.0)
    if [each.outcome for each in leaf.history] != [Outcome.SERVER_LOST, Outcome.SERVER_UNAVAILABLE]:
        raise RuntimeError(f"the server that was to be lost was not: {leaf.history}")


def run(goals: int, directory: Path) -> list[str]:
    """Run the goals against servers in another process; return what is wrong."""
    record, said = directory / "journal.jsonl", directory / "said.txt"
    faults = [f"*:5%:{fault}" for fault in FAULTS]
    faults += [f"move_robot:5%:{fault}" for fault in NO_CANCEL] + ["gripper_control:5%:stall"]
    command = [sys.executable, "-m", "bt_actions.cli", "sim", "--speed", "20", "--seed", "1"]
    servers = subprocess.Popen(
        [*command, "--journal", str(record), *(word for f in faults for word in ("--fault", f))],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    soak = Soak(goals, said)
    retry = Retry(2, outcomes=frozenset({*Retry().outcomes, *LOST}))
    move = MoveRobot("move", 0.0, timeout=TIMEOUTS, retry=retry, on_feedback=lambda feedback: None)
    grip = Gripper("grip", 0.0, timeout=TIMEOUTS, retry=retry)
    move.goal = lambda: {"distance": soak.visit() * 0.03}
    grip.goal = lambda: {"position": 50.0 + soak.visit()}
    whatever = py_trees.decorators.FailureIsSuccess
    both = py_trees.composites.Sequence(
        "both", memory=True, children=[whatever("moved", move), whatever("gripped", grip)]
    )
    again = py_trees.decorators.Repeat("again", child=both, num_success=goals // 2)
    end = AllAccountedFor("all accounted for", move, grip)
    root = py_trees.composites.Sequence("soak", memory=True, children=[again, end])
    wrong = []
    began = time.monotonic()
    try:
        with TreeRunner(root) as runner:
            runner.observe_events(soak.note_goal)
            if runner.run() is not Status.SUCCESS:
                wrong.append("the tree did not succeed")
            wrong += [f"{report} is unaccounted for" for report in runner.unaccounted]
            soak.close()
        live = [each for each in journal.live_intervals(journal.read(record)) if each.end is None]
        wrong += [f"{each.goal}: still runs when all is over" for each in live]
    finally:
        servers.send_signal(signal.SIGINT)
        servers.wait(20.0)
    print(f"{goals} goals in {time.monotonic() - began:.0f} s")
    return wrong + compare(said, record) + growth(soak)


LOST = (Outcome.SERVER_LOST, Outcome.ACCEPT_TIMEOUT)


def compare(said: Path, record: Path) -> list[str]:
    """Compare report and journal, goal by goal."""
    lines = [line.split() for line in said.read_text(encoding="utf-8").splitlines()]
    ends = {goal: End(end) for goal, end, _ in lines}
    outcomes = Counter(outcome for _, _, outcome in lines)
    entries = journal.read(record)
    known = {goal: str(end) for (_, goal), end in journal.ends(entries).items()}
    print("outcomes:", dict(outcomes))
    print("the journal's ends:", dict(Counter(known.values())))
    wrong = [f"{g}: {e}, and we said nothing" for g, e in known.items() if g not in ends]
    wrong += [
        f"{goal}: {known[goal]}, and we said {end}"
        for goal, end in ends.items()
        if goal in known and end not in SAID[known[goal]]
    ]
    wrong += [
        f"{goal}: no server has seen it, and we said {end}"
        for goal, end in ends.items()
        if goal not in known and end not in SAID["None"]
    ]
    twice = [goal for (_, goal), times in journal.executions(entries).items() if times > 1]
    return wrong + [f"{goal}: executed twice" for goal in twice]


def growth(soak: Soak) -> list[str]:
    """Say what has grown since the warm-up beyond what is allowed."""
    (first, warm), (last, after) = (
        next(each for each in soak.measured if each[0] >= WARM * soak.goals),
        soak.measured[-1],
    )
    allowed = max(GROWTH, GROWTH * (last - first) / 10_000)
    grown = after["memory"] - warm["memory"]
    print(f"memory grew by {grown:.2f} MB in {last - first} goals")
    wrong = [f"memory grew by {grown:.2f} MB"] if grown >= allowed else []
    return wrong + [
        f"{what}: {warm[what]} after the warm-up, {after[what]} at the end"
        for what in ("threads", "files")
        if after[what] > warm[what]
    ]


def main() -> int:
    """Run it and tell."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--goals", type=int, default=20_000)
    parser.add_argument("--keep", type=Path, help="a directory to keep journal and report in")
    given = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", "69")
    prepare(Reach.MACHINE)
    with tempfile.TemporaryDirectory() as scratch:
        directory = given.keep or Path(scratch)
        directory.mkdir(parents=True, exist_ok=True)
        lose_a_server()
        wrong = run(given.goals, directory)
    for line in wrong[:50]:
        print(f"WRONG: {line}")
    print("every goal is accounted for" if not wrong else f"{len(wrong)} things are wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
