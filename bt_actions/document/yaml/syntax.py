"""Reports of syntax errors, in words for an author who wants to mend the text.

libyaml stops at the first character that fits no rule of YAML, and names the rule, not the mistake.
The mistake often stands earlier: a missing space behind a ':' makes a text of a key, and libyaml
complains of the next ':' on the line below. `_explain` therefore asks for one typical mistake after
the other, from the most certain to the least: a tab, a second ':', a text that a bracket cuts, a
character behind a closed value, a line that begins in no column of an open block. libyaml's own
words are the last answer.

A syntax error leaves no nodes. All questions go to lines: to the line where libyaml stopped, to the
line above it, and, for a column, to the keys and dashes of the lines above (`_opened_above`).
"""

from __future__ import annotations

import re
from typing import NamedTuple

import yaml

from bt_actions.document.findings import Place, Related, Span
from bt_actions.document.findings.elsewhere import notation_here
from bt_actions.document.yaml.source import Source

_OPENS = re.compile("flow mapping|flow sequence|quoted scalar")
_EXPECTED = ("expected key", "expected '-' indicator", "expected <document start>")
"""libyaml's words for a line that is not indented as its siblings are."""
_REACH = 200
"""Characters of a line that are looked at, before and behind the place."""
_BRACKETED = re.compile(r"""([^\s,:{}\[\]'"][^,:{}\[\]'"]*)(\[[^\[\]{}]*\]?)""")
_ELEMENT = re.compile(r"(\$\w[\w.]*|\w+\.[\w.]+)\[(\d+)\]")
_SHELL = re.compile(r"\$\{[^{}]*\}")
_BRACED = re.compile(r"\{ *([A-Za-z_]\w*) *\} *$")
_UNSPACED = re.compile(r" *(?:- +)*([A-Za-z_]\w*):([^ \t:#/][^:#]*)$")
_DASH = re.compile(r"-( +|$)")
_KEY = re.compile(r"""["']?([\w<][^:'"]{0,40})["']?\s*:(?:\s|$)""")
_QUOTES = {
    "'": "inside ' ' a quote is written twice; or put the text in \" \"",
    '"': 'inside " " a quote is written \\"; or put the text in \' \'',
}


class _Said(NamedTuple):
    """One finding to be: its place and its words."""

    span: Span
    message: str
    hint: str | None = None
    code: str = "BT102"


def report_syntax(source: Source, error: yaml.YAMLError) -> None:
    """Report libyaml's error. Nothing behind it can be read."""
    what = getattr(error, "context", None) or ""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if "block scalar" in what or "simple key" in what:
        mark = error.context_mark  # type: ignore[attr-defined]  # where it begins
    problem = getattr(error, "problem", None) or str(error) or "this is not YAML"
    line, column = (mark.line + 1, mark.column + 1) if mark is not None else (1, 1)
    if line > len(source.lines) > 0:
        line, column = len(source.lines), len(source.lines[-1]) + 1
    said = _explain(source, problem, line, column)
    opened = _opened(source, error) if said.hint is None else None
    source.report(said.code, said.span, said.message, hint=said.hint, related=opened)


def _opened(source: Source, error: yaml.YAMLError) -> Related | None:
    """Return the place of a brace, bracket or quote that is never closed, if that is the error."""
    what, mark = getattr(error, "context", None) or "", getattr(error, "context_mark", None)
    if mark is None or not _OPENS.search(what):
        return None
    return Related(Place(source.name, mark.line + 1, mark.column + 1), "opened here")


def _explain(source: Source, problem: str, line: int, column: int) -> _Said:
    text = source.line(line) or ""
    span = Span(line, column, line, column + 1)
    indent = text[: len(text) - len(text.lstrip())]
    if "\t" in indent or text[column - 1 : column] == "\t":
        at = text.find("\t") + 1
        span = Span(line, at, line, at + 1)
        return _Said(span, "a tab cannot indent YAML", "use spaces", "BT103")
    if "mapping values are not allowed" in problem:
        return _second_colon(source, text, span)
    cut = _cut_text(problem, text, span) or _behind(problem, text, span)
    if cut is not None:
        return cut
    if "could not find expected ':'" in problem:
        return _Said(span, "a key without its ':'")
    if any(expected in problem for expected in _EXPECTED):
        if column > len(indent) + 1:
            return _Said(span, "this cannot stand behind what is before it", "put it in quotes")
        return _Said(
            span, f"this lines up with nothing above: it begins in column {column}",
            _column_hint(source, line) or "check the indentation",
        )  # fmt: skip
    if "unexpected end of stream" in problem:
        return _Said(span, "the quote that was opened is never closed")
    if "cannot start any token" in problem:
        bad = text[column - 1 : column]
        return _Said(span, f"no text begins with {bad!r}", "put it in quotes")
    return _Said(span, problem)


def _second_colon(source: Source, text: str, span: Span) -> _Said:
    """Explain a ':' where no key can stand: often the line above holds a key without a space."""
    before = text[: span.column - 1]
    above = next((at for at in range(span.line - 1, 0, -1) if source.lines[at - 1].strip()), 0)
    if ": " in before or not above:
        return _Said(span, "a second ':' on this line", "put a text that holds ': ' in quotes")
    unspaced = _UNSPACED.match(source.lines[above - 1])
    if unspaced is None:
        message = "this line goes on with the text above it, where no ':' can stand"
        return _Said(span, message, _column_hint(source, span.line) or "check the indentation")
    key, rest = unspaced[1], unspaced[2].rstrip()
    column = unspaced.end(1) + 1
    span = Span(above, column, above, column + 1)
    return _Said(span, "a space is missing behind the ':'", f"write '{key}: {rest}'")


def _cut_text(problem: str, text: str, span: Span) -> _Said | None:
    """Explain a text that a bracket or a brace ends inside { } and [ ]: ``$a[0] > 2``, ``${a}``."""
    if "expected ','" not in problem and "cannot start any token" not in problem:
        return None
    at = span.column - 1
    start = max(0, at - _REACH)
    for match in _SHELL.finditer(text[start : at + _REACH]):
        if start + match.start() + 1 == at:
            message = f"'{{' ends a text inside {{ }} and [ ], so {match[0]!r} is cut"
            return _Said(span, message, notation_here(match[0]), "BT118")
    for match in _BRACKETED.finditer(text[start : at + _REACH]):
        rest = text[start + match.end() : at]
        if start + match.start(2) != at and (start + match.end() > at or rest.strip()):
            continue
        named = _ELEMENT.fullmatch(match[0])
        quoted = "put it in quotes"
        hint = f"write {named[1]}.{named[2]}, or {quoted}" if named is not None else quoted
        message = f"'[' ends a text inside {{ }} and [ ], so {match[0]!r} is cut"
        bracket = start + match.start(2) + 1
        place = Span(span.line, bracket, span.line, bracket + 1)
        return _Said(place, message, hint, "BT118")
    return None


def _behind(problem: str, text: str, span: Span) -> _Said | None:
    """Explain characters behind a quote, a brace or a bracket that has ended a value already."""
    at = span.column - 1
    if not text[at:].strip():
        return None
    before = text[max(0, at - _REACH) : at]
    braced = _BRACED.search(before)
    if braced is not None:
        column = span.column - len(before) + braced.start()
        span = Span(span.line, column, span.line, column + len(braced[0].rstrip()))
        hint = f"leave the braces away, or write ${braced[1]} for a variable"
        return _Said(span, f"{{{braced[1]}}} is read as a mapping", hint, "BT117")
    inside = "expected ','" in problem  # { } or [ ], where a comma may be missing
    last = before[-1:] if inside else before.rstrip()[-1:]
    if last in _QUOTES:
        return _Said(span, f"the {last} before this ends the text", _QUOTES[last])
    if last and last in "}]" and not inside:
        begin = "{" if last == "}" else "["
        hint = f"a text that begins with '{begin}' needs quotes"
        return _Said(span, f"nothing can stand behind the '{last}' on its line", hint)
    return None


class _Open(NamedTuple):
    """A key, or the dash of an item (without a name), that a line may line up with."""

    column: int
    line: int
    name: str = ""


def _column_hint(source: Source, line: int) -> str | None:
    """Say where a line should begin: ``begin it in column 7, as the item in line 5 does``.

    A key or a dash is open until a line begins further to the left.
    """
    text = source.line(line) or ""
    column = _indent(text) + 1
    is_item = _DASH.match(text.lstrip(" ")) is not None
    opened = _opened_above(source, line)
    fitting = [one for one in opened if is_item != bool(one.name) and one.column != column]
    if not fitting:
        return None
    nearest = min(fitting, key=lambda one: (abs(one.column - column), -one.column))
    what = repr(nearest.name) if nearest.name else "the item"
    hint = f"begin it in column {nearest.column}, as {what} in line {nearest.line} does"
    if not is_item and any(one.column == column and not one.name for one in opened):
        return f"{hint}, or with '- ' for another item"
    return hint


def _opened_above(source: Source, line: int) -> list[_Open]:
    """Return the open keys and dashes where a line begins, from the outside to the inside."""
    opened: list[_Open] = []
    for number, text in enumerate(source.lines[: line - 1], 1):
        at = _indent(text)
        if text[at : at + 1] in ("", "#"):
            continue
        dash = _DASH.match(text, at)
        while opened and opened[-1].column > at + bool(dash and opened[-1].name):
            opened.pop()  # but for the key of a list that is indented as its key is
        while dash := _DASH.match(text, at):
            opened.append(_Open(at + 1, number))
            at = dash.end()
        if key := _KEY.match(text, at):
            opened.append(_Open(at + 1, number, key[1]))
    return opened


def _indent(text: str) -> int:
    return len(text) - len(text.lstrip(" "))
