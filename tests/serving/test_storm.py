"""A storm over a server of trees: what clients are told, held against the robots' journals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.serving.conftest import MAIN
from tests.support.processes import HostFactory, Process
from tests.support.storm import Storm, write_trees
from tests.support.tree_client import TreeClient

ONE_ARENA = {"MALLOC_ARENA_MAX": "1"}
"""glibc gives threads that get in each other's way an arena each, which grows at first."""


@pytest.fixture
def new_client(domain: int, space: str) -> Iterator[Callable[[], TreeClient]]:
    """Make clients with a participant of their own each."""
    from rclpy.context import Context

    contexts: list[Any] = []

    def make() -> TreeClient:
        contexts.append(Context())
        contexts[-1].init(domain_id=domain)
        return TreeClient(contexts[-1], space)

    yield make
    for each in contexts:
        each.shutdown()


@pytest.mark.timeout(800)
@pytest.mark.parametrize(
    ("seed", "rounds", "kills"),
    [(0, 60, 2), *(pytest.param(seed, 500, 10, marks=pytest.mark.chaos) for seed in range(1, 11))],
)
def test_no_goal_below_one_that_ended_settled_is_live(
    seed: int,
    rounds: int,
    kills: int,
    start_program: Callable[..., Process],
    new_client: Callable[[], TreeClient],
    new_host: HostFactory,
    space: str,
    tmp_path: Path,
) -> None:
    folder = tmp_path / "trees"
    folder.mkdir()
    names = f"{space}/a", f"{space}/b"
    write_trees(folder, *names)

    def start(policy: str) -> Process:
        options = ["--policy", policy, "--python", "tests", "--namespace", space]
        options += ["--max", "3"] if policy in ("queue", "parallel") else []
        command = ["-c", MAIN, "serve", "--trees", str(folder), *options]
        process = start_program(*command, short_lease=True, environment=ONE_ARENA)
        process.line("ready: ", within=60.0)
        return process

    storm = Storm(seed, start, new_client, new_host, names)
    storm.run(rounds, kills)
    wrong = storm.judge()
    print(storm)
    assert not wrong, f"seed {seed}: " + "\n".join([*wrong, str(storm)])
