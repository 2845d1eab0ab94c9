"""`bt-actions runs` and `bt-actions report` over what runs have left."""

from __future__ import annotations

import json
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from py_trees.common import Status

from bt_actions.cli import main
from bt_actions.cli.commands import runs as runs_command
from bt_actions.events import Event, GoalChanged, Moment, RunEnded
from bt_actions.recording import finishing
from bt_actions.recording.finishing import is_finished
from bt_actions.recording.folders import held, home, summary_of
from bt_actions.recording.reading import Recording
from tests.cli.conftest import Start
from tests.support.processes import Process
from tests.support.recordings import bytes_of, record
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.waiting import until

Out = pytest.CaptureFixture[str]


def story_of(tree: str, number: int) -> tuple[Story, FakeNode]:
    """The beginning of run `number`, an hour after the one before it."""
    leaf = FakeAction("Move")
    story = Story(FakeNode(tree, [leaf]))
    at = story.began.at
    began = Moment(1, at.steady, at.wall + 3600 * number, at.ros)
    story.began = replace(story.began, at=began, run_id=f"{number:x}" * 32)
    return story, leaf


def run_of(tree: str, number: int, status: Status) -> Path:
    """Record a run that ends with a status; or was killed, where that is RUNNING."""
    story, leaf = story_of(tree, number)
    events: list[Event] = [story.began]
    events += story.fail(leaf, "a fault") if status is Status.FAILURE else story.succeed(leaf)
    if status is Status.RUNNING:
        return record(events[:3], killed=0.5)
    ends = [story.node(story.root, status), story.finish(status), RunEnded(story._next(), 1)]
    return record([*events, *ends])


@pytest.fixture
def four() -> dict[str, Path]:
    """Runs of two trees."""
    return {
        "went well": run_of("patrol", 1, Status.SUCCESS),
        "failed": run_of("deliver", 2, Status.FAILURE),
        "killed": run_of("deliver", 3, Status.RUNNING),
        "newest": run_of("patrol", 4, Status.SUCCESS),
    }


def columns_of(out: str) -> list[list[str]]:
    return [line.split() for line in out.splitlines()[1:]]


class TestRuns:
    def test_are_listed_the_newest_first(self, four: dict[str, Path], capsys: Out) -> None:
        assert main(["runs"]) == 0
        rows = columns_of(capsys.readouterr().out)
        assert [row[0] for row in rows] == [letter * 8 for letter in "4321"]
        assert [" ".join(row[3:5]) for row in rows] == [
            "patrol SUCCESS",
            "deliver never",
            "deliver FAILURE",
            "patrol SUCCESS",
        ]
        assert rows[2][5:] == ["3.00", "Move:", "ABORTED:", "a", "fault"]

    def test_that_go_on_say_so_and_have_not_failed(
        self, four: dict[str, Path], capsys: Out
    ) -> None:
        with held(four["killed"], alone=True):
            main(["runs"])
            assert "goes on" in capsys.readouterr().out
            main(["runs", "--failed"])
        assert [row[0] for row in columns_of(capsys.readouterr().out)] == ["2" * 8]

    def test_that_failed_or_never_finished_are_chosen(
        self, four: dict[str, Path], capsys: Out
    ) -> None:
        main(["runs", "--failed"])
        assert [row[0] for row in columns_of(capsys.readouterr().out)] == ["3" * 8, "2" * 8]
        main(["runs", "--tree", "patrol"])
        assert [row[0] for row in columns_of(capsys.readouterr().out)] == ["4" * 8, "1" * 8]

    def test_are_an_object_a_line_for_programs(self, four: dict[str, Path], capsys: Out) -> None:
        main(["runs", "--json"])
        data = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert [(each["tree"], each["status"], each["failed"]) for each in data] == [
            ("patrol", "SUCCESS", False),
            ("deliver", None, True),
            ("deliver", "FAILURE", True),
            ("patrol", "SUCCESS", False),
        ]
        assert data[2]["cause"] == "Move: ABORTED: a fault"
        assert data[2]["path"] == str(four["failed"])

    def test_in_a_simulation_are_marked(self, capsys: Out) -> None:
        where = {"host": "robot7", "simulation": "--sim --speed 1"}
        for number in (1, 2):
            story, leaf = story_of("patrol", number)
            story.began = replace(story.began, where=where if number == 2 else {})
            record([story.began, *story.succeed(leaf), story.finish(Status.SUCCESS)])
        main(["runs"])
        rows = columns_of(capsys.readouterr().out)
        assert [row[4:-1] for row in rows] == [["SUCCESS", "in", "sim"], ["SUCCESS"]]
        main(["runs", "--json"])
        data = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert [each["where"] for each in data] == [where, {}]

    def test_fit_into_a_narrow_terminal(
        self, four: dict[str, Path], capsys: Out, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(runs_command, "columns", lambda stream: 60)
        main(["runs"])
        lines = capsys.readouterr().out.splitlines()
        assert max(map(len, lines)) <= 60
        assert "    Move: ABORTED: a fault" in lines

    def test_are_listed_without_a_look_at_their_events(
        self, four: dict[str, Path], capsys: Out
    ) -> None:
        for each in four.values():
            each.write_bytes(b"none")
        main(["runs"])
        assert len(columns_of(capsys.readouterr().out)) == 4

    def test_that_are_not_there_are_a_line_on_standard_error(self, capsys: Out) -> None:
        assert main(["runs", "--json"]) == 0
        told = capsys.readouterr()
        assert told.out == ""
        assert str(home()) in told.err

    def test_of_a_killed_process_are_finished(self, four: dict[str, Path]) -> None:
        assert not is_finished(four["killed"])
        main(["runs"])
        assert is_finished(four["killed"])

    def test_of_killed_processes_are_finished_by_one_where_they_are_large(
        self, four: dict[str, Path], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        killed, begun = [four["killed"], run_of("patrol", 5, Status.RUNNING)], list[list[str]]()
        monkeypatch.setattr(finishing, "AT_ONCE", 0)
        monkeypatch.setattr(
            finishing.subprocess, "Popen", lambda command, **_: begun.append(command)
        )
        main(["runs"])
        [command] = begun
        assert set(map(str, killed)) < set(command)

    def test_are_removed_by_prune_which_says_which(self, capsys: Out) -> None:
        for number in range(22):
            story, leaf = story_of("patrol", number)
            story.began = replace(story.began, run_id=f"{number:032x}")
            record([story.began, *story.succeed(leaf), story.finish(Status.SUCCESS)])
        main(["runs", "prune"])
        told = capsys.readouterr()
        assert len(columns_of(told.out)) == 2
        assert "2 runs removed" in told.err
        assert len(list(home().iterdir())) == 20

    def test_are_all_removed_but_those_that_go_on(self, four: dict[str, Path], capsys: Out) -> None:
        with held(four["killed"], alone=True):
            main(["runs", "prune", "--all"])
        assert [each / "run.mcap" for each in home().iterdir()] == [four["killed"]]

    @pytest.mark.parametrize("words", [["--all"], ["prune", "--failed"], ["prune", "--tree", "x"]])
    def test_are_not_removed_by_words_that_say_something_else(
        self, four: dict[str, Path], words: list[str], capsys: Out
    ) -> None:
        assert main(["runs", *words]) == 2
        assert "prune" in capsys.readouterr().err
        assert len(list(home().iterdir())) == 4


class TestReport:
    @pytest.mark.parametrize(
        ("words", "tree", "letter"),
        [
            ([], "patrol: SUCCESS", "4"),
            (["222"], "deliver: FAILURE", "2"),
            (["deliver"], "deliver: never finished", "3"),
        ],
        ids=["the last", "letters of an id", "the last of a tree"],
    )
    def test_is_of_the_run_that_is_meant(
        self, four: dict[str, Path], words: list[str], tree: str, letter: str, capsys: Out
    ) -> None:
        assert main(["report", *words]) == 0
        out = capsys.readouterr().out
        assert out.startswith(tree)
        assert f"run {letter * 32}" in out

    def test_is_of_a_file_or_of_a_folder(
        self, four: dict[str, Path], tmp_path: Path, capsys: Out
    ) -> None:
        bag = tmp_path / "bag"
        bag.mkdir()
        (bag / "bag_0.mcap").write_bytes(four["failed"].read_bytes())
        for path in (four["failed"], four["failed"].parent, bag, bag / "bag_0.mcap"):
            assert main(["report", str(path)]) == 0
            assert capsys.readouterr().out.startswith("deliver: FAILURE")

    def test_of_the_last_run_begins_with_the_run_that_asked_for_it(self, capsys: Out) -> None:
        above, leaf = story_of("deliver", 1)
        leaf.action = "RunTree"
        node = replace(above.began.nodes[1], action="RunTree")
        above.began = replace(above.began, nodes=(above.began.nodes[0], node))
        failed: list[Event] = [
            replace(each, goal_id="ab" * 16) if isinstance(each, GoalChanged) else each
            for each in above.fail(leaf, "below")
        ]
        record([above.began, *failed, above.node(above.root, Status.FAILURE),
                above.finish(Status.FAILURE)])  # fmt: skip
        below, leaf = story_of("fetch", 2)
        below.began = replace(below.began, request="ab" * 16, caller="1" * 32)
        record([below.began, *below.fail(leaf, "stuck"), below.finish(Status.FAILURE)])
        main(["report"])
        heads = [line for line in capsys.readouterr().out.splitlines() if line[:1].strip()]
        assert heads[0].startswith("deliver: FAILURE")
        assert "below deliver / Move: fetch: FAILURE after 2.00 s" in heads
        main(["runs"])
        rows = capsys.readouterr().out.splitlines()[1:]
        assert ["  below 11111111" in row for row in rows] == [True, False]
        main(["runs", "--json"])
        callers = [json.loads(line)["caller"] for line in capsys.readouterr().out.splitlines()]
        assert callers == ["1" * 32, None]
        main(["report", "fetch"])
        assert capsys.readouterr().out.startswith("fetch: FAILURE")

    def test_as_markdown_and_as_json_tell_the_same(
        self, four: dict[str, Path], tmp_path: Path
    ) -> None:
        for form in ("md", "json"):
            assert main(["report", "222", "-o", str(tmp_path / f"x.{form}")]) == 0
        text = (tmp_path / "x.md").read_text()
        assert text.startswith("# `deliver: FAILURE after 3.00 s`\n")
        (data,) = json.loads((tmp_path / "x.json").read_text())["runs"]
        assert data["status"] == "FAILURE"
        assert data["where"] == {}
        assert "Move: ABORTED: a fault" in text
        assert data["timeline"][-2]["text"] in text
        for line in data["why"]:
            assert line in text

    @pytest.mark.parametrize(
        ("words", "error"),
        [
            (["nobody"], "no recorded run has an id or a tree 'nobody'"),
            (["delivr"], "did you mean 'deliver'?"),
            (["nowhere/run.mcap"], "nowhere/run.mcap is no recording"),
            (["-o", "x.txt"], "the name of a report ends in .md, .json or .html"),
            (["-o", "nowhere/x.md"], "nowhere/x.md cannot be written: No such file"),
        ],
    )
    def test_that_cannot_be_made_is_an_error_in_words(
        self, four: dict[str, Path], words: list[str], error: str, capsys: Out
    ) -> None:
        assert main(["report", *words]) == 2
        told = capsys.readouterr().err
        assert error in told
        assert told.count("\n") == 1

    def test_finishes_what_a_killed_process_left(self, four: dict[str, Path]) -> None:
        assert not is_finished(four["killed"])
        main(["report", "deliver"])
        assert is_finished(four["killed"])

    def test_is_made_where_the_folder_cannot_be_written(
        self, four: dict[str, Path], capsys: Out, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(part: Path) -> None:
            raise PermissionError(13, "Permission denied", str(part))

        monkeypatch.setattr(finishing, "_rewrite", refuse)
        assert main(["report", "deliver"]) == 0
        told = capsys.readouterr()
        assert told.out.startswith("deliver: never finished")
        assert told.err == ""

    def test_changes_no_file_that_no_run_of_ours_wrote(self, four: dict[str, Path]) -> None:
        """A bag that somebody still writes has no end, and no summary beside it."""
        summary_of(four["killed"]).unlink()
        before = four["killed"].read_bytes()
        main(["report", str(four["killed"])])
        assert four["killed"].read_bytes() == before


# Real runs


@pytest.mark.parametrize("name", ["m.mcap", "m.json", "m.1.mcap", "m.12.mcap"])
def test_a_file_of_another_run_is_neither_replaced_nor_mixed_in(
    tmp_path: Path, name: str, capsys: Out
) -> None:
    (tmp_path / name).write_text("mine")
    (tmp_path / "tree.yaml").write_text("tree: mine\nroot:\n  log: done\n")
    assert main(["run", str(tmp_path / "tree.yaml"), "--record", str(tmp_path / "m.mcap")]) == 2
    assert f"{tmp_path / name} exists" in capsys.readouterr().err
    assert (tmp_path / name).read_text() == "mine"


def recordings() -> list[Path]:
    return sorted(home().glob("*/run.mcap"))


def test_a_process_that_is_killed_leaves_what_it_was_doing(start: Start, capsys: Out) -> None:
    process: Process = start("run", "pick_and_place", "--sim", "--speed", "0.2")
    process.line("To the part: executing", within=30.0)

    def reported() -> str:
        main(["report"])
        return capsys.readouterr().out

    waits = "    To the part: executing on /move_robot for "
    said = until(lambda: waits in (told := reported()) and told, 10.0)
    assert said.startswith("pick_and_place: goes on\n")
    process.popen.kill()
    process.popen.wait()
    main(["runs"])
    assert "never finished in sim" in capsys.readouterr().out
    out = reported()
    assert out.startswith("pick_and_place: never finished\n")
    assert "  its process lived until " in out
    assert waits in out
    assert "  in a simulation: --sim --speed 0.2\n" in out
    assert "cleanup" not in out
    (first,) = recordings()
    assert is_finished(first)


SECRET = "hunter2-4711"


def test_a_secret_is_in_no_file_of_a_recording(start: Start, tmp_path: Path, capsys: Out) -> None:
    tree = tmp_path / "door.yaml"
    tree.write_text(
        """\
tree: door
inputs:
  pin: {type: string, secret: true}
  code: {type: string, default: "CODE-é-4712", secret: true, description: of the door}
  word:
    secret: true
    type: string
    default: >
      WORD-4713 and
      WORD-4714
  floor: {type: string}
root:
  sequence: Door
  children:
    - set: {made: = $pin + '!', where: $floor}
    - check: $made == 'nothing'
""",
        encoding="utf-8",
    )
    words = ("--set", f"pin={SECRET}", "--set", "floor=third-0815")
    assert start("run", str(tree), *words).wait(30.0) == 1
    (first,) = recordings()
    kept = list(bytes_of(first.parent))
    assert any(b"third-0815" in each for each in kept)
    for secret in (SECRET, "CODE-", "WORD-"):
        assert not any(secret.encode() in each for each in kept)
    [text] = Recording(first).state().began.sources.values()  # type: ignore[union-attr]
    assert "description: of the door}" in text
    assert len(text.splitlines()) == len(tree.read_text().splitlines())
    main(["report", "-o", str(tmp_path / "x.json"), "--full"])
    main(["report", "-o", str(tmp_path / "x.md"), "--full"])
    for path in (tmp_path / "x.json", tmp_path / "x.md"):
        assert "third-0815" in path.read_text()
        assert SECRET not in path.read_text()


def test_a_machine_may_keep_events_without_values(
    start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = tmp_path / "door.yaml"
    tree.write_text("tree: door\ninputs: {floor: {type: string}}\nroot: {set: {where: $floor}}\n")
    asked = ("run", str(tree), "--set", "floor=third-0815")
    assert start(*asked).wait(30.0) == 0
    [whole] = recordings()
    monkeypatch.setenv("BT_ACTIONS_RECORD", "events")
    assert start(*asked).wait(30.0) == 0
    [bare] = {*recordings()} - {whole}
    assert any(b"third-0815" in each for each in bytes_of(whole.parent))
    assert not any(b"third-0815" in each for each in bytes_of(bare.parent))


def test_a_wrong_word_for_what_a_machine_keeps_is_bad_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Out
) -> None:
    monkeypatch.setenv("BT_ACTIONS_RECORD", "event")
    assert main(["run", "examples/guided.yaml", "--sim"]) == 2
    assert "BT_ACTIONS_RECORD is 'event'; it is one of off, events, all" in capsys.readouterr().err


def test_a_run_that_a_server_of_trees_ran_is_told_below_the_leaf(
    start: Start, tmp_path: Path, namespace: str, capsys: Out
) -> None:
    below = tmp_path / "below"
    below.mkdir()
    (below / "fetch.yaml").write_text(
        "tree: fetch\ninputs: {at: {type: float64}}\nroot: {check: $at > 9.0, name: Far enough}\n"
    )
    tree = tmp_path / "deliver.yaml"
    tree.write_text(
        "tree: deliver\nroot:\n  run_tree: Get it\n  tree: fetch\n"
        f"  server: {namespace}/run_tree\n  inputs: {{at: 3.125}}\n"
    )
    server = start("serve", "--trees", str(below), "--namespace", namespace)
    server.line("ready", within=30.0)
    assert start("run", str(tree)).wait(40.0) == 1
    server.send(signal.SIGINT)
    server.wait(20.0)
    main(["report"])
    heads = [line for line in capsys.readouterr().out.splitlines() if line[:1].strip()]
    assert heads[0].startswith("deliver: FAILURE after ")
    assert [line for line in heads if line.startswith("below Get it: fetch: FAILURE after ")]
    main(["runs", "--failed"])
    rows = columns_of(capsys.readouterr().out)
    assert [row[3] for row in rows] == ["fetch", "deliver"]
    assert (
        " ".join(rows[0][6:]) == f"below {rows[1][0]}: Far enough: $at > 9.0 is false: $at is 3.125"
    )
