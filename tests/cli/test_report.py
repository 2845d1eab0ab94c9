"""The report: what became of each action, and whose failure made the tree fail."""

from __future__ import annotations

import gc
import io
import weakref
from pathlib import Path
from types import SimpleNamespace

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.decorators import Inverter

from bt_actions.cli.exits import Exit
from bt_actions.cli.views.lines import LineView
from bt_actions.cli.views.table import summary, table, verdict
from bt_actions.cli.views.words import Closing, goal_text, last_words, troubles
from bt_actions.document import Place, load_tree
from bt_actions.document.findings import NODE
from bt_actions.events import Event, TreeFinished
from bt_actions.goals.policy import End, Outcome
from bt_actions.running.report import Report, Row
from bt_actions.running.ticking import ChangeVisitor
from bt_actions.testing import VirtualRunner
from bt_actions.utilities.shorten import MESSAGE
from tests.cli.fakes import FakeAction, Story


@pytest.fixture
def leaf() -> FakeAction:
    return FakeAction("Move")


@pytest.fixture
def story() -> Story:
    return Story(step=1.0)


def told(root: Behaviour, *events: Event) -> Report:
    report = Report(root)
    for event in events:
        report.observe(event)
    return report


def row_of(leaf: FakeAction, *events: Event) -> Row:
    return told(leaf, *events).row(leaf)


def test_a_tree_that_never_started_took_no_time(leaf: FakeAction) -> None:
    """Its setup raised; the clock counts from when the machine was started."""
    report = told(leaf, TreeFinished(5000.0, Status.INVALID))
    words = last_words(report, Closing(Exit.FAILURE))
    assert any(" after 0.00 s" in line for line in words), words


@pytest.mark.parametrize("end", [End.SERVER_GONE, End.ABORTED])
def test_what_a_server_may_go_on_with_is_said_and_what_to_do(
    leaf: FakeAction, story: Story, end: End
) -> None:
    """But not of a simulation, which ends with the run."""
    lost = story.goal(leaf, "CANCELING", outcome=Outcome.SERVER_LOST, end=end)
    leaf.status = Status.FAILURE
    failed = story.node(leaf, Status.FAILURE), story.finish(Status.FAILURE)
    report = told(leaf, story.start(), lost, *failed)

    def hints(closing: Closing) -> int:
        return sum(
            "`bt-actions cleanup move_robot`" in line for line in last_words(report, closing)
        )

    assert hints(Closing(Exit.FAILURE)) == (end is End.SERVER_GONE)
    assert hints(Closing(Exit.SIGINT, "interrupted by SIGINT")) == (end is End.SERVER_GONE)
    assert report.servers_gone == (["Move on move_robot"] if end is End.SERVER_GONE else [])
    assert not hints(Closing(Exit.FAILURE, verdict="The part lies there."))


def test_a_success_that_warns_is_told_at_the_end(leaf: FakeAction, story: Story) -> None:
    leaf.warning = "nobody listens on /lamp"  # type: ignore[attr-defined]
    told_of = story.node(leaf, Status.SUCCESS), story.finish(Status.SUCCESS)
    words = last_words(told(leaf, story.start(), *told_of), Closing(Exit.SUCCESS))
    assert words[-1] == "warning: Move: nobody listens on /lamp"


def test_a_success_after_its_deadline_is_told_as_late(leaf: FakeAction, story: Story) -> None:
    ended = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
    late = story.goal(leaf, "DONE", **ended, reason="late: not finished within 1 s")
    assert verdict(row_of(leaf, late)) == "SUCCEEDED, late"
    assert verdict(row_of(leaf, story.goal(leaf, "DONE", **ended))) == "SUCCEEDED"


def test_attempts_are_counted_over_the_retries_of_a_visit(leaf: FakeAction, story: Story) -> None:
    row = row_of(
        leaf,
        story.goal(leaf, "EXECUTING"),
        story.goal(leaf, "DONE", outcome=Outcome.ABORTED, end=End.ABORTED, reason="a fault"),
        story.goal(leaf, "EXECUTING", attempt=2),
        story.goal(leaf, "DONE", attempt=2, outcome=Outcome.SUCCEEDED, end=End.SUCCEEDED),
    )
    assert (row.attempts, row.outcome, row.end, row.reason) == (
        2,
        Outcome.SUCCEEDED,
        End.SUCCEEDED,
        "",
    )
    assert row.duration == pytest.approx(3.0)


def test_a_failure_tells_the_attempts_of_its_last_visit(leaf: FakeAction, story: Story) -> None:
    report = told(
        leaf,
        *story.succeed(leaf),
        *story.succeed(leaf),
        *fail(story, leaf),
        story.finish(Status.FAILURE),
    )
    assert "  ABORTED after 1 attempt" in "\n".join(summary(report))


def test_a_leaf_that_is_visited_again_adds_to_its_row(leaf: FakeAction, story: Story) -> None:
    report = Report(leaf)
    for visit in (1, 2, 3):
        report.observe(story.goal(leaf, "SENDING", visit=visit))
        report.observe(story.goal(leaf, "DONE", visit=visit, outcome=Outcome.SUCCEEDED))
    assert [(row.attempts, row.visits) for row in report.rows] == [(3, 3)]
    assert table(report)[1].split()[-6:-3] == ["3", "in", "3"], "which is no retry"
    assert goal_text(report.rows[0]) == "SUCCEEDED"
    assert report.rows[0].duration == pytest.approx(3.0)


def test_an_end_that_nobody_waited_for_is_told(leaf: FakeAction, story: Story) -> None:
    canceled = {"outcome": Outcome.CANCELED, "end": End.SUCCEEDED}
    row = row_of(leaf, story.goal(leaf, "EXECUTING"), story.goal(leaf, "DONE", **canceled))
    assert verdict(row) == "CANCELED, end SUCCEEDED"


@pytest.mark.parametrize(
    ("outcome", "told"),
    [(Outcome.CANCELED, "CANCELED, end SERVER_GONE"), (Outcome.SERVER_LOST, "SERVER_LOST")],
)
def test_a_goal_that_may_run_on_where_its_server_went_is_no_canceled_one(
    leaf: FakeAction, story: Story, outcome: Outcome, told: str
) -> None:
    gone = story.goal(leaf, "CANCELING", outcome=outcome, end=End.SERVER_GONE)
    assert verdict(row_of(leaf, story.goal(leaf, "EXECUTING"), gone)) == told


def test_a_goal_that_was_not_sent_is_not_live(leaf: FakeAction, story: Story) -> None:
    assert not row_of(leaf, story.goal(leaf, "WAITING_FOR_SERVER")).live
    assert row_of(leaf, story.goal(leaf, "SENDING")).live


def test_what_is_left_without_waiting_keeps_its_duration(leaf: FakeAction, story: Story) -> None:
    row = row_of(leaf, story.goal(leaf, "SENDING"), story.goal(leaf, "EXECUTING"))
    row.leave(row.begun + 7.0)
    assert row.duration == pytest.approx(7.0)


def test_late_news_of_an_older_goal_leave_the_newer_one_alone(
    leaf: FakeAction, story: Story
) -> None:
    report = told(
        leaf,
        story.goal(leaf, "EXECUTING", visit=1),
        story.goal(leaf, "CANCELING", visit=1, outcome=Outcome.CANCELED),
        story.goal(leaf, "EXECUTING", visit=2),
        story.goal(leaf, "CANCELING", visit=1, outcome=Outcome.CANCELED, end=End.UNKNOWN),
    )
    row = report.rows[0]
    assert (row.attempts, row.visits, row.state, row.outcome) == (2, 2, "EXECUTING", None)
    report.observe(story.goal(leaf, "DONE", visit=2, outcome=Outcome.SUCCEEDED))
    assert row.live, "the older goal is still being canceled"
    report.observe(story.goal(leaf, "DONE", visit=1, outcome=Outcome.CANCELED, end=End.CANCELED))
    assert not row.live
    assert (row.attempts, row.outcome) == (2, Outcome.SUCCEEDED)


def test_a_goal_that_is_still_canceling_is_live_though_its_leaf_has_an_outcome(
    leaf: FakeAction, story: Story
) -> None:
    report = told(
        leaf,
        story.goal(leaf, "EXECUTING"),
        story.goal(leaf, "CANCELING", outcome=Outcome.CANCELED, end=End.UNKNOWN),
    )
    assert report.live == report.rows
    report.observe(story.goal(leaf, "DONE", outcome=Outcome.CANCELED, end=End.CANCELED))
    assert report.live == []
    assert report.rows[0].duration == pytest.approx(1.0)


def test_a_goal_whose_server_is_gone_is_accounted_for(leaf: FakeAction, story: Story) -> None:
    lost = Outcome.SERVER_LOST
    report = told(leaf, story.goal(leaf, "CANCELING", outcome=lost, end=End.SERVER_GONE))
    assert report.live == []


def test_an_action_that_runs_has_a_duration_too(leaf: FakeAction, story: Story) -> None:
    report = told(leaf, story.start(), story.goal(leaf, "EXECUTING"), story.goal(leaf, "CANCELING"))
    assert report.rows[0].seconds(report.now) == pytest.approx(1.0)


def test_the_leaf_s_own_judgement_wins_over_the_server_s(leaf: FakeAction, story: Story) -> None:
    leaf.outcome = Outcome.UNEXPECTED_RESULT  # type: ignore[attr-defined]
    leaf.reason = "not held"  # type: ignore[attr-defined]
    row = row_of(
        leaf,
        story.goal(leaf, "DONE", outcome=Outcome.SUCCEEDED, end=End.SUCCEEDED),
        story.node(leaf, Status.FAILURE),
    )
    assert (row.outcome, row.reason) == (Outcome.UNEXPECTED_RESULT, "not held")


def test_a_leaf_says_why_it_did_not_try_again(leaf: FakeAction, story: Story) -> None:
    leaf.outcome = Outcome.STALLED  # type: ignore[attr-defined]
    leaf.reason = "silent (not tried again: its server went away)"  # type: ignore[attr-defined]
    stalled, gone = Outcome.STALLED, End.SERVER_GONE
    row = row_of(
        leaf,
        story.goal(leaf, "CANCELING", outcome=stalled, end=gone, reason="silent"),
        story.node(leaf, Status.FAILURE),
    )
    assert (row.outcome, row.reason) == (stalled, leaf.reason)  # type: ignore[attr-defined]


def fail(story: Story, leaf: FakeAction, reason: str = "") -> list[Event]:
    return [
        story.goal(leaf, "EXECUTING"),
        story.goal(leaf, "DONE", outcome=Outcome.ABORTED, end=End.ABORTED, reason=reason),
        story.node(leaf, Status.FAILURE),
    ]


def test_the_summary_names_path_attempts_outcome_reason_and_place(story: Story) -> None:
    leaf = FakeAction("Move")
    setattr(leaf, NODE, SimpleNamespace(place=Place("trees/x.yaml", 14, 9)))
    root = Sequence("Deliver", memory=True, children=[leaf])
    report = told(
        root,
        *fail(story, leaf, "a fault"),
        story.goal(leaf, "DONE", attempt=2, outcome=Outcome.ABORTED, reason="a fault"),
        story.node(root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    assert summary(report) == [
        "Deliver / Move",
        "  ABORTED after 2 attempts: a fault",
        "  trees/x.yaml:14:9",
    ]


def test_reasons_of_any_length_leave_the_end_of_a_run_with_lines_that_can_be_read(
    story: Story,
) -> None:
    leaf, reason = FakeAction("n" * 400, server=f"/{'s' * 200}"), "the motor\nis hot; " * 300
    report = told(leaf, *fail(story, leaf, reason), story.finish(Status.FAILURE))
    report.unaccounted = [f"Move on /move_robot, goal 01: {reason}"] * 2
    closing = Closing(Exit.FAILURE, error=reason)
    said = troubles(report, closing)
    assert all(len(line) <= MESSAGE and "\n" not in line for line in said)
    assert report.culprits()[0].row.reason == reason  # type: ignore[union-attr]
    out = io.StringIO()
    view = LineView(report, out)
    for event in fail(story, leaf, reason):
        view.event(event)
    view.finish(closing)
    assert all(len(line) <= MESSAGE for line in out.getvalue().splitlines())


def test_of_a_fallback_each_child_that_failed_is_named_and_of_a_sequence_only_the_one(
    story: Story,
) -> None:
    first, second, never, last = (FakeAction(name) for name in ("a", "b", "c", "d"))
    main = Sequence("main", memory=True, children=[first, second, never])
    wrapped = Inverter("not", last)
    end = Failure("not delivered")
    root = Selector("root", memory=True, children=[main, wrapped, end])
    report = told(
        root,
        *story.succeed(first),
        *fail(story, second),
        story.node(main, Status.FAILURE),
        *story.succeed(last),
        story.node(wrapped, Status.FAILURE),
        story.node(end, Status.FAILURE),
        story.node(root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    assert [culprit.path[-1] for culprit in report.culprits()] == ["b", "not", "not delivered"]


ANOTHER_EACH_TIME = (
    "{retry: R, attempts: 2, child: {sequence: S, children: [{set: {m: = $m + 1}},"
    " {check: $m != 2, name: A}, {check: $m != 1, name: B}]}}"
)

ANOTHER_REASON_EACH_TIME = (
    "{retry: R, attempts: 2, child: {sequence: S, children: [{set: {m: = $m + 1}},"
    " {while: $m != 2, name: W, child: {failure: Z}}]}}"
)


@pytest.mark.parametrize(
    ("written", "culprits"),
    [
        ("{timeout: T, after: 10 ms, child: {running: R}}", {"T": "not done within 0.01 s"}),
        ("{while: false, name: W, child: {wait: 1 s}}", {"W": "the condition does not hold"}),
        ("{repeat: R, times: $n, child: {success: S}}", {"R": "times"}),
        ("{invert: I, child: {success: S}}", {"I": "success"}),
        ("{force_failure: G, child: {success: S}}", {"G": "success is failure"}),
        (
            "{invert: I, child: {fallback: F, children: [{failure: A}, {success: B}]}}",
            {"I": "success"},
        ),
        ("{for_each: F, in: $l, as: m, child: {success: A}}", {"F": "item 1: m: 300 does"}),
        ("{subtree: sub.yaml, save: {m: z}}", {"sub": "m: 500 does not fit an int8"}),
        (ANOTHER_REASON_EACH_TIME, {"W": "the condition does not hold"}),
        (ANOTHER_EACH_TIME, {"A": ""}),
    ],
    ids=[
        "timeout",
        "while",
        "repeat",
        "invert",
        "force",
        "invert a fallback",
        "for_each",
        "subtree",
        "reasons",
        "retry",
    ],
)
def test_who_failed_is_named_and_nobody_who_did_not_run(
    tmp_path: Path, written: str, culprits: dict[str, str]
) -> None:
    tree = tmp_path / "t.yaml"
    tree.write_text(
        "tree: t\n"
        "inputs: {n: {type: int32, default: -1}, l: {type: 'int32[]', default: [1, 300]}}\n"
        "outputs: {m: int8}\n"
        f"root: {{sequence: t, children: [{{set: {{m: 0}}}}, {written}]}}\n"
    )
    (tmp_path / "sub.yaml").write_text("tree: sub\noutputs: {z: int32}\nroot: {set: {z: 500}}\n")
    root = load_tree(tree)
    runner = VirtualRunner(root)
    runner.run()
    report = told(root, *runner.events)
    named = {culprit.path[-1]: culprit.message for culprit in report.culprits()}
    assert list(named) == list(culprits)
    for name, message in culprits.items():
        assert named[name].startswith(message)


def test_what_was_pruned_in_a_run_is_not_kept() -> None:
    root = Sequence("root", memory=False)
    ticking = py_trees.trees.BehaviourTree(root)
    visitor = ChangeVisitor(lambda: None, lambda: "")
    ticking.visitors.append(visitor)

    def tick() -> None:
        ticking.tick()
        visitor.finish()
        visitor.forget_others(set(root.iterate()))

    pruned = []
    for number in range(5):
        leaf = py_trees.behaviours.Running(f"leaf {number}")
        ticking.insert_subtree(leaf, root.id, 0)
        tick()
        ticking.prune_subtree(leaf.id)
        tick()
        pruned.append(weakref.ref(leaf))
        del leaf
    gc.collect()
    assert [each() for each in pruned] == [None] * 5


def test_a_tree_that_succeeded_has_no_culprits_though_a_leaf_failed(story: Story) -> None:
    leaf = FakeAction("a")
    root = Selector("root", memory=True, children=[leaf])
    assert told(root, *fail(story, leaf), story.finish(Status.SUCCESS)).culprits() == []


def test_the_table_has_a_line_for_each_action_and_fits_the_width(story: Story) -> None:
    leaves = [FakeAction("A name that is long " * 3, server="/r1/" + "x" * 30), FakeAction("b")]
    root = Sequence("root", memory=True, children=list(leaves))
    report = told(root, *story.succeed(leaves[0]), *story.succeed(leaves[1]))
    assert len(table(report)) == 3
    assert table(report)[2].split() == ["b", "move_robot", "1", "SUCCEEDED", "2.00", "s"]
    for width in (40, 60, 80):
        assert max(len(line) for line in table(report, width)) <= max(width, 55)


def test_actions_that_were_never_tried_are_not_in_the_table(story: Story) -> None:
    root = Sequence("root", memory=True, children=[FakeAction("never")])
    assert table(told(root, story.start(), story.finish(Status.FAILURE))) == []
