"""Answers to TAB in a shell: argcomplete asks the parsers, and the functions here for some values.

A user waits for each answer, so nothing here imports py_trees or the checker. Where a function
raises an error, as for a missing tree, the shell offers nothing.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import argcomplete
from argcomplete.completers import FilesCompleter

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Parser


def complete(parser_of: Callable[[str], Parser]) -> None:
    """Answer the shell, and leave. `parser_of` gives the parser of one command, or of all ("")."""
    typed = os.environ["COMP_LINE"][: int(os.environ["COMP_POINT"])] + "."
    command = typed.split()[1] if len(typed.split()) > 2 else ""
    parser = parser_of(command)
    for name, each in {"": parser, **parser.commands}.items():
        for action in each._actions:  # noqa: SLF001 - argparse has no public way to read a parser
            words = action.metavar if isinstance(action.metavar, str) else ""
            found = _VALUES.get(f"{name} {words}", _VALUES.get(words))
            if found is not None:
                action.completer = found  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser, always_complete_options=not command)


def _trees(prefix: str, **_others: object) -> Iterable[str]:
    from bt_actions.document import installed_trees

    names = (name for name, path in installed_trees().items() if _holds_tree(path))
    return [*names, *FilesCompleter()(prefix)]


def _holds_tree(path: Path) -> bool:
    """Return whether a file holds a tree, rather than a library, as far as its text tells."""
    try:
        return re.search(rb"^tree:", path.read_bytes(), re.MULTILINE) is not None
    except OSError:
        return False


def _inputs(parsed_args: argparse.Namespace, **_others: object) -> Iterable[str]:
    from bt_actions.document import find_tree, read_source
    from bt_actions.document.yaml.compose import compose
    from bt_actions.document.yaml.nodes import Mapping

    node = compose(read_source(find_tree(parsed_args.tree)))
    top = {key.text: value for key, value in node.pairs} if isinstance(node, Mapping) else {}
    inputs = top.get("inputs")
    return [f"{key.text}=" for key, _ in inputs.pairs] if isinstance(inputs, Mapping) else []


def _rules(**_others: object) -> dict[str, str]:
    from bt_actions.document import RULES

    return {code: rule.title for code, rule in RULES.items()}


def _faults(prefix: str, **_others: object) -> dict[str, str]:
    from bt_actions.cli.driving.simulated import SERVED
    from bt_actions.simulation.faults import FaultKind

    which = prefix.rpartition(":")[0]
    if ":" in which:
        return {f"{which}:{kind}": kind.does for kind in FaultKind}
    return {f"{server}:": kind for kind, server in SERVED.items()}


def _runs(prefix: str, **_others: object) -> dict[str, str]:
    from bt_actions.recording.folders import recorded

    runs = [each.summary for each in recorded()]
    ids = {each.run_id[:8]: each.tree for each in runs}
    files = dict.fromkeys(FilesCompleter()(prefix), "") if "/" in prefix else {}
    return ids | dict.fromkeys(ids.values(), "its last run") | files


def _recorded_trees(**_others: object) -> Iterable[str]:
    from bt_actions.recording.folders import recorded

    return {each.summary.tree for each in recorded()}


_VALUES = {
    "TREE": _trees,
    "NAME=VALUE": _inputs,
    "CODE": _rules,
    "SPEC": _faults,
    "RUN": _runs,
    "watch NAME": _runs,
    "runs NAME": _recorded_trees,
    "stats NAME": _recorded_trees,
}
"""The answers, by the words that stand for values in help, of all commands or of one."""
