"""Trees by their names: looked up, read again when they changed, and nothing outside is read."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.serving.catalog import Catalog, State
from bt_actions.serving.requests import Refused

TREE = "tree: {name}\ninputs: {{n: {{type: int32, default: 1}}}}\nroot: {{success: Done}}\n"

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a file of trees/, long ago unless `old` is False."""
    (tmp_path / "trees").mkdir()
    times = itertools.count()

    def write(name: str, text: str = "", *, old: bool = True) -> Path:
        path = tmp_path / "trees" / name
        path.write_text(text or TREE.format(name=path.stem))
        if old:
            os.utime(path, (next(times), 1e9 + next(times)))
        return path

    return write


@pytest.fixture
def catalog(tmp_path: Path, write: Write) -> Catalog:
    return Catalog([tmp_path / "trees"])


def refusal(catalog: Catalog, name: str, inputs: str = "") -> tuple[str, str]:
    with pytest.raises(Refused) as raised:
        catalog.check(name, inputs)
    return raised.value.finding.code, raised.value.finding.message


def test_a_tree_is_known_by_the_name_of_its_file(catalog: Catalog, write: Write) -> None:
    write("go.yaml")
    write("stop.yml")
    write("words.yaml", "actions: {}\n")  # for others to import
    write("notes.txt", "no tree")
    assert [(each.name, each.state) for each in catalog.entries()] == [
        ("go", State.OK),
        ("stop", State.OK),
    ]


def test_a_name_that_is_nearly_one_is_answered_with_it(catalog: Catalog, write: Write) -> None:
    write("deliver.yaml")
    assert refusal(catalog, "delivr")[1].endswith("did you mean 'deliver'?")


@pytest.mark.parametrize("inputs", ["{m: 1}", "{n: many}", "{n: 1.5}"])
def test_inputs_are_checked_against_what_the_tree_declares(
    catalog: Catalog, write: Write, inputs: str
) -> None:
    write("go.yaml")
    assert refusal(catalog, "go", inputs)[0] == "INPUTS"
    catalog.check("go", "{n: 2}")


def test_a_tree_that_does_not_check_is_refused_as_check_words_it(
    catalog: Catalog, write: Write
) -> None:
    write("go.yaml", "tree: go\nroot: {sucess: Done}\n")
    code, message = refusal(catalog, "go")
    assert (code, "did you mean 'success'" in message) == ("BT201", True)
    assert catalog.entries()[0].state is State.INVALID


def test_a_file_that_changed_is_read_again_and_else_it_is_not(
    catalog: Catalog, write: Write
) -> None:
    write("go.yaml")
    first = catalog.find("go")
    assert catalog.find("go") is first
    write("go.yaml", TREE.format(name="go").replace("Done", "Gone"))
    second = catalog.find("go")
    assert second is not first
    assert second.digest != first.digest


def test_two_changes_at_one_moment_are_both_seen(catalog: Catalog, write: Write) -> None:
    path = write("go.yaml", old=False)
    catalog.find("go")
    status = path.stat()
    path.write_text(TREE.format(name="go").replace("Done", "Gone"))
    os.utime(path, ns=(status.st_mtime_ns, status.st_mtime_ns))
    tree = catalog.find("go").tree
    assert tree is not None
    assert tree.build().name == "Gone"


def test_what_a_tree_includes_counts_as_its_own(catalog: Catalog, write: Write) -> None:
    write("part.yaml")
    write("go.yaml", "tree: go\nroot: {subtree: part.yaml}\n")
    before = catalog.find("go").digest
    write("part.yaml", TREE.format(name="part").replace("Done", "Other"))
    assert catalog.find("go").digest != before


def test_one_that_no_longer_checks_keeps_its_last_good_version_and_says_so(
    catalog: Catalog, write: Write
) -> None:
    write("go.yaml")
    good = catalog.find("go").tree
    write("go.yaml", "tree: [")
    entry = catalog.find("go")
    assert (entry.state, entry.tree) == (State.KEPT_LAST_GOOD, good)
    assert entry.findings[0].code == "BT102"
    catalog.check("go", "")
    write("go.yaml")
    assert catalog.find("go").state is State.OK


def test_a_tree_that_was_checked_stays_what_it_was(catalog: Catalog, write: Write) -> None:
    path = write("go.yaml")
    _, tree, values = catalog.check("go", "")
    path.unlink()
    assert tree.build(values).name == "Done"
    assert refusal(catalog, "go")[0] == "UNKNOWN_TREE"


@pytest.mark.parametrize(
    "root",
    ["{subtree: ../secret.yaml}", "{subtree: link.yaml}", "{set: {x: '@../secret.yaml'}}"],
)
def test_nothing_outside_of_the_folders_is_read_wherever_links_lead(
    catalog: Catalog, write: Write, tmp_path: Path, root: str
) -> None:
    (tmp_path / "secret.yaml").write_text(TREE.format(name="secret"))
    (tmp_path / "trees" / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    write("go.yaml", f"tree: go\nroot: {root.replace(chr(39), chr(34))}\n")
    code, message = refusal(catalog, "go")
    assert (code, "outside of the folders" in message) == ("BT209", True)
    assert "outside of the folders" in refusal(catalog, "link")[1]


def test_an_import_from_outside_is_refused(catalog: Catalog, write: Write, tmp_path: Path) -> None:
    (tmp_path / "words.yaml").write_text("actions: {}\n")
    write("go.yaml", "tree: go\nimport: [../words.yaml]\nroot: {success: }\n")
    assert "outside of the folders" in refusal(catalog, "go")[1]


def test_python_comes_from_named_packages_only(write: Write, tmp_path: Path) -> None:
    write("go.yaml", "tree: go\nroot: {python: py_trees.behaviours.Success}\n")
    assert refusal(Catalog([tmp_path / "trees"]), "go")[0] == "BT214"
    assert refusal(Catalog([tmp_path / "trees"], python=["other"]), "go")[0] == "BT214"
    Catalog([tmp_path / "trees"], python=["py_trees"]).check("go", "")


class Moody(Behaviour):
    """Cannot be made at first."""

    ready = False

    def __init__(self, name: str) -> None:
        if not Moody.ready:
            raise OSError("no device")
        super().__init__(name)

    def update(self) -> Status:
        return Status.SUCCESS


def test_a_tree_that_could_not_be_built_can_be_built_later(write: Write, tmp_path: Path) -> None:
    write("go.yaml", f"tree: go\nroot: {{python: {__name__}.Moody}}\n")
    _, tree, values = Catalog([tmp_path / "trees"], python=["tests"]).check("go", "")
    for _ in range(2):
        with pytest.raises(ValueError, match="no device"):
            tree.build(values)
    Moody.ready = True
    assert isinstance(tree.build(values), Moody)


def test_a_folder_that_is_none_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(NotADirectoryError):
        Catalog([tmp_path / "nothing"])
