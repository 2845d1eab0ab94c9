"""What there is to check about each kind of node, beyond its form."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from types import MappingProxyType

from bt_actions.document.checking.checker import Checker
from bt_actions.document.checking.value_types import FLOAT, INTEGER, named
from bt_actions.document.findings import Related
from bt_actions.document.language.types import Record, fits, misfits
from bt_actions.document.language.values import Computed, computed_in, constant_of, locate
from bt_actions.document.reading.tree import Document, TreeNode
from bt_actions.document.yaml.nodes import Mapping as YamlMapping
from bt_actions.document.yaml.nodes import Node, span_of
from bt_actions.messages.fields import FieldType, Listing, Scalar
from bt_actions.utilities.suggest import did_you_mean, listing


def _subtree(checker: Checker, node: TreeNode) -> None:
    included = node.included
    given = node.values.get("with")
    written = node.written.get("with")
    names: Container[str] | None = None
    if given is None:
        names = () if not checker.doubts.own(node) else None
    elif isinstance(given, Computed):
        kind = checker.expression(given, {})
        if kind is not None and not isinstance(kind, Record):
            said = f"a mapping of inputs to values is needed, and this is {named(kind)}"
            checker.source.report("BT204", span_of(given.node), said)
        elif kind is not None and included is not None:
            names = dict(kind.items)
            _computed_inputs(checker, included, given, kind)
    elif isinstance(given, dict) and included is None and written is not None:
        checker.value(None, given, written)
    elif isinstance(given, dict) and included is not None and isinstance(written, YamlMapping):
        names = given
        for key, inner in written.pairs:
            wanted = _input_type(checker, included, key.text, key)
            checker.value(wanted, given.get(key.text), inner)
            checker.finite(given.get(key.text), inner)
    if included is None:
        return
    if names is not None:
        for name, declared in included.inputs.items():
            if "default" not in declared.values and name not in names:
                checker.source.report(
                    "BT211", span_of(node.key),
                    f"the tree {included.name!r} needs the input {name!r}",
                    hint=f"with: {{{name}: ...}}",
                    related=Related(declared.place, "declared here"),
                )  # fmt: skip
    _outputs(checker, node)


def _computed_inputs(checker: Checker, included: Document, given: Computed, kind: Record) -> None:
    """Check the inputs that a variable gives, whose keys are known."""
    for name, value in kind.items:
        wanted = _input_type(checker, included, name, given.node)
        if not fits(value, wanted):
            said = given.expression.text.strip()
            text = f"{name!r} is {named(wanted)}, and in {said} it is {named(value)}"
            checker.source.report("BT204", span_of(given.node), text)
            continue
        for text in misfits(value, wanted):
            checker.source.report("BT204", span_of(given.node), f"{name}{text}")


def _input_type(checker: Checker, included: Document, name: str, at: Node) -> FieldType | None:
    """The type of an input of an included tree, which is reported if it has none of that name."""
    declared = included.inputs.get(name)
    if declared is None:
        if not checker.doubts_of(included).declares(name):
            _no_such(checker, included, "input", name, included.inputs, at)
        return None
    return checker.declared_type(declared)


def _no_such(
    checker: Checker, included: Document, what: str, name: str, known: Iterable[str], at: Node
) -> None:
    """Report an input or an output that an included tree does not have."""
    near, names = did_you_mean(name, known), listing(known)
    hint = None if near else (f"its {what}s are {names}" if names else f"it has no {what}s")
    message = f"the tree {included.name!r} has no {what} {name!r}{near}"
    checker.source.report("BT212" if what == "input" else "BT213", span_of(at), message, hint=hint)


def _outputs(checker: Checker, node: TreeNode) -> None:
    included, saved = node.included, node.values.get("save")
    written = node.written.get("save")
    if included is None or not isinstance(saved, dict) or not isinstance(written, YamlMapping):
        return
    for key, inner in written.pairs:
        output = saved.get(key.text)
        if not isinstance(output, str):
            continue
        declared = included.outputs.get(output)
        if declared is None and checker.doubts_of(included).declares(output):
            continue
        if declared is None:
            _no_such(checker, included, "output", output, included.outputs, inner)
            continue
        checker.assigns(key.text, checker.declared_type(declared), inner)


def _condition(checker: Checker, node: TreeNode) -> None:
    checker.condition(node.values.get(node.kind.reads), {})


def _number(
    wanted: FieldType, least: float = 0, *, zero: bool = True
) -> Callable[[Checker, TreeNode], None]:
    def check(checker: Checker, node: TreeNode) -> None:
        value = node.values.get(node.kind.reads)
        if not isinstance(value, Computed):
            return
        given = checker.expression(value, {})
        if not fits(given, wanted):
            text = f"{named(wanted)} is needed, and this is {named(given)}"
            checker.source.report("BT204", span_of(value.node), text)
            return
        number = constant_of(value)
        if isinstance(number, (int, float)) and not least <= number < float("inf"):
            text = f"at least {least:g} is needed, not {number}"
            checker.source.report("BT110", span_of(value.node), text)
        elif number == 0 and not zero:
            checker.source.report("BT110", span_of(value.node), "more than zero is needed, not 0")

    return check


def _for_each(checker: Checker, node: TreeNode) -> None:
    item, index = node.values.get("as", "item"), node.values.get("index")
    if item == index and "index" in node.written:
        text = f"the item and its index are both called {item!r}"
        checker.source.report("BT216", span_of(node.written["index"]), text)
    if isinstance(index, str) and index not in checker.document.topics:  # which BT312 tells of
        checker.assigns(index, INTEGER, node.written["index"])
    items = node.values.get("in")
    wanted = checker.variables.get(str(item)) if item in checker.declared_at else None
    if wanted is not None and item not in checker.document.topics and "in" in node.written:
        checker.value(Listing(wanted), items, node.written["in"], prose=True)
    elif isinstance(items, Computed):
        kind = checker.expression(items, {})
        if kind is not None and not isinstance(kind, Listing):
            text = f"a list is needed, and this is {named(kind)}"
            checker.source.report("BT204", span_of(items.node), text)
    elif "in" in node.written:
        checker.value(None, items, node.written["in"], prose=True)


def _call(checker: Checker, node: TreeNode) -> None:
    checker.call(node.values, node.written, checker.class_of(node), node.kind)


def _run_tree(checker: Checker, node: TreeNode) -> None:
    text = node.values.get("tree")
    if text is not None:
        checker.value(Scalar("string"), text, node.written["tree"], prose=True)
    inputs, written = node.values.get("inputs"), node.written.get("inputs")
    if inputs is not None and written is not None:
        checker.value(None, inputs, written)
        checker.finite(inputs, written)
    checker.call(node.values, node.written, checker.class_of(node), node.kind, {"outputs": None})


def _publish(checker: Checker, node: TreeNode) -> None:
    _call(checker, node)
    alone = "timeout" in node.values and "subscribers" not in node.values
    if alone and not checker.doubts.own(node):
        said = "'timeout' is how long to wait for 'subscribers', which are missing"
        checker.source.report(
            "BT108", span_of(node.written["timeout"]), said, hint="subscribers: 1"
        )


def _set(checker: Checker, node: TreeNode) -> None:
    values, written = node.values.get("set"), node.written.get("set")
    if not isinstance(values, dict) or not isinstance(written, YamlMapping):
        return
    for key, inner in written.pairs:
        if key.text not in values:
            continue
        value = values[key.text]
        declared = checker.declared_at.get(key.text)
        if declared is not None and key.text in checker.document.topics:
            checker.assigns(key.text, None, key)
            continue
        kind = checker.variables.get(key.text) if declared is not None else None
        checker.value(kind, value, inner)


def _parallel(checker: Checker, node: TreeNode) -> None:
    policy = node.values.get("policy")
    least = policy.get("at_least") if isinstance(policy, dict) else None
    if isinstance(least, int) and least > len(node.children) > 0:
        at = locate(node.written["policy"], ("at_least",))
        text = f"{least} children can never succeed: there are {len(node.children)}"
        checker.source.report("BT110", span_of(at), text)


def _log(checker: Checker, node: TreeNode) -> None:
    checker.value(None, node.values.get("log"), node.written["log"], prose=True)


def _python(checker: Checker, node: TreeNode) -> None:
    path, arguments = node.values.get("python"), node.values.get("arguments", {})
    from py_trees.timers import Timer

    from bt_actions.document.language.classes import (
        ClassError,
        find_behaviour,
        refusal,
        wrong_arguments,
    )

    if refused := refusal(path, checker.python):
        checker.source.report("BT214", span_of(node.key), refused)
        return
    computed = computed_in(arguments)
    for one in computed:
        text = "an argument is a plain value: the class is made before the tree runs"
        checker.source.report("BT204", span_of(one.node), text)
    if computed or not isinstance(path, str) or not checker.types:
        return
    try:
        cls = find_behaviour(path)
    except ClassError as error:
        checker.source.report("BT214", span_of(node.written["python"]), str(error))
        return
    if issubclass(cls, Timer):
        text = "this timer goes by the wall clock: it cannot be run in virtual time"
        checker.source.report("BT316", span_of(node.written["python"]), text, hint="wait: 5 s")
    if not isinstance(arguments, dict):
        return
    for wrong in wrong_arguments(cls, arguments):
        at: Node = node.key
        if wrong.name:
            at = locate(node.written["arguments"], (wrong.name,), at_key=wrong.at_key)
        checker.source.report("BT215", span_of(at), wrong.text)


CHECKS: Mapping[str, Callable[[Checker, TreeNode], None]] = MappingProxyType(
    {
        "action": _call,
        "check": _condition,
        "for_each": _for_each,
        "log": _log,
        "parallel": _parallel,
        "publish": _publish,
        "python": _python,
        "repeat": _number(INTEGER),
        "retry": _number(INTEGER, 1),
        "run_tree": _run_tree,
        "service": _call,
        "set": _set,
        "subtree": _subtree,
        "timeout": _number(FLOAT, zero=False),
        "wait": _number(FLOAT),
        "wait_for_message": _call,
        "wait_until": _condition,
        "while": _condition,
    }
)
"""The checks by the name of the kind."""
