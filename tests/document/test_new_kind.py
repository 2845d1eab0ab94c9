"""A kind is one file: that of CONTRIBUTING.md is read, checked, formatted, built and drawn."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours import decorators
from bt_actions.behaviours.kinds import kind as in_words
from bt_actions.document import Source, check_source, tree_outputs
from bt_actions.document.formatting.format import format_source
from bt_actions.document.kinds import KINDS
from bt_actions.document.language.kinds import NODE_KEYS, register
from bt_actions.document.schema import json_schema

ROOT = Path(__file__).parents[2]
CODE = re.compile(r"```python\n# bt_actions/.+?\n(.+?)```", re.DOTALL)
TREE = """\
tree: t
outputs: {asked: int64}
root:
  sequence: S
  children:
    - set: {asked: 0}
    - often: Ask
      period: 10 s
      child:
        set: {asked: = $asked + 1}
    - success: Never
"""


@pytest.fixture(scope="module")
def often() -> Iterator[type[decorators.Gate]]:
    """Add what CONTRIBUTING.md adds, and return its behaviour's class."""
    kinds, keys = dict(KINDS), set(NODE_KEYS)
    behaviour, kind = CODE.findall((ROOT / "docs" / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    with pytest.MonkeyPatch.context() as patch:
        space = dict(vars(decorators))
        exec(behaviour, space)
        patch.setattr(decorators, "Often", space["Often"], raising=False)
        exec(kind, space)
        register(space["KIND"])
        yield space["Often"]
    KINDS.clear()
    KINDS.update(kinds)
    NODE_KEYS.intersection_update(keys)


def test_a_kind_that_is_added_is_built_and_does_what_it_says(
    often: type[decorators.Gate], load: Callable[[str], Behaviour], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr(often, "_now", lambda _self: now[0])
    root = load(TREE)
    node = root.children[1]
    assert (type(node), in_words(node)) == (often, "often")
    for at, asked in ((0.0, 1), (9.0, 1), (10.0, 2), (19.0, 2)):
        now[0] = at
        root.tick_once()
        assert (root.status, tree_outputs(root)) == (Status.RUNNING, {"asked": asked})
    assert node.due_in() == 1.0  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("written", "instead", "code", "told"),
    [
        ("10 s", "= 1 - 2", "BT110", "at least 0 is needed"),
        ("10 s", "= 'a'", "BT204", "is needed"),
        ("period", "preiod", "BT107", "did you mean 'period'?"),
        ("often:", "ofen:", "BT201", "did you mean 'often'?"),
        ("- success: Never", "- often: Alone", "BT108", "needs the key 'period'"),
        ("root:", "actions: {often: {}}\nroot:", "BT208", "'often' is a kind of node"),
        ("root:", "actions: {period: {}}\nroot:", "BT208", "'period' is a key of nodes"),
    ],
)
@pytest.mark.usefixtures("often")
def test_a_kind_that_is_added_is_checked(written: str, instead: str, code: str, told: str) -> None:
    found = check_source(Source("t.yaml", TREE.replace(written, instead, 1)))
    assert [one for one in found if one.code == code and told in one.message], found


@pytest.mark.usefixtures("often")
def test_the_passes_of_the_checker_ask_a_kind_that_is_added() -> None:
    found = check_source(Source("t.yaml", TREE))
    assert [(one.code, one.line) for one in found] == [("BT305", 11)]  # as it never succeeds


@pytest.mark.usefixtures("often")
def test_a_kind_that_is_added_is_formatted_and_in_the_schema() -> None:
    turned = TREE.replace("      period: 10 s\n", "").replace(
        "= $asked + 1}\n", "= $asked + 1}\n      period: 10 s\n"
    )
    assert format_source(Source("t.yaml", turned)) == format_source(Source("t.yaml", TREE))
    assert json_schema()["$defs"]["often"]["required"] == ["often", "child", "period"]


def test_a_name_has_one_kind() -> None:
    with pytest.raises(ValueError, match="there is a kind 'wait' already"):
        register(KINDS["wait"])


def test_reading_and_checking_import_no_behaviour() -> None:
    code = (
        "import sys; from bt_actions.document import check_file;"
        "check_file('trees/recover.yaml', types=False);"
        "bad = ('bt_actions.behaviours', 'bt_actions.document.building', 'py_trees');"
        "sys.exit([name for name in sys.modules if name.startswith(bad)] or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False)
    assert done.returncode == 0
