"""Whatever the file holds: findings, in bounded time and memory, and no traceback."""

from __future__ import annotations

import os
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status
from py_trees.trees import BehaviourTree

from bt_actions import render
from bt_actions.document import (
    DocumentError,
    Finding,
    check_file,
    check_source,
    load_tree,
    source_of,
)
from bt_actions.document.describing import nodes_of
from bt_actions.document.reading.inputs import parse_input
from bt_actions.document.reading.workspace import MAX_LEVELS
from bt_actions.document.yaml.source import MAX_BYTES, MAX_ERRORS
from bt_actions.utilities.shorten import MESSAGE
from tests.document.test_wrong_documents import CASES

EMPTY = '""'


def check_bytes(data: bytes) -> list[Finding]:
    try:
        return check_source(source_of(data, "tree.yaml"))
    except DocumentError as error:
        return list(error.findings)


def only(findings: list[Finding]) -> str:
    (finding,) = findings
    return finding.headline()


LONG = "n" * 3000


@pytest.mark.parametrize(
    "text",
    [
        f"tree: {LONG} {LONG}\nroot: {{success: }}\n",
        f"tree: t\nroot: {{{LONG}: x}}\n",
        f"tree: t\ninputs: {{{LONG}: bogus}}\nroot: {{check: ${LONG} > 1}}\n",
        f"tree: t\nroot: {{python: {LONG}.{LONG}, name: x}}\n",
        f"tree: t\nroot: {{subtree: {LONG}.yaml}}\n",
        f"tree: t\nimport: [{LONG}.yaml]\nroot: {{wait: {LONG}}}\n",
        f"tree: t\nactions: {{a: {{type: pkg/action/{LONG}, server: '{LONG} {LONG}'}}}}\n",
        f"tree: t\ninputs: {{{', '.join(f'{LONG[:60]}{n}: int32' for n in range(200))}}}\n",
        f"tree: t\nroot: {{check: $nope, goal: {{{LONG}: 1}}, retry: {LONG}}}\n",
    ],
)
def test_names_of_any_length_leave_what_is_said_of_them_three_lines_long(text: str) -> None:
    findings = check_bytes(text.encode())
    assert findings
    for line in "\n".join(map(str, findings)).splitlines():
        assert len(line) <= MESSAGE + len("  hint: "), line


def test_a_directory_is_no_tree(tmp_path: Path) -> None:
    assert only(check_file(tmp_path)).endswith(
        ":1:1: error[BT100]: this is a directory, not a tree"
    )


def test_a_file_that_is_not_there_is_told_with_what_is_installed() -> None:
    (finding,) = check_file("no_such_tree")
    assert (finding.code, finding.file) == ("BT100", "no_such_tree")
    assert finding.hint is not None
    assert "pick_and_place" in finding.hint


def test_a_name_that_no_file_can_have_is_told_as_any_other() -> None:
    assert only(check_file("x" * 300)).endswith(
        "error[BT100]: this cannot be read: File name too long"
    )


@pytest.mark.parametrize("line", [
    "root: {subtree: NAME}",
    "import: NAME\nroot: {success: }",
])  # fmt: skip
@pytest.mark.parametrize(("name", "told"), [
    ("x" * 300, "x: this cannot be read: File name too long"),
    ("x/" * 3000, "x: this cannot be read: File name too long"),
    ('"a\\0b"', "there is no tree 'a\\x00b' here, and none of that name is installed"),
    ("loop.yaml", "loop.yaml is a link that leads round in a circle"),
    ("round.yaml", "round.yaml is a link that leads round in a circle"),
    ("circle/a.yaml", "circle is a link that leads round in a circle"),
    ("file.yaml/inner", "there is no tree 'file.yaml/inner': there is no folder 'file.yaml'"),
    ("lost.yaml", "lost.yaml is a link to {folder}/gone.yaml, which is not there"),
    ("lost", "lost.yaml is a link to {folder}/gone.yaml, which is not there"),
    (".", ".: this is a directory, not a tree"),
    ("/", "/: this is a directory, not a tree"),
])  # fmt: skip
def test_a_file_that_cannot_be_there_is_told_where_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, name: str, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file.yaml").touch()
    Path("loop.yaml").symlink_to("loop.yaml")
    Path("round.yaml").symlink_to("back.yaml")
    Path("back.yaml").symlink_to("round.yaml")
    Path("circle").symlink_to("circle")
    Path("lost.yaml").symlink_to("first.yaml")
    Path("first.yaml").symlink_to("gone.yaml")
    Path("tree.yaml").write_text(f"tree: t\n{line.replace('NAME', name)}\n", encoding="utf-8")
    (finding,) = check_file("tree.yaml")
    assert finding.code == "BT209"
    assert finding.message.endswith(told.replace("{folder}", str(tmp_path)))


def test_a_device_is_no_tree() -> None:
    assert "this is no regular file" in only(check_file("/dev/zero"))


@pytest.mark.parametrize("path", ["", ".", "/", ".."])
def test_a_path_without_a_name_of_its_own_is_answered_as_any_other(path: str) -> None:
    said = only(check_file(path))
    assert said.startswith(f"{path or EMPTY}:1:1: error[BT100]: ")
    with pytest.raises(DocumentError):
        load_tree(path)


def test_a_pipe_that_nobody_writes_to_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bt_actions.document.yaml.source.PIPE_PATIENCE", 0.05)
    path = tmp_path / "pipe.yaml"
    os.mkfifo(path)
    assert "nobody wrote to this pipe within 0.05 s" in only(check_file(path))


@pytest.mark.parametrize(("line", "told"), [
    ("root: {subtree: pipe.yaml}", "pipe.yaml: this is a pipe, which a tree cannot name"),
    ("root: {subtree: /dev/fd/READER}", "READER: this is a pipe, which a tree cannot name"),
    ("import: pipe.yaml\nroot: {success: }", "pipe.yaml: this is a pipe, which a tree cannot name"),
    (
        "outputs: {x: string}\nroot: {set: {x: '@pipe.yaml'}}",
        "pipe.yaml:1:1: this is a pipe, which a tree cannot name",
    ),
])  # fmt: skip
def test_a_pipe_that_a_tree_names_is_not_waited_for(tmp_path: Path, line: str, told: str) -> None:
    reader, writer = os.pipe()
    os.mkfifo(tmp_path / "pipe.yaml")
    held = os.open(tmp_path / "pipe.yaml", os.O_RDWR)  # a writer who says nothing
    try:
        path = tmp_path / "tree.yaml"
        path.write_text(f"tree: t\n{line.replace('READER', str(reader))}\n", encoding="utf-8")
        (finding,) = check_file(path)
    finally:
        for descriptor in (reader, writer, held):
            os.close(descriptor)
    assert finding.code == "BT209"
    assert finding.message == told.replace("READER", str(reader))


@pytest.mark.parametrize("line", ["root: {subtree: NAME}", "import: NAME\nroot: {success: }"])
@pytest.mark.parametrize("name", ["shadow", "notes.txt", "shadow.yaml.bak"])
def test_of_other_files_a_tree_shows_nothing(tmp_path: Path, line: str, name: str) -> None:
    (tmp_path / name).write_text("root:secret:1\n")
    path = tmp_path / "tree.yaml"
    path.write_text(f"tree: t\n{line.replace('NAME', name)}\n", encoding="utf-8")
    (finding,) = check_file(path)
    assert finding.message == f"{name}: a tree names files that end in .yaml, .yml, .json only"
    assert "secret" not in str(finding)


def test_a_huge_file_is_refused_without_being_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.yaml"
    with path.open("wb") as stream:
        os.truncate(stream.fileno(), 1024**3)  # sparse: takes no room on the disk
    started = time.monotonic()
    tracemalloc.start()
    said = only(check_file(path))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "this is larger than 32 MiB" in said
    assert peak < 4 * MAX_BYTES
    assert time.monotonic() - started < 5


def test_what_is_no_utf_8_is_told_with_its_place() -> None:
    assert only(check_bytes(b"tree: t\nroot: {success: \xff}\n")) == (
        "tree.yaml:2:17: error[BT101]: byte 0xff is no UTF-8"
    )


def test_a_byte_order_mark_is_left_out() -> None:
    assert check_bytes(b"\xef\xbb\xbftree: t\nroot: {success: A}\n") == []


@pytest.mark.parametrize("char", ["\x00", "\x1b", "\ufffe", "\x7f"])
def test_a_control_character_is_told_with_its_place(char: str) -> None:
    text = f"tree: t\nroot: {{success: {char}}}\n"
    assert only(check_bytes(text.encode())).startswith("tree.yaml:2:17: error[BT101]: the char")


@pytest.mark.parametrize(
    "text",
    [
        "[" * 10_000,
        "{a: " * 10_000,
        "".join(" " * depth + "a:\n" for depth in range(3_000)),
        "- " * 10_000,
        "tree: t\nroot: " + "{invert: a, child: " * 10_000,
    ],
    ids=["lists", "mappings", "blocks", "dashes", "nodes"],
)
def test_ten_thousand_levels_of_nesting_are_one_finding(text: str) -> None:
    assert "error[BT105]: nested deeper than 200 levels" in only(check_bytes(text.encode()))


@pytest.mark.parametrize("text", [
    "tree: t\nroot:\n  log: {inner}\n",
    "tree: t\nroot:\n  <<: {inner}\n",
    "a: {inner}\nb: *x2\n",
])  # fmt: skip
def test_aliases_of_aliases_are_no_deeper_than_what_is_written_out(text: str) -> None:
    inner = "[&x0 " + "[" * 90 + "]" * 90
    for n in range(1, 20):
        inner += f", &x{n} " + "[" * 90 + f"*x{n - 1}" + "]" * 90
    said = only(check_bytes(text.replace("{inner}", inner + "]").encode()))
    assert "error[BT105]: nested deeper than 200 levels" in said


def deep_down(levels: int, call: Callable[[], object]) -> object:
    return call() if levels == 0 else deep_down(levels - 1, call)


def write_deep(folder: Path, node: str, levels: int, per_file: int) -> Path:
    """A tree of so many levels, of which each file holds some, and a subtree below them."""
    head, tail = node.split("CHILD")
    number = 0
    while True:
        nodes = min(per_file, levels - 1)
        levels -= nodes + 1
        inner = f"{{subtree: f{number + 1}.yaml}}" if levels else "{running: Wait}"
        text = f"tree: t\nroot: {head * nodes}{inner}{tail * nodes}\n"
        (folder / f"f{number}.yaml").write_text(text, encoding="utf-8")
        number += 1
        if not levels:
            return folder / "f0.yaml"


@pytest.mark.parametrize("per_file", [97, 3])
@pytest.mark.parametrize("node", [
    "{sequence: a, children: [CHILD, {success: }]}",
    "{fallback: a, memory: false, children: [CHILD, {success: }]}",
    "{parallel: a, children: [CHILD]}",
    "{invert: a, child: CHILD}",
    "{run_once: a, child: CHILD}",
    "{for_each: a, in: [1, 2], child: CHILD}",
    "{timeout: a, after: 9 s, child: CHILD}",
    "{retry: a, attempts: 2, child: CHILD}",
])  # fmt: skip
def test_the_deepest_tree_that_is_allowed_runs_and_is_drawn_from_deep_within_a_program(
    tmp_path: Path, node: str, per_file: int
) -> None:
    path = write_deep(tmp_path, node, MAX_LEVELS, per_file)

    def use() -> None:
        assert {finding.severity for finding in check_file(path)} <= {"warning"}
        root = load_tree(path)
        tree = BehaviourTree(root)
        tree.setup()
        tree.tick()
        assert root.status is Status.RUNNING
        assert root.tip() is not None
        assert "Wait" in render.text(nodes_of(root))
        assert "Wait" in render.dot(nodes_of(root))
        root.stop(Status.INVALID)
        tree.shutdown()

    deep_down(100, use)


@pytest.mark.parametrize("per_file", [97, 4])
def test_a_tree_that_is_deeper_with_what_it_includes_is_one_finding(
    tmp_path: Path, per_file: int
) -> None:
    path = write_deep(tmp_path, "{invert: a, child: CHILD}", MAX_LEVELS + 1, per_file)
    assert only(check_file(path)).endswith("the tree unfolds to more than 200 levels of nodes")
    with pytest.raises(DocumentError, match="more than 200 levels"):
        load_tree(path)


def test_a_chain_of_deep_trees_is_checked_without_an_end_of_recursion(tmp_path: Path) -> None:
    path = write_deep(tmp_path, "{invert: a, child: CHILD}", 49 * 198, 197)
    (*_, finding) = check_file(path)
    assert finding.code == "BT105"


def test_a_billion_laughs_are_one_finding() -> None:
    lines = ["a0: &a0 [lol, lol, lol, lol, lol, lol, lol, lol, lol]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    started = time.monotonic()
    assert "error[BT105]: this is, or unfolds to, more than 2,000,000 nodes" in only(
        check_bytes("\n".join(lines).encode())
    )
    assert time.monotonic() - started < 5


@pytest.mark.parametrize(("line", "message"), [
    ("import: NEXT", "more than 100 files inside each other"),
    ("root: {subtree: NEXT}", "more than 50 trees inside each other"),
])  # fmt: skip
def test_a_chain_of_files_without_end_is_one_finding(
    tmp_path: Path, line: str, message: str
) -> None:
    for at in range(600):
        head = "tree: t\n" if "root" in line or at == 0 else "actions: {}\n"
        text = f"{head}{line.replace('NEXT', f'f{at + 1}.yaml')}\n"
        text += "root: {success: }\n" if at == 0 and "root" not in line else ""
        (tmp_path / f"f{at}.yaml").write_text(text, encoding="utf-8")
    (finding,) = check_file(tmp_path / "f0.yaml")
    assert (finding.code, finding.message) == ("BT105", message)


def test_trees_that_unfold_without_bound_are_one_finding(tmp_path: Path) -> None:
    (tmp_path / "t0.yaml").write_text("tree: t0\nroot: {success: A}\n")
    for n in range(1, 9):
        child = f"    - {{subtree: t{n - 1}.yaml}}\n"
        text = f"tree: t{n}\nroot:\n  sequence: S\n  children:\n{child * 9}"
        (tmp_path / f"t{n}.yaml").write_text(text)
    findings = check_file(tmp_path / "t8.yaml")
    assert {finding.code for finding in findings} == {"BT105"}


@pytest.mark.parametrize("line", [
    "    - sucess{0}: A\n",
    "    - {{success: A, nmae{0}: B}}\n",
    "    - check: $variable{0} > 1\n",
    "    - set: {{x{0}: = $y{0} + 1}}\n",
])  # fmt: skip
def test_a_document_full_of_errors_is_answered_in_bounded_time(line: str) -> None:
    body = "".join(line.format(n) for n in range(5_000))
    text = f"tree: t\nroot:\n  sequence: S\n  children:\n{body}"
    started = time.monotonic()
    findings = check_bytes(text.encode())
    assert len(findings) == MAX_ERRORS
    assert max(len(finding.hint or "") for finding in findings) < 300
    assert time.monotonic() - started < 30


def test_after_a_thousand_warnings_an_error_is_told_and_a_thousandth_says_that_there_may_be_more(
    tmp_path: Path,
) -> None:
    head = "tree: t\nroot:\n  sequence: S\n  children:\n"
    warned = head + "    - success: Part #0\n" * (MAX_ERRORS + 10)
    (*warnings, error) = check_bytes(f"{warned}    - sucess: A\n".encode())
    assert {finding.code for finding in warnings} == {"BT116"}
    assert (error.code, error.hint) == ("BT201", None)

    *_, last = check_bytes((head + "    - sucess: A\n" * 2 * MAX_ERRORS).encode())
    assert last.line == 4 + MAX_ERRORS
    assert last.hint == "after 1,000 errors the rest of a file is not checked"

    path = tmp_path / "tree.yaml"
    path.write_text(warned + "    - sucess: A\n" * 2 * MAX_ERRORS, encoding="utf-8")
    with pytest.raises(DocumentError) as caught:
        load_tree(path)
    assert len(caught.value.findings) == MAX_ERRORS


def test_data_with_too_many_errors_is_refused_where_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "data.yaml").write_text("a: 1\n" * 2 * MAX_ERRORS)
    (tmp_path / "tree.yaml").write_text("tree: t\nroot: {set: {x: '@data.yaml'}}\n")
    with pytest.raises(DocumentError, match=r"data\.yaml:2:1: the key 'a' is here twice") as caught:
        load_tree(tmp_path / "tree.yaml")
    assert len(caught.value.findings) == 1


def test_classes_that_fail_when_they_are_made_are_refused_whatever_their_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "failing_thousandfold.py").write_text(
        "import py_trees\n"
        "class Fails(py_trees.behaviours.Success):\n"
        "    def __init__(self, name):\n"
        "        raise RuntimeError('broken')\n"
    )
    nodes = "    - python: failing_thousandfold.Fails\n" * (MAX_ERRORS + 10)
    path = tmp_path / "tree.yaml"
    path.write_text(f"tree: t\nroot:\n  sequence: S\n  children:\n{nodes}")
    with pytest.raises(DocumentError, match="broken") as caught:
        load_tree(path)
    assert len(caught.value.findings) == MAX_ERRORS


def _words(findings: list[Finding]) -> None:
    for finding in findings:
        assert finding.line >= 1
        assert finding.column >= 1
        assert (finding.end_line, finding.end_column) > (finding.line, finding.column)
        assert str(finding)


@settings(deadline=None, max_examples=300)
@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_any_bytes_are_answered_with_findings(data: bytes) -> None:
    _words(check_bytes(data))


_PIECES = st.sampled_from(
    ["tree: t\n", "root:\n", "  sequence: S\n", "  children:\n", "    - success: A\n", "    - ",
     "inputs: {a: float64}\n", "  check: $a > 1\n", "{", "}", "[", "]", ": ", ", ", "&x ", "*x",
     "<<: ", "$", "$a", "= ", "'", '"', "\n", "  ", "#", "!!int ", "| ", "\t", "---\n", "?", "ä",
     "null", "1e999", ".nan", "- - ", "for_each: F\n", "in: [1]\n", "set: {a: 1}\n", "wait: 1 s\n"]
)  # fmt: skip


@settings(deadline=None, max_examples=500)
@given(st.lists(_PIECES, max_size=20).map("".join))
def test_any_pieces_of_trees_are_answered_with_findings(text: str) -> None:
    _words(check_bytes(text.encode()))


@settings(deadline=None, max_examples=500)
@given(st.sampled_from([case.text for case in CASES]), st.floats(0, 1), st.integers(0, 9), _PIECES)
def test_any_document_with_a_piece_in_another_s_place_is_answered_with_findings(
    text: str, where: float, left_out: int, piece: str
) -> None:
    at = int(where * len(text))
    _words(check_bytes((text[:at] + piece + text[at + left_out :]).encode()))


@pytest.mark.parametrize(("head", "each", "tail"), [
    (
        "inputs: {ready: bool}\nroot:\n  sequence: S\n  children:\n",
        "    - {retry: R, child: {check: $ready}}  # bt: ignore[BT304] an operator stops it\n",
        "",
    ),
    ("root: {log: '", "$(x)", "'}\ninputs: {x: {type: int32, default: 1}}\n"),
    ("root:\n  set:\n", "    v{n}: 1\n", ""),
    ("root:\n  sequence: S\n  memory: false\n  children:\n", "    - log: a\n", ""),
    (
        "root:\n  sequence: S\n  memory: false\n  children:\n",
        "    - {action: a, type: a/action/B, server: s, timeout: 1 s}\n",
        "",
    ),
])  # fmt: skip
def test_the_time_for_many_of_one_thing_grows_with_their_number_and_no_faster(
    head: str, each: str, tail: str
) -> None:
    def seconds(count: int) -> float:
        text = (
            f"tree: t\n{head}" + "".join(each.replace("{n}", str(n)) for n in range(count)) + tail
        )
        source = source_of(text.encode(), "tree.yaml")
        started = time.process_time()
        check_source(source, types=False)
        return time.process_time() - started

    assert seconds(8000) < 8 * seconds(2000) + 0.5


def test_a_thousand_errors_in_one_long_text_are_told_in_bounded_time() -> None:
    text = "tree: t\nroot: {log: '" + "nothing is called $(x); " * 8000 + "'}\n"
    started = time.process_time()
    assert len(check_bytes(text.encode())) == MAX_ERRORS
    assert time.process_time() - started < 5


ALIASES = "a0: &a0 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 5)
)
"""Some 110,000 items, once its aliases are unfolded."""


def test_a_value_in_a_file_is_no_larger_than_any_other(tmp_path: Path) -> None:
    (tmp_path / "data.yaml").write_text(ALIASES + f"more: [{', '.join(['*a4'] * 10)}]\n")
    path = tmp_path / "tree.yaml"
    path.write_text("tree: t\nroot: {set: {x: '@data.yaml'}}\n")
    with pytest.raises(DocumentError, match=r"data\.yaml: the value is too large"):
        load_tree(path)
    with pytest.raises(ValueError, match="the value is too large"):
        parse_input(f"@{tmp_path}/data.yaml", "int32[]")


def test_a_number_in_a_file_that_no_float_can_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "data.yaml").write_text("[.inf, 1e999]")
    path = tmp_path / "tree.yaml"
    path.write_text("tree: t\nroot: {set: {x: '@data.yaml'}}\n")
    with pytest.raises(DocumentError, match=r"data\.yaml: 1e999 does not fit a float64"):
        load_tree(path)
