"""The battery empties on the way and fills at home."""

from hypothesis import given
from hypothesis import strategies as st

from bt_actions.simulation.battery import Battery


def test_driving_takes_charge_in_either_direction() -> None:
    battery = Battery()
    battery.drive(10.0)
    battery.drive(-10.0)
    assert battery.charge == 0.98


def test_rest_at_home_fills_it() -> None:
    battery = Battery(0.5)
    battery.rest_at_home(10.0)
    assert battery.charge == 0.6


@given(st.lists(st.floats(-1e6, 1e6) | st.none()))
def test_the_charge_stays_between_none_and_all(ways: list[float | None]) -> None:
    battery = Battery()
    for way in ways:
        battery.rest_at_home(100.0) if way is None else battery.drive(way)
        assert 0.0 <= battery.charge <= 1.0
