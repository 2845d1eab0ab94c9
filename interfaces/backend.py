"""Makes the package beside it installable with pip, from ROS 2 wheels (PEP 517).

Each package has a link to this file. Builds with bt_actions/packages, as `bt-actions interfaces
build` does, and has pip supply the build environment: bt_actions needs these packages, and can be
installed only after them.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

_ROOT = Path(__file__).resolve().parents[1] / "bt_actions"


def _load() -> None:
    """Make bt_actions.packages importable without bt_actions itself, which imports py_trees."""
    bare = ModuleType("bt_actions")
    bare.__path__ = [str(_ROOT)]
    sys.modules["bt_actions"] = bare


def get_requires_for_build_wheel(config_settings: object = None) -> list[str]:
    """What pip installs first: the list of pins that all interface packages are built with."""
    _load()
    from bt_actions.packages.environment import pins

    return pins()


def build_wheel(
    wheel_directory: str, config_settings: object = None, metadata_directory: object = None
) -> str:
    """Build the package in the current folder; return the name of its wheel."""
    _load()
    from bt_actions.packages import PackageError
    from bt_actions.packages.building import build_wheels
    from bt_actions.packages.environment import check_compilers, own_tools
    from bt_actions.packages.order import in_order

    try:
        check_compilers()
        tools = own_tools()
        sources = in_order([Path.cwd()], [tools.prefix])
        (wheel,) = build_wheels(sources, tools, [], Path(wheel_directory), lambda *_: None)
    except PackageError as error:
        raise SystemExit(f"error: {error}") from None
    return wheel.name
