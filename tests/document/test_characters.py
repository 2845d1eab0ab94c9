"""Characters mean what YAML 1.2 and JSON say, wherever a text comes from, and keep their places."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bt_actions.document import DocumentError, check_source, load_tree, source_of
from bt_actions.document.formatting.format import format_source
from bt_actions.document.language.values import read_data
from bt_actions.document.reading.inputs import parse_input
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.nodes import data_of
from bt_actions.document.yaml.source import Source
from bt_actions.serving.requests import inputs_of
from bt_actions.utilities.plain_text import as_json

FACE = "\N{GRINNING FACE}"
WRITTEN = r"\ud83d\ude00"
"""The same as `json.dumps` writes it."""
SEPARATORS = ["\x85", "\u2028", "\u2029"]


def data(text: str) -> object:
    source = Source("text", text)
    node = compose(source)
    assert node is not None, source.findings
    return data_of(node)


def test_what_json_writes_is_read_wherever_it_is_given(tmp_path: Path) -> None:
    text = json.dumps([FACE])
    assert WRITTEN in text
    for name in ("a.json", "a.yaml"):
        (tmp_path / name).write_text(text)
        assert read_data(tmp_path / name) == [FACE]
        assert parse_input(f"@{tmp_path / name}", "string[]") == [FACE]
    assert parse_input(text, "string[]") == [FACE]
    assert inputs_of(json.dumps({"log": FACE})) == {"log": FACE}
    tree = tmp_path / "tree.yaml"
    tree.write_text(json.dumps({"tree": "t", "root": {"success": FACE}}))
    assert load_tree(tree).name == FACE


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (rf'"a {WRITTEN} b{WRITTEN}{WRITTEN}"', f"a {FACE} b{FACE}{FACE}"),
        (r'"\uD83D\uDE00"', FACE),
        (r'"\\' + WRITTEN + '"', "\\" + FACE),
        (r'"\\ud83d"', r"\ud83d"),
        (f"'{WRITTEN}'", WRITTEN),
        (WRITTEN, WRITTEN),
        (f"|-\n  {WRITTEN}", WRITTEN),
    ],
)
def test_only_in_double_quotes_two_halves_are_one_character(text: str, value: object) -> None:
    assert data(text) == value


@pytest.mark.parametrize("half", [r"\ud83d", r"\ude00", r"\ude00\ud83d", r"\ud83d \ude00"])
def test_half_a_character_is_an_error(half: str) -> None:
    source = Source("text", f'"{half}"')
    assert compose(source) is None
    assert [finding.code for finding in source.findings] == ["BT102"]


@pytest.mark.parametrize("char", SEPARATORS)
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a: b{}c # d", {"a": "b{}c"}),
        ("a: 'b{}c'", {"a": "b{}c"}),
        ('a: "b{}c"', {"a": "b{}c"}),
        ("a: |-\n  b{}c", {"a": "b{}c"}),
        ("a{}c: b", {"a{}c": "b"}),
        ("a: b # d{}  c: d", {"a": "b"}),
    ],
)
def test_what_ended_a_line_in_yaml_1_1_is_content(
    char: str, text: str, value: dict[str, str]
) -> None:
    source = Source("text", text.replace("{}", char))
    node = compose(source)
    assert node is not None
    expected = {key.replace("{}", char): said.replace("{}", char) for key, said in value.items()}
    assert data_of(node) == expected
    assert len(source.lines) == text.count("\n") + 1


def test_places_count_lines_as_an_editor_does() -> None:
    text = (
        "tree: t\nroot: # a\x85b\n  sequence: S\n  children:\n"
        f'    - log: "a\x85b $(x)" # bt\u2028\n    - {{log: "{WRITTEN} $(y)", level: warn}}\n'
    )
    found = check_source(source_of(text.encode(), "t.yaml"))
    assert [(one.message[-2:], one.line, one.column) for one in found] == [
        ("$x", 5, 18),
        ("$y", 6, 28),
    ]
    assert str(found[0]).split("\n")[1:3] == [
        ' 5 |     - log: "a b $(x)" # bt',
        "   |                  ^^",
    ]


@pytest.mark.parametrize(
    ("char", "name"),
    [("\x85", "next line"), ("\u2028", "line separator"), ("\u2029", "paragraph separator")],
)
def test_a_separator_that_nobody_sees_is_named_where_it_is_wrong(char: str, name: str) -> None:
    text = f"tree: t\nroot:\n  sequence: S\n  {char}children: [{{success: A}}]\n"
    (finding,) = check_source(source_of(text.encode(), "t.yaml"))
    assert (finding.code, finding.line, finding.column) == ("BT107", 4, 3)
    assert finding.hint == f"U+{ord(char):04X} ({name}) stands here: type this without it"


def test_formatting_and_ignores_keep_to_the_same_lines() -> None:
    text = (
        "tree: t\nroot:\n  # of\u2028ours\n  retry: R # bt: ignore[BT304] a\x85b\n"
        f'  child: {{log: "a\u2029{WRITTEN}"}}\n'
    )
    assert check_source(source_of(text.encode(), "t.yaml")) == []
    assert format_source(source_of(text.encode(), "t.yaml")) == text


def test_a_line_of_json_is_one_however_lines_are_counted() -> None:
    value = {"a": "".join(SEPARATORS) + FACE + "\v\f\x1c\r\n"}
    line = as_json(value)
    assert line.splitlines() == [line]
    assert FACE in line
    assert json.loads(line) == value


def test_a_code_point_that_unicode_sets_aside_is_no_text() -> None:
    """Such stand for separators while a text is parsed."""
    with pytest.raises(DocumentError, match=r"1:7: error\[BT101\]: the character U\+FDD0"):
        source_of("log: a\ufdd0b\u2028c\n".encode(), "t")
