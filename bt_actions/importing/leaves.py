"""Leaves of one's own, by a map; stubs stand for the others."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from bt_actions.importing.given import Given
from bt_actions.importing.mapping import SAVES, Leaf
from bt_actions.importing.names import ros_name, value_of
from bt_actions.importing.project import ports_of, variable_in
from bt_actions.importing.scripts import Refused
from bt_actions.importing.stubs import stub_node
from bt_actions.importing.text import Node

_MISSING = object()
"""The value of a port without one in the XML."""


def leaf(given: Given) -> Node:
    writer = given.writer
    known = writer.project.mapping.leaves.get(given.kind)
    if known is not None:
        return _Filled(given, known).node()
    return stub_node(given, "nothing is known of it, and --map has no row")


class _Filled:
    """A node of a map, with the values of its ports."""

    def __init__(self, given: Given, leaf: Leaf) -> None:
        self._given, self._leaf = given, leaf
        self._texts = dict(ports_of(given.element))

    def node(self) -> Node:
        given, leaf = self._given, self._leaf
        kind, value = next(iter(leaf.node.items()))
        rest = {key: each for key, each in leaf.node.items() if key != kind}
        if value is None:
            node = Node({kind: given.name()})
        else:
            node = given.named(
                Node({kind: self._saves(value, kind) if kind in SAVES else self._fill(value)})
            )
        self._declare(kind, node)
        if len(given.element.children) == 1:
            node["child"] = given.only_child()
        elif given.element.children:
            node["children"] = given.children()
        for key, each in rest.items():
            filled = self._saves(each, key) if key in SAVES else self._fill(each)
            if key in ("server", "topic"):
                node[key] = ros_name("" if filled is _MISSING else filled)
            elif filled is not _MISSING and filled != {}:
                node[key] = filled
        for port in self._texts:
            given.dropped(port, "the map has no place for it")
        return node

    def _declare(self, kind: str, node: Node) -> None:
        """Let the tree declare the words that the node uses."""
        writer, mapping = self._given.writer, self._given.writer.project.mapping
        for word in {kind, *re.findall(r"\$(\w+)", repr(self._leaf.node))} - set(self._leaf.ports):
            if word in mapping.imports:
                writer.imports.add(mapping.imports[word][0])
            elif (section := mapping.section_of(word)) is not None:
                writer.words.setdefault(section, {})[word] = mapping.words[section][word]
        server = self._port("server_name")
        if server is _MISSING or kind not in mapping.imports:
            return
        node["action"] = node.pop(kind)
        node["type"], node["server"] = mapping.imports[kind][1], ros_name(server)

    def _port(self, port: str) -> object:
        """Return the value of a port, `$name` for a variable, or _MISSING."""
        declared = self._leaf.ports.get(port, {})
        attributes = self._given.element.attributes
        if port not in attributes:
            is_left_out = declared.get("with", port) not in (port, *attributes)
            return _MISSING if is_left_out else declared.get("default", _MISSING)
        self._texts.pop(port, None)
        self._given.converted(port)
        text = attributes[port]
        variable = variable_in(text, port)
        if variable is None:
            return value_of(text, str(declared.get("type", "")))
        if variable in self._given.scope.literals:
            return self._given.scope.literals[variable]
        return f"${self._given.scope[variable]}"

    def _saves(self, saves: Mapping[str, str], key: str) -> dict[str, str]:
        found, is_read = {}, self._given.writer.project.is_read
        for port, expression in saves.items():
            name = variable_in(self._texts.get(port, ""), port)
            if key != "set" and name and not is_read(self._given.scope.definition, name):
                self._given.dropped(port, f"nothing reads {{{name}}}")
                self._texts.pop(port)
                continue
            value = self._port(port)
            if isinstance(value, str) and value.startswith("$"):
                found[value[1:]] = self._fill(expression)
        return found

    def _fill(self, value: Any) -> Any:
        if isinstance(value, Mapping):
            filled = {key: self._fill(inner) for key, inner in value.items()}
            left = {key: each for key, each in filled.items() if each is not _MISSING}
            return left if left or not value else _MISSING
        if isinstance(value, list):
            return [each for each in map(self._fill, value) if each is not _MISSING]
        if not isinstance(value, str) or "$" not in value:
            return value
        if whole := re.fullmatch(r"\$(\w+)( [a-z]+)?", value):
            if whole[1] not in self._leaf.ports and whole[1] not in self._given.element.attributes:
                return value if self._is_word(whole[1]) else _MISSING
            found = self._port(whole[1])
            if whole[2] is None or found is _MISSING:
                return found
            if isinstance(found, str) and found.startswith("$"):
                return found if whole[2] == " s" else f"= {found} / 1000"
            if not isinstance(found, int | float):
                raise Refused("port", f"{whole[1]} is no number")
            return f"{found:g}{whole[2]}" if isinstance(found, float) else f"{found}{whole[2]}"
        return self._in_expression(value)

    def _is_word(self, name: str) -> bool:
        return self._given.writer.project.mapping.is_word(name)

    def _in_expression(self, text: str) -> Any:
        def put(found: re.Match[str]) -> str:
            if self._is_word(found[1]) and found[1] not in self._leaf.ports:
                return found[0]
            value = self._port(found[1])
            if value is _MISSING:
                raise Refused("port", f"the port {found[1]!r} is missing")
            if isinstance(value, str) and value.startswith("$"):
                return value
            return repr(value) if not isinstance(value, bool) else str(value).lower()

        return re.sub(r"\$(\w+)", put, text)
