"""`bt-actions interfaces build|show|list`: message packages of one's own, and installed ones."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.cli.exits import BadInput, Exit
from bt_actions.cli.streams.writing import columns, note, write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  bt-actions interfaces build my_msgs
  bt-actions interfaces build src/my_msgs src/other_msgs -o wheels
  bt-actions interfaces show MoveRobot
  bt-actions interfaces list my_msgs
"""
_BUILD = """\
examples:
  bt-actions interfaces build my_msgs
  bt-actions interfaces build navigation2/nav2_msgs geographic_info/geographic_msgs
  bt-actions interfaces build src/my_msgs src/other_msgs -o wheels

A package is a folder with package.xml, CMakeLists.txt, and action/, srv/ or msg/. Packages beside
it that it uses are built with it. The first call downloads its tools, into the user's cache. Where
ROS 2 is installed, colcon builds the same folder. Exit codes: 0, or 2 where a package cannot be
built or installed; nothing is installed then.
"""
_SHOW = """\
examples:
  bt-actions interfaces show robot_control_interfaces/action/MoveRobot
  bt-actions interfaces show PoseStamped --all-comments
"""
_LIST = """\
examples:
  bt-actions interfaces list
  bt-actions interfaces list geometry_msgs nav_msgs
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser, and those of the commands below it."""
    parser = subparsers.add_parser(
        "interfaces",
        help="build message packages of your own, and show types",
        description="Build message packages without a ROS installation, and show types.",
        epilog=_EPILOG,
    )
    below = parser.add_subparsers(title="commands", dest="action", metavar="COMMAND", required=True)
    build = below.add_parser(
        "build",
        help="build message packages and install them here",
        description="Generate message packages with rosidl, and install a wheel of each into this "
        "environment.",
        epilog=_BUILD,
    )
    build.add_argument("paths", metavar="PATH", nargs="+", type=Path, help="folder of a package")
    build.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="only write the wheels, into this folder"
    )
    build.add_argument(
        "--no-network",
        dest="network",
        action="store_false",
        help="fail where something would have to be downloaded",
    )
    show = below.add_parser(
        "show",
        help="print the fields of a type",
        description="Print the fields of an action, service or message, with comments, constants "
        "and defaults.",
        epilog=_SHOW,
    )
    show.add_argument("type", metavar="TYPE", help="such as MoveRobot, or pkg/action/MoveRobot")
    show.add_argument(
        "--all-comments", action="store_true", help="with the comments of messages in it, too"
    )
    listing = below.add_parser(
        "list",
        help="list the installed types",
        description="List the actions, services and messages that are installed.",
        epilog=_LIST,
    )
    listing.add_argument(
        "packages", metavar="PACKAGE", nargs="*", help="only types of this package"
    )


def run(args: argparse.Namespace) -> int:
    """Build, show or list."""
    if args.action == "build":
        from bt_actions.packages import PackageError

        try:
            _build(args)
        except (PackageError, OSError) as error:  # a folder that cannot be written, a full disk
            raise BadInput(f"interfaces build: {error}") from error
        return Exit.SUCCESS
    from bt_actions.messages.definition import all_interfaces, definition
    from bt_actions.messages.interfaces import UnknownInterface, full_name

    if args.action == "show":
        try:
            name = full_name(args.type, all_interfaces(), "type")
            lines = list(definition(name, all_comments=args.all_comments))
        except UnknownInterface as error:
            raise BadInput(str(error)) from error
        write("".join(f"{line}\n" for line in lines))
        return Exit.SUCCESS
    names = all_interfaces()
    for package in args.packages:
        if not any(name.startswith(f"{package}/") for name in names):
            raise BadInput(f"no package {package!r} with interfaces is installed")
    wanted = tuple(f"{package}/" for package in args.packages) or ("",)
    write("".join(f"{name}\n" for name in names if name.startswith(wanted)))
    return Exit.SUCCESS


def _build(args: argparse.Namespace) -> None:
    from bt_actions.packages import installing
    from bt_actions.packages.building import build_wheels
    from bt_actions.packages.environment import build_environment, check_compilers, own_prefix
    from bt_actions.packages.order import in_order

    began = time.monotonic()
    if args.output is not None:
        args.output.mkdir(parents=True, exist_ok=True)
    sources = in_order(args.paths, [own_prefix()])
    if args.output is None:
        installing.check_names(sources)
    check_compilers()
    tools = build_environment(note, network=args.network)
    note(f"building {', '.join(map(str, sources))}")
    with tempfile.TemporaryDirectory(prefix="bt_actions-wheels-") as kept, _progress() as show:
        wheels = build_wheels(sources, tools, [own_prefix()], args.output or Path(kept), show)
        if args.output is None:
            show("installing", "")
            installing.install(wheels)
    took = f"in {time.monotonic() - began:.0f} s"
    if args.output is not None:
        write("".join(f"{wheel}\n" for wheel in wheels))
        return
    write("".join(f"installed {source} {took}\n" for source in sources))
    for name in installing.left_behind(sources):
        note(f"{name} was compiled against what is replaced now: build it again, too")


@contextmanager
def _progress() -> Iterator[Callable[[str, str], None]]:
    """Show the progress of a build: in one line of a terminal, else a line for each step."""
    terminal = sys.stderr is not None and sys.stderr.isatty()

    def show(step: str, count: str) -> None:
        if terminal:
            note(f"\r\x1b[K{f'{step} {count}'[: columns(sys.stderr) - 1]}", end="")
        elif not count:
            note(step)

    try:
        yield show
    finally:
        if terminal:
            note("\r\x1b[K", end="")
