"""The trees of some files, and the variables that each reads and writes.

Names of variables are those of the XML here. A subtree's ports are other names of its caller's
variables: a write to a port is a write to the caller's variable.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bt_actions.importing.mapping import Leaf, Map, texts_in
from bt_actions.importing.reading import Element, XmlError, read_file
from bt_actions.importing.refused import rows
from bt_actions.importing.report import Report, Verdict
from bt_actions.importing.scripts import (
    Part,
    ScriptError,
    Sort,
    Sorts,
    Statement,
    condition,
    names_in,
    statements,
)

CONDITIONS = ("_failureIf", "_successIf", "_skipIf", "_while")
AFTER = ("_onSuccess", "_onFailure", "_onHalted", "_post")
SUBTREES = ("SubTree", "SubTreePlus", "Subtree")
LOOPS = {"LoopInt": Sort.NUMBER, "LoopDouble": Sort.NUMBER, "LoopBool": Sort.TRUTH,
         "LoopString": Sort.TEXT, "ForEach": Sort.NUMBER}  # fmt: skip
"""The sorts of their items."""
SHARED = ("_autoremap", "__autoremap", "__shared_blackboard")
"""Attributes of a subtree that shares all names with its caller."""
_CALLED = ("Action", "Condition", "Control", "Decorator")
_OWN = ("ID", "name", *SHARED, "_description", "_uid", "_fullpath")
"""Attributes that are no ports."""
_MOST_FILES = 200
_VARIABLE = re.compile(r"\s*\$?\{\s*([^{}]*?)\s*\}\s*")


def kind_of(element: Element) -> str:
    """Return the ID of a node, in either notation."""
    return element.attributes.get("ID", element.tag) if element.tag in _CALLED else element.tag


def variable_in(text: str, port: str) -> str | None:
    """Return the variable that a port's text names, `{=}` being the port's own; else None."""
    found = _VARIABLE.fullmatch(text)
    if found is None:
        return None
    return port if found[1] == "=" else found[1]


def is_shared(element: Element) -> bool:
    """Return whether a subtree shares all names with its caller."""
    return any(element.attributes.get(name) in ("true", "1") for name in SHARED)


def ports_of(element: Element) -> Iterator[tuple[str, str]]:
    """Yield the attributes of a node that are ports."""
    for name, text in element.attributes.items():
        if name not in (*_OWN, *CONDITIONS, *AFTER):
            yield name, text


@dataclass(slots=True)
class Definition:
    """A tree of the XML."""

    name: str
    element: Element
    version: int
    """The format: 3 or 4."""
    accesses: dict[str, str] = field(default_factory=dict)
    """The accesses of each variable: `r`, `w`, `rw` or `wr`, the first one first."""
    done: bool = False
    outputs: set[str] | None = None
    """The outputs for callers, once asked for."""

    @property
    def root(self) -> Element | None:
        """The one node of the tree, or None."""
        return self.element.children[0] if len(self.element.children) == 1 else None

    def reads_first(self, name: str) -> bool:
        """Return whether a variable is read before anything in the tree writes it."""
        return self.accesses.get(name, "").startswith("r")

    def writes(self, name: str) -> bool:
        """Return whether the tree writes a variable."""
        return "w" in self.accesses.get(name, "")


class Project:
    """All files of an import."""

    def __init__(self, paths: list[Path], mapping: Map, report: Report) -> None:
        self.mapping, self.report = mapping, report
        self.trees: dict[str, Definition] = {}
        self.models: dict[str, dict[str, str]] = {}
        """The directions of the ports, by ID."""
        self.model_types: dict[str, dict[str, str]] = {}
        """The types of the ports that are known here, by ID."""
        self.stubs: dict[str, Any] = {}
        """The stubs by ID; `stubs.py` fills the table."""
        self.failed: list[XmlError] = []
        self.sorts = Sorts()
        self.types: dict[str, str] = {}
        """The type of a port that a variable is given to, by variable."""
        self.updated: set[str] = set()
        """Variables that one node both reads and writes."""
        self._alike: dict[str, set[str]] = {}
        """The variables that share a value with each variable."""
        self._given = {path.resolve().parent for path in paths}
        self._read: set[Path] = set()
        for path in paths:
            self._add_file(path)
        for definition in self.trees.values():
            for element in definition.element.walk():
                self._note(element)
        self.sorts.settle()
        self._share_types()
        for definition in self.trees.values():
            self._follow(definition)

    # Files

    def _add_file(self, path: Path) -> None:
        real = path.resolve()
        if real in self._read or len(self._read) >= _MOST_FILES:
            return
        self._read.add(real)
        try:
            root = read_file(path)
        except XmlError as error:
            self.failed.append(error)
            return
        tops = root.children if root.tag == "root" else [root]
        version = 4 if root.attributes.get("BTCPP_format", "").startswith("4") else 3
        if root.comments and tops and root is not tops[0]:
            tops[0].comments[:0] = root.comments
        for element in tops:
            if element.tag == "include":
                self._include(element, path)
            elif element.tag == "TreeNodesModel":
                self._models(element)
            elif element.tag == "BehaviorTree":
                self._add_tree(element, path, version)
            elif element is not root:
                self.report.tree(element, element.tag, Verdict.DROPPED, "it is no tree")
            else:
                whole = Element("BehaviorTree", {}, element.file, element.line, element.column)
                whole.children = [element]
                self._add_tree(whole, path, version)

    def _add_tree(self, element: Element, path: Path, version: int) -> None:
        name = element.attributes.get("ID", path.stem)
        if name in self.trees:
            self.report.tree(element, name, Verdict.DROPPED, "a tree of that name was read before")
            return
        self.trees[name] = Definition(name, element, version)

    def _include(self, element: Element, path: Path) -> None:
        wanted = element.attributes.get("path", "")
        if "ros_pkg" in element.attributes or not wanted:
            why = "a package's file is not looked for: name it on the command line, too"
            self.report.tree(element, f"include {wanted}", Verdict.REFUSED, why)
            return
        found = path.parent / wanted
        real = found.resolve()
        if real in self._read:
            return
        if not any(real.is_relative_to(folder) for folder in self._given):
            why = "it is outside of the folders of the files: name it on the command line, too"
            self.report.tree(element, f"include {wanted}", Verdict.REFUSED, why)
        elif not found.is_file():
            self.report.tree(element, f"include {wanted}", Verdict.REFUSED, "there is no such file")
        else:
            self._add_file(found)

    def _models(self, element: Element) -> None:
        for model in element.children:
            kind = model.attributes.get("ID", model.tag)
            ports = self.models.setdefault(kind, {})
            types = self.model_types.setdefault(kind, {})
            for port in model.children:
                name = port.attributes.get("name", "")
                ports[name] = port.tag.removesuffix("_port")
                if known := _of_cpp(port.attributes.get("type", "")):
                    types[name] = known

    # What variables are

    def _note(self, element: Element) -> None:
        """Take note of what a node tells of the sorts and types of variables."""
        attributes, kind = element.attributes, kind_of(element)
        for code in (*AFTER, "code") if kind == "Script" else AFTER:
            found = self._statements(attributes.get(code, ""))
            self.sorts.add(found)
            for key, _, part in found:
                self._link(key, *_carried(part))
        for code in (*CONDITIONS, "code", "if") if kind != "Script" else CONDITIONS:
            try:
                self.sorts.add_condition(condition(attributes[code]))
            except (KeyError, ScriptError):
                continue
        if kind == "SetBlackboard":
            key = attributes.get("output_key", "").strip("{}")
            value = attributes.get("value", "")
            if (other := variable_in(value, "value")) is not None:
                self.sorts.alike(key, other)
                self._link(key, other)
            elif not value.startswith("json:"):
                self.sorts.add_text(key, value)
        leaf = self.mapping.leaves.get(kind)
        cases = {_sort_of_text(text) for port, text in attributes.items() if port[:5] == "case_"}
        for port, text in ports_of(element):
            name = variable_in(text, port)
            if name is not None and len(cases) == 1 and port == "variable":
                self.sorts.use(name, *cases)
            model = self.model_types.get(kind, {}).get(port, "")
            kind_of_port = leaf.type_of(port) if leaf is not None else model
            if port in ("value_A", "value_B"):
                kind_of_port = COMPARED.get(kind, "")
            if kind == "GoalUpdater":
                kind_of_port = "geometry_msgs/msg/PoseStamped"
            if kind in LOOPS and port == "queue":
                kind_of_port = f"{LOOPS[kind].value}[]"
            if port in ("num_cycles", "num_attempts", "msec", "delay_msec", PLACE):
                kind_of_port = "int64"
            inner = self.trees.get(attributes.get("ID", "")) if kind in SUBTREES else None
            if inner is not None:
                name = outer_name(element, inner, port)
            if kind in SUBTREES and name is not None:
                self._link(port, name)
                self.sorts.alike(port, name)
            if kind in SUBTREES and name is None and not text.startswith("json:"):
                self.sorts.add_text(port, text)
            if name is not None and kind in LOOPS and port == "value":
                self.sorts.use(name, LOOPS[kind])
            if name is not None and kind_of_port:
                self.types.setdefault(name, kind_of_port)
                if (sort := _sort_of(kind_of_port)) is not None:
                    self.sorts.use(name, sort)

    def _link(self, *names: str) -> None:
        for name in names:
            self._alike.setdefault(name, set()).update(names)

    def _share_types(self) -> None:
        """Give the types of ports to all variables that have their values."""
        waiting = list(self.types.items())
        while waiting:
            name, kind = waiting.pop()
            for other in self._alike.get(name, ()):
                if other and other not in self.types:
                    self.types[other] = kind
                    waiting.append((other, kind))

    def outputs(self, tree: Definition) -> set[str]:
        """Return the variables of a tree that its callers get."""
        if tree.outputs is None:
            calls = (
                element
                for definition in self.trees.values()
                for element in definition.element.walk()
                if kind_of(element) in SUBTREES and element.attributes.get("ID") == tree.name
            )
            tree.outputs = {
                name
                for element in calls
                for name in tree.accesses
                if tree.writes(name) and outer_name(element, tree, name) is not None
            }
        return tree.outputs

    def is_read(self, tree: Definition, name: str) -> bool:
        """Return whether a tree reads a variable, or a caller gets what is in it."""
        return "r" in tree.accesses.get(name, "") or name in self.outputs(tree)

    def reaches(self, definition: Definition, other: Definition) -> bool:
        """Return whether a tree is another one, or holds it."""
        waiting, seen = [definition], set()
        while waiting:
            found = waiting.pop()
            if found is other:
                return True
            if found.name not in seen:
                seen.add(found.name)
                names = (each.attributes.get("ID", "") for each in found.element.walk()
                         if kind_of(each) in SUBTREES)  # fmt: skip
                waiting += [self.trees[name] for name in names if name in self.trees]
        return False

    def type_of(self, name: str) -> str:
        """Return the type of an input or output."""
        sort = self.sorts[name]
        known = self.types.get(name, "")
        if known.endswith("]"):
            return known  # the text that is given to a port is a list, written out
        if sort is Sort.TEXT or (sort is not Sort.ANY and not known):
            return str(sort.value)
        return known or "string"

    def knows(self, name: str) -> bool:
        """Return whether the type of a variable is known."""
        return name in self.types or self.sorts[name] is not Sort.ANY

    @staticmethod
    def _statements(code: str) -> tuple[Statement, ...]:
        try:
            return statements(code)
        except ScriptError:
            return ()

    # What is done with them

    def _follow(self, definition: Definition) -> None:
        if definition.done:
            return
        definition.done = True  # a tree that holds itself is refused elsewhere
        for element in definition.element.children:
            for name, access in self.accesses(element):
                if name in self.mapping.constants:
                    continue
                before = definition.accesses.get(name, "")
                if access not in before:
                    definition.accesses[name] = before + access

    def accesses(self, element: Element) -> Iterator[tuple[str, str]]:
        """Yield each variable that a node and those below it read (`r`) or write (`w`)."""
        attributes, kind = element.attributes, kind_of(element)
        for name in CONDITIONS:
            yield from self._asked(attributes.get(name, ""))
        if kind in SUBTREES:
            yield from self._of_subtree(element)
        elif kind in ("Script", "ScriptCondition"):
            yield from self._run(attributes.get("code", ""))
        elif kind == "Precondition":
            yield from self._asked(attributes.get("if", ""))
        elif kind == "SetBlackboard":
            if (value := variable_in(attributes.get("value", ""), "value")) is not None:
                yield value, "r"
            yield attributes.get("output_key", "").strip("{} "), "w"
        else:
            yield from self._of_ports(element, kind)
        for child in element.children:
            yield from self.accesses(child)
        for name in AFTER:
            yield from self._run(attributes.get(name, ""))

    def _of_ports(self, element: Element, kind: str) -> Iterator[tuple[str, str]]:
        leaf = self.mapping.leaves.get(kind)
        if leaf is None and (kind in _WITHOUT_PORTS or kind in rows()):
            return
        found = []
        used = _ports_used(leaf) if leaf is not None else None
        for port, text in ports_of(element):
            name = variable_in(text, port)
            if name is None or (used is not None and port not in used):
                continue
            found.append((name, self.direction(kind, port)))
        read = [name for name, direction in found if direction != "output"]
        written = [name for name, direction in found if direction != "input"]
        self.updated.update({*read} & {*written})
        yield from ((name, "r") for name in read)
        yield from ((name, "w") for name in written)

    def direction(self, kind: str, port: str) -> str:
        """Return the direction of a port; where nothing tells it, its name does, as in Nav2."""
        leaf = self.mapping.leaves.get(kind)
        if kind in LOOPS:
            return "output" if port == "value" else "input"
        if kind == "PersistentSequence" and port == PLACE:
            return "inout"
        if kind in WRITTEN_BY_KIND:
            return "output" if port == WRITTEN_BY_KIND[kind] else "input"
        if leaf is not None and port in leaf.outputs:
            return "output"
        named = "output" if leaf is None and port.startswith("output_") else "input"
        return self.models.get(kind, {}).get(port, named)

    def _of_subtree(self, element: Element) -> Iterator[tuple[str, str]]:
        inner = self.trees.get(element.attributes.get("ID", ""))
        if inner is None:
            return
        self._follow(inner)
        ports = dict(ports_of(element))
        for name, access in inner.accesses.items():
            outer = outer_name(element, inner, name)
            if outer is None and name not in ports and access.startswith("r"):
                outer = name  # without a value there: an input here
            if outer is not None:
                yield from ((outer, each) for each in access)

    def _run(self, code: str) -> Iterator[tuple[str, str]]:
        for name, sign, value in self._statements(code):
            yield from ((each, "r") for each in names_in(value))
            if name and sign not in (":=", "="):
                yield name, "r"
            if name:
                yield name, "w"

    def _asked(self, code: str) -> Iterator[tuple[str, str]]:
        try:
            yield from ((name, "r") for name in names_in(condition(code)))
        except ScriptError:
            return


SELECTORS = {
    f"{what[0].upper()}{what[1:]}Selector".replace("_c", "C").replace("_h", "H"): f"selected_{what}"
    for what in ("planner", "controller", "smoother", "goal_checker", "progress_checker",
                 "path_handler")
}  # fmt: skip
"""Nav2's nodes that take a name from a topic, and the port that they write."""
COMPARED = {
    "BlackboardCheckInt": "int64",
    "BlackboardCheckDouble": "float64",
    "BlackboardCheckString": "string",
    "BlackboardCheckBool": "bool",
}
"""Decorators of BehaviorTree.CPP 3 that compare two values, and the type of these."""
PLACE = "current_child_idx"
"""The port of PersistentSequence that tells the child to go on with."""
_WITHOUT_PORTS = ("GoalUpdated", "GlobalUpdatedGoal", "GoalUpdatedController")
"""Kinds whose ports have no meaning here."""
WRITTEN_BY_KIND = {"GoalUpdater": "output_goal", **SELECTORS}
"""Kinds without a row in a map, and the port that they write."""


def outer_name(element: Element, inner: Definition, name: str) -> str | None:
    """Return the caller's variable that a name of its subtree stands for, or None."""
    ports = dict(ports_of(element))
    if name.startswith("@"):
        return name
    if name in ports:
        text = ports[name]
        if inner.version == 3 and element.tag == "SubTree" and re.fullmatch(r"\w+", text):
            return text  # as it names a variable in the format 3
        return variable_in(text, name)
    private = name.startswith("_") and inner.version == 4
    return name if is_shared(element) and not private else None


def _of_cpp(text: str) -> str:
    """Return a type of C++ as one of ours, or ""."""
    if found := re.fullmatch(r"(?:::)?(\w+)::msg::(\w+)", text):
        return f"{found[1]}/msg/{found[2]}"
    for ours, theirs in _CPP.items():
        if text in theirs:
            return ours
    return ""


_CPP = {
    "string": ("std::string", "string", "std::string_view"),
    "float64": ("double", "float"),
    "bool": ("bool",),
    "int64": ("int", "unsigned", "unsigned int", "unsigned char", "long", "size_t", "uint8_t",
              "int32_t", "uint32_t", "int64_t", "uint64_t", "uint16_t", "int16_t"),
}  # fmt: skip


def _carried(value: Part) -> Iterator[str]:
    """Yield the names whose type a value has."""
    if value.kind == "name":
        yield value.signs[0]
    elif value.kind == "if" or (value.kind == "binary" and value.signs[0] in "+-*"):
        for part in value.parts[value.kind == "if" :]:
            yield from _carried(part)


def _ports_used(leaf: Leaf) -> set[str]:
    texts = " ".join(texts_in(leaf.node))
    return {*re.findall(r"\$(\w+)", texts), *leaf.outputs}


def _sort_of_text(text: str) -> Sort:
    return Sort.NUMBER if re.fullmatch(r"-?\d+(\.\d*)?", text) else Sort.TEXT


def _sort_of(kind: str) -> Sort | None:
    if kind == "string":
        return Sort.TEXT
    if kind == "bool":
        return Sort.TRUTH
    return Sort.NUMBER if re.fullmatch(r"u?int\d+|float\d+|byte", kind) else None
