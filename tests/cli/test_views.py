"""Lines, JSON and the live drawing, from scripted events; a terminal emulator is the judge."""

from __future__ import annotations

import io
import json
import math
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyte
import pytest
from py_trees.common import Status
from rich.console import Console
from robot_control_interfaces.action import MoveRobot as Move

from bt_actions import MoveRobot, Retry
from bt_actions.behaviours.decorators import Deadline
from bt_actions.behaviours.leaves import Wait
from bt_actions.cli.driving.feed import Feed
from bt_actions.cli.streams.writing import terminal
from bt_actions.cli.views.choosing import choose
from bt_actions.cli.views.json_lines import JsonView
from bt_actions.cli.views.lines import LASTING, LineView
from bt_actions.cli.views.live import SCROLLS, LiveView
from bt_actions.cli.views.view import View
from bt_actions.document import load_tree
from bt_actions.events import AttemptEnded, Event, RunEnded, StopWanted
from bt_actions.events.snapshot import snapshot
from bt_actions.goals.policy import End, Outcome
from bt_actions.story.state import State
from bt_actions.story.why import why
from bt_actions.story.words import last_words
from bt_actions.testing import ScriptedServer, VirtualNetwork, VirtualRunner
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.trees import in_sequence, together


@pytest.fixture
def leaves() -> list[FakeNode]:
    return [FakeAction(f"Step {number}") for number in range(10)]


@pytest.fixture
def root(leaves: list[FakeNode]) -> FakeNode:
    """A fallback over a sequence of ten actions, and another leaf."""
    work = FakeNode("Work", list(leaves))
    return FakeNode("Deliver", [work, FakeNode("Recover", kind="success")], "fallback")


@pytest.fixture
def story(root: FakeNode) -> Story:
    return Story(root)


def feed(state: State, view: View, *events: Event) -> None:
    feeding = Feed(state, view)
    for event in events:
        feeding.event(event)


def finish(state: State, view: View, exit_code: int = 0, **more: Any) -> None:
    """End the run, as whoever drives it does."""
    assert state.now is not None
    feed(state, view, RunEnded(state.now, exit_code, **more))
    view.finish()


# Lines


class Lines:
    """A LineView, and what it wrote."""

    def __init__(self, *events: Event, verbose: bool = False) -> None:
        self.state, self.out = State(), io.StringIO()
        self.view = LineView(self.state, self.out, verbose=verbose)
        self.feeding = Feed(self.state, self.view)
        self.feed(*events)

    def feed(self, *events: Event) -> None:
        for event in events:
            self.feeding.event(event)

    @property
    def said(self) -> list[str]:
        """The lines so far, without their times."""
        return [line[12:] for line in self.out.getvalue().splitlines()]


def test_a_line_for_each_change_of_a_node_one_for_a_goal_under_way_and_one_for_its_failure(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    lines = Lines(story.began, story.node(root, Status.RUNNING), *story.succeed(leaves[0]))
    lines.feed(story.node(leaves[1], Status.RUNNING))
    for state in ("QUEUED", "WAITING_FOR_SERVER", "SENDING", "EXECUTING"):
        lines.feed(story.goal(leaves[1], state))
    aborted = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": "a fault"}
    lines.feed(
        story.goal(leaves[1], "DONE", **aborted),
        story.verdict(leaves[1], Outcome.ABORTED, "a fault; its result is: {}"),
        story.node(leaves[1], Status.FAILURE, "ABORTED: a fault; its result is: {}"),
    )
    assert lines.out.getvalue().splitlines() == [
        "    0.50 s  RUNNING  Deliver",
        "    2.00 s  goal     Deliver / Work / Step 0: executing on move_robot",
        "    3.00 s  SUCCESS  Deliver / Work / Step 0",
        "    5.50 s  goal     Deliver / Work / Step 1: executing on move_robot",
        "    6.50 s  goal     Deliver / Work / Step 1: ABORTED: a fault; its result is: {}",
        "    7.00 s  FAILURE  Deliver / Work / Step 1: ABORTED",
    ]


def test_each_attempt_that_fails_says_once_what_came_when_it_came() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robot")
    given = {"expect": "result.final_pose > 9.0", "retry": Retry(2, backoff=0.5)}
    runner = VirtualRunner(together(MoveRobot("Move", 1.0, **given)), network)
    assert runner.run() is Status.FAILURE
    told = "goal     together / Move: "
    first, verdict, second, last, *more = [
        line for line in Lines(*runner.events).said if "Move: " in line
    ]
    unmet = "UNEXPECTED_RESULT: result.final_pose is 0.0; expected result.final_pose > 9.0"
    assert first == f"{told}executing on /move_robot"
    assert verdict.startswith(f"{told}attempt 1 of 2: {unmet}; goal {{distance: 1.0}}; result {{")
    assert re.search(r"; again in 0.\d s$", verdict)
    assert second == f"{told}executing on /move_robot, attempt 2 of 2"
    assert last.startswith(f"{told}attempt 2 of 2: {unmet}; goal {{distance: 1.0}}; result {{")
    assert more == ["FAILURE  together / Move: UNEXPECTED_RESULT (attempt 2 of 2)"]


def test_a_goal_whose_end_comes_after_its_outcome_has_a_line_at_its_end(
    leaves: list[FakeNode], story: Story
) -> None:
    story.step = LASTING / 10
    late = {"outcome": Outcome.RESULT_TIMEOUT, "reason": "not finished within 5 s"}
    lines = Lines(
        story.began,
        story.node(leaves[0], Status.RUNNING),
        story.goal(leaves[0], "CANCELING", end=End.UNKNOWN, **late),
        story.verdict(leaves[0], Outcome.RESULT_TIMEOUT, "not finished within 5 s"),
        story.goal(leaves[0], "DONE", end=End.CANCELED, **late),
    )
    told = "goal     Deliver / Work / Step 0: "
    reason = "RESULT_TIMEOUT, end not known: not finished within 5 s"
    assert lines.said == [f"{told}{reason}", f"{told}ended CANCELED"]


def test_a_node_that_takes_over_the_words_of_its_child_does_not_say_them_again(
    leaves: list[FakeNode], story: Story
) -> None:
    recover = story.root.children[1]
    failures = [story.node(each, Status.FAILURE, "no way") for each in (recover, story.root)]
    assert Lines(story.began, *failures).said == [
        "FAILURE  Deliver / Recover: no way",
        "FAILURE  Deliver",
    ]


def test_a_check_that_succeeds_again_and_again_has_one_line_in_each_round_of_a_loop() -> None:
    check = FakeNode("Check", kind="check")
    loop = FakeNode("Again", [check], "repeat")
    story, succeeds = Story(loop), Status.SUCCESS
    lines = Lines(story.began, story.node(check, succeeds), story.node(check, succeeds))
    assert lines.said == ["SUCCESS  Again / Check"]
    lines.feed(story.round(loop, 1), story.node(check, succeeds), story.node(check, succeeds))
    assert lines.said[1:] == ["round    Again: round 2", "SUCCESS  Again / Check"]
    lines.feed(story.node(check, Status.FAILURE, "no"), story.node(check, Status.FAILURE, "no"))
    assert lines.said[3:] == ["FAILURE  Again / Check: no"]


def test_a_loop_tells_its_item_in_a_line_at_each_round_and_beside_its_name_while_it_runs() -> None:
    step = FakeNode("Step", kind="check")
    loop = FakeNode("Each station", [step], "for_each")
    story, state, screen = Story(FakeNode("Shift", [loop])), State(), Screen(24)
    begins = [story.round(loop, 0, 4.5, of=2), story.node(step, Status.SUCCESS)]
    events = [story.began, *begins, story.node(loop, Status.RUNNING), story.round(loop, 1, 3.0, 2)]
    assert Lines(*events).said == [
        "round    Shift / Each station: item 1 of 2 (4.5)",
        "SUCCESS  Shift / Each station / Step",
        "RUNNING  Shift / Each station",
        "round    Shift / Each station: item 2 of 2 (3.0)",
    ]
    view = LiveView(state, screen.console)
    feed(state, view, *events)
    view.frame(story.time)
    assert "  ▶ Each station  item 2 of 2 (3.0)" in screen.lines()
    view.close()


def test_what_a_round_or_a_visit_has_not_begun_yet_shows_nothing_of_the_one_before() -> None:
    pair = [FakeNode(name, kind="check") for name in ("First", "Second")]
    both, last = FakeNode("Both", list(pair)), FakeNode("Last", kind="check")
    loop = FakeNode("Again", [both], "repeat")
    story = Story(FakeNode("Work", [loop, last]))
    ends = [*pair, both, last]

    def drawn(*events: Event) -> tuple[list[str], list[str]]:
        """The tree as it is drawn, and the progress."""
        state, screen = State(), Screen(40)
        view = LiveView(state, screen.console)
        feed(state, view, story.began, *events)
        view.frame(story.time)
        live = [line.strip() for line in screen.lines() if not line.startswith(("✓", "▶ W"))]
        view.close()
        return live[1:], re.findall(r"\d+ of \d+ leaves", live[0])

    def done(*nodes: FakeNode) -> list[Event]:
        return [story.node(each, Status.SUCCESS) for each in nodes]

    first = [story.node(loop, Status.RUNNING), story.round(loop, 0), *done(*ends)]
    assert drawn(*first)[1] == ["3 of 3 leaves"]
    tree, count = drawn(*first, story.round(loop, 1))
    assert (tree[2:], count) == (["· Both", "· First", "· Second", "✓ Last"], ["1 of 3 leaves"])
    for anew in (story.round(loop, 1), story.node(pair[0], Status.RUNNING)):
        again = [*first, anew, *done(pair[0]), story.node(both, Status.RUNNING)]
        tree, count = drawn(*again)
        assert [line.partition("  ")[0] for line in tree] == [
            "· Work",
            "▶ Again",
            "▶ Both",
            "✓ First",
            "· Second",
            "✓ Last",
        ]
        assert count == ["2 of 3 leaves"]


def test_a_round_of_one_loop_tells_nothing_anew_of_what_is_outside_of_it() -> None:
    loop = FakeNode("Again", [FakeNode("Inner", kind="check")], "repeat")
    other = FakeNode("Other", kind="check")
    story = Story(FakeNode("Both", [loop, other], "parallel"))
    screen, drawn, succeeds = Screen(24), State(), Status.SUCCESS
    view = LiveView(drawn, screen.console)
    events: list[Event] = [story.began]
    for number in range(3):
        events.append(story.round(loop, number))
        events += [story.node(node, succeeds) for node in (loop.children[0], other)]
    assert Lines(*events).said.count("SUCCESS  Both / Other") == 1
    feed(drawn, view, *events)
    view.close()
    assert screen.lines() == ["✓ Inner", "✓ Other", "✓ Inner", "✓ Inner"]


def test_a_leaf_that_was_stopped_is_told_of_anew(leaves: list[FakeNode], story: Story) -> None:
    recover = story.root.children[1]
    lines = Lines(story.began)
    for status in (Status.RUNNING, Status.INVALID, Status.RUNNING):
        lines.feed(story.node(recover, status))
    assert lines.said == ["RUNNING  Deliver / Recover"] * 2


HOSTILE = "done\n    9.99 s  SUCCESS  Deliver\x1b[2J\x9b1A"
TAMED = "done     9.99 s  SUCCESS  Deliver [2J 1A"
"""What a tree may log, and what of it is shown."""


def test_what_a_tree_says_forges_no_line_and_gives_the_terminal_no_commands(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    recover = root.children[1]
    failed = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": HOSTILE}
    news = [
        story.began,
        story.goal(leaves[0], "DONE", **failed),
        story.node(leaves[0], Status.FAILURE, HOSTILE),
        story.node(recover, Status.FAILURE, HOSTILE),
        story.node(root, Status.FAILURE),
        story.finish(Status.FAILURE),
    ]
    lines = Lines(*news)
    finish(lines.state, lines.view, 1)
    written = lines.out.getvalue()
    assert f"Deliver / Recover: {TAMED}\n" in written
    assert f"  failed: {TAMED}\n" in written
    assert "\x1b" not in written
    assert "\x9b" not in written
    assert not any(line.startswith("    9.99 s") for line in written.splitlines())

    screen = Screen(24)
    state = State()
    view = LiveView(state, screen.console)
    feed(state, view, *news)
    finish(state, view, 1)
    assert f"✗ Recover  {TAMED}" in screen.lines()


def test_an_output_is_one_line_whatever_it_holds(story: Story) -> None:
    state = story.told(story.finish(Status.SUCCESS, outputs={"x": HOSTILE}))
    assert f"x: {TAMED}" in last_words(state)


def test_what_one_tick_ended_comes_before_what_it_began() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robot")
    runner = VirtualRunner(in_sequence(*(MoveRobot(name, 1.0) for name in "ab")), network)
    assert runner.run() is Status.SUCCESS
    assert Lines(*runner.events, verbose=True).said == [
        "goal     sequence / a: waiting for the server /move_robot",
        "goal     sequence / a: sending a goal to /move_robot",
        "RUNNING  sequence",
        "goal     sequence / a: executing on /move_robot",
        "SUCCESS  sequence / a",
        "goal     sequence / b: waiting for the server /move_robot",
        "goal     sequence / b: sending a goal to /move_robot",
        "goal     sequence / b: executing on /move_robot",
        "SUCCESS  sequence / b",
        "SUCCESS  sequence",
    ]


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ("QUEUED", "waiting for its turn on"),
        ("WAITING_FOR_SERVER", "waiting for the server"),
        ("SENDING", "sending a goal to"),
    ],
)
def test_a_goal_that_waits_gets_a_line_when_it_waits_for_a_second(
    state: str, words: str, leaves: list[FakeNode], story: Story
) -> None:
    lines = Lines(story.began, story.node(leaves[0], Status.RUNNING), story.goal(leaves[0], state))
    for waited in (0.5, 0.9, LASTING, 5.0):
        lines.feeding.frame(story.time + waited)
        assert len(lines.said) == (waited >= LASTING)
    assert lines.out.getvalue().splitlines() == [
        f"    2.00 s  goal     Deliver / Work / Step 0: {words} move_robot for 1.0 s"
    ], "the time at which it had lasted, whenever that was drawn"


def test_what_lasted_has_its_line_before_the_event_that_ends_it_also_where_nothing_is_drawn(
    leaves: list[FakeNode], story: Story
) -> None:
    """As where stored events are shown: the same lines."""
    events = [story.began, story.goal(leaves[0], "QUEUED")]
    story.time += 5.0
    events.append(story.goal(leaves[0], "WAITING_FOR_SERVER"))
    story.time += 0.1
    events += [story.goal(leaves[0], "EXECUTING"), story.node(leaves[0], Status.RUNNING)]
    drawn, stored = Lines(*events[:2]), Lines(*events)
    for tenth in range(1, 50):
        drawn.feeding.frame(events[1].at.steady + tenth / 10)
    drawn.feed(*events[2:])
    assert drawn.out.getvalue() == stored.out.getvalue()
    goal = "goal     Deliver / Work / Step 0:"
    assert stored.out.getvalue().splitlines() == [
        f"    1.50 s  {goal} waiting for its turn on move_robot for 1.0 s",
        f"    6.60 s  {goal} executing on move_robot",
    ]


def test_a_goal_that_waits_on_a_node_that_was_taken_out_has_no_line(
    leaves: list[FakeNode], story: Story
) -> None:
    lines = Lines(story.began, story.goal(leaves[0], "QUEUED"), story.remove(leaves[0]))
    lines.feeding.frame(story.time + LASTING)
    assert lines.said == []


def test_a_wish_to_stop_is_told_with_what_is_canceled(leaves: list[FakeNode], story: Story) -> None:
    lines = Lines(story.began, story.goal(leaves[0], "EXECUTING"))
    lines.feed(StopWanted(story._next(), "SIGINT", "interrupted by SIGINT"))
    assert lines.out.getvalue().splitlines()[-1] == (
        "interrupted by SIGINT: canceling 1 goal; Ctrl-C again leaves without waiting"
    )


def test_the_last_line_is_what_went_wrong(leaves: list[FakeNode], story: Story) -> None:
    lines = Lines(story.began, *story.succeed(leaves[0]), story.finish(Status.SUCCESS))
    finish(lines.state, lines.view, 1, world="It lies there.", complaint="It should lie here.")
    assert lines.out.getvalue().splitlines()[-7:] == [
        "Step 0  move_robot         1  SUCCEEDED    1.00 s",
        "",
        "It lies there.",
        "",
        "SUCCESS after 3.00 s, but not as it should be",
        "",
        "It should lie here.",
    ]


# JSON


def objects_of(
    story: Story, *events: Event, status: Status = Status.SUCCESS, note: str = "", **more: Any
) -> list[dict[str, Any]]:
    """What is written of a run that ends with `status` after `events`."""
    return written([story.began, *events, story.finish(status, **more)], note)


def written(events: Iterable[Event], note: str = "") -> list[dict[str, Any]]:
    """What is written of a run that tells `events`."""
    state, out = State(), io.StringIO()
    view = JsonView(state, out)
    feed(state, view, *events)
    if note:
        view.say(note)
    finish(state, view, 0 if state.status is Status.SUCCESS else 1)
    return [json.loads(line) for line in out.getvalue().splitlines()]


def test_json_is_one_object_a_line_and_the_last_one_is_the_result(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    events = story.succeed(leaves[0])
    events[3:3] = [story.feedback(leaves[0], {"pose": 1.0})]
    events[5:5] = [story.verdict(leaves[0], Outcome.SUCCEEDED)]
    lasts = [story.lasts(root, 1.0), story.lasts(root, 2.0, is_over=True)]
    objects = objects_of(story, story.round(root, 0), *lasts, *events, note="a note")
    kinds = [each["event"] for each in objects]
    assert kinds == [
        "started",
        "round",
        "tick",
        "tick",
        "node",
        "goal",
        "goal",
        "feedback",
        "goal",
        "attempt",
        "node",
        "note",
        "finished",
    ]
    last = objects[-1]
    assert (last["status"], last["exit_code"]) == ("SUCCESS", 0)
    action = last["actions"][0]
    assert {key: action[key] for key in ("name", "server", "attempts", "visits", "outcome")} == {
        "name": "Step 0",
        "server": "move_robot",
        "attempts": 1,
        "visits": 1,
        "outcome": "SUCCEEDED",
    }
    text = (Path(__file__).parents[2] / "docs" / "running.md").read_text()
    table = dict(re.findall(r"^\| `(\w+)` \|[^|]*\| (.*) \|$", text, re.MULTILINE))
    documented = {kind: re.findall(r"`(\w+)`", keys) for kind, keys in table.items()}
    assert documented == {each["event"]: list(each)[1:] for each in objects}
    (actions,) = re.findall(r"^- `actions`: [^,]*, with (.*?)\.$", text, re.MULTILINE | re.DOTALL)
    assert re.findall(r"`(\w+)`", actions) == list(action)


def test_json_tells_what_a_goal_was_sent_what_came_of_it_and_when(
    leaves: list[FakeNode], story: Story
) -> None:
    leaf = leaves[0]
    failed = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": "a fault"}
    _, sent, came, done, judged, _ = objects_of(
        story,
        story.goal(leaf, "SENDING", goal={"distance": 2.0}),
        story.feedback(leaf, {"data": b"\x01\x02"}),
        story.goal(leaf, "DONE", **failed, result={"pose": math.nan}),
        story.verdict(leaf, Outcome.ABORTED, "a fault", again_in=0.5),
        status=Status.FAILURE,
    )
    assert (sent["goal"], sent["result"]) == ({"distance": 2.0}, None)
    assert came["feedback"] == {"data": [1, 2]}
    assert (done["goal"], done["result"]) == (None, {"pose": None})
    assert (judged["reason"], judged["again_in"], judged["expect"]) == ("a fault", 0.5, "")
    for each, at in ((sent, 0.5), (came, 1.0), (done, 1.5), (judged, 2.0)):
        assert (each["id"], each["path"]) == (leaf.id, ["Deliver", "Work", "Step 0"])
        assert (each["time"], each["wall"]) == (at, 1e9 + 100.0 + at)


def test_json_tells_of_each_failure_what_it_was_and_who_dealt_with_it(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    work, recover = root.children
    *_, finished = objects_of(
        story,
        story.goal(leaves[0], "SENDING", goal={"distance": 2.0}),
        *story.fail(leaves[0], "a fault"),
        story.node(work, Status.FAILURE),
        story.node(recover, Status.SUCCESS),
        story.node(root, Status.SUCCESS),
    )
    assert finished["failures"] == []
    (failure,) = finished["dealt_with"]
    assert failure == {
        "id": leaves[0].id,
        "path": ["Deliver", "Work", "Step 0"],
        "attempts": 1,
        "outcome": "ABORTED",
        "reason": "a fault",
        "place": None,
        "server": "move_robot",
        "goal": {"distance": 2.0},
        "result": None,
        "items": [],
        "by": root.id,
    }


def test_each_node_has_an_id_of_its_own_in_the_order_of_the_file() -> None:
    duplicates = [FakeAction("Step"), FakeAction("Step"), FakeAction("Step")]
    root = FakeNode("Step", duplicates[:2])
    story = Story(root)
    events: list[Event] = [story.add(duplicates[2], root)]
    for duplicate in reversed(duplicates):
        events += story.fail(duplicate)[1:]
    events.append(story.node(root, Status.FAILURE))
    started, *told, finished = objects_of(story, *events, status=Status.FAILURE)
    assert [(node["id"], node["parent"]) for node in started["nodes"]] == [
        (1, None),
        (2, 1),
        (3, 1),
    ]
    assert [each["id"] for each in told] == [4, 4, 3, 3, 2, 2, 1]
    assert [each["id"] for each in finished["actions"]] == [4, 3, 2]
    assert [each["id"] for each in finished["failures"]] == [2, 3, 4]


def test_json_names_the_tree_as_its_file_does_and_its_nodes(tmp_path: Path) -> None:
    path = tmp_path / "tree.yaml"
    path.write_text(
        "tree: errand\ninputs: {n: {type: int8, default: 2}}\n"
        "root: {invert: Not, child: {wait: 1 s, name: A moment}}\n"
    )
    runner = VirtualRunner(load_tree(path))
    runner.run()
    began = runner.state.began
    assert began is not None
    assert written(runner.events)[0] == {
        "event": "started",
        "tree": "errand",
        "run": began.run_id,
        "wall": began.at.wall,
        "where": {},
        "inputs": {"n": 2},
        "nodes": [
            {"id": 1, "parent": None, "name": "Not", "kind": "invert", "place": f"{path}:3:8"},
            {"id": 2, "parent": 1, "name": "A moment", "kind": "wait", "place": f"{path}:3:29"},
        ],
    }


LARGE = (7,) * 1_000_000


def test_json_has_outputs_whole_however_long_they_are(story: Story) -> None:
    outputs = {"many": LARGE, "text": "x" * 1_000_000}
    *_, finished = objects_of(story, outputs=outputs)
    assert finished["outputs"] == {"many": list(LARGE), "text": "x" * 1_000_000}


def test_numbers_that_json_has_no_word_for_are_null(story: Story) -> None:
    out = io.StringIO()
    view = JsonView(State(), out)
    view._write({"outputs": {"n": math.nan, "all": [1.0, -math.inf]}, "duration": 2.5})
    expected = {"outputs": {"n": None, "all": [1.0, None]}, "duration": 2.5}
    assert json.loads(out.getvalue(), parse_constant=pytest.fail) == expected


# The live drawing


class Screen:
    """A console whose output a terminal emulator shows."""

    def __init__(self, height: int, width: int = 80, encoding: str = "utf-8") -> None:
        self.raw = io.BytesIO()
        file = io.TextIOWrapper(self.raw, encoding=encoding, write_through=True)
        self.console = Console(
            file=file,
            force_terminal=True,
            color_system="standard",
            width=width,
            height=height,
            legacy_windows=False,
            _environ={"TERM": "xterm"},
        )
        self._width, self._height = width, height

    def lines(self) -> list[str]:
        """What stands on the screen, from the top, without empty lines at the end."""
        screen = pyte.HistoryScreen(self._width, self._height, history=10_000)
        stream = pyte.ByteStream(screen)
        stream.feed(self.raw.getvalue().replace(b"\n", b"\r\n"))
        above = ["".join(line[x].data for x in range(self._width)) for line in screen.history.top]
        shown = [line.rstrip() for line in [*above, *screen.display]]
        while shown and not shown[-1]:
            shown.pop()
        return shown


@pytest.mark.parametrize("height", [1, 3, 6, 12, 24, 50])
def test_the_live_part_leaves_lines_for_what_scrolls_by(
    height: int, root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    screen = Screen(height)
    state = State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began, story.node(root, Status.RUNNING))
    feed(state, view, story.node(root.children[0], Status.RUNNING))
    feed(state, view, story.node(leaves[4], Status.RUNNING), story.goal(leaves[4], "EXECUTING"))
    view.frame(story.time)
    drawn = screen.lines()
    assert 1 <= len(drawn) <= max(1, height / 3, height - 1 - SCROLLS)
    if height >= 12:
        assert any("Step 4" in line for line in drawn), "what runs is shown first"
    view.close()


@pytest.mark.parametrize("name", ["\x1b[31mred", "\ud800", "two\nlines"])
def test_a_node_s_name_gives_the_terminal_no_commands(name: str) -> None:
    screen, state, story = Screen(30), State(), Story(FakeNode(name, [FakeNode("Leaf")]))
    view = LiveView(state, screen.console)
    feed(state, view, story.began)
    view.frame(story.time)
    assert b"\x1b[31m" not in screen.raw.getvalue()
    assert len(screen.lines()) == 3
    view.close()


def test_a_node_that_was_taken_out_is_drawn_and_counted_no_more(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    screen, state = Screen(30), State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began, *story.succeed(leaves[3]), story.remove(leaves[3]))
    view.frame(story.time)
    drawn = [line.strip() for line in screen.lines()]
    assert not any(line.endswith("Step 3") for line in drawn)
    assert any(" 0 of 10 leaves" in line for line in drawn), drawn
    view.close()


def test_it_shows_what_an_action_does_its_attempt_its_feedback_and_the_time_left() -> None:
    screen = Screen(60, width=120)
    leaf, feedback = moving("Step 2", attempts=3)
    story, state = Story(FakeNode("Work", [leaf])), State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began, story.node(leaf, Status.RUNNING))
    feed(state, view, story.goal(leaf, "EXECUTING", attempt=2))
    feed(state, view, story.feedback(leaf, feedback, attempt=2))
    view.frame(story.time - story.step + 25.8)
    left = "4.2 s left (timeout.result)"
    doing = f"executing, attempt 2 of 3, {left}: current_pose 1.50, status MOVING"
    assert [line.strip() for line in screen.lines() if "2  ex" in line] == [f"▶ Step 2  {doing}"]
    view.close()


def test_between_two_attempts_it_shows_why_and_when_the_next_begins() -> None:
    screen = Screen(60, width=120)
    leaf, _ = moving("Step", attempts=3)
    story, state = Story(FakeNode("Work", [leaf])), State()
    view = LiveView(state, screen.console)
    failed = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": "a fault"}
    feed(state, view, story.began, story.node(leaf, Status.RUNNING))
    feed(state, view, story.goal(leaf, "DONE", **failed))
    feed(state, view, story.verdict(leaf, Outcome.ABORTED, "a fault", again_in=2.0))
    view.frame(story.time + 0.5)
    doing = "trying again in 1.5 s, attempt 2 of 3: ABORTED: a fault"
    assert [line.strip() for line in screen.lines() if "Step" in line] == [f"▶ Step  {doing}"]
    view.close()


def test_it_counts_down_the_time_of_a_wait_and_of_what_holds_others() -> None:
    screen = Screen(60)
    both = in_sequence(Wait("Rest", lambda: 5.0), name="Both")
    runner, state = VirtualRunner(Deadline("In time", both, lambda: 9.0)), State()
    runner.start()
    runner.advance(0.5)
    view = LiveView(state, screen.console)
    feed(state, view, *runner.events)
    for now, drawn in ((0.5, ["8.5 s", "4.5 s"]), (3.0, ["6.0 s", "2.0 s"])):
        view.frame(now)
        shown = [line for line in screen.lines() if line.endswith(" left")]
        assert [line.rpartition("  ")[2] for line in shown] == [f"{each} left" for each in drawn]
    view.close()


def test_a_tick_that_lasts_is_shown_with_its_node_and_how_long_it_has_lasted() -> None:
    first, grasp = FakeNode("First", kind="check"), FakeNode("Grasp", kind="python")
    root = FakeNode("Work", [first, FakeNode("Inner", [grasp])])
    story, screen, state = Story(root), Screen(60), State()
    events = [
        story.began,
        story.node(first, Status.SUCCESS),
        story.node(root, Status.RUNNING),
        story.lasts(grasp, 1.0),
    ]
    view, lines = LiveView(state, screen.console), Lines(*events)
    feed(state, view, *events)
    view.frame(story.time + 13.0)
    assert "    ▶ Grasp  in its tick for 14 s" in screen.lines()
    assert why(state, story.time + 13.0) == ["Grasp: in its tick for 14 s"]
    lines.feed(story.lasts(grasp, 15.5, is_over=True))
    assert lines.said[-2:] == [
        "tick     Work / Inner / Grasp: in its tick for 1.0 s",
        "tick     Work / Inner / Grasp: its tick has taken 15.5 s",
    ]
    state.fold(story.lasts(grasp, 15.5, is_over=True))
    assert why(state, story.time) == ["Work: running for 1.5 s"]
    view.close()


def test_who_stops_a_run_reads_whose_tick_has_to_return_first() -> None:
    grasp = FakeNode("Grasp", kind="python")
    story = Story(FakeNode("Work", [grasp]))
    lines = Lines(story.began, story.lasts(grasp, 1.0))
    lines.feed(StopWanted(story._next(), "SIGINT", "interrupted by SIGINT"))
    said = "interrupted by SIGINT: waiting for the tick of Grasp to return; Ctrl-C again leaves"
    assert said in lines.out.getvalue()


def moving(name: str, *, attempts: int = 1) -> tuple[FakeNode, Any]:
    """A leaf that may execute for 30 s, and feedback for it."""
    from robot_control_interfaces.action import MoveRobot

    feedback = MoveRobot.Feedback(current_pose=1.5, status=MoveRobot.Feedback.STATUS_MOVING)
    constants: Any = {"feedback": {"status": {str(feedback.status): "MOVING"}}}
    leaf = FakeAction(
        name, attempts=attempts, timeouts={"result": 30.0, "feedback": None}, constants=constants
    )
    return leaf, snapshot(feedback)


def test_finished_work_scrolls_by_once_and_the_drawing_is_gone_at_the_end(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    screen = Screen(24)
    state = State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began, story.node(root, Status.RUNNING))
    for leaf in leaves:
        for event in story.succeed(leaf):
            feed(state, view, event)
            view.frame(story.time)
    feed(state, view, story.node(root, Status.SUCCESS), story.finish(Status.SUCCESS))
    finish(state, view)
    lines = screen.lines()
    for leaf in leaves:
        assert lines.count(f"✓ {leaf.name}  move_robot  SUCCEEDED  1.00 s") == 1
    assert not any("more node" in line or "Ctrl-C" in line for line in lines)
    assert lines[-1].startswith("SUCCESS after")


def test_each_visit_of_an_action_scrolls_by_with_the_seconds_of_that_visit(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    screen, state = Screen(24), State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began)
    for visit in (1, 2, 3):
        feed(state, view, *story.succeed(leaves[0], visit))
    view.close()
    assert screen.lines() == ["✓ Step 0  move_robot  SUCCEEDED  1.00 s"] * 3


def test_an_expect_that_does_not_hold_is_told_in_the_same_words_everywhere() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robot")
    given = {"expect": "result.final_pose > 9.0", "retry": Retry(2, backoff=0.5, jitter=0.0)}
    runner, state = VirtualRunner(MoveRobot("Move", 1.0, **given), network), State()
    screen = Screen(24, width=200)
    view = LiveView(state, screen.console)
    runner.start()
    while not any(isinstance(each, AttemptEnded) for each in runner.events):
        runner.advance(0.1)
    feed(state, view, *(told := list(runner.events)))
    view.frame(runner.now)
    trying = screen.lines()[-1]
    runner.advance(9.0)
    feed(state, view, *runner.events[len(told) :])
    unmet = "UNEXPECTED_RESULT: result.final_pose is 0.0; expected result.final_pose > 9.0"
    assert trying.endswith(f", attempt 2 of 2: {unmet}")
    view.close()
    assert unmet.replace(": ", " (attempt 2): ", 1) in screen.lines()[0]
    assert f"attempts 1 to 2: {unmet}" in why(state)[1]


def test_a_check_that_succeeds_again_and_again_scrolls_by_once_in_each_round(
    root: FakeNode, story: Story
) -> None:
    screen = Screen(24)
    state = State()
    view = LiveView(state, screen.console)
    check = root.children[1]
    feed(state, view, story.began)
    for number in range(2):
        feed(state, view, story.round(root, number))
        feed(state, view, *(story.node(check, Status.SUCCESS) for _ in range(50)))
    feed(state, view, story.node(check, Status.FAILURE))
    view.close()
    assert screen.lines() == ["✓ Recover", "✓ Recover", "✗ Recover"]


def test_a_terminal_that_knows_only_ascii_gets_only_ascii(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    screen = Screen(18, encoding="ascii")
    state = State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began, story.node(root, Status.RUNNING))
    feed(state, view, *story.succeed(leaves[0]), story.node(leaves[1], Status.RUNNING))
    view.frame(story.time)
    finish(state, view)
    assert any(line.startswith("+ Step 0") for line in screen.lines())


def test_no_line_is_wider_than_the_terminal(leaves: list[FakeNode]) -> None:
    screen = Screen(30, width=30)
    root = FakeNode("A long name " * 9, list(leaves))
    story, state = Story(root), State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began, story.node(root, Status.RUNNING))
    view.frame(story.time)
    assert len(screen.lines()) == 1 + 11
    view.close()


@pytest.mark.parametrize("running", [0, 4, 9])
def test_the_room_that_there_is_is_used(
    running: int, root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    screen = Screen(9 + 1 + SCROLLS)
    state = State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began)
    for node in (root, root.children[0], leaves[running]):
        feed(state, view, story.node(node, Status.RUNNING))
    view.frame(story.time)
    assert len(screen.lines()) == 9, screen.lines()
    view.close()


@pytest.mark.parametrize("height", [24, 50, 80])
def test_a_tree_that_fits_into_the_screen_is_shown_whole(height: int) -> None:
    most = height - 1 - SCROLLS
    for steps, lines in ((most - 2, most), (most - 1, most)):
        screen = Screen(height)
        story = Story(FakeNode("Work", [FakeAction(f"S{n}") for n in range(steps)]))
        state = State()
        view = LiveView(state, screen.console)
        feed(state, view, story.began)
        view.frame(story.time)
        assert len(screen.lines()) == lines
        assert (screen.lines()[-1] == f"  · S{steps - 1}") is (steps == most - 2), "or a remark"
        view.close()


def two_arms() -> tuple[FakeNode, list[FakeNode]]:
    """Two subtrees alike, one deeper than the other, and leaves of other names."""
    leaves = [FakeAction(name) for name in ("Close", "Close", "Open", "Close")]
    arms = [
        FakeNode("Left", [FakeNode("Grip", [leaves[0]]), leaves[2]]),
        FakeNode("Right", [FakeNode("Grip", [leaves[1]])]),
        FakeNode("Right", [leaves[3]]),
    ]
    return FakeNode("Both", arms), leaves


def test_leaves_of_one_name_are_told_apart_by_the_shortest_path_that_does() -> None:
    root, leaves = two_arms()
    story, state, screen = Story(root), State(), Screen(40)
    view = LiveView(state, screen.console)
    feed(state, view, story.began, story.node(root, Status.RUNNING))
    for leaf in leaves:
        ended = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
        feed(state, view, story.goal(leaf, "DONE", **ended), story.node(leaf, Status.SUCCESS))
    view.frame(story.time)
    names = ["Left / Grip / Close", "Right / Grip / Close", "Open", "Right / Close"]
    scrolled = [line for line in screen.lines() if line.startswith("✓")]
    assert [line[2:].partition("  ")[0] for line in scrolled] == names
    assert [line.partition("  ")[0] for line in last_words(state)[2:6]] == names
    view.close()


@pytest.mark.parametrize("lines", [3, 5, 7, 13])
def test_two_robots_that_do_the_same_are_told_apart_at_40_columns(lines: int) -> None:
    sides, moves = [], []
    for side in ("left", "right"):
        move, feedback = moving("To the part that lies far away")
        work = FakeNode("Pick and place", [FakeAction("Open"), move])
        recover = FakeNode("Recover", kind="success")
        deliver = FakeNode("Deliver the part", [work, recover], "fallback")
        sides.append(FakeNode(f"The {side} robot", [deliver]))
        moves.append(move)
    story = Story(FakeNode("Both robots deliver", sides), step=0.1)
    screen = Screen(lines + 1 + SCROLLS, width=40)
    state = State()
    view = LiveView(state, screen.console)
    feed(state, view, story.began)
    for move in moves:
        node: FakeNode | None = move
        while node is not None:
            feed(state, view, story.node(node, Status.RUNNING))
            node = node.parent
        feed(state, view, story.goal(move, "EXECUTING"), story.feedback(move, feedback))
    view.frame(story.time + 17.8)
    drawn = screen.lines()
    assert len(drawn) == lines
    assert max(map(len, drawn)) < 40
    assert " s  Ctrl-C cancels" in drawn[0]
    if lines >= 5:
        left, right = (next(n for n, d in enumerate(drawn) if s in d) for s in ("left", "right"))
        first, second = [n for n, line in enumerate(drawn) if "To the" in line]
        assert left <= first < right <= second, drawn
        assert drawn[first].endswith("…")
        if lines >= 7:
            assert re.search("1[12] s left", drawn[first])
    view.close()


@pytest.mark.parametrize("stopping", [False, True])
def test_the_progress_line_survives_at_40_columns(
    stopping: bool, root: FakeNode, story: Story
) -> None:
    screen = Screen(24, width=40)
    stop = [StopWanted(story._next(), "SIGINT", "interrupted")] if stopping else []
    state = story.told(*stop)
    view = LiveView(state, screen.console)
    view.frame(state.started)
    keys = "again leaves" if stopping else "cancels"
    assert any(line.endswith(f"0.0 s  Ctrl-C {keys}") for line in screen.lines())
    view.close()


@pytest.mark.parametrize(("term", "drawn"), [("xterm", True), ("dumb", False), ("unknown", False)])
def test_a_dumb_terminal_is_not_drawn_on(
    monkeypatch: pytest.MonkeyPatch, term: str, drawn: bool
) -> None:
    monkeypatch.setenv("TERM", term)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert (terminal() is not None) is drawn


def test_choosing_what_to_show_costs_the_same_in_a_tree_of_100000_nodes() -> None:
    work = FakeNode("work", [FakeNode(str(number)) for number in range(100_000)])
    state = Story(work).told()
    nodes = state.in_order()
    position = {node: number for number, node in enumerate(nodes)}
    shown, hidden, _ = choose(state, nodes, position, [1, work.children[50_000].id], 8)
    assert [state.nodes[node].node.name for node in shown] == [
        "work",
        "50000",
        "50001",
        "50002",
        "50003",
        "50004",
        "50005",
    ]
    assert hidden == len(nodes) - 7


def test_why_a_tree_that_has_ended_is_not_over_is_said_once_also_where_nothing_is_drawn(
    root: FakeNode, leaves: list[FakeNode], story: Story
) -> None:
    late = {"outcome": Outcome.ACCEPT_TIMEOUT, "end": End.UNKNOWN}
    lines = Lines(story.began, story.goal(leaves[0], "CANCELING", **late))
    lines.feed(story.node(root, Status.FAILURE))
    lines.feeding.frame(story.time + 0.5)
    said = "waiting to know the end of 1 goal: Step 0 on move_robot; Ctrl-C twice leaves"
    assert said not in lines.out.getvalue()
    story.time += 5.0
    lines.feed(story.finish(Status.FAILURE))
    assert lines.out.getvalue().count(said) == 1
