"""The tree of a command, with the values of its inputs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.arguments.ros_arguments import as_inputs
from bt_actions.cli.arguments.values import split
from bt_actions.cli.exits import BadInput
from bt_actions.cli.streams.writing import columns, note

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

    from bt_actions.document import DocumentError
    from bt_actions.ros.arguments import Given


def load(
    tree: str,
    settings: Iterable[str],
    *,
    python: bool = True,
    parameters: Callable[[str], Given | None] | None = None,
) -> Behaviour:
    """Load a tree by path or by the name of an installed one, with `--set` words for its inputs.

    ROS parameters by the names of inputs fill the rest: `parameters` returns them for the name of
    the tree. With `python=False` a tree with a `python:` node is refused, and nothing it names is
    imported.

    Raises BadInput with all findings, or about the first input that does not fit.
    """
    from bt_actions.document import (
        DocumentError,
        InputError,
        TreeNotFoundError,
        find_tree,
        open_tree,
        parse_input,
    )

    texts: dict[str, str] = {}
    for word in settings:
        name, text = split(word, "--set")
        if name in texts:
            raise BadInput(f"--set {name} is given twice: {texts[name]!r} and {text!r}")
        texts[name] = text
    try:
        found = find_tree(tree)
        if Path(tree).suffix and found != Path(tree) and "://" not in tree:
            note(f"bt-actions: there is no {tree} in this folder; taking the installed {found}")
        opened = open_tree(tree, python=python)  # once: it may be a pipe
        declared = opened.inputs
        inputs = as_inputs(parameters(opened.name), declared, opened.name) if parameters else {}
        for name, text in texts.items():
            kind = declared[name].type if name in declared else "string"
            try:
                inputs[name] = parse_input(text, kind)
            except ValueError as error:
                raise BadInput(f"--set {name}={text}: {error}") from error
        return opened.build(inputs, once=True)
    except DocumentError as error:
        raise BadInput(findings_text(error), prefixed=False) from error
    except InputError as error:
        remedy = f", such as --set {error.missing}=..." if error.missing else ""
        raise BadInput(f"{error}{remedy}") from error
    except TreeNotFoundError as error:
        raise BadInput(str(error)) from error


def findings_text(error: DocumentError) -> str:
    """Return a document's findings, for standard error."""
    return "\n".join(finding.text(columns(sys.stderr)) for finding in error.findings)
