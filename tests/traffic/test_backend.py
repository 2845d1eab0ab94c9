"""What every Backend keeps, and its services, subscriptions and publishers. ROS is one of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import pytest
from std_msgs.msg import Bool, Float32, Int32
from std_srvs.srv import SetBool, Trigger

from bt_actions.messages.interfaces import TwoTypes
from bt_actions.testing import VirtualBackend, VirtualNetwork
from bt_actions.traffic.backend import Backend
from bt_actions.traffic.state import RunListener, ticking_run
from bt_actions.wiring import backend_of
from tests.support.waiting import until

NUMBERS = itertools.count(1)
QOS = ("default", "latched")
RAISES = ValueError("a mistake of whoever answers")


class World(Protocol):
    """A backend, and what stands around it."""

    backend: Backend
    namespace: str
    """Of the backend's node, without a slash at its end."""

    def serve(self, service_type: type, name: str, answer: Callable[[Any], Any]) -> None:
        """Offer a service; `answer` gives the response to a request."""

    def listen(self, message_type: type, topic: str, take: Callable[[Any], None]) -> None:
        """Have `take` called with each message, as any other node may."""

    def speaker(self, message_type: type, topic: str) -> Any:
        """Make a publisher, as any other node may."""

    def until(self, condition: Callable[[], Any]) -> None:
        """Let messages travel until something is so."""


class Ros:
    """A node that is spun while somebody waits for something."""

    def __init__(self, node: Any) -> None:
        from rclpy.executors import SingleThreadedExecutor

        self.backend: Backend = backend_of(node)
        self.namespace = node.get_namespace().rstrip("/")
        self._node = node
        self._services: list[Any] = []
        self._subscriptions: list[Any] = []
        self._publishers: list[Any] = []
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def serve(self, service_type: type, name: str, answer: Callable[[Any], Any]) -> None:
        """Offer a service on the same node."""
        self._services.append(
            self._node.create_service(service_type, name, lambda request, _: answer(request))
        )

    def listen(self, message_type: type, topic: str, take: Callable[[Any], None]) -> None:
        """Listen on the same node."""
        self._subscriptions.append(self._node.create_subscription(message_type, topic, take, 10))

    def speaker(self, message_type: type, topic: str) -> Any:
        """Make one on the same node."""
        self._publishers.append(self._node.create_publisher(message_type, topic, 10))
        return self._publishers[-1]

    def until(self, condition: Callable[[], Any]) -> None:
        """Spin until something is so."""
        until(condition, meanwhile=lambda: self._executor.spin_once(timeout_sec=0.01))

    def close(self) -> None:
        """Leave the node as it was."""
        for service in self._services:
            self._node.destroy_service(service)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        for publisher in self._publishers:
            self._node.destroy_publisher(publisher)
        self._executor.shutdown()
        self._node.executor = None


class Virtual:
    """The network in virtual time."""

    namespace = "/house"

    def __init__(self) -> None:
        self._network = VirtualNetwork(self.namespace)
        self.backend: Backend = VirtualBackend(self._network)

    def serve(self, service_type: type, name: str, answer: Callable[[Any], Any]) -> None:
        """Offer a service."""
        self._network.provide(service_type, name, answer)

    def listen(self, message_type: type, topic: str, take: Callable[[Any], None]) -> None:
        """Listen."""
        self._network.subscribe(message_type, topic, take)

    def speaker(self, message_type: type, topic: str) -> Any:
        """Make one."""
        return self._network.publisher(message_type, topic)

    def until(self, condition: Callable[[], Any]) -> None:
        """Let time pass until something is so."""
        while not condition():
            assert self._network.now() < 60.0
            self._network.timeline.advance(self._network.now() + 0.1)


@pytest.fixture
def virtual() -> World:
    """A network of its own for each test."""
    return Virtual()


@pytest.fixture
def ros(node: Any) -> Iterator[World]:
    """The node of all tests."""
    world = Ros(node)
    yield world
    world.close()


@pytest.fixture(params=[pytest.param("ros", marks=pytest.mark.ros), "virtual"])
def world(request: pytest.FixtureRequest) -> World:
    """Each Backend there is."""
    world: World = request.getfixturevalue(request.param)
    return world


@pytest.fixture
def name() -> str:
    """A relative name that no other test uses."""
    return f"backend_{next(NUMBERS)}"


@pytest.fixture
def told(world: World) -> Iterator[list[Any]]:
    """What who runs a tree here is told; None is a wake-up."""
    told: list[Any] = []
    before = ticking_run.set(RunListener(told.append))
    yield told
    ticking_run.reset(before)


def switched(request: Any) -> Any:
    return SetBool.Response(success=request.data, message="switched")


def test_what_is_a_backend_stands_for_itself(world: World) -> None:
    assert isinstance(world.backend, Backend)
    assert backend_of(world.backend) is world.backend


def test_time_goes_on_and_a_stamp_is_of_the_node_s_own_clock(world: World) -> None:
    clock = world.backend
    first, first_stamp = clock.now(), clock.stamp()
    world.until(lambda: clock.now().steady > first.steady and clock.now().ros > first.ros)
    assert isinstance(first_stamp, int)
    assert clock.stamp() > first_stamp


def test_a_line_of_each_level_can_be_logged(world: World) -> None:
    for level in ("debug", "info", "warn", "error", "fatal"):
        world.backend.log(level, "a line")


def test_who_listens_is_given_each_message_in_order(world: World, name: str) -> None:
    came: list[int] = []
    heard = world.backend.subscription(Int32, name, "default", lambda each: came.append(each.data))
    spoken = world.backend.publisher(Int32, name, "default")
    assert heard.name == spoken.name == f"{world.namespace}/{name}"
    world.until(lambda: spoken.listeners == 1)
    for number in range(5):
        spoken.publish(Int32(data=number))
    world.until(lambda: len(came) == 5)
    assert came == [0, 1, 2, 3, 4]
    heard.close()
    world.until(lambda: spoken.listeners == 0)
    spoken.publish(Int32(data=5))
    spoken.close()
    assert came == [0, 1, 2, 3, 4], "nobody listens any more"


def test_a_latched_message_is_given_to_who_comes_later(world: World, name: str) -> None:
    came: list[int] = []
    spoken = world.backend.publisher(Int32, name, "latched")
    spoken.publish(Int32(data=1))
    spoken.publish(Int32(data=2))
    heard = world.backend.subscription(Int32, name, "latched", lambda each: came.append(each.data))
    world.until(lambda: came)
    assert came == [2]
    heard.close()
    spoken.close()


def test_some_time_after_it_began_nobody_may_be_on_the_way_any_more(
    world: World, name: str
) -> None:
    heard = world.backend.subscription(Int32, name, "default", lambda _: None)
    spoken = world.backend.publisher(Int32, name, "default")
    world.until(lambda: heard.may_come() == 0.0)
    world.until(lambda: spoken.may_come() == 0.0)
    heard.close()
    spoken.close()


@pytest.mark.parametrize("qos", ["default", "latched", "sensor"])
def test_a_first_message_has_its_time_where_its_publisher_is_there(
    world: World, name: str, qos: str
) -> None:
    alone = world.backend.subscription(Int32, f"{name}_alone", qos, lambda _: None)
    world.until(lambda: alone.may_come() == 0.0)  # and the node is new no more
    spoken = world.backend.publisher(Int32, name, "latched" if qos == "latched" else "default")
    heard = world.backend.subscription(Int32, name, qos, lambda _: None)
    world.until(lambda: heard.may_come() > 0.0)
    assert alone.may_come() == 0.0
    world.until(lambda: heard.may_come() == 0.0)
    for each in (alone, heard, spoken):
        each.close()


def test_what_was_published_before_comes_to_nobody_unless_it_is_latched(
    world: World, name: str
) -> None:
    came: dict[tuple[str, str], list[int]] = {}
    heard = []
    spoken = {qos: world.backend.publisher(Int32, f"{name}_{qos}", qos) for qos in QOS}
    for each in spoken.values():
        each.publish(Int32(data=1))
    for qos, asked in (("default", "default"), ("latched", "default"), ("latched", "latched")):
        came[qos, asked] = []
        take = came[qos, asked].append
        topic = f"{name}_{qos}"
        heard.append(
            world.backend.subscription(Int32, topic, asked, lambda it, take=take: take(it.data))
        )
    world.until(lambda: [each.listeners for each in spoken.values()] == [1, 2])
    world.until(lambda: came["latched", "latched"])
    for each in spoken.values():
        each.publish(Int32(data=2))
    world.until(lambda: all(2 in each for each in came.values()))
    assert list(came.values()) == [[2], [2], [1, 2]]
    for end in (*heard, *spoken.values()):
        end.close()


def test_what_a_latched_publisher_said_goes_with_it(world: World, name: str) -> None:
    came: list[int] = []
    first, second = (world.backend.publisher(Int32, name, "latched") for _ in range(2))
    first.publish(Int32(data=1))
    second.publish(Int32(data=2))
    first.close()
    heard = world.backend.subscription(Int32, name, "latched", lambda each: came.append(each.data))
    world.until(lambda: came)
    assert came == [2]
    heard.close()
    second.close()


def test_a_message_arrives_as_it_was_when_it_was_published(world: World, name: str) -> None:
    came: list[int] = []
    world.listen(Int32, name, lambda each: came.append(each.data))
    spoken = world.backend.publisher(Int32, name, "default")
    world.until(lambda: spoken.listeners == 1)
    message = Int32()
    for message.data in range(3):
        spoken.publish(message)
    spoken.close()
    world.until(lambda: len(came) == 3)
    assert came == [0, 1, 2], "all of it, though the publisher is gone"


def test_who_is_told_may_publish_in_turn(world: World, name: str) -> None:
    came: list[int] = []
    echo = world.speaker(Int32, f"{name}_echo")
    world.listen(Int32, name, echo.publish)
    for _ in range(2):
        world.listen(Int32, f"{name}_echo", lambda each: came.append(each.data))
    spoken = world.backend.publisher(Int32, name, "default")
    world.until(lambda: spoken.listeners == 1)
    spoken.publish(Int32(data=7))
    world.until(lambda: len(came) == 2)
    assert came == [7, 7]
    spoken.close()


def test_a_listener_that_raises_raises_where_messages_travel(world: World, name: str) -> None:
    def take(_message: Any) -> None:
        raise RuntimeError("a mistake of the listener's")

    heard = world.backend.subscription(Int32, name, "default", take)
    spoken = world.backend.publisher(Int32, name, "default")
    world.until(lambda: spoken.listeners == 1)
    spoken.publish(Int32(data=1))
    with pytest.raises(RuntimeError, match="a mistake of the listener's"):
        world.until(lambda: False)
    heard.close()
    spoken.close()


@pytest.mark.parametrize("given", [None, True, Int32, Float32(data=1.0)])
def test_a_topic_takes_messages_of_its_type_alone(world: World, name: str, given: Any) -> None:
    spoken = world.backend.publisher(Int32, name, "default")
    for each in (spoken, world.speaker(Int32, name)):
        with pytest.raises(TypeError):
            each.publish(given)
    spoken.close()


def test_why_nothing_comes_is_told_of_what_is_published(world: World, name: str) -> None:
    heard = world.backend.subscription(Int32, name, "default", lambda _: None)
    assert heard.why_nobody() == ": nobody publishes on it"
    world.speaker(Int32, f"/elsewhere/{name}")
    there = f": nobody publishes on it; there is /elsewhere/{name} of that type"
    world.until(lambda: heard.why_nobody() == there)
    world.speaker(Int32, name)
    world.until(lambda: not heard.why_nobody())
    heard.close()


def test_why_no_service_is_there_is_told_of_those_that_are(world: World, name: str) -> None:
    service = world.backend.service(SetBool, name)
    assert service.why_nobody() == ": nobody offers it"
    world.serve(SetBool, f"/elsewhere/{name}", switched)
    there = f": nobody offers it; there is /elsewhere/{name} of that type"
    world.until(lambda: service.why_nobody() == there)
    assert not service.ready
    service.close()


@pytest.mark.parametrize("given", [None, True, SetBool.Response, Trigger.Response(), RAISES])
def test_what_a_service_is_to_return_is_its_response_alone(
    world: World, name: str, given: Any
) -> None:
    def answer(_: Any) -> Any:
        if given is RAISES:
            raise RAISES
        return given

    service = world.backend.service(SetBool, name)
    world.serve(SetBool, name, answer)
    world.until(lambda: service.ready)
    call = service.call(SetBool.Request())
    with pytest.raises(type(given) if given is RAISES else TypeError):
        world.until(call.done)
    assert not call.done()
    service.close()


def test_an_answer_is_as_it_was_when_it_was_given(world: World, name: str) -> None:
    answer = SetBool.Response()

    def count(_: Any) -> SetBool.Response:
        answer.message += "."
        return answer

    service = world.backend.service(SetBool, name)
    world.serve(SetBool, name, count)
    world.until(lambda: service.ready)
    calls = []
    for _ in range(2):
        calls.append(service.call(SetBool.Request()))
        world.until(calls[-1].done)
    assert [call.result().message for call in calls] == [".", ".."]
    service.close()


def test_a_service_answers_and_wakes_who_runs_the_tree(
    world: World, name: str, told: list[Any]
) -> None:
    service = world.backend.service(SetBool, name)
    assert service.name == f"{world.namespace}/{name}"
    assert not service.ready
    why = service.why_nobody()
    assert not why or why.startswith(": ")
    world.serve(SetBool, name, switched)
    world.until(lambda: service.ready)
    for data in (True, False):
        del told[:]
        call = service.call(SetBool.Request(data=data))
        assert not call.done()
        world.until(lambda call=call: call.done() and told)
        assert told == [None]
        assert call.result() == SetBool.Response(success=data, message="switched")
    service.close()


@pytest.mark.ros
def test_a_name_that_is_in_use_with_another_type_is_told_with_both(ros: World, name: str) -> None:
    full, backend = f"{ros.namespace}/{name}", ros.backend
    made = [backend.publisher(Int32, name, "default"), backend.service(SetBool, name)]
    with pytest.raises(TwoTypes, match=f"^{full} is used as std_msgs/msg/Bool, and also as"):
        backend.subscription(Bool, name, "default", lambda _: None)
    with pytest.raises(TwoTypes, match=r"/msg/Bool, and also as .*std_msgs/msg/Int32"):
        backend.publisher(Bool, name, "default")
    with pytest.raises(TwoTypes, match=r"/srv/Trigger, and also as .*std_srvs/srv/SetBool"):
        backend.service(Trigger, name)
    for each in made:
        each.close()


def test_an_answer_to_a_call_that_was_dropped_is_no_answer_to_the_next(
    world: World, name: str
) -> None:
    served: list[bool] = []

    def answer(request: Any) -> Any:
        served.append(request.data)
        return switched(request)

    service = world.backend.service(SetBool, name)
    world.serve(SetBool, name, answer)
    world.until(lambda: service.ready)
    dropped = service.call(SetBool.Request(data=True))
    dropped.cancel()
    call = service.call(SetBool.Request(data=False))
    world.until(lambda: call.done() and len(served) == 2)
    assert call.result().success is False
    service.call(SetBool.Request(data=True))
    service.close()
