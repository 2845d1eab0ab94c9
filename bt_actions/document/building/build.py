"""From a checked document to py_trees behaviours. Needs no ROS graph and starts nothing.

`BUILDERS` has an entry for each kind of the model. Only documents without errors come here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy
from py_trees.composites import Selector, Sequence
from py_trees.decorators import FailureIsSuccess, Inverter, OneShot, SuccessIsFailure

from bt_actions.behaviours.decorators import Deadline, ForEach, Repeat, RetryChild, Subtree, While
from bt_actions.behaviours.leaves import WaitUntil
from bt_actions.behaviours.parallel import Parallel
from bt_actions.behaviours.topics import TopicValue, patient
from bt_actions.document.building.context import Context, Scope, plain_name, table_of, written_text
from bt_actions.document.building.leaves import LEAVES
from bt_actions.document.findings import NODE
from bt_actions.document.language.bounds import refuse_large
from bt_actions.document.language.classes import Python
from bt_actions.document.language.values import computed_in
from bt_actions.document.reading.inputs import check_inputs
from bt_actions.document.reading.tree import (
    Declared,
    Document,
    TreeNode,
    join_names,
    settings_of,
    text_of,
    writes_of,
)
from bt_actions.goals.policy import Retry
from bt_actions.utilities.shorten import shorten

__all__ = ["BUILDERS", "build"]


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
        names = {name for each in computed_in(written) for name in each.expression.names}
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


def _sequence(node: TreeNode, context: Context) -> Behaviour:
    memory = node.values.get("memory", True) is True
    return Sequence(node.name, memory, children=_children(node, context))


def _fallback(node: TreeNode, context: Context) -> Behaviour:
    memory = node.values.get("memory", True) is True
    return Selector(node.name, memory, children=_children(node, context))


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
    return While(name, _child(node, context), context.holds(node.values["while"]))


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


BUILDERS: Mapping[str, Callable[[TreeNode, Context], Behaviour]] = MappingProxyType(
    {
        **LEAVES,
        "sequence": _sequence,
        "fallback": _fallback,
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
