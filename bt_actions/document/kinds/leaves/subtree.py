"""`subtree`: another tree, with inputs and outputs."""

import contextlib
from collections.abc import Container, Iterable
from collections.abc import Mapping as Mapped

from bt_actions.document.checking.value_types import named
from bt_actions.document.findings import Related
from bt_actions.document.kinds.given import Behaviour, Checker, Context, build, decorators
from bt_actions.document.language.keys import NAMESPACE
from bt_actions.document.language.kinds import Can, Settings, leaf
from bt_actions.document.language.scalars import Choice, Name, Text
from bt_actions.document.language.shapes import Key, Table, Values
from bt_actions.document.language.types import Record, fits, misfits
from bt_actions.document.language.values import Computed, computed_in, refuse_large, resolve
from bt_actions.document.reading.inputs import check_inputs
from bt_actions.document.reading.tree import (
    Document,
    TreeNode,
    table_of,
    writes_of,
)
from bt_actions.document.yaml.nodes import Mapping, Node, span_of
from bt_actions.messages.fields import FieldType
from bt_actions.utilities.plain_data import same
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.suggest import did_you_mean, listing


def _build(node: TreeNode, context: Context) -> Behaviour:
    included = node.included
    assert included is not None
    scope = context.scope.inner(included.name)
    child = build.build(
        included,
        scope,
        namespace=context.namespace_of(node.values),
        types=context.types,
        python=context.python,
        static=_static(node, included, context.static),
    )
    given = context.value(node.values.get("with", {}))
    passed: dict[str, object] = {}
    saved = table_of(node.values.get("save"))
    written = {declared.name for declared in included.outputs.values()}
    written |= _writes(included, included.nodes())
    for inner in included.nodes():
        if inner.kind.once:
            written -= _writes(included, inner.walk())  # a run_once writes no second time

    def inputs() -> dict[str, object]:
        values = given()
        if not isinstance(values, dict):
            got = shorten(values, 60)
            raise ValueError(f"'with' needs a mapping of inputs to values, not {got}")
        try:
            refuse_large(values)
        except ValueError as error:
            raise ValueError(f"'with': {error}") from None
        return check_inputs(included, values, types=context.types)

    def begin() -> None:
        passed.update(values := inputs())
        for name in written:
            if name not in values:
                scope.clear(name)
        scope.write_all(values)

    def pass_on() -> None:
        with contextlib.suppress(ValueError):  # the former input stays
            now = inputs()
            changed = {name: now[name] for name in now if not same(passed.get(name), now[name])}
            passed.update(changed)
            scope.write_all(changed)

    def end() -> None:
        values = {}
        for name, output in saved.items():
            with contextlib.suppress(KeyError):  # a tree that failed may have nothing to give
                values[name] = scope.read(output)
        context.write(values)

    passes = node.values.get("on_change") == "pass"
    name = node.name or included.name
    return decorators.Subtree(name, child, begin, end, pass_on if passes else None)


def _static(node: TreeNode, included: Document, outer: Mapped[str, object]) -> dict[str, object]:
    """Return the inputs of an included tree that are known before the tree runs."""
    inputs = included.inputs.items()
    found = {name: each.values["default"] for name, each in inputs if "default" in each.values}
    for name, value in table_of(node.values.get("with")).items():
        found.pop(name, None)
        read = {each for one in computed_in(value) for each in one.expression.variables}
        if read <= outer.keys():
            with contextlib.suppress(ValueError):  # reported at the begin
                found[name] = resolve(value, outer.__getitem__)
    return found


def _writes(document: Document, nodes: Iterable[TreeNode]) -> set[str]:
    """Return the names of the variables that some nodes of a tree write."""
    return {each.name for node in nodes for each in writes_of(node, document)}


def _check(checker: Checker, node: TreeNode) -> None:
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
    elif isinstance(given, dict) and included is not None and isinstance(written, Mapping):
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
    """Return the type of an included tree's input; report an input that the tree does not have."""
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
    included, saved = node.included, table_of(node.values.get("save"))
    written = node.written.get("save")
    if included is None or not isinstance(written, Mapping):
        return
    for key, inner in written.pairs:
        output = saved.get(key.text)
        if not isinstance(output, str):
            continue
        declared = included.outputs.get(output)
        if declared is not None:
            checker.assigns(key.text, checker.declared_type(declared), inner)
        elif not checker.doubts_of(included).declares(output):
            _no_such(checker, included, "output", output, included.outputs, inner)


def _ends(values: Settings, inner: list[Can], at_once: bool) -> Can:
    refused = not at_once and bool(computed_in(values.get("with")))
    return Can(inner[0].succeed, inner[0].fail or refused)


KIND = leaf(
    "subtree",
    Text("a tree's file or name, as a text"),
    "Runs another tree. The tree sees only the values of `with`; `save` gives back its outputs.",
    "subtree: recover\nwith: {home: 0.0}",
    Key("with", Values(), "Values for the tree's inputs."),
    Key("on_change", Choice(("ignore", "pass")),
        "Whether the running tree gets inputs that have changed.",
        default="ignore"),
    Key("save", Table(Name()), "Variables for the outputs of the tree."),
    Key("namespace", NAMESPACE, "Put before all relative names of the tree."),
    reads="with",
    build=_build, check=_check, ends=_ends, includes=True,
)  # fmt: skip
