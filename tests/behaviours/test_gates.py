"""Nodes that are left out, and what their parents do: the table of docs/yaml.md."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, Status

from bt_actions.behaviours.composites import If, InTurn, Pipeline, Recover, Resume
from bt_actions.behaviours.decorators import ForEach, Repeat, RetryChild, While
from bt_actions.behaviours.gates import gate
from bt_actions.behaviours.leaving import (
    Fallback,
    ForceFailure,
    ForceSuccess,
    Invert,
    RunOnce,
    Sequence,
    is_left_out,
)
from bt_actions.behaviours.parallel import Parallel
from bt_actions.goals.policy import Retry
from tests.support.scripted import Scripted

S, F, R = Status.SUCCESS, Status.FAILURE, Status.RUNNING


@pytest.fixture
def log() -> list[str]:
    return []


@pytest.fixture
def there() -> list[bool]:
    """Whether the nodes with a gate are there."""
    return [False]


Leaf = Callable[[str, str], Scripted]


@pytest.fixture
def leaf(log: list[str]) -> Leaf:
    return lambda name, visits: Scripted(name, visits, log)


@pytest.fixture
def out(leaf: Leaf, there: list[bool]) -> Leaf:
    """A leaf that is there as `there` says when it begins."""

    def make(name: str, visits: str) -> Scripted:
        made = leaf(name, visits)
        gate(made, {"only_if": "$x"}, only_if=lambda: "" if there[0] else "$x is false")
        return made

    return make


def ticked(root: Behaviour, log: list[str], ticks: int = 1) -> list[str]:
    told = []
    for _ in range(ticks):
        log.clear()
        root.tick_once()
        told.append(f"{' '.join(log)} {root.status.name[0]}".strip())
    return told


def seq(*children: Behaviour, memory: bool = True) -> Sequence:
    return Sequence("s", memory, children=list(children))


def fallback(*children: Behaviour) -> Fallback:
    return Fallback("f", True, children=list(children))


@pytest.mark.parametrize("make", [seq, fallback, lambda *each: Pipeline("p", each)])
def test_a_composite_goes_on_to_the_next_child(
    leaf: Leaf, out: Leaf, log: list[str], make: Callable[..., Behaviour]
) -> None:
    root = make(out("a", "S"), leaf("b", "RS"))
    assert ticked(root, log, 2) == ["b+ R", "bS S"]
    assert not is_left_out(root)


@pytest.mark.parametrize("plain", [composites.Sequence, composites.Selector])
def test_composites_of_py_trees_go_on_as_well(
    leaf: Leaf, out: Leaf, log: list[str], plain: Any
) -> None:
    assert ticked(plain("c", True, children=[out("a", "S"), leaf("b", "R")]), log) == ["b+ R"]


MAKES: dict[str, Callable[[Behaviour], Behaviour]] = {
    "sequence": seq,
    "reactive": lambda child: seq(child, memory=False),
    "fallback": fallback,
    "parallel": lambda child: Parallel("p", [child], at_least=1),
    "pipeline": lambda child: Pipeline("p", [child]),
    "in turn": lambda child: InTurn("t", [child]),
    "resume": lambda child: Resume("r", [child]),
    "invert": lambda child: Invert("i", child),
    "force_success": lambda child: ForceSuccess("i", child),
    "force_failure": lambda child: ForceFailure("i", child),
    "run_once": lambda child: RunOnce("o", child, OneShotPolicy.ON_COMPLETION),
    "while": lambda child: While("w", child, lambda: True),
    "repeat": lambda child: Repeat("r", child, 2),
    "retry": lambda child: RetryChild("r", child, None, Retry()),
    "recover": lambda child: Recover("r", child, Scripted("x", "S", []), 2),
    "if": lambda child: If("i", lambda: True, child),
    "asked": lambda child: If("i", child, Scripted("x", "S", [])),
    "for_each": lambda child: ForEach(
        "e", child, lambda: [1], lambda _item, _index: None, keep_going=True
    ),
}


@pytest.mark.parametrize("make", MAKES.values(), ids=MAKES)
@pytest.mark.parametrize(("around", "status"), [(seq, S), (fallback, F)], ids=["in s", "in f"])
def test_what_has_nothing_but_what_is_left_out_is_left_out_itself(
    leaf: Leaf,
    out: Leaf,
    log: list[str],
    there: list[bool],
    make: Callable[[Behaviour], Behaviour],
    around: Callable[..., Behaviour],
    status: Status,
) -> None:
    node = make(out("a", "R"))
    root = around(node, leaf("b", "S"))
    root.tick_once()
    assert log == ["b+", "bS"], "its parent goes on"
    assert (node.status, is_left_out(node), node.feedback_message) == (status, True, "left out")
    there[0] = True
    assert ticked(root, log) == ["a+ R"], "it is asked anew in each visit"
    assert not is_left_out(node)


def test_a_root_that_is_left_out_succeeds(out: Leaf, log: list[str]) -> None:
    root = out("a", "F")
    assert ticked(root, log) == ["S"]
    assert root.feedback_message == "left out: $x is false"


def test_a_parallel_asks_again_at_each_tick_until_the_child_begins(
    leaf: Leaf, out: Leaf, log: list[str], there: list[bool]
) -> None:
    root = Parallel("p", [out("a", "RS"), leaf("b", "RRRS")])
    assert ticked(root, log, 2) == ["b+ R", "R"]
    there[0] = True
    assert ticked(root, log, 2) == ["a+ R", "aS bS S"]


def test_in_a_parallel_it_counts_for_all_and_not_for_so_many(
    leaf: Leaf, out: Leaf, log: list[str]
) -> None:
    assert ticked(Parallel("p", [out("a", "S"), leaf("b", "S")]), log) == ["b+ bS S"]
    some = Parallel("p", [out("a", "S"), leaf("b", "S")], at_least=2)
    assert ticked(some, log, 2) == ["b+ bS R", "R"]


def test_a_repeat_without_an_end_asks_at_the_next_tick_and_polls_for_no_time(
    out: Leaf, log: list[str], there: list[bool]
) -> None:
    root = Repeat("r", out("a", "R"), None)
    assert ticked(root, log, 2) == ["R", "R"]
    assert root.due_in() is None
    there[0] = True
    assert ticked(root, log) == ["a+ R"]


def test_a_loop_goes_on_to_the_next_item(out: Leaf, log: list[str], there: list[bool]) -> None:
    items = [False, True, False, True]

    def begin(_item: object, index: int) -> None:
        there[0] = items[index]

    for visits, end in (("S", "S"), ("F S", "S"), ("F", "F")):
        root = ForEach("e", out("a", visits), lambda: items, begin, keep_going=True)
        assert [each[-1] for each in ticked(root, log, 4)] == ["R", "R", "R", end]


def test_a_retry_whose_recovery_is_left_out_fails(leaf: Leaf, out: Leaf, log: list[str]) -> None:
    root = Recover("r", leaf("a", "F"), out("b", "S"), 3)
    assert ticked(root, log) == ["a+ aF F"]
    assert not is_left_out(root)


def test_what_is_left_out_has_not_run_once(out: Leaf, log: list[str], there: list[bool]) -> None:
    root = RunOnce("o", out("a", "F"), OneShotPolicy.ON_COMPLETION)
    assert ticked(root, log) == ["S"]
    there[0] = True
    assert ticked(root, log, 2) == ["a+ aF F", "F"]


# The gate itself


def test_only_if_is_asked_when_a_visit_begins_and_not_again(leaf: Leaf, log: list[str]) -> None:
    asked: list[str] = []
    node = leaf("a", "RRS")
    gate(node, {}, only_if=lambda: asked.append("?") or "")  # type: ignore[func-returns-value]
    assert ticked(node, log, 4) == ["a+ R", "R", "aS S", "a+ R"]
    assert asked == ["?", "?"]
    assert not node.asks  # type: ignore[attr-defined]


def test_a_node_that_was_left_out_asks_again_until_it_begins(
    out: Leaf, log: list[str], there: list[bool]
) -> None:
    node = out("a", "R")
    assert ticked(node, log) == ["S"]
    assert node.asks  # type: ignore[attr-defined]
    there[0] = True
    assert ticked(node, log) == ["a+ R"]
    assert not node.asks  # type: ignore[attr-defined]


def test_only_while_is_asked_before_each_tick_and_stops_what_runs(
    leaf: Leaf, log: list[str]
) -> None:
    why = [""]
    node = leaf("a", "R")
    gate(node, {}, only_while=lambda: why[0])
    root = seq(node, leaf("b", "S"))
    assert ticked(root, log, 2) == ["a+ R", "R"]
    why[0] = "$x is false"
    assert ticked(root, log) == ["ax b+ bS S"]
    assert node.asks  # type: ignore[attr-defined]


def test_a_gate_that_cannot_be_asked_fails_the_node_and_says_why(
    leaf: Leaf, log: list[str]
) -> None:
    answers = ["", "no"]

    def asked() -> str:
        answer = answers.pop(0)
        if answer:
            raise ValueError("$x has no value")
        return answer

    node = leaf("a", "R")
    gate(node, {}, only_while=asked)
    assert ticked(node, log, 2) == ["a+ R", "ax F"]
    assert (node.feedback_message, is_left_out(node)) == ("$x has no value", False)
    assert node.refused  # type: ignore[attr-defined]


def test_a_running_node_whose_gate_was_asked_costs_no_generator(leaf: Leaf) -> None:
    node = leaf("a", "R")
    gate(node, {}, only_if=lambda: "")
    node.tick_once()
    assert node.tick().__qualname__ == "Behaviour.tick"  # type: ignore[attr-defined]
