"""The JSON Schema for editors takes what `check` takes, and refuses what has the wrong form."""

from __future__ import annotations

import json
import re
import textwrap
from pathlib import Path

import jsonschema
import pytest

from bt_actions.cli import main
from bt_actions.document import check_file
from bt_actions.document.findings.rules import RULES
from bt_actions.document.kinds import KINDS
from bt_actions.document.language.keys import ALIAS, INPUT, OUTPUT, TOP_KEYS, TOPIC
from bt_actions.document.language.shapes import required_in
from bt_actions.document.schema import json_schema
from bt_actions.document.yaml.compose import compose
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar
from bt_actions.document.yaml.source import Source

ROOT = Path(__file__).parents[2]
SCHEMA = jsonschema.Draft202012Validator(json_schema())
MODELINE = re.compile(r"# yaml-language-server: \$schema=(\S+?\.json)")
OF_FORM = {"BT106", "BT107", "BT108", "BT109", "BT110", "BT112", "BT113", "BT121"}
"""Rules that a schema can know."""


def data(node: Node | None) -> object:
    """A document as a validator takes it."""
    if isinstance(node, Mapping):
        return {key.text: data(inner) for key, inner in node.pairs}
    if isinstance(node, Listing):
        return [data(item) for item in node.items]
    return node.value if isinstance(node, Scalar) else None


def complaints(text: str) -> list[str]:
    return [error.message for error in SCHEMA.iter_errors(data(compose(Source("t", text))))]


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(json_schema())


def test_each_key_that_must_be_there_has_an_example_of_its_form() -> None:
    tables = [TOP_KEYS, *(kind.keys for kind in KINDS.values())]
    tables += [record.keys for record in (ALIAS, INPUT, OUTPUT, TOPIC)]
    definitions = {"$defs": json_schema()["$defs"]}
    for key in (key for table in tables for key in required_in(table)):
        example = data(compose(Source("example", key.example)))
        schema = definitions | key.shape.schema()
        assert [*jsonschema.Draft202012Validator(schema).iter_errors(example)] == [], key.name


@pytest.mark.parametrize("path", sorted(ROOT.glob("trees/*.yaml")), ids=lambda path: path.stem)
def test_it_takes_the_sample_trees(path: Path) -> None:
    assert complaints(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_it_takes_the_example_of_each_kind(kind: str) -> None:
    assert complaints("tree: t\nroot:\n" + textwrap.indent(KINDS[kind].example, "  ")) == []


@pytest.mark.parametrize(
    "code", sorted(code for code, page in RULES.items() if page.language == "yaml")
)
def test_it_takes_the_right_example_of_each_rule(code: str) -> None:
    assert complaints(RULES[code].right) == []


@pytest.mark.parametrize("code", sorted(OF_FORM))
def test_it_refuses_the_wrong_example_of_each_rule_of_form(code: str) -> None:
    assert complaints(RULES[code].wrong)


def test_the_line_for_editors_is_the_same_in_docs_and_help(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs" / "editors.md").read_text(encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["schema", "--help"])
    for text in (page, capsys.readouterr().out):
        [line] = MODELINE.finditer(text)
        assert f"bt-actions schema > {line[1]}" in text
    assert main(["schema"]) == 0
    (tmp_path / line[1]).write_text(capsys.readouterr().out, encoding="utf-8")
    assert json.loads((tmp_path / line[1]).read_text(encoding="utf-8")) == json_schema()
    tree = tmp_path / "t.yaml"
    tree.write_text(f"{line[0]}\ntree: t\nroot: {{success: Done}}\n", encoding="utf-8")
    assert check_file(tree) == []
