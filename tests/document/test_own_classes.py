"""A user's own class in a tree: whatever its module and its constructor do, the tree says where."""

from __future__ import annotations

import itertools
import json
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from bt_actions.behaviours.decorators import Deadline
from bt_actions.cli import main
from bt_actions.document import DocumentError, check_file, load_tree, place_of, tree_outputs

Own = Callable[..., Path]
BASE = """
from __future__ import annotations
import py_trees
class Base(py_trees.behaviour.Behaviour):
    def update(self):
        return py_trees.common.Status.SUCCESS
"""
_numbers = itertools.count()


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Own:
    """Write a module with a class `A`, and a tree that names it."""
    monkeypatch.syspath_prepend(tmp_path)  # type: ignore[no-untyped-call]

    def write(code: str, arguments: str = "{}", *, base: bool = True) -> Path:
        module = f"own_{next(_numbers)}"
        text = (BASE if base else "") + textwrap.dedent(code)
        (tmp_path / f"{module}.py").write_text(text, encoding="utf-8")
        tree = tmp_path / "t.yaml"
        text = f"tree: t\nroot:\n  python: {module}.A\n  arguments: {arguments}\n"
        tree.write_text(text, encoding="utf-8")
        return tree

    return write


def checked(tree: Path) -> list[str]:
    return [f"{one.line}:{one.column} {one.code} {one.message}" for one in check_file(tree)]


def refused(tree: Path) -> list[str]:
    with pytest.raises(DocumentError) as raised:
        load_tree(tree)
    findings = raised.value.findings
    return [f"{one.line}:{one.column} {one.code} {one.message}" for one in findings]


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import sys; sys.exit(0)", "raised SystemExit: 0"),
        ("raise ModuleNotFoundError('boo')", "raised ModuleNotFoundError: boo"),
        ("class E(BaseException): pass\nraise E", "raised E"),
        ("x = (", "raised SyntaxError: '(' was never closed (own_"),
    ],
)
def test_what_a_module_raises_is_told_where_it_is_named(own: Own, code: str, said: str) -> None:
    (found,) = checked(own(code, base=False))
    assert found.startswith("3:11 BT214 importing 'own_")
    assert said in found


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        ("n: int", "abc"), ("n: int", "1.5"), ("n: int", "true"), ("n: float", "abc"),
        ("n: str", "5"), ("n: bool", "1"), ("n: int | None", "abc"), ("n: list[int]", "{a: 1}"),
        ("n: list[float] | None", "[1, a]"), ("n: dict[str, int]", "{a: 1, b: c}"),
    ],
)  # fmt: skip
def test_an_argument_of_another_type_than_it_is_annotated_with_is_wrong(
    own: Own, parameter: str, value: str
) -> None:
    code = f"class A(Base):\n    def __init__(self, name, {parameter}): super().__init__(name)"
    (found,) = checked(own(code, f"{{n: {value}}}"))
    assert found.startswith(f"4:18 BT215 A takes a 'n' of type {parameter[3:]}, not ")


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        ("n: int", "5"), ("n: float", "5"), ("n: str", "abc"), ("n: int | None", "null"),
        ("n: Path", "abc"), ("n", "abc"), ("n: tuple[int, ...]", "[1]"), ("n: list[int]", "[1]"),
        ("n: list", "[1, a]"), ("n: list[list[int]]", "[[1], []]"), ("n: dict", "{a: 1}"),
        ("n: dict[str, float]", "{a: 1}"), ("n: list[float] | None", "[1, 0.5]"),
    ],
)  # fmt: skip
def test_an_argument_that_fits_or_of_which_that_cannot_be_told_is_taken(
    own: Own, parameter: str, value: str
) -> None:
    code = f"class A(Base):\n    def __init__(self, name, {parameter}): super().__init__(name)"
    tree = own(code, f"{{n: {value}}}")
    assert checked(tree) == []
    assert load_tree(tree).name == "A"


ENUMS = """
from enum import Enum, IntEnum
from typing import TYPE_CHECKING, Optional
from py_trees.common import Status
if TYPE_CHECKING:
    from nowhere import Nothing
class Mode(Enum):
    FAST = "quick"
    SLOW = "slow"
class Level(IntEnum):
    LOW = 1
class A(Base):
    def __init__(self, name, {parameter}, node: Nothing = None):
        super().__init__(name)
        self.n = repr(n)
"""


@pytest.mark.parametrize(
    ("parameter", "value", "member"),
    [
        ("n: Status", "SUCCESS", "<Status.SUCCESS: 'SUCCESS'>"),
        ("n: py_trees.common.Status", "FAILURE", "<Status.FAILURE: 'FAILURE'>"),
        ("n: Status", "Status.SUCCESS", "<Status.SUCCESS: 'SUCCESS'>"),
        ("n: Status", "py_trees.common.Status.SUCCESS", "<Status.SUCCESS: 'SUCCESS'>"),
        ("n: list[Mode]", "[Mode.SLOW]", "[<Mode.SLOW: 'slow'>]"),
        ("n=Status.SUCCESS", "RUNNING", "<Status.RUNNING: 'RUNNING'>"),
        ("n=Mode.SLOW", "quick", "'quick'"),
        ("n: 'exit(7)'", "quick", "'quick'"),
        ("n: Mode | None", "FAST", "<Mode.FAST: 'quick'>"),
        ("n: Mode | None", "null", "None"),
        ("n: Optional[Mode] = None", "SLOW", "<Mode.SLOW: 'slow'>"),
        ("n: list[Mode]", "[FAST]", "[<Mode.FAST: 'quick'>]"),
        ("n: dict[str, Mode]", "{a: FAST}", "{'a': <Mode.FAST: 'quick'>}"),
        ("n: Level", "LOW", "<Level.LOW: 1>"),
        ("n: Level", "1", "<Level.LOW: 1>"),
        ("n: str | Mode", "FAST", "'FAST'"),
    ],
)
def test_a_text_stands_for_the_member_of_an_enum(
    own: Own, parameter: str, value: str, member: str
) -> None:
    tree = own(ENUMS.format(parameter=parameter), f"{{n: {value}}}")
    assert checked(tree) == []
    made: Any = load_tree(tree)
    assert made.n == member


@pytest.mark.parametrize(
    ("parameter", "value", "named"),
    [
        ("n: Mode", "FASR", "Mode"),
        ("n: Mode", "quick", "Mode"),
        ("n: Mode", "Level.FAST", "Mode"),
        ("n: Mode | None", "3", "Mode | None"),
        ("n: Optional[Mode]", "3", "Optional[Mode]"),
        ("n: list[Mode]", "[X]", "list[Mode]"),
    ],
)
def test_a_name_that_no_member_has_is_told_with_those_there_are(
    own: Own, parameter: str, value: str, named: str
) -> None:
    (found,) = checked(own(ENUMS.format(parameter=parameter), f"{{n: {value}}}"))
    assert found.startswith(f"4:18 BT215 A takes a 'n' of type {named}, not ")
    assert found.endswith(": one of FAST, SLOW")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("{n: a, x: 3}", ["4:18 BT215 A takes a 'n' of ", "4:24 BT215 A takes a 'x' of "]),
        ("{nn: 3, y: 3}", ["4:15 BT215 A takes no arg", "4:22 BT215 A takes no arg"]),
        ("{}", ["3:3 BT215 A needs the argument 'n'", "3:3 BT215 A needs the argument 'x'"]),
        ("{n: $a, x: $b}", ["4:18 BT204 an argument is ", "4:25 BT204 an argument is "]),
    ],
)
def test_all_that_is_wrong_with_the_arguments_is_told_at_once(
    own: Own, arguments: str, said: list[str]
) -> None:
    code = "class A(Base):\n    def __init__(self, name, n: int, x: str): super().__init__(name)"
    found = checked(own(code, arguments))
    assert [one[: len(start)] for one, start in zip(found, said, strict=True)] == said


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("def __init__(self, name, n): raise ValueError('no')", "making a A raised ValueError: no"),
        ("def __init__(self, name, n): raise SystemExit(7)", "making a A raised SystemExit: 7"),
        (
            "def __init__(self, name, n): pass",
            "the constructor of A does not call super().__init__(name)",
        ),
    ],
)
def test_a_class_of_which_nothing_can_be_made_is_an_error_with_its_place(
    own: Own, code: str, said: str
) -> None:
    assert refused(own(f"class A(Base):\n    {code}", "{n: 1}")) == [f"4:14 BT215 {said}"]


def test_a_class_that_makes_something_else_is_an_error_with_its_place(own: Own) -> None:
    tree = own("class A(Base):\n    def __new__(cls, **given): return 5")
    tree.write_text(tree.read_text(encoding="utf-8").replace("  arguments: {}\n", ""))
    (found,) = refused(tree)
    assert found.startswith("3:11 BT214 ")
    assert found.endswith("makes no behaviour, but a int")


def test_every_class_that_fails_is_told_at_once(own: Own) -> None:
    tree = own("class A(Base):\n    def __init__(self, name): raise ValueError(name)")
    python = tree.read_text(encoding="utf-8").splitlines()[2].strip()
    tree.write_text(
        f"tree: t\nroot:\n  sequence: S\n  children:\n    - {python}\n    - {python}\n",
        encoding="utf-8",
    )
    assert [found.split()[0] for found in refused(tree)] == ["5:15", "6:15"]


def test_what_a_module_prints_does_not_disturb_a_report(
    own: Own, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = own("print('hello')\nimport py_trees\nA = py_trees.behaviours.Success", base=False)
    assert main(["check", "--format", "json", str(tree)]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == []
    assert err == "hello\n"


def test_a_run_of_a_class_that_cannot_be_made_ends_with_2_and_the_place(
    own: Own, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = own("class A(Base):\n    def __init__(self, name): raise ValueError('no')")
    assert main(["render", str(tree)]) == 2
    assert "t.yaml:4:14: error[BT215]: making a A raised ValueError: no" in capsys.readouterr().err


def test_names_that_a_class_of_ones_own_may_have(own: Own) -> None:
    """A place, a state of its own, and ones that leaves for actions have."""
    tree = own(
        """
        class A(Base):
            draining, drained = True, False
            def __init__(self, name, place):
                super().__init__(name)
                self.place = self.loaded = place
            @property
            def refused(self):
                raise AttributeError
        """,
        "{place: shelf}",
    )
    root = load_tree(tree)
    assert (root.place, root.loaded) == ("shelf", "shelf")  # type: ignore[attr-defined]
    assert str(place_of(root)).endswith("t.yaml:3:3")
    assert tree_outputs(root) == {}
    assert main(["render", str(tree)]) == 0
    late = Deadline("T", root, lambda: 0.0)
    late.tick_once()
    late.tick_once()
    assert late.status is Status.FAILURE
