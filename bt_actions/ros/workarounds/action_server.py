"""rclpy's ActionServer, which may be destroyed while its node is spun.

rclpy's executor asks a server for its entities, and takes and answers requests, while another
thread may destroy the server: the spin then ends with InvalidHandle, as with any other error while
a request is answered. rclpy #1150 mended that for messages, and not for actions. Not needed any
more where tests/ros/test_closable.py sees no InvalidHandle of a plain one.

rclpy would also poll an awaited goal, and have the executor send its result. Here a goal is
executed elsewhere, and the thread that sets or asks for a result sends it.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, TypeVar

from rclpy.action.server import ActionServer, RCLError
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.waitable import NumberOfEntities

from bt_actions.ros.log import log
from bt_actions.utilities.plain_text import raised

Value = TypeVar("Value")


class ClosableActionServer(ActionServer):  # type: ignore[misc]
    """An action server whose goals are executed, and whose results are set, by a subclass."""

    def __init__(self, node: Node, action_type: Any, name: str, **settings: Any) -> None:
        """Serve on `node`; `settings` are those of rclpy's ActionServer."""
        self.gone = False
        self._name = name
        super().__init__(node, action_type, name, execute_callback=lambda _: None, **settings)

    def destroy(self) -> None:
        """Go, at once and without a word to the clients; on any thread."""
        if not self.gone:
            self.gone = True
            super().destroy()

    # The executor calls these four while it builds its wait set and takes what has come

    def get_num_entities(self) -> NumberOfEntities:
        none = NumberOfEntities(0, 0, 0, 0, 0)
        return self._unless_gone(super().get_num_entities, none)

    def add_to_wait_set(self, wait_set: Any) -> None:
        self._unless_gone(partial(super().add_to_wait_set, wait_set), None)

    def is_ready(self, wait_set: Any) -> bool:
        return self._unless_gone(partial(super().is_ready, wait_set), False)

    def take_data(self) -> dict[str, Any]:
        return self._unless_gone(super().take_data, {})

    def _unless_gone(self, ask: Callable[[], Value], otherwise: Value) -> Value:
        try:
            return otherwise if self.gone else ask()
        except (InvalidHandle, RCLError):
            if not self.gone:
                raise
            return otherwise

    async def execute(self, taken_data: dict[str, Any]) -> None:
        """Answer the taken requests, each on its own."""
        for kind, taken in taken_data.items():
            await self.guarded(super().execute, {kind: taken})

    async def guarded(self, work: Callable[..., Awaitable[object]], *arguments: Any) -> None:
        """Await work whose error would end the executor's spin."""
        try:
            await work(*arguments)
        except Exception as error:  # noqa: BLE001 - see above
            if not self.gone:
                log.error(f"{self._name}: {raised(error)}")

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        """Do nothing: `goal_handle.execute()` has marked the goal as executing, and that is all."""

    def add_future(self, future: Any) -> None:
        """Do nothing: a result is not the executor's."""

    remove_future = add_future

    def _send_result_response(self, request_header: Any, future: Any) -> None:
        self._unless_gone(partial(super()._send_result_response, request_header, future), None)
