"""From a checked document to py_trees behaviours. Needs no ROS graph and starts nothing.

`BUILDERS` has an entry for each kind of the model. Only documents without errors come here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure, Running, Success
from py_trees.common import OneShotPolicy
from py_trees.composites import Selector, Sequence
from py_trees.decorators import FailureIsSuccess, Inverter, OneShot, SuccessIsFailure

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.decorators import Deadline, ForEach, Repeat, RetryChild, Subtree, While
from bt_actions.behaviours.leaves import Check, Log, SetValues, Wait, WaitUntil, stood_for
from bt_actions.behaviours.parallel import Parallel
from bt_actions.behaviours.reading import Names, Reading, of_result
from bt_actions.behaviours.run_tree import CANCEL, RunTree, roots_of
from bt_actions.behaviours.service import CallService
from bt_actions.behaviours.topics import Publish, TopicValue, WaitForMessage, patient
from bt_actions.document.building.context import Context, Scope, plain_name, table_of, written_text
from bt_actions.document.findings import NODE
from bt_actions.document.language.classes import ClassError, Python, make_behaviour, refusal
from bt_actions.document.language.values import Computed, computed_in, refuse_large, spoken
from bt_actions.document.reading.inputs import check_inputs, inputs_of
from bt_actions.document.reading.tree import (
    Declared,
    Document,
    TreeNode,
    join_names,
    server_of,
    settings_of,
    text_of,
    writes_of,
)
from bt_actions.document.yaml.nodes import span_of
from bt_actions.goals.policy import Busy, Retry, Timeouts
from bt_actions.messages.interfaces import interface
from bt_actions.utilities.shorten import shorten


def build(
    document: Document,
    scope: Scope,
    *,
    namespace: str = "",
    types: bool = True,
    python: Python = True,
    once: bool = False,
) -> Behaviour:
    """The behaviours of a document; each has its node.

    With `once` no more will be made of it: its YAML is let go of on the way. What cannot be made is
    reported to the document's source, as is every ``python:`` node that `python` does not allow.
    Raises TooManyErrors.
    """
    assert document.root is not None
    scope.hide(name for name, each in inputs_of(document).items() if each.secret)
    inner = join_names(namespace, document.namespace)
    topics = {declared.name: _topic(declared, inner) for declared in document.topics.values()}
    context = Context(document, scope, inner, types, topics, python, once)
    root = _node(document.root, context)
    if topics:
        _connect(root, list(topics.values()))
    return root


def _topic(declared: Declared, namespace: str) -> TopicValue:
    values: dict[str, Any] = declared.values
    name = join_names(namespace, text_of(values, "namespace"), text_of(values, "topic"))
    qos = text_of(values, "qos") or "default"
    return TopicValue(declared.name, values["type"], name, qos, values.get("max_age"))


def _connect(root: Behaviour, topics: list[TopicValue]) -> None:
    """Subscribe when the tree is set up, and unsubscribe when it is shut down.

    Any node may read a topic, foreign ones' children too; so the root of the document does it for
    all, and no node is added to the tree.
    """
    set_up, shut_down = root.setup, root.shutdown

    def setup(**kwargs: Any) -> None:
        set_up(**kwargs)  # which shuts a leaf down that was set up before
        for topic in topics:
            topic.setup(**kwargs)

    def shutdown() -> None:
        shut_down()
        for topic in topics:
            topic.shutdown()

    root.setup = setup  # type: ignore[method-assign]
    root.shutdown = shutdown  # type: ignore[method-assign]


def _node(node: TreeNode, context: Context) -> Behaviour:
    behaviour = BUILDERS[node.kind.name](node, context)
    if context.topics and not isinstance(behaviour, WaitUntil):  # which waits anyway
        written = settings_of(node, context.document) if node.is_action else node.values
        names = {name for each in computed_in(written) for name in each.expression.variables}
        if read := [topic for name, topic in context.topics.items() if name in names]:
            patient(behaviour, read)
    setattr(behaviour, NODE, node)
    if context.once:
        node.release()
    return behaviour


def _children(node: TreeNode, context: Context) -> list[Behaviour]:
    built = []
    for child in node.children:  # a comprehension would take a level of recursion of its own
        built.append(_node(child, context))  # noqa: PERF401
    return built


def _in_turn(make: Callable[..., Behaviour]) -> Callable[[TreeNode, Context], Behaviour]:
    return lambda node, context: make(
        node.name, node.values.get("memory", True) is True, children=_children(node, context)
    )


def _parallel(node: TreeNode, context: Context) -> Behaviour:
    policy = node.values.get("policy", "all")
    needed = policy.get("at_least") if isinstance(policy, dict) else {"one": 1}.get(str(policy))
    return Parallel(node.name, _children(node, context), at_least=needed)


def _child(node: TreeNode, context: Context) -> Behaviour:
    (child,) = node.children
    return _node(child, context)


def _retry(node: TreeNode, context: Context) -> Behaviour:
    values: dict[str, Any] = node.values
    given = {key: values[key] for key in ("backoff", "factor", "max_backoff") if key in values}
    attempts = context.value(values["attempts"]) if "attempts" in values else None
    return RetryChild(node.name, _child(node, context), attempts, Retry(**given))


def _repeat(node: TreeNode, context: Context) -> Behaviour:
    times = context.value(node.values["times"]) if "times" in node.values else None
    return Repeat(node.name, _child(node, context), times)


def _timeout(node: TreeNode, context: Context) -> Behaviour:
    return Deadline(node.name, _child(node, context), context.value(node.values["after"]))


def _around(make: Callable[..., Behaviour]) -> Callable[[TreeNode, Context], Behaviour]:
    return lambda node, context: make(node.name, _child(node, context))


def _once(name: str, child: Behaviour) -> Behaviour:
    return OneShot(name, child, OneShotPolicy.ON_COMPLETION)


def _for_each(node: TreeNode, context: Context) -> Behaviour:
    values = node.values
    item_name, index_name = text_of(values, "as") or "item", text_of(values, "index")

    def begin(item: object, index: int) -> None:
        context.write({item_name: item} | ({index_name: index} if index_name else {}))

    keep_going = values.get("on_failure") == "continue"
    items = context.value(values["in"])
    return ForEach(node.name, _child(node, context), items, begin, keep_going=keep_going)


def _while(node: TreeNode, context: Context) -> Behaviour:
    name = node.name or plain_name(f"while {written_text(node)}")
    written, holds = node.values["while"], context.holds(node.values["while"])
    assert isinstance(written, Computed)

    def condition() -> bool:
        if holds():
            return True
        raise ValueError(
            f"the condition does not hold{stood_for(written.expression, context.read)}"
        )

    return While(name, _child(node, context), condition)


def _subtree(node: TreeNode, context: Context) -> Behaviour:
    included = node.included
    assert included is not None
    scope = context.scope.inner(included.name)
    namespace = join_names(context.namespace, text_of(node.values, "namespace"))
    child = build(included, scope, namespace=namespace, types=context.types, python=context.python)
    given = context.value(node.values.get("with", {}))
    saved = table_of(node.values.get("save"))
    written = {declared.name for declared in included.outputs.values()}
    written |= _writes(included, included.nodes())
    for inner in included.nodes():
        if inner.kind.name == "run_once":
            written -= _writes(included, inner.walk())  # which is not done again

    def begin() -> None:
        values = given()
        if not isinstance(values, dict):
            got = shorten(values, 60)
            raise ValueError(f"'with' needs a mapping of inputs to values, not {got}")
        try:
            refuse_large(values)
        except ValueError as error:
            raise ValueError(f"'with': {error}") from None
        inputs = check_inputs(included, values, types=context.types)
        for name in written:
            if name not in inputs:
                scope.clear(name)
        scope.write_all(inputs)

    def end() -> None:
        values = {}
        for name, output in saved.items():
            with contextlib.suppress(KeyError):  # a tree that failed may have nothing to give
                values[name] = scope.read(output)
        context.write(values)

    return Subtree(node.name or included.name, child, begin, end)


def _writes(document: Document, nodes: Iterable[TreeNode]) -> set[str]:
    """The names of the variables that some nodes of a tree write."""
    return {each.name for node in nodes for each in writes_of(node, document)}


def _action(node: TreeNode, context: Context) -> Behaviour:
    """The behaviour of an action, by its name in the document or in place."""
    settings = settings_of(node, context.document)
    overrides_alias = len(node.values) - ("goal" in node.values) - ("save" in node.values) > 1
    shared = None if overrides_alias else context.shared.get(node.alias)
    if shared is None:
        shared = {
            "action_type": _interface(settings["type"], "action", context),
            "action_name": context.name(settings, "server"),
            **_shared_settings(settings, context, of_result),
        }
        if not overrides_alias:
            context.shared[node.alias] = shared
    goal = settings.get("goal", {})
    result = shared["action_type"].Result if context.types else None
    return ActionBehaviour(
        node.name,
        goal=context.value(goal) if computed_in(goal) else goal,
        save=context.saved(settings.get("save"), of_result, result),
        **shared,
    )


def _run_tree(node: TreeNode, context: Context) -> Behaviour:
    settings = settings_of(node, context.document)
    return RunTree(
        node.name,
        context.value(settings["tree"]),
        context.value(settings.get("inputs", {})),
        server=context.joined(settings, server_of(settings)),
        save=context.saved(settings.get("save"), roots_of),
        **_shared_settings(settings, context, roots_of, {"cancel": CANCEL}),
    )


def _shared_settings(
    settings: Mapping[str, object],
    context: Context,
    names: Names,
    timeout: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, Any]:
    """What a goal is sent and judged by, whatever it says; `timeout` where nothing else is said."""
    given = settings.get("resources")
    resources = given if isinstance(given, list) else []
    return {
        "timeout": _timeouts(tuple({**timeout, **table_of(settings.get("timeout"))}.items())),
        "retry": _policy(settings, context),
        "expect": context.condition(settings.get("expect"), names),
        "busy": Busy(text_of(settings, "busy") or "wait"),
        "resources": [context.joined(settings, str(each)) for each in resources],
    }


@lru_cache(maxsize=1024)
def _timeouts(fields: tuple[tuple[str, float | None], ...]) -> Timeouts:
    """Most nodes of a tree have the timeouts of its action: they share one object."""
    return Timeouts(**dict(fields))


def _policy(settings: Mapping[str, object], context: Context) -> Retry:
    fields = {**table_of(settings.get("retry"))}
    if "outcomes" in fields:
        fields["outcomes"] = frozenset(fields["outcomes"])
    if "when" in fields:  # reads the variables of one tree, so that no other can share it
        fields["when"] = context.condition(fields["when"], of_result)
        return Retry(**fields)
    return _plain_retry(tuple(fields.items()))


@lru_cache(maxsize=1024)
def _plain_retry(fields: tuple[tuple[str, Any], ...]) -> Retry:
    return Retry(**dict(fields))


def _interface(name: object, kind: str, context: Context) -> Any:
    return interface(str(name), kind) if context.types else name


def _check(node: TreeNode, context: Context) -> Behaviour:
    written = node.values["check"]
    assert isinstance(written, Computed)
    name = node.name or plain_name(written.expression.text)
    return Check(name, written.expression, context.read)


def _reader(
    values: Mapping[str, object], context: Context, condition: str, what: str, names: Names
) -> Callable[[Any], str]:
    """What judges an answer or a message, and keeps parts of it, as `save` says."""
    expect = context.condition(values.get(condition), names)
    reading = Reading(expect, context.saved(values.get("save"), names), what=what)
    reading.set_up(None)
    return reading.read


def _service(node: TreeNode, context: Context) -> Behaviour:
    values = node.values
    timeout = table_of(values.get("timeout"))
    return CallService(
        node.name,
        _interface(values["type"], "srv", context),
        context.name(values, "server"),
        context.value(values.get("request", {})),
        server=timeout.get("server", 5.0),
        response=timeout.get("response", 5.0),
        retry=_policy(values, context),
        read=_reader(values, context, "expect", "answer", of_result),
    )


def _publish(node: TreeNode, context: Context) -> Behaviour:
    values = node.values
    subscribers: Any = values.get("subscribers", 0)
    timeout: Any = values.get("timeout")
    return Publish(
        node.name or plain_name(f"publish {text_of(values, 'publish')}"),
        _interface(values["type"], "msg", context),
        context.name(values, "publish"),
        context.value(values.get("message", {})),
        qos=text_of(values, "qos") or "default",
        subscribers=subscribers,
        timeout=timeout,
    )


def _wait_for_message(node: TreeNode, context: Context) -> Behaviour:
    values = node.values
    timeout: Any = values.get("timeout")
    return WaitForMessage(
        node.name,
        _interface(values["type"], "msg", context),
        context.name(values, "topic"),
        qos=text_of(values, "qos") or "default",
        timeout=timeout,
        read=_reader(values, context, "until", "message", lambda message: {"message": message}),
    )


def _wait(node: TreeNode, context: Context) -> Behaviour:
    name = node.name or plain_name(f"wait {written_text(node)}")
    return Wait(name, context.value(node.values["wait"]))


def _wait_until(node: TreeNode, context: Context) -> Behaviour:
    name = node.name or plain_name(f"wait until {written_text(node)}")
    timeout: Any = node.values.get("timeout")
    return WaitUntil(name, context.holds(node.values["wait_until"]), timeout)


def _set(node: TreeNode, context: Context) -> Behaviour:
    written = table_of(node.values["set"])
    name = node.name or plain_name(f"set {', '.join(written)}")
    compute = context.value(written)
    return SetValues(name, lambda: context.write(table_of(compute())))


def _log(node: TreeNode, context: Context) -> Behaviour:
    name = node.name or plain_name(f"log {written_text(node)}")
    level = text_of(node.values, "level") or "info"
    text = node.values["log"]
    return Log(name, lambda: spoken(text, context.read), level)


def _python(node: TreeNode, context: Context) -> Behaviour:
    """What cannot be made is reported to the document's source, and `Failure` stands for it."""
    path = text_of(node.values, "python")
    name = node.name or path.rpartition(".")[2]
    if refused := refusal(path, context.python):  # nothing is imported, whatever the checker said
        node.source.report("BT214", span_of(node.key), refused)
        return Failure(name)
    try:
        return make_behaviour(path, name, table_of(node.values.get("arguments")))
    except ClassError as error:
        code, at = "BT214", node.written["python"]
        if "arguments" in node.written:
            code, at = "BT215", node.written["arguments"]
        node.source.report(code, span_of(at), str(error))
        return Failure(name)


def _plain(
    make: Callable[..., Behaviour], default: str
) -> Callable[[TreeNode, Context], Behaviour]:
    return lambda node, _context: make(name=node.name or default)


BUILDERS: Mapping[str, Callable[[TreeNode, Context], Behaviour]] = MappingProxyType(
    {
        "action": _action,
        "run_tree": _run_tree,
        "service": _service,
        "publish": _publish,
        "wait_for_message": _wait_for_message,
        "wait": _wait,
        "wait_until": _wait_until,
        "check": _check,
        "set": _set,
        "log": _log,
        "python": _python,
        "success": _plain(Success, "success"),
        "failure": _plain(Failure, "failure"),
        "running": _plain(Running, "running"),
        "sequence": _in_turn(Sequence),
        "fallback": _in_turn(Selector),
        "parallel": _parallel,
        "retry": _retry,
        "repeat": _repeat,
        "timeout": _timeout,
        "invert": _around(Inverter),
        "force_success": _around(FailureIsSuccess),
        "force_failure": _around(SuccessIsFailure),
        "run_once": _around(_once),
        "for_each": _for_each,
        "while": _while,
        "subtree": _subtree,
    }
)
"""What makes a behaviour of each kind of node."""
