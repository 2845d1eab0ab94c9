"""The report: the outcome of each node, attribute and script. Nothing is left out in silence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum

from bt_actions.importing.reading import Element


class Verdict(IntEnum):
    """The outcome of a part; the graver one wins for a part that was written twice."""

    CONVERTED = 0
    DIFFERS = 1
    DROPPED = 2
    REFUSED = 3

    def __str__(self) -> str:
        return self.name.lower()


@dataclass(frozen=True, slots=True)
class Entry:
    """The outcome of one part; `what` is node, attribute or tree."""

    file: str
    line: int
    column: int
    what: str
    name: str
    verdict: Verdict
    why: str = ""

    def __str__(self) -> str:
        why = f": {self.why}" if self.why else ""
        return (
            f"{self.file}:{self.line}:{self.column}: {self.what} {self.name}: {self.verdict}{why}"
        )


@dataclass
class Report:
    """All entries of an import, in the order of the files."""

    _entries: dict[tuple[int, str], Entry] = field(default_factory=dict)
    _elements: list[Element] = field(default_factory=list)
    """Kept, so that no new element gets the id of an old one."""
    trees: list[Entry] = field(default_factory=list)

    def node(self, element: Element, verdict: Verdict, why: str = "") -> None:
        """Tell the outcome of a node."""
        self._add(element, "", "node", element.attributes.get("ID", element.tag), verdict, why)

    def attribute(self, element: Element, name: str, verdict: Verdict, why: str = "") -> None:
        """Tell the outcome of an attribute, or of the script in it."""
        self._add(element, name, "attribute", name, verdict, why)

    def tree(self, element: Element, name: str, verdict: Verdict, why: str = "") -> None:
        """Tell the outcome of a tree, or of a whole file."""
        place = element.file, element.line, element.column
        entry = Entry(*place, "tree", name, verdict, why)
        if entry not in self.trees:
            self.trees.append(entry)

    def _add(
        self, element: Element, key: str, what: str, name: str, verdict: Verdict, why: str
    ) -> None:
        self._elements.append(element)
        before = self._entries.get((id(element), key))
        if before is None or before.verdict < verdict:
            place = element.file, element.line, element.column
            self._entries[id(element), key] = Entry(*place, what, name, verdict, why)

    def knows(self, element: Element) -> bool:
        """Return whether a node has an entry."""
        return (id(element), "") in self._entries

    def __iter__(self) -> Iterator[Entry]:
        yield from sorted(
            [*self.trees, *self._entries.values()],
            key=lambda entry: (entry.file, entry.line, entry.column, entry.what != "tree"),
        )

    def nodes(self) -> list[Entry]:
        """Return the entries of nodes alone."""
        return [entry for entry in self._entries.values() if entry.what == "node"]

    def summary(self) -> str:
        """Return one line: the numbers of converted nodes, and of others."""
        counts = Counter(entry.verdict for entry in self.nodes())
        told = [f"{counts[verdict]} {verdict}" for verdict in Verdict if counts[verdict]]
        return f"{len(self.nodes())} nodes: {', '.join(told)}"
