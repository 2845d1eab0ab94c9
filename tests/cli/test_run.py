"""`bt-actions run`, as a process: what it prints and with which code it ends."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bt_actions.cli import main
from tests.cli.conftest import Start
from tests.support.processes import Journal, Process
from tests.support.waiting import until

WRONG_GOAL = """\
tree: t
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: s, timeout: 3 s}
root:
  {move: a, goal: {distance: far}}
"""

PICK = """\
tree: pick
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 20 s}
  grip: {type: robot_control_interfaces/action/Gripper, server: gripper_control, timeout: 20 s}
root:
  sequence: Pick
  children:
    - {grip: Open, goal: {position: 100.0}}
    - {move: To the part, goal: {distance: 2.0}}
    - {grip: Close, goal: {position: 0.0}}
"""

TWO_TYPES = """\
tree: two
root:
  sequence: S
  children:
    - {action: Go, type: robot_control_interfaces/action/MoveRobot, server: door, timeout: 1 s}
    - {action: Grip, type: robot_control_interfaces/action/Gripper, server: /r1/door, timeout: 1 s}
"""
"""A check takes `door` and `/r1/door` for two names; in the namespace /r1 they are one."""
SPEAKS = "tree: new\nroot: {publish: lamp, type: std_msgs/msg/Bool, message: {data: true}}\n"
HEARS = """\
tree: new
topics: {flag: {topic: flag, type: std_msgs/msg/Bool, qos: latched}}
root: {check: $flag.data}
"""

Tree = Callable[..., Path]
Robot = Callable[..., Journal]


def clean(process: Process) -> bool:
    """Whether a process wrote nothing that a user should not see."""
    return not any("Traceback" in line for line in [*process.lines, *process.errors])


class TestExitCode0:
    def test_the_demo_delivers_the_part_and_the_world_says_so(self, start: Start) -> None:
        run = start("run", "pick_and_place", "--sim", "--speed", "20", "--check-part", "5")
        assert run.wait() == 0, run
        assert any("Grasp: executing on /gripper_control" in line for line in run.lines)
        table = [line.split()[-5:] for line in run.lines if line.startswith("To the ")]
        assert [(row[1], row[2]) for row in table] == [("1", "SUCCEEDED")] * 2, run
        assert "The part lies at 4.99 m, at the shelf." in run.lines
        assert any(line.startswith("final_pose: 4.99") for line in run.lines), "the tree's output"
        assert run.lines[-1].startswith("SUCCESS after ")

    def test_against_servers_in_another_process(
        self, start: Start, robot: Robot, namespace: str
    ) -> None:
        journal = robot(speed=20.0)
        run = start("run", "pick_and_place", "--namespace", namespace)
        assert run.wait() == 0, run
        assert journal.ends() == ["succeeded", "succeeded"]

    def test_a_value_that_is_set_reaches_the_server(self, start: Start) -> None:
        run = start(
            *("run", "pick_and_place", "--sim", "--speed", "20", "--check-part", "3.5"),
            *("--set", "place_at=3.5", "--executor", "single"),
        )
        assert run.wait() == 0, run

    def test_two_simulated_robots_in_the_namespaces_that_the_tree_names(self, start: Start) -> None:
        run = start("run", "sorting_cell", "--sim", "--speed", "20", "--namespace", "/cell")
        assert run.wait() == 0, run
        assert "/cell/left: The part lies at 4.99 m, at the shelf." in run.lines
        assert "/cell/right: The part lies at 4.99 m, at the shelf." in run.lines
        assert not any("--sim serves only" in line for line in run.errors)

    def test_a_new_process_is_heard_and_hears_what_was_latched_before_it(
        self, start: Start, node: Any, namespace: str, tmp_path: Path
    ) -> None:
        from rclpy.executors import SingleThreadedExecutor
        from std_msgs.msg import Bool

        from bt_actions.ros.connections import qos_profile

        path = tmp_path / "new.yaml"
        heard: list[bool] = []
        lamp = node.create_subscription(
            Bool, f"{namespace}/lamp", lambda m: heard.append(m.data), 10
        )
        flag = node.create_publisher(Bool, f"{namespace}/flag", qos_profile("latched"))
        flag.publish(Bool(data=True))
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        for text in (SPEAKS, HEARS):
            path.write_text(text)
            run = start("run", str(path), "--namespace", namespace)
            assert run.wait() == 0, run
        until(lambda: heard, 5.0, meanwhile=lambda: executor.spin_once(timeout_sec=0.01))
        executor.shutdown()
        node.executor = None
        node.destroy_subscription(lamp)
        node.destroy_publisher(flag)
        assert heard == [True]

    def test_json_is_nothing_but_objects_wherever_rclpys_loggers_are_to_write(
        self, start: Start, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("RCUTILS_LOGGING_USE_STDOUT", "1")
        faulty = ("--fault", "move_robot:1:reject", "--sim", "--speed", "20", "--json")
        chance = ("--fault", "gripper_control:1%:slow=1", "--seed", "3")
        run = start("run", "pick_and_place", *faulty, *chance)
        assert run.wait() == 0, run
        objects: list[dict[str, Any]] = [json.loads(line) for line in run.lines]
        assert objects[0]["event"] == "started"
        said = " ".join((*faulty[2:5], *faulty[:2], *chance))
        assert objects[0]["where"]["simulation"] == said
        last = objects[-1]
        assert (last["event"], last["status"], last["exit_code"]) == ("finished", "SUCCESS", 0)
        assert last["outputs"]["final_pose"] == pytest.approx(5.0, abs=0.01)
        assert [(action["name"], action["attempts"]) for action in last["actions"]] == [
            ("Open", 1),
            ("To the part", 2),
            ("Grasp", 1),
            ("To the shelf", 1),
            ("Release", 1),
        ]
        for action in last["actions"]:
            assert action["server"] in ("/move_robot", "/gripper_control")
            assert action["outcome"] == "SUCCEEDED"
            assert 0.0 < action["duration"] < 30.0
        assert any("[sim" in line or "[move_robot" in line for line in run.errors), run


def why(run: Process) -> list[str]:
    """The last lines, of why the tree failed: without times of the day and who passed it on."""
    verdict = next(at for at, line in enumerate(run.lines) if line.startswith("FAILURE after "))
    last = (line.partition("; passed on by ")[0] for line in run.lines[verdict + 2 :])
    return [re.sub(r"^\d\d:\d\d:\d\d  ", "", line) for line in last]


class TestExitCode1:
    def test_a_failure_s_summary_comes_last(self, start: Start) -> None:
        run = start(
            *("run", "trees/pick_and_place.yaml", "--sim", "--speed", "20"),
            *("--fault", "move_robot:*:abort"),
        )
        assert run.wait() == 1, run
        said = why(run)
        assert said[1].endswith(", status: 3, message: 'fault: abort'}"), "its result"
        assert [line.partition("; goal {distance: ")[0] for line in said] == [
            "Deliver the part / Pick and place / To the part",
            *(f"  attempt {number}: ABORTED: aborted by /move_robot" for number in (1, 2, 3)),
            "  trees/pick_and_place.yaml:22:11",
            "Deliver the part / recover / Recover / Home",
            *(f"  attempt {number}: ABORTED: aborted by /move_robot" for number in (1, 2, 3)),
            "  trees/recover.yaml:13:7",
        ]

    def test_a_server_that_is_not_there(self, start: Start, tree: Tree, namespace: str) -> None:
        path = tree(timeout="{server: 300 ms, result: 5 s}", server=f"{namespace}/nobody")
        run = start("run", str(path))
        assert run.wait() == 1, run
        server = f"{namespace}/nobody"
        _, said, place = why(run)
        assert said.startswith(f"  SERVER_UNAVAILABLE: no action server {server} within 0.3 s"), run
        assert place == f"  {path}:11:7"
        assert clean(run)

    def test_a_battery_that_says_nothing_fails_the_tree_before_the_part_is_touched(
        self, start: Start, robot: Robot, namespace: str
    ) -> None:
        journal = robot(speed=20.0, battery=False)
        run = start("run", "trees/pick_and_place.yaml", "--namespace", namespace)
        assert run.wait() == 1, run
        silent = f"no message has come on {namespace}/battery_state yet ($battery)"
        assert why(run)[:3] == [
            "Deliver the part / Pick and place / Know the charge",
            f"  failed: not within 5 s: {silent}",
            "  trees/pick_and_place.yaml:16:11",
        ]
        assert journal.ends() == ["succeeded"], "the way home"

    def test_a_server_that_sim_does_not_have_is_named_at_once(
        self, start: Start, tree: Tree
    ) -> None:
        run = start(
            "run", str(tree(timeout="{server: 300 ms, result: 5 s}", server="arm")), "--sim"
        )
        assert run.wait() == 1, run
        [said] = run.errors
        assert said.startswith("bt-actions: --sim serves only ")
        assert said.endswith("it has no server for /arm (MoveRobot)")

    def test_the_part_is_not_where_it_should_be(self, start: Start) -> None:
        run = start(
            *("run", "pick_and_place", "--sim", "--speed", "20", "--check-part", "3"),
        )
        assert run.wait() == 1, run
        assert run.lines[-1] == "The part should lie at 3.00 m (--check-part)."
        assert re.fullmatch(r"SUCCESS after .* s, but not as it should be", run.lines[-3])

    def test_a_part_that_is_held_lies_nowhere(self, start: Start, tmp_path: Path) -> None:
        path = tmp_path / "pick.yaml"
        path.write_text(PICK)
        run = start("run", str(path), "--sim", "--speed", "20", "--check-part", "2")
        assert run.wait() == 1, run
        assert "SUCCESS after" in run.lines[-3]
        assert any(line.startswith("The part is in the gripper") for line in run.lines)


class TestExitCode2:
    @pytest.mark.parametrize(
        "words",
        ["run pick_and_place", "run pick_and_place --ros-args -p pick_at:=1", "sim", "cleanup"],
    )
    def test_without_what_ros_needs_to_be_secure_nothing_starts_and_one_line_says_why(
        self, words: str, start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
        monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
        monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(tmp_path))
        program = start(*words.split())
        assert program.wait() == 2, program
        assert program.lines == []
        [line] = program.errors
        assert line.startswith("bt-actions: ")
        assert f"SECURITY ERROR: directory '{tmp_path}/enclaves' does not exist" in line

    def test_a_server_that_is_used_with_two_types_is_told_in_one_line(
        self, start: Start, tmp_path: Path
    ) -> None:
        (tmp_path / "two.yaml").write_text(TWO_TYPES)
        run = start("run", str(tmp_path / "two.yaml"), "--namespace", "/r1")
        assert run.wait() == 2, run
        assert clean(run)
        [line] = [line for line in run.lines if "/r1/door" in line]
        kinds = "robot_control_interfaces/action/{}, and also as robot_control_interfaces/action/{}"
        assert line.endswith(f"/r1/door is used as {kinds.format('Gripper', 'MoveRobot')}"), run

    def refused(self, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
        assert main(["run", *arguments]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert "Traceback" not in said.err
        return said.err

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("root: [", "error[BT10"),
            ("tree: t\nroot: {sequence: s, childen: []}", ":2:21: error[BT107]: unknown key"),
            (WRONG_GOAL, ":5:30: error["),
        ],
        ids=["broken", "unknown-key", "goal"],
    )
    def test_a_bad_tree_is_one_readable_error_with_its_place(
        self, text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "bad.yaml"
        path.write_text(text)
        said = self.refused(capsys, str(path))
        assert said.startswith(f"{path}:"), said
        assert message in said

    def test_a_file_that_cannot_be_read(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
        for path in (tmp_path, tmp_path / "missing.yaml", tmp_path / "binary.yaml"):
            assert str(path) in self.refused(capsys, str(path))

    def test_a_fault_for_a_server_that_is_not_simulated(
        self, capsys: pytest.CaptureFixture[str], domain: int
    ) -> None:
        fault = ("--sim", "--fault", "move_robt:1:abort")
        assert "--fault" in self.refused(capsys, "pick_and_place", *fault)

    @pytest.mark.parametrize(
        ("command", "domain"),
        [("run", "many"), ("run --cleanup-first", "233"), ("cleanup", "0x1F4"), ("sim", "233")],
    )
    def test_a_ros_domain_that_is_none(
        self, start: Start, monkeypatch: pytest.MonkeyPatch, tree: Tree, command: str, domain: str
    ) -> None:
        monkeypatch.setenv("ROS_DOMAIN_ID", domain)
        run = start(*command.split(), *([str(tree())] if "run" in command else []))
        assert run.wait() == 2, run
        assert clean(run), run
        assert run.errors[-1].startswith("bt-actions: ROS 2 cannot start: ")


class TestExitCode124:
    def test_the_timeout_cancels_what_runs(self, start: Start, tree: Tree) -> None:
        slow = ("--sim", "--fault", "move_robot:1:slow=100")
        run = start("run", str(tree()), *slow, "--timeout", "1.5", "--json")
        assert run.wait() == 124, run
        last = json.loads(run.lines[-1])
        assert (last["status"], last["cause"]) == ("INVALID", "--timeout 1.5 s expired")
        [action] = last["actions"]
        assert (action["outcome"], action["end"]) == ("CANCELED", "CANCELED")


class TestPyTreesRender:
    def test_py_trees_own_tool_reads_our_trees(
        self, start_program: Callable[..., Process], tmp_path: Path
    ) -> None:
        tree = Path(__file__).parents[2] / "trees" / "pick_and_place.yaml"
        code = (
            f"import os, sys; os.chdir({str(tmp_path)!r});"
            "from py_trees.programs.render import main;"
            f"sys.argv = ['py-trees-render', '--kwargs', '{{\"path\": \"{tree}\"}}',"
            " 'bt_actions.load_tree'];"
            "main()"
        )
        start_program("-c", code).wait()
        dot = (tmp_path / "deliver_the_part.dot").read_text()
        assert "To the shelf" in dot


@pytest.mark.parametrize(
    ("cause", "code", "told"),
    [(KeyboardInterrupt(), 130, ""), (None, 2, "ROS 2 cannot be imported (initialization failed)")],
)
@pytest.mark.ros
def test_ctrl_c_while_ros_is_imported_is_no_missing_ros(
    cause: BaseException | None,
    code: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A C extension that is interrupted in its import raises ImportError from it."""

    class Interrupted:
        @staticmethod
        def find_spec(name: str, *_: object) -> None:
            if name == "bt_actions.ros.spinning":
                raise ImportError("initialization failed") from cause

    monkeypatch.delitem(sys.modules, "bt_actions.ros.spinning", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Interrupted, *sys.meta_path])
    assert main(["run", "pick_and_place", "--sim"]) == code
    said = capsys.readouterr().err
    assert told in said
    assert bool(said) == bool(told)
