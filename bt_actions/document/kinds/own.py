"""Kinds that a tree declares under `kinds`, by the children that they hold."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from bt_actions.document.findings import Related
from bt_actions.document.kinds.given import Behaviour, Checker, Context, TreeNode, own, py_trees
from bt_actions.document.language.kinds import End, composite, decorator, leaf
from bt_actions.document.language.scalars import Name, NodeName
from bt_actions.document.language.shapes import Key, Table, Values
from bt_actions.document.language.types import TypeNameError, parse_type
from bt_actions.document.language.values import Computed
from bt_actions.document.reading.inputs import convert
from bt_actions.document.reading.tree import table_of, text_of
from bt_actions.document.yaml.nodes import Mapping as YamlMapping
from bt_actions.document.yaml.nodes import span_of
from bt_actions.expressions.text import ExpressionError
from bt_actions.messages.fields import FieldType
from bt_actions.utilities.suggest import did_you_mean


def _build(node: TreeNode, context: Context, *children: Behaviour) -> Behaviour:
    """Make a behaviour; report a failure to the document's source, and return `Failure` instead."""
    from bt_actions.document.language.classes import ClassError, make_behaviour

    values = context.document.kinds[node.key.text].values
    held = {"one": "child", "many": "children"}.get(text_of(values, "children"))
    arguments = {held: children[0] if held == "child" else list(children)} if held else {}
    try:
        made = make_behaviour(text_of(values, "python"), node.name, arguments)
    except ClassError as error:
        node.source.report("BT215", span_of(node.key), str(error))
        return py_trees.behaviours.Failure(node.name)
    given = {
        name: {
            **declared,
            "value": table_of(node.values.get("with")).get(name, declared.get("default")),
        }
        for name, declared in table_of(values.get("inputs")).items()
    }
    saved = {output: name for name, output in table_of(node.values.get("save")).items()}

    def write(outputs: Mapping[str, object]) -> None:
        try:
            context.write({saved[name]: outputs[name] for name in outputs if name in saved})
        except ValueError as error:
            raise ExpressionError(str(error)) from None

    outputs = table_of(values.get("outputs"))
    own.equip(made, {name: _reader(each, context) for name, each in given.items()}, outputs, write)
    return made


def _reader(declared: Mapping[str, object], context: Context) -> Callable[[], object]:
    compute = context.value(declared["value"])

    def read() -> object:
        try:
            return convert(compute(), str(declared["type"]), types=context.types)
        except ExpressionError:
            raise
        except ValueError as error:
            raise ExpressionError(str(error)) from None

    return read


def _check(checker: Checker, node: TreeNode) -> None:
    from bt_actions.document.language.classes import ClassError, find_behaviour, refusal

    declared = checker.document.kinds[node.key.text]
    path = declared.values.get("python")
    if refused := refusal(path, checker.python):
        checker.source.report("BT214", span_of(node.key), refused)
    elif isinstance(path, str) and checker.types:
        try:
            find_behaviour(path)
        except ClassError as error:
            at = declared.written("python") if declared.source is checker.source else node.key
            checker.source.report("BT214", span_of(at), str(error))
    given, written = node.values.get("with"), node.written.get("with")
    inputs = table_of(declared.values.get("inputs"))
    for name, each in inputs.items():
        if (
            "default" not in each
            and not isinstance(given, Computed)
            and name not in table_of(given)
        ):
            checker.source.report(
                "BT211", span_of(node.key), f"{declared.name!r} needs the input {name!r}",
                hint=f"with: {{{name}: ...}}", related=Related(declared.place, "declared here"),
            )  # fmt: skip
    for key, inner in written.pairs if isinstance(written, YamlMapping) else ():
        if key.text in inputs:
            checker.value(_type(checker, inputs[key.text]), table_of(given).get(key.text), inner)
        else:
            near = did_you_mean(key.text, inputs)
            text = f"{declared.name!r} has no input {key.text!r}{near}"
            checker.source.report("BT212", span_of(key), text)
    outputs, saved = table_of(declared.values.get("outputs")), node.written.get("save")
    for key, inner in saved.pairs if isinstance(saved, YamlMapping) else ():
        output = table_of(node.values.get("save")).get(key.text)
        if output in outputs:
            checker.assigns(key.text, _type(checker, outputs[output]), inner)
        elif isinstance(output, str):
            near = did_you_mean(output, outputs)
            text = f"{declared.name!r} has no output {output!r}{near}"
            checker.source.report("BT213", span_of(inner), text)


def _type(checker: Checker, declared: Mapping[str, object]) -> FieldType | None:
    try:
        return parse_type(str(declared.get("type")), types=checker.types)
    except TypeNameError:  # reported at the declaration
        return None


_KEYS = (
    Key("with", Values(), "Values for the kind's inputs."),
    Key("save", Table(Name()), "Names here for the kind's outputs."),
)
_own: Callable[..., dict[str, Any]] = partial(dict, build=_build, check=_check, slow=True)
OWN = {
    "none": leaf("none", NodeName(), "", "", *_KEYS, **_own(reads="with")),
    "one": decorator("one", "", "", *_KEYS, **_own(again=End.ANY)),
    "many": composite("many", "", "", *_KEYS, **_own(again=End.ANY)),
}
