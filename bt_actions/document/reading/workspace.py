"""A tree with all that it imports and includes; each file is read once.

A file that cannot be opened is reported at its name in the tree. The only checks here are for
trees that include themselves, and for trees that unfold without bound.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from bt_actions.document.findings import DocumentError, Finding, Related, Span
from bt_actions.document.findings.elsewhere import package_here
from bt_actions.document.language.keys import GATES
from bt_actions.document.reading.find import TreeNotFoundError, find_tree, is_file
from bt_actions.document.reading.nodes import read_root
from bt_actions.document.reading.read import read_document
from bt_actions.document.reading.tree import Declared, Document, TreeNode, merged
from bt_actions.document.yaml.nodes import Listing, Node, span_of
from bt_actions.document.yaml.source import SUFFIXES, Source, absolute, read_source

MAX_TREE_NODES = 1_000_000
"""Nodes of a tree, with all included trees unfolded."""
MAX_LEVELS = 200
"""Levels of a tree, with all included trees unfolded: py_trees ticks and stops a tree by recursion,
and Python has 1,000 levels of recursion for everything.
"""
_HIDDEN = "•••"
"""The stand-in for a secret, as in events."""
_MAX_CHAIN = 50
_MAX_FILES = 2 * _MAX_CHAIN
"""Levels of trees inside each other, and of files that import each other."""


class Workspace:
    """The documents of one or several trees."""

    def __init__(self, within: Iterable[Path] | None = None) -> None:
        """Open files in the folders `within` alone; None: anywhere."""
        self._within: tuple[Path, ...] | None = None
        if within is not None:
            ways = [(absolute(each), each.resolve()) for each in within]
            self._within = tuple(folder for both in ways for folder in both)
        self._documents: dict[tuple[Path, bool], Document | None] = {}
        self._sources: list[Source] = []
        self._failed: dict[Path, DocumentError] = {}
        self._keys: dict[Path, Path] = {}

    def open(self, path: Path, name: str | None = None) -> Document | None:
        """Open the tree in a file, with its imports and subtrees; None without a tree.

        Raises DocumentError where the file cannot be read at all.
        """
        source = read_source(path, name, pipes=self._within is None)
        source.within = self._within
        if refusal := source.refusal(path):
            source.report("BT209", Span(1, 1, 1, 2), refusal)
            raise DocumentError(source.findings)
        return self._open(source, (path,))

    def open_source(self, source: Source) -> Document | None:
        """Open the tree in a source that was read already (standard input, an editor's buffer)."""
        return self._open(source, () if source.path is None else (source.path,))

    @property
    def documents(self) -> list[Document]:
        """Every open document, in the order of opening."""
        return [document for document in self._documents.values() if document is not None]

    @property
    def files(self) -> dict[Path, str]:
        """Every file that was read, by the name in its tree, with its text; "" for a data file.

        Defaults of secret inputs are blanked; the lines around them keep their numbers.
        """
        found = {each.path: each.text for each in self._sources if each.path}
        for document in self.documents:
            for declared in reversed(document.inputs.values()):
                if declared.values.get("secret") is True and "default" in declared.parts:
                    path, node = document.source.path, declared.parts["default"]
                    if path in found:
                        begin, end = node.begin.index, node.end.index
                        found[path] = _blanked(found[path], begin, end)
        return found | {path: "" for each in self._sources for path in each.files}

    @property
    def findings(self) -> list[Finding]:
        """All findings of all sources, by file and place."""
        failed = [error.findings for error in self._failed.values()]
        found = [one for findings in failed for one in findings if one.code == "BT101"]
        for source in self._sources:
            found += sorted(source.findings, key=lambda one: (one.line, one.column, one.code))
        return list(dict.fromkeys(found))  # an alias repeats a finding

    @contextlib.contextmanager
    def as_it_was(self) -> Iterator[None]:
        """Forget at the end all findings of the time between."""
        before = [(source, len(source.findings), source.errors) for source in self._sources]
        try:
            yield
        finally:
            for source, findings, errors in before:
                del source.findings[findings:]
                source.errors = errors

    def _open(
        self, source: Source, chain: tuple[Path, ...], *, library: bool = False
    ) -> Document | None:
        key = (chain[-1] if chain else Path(source.name), library)
        if key in self._documents:
            return self._documents[key]
        self._sources.append(source)
        document = self._documents[key] = read_document(source, library=library)
        if document is None:
            return None
        self._import(document, chain)
        if library:
            return document
        read_root(document)
        size = height = 0
        gated = False
        for node in document.nodes():
            size += 1
            gated = gated or not GATES.keys().isdisjoint(node.values)
            if node.level > height:
                height = node.level
            if node.kind.includes:
                node.included = self._include(node, chain)
                if node.included is not None:
                    gated = gated or node.included.gated
                    size += node.included.size
                    below = node.level + node.included.height
                    if below > MAX_LEVELS:
                        message = f"the tree unfolds to more than {MAX_LEVELS} levels of nodes"
                        source.report("BT105", span_of(node.key), message)
                        node.included = None
                        below = node.level
                    height = max(height, below)
                if size > MAX_TREE_NODES:
                    message = f"the tree unfolds to more than {MAX_TREE_NODES:,} nodes"
                    source.report("BT105", span_of(node.key), message)
                    break
        document.size, document.height = min(size, MAX_TREE_NODES + 1), height
        document.gated = gated
        return document

    def _include(self, node: TreeNode, chain: tuple[Path, ...]) -> Document | None:
        wanted = node.values.get(node.key.text)
        if not isinstance(wanted, str):
            return None
        written = node.written[node.key.text]
        included = self._named(wanted, written, node.source, chain)
        if included is not None and included.node.get("root") is None:
            name = included.source.path.name if included.source.path is not None else wanted
            node.source.report("BT209", span_of(written), f"{name} holds no tree")
            return None
        return included

    def _named(
        self,
        wanted: str,
        written: Node,
        source: Source,
        chain: tuple[Path, ...],
        *,
        library: bool = False,
    ) -> Document | None:
        """Open a tree to include, or a `library` to import, by the name in a source."""
        path = self._find(wanted, written, source)
        if path is None:
            return None
        key = self._key(path)
        chain = tuple(map(self._key, chain))
        most, what = (_MAX_FILES, "files") if library else (_MAX_CHAIN, "trees")
        if key in chain:
            circle = "a cycle of imports" if library else "the tree includes itself"
            names = [step.name for step in chain[chain.index(key) :]] + [key.name]
            source.report("BT210", span_of(written), f"{circle}: {' -> '.join(names)}")
            return None
        if len(chain) >= most:
            source.report("BT105", span_of(written), f"more than {most} {what} inside each other")
            return None
        if (key, library) in self._documents:
            return self._documents[key, library]
        opened = self._read(path, written, source)
        return None if opened is None else self._open(opened, (*chain, key), library=library)

    def _find(self, wanted: str, written: Node, source: Source) -> Path | None:
        beside = source.path.parent if source.path is not None else None
        try:
            path = find_tree(wanted, beside=beside)
        except TreeNotFoundError as error:
            here = package_here(wanted)
            text = f"there is no tree {wanted!r}" if here else str(error)
            source.report("BT209", span_of(written), text, hint=here or error.hint)
            return None
        if path.suffix not in SUFFIXES and is_file(path):
            text = f"{path.name}: a tree names files that end in {', '.join(SUFFIXES)} only"
            source.report("BT209", span_of(written), text)
            return None
        if refusal := source.refusal(path):
            source.report("BT209", span_of(written), refusal)
            return None
        return path

    def _read(self, path: Path, written: Node, source: Source) -> Source | None:
        key = self._key(path)
        if key not in self._failed:
            try:
                opened = read_source(path, _shown(path, source), pipes=False)
                opened.within = self._within
                return opened
            except DocumentError as error:
                self._failed[key] = error
        first = self._failed[key].findings[0]
        if first.code != "BT101":  # BT101 stands in the other file
            source.report("BT209", span_of(written), f"{path.name or path}: {first.message}")
        return None

    def _import(self, document: Document, chain: tuple[Path, ...]) -> None:
        """Take over the actions, topics and defaults of the files a document imports."""
        names = document.values.get("import")
        written = document.node.get("import")
        if not isinstance(names, list) or written is None:
            return
        nodes = written.items if isinstance(written, Listing) else [written]
        defaults: dict[str, object] = {}
        for name, node in zip(names, nodes, strict=True):
            library = self._named(str(name), node, document.source, chain, library=True)
            if library is None:
                document.source.unread.names = True
                continue
            document.imported.append(library)
            for theirs, ours in (
                (library.actions, document.actions),
                (library.topics, document.topics),
                (library.kinds, document.kinds),
            ):
                for declared in theirs.values():
                    self._take_over(declared, ours, node, document)
            defaults = merged(defaults, library.defaults)
        document.defaults = merged(defaults, document.defaults)

    def _take_over(
        self, declared: Declared, ours: dict[str, Declared], node: Node, document: Document
    ) -> None:
        there = ours.setdefault(declared.name, declared)
        if there is declared or there.source is document.source:
            return  # a document's own words win over those that it imports
        document.source.report(
            "BT216", span_of(node), f"{declared.name!r} is declared by two imports",
            related=Related(there.place, "the other is here"),
        )  # fmt: skip

    def _key(self, path: Path) -> Path:
        """Return the file itself, behind all links; found on demand."""
        if path not in self._keys:
            try:
                self._keys[path] = path.resolve()
            except (OSError, RuntimeError):
                self._keys[path] = path
        return self._keys[path]


def _shown(path: Path, source: Source) -> str:
    """Return a file's name as a person would write it: as short as the including file's."""
    if source.path is not None and not Path(source.name).is_absolute():
        try:
            return str(path.resolve().relative_to(Path.cwd()))
        except ValueError:
            return str(path)
    return str(path)


def _blanked(text: str, begin: int, end: int) -> str:
    """Return the text with the characters between two places blanked, but for the ends of lines."""
    lines = text[begin:end].count("\n")
    return f"{text[:begin]}{_HIDDEN}{chr(10) * lines}{text[end:]}"
