"""The leaves of a tree as py_trees behaviours, by the names of their kinds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure, Running, Success

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.leaves import Check, Log, SetValues, Wait, WaitUntil
from bt_actions.behaviours.reading import Names, Reading, of_result
from bt_actions.behaviours.run_tree import CANCEL, RunTree, roots_of
from bt_actions.behaviours.service import CallService
from bt_actions.behaviours.topics import Publish, WaitForMessage
from bt_actions.document.building.context import Context, plain_name, table_of, written_text
from bt_actions.document.language.classes import ClassError, make_behaviour, refusal
from bt_actions.document.language.values import Computed, computed_in, spoken
from bt_actions.document.reading.tree import TreeNode, server_of, settings_of, text_of
from bt_actions.document.yaml.nodes import span_of
from bt_actions.goals.policy import Busy, Retry, Timeouts
from bt_actions.messages.interfaces import interface

__all__ = ["LEAVES"]


def _action(node: TreeNode, context: Context) -> Behaviour:
    """The behaviour of an action, by its name in the document or in place."""
    settings = settings_of(node, context.document)
    says_more = len(node.values) - ("goal" in node.values) - ("save" in node.values) > 1
    terms = None if says_more else context.terms.get(node.alias)
    if terms is None:
        terms = {
            "action_type": _interface(settings["type"], "action", context),
            "action_name": context.name(settings, "server"),
            **_terms(settings, context, of_result),
        }
        if not says_more:
            context.terms[node.alias] = terms
    goal = settings.get("goal", {})
    result = terms["action_type"].Result if context.types else None
    return ActionBehaviour(
        node.name,
        goal=context.value(goal) if computed_in(goal) else goal,
        save=context.saved(settings.get("save"), of_result, result),
        **terms,
    )


def _run_tree(node: TreeNode, context: Context) -> Behaviour:
    settings = settings_of(node, context.document)
    return RunTree(
        node.name,
        context.value(settings["tree"]),
        context.value(settings.get("inputs", {})),
        server=context.joined(settings, server_of(settings)),
        save=context.saved(settings.get("save"), roots_of),
        **_terms(settings, context, roots_of, {"cancel": CANCEL}),
    )


def _terms(
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
        "retry": _retry(settings, context),
        "expect": context.condition(settings.get("expect"), names),
        "busy": Busy(text_of(settings, "busy") or "wait"),
        "resources": [context.joined(settings, str(each)) for each in resources],
    }


@lru_cache(maxsize=1024)
def _timeouts(fields: tuple[tuple[str, float | None], ...]) -> Timeouts:
    """Most nodes of a tree have the timeouts of its action: they share one object."""
    return Timeouts(**dict(fields))


def _retry(settings: Mapping[str, object], context: Context) -> Retry:
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
        retry=_retry(values, context),
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


LEAVES: Mapping[str, Callable[[TreeNode, Context], Behaviour]] = MappingProxyType(
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
    }
)
"""What makes a behaviour of each kind of leaf but `subtree`."""
