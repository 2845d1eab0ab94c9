"""Names with two types: an action server, a service or a topic, over all trees included: BT217.

The namespace that a tree will run in is not known here: a relative name counts as one in `/`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from typing import NamedTuple

from bt_actions.document.checking.checker import Checker
from bt_actions.document.findings import Place, Related
from bt_actions.document.language.kinds import Interface
from bt_actions.document.reading.tree import (
    Declared,
    Document,
    TreeNode,
    join_names,
    server_of,
    shared_settings,
    text_of,
)
from bt_actions.document.yaml.nodes import Node, span_of

_WORDS = {"action": "the action server", "srv": "the service", "msg": "the topic"}
_TOPIC = Interface("msg", "topic")
_MOST = 10_000
"""Names of a tree and of its included trees that are compared: subtrees can multiply them."""
_Name = tuple[str, str]
"""The kind of interface, and the full name."""


class _Use(NamedTuple):
    """A use of a name with a type; `at` is in the checked document."""

    type: str
    place: Place
    at: Node


_Known = dict[int, dict[_Name, _Use]]


def check_names(checker: Checker) -> None:
    """Report each name that a tree uses with another type than before."""
    first: dict[_Name, _Use] = {}
    told: set[_Name] = set()
    for (kind, full), use in islice(_uses(checker.document, {}), _MOST):
        name = kind, join_names("/", full)
        other = first.setdefault(name, use)
        if other.type != use.type and name not in told and use.at is not other.at:
            told.add(name)
            inside = use.place.file != checker.source.name
            here = f"in {use.place.file}:{use.place.line}" if inside else "here"
            checker.source.report(
                "BT217", span_of(use.at),
                f"{_WORDS[kind]} {full!r} is {use.type} {here}, and {other.type} elsewhere",
                related=Related(other.place, "elsewhere"),
                hint="correct one of the two types, or one of the names",
            )  # fmt: skip


def _uses(document: Document, known: _Known) -> Iterator[tuple[_Name, _Use]]:
    """Yield the names that a document uses, in its own namespace; `known` keeps included trees'."""
    for declared in document.topics.values():
        at = _place(declared, document, document.node.get("import") or document.node)
        yield from _use(_TOPIC, declared.values, at, document)
    seen: set[tuple[str | None, str]] = set()
    for node in document.nodes():
        interface, namespace = node.kind.interface, text_of(node.values, "namespace")
        if node.included is not None:
            yield from _included(node, document, known)
        elif interface is None:
            continue
        elif node.alias is not None:
            if (node.alias, namespace) in seen or node.alias not in document.actions:
                continue
            seen.add((node.alias, namespace))
            settings = {**shared_settings(node.alias, document), **node.values}
            at = _place(document.actions[node.alias], document, node.key)
            yield from _use(interface, settings, at, document)
        else:
            values = node.values
            if interface.type:
                values = {**values, "type": interface.type, "server": server_of(values)}
            at = node.place, node.written.get("type", node.key)
            yield from _use(interface, values, at, document)


def _place(declared: Declared, document: Document, used: Node) -> tuple[Place, Node]:
    """Return the place of a declaration, and the node in the document to report it at."""
    own = declared.source is document.source
    return declared.place, declared.written("type") if own else used


def _included(node: TreeNode, document: Document, known: _Known) -> Iterator[tuple[_Name, _Use]]:
    included = node.included
    assert included is not None
    below = known.get(id(included))
    if below is None:
        below = known[id(included)] = {}
        for name, use in islice(_uses(included, known), _MOST):
            below.setdefault(name, use)
    for (kind, named), use in below.items():
        full = join_names(document.namespace, text_of(node.values, "namespace"), named)
        yield (kind, full), use._replace(at=node.key)


def _use(
    interface: Interface,
    values: Mapping[str, object],
    at: tuple[Place, Node],
    document: Document,
) -> Iterator[tuple[_Name, _Use]]:
    name, given, kind = text_of(values, interface.name), text_of(values, "type"), interface.kind
    if name and given:
        package, _, short = given.partition("/")
        full = join_names(document.namespace, text_of(values, "namespace"), name)
        whole = f"{package}/{kind}/{short.rpartition('/')[2]}"
        yield (kind, full), _Use(whole, *at)
