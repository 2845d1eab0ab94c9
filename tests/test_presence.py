"""What is known of one action server, seen from outside."""

from __future__ import annotations

import pytest

from bt_actions.servers.presence import (
    LEASE,
    NO_SECOND_AFTER,
    NOT_READY_FOR,
    PROBE_EVERY,
    SLOWEST_START,
    Server,
    ServerWatch,
)

OLD, NEW, THIRD = b"old", b"new", b"third"


def gids(*which: bytes) -> frozenset[bytes]:
    return frozenset(which)


@pytest.fixture
def watch() -> ServerWatch:
    seen = ServerWatch()
    seen.see(0.0, True, gids(OLD))
    return seen


def crowd(watch: ServerWatch, at: float = 1.0) -> ServerWatch:
    watch.see(at, True, gids(OLD, NEW))
    watch.probe_sent(at, 1)
    return watch


def settle(watch: ServerWatch, at: float = 1.0) -> ServerWatch:
    """Show a dead server and its successor, and let only the successor answer."""
    crowd(watch, at)
    watch.probe_answered(at + 0.1, 1)
    watch.see(at + 0.1 + SLOWEST_START, True, gids(OLD, NEW))
    return watch


def test_nothing_was_seen_yet() -> None:
    assert ServerWatch().state(0.0) is Server.ABSENT
    assert not ServerWatch().wants_probe(0.0)


def test_one_that_is_ready_is_ready(watch: ServerWatch) -> None:
    assert watch.state(0.0) is Server.READY
    assert not watch.wants_probe(0.0), "nothing is open: no traffic"


def test_without_its_services_or_its_status_topic_it_is_absent(watch: ServerWatch) -> None:
    watch.see(1.0, False, gids(OLD))
    assert watch.state(1.0) is Server.ABSENT
    watch.see(2.0, True, gids())
    assert watch.state(2.0) is Server.ABSENT


def test_two_publishers_are_not_yet_two_servers(watch: ServerWatch) -> None:
    assert crowd(watch).state(1.0) is Server.UNCLEAR


def test_two_answers_to_one_probe_are_two_servers(watch: ServerWatch) -> None:
    crowd(watch).probe_answered(1.1, 1)
    assert watch.state(1.1) is Server.UNCLEAR
    watch.probe_answered(1.2, 1)
    assert watch.state(1.2) is Server.AMBIGUOUS


def test_one_answer_and_silence_are_a_dead_server_and_its_successor(watch: ServerWatch) -> None:
    late = 1.0 + SLOWEST_START
    crowd(watch).probe_answered(late, 1)
    watch.see(late + NO_SECOND_AFTER / 2, True, gids(OLD, NEW))
    assert watch.state(late + NO_SECOND_AFTER / 2) is Server.UNCLEAR
    watch.see(late + NO_SECOND_AFTER, True, gids(OLD, NEW))
    assert watch.state(late + NO_SECOND_AFTER) is Server.READY
    assert watch.alone


def test_a_server_that_has_just_come_in_sight_is_given_time_to_answer_too(
    watch: ServerWatch,
) -> None:
    crowd(watch).probe_answered(1.01, 1)
    watch.see(1.0 + SLOWEST_START - 0.1, True, gids(OLD, NEW))
    assert not watch.alone, "the old one answered at once; the new one may be slow"
    watch.probe_answered(1.0 + SLOWEST_START - 0.1, 1)
    assert watch.state(1.0 + SLOWEST_START) is Server.AMBIGUOUS


def test_answers_to_two_probes_are_not_two_answers(watch: ServerWatch) -> None:
    crowd(watch)
    for probe in (1, 2, 3):
        watch.probe_answered(1.0 + 0.1 * probe, probe)
    assert watch.state(1.5) is Server.UNCLEAR


def test_a_second_answer_that_is_late_still_shows_two_servers(watch: ServerWatch) -> None:
    settle(watch).probe_answered(4.0, 1)
    assert watch.state(4.0) is Server.AMBIGUOUS
    watch.see(5.0, True, gids(OLD, NEW))
    assert watch.state(5.0) is Server.AMBIGUOUS, "one answer to another probe changes nothing"


def test_who_answers_is_alone_only_where_a_later_probe_shows_it(watch: ServerWatch) -> None:
    """A server that has just started may be silent for long, and then answer all at once."""
    settle(watch)
    assert watch.alone
    watch.probe_sent(9.0, 2)
    watch.probe_answered(9.0, 2)
    denied_at = 9.5
    assert not watch.alone_since(9.5 + NO_SECOND_AFTER, denied_at), "probe 2 was sent before"
    watch.probe_sent(9.6, 3)
    watch.probe_answered(9.6, 3)
    assert not watch.alone_since(9.6, denied_at), "a second answer may be under way"
    assert watch.alone_since(9.6 + NO_SECOND_AFTER, denied_at)
    watch.probe_answered(9.7 + NO_SECOND_AFTER, 3)
    assert not watch.alone_since(9.9 + NO_SECOND_AFTER, denied_at)


def test_what_is_shown_beyond_the_lease_is_a_server(watch: ServerWatch) -> None:
    assert settle(watch).state(1.0 + LEASE + 0.1) is Server.AMBIGUOUS


def test_when_the_dead_one_is_gone_there_is_one_again(watch: ServerWatch) -> None:
    crowd(watch).see(20.0, True, gids(NEW))
    assert watch.state(20.0) is Server.READY
    assert not watch.alone
    assert not watch.wants_probe(20.0)


def test_it_is_probed_now_and_then_while_the_question_is_open(watch: ServerWatch) -> None:
    crowd(watch)
    assert watch.wants_probe(1.0)
    assert not watch.wants_probe(1.0 + PROBE_EVERY / 2)
    assert watch.wants_probe(1.0 + PROBE_EVERY)


def test_it_is_gone_when_it_is_not_ready_for_a_while_but_not_at_once(watch: ServerWatch) -> None:
    watch.see(1.0, True, gids(OLD))
    watch.see(1.2, False, gids(OLD))
    assert not watch.gone(1.2, gids(OLD))
    late = 1.2 + NOT_READY_FOR
    watch.see(late, False, gids(OLD))
    assert watch.gone(late, gids(OLD))
    watch.see(late + 0.1, True, gids(OLD))
    assert not watch.gone(late + 0.1, gids(OLD))


def test_one_that_is_not_ready_is_asked_and_is_not_gone_while_it_speaks(watch: ServerWatch) -> None:
    watch.see(1.0, False, gids(OLD))
    assert not watch.wants_probe(1.0), "nothing runs there"
    assert watch.wants_probe(1.0, runs=True)
    assert not watch.wants_probe(1.0, runs=True)
    watch.heard_at = 1.5
    assert not watch.gone(1.4 + NOT_READY_FOR, gids(OLD))
    assert watch.gone(1.5 + NOT_READY_FOR, gids(OLD))
    watch.heard_at = 3.0
    assert not watch.gone(1.5 + NOT_READY_FOR, gids(OLD))


def test_a_second_server_that_is_discovered_in_part_does_not_make_the_first_gone(
    watch: ServerWatch,
) -> None:
    """A name is ready only where all services of all its servers are matched."""
    watch.see(1.0, False, gids(OLD, NEW))
    assert not watch.gone(60.0, gids(OLD))
    watch.see(61.0, False, gids(NEW))
    assert watch.gone(61.0, gids(OLD))


def test_a_newcomer_is_a_change_and_a_departure_is_not(watch: ServerWatch) -> None:
    assert not watch.changed(gids(OLD))
    assert crowd(watch).changed(gids(OLD))
    watch.see(2.0, True, gids(NEW))
    assert not watch.changed(gids(OLD, NEW))


def test_after_a_stall_of_ours_answers_have_time_to_come_in(watch: ServerWatch) -> None:
    """One had answered; the other's answer may lie in a socket."""
    crowd(watch).probe_answered(1.1, 1)
    late = 1.0 + SLOWEST_START
    watch.stood_still(late)
    for now in (late, late + 0.9 * NO_SECOND_AFTER):
        watch.see(now, True, gids(OLD, NEW))
        assert watch.state(now) is Server.UNCLEAR
    watch.see(late + NO_SECOND_AFTER, True, gids(OLD, NEW))
    assert watch.state(late + NO_SECOND_AFTER) is Server.READY
