"""A tree of BehaviorTree.CPP, written in our language.

`KINDS` has a function for each tag that can be said today, `AROUND` one for each attribute. What
has none makes the case one that is not to be run yet: a new construct is an entry here.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from tests.support.oracle.cases import Case

Node = dict[str, Any]
Element = ET.Element
ROUND_A_TICK = "KeepRunningUntilFailure", "LoopInt"
"""The loops whose next round waits for the next tick of the world; nodes are named by their tag."""
_TOKEN = re.compile(r"'[^']*'|[A-Za-z_]\w*|&&|\|\||!(?!=)|\?")
_WORDS = {"&&": " and ", "||": " or ", "!": " not ", "true": "true", "false": "false"}


class NotYet(Exception):
    """The language has no word for it; the text names what."""


@dataclass
class Names:
    """The variables of a tree: each tree has its own, of which ports are another's."""

    prefix: str = ""
    ports: dict[str, str] = field(default_factory=dict)
    outer: Names | None = None
    """Of a tree that shares all names with the one around it."""

    def __getitem__(self, name: str) -> str:
        if name in self.ports:
            return self.ports[name]
        return self.outer[name] if self.outer is not None else f"{self.prefix}{name}"

    def of_text(self, text: str) -> str | None:
        """The variable that stands in braces; None for what is no variable."""
        return self[text[1:-1]] if text.startswith("{") else None


class Writer:
    """Writes one tree; subtrees are written into it, as their ports are aliases and no copies."""

    def __init__(self, case: Case) -> None:
        trees = ET.fromstring(case.xml).iter("BehaviorTree")
        self._trees = {tree.get("ID"): tree[0] for tree in trees}
        self._numbers = count(1)
        self.inputs: dict[str, Node] = {}
        for name, value in values_of(case.init).items():
            self.declare(name, value)
        root = self.node(self._trees["Main"], Names())
        goals = {"type": "robot_control_interfaces/action/MoveRobot"}
        answers = {"type": "std_msgs/msg/Bool", "qos": "latched"}
        self.tree: Node = {
            "tree": "oracle",
            "inputs": self.inputs,
            "actions": {act: {**goals, "server": act} for act in case.acts},
            "topics": {cond: {**answers, "topic": cond} for cond in case.conds},
            "root": root,
        }

    def declare(self, name: str, value: object) -> None:
        """Have a variable with a value from the beginning."""
        kind = "string" if isinstance(value, str) else "int64"
        self.inputs[name] = {"type": kind, "default": value}

    def name(self, what: str) -> str:
        """Return a name for a node."""
        return f"{what} {next(self._numbers)}"

    def node(self, element: Element, names: Names) -> Node:
        """Write a node, with what its attributes put around it. Raises NotYet."""
        for attribute in element.attrib:
            if attribute.startswith("_") and attribute not in (*AROUND, "_autoremap"):
                raise NotYet(attribute)
        if element.tag not in KINDS:
            raise NotYet(element.tag)
        node = KINDS[element.tag](self, element, names)
        for attribute, around in AROUND.items():
            if attribute in element.attrib:
                node = around(self, node, element.attrib[attribute], names)
        return node

    def children(self, element: Element, names: Names) -> list[Node]:
        return [self.node(child, names) for child in element]

    def subtree(self, element: Element, names: Names) -> Node:
        prefix = f"t{next(self._numbers)}_"
        inner = Names(prefix, outer=names if element.get("_autoremap") == "true" else None)
        for port, text in element.attrib.items():
            if port in ("ID", "_autoremap"):
                continue
            variable = names.of_text(text)
            inner.ports[port] = variable or f"{prefix}{port}"
            if variable is None:
                self.declare(inner.ports[port], int(text))
        return self.node(self._trees[element.attrib["ID"]], inner)


Write = Callable[[Writer, Element, Names], Node]
Around = Callable[[Writer, Node, str, Names], Node]


# Scripts


def values_of(script: str) -> dict[str, int | str]:
    """The values that a script gives to variables, all of them written out."""
    pairs = [each.split(":=") for each in script.split(";") if each.strip()]
    texts = {name.strip(): value.strip() for name, value in pairs}
    return {name: text[1:-1] if text[0] == "'" else int(text) for name, text in texts.items()}


def expression(code: str, names: Names) -> str:
    """An expression of a script in our words. Raises NotYet."""

    def word(found: re.Match[str]) -> str:
        token = found[0]
        if token == "?":
            raise NotYet("?:")
        return token if token[0] == "'" else _WORDS.get(token) or f"${names[token]}"

    return _TOKEN.sub(word, code).strip()


def assignments(writer: Writer, code: str, names: Names) -> list[Node]:
    """A script, as a node for each of its statements."""
    nodes = []
    for statement in code.split(";"):
        found = re.fullmatch(r"\s*(\w+)\s*(:=|\+=|=)\s*(.*?)\s*", statement)
        if found is None:
            raise NotYet(statement)
        name, value = names[found[1]], expression(found[3], names)
        if found[2] == "+=":
            value = f"${name} + {value}"
        nodes.append({"set": {name: f"= {value}"}, "name": writer.name("Script")})
    return nodes


def _script(writer: Writer, code: str, names: Names) -> Node:
    return _sequence(writer, assignments(writer, code, names))


def _sequence(writer: Writer, children: list[Node], kind: str = "sequence") -> Node:
    return {kind: writer.name(kind), "children": children} if len(children) > 1 else children[0]


# Kinds


def _composite(kind: str, **more: object) -> Write:
    return lambda writer, element, names: {
        kind: writer.name(element.tag),
        **more,
        "children": writer.children(element, names),
    }


def _decorator(kind: str, **attributes: tuple[str, Callable[[str], object]]) -> Write:
    """`attributes`: our key, theirs, and what becomes of its text; None leaves the key out."""

    def write(writer: Writer, element: Element, names: Names) -> Node:
        node: Node = {kind: writer.name(element.tag)}
        for key, (theirs, value) in attributes.items():
            variable = names.of_text(element.attrib[theirs])
            written = f"${variable}" if variable else value(element.attrib[theirs])
            if written is not None:
                node[key] = written
        return {**node, "child": writer.node(element[0], names)}

    return write


def _leaf(kind: str) -> Write:
    return lambda writer, element, names: {kind: writer.name(element.tag)}


def _rounds(text: str) -> int | None:
    return None if text == "-1" else int(text)


def _duration(text: str) -> str:
    return f"{text} ms"


def _act(writer: Writer, element: Element, names: Names) -> Node:
    return {element.attrib["id"]: element.attrib["id"]}


def _cond(writer: Writer, element: Element, names: Names) -> Node:
    return {"check": f"${element.attrib['id']}.data", "name": writer.name("Cond")}


def _check(writer: Writer, code: str, names: Names) -> Node:
    return {"check": expression(code, names), "name": writer.name("check")}


def _loop_int(writer: Writer, element: Element, names: Names) -> Node:
    if element.get("if_empty") == "SKIPPED":
        raise NotYet("if_empty")
    loop = {
        "for_each": writer.name(element.tag),
        "in": [int(each) for each in element.attrib["queue"].split(";")],
        "as": names.of_text(element.attrib["value"]),
        "child": writer.node(element[0], names),
    }
    node = _sequence(writer, [loop, _wait(writer, "1")])  # it looks for more at the next tick
    fails = element.get("if_empty") == "FAILURE"
    return {"force_failure": writer.name("empty"), "child": node} if fails else node


def _set_blackboard(writer: Writer, element: Element, names: Names) -> Node:
    variable = names.of_text(element.attrib["value"])
    value = f"${variable}" if variable else element.attrib["value"]
    return {"set": {names[element.attrib["output_key"]]: value}, "name": writer.name(element.tag)}


def _wait(writer: Writer, milliseconds: str) -> Node:
    return {"wait": _duration(milliseconds), "name": writer.name("wait")}


def _delay(writer: Writer, element: Element, names: Names) -> Node:
    wait = _wait(writer, element.attrib["delay_msec"])
    return _sequence(writer, [wait, writer.node(element[0], names)])


def _parallel(writer: Writer, element: Element, names: Names) -> Node:
    number = len(element)
    succeeds, fails = (
        wanted if wanted >= 0 else number + wanted + 1
        for wanted in (
            int(element.get("success_count", -1)),
            int(element.get("failure_count", 1)),
        )
    )
    if fails < number - succeeds + 1:  # it fails though it might still succeed
        raise NotYet("failure_count")
    return {
        "parallel": writer.name(element.tag),
        "policy": {"at_least": succeeds},
        "children": writer.children(element, names),
    }


def _try_catch(writer: Writer, element: Element, names: Names) -> Node:
    if "catch_on_halt" in element.attrib:
        raise NotYet("catch_on_halt")
    *work, catch = writer.children(element, names)
    last = {"force_failure": writer.name("catch"), "child": catch}
    return _sequence(writer, [_sequence(writer, work), last], "fallback")


def _recovery(writer: Writer, element: Element, names: Names) -> Node:
    child, recover = writer.children(element, names)
    attempts = int(element.get("number_of_retries", 1)) + 1
    if attempts == 1:
        return child
    return {
        "retry": writer.name(element.tag),
        "attempts": attempts,
        "child": child,
        "recover": recover,
    }


def _if_then_else(writer: Writer, element: Element, names: Names) -> Node:
    asked, *branches = writer.children(element, names)
    node: Node = {"if": asked, "name": writer.name(element.tag)}
    if element.tag == "WhileDoElse":
        if element[0].tag in ("Act", "Sleep"):
            raise NotYet("WhileDoElse of what takes time")
        node["memory"] = False
    return {**node, **dict(zip(("then", "else"), branches, strict=False))}


def _switch(writer: Writer, element: Element, names: Names) -> Node:
    *cases, node = writer.children(element, names)
    variable = names.of_text(element.attrib["variable"])
    for number, then in reversed(list(enumerate(cases, 1))):
        asked = f"str(${variable}) == '{element.attrib[f'case_{number}']}'"
        name = writer.name(element.tag)
        node = {"if": asked, "name": name, "memory": False, "then": then, "else": node}
    return node


def _precondition(writer: Writer, element: Element, names: Names) -> Node:
    asked, otherwise = expression(element.attrib["if"], names), element.get("else", "FAILURE")
    child = writer.node(element[0], names)
    if otherwise == "SKIPPED":
        raise NotYet("else=SKIPPED")
    if otherwise == "RUNNING":
        waits = {"wait_until": asked, "name": writer.name("wait")}
        return _sequence(writer, [waits, child])
    last: Node = {otherwise.lower(): writer.name("else")}
    return {"if": asked, "name": writer.name(element.tag), "then": child, "else": last}


KINDS: Mapping[str, Write] = {
    "Act": _act,
    "Cond": _cond,
    "AlwaysSuccess": _leaf("success"),
    "AlwaysFailure": _leaf("failure"),
    "Sleep": lambda writer, element, names: _wait(writer, element.attrib["msec"]),
    "Script": lambda writer, element, names: _script(writer, element.attrib["code"], names),
    "ScriptCondition": lambda writer, element, names: _check(writer, element.attrib["code"], names),
    "SetBlackboard": _set_blackboard,
    "Sequence": _composite("sequence"),
    "AsyncSequence": _composite("sequence"),
    "ReactiveSequence": _composite("sequence", memory=False),
    "Fallback": _composite("fallback"),
    "AsyncFallback": _composite("fallback"),
    "ReactiveFallback": _composite("fallback", memory=False),
    "Parallel": _parallel,
    "TryCatch": _try_catch,
    "RecoveryNode": _recovery,
    "IfThenElse": _if_then_else,
    "WhileDoElse": _if_then_else,
    **dict.fromkeys([f"Switch{number}" for number in range(2, 7)], _switch),
    "Precondition": _precondition,
    "Inverter": _decorator("invert"),
    "ForceSuccess": _decorator("force_success"),
    "ForceFailure": _decorator("force_failure"),
    "RunOnce": _decorator("run_once"),
    "Repeat": _decorator("repeat", times=("num_cycles", _rounds)),
    "RetryUntilSuccessful": _decorator("retry", attempts=("num_attempts", _rounds)),
    "LoopInt": _loop_int,
    "KeepRunningUntilFailure": _decorator("repeat"),
    "Delay": _delay,
    "Timeout": _decorator("timeout", after=("msec", _duration)),
    "SubTree": Writer.subtree,
}


# Attributes, the innermost first


def _after(on: str) -> Around:
    """A script behind a node, which ends as it did."""

    def around(writer: Writer, node: Node, code: str, names: Names) -> Node:
        if on in ("success", "any"):
            node = _sequence(writer, [node, *assignments(writer, code, names)])
        if on in ("failure", "any"):
            script = _script(writer, code, names)
            failed = {"force_failure": writer.name("failed"), "child": script}
            node = _sequence(writer, [node, failed], "fallback")
        return node

    return around


def _unless(kind: str, negate: str) -> Around:
    """A condition before a node, which ends it; asked when the node begins."""

    def around(writer: Writer, node: Node, code: str, names: Names) -> Node:
        asked = f"{negate}({expression(code, names)})"
        check = {"check": asked, "name": writer.name("check")}
        return _sequence(writer, [check, node], kind)

    return around


AROUND: Mapping[str, Around] = {
    "_onSuccess": _after("success"),
    "_onFailure": _after("failure"),
    "_post": _after("any"),
    "_successIf": _unless("fallback", ""),
    "_failureIf": _unless("sequence", "not "),
}
