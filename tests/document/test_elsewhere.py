"""Words and notations of other tools are answered with what is written here."""

from __future__ import annotations

import re

import pytest

from bt_actions.document.findings import elsewhere
from bt_actions.document.kinds import KINDS


@pytest.mark.parametrize("said", sorted(set(elsewhere._KINDS.values())))
def test_an_answer_names_kinds_that_there_are(said: str) -> None:
    assert set(re.findall("'([a-z_]+)'", said)) <= set(KINDS)


def test_no_kind_that_there_is_has_another_name_here() -> None:
    assert not {kind.replace("_", "") for kind in KINDS} & set(elsewhere._KINDS)
