"""What to write for the fields of what a node sends, where they stand there as a list."""

from __future__ import annotations

import contextlib

from bt_actions.document.language.shape import is_computed
from bt_actions.document.language.types import interface_of
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar, data_of
from bt_actions.messages.as_fields import as_fields
from bt_actions.messages.interfaces import Kind

FIELDS: dict[str, tuple[Kind, str]] = {
    "goal": ("action", "Goal"), "request": ("srv", "Request"), "message": ("msg", ""),
}  # fmt: skip
"""Keys for the fields of what a node sends: the kind of its type, and the part that is sent."""


def fields_for(key: str, inner: Listing, typed: Node) -> str | None:
    """Return a hint for a list behind one of `FIELDS`; `typed` holds the type of what is sent."""
    named = typed.get("type") if isinstance(typed, Mapping) else None
    if not isinstance(named, Scalar):
        return None
    kind, part = FIELDS[key]
    with contextlib.suppress(ValueError):  # TypeNameError is one
        cls = interface_of(named.text, kind)
        data = [None if is_computed(each) else data_of(each) for each in inner.items]
        instead = as_fields(getattr(cls, part) if part else cls, data)
        return f"write {instead}" if instead else None
    return None
