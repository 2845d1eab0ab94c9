"""Trees by their names: looked up, read again when they changed, and nothing outside is read."""

from __future__ import annotations

import itertools
import os
import re
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.document import Tree, open_tree
from bt_actions.serving.catalog import Catalog, FileState
from bt_actions.serving.requests import GoalRefused
from tests.support.waiting import until

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
    with pytest.raises(GoalRefused) as raised:
        catalog.check(name, inputs)
    return raised.value.finding.code, raised.value.finding.message


def test_a_tree_is_known_by_the_name_of_its_file(catalog: Catalog, write: Write) -> None:
    write("go.yaml")
    write("stop.yml")
    write("words.yaml", "actions: {}\n")  # for others to import
    write("notes.txt", "no tree")
    assert [(each.name, each.state) for each in catalog.entries()] == [
        ("go", FileState.OK),
        ("stop", FileState.OK),
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
    assert catalog.entries()[0].state is FileState.INVALID


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
    assert (entry.state, entry.tree) == (FileState.KEPT_LAST_GOOD, good)
    assert entry.findings[0].code == "BT102"
    catalog.check("go", "")
    write("go.yaml")
    assert catalog.find("go").state is FileState.OK


def test_a_tree_that_was_checked_stays_what_it_was(catalog: Catalog, write: Write) -> None:
    path = write("go.yaml")
    _, tree, values = catalog.check("go", "")
    path.unlink()
    assert tree.build(values).name == "Done"
    assert refusal(catalog, "go")[0] == "UNKNOWN_TREE"


NAMING = {
    "subtree": "root: {subtree: FILE}\n",
    "import": "import: [FILE]\nroot: {success: }\n",
    "data": 'root: {set: {x: "@FILE"}}\n',
}
"""How a tree names a file."""
naming = pytest.mark.parametrize("naming", NAMING.values(), ids=NAMING)


@naming
@pytest.mark.parametrize(
    "file", ["../secret.yaml", "linked/../secret.yaml", "{outside}/secret.yaml"]
)
def test_nothing_outside_of_the_folders_is_read(
    catalog: Catalog, write: Write, tmp_path: Path, naming: str, file: str
) -> None:
    for folder in (tmp_path, tmp_path / "outside"):
        (folder / "trees").mkdir(parents=True, exist_ok=True)
        (folder / "secret.yaml").write_text("actions: {}\n")
    (tmp_path / "trees" / "linked").symlink_to(tmp_path / "outside" / "trees")
    file = file.format(outside=tmp_path / "outside")
    write("go.yaml", f"tree: go\n{naming.replace('FILE', file)}")
    code, message = refusal(catalog, "go")
    assert (code, "outside of the folders" in message) == ("BT209", True)


def test_what_comes_with_bt_actions_may_be_named(catalog: Catalog, write: Write) -> None:
    write("go.yaml", "tree: go\nroot: {subtree: pick_and_place}\n")
    catalog.check("go", "")


@pytest.mark.parametrize(
    "root",
    [
        "{subtree: part.yaml}",
        "{subtree: more/part.yaml}",
        "{subtree: more/../part.yaml}",
        "{subtree: linked/part.yaml}",
        "{set: {x: '@points.yaml'}}",
    ],
)
def test_whoever_may_write_to_a_folder_may_link_trees_there(
    catalog: Catalog, write: Write, tmp_path: Path, root: str
) -> None:
    source, trees = tmp_path / "src", tmp_path / "trees"
    source.mkdir()
    (trees / "more").mkdir()
    (source / "go.yaml").write_text(f"tree: go\nimport: words.yaml\nroot: {root}\n")
    (source / "words.yaml").write_text("actions: {}\n")
    (source / "points.yaml").write_text("[1, 2]\n")
    (source / "part.yaml").write_text("tree: part\nroot: {success: }\n")
    for each in source.iterdir():
        (trees / each.name).symlink_to(each)
        (trees / "more" / each.name).symlink_to(each)
    (trees / "linked").symlink_to(source)
    catalog.check("go", "")


def test_a_link_that_leads_elsewhere_now_is_read_again(
    catalog: Catalog, write: Write, tmp_path: Path
) -> None:
    for number in (1, 2):
        release = tmp_path / str(number)
        release.mkdir()
        (release / "go.yaml").write_text(
            f"tree: go\ndescription: '{number}'\nroot: {{success: }}\n"
        )
        os.utime(release / "go.yaml", (number, number))
        link = tmp_path / "trees" / "go.yaml"
        link.unlink(missing_ok=True)
        link.symlink_to(release / "go.yaml")
        tree = catalog.find("go").tree
        assert tree is not None
        assert tree.description == str(number)


def test_a_link_to_nowhere_is_one_broken_tree(
    catalog: Catalog, write: Write, tmp_path: Path
) -> None:
    write("go.yaml")
    (tmp_path / "trees" / "gone.yaml").symlink_to(tmp_path / "nowhere.yaml")
    told = {each.name: each.findings for each in catalog.entries()}
    assert told.keys() == {"go", "gone"}
    assert not told["go"]
    assert (
        f"is a link to {tmp_path / 'nowhere.yaml'}, which is not there" in told["gone"][0].message
    )


def test_files_that_begin_with_a_dot_are_not_looked_at(catalog: Catalog, write: Write) -> None:
    write("go.yaml")
    write(".go.yaml")
    (catalog.folders[0] / ".#go.yaml").symlink_to("op@cell3.2211:1790000000")
    assert [each.name for each in catalog.entries()] == ["go"]
    assert refusal(catalog, ".go")[0] == "UNKNOWN_TREE"


def test_of_two_files_of_one_name_the_first_is_served_and_names_the_other(
    catalog: Catalog, write: Write, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    other.mkdir()
    first, beside = write("go.yaml"), write("go.yml")
    elsewhere = other / "go.yaml"
    elsewhere.write_text("tree: go\nroot: {failure: }\n")
    (entry,) = Catalog([tmp_path / "trees", other]).entries()
    assert (entry.file, entry.hides) == (first, (beside, elsewhere))
    write("go.yaml", "actions: {}\n")
    (entry,) = Catalog([tmp_path / "trees", other]).entries()
    assert (entry.file, entry.hides) == (beside, (elsewhere,)), "a file without a tree hides none"


def test_one_file_by_two_paths_hides_nothing(write: Write, tmp_path: Path) -> None:
    folder = tmp_path / "trees"
    first = write("go.yaml")
    (folder / "go.yml").symlink_to("go.yaml")
    (tmp_path / "linked").symlink_to("trees")
    twice = [folder, folder, tmp_path / "linked", folder / ".." / "trees"]
    (entry,) = Catalog(twice).entries()
    assert (entry.file, entry.hides) == (first, ())


@pytest.fixture(params=["pipe", "socket", "folder", "device"])
def no_file(request: pytest.FixtureRequest, tmp_path: Path, write: Write) -> Path:
    """Something among the trees that is none, and nobody writes to."""
    path = tmp_path / "trees" / "other.yaml"
    if request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "socket":
        socket.socket(socket.AF_UNIX).bind(str(path))
    elif request.param == "folder":
        path.mkdir()
    else:
        path.symlink_to("/dev/zero")
    return path


def test_what_is_no_file_is_one_broken_tree_at_once(
    catalog: Catalog, write: Write, no_file: Path
) -> None:
    write("go.yaml")
    told = {each.name: each.findings for each in catalog.entries()}
    assert told.keys() == {"go", "other"}
    assert not told["go"]
    assert told["other"][0].code == "BT100"
    assert "this is " in told["other"][0].message


@naming
def test_what_is_no_file_breaks_the_tree_that_names_it(
    catalog: Catalog, write: Write, no_file: Path, naming: str
) -> None:
    write("go.yaml", f"tree: go\n{naming.replace('FILE', no_file.name)}")
    code, message = refusal(catalog, "go")
    assert code == "BT209"
    assert re.match("other.yaml(:1:1)?: this is ", message)


class Mount:
    """A disk that can be stuck."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.answers = threading.Event()
        self.stuck: set[str] = set()
        self.reads: list[str] = []

        def read(path: Path, **options: Any) -> Tree:
            self.reads.append(path.name)
            if path.name in self.stuck:
                self.answers.wait()
            return open_tree(path, **options)

        patch.setattr("bt_actions.serving.catalog.open_tree", read)
        patch.setattr("bt_actions.serving.catalog.AT_START", 0.2)
        patch.setattr("bt_actions.serving.catalog.PATIENCE", 0.2)


@pytest.fixture
def mount(monkeypatch: pytest.MonkeyPatch) -> Iterator[Mount]:
    mount = Mount(monkeypatch)
    yield mount
    mount.answers.set()


def test_a_file_that_cannot_be_read_soon_is_one_broken_tree_until_it_has_been_read(
    mount: Mount, write: Write, tmp_path: Path
) -> None:
    for name in ("a", "go", "z"):
        write(f"{name}.yaml")
    mount.stuck = {"go.yaml"}
    catalog = Catalog([tmp_path / "trees"])
    for _ in range(2):
        assert {each.name: each.state for each in catalog.entries()} == {
            "a": FileState.OK, "go": FileState.INVALID, "z": FileState.OK,
        }  # fmt: skip
    code, message = refusal(catalog, "go")
    assert (code, "cannot be read" in message) == ("BT100", True)
    assert mount.reads.count("go.yaml") == 1, "it is not begun again meanwhile"
    mount.answers.set()
    until(lambda: catalog.find("go").state is FileState.OK)


def test_where_a_file_cannot_be_read_soon_the_last_good_version_is_kept(
    mount: Mount, write: Write, tmp_path: Path
) -> None:
    write("go.yaml")
    catalog = Catalog([tmp_path / "trees"])
    good = catalog.find("go").tree
    write("go.yaml")
    mount.stuck = {"go.yaml"}
    entry = catalog.find("go")
    assert (entry.state, entry.tree) == (FileState.KEPT_LAST_GOOD, good)
    mount.answers.set()
    until(lambda: catalog.find("go").state is FileState.OK)


def test_a_folder_that_does_not_answer_holds_up_no_other(
    monkeypatch: pytest.MonkeyPatch, mount: Mount, write: Write, tmp_path: Path
) -> None:
    write("go.yaml")
    (tmp_path / "far").mkdir()
    catalog = Catalog([tmp_path / "far", tmp_path / "trees"])
    resolve, iterdir = Path.resolve, Path.iterdir

    def stuck(call: Callable[..., Any]) -> Callable[..., Any]:
        def called(path: Path, *arguments: Any, **options: Any) -> Any:
            if path.name == "far":
                mount.answers.wait()
            return call(path, *arguments, **options)

        return called

    monkeypatch.setattr(Path, "resolve", stuck(resolve))
    monkeypatch.setattr(Path, "iterdir", stuck(iterdir))
    assert catalog.find("go").state is FileState.OK


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
