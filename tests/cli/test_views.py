"""Lines, JSON and the live drawing, from scripted events; a terminal emulator is the judge."""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pyte
import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from rich.console import Console

from bt_actions.cli.exits import Exit
from bt_actions.cli.views.choosing import choose
from bt_actions.cli.views.json_lines import JsonView
from bt_actions.cli.views.lines import LineView
from bt_actions.cli.views.live import SCROLLS, LiveView, suits
from bt_actions.cli.views.view import View
from bt_actions.cli.views.words import Closing, last_words, result_lines
from bt_actions.document import load_tree
from bt_actions.document.findings import LOADED
from bt_actions.events import Event, TreeFinished
from bt_actions.goals.policy import End, Outcome
from bt_actions.messages.fields import fields_in_words
from bt_actions.running.report import Report
from tests.cli.fakes import FakeAction, FakeProgress, Story


@pytest.fixture
def story() -> Story:
    return Story()


@pytest.fixture
def leaves() -> list[FakeAction]:
    return [FakeAction(f"Step {number}") for number in range(10)]


@pytest.fixture
def root(leaves: list[FakeAction]) -> Behaviour:
    """A fallback over a sequence of ten actions, and another leaf."""
    work = Sequence("Work", memory=True, children=list(leaves))
    return Selector("Deliver", memory=True, children=[work, Success("Recover")])


def feed(report: Report, view: View, *events: Event) -> None:
    for event in events:
        report.observe(event)
        view.event(event)


# Lines


class Lines:
    """A LineView with a clock that only moves when it is told to."""

    def __init__(self, root: Behaviour, *, verbose: bool = False) -> None:
        self.report, self.out, self.now = Report(root), io.StringIO(), 0.0
        self.view = LineView(self.report, self.out, verbose=verbose, clock=lambda: self.now)

    def feed(self, *events: Event) -> None:
        feed(self.report, self.view, *events)

    @property
    def said(self) -> list[str]:
        """The lines so far, without their times."""
        return [line[12:] for line in self.out.getvalue().splitlines()]


def test_a_line_for_each_change_of_a_node_one_for_a_goal_under_way_and_one_for_its_end(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    lines = Lines(root)
    lines.feed(story.start(), story.node(root, Status.RUNNING), *story.succeed(leaves[0]))
    lines.feed(story.node(leaves[1], Status.RUNNING))
    for state in ("QUEUED", "WAITING_FOR_SERVER", "SENDING", "EXECUTING", "EXECUTING"):
        lines.feed(story.goal(leaves[1], state))
    aborted = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": "a fault"}
    lines.feed(story.goal(leaves[1], "DONE", **aborted))  # type: ignore[arg-type]
    assert lines.out.getvalue().splitlines() == [
        "    0.50 s  RUNNING  Deliver",
        "    2.00 s  goal     Deliver / Work / Step 0: executing on move_robot",
        "    3.00 s  SUCCESS  Deliver / Work / Step 0",
        "    5.50 s  goal     Deliver / Work / Step 1: executing on move_robot",
        "    6.50 s  goal     Deliver / Work / Step 1: ABORTED: a fault",
    ]


HOSTILE = "done\n    9.99 s  SUCCESS  Deliver\x1b[2J\x9b1A"
TAMED = "done     9.99 s  SUCCESS  Deliver [2J 1A"
"""What a tree may log, and what of it is shown."""


def test_what_a_tree_says_forges_no_line_and_gives_the_terminal_no_commands(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    recover = root.children[1]
    failed = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": HOSTILE}
    news = [
        story.start(),
        story.goal(leaves[0], "DONE", **failed),  # type: ignore[arg-type]
        story.node(leaves[0], Status.FAILURE, HOSTILE),
        story.node(recover, Status.FAILURE, HOSTILE),
        story.node(root, Status.FAILURE),
        story.finish(Status.FAILURE),
    ]
    lines = Lines(root)
    lines.feed(*news)
    lines.view.finish(Closing(Exit.FAILURE))
    written = lines.out.getvalue()
    assert f"Deliver / Recover: {TAMED}\n" in written
    assert f"  failed: {TAMED}\n" in written
    assert "\x1b" not in written
    assert "\x9b" not in written
    assert not any(line.startswith("    9.99 s") for line in written.splitlines())

    screen = Screen(24)
    report = Report(root)
    view = LiveView(report, screen.console)
    feed(report, view, *news)
    view.finish(Closing(Exit.FAILURE))
    assert f"✗ Recover  {TAMED}" in screen.lines()


def test_an_output_is_one_line_whatever_it_holds(tmp_path: Path, story: Story) -> None:
    path = tmp_path / "tree.yaml"
    path.write_text(
        f"tree: t\noutputs: {{x: string}}\nroot: {{set: {{x: {json.dumps(HOSTILE)}}}}}\n"
    )
    root = load_tree(path)
    root.tick_once()
    report = Report(root)
    report.observe(story.finish(Status.SUCCESS))
    assert f"x: {TAMED}" in last_words(report, Closing(Exit.SUCCESS))


def test_what_one_tick_ended_comes_before_what_it_began(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    lines = Lines(root, verbose=True)
    begun, ended = story.node(leaves[0], Status.RUNNING), story.node(leaves[0], Status.SUCCESS)
    lines.feed(story.start(), begun, story.goal(leaves[0], "EXECUTING"))
    lines.feed(story.goal(leaves[0], "DONE", outcome=Outcome.SUCCEEDED, end=End.SUCCEEDED))
    lines.feed(story.goal(leaves[1], "SENDING"), story.goal(leaves[1], "EXECUTING"))
    lines.feed(ended, story.node(leaves[1], Status.RUNNING))
    assert lines.said == [
        "goal     Deliver / Work / Step 0: executing on move_robot",
        "SUCCESS  Deliver / Work / Step 0",
        "goal     Deliver / Work / Step 1: sending a goal to move_robot",
        "goal     Deliver / Work / Step 1: executing on move_robot",
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
    state: str, words: str, root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    lines = Lines(root)
    lines.feed(story.start(), story.node(leaves[0], Status.RUNNING), story.goal(leaves[0], state))
    for lines.now in (0.5, 0.9, 1.0, 5.0):
        lines.view.frame()
        assert len(lines.said) == (lines.now >= 1.0)
    assert lines.said == [f"goal     Deliver / Work / Step 0: {words} move_robot"]


def test_the_last_line_is_what_went_wrong(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    report, out = Report(root), io.StringIO()
    view = LineView(report, out)
    feed(report, view, story.start(), *story.succeed(leaves[0]), story.finish(Status.SUCCESS))
    view.finish(Closing(Exit.FAILURE, verdict="It lies there.", complaint="It should lie here."))
    assert out.getvalue().splitlines()[-7:] == [
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
    root: Behaviour, events: Iterable[Event], status: Status = Status.SUCCESS, note: str = ""
) -> list[dict[str, Any]]:
    """What is written of a run that ends with `status` after `events`."""
    report, out = Report(root), io.StringIO()
    view = JsonView(report, out)
    for event in events:
        feed(report, view, event)
    feed(report, view, TreeFinished(report.now, status))
    if note:
        view.say(note)
    view.finish(Closing(Exit.SUCCESS if status is Status.SUCCESS else Exit.FAILURE))
    return [json.loads(line) for line in out.getvalue().splitlines()]


def test_json_is_one_object_a_line_and_the_last_one_is_the_result(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    objects = objects_of(root, [story.start(), *story.succeed(leaves[0])], note="a note")
    kinds = [each["event"] for each in objects]
    assert kinds == ["started", "node", "goal", "goal", "goal", "node", "note", "finished"]
    last = objects[-1]
    assert (last["status"], last["exit_code"]) == ("SUCCESS", 0)
    action = last["actions"][0]
    assert {key: action[key] for key in ("name", "server", "attempts", "outcome", "duration")} == {
        "name": "Step 0",
        "server": "move_robot",
        "attempts": 1,
        "outcome": "SUCCEEDED",
        "duration": 1.0,
    }
    text = (Path(__file__).parents[2] / "docs" / "running.md").read_text()
    table = dict(re.findall(r"^\| `(\w+)` \|[^|]*\| (.*) \|$", text, re.MULTILINE))
    documented = {kind: re.findall(r"`(\w+)`", keys) for kind, keys in table.items()}
    assert documented == {each["event"]: list(each)[1:] for each in objects}
    (actions,) = re.findall(r"^- `actions`: [^,]*, with (.*?)\.$", text, re.MULTILINE | re.DOTALL)
    assert re.findall(r"`(\w+)`", actions) == list(action)


def test_each_node_has_an_id_of_its_own_in_the_order_of_the_file(story: Story) -> None:
    duplicates = [FakeAction("Step"), FakeAction("Step"), FakeAction("Step")]
    root = Sequence("Step", memory=True, children=[*duplicates[:2]])

    def insert_one_and_fail() -> Iterator[Event]:
        yield story.start()
        root.add_child(duplicates[2])
        for duplicate in reversed(duplicates):
            yield story.goal(duplicate, "DONE", outcome=Outcome.ABORTED, end=End.ABORTED)
            yield story.node(duplicate, Status.FAILURE)
        yield story.node(root, Status.FAILURE)

    started, *told, finished = objects_of(root, insert_one_and_fail(), Status.FAILURE)
    assert [(node["id"], node["parent"]) for node in started["nodes"]] == [
        (1, None),
        (2, 1),
        (3, 1),
    ]
    assert [each["id"] for each in told] == [4, 4, 3, 3, 2, 2, 1]
    assert [each["id"] for each in finished["actions"]] == [4, 3, 2]
    assert [each["id"] for each in finished["failures"]] == [2, 3, 4]


def test_json_names_the_tree_as_its_file_does_and_its_nodes(tmp_path: Path, story: Story) -> None:
    path = tmp_path / "tree.yaml"
    path.write_text("tree: errand\nroot: {invert: Not, child: {wait: 1 s, name: A moment}}\n")
    assert objects_of(load_tree(path), [story.start()])[0] == {
        "event": "started",
        "tree": "errand",
        "nodes": [
            {"id": 1, "parent": None, "name": "Not", "kind": "invert", "place": f"{path}:2:8"},
            {"id": 2, "parent": 1, "name": "A moment", "kind": "wait", "place": f"{path}:2:29"},
        ],
    }


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
    height: int, root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    screen = Screen(height)
    report = Report(root)
    view = LiveView(report, screen.console)
    feed(report, view, story.start(), story.node(root, Status.RUNNING))
    feed(report, view, story.node(root.children[0], Status.RUNNING))
    feed(report, view, story.node(leaves[4], Status.RUNNING), story.goal(leaves[4], "EXECUTING"))
    view.frame()
    drawn = screen.lines()
    assert 1 <= len(drawn) <= max(1, height / 3, height - 1 - SCROLLS)
    if height >= 12:
        assert any("Step 4" in line for line in drawn), "what runs is shown first"
    view.close()


def test_it_shows_what_an_action_does_its_attempt_its_feedback_and_the_time_left(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    screen = Screen(60, width=120)
    report = Report(root)
    view = LiveView(report, screen.console)
    leaves[2].shown = FakeProgress(
        attempt=2, attempts=3, feedback=move_feedback(), seconds_left=4.2, deadline="result"
    )
    feed(report, view, story.start(), story.node(leaves[2], Status.RUNNING))
    feed(report, view, story.goal(leaves[2], "EXECUTING", attempt=2))
    view.frame()
    doing = "executing, attempt 2 of 3, 4.2 s left for the result, current_pose 1.50, status MOVING"
    assert [line.strip() for line in screen.lines() if "2  ex" in line] == [f"▶ Step 2  {doing}"]
    view.close()


def move_feedback() -> object:
    from robot_control_interfaces.action import MoveRobot

    return MoveRobot.Feedback(current_pose=1.5, status=MoveRobot.Feedback.STATUS_MOVING)


def test_finished_work_scrolls_by_once_and_the_drawing_is_gone_at_the_end(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    screen = Screen(24)
    report = Report(root)
    view = LiveView(report, screen.console)
    feed(report, view, story.start(), story.node(root, Status.RUNNING))
    for leaf in leaves:
        for event in story.succeed(leaf):
            feed(report, view, event)
            view.frame()
    feed(report, view, story.node(root, Status.SUCCESS), story.finish(Status.SUCCESS))
    view.finish(Closing(Exit.SUCCESS))
    lines = screen.lines()
    for leaf in leaves:
        assert lines.count(f"✓ {leaf.name}  move_robot  SUCCEEDED  1.00 s") == 1
    assert not any("more node" in line or "Ctrl-C" in line for line in lines)
    assert lines[-1].startswith("SUCCESS after")


def test_a_check_that_succeeds_again_and_again_scrolls_by_once(
    root: Behaviour, story: Story
) -> None:
    screen = Screen(24)
    report = Report(root)
    view = LiveView(report, screen.console)
    check = root.children[1]
    for _ in range(50):
        feed(report, view, story.node(check, Status.SUCCESS), story.node(check, Status.INVALID))
    feed(report, view, story.node(check, Status.FAILURE))
    view.close()
    assert screen.lines() == ["✓ Recover", "✗ Recover"]


def test_a_terminal_that_knows_only_ascii_gets_only_ascii(
    root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    screen = Screen(18, encoding="ascii")
    report = Report(root)
    view = LiveView(report, screen.console)
    feed(report, view, story.start(), story.node(root, Status.RUNNING))
    feed(report, view, *story.succeed(leaves[0]), story.node(leaves[1], Status.RUNNING))
    view.frame()
    view.finish(Closing(Exit.SUCCESS))
    assert any(line.startswith("+ Step 0") for line in screen.lines())


def test_no_line_is_wider_than_the_terminal(leaves: list[FakeAction], story: Story) -> None:
    screen = Screen(30, width=30)
    root = Sequence("A long name " * 9, memory=True, children=list(leaves))
    report = Report(root)
    view = LiveView(report, screen.console)
    feed(report, view, story.start(), story.node(root, Status.RUNNING))
    view.frame()
    assert len(screen.lines()) == 1 + 11
    view.close()


@pytest.mark.parametrize("running", [0, 4, 9])
def test_the_room_that_there_is_is_used(
    running: int, root: Behaviour, leaves: list[FakeAction], story: Story
) -> None:
    screen = Screen(9 + 1 + SCROLLS)
    report = Report(root)
    view = LiveView(report, screen.console)
    feed(report, view, story.start())
    for node in (root, root.children[0], leaves[running]):
        feed(report, view, story.node(node, Status.RUNNING))
    view.frame()
    assert len(screen.lines()) == 9, screen.lines()
    view.close()


@pytest.mark.parametrize("height", [24, 50, 80])
def test_a_tree_that_fits_into_the_screen_is_shown_whole(height: int) -> None:
    most = height - 1 - SCROLLS
    for steps, lines in ((most - 2, most), (most - 1, most)):
        screen = Screen(height)
        root = Sequence("Work", memory=True, children=[FakeAction(f"S{n}") for n in range(steps)])
        view = LiveView(Report(root), screen.console)
        view.frame()
        assert len(screen.lines()) == lines
        assert (screen.lines()[-1] == f"  · S{steps - 1}") is (steps == most - 2), "or a remark"
        view.close()


def two_arms() -> tuple[Behaviour, list[FakeAction]]:
    """Two subtrees alike, one deeper than the other, and leaves of other names."""
    leaves = [FakeAction(name) for name in ("Close", "Close", "Open", "Close")]
    arms = [Sequence(name, memory=True) for name in ("Left", "Right", "Right")]
    arms[0].add_children([Sequence("Grip", memory=True, children=[leaves[0]]), leaves[2]])
    arms[1].add_child(Sequence("Grip", memory=True, children=[leaves[1]]))
    arms[2].add_child(leaves[3])
    return Sequence("Both", memory=True, children=arms), leaves


def test_leaves_of_one_name_are_told_apart_by_the_shortest_path_that_does(story: Story) -> None:
    root, leaves = two_arms()
    report, screen = Report(root), Screen(40)
    view = LiveView(report, screen.console)
    feed(report, view, story.start(), story.node(root, Status.RUNNING))
    for leaf in leaves:
        ended = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
        feed(report, view, story.goal(leaf, "DONE", **ended), story.node(leaf, Status.SUCCESS))
    view.frame()
    names = ["Left / Grip / Close", "Right / Grip / Close", "Open", "Right / Close"]
    scrolled = [line for line in screen.lines() if line.startswith("✓")]
    assert [line[2:].partition("  ")[0] for line in scrolled] == names
    assert [line.partition("  ")[0] for line in last_words(report, Closing(Exit.SUCCESS))[2:6]] == (
        names
    )
    view.close()


@pytest.mark.parametrize("lines", [3, 5, 7, 13])
def test_two_robots_that_do_the_same_are_told_apart_at_40_columns(lines: int, story: Story) -> None:
    sides, moves = [], []
    for side in ("left", "right"):
        move = FakeAction("To the part that lies far away")
        move.shown = FakeProgress(seconds_left=12.0, deadline="result", feedback=move_feedback())
        work = Sequence("Pick and place", memory=True, children=[FakeAction("Open"), move])
        deliver = Selector("Deliver the part", memory=True, children=[work, Success("Recover")])
        sides.append(Sequence(f"The {side} robot", memory=True, children=[deliver]))
        moves.append(move)
    root = Sequence("Both robots deliver", memory=True, children=list(sides))
    screen = Screen(lines + 1 + SCROLLS, width=40)
    report = Report(root)
    view = LiveView(report, screen.console)
    feed(report, view, story.start())
    for move in moves:
        node: Behaviour | None = move
        while node is not None:
            feed(report, view, story.node(node, Status.RUNNING))
            node = node.parent
        feed(report, view, story.goal(move, "EXECUTING"))
    view.frame()
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
            assert "12 s left" in drawn[first]
    view.close()


@pytest.mark.parametrize("stopping", [False, True])
def test_the_progress_line_survives_at_40_columns(
    stopping: bool, root: Behaviour, story: Story
) -> None:
    screen = Screen(24, width=40)
    view = LiveView(Report(root), screen.console)
    if stopping:
        view.say("interrupted")
    view.frame()
    keys = "again leaves" if stopping else "cancels"
    assert any(line.endswith(f"0.0 s  Ctrl-C {keys}") for line in screen.lines())
    view.close()


@pytest.mark.parametrize(
    ("environment", "drawn"),
    [({"TERM": "xterm"}, True), ({"TERM": "dumb"}, False), ({"TERM": "unknown"}, False)],
)
def test_a_dumb_terminal_is_not_drawn_on(environment: dict[str, str], drawn: bool) -> None:
    console = Console(file=io.StringIO(), force_terminal=True, _environ=environment)
    assert suits(console) is drawn


def test_choosing_what_to_show_costs_the_same_in_a_tree_of_100000_nodes() -> None:
    work = Sequence("work", memory=True)
    for number in range(100_000):
        work.children.append(leaf := Success(str(number)))
        leaf.parent = work
    nodes = [work, *work.children]
    position: dict[object, int] = {node.id: number for number, node in enumerate(nodes)}
    shown, hidden = choose(nodes, position, [work, work.children[50_000]], 8)
    assert [node.name for node in shown] == [
        "work",
        "50000",
        "50001",
        "50002",
        "50003",
        "50004",
        "50005",
    ]
    assert hidden == len(nodes) - 7


# Messages in words


def test_a_message_in_words_shows_constants_by_name() -> None:
    from robot_control_interfaces.action import Gripper, MoveRobot

    result = MoveRobot.Result(final_pose=2.0, status=MoveRobot.Result.STATUS_FAULT, message="hot")
    assert fields_in_words(result) == "final_pose 2.00, status FAULT, message hot"
    assert fields_in_words(Gripper.Feedback(stalled=True)).startswith("position 0.00, stalled true")
    assert "  status: 3  # FAULT" in result_lines(result)


LARGE = [7] * 1_000_000


def test_reports_and_the_live_view_shorten_long_values_and_json_has_them_whole(
    tmp_path: Path, story: Story
) -> None:
    from robot_control_interfaces.action import MoveRobot
    from test_msgs.action import Fibonacci

    path = tmp_path / "tree.yaml"
    path.write_text("tree: t\noutputs: {many: 'int32[]', text: string}\nroot: {success: Done}\n")
    root = load_tree(path)
    getattr(root, LOADED).scope.write_all({"many": LARGE, "text": "x" * 1_000_000})
    report = Report(root)
    report.observe(story.finish(Status.SUCCESS))
    assert last_words(report, Closing(Exit.SUCCESS))[1:3] == [
        "many: [7, 7, 7, … 1000000 items]",
        f"text: {'x' * 131} … {'x' * 66}",
    ]
    *_, finished = objects_of(root, [story.start()])
    assert finished["outputs"] == {"many": LARGE, "text": "x" * 1_000_000}
    result = result_lines(Fibonacci.Result(sequence=LARGE))
    assert result == ["  sequence:", "  - 7", "  - 7", "  - 7", "  - … 1000000 items"]
    result = MoveRobot.Result(message="x" * 1_000_000)
    assert fields_in_words(result).endswith(f", message {'x' * 51} … {'x' * 26}")


def test_without_a_result_there_are_no_lines() -> None:
    assert result_lines(None) == []


def test_numbers_that_json_has_no_word_for_are_null() -> None:
    out = io.StringIO()
    view = JsonView(Report(FakeAction("Move")), out)
    view._write({"outputs": {"n": math.nan, "all": [1.0, -math.inf]}, "duration": 2.5})
    expected = {"outputs": {"n": None, "all": [1.0, None]}, "duration": 2.5}
    assert json.loads(out.getvalue(), parse_constant=pytest.fail) == expected
