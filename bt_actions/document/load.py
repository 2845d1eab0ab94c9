"""The library's front door: open, check, and build a tree."""

from __future__ import annotations

import contextlib
import gc
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import bt_actions.document.kinds  # noqa: F401  (fills the table that all others read)
from bt_actions.document.checking.check import check_document
from bt_actions.document.checking.checker import Checker
from bt_actions.document.checking.hazards import find_hazards
from bt_actions.document.findings import LOADED, DocumentError, Finding, Severity, Span
from bt_actions.document.reading.find import TreeNotFoundError, find_tree, installed_trees
from bt_actions.document.reading.inputs import TreeInput, check_inputs, inputs_of
from bt_actions.document.reading.tree import Document
from bt_actions.document.reading.unread import Doubts
from bt_actions.document.reading.workspace import Workspace
from bt_actions.document.yaml.source import Source, TooManyErrors
from bt_actions.document.yaml.written import apply_ignores
from bt_actions.utilities.plain_data import plain

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

    from bt_actions.document.building.context import Scope
    from bt_actions.document.language.classes import Python

PathLike = str | os.PathLike[str]
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Loaded:
    """The origin of a loaded tree, kept at its root."""

    document: Document
    scope: Scope
    sources: dict[str, str]
    """The texts of all files that made the tree, by path."""


def _no_collecting(call: Callable[P, T]) -> Callable[P, T]:
    """Leave the garbage collector out while a document is made: nothing of it becomes garbage.

    With the collector, 10,000 nodes would take twice as long.
    """

    @wraps(call)
    def collecting_nothing(*args: P.args, **kwargs: P.kwargs) -> T:
        was_on = gc.isenabled()
        gc.disable()
        try:
            return call(*args, **kwargs)
        finally:
            if was_on:
                gc.enable()

    return collecting_nothing


class Tree:
    """A tree that was read and checked, from which `build` makes behaviours as often as wanted.

    Later changes of the files do not touch this tree.
    """

    def __init__(
        self, workspace: Workspace, document: Document, *, types: bool, python: Python
    ) -> None:
        self._workspace, self._document = workspace, document
        self._types, self._python = types, python
        self._building = threading.Lock()  # the sources gather findings

    def __repr__(self) -> str:
        return f"<Tree {self.name}>"

    @property
    def name(self) -> str:
        """The name in the file; the file itself may have another name."""
        return self._document.name

    @property
    def description(self) -> str:
        """The purpose of the tree, in the words of its file; may be empty."""
        return str(self._document.values.get("description", ""))

    @property
    def inputs(self) -> dict[str, TreeInput]:
        """The inputs of the tree."""
        return inputs_of(self._document)

    @property
    def warnings(self) -> list[Finding]:
        """The warnings about the tree; an error would have raised."""
        return self._workspace.findings

    @property
    def files(self) -> dict[Path, str]:
        """Every file of the tree, by the name it was given, with its text ("" for a data file)."""
        return self._workspace.files

    def check_inputs(self, inputs: Mapping[str, object]) -> None:
        """Raise InputError where `build` would."""
        check_inputs(self._document, inputs, types=self._types)

    def build(self, inputs: Mapping[str, object] | None = None, *, once: bool = False) -> Behaviour:
        """Make behaviours with variables of their own, without a node or a server.

        `once` says that no other call follows, so the YAML nodes are dropped on the way. Raises
        InputError for inputs that do not fit, and DocumentError for a class of a ``python:`` node
        that fails to be made.
        """
        with self._building:
            return self._build(inputs or {}, once=once)

    @_no_collecting
    def _build(self, inputs: Mapping[str, object], *, once: bool) -> Behaviour:
        from bt_actions.document.building.build import build
        from bt_actions.document.building.context import Scope

        document, types = self._document, self._types
        values = check_inputs(document, inputs, types=types)
        scope = Scope.of_load(document.name)
        scope.write_all(values)
        with self._workspace.as_it_was():
            try:
                root = build(
                    document, scope, types=types, python=self._python, once=once, static=values
                )
            except TooManyErrors:
                raise DocumentError(_errors(self._workspace)) from None
            _refuse(self._workspace)  # a class of one's own may fail when it is made
        sources = {str(path): text for path, text in self._workspace.files.items()}
        setattr(root, LOADED, Loaded(document, scope, sources))
        return root


@_no_collecting
def open_tree(
    path: PathLike,
    *,
    types: bool = True,
    python: Python = True,
    within: Iterable[Path] | None = None,
) -> Tree:
    """Read and check a tree, with all that it includes and imports.

    `types` and `python` have the meaning they have in `load_tree`; `python` may also be the names
    of the packages whose classes a tree may name. `within` are the folders that hold every file a
    tree may read; a link in them may lead anywhere.

    Raises DocumentError with everything that is wrong with the tree.
    """
    workspace = Workspace(within)
    try:
        found = _found(path)
        document = workspace.open(found, _shown(path, found))
    except TooManyErrors:
        raise DocumentError(_errors(workspace)) from None
    _checked(workspace, types=types, python=python)
    _refuse(workspace)
    assert document is not None
    if document.root is None:
        message = "this file is for trees to import: it holds no tree itself"
        document.source.report("BT106", Span(1, 1, 1, 2), message)
        raise DocumentError(_errors(workspace))
    return Tree(workspace, document, types=types, python=python)


def load_tree(
    path: PathLike,
    inputs: Mapping[str, object] | None = None,
    *,
    types: bool = True,
    python: bool = True,
) -> Behaviour:
    """Return the behaviours of a tree, ready to run, without a node or a server.

    `path` is a file, or the name of an installed tree. `inputs` are converted to the types that
    the tree declares. With `types=False` no ROS interface is looked up. With `python=False` a
    ``python:`` node is an error, and no module that the tree names is imported: for trees that are
    not trusted (docs/security.md).

    Raises DocumentError with everything that is wrong with the tree, and InputError for inputs that
    do not fit; both are ValueErrors.
    """
    return open_tree(path, types=types, python=python).build(inputs, once=True)


def tree_inputs(path: PathLike) -> dict[str, TreeInput]:
    """Return the inputs of a tree. Raises DocumentError as `load_tree` does."""
    return open_tree(path, types=False).inputs


def given_inputs(root: Behaviour) -> dict[str, tuple[TreeInput, object]]:
    """Return the inputs of a loaded tree that has not run yet, with the values given to them."""
    loaded = getattr(root, LOADED, None)
    if not isinstance(loaded, Loaded):
        return {}
    declared = inputs_of(loaded.document)
    return {name: (each, loaded.scope.read(name)) for name, each in declared.items()}


def tree_name(root: Behaviour) -> str:
    """Return the name of a loaded tree in its file; the root's own where no file made the tree."""
    loaded = getattr(root, LOADED, None)
    return loaded.document.name if isinstance(loaded, Loaded) else root.name


def sources_of(root: Behaviour) -> dict[str, str]:
    """Return the texts of a loaded tree's files, by path; none of a tree in Python."""
    loaded = getattr(root, LOADED, None)
    return dict(loaded.sources) if isinstance(loaded, Loaded) else {}


def tree_outputs(root: Behaviour) -> dict[str, object]:
    """Return the outputs of a loaded tree that have a value by now, by name; arrays as lists."""
    loaded = getattr(root, LOADED, None)
    if not isinstance(loaded, Loaded):
        return {}
    found = {}
    for name in loaded.document.outputs:
        try:
            found[name] = plain(loaded.scope.read(name))
        except KeyError:
            continue
    return found


def hidden_outputs(root: Behaviour) -> set[str]:
    """Return the names of the outputs of a loaded tree that come from a secret."""
    loaded = getattr(root, LOADED, None)
    if not isinstance(loaded, Loaded):
        return set()
    return {name for name in loaded.document.outputs if loaded.scope.hides(name)}


@_no_collecting
def check_file(path: PathLike, *, types: bool = True, python: bool = True) -> list[Finding]:
    """Find everything that is wrong with a tree, and with all that it includes and imports.

    The class of a ``python:`` node is imported for this, unless `types` or `python` is False. With
    `python=False` such a node is an error.
    """
    workspace = Workspace()
    try:
        found = _found(path)
        workspace.open(found, _shown(path, found))
    except DocumentError as error:
        return list(error.findings)
    except TooManyErrors:
        return workspace.findings
    return _checked(workspace, types=types, python=python)


@_no_collecting
def check_source(source: Source, *, types: bool = True, python: bool = True) -> list[Finding]:
    """Find what `check_file` finds, in a text that was read already."""
    workspace = Workspace()
    try:
        workspace.open_source(source)
    except TooManyErrors:
        return workspace.findings
    return _checked(workspace, types=types, python=python)


def _checked(workspace: Workspace, *, types: bool, python: Python = True) -> list[Finding]:
    # Libraries first: what is wrong with them by themselves is not told of the trees they are in.
    used = _used(workspace.documents)
    for document in sorted(workspace.documents, key=lambda one: one.root is not None):
        with contextlib.suppress(TooManyErrors):  # errors of this document, which is refused
            asked = used if document.root is None else None
            checker = Checker(document, types=types, python=python, used=asked)
            check_document(checker)
            find_hazards(checker)
            apply_ignores(document.source, partial(_all_tried, document, checker.doubts))
    return workspace.findings


def _used(documents: Sequence[Document]) -> set[int] | None:
    """Return the ids of the nodes that declare the actions of trees; None where there is no tree.

    Nav2's older releases lack types of nav2.yaml: a tree without these actions needs none of them.
    """
    trees = [document for document in documents if document.root is not None]
    actions = (
        tree.actions[alias]
        for tree in trees
        for node in tree.nodes()
        if (alias := node.alias) is not None
    )
    return {id(action.node) for action in actions} if trees else None


def _all_tried(document: Document, doubts: Doubts) -> bool:
    has_unread = document.root is None and document.node.get("root") is not None
    return not has_unread and not doubts.any


def _refuse(workspace: Workspace) -> None:
    """Raise DocumentError with the errors that were found, if there are any."""
    errors = _errors(workspace)
    if errors:
        raise DocumentError(errors)


def _errors(workspace: Workspace) -> list[Finding]:
    return [one for one in workspace.findings if one.severity is Severity.ERROR]


def _found(path: PathLike) -> Path:
    try:
        return find_tree(path)
    except TreeNotFoundError as error:
        source = Source(os.fspath(path) or '""', "")
        hint = None
        if error.hint and "mean" not in str(error):
            hint = f"installed are {', '.join(installed_trees())}"
        source.report("BT100", Span(1, 1, 1, 2), str(error), hint=hint)
        raise DocumentError(source.findings) from None


def _shown(path: PathLike, found: Path) -> str | None:
    """Return the path to show: the given path where that is the file, else the found one."""
    return os.fspath(path) if path is found or Path(path) == found else None
