"""What a tree means: loading, values, subtrees, composites and decorators."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.leaves import Check, WaitUntil
from bt_actions.document import (
    DocumentError,
    InputError,
    find_tree,
    load_tree,
    parse_input,
    place_of,
    tree_inputs,
    tree_outputs,
)
from bt_actions.document.reading.find import TreeNotFoundError, installed_trees
from bt_actions.goals.policy import Retry, Timeouts
from tests.document.conftest import tick

Load = Callable[..., Behaviour]
TREES = Path(__file__).parents[2] / "trees"


def test_the_demo_tree_becomes_plain_py_trees_behaviours() -> None:
    root = load_tree(TREES / "pick_and_place.yaml")
    assert isinstance(root, Selector)
    assert root.name == "Deliver the part"
    pick = root.children[0]
    assert isinstance(pick, Sequence)
    wanted = [WaitUntil, Check, *[ActionBehaviour] * 5]
    assert [type(child) for child in pick.children] == wanted
    assert [child.name for child in pick.children[2:]] == [
        "Open", "To the part", "Grasp", "To the shelf", "Release"
    ]  # fmt: skip


def test_composites_have_memory_unless_told_otherwise(load: Load) -> None:
    text = """
    tree: t
    root: {sequence: S, %s children: [{success: A}]}
    """
    assert load(text % "").memory is True  # type: ignore[attr-defined]
    assert load(text % "memory: false,").memory is False  # type: ignore[attr-defined]


def test_each_behaviour_knows_the_place_it_was_written_at(load: Load) -> None:
    root = load("tree: t\nroot:\n  sequence: S\n  children:\n    - success: A\n")
    place = place_of(root.children[0])
    assert place is not None
    assert place[1:] == (5, 7)
    assert place.file.endswith("main.yaml")
    assert str(place).endswith("main.yaml:5:7")


ACTIONS = """
    tree: t
    defaults: {timeout: {server: 1 s, result: 9 s}, retry: {backoff: 2 s}, busy: fail}
    actions:
      move:
        type: robot_control_interfaces/action/MoveRobot
        server: move_robot
        timeout: {server: 5 s, cancel: 2 s}
        retry: 3
        goal: {distance: 7.0}
    """


def action(load: Load, node: str) -> ActionBehaviour:
    behaviour = load(ACTIONS + f"root: {node}\n    ")
    assert isinstance(behaviour, ActionBehaviour)
    return behaviour


def test_settings_merge_key_by_key_from_defaults_over_the_action_to_the_node(load: Load) -> None:
    behaviour = action(load, "{move: A, timeout: {cancel: 1 s}, retry: {attempts: 2}}")
    assert behaviour.timeouts == Timeouts(server=5.0, result=9.0, cancel=1.0)
    assert behaviour.retry == Retry(attempts=2, backoff=2.0)
    assert behaviour.busy == "fail"
    assert behaviour.goal == {"distance": 7.0}


def test_a_bare_timeout_is_the_result_s_and_a_bare_retry_the_attempts(load: Load) -> None:
    behaviour = action(load, "{move: A, timeout: 4 s, retry: 5}")
    assert behaviour.timeouts.result == 4.0
    assert behaviour.timeouts.server == 5.0
    assert behaviour.retry.attempts == 5


def test_none_takes_a_deadline_away(load: Load) -> None:
    assert action(load, "{move: A, timeout: none}").timeouts.result is None


def test_a_namespace_goes_before_relative_names_only(load: Load) -> None:
    assert action(load, "{move: A, namespace: r1}").action_name == "r1/move_robot"
    assert action(load, "{move: A, namespace: /r1/}").action_name == "/r1/move_robot"
    text = """
    tree: t
    namespace: cell
    root:
      action: A
      type: robot_control_interfaces/action/MoveRobot
      server: %s
      timeout: 1 s
    """
    assert load(text % "m").action_name == "cell/m"  # type: ignore[attr-defined]
    assert load(text % "/m").action_name == "/m"  # type: ignore[attr-defined]


def test_a_goal_keeps_the_type_of_a_lone_name_and_computes_the_rest(load: Load) -> None:
    root = load(
        """
        tree: t
        inputs: {a: {type: float64, default: 2}}
        actions:
          move: {type: robot_control_interfaces/action/MoveRobot, server: m, timeout: 1 s}
        root:
          sequence: S
          children:
            - {move: A, goal: {distance: $a}}
            - {move: B, goal: {distance: = $a + 1}}
        """
    )
    goals = [child.goal() for child in root.children]  # type: ignore[attr-defined]
    assert goals == [{"distance": 2.0}, {"distance": 3.0}]


def test_a_missing_variable_is_an_error_of_the_goal_not_of_the_tree(load: Load) -> None:
    root = load(
        """
        tree: t
        outputs: {a: float64}
        actions:
          move: {type: robot_control_interfaces/action/MoveRobot, server: m, timeout: 1 s}
        root: {move: A, goal: {distance: $a}}
        """
    )
    with pytest.raises(ValueError, match=r"\$a has no value"):
        root.goal()  # type: ignore[attr-defined]


# Inputs and outputs


INPUTS = """
    tree: t
    inputs:
      speed: {type: float64, default: 2, unit: m/s, description: How fast.}
      names: string[]
    outputs: {twice: float64}
    root:
      sequence: S
      children:
        - set: {twice: = $speed * 2}
        - check: len($names) == 2
    """


def test_inputs_are_converted_to_their_types_and_outputs_are_read_after_the_run(
    load: Load,
) -> None:
    root = load(INPUTS, {"speed": 3, "names": ["a", "b"]})
    assert tree_outputs(root) == {}
    assert tick(root) is Status.SUCCESS
    assert tree_outputs(root) == {"twice": 6.0}


@pytest.mark.parametrize(
    ("inputs", "text"),
    [
        ({}, "the tree 't' needs the input 'names' (string[]): give it a value"),
        ({"names": [], "sped": 1}, "the tree 't' has no input 'sped'; did you mean 'speed'?"),
        ({"names": [], "other": 1}, ("the tree 't' has no input 'other'; its inputs are speed,"
                                    " names")),
        ({"names": [1]}, "input 'names' of 't': 0: a text is needed, not 1"),
        ({"names": [], "speed": "x"}, ("input 'speed' of 't': a number (float64) is needed, not"
                                      " 'x'")),
    ],
)  # fmt: skip
def test_an_input_that_does_not_fit_is_one_clear_error(
    load: Load, inputs: dict[str, object], text: str
) -> None:
    with pytest.raises(InputError) as caught:
        load(INPUTS, inputs)
    assert str(caught.value) == text


def test_a_tree_tells_what_it_wants_to_be_given(load: Load, tmp_path: Path) -> None:
    load(INPUTS, {"names": []})
    wanted = tree_inputs(tmp_path / "main.yaml")
    speed = wanted["speed"]
    assert (speed.type, speed.required, speed.default) == ("float64", False, 2)
    assert (speed.unit, speed.description) == ("m/s", "How fast.")
    assert wanted["names"].required


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("2", "float64", 2.0),
        ("2", "string", "2"),
        ("yes", "string", "yes"),
        ("[1, 2]", "int32[]", [1, 2]),
        ("true", "bool", True),
        ("[a, b]", "string[<=3]", ["a", "b"]),
    ],
)
def test_a_value_on_the_command_line_is_read_as_its_type_wants(
    text: str, kind: str, value: object
) -> None:
    assert parse_input(text, kind) == value


@pytest.mark.parametrize(
    ("text", "kind"), [("x", "float64"), ("2.5", "int32"), ("[1", "int32[]"), ("1", "what"),
                       ("yes", "bool"), ("[1,2,3]", "int32[<=2]"), ("a: b: c", "bool")]
)  # fmt: skip
def test_a_value_that_does_not_fit_is_a_value_error(text: str, kind: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_input(text, kind)


def test_a_computed_value_on_the_command_line_needs_its_space_too() -> None:
    assert parse_input("[= 1 + 1]", "int32[]") == [2]
    with pytest.raises(ValueError, match=r"'=' computes only with a space behind it"):
        parse_input("[=1 + 1]", "int32[]")


def test_two_loads_of_a_tree_share_nothing(load: Load) -> None:
    text = """
    tree: t
    outputs: {n: int32}
    root:
      fallback: F
      children:
        - check: $n == 1
        - set: {n: 1}
    """
    first = load(text)
    tick(first)
    second = load(text)
    assert (tree_outputs(first), tree_outputs(second)) == ({"n": 1}, {})


def test_a_subtree_sees_only_what_it_is_given_and_gives_back_what_is_asked(load: Load) -> None:
    root = load(
        """
        tree: outer
        inputs: {a: {type: int32, default: 5}}
        outputs: {b: int32}
        root:
          sequence: S
          children:
            - {subtree: inner.yaml, with: {a: = $a + 1}, save: {b: y}}
            - check: $b == 12
            - check: $a == 5
        """,
        inner="""
        tree: inner
        inputs: {a: int32}
        outputs: {y: int32}
        root: {set: {y: = $a * 2}}
        """,
    )
    assert tick(root) is Status.SUCCESS
    assert tree_outputs(root) == {"b": 12}


def test_a_subtree_that_starts_again_has_forgotten_its_values(load: Load) -> None:
    root = load(
        """
        tree: outer
        outputs: {n: int32}
        root:
          repeat: Twice
          times: 2
          child: {subtree: inner.yaml, save: {n: n}}
        """,
        inner="""
        tree: inner
        outputs: {n: int32}
        root:
          sequence: S
          children:
            - invert: Not yet
              child: {check: $n == 1}
            - set: {n: 1}
        """,
    )
    assert tick(root) is Status.SUCCESS


def test_whatever_writes_an_output_converts_it_to_its_type(load: Load) -> None:
    root = load(
        """
        tree: t
        outputs: {a: float64, b: float64}
        root:
          sequence: S
          children:
            - {subtree: inner.yaml, save: {a: x}}
            - {for_each: F, in: [1, 2], as: b, child: {success: }}
        """,
        inner="tree: inner\noutputs: {x: int32}\nroot: {set: {x: 3}}\n",
    )
    assert tick(root) is Status.SUCCESS
    assert [(name, type(value)) for name, value in tree_outputs(root).items()] == [
        ("a", float), ("b", float)
    ]  # fmt: skip


@pytest.mark.parametrize(("first", "again", "told"), [
    ("abc", '"$(x)$(x)"', "the text would be longer than 10,000 characters"),
    ("abc", "[$x, $x]", "x: the value is too large"),
    ("abc", "{a: $x, b: {c: $x}}", "x: the value is too large"),
    ("abc", "[$x]", "x: the value is nested deeper than 100 levels"),
    ("abc", "'= [$x, $x]'", "x: the value is too large"),
    ("[a, b]", '["$(x)"]', "the text would be longer than 10,000 characters"),
])  # fmt: skip
def test_a_variable_cannot_grow_without_bound(
    load: Load, first: str, again: str, told: str
) -> None:
    root = load(
        f"""
        tree: t
        root:
          sequence: S
          children:
            - {{set: {{x: {first}}}}}
            - {{repeat: Grow, times: 3000, child: {{set: {{x: {again}}}}}}}
            - {{check: $x == $x}}
        """
    )
    assert tick(root, 4000) is Status.FAILURE
    assert root.children[1].children[0].feedback_message == told


def test_a_tree_that_includes_itself_is_an_error_that_shows_the_chain(
    load: Load, tmp_path: Path
) -> None:
    with pytest.raises(DocumentError) as caught:
        load(
            "tree: a\nroot: {subtree: b.yaml}\n",
            b="tree: b\nroot: {subtree: main.yaml}\n",
        )
    (finding,) = caught.value.findings
    assert finding.message == "the tree includes itself: main.yaml -> b.yaml -> main.yaml"
    assert finding.file == str(tmp_path / "b.yaml")


def test_imports_bring_actions_topics_and_defaults_and_the_own_ones_win(load: Load) -> None:
    root = load(
        """
        tree: a
        import: [robot.yaml]
        defaults: {retry: 4}
        actions:
          gripper:
            type: robot_control_interfaces/action/Gripper
            server: mine
            timeout: 1 s
        root:
          sequence: S
          children:
            - {move: A, goal: {distance: 1}}
            - {gripper: B}
        """,
        robot="""
        defaults: {busy: fail, retry: 2}
        actions:
          move:
            {type: robot_control_interfaces/action/MoveRobot, server: m, timeout: 1 s}
          gripper:
            {type: robot_control_interfaces/action/Gripper, server: theirs, timeout: 1 s}
        """,
    )
    move, gripper = root.children
    assert isinstance(move, ActionBehaviour)
    assert isinstance(gripper, ActionBehaviour)
    assert (move.action_name, gripper.action_name) == ("m", "mine")
    assert (move.busy, move.retry.attempts) == ("fail", 4)


@pytest.mark.parametrize(
    ("library", "finding"),
    [
        ("kinds: {m: {python: py_trees.behaviours.Success, inputs: {a: foo/msg/Bar}}}",
         ("robot.yaml", 1, 9, "BT205")),
        ("topics: {a: {topic: a, type: foo/msg/Bar}}", ("robot.yaml", 1, 30, "BT205")),
        ("topics: {here: {topic: a, type: std_msgs/msg/Bool}}", ("main.yaml", 3, 10, "BT216")),
        ("inputs: {a: int32}\nactions: {}", ("robot.yaml", 1, 1, "BT107")),
    ],
)  # fmt: skip
def test_what_is_wrong_in_an_import_is_told_once_and_in_its_place(
    load: Load, library: str, finding: tuple[str, int, int, str]
) -> None:
    text = "tree: t\nimport: robot.yaml\ninputs: {here: int32}\nroot: {check: $here > 1}\n"
    with pytest.raises(DocumentError) as caught:
        load(text, {"here": 1}, robot=library)
    (one,) = caught.value.findings
    assert (Path(one.file).name, one.line, one.column, one.code) == finding


def test_imports_in_a_circle_are_an_error_that_shows_them(load: Load) -> None:
    with pytest.raises(DocumentError) as caught:
        load(
            "tree: t\nimport: a.yaml\nroot: {success: A}\n",
            a="import: b.yaml\ndefaults: {}\n",
            b="import: a.yaml\ndefaults: {}\n",
        )
    (one,) = caught.value.findings
    assert one.message == "a cycle of imports: a.yaml -> b.yaml -> a.yaml"


def test_a_library_is_no_tree(load: Load) -> None:
    with pytest.raises(DocumentError, match="it holds no tree itself"):
        load("defaults: {retry: 2}\n")
    with pytest.raises(DocumentError, match=r"inner\.yaml holds no tree"):
        load("tree: t\nroot: {subtree: inner.yaml}\n", inner="defaults: {retry: 2}\n")


def test_anchors_and_merge_keys_work(load: Load) -> None:
    root = load(
        """
        tree: t
        actions:
          a: &base
            type: robot_control_interfaces/action/MoveRobot
            server: one
            timeout: 1 s
          b:
            <<: *base
            server: two
        root:
          sequence: S
          children:
            - a: A
            - b: B
        """
    )
    servers = [child.action_name for child in root.children]  # type: ignore[attr-defined]
    assert servers == ["one", "two"]


def test_finding_a_tree_takes_a_path_or_the_name_of_an_installed_one() -> None:
    assert find_tree(TREES / "recover.yaml") == TREES / "recover.yaml"
    assert find_tree("recover").name == "recover.yaml"


def test_files_that_begin_with_a_dot_are_no_installed_trees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (".#dock.yaml", ".dock.yaml", "dock.yaml"):
        (tmp_path / name).write_text("tree: dock\nroot: {success: }\n")
    monkeypatch.setenv("BT_ACTIONS_TREE_PATH", str(tmp_path))
    assert [name for name in installed_trees() if "dock" in name] == ["dock"]
    assert find_tree("dock") == tmp_path / "dock.yaml"
    assert find_tree(tmp_path / ".dock.yaml") == tmp_path / ".dock.yaml", "a path is a path"
    for name in (".dock", ".dock.yaml"):
        with pytest.raises(TreeNotFoundError):
            find_tree(name)


@pytest.mark.parametrize("statement", [
    "from bt_actions.document import check_file; check_file('trees/recover.yaml', types=False)",
    "from bt_actions.document import load_tree; load_tree('trees/recover.yaml')",
])  # fmt: skip
def test_checking_and_building_import_no_rclpy(statement: str) -> None:
    code = f"import sys; {statement}; sys.exit('rclpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=TREES.parent, check=False)
    assert done.returncode == 0


def test_checking_without_types_imports_no_message_package() -> None:
    code = (
        "import sys; from bt_actions.document import check_file;"
        "found = check_file('trees/pick_and_place.yaml', types=False);"
        "bad = [m for m in sys.modules if m.startswith(('robot_control', 'rosidl', 'numpy'))];"
        "sys.exit(str(found or bad) if found or bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=TREES.parent, check=False)
    assert done.returncode == 0


POINTS = """
tree: t
inputs:
  points: {type: "geometry_msgs/msg/Point[]", default: "@points.yaml"}
root: {check: $points.1.x == 3.5}
"""


def test_a_large_value_may_stand_in_a_file_of_its_own(load: Load, tmp_path: Path) -> None:
    root = load(POINTS, points="[{x: 1}, {x: 3.5}]")
    assert tick(root) is Status.SUCCESS
    points = parse_input(f"@{tmp_path}/points.yaml", "geometry_msgs/msg/Point[]")
    assert points[1].x == 3.5  # type: ignore[index]
