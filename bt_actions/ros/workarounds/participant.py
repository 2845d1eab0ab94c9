"""The end of a context of our own, with the last of its nodes, so that Fast DDS does not hang.

rmw_fastrtps takes its listener off a participant before it destroys the participant, and Fast DDS
waits without a limit for the listener's present call. Where condition variables know no steady
clock, as in the wheels, that wait is a loop which holds the lock that the listener needs: the wait
never ends, and rclpy holds Python's lock meanwhile (the mechanism: Fast DDS #6513; measured: once
in 4,000 participants that were closed while they discovered 80 robots). The same call with a limit
waits in good order, so it is made here before. Not needed any more where libfastrtps imports
pthread_cond_clockwait.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
from typing import Any

from rclpy.node import Node

LIMIT = 5
"""Seconds for the listener's present call, which takes well under a millisecond."""
_PARTICIPANT_OF = "_ZN16rmw_fastrtps_cpp22get_domain_participantEP10rmw_node_s"
"""rmw_fastrtps_cpp::get_domain_participant(rmw_node_t *)"""
_SET_LISTENER = (
    "_ZN8eprosima7fastdds3dds17DomainParticipant12set_listener"
    "EPNS1_25DomainParticipantListenerENSt6chrono8durationIlSt5ratioILl1ELl1EEEE"
)
"""DomainParticipant::set_listener(DomainParticipantListener *, std::chrono::seconds)"""


def close(node: Node) -> None:
    """Destroy the node, which is the last of its context, and shut the context down.

    Other nodes of the context, if there are any, learn nothing new from here on.
    """
    fall_silent(node)
    node.destroy_node()
    with contextlib.suppress(RuntimeError):
        node.context.try_shutdown()


def fall_silent(node: Node) -> bool:
    """Stop the discovery of a node's participant; return whether that was possible."""
    try:
        rmw_node_of, participant_of, set_listener = _functions()
        with node.handle:
            participant = participant_of(rmw_node_of(node.handle.pointer))
            return participant is not None and set_listener(participant, None, LIMIT) == 0
    except Exception:  # noqa: BLE001 - it was destroyed; or of another middleware, or release of it
        return False


@functools.cache
def _functions() -> tuple[Any, Any, Any]:
    """Return functions from an rcl_node_t to its participant, and to take the listener off that."""
    loaded = os.RTLD_NOLOAD | os.RTLD_LAZY
    rmw_node_of = ctypes.CDLL("librcl.so", mode=loaded).rcl_node_get_rmw_handle
    rmw = ctypes.CDLL("librmw_fastrtps_cpp.so", mode=loaded)
    participant_of, set_listener = rmw[_PARTICIPANT_OF], rmw[_SET_LISTENER]
    for function in (rmw_node_of, participant_of):
        function.argtypes, function.restype = (ctypes.c_void_p,), ctypes.c_void_p
    set_listener.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
    set_listener.restype = ctypes.c_uint32
    return rmw_node_of, participant_of, set_listener
