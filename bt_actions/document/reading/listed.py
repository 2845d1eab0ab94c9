"""What to write for the fields of what a node sends, where they stand there as a list."""

from __future__ import annotations

import contextlib

from bt_actions.document.language.kinds import Interface
from bt_actions.document.language.shape import is_computed
from bt_actions.document.language.types import interface_of
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar, data_of
from bt_actions.messages.as_fields import as_fields

__all__ = ["fields_for"]


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
