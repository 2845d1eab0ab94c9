"""Settings and ROS names as they come out for a node, for building and for looking ahead."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from bt_actions.document.reading.tree import Document, TreeNode


def text_of(values: Mapping[str, object], key: str) -> str:
    """A text as it is, and anything else as an empty one."""
    value = values.get(key)
    return value if isinstance(value, str) else ""


@lru_cache(maxsize=1024)
def join_names(*parts: str) -> str:
    """ROS names put together; an absolute one, and one of the node's own (~), begins anew."""
    joined = ""
    for part in parts:
        trimmed = part if part == "/" else part.rstrip("/")
        if trimmed.startswith(("/", "~")) or not joined:
            joined = trimmed
        elif trimmed:
            joined = f"{joined.rstrip('/')}/{trimmed}"
    return joined


def merged(base: dict[str, object], over: dict[str, object]) -> dict[str, object]:
    """Two mappings of settings as one, key by key to any depth; `over` wins."""
    result = {**base, **over}
    for name in base.keys() & over:
        earlier, value = base[name], over[name]
        if isinstance(earlier, dict) and isinstance(value, dict):
            result[name] = merged(earlier, value)
    return result


def settings_of(node: TreeNode, document: Document) -> dict[str, object]:
    """A node's settings over its alias's over the document's defaults, key by key."""
    return merged(shared_settings(node.alias, document), node.values)


def shared_settings(alias: str | None, document: Document) -> dict[str, object]:
    """What the nodes of an alias (None: of no alias) have where they say nothing."""
    shared = document.settings.get(alias)
    if shared is None:
        declared = document.actions.get(alias) if alias is not None else None
        own = declared.values if declared is not None else {}
        shared = document.settings[alias] = merged(document.defaults, own)
    return shared


def server_of(settings: Mapping[str, object]) -> str:
    """The name of an action's server; that of a server of trees where none is given."""
    return text_of(settings, "server") or "run_tree"


def when_of(settings: object) -> object:
    """The condition of settings for another attempt."""
    retry = settings.get("retry") if isinstance(settings, dict) else None
    return retry.get("when") if isinstance(retry, dict) else None


_Known = dict[tuple[int, str], dict[str, TreeNode]]


def resources_below(
    root: TreeNode, document: Document, namespace: str = "", known: _Known | None = None
) -> dict[str, TreeNode]:
    """What the actions of a subtree hold while they run, with the first node that does.

    `known` keeps what trees that are included hold, for later calls.
    """
    known = {} if known is None else known
    found: dict[str, TreeNode] = {}
    inner = join_names(namespace, document.namespace)
    for node in root.walk():
        if node.included is not None and node.included.root is not None:
            below = join_names(inner, text_of(node.values, "namespace"))
            there = (id(node.included.root), below)
            if there not in known:
                known[there] = resources_below(node.included.root, node.included, below, known)
            for name in known[there]:
                found.setdefault(name, node)
        elif node.is_action:
            settings = settings_of(node, document)
            if settings.get("busy") == "share":
                continue
            given = settings.get("resources")
            names = given if isinstance(given, list) and given else [server_of(settings)]
            for name in names:
                full = join_names(inner, text_of(settings, "namespace"), str(name))
                found.setdefault(full, node)
    return found
