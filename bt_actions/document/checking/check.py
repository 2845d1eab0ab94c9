"""The checks of names and types, in their order.

The checks of single kinds are in `document/kinds/`, those of single values in `checker.py`. A
finding about an imported file stands in that file where the file is wrong by itself. Where the file
is wrong only in this tree, the finding stands at the import.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from bt_actions.document.checking.checker import Checker
from bt_actions.document.checking.names import check_names
from bt_actions.document.checking.server_names import check_server_names
from bt_actions.document.checking.value_types import FLOAT, INTEGER
from bt_actions.document.findings import Related
from bt_actions.document.language.keys import GATES
from bt_actions.document.language.scalars import Duration, Whole
from bt_actions.document.language.types import TypeNameError, parse_type
from bt_actions.document.language.values import (
    BAD,
    Computed,
    Interpolated,
    computed_in,
    locate,
)
from bt_actions.document.reading.tree import (
    Declared,
    TreeNode,
    merged,
    settings_of,
    table_of,
    when_of,
)
from bt_actions.document.yaml.nodes import Mapping, span_of
from bt_actions.document.yaml.source import Source
from bt_actions.messages.conversion import Problem, examine
from bt_actions.messages.fields import FieldType, Message

_PLAIN = "a default is a plain value: it can read nothing"


def check_document(checker: Checker) -> None:
    """Report everything that is wrong with names and types to the documents' own sources."""
    _check_declarations(checker)
    checker.collect_writes()
    _check_actions(checker)
    for node in checker.document.nodes():
        checker.reader = node
        _check_form(checker, node)
        if node.kind.check is not None:
            node.kind.check(checker, node)
        if node.alias is not None:
            _check_together(checker, node)
    _check_defaults(checker)
    check_names(checker)
    check_server_names(checker)


def _check_form(checker: Checker, node: TreeNode) -> None:
    """Check a node by the forms of its kind's keys: conditions, numbers, the ROS interface."""
    for key in GATES:
        if key in node.values:
            checker.condition(node.values[key], {})
    kind = node.kind
    form = kind.keys[kind.reads].shape if kind.reads in kind.keys else kind.value
    value = node.values.get(kind.reads)
    if kind.interface is not None:
        checker.call(node.values, node.written, checker.class_of(node), kind.interface)
    elif kind.asks:
        checker.condition(value, {})
    elif isinstance(value, Computed) and isinstance(form, Whole):
        checker.number(value, INTEGER, form.least)
    elif isinstance(value, Computed) and isinstance(form, Duration):
        checker.number(value, FLOAT, 0, zero=form.zero)


def _check_declarations(checker: Checker) -> None:
    """Check all declarations, and make them known to the checker."""
    document = checker.document
    for table in (document.inputs, document.outputs, document.topics):
        for name, declared in table.items():
            kind = _declared_type(checker, declared, topic=table is document.topics)
            earlier = checker.declared_at.get(name)
            if earlier is None:
                checker.declared_at[name] = declared
                checker.variables[name] = kind
                continue
            hint = None
            if table is document.outputs:
                hint = f"give the output a name of its own: set: {{NAME: ${name}}}"
            own, other = declared, earlier
            if declared.source is not checker.source:
                own, other = earlier, declared
            checker.source.report(
                "BT216", span_of(own.key), f"{name!r} is declared twice",
                hint=hint, related=Related(other.place, "first here"),
            )  # fmt: skip
            checker.variables[name] = None
    for declared in document.inputs.values():
        default = declared.values.get("default", BAD)
        if default is not BAD:
            _check_default(checker, declared, default)
    for own in document.kinds.values():
        for key in ("inputs", "outputs"):
            for name, each in table_of(own.values.get(key)).items():
                _check_type(checker, own, name, table_of(each).get("type"))
                for computed in computed_in(table_of(each).get("default")):
                    checker.source.report("BT204", span_of(computed.node), _PLAIN)
    for declared in document.topics.values():
        if "default" in declared.values and declared.source is checker.source:
            kind = checker.variables.get(declared.name)
            checker.value(kind, declared.values["default"], declared.written("default"))


def _declared_type(checker: Checker, declared: Declared, *, topic: bool) -> FieldType | None:
    text = declared.values.get("type")
    if not isinstance(text, str):
        return None
    if topic:
        cls = checker.interface(text, "msg", declared.written("type"), declared.source)
        return Message(cls) if cls is not None else None
    try:
        return parse_type(text, types=checker.types)
    except TypeNameError as error:
        code = "BT205" if error.missing else "BT207"
        checker.source.report(code, span_of(declared.written("type")), str(error))
        return None


def _check_type(checker: Checker, own: Declared, name: str, text: object) -> None:
    try:
        parse_type(str(text), types=checker.types)
    except TypeNameError as error:
        if isinstance(text, str) and own.source is checker.source:
            code = "BT205" if error.missing else "BT207"
            checker.source.report(code, span_of(own.key), f"{name}: {error}")


def _check_default(checker: Checker, declared: Declared, default: object) -> None:
    node = declared.written("default")
    for computed in computed_in(default):
        checker.source.report("BT204", span_of(computed.node), _PLAIN)
        return
    kind = checker.variables.get(declared.name)
    if kind is not None:
        checker.fit(kind, default, node, known=())
    checker.finite(default, node)


def _check_actions(checker: Checker) -> None:
    """Check the actions that are declared here, and of imported ones what the nodes take over."""
    users: dict[str | None, list[dict[str, object]]] = {}
    if checker.document.imported:
        for node in checker.document.nodes():
            users.setdefault(node.alias, []).append(node.values)
    for declared in checker.document.actions.values():
        if not isinstance(declared.node, Mapping):
            continue
        checker.reader = declared
        if declared.source is checker.source:
            cls = checker.action_class(declared)
            checker.call(declared.values, declared.parts, cls)
            continue
        values = _left(declared.values, users.get(declared.name, []))
        with _within(checker, declared.source, f"the imported action {declared.name!r}"):
            checker.call(values, declared.parts, checker.action_class(declared))


def _check_defaults(checker: Checker) -> None:
    """Check the condition in `defaults` for each action that has none nearer."""
    when = when_of(checker.document.defaults)
    if when is None:
        return
    users = {
        node.alias or node.values.get("type"): node
        for node in checker.document.nodes()
        if node.is_action and when_of(settings_of(node, checker.document)) is when
    }
    documents = checker.document.with_imports()
    source = next(one.source for one in documents if when_of(one.values.get("defaults")) is when)
    with _within(checker, source, "the imported defaults"):
        for node in users.values():
            checker.reader = checker.document.actions.get(node.alias or "", checker.document)
            checker.condition(when, {"result": checker.received(node)})


@contextmanager
def _within(checker: Checker, source: Source, what: str) -> Iterator[None]:
    """Look at a part of a source, which may be imported.

    A mistake of an imported source that is one in this document only is told at the import.
    """
    own, written = checker.source, checker.document.node.get("import")
    if source is own or written is None:
        yield
        return
    checker.source = replace(source, findings=[], errors=0, unread=own.unread)
    try:
        yield
    finally:
        found, checker.source = checker.source.findings, own
        for one in found:
            if one not in source.findings:
                own.report(
                    one.code, span_of(written), f"{what}: {one.message}",
                    hint=one.hint, related=Related(one.place, "written here"),
                )  # fmt: skip


def _check_together(checker: Checker, node: TreeNode) -> None:
    """Check merged goals: each part may be right, and not fit the other (yaw, and x beside it)."""
    declared = checker.document.actions[node.alias or ""]
    shared, own = declared.values.get("goal"), node.values.get("goal")
    if not isinstance(shared, dict) or not isinstance(own, dict):
        return
    cls = checker.action_class(declared)
    if cls is None or not any(isinstance(own[name], dict) for name in own.keys() & shared):
        return

    def problems(goal: object) -> list[Problem]:
        return examine(Message(cls.Goal), goal, _is_computed)  # type: ignore[attr-defined]

    told = {*problems(own), *problems(shared)}
    for problem in problems(merged(shared, own)):
        if problem not in told:
            checker.source.report(
                "BT204", span_of(locate(node.written["goal"], problem.path)), problem.text,
                related=Related(declared.place, "merged with the goal here"),
            )  # fmt: skip


def _is_computed(value: object, _kind: FieldType, _path: tuple[str | int, ...]) -> bool:
    return value is BAD or isinstance(value, Computed | Interpolated)


def _left(settings: dict[str, object], nearer: list[dict[str, object]]) -> dict[str, object]:
    """Return the settings that something nearer does not replace everywhere."""
    left: dict[str, object] = {}
    for name, value in settings.items():
        over = [one[name] for one in nearer if name in one]
        inner = [one for one in over if isinstance(one, dict)]
        if len(over) < len(nearer):
            left[name] = value
        elif inner and isinstance(value, dict):
            left[name] = _left(value, inner)
    return left
