"""Names and inputs of strangers who mean harm: rejected with a reason that is fit to be shown."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.srv import ControlTree

from bt_actions.serving.catalog import Catalog
from bt_actions.serving.requests import MAX_BYTES, GoalRefused
from bt_actions.utilities.plain_text import clean
from tests.serving.conftest import Serve
from tests.support.tree_client import TreeClient

TREE = """\
tree: go
inputs:
  n: {type: int32, default: 1}
  x: {type: float64, default: 1.0}
  s: {type: string, default: a}
  pose: {type: geometry_msgs/msg/Pose, default: {}}
root: {success: Done}
"""
LONGEST = 1000
NAMES = {
    "empty": "",
    "slash": "/",
    "root": "/etc/passwd",
    "up": "..",
    "up and down": "go/../go",
    "here": "./go",
    "file": "go.yaml",
    "nul": "go\0",
    "newline": "go\n[ERROR] done",
    "escape": "\x1b[2Jgo",
    "look-alike": "g\u043e",
    "full width": "\uff47\uff4f",
    "combining": "go\u0301",
    "no width": "go\u200b",
    "right to left": "\u202eog",
    "surrogate": "go\udcff",
    "replaced": "go\ufffd",
    "blank": "go ",
    "capitals": "GO",
    "pattern": "*",
    "home": "~",
    "format": "{0}%s",
    "long": "x" * 1_000_000,
    "through a link": "linked/secret",
    "a link": "linked",
    "hidden": ".secret",
}
DEEP = 10_000
BOMB = "x: &x [1,1,1,1,1,1,1,1]\n" + "".join(
    f"x{n}: &x{n} [" + ",".join([f"*x{n - 1 or ''}"] * 8) + "]\n" for n in range(1, 9)
)
INPUTS = {
    "lists": "s: " + "[" * DEEP + "]" * DEEP,
    "mappings": "{s: " * DEEP + "1" + "}" * DEEP,
    "JSON": '{"s":' * DEEP + "1" + "}" * DEEP,
    "dashes": "s:\n  " + "- " * DEEP + "1",
    "keys of keys": "? " * DEEP,
    "1e400": "x: 1e400",
    "1e400 for an integer": "n: 1e400",
    "infinite": "x: .inf",
    "no number": "x: .nan",
    "exponent": "x: 1e99999999999999999999",
    "digits": "n: " + "9" * 100_000,
    "digits of a float": "x: " + "9" * 100_000,
    "hexadecimal": "n: 0x" + "f" * 100_000,
    "one too many": "n: 2147483648",
    "bomb": BOMB,
    "holds itself": "s: &x [*x]",
    "tag": "s: !!python/object/apply:os.system ['true']",
    "1 MB": "s: " + "x" * 1_000_000,
    "just too long": "s: " + "x" * MAX_BYTES,
    "keys": "".join(f"k{number}: 1\n" for number in range(20_000)),
    "long key": "? " + "k" * 100_000 + "\n: 1",
    "long field": "pose:\n  ? " + "k" * 100_000 + "\n  : 1",
    "long alias": "s: *" + "a" * 100_000,
    "long tag": "s: !" + "a" * 100_000 + " 1",
    "escape": "s: \x1b[2J",
    "escape in a key": '"a\\nb\\e[2J": 1',
    "escape in a field": 'pose: {"a\\nb\\e[2J": 1}',
    "escape in a value": 'n: "1\\n[ERROR] done\\e[2J"',
    "nul": "s: \0",
    "nul in a text": 's: "\\0"',
    "surrogate": "s: \ud800",
    "written surrogate": 's: "\\ud800"',
    "look-alike": "\uff4e: 1",
    "two documents": "n: 1\n---\nn: 2",
    "UTF-16": "n: 1".encode("utf-16").decode("latin-1"),
}


@pytest.fixture
def catalog(tmp_path: Path) -> Catalog:
    for folder in (tmp_path / "trees", tmp_path / "outside"):
        folder.mkdir()
        (folder / "secret.yaml").write_text(TREE)
    (tmp_path / "trees" / "secret.yaml").rename(tmp_path / "trees" / ".secret.yaml")
    (tmp_path / "trees" / "go.yaml").write_text(TREE)
    (tmp_path / "trees" / "linked").symlink_to(tmp_path / "outside")
    return Catalog([tmp_path / "trees"])


def is_refused_in_a_line(catalog: Catalog, name: str, inputs: str) -> str:
    with pytest.raises(GoalRefused) as raised:
        catalog.check(name, inputs)
    said = raised.value.finding
    assert said.message
    assert len(said.message) <= LONGEST
    assert len(said.place) <= LONGEST
    assert clean(said.message) == said.message
    said.message.encode()
    return said.code


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_hostile_name_is_looked_up_and_refused_in_a_line(catalog: Catalog, name: str) -> None:
    assert is_refused_in_a_line(catalog, name, "") == "UNKNOWN_TREE"


@pytest.mark.parametrize("inputs", INPUTS.values(), ids=INPUTS)
def test_hostile_inputs_are_refused_in_a_line(catalog: Catalog, inputs: str) -> None:
    is_refused_in_a_line(catalog, "go", inputs)


@pytest.mark.parametrize("text", ["@go.yaml", "@linked/secret.yaml", "@../outside/secret.yaml"])
def test_inputs_name_no_file_not_even_one_that_is_linked(catalog: Catalog, text: str) -> None:
    assert catalog.check("go", f"s: '{text}'")[2] == {"s": text}
    assert is_refused_in_a_line(catalog, "go", f"pose: '{text}'") == "INPUTS"


def test_a_file_whose_name_no_message_can_carry_is_no_tree(tmp_path: Path) -> None:
    (tmp_path / "go.yaml").write_text(TREE)
    for name in (b"go\xff.yaml", b"a\nb.yaml", b"\x1b[2J.yaml"):
        Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + name)).write_text(TREE)
    assert [each.name for each in Catalog([tmp_path]).entries()] == ["go"]


def no_utf8() -> str:
    """A text that rclpy sends as bytes that are no UTF-8, as a client in C++ may.

    Python's own texts cannot be that: the bytes of one that nobody else holds are overwritten.
    """
    text = "".join(["n", "o", "n", "e"])
    ctypes.memmove(id(text) + sys.getsizeof("") - 1, b"\xff\xfe\xc3\x28", len(text))
    return text


def test_what_a_server_says_of_strangers_is_one_clean_line_each(
    serve_trees: Serve, client: TreeClient
) -> None:
    server = serve_trees()
    spoofed = "[ERROR] spoofed"
    names = {
        "newline": (f"move\n{spoofed}", "", f"mine\n{spoofed}"),
        "escape": ("\x1b[2Jmove", "", "\x1b[2J"),
        "no UTF-8": (no_utf8(), "", no_utf8()),
        "no UTF-8 in inputs": ("move", no_utf8(), ""),
        "deep": ("move", INPUTS["mappings"], "x" * 100_000),
        "long": ("x" * 100_000, "", ""),
    }
    for tree, inputs, goal_name in names.values():
        assert not client.send(tree, inputs, goal_name).accepted
    sent = client.send("move", "{distance: 1.0}", f"mine\n{spoofed}")
    ours, pause = sent.handle.goal_id, ControlTree.Request.PAUSE
    for asks in (f"me\n{spoofed}", "\x1b[2J", no_utf8(), "x" * 100_000):
        assert client.call(ControlTree, goal_id=ours, command=pause, requested_by=asks).accepted
    client.cancel(sent)
    assert client.result(sent)[0] == GoalStatus.STATUS_CANCELED
    client.until(lambda: len(client.rejections) == len(names), "all rejections are there")
    for told in client.rejections:
        for text in (told.tree, told.goal_name, told.code, told.message):
            assert clean(text) == text
            assert len(text) <= LONGEST + 20
    assert sum("\ufffd" in told.tree for told in client.rejections) == 1
    assert sum("asked for by" in line for line in server.errors) == 4
    assert not any(line.startswith(spoofed) for line in server.errors)
    assert [line for line in server.errors if clean(line) != line or len(line) > LONGEST] == []
