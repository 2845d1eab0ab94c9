"""`{x}`, which YAML reads as a mapping of x to nothing, where a variable or a word was meant."""

from __future__ import annotations

from bt_actions.document.yaml.nodes import Mapping, Node, Scalar, span_of
from bt_actions.document.yaml.source import Source


def report_braces(node: Node, source: Source) -> bool:
    """Report `{x}` where no mapping is meant: YAML reads it as a mapping of x to nothing."""
    if not isinstance(node, Mapping) or not node.flow or len(node.pairs) != 1:
        return False
    key, value = node.pairs[0]
    if not isinstance(value, Scalar) or value.text or not value.plain:
        return False
    hint = f"leave the braces away, or write ${key.text} for a variable"
    source.report("BT117", span_of(node), f"{{{key.text}}} is read as a mapping", hint=hint)
    return True
