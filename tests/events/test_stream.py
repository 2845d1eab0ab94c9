"""The stream: numbers and moments in one order from all threads, and readers that are slow."""

from __future__ import annotations

import random
import threading
import time
import weakref
from typing import Any

import pytest

from bt_actions.events import (
    ClockJumped,
    Event,
    EventsLost,
    FeedbackCame,
    GoalChanged,
    Moment,
    Node,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    Paused,
    RunBegan,
    RunEnded,
)
from bt_actions.events.stream import BURST, CHANGES, JUMP, ROOM, Stream
from bt_actions.story.state import State
from tests.support.stories import state_of


class Clock:
    """Stands still until somebody moves it."""

    def __init__(self) -> None:
        self.steady, self.wall, self.ros, self.asked = 100.0, 1e9, 50.0, 0

    def __call__(self) -> tuple[float, float, float]:
        self.asked += 1
        return self.steady, self.wall, self.ros

    def move(self, seconds: float, wall: float | None = None, ros: float | None = None) -> None:
        self.steady += seconds
        self.wall += seconds if wall is None else wall
        self.ros += seconds if ros is None else ros


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def stream(clock: Clock) -> Stream:
    return Stream(clock)


def feedback(stream: Stream, number: int = 0) -> None:
    stream.add(FeedbackCame, 1, "ab", number)


def goal(stream: Stream, number: int = 0) -> None:
    stream.add(GoalChanged, 1, f"{number}", 1, "EXECUTING", None, None, "", "/move")


def kinds(events: list[Event]) -> list[str]:
    return [type(event).__name__ for event in events]


def test_numbers_have_no_gaps_and_moments_never_go_back_whoever_adds() -> None:
    """A clock that lets other threads in between its reading and the event's place in the order."""

    def clock() -> tuple[float, float, float]:
        now = time.monotonic()
        time.sleep(0)
        return now, now, now

    stream = Stream(clock)
    readers = [stream.reader(), stream.reader()]
    threads, each = 4, 500
    ready = threading.Barrier(threads)

    def add() -> None:
        ready.wait()
        for _ in range(each):
            goal(stream)

    adding = [threading.Thread(target=add) for _ in range(threads)]
    for thread in adding:
        thread.start()
    taken: list[list[Event]] = [[], []]
    while any(thread.is_alive() for thread in adding):
        taken[0] += readers[0].take()
    for reader, events in zip(readers, taken, strict=True):
        events += reader.take()
        moments = [event.at for event in events]
        assert [moment.number for moment in moments] == list(range(1, threads * each + 1))
        assert [moment.steady for moment in moments] == sorted(each.steady for each in moments)


def test_where_nobody_reads_nothing_is_made(stream: Stream, clock: Clock) -> None:
    def never(*_: Any) -> Event:
        raise AssertionError("an event was made")

    stream.add(never)
    assert not stream.is_read
    reader = stream.reader()
    assert stream.is_read
    goal(stream)
    stream.leave(reader)
    stream.add(never)
    assert not stream.is_read
    assert clock.asked == 1
    assert [event.at.number for event in reader.take()] == [1]


def test_an_event_is_made_once_for_all_readers_with_the_moment_at_which_it_was_noted(
    stream: Stream, clock: Clock
) -> None:
    made: list[threading.Thread] = []

    def paused(at: Moment) -> Event:
        made.append(threading.current_thread())
        return Paused(at, True)

    one, other = stream.reader(), stream.reader()
    noted = threading.Thread(target=stream.add, args=[paused])
    noted.start()
    noted.join()
    assert not made
    before = clock.steady
    clock.move(5.0)
    (event,) = one.take()
    assert other.take() == [event]
    assert event.at.steady == before
    assert made == [threading.current_thread()]


def test_what_nobody_takes_does_not_pile_up(stream: Stream) -> None:
    class Kept(FeedbackCame):
        """Feedback that is known to be there."""

    alive = weakref.WeakSet[Kept]()

    def kept(at: Moment) -> Event:
        alive.add(event := Kept(at, 1, "ab", 0))
        return event

    reader = stream.reader(room=10)
    for _ in range(ROOM):
        stream.add(kept)
    assert len(alive) == 10
    assert len(reader.take()) == 10


def test_a_reader_has_what_came_since_it_reads_and_none_waits_for_another(stream: Stream) -> None:
    slow = stream.reader()
    goal(stream)
    late = stream.reader()
    goal(stream)
    assert [event.at.number for event in late.take()] == [2]
    assert late.take() == []
    assert [event.at.number for event in slow.take()] == [1, 2]


def test_a_slow_reader_is_told_how_much_it_has_lost_and_never_loses_a_goal_s_event(
    stream: Stream,
) -> None:
    reader, quick = stream.reader(room=10), stream.reader()
    for number in range(100):
        feedback(stream, number)
        if number % 10 == 9:
            goal(stream, number)
    stream.add(RunEnded, 0)
    events, told = reader.take(), quick.take()
    assert [each for each in events if isinstance(each, GoalChanged | RunEnded)] == [
        each for each in told if isinstance(each, GoalChanged | RunEnded)
    ]
    lost = sum(each.count for each in events if isinstance(each, EventsLost))
    kept = [each for each in events if isinstance(each, FeedbackCame)]
    assert (len(kept), lost) == (10, 90)
    assert not any(isinstance(each, EventsLost) for each in told)
    first = next(at for at, each in enumerate(events) if isinstance(each, EventsLost))
    assert kinds(events[first - 1 : first + 2]) == ["GoalChanged", "EventsLost", "GoalChanged"]


def test_a_reader_that_has_caught_up_has_all_again(stream: Stream) -> None:
    reader = stream.reader(room=3)
    for number in range(5):
        feedback(stream, number)
    assert kinds(reader.take()) == ["FeedbackCame"] * 3
    feedback(stream)
    (lost, _) = events = reader.take()
    assert kinds(events) == ["EventsLost", "FeedbackCame"]
    assert isinstance(lost, EventsLost)
    assert lost.count == 2
    feedback(stream)
    assert kinds(reader.take()) == ["FeedbackCame"]


def test_the_pause_of_a_run_and_its_end_are_never_left_out(stream: Stream) -> None:
    reader = stream.reader(room=0)
    stream.add(NodeChanged, 1, "RUNNING", "")
    stream.add(Paused, True)
    stream.add(RunEnded, 0)
    assert kinds(reader.take()) == ["EventsLost", "Paused", "RunEnded"]


def test_a_reader_is_poked_once_for_what_comes_to_an_empty_queue(stream: Stream) -> None:
    poked: list[int] = []
    reader = stream.reader(lambda: poked.append(1), room=2)
    for _ in range(4):
        feedback(stream)
    assert len(poked) == 1
    reader.take()
    feedback(stream)
    assert len(poked) == 2, "also where that is told with what was lost before it"
    feedback(stream)
    assert len(poked) == 2


def test_a_reader_sees_a_burst_but_not_once_half_its_room_is_taken(stream: Stream) -> None:
    reader, other = stream.reader(room=100), stream.reader()
    for _ in range(BURST):
        feedback(stream)
    assert not reader.is_burst
    feedback(stream)
    assert reader.is_burst
    other.take()
    assert (reader.is_burst, other.is_burst) == (True, False), "made events count as noted ones"
    for _ in range(50 - BURST):
        feedback(stream)
    assert not reader.is_burst, "else events would be lost"


def test_a_jump_of_the_wall_clock_is_told_before_the_event_that_shows_it(
    stream: Stream, clock: Clock
) -> None:
    reader = stream.reader()
    goal(stream)
    clock.move(1.0, wall=11.0)
    goal(stream)
    clock.move(1.0, wall=-5.0)
    goal(stream)
    clock.move(1.0)
    goal(stream)
    events = reader.take()
    jumps = [each for each in events if isinstance(each, ClockJumped)]
    assert [(each.clock, each.seconds) for each in jumps] == [
        ("wall", pytest.approx(10.0)),
        ("wall", pytest.approx(-6.0)),
    ]
    assert kinds(events) == ["GoalChanged", *["ClockJumped", "GoalChanged"] * 2, "GoalChanged"]
    assert [each.at.number for each in events] == [1, 2, 3, 4, 5, 6]


def test_a_wall_clock_that_is_only_adjusted_has_not_jumped(stream: Stream, clock: Clock) -> None:
    reader = stream.reader()
    for _ in range(10):
        clock.move(1.0, wall=1.0 + 0.5 * JUMP)
        goal(stream)
    assert "ClockJumped" not in kinds(reader.take())


def test_a_ros_clock_that_goes_back_has_jumped_and_one_that_is_faster_has_not(
    stream: Stream, clock: Clock
) -> None:
    reader = stream.reader()
    for ros in (10.0, -3.0, 0.0):
        goal(stream)
        clock.move(1.0, ros=ros)
    goal(stream)
    jumps = [each for each in reader.take() if isinstance(each, ClockJumped)]
    assert [(each.clock, each.seconds) for each in jumps] == [("ros", -3.0)]


@pytest.mark.parametrize("seed", range(5))
def test_a_late_reader_is_told_of_the_nodes_that_are_there_in_few_events(
    stream: Stream, seed: int
) -> None:
    chance, early = random.Random(seed), stream.reader()
    root = Node(1, None, "root", "sequence", "")
    stream.add(RunBegan, "ab" * 16, "tree", (root, Node(2, 1, "first", "wait", "")), {}, {}, {})
    truth = State()
    for number in range(3, 6 * CHANGES + seed):
        for event in early.take():
            truth.fold(event)
        if len(leaves := truth.nodes[1].children) > CHANGES:
            stream.add(NodesRemoved, (chance.choice(leaves),))
        index = chance.randrange(len(leaves))
        stream.add(NodesAdded, (Node(number, 1, str(number), "wait", "", index=index),))
    for event in early.take():
        truth.fold(event)
    late = stream.reader().take()
    told = state_of(late)
    assert told.in_order() == truth.in_order()
    assert [told.path(each) for each in told.nodes] == [truth.path(each) for each in truth.nodes]
    assert len(late) <= CHANGES
