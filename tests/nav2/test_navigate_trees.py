"""Nav2's navigate trees, from their XML to their end, with servers and tree in processes apart.

The XML in trees/ has the shape of Nav2's. One of the trees is looked at closely, with a recovery
for each cause and a cancel in each phase; of the others, what they are for.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml

import bt_actions.importing
from tests.nav2.conftest import MAIN, PACKAGE, TREES, Nav2
from tests.support.processes import ROOT, Process

if TYPE_CHECKING:
    from tests.support.tree_client import Sent

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.timeout(900.0),
    pytest.mark.skipif(
        not (Path(sys.prefix) / "share" / "rosidl_runtime_c" / "cmake").is_dir(),
        reason="ROS does not come from wheels here",
    ),
]

CLOSELY = "replanning_and_recovery"
PLAN, FOLLOW, VALID = "compute_path_to_pose", "follow_path", "is_path_valid"
LOCAL, GLOBAL = (f"{each}_costmap/clear_entirely_{each}_costmap" for each in ("local", "global"))
THROUGH = "compute_path_through_poses"
LONG = {"seconds": 60.0}
NO_PROGRESS, NO_PATH, UNKNOWN_FRAME = 105, 208, 201  # of which no recovery mends the last


def to(x: float) -> dict[str, Any]:
    return {"header": {"frame_id": "map"}, "pose": {"position": {"x": x}}}


def status(nav2: Nav2, sent: Sent) -> str:
    """How a run ends, when it does; a run that has ended leaves no goal live."""
    from action_msgs.msg import GoalStatus

    number, result = nav2.client.result(sent)
    assert result.settled
    assert "None" not in nav2.ends, nav2.lines
    names = {GoalStatus.STATUS_SUCCEEDED: "succeeded", GoalStatus.STATUS_CANCELED: "canceled"}
    return names.get(number, "failed")


def follows_each_path(nav2: Nav2) -> bool:
    """Each path that was planned was followed, one after the other."""
    frames = [goal["path"]["header"]["frame_id"] for goal in nav2.goals(FOLLOW)]
    return frames == sorted(set(frames), key=lambda frame: int(frame.split()[1]))


# One tree, closely


def test_it_plans_once_a_second_and_follows_the_newest_path(nav2: Nav2) -> None:
    nav2.play(follow_path={"seconds": 3.4})
    assert status(nav2, nav2.send(CLOSELY, goal=to(2.0))) == "succeeded"
    moments = [
        line.t
        for line in nav2.lines
        if line.server.endswith(PLAN) and line.event == "received"
    ]  # fmt: skip
    assert len(moments) in (3, 4)
    assert all(later - earlier > 0.99 for earlier, later in itertools.pairwise(moments))
    assert follows_each_path(nav2)
    assert nav2.ends.count("aborted") == nav2.count(FOLLOW) - 1 >= 2, "Nav2's servers preempt"
    assert nav2.goals(PLAN)[0]["planner_id"] == "GridBased"
    assert nav2.goals(FOLLOW)[0]["controller_id"] == "FollowPath"


@pytest.mark.parametrize(
    ("script", "asked"),
    [
        ({PLAN: [NO_PATH]}, [PLAN, GLOBAL, PLAN, FOLLOW]),
        ({FOLLOW: [NO_PROGRESS]}, [PLAN, FOLLOW, LOCAL, FOLLOW]),
        ({PLAN: [NO_PATH] * 2}, [PLAN, GLOBAL, PLAN, LOCAL, GLOBAL, PLAN, FOLLOW]),
        (
            {FOLLOW: [NO_PROGRESS] * 8},
            [
                *[PLAN, FOLLOW, LOCAL, FOLLOW, LOCAL, GLOBAL],
                *[PLAN, FOLLOW, LOCAL, FOLLOW, "spin"],
                *[PLAN, FOLLOW, LOCAL, FOLLOW],  # and a wait, which no server does
                *[PLAN, FOLLOW, LOCAL, FOLLOW, "backup"],
                *[PLAN, FOLLOW],
            ],
        ),
    ],
    ids=["no plan", "no progress", "no plan again", "no progress again and again"],
)
def test_it_recovers_as_the_cause_asks_for(
    nav2: Nav2, script: dict[str, list[int]], asked: list[str]
) -> None:
    nav2.play(**{server: {"fails": codes} for server, codes in script.items()})
    assert status(nav2, nav2.send(CLOSELY, goal=to(2.0))) == "succeeded"
    assert nav2.order == asked


def test_it_does_not_recover_from_what_no_recovery_mends(nav2: Nav2) -> None:
    nav2.play(**{PLAN: {"fails": [UNKNOWN_FRAME]}})
    assert status(nav2, nav2.send(CLOSELY, goal=to(2.0))) == "failed"
    assert nav2.order == [PLAN]


def test_it_gives_up_after_its_last_recovery(nav2: Nav2) -> None:
    nav2.play(**{PLAN: {"fails": [NO_PATH] * 99}})
    assert status(nav2, nav2.send(CLOSELY, goal=to(2.0))) == "failed"
    assert nav2.count(PLAN) == 2 * 7


PHASES: dict[str, tuple[dict[str, Any], tuple[str, str, int]]] = {
    "planning": ({PLAN: LONG}, (PLAN, "accepted", 1)),
    "following": ({FOLLOW: LONG}, (FOLLOW, "accepted", 1)),
    "planning again": ({FOLLOW: LONG, PLAN: {"seconds": 0.5}}, (PLAN, "accepted", 2)),
    "replacing": ({FOLLOW: LONG}, (FOLLOW, "received", 2)),
    "clearing": ({PLAN: {"fails": [NO_PATH]}, GLOBAL: {"seconds": 1.0}}, (GLOBAL, "received", 1)),
    "spinning": ({FOLLOW: {"fails": [NO_PROGRESS] * 4}, "spin": LONG}, ("spin", "accepted", 1)),
    "waiting": ({FOLLOW: {"fails": [NO_PROGRESS] * 6}}, (FOLLOW, "aborted", 6)),
    "backing up": (
        {FOLLOW: {"fails": [NO_PROGRESS] * 8}, "backup": LONG}, ("backup", "accepted", 1),
    ),
}  # fmt: skip


@pytest.mark.parametrize("phase", PHASES)
def test_a_cancel_in_any_phase_leaves_nothing_live(nav2: Nav2, phase: str) -> None:
    script, (server, event, times) = PHASES[phase]
    nav2.play(**script)
    sent = nav2.send(CLOSELY, goal=to(2.0))
    nav2.wait_for(server, event, times)
    assert nav2.client.cancel(sent) == 1
    assert status(nav2, sent) == "canceled"
    if LONG in script.values():
        assert nav2.ends[-1] == "canceled"


@pytest.mark.parametrize("phase", ["planning", "following", "spinning"])
def test_a_newer_goal_begins_when_all_goals_of_the_older_run_have_ended(
    nav2: Nav2, phase: str
) -> None:
    from bt_actions_interfaces.action import RunTree

    script, (server, event, times) = PHASES[phase]
    nav2.play(**script)
    older = nav2.send(CLOSELY, goal=to(2.0))
    nav2.wait_for(server, event, times)
    nav2.obey()
    newer = nav2.send(CLOSELY, goal=to(3.0))
    assert nav2.client.told(older)[1:] == (RunTree.Result.REPLACED, True)
    assert status(nav2, newer) == "succeeded"
    assert nav2.goals(PLAN)[-1]["goal"]["pose"]["position"]["x"] == 3.0
    assert nav2.max_live(server) == 1


# The others


def test_replanning_by_time(nav2: Nav2) -> None:
    nav2.play(follow_path={"seconds": 1.5})
    assert status(nav2, nav2.send("replanning_time", goal=to(2.0))) == "succeeded"
    assert nav2.count(PLAN) == 2
    assert follows_each_path(nav2)


def test_planning_once_where_the_goal_stays(nav2: Nav2) -> None:
    nav2.play(follow_path={"seconds": 1.5})
    tree = "replanning_only_if_goal_is_updated"
    assert status(nav2, nav2.send(tree, goal=to(2.0))) == "succeeded"
    assert nav2.order == [PLAN, FOLLOW]


def test_planning_where_the_path_has_become_invalid(nav2: Nav2) -> None:
    nav2.play(follow_path={"seconds": 2.6}, is_path_valid={"fails": [0, 0, 1]})
    tree = "replanning_only_if_path_becomes_invalid"
    assert status(nav2, nav2.send(tree, goal=to(2.0))) == "succeeded"
    assert nav2.order == [VALID, PLAN, FOLLOW, VALID, VALID, PLAN, FOLLOW]
    assert follows_each_path(nav2)


def test_recovering_with_a_path_that_is_still_valid(nav2: Nav2) -> None:
    nav2.play(follow_path={"fails": [NO_PROGRESS] * 4})
    tree = "recovery_and_replanning_only_if_path_becomes_invalid"
    assert status(nav2, nav2.send(tree, goal=to(2.0))) == "succeeded"
    assert nav2.order == [
        *[VALID, PLAN, FOLLOW, LOCAL, FOLLOW, LOCAL],
        *[VALID, FOLLOW, LOCAL, FOLLOW, "spin"],
        *[VALID, FOLLOW],
    ]


def test_driving_in_squares(nav2: Nav2) -> None:
    nav2.play()
    assert status(nav2, nav2.send("odometry_calibration")) == "succeeded"
    assert nav2.order == ["drive_on_heading", "spin"] * 4


def battery(nav2: Nav2) -> Callable[[bool], None]:
    """Tell the trees whether the battery is being charged."""
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import BatteryState

    publisher = nav2.client.node.create_publisher(
        BatteryState, "/battery_status", qos_profile_sensor_data
    )

    def tell(charging: bool) -> None:
        publisher.publish(BatteryState(power_supply_status=1 if charging else 2))

    return tell


@pytest.mark.parametrize("fails", [[], [9000]], ids=["arrives", "does not arrive"])
def test_docking_whatever_came_of_the_task(nav2: Nav2, fails: list[int]) -> None:
    nav2.play(undock_robot=LONG, navigate_to_pose={"fails": fails})
    tell = battery(nav2)
    places = {"picking": to(2.0), "placing": to(3.0), "dock_id": "home", "dock_type": "plug"}
    sent = nav2.send("application_with_docking", **places)
    nav2.client.until(lambda: tell(True) or nav2.count("undock_robot", "accepted"), "it undocks")
    tell(False)
    assert status(nav2, sent) == "succeeded"
    navigated = ["navigate_to_pose"] * (1 if fails else 2)
    assert nav2.order == ["undock_robot", *navigated, "dock_robot"]
    assert nav2.ends[0] == "canceled", "as it is charged no more"
    assert nav2.goals("dock_robot")[0]["dock_id"] == "home"


def test_following_a_point_that_moves(nav2: Nav2) -> None:
    from geometry_msgs.msg import PoseStamped

    nav2.play(follow_path=LONG)
    publisher = nav2.client.node.create_publisher(PoseStamped, "goal_update", 10)
    sent = nav2.send("follow_point", goal=to(2.0))
    nav2.wait_for(FOLLOW)
    moved = PoseStamped()
    moved.pose.position.x = 7.0

    def seen() -> bool:
        publisher.publish(moved)
        return nav2.goals(PLAN)[-1]["goal"]["pose"]["position"]["x"] == 7.0

    nav2.client.until(seen, "the point that has moved is planned for")
    nav2.wait_for(FOLLOW, times=nav2.count(PLAN))
    followed = nav2.goals(FOLLOW)[-1]["path"]
    assert re.fullmatch(r"path \d+ less 1.0 m", followed["header"]["frame_id"])
    assert followed["poses"][0]["pose"]["position"]["x"] == 7.0
    assert nav2.client.cancel(sent) == 1
    assert status(nav2, sent) == "canceled"


def odometry(nav2: Nav2) -> Callable[[float, float], None]:
    """Tell the trees where the robot is, and how fast."""
    from nav_msgs.msg import Odometry

    publisher = nav2.client.node.create_publisher(Odometry, "odom", 10)

    def tell(x: float, speed: float) -> None:
        message = Odometry()
        message.pose.pose.position.x, message.twist.twist.linear.x = x, speed
        publisher.publish(message)

    return tell


def test_replanning_each_metre(nav2: Nav2) -> None:
    nav2.play(follow_path=LONG)
    tell = odometry(nav2)
    sent = nav2.send("replanning_distance", goal=to(9.0))
    nav2.wait_for(FOLLOW)
    nav2.client.until(lambda: tell(1.2, 0.5) or nav2.count(FOLLOW) == 2, "1.2 m from the start")
    nav2.obey()
    tell(2.1, 0.5)  # 0.9 m from there
    nav2.client.until(lambda: tell(2.3, 0.5) or nav2.count(FOLLOW) == 3, "1.1 m from there")
    assert status(nav2, sent) == "succeeded"
    assert nav2.order == [PLAN, FOLLOW] * 3
    assert follows_each_path(nav2)


@pytest.mark.parametrize("speed", [0.5, 0.0])
def test_replanning_the_more_often_the_faster_the_robot_is(nav2: Nav2, speed: float) -> None:
    nav2.play(follow_path={"seconds": 2.6})
    tell = odometry(nav2)
    sent = nav2.send("replanning_speed", goal=to(9.0))
    nav2.client.until(lambda: tell(0.0, speed) or sent.result_future.done(), "it arrives")
    assert status(nav2, sent) == "succeeded"
    assert nav2.count(PLAN) == 1 if speed == 0.0 else nav2.count(PLAN) >= 4
    assert follows_each_path(nav2)


def test_waiting_where_the_way_has_become_long_near_the_goal(nav2: Nav2) -> None:
    nav2.play(follow_path={"seconds": 1.5}, **{PLAN: {"poses": [2, 8, 8, 8]}})
    assert status(nav2, nav2.send("goal_patience", goal=to(2.0))) == "succeeded"
    assert nav2.order[:4] == [PLAN, FOLLOW, PLAN, FOLLOW]
    assert [len(goal["path"]["poses"]) for goal in nav2.goals(FOLLOW)][:2] == [2, 8]
    assert nav2.ends.count("canceled") == 1
    followed = [line.event for line in nav2.lines if line.server.endswith(FOLLOW)]
    begun = [each for each in followed if each in ("received", "canceled")]
    assert begun[:3] == ["received", "canceled", "received"], "one after the other"


@pytest.mark.parametrize(
    ("error", "end"), [(0.1, "succeeded"), (0.25, "failed"), (-0.25, "succeeded"), (-0.4, "failed")]
)
def test_following_as_long_as_the_robot_is_near_its_path(
    nav2: Nav2, error: float, end: str
) -> None:
    nav2.play(follow_path={"seconds": 1.0 if end == "succeeded" else 60.0, "error": error})
    assert status(nav2, nav2.send("bounds_check", goal=to(2.0))) == end
    assert nav2.order == [PLAN, FOLLOW]
    assert nav2.ends[1] == ("succeeded" if end == "succeeded" else "canceled")


def test_driving_through_the_poses_that_lie_ahead(nav2: Nav2) -> None:
    nav2.play(follow_path={"seconds": 1.5}, **{THROUGH: {"fails": [NO_PATH]}})
    goals = {"goals": [to(0.5), to(2.0), to(3.0)]}
    assert status(nav2, nav2.send("through_poses", goals=goals)) == "succeeded"
    assert nav2.order == [THROUGH, GLOBAL, THROUGH, FOLLOW, THROUGH, FOLLOW]
    planned, followed = nav2.goals(THROUGH)[-1], nav2.goals(FOLLOW)[-1]
    for poses in (planned["goals"]["goals"], followed["path"]["poses"]):
        assert [each["pose"]["position"]["x"] for each in poses] == [2.0, 3.0]


# What they stand on


def test_what_was_imported_has_nothing_wrong(start: Callable[..., Process], trees: Path) -> None:
    process = start("-c", MAIN, "check", *map(str, sorted(trees.glob("*.yaml"))))
    assert (process.wait(), process.lines, process.errors) == (0, [], []), process


def test_their_messages_were_built_for_running_and_for_building_upon(
    nav2_msgs: dict[str, str],
) -> None:
    prefix = Path(nav2_msgs["AMENT_PREFIX_PATH"])
    assert len(list(prefix.glob("share/nav2_msgs/action/*.action"))) == 14
    for wanted in (
        "nav2_msgs/action/__init__.py",
        "include/nav2_msgs/**/spin.hpp",
        "share/nav2_msgs/cmake/nav2_msgsConfig.cmake",
        "lib/libnav2_msgs__rosidl_generator_c.so",
    ):
        assert list(prefix.glob(wanted)), wanted


def test_the_package_has_the_types_and_fields_that_the_map_names() -> None:
    folder = Path(bt_actions.importing.__file__).parent
    mapped = yaml.safe_load((folder / "nav2.yaml").read_text(encoding="utf-8"))
    (types,) = mapped["import"].values()
    for name, node in mapped["nodes"].items():
        action = next((types[key] for key in node if key in types), None)
        if (full := node.get("type", action)) is None or "nav2_msgs" not in full:
            continue
        parts = (PACKAGE / _file(full)).read_text(encoding="utf-8").split("---\n")
        has = [set(re.findall(r"^\S+ (\w+)", part, re.MULTILINE)) for part in parts]
        fed = node.get("save_feedback", {}).values()
        saved = [*node.get("save", {}).values(), *node.get("save_on_failure", {}).values()]
        assert {*node.get("goal", {}), *node.get("request", {})} <= has[0], name
        assert {text.removeprefix("result.") for text in saved} <= has[1], name
        assert {text.removeprefix("feedback.") for text in fed} <= {*has[-1]}, name


def _file(full: str) -> str:
    _, kind, short = full.split("/")
    return f"{kind}/{short}.{kind}"


def test_the_page_tells_of_each_tree_and_shows_one() -> None:
    text = (ROOT / "docs" / "coming_from" / "nav2.md").read_text(encoding="utf-8")
    _, _, table = text.partition("| tree | in the shape of |")
    assert sorted(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == [
        each.stem for each in TREES
    ]
    (closely,) = (each for each in TREES if each.stem == CLOSELY)
    assert f"```xml\n{closely.read_text(encoding='utf-8')}```" in text
