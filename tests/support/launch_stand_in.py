"""A stand-in for launch and launch_ros, which are on no package index.

It has the classes that launch files of ours name, with the keyword arguments that those of Jazzy
have, and no others; it expands a file to the commands that would be started. It starts nothing.
"""

from __future__ import annotations

import runpy
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml


@dataclass
class LaunchContext:
    """What launch arguments are at this point of the description."""

    launch_configurations: dict[str, str] = field(default_factory=dict)
    declared: list[DeclareLaunchArgument] = field(default_factory=list)
    commands: list[Command] = field(default_factory=list)

    def text(self, value: Any) -> str:
        """Perform a substitution, or several side by side; anything else is text already."""
        if isinstance(value, LaunchConfiguration):
            return value.perform(self)
        if isinstance(value, list | tuple):
            return "".join(map(self.text, value))
        assert isinstance(value, str), f"neither text nor a substitution: {value!r}"
        return value


@dataclass
class Command:
    """A process as it would be started."""

    words: list[str]
    sigterm_timeout: float
    respawn: bool


class LaunchConfiguration:
    def __init__(self, variable_name: str, *, default: Any = None) -> None:
        self._name, self._default = variable_name, default

    def perform(self, context: LaunchContext) -> str:
        if self._name not in context.launch_configurations and self._default is not None:
            return context.text(str(self._default))
        return context.launch_configurations[self._name]


class LaunchDescription:
    def __init__(self, initial_entities: Iterable[Any] = ()) -> None:
        self._entities = list(initial_entities)

    def add_action(self, action: Any) -> None:
        self._entities.append(action)

    def visit(self, context: LaunchContext) -> None:
        for entity in self._entities:
            entity.visit(context)


class DeclareLaunchArgument:
    def __init__(
        self,
        name: str,
        *,
        default_value: Any = None,
        description: str | None = None,
        choices: Sequence[str] | None = None,
    ) -> None:
        self.name, self.default, self.description = name, default_value, description
        self._choices = choices

    def visit(self, context: LaunchContext) -> None:
        context.declared.append(self)
        if self.name not in context.launch_configurations:
            assert self.default is not None, f"{self.name} was not given, and has no default"
            context.launch_configurations[self.name] = context.text(self.default)
        value = context.launch_configurations[self.name]
        assert self._choices is None or value in self._choices, f"{self.name}: {value!r}"


class OpaqueFunction:
    def __init__(
        self, *, function: Callable[..., Any], args: Iterable[Any] = (), kwargs: Any = None
    ) -> None:
        self._call = lambda context: function(context, *args, **(kwargs or {}))

    def visit(self, context: LaunchContext) -> None:
        known = len(context.declared)
        LaunchDescription(self._call(context) or ()).visit(context)
        del context.declared[known:]  # launch does not look here for what --show-args lists


class PythonLaunchDescriptionSource:
    def __init__(self, launch_file_path: Any) -> None:
        self.path = launch_file_path


class IncludeLaunchDescription:
    def __init__(
        self,
        launch_description_source: PythonLaunchDescriptionSource,
        *,
        launch_arguments: Iterable[tuple[str, Any]] = (),
    ) -> None:
        self._source = launch_description_source
        self._arguments = list(launch_arguments)

    def visit(self, context: LaunchContext) -> None:
        for name, value in self._arguments:  # which stay set for what comes after
            context.launch_configurations[name] = context.text(value)
        described(Path(context.text(self._source.path))).visit(context)


class Node:
    def __init__(
        self,
        *,
        executable: Any,
        package: Any = None,
        name: Any = None,
        namespace: Any = None,
        exec_name: Any = None,
        parameters: Sequence[Any] = (),
        remappings: Sequence[tuple[Any, Any]] = (),
        ros_arguments: Sequence[Any] = (),
        arguments: Sequence[Any] = (),
        # what it hands on to the process that it is
        prefix: Any = None,
        cwd: Any = None,
        env: Mapping[str, Any] | None = None,
        additional_env: Mapping[str, Any] | None = None,
        shell: bool = False,
        sigterm_timeout: Any = None,
        sigkill_timeout: Any = None,
        emulate_tty: bool = False,
        output: Any = "log",
        output_format: str = "",
        cached_output: bool = False,
        log_cmd: bool = False,
        on_exit: Any = None,
        respawn: Any = False,
        respawn_delay: float | None = None,
        respawn_max_retries: int = -1,
    ) -> None:
        assert isinstance(parameters, list | tuple), "parameters is a list"
        self._before = [package, executable, *arguments]
        self._ros_arguments = ["--ros-args", *ros_arguments] if ros_arguments else []
        self._name, self._namespace = name, namespace
        self._parameters, self._remappings = parameters, remappings
        patience = LaunchConfiguration("sigterm_timeout", default=5)
        self._sigterm_timeout = patience if sigterm_timeout is None else sigterm_timeout
        self._respawn = respawn

    def visit(self, context: LaunchContext) -> None:
        words = [context.text(word) for word in (*self._before, *self._ros_arguments)]
        words += ["--ros-args"]
        if self._name is not None:
            words += ["-r", f"__node:={context.text(self._name)}"]
        if self._namespace is not None:
            words += ["-r", f"__ns:=/{context.text(self._namespace).strip('/')}"]
        for each in self._parameters:
            file = _params_file(each) if isinstance(each, dict) else context.text(each)
            words += ["--params-file", file]
        for source, target in self._remappings:
            words += ["-r", f"{context.text(source)}:={context.text(target)}"]
        respawn = self._respawn
        if not isinstance(respawn, bool):
            respawn = yaml.safe_load(context.text(respawn))
        patience = float(context.text(self._sigterm_timeout))
        context.commands.append(Command(words, patience, respawn))


def _params_file(parameters: dict[str, Any]) -> str:
    with tempfile.NamedTemporaryFile("w", prefix="launch_params_", delete=False) as file:
        yaml.dump({"/**": {"ros__parameters": parameters}}, file)
    return file.name


_MODULES: dict[str, list[type]] = {
    "launch": [LaunchDescription, LaunchContext],
    "launch.actions": [DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction],
    "launch.launch_description_sources": [PythonLaunchDescriptionSource],
    "launch.substitutions": [LaunchConfiguration],
    "launch_ros": [],
    "launch_ros.actions": [Node],
}


@contextmanager
def _standing_in() -> Iterator[None]:
    before = {name: sys.modules.get(name) for name in _MODULES}
    for name, classes in _MODULES.items():
        module = sys.modules[name] = ModuleType(name)
        vars(module).update({each.__name__: each for each in classes})
    try:
        yield
    finally:
        for name, module in before.items():
            sys.modules.pop(name)
            if module is not None:
                sys.modules[name] = module


def described(path: Path) -> LaunchDescription:
    """What a launch file describes."""
    with _standing_in():
        found = runpy.run_path(str(path))["generate_launch_description"]()
    assert isinstance(found, LaunchDescription)
    return found


def expand(path: Path, **arguments: str) -> LaunchContext:
    """Return what would be started with these launch arguments, and what was declared."""
    context = LaunchContext(dict(arguments))
    described(path).visit(context)
    return context
