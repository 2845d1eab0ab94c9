"""One tree of ours, from one of the XML: its nodes, its variables, its declarations.

`kinds.py` has a function for each kind of node; the common parts of all nodes are here: names,
comments, conditions, and subtrees.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from bt_actions.importing.given import Given, Handler
from bt_actions.importing.mapping import SAVES, texts_in
from bt_actions.importing.names import (
    NOTHING,
    Scope,
    identifier,
    in_sequence,
    input_name,
    node_name,
    unique,
    value_of,
)
from bt_actions.importing.project import (
    AFTER,
    CONDITIONS,
    SELECTORS,
    SHARED,
    SUBTREES,
    Definition,
    Project,
    kind_of,
    outer_name,
    ports_of,
    variable_in,
)
from bt_actions.importing.reading import Element
from bt_actions.importing.refused import rows
from bt_actions.importing.report import Verdict
from bt_actions.importing.saying import asked, assignments
from bt_actions.importing.scripts import Refused, ScriptError
from bt_actions.importing.stubs import stub_node
from bt_actions.importing.text import Node

_PACING = ("RateController", "GoalUpdatedController")
"""Kinds with a meaning for the pipeline around them alone."""
_CONCURRENT = re.compile(r"Parallel|Reactive|Pipeline|WhileDoElse|Switch|Timeout|NonblockingSeq")


class Writer:
    """The writer of one tree."""

    def __init__(
        self, project: Project, definition: Definition, kinds: dict[str, Handler],
        called: Callable[[Definition], str],
    ) -> None:  # fmt: skip
        self.project, self.report = project, project.report
        self._kinds, self._called = kinds, called
        self.definition = definition
        self.above: list[str] = []
        """The kinds of the nodes around the current one."""
        self.words: dict[str, dict[str, Any]] = {"actions": {}, "topics": {}, "kinds": {}}
        self.imports: set[str] = set()
        self._inside: list[Definition] = [definition]
        self._taken = {identifier(name) for name in definition.accesses}

    # The tree

    def tree(self, name: str, *, called: bool) -> Node:
        """Write the tree, as a document; `called` where another tree holds it."""
        element, scope = self.definition.element, self.scope(self.definition)
        if self.definition.root is None:
            refused = Refused("children", f"it has {len(element.children)} nodes, not one")
            self.report.tree(element, self.definition.name, Verdict.REFUSED, str(refused))
            root = Node(failure=node_name(f"{self.definition.name} has no single root"))
            for child in element.children:
                self._refuse(child, refused)
        else:
            root = self.node(self.definition.root, scope)
            root.dropped = False
            self.report.tree(element, self.definition.name, Verdict.CONVERTED, f"into {name}.yaml")
        tree = Node(tree=name)
        tree.comments = _lines(element.comments)
        if text := element.attributes.get("_description"):
            tree["description"] = text
            self.report.attribute(element, "_description", Verdict.CONVERTED)
        if self.imports:
            tree["import"] = sorted(self.imports)
        inputs: dict[str, object] = {}
        both: dict[str, object] = {}
        given_back = self.project.outputs(self.definition)
        outputs = {scope[each]: self.project.type_of(each) for each in given_back}
        for each in self.definition.accesses:
            if not self.definition.reads_first(each) or each in scope.topics:
                continue
            name = input_name(each, taken=scope[each] in outputs)
            kind = self.project.type_of(each)
            is_given = each in self.project.updated or not self.definition.writes(each)
            begins_empty = "/" in kind and not is_given  # as a port of Nav2's does
            inputs[name] = {"type": kind, "default": {}} if begins_empty else kind
            if scope[each] in outputs:
                both[scope[each]] = f"${name}"
            if not self.project.knows(each):
                why = f"nothing tells the type of the input {each}: it was written as a text"
                self.report.tree(element, self.definition.name, Verdict.DIFFERS, why)
        types = {scope[each]: self.project.type_of(each) for each in self.definition.accesses}
        for name in sorted(_read_only(root) - {*inputs, *both, *self.words["topics"]}):
            kind = types.get(name, "string")  # its writer was not imported
            nothing = NOTHING.get(kind, {})
            if name in outputs:
                both[name] = nothing
            else:
                inputs[name] = {"type": kind, "default": nothing} if called else kind
        if both:
            root = Node(sequence="With what was given", children=[Node(set=both), root])
        for key, declared in (("inputs", inputs), ("outputs", outputs)):
            if declared:
                tree[key] = dict(sorted(declared.items()))
        for section, words in self.words.items():
            if words:
                tree[section] = dict(sorted(words.items()))
        tree["root"] = root
        return tree

    def scope(self, definition: Definition, prefix: str = "", outer: Any = None) -> Scope:
        """Return the names of a tree."""
        scope = Scope(definition, prefix, outer)
        for element in definition.element.walk():
            kind = kind_of(element)
            port = SELECTORS.get(kind, "output_goal" if kind == "GoalUpdater" else "")
            if port and (name := variable_in(element.attributes.get(port, ""), port)):
                word = identifier(name.removeprefix("selected_"))
                word = identifier(name) if word in definition.accesses else word
                scope.topics[name] = word if kind == "GoalUpdater" else f"{word}.data"
        return scope

    def variable(self, word: str) -> str:
        """Return the name of a new variable."""
        name = unique(word, self._taken)
        self._taken.add(name)
        return name

    # A node

    def node(self, element: Element, scope: Scope) -> Node:
        """Write a node, inside of the nodes that its attributes put around it."""
        self.report.node(element, Verdict.CONVERTED)
        given = Given(self, element, scope)
        try:
            node = self._node(given)
        except ScriptError as refused:
            node = self._refuse(element, refused)
        node.comments[:0] = _lines(element.comments)
        if text := element.attributes.get("_description"):
            node.comments += _lines([text])
        return node

    def _node(self, given: Given) -> Node:
        element, kind = given.element, given.kind
        for name in (*CONDITIONS, *AFTER):
            if name in element.attributes:
                given.converted(name)
        if "_onHalted" in element.attributes:
            raise Refused("_onHalted")
        if "_description" in element.attributes:
            given.converted("_description")
        self.above.append(kind)
        try:
            node = self._subtree(given) if kind in SUBTREES else self._kind(given)(given)
            node.last += _lines(element.last)
            given.rest()
            return self._around(given, node)
        finally:
            self.above.pop()

    def _kind(self, given: Given) -> Handler:
        kind = given.kind
        if kind in self.project.mapping.leaves or kind not in self._kinds:
            if kind in rows() and kind not in self.project.mapping.leaves:
                raise Refused(kind)
            return self._kinds["a leaf"]
        return self._kinds[kind]

    def _refuse(self, element: Element, refused: ScriptError) -> Node:
        what = refused.what if isinstance(refused, Refused) else "script"
        detail = refused.detail if isinstance(refused, Refused) else str(refused)
        row = rows()[what]
        why = f"{detail}: {row}" if detail else str(row)
        self.report.node(element, Verdict.REFUSED, why)
        if what in element.attributes:
            self.report.attribute(element, what, Verdict.REFUSED, why)
        for inner in element.walk():
            if inner is not element:
                self.report.node(inner, Verdict.REFUSED, f"it stands in a {kind_of(element)}")
        name = element.attributes.get("name", "") or kind_of(element)
        node = Node(failure=node_name(f"{name} was not imported"))
        node.comments = [f"Refused, {kind_of(element)}: {why}"]
        return node

    def _around(self, given: Given, node: Node) -> Node:
        attributes, scope = given.element.attributes, given.scope
        post = attributes.get("_post", "")
        for on, code in (("_onSuccess", attributes.get("_onSuccess")),
                         ("_onFailure", attributes.get("_onFailure"))):  # fmt: skip
            codes = [each for each in (code, post) if each]
            sets = [each for one in codes for each in assignments(self.project, one, scope)]
            if not sets:
                continue
            if on == "_onSuccess":
                node = Node(sequence=f"{given.name()} and after", children=[node, *sets])
            else:
                failed = Node(force_failure="Failed", child=in_sequence("Take note", sets))
                node = Node(fallback=f"{given.name()} or after", children=[node, failed])
        if code := attributes.get("_while"):
            node["only_while"] = asked(self.project, code, scope)
        if code := attributes.get("_skipIf"):
            node["only_if"] = asked(self.project, code, scope, negated=True)
        if code := attributes.get("_successIf"):
            check = Node(check=asked(self.project, code, scope))
            node = Node(fallback=f"Unless {given.name()} is done", children=[check, node])
        if code := attributes.get("_failureIf"):
            check = Node(check=asked(self.project, code, scope, negated=True))
            node = Node(sequence=f"If {given.name()} may be", children=[check, node])
        return node

    # Subtrees

    def _subtree(self, given: Given) -> Node:
        element = given.element
        inner = self.project.trees.get(element.attributes.get("ID", ""))
        for name in SHARED:
            if name in element.attributes:
                given.converted(name)
        if inner is None or inner.root is None:
            return stub_node(given, "it is not in the files that were given")
        if any(self.project.reaches(inner, around) for around in self._inside):
            raise Refused("recursion")
        shares = kind_of(inner.root) in _PACING or any(
            outer_name(element, inner, name) is not None for name in inner.accesses
        )
        concurrent = (
            any(_CONCURRENT.search(kind) for kind in self.above) or "_while" in element.attributes
        )
        if shares and concurrent:
            return self._inlined(given, inner)
        node = Node(subtree=f"{self._called(inner)}.yaml")
        if "name" in element.attributes:
            node["name"] = given.name()
        values, saved = Node(), Node()
        for each in sorted(inner.accesses):
            outer = outer_name(element, inner, each)
            if inner.reads_first(each):
                name = input_name(each, taken=each in self.project.outputs(inner))
                values[name] = self._passed(given, inner, each, outer)
            if inner.writes(each) and outer is not None:
                saved[given.scope[outer]] = identifier(each)
        for key, mapping in (("with", values), ("save", saved)):
            if mapping:
                node[key] = dict(mapping)
        for port, _ in ports_of(element):
            if port in inner.accesses:
                given.converted(port)
            else:
                given.dropped(port, f"the tree {inner.name} does nothing with it")
        return node

    def _passed(self, given: Given, inner: Definition, name: str, outer: str | None) -> object:
        """Return the value for a subtree's input."""
        ports = dict(ports_of(given.element))
        if outer is None and name in ports:
            return value_of(ports[name], self.project.type_of(name))
        if outer is None:
            given.differs(
                f"{{{name}}} of the tree {inner.name} has no value there: it is an input here"
            )
            outer = name
        if outer in given.scope.literals:
            return given.scope.literals[outer]
        return f"${given.scope[outer]}"

    def _inlined(self, given: Given, inner: Definition) -> Node:
        """Write a tree into this one, whose ports are other names and no copies."""
        element, scope = given.element, given.scope
        prefix = f"{identifier(element.attributes.get('name') or inner.name)}_"
        ports = dict(ports_of(element))

        def outer(name: str) -> str | None:
            found = outer_name(element, inner, name)
            return scope[found] if found is not None else None

        own = self.scope(inner, prefix, outer)
        before = []
        for name, text in ports.items():
            found = outer_name(element, inner, name)
            if name not in inner.accesses:
                given.dropped(name, f"the tree {inner.name} does nothing with it")
                continue
            given.converted(name)
            if found is not None:
                if found in scope.literals:
                    own.literals[name] = scope.literals[found]
                continue
            value = value_of(text, self.project.type_of(name))
            if inner.writes(name):
                before.append(Node(set={own[name]: value}))
            else:
                own.literals[name] = value
        why = f"{inner.name} is written into this tree, as both sides use its ports while it runs"
        given.differs(why)
        self.report.tree(inner.element, inner.name, Verdict.DIFFERS,
                         f"written into {self.definition.name}")  # fmt: skip
        self._inside.append(inner)
        try:
            assert inner.root is not None
            node = self.node(inner.root, own)
        finally:
            self._inside.pop()
        return in_sequence(given.name(inner.name), [*before, node])


def _read_only(root: Node) -> set[str]:
    """Return the variables of a tree that no node of it writes."""
    texts = " ".join(texts_in(root))
    read = {*re.findall(r"(?<!\$)\$\(?([A-Za-z]\w*)", texts)}
    return read - {*_written(root)}


def _written(node: Node) -> Iterator[str]:
    for key, value in node.items():
        if key in SAVES and isinstance(value, dict):
            yield from value
        elif key == "as":
            yield str(value)
        for inner in value if isinstance(value, list) else [value]:
            if isinstance(inner, Node):
                yield from _written(inner)


def _lines(comments: list[str]) -> list[str]:
    return [line for text in comments for line in _of_comment(text)]


def _of_comment(text: str) -> Iterator[str]:
    for line in text.strip().splitlines():
        yield "".join(char if char.isprintable() else " " for char in line).strip()
