"""Interface packages, written as users write them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Write = Callable[..., Path]

MANIFEST = """\
<package format="3">
  <name>{name}</name>
  <version>{version}</version>
  <description>A package for tests.</description>
  <maintainer email="maintainers@bt-actions.invalid">The bt_actions authors</maintainer>
  <license>Apache-2.0</license>
  {depends}
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
"""


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a package; `files` are its interfaces, `cmake` is its CMakeLists.txt."""

    def package(
        name: str,
        files: dict[str, str],
        *,
        version: str = "1.0.0",
        depends: str = "",
        cmake: str | None = None,
        folder: str = "",
    ) -> Path:
        root = tmp_path / "src" / (folder or name)
        named = "".join(f'  "{file}"\n' for file in files)
        if cmake is None:
            cmake = f"project({name})\nrosidl_generate_interfaces(${{PROJECT_NAME}}\n{named})\n"
        tags = "".join(f"<depend>{each}</depend>" for each in depends.split())
        texts = {
            **files,
            "CMakeLists.txt": cmake,
            "package.xml": MANIFEST.format(name=name, version=version, depends=tags),
        }
        for file, text in texts.items():
            (root / file).parent.mkdir(parents=True, exist_ok=True)
            (root / file).write_text(text)
        return root

    return package
