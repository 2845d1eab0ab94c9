"""Files of XML to files of YAML, with a report: `convert` is the one entry."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from bt_actions.document.formatting.format import format_source
from bt_actions.document.yaml.source import Source
from bt_actions.importing.kinds import KINDS
from bt_actions.importing.mapping import Map, nav2
from bt_actions.importing.names import identifier, unique
from bt_actions.importing.project import SUBTREES, Definition, Project, kind_of
from bt_actions.importing.reading import XmlError
from bt_actions.importing.report import Report, Verdict
from bt_actions.importing.stubs import MODULE, module
from bt_actions.importing.text import document
from bt_actions.importing.writer import Writer


@dataclass
class Imported:
    """The result of an import."""

    files: dict[str, str] = field(default_factory=dict)
    """The text of each file, by its name."""
    report: Report = field(default_factory=Report)
    failed: list[XmlError] = field(default_factory=list)
    """Files that could not be read."""


def convert(paths: list[Path], mapping: Map | None = None) -> Imported:
    """Write the trees of some files in our language."""
    imported = Imported()
    project = Project(paths, nav2() if mapping is None else mapping, imported.report)
    imported.failed = project.failed
    names: dict[str, str] = {}
    for name in project.trees:
        names[name] = unique(identifier(name), names.values())
    called = {
        element.attributes.get("ID", "")
        for definition in project.trees.values()
        for element in definition.element.walk()
        if kind_of(element) in SUBTREES
    }
    waiting = [each for each in project.trees.values() if each.name not in called]
    waiting = waiting or list(project.trees.values())  # trees that hold each other
    begun: list[Definition] = []

    def call(definition: Definition) -> str:
        waiting.append(definition)
        return names[definition.name]

    while waiting:
        definition = waiting.pop(0)
        if definition in begun:
            continue
        begun.append(definition)
        writer = Writer(project, definition, KINDS, call)
        tree = writer.tree(names[definition.name], called=definition.name in called)
        text = document(tree, tree.comments)
        name = f"{names[definition.name]}.yaml"
        imported.files[name] = format_source(Source(name, text))
    for definition in project.trees.values():
        for element in definition.element.children:
            for inner in element.walk():
                if not imported.report.knows(inner):
                    why = "its tree is not used by any that was written"
                    imported.report.node(inner, Verdict.DROPPED, why)
    if project.stubs:
        imported.files[f"{MODULE}.py"] = module(project.stubs.values())
    return imported
