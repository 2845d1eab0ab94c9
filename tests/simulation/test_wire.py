"""A server that is destroyed while its executor spins, at each moment the executor may be at."""

from __future__ import annotations

import gc
import warnings
from typing import Any

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from test_msgs.action import Fibonacci

from bt_actions.simulation import ScriptedServer
from bt_actions.simulation.ros.wire import InterceptedActionServer
from tests.simulation.conftest import RosBench


@pytest.fixture
def gone(ros_bench: RosBench, space: str) -> InterceptedActionServer:
    """The rclpy side of a server that an executor has just put into its wait set."""
    server = ScriptedServer(ros_bench.node, Fibonacci, f"{space}/fibonacci")
    wire: Any = server._wire
    server.close()
    return wire


def test_it_is_left_out_of_the_wait_set(gone: InterceptedActionServer, ros_bench: RosBench) -> None:
    with ros_bench.node.context.handle:
        wait_set = _rclpy.WaitSet(0, 0, 0, 0, 0, 0, ros_bench.node.context.handle)
    gone.add_to_wait_set(wait_set)
    assert not gone.is_ready(wait_set)
    assert gone.get_num_entities().num_services in {0, 3}


def test_nothing_is_taken_from_it(gone: InterceptedActionServer) -> None:
    assert gone.take_data() == {}


def test_what_was_taken_before_is_not_answered(gone: InterceptedActionServer) -> None:
    request = Fibonacci.Impl.SendGoalService.Request()
    execution = gone.execute({"goal": (object(), request), "expired": ()})
    with pytest.raises(StopIteration):
        execution.send(None)


def test_its_results_are_not_sent(gone: InterceptedActionServer) -> None:
    from rclpy.task import Future

    future = Future()
    future.set_result(Fibonacci.Impl.GetResultService.Response())
    gone._send_result_response(object(), future)


def test_it_may_be_destroyed_twice(gone: InterceptedActionServer) -> None:
    gone.destroy()


def test_python_does_not_warn_of_what_an_executor_did_not_come_to(
    ros_bench: RosBench, space: str
) -> None:
    """As where a signal ends the process in mid-goal."""
    node = Node("ends", context=ros_bench.node.context)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    server = ScriptedServer(node, Fibonacci, f"{space}/fibonacci")
    wire: Any = server._wire
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        wire.finish("00", Fibonacci.Result())
        for silent in (True, False):
            wire.answer_soon(object(), silent=silent)
        server.close()
        executor.shutdown()
        node.destroy_node()
        del executor, node, server, wire
        gc.collect()
    assert [str(each.message) for each in told] == []
