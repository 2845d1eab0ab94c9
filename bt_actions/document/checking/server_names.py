"""Inputs in the names of servers, topics and namespaces: texts, known before a tree runs.

Clients are made when a tree is set up. So an input in a name has to be an input of the root, or
one of a subtree whose `with` gives a constant, or such an input, all the way up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from bt_actions.document.checking.checker import Checker
from bt_actions.document.checking.value_types import TEXT, named
from bt_actions.document.language.keys import ALIAS, TOP_KEYS, TOPIC
from bt_actions.document.language.ros_names import INPUT, RosName
from bt_actions.document.language.shapes import Key
from bt_actions.document.language.values import computed_in
from bt_actions.document.reading.tree import Document, table_of, text_of
from bt_actions.document.yaml.nodes import Node, span_of
from bt_actions.utilities.suggest import closest


def _names(
    values: Mapping[str, object], keys: Mapping[str, Key], written: Mapping[str, Node]
) -> Iterator[tuple[str, Node]]:
    for key, value in values.items():
        if isinstance(value, str) and key in keys and isinstance(keys[key].shape, RosName):
            yield from ((name, written[key]) for name in INPUT.findall(value) if key in written)


def _names_in(document: Document) -> Iterator[tuple[str, Node]]:
    """Yield the inputs in the names of a document, each with its YAML node."""
    top = {key.text: node for key, node in document.node.pairs}
    yield from _names(document.values, TOP_KEYS, top)
    for table, keys in ((document.actions, ALIAS.keys), (document.topics, TOPIC.keys)):
        for declared in table.values():
            yield from _names(declared.values, keys, declared.parts)
    for node in document.nodes():
        for key in node.kind.ros_names:
            if "$" in (name := text_of(node.values, key)) and key in node.written:
                yield from ((each, node.written[key]) for each in INPUT.findall(name))


def inputs_in_names(document: Document, known: dict[int, set[str]] | None = None) -> set[str]:
    """Return the inputs that a tree needs before it runs; `known` holds those of other trees."""
    known = {} if known is None else known
    if id(document) not in known:
        found = known[id(document)] = {name for name, _ in _names_in(document)}
        for node in document.nodes():
            if node.included is not None:
                given = table_of(node.values.get("with"))
                for name in inputs_in_names(node.included, known) & given.keys():
                    for each in computed_in(given[name]):
                        found.update(each.expression.variables)
    return known[id(document)]


def check_server_names(checker: Checker) -> None:
    """Report a variable in a name that is no input, or no text."""
    document = checker.document
    if document.root is None:
        return  # a library's names have the inputs of whoever imports it
    for name, node in _names_in(document):
        _check_input(checker, name, node)
    known: dict[int, set[str]] = {}
    for each in document.nodes():
        if each.included is None:
            continue
        wanted, given = inputs_in_names(each.included, known), each.values.get("with")
        for name in wanted & table_of(given).keys():
            for computed in computed_in(table_of(given)[name]):
                for variable in computed.expression.variables:
                    _check_input(checker, variable, computed.node)


def _check_input(checker: Checker, name: str, node: Node) -> None:
    if name not in checker.document.inputs:
        if not checker.doubts.declares(name):
            meant = closest(name, checker.document.inputs)
            near = f"; did you mean '${meant}'?" if meant else ""
            text = f"a server's name has to be known before the tree runs, and ${name} is no input"
            checker.source.report("BT202", span_of(node), f"{text}{near}")
        return
    kind = checker.variables.get(name)
    if kind is not None and kind != TEXT:
        text = f"a name is a text, and ${name} is {named(kind)}"
        checker.source.report("BT204", span_of(node), text)
