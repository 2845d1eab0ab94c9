"""Wheels into this environment: all at once, and never over what somebody else has installed."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution, distributions
from importlib.util import find_spec
from pathlib import Path

from bt_actions.packages import PackageError
from bt_actions.packages.environment import installer
from bt_actions.packages.sources import Package
from bt_actions.packages.wheel import GENERATOR


def check_names(sources: Iterable[Package]) -> None:
    """Raise PackageError where a wheel would overwrite another's package, or a newer one."""
    for source in sources:
        try:
            found = distribution(source.name)
        except PackageNotFoundError:
            spec = find_spec(source.name)
            if spec is not None and spec.origin is not None:
                raise PackageError(
                    f"{source.folder}: there is a Python module {source.name!r} already "
                    f"({spec.origin}), which the package would hide: give it another <name>"
                ) from None
            continue
        if not _is_ours(found):
            raise PackageError(
                f"{source.folder}: {source.name} {found.version} is installed already, and was not "
                "built by this command: give the package another <name>"
            )
        if _numbers(found.version) > _numbers(source.version):
            raise PackageError(
                f"{source.folder}: {source.name} is {source.version}, and {found.version} is "
                f"installed: raise its <version>, or `pip uninstall {source.name}` first"
            )


def install(wheels: Iterable[Path]) -> None:
    """Install `wheels` at once; a Ctrl-C waits for the end. Raises PackageError."""
    command = [
        *installer(),
        "--quiet",
        "--no-index",
        "--no-deps",
        "--force-reinstall",
        *map(str, wheels),
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as process:
        try:
            said, _ = process.communicate()
        except KeyboardInterrupt:  # pip would leave half of it behind
            process.communicate()
            raise
    if process.returncode != 0:
        lines = [line for line in said.splitlines() if line.strip()]
        first = next((line for line in lines if line.lower().startswith("error")), said[-300:])
        raise PackageError(f"the wheels were built, and could not be installed: {first.strip()}")


def left_behind(sources: Iterable[Package]) -> list[str]:
    """Return the installed packages that were compiled against another build of `sources`."""
    built = {source.name for source in sources}
    return sorted(
        found.name
        for found in distributions()
        if _is_ours(found) and found.name not in built and built & set(_required(found))
    )


def _is_ours(found: Distribution) -> bool:
    return f"Generator: {GENERATOR}\n" in (found.read_text("WHEEL") or "")


def _required(found: Distribution) -> Iterator[str]:
    for requirement in found.requires or ():
        yield requirement.partition("==")[0]


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(each) for each in version.split("."))
