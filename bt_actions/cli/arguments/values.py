"""The `field=value` words of `bt-actions send`, read as values of the tree language.

A value that begins with a bracket, a brace or a quote is YAML. Any other value is one scalar, so
`message=hello: world # 1` is a text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from bt_actions.cli.exits import BadInput

_OTHERWISE = re.compile(
    r"(?:([A-Za-z_][\w.]*)(?:\s*:?=\s*|:\s+)|([A-Za-z_]\w*)\s+)(?!--|:?=)(\S.*)",
    re.ASCII | re.DOTALL,
)
"""A name and its value, in any notation: `speed=2`, `speed:=2`, `speed: 2`, `speed 2`."""


def split(word: str, what: str) -> tuple[str, str]:
    """Split `name=value`; raise BadInput, beginning with `what`, for anything else."""
    name, equals, text = word.partition("=")
    name = name.strip()
    if equals and name and not name.endswith(":"):
        return name, text
    remedy = "expected name=value, as in distance=2.0"
    if meant := meant_by([word]):
        remedy = f"write {what} {meant}" if what.startswith("-") else f"write {meant}"
    raise BadInput(f"{what} {word!r}: {remedy}")


def meant_by(words: Sequence[str]) -> str:
    """Return `name=value` as the first of `words` mean it, or ""."""
    texts = (" ".join(words[:many]) for many in (1, 2, 3))
    found = next(filter(None, map(_OTHERWISE.fullmatch, texts)), None)
    return f"{found[1] or found[2]}={found[3]}" if found else ""


def goal_fields(words: Iterable[str], what: str = "field") -> dict[str, object]:
    """Read `field=value` words, dotted names as nested fields; the last word for a name counts.

    Raises BadInput that names the word, which is called `what`.
    """
    values: dict[str, object] = {}
    for word in words:
        name, text = split(word, what)
        values[name] = value(text, f"{what} {word!r}")
    return nested(values)


def value(text: str, where: str) -> object:
    """Read one value; `where` begins the message of an error.

    Raises BadInput.
    """
    from bt_actions.document.yaml.compose import compose
    from bt_actions.document.yaml.nodes import Node, Scalar, data_of
    from bt_actions.document.yaml.source import Source

    stripped = text.strip()
    if not stripped:
        return text
    node: Node | None
    if stripped[0] in "[{\"'":
        source = Source(where, text)
        node = compose(source)
        if source.findings or node is None:
            why = source.findings[0].message if source.findings else "not a value"
            raise BadInput(f"{where}: {why}")
    else:
        node = Scalar()
        node.text, node.plain = stripped, True
    try:
        return data_of(node)
    except ValueError as error:
        raise BadInput(f"{where}: {error}") from error


def nested(values: dict[str, object]) -> dict[str, object]:
    """Turn dotted names into mappings: {"a.b": 1} into {"a": {"b": 1}}.

    Raises BadInput where one name is both a value and the beginning of another name.
    """
    tree: dict[str, object] = {}
    for name, given in values.items():
        *above, last = name.split(".")
        at = tree
        for step in above:
            below = at.setdefault(step, {})
            if not isinstance(below, dict):
                raise BadInput(f"field {name!r}: {step} has a value of its own already")
            at = below
        if last in at:
            raise BadInput(f"field {name!r}: parts of it have values already")
        at[last] = given
    return tree
