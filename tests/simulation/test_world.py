"""A part that is picked, carried and placed, and that is nowhere else than where it must be."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from bt_actions.simulation.robot import RobotStatus
from bt_actions.simulation.world import PART_WIDTH, PICK, REACH, SHELF, World, WorldEvent


def drive(world: World, to: float) -> None:
    world.robot.set_goal(to)
    while world.robot.get_status() is RobotStatus.MOVING:
        world.move_robot()


def grip(world: World, to: float) -> None:
    world.gripper.set_goal(to)
    while not world.gripper.done:
        world.move_gripper()


@pytest.fixture
def events() -> list[WorldEvent]:
    return []


@pytest.fixture
def world(events: list[WorldEvent]) -> World:
    return World(on_event=events.append)


def pick(world: World) -> None:
    grip(world, 100.0)
    drive(world, PICK.position)
    grip(world, 0.0)


def test_the_part_lies_at_the_pick_station_at_first(world: World) -> None:
    assert world.part.position == 2.0
    assert world.part.station == "pick"
    assert world.part.held_by is None
    assert world.describe() == "The part lies at 2.00 m, at the pick station."


def test_it_is_carried_to_the_shelf(world: World, events: list[WorldEvent]) -> None:
    pick(world)
    assert world.gripper.stalled
    assert world.part.held_by == "the robot"
    drive(world, SHELF.position)
    assert world.part.position == world.robot.current_pose
    assert "in the gripper of the robot" in world.describe()
    grip(world, 100.0)
    assert world.part.station == "shelf"
    assert world.describe() == "The part lies at 4.99 m, at the shelf."
    assert [event.kind for event in events] == ["picked", "placed"]
    assert str(events[1]) == "placed: the part at 4.99 m, at the shelf, by the robot"


def test_closing_elsewhere_grips_nothing(world: World, events: list[WorldEvent]) -> None:
    grip(world, 100.0)
    drive(world, PICK.position + 2 * REACH)
    grip(world, 0.0)
    assert world.gripper.reached
    assert not world.gripper.stalled
    assert events == []


def test_a_part_let_go_between_stations_is_dropped(world: World, events: list[WorldEvent]) -> None:
    pick(world)
    drive(world, 3.5)
    grip(world, 100.0)
    assert [event.kind for event in events] == ["picked", "dropped"]
    assert world.part.station is None
    assert world.describe() == "The part lies at 3.49 m, at no station."


def test_a_fallen_part_can_be_picked_up_again(world: World, events: list[WorldEvent]) -> None:
    pick(world)
    drive(world, 3.0)
    world.drop()
    grip(world, 100.0)
    grip(world, 0.0)
    assert world.part.held_by == "the robot"
    assert [event.kind for event in events] == ["picked", "dropped", "picked"]


class AnyOrder(RuleBasedStateMachine):
    """Robot and gripper are stepped in any order, with goals changed in mid-motion."""

    def __init__(self) -> None:
        super().__init__()
        self.events: list[WorldEvent] = []
        self.world = World(on_event=self.events.append)
        self.lay_at = self.world.part.position

    @rule(to=st.sampled_from([0.0, 2.0, 5.0]) | st.floats(-10.0, 10.0))
    def send_robot(self, to: float) -> None:
        self.world.robot.set_goal(to)

    @rule(to=st.sampled_from([0.0, 100.0]) | st.floats(0.0, 100.0))
    def send_gripper(self, to: float) -> None:
        self.world.gripper.set_goal(to)

    @rule(steps=st.integers(1, 80), share=st.floats(0.1, 1.0))
    def move_robot(self, steps: int, share: float) -> None:
        for _ in range(steps):
            self.world.move_robot(share)

    @rule(steps=st.integers(1, 15))
    def move_gripper(self, steps: int) -> None:
        for _ in range(steps):
            self.world.move_gripper()

    @rule()
    def drop(self) -> None:
        held = self.held
        assert self.world.drop() == held

    @property
    def held(self) -> bool:
        return self.world.part.held_by is not None

    @invariant()
    def a_held_part_is_where_the_robot_is_and_any_other_where_it_lay(self) -> None:
        part = self.world.part
        if self.held:
            assert part.position == self.world.robot.current_pose
        elif self.events:
            assert part.position == self.events[-1].position
        else:
            assert part.position == self.lay_at

    @invariant()
    def it_is_picked_and_let_go_in_turns(self) -> None:
        picked = [event.kind == "picked" for event in self.events]
        assert picked == [index % 2 == 0 for index in range(len(picked))]
        assert self.held == (len(picked) % 2 == 1)

    @invariant()
    def fingers_that_hold_are_not_closed_through_the_part(self) -> None:
        if self.held:
            assert self.world.gripper.position == PART_WIDTH


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
