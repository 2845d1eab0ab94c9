"""Trees written in YAML: read, checked and built. A library for editors and services, too.

`findings/` holds what is wrong, `yaml/` reads text, `language/` knows keys and kinds, `reading/`
makes documents. `checking/` and `building/` stand above these, side by side; `kinds/` comes next,
with a file for each kind. `formatting/` and `load.py` put all of them together. This import loads
neither rclpy nor any message package.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from bt_actions.document.findings import NODE, Place

if TYPE_CHECKING:
    from bt_actions.document.findings import DocumentError, Finding, Related, Rule, Severity, Span
    from bt_actions.document.findings.rules import RULES
    from bt_actions.document.load import (
        Tree,
        check_file,
        check_source,
        given_inputs,
        hidden_outputs,
        load_tree,
        open_tree,
        sources_of,
        tree_inputs,
        tree_name,
        tree_outputs,
    )
    from bt_actions.document.reading.find import TreeNotFoundError, find_tree, installed_trees
    from bt_actions.document.reading.inputs import InputError, TreeInput, parse_input
    from bt_actions.document.yaml.source import Source, read_source, source_of

__all__ = [
    "RULES",
    "DocumentError",
    "Finding",
    "InputError",
    "Place",
    "Related",
    "Rule",
    "Severity",
    "Source",
    "Span",
    "Tree",
    "TreeInput",
    "TreeNotFoundError",
    "check_file",
    "check_source",
    "find_tree",
    "given_inputs",
    "hidden_outputs",
    "installed_trees",
    "load_tree",
    "open_tree",
    "parse_input",
    "place_of",
    "read_source",
    "source_of",
    "sources_of",
    "tree_inputs",
    "tree_name",
    "tree_outputs",
]

_PLACES = ("findings", "findings.rules", "yaml.source", "reading.find", "reading.inputs", "load")
"""The modules of the names that are imported on demand; the quickest modules come first."""


def __getattr__(name: str) -> object:
    for place in _PLACES if name in __all__ else ():
        module = import_module(f"{__name__}.{place}")
        if hasattr(module, name):
            return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def place_of(behaviour: object) -> Place | None:
    """Return the place where a behaviour was written, or None where no document made it."""
    place = getattr(getattr(behaviour, NODE, None), "place", None)
    return place if isinstance(place, Place) else None
