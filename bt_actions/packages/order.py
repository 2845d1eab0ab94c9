"""The packages to build, in their order, and what each of them stands on.

A type that is used is looked for among the packages that are built, then in the prefixes, then in
packages that lie beside those that were named.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from bt_actions.packages import PackageError
from bt_actions.packages.sources import Package, read_manifest, read_package
from bt_actions.utilities.suggest import what_it_has


def in_order(folders: Iterable[Path], prefixes: Sequence[Path]) -> list[Package]:
    """Return the packages in `folders` and those beside them that they need, needed ones first.

    Raises PackageError for a package that cannot be read, is given twice, or uses what is nowhere,
    and for a circle.
    """
    sources: dict[str, Package] = {}
    waiting = [folder.resolve() for folder in folders]
    while waiting:
        source = read_package(waiting.pop(0))
        other = sources.setdefault(source.name, source)
        if other is not source and other.folder != source.folder:
            raise PackageError(
                f"{source.name} is there twice: in {other.folder} and in {source.folder}"
            )
        for package in needs(source):
            known = {each.name for each in sources.values()}
            if package in known or messages_in(package, prefixes):
                continue
            waiting += [each for each in _beside(source, package) if each not in waiting]
    for source in sources.values():
        _check_uses(source, sources, prefixes)
    graph = {
        name: (set(needs(source)) | source.depends) & (sources.keys() - {name})
        for name, source in sources.items()
    }
    try:
        return [sources[name] for name in TopologicalSorter(graph).static_order()]
    except CycleError as error:
        circle = " uses ".join(reversed(error.args[1]))
        raise PackageError(f"these packages use each other in a circle: {circle}") from error


def needs(source: Package) -> list[str]:
    """Return the other packages whose messages its files use."""
    return sorted({used.partition("/")[0] for used in source.uses} - {source.name})


def messages_in(package: str, prefixes: Iterable[Path]) -> set[str]:
    """Return the messages of a package; none where nothing can be built upon it."""
    for prefix in prefixes:
        share = prefix / "share" / package
        if (share / "cmake").is_dir():
            return {path.stem for path in (share / "msg").glob("*.idl")}
    return set()


def _beside(source: Package, package: str) -> list[Path]:
    """Return the folder of a package that lies beside a source, if there is one."""
    for manifest in sorted(source.folder.parent.glob("*/package.xml")):
        try:
            name = read_manifest(manifest.parent).findtext("name") or ""
        except PackageError:  # of a package that nobody has asked for
            continue
        if name.strip() == package:
            return [manifest.parent]
    return []


def _check_uses(source: Package, sources: dict[str, Package], prefixes: Sequence[Path]) -> None:
    for used, place in source.uses.items():
        package, _, name = used.partition("/")
        built = sources.get(package)
        known = built.messages if built else messages_in(package, prefixes)
        if not known and not built:
            raise PackageError(
                f"{place}: {used} is used, and {package} is not there: give the path of its "
                f"sources, too, or `pip install ros-jazzy-{package.replace('_', '-')}`"
            )
        if name not in known:
            has = what_it_has(name, sorted(known))
            raise PackageError(f"{place}: {package} has no message {name!r}{has}")
