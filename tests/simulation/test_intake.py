"""Goal requests until they are decided, without ROS."""

from __future__ import annotations

from bt_actions.simulation.fault_plan import FaultPlan
from bt_actions.simulation.intake import Fate, Intake
from bt_actions.simulation.journal import Event


class Desk:
    """An intake whose records and warnings can be read."""

    def __init__(self, *faults: str) -> None:
        self.events: list[tuple[str, Event]] = []
        self.warnings: list[str] = []
        self.intake = Intake(
            "/move_robot",
            FaultPlan.of(faults),
            record=lambda goal, event, **more: self.events.append((goal, event)),
            warn=self.warnings.append,
        )


def accepts(goal: object) -> None:
    return None


def test_a_goal_goes_from_received_to_accepted() -> None:
    desk = Desk()
    goal = object()
    assert desk.intake.receive(goal, "a").fate is Fate.ANSWER
    assert desk.intake.decide(goal, accepts)
    assert desk.intake.start("a")
    assert desk.intake.start("a") is None, "a goal starts once"
    assert not desk.intake.answered(goal, "a")
    assert desk.events == [("a", Event.RECEIVED), ("a", Event.ACCEPTED)]


def test_a_refused_goal_is_logged_with_its_reason() -> None:
    desk = Desk()
    goal = object()
    desk.intake.receive(goal, "a")
    assert not desk.intake.decide(goal, lambda goal: "too far")
    assert desk.warnings == ["/move_robot: goal 1 refused: too far"]
    assert desk.events[-1] == ("a", Event.REJECTED)


def test_a_check_that_raises_refuses() -> None:
    desk = Desk()
    goal = object()
    desk.intake.receive(goal, "a")
    assert not desk.intake.decide(goal, lambda goal: str(1 / 0))
    assert "ZeroDivisionError" in desk.warnings[0]


def test_a_goal_whose_id_is_taken_is_recorded_as_rejected() -> None:
    desk = Desk()
    goal = object()
    desk.intake.receive(goal, "a")
    assert not desk.intake.answered(goal, "a")
    assert desk.events[-1] == ("a", Event.REJECTED)


def test_an_accepted_goal_that_was_not_started_is_reported() -> None:
    desk = Desk()
    goal = object()
    desk.intake.receive(goal, "a")
    desk.intake.decide(goal, accepts)
    assert desk.intake.answered(goal, "a")


def test_faults_decide_what_becomes_of_a_request() -> None:
    desk = Desk(
        "*:1:reject", "*:2:delay_accept=3", "*:3:drop_goal", "*:4:drop_accept", "*:5:die=accept"
    )
    goals = [object() for _ in range(5)]
    requests = [desk.intake.receive(goal, str(n)) for n, goal in enumerate(goals)]
    assert [each.fate for each in requests] == [
        Fate.ANSWER, Fate.LATER, Fate.LOST, Fate.SILENT, Fate.DIE,
    ]  # fmt: skip
    assert requests[1].delay == 3.0
    assert not desk.intake.decide(goals[0], accepts)
    assert desk.intake.decide(goals[1], accepts)


def test_a_lost_request_leaves_nothing_behind() -> None:
    desk = Desk("*:1:drop_goal")
    goal = object()
    assert desk.intake.receive(goal, "a").fate is Fate.LOST
    assert not desk.intake.decide(goal, accepts)
    assert not desk.intake.answered(goal, "a")
    assert desk.events == [("a", Event.RECEIVED)]


def test_a_dead_server_forgets_its_requests_but_goes_on_counting() -> None:
    desk = Desk()
    goal = object()
    desk.intake.receive(goal, "a")
    desk.intake.clear()
    assert not desk.intake.decide(goal, accepts)
    assert desk.intake.receive(goal, "b").number == 2
