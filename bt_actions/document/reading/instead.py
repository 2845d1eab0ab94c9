"""What to write for a decorator that was written as a setting of another node, and for fields that
were written as a list."""

from __future__ import annotations

import contextlib

from bt_actions.document.language.kinds import KINDS, Interface
from bt_actions.document.language.shape import is_computed
from bt_actions.document.language.types import interface_of
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar, data_of
from bt_actions.messages.as_fields import as_fields

__all__ = ["a_kind", "around", "fields_for"]

_LONGEST = 40
_SIGNS = frozenset(":,{}[]#\n")


def around(written: Mapping, outer: Scalar, inner: Scalar, decorator: str = "") -> str:
    """Put a decorator around a node: `outer` and `inner` are the two keys of what was written.

    `decorator` is the kind that is meant, where `outer` is one of its keys, or looks like its name.
    """
    decorator = decorator or outer.text
    keys, setting = KINDS[decorator].keys, KINDS[decorator].reads
    said = _text(written.get(decorator))
    if said == "..." and outer.text not in keys:
        said = _text(written.get(outer.text))
    name = _text(written.get(inner.text))
    parts = [f"{decorator}: {said if decorator == 'while' else name}"]
    if setting in keys:  # how often, or how long
        given = _text(written.get(setting))
        if given == "..." and said[:1].isdigit():
            given = said
        parts.append(f"{setting}: {keys[setting].example if given == '...' else given}")
    own = {key: _text(written.get(key)) for key in keys if key != setting}
    parts += [f"{key}: {given}" for key, given in own.items() if key != "name" and given != "..."]
    parts.append(f"child: {{{inner.text}: {name}, ...}}")
    return f"{a_kind(decorator)} goes around the node: {{{', '.join(parts)}}}"


def a_kind(word: str) -> str:
    """Return ``a 'retry'``, ``an 'invert'``."""
    return f"{'an' if word[0] in 'aeiou' else 'a'} {word!r}"


def _text(node: Node | None) -> str:
    """A short scalar as it is, if it can stand in braces so; dots for anything else."""
    said = node.text if isinstance(node, Scalar) else ""
    return said if 0 < len(said) <= _LONGEST and _SIGNS.isdisjoint(said) else "..."


def fields_for(interface: Interface, inner: Listing, typed: Node) -> str | None:
    """Return a hint for a list in the place of fields; `typed` holds the interface's type."""
    named = typed.get("type") if isinstance(typed, Mapping) else None
    if not isinstance(named, Scalar):
        return None
    with contextlib.suppress(ValueError):  # TypeNameError is one
        cls = interface_of(named.text, interface.kind)
        data = [None if is_computed(each) else data_of(each) for each in inner.items]
        instead = as_fields(interface.sent_by(cls), data)
        return f"write {instead}" if instead else None
    return None
