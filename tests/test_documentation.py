"""What the README and the examples show works as it stands there."""

import json
import re
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.processes import Host, HostFactory, Process
from tests.support.waiting import until

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")

Start = Callable[..., Process]


def _block(language: str) -> str:
    blocks = re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 1, f"the README has {len(blocks)} {language} blocks"
    return str(blocks[0])


@pytest.fixture
def server(new_host: HostFactory) -> Host:
    """A process of servers for names without a namespace, as README and examples use them."""
    return new_host()


def test_the_tree_in_the_readme_runs_and_is_as_short_as_promised(
    start_program: Start, tmp_path: Path
) -> None:
    tree = tmp_path / "fetch.yaml"
    tree.write_text(_block("yaml"), encoding="utf-8")
    assert len(_block("yaml").splitlines()) <= 15
    program = start_program("-m", "bt_actions.cli", "run", str(tree), "--sim", "--speed", "10")
    assert program.wait() == 0, program
    assert "The part is in the gripper of the robot" in "\n".join(program.lines), program


def test_the_python_in_the_readme_runs_and_is_as_short_as_promised(
    start_program: Start, server: Host, tmp_path: Path
) -> None:
    code = _block("python")
    assert len(code.splitlines()) <= 20
    server.robot("", speed=10.0)
    script = tmp_path / "fetch.py"
    script.write_text(code, encoding="utf-8")
    program = start_program(str(script))
    assert program.wait(40.0) == 0, program
    assert program.lines[0] == "Status.SUCCESS", program
    assert [line.split()[-3:-1] for line in program.lines[1:]] == [["SUCCEEDED"] * 2] * 5, program


def test_the_example_of_a_server_runs_trees_for_the_example_of_a_client(
    start_program: Start, server: Host
) -> None:
    journal = server.robot("", speed=10.0)
    serving = start_program("examples/tree_server.py")
    serving.line("ready: ")
    client = start_program("examples/tree_client.py", "pick_and_place", "{place_at: 4.5}")
    assert client.wait(60.0) == 0, (client, serving)
    assert json.loads(client.lines[-1])["final_pose"] == pytest.approx(4.5, abs=0.1)
    before = journal.count("accepted")
    waiting = start_program("examples/tree_client.py", "patrol")
    journal.wait_for("accepted", before + 1, within=20.0)
    serving.send(signal.SIGINT)
    assert serving.wait() == 0, serving
    assert waiting.wait() == 1, waiting
    assert waiting.lines[-1].startswith("its server ends"), waiting
    assert "Traceback" not in "\n".join(serving.errors), serving


def test_the_example_of_embedding_delivers_the_part(start_program: Start, server: Host) -> None:
    server.robot("", speed=10.0)
    program = start_program("examples/embed.py")
    assert program.wait(40.0) == 0, program
    assert any(line.startswith("Release: SUCCEEDED, end SUCCEEDED") for line in program.lines)


def test_ctrl_c_in_the_example_cancels_its_goal_on_the_server(
    start_program: Start, server: Host
) -> None:
    robot = server.robot("", speed=0.5)
    program = start_program("examples/embed.py")
    robot.wait_for("accepted", within=20.0)
    program.send(signal.SIGINT)
    assert program.wait() == 1, program
    robot.wait_for("canceled")
    assert "succeeded" not in robot.events()


def test_the_example_of_a_tree_as_an_action_delivers_and_ends_at_a_cancel_request(
    start_program: Start, server: Host
) -> None:
    robot = server.robot("", "3:slow=200", speed=10.0)
    start_program("examples/offer.py")
    goal = ("-m", "bt_actions.cli", "send", "deliver", "MoveRobot")
    sent = start_program(*goal, "distance=5.0")
    assert sent.wait(60.0) == 0, sent
    assert any("the tree ended with SUCCESS" in line for line in sent.lines), sent
    sent = start_program(*goal, "distance=5.0")
    until(lambda: robot.count("accepted") == 3, 40.0)
    sent.send(signal.SIGINT)
    assert sent.wait(20.0) == 130, sent
    assert robot.ends() == ["succeeded", "succeeded", "canceled"]


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def _anchors(page: Path) -> set[str]:
    """The names by which GitHub links to the headings of a page."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_every_link_of_the_pages_leads_somewhere() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for target, anchor in re.findall(r"\]\(([^)#: ]*)(?:#([^) ]*))?\)", text):
            to = page.parent / target if target else page
            assert to.exists(), f"{page.name} names {target}"
            assert not anchor or anchor in _anchors(to), f"{page.name} names {target}#{anchor}"


def test_the_index_leads_to_every_page() -> None:
    index = ROOT / "docs" / "index.md"
    targets = re.findall(r"\]\(([^)#:]+)", index.read_text(encoding="utf-8"))
    named = {(index.parent / target).resolve() for target in targets}
    assert {page for page in PAGES if page != index and page not in named} == set()


def test_the_front_page_stays_short() -> None:
    assert len(README.splitlines()) <= 110
