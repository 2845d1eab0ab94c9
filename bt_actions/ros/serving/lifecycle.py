"""The standard interface of a managed node, on a plain one. The user gives the work of a change.

The states are rcl's own table. rclpy's LifecycleNode will not do: an illegal request kills its
executor, and nothing is answered during a change.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Mapping
from typing import Any

from lifecycle_msgs.msg import State, Transition, TransitionDescription, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.impl.implementation_singleton import rclpy_implementation

from bt_actions.ros.rosout import Tell
from bt_actions.ros.serving.endpoints import Endpoints
from bt_actions.utilities.plain_text import in_words


class Lifecycle:
    """The state of a node, and the services that tell and change it; unconfigured at first.

    `steps` has the work in a state of transition ("configuring", ...): an error fails the change,
    and the state is as before. One change at a time.
    """

    def __init__(
        self, endpoints: Endpoints, steps: Mapping[str, Callable[[], None]], tell: Tell
    ) -> None:
        node = self._node = endpoints.node
        self._steps, self._off, self._say = steps, endpoints.off, tell
        self._changes = threading.Lock()
        with node.handle:
            self._machine = rclpy_implementation.LifecycleStateMachine(node.handle, False)
        self._events = endpoints.publisher(TransitionEvent, "~/transition_event", 10)
        endpoints.service(ChangeState, "~/change_state", self._on_change)
        for kind, what in (
            (GetState, "current_state"),
            (GetAvailableStates, "available_states"),
            (GetAvailableTransitions, "available_transitions"),
            (GetAvailableTransitions, "transition_graph"),
        ):
            name = f"~/get_{what.removeprefix('current_')}"
            endpoints.service(kind, name, functools.partial(self._tell, what))

    @property
    def state(self) -> str:
        """The state's label."""
        return str(self._machine.current_state[1])

    def change(self, transition: str | int) -> bool:
        """Make a transition by its label or id; return, when it is done, whether it succeeded."""
        if not self._changes.acquire(blocking=False):
            return False
        try:
            self._trigger(transition)
            state = self.state
            self._say("info", state)
            try:
                self._steps[state]()
                how = "success"
            except Exception as error:  # noqa: BLE001 - it is told, and the state is as before
                self._say("error", f"{state} failed: {in_words(error)}")
                how = "failure"
            self._trigger(f"transition_{how}")
        except (KeyError, RuntimeError):  # rclpy's RCLError: the context was shut down
            return False
        finally:
            self._changes.release()
        return how == "success"

    def stop(self) -> None:
        """Return once a running change is over; none follows."""
        self._changes.acquire()

    def close(self) -> None:
        """Close, after `stop`, and after the endpoints."""
        self._machine.destroy_when_not_in_use()

    def _trigger(self, wanted: str | int) -> None:
        """Go to the next state, and tell of it. Raises KeyError where no way leads there."""
        possible = {key: each for each in self._machine.available_transitions for key in each[:2]}
        self._machine.trigger_transition_by_id(possible[wanted][0], False)
        now = self._node.get_clock().now().nanoseconds
        self._events.publish(TransitionEvent(timestamp=now, **_described(*possible[wanted])))

    def _tell(self, what: str, _request: Any, response: Any) -> Any:
        found = getattr(self._machine, what)
        if what == "current_state":
            response.current_state = _state(*found)
        elif what == "available_states":
            response.available_states = [_state(*each) for each in found]
        else:
            response.available_transitions = [
                TransitionDescription(**_described(*each)) for each in found
            ]
        return response

    async def _on_change(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        wanted = request.transition.label or int(request.transition.id)
        response.success = await self._off(
            lambda work: threading.Thread(target=work, name="bt_actions-change").start(),
            lambda: self.change(wanted),
        )
        return response


def _state(number: int, label: str) -> State:
    return State(id=number, label=label)


def _described(number: int, label: str, *ends: Any) -> dict[str, Any]:
    """Return a transition for messages; `ends` are the ids and labels of its two states."""
    return {
        "transition": Transition(id=number, label=label),
        "start_state": _state(*ends[:2]),
        "goal_state": _state(*ends[2:]),
    }
