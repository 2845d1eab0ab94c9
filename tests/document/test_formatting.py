"""Canonical form: what moves, what stays, and that the meaning never changes."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_actions.document import DocumentError, source_of
from bt_actions.document.findings.rules import RULES
from bt_actions.document.formatting.format import FormatError, format_source
from tests.document.test_wrong_documents import CASES

TREES = Path(__file__).parents[2] / "trees"


def formatted(text: str) -> str:
    return format_source(source_of(text.encode(), "tree.yaml"))


def squeezed(text: str) -> str:
    """Canonical form with two spaces before each comment, whatever its column was."""
    return re.sub(r"(?<=\S) +# ", "  # ", formatted(text))


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


@pytest.mark.parametrize("code", sorted(code for code in RULES if RULES[code].language == "yaml"))
def test_formatting_twice_changes_nothing_more(code: str) -> None:
    once = formatted(RULES[code].right)
    assert formatted(once) == once


def test_anchors_and_aliases_stay_where_they_are() -> None:
    text = """\
    root: &all # c1
      children:
        - &a {log: hi, level: info}   # one
        - *a  # two
        - &b
          log: x  # c
        - set: {a: &x 1, b: *x , c: [*x]}
      sequence: S
    tree: t
    """
    assert squeezed(textwrap.dedent(text)) == textwrap.dedent(
        """\
        tree: t
        root: &all  # c1
          sequence: S
          children:
            - &a {log: hi, level: info}  # one
            - *a  # two
            - &b
              log: x  # c
            - set: {a: &x 1, b: *x , c: [*x]}
        """
    )


def test_texts_over_several_lines_and_braces_with_comments_keep_their_lines() -> None:
    text = """\
    tree: t
    root:
        set: {
          a: 1,  # one
          # alone
          b: [2,
              3]  # two
          }  # end
        name: 'one
          # two
      three'   # c
        x: "one\\
     two\\\x20

          three"
        y: |+  # keep
            a\x20\x20
             # text


        z: plain
         text  # c
    """
    text = textwrap.dedent(text.replace("\\x20", " "))
    assert squeezed(text) == textwrap.dedent(
        """\
        tree: t
        root:
          set: {
            a: 1,  # one
            # alone
            b: [2,
                3]  # two
            }  # end
          name: 'one
            # two
            three'  # c
          x: "one\\
            two\\\x20

            three"
          y: |+  # keep
            a\x20\x20
             # text


          z: plain
            text  # c
        """.replace("\\x20", " ")
    )


def test_an_ignore_stays_above_the_line_that_it_silences() -> None:
    text = """\
    # bt: ignore[BT301] not yet

    inputs: {a: int32}
    tree: t
    root:
      children:
        - log: a
          # bt: ignore[BT310] however it is indented
        - save: {x: result.final_pose}
          move: A

        # of the item
        # bt: ignore[BT310] the operator reads it,
        # on the screen
        - save: {y: result.final_pose}
          # of the goal
          goal: {distance: 1}
          move: B
        # bt: ignore[BT302] not moved
        - move: C
          # bt: ignore[BT310] inside
          save: {z: result.final_pose}
      sequence: S
    """
    assert formatted(textwrap.dedent(text)) == textwrap.dedent(
        """\
        tree: t
        # bt: ignore[BT301] not yet

        inputs: {a: int32}
        root:
          sequence: S
          children:
            - log: a
            - move: A
              # bt: ignore[BT310] however it is indented
              save: {x: result.final_pose}

            # of the item
            - move: B
              # of the goal
              goal: {distance: 1}
              # bt: ignore[BT310] the operator reads it,
              # on the screen
              save: {y: result.final_pose}
            # bt: ignore[BT302] not moved
            - move: C
              # bt: ignore[BT310] inside
              save: {z: result.final_pose}
        """
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("tree: &n N\nroot:\n  name: &n N\n  log: a\n", "the anchor &n names 2 things"),
        ("tree: t\nroot:\n  name: &n N\n  log: *n\n", "an alias would come before what it repeats"),
        ("tree: t\nroot:\n  set: {a: &x b, *x : 1}\n", "line 3: an alias stands for a key"),
        ("&x\ntree: t\nroot: {success: }\n", "line 1: an anchor names the whole document"),
        ("tree: t\nroot:\n  log: |2\n    a\n", "line 3: a block text that gives its own indentat"),
        (
            "--- # c\ntree: t\nroot: {success: A}\n",
            "line 1: a comment that has no place of its own",
        ),
        ("[a]\n", "this is not a tree"),
    ],
)
def test_what_cannot_be_kept_is_refused_for_its_true_reason(text: str, reason: str) -> None:
    with pytest.raises(FormatError, match=re.escape(reason)):
        formatted(text)


def test_what_is_no_yaml_is_answered_as_the_checker_does() -> None:
    with pytest.raises(DocumentError, match="BT102"):
        formatted("tree: [\n")


_LINES = st.sampled_from(
    [line for case in CASES for line in case.text.splitlines()]
    + ["# a comment", "", "    # deeper", "  x: |", "    text # no comment", "  - a: 1 # why"]
    + ["  - # c", "  -", "    - - b", "  y: &a {b: 1, # c", "    c: 2} # d", "  z: *a", "  - *a"]
    + ["    # - in", "  w: 'a", "    b' # c", "  v: # e", "    plain", "  u: >+", "  -   # d"]
)


@settings(deadline=None, max_examples=300)
@given(st.lists(_LINES, max_size=12).map("\n".join))
def test_any_text_is_formatted_without_a_loss_or_refused(text: str) -> None:
    try:
        once = formatted(text)
    except (FormatError, DocumentError):
        return
    assert formatted(once) == once
