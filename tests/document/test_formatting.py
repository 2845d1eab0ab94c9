"""Canonical form: what moves, what stays, and that the meaning never changes."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_actions.document import DocumentError, source_of
from bt_actions.document.formatting import FormatError, format_source
from bt_actions.document.pages import PAGES
from tests.document.test_wrong_documents import CASES

TREES = Path(__file__).parents[2] / "trees"


def formatted(text: str) -> str:
    return format_source(source_of(text.encode(), "tree.yaml"))


def test_the_kind_comes_first_and_comments_stay_with_what_they_are_about() -> None:
    text = """\
    # the head

    root:   # the root
        children:
            # first
            - goal:  {position:  100.0}   # a goal
              # before the kind
              gripper: Open
            -   check: $a  >   1   # cond


            # second
            - children: [ {name: X, success: }, {failure: Y} ]
              sequence: "a # b"
            - log: |
                  hello # no comment
                    world
              # end of log
            - timeout: T
              child:
                 wait: 3
              after: 5 s
        # late
        fallback: Deliver
    inputs: {a: int32}
    tree: t
    # tail
    """
    assert formatted(textwrap.dedent(text)) == textwrap.dedent(
        """\
        # the head

        tree: t
        inputs: {a: int32}
        root:   # the root
          # late
          fallback: Deliver
          children:
            # first
            # before the kind
            - gripper: Open
              goal: {position: 100.0}         # a goal
            - check: $a  >   1         # cond

            # second
            - sequence: "a # b"
              children: [{success: , name: X}, {failure: Y}]
            - log: |
                hello # no comment
                  world
            # end of log
            - timeout: T
              after: 5 s
              child:
                wait: 3
        # tail
        """
    )


def test_what_is_no_node_has_its_keys_in_the_model_s_order_and_data_stays_as_it_is() -> None:
    text = """\
    tree: t
    inputs: {a: {default: 1, type: int32}}
    actions:
      move:
        timeout: {result: 3 s, server: 1 s}
        server: move_robot
        type: a/action/B
      grip: {retry: 2, server: g, type: a/action/B}
    defaults: {retry: 2, timeout: 3 s}
    root:
      move: A
      retry: 2
      goal: {x: 1, wait: 3, a: {server: s, type: t}}
      timeout: 3 s
    """
    assert formatted(textwrap.dedent(text)) == textwrap.dedent(
        """\
        tree: t
        inputs: {a: {type: int32, default: 1}}
        actions:
          move:
            type: a/action/B
            server: move_robot
            timeout: {server: 1 s, result: 3 s}
          grip: {type: a/action/B, server: g, retry: 2}
        defaults: {timeout: 3 s, retry: 2}
        root:
          move: A
          goal: {x: 1, wait: 3, a: {server: s, type: t}}
          timeout: 3 s
          retry: 2
        """
    )


@pytest.mark.parametrize("path", sorted(TREES.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_sample_trees_are_in_canonical_form(path: Path) -> None:
    assert formatted(path.read_text(encoding="utf-8")) == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("code", sorted(code for code in PAGES if PAGES[code].language == "yaml"))
def test_formatting_twice_changes_nothing_more(code: str) -> None:
    once = formatted(PAGES[code].right)
    assert formatted(once) == once


def test_anchors_are_refused_rather_than_lost() -> None:
    with pytest.raises(FormatError, match="anchors"):
        formatted("tree: t\nroot: &here\n  success: A\n")


def test_what_is_no_yaml_is_answered_as_the_checker_does() -> None:
    with pytest.raises(DocumentError, match="BT102"):
        formatted("tree: [\n")


_LINES = st.sampled_from(
    [line for case in CASES for line in case.text.splitlines()]
    + ["# a comment", "", "    # deeper", "  x: |", "    text # no comment", "  - a: 1 # why"]
)


@settings(deadline=None, max_examples=300)
@given(st.lists(_LINES, max_size=12).map("\n".join))
def test_any_text_is_formatted_without_a_loss_or_refused(text: str) -> None:
    try:
        once = formatted(text)
    except (FormatError, DocumentError):
        return
    assert formatted(once) == once
