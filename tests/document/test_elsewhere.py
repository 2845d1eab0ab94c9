"""Words and notations of other tools are answered with what is written here."""

from __future__ import annotations

import re

import pytest

from bt_actions.document.findings import elsewhere
from bt_actions.document.language.kinds import KINDS
from tests.document.test_wrong_documents import findings_of

WORDS = {
    "sequence": "Sequence SEQUENCE SequenceWithMemory serial series",
    "sequence' with 'memory: false": "ReactiveSequence reactive_sequence",
    "fallback": "Selector selector Fallback",
    "fallback' with 'memory: false": "ReactiveFallback",
    "parallel": "Parallel ParallelAll concurrent all join",
    "while": "WhileDoElse eternal_guard EternalGuard",
    "invert": "Inverter not",
    "retry": "RetryUntilSuccessful RetryUntilSuccesful retry_until_successful",
    "repeat": "Repeat KeepRunningUntilFailure loop",
    "force_success": "ForceSuccess succeeder",
    "success": "AlwaysSuccess",
    "force_failure": "ForceFailure",
    "failure": "AlwaysFailure",
    "wait": "Delay Sleep sleep delay",
    "subtree": "SubTree include tree call_tree",
    "set": "Script SetBlackboard set_variable assign",
    "check": "ScriptCondition Precondition condition if_condition guard",
    "run_once": "oneshot one_shot OneShot",
    "wait_for_message": "subscribe subscriber topic wait_for_topic",
    "log": "print echo say",
    "service": "call_service call",
    "action": "send_goal action_client",
}
NO_KIND = {
    "Switch Switch2 Switch6 switch": ("fallback", "sequence", "check"),
    "IfThenElse if": ("fallback", "sequence", "check"),
    "RateController rate throttle every": ("repeat", "sequence", "wait"),
    "RecoveryNode recovery recover": ("retry", "fallback", "force_failure"),
    "RoundRobin round_robin": ("fallback", "sequence", "check", "set"),
    "PipelineSequence pipeline": ("parallel", "repeat"),
}


def answer(word: str) -> str:
    """What is said of a node of a kind, behind its name."""
    said, *more = findings_of(f"tree: t\nroot: {{{word}: A}}\n")
    assert f"is called {word!r}; " in said, said
    assert more == []
    return said.partition(f"is called {word!r}; ")[2]


@pytest.mark.parametrize(
    ("word", "kind"), [(word, kind) for kind, words in WORDS.items() for word in words.split()]
)
def test_a_kind_as_others_call_it_is_answered_with_its_name_here(word: str, kind: str) -> None:
    assert re.match(f"(here it is|did you mean) '{kind}'", answer(word))


@pytest.mark.parametrize(
    ("word", "kinds"), [(word, kinds) for words, kinds in NO_KIND.items() for word in words.split()]
)
def test_a_kind_that_there_is_not_is_answered_with_what_to_write(
    word: str, kinds: tuple[str, ...]
) -> None:
    said = answer(word)
    assert said.startswith("write ")
    assert set(kinds) == set(re.findall("'([a-z_]+)'", said))


@pytest.mark.parametrize("said", sorted(set(elsewhere._KINDS.values())))
def test_an_answer_names_kinds_that_there_are(said: str) -> None:
    assert set(re.findall("'([a-z_]+)'", said)) <= set(KINDS)


def test_no_kind_that_there_is_has_another_name_here() -> None:
    assert not {kind.replace("_", "") for kind in KINDS} & set(elsewhere._KINDS)
