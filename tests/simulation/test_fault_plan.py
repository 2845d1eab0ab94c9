"""Which goals are struck: by number, always, or by dice that a seed decides."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_actions.simulation.fault_plan import FaultPlan
from bt_actions.simulation.faults import FaultError, FaultKind

SERVER = "/r1/move_robot"


def struck(plan: FaultPlan, count: int, server: str = SERVER) -> list[int]:
    return [number for number in range(1, count + 1) if plan.strike(server, number)]


def test_a_number_strikes_that_goal_only() -> None:
    assert struck(FaultPlan.of(["move_robot:2:abort"]), 5) == [2]


def test_a_star_strikes_every_goal() -> None:
    assert struck(FaultPlan.of(["move_robot:*:abort"]), 3) == [1, 2, 3]


def test_each_server_counts_its_own_goals_and_meets_its_own_dice() -> None:
    plan = FaultPlan.of(["move_robot:50%:abort"], seed=1)
    assert struck(plan, 40, "/r1/move_robot") != struck(plan, 40, "/r2/move_robot")


@given(seed=st.integers(0, 2**32), order=st.permutations(range(1, 30)))
def test_the_same_seed_strikes_the_same_goals_in_whatever_order(
    seed: int, order: list[int]
) -> None:
    plan, other = (FaultPlan.of(["*:30%:reject", "*:10%:stall"], seed) for _ in range(2))
    shuffled = {number: str(other.strike(SERVER, number)) for number in order}
    assert shuffled == {number: str(plan.strike(SERVER, number)) for number in range(1, 30)}


def test_a_percentage_strikes_about_so_many() -> None:
    plan = FaultPlan.of(["*:5%:reject"], seed=7)
    assert 400 < len(struck(plan, 10_000)) < 600


def test_without_a_seed_one_is_chosen_and_can_be_used_again() -> None:
    plan = FaultPlan.of(["*:50%:reject"])
    again = FaultPlan.of(["*:50%:reject"], plan.seed)
    assert struck(plan, 100) == struck(again, 100)
    assert plan.uses_chance
    assert not FaultPlan.of(["*:1:reject"]).uses_chance


def test_several_faults_strike_one_goal_and_the_last_of_a_kind_wins() -> None:
    plan = FaultPlan.of(["*:1:slow=2", "*:1:drop_result", "*:1:slow=4"])
    faults = plan.strike(SERVER, 1)
    assert faults.number(FaultKind.SLOW) == 4.0
    assert FaultKind.DROP_RESULT in faults
    assert faults.number(FaultKind.DROP_RESULT) is None
    assert str(faults) == "slow=4.0, drop_result"


def test_a_goal_without_faults_is_false() -> None:
    assert not FaultPlan.of(["*:2:slow"]).strike(SERVER, 1)


def test_a_fault_for_a_server_that_is_not_there_is_an_error() -> None:
    plan = FaultPlan.of(["move_robt:1:abort"])
    with pytest.raises(FaultError, match="did you mean 'move_robot'"):
        plan.check(["/move_robot", "/gripper_control"])
    with pytest.raises(FaultError, match="there is /arm, /gripper_control"):
        plan.check(["/arm", "/gripper_control"])


def test_a_fault_for_another_namespace_is_an_error() -> None:
    with pytest.raises(FaultError, match="no server '/r9/move_robot'"):
        FaultPlan.of(["/r9/move_robot:1:abort"]).check(["/r1/move_robot"])
