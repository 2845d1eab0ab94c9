"""One robot, one part, and the stations between which the part is carried. No ROS, no clock.

The part moves only in the gripper. The fingers pick the part when they close on it, carry it with
the robot, and leave it where they open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from bt_actions.simulation.gripper import GripperSimulator
from bt_actions.simulation.robot import RobotSimulator

REACH = 0.05
"""Distance within which the gripper gets hold of a part, m; also the size of a station."""
PART_WIDTH = 40.0
"""The opening at which the fingers touch the part, percent."""


@dataclass(frozen=True, slots=True)
class Station:
    """A place on the axis with a name."""

    name: str
    position: float
    """m"""
    where: str
    """The place in a sentence: "at the shelf"."""


HOME = Station("home", 0.0, "at home")
PICK = Station("pick", 2.0, "at the pick station")
SHELF = Station("shelf", 5.0, "at the shelf")
STATIONS = (HOME, PICK, SHELF)


@dataclass(frozen=True, slots=True)
class Part:
    """The present place of the part, and its holder."""

    position: float
    """m"""
    held_by: str | None
    """The robot's name, or None while the part lies."""
    station: str | None
    """The station at which the part lies; None while it is held or lies somewhere else."""


@dataclass(frozen=True, slots=True)
class WorldEvent:
    """An event of the part: picked, placed at a station, or dropped elsewhere."""

    kind: Literal["picked", "placed", "dropped"]
    robot: str
    position: float
    station: Station | None

    def __str__(self) -> str:
        where = self.station.where if self.station else "at no station"
        return f"{self.kind}: the part at {self.position:.2f} m, {where}, by {self.robot}"


class World:
    """The robot, its gripper and the part, of one namespace."""

    def __init__(
        self,
        *,
        name: str = "the robot",
        stations: tuple[Station, ...] = STATIONS,
        part_at: float = PICK.position,
        on_event: Callable[[WorldEvent], None] = lambda event: None,
    ) -> None:
        """Put the part at `part_at` (m) and the robot at 0, its gripper closed.

        `on_event` gets the events of the part, from within the call that causes them.
        """
        self.name = name
        self.stations = stations
        self.robot = RobotSimulator()
        self.gripper = GripperSimulator()
        self._on_event = on_event
        self._lies_at = part_at
        self._held = False

    def __repr__(self) -> str:
        return f"<World {self.robot!r} {self.gripper!r} {self.part!r}>"

    @property
    def part(self) -> Part:
        """The part as it is now."""
        if self._held:
            return Part(self.robot.current_pose, self.name, None)
        station = self.station_at(self._lies_at)
        return Part(self._lies_at, None, station.name if station else None)

    def station_at(self, position: float) -> Station | None:
        """Return the station within REACH of `position` (m)."""
        for station in self.stations:
            if abs(station.position - position) <= REACH:
                return station
        return None

    def move_robot(self, share: float = 1.0) -> float:
        """Move the robot one step, or `share` of one, with the part that it holds.

        Return its pose.
        """
        return self.robot.move_step(share)

    def move_gripper(self, share: float = 1.0) -> float:
        """Move the gripper one step, or `share` of one; return its position."""
        position = self.gripper.move_step(share, PART_WIDTH if self._between else None)
        if self.gripper.stalled and not self._held:
            self._held = True
            self._tell("picked")
        elif self._held and position > PART_WIDTH:
            self.drop()
        return position

    def drop(self) -> bool:
        """Let the part fall where the robot is; return whether the robot held one."""
        if not self._held:
            return False
        self._held = False
        self._lies_at = self.robot.current_pose
        self._tell("placed" if self.station_at(self._lies_at) else "dropped")
        return True

    def describe(self) -> str:
        """Say in one sentence where the part is."""
        part = self.part
        if part.held_by:
            return f"The part is in the gripper of {part.held_by}, at {part.position:.2f} m."
        station = self.station_at(part.position)
        where = station.where if station else "at no station"
        return f"The part lies at {part.position:.2f} m, {where}."

    @property
    def _between(self) -> bool:
        within_reach = abs(self._lies_at - self.robot.current_pose) <= REACH
        return self._held or (within_reach and self.gripper.position >= PART_WIDTH)

    def _tell(self, kind: Literal["picked", "placed", "dropped"]) -> None:
        pose = self.robot.current_pose
        self._on_event(WorldEvent(kind, self.name, pose, self.station_at(pose)))
