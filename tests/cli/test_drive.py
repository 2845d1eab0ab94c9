"""What ends a run from outside, and the exit code: real signals, a runner that plays a script."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from py_trees.common import Status

from bt_actions.cli.driving.drive import Drive
from bt_actions.cli.driving.signals import SAME_WISH, Signals
from bt_actions.cli.exits import Exit
from bt_actions.cli.views.lines import LineView
from bt_actions.events import Event
from bt_actions.events.stream import BURST
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.unaccounted import GoalReport
from bt_actions.story.state import State
from tests.cli import fakes
from tests.cli.fakes import FakeRunner
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.waiting import until


class Run:
    """One drive over a fake runner, and what was written."""

    def __init__(
        self, runner: FakeRunner, timeout: float | None = None, output: object = None
    ) -> None:
        self.output: Any = output
        self.state = State()
        self.out = io.StringIO()
        self.runner = runner
        self.timeout = timeout
        self.abandoned = False

    def go(self) -> Exit:
        """Drive it to its end; return the exit code."""
        with Signals() as signals:
            drive = Drive(
                self.runner,
                self.runner.tick_to_end,
                self.state,
                LineView(self.state, self.out),
                signals,
                timeout=self.timeout,
                output=self.output,
            )
            drive.run()
            self.abandoned = drive.abandoned
            return drive.finish()


@pytest.fixture
def leaf() -> FakeNode:
    return FakeAction("Move")


@pytest.fixture
def story(leaf: FakeNode) -> Story:
    return Story(leaf)


def executing(story: Story) -> list[Event]:
    return [story.began, story.goal(story.root, "EXECUTING")]


def canceled(story: Story) -> list[Event]:
    done = story.goal(story.root, "DONE", outcome=Outcome.CANCELED, end=End.CANCELED)
    return [done, story.finish(Status.INVALID)]


@pytest.mark.parametrize(
    ("status", "code"), [(Status.SUCCESS, Exit.SUCCESS), (Status.FAILURE, Exit.FAILURE)]
)
def test_the_status_of_the_tree_is_the_exit_code(status: Status, code: Exit, story: Story) -> None:
    assert Run(FakeRunner([story.began, story.finish(status)])).go() is code


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGINT, Exit.SIGINT),
        (signal.SIGTERM, Exit.SIGTERM),
        (signal.SIGHUP, Exit.SIGHUP),
        (signal.SIGQUIT, Exit.SIGQUIT),
    ],
)
def test_a_signal_interrupts_and_the_drained_run_has_its_code(
    number: signal.Signals, code: Exit, story: Story
) -> None:
    run = Run(FakeRunner(waits=True))
    run.runner.before, run.runner.after = executing(story), canceled(story)
    with killed_when(run.runner.playing, number):
        assert run.go() is code
    assert not run.abandoned
    assert run.runner.interrupted.is_set()
    assert f"interrupted by {number.name}: canceling 1 goal; Ctrl-C again" in run.out.getvalue()
    assert f"STOPPED after 1.50 s, interrupted by {number.name}" in run.out.getvalue()


def test_a_burst_of_events_is_shown_before_the_tree_ends(leaf: FakeNode, story: Story) -> None:
    run = Run(FakeRunner(waits=True))
    changes = [story.node(leaf, Status.RUNNING) for _ in range(2 * BURST)]
    run.runner.before = [*executing(story), *changes, story.verdict(leaf, Outcome.ABORTED)]
    shown: list[bool] = []

    def ends() -> Iterator[Event]:
        shown.append("ABORTED" in run.out.getvalue())
        yield from (story.node(leaf, Status.FAILURE), story.finish(Status.FAILURE))

    run.runner.after = ends()
    run_until(run, "ABORTED")
    assert shown == [True]


def test_who_waits_after_the_end_of_the_tree_is_told_for_which_goals(
    leaf: FakeNode, story: Story
) -> None:
    run = Run(FakeRunner(waits=True))
    late = story.goal(leaf, "CANCELING", outcome=Outcome.ACCEPT_TIMEOUT, end=End.NEVER_STARTED)
    verdict = story.verdict(leaf, Outcome.ACCEPT_TIMEOUT)
    run.runner.before = [story.began, late, verdict, story.node(leaf, Status.FAILURE)]
    unknown = story.goal(leaf, "CANCELING", outcome=Outcome.ACCEPT_TIMEOUT, end=End.UNKNOWN)
    run.runner.after = [unknown, story.finish(Status.FAILURE)]
    said = "waiting to know the end of 1 goal: Move on move_robot; Ctrl-C twice leaves"
    text = run_until(run, said)
    assert text.count(said) == 1
    assert "ACCEPT_TIMEOUT, not started as far as its server knows" in text


def test_who_waits_for_a_server_that_went_away_is_told(leaf: FakeNode, story: Story) -> None:
    run = Run(FakeRunner(waits=True))
    gone = story.goal(leaf, "CANCELING", outcome=Outcome.SERVER_LOST, end=End.SERVER_GONE)
    run.runner.before = [story.began, gone, story.node(leaf, Status.FAILURE)]
    run.runner.after = [story.finish(Status.FAILURE)]
    said = "to cancel its goal if it is back: Move on move_robot; Ctrl-C twice leaves"
    assert run_until(run, said).count(said) == 1


def run_until(run: Run, said: str) -> str:
    """Go, let the runner end when this was said, and return all that was."""
    thread = threading.Thread(target=lambda: until(lambda: said in run.out.getvalue()))
    done = threading.Thread(target=lambda: (thread.join(), run.runner.interrupted.set()))
    for each in (thread, done):
        each.start()
    assert run.go() is Exit.FAILURE
    done.join()
    return run.out.getvalue()


@contextlib.contextmanager
def killed_when(event: threading.Event, number: signal.Signals) -> Iterator[None]:
    """Send a signal to this process at an event; one that is late does not hit the next test."""

    def kill() -> None:
        event.wait()
        os.kill(os.getpid(), number)

    killer = threading.Thread(target=kill)
    killer.start()
    with Signals():
        yield
        event.set()
        killer.join()


ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def test_the_handlers_of_before_are_back_after_a_run(story: Story) -> None:
    before = [signal.getsignal(number) for number in ENDING]
    Run(FakeRunner([story.began, story.finish(Status.SUCCESS)])).go()
    after = [signal.getsignal(number) for number in ENDING]
    assert after == before


@pytest.fixture
def ignored_hangup() -> Iterator[None]:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("ignored_hangup")
def test_under_nohup_a_hangup_stays_ignored() -> None:
    with Signals() as signals:
        os.kill(os.getpid(), signal.SIGHUP)
        assert signals.wait(0.0) == ([], set())


def test_the_timeout_interrupts_with_124(story: Story) -> None:
    run = Run(FakeRunner(waits=True), timeout=0.05)
    run.runner.before, run.runner.after = executing(story), canceled(story)
    assert run.go() is Exit.TIMEOUT
    assert "--timeout 0.05 s expired: canceling 1 goal" in run.out.getvalue()


def test_a_timeout_that_expires_when_the_tree_has_finished_changes_nothing(story: Story) -> None:
    run = Run(FakeRunner(waits=True), timeout=0.05)
    run.runner.before = [story.began, story.finish(Status.SUCCESS)]
    later = threading.Timer(0.3, run.runner.interrupted.set)  # its shutdown takes so long
    later.start()
    assert run.go() is Exit.SUCCESS
    later.join()


class SlowReader:
    """Takes everything after so many looks."""

    def __init__(self, looks: int) -> None:
        self.left = looks

    def written(self, within: float) -> bool:
        time.sleep(within)
        self.left -= 1
        return self.left <= 0


def test_a_timeout_that_expires_in_the_shutdown_does_not_cut_off_the_output(story: Story) -> None:
    reader = SlowReader(5)
    run = Run(FakeRunner(waits=True), timeout=0.05, output=reader)
    run.runner.before = [story.began, story.finish(Status.SUCCESS)]
    later = threading.Timer(0.3, run.runner.interrupted.set)  # its shutdown takes so long
    later.start()
    assert run.go() is Exit.SUCCESS
    later.join()
    assert reader.left == 0


def test_a_goal_whose_end_is_unknown_wins_over_every_other_code(story: Story) -> None:
    lost = GoalReport("Move", "/move_robot", "0123456789abcdef", Outcome.CANCELED, "no answer")
    for waits, timeout in ((False, None), (True, 0.05)):
        run = Run(FakeRunner([story.began], waits=waits), timeout=timeout)
        run.runner.after = [story.finish(Status.SUCCESS, lost)]
        assert run.go() is Exit.UNKNOWN
        last = run.out.getvalue().splitlines()[-1]
        assert last == "not accounted for: Move on /move_robot, goal 0123456789abcdef: no answer"


def test_a_second_signal_ends_the_wait_at_once_and_the_report_says_what_is_left(
    story: Story,
) -> None:
    given_up = {"outcome": Outcome.STALLED, "end": End.UNKNOWN, "reason": "silent"}
    older = story.goal(story.root, "DONE", visit=0, **given_up)
    events = [story.began, older, story.goal(story.root, "EXECUTING")]
    run = Run(FakeRunner(events, waits=True, never_drains=True))
    stop = threading.Event()

    def keep_killing() -> None:  # as an impatient user does
        run.runner.playing.wait()
        while not stop.wait(SAME_WISH / 2):
            os.kill(os.getpid(), signal.SIGINT)

    impatient = threading.Thread(target=keep_killing)
    impatient.start()
    with Signals():  # so that a signal after the end does not hit the test
        code = run.go()
        stop.set()
        impatient.join()
    run.runner.released.set()
    assert (code, run.abandoned) == (Exit.UNKNOWN, True)
    assert run.out.getvalue().splitlines()[-2:] == [
        "not accounted for: Move on move_robot, goal Move-0-1: silent",
        "not accounted for: Move on move_robot, goal Move-1-1: executing when left",
    ]
    assert "  CANCELED, end UNKNOWN  " in run.out.getvalue()
    assert run.out.getvalue().count("Ctrl-C again leaves without waiting") == 1


def test_a_second_signal_after_the_end_of_all_goals_leaves_none_unknown(story: Story) -> None:
    """It is left while node and context are still being closed."""
    run, closed = Run(FakeRunner(waits=True)), threading.Event()
    run.runner.before = executing(story)

    def takes_long_to_close() -> Iterator[Event]:
        yield from canceled(story)
        while not run.runner.released.wait(SAME_WISH / 2):
            os.kill(os.getpid(), signal.SIGINT)
        closed.set()

    run.runner.after = takes_long_to_close()
    with Signals():  # so that a signal after the end does not hit the test
        with killed_when(run.runner.playing, signal.SIGINT):
            code = run.go()
        run.runner.released.set()
        closed.wait()
    assert (code, run.abandoned) == (Exit.SIGINT, True)
    assert "not accounted for" not in run.out.getvalue()


def test_a_second_signal_waits_for_a_run_with_no_goal_left_to_be_over(story: Story) -> None:
    """The middleware may take its time for what was sent last."""
    run = Run(FakeRunner(waits=True))
    run.runner.before = executing(story)

    def takes_a_while() -> Iterator[Event]:
        done, finished = canceled(story)
        yield done
        while not run.runner.abandoned.wait(SAME_WISH / 2):
            os.kill(os.getpid(), signal.SIGINT)
        threading.Event().wait(2 * SAME_WISH)
        yield finished

    run.runner.after = takes_a_while()
    with Signals(), killed_when(run.runner.playing, signal.SIGINT):
        code = run.go()
    assert (code, run.abandoned) == (Exit.SIGINT, True)
    assert "not accounted for" not in run.out.getvalue()


def test_one_wish_that_arrives_twice_is_one_wish(story: Story) -> None:
    run = Run(FakeRunner(waits=True))
    run.runner.before, run.runner.after = executing(story), canceled(story)
    with (
        killed_when(run.runner.playing, signal.SIGINT),
        killed_when(run.runner.interrupted, signal.SIGINT),  # as a wrapper passes it on
    ):
        assert run.go() is Exit.SIGINT
    assert not run.abandoned


def test_an_exception_in_the_tree_is_a_failure_and_is_told_with_its_place(story: Story) -> None:
    """Of one that is told with the end of the tree, and of one in its setup, its end or closing."""
    told = story.finish(Status.INVALID, error="a bug (own.py:3)")
    run = Run(FakeRunner([story.began, told], error=RuntimeError("a bug")))
    assert run.go() is Exit.FAILURE
    assert run.out.getvalue().splitlines()[-1].endswith("  a bug (own.py:3)")
    for events in ([], [story.began], [story.began, story.finish(Status.SUCCESS)]):
        run = Run(FakeRunner(events, error=RuntimeError("a bug")))
        assert run.go() is Exit.FAILURE
        last = run.out.getvalue().splitlines()[-1]
        assert last.startswith(f"a bug ({fakes.__file__}:")
        assert run.state.ended is not None
        assert run.state.ended.error == last


def test_a_tree_that_cannot_be_set_up_as_it_is_given_is_bad_input(story: Story) -> None:
    told = story.finish(Status.INVALID, error="no such type", unusable=True)
    run = Run(FakeRunner([story.began, told], error=RuntimeError("no such type")))
    assert run.go() is Exit.BAD_INPUT


def test_a_view_that_fails_is_given_up_and_the_run_goes_on(
    story: Story, capsys: pytest.CaptureFixture[str]
) -> None:
    class FullDisk(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(28, "No space left on device")

    run = Run(FakeRunner([*executing(story), story.finish(Status.SUCCESS)]))
    run.out = FullDisk()
    assert run.go() is Exit.FAILURE, "a success that nobody could be told is none"
    assert run.state.status is Status.SUCCESS
    said = capsys.readouterr().err
    assert said.count("the output cannot be written") == 1
    assert "No space left on device" in said
