"""BehaviorTree.CPP's kinds of nodes in our language: `KINDS` has a function for each."""

from __future__ import annotations

import re

from bt_actions.importing.given import Given, Handler
from bt_actions.importing.leaves import leaf
from bt_actions.importing.names import in_sequence, value_of
from bt_actions.importing.nav2_kinds import NAV2, takes_time
from bt_actions.importing.project import LOOPS, variable_in
from bt_actions.importing.saying import asked, assignments
from bt_actions.importing.scripts import Refused
from bt_actions.importing.text import Node

_SAME = "BlackboardCheck"


def _composite(kind: str, neutral: str, **more: object) -> Handler:
    """Return a composite's handler; `neutral` is the status of a dropped child without effect."""

    def write(given: Given) -> Node:
        children = given.children()
        left = [each for each in children if not (each.dropped and neutral in each)]
        if not left:
            node = Node({neutral: given.name()})
            node.dropped = True
            return node
        if len(left) == 1 < len(children):
            given.differs("one child is left, which stands in its place")
            return left[0]
        return Node({kind: given.name(), **more, "children": left})

    return write


def _round_robin(given: Given) -> Node:
    why = "as in Jazzy: later, where wrap_around is false, success of the last child fails"
    given.dropped("wrap_around", why)
    given.differs(why)
    return _composite("fallback", "failure", in_turn=True)(given)


def _parallel(given: Given) -> Node:
    children = given.children()
    number = len(children)
    names = ("success_count", "success_threshold", "threshold")
    succeeds = _number_of(given, *names, default=-1)
    skips = all(given.element.attributes.get(name, "-1") == "-1" for name in names)
    fails = _number_of(given, "failure_count", "failure_threshold", default=1)
    policy: dict[str, object] = {}
    if 0 < succeeds < number or (succeeds == number and not skips):  # a child that is left out
        policy["at_least"] = succeeds  # counts for -1 alone
    if 0 < fails < number - succeeds + 1:
        policy["fails_after"] = fails
    node = Node(parallel=given.name())
    if policy:
        node["policy"] = policy
    node["children"] = children
    return node


def _number_of(given: Given, *names: str, default: int) -> int:
    """Take a number of children; a negative one counts from all children down."""
    name = next((each for each in names if each in given.element.attributes), "")
    wanted = given.whole(name) if name else default
    if isinstance(wanted, str):
        raise Refused("port", f"{name} is a variable")
    return wanted if wanted >= 0 else len(given.element.children) + wanted + 1


def _parallel_all(given: Given) -> Node:
    """Write a parallel whose children count their failures, as each of them runs to its end."""
    children = given.children()
    fails = _number_of(given, "max_failures", default=1)
    if fails > len(children):
        raise Refused("port", f"max_failures is {fails}, and there are fewer children")
    given.differs("the node succeeds where all of its children are left out; there it is SKIPPED")
    failures = given.writer.variable("failures")
    counted = [
        Node({"if": child, "then": Node(success="As it is"),
              "else": Node(set={failures: f"= ${failures} + 1"})})
        for child in children
    ]  # fmt: skip
    steps = [
        Node(set={failures: 0}),
        Node(parallel="Each to its end", children=counted),
        Node(check=f"${failures} < {fails}"),
    ]
    return Node(sequence=given.name(), children=steps)


def _decorator(kind: str, **more: object) -> Handler:
    return lambda given: Node({kind: given.name(), **more, "child": given.only_child()})


def _invert(given: Given) -> Node:
    child = given.only_child()
    if child.dropped:
        node = Node(success=given.name()) if "failure" in child else Node(failure=given.name())
        node.dropped = "success" in node
        return node
    if set(child) <= {"check", "name"}:
        return Node({**child, "check": _not(child["check"])})
    return Node(invert=given.name(), child=child)


def _not(asked: str) -> str:
    return f"not {asked}" if re.fullmatch(r"\$[\w.]+", asked) else f"not ({asked})"


def _rounds(kind: str, key: str, port: str, none: str) -> Handler:
    def write(given: Given) -> Node:
        times = given.whole(port, "1")
        node = Node({kind: given.name()})
        if isinstance(times, str):
            given.converted(port, "it is read when the loop begins, there at each round")
            node[key] = times
        elif times == 0 or times < -1:
            given.children()
            given.differs("it has no round")
            return Node({none: given.name()})
        elif times > 0:
            node[key] = times
        return Node({**node, "child": given.only_child()})

    return write


def _once(given: Given) -> Node:
    if given.text("then_skip", "true") not in ("false", "0"):
        given.differs("there it is skipped once it has ended; here it keeps to its end")
    return Node(run_once=given.name(), child=given.only_child())


def _delay(given: Given) -> Node:
    port = "delay_msec" if "delay_msec" in given.element.attributes else "msec"
    wait = Node(wait=given.duration(port))
    return Node(sequence=given.name(), children=[wait, given.only_child()])


def _wait(given: Given) -> Node:
    return given.named(Node(wait=given.duration("msec")))


def _timeout(given: Given) -> Node:
    after = given.duration("msec")
    return Node(timeout=given.name(), after=after, child=given.only_child())


def _asked_by(condition: Node) -> object:
    """Return a child that is a condition, as the value of `if`."""
    return condition["check"] if set(condition) <= {"check", "name"} else condition


def _if(**more: object) -> Handler:
    def write(given: Given) -> Node:
        children = given.children()
        if not 2 <= len(children) <= 3:
            raise Refused("children")
        stub = next(iter(children[0])) in given.writer.words["kinds"]
        stub = stub and given.element.children[0].tag != "Action"
        if more and takes_time(children[0]) and not stub:  # a stub may be a condition
            raise Refused("condition")
        node = Node({"if": _asked_by(children[0]), **more, "then": children[1]})
        if len(children) == 3:
            node["else"] = children[2]
        return given.named(node)

    return write


def _switch(cases: int) -> Handler:
    def write(given: Given) -> Node:
        children = given.children()
        if len(children) != cases + 1:
            raise Refused("children")
        variable = variable_in(given.text("variable"), "variable")
        if variable is None:
            raise Refused("port", "its variable is a value")
        reference = f"${given.scope[variable]}"
        node = children[-1]
        for number in range(cases, 0, -1):
            case = given.text(f"case_{number}")
            kind = given.writer.project.sorts[variable].value
            if (name := variable_in(case, "")) is not None:
                other = f"${given.scope[name]}"
            elif kind == "string" or (not kind and not re.fullmatch(r"-?\d+(\.\d*)?", case)):
                other = f"'{case}'"
            else:
                constants = given.writer.project.mapping.constants
                other = str(constants.get(case, value_of(case, kind)))
            asked = f"{reference} == {other}"
            node = Node({"if": asked, "memory": False, "then": children[number - 1], "else": node})
        return given.named(node)

    return write


def _try(given: Given) -> Node:
    if given.text("catch_on_halt", "false") not in ("false", "0"):
        raise Refused("catch_on_halt")
    *work, catch = given.children()
    if not work:
        raise Refused("children")
    failed = Node(force_failure="Clean up", child=catch)
    return Node(fallback=given.name(), children=[in_sequence("Try", work), failed])


def _precondition(given: Given) -> Node:
    code, otherwise = given.text("if"), given.text("else", "FAILURE")
    child = given.only_child()
    writer = given.writer
    holds = asked(writer.project, code, given.scope)
    if otherwise == "SKIPPED":
        if "only_if" in child:
            child = Node(sequence=given.name(), children=[child])
        child["only_if"] = holds
        return child
    if otherwise == "RUNNING":
        return Node(sequence=given.name(), children=[Node(wait_until=holds), child])
    node = Node({"if": holds, "then": child})
    if otherwise == "SUCCESS":
        node["else"] = Node(success="As it is")
    return given.named(node)


def _same(given: Given) -> Node:
    """Write a check of two values of BehaviorTree.CPP 3."""
    sides = []
    for name in ("value_A", "value_B"):
        text = given.reference(name)
        sides.append(
            text or repr(value_of(given.text(name), given.kind.removeprefix(_SAME).lower()))
        )
    otherwise = given.text("return_on_mismatch", "FAILURE").lower()
    if otherwise not in ("success", "failure"):
        raise Refused("port", f"return_on_mismatch={otherwise!r}")
    other = Node({otherwise: "Another value"})
    return given.named(Node({"if": " == ".join(sides), "then": given.only_child(), "else": other}))


def _script(given: Given) -> Node:
    name = given.name() if "name" in given.element.attributes else ""
    nodes = assignments(given.writer.project, given.text("code"), given.scope, name)
    return in_sequence(given.name(), nodes) if nodes else Node(success=given.name())


def _check(given: Given) -> Node:
    code = given.text("code").rstrip("; ")
    before, _, last = code.rpartition(";")
    check = given.named(Node(check=asked(given.writer.project, last, given.scope)))
    sets = assignments(given.writer.project, before, given.scope)
    return in_sequence(given.name(), [*sets, check])


def _set(given: Given) -> Node:
    name = given.text("output_key").strip("{} ")
    text = given.text("value")
    value: object = given.reference("value")
    if value is None:
        project = given.writer.project
        known = project.types.get(name, "")
        value = value_of(
            text, known if known.endswith("]") else project.sorts[name].value or "string"
        )
    return given.named(Node(set={given.scope[name]: value}))


def _for_each(given: Given) -> Node:
    empty = given.text("if_empty", "SUCCESS")
    if empty == "SKIPPED":
        raise Refused("if_empty")
    name = variable_in(given.text("value"), "value")
    if name is None:
        raise Refused("port", "'value' names no variable")
    items: object = given.reference("queue")
    if items is None:
        items = value_of(given.text("queue"), f"{LOOPS[given.kind].value}[]")
    else:
        given.converted("queue", "the list stays as it is: nothing is taken out of it")
    node = Node({"for_each": given.name(), "in": items, "as": given.scope[name],
                 "child": given.only_child()})  # fmt: skip
    if empty == "FAILURE":
        return Node(force_failure=given.name(), child=node)
    return node


KINDS: dict[str, Handler] = {
    "a leaf": leaf,
    "AlwaysSuccess": lambda given: Node(success=given.name()),
    "AlwaysFailure": lambda given: Node(failure=given.name()),
    "Sleep": _wait,
    "Script": _script,
    "ScriptCondition": _check,
    "SetBlackboard": _set,
    "Sequence": _composite("sequence", "success"),
    "AsyncSequence": _composite("sequence", "success"),
    "ReactiveSequence": _composite("sequence", "success", memory=False),
    "SequenceWithMemory": _composite("sequence", "success", memory="resume"),
    "SequenceStar": _composite("sequence", "success", memory="resume"),
    "Fallback": _composite("fallback", "failure"),
    "Selector": _composite("fallback", "failure"),
    "FallbackStar": _composite("fallback", "failure"),
    "AsyncFallback": _composite("fallback", "failure"),
    "ReactiveFallback": _composite("fallback", "failure", memory=False),
    "RoundRobin": _round_robin,
    "Parallel": _parallel,
    "ParallelAll": _parallel_all,
    "IfThenElse": _if(),
    "WhileDoElse": _if(memory=False),
    "TryCatch": _try,
    "Inverter": _invert,
    "inverter": _invert,  # an example of Nav2's has this spelling
    "ForceSuccess": _decorator("force_success"),
    "ForceFailure": _decorator("force_failure"),
    "Repeat": _rounds("repeat", "times", "num_cycles", "success"),
    "RetryUntilSuccessful": _rounds("retry", "attempts", "num_attempts", "failure"),
    "RetryUntilSuccesful": _rounds("retry", "attempts", "num_attempts", "failure"),
    "KeepRunningUntilFailure": _decorator("repeat"),
    "Delay": _delay,
    "Timeout": _timeout,
    "RunOnce": _once,
    "Precondition": _precondition,
    **{f"Switch{cases}": _switch(cases) for cases in range(2, 7)},
    **dict.fromkeys(LOOPS, _for_each),
    **{f"{_SAME}{what}": _same for what in ("Int", "Double", "String", "Bool")},
    **NAV2,
}
