"""What each kind of node does, ticked without ROS."""

from __future__ import annotations

import gc
import textwrap
from collections.abc import Callable

import pytest
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from bt_actions.document import tree_outputs
from tests.document.conftest import tick

Load = Callable[..., Behaviour]
HEAD = """
tree: t
inputs: {level: {type: float64, default: 1.0}, count: {type: int32, default: 1}}
outputs: {n: int32, log: string}
root:
"""

COUNTING = """
    sequence: S
    children:
      - set: {n: 0}
      - %s
"""
STEP = "{set: {n: = $n + 1}}"


def run(load: Load, node: str, ticks: int = 50) -> tuple[Status, dict[str, object], Behaviour]:
    root = load(HEAD + textwrap.indent(textwrap.dedent(node), "  "))
    status = tick(root, ticks)
    return status, tree_outputs(root), root


@pytest.mark.parametrize(
    ("policy", "children", "status"),
    [
        ("all", ["success", "success"], Status.SUCCESS),
        ("all", ["success", "failure"], Status.FAILURE),
        ("all", ["success", "running"], Status.RUNNING),
        ("all", ["failure", "running"], Status.FAILURE),
        ("one", ["failure", "success"], Status.SUCCESS),
        ("one", ["running", "success"], Status.SUCCESS),
        ("one", ["failure", "running"], Status.RUNNING),
        ("one", ["failure", "failure"], Status.FAILURE),
        ("{at_least: 2}", ["success", "failure", "success"], Status.SUCCESS),
        ("{at_least: 2}", ["success", "failure", "running"], Status.RUNNING),
        ("{at_least: 2}", ["failure", "failure", "running"], Status.FAILURE),
    ],
)
def test_parallel_succeeds_when_enough_do_and_fails_when_that_cannot_happen(
    load: Load, policy: str, children: list[str], status: Status
) -> None:
    items = "\n".join(f"  - {{{child}: {child} {n}}}" for n, child in enumerate(children))
    assert run(load, f"parallel: P\npolicy: {policy}\nchildren:\n{items}", 3)[0] is status


def test_parallel_does_not_start_a_finished_child_again(load: Load) -> None:
    parallel = (
        f"{{parallel: P, children: [{STEP}, {{repeat: R, times: 3, child: {{success: A}}}}]}}"
    )
    status, outputs, _ = run(load, COUNTING % parallel)
    assert (status, outputs) == (Status.SUCCESS, {"n": 1})


def test_parallel_stops_what_still_runs_when_it_ends(load: Load) -> None:
    _, _, root = run(load, "{parallel: P, policy: one, children: [{running: R}, {success: A}]}")
    assert [child.status for child in root.children] == [Status.INVALID, Status.SUCCESS]


def test_repeat_runs_its_child_so_often(load: Load) -> None:
    status, outputs, _ = run(load, COUNTING % f"{{repeat: R, times: 3, child: {STEP}}}")
    assert (status, outputs) == (Status.SUCCESS, {"n": 3})


def test_repeat_zero_times_succeeds_without_running_its_child(load: Load) -> None:
    status, outputs, _ = run(load, COUNTING % f"{{repeat: R, times: 0, child: {STEP}}}")
    assert (status, outputs) == (Status.SUCCESS, {"n": 0})


def test_repeat_ends_with_the_first_failure(load: Load) -> None:
    child = f"{{sequence: X, children: [{STEP}, {{check: $n < 2}}]}}"
    status, outputs, _ = run(load, COUNTING % f"{{repeat: R, times: 9, child: {child}}}")
    assert (status, outputs) == (Status.FAILURE, {"n": 2})


def test_retry_runs_its_child_until_it_succeeds_or_the_attempts_are_used(load: Load) -> None:
    child = f"{{sequence: X, children: [{STEP}, {{check: $n > 2}}]}}"
    status, outputs, root = run(load, COUNTING % f"{{retry: R, attempts: 5, child: {child}}}")
    assert (status, outputs) == (Status.SUCCESS, {"n": 3})
    assert root.children[1].feedback_message == "attempt 3 of 5 succeeded"
    status, outputs, root = run(load, COUNTING % f"{{retry: R, attempts: 2, child: {child}}}")
    assert (status, outputs) == (Status.FAILURE, {"n": 2})
    assert root.children[1].feedback_message == "attempt 2 of 2 failed"


def test_retry_waits_for_its_backoff(load: Load) -> None:
    status, outputs, root = run(
        load,
        COUNTING % "{retry: R, attempts: 2, backoff: 60 s, child: {check: $n > 0}}",
        5,
    )
    assert (status, outputs) == (Status.RUNNING, {"n": 0})
    due = root.children[1].due_in()  # type: ignore[attr-defined]
    assert 59 < due <= 60


def test_timeout_stops_its_child_and_fails(load: Load) -> None:
    status, _, root = run(load, "{timeout: T, after: 1 ns, child: {running: R}}")
    assert status is Status.FAILURE
    assert root.children[0].status is Status.INVALID
    assert root.feedback_message == "not done within 1e-09 s"


def test_timeout_lets_a_child_end_in_time(load: Load) -> None:
    assert run(load, "{timeout: T, after: 1 h, child: {failure: R}}")[0] is Status.FAILURE
    assert run(load, "{timeout: T, after: 1 h, child: {success: R}}")[0] is Status.SUCCESS


@pytest.mark.parametrize(
    ("kind", "child", "status"),
    [
        ("invert", "success", Status.FAILURE),
        ("invert", "failure", Status.SUCCESS),
        ("force_success", "failure", Status.SUCCESS),
        ("force_success", "running", Status.RUNNING),
        ("force_failure", "success", Status.FAILURE),
        ("run_once", "failure", Status.FAILURE),
    ],
)
def test_decorators_change_how_a_child_ends(
    load: Load, kind: str, child: str, status: Status
) -> None:
    assert run(load, f"{kind}: D\nchild: {{{child}: C}}", 2)[0] is status


def test_run_once_runs_its_child_once(load: Load) -> None:
    status, outputs, _ = run(
        load,
        COUNTING % f"{{repeat: R, times: 3, child: {{run_once: O, child: {STEP}}}}}",
    )
    assert (status, outputs) == (Status.SUCCESS, {"n": 1})


def test_for_each_gives_its_child_each_item_and_its_index(load: Load) -> None:
    status, outputs, _ = run(
        load,
        """
        sequence: S
        children:
          - set: {log: ''}
          - for_each: F
            in: [a, b, c]
            as: letter
            index: at
            child: {set: {log: "$(log)$(letter)$(at)"}}
        """,
    )
    assert (status, outputs) == (Status.SUCCESS, {"log": "a0b1c2"})


@pytest.mark.parametrize(
    ("on_failure", "items", "status", "count"),
    [
        ("stop", "[1, 5, 2]", Status.FAILURE, 2),
        ("continue", "[1, 5, 2]", Status.SUCCESS, 3),
        ("continue", "[5, 5]", Status.FAILURE, 2),
        ("stop", "[]", Status.SUCCESS, 0),
    ],
)
def test_for_each_stops_at_a_failure_or_goes_on(
    load: Load, on_failure: str, items: str, status: Status, count: int
) -> None:
    child = f"{{sequence: X, children: [{STEP}, {{check: $item < 3}}]}}"
    node = f"{{for_each: F, in: {items}, on_failure: {on_failure}, child: {child}}}"
    ended, outputs, _ = run(load, COUNTING % node)
    assert (ended, outputs) == (status, {"n": count})


def test_while_ticks_its_child_as_long_as_the_condition_holds(load: Load) -> None:
    status, outputs, root = run(
        load,
        COUNTING % f"{{while: $n < 3, child: {{repeat: R, child: {STEP}}}}}",
    )
    assert (status, outputs) == (Status.FAILURE, {"n": 3})
    assert root.children[1].children[0].status is Status.INVALID


def test_check_fails_with_a_readable_reason_and_never_raises(load: Load) -> None:
    for text, reason in (
        ("$count > 1", "$count > 1 is false: $count is 1"),
        ("$n > 1", "$n has no value"),
        ("1 / ($count - 1) > 0", "1 / ($count - 1) divides by zero"),
    ):
        status, _, root = run(load, f"check: {text}")
        assert (status, root.feedback_message) == (Status.FAILURE, reason)


def test_set_writes_all_or_none(load: Load) -> None:
    status, outputs, root = run(load, "set: {n: 1, log: = $log + 'x'}")
    assert (status, outputs) == (Status.FAILURE, {})
    assert root.feedback_message == "$log has no value"
    node = "{sequence: S, children: [{set: {x: [1, a]}}, {set: {n: 1, log: $x}}]}"
    status, outputs, root = run(load, node)
    assert (status, outputs) == (Status.FAILURE, {})
    assert root.children[1].feedback_message == "log: a text is needed, not a list"


def test_log_writes_a_line_with_its_values(load: Load, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", "bt_actions"):
        run(load, "log: Level $(level), $$5, on $(count)")
    assert [record.message for record in caplog.records] == ["Level 1.0, $5, on 1"]


def test_wait_until_succeeds_as_soon_as_its_condition_holds(load: Load) -> None:
    assert run(load, "wait_until: $count == 1")[0] is Status.SUCCESS
    assert run(load, "wait_until: $n == 1", 3)[0] is Status.RUNNING
    status, _, root = run(load, "{wait_until: $n == 1, timeout: 1 ns}", 3)
    assert status is Status.FAILURE
    assert root.feedback_message == "not within 1e-09 s: $n has no value"


def test_wait_is_over_after_its_time(load: Load) -> None:
    assert run(load, "wait: 0")[0] is Status.SUCCESS
    status, _, root = run(load, "wait: = $count * 60", 3)
    assert status is Status.RUNNING
    assert 59 < root.due_in() <= 60  # type: ignore[attr-defined]


def test_a_behaviour_of_one_s_own_is_made_with_its_name_and_arguments(load: Load) -> None:
    _, _, root = run(
        load, "{python: py_trees.timers.Timer, name: Mine, arguments: {duration: 60.0}}", 1
    )
    assert (type(root).__name__, root.name) == ("Timer", "Mine")


@pytest.mark.parametrize(
    ("node", "name"),
    [
        ("check: $count > 1", "$count > 1"),
        ("wait: 5 s", "wait 5 s"),
        ("log: 'a: b'", "log a; b"),
        ("set: {n: 1}", "set n"),
        ("failure:", "failure"),
        ("{wait: 5 s, name: Rest}", "Rest"),
    ],
)
def test_a_node_that_needs_no_name_gets_one_without_a_colon(
    load: Load, node: str, name: str
) -> None:
    assert run(load, node, 0)[2].name == name


def test_a_retry_without_a_pause_never_makes_one(load: Load) -> None:
    """The factor's power is no float any more after 1,024 failures."""
    root = load(HEAD + "  retry: R\n  child: {check: $level > 2}\n")
    for _ in range(1030):
        root.tick_once()
    assert root.feedback_message == "attempt 1030 failed"
    assert root.due_in() == 0.0  # type: ignore[attr-defined]


def visited_twice(load: Load, children: str) -> tuple[Status, dict[str, object]]:
    """Run a subtree of these nodes, which computes `r` from `k`, for 0 and for 1."""
    inner = (
        "tree: inner\ninputs: {k: int32}\noutputs: {r: int32}\n"
        f"root: {{sequence: S, children: [{children}]}}\n"
    )
    outer = (
        "tree: outer\noutputs: {last: int32}\nroot:\n  for_each: Each\n  in: [0, 1]\n"
        "  child: {subtree: inner.yaml, with: {k: $item}, save: {last: r}}\n"
    )
    root = load(outer, inner=inner)
    return tick(root), tree_outputs(root)


def test_a_subtree_begins_without_what_its_last_visit_wrote(load: Load) -> None:
    seen_once = (
        "{force_success: F, child: "
        "{sequence: First, children: [{check: $k == 0}, {set: {seen: = $k + 100}}]}}"
    )
    ended = visited_twice(load, f"{seen_once}, {{set: {{r: $seen}}}}")
    assert ended == (Status.FAILURE, {"last": 100})


def test_what_a_subtree_does_once_it_knows_ever_after(load: Load) -> None:
    once = "{run_once: Calibrate, child: {set: {offset: 100}}}"
    ended = visited_twice(load, f"{once}, {{set: {{r: = $k + $offset}}}}")
    assert ended == (Status.SUCCESS, {"last": 101})


def test_what_a_tree_wrote_is_forgotten_when_nothing_of_it_is_left(load: Load) -> None:
    def names() -> set[str]:
        return {key.split("/")[2] for key in Blackboard.storage if key.startswith("/bt/forgotten")}

    text = "tree: forgotten%d\noutputs: {n: int32}\nroot: {set: {n: 1}}\n"
    kept = load(text % 0)
    tick(kept)
    for number in range(1, 4):
        tick(load(text % number))
    gc.collect()
    load(text % 4)
    assert names() == {"forgotten0"}
    assert tree_outputs(kept) == {"n": 1}


def test_a_blackboard_of_its_own_numbers_its_loads_from_the_first(
    load: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    def keys() -> list[str]:
        monkeypatch.setattr(Blackboard, "storage", {})
        tick(load("tree: t\noutputs: {n: int32}\nroot: {set: {n: 1}}\n"))
        return list(Blackboard.storage)

    assert keys() == keys()
