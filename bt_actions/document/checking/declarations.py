"""Checks what a document declares: its inputs, outputs and topics, their types and defaults."""

from __future__ import annotations

from bt_actions.document.checking.checker import Checker
from bt_actions.document.findings import Related
from bt_actions.document.language.types import TypeNameError, parse_type
from bt_actions.document.language.values import BAD, computed_in
from bt_actions.document.reading.tree import Declared
from bt_actions.document.yaml.nodes import span_of
from bt_actions.messages.fields import FieldType, Message


def check_declarations(checker: Checker) -> None:
    """Report what is wrong, and make what is declared known to the checker."""
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


def _check_default(checker: Checker, declared: Declared, default: object) -> None:
    node = declared.written("default")
    for computed in computed_in(default):
        checker.source.report(
            "BT204", span_of(computed.node), "a default is a plain value: it can read nothing"
        )
        return
    kind = checker.variables.get(declared.name)
    if kind is not None:
        checker.fit(kind, default, node, known=())
    checker.finite(default, node)
