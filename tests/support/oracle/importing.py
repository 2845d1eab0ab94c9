"""A case's tree as the importer writes it: its leaves become actions and topics by a map."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from bt_actions.document import DocumentError, load_tree
from bt_actions.importing.convert import Imported, convert
from bt_actions.importing.mapping import Leaf, Map
from bt_actions.importing.report import Verdict
from tests.support.oracle.cases import LATER, Case

_LEAF = re.compile(r"<(?:Act|Cond) id=\"(\w+)\"")


class NotYet(Exception):
    """The tree holds what is refused, or a word that the language does not have yet."""


def imported(case: Case, folder: Path) -> Imported:
    """Import the tree of a case; `folder` gets its XML."""
    xml = folder / "case.xml"
    values = f'<BehaviorTree ID="Values"><Script code="{case.init}"/></BehaviorTree></root>'
    text = case.xml.replace("</root>", values)  # which tell the sorts of the variables
    text = text.replace(LATER, "RoundRobin")
    xml.write_text(_LEAF.sub(r"<\1", text), encoding="utf-8")
    leaves = {act: {act: None} for act in case.acts}
    leaves |= {cond: {"check": f"${cond}.data"} for cond in case.conds}
    goals = {"type": "robot_control_interfaces/action/MoveRobot"}
    answers = {"type": "std_msgs/msg/Bool", "qos": "latched"}
    words = {
        "actions": {act: {**goals, "server": act} for act in case.acts},
        "topics": {cond: {**answers, "topic": cond} for cond in case.conds},
    }
    return convert([xml], Map({kind: Leaf(node, {}) for kind, node in leaves.items()}, words))


def write(case: Case, folder: Path) -> Path:
    """Write the tree of a case into a folder; return its file. Raises NotYet."""
    found = imported(case, folder)
    for entry in found.report.nodes():
        if entry.verdict is Verdict.REFUSED and "it stands in" not in entry.why:
            raise NotYet(f"refused: {entry.why}")
    main = folder / "Main.yaml"
    for name, text in found.files.items():
        tree = yaml.load(text, Loader=yaml.CSafeLoader)
        if name == main.name:
            _give(tree.setdefault("inputs", {}), case)
        tree["root"] = _with_last_looks(tree["root"])
        text = yaml.dump(tree, Dumper=yaml.CSafeDumper, sort_keys=False)
        (folder / name).write_text(text, encoding="utf-8")
    try:
        load_tree(main)
    except DocumentError as error:
        raise NotYet(error.findings[0].message) from None
    return main


def _give(inputs: dict[str, Any], case: Case) -> None:
    """Have the variables of a case begin with their values."""
    for name, value in values_of(case.init).items():
        kind = inputs.get(name) or ("string" if isinstance(value, str) else "float64")
        as_written = {"bool": bool, "string": str}.get(kind, int)
        inputs[name] = {"type": kind, "default": as_written(value)}


def _with_last_looks(node: Any) -> Any:
    """Have each loop end at the tick behind its last round, in which LoopInt looks for more."""
    if isinstance(node, list):
        return [_with_last_looks(each) for each in node]
    if not isinstance(node, dict):
        return node
    node = {key: _with_last_looks(each) for key, each in node.items()}
    if "for_each" in node:
        return {"sequence": "Loop", "children": [node, {"wait": "1 ms"}]}
    return node


def values_of(script: str) -> dict[str, int | str]:
    """The values that a script gives to variables, all of them written out."""
    pairs = [each.split(":=") for each in script.split(";") if each.strip()]
    texts = {name.strip(): value.strip() for name, value in pairs}
    return {name: text[1:-1] if text[0] == "'" else int(text) for name, text in texts.items()}
