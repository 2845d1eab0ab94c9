"""Faults as they are written: read, written again, and refused with a remedy."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_actions.simulation.faults import KINDS, PHASES, Fault, FaultError, FaultKind, Unit, table


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("move_robot:2:abort", Fault("move_robot", FaultKind.ABORT, number=2)),
        ("gripper_control:5%:stall", Fault("gripper_control", FaultKind.STALL, probability=0.05)),
        ("/r1/move_robot:*:slow=3", Fault("/r1/move_robot", FaultKind.SLOW, 3.0)),
        ("r1/move_robot:*:slow", Fault("/r1/move_robot", FaultKind.SLOW, 5.0)),
        ("*:100%:reject", Fault("*", FaultKind.REJECT)),
        (" move_robot : 1 : delay-accept = 2s ", Fault("move_robot", FaultKind.DELAY_ACCEPT, 2, 1)),
        ("move_robot:1:DIE=accept", Fault("move_robot", FaultKind.DIE, "accept", 1)),
        ("move_robot:1:die", Fault("move_robot", FaultKind.DIE, "execute", 1)),
        ("move_robot:1:drop_result=2", Fault("move_robot", FaultKind.DROP_RESULT, 2, 1)),
        ("move_robot:.5%:reject", Fault("move_robot", FaultKind.REJECT, probability=0.005)),
    ],
)
def test_a_fault_is_read(text: str, fault: Fault) -> None:
    assert Fault.parse(text) == fault


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "SERVER:WHEN:FAULT"),
        ("move_robot", "SERVER:WHEN:FAULT"),
        ("move_robot:2", "SERVER:WHEN:FAULT"),
        ("a:b:c:d", "SERVER:WHEN:FAULT"),
        (":2:abort", "not the name of a server"),
        ("mö:2:abort", "not the name of a server"),
        ("/:2:abort", "not the name of a server"),
        ("move_robot:0:abort", "which goal"),
        ("move_robot:-1:abort", "which goal"),
        ("move_robot:2.5:abort", "which goal"),
        ("move_robot:" + "9" * 5000 + ":abort", "which goal"),
        ("move_robot:0%:abort", "which goal"),
        ("move_robot:100.1%:abort", "which goal"),
        ("move_robot:" + "9" * 5000 + "%:abort", "which goal"),
        ("move_robot:nan%:abort", "which goal"),
        ("move_robot:2:abrot", "did you mean 'abort'"),
        ("move_robot:2:", "there is no fault ''"),
        ("move_robot:2:reject=1", "takes no value"),
        ("move_robot:2:slow=", "takes FACTOR"),
        ("move_robot:2:slow=0.5", "from 1 to 1000000"),
        ("move_robot:2:slow=nan", "from 1 to 1000000"),
        ("move_robot:2:abort=-1", "from 0 to 1000000"),
        ("move_robot:2:abort=inf", "from 0 to 1000000"),
        ("move_robot:2:drop_result=1.5", "a whole number"),
        ("move_robot:2:die=exekute", "did you mean 'execute'"),
    ],
)
def test_a_wrong_fault_is_one_readable_error(text: str, says: str) -> None:
    with pytest.raises(FaultError) as caught:
        Fault.parse(text)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_fault_is_answered_with_one_like_it_or_with_where_they_are_listed() -> None:
    with pytest.raises(FaultError, match="no fault 'abrt'; did you mean 'abort'"):
        Fault.parse("move_robot:2:abrt")
    with pytest.raises(FaultError, match="`bt-actions sim --help` lists the faults"):
        Fault.parse("move_robot:2:explode")


def test_every_fault_has_a_meaning_and_a_line_in_the_table() -> None:
    assert set(KINDS) == set(FaultKind)
    assert len(table().splitlines()) == len(FaultKind)


def values_of(kind: FaultKind) -> st.SearchStrategy[float | str | None]:
    unit = KINDS[kind].unit
    if unit is Unit.NONE:
        return st.none()
    if unit is Unit.PHASE:
        return st.none() | st.sampled_from(PHASES)
    return st.none() | st.integers(1, 1000).map(float)


faults = st.sampled_from(FaultKind).flatmap(
    lambda kind: st.builds(
        Fault,
        server=st.sampled_from(["move_robot", "/r1/move_robot", "*"]),
        kind=st.just(kind),
        value=values_of(kind),
        number=st.none() | st.integers(1, 999),
    )
)


@given(faults)
def test_a_fault_that_is_written_is_read_as_itself(fault: Fault) -> None:
    assert Fault.parse(str(fault)) == fault


@given(st.text() | st.text(alphabet="ab/*:%=._19"))
def test_any_text_is_a_fault_or_a_fault_error(text: str) -> None:
    try:
        Fault.parse(text)
    except FaultError:
        return


@pytest.mark.parametrize(
    ("fault", "server", "fits"),
    [
        ("move_robot:1:abort", "/move_robot", True),
        ("move_robot:1:abort", "/r1/move_robot", True),
        ("move_robot:1:abort", "/r1/gripper_control", False),
        ("robot:1:abort", "/r1/move_robot", False),
        ("/r1/move_robot:1:abort", "/r1/move_robot", True),
        ("/r1/move_robot:1:abort", "/r2/move_robot", False),
        ("/move_robot:1:abort", "/r1/move_robot", False),
        ("*:1:abort", "/r2/gripper_control", True),
    ],
)
def test_a_name_without_namespace_fits_every_namespace(fault: str, server: str, fits: bool) -> None:
    assert Fault.parse(fault).fits(server) is fits


@pytest.mark.parametrize("number", [0, -1])
def test_goals_are_counted_from_one(number: int) -> None:
    with pytest.raises(FaultError, match="from 1"):
        Fault("move_robot", FaultKind.ABORT, number=number)


@pytest.mark.parametrize("probability", [0.0, -0.1, 1.1, float("nan")])
def test_a_probability_lies_between_none_and_one(probability: float) -> None:
    with pytest.raises(FaultError, match="probability"):
        Fault("move_robot", FaultKind.ABORT, probability=probability)
