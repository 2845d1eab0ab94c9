"""From a checked document to py_trees behaviours. Needs no ROS graph and starts nothing.

The kinds of the nodes build the behaviours. All documents here are without errors.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from py_trees.behaviour import Behaviour

from bt_actions.behaviours.gates import gate
from bt_actions.behaviours.topics import READ, TopicValue, patient
from bt_actions.document.building.context import Context, Scope, filled
from bt_actions.document.findings import NODE
from bt_actions.document.language.classes import Python
from bt_actions.document.language.keys import GATES
from bt_actions.document.language.values import computed_in
from bt_actions.document.reading.inputs import inputs_of
from bt_actions.document.reading.tree import (
    Declared,
    Document,
    TreeNode,
    join_names,
    settings_of,
    text_of,
)


def build(
    document: Document,
    scope: Scope,
    *,
    namespace: str = "",
    types: bool = True,
    python: Python = True,
    once: bool = False,
    static: Mapping[str, object] = MappingProxyType({}),
) -> Behaviour:
    """Return the behaviours of a document; each has its node.

    `static` are the known inputs, which the names of servers may hold. `once` says that no second
    call follows, so the YAML is dropped on the way. A node that fails to be made is reported to
    the document's source, as is every ``python:`` node that `python` does not allow. Raises
    TooManyErrors, and InputError for an input that makes a name invalid.
    """
    assert document.root is not None
    scope.hide(name for name, each in inputs_of(document).items() if each.secret)
    inner = join_names(namespace, filled(document.namespace, static))
    topics: dict[str, TopicValue] = {}
    context = Context(document, scope, inner, types, topics, python, once, static)
    topics |= {each.name: _topic(each, context) for each in document.topics.values()}
    for name, declared in document.topics.items():
        if "default" in declared.values:
            topics[name].default = context.default(declared)
    root = _node(document.root, context)
    if topics:
        _connect(root, list(topics.values()))
    return root


def _topic(declared: Declared, context: Context) -> TopicValue:
    values: dict[str, Any] = declared.values
    name = context.name(values, "topic")
    qos = text_of(values, "qos") or "default"
    return TopicValue(declared.name, values["type"], name, qos, values.get("max_age"))


def _connect(root: Behaviour, topics: list[TopicValue]) -> None:
    """Subscribe at the tree's setup, and unsubscribe at its shutdown.

    Any node may read a topic, also below a foreign node; so the root of the document subscribes for
    all, and no node is added to the tree.
    """
    set_up, shut_down = root.setup, root.shutdown

    def setup(**kwargs: Any) -> None:
        set_up(**kwargs)  # shuts leaves down that were set up
        for topic in topics:
            topic.setup(**kwargs)

    def shutdown() -> None:
        shut_down()
        for topic in topics:
            topic.shutdown()

    root.setup = setup  # type: ignore[method-assign]
    root.shutdown = shutdown  # type: ignore[method-assign]


def _node(node: TreeNode, context: Context) -> Behaviour:
    children = []
    for child in node.children:  # a comprehension would take a level of recursion of its own
        children.append(_node(child, context))  # noqa: PERF401
    behaviour = node.kind.build(node, context, *children)
    gates: dict[str, object] = {}
    if not GATES.keys().isdisjoint(node.values):
        gates = {key: node.values[key] for key in GATES if key in node.values}
        conditions = {key: context.why_not(key, written) for key, written in gates.items()}
        gate(behaviour, {key: context.said(each) for key, each in gates.items()}, **conditions)
    if context.topics:
        written = settings_of(node, context.document) if node.is_action else node.values
        if read := _read(written, context):
            setattr(behaviour, READ, tuple(topic.topic for topic in read))
        if node.kind.only_asks and node.kind.slow:  # a slow check waits anyway
            read = _read(gates, context)
        if read:
            patient(behaviour, read)
    setattr(behaviour, NODE, node)
    if context.once:
        node.release()
    return behaviour


def _read(written: Mapping[str, object], context: Context) -> list[TopicValue]:
    """Return the topics whose values the settings of a node compute with."""
    names = {name for each in computed_in(written) for name in each.expression.variables}
    return [topic for name, topic in context.topics.items() if name in names]
