"""Why a run waits, or has failed, in lines."""

from __future__ import annotations

import re

import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as Move

from bt_actions import MoveRobot, Retry, Timeouts, load_tree
from bt_actions.behaviours.decorators import Deadline
from bt_actions.behaviours.leaves import Wait
from bt_actions.events import Event, StopWanted
from bt_actions.events.bare import bare
from bt_actions.goals.policy import End, Outcome
from bt_actions.story.doing import doing
from bt_actions.story.state import State
from bt_actions.story.why import why, why_text
from bt_actions.story.words import verdict_on
from bt_actions.testing import Script, ScriptedServer, Simulation, VirtualNetwork, VirtualRunner
from tests.support.stories import state_of
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.trees import together


@pytest.fixture
def leaf() -> FakeNode:
    return FakeAction("Move", place="trees/x.yaml:14:9")


@pytest.fixture
def story(leaf: FakeNode) -> Story:
    return Story(FakeNode("Deliver", [leaf]))


def lines(state: State) -> list[str]:
    """Why it failed, without times of the day."""
    return [line.partition("  ")[2] if line[2:3] == ":" else line for line in why(state)]


def test_a_failure_names_path_attempts_outcome_reason_and_place(
    leaf: FakeNode, story: Story
) -> None:
    first, second, failed = story.fail(leaf, "a fault")
    again = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": "another"}
    state = story.told(
        first,
        second,
        story.goal(leaf, "DONE", attempt=2, **again),
        failed,
        story.node(story.root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    said = lines(state)
    assert said[0] == "Deliver / Move"
    assert any("attempt 1" in line and "ABORTED: a fault" in line for line in said), said
    assert any("attempt 2" in line and "ABORTED: another" in line for line in said), said
    assert any("trees/x.yaml:14:9" in line for line in said), said


def test_a_failure_tells_the_attempts_of_its_last_visit(leaf: FakeNode, story: Story) -> None:
    state = story.told(
        *story.succeed(leaf, 1),
        *story.fail(leaf, "an older fault", 2),
        *story.fail(leaf, "a fault", 3),
        story.node(story.root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    said = "\n".join(lines(state)[:3])
    assert "ABORTED: a fault" in said
    assert "older" not in said
    assert "attempt" not in said


def test_a_tree_that_succeeded_has_nothing_to_say(leaf: FakeNode, story: Story) -> None:
    assert why(story.told(*story.succeed(leaf), story.finish(Status.SUCCESS))) == []


def test_a_night_of_forty_nodes_is_answered_in_a_few_lines() -> None:
    """docs/events.md shows it: why did it end, with which goal; what failed before, who went on."""
    network = VirtualNetwork()
    Simulation(network, faults=["move_robot:12:abort"])
    runner = VirtualRunner(load_tree("examples/night/night.yaml"), network)
    assert runner.run() is Status.FAILURE
    assert len(runner.state.nodes) == 40
    said = why(runner.state)
    assert len(said) <= 12
    assert re.match(
        r"\d\d:\d\d:\d\d  Shift / Go home / Straight home / Home in time / Home$", said[0]
    )
    assert said[1].startswith(
        "  ABORTED: aborted by /move_robot; goal {distance: 0.0}; its result is"
    )
    assert re.search(r"night/night.yaml:\d+:\d+; passed on by Home in time \(timeout\), ", said[2])
    assert said[3] == "failed before, and dealt with:"
    second = said[4]
    for part in (
        "Grasp, item 2 of 3 of Each station (3.0), failed after 3 attempts: UNEXPECTED_RESULT",
        "result.stalled is false; expected result.stalled",
        "goal {position: 0.0",
        "result {position: 0.0",
        "Hold the part (fallback) went on",
    ):
        assert part in second, said


def test_while_it_runs_each_leaf_says_what_it_waits_for_and_until_when() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "left", Script(duration=9.0))
    leaves = [
        MoveRobot(name, 1.0, action_name=name, timeout=Timeouts(server=5.0, result=8.0))
        for name in ("left", "right")
    ]
    runner = VirtualRunner(together(*leaves), network)
    runner.start()
    runner.advance(1.9)
    feedback = "current_pose 0.00, status READY"
    assert why(runner.state, runner.now) == [
        f"left: executing on /left for 1.9 s, 6.1 s left (timeout.result): {feedback}",
        "right: waiting for the server /right for 1.9 s, 3.1 s left (timeout.server)",
    ]


def test_a_leaf_tells_the_time_that_ends_first_its_own_or_that_of_a_node_that_holds_it() -> None:
    inner = Deadline("Not yet", Wait("Rest", lambda: 5.0), lambda: 9.0)
    runner = VirtualRunner(Deadline("Home in time", inner, lambda: 4.0))
    runner.start()
    runner.advance(1.5)
    told = ["Rest: running for 1.5 s, 2.5 s left (Home in time)"]
    assert why(runner.state, runner.now) == told


def test_what_runs_in_a_loop_tells_its_item() -> None:
    rest = FakeNode("Rest", kind="wait")
    each = FakeNode("Each station", [rest], "for_each")
    story = Story(each)
    begins = [story.round(each, 1, 3.0, of=3), story.node(rest, Status.RUNNING)]
    state = story.told(*begins, story.node(each, Status.RUNNING))
    told = "Rest, item 2 of 3 of Each station (3.0): running for 2.5 s"
    assert why(state, story.time + 2.0) == [told]


def stopping(story: Story) -> StopWanted:
    return StopWanted(story._next(), "SIGINT", "interrupted by SIGINT")


def test_what_a_stop_ended_has_not_failed_and_tells_how_long_it_ran() -> None:
    leaf = FakeNode("Forever", kind="Running", place="x.yaml:3:3")
    story = Story(FakeNode("Both", [leaf]))
    runs = [story.node(each, Status.RUNNING, "running") for each in (leaf, story.root)]
    story.time += 2.0
    events = [*runs, stopping(story)]
    events += [story.node(each, Status.INVALID) for each in (leaf, story.root)]
    said = lines(story.told(*events, story.finish(Status.INVALID)))
    assert said == [
        "stopped while it ran:",
        "Both / Forever",
        "  running for 3.0 s: running",
        "  x.yaml:3:3",
    ]


@pytest.mark.parametrize("is_told", ["before", "after"])
def test_a_leaf_in_whose_tick_a_stop_found_the_run_says_so_whenever_that_was_told(
    is_told: str,
) -> None:
    grasp = FakeNode("Grasp", kind="python", place="x.yaml:3:3")
    story = Story(FakeNode("Work", [FakeNode("Inner", [grasp])]))
    events: list[Event] = [story.node(story.root, Status.RUNNING)]
    makers = [lambda: story.lasts(grasp, 1.0), lambda: stopping(story)]
    events += [make() for make in (makers if is_told == "before" else reversed(makers))]
    events.append(story.lasts(grasp, 4.0, is_over=True))
    events += [story.node(grasp, Status.SUCCESS), story.node(story.root, Status.INVALID)]
    said = lines(story.told(*events, story.finish(Status.INVALID)))
    assert said[1:] == ["Work / Inner / Grasp", "  in its tick for 4.0 s", "  x.yaml:3:3"]


def test_between_two_attempts_a_leaf_tells_when_the_next_begins_and_why() -> None:
    network = VirtualNetwork()
    refusals = iter(["no"])
    ScriptedServer(network, Move, "move", Script(9.0, refuse=lambda goal: next(refusals, None)))
    leaf = MoveRobot("Go", 1.0, action_name="move", retry=Retry(3, backoff=2.0, jitter=0.0))
    runner = VirtualRunner(leaf, network)
    runner.start()
    runner.advance(0.5)
    assert re.fullmatch(
        r"Go: trying again in 1.\d s, attempt 2 of 3: REJECTED: .*", *why(runner.state, runner.now)
    )
    runner.advance(2.5)
    assert "executing on /move for" in (said := why(runner.state, runner.now)[0])
    assert ", attempt 2 of 3" in said


def test_who_ticks_reads_the_same_words_on_the_leaf() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move", Script(duration=9.0))
    runner = VirtualRunner(leaf := MoveRobot("Go", 1.0, action_name="move"), network)
    runner.start()
    runner.advance(1.0)
    told = "executing on /move: current_pose 0.00, status READY"
    assert (leaf.feedback_message, str(doing(runner.state, runner.state.nodes[1]))) == (told, told)


def test_a_run_below_is_told_by_the_story_that_its_server_gives(
    leaf: FakeNode, story: Story
) -> None:
    grasp = FakeAction("Grasp", place="trees/x.yaml:20:9")
    failing = FakeNode("Deliver", [leaf, grasp], "fallback")
    below = Story(failing)
    run = FakeAction("Run it", "/r1/run_tree", "fleet.yaml:4:7")
    run.action = "RunTree"
    above = Story(FakeNode("Fleet", [run]))
    state = below.told(
        *below.fail(leaf, "a fault"),
        *below.fail(grasp, "another"),
        below.node(failing, Status.FAILURE),
        below.finish(Status.FAILURE),
    )
    aborted = {"outcome": Outcome.ABORTED, "end": End.ABORTED}
    said = why_text(state)
    outer = above.told(
        above.goal(run, "EXECUTING"),
        above.goal(
            run, "DONE", **aborted, result={"error_msg": said, "recording": "r1:/runs/a.mcap"}
        ),
        above.node(run, Status.FAILURE),
        above.node(above.root, Status.FAILURE),
        above.finish(Status.FAILURE),
    )
    first, *more = said.splitlines()
    assert why(outer)[1:] == [
        "  ABORTED: the run at /r1/run_tree has failed:",
        *(f"    {line}" for line in (first, *more)),
        "    recorded in r1:/runs/a.mcap",
        "  fleet.yaml:4:7; passed on by Fleet (sequence)",
    ]
    cause = why_text(outer).splitlines()[0]
    assert cause.endswith(f"  Fleet / Run it: ABORTED: the run at /r1/run_tree has failed: {first}")
    assert first.endswith("  Deliver / Move: ABORTED: a fault")


def test_of_more_attempts_than_are_told_each_says_how_many_there_were(
    leaf: FakeNode, story: Story
) -> None:
    events = [story.goal(leaf, "EXECUTING")]
    for number in range(1, 6):
        done = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": f"fault {number}"}
        events.append(story.goal(leaf, "DONE", attempt=number, **done))
    events += [story.node(leaf, Status.FAILURE), story.node(story.root, Status.FAILURE)]
    state = story.told(*events, story.finish(Status.FAILURE))
    assert lines(state)[1:4] == [
        f"  attempt {number} of 5: ABORTED: fault {number}" for number in (3, 4, 5)
    ]


def test_a_failure_of_a_node_that_was_taken_out_since_is_told_by_its_name() -> None:
    check, other = FakeNode("Check", kind="check"), FakeNode("Other", kind="check")
    hold, last = FakeNode("Hold", [check, other], "fallback"), FakeNode("Last", kind="check")
    story = Story(FakeNode("Deliver", [hold, last]))
    state = story.told(
        story.node(check, Status.FAILURE, "no"),
        story.node(other, Status.SUCCESS),
        story.node(hold, Status.SUCCESS),
        story.remove(check),
        story.node(last, Status.FAILURE),
        story.node(story.root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    assert lines(state)[-1].endswith("  Check, failed: no; Hold (fallback) went on")


def test_a_cause_that_was_taken_out_since_is_told_with_what_passed_it_on() -> None:
    check = FakeNode("Check", kind="check", place="x.yaml:3:5")
    inner = FakeNode("Inner", [check, FakeNode("Other", kind="check")])
    last = FakeNode("Last", kind="check")
    story = Story(FakeNode("Deliver", [inner, last], "fallback"))
    state = story.told(
        story.node(check, Status.FAILURE, "no"),
        story.node(inner, Status.FAILURE),
        story.remove(check),
        story.node(last, Status.FAILURE),
        story.node(story.root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    assert lines(state)[:3] == [
        "Deliver / Inner / Check",
        "  failed: no",
        "  x.yaml:3:5; passed on by Inner (sequence), Deliver (fallback)",
    ]


def test_of_two_leaves_of_one_name_that_were_stopped_the_path_tells_which() -> None:
    leaves = [FakeNode("Wait", kind="wait") for _ in "ab"]
    sides = [FakeNode(name, [leaf]) for name, leaf in zip(("Left", "Right"), leaves, strict=True)]
    root = FakeNode("In time", [FakeNode("Both", sides, "parallel")], "timeout")
    story = Story(root)
    state = story.told(
        *(story.node(each, Status.RUNNING) for each in (*leaves, *sides, root)),
        *(story.node(each, Status.INVALID) for each in leaves),
        story.node(root, Status.FAILURE, "its time is over", by_itself=True),
        story.finish(Status.FAILURE),
    )
    stopped = [line for line in lines(state) if "it stopped" in line]
    assert sorted(stopped) == ["  it stopped Left / Wait", "  it stopped Right / Wait"]


def test_of_many_leaves_that_a_node_has_stopped_the_rest_is_counted() -> None:
    leaves = [FakeNode(f"Wait {number}", kind="wait") for number in range(30)]
    root = FakeNode("In time", [FakeNode("All", leaves, "parallel")], "timeout", place="x.yaml:3:5")
    story = Story(root)
    state = story.told(
        *(story.node(each, Status.RUNNING) for each in (*leaves, root)),
        *(story.node(each, Status.INVALID) for each in leaves),
        story.node(root, Status.FAILURE, "its time is over", by_itself=True),
        story.finish(Status.FAILURE),
    )
    assert lines(state) == [
        "In time",
        "  failed: its time is over",
        "  it stopped Wait 29",
        "  it stopped Wait 28",
        "  and 28 more",
        "  x.yaml:3:5",
    ]


@pytest.mark.parametrize("dealt", [0, 1, 2])
@pytest.mark.parametrize("causes", range(1, 7))
@pytest.mark.parametrize("lost", [0, 5])
def test_a_failure_has_at_most_twelve_lines_and_counts_each_cause(
    causes: int, lost: int, dealt: int
) -> None:
    before = [FakeNode(f"Before {number}") for number in range(dealt)]
    tried = [FakeNode(f"Tried {number}", [leaf], "fallback") for number, leaf in enumerate(before)]
    leaves = [FakeNode(f"Check {number}") for number in range(causes)]
    either = FakeNode("Either", leaves, "fallback")
    story = Story(FakeNode("Main", [*tried, either]))
    events: list[Event] = []
    for leaf, holder in zip(before, tried, strict=True):
        events += [story.node(leaf, Status.FAILURE, "no"), story.node(holder, Status.SUCCESS)]
    events += [story.node(each, Status.FAILURE, "no") for each in (*leaves, either, story.root)]
    state = story.told(*events, story.finish(Status.FAILURE))
    state.lost = lost
    said = lines(state)
    assert len(said) <= 12, said
    assert any("lost" in line for line in said) is bool(lost)
    assert sum("went on" in line for line in said) == dealt
    told = sum(line.startswith("Main / Either / Check") for line in said)
    rest = sum(int(line.split()[1]) for line in said if line.startswith("and "))
    assert told + rest == causes
    # one more cause has three lines instead of "and 1 more", or beside "and 2 more"
    assert not rest or len(said) + (2 if rest == 1 else 3) > 12


def test_a_long_cause_comes_before_failures_that_were_dealt_with() -> None:
    before = [FakeNode(f"Before {number}") for number in range(2)]
    tried = [FakeNode(f"Tried {each.name}", [each], "fallback") for each in before]
    run = FakeAction("Run it", "/r1/run_tree")
    run.action = "RunTree"
    other = FakeNode("Other")
    story = Story(FakeNode("Main", [*tried, FakeNode("Either", [run, other], "fallback")]))
    either = story.root.children[-1]
    events: list[Event] = []
    for leaf, holder in zip(before, tried, strict=True):
        events += [story.node(leaf, Status.FAILURE, "no"), story.node(holder, Status.SUCCESS)]
    aborted = {"outcome": Outcome.ABORTED, "end": End.ABORTED}
    below = {"error_msg": "\n".join(f"line {number}" for number in range(9)), "recording": "r1:/a"}
    events += [story.goal(run, "EXECUTING"), story.goal(run, "DONE", **aborted, result=below)]
    events += [story.node(each, Status.FAILURE) for each in (run, other, either, story.root)]
    state = story.told(*events, story.finish(Status.FAILURE))
    state.lost = 5
    said = lines(state)
    assert (len(said), said[0]) == (11, "Main / Either / Run it"), said
    assert not any("dealt with" in line for line in said)
    assert any(line.startswith("5 events were lost") for line in said)


def test_what_a_behaviour_raised_tells_where_in_which_item_and_what() -> None:
    camera = FakeNode("Camera", kind="python", place="x.yaml:5:3")
    each = FakeNode("Each", [camera], "for_each")
    story = Story(FakeNode("Main", [each]))
    error = "Main / Each / Camera: tick raised ValueError: no camera 3 (leaf.py:12)"
    begins = story.round(each, 1, 3.0, of=3)
    state = story.told(begins, story.finish(Status.INVALID, error=error, culprit=camera.id))
    assert lines(state) == [
        "Main / Each / Camera, item 2 of 3 of Each (3.0)",
        "  tick raised ValueError: no camera 3 (leaf.py:12)",
        "  x.yaml:5:3",
    ]
    assert verdict_on(state).startswith("FAILURE after ")
    told = [bare(event) for event in (story.began, begins, state.finished) if event is not None]
    assert lines(state_of(event for event in told if event is not None))[1:] == [
        "  tick raised ValueError",
        "  x.yaml:5:3",
    ]


def test_a_run_that_somebody_stopped_is_stopped_whatever_its_leaves_raise_then(
    story: Story,
) -> None:
    state = story.told(stopping(story), story.finish(Status.INVALID, error="Deliver: raised"))
    assert verdict_on(state).startswith("STOPPED after ")


def test_what_a_behaviour_raised_is_all_of_the_first_line(story: Story, leaf: FakeNode) -> None:
    story.root.kind = "fallback"
    other = FakeNode("Other", kind="check")
    told = story.add(other, story.root)
    state = story.told(
        told,
        *story.fail(leaf, "a fault"),
        story.node(other, Status.SUCCESS),
        story.node(story.root, Status.SUCCESS),
        story.finish(Status.INVALID, error="Deliver/Other: tick raised OSError (x.py:3)"),
    )
    first, second, *_ = why_text(state).splitlines()
    assert first.endswith("  Deliver/Other: tick raised OSError (x.py:3)")
    assert second == "failed before, and dealt with:"
