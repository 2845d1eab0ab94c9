"""Kinds that a tree declares: classes with inputs, outputs and children."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.own import Outputs, equip
from bt_actions.document import DocumentError, Source, check_source, load_tree, tree_outputs
from bt_actions.document.formatting.format import format_source
from tests.document.conftest import tick
from tests.support.own_kinds import Both, Multiply, Not

Load = Callable[..., Behaviour]
KINDS = """\
kinds:
  multiply:
    python: tests.support.own_kinds.Multiply
    inputs: {x: float64, by: {type: float64, default: 2.0}}
    outputs: {product: float64, word: string}
  both: {python: tests.support.own_kinds.Both, children: many}
  nay: {python: tests.support.own_kinds.Not, children: one}
"""
TREE = (
    """\
tree: t
inputs: {a: {type: float64, default: 1.5}}
outputs: {b: float64, c: string}
"""
    + KINDS
)
USE = """\
root:
  both: B
  children:
    - nay: N
      child: {failure: F}
    - multiply: D
      with: {x: $a}
      save: {b: product, c: word}
"""


def test_a_kind_is_made_with_its_children_reads_inputs_and_gives_outputs(load: Load) -> None:
    root = load(TREE + USE)
    assert [type(each) for each in (root, *root.children)] == [Both, Not, Multiply]
    root.tick_once()
    assert (root.status, tree_outputs(root)) == (Status.RUNNING, {}), "nothing before its end"
    root.tick_once()
    assert (root.status, tree_outputs(root)) == (Status.SUCCESS, {"b": 3.0, "c": "D"})


def test_outputs_of_a_failure_are_written_too(load: Load) -> None:
    root = load(TREE + "root: {multiply: D, with: {x: $a, by: 0.0}, save: {b: product}}\n")
    assert tick(root) is Status.FAILURE
    assert tree_outputs(root) == {"b": 0.0}


def test_an_output_that_does_not_fit_fails_the_node_and_none_is_written(load: Load) -> None:
    text = TREE.replace("product: float64, word: string", "product: float64, word: float64")
    text = text.replace("c: string", "c: float64")
    root = load(text + "root: {multiply: D, with: {x: $a}, save: {b: product, c: word}}\n")
    assert tick(root) is Status.FAILURE
    assert tree_outputs(root) == {}
    assert root.feedback_message.startswith("c: ")


def test_an_input_without_a_value_fails_the_node(load: Load) -> None:
    topics = "topics: {near: {topic: near, type: std_msgs/msg/Float64}}\n"
    root = load(TREE + topics + "root: {multiply: D, with: {x: $near.data}, save: {b: product}}\n")
    assert tick(root) is Status.FAILURE
    assert root.feedback_message.startswith("no message has come on near yet")
    assert tree_outputs(root) == {}


def test_a_word_that_the_kind_does_not_declare_is_no_input_and_no_output(load: Load) -> None:
    root = load(TREE + "root: {multiply: D, with: {x: 1.0}}\n")
    assert isinstance(root, Multiply)
    with pytest.raises(AttributeError, match="declares no input 'y'"):
        _ = root.inputs.y
    with pytest.raises(AttributeError, match="declares no output 'y'"):
        root.outputs.y = 1


def test_kinds_are_imported(load: Load) -> None:
    use = "tree: t\nimport: words\noutputs: {b: float64}\nroot: {multiply: D, with: {x: 1.0}, "
    root = load(use + "save: {b: product}}\n", words=KINDS)
    assert tick(root) is Status.SUCCESS
    assert tree_outputs(root) == {"b": 2.0}


def test_no_class_is_made_of_a_tree_that_is_not_trusted(load: Load, tmp_path: object) -> None:
    load(TREE + USE)
    with pytest.raises(DocumentError, match="python: is not allowed here"):
        load_tree(f"{tmp_path}/main.yaml", python=False)


def test_a_node_of_such_a_kind_is_in_canonical_form() -> None:
    turned = (
        TREE
        + USE.replace("both: B\n  children", "children")
        .replace(
            "- nay: N\n      child: {failure: F}", "- child: {name: F, failure: }\n      nay: N"
        )
        .rstrip("\n")
        + "\n  both: B\n"
    )
    told = format_source(Source("t.yaml", turned))
    assert "  both: B\n  children:\n    - nay: N\n      child:" in told


@pytest.mark.parametrize(
    ("written", "instead", "code", "told"),
    [
        ("x: $a", "x: $a, y: 1", "BT212", "'multiply' has no input 'y'"),
        ("{x: $a}", "{by: 1.0}", "BT211", "'multiply' needs the input 'x'"),
        ("x: $a", "x: text", "BT204", "a number (float64) is needed"),
        ("b: product", "b: prodct", "BT213", "did you mean 'product'?"),
        ("b: product", "b: word", "BT204", "'b' is a float64, and this is a string"),
        ("own_kinds.Both", "own_kinds.Beth", "BT214", "has no 'Beth'"),
        ("children: many", "children: two", "BT110", "'two' is not known here"),
        ("default: 2.0", "default: $a", "BT204", "a default is a plain value"),
        ("x: float64,", "x: float,", "BT207", "x: 'float'"),
        ("  both: {python", "  wait: {python", "BT208", "cannot name a kind of one's own"),
        ("- multiply: D", "- multply: D", "BT201", "did you mean 'multiply'?"),
        ("    - nay: N\n      child: {failure: F}\n", "", "BT309", "no node is of the kind 'nay'"),
        ("child: {failure: F}", "children: [{failure: F}]", "BT107", "'nay' has no 'children'"),
        ("kinds:", "actions: {nay: {type: a/action/B, server: s}}\nkinds:", "BT216", "twice"),
    ],
)
def test_a_kind_and_its_use_are_checked(written: str, instead: str, code: str, told: str) -> None:
    text = TREE + USE
    assert check_source(Source("t.yaml", text)) == []
    assert written in text
    found = check_source(Source("t.yaml", text.replace(written, instead, 1)))
    assert [one for one in found if one.code == code and told in one.message], found


def test_what_was_set_in_an_earlier_visit_is_not_written_again() -> None:
    class Once(Behaviour):
        outputs: Outputs

        def update(self) -> Status:
            if not written:
                self.outputs.x = 1
            return Status.SUCCESS

    written: list[dict[str, object]] = []
    node = Once("once")
    equip(node, {}, ["x"], lambda given: written.append(dict(given)))
    node.tick_once()
    node.tick_once()
    assert written == [{"x": 1}, {}]
