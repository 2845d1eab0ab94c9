"""The events of a tree: its nodes, their changes, and the end of a run. No ROS."""

from __future__ import annotations

import contextlib
import hashlib
import platform
import sys
import traceback
from collections.abc import Iterable
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree

from bt_actions import document
from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.connected import Timed
from bt_actions.behaviours.places import in_order
from bt_actions.behaviours.variables import overhear, overhear_less
from bt_actions.document.describing import describe
from bt_actions.events import Node, NodeChanged, NodesAdded, NodesRemoved, RunBegan, TreeFinished
from bt_actions.events.snapshot import HIDDEN, snapshot
from bt_actions.events.stream import Stream
from bt_actions.events.teller import Teller
from bt_actions.goals.unaccounted import GoalReport
from bt_actions.traffic.backend import Backend

FINE = 0.001
"""Seconds for which a reading of the ROS clock counts."""
_ALL = sys.maxsize


class TreeError(Exception):
    """A fault of a behaviour (an exception, no status), or of the spin thread.

    Goals were drained.
    """

    culprit: Behaviour | None = None
    """The behaviour at fault."""


class UnusableTree(TreeError):
    """A fault of the tree itself: its setup fails whatever the world does."""


class TreeTeller(Teller):
    """The teller of one tree, in one run after another."""

    def __init__(self, tree: BehaviourTree, backend: Backend) -> None:
        self._tree, self._backend = tree, backend
        self._host = backend.traffic.host
        self._wall = self._host.wall
        self._has_begun = False
        """Whether RunBegan of this run was told."""
        self._overhears = False
        """Whether writes of blackboard clients are told."""
        self._ros, self._asked, self._last = 0.0, -FINE, 0
        self._hidden: dict[Behaviour, str] = {}
        """The latest messages of nodes that had read a secret: their parents may take these
        over."""
        self.asked_by = "", ""
        """The id of the RunTree goal that the runs answer, and that of its caller's run."""
        self.where: dict[str, str] = {}
        """The place of the runs, as RunBegan tells."""
        super().__init__(Stream(self._moment), self._host.steady)

    def _moment(self) -> tuple[float, float, float]:
        steady = self._steady()
        if steady - self._asked >= FINE:  # the ROS clock takes longer than the rest of an event
            self._asked = steady
            with contextlib.suppress(Exception):  # the node is destroyed
                self._ros = self._backend.stamp() * 1e-9
        return steady, self._wall(), self._ros

    def begin(self) -> None:
        """Take note that a run begins; `began` tells it when the tree is set up."""
        unlike = hashlib.blake2b(self._host.new_goal_id(), digest_size=16)
        self.run_id, self._has_begun = unlike.hexdigest(), False  # also in its first letters
        self._overhears = self.is_heard
        if self._overhears:
            overhear()

    def rest(self) -> None:
        """Take note that the run is over."""
        if self._overhears:
            self._overhears = False
            overhear_less()

    def began(self) -> None:
        """Tell that this run begins, with all its nodes, which get new numbers."""
        self._has_begun, root = True, self._tree.root
        self.forget()
        if not self.is_heard:
            return
        with self._host.lock:  # answers to goals wait, so that RunBegan is the first event
            self._tell_began(root)

    def _tell_began(self, root: Behaviour) -> None:
        given = document.given_inputs(root)
        self.reads_secret = False
        self._hidden.clear()
        self.numbers, self._last = {}, 0
        self.stream.add(
            RunBegan,
            self.run_id,
            document.tree_name(root),
            self._new(in_order(root)),
            {
                name: HIDDEN if each.secret else snapshot(value)
                for name, (each, value) in given.items()
            },
            document.sources_of(root),
            _versions(),
            *self.asked_by,
            dict(self.where),
        )

    def added(self) -> None:
        """Tell the nodes that were inserted since the run began, and those taken out."""
        if not (self._has_begun and self.is_heard):
            return
        nodes = list(in_order(self._tree.root))
        gone = {each for each in set(self.numbers).difference(nodes) if _is_over(each)}
        if gone:
            self.stream.add(NodesRemoved, tuple(sorted(self.numbers.pop(each) for each in gone)))
        if new := self._new(nodes, are_inserted=True):
            self.stream.add(NodesAdded, new)

    def _new(self, nodes: Iterable[Behaviour], *, are_inserted: bool = False) -> tuple[Node, ...]:
        """Number the nodes without a number; return their descriptions."""
        numbers, found = self.numbers, []
        for node in nodes:
            if node not in numbers:
                self._last += 1
                numbers[node] = self._last
                parent = None if node.parent is None else numbers.get(node.parent)
                index = node.parent.children.index(node) if are_inserted and node.parent else None
                found.append(describe(node, self._last, parent, index))
        return tuple(found)

    def changed(self, node: Behaviour) -> None:
        """Tell the present status of a node; on the ticking thread, as its tick returns."""
        if not self.is_heard:
            return
        message, status = node.feedback_message, node.status
        by_itself, warning, due_in = False, "", None
        is_secret = self.reads_secret or bool(getattr(node, "reads_secret", False))
        hidden = self._hidden
        below = hidden and [hidden[child] for child in node.children if child in hidden]
        from_below = below and any(said in message for said in below)  # py_trees adds words to it
        if message and (is_secret or from_below):
            hidden[node], message = message, HIDDEN
        if self.has_news:
            self.claim(node)
        if status is Status.FAILURE:
            self.all_written()
            by_itself = bool(getattr(node, "refused", False))
        elif status is Status.SUCCESS:
            warning = str(getattr(node, "warning", ""))
        elif status is Status.RUNNING and isinstance(node, Timed) and not is_secret:
            due_in = node.left_to_run()
        self.tell(NodeChanged, node, status, message, by_itself, warning, due_in)

    def goes_on(self, node: Behaviour) -> None:
        """Take note that a running node has been ticked."""
        if self.has_news:
            self.claim(node)

    def finished(
        self, status: Status, error: BaseException | None, unaccounted: list[GoalReport]
    ) -> None:
        """Tell how the tree has ended."""
        if not self.is_heard:
            return
        if not self._has_begun:  # the setup has failed
            self.began()
        self.all_written()
        outputs = document.tree_outputs(self._tree.root) if status is Status.SUCCESS else {}
        hidden = document.hidden_outputs(self._tree.root)
        self.stream.add(
            TreeFinished,
            status,
            {
                name: HIDDEN if name in hidden else snapshot(each, fields=_ALL, size=_ALL)
                for name, each in outputs.items()
            },
            "" if error is None else where_raised(error, hides=self.reads_secret),
            isinstance(error, UnusableTree),
            tuple(unaccounted),
            self.numbers.get(getattr(error, "culprit", None)),
        )


def _is_over(node: object) -> bool:
    """Return whether no more events come of a node that is out of the tree."""
    return not isinstance(node, ActionBehaviour) or (node.drained and not node.draining)


def where_raised(error: BaseException, *, hides: bool = False) -> str:
    """Return one line about the error that ended a run, with the place in the user's code.

    `hides` leaves out the words of the user's code, which may hold a secret.
    """
    cause = error.__cause__ or error
    frames = [] if isinstance(cause, TreeError) else traceback.extract_tb(cause.__traceback__)
    said = f"{type(cause).__name__}: {HIDDEN}" if hides else str(error)
    return f"{said} ({frames[-1].filename}:{frames[-1].lineno})" if frames else said


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    """Return the versions of the software that runs the tree."""
    found = {"python": platform.python_version()}
    for package in ("bt_actions", "py_trees", "rclpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
