"""A robot's battery: empties with the way it drives, fills at home. No ROS, no clock."""

from __future__ import annotations

PER_METRE = 0.001
"""Charge that one metre takes, of 1."""
PER_SECOND_AT_HOME = 0.01
"""Charge that comes back in one simulated second at home, of 1."""


class Battery:
    """The charge, 0 to 1."""

    def __init__(self, charge: float = 1.0) -> None:
        self.charge = charge

    def __repr__(self) -> str:
        return f"<Battery {self.charge:.0%}>"

    def drive(self, metres: float) -> None:
        """Take what a way of `metres` costs."""
        self.charge = max(0.0, self.charge - PER_METRE * abs(metres))

    def rest_at_home(self, seconds: float) -> None:
        """Give back what `seconds` of simulated time at home bring."""
        self.charge = min(1.0, self.charge + PER_SECOND_AT_HOME * seconds)
