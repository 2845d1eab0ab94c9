"""Robots, grippers and parts together, on one node, as a tree or a process of its own has them."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from robot_control_interfaces.action import Gripper, MoveRobot
from sensor_msgs.msg import BatteryState

from bt_actions.simulation import FaultError, Simulation, WorldEvent
from bt_actions.simulation import journal as j
from tests.simulation.conftest import Bench, RosBench
from tests.support.waiting import until

IN_VIRTUAL_TIME = pytest.mark.parametrize("stands_on", ["virtual"])
SUCCEEDED = GoalStatus.STATUS_SUCCEEDED


class Robot:
    """The clients of one simulated robot."""

    def __init__(self, bench: Bench, namespace: str) -> None:
        self.move = bench.client(MoveRobot, f"{namespace}/move_robot")
        self.gripper = bench.client(Gripper, f"{namespace}/gripper_control")

    def until_ready(self) -> Robot:
        self.move.until_ready()
        self.gripper.until_ready()
        return self

    def carry(self, to: float) -> None:
        """Pick the part at 2 m and place it at `to`."""
        for goal in (
            lambda: self.gripper.send(position=100.0),
            lambda: self.move.send(distance=2.0),
            lambda: self.gripper.send(position=0.0),
            lambda: self.move.send(distance=to),
            lambda: self.gripper.send(position=100.0),
        ):
            assert goal().until_ended().status == SUCCEEDED


def test_the_part_is_carried_to_the_shelf(bench: Bench, space: str) -> None:
    events: list[tuple[str, WorldEvent]] = []
    robot = Robot(bench, space)
    simulation = bench.serve(
        Simulation(
            bench.node,
            namespaces=(space,),
            speed=20.0,
            journal=bench.path,
            on_event=lambda namespace, event: events.append((namespace, event)),
        )
    )
    assert simulation.describe() == "The part lies at 2.00 m, at the pick station."
    robot.until_ready().carry(to=5.0)
    part = simulation.world(space).part
    assert (part.station, part.held_by) == ("shelf", None)
    assert simulation.describe() == "The part lies at 4.99 m, at the shelf."
    assert [(namespace, event.kind) for namespace, event in events] == [
        (space, "picked"), (space, "placed"),
    ]  # fmt: skip
    assert j.max_live(bench.entries()) == 1
    assert set(j.ends(bench.entries()).values()) == {j.Event.SUCCEEDED}


@IN_VIRTUAL_TIME
def test_each_namespace_has_a_world_of_its_own(bench: Bench, space: str) -> None:
    names = [f"{space}/a", f"{space}/b"]
    robots = [Robot(bench, name) for name in names]
    simulation = bench.serve(Simulation(bench.node, namespaces=names, speed=20.0))
    robots[1].until_ready().carry(to=5.0)
    assert simulation.describe().splitlines() == [
        f"{names[0]}: The part lies at 2.00 m, at the pick station.",
        f"{names[1]}: The part lies at 4.99 m, at the shelf.",
    ]
    assert simulation.world(names[0]).robot.current_pose == 0.0
    with pytest.raises(KeyError):
        simulation.world("/c")


@pytest.mark.parametrize("executor", ["multi"])
def test_fifty_robots_move_at_once_without_a_thread_each(ros_bench: RosBench, space: str) -> None:
    names = [f"{space}/r{number}" for number in range(50)]
    clients = [ros_bench.client(MoveRobot, f"{name}/move_robot") for name in names]
    threads = threading.active_count()
    simulation = ros_bench.serve(
        Simulation(ros_bench.node, namespaces=names, speed=10.0, journal=ros_bench.path)
    )
    for client in clients:
        client.until_ready()
    goals = [client.send(distance=2.0) for client in clients]
    assert {goal.until_ended(20.0).status for goal in goals} == {SUCCEEDED}
    assert threading.active_count() <= threads + 2
    assert len(simulation.servers) == 100
    starts = [each for each in ros_bench.entries() if each.event is j.Event.ACCEPTED]
    ends = [each for each in ros_bench.entries() if each.event is j.Event.SUCCEEDED]
    took = [end.t - next(s.t for s in starts if s.goal == end.goal) for end in ends]
    assert len(took) == 50
    assert max(took) < 10.0, "51 steps of 10 ms, on a machine that does other work besides"


@IN_VIRTUAL_TIME
def test_a_dropped_part_lies_on_the_way(bench: Bench, space: str) -> None:
    robot = Robot(bench, space)
    simulation = bench.serve(
        Simulation(bench.node, namespaces=(space,), speed=20.0, faults=["move_robot:2:drop_part"])
    )
    robot.until_ready().carry(to=5.0)
    part = simulation.world(space).part
    assert part.station is None
    assert part.held_by is None
    assert 3.0 < part.position < 4.5


@IN_VIRTUAL_TIME
def test_death_in_a_shared_process_takes_one_server_only(bench: Bench, space: str) -> None:
    robot = Robot(bench, space)
    simulation = bench.serve(
        Simulation(bench.node, namespaces=(space,), speed=20.0, faults=["move_robot:1:die"])
    )
    robot.until_ready()
    robot.move.send(distance=5.0)
    bench.until(lambda: not robot.move.is_ready())
    stands_at = simulation.world(space).robot.current_pose
    assert 2.5 <= stands_at < 5.0
    assert robot.gripper.send(position=100.0).until_ended().status == SUCCEEDED
    assert simulation.world(space).robot.current_pose == stands_at


def test_the_battery_is_published_and_empties_on_the_way(ros_bench: RosBench, space: str) -> None:
    charges: list[float] = []
    subscription = ros_bench.client_node.create_subscription(
        BatteryState, f"{space}/battery_state", lambda m: charges.append(m.percentage), 10
    )
    robot = Robot(ros_bench, space)
    ros_bench.serve(Simulation(ros_bench.node, namespaces=(space,), speed=20.0))
    robot.until_ready().move.send(distance=-10.0).until_ended()
    ros_bench.until(lambda: charges and charges[-1] < 0.995, 4.0)
    assert all(0.0 <= charge <= 1.0 for charge in charges)
    ros_bench.client_node.destroy_subscription(subscription)


@pytest.mark.parametrize(
    ("settings", "error", "says"),
    [
        ({"faults": ["move_robt:1:abort"]}, FaultError, "did you mean 'move_robot'"),
        ({"faults": ["move_robot:1:abrot"]}, FaultError, "did you mean 'abort'"),
        ({"namespaces": ()}, ValueError, "at least one"),
        ({"namespaces": ("/1r",)}, ValueError, "1r"),
        ({"speed": 0.0}, ValueError, "speed"),
        ({"step_period": -1.0}, ValueError, "step_period"),
        ({"journal": "/dev/null/journal"}, OSError, "Not a directory"),
    ],
)
def test_a_wrong_setting_is_an_error_that_leaves_nothing_behind(
    ros_bench: RosBench, settings: dict[str, Any], error: type[Exception], says: str
) -> None:
    def entities() -> tuple[int, int, int]:
        node = ros_bench.node
        return len(list(node.waitables)), len(list(node.timers)), len(list(node.publishers))

    before = entities()
    with pytest.raises(error, match=says):
        Simulation(ros_bench.node, **settings)
    assert entities() == before


def test_it_closes_under_running_goals_while_the_executor_spins(
    ros_bench: RosBench, space: str
) -> None:
    for cycle in range(15):
        robot = Robot(ros_bench, f"{space}/c{cycle}")
        simulation = Simulation(ros_bench.node, namespaces=(f"{space}/c{cycle}",), speed=2.0)
        robot.until_ready().move.send(distance=9.0).until_moving()
        robot.gripper.send(position=100.0).until_moving().cancel()
        simulation.close()
        simulation.close()
        assert not any(server.is_open for server in simulation.servers)
    ros_bench.go_on_for(0.1)


def test_a_client_in_the_same_executor_is_served(own_bench: RosBench, space: str) -> None:
    from rclpy.action import ActionClient
    from rclpy.node import Node

    node = Node("tree", context=own_bench.node.context)
    client = ActionClient(node, MoveRobot, f"{space}/move_robot")
    own_bench.serve(
        Simulation(
            own_bench.node, namespaces=(space,), speed=20.0, faults=["move_robot:1:delay_accept=1"]
        )
    )
    own_bench.spun.executor.add_node(node)
    until(client.server_is_ready, 10.0)
    ended = threading.Event()
    statuses: list[int] = []

    def finished(future: Any) -> None:
        statuses.append(future.result().status)
        ended.set()

    client.send_goal_async(MoveRobot.Goal(distance=1.0))
    second = client.send_goal_async(MoveRobot.Goal(distance=2.0))
    second.add_done_callback(
        lambda future: future.result().get_result_async().add_done_callback(finished)
    )
    assert ended.wait(5.0), "an acceptance that is delayed holds nobody up"
    assert statuses == [SUCCEEDED]
    own_bench.spun.stop()  # rclpy's own clients must not be destroyed before
    client.destroy()
    node.destroy_node()
