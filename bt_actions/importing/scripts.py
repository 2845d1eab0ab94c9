"""Scripts of BehaviorTree.CPP as expressions of ours.

Scripts there know numbers and texts: `true` is 1.0, and `!`, `&&` and `?` take numbers. Expressions
here tell true and false from numbers. So each part of a script has a sort, and the importer
converts a part of another sort than the needed one: `$n != 0`, `1 if $on else 0`, `float($text)`.

The grammar is that of BehaviorTree.CPP 4.10, with one surprise: `&&` and `||` bind equally, from
the left.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

_TOKEN = re.compile(
    r"""\s*(?:(?P<number>0[xX][0-9a-fA-F]+|\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)|(?P<text>'[^']*')"""
    r"""|(?P<name>@?[A-Za-z_]\w*)"""
    r"""|(?P<sign>:=|[-+*/]=|==|!=|<=|>=|&&|\|\||\.\.|[-+*/<>=!~&|^?:;()]))""",
    re.ASCII,
)
_BINDING = {  # our operators, the loosest first
    word: strength
    for strength, words in enumerate(("if", "or", "and", "not", "== != < <= > >=", "+ -", "* /"))
    for word in words.split()
}
_ATOM = 9
_LEVELS = (("&&", "||"), (), ("|", "^"), ("&",), ("..",), ("+", "-"), ("*", "/"))
"""Signs between two parts, the loosest first; comparisons have the empty place."""
_COMPARED = ("==", "!=", "<", "<=", ">", ">=")
_ASSIGNED = (":=", "=", "+=", "-=", "*=", "/=")
BITS = frozenset("&|^~")
DEEPEST = 20
"""Brackets inside of each other."""
LONGEST = 200
"""Words of a statement."""


class ScriptError(ValueError):
    """A script that cannot be read, or has no equal here."""


class Refused(ScriptError):
    """A part without an equal in our language; `what` is its row in refused.yaml."""

    def __init__(self, what: str, detail: str = "") -> None:
        super().__init__(detail or what)
        self.what, self.detail = what, detail


class Sort(Enum):
    """The sort of a value."""

    TRUTH = "bool"
    NUMBER = "float64"
    TEXT = "string"
    ANY = ""


class Part(NamedTuple):
    """A part of a script: `kind` number, text, truth, name, unary, binary, compare or if."""

    kind: str
    signs: tuple[str, ...]
    """The sign, the signs of a comparison, or the word of an atom."""
    parts: tuple[Part, ...] = ()


class Statement(NamedTuple):
    """A value for a variable; `name` is empty where nothing is done with the value."""

    name: str
    sign: str
    value: Part


class Said(NamedTuple):
    """An expression of ours."""

    text: str
    sort: Sort
    binds: int = _ATOM

    def inside(self, least: int) -> str:
        """Return the text as a part of an expression that binds as `least` does."""
        return self.text if self.binds >= least else f"({self.text})"


@lru_cache(maxsize=1024)
def statements(code: str) -> tuple[Statement, ...]:
    """Read a script. Raises ScriptError."""
    return tuple(_Reader(code).statements())


def condition(code: str) -> Part:
    """Read a script that is one expression. Raises ScriptError."""
    found = statements(code)
    if len(found) != 1 or found[0].name:
        raise ScriptError(f"a condition is one expression, not {code!r}")
    return found[0].value


class _Reader:
    def __init__(self, code: str) -> None:
        """Split a script into words. Raises ScriptError for a wrong word or a long statement."""
        self._tokens: list[tuple[str, str]] = []
        at, words, code = 0, 0, code.strip()
        while at < len(code):
            found = _TOKEN.match(code, at)
            if found is None:
                raise ScriptError(f"{code[at : at + 20]!r} in a script cannot be read")
            self._tokens.append((str(found.lastgroup), found[str(found.lastgroup)]))
            at = found.end()
            words = 0 if found["sign"] == ";" else words + 1
            if words > LONGEST:
                raise ScriptError(f"a script has a statement of more than {LONGEST} words")
        self._at = self._depth = 0

    def statements(self) -> list[Statement]:
        found = []
        while self._at < len(self._tokens):
            if self._takes(";"):
                continue
            value = self._expression()
            if (sign := self._sign()) in _ASSIGNED:
                self._at += 1
                if value.kind != "name":
                    raise ScriptError(f"{sign!r} in a script stands behind no name")
                found.append(Statement(value.signs[0], sign, self._expression()))
            else:
                found.append(Statement("", "", value))
            if self._at < len(self._tokens) and not self._takes(";"):
                raise ScriptError(f"{self._tokens[self._at][1]!r} has no place there in a script")
        return found

    def _sign(self) -> str:
        kind, text = self._tokens[self._at] if self._at < len(self._tokens) else ("", "")
        return text if kind == "sign" else ""

    def _takes(self, sign: str) -> bool:
        taken = self._sign() == sign
        self._at += taken
        return taken

    def _expression(self) -> Part:
        self._depth += 1
        if self._depth > DEEPEST:
            raise ScriptError("a script is nested too deep")
        asked = self._level(0)
        if self._takes("?"):
            then = self._expression()
            if not self._takes(":"):
                raise ScriptError("a ':' is missing behind a '?' in a script")
            asked = Part("if", (), (asked, then, self._expression()))
        self._depth -= 1
        return asked

    def _level(self, level: int) -> Part:
        if level == len(_LEVELS):
            return self._prefixed()
        left = self._level(level + 1)
        if not _LEVELS[level]:
            return self._compared(left, level)
        while (sign := self._sign()) in _LEVELS[level]:
            self._at += 1
            left = Part("binary", (sign,), (left, self._level(level + 1)))
        return left

    def _compared(self, left: Part, level: int) -> Part:
        signs, parts = [], [left]
        while (sign := self._sign()) in _COMPARED:
            self._at += 1
            signs.append(sign)
            parts.append(self._level(level + 1))
        return Part("compare", tuple(signs), tuple(parts)) if signs else left

    def _prefixed(self) -> Part:
        if (sign := self._sign()) in ("-", "!", "~"):
            self._at += 1
            return Part("unary", (sign,), (self._atom(),))
        return self._atom()

    def _atom(self) -> Part:
        if self._takes("("):
            inside = self._expression()
            if not self._takes(")"):
                raise ScriptError("a ')' is missing in a script")
            return inside
        if self._at == len(self._tokens) or self._tokens[self._at][0] == "sign":
            raise ScriptError("a value is missing in a script")
        kind, text = self._tokens[self._at]
        self._at += 1
        return Part("truth" if text in ("true", "false") else kind, (text,))


def names_in(part: Part) -> Iterator[str]:
    """Yield each name that a part reads."""
    if part.kind == "name":
        yield part.signs[0]
    for inner in part.parts:
        yield from names_in(inner)


def has_bits(part: Part) -> bool:
    """Return whether a part computes with single bits."""
    own = part.kind in ("unary", "binary") and not BITS.isdisjoint(part.signs)
    return own or any(map(has_bits, part.parts))


@dataclass
class Sorts:
    """The sorts of a tree's variables, from all that is written to them and done with them."""

    told: dict[str, set[Sort]] = field(default_factory=dict)
    """The sorts of written values."""
    used: dict[str, set[Sort]] = field(default_factory=dict)
    """The sorts that uses need."""
    _later: list[tuple[str, Part]] = field(default_factory=list)
    _alike: list[tuple[str, str]] = field(default_factory=list)

    def __getitem__(self, name: str) -> Sort:
        found = self.told.get(name) or self.used.get(name) or set()
        if len(found) == 1:
            return next(iter(found))
        return Sort.NUMBER if found == {Sort.TRUTH, Sort.NUMBER} else Sort.ANY

    def add_text(self, name: str, text: str) -> None:
        """Note a written text, which stands for a number where one is needed."""
        if re.fullmatch(r"\s*-?\d+(\.\d*)?([eE][-+]?\d+)?\s*", text):
            self._tell(name, Sort.NUMBER)
        elif text in ("true", "false"):
            self._tell(name, Sort.TRUTH)
        else:
            self._tell(name, Sort.TEXT)

    def add(self, code: Iterable[Statement]) -> None:
        """Note a script."""
        for name, sign, value in code:
            self._use(value, Sort.ANY)
            if name and value.kind == "name":
                self.alike(name, value.signs[0])
            if name and sign in (":=", "=", "+="):
                self._later.append((name, value))
            elif name:
                self._tell(name, Sort.NUMBER)

    def settle(self) -> None:
        """Share sorts among variables that take values from each other, once all is noted."""
        for _ in range(3):
            for name, value in self._later:
                if (sort := say(value, self.__getitem__, str, check=False).sort) is not Sort.ANY:
                    self._tell(name, sort)
            for one, other in (*self._alike, *(pair[::-1] for pair in self._alike)):
                if self[one] is Sort.ANY and self[other] is not Sort.ANY:
                    self.use(one, self[other])

    def add_condition(self, asked: Part) -> None:
        """Note a condition, as `add` notes a script."""
        self._use(asked, Sort.TRUTH)

    def alike(self, one: str, other: str) -> None:
        """Note that two variables are of one sort."""
        self._alike.append((one, other))

    def use(self, name: str, sort: Sort) -> None:
        """Note a use of a variable."""
        self.used.setdefault(name, set()).add(sort)

    def _tell(self, name: str, sort: Sort) -> None:
        self.told.setdefault(name, set()).add(sort)

    def _use(self, part: Part, wanted: Sort) -> None:
        if part.kind == "name":
            if wanted is not Sort.ANY:
                self.use(part.signs[0], wanted)
            return
        inner = [wanted] * len(part.parts)
        if part.kind == "if":
            inner[0] = Sort.TRUTH
        elif part.kind in ("unary", "binary"):
            sign = part.signs[0]
            sort = Sort.TRUTH if sign in ("!", "&&", "||") else Sort.NUMBER
            inner = [Sort.ANY if sign in ("+", "..") else sort] * len(part.parts)
            if sign == "+" and any(each.kind == "number" for each in part.parts):
                inner = [Sort.NUMBER] * 2
        elif part.kind == "compare":
            literal = {"number": Sort.NUMBER, "text": Sort.TEXT, "truth": Sort.TRUTH}
            found = {literal[each.kind] for each in part.parts if each.kind in literal}
            found |= {Sort.NUMBER for each in part.parts if each.kind in ("unary", "binary")}
            inner = [next(iter(found)) if len(found) == 1 else Sort.ANY] * len(part.parts)
            self._alike += pairwise(each.signs[0] for each in part.parts if each.kind == "name")
        for each, sort in zip(part.parts, inner, strict=True):
            self._use(each, sort)


def say(
    part: Part,
    sort_of: Callable[[str], Sort],
    reference: Callable[[str], str],
    *,
    check: bool = True,
) -> Said:
    """Say a part in our words; `reference` returns the words behind the dollar sign for a name.

    Raises Refused, but for parts that `check` leaves out.
    """

    def inner(each: Part) -> Said:
        return say(each, sort_of, reference, check=check)

    match part:
        case Part("number", (text,)):
            return Said(text + "0" * text.endswith("."), Sort.NUMBER)
        case Part("text", (text,)):
            return Said(_quoted(text[1:-1]), Sort.TEXT)
        case Part("truth", (text,)):
            return Said(text, Sort.TRUTH)
        case Part("name", (name,)):
            return Said(f"${reference(name)}", sort_of(name))
        case Part("if", _, (asked, then, otherwise)):
            return _chosen(truth(inner(asked)), inner(then), inner(otherwise))
        case Part("unary", ("!",), (value,)):
            return Said(f"not {truth(inner(value)).inside(_BINDING['not'])}", Sort.TRUTH,
                        _BINDING["not"])  # fmt: skip
        case Part("unary", ("-",), (value,)):
            return Said(f"-{_number(inner(value)).inside(_ATOM)}", Sort.NUMBER, _BINDING["*"])
        case Part("binary", ("&&" | "||" as sign,), (left, right)):
            word = "and" if sign == "&&" else "or"
            sides = (truth(inner(side)).inside(_BINDING[word]) for side in (left, right))
            return Said(f" {word} ".join(sides), Sort.TRUTH, _BINDING[word])
        case Part("binary", ("..",), sides):
            texts = (_text(inner(side)).inside(_BINDING["+"]) for side in sides)
            return Said(" + ".join(texts), Sort.TEXT, _BINDING["+"])
        case Part("binary", (sign,), (left, right)) if sign not in BITS:
            return _computed(sign, inner(left), inner(right))
        case Part("compare", signs, parts):
            return _comparison(signs, [inner(each) for each in parts])
    if check:
        raise Refused("bits")
    return Said("0", Sort.NUMBER)


def _quoted(text: str) -> str:
    return f'"{text}"' if "'" in text else f"'{text}'"


def _chosen(asked: Said, then: Said, otherwise: Said) -> Said:
    sort = then.sort
    if sort is not otherwise.sort:
        sorts = {then.sort, otherwise.sort}
        sort = Sort.NUMBER if sorts == {Sort.TRUTH, Sort.NUMBER} else Sort.ANY
        if sort is Sort.NUMBER:
            then, otherwise = _number(then), _number(otherwise)
    least = _BINDING["or"]
    text = f"{then.inside(least)} if {asked.inside(least)} else {otherwise.inside(_BINDING['if'])}"
    return Said(text, sort, _BINDING["if"])


def _computed(sign: str, left: Said, right: Said) -> Said:
    binds = _BINDING[sign]
    if sign == "+" and Sort.TEXT in (left.sort, right.sort):
        sort = Sort.TEXT
    elif sign == "+" and left.sort is right.sort is Sort.ANY:
        sort = Sort.ANY
    else:
        left, right, sort = _number(left), _number(right), Sort.NUMBER
    return Said(f"{left.inside(binds)} {sign} {right.inside(binds + 1)}", sort, binds)


def _comparison(signs: tuple[str, ...], sides: list[Said]) -> Said:
    """Return a chain of comparisons; pairs, where a side is compared as two sorts."""
    pairs = [
        _alike(sign, left, right)
        for sign, left, right in zip(signs, sides, sides[1:], strict=False)
    ]
    least = _BINDING["=="] + 1
    fits = all(one[1] == other[0] for one, other in pairwise(pairs))
    if fits:
        text = pairs[0][0].inside(least)
        for sign, (_, right) in zip(signs, pairs, strict=True):
            text += f" {sign} {right.inside(least)}"
        return Said(text, Sort.TRUTH, _BINDING["=="])
    texts = [
        f"{left.inside(least)} {sign} {right.inside(least)}"
        for sign, (left, right) in zip(signs, pairs, strict=True)
    ]
    return Said(" and ".join(texts), Sort.TRUTH, _BINDING["and"])


def _alike(sign: str, left: Said, right: Said) -> tuple[Said, Said]:
    """Return two sides of a comparison as values that can be compared here."""
    sorts = {left.sort, right.sort}
    if sorts == {Sort.TRUTH} and sign in ("==", "!="):
        return left, right
    if Sort.TRUTH in sorts and Sort.ANY not in sorts:
        left, right = (_number(side) if side.sort is Sort.TRUTH else side for side in (left, right))
        sorts = {left.sort, right.sort}
    if sorts == {Sort.TEXT, Sort.NUMBER}:
        left, right = (
            Said(f"float({side.text})", Sort.NUMBER) if side.sort is Sort.TEXT else side
            for side in (left, right)
        )
    return left, right


def truth(said: Said) -> Said:
    """Return an expression that is true where BehaviorTree.CPP takes the value for true."""
    if said.sort in (Sort.NUMBER, Sort.TEXT):
        nothing = "0" if said.sort is Sort.NUMBER else "''"
        return Said(f"{said.inside(_BINDING['+'])} != {nothing}", Sort.TRUTH, _BINDING["=="])
    return said


def _number(said: Said) -> Said:
    if said.sort is not Sort.TRUTH:
        return said
    if said.text in ("true", "false"):
        return Said("1" if said.text == "true" else "0", Sort.NUMBER)
    return Said(f"1 if {said.inside(_BINDING['or'])} else 0", Sort.NUMBER, _BINDING["if"])


def _text(said: Said) -> Said:
    return said if said.sort is Sort.TEXT else Said(f"str({said.text})", Sort.TEXT)


def assigned(
    statement: Statement, sort_of: Callable[[str], Sort], reference: Callable[[str], str]
) -> Said:
    """Say the value that a statement gives to its variable. Raises Refused."""
    name, sign, value = statement
    if sign in (":=", "="):
        said = say(value, sort_of, reference)
    else:
        said = say(Part("binary", (sign[0],), (Part("name", (name,)), value)), sort_of, reference)
    return _number(said) if sort_of(name) is Sort.NUMBER else said


def constant(said: Said) -> bool | int | float | str | None:
    """Return the value of an expression without variables; None for any other."""
    if said.text in ("true", "false"):
        return said.text == "true"
    if re.fullmatch(r"-?\d+", said.text):
        return int(said.text)
    if re.fullmatch(r"-?\d+\.\d+", said.text):
        return float(said.text)
    return said.text[1:-1] if re.fullmatch(r"'[^'$]*'", said.text) else None
