"""Values in a tree: literals, and expressions that are computed on demand.

A scalar that is just `$name` keeps its type; `= $a + 1` computes; `$(name)` stands inside a text;
`$$` is a dollar sign. Nothing is evaluated here.

A tree can double a value in each round (`set: {x: [$x, $x]}`). Both halves are one object, so the
doubling costs nothing until the value is compared or made a text, which then takes for ever: hence
the bounds. Messages and arrays are not looked into: ROS has bounded them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from collections.abc import Mapping as MappingType
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Final

from bt_actions.document.findings import DocumentError, Span
from bt_actions.document.findings.elsewhere import notation_here
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.mistaken import cut_hint, report_braces, warn_cut, warn_quotes
from bt_actions.document.yaml.nodes import (
    Listing,
    Mapping,
    Node,
    Scalar,
    beyond_floats,
    data_of,
    span_of,
)
from bt_actions.document.yaml.source import SUFFIXES, Source, read_source
from bt_actions.document.yaml.written import inner_span
from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from bt_actions.expressions.values import MAX_ITEMS as MAX_TEXT
from bt_actions.utilities.plain_data import numbers_only

MAX_ITEMS = 1_000_000
"""Numbers, texts, lists and mappings in one value, each counted as often as a path leads to it."""
MAX_CHARACTERS = 10_000_000
"""Characters of all texts in one value."""
MAX_LEVELS = 100
"""Lists and mappings inside each other."""
_END = object()
Lookup = Callable[[str], object]


class _Bad:
    """The stand-in for a reported value: nothing more is reported of it."""

    def __repr__(self) -> str:
        return "BAD"


BAD: Final = _Bad()


@dataclass(slots=True, eq=False)
class Computed:
    """A value that an expression gives on demand; `start` is the place in the scalar."""

    expression: Expression
    node: Scalar
    start: int = 0

    def evaluate(self, variable: Lookup) -> object:
        """Return the value. Raises ExpressionError."""
        return self.expression.evaluate({}, variable)

    def span(self, source: Source, start: int, end: int) -> Span:
        """Return the range of some columns of the expression in the text."""
        return inner_span(self.node, source, self.start + start, self.start + end)


@dataclass(slots=True, eq=False)
class Interpolated:
    """A text with values in it."""

    parts: tuple[str | Computed, ...]
    node: Scalar

    def evaluate(self, variable: Lookup) -> str:
        """Return the text. Raises ExpressionError, also for a text beyond an expression's bound."""
        texts, left = [], MAX_TEXT
        for part in self.parts:
            text = part if isinstance(part, str) else _as_text(part.evaluate(variable))
            texts.append(text)
            left -= len(text)
            if left < 0:
                raise ExpressionError(_TOO_LONG)
        return "".join(texts)


def refuse_large(value: object, *, items: int = MAX_ITEMS, characters: int = MAX_CHARACTERS) -> int:
    """Return the number of items in a value.

    Raises ValueError for a value that is larger, or nested deeper than `MAX_LEVELS`. Takes no more
    time than a value of the largest size.
    """
    left = items
    stack: list[Iterator[object]] = [iter((value,))]
    while stack:
        item = next(stack[-1], _END)
        if item is _END:
            stack.pop()
            continue
        left -= 1
        if isinstance(item, str):
            characters -= len(item)
        elif isinstance(item, list | tuple):
            if len(item) <= left and numbers_only(item):
                left -= len(item)
                continue
            stack.append(iter(item))
        elif isinstance(item, MappingType):
            stack.append(chain.from_iterable(item.items()))
        if left < 0 or characters < 0:
            raise ValueError("the value is too large")
        if len(stack) > MAX_LEVELS + 1:
            raise ValueError(f"the value is nested deeper than {MAX_LEVELS} levels")
    return items - left


def spoken(value: object, variable: Lookup) -> str:
    """Return the text of a log, whatever the log reads.

    `(no value)` stands for a part that cannot be computed. An ellipsis ends a text that is longer
    than an expression may make.
    """
    text = ""
    for part in value.parts if isinstance(value, Interpolated) else (value,):
        try:
            text += part if isinstance(part, str) else _as_text(resolve(part, variable))
        except ExpressionError as error:
            text += "…" if error.message == _TOO_LONG else "(no value)"
        if len(text) > MAX_TEXT:
            return f"{text[: MAX_TEXT - 1]}…"
    return text


_TOO_LONG = f"the text would be longer than {MAX_TEXT:,} characters"
_VARIABLE = re.compile(r"\$[A-Za-z_]\w*(?:\.\w+|\[(?:-?\d+|-?\d*:-?\d*)\])*", re.ASCII)
_DOLLAR = re.compile(r"\$\$|\$\(([^()$]*)\)|\$")


def read_value(node: Node, source: Source) -> object:
    """Return plain data with `Computed` and `Interpolated` in it, or BAD after a report."""
    if isinstance(node, Scalar):
        value = _read_scalar(node, source)
        if isinstance(value, Computed):
            if value.start:  # $name alone may be a number
                warn_cut(node, source, "expression")
        elif isinstance(value, (str, Interpolated)):
            warn_cut(node, source, "text")
            warn_quotes(node, source)
        return value
    bad = False
    if isinstance(node, Listing):
        items = [read_value(item, source) for item in node.items]
        bad = any(item is BAD for item in items)
        return BAD if bad else items
    assert isinstance(node, Mapping)
    if report_braces(node, source):
        return BAD
    data: dict[str, object] = {}
    for key, inner in node.pairs:
        value = read_value(inner, source)
        bad = bad or value is BAD
        data[key.text] = value
    return BAD if bad else data


def _read_scalar(node: Scalar, source: Source) -> object:
    text = node.text
    if "$" not in text and not text.startswith(("=", "@")):
        if beyond_floats(node):
            source.report("BT204", span_of(node), f"{text} does not fit a float64")
            return BAD
        return node.value
    if names_value(text):
        return _computed(node, source, text, 0)
    if text.startswith("= "):
        return _computed(node, source, text[2:], 2)
    if names_file(text):
        return _read_file(node, source)
    if node.plain and _lacks_space(text):
        span = inner_span(node, source, 0, 1)
        quotes = "" if "$" in text else ", or put it in quotes to mean the text"
        hint = f"write '= {text[1:]}'{quotes}"
        source.report("BT114", span, "'=' computes only with a space behind it", hint=hint)
        return BAD
    return _interpolated(node, source)


def _lacks_space(text: str) -> bool:
    """Return whether a text is an expression but for the space behind its '='."""
    return text.startswith("=") and computes(text[1:])


def names_value(text: str) -> bool:
    """Return whether a text stands for one value: ``$name``, ``$name.field.0``, ``$name[1:3]``."""
    return _VARIABLE.fullmatch(text) is not None


def computes(text: str) -> bool:
    """Return whether a text is an expression."""
    try:
        _expression(text, frozenset())
    except ExpressionError:
        return False
    return True


def names_file(text: str) -> bool:
    """Return whether a text stands for the data in a file: ``@points.yaml``."""
    return text.startswith("@") and text.endswith(SUFFIXES)


def read_data(path: Path, *, pipes: bool = False) -> object:
    """Return the data in a YAML or JSON file; a dollar sign has no meaning in the data.

    Raises DocumentError, with the place in that file, and ValueError for data larger than any value
    of a tree. `pipes` has the meaning it has in `read_source`.
    """
    source = read_source(path, pipes=pipes)
    node = compose(source)
    if source.findings:
        raise DocumentError(source.findings)
    data = None if node is None else data_of(node)
    refuse_large(data)
    return data


def _read_file(node: Scalar, source: Source) -> object:
    path = Path(node.text[1:])
    if source.path is not None:
        path = source.path.parent / path
    if path not in source.files:
        try:
            if refusal := source.refusal(path):
                raise ValueError(refusal)
            source.files[path] = read_data(path)
        except ValueError as error:
            source.files[path] = error
    data = source.files[path]
    if not isinstance(data, ValueError):
        if source.items <= MAX_ITEMS:
            source.items += refuse_large(data)
        if source.items <= MAX_ITEMS:
            return data
        data = ValueError(f"of data in files, a tree takes {MAX_ITEMS:,} items")
    text = f"{path.name}: {data}"
    if isinstance(data, DocumentError):
        first = data.findings[0]
        text = f"{path.name}:{first.line}:{first.column}: {first.message}"
    source.report("BT209", span_of(node), text)
    return BAD


def _computed(node: Scalar, source: Source, text: str, start: int) -> object:
    expression = read_expression(node, source, text, start, frozenset())
    return BAD if expression is None else Computed(expression, node, start)


def _interpolated(node: Scalar, source: Source) -> object:
    parts: list[str | Computed] = []
    at = 0
    text = node.text
    for match in _DOLLAR.finditer(text):
        parts.append(text[at : match.start()])
        at = match.end()
        if match[0] == "$$":
            parts.append("$")
            continue
        if match[1] is None:
            span = inner_span(node, source, match.start(), match.end())
            hint = notation_here(text, match.start())
            if hint is None:
                hint = "write $(name) inside a text, and $$ for a dollar sign"
            if _lacks_space(text):
                hint = f"write '= {text[1:]}' with a space to compute it"
            elif computes(text):
                hint = f"write '= {text}' to compute it, and $(name) inside a text"
            source.report("BT115", span, "this dollar sign refers to nothing", hint=hint)
            return BAD
        written = "$" + match[1].strip()
        if not names_value(written):
            span = inner_span(node, source, match.start(), match.end())
            hint = notation_here(text, match.start()) or "$(name) or $(name.field)"
            source.report("BT115", span, f"{match[0]} holds no variable's name", hint=hint)
            return BAD
        part = _computed(node, source, written, match.start(1) - 1)
        if part is BAD:
            return BAD
        assert isinstance(part, Computed)
        parts.append(part)
    parts.append(text[at:])
    kept = tuple(part for part in parts if part != "")
    if all(isinstance(part, str) for part in kept):
        return "".join(str(part) for part in kept)
    return Interpolated(kept, node)


def read_expression(
    node: Scalar, source: Source, text: str, start: int, roots: frozenset[str]
) -> Expression | None:
    """Return the expression in a part of a scalar, or None after a report."""
    try:
        return _expression(text, roots)
    except ExpressionError as error:
        span = inner_span(node, source, start + error.column, start + error.end_column)
        hint = cut_hint(node, source) or notation_here(text, computes=True)
        source.report("BT114", span, error.message, hint=hint)
        return None


@lru_cache(maxsize=4096)
def _expression(text: str, roots: frozenset[str]) -> Expression:
    """Return an expression, shared by all places with the same text: expressions never change."""
    return Expression(text, roots=roots, constants=_named_constant)


def _named_constant(name: str) -> object:
    from bt_actions.messages.conveniences import (
        constant,  # here, so that reading a tree needs no ROS
    )

    return constant(name, None)


def locate(node: Node, path: tuple[str | int, ...], *, at_key: bool = False) -> Node:
    """Return the YAML node at a path inside another, or the last node on the way there."""
    for depth, step in enumerate(path):
        last = depth == len(path) - 1
        if isinstance(node, Mapping):
            for key, value in node.pairs:
                if key.text == step:
                    if last and at_key:
                        return key
                    node = value
                    break
            else:
                return node
        elif isinstance(node, Listing) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
        else:
            return node
    return node


def computed_in(value: object) -> list[Computed]:
    """Return every computed part of a value, in the order of the text."""
    if isinstance(value, Computed):
        return [value]
    if isinstance(value, Interpolated):
        return [part for part in value.parts if isinstance(part, Computed)]
    if isinstance(value, dict):
        value = [*value.values()]
    elif isinstance(value, list) and numbers_only(value):
        return []
    return [each for item in value for each in computed_in(item)] if isinstance(value, list) else []


def constant_of(computed: Computed) -> object:
    """Return the value of an expression over numbers and texts alone; None for any other."""
    expression = computed.expression
    if expression.variables or expression.form.roots or expression.form.constants:
        return None
    try:
        return computed.evaluate(lambda _name: None)
    except ExpressionError:
        return None


def resolve(value: object, variable: Lookup) -> object:
    """Return the value with all its parts computed. Raises ExpressionError."""
    if isinstance(value, (Computed, Interpolated)):
        return value.evaluate(variable)
    if isinstance(value, MappingType):
        return {key: resolve(item, variable) for key, item in value.items()}
    if isinstance(value, list):
        if numbers_only(value):
            return [*value]
        return [resolve(item, variable) for item in value]
    return value


def _as_text(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    from bt_actions.messages.conversion import to_plain  # here, so that reading a tree needs no ROS

    try:
        refuse_large(value, items=MAX_TEXT, characters=MAX_TEXT)  # an item takes a character
        value = to_plain(value)
        refuse_large(value, items=MAX_TEXT, characters=MAX_TEXT)
    except ValueError:
        raise ExpressionError(_TOO_LONG) from None
    return str(value)
