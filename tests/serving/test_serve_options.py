"""The options of `bt-actions serve`, as parameters too."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter

from bt_actions.cli import main
from bt_actions.cli.arguments.ros_arguments import parameters
from bt_actions.cli.commands.serve import _options
from bt_actions.cli.driving.signals import SAME_WISH
from bt_actions.cli.program import build_parser
from tests.serving.conftest import MAIN, Serve
from tests.support.parameter_dump import dumped
from tests.support.processes import Journal, Process
from tests.support.tree_client import TreeClient
from tests.support.waiting import until

NODE = "bt_actions_serve"
FILE = """\
bt_actions_serve:
  ros__parameters: {{trees: [{folder}], policy: queue, max: 7, managed: true, pick_at: 2.0}}
"""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--max", "3"], "--max is for the policies queue and parallel, and this is reject"),
        (["--policy", "replace", "--ros-args", "-p", "max:=3"],
         "--max is for the policies queue and parallel, and this is replace"),
        (["--trees", "/no/such/folder"], "--trees: /no/such/folder is no folder of trees"),
        (["--ros-args", "-p", "policy:=que"],
         "the parameter 'policy' is 'que', and not reject, queue, replace, parallel"),
        (["--ros-args", "-p", "max:=0"],
         "the parameter 'max' is 0, and not a whole number, 1 to 1000"),
        (["--ros-args", "-p", "trees:=trees"],
         "the parameter 'trees' is 'trees', and not a list of texts"),
        (["--ros-args", "-p", "managed:=1"],
         "the parameter 'managed' is 1, and not true or false"),
        (["--ros-args", "-p", "polcy:=queue"],
         "the parameter 'polcy' is no parameter of bt-actions serve; did you mean 'policy'?"),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("domain")
def test_a_wrong_option_is_bad_input(
    words: list[str], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", *words]) == 2
    assert message in capfd.readouterr().err.splitlines()[-1]


def test_options_are_read_only_parameters_and_the_command_line_wins(
    start_program: Callable[..., Process],
    client: TreeClient,
    folder: Path,
    space: str,
    tmp_path: Path,
) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(FILE.format(folder=folder).replace("bt_actions_serve", f"{space}/{NODE}"))
    command = ["-c", MAIN, "serve", "--max", "5", "--namespace", space]
    server = start_program(*command, "--ros-args", "--params-file", str(path), short_lease=True)
    server.line(f"unconfigured: {space}/{NODE}")
    names = ["trees", "policy", "max", "managed"]

    got = ask(client, GetParameters, "get_parameters", names=names).values
    assert [list(got[0].string_array_value), got[1].string_value, got[2].integer_value,
            got[3].bool_value] == [[str(folder)], "queue", 5, True]  # fmt: skip
    told = ask(client, DescribeParameters, "describe_parameters", names=names)
    assert all(each.read_only and each.description for each in told.descriptors)
    change = [Parameter("max", value=6).to_parameter_msg()]
    answer = ask(client, SetParameters, "set_parameters", parameters=change)
    assert not answer.results[0].successful
    assert any("and not used: pick_at" in line for line in server.errors)


def ask(client: TreeClient, kind: Any, what: str, **fields: object) -> Any:
    """Ask the server of parameters of `serve`."""
    service = client.node.create_client(kind, f"{NODE}/{what}")
    client.until(service.service_is_ready, "the service is there")
    future = service.call_async(kind.Request(**fields))
    client.until(future.done, "the call is answered")
    return future.result()


@pytest.mark.parametrize("policy", ["reject", "queue"])
def test_what_is_dumped_of_its_parameters_can_be_given_back(
    policy: str, serve_trees: Serve, client: TreeClient, folder: Path, space: str, tmp_path: Path
) -> None:
    serve_trees("--policy", policy)
    names = ask(client, ListParameters, "list_parameters", depth=0).result.names
    values = ask(client, GetParameters, "get_parameters", names=names).values
    (told,) = ask(client, DescribeParameters, "describe_parameters", names=["python"]).descriptors
    assert (told.type, values[names.index("python")].type) == (9, 9), "an array of texts"
    file = tmp_path / "dump.yaml"
    file.write_text(dumped(f"{space}/{NODE}", names, values))
    args = build_parser().parse(["serve", "--ros-args", "--params-file", str(file)])
    given = parameters(args.ros_args, NODE, space)
    assert given is not None
    assert not given.unused
    options = _options(args, given.values)
    assert options == {"trees": [str(folder)], "policy": policy, "max": 10, "python": [],
                       "managed": False}  # fmt: skip


@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize("name", ["python", "trees"])
def test_an_empty_list_is_as_if_it_were_not_given(name: str) -> None:
    args = build_parser().parse(["serve", "--ros-args", "-p", f"{name}:=[]"])
    given = parameters(args.ros_args, NODE)
    assert given is not None
    assert _options(args, given.values)["trees"] == ["trees"]


def test_a_rule_for_the_name_of_the_action_is_told_to_have_no_effect(
    serve_trees: Serve, space: str
) -> None:
    server = serve_trees("--ros-args", "-r", "run_tree:=do")
    assert any(f"a rule remaps {space}/run_tree to {space}/do, and has no effect" in line
               for line in server.errors)  # fmt: skip


def test_ready_counts_the_trees_that_can_be_run_and_names_the_others(serve_trees: Serve) -> None:
    server = serve_trees()
    assert server.lines[0].endswith("/run_tree, 2 trees, 1 broken: broken")


def test_ready_counts_the_files_whose_name_another_has_and_names_the_first(
    serve_trees: Serve, folder: Path, tmp_path: Path
) -> None:
    for other in (tmp_path / "b", tmp_path / "c"):
        other.mkdir()
        (other / "move.yaml").write_bytes((folder / "empty.yaml").read_bytes())
    server = serve_trees("--trees", str(tmp_path / "b"), "--trees", str(tmp_path / "c"))
    hidden = f"; 2 not served, as another has the name: {tmp_path}/b/move.yaml and 1 more"
    assert server.lines[0].endswith(hidden)
    assert sum("is served as 'move'" in line for line in server.errors) == 2


def test_a_second_ctrl_c_waits_for_no_goal_and_names_what_may_still_run(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, name: str
) -> None:
    journal = serve("1:ignore_cancel")
    server = serve_trees()
    client.send("move", "{distance: 20.0}")
    journal.wait_for("accepted")
    began = server.send(signal.SIGINT)
    until(
        lambda: server.popen.poll() is not None,
        meanwhile=lambda: time.monotonic() > began + SAME_WISH and server.send(signal.SIGINT),
    )
    assert server.wait() == 3
    assert sum(f"not accounted for: Go on {name}" in line for line in server.errors) == 1, server
