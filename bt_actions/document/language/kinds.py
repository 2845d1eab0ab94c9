"""A kind of node: `Kind` holds all that reading, checking and building ask of one.

The kinds stand in `document/kinds/`, a file each, which registers them in `KINDS`. A file makes its
kind by `composite`, `decorator` or `leaf`, and names only those fields of `Kind` in which the kind
differs from others. No pass of the checker knows a kind by name:

- `verdicts.py` asks how a node can end, from how its children can: `ends`, `seconds`;
- `hazards.py` and `reads.py` ask when children are ticked: `goes_on`, `again`, `once`, `begun`;
- `check.py` asks the forms of value and keys, and then `check`.

The types of a kind's functions name no node, checker or context, as these belong to rooms above.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from bt_actions.document.language.keys import (
    ACTION_KEYS,
    GATES,
    NODE,
    NODES,
    ConditionOrNode,
    keyed,
)
from bt_actions.document.language.ros_names import RosName
from bt_actions.document.language.scalars import Condition, NodeName, Shape
from bt_actions.document.language.shapes import Key, required_in

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

    from bt_actions.messages.interfaces import Kind as InterfaceKind

Settings = Mapping[str, object]
"""The values under the keys of a node, the kind's own key among them."""


class Group(StrEnum):
    """The group of a kind, in py_trees' words."""

    COMPOSITE = "composite"
    DECORATOR = "decorator"
    LEAF = "leaf"


class End(StrEnum):
    """The end of a child."""

    SUCCESS = "success"
    FAILURE = "failure"
    ANY = "any"


class Can(NamedTuple):
    """Whether a node can succeed, and whether it can fail."""

    succeed: bool
    fail: bool


EITHER = Can(True, True)
SUCCEEDS = Can(True, False)


@dataclass(frozen=True, slots=True)
class Interface:
    """The ROS interface of a kind: `name` is the key for the server or the topic.

    `fields` is the key for the fields of the sent message, which is the interface's part `sent`.
    `root` is the name of the part `received` in expressions; `more` are further names, of unknown
    types. `type` is the interface's, where no key gives one.
    """

    kind: InterfaceKind
    name: str
    fields: str = ""
    sent: str = ""
    root: str = ""
    received: str = ""
    more: tuple[str, ...] = ()
    type: str = ""

    def part(self, cls: Any, name: str) -> Any:
        """Return a part of an interface's class; a message is its own part."""
        return getattr(cls, name) if name else cls


ACTION = Interface("action", "server", "goal", "Goal", "result", "Result")


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of node. `value` is the form of the value behind the kind's own key."""

    name: str
    group: Group
    value: Shape
    doc: str
    keys: Mapping[str, Key]
    example: str
    build: Callable[..., Behaviour]
    """Makes a behaviour of a node, a Context and the children's behaviours, one by one.

    The function imports the behaviour's class when it is called: checking is to stay quick.
    """
    reads: str
    """The key whose value is computed before anything else; without a value the node fails."""
    interface: Interface | None = None
    check: Callable[..., None] | None = None
    """Reports, of a Checker and a node, what is wrong beyond the forms of the keys."""
    warn: Callable[..., None] | None = None
    """Reports hazards, of Hazards, a node, and whether a timeout around the node bounds it."""
    ends: Callable[[Settings, list[Can], bool], Can] = lambda _values, _inner, _at_once: EITHER
    """How a node can end, from how its children can; with `True`, in the tick of its begin."""
    seconds: Callable[[Settings, list[float]], float] = lambda _values, inner: max(inner)
    """The seconds of all deadlines and pauses of a node, from those of its children."""
    writes: Callable[[Settings], Iterable[tuple[str, str, object, str | None]]] | None = None
    """Variables that a node writes without `save`: name, key, value, and the value's root."""
    begun: bool = False
    """Whether a node takes time at each begin."""
    slow: bool | str = False
    """Whether a node may take time by itself; a text names the key that makes it slow."""
    goes_on: End | None = None
    """The end of a child after which a composite ticks the next, and a decorator succeeds."""
    again: End | None = None
    """The end of a child after which another round, or a branch beside it, may write and read."""
    once: bool = False
    """Whether the child is never begun anew after its end."""
    bounds: bool = False
    """Whether the node stops its child after some time."""
    paces: bool = False
    """Whether the node holds its child back after a success, in this visit of the parent."""
    computes: bool = False
    """Whether a node fails for hardly anything but a missing value."""
    semantics: str = ""
    """Rows of a table in Markdown, with a head: the node's behaviour in each case."""
    includes: bool = False
    """Whether a node stands for another tree, and saves its outputs however that tree ends."""

    @property
    def named_by_value(self) -> bool:
        """Whether the kind's value is the node's name."""
        return isinstance(self.value, NodeName)

    @cached_property
    def needs(self) -> tuple[Key, ...]:
        """The required keys."""
        return required_in(self.keys)

    @cached_property
    def holds(self) -> tuple[str, ...]:
        """The keys that hold nodes, in the order of the children; the kind's own may be one."""
        own = (self.name,) if isinstance(self.value, ConditionOrNode) else ()
        return own + tuple(name for name, key in self.keys.items() if key.shape in (NODE, NODES))

    @cached_property
    def ros_names(self) -> tuple[str, ...]:
        """The keys whose values are names of servers, topics or namespaces."""
        forms = {self.name: self.value} | {name: key.shape for name, key in self.keys.items()}
        return tuple(name for name, form in forms.items() if isinstance(form, RosName))

    @cached_property
    def is_action(self) -> bool:
        """Whether a node sends a goal."""
        return self.interface is not None and self.interface.kind == "action"

    @cached_property
    def asks(self) -> bool:
        """Whether a node asks a condition."""
        return isinstance(self.value, Condition)

    @cached_property
    def only_asks(self) -> bool:
        """Whether a node does nothing but ask a condition."""
        return self.asks and self.group is Group.LEAF

    @cached_property
    def in_turn(self) -> End | None:
        """The end of a child after which the next one is ticked, where children take turns."""
        return self.goes_on if self.group is Group.COMPOSITE else None


NAME = Key("name", NodeName(), "A name for the node, in place of the value of its kind.")
_CHILDREN = Key("children", NODES, "The child nodes.", required=True,
                example="[{success: First}, {success: Second}]")  # fmt: skip
_CHILD = Key("child", NODE, "The child node.", required=True, example="{success: Done}")

KINDS: dict[str, Kind] = {}
"""Every kind of node, by its key; `document/kinds/` fills the table once, at its import."""
OWN_KINDS: dict[str, Kind] = {}
"""The kinds behind kinds that a tree declares, by the children that these hold."""
NODE_KEYS = {*ACTION_KEYS, "child", "children"}
"""All keys of a node beside its kind: no action may have such a name.

Other keys that hold nodes may name an action. Beside a kind with such a key, the word is the key.
"""
SINCE = dict.fromkeys(
    ("if", "pipeline", "every", "in_turn", "on_change", "save_on_failure", "save_feedback", *GATES),
    "0.2",
)
"""The version of bt_actions since which a word may name no action, where that is not the first."""


def register(*kinds: Kind) -> None:
    """Add kinds to the language. Raises ValueError for a name that is taken."""
    for kind in kinds:
        if kind.name in KINDS:
            raise ValueError(f"there is a kind {kind.name!r} already")
        KINDS[kind.name] = replace(kind, keys={**kind.keys, **GATES})
        NODE_KEYS.update(kind.keys.keys() - set(kind.holds))


# `more` is any of the other fields of Kind; a wrong one raises when the kind's file is imported.


def composite(name: str, doc: str, example: str, *keys: Key, **more: Any) -> Kind:
    """Make a kind that holds a list of nodes."""
    own = keyed(_CHILDREN, *keys)
    return Kind(name, Group.COMPOSITE, NodeName(), doc, own, example, reads=name, **more)


def decorator(
    name: str, doc: str, example: str, *keys: Key, value: Shape | None = None, **more: Any
) -> Kind:
    """Make a kind that holds one node. The first key says how often, or how long."""
    own = keyed(_CHILD, *keys, *(() if value is None else (NAME,)))
    reads, form = keys[0].name if keys else name, value or NodeName()
    return Kind(name, Group.DECORATOR, form, doc, own, example, reads=reads, **more)


def leaf(name: str, value: Shape, doc: str, example: str, *keys: Key, **more: Any) -> Kind:
    """Make a kind without children, which reads the fields it sends or the value behind its key."""
    own = keyed(*keys, *(() if isinstance(value, NodeName) else (NAME,)))
    more.setdefault("reads", more["interface"].fields if "interface" in more else name)
    return Kind(name, Group.LEAF, value, doc, own, example, **more)


def own_kind(name: str, children: str) -> Kind:
    """Make a kind that a tree declares; `children` are none, one or many."""
    made = OWN_KINDS.get(children, OWN_KINDS["none"])
    return replace(made, name=name, keys={**made.keys, **GATES})
