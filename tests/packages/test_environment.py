"""The build environment: made once, or a clear word on what is missing."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from bt_actions.packages import PackageError, environment
from bt_actions.packages.environment import (
    build_environment,
    check_compilers,
    installer,
    own_prefix,
    pins,
)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "bt_actions"


def test_without_a_network_the_missing_environment_is_named(cache: Path) -> None:
    with pytest.raises(PackageError) as raised:
        build_environment(print, network=False)
    said = str(raised.value)
    assert said.startswith(f"the build environment is missing: {cache}/build-3.")
    assert f"{len(pins())} packages" in said
    assert "--no-network" in said.splitlines()[1]
    assert not cache.exists()


def test_one_that_is_ready_is_taken_as_it_is(cache: Path) -> None:
    with pytest.raises(PackageError) as raised:
        build_environment(print, network=False)
    folder = Path(str(raised.value).split(": ")[1].split(" is to hold")[0])
    folder.mkdir(parents=True)
    (folder / "ready").touch()
    tools = build_environment(print, network=False)
    assert (tools.prefix, tools.python) == (folder, folder / "bin" / "python")


def test_one_that_cannot_be_made_is_not_ready(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        environment,
        "installer",
        lambda _: [sys.executable, "-c", "import sys; sys.exit('ERROR: no such wheel')"],
    )
    said: list[str] = []
    for _ in range(2):
        with pytest.raises(PackageError, match="could not be made: ERROR: no such wheel\n"):
            build_environment(said.append, network=True)
    assert len(said) == 2
    assert "once, of" in said[0]
    assert not list(cache.glob("*/ready"))


def test_without_pip_and_uv_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "_has_pip", lambda: False)
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(PackageError, match="neither pip nor uv"):
        installer()
    monkeypatch.setattr("shutil.which", lambda _: "/bin/uv")
    assert installer()[:3] == ["/bin/uv", "pip", "install"]


@pytest.mark.parametrize(("variable", "language"), [("CC", "C"), ("CXX", "C++")])
def test_a_compiler_that_is_missing_is_named(
    variable: str, language: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("CC", "CXX"):
        monkeypatch.setenv(name, "true")
    check_compilers()
    for broken in ("no-such-compiler", "false"):
        monkeypatch.setenv(variable, broken)
        with pytest.raises(PackageError) as raised:
            check_compilers()
        assert str(raised.value).startswith(f"no working {language} compiler was found")
        assert "build-essential" in str(raised.value)


def test_where_ros_is_no_wheel_colcon_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sysconfig.get_path", lambda _: str(tmp_path))
    with pytest.raises(PackageError, match=r"`colcon build`.*docs/workspace\.md"):
        own_prefix()
