"""Prints what `colcon build` on ROS 2 wheels needs: what the packages name, and colcon."""

import configparser
import tomllib
from pathlib import Path

root = Path(__file__).resolve().parents[1]
metadata = configparser.ConfigParser()
metadata.read(root / "setup.cfg")
interfaces = sorted(path.parent for path in root.glob("interfaces/*/pyproject.toml"))
ours = tuple(path.name for path in interfaces)

requirements = metadata["options"]["install_requires"].split("\n")
pyproject = tomllib.loads((interfaces[0] / "pyproject.toml").read_text())  # they need the same
requirements += pyproject["build-system"]["requires"]
for requirement in requirements:
    # colcon builds the interfaces itself; a wheel of them beside that would shadow them.
    if requirement and not requirement.startswith(("#", *ours)):
        print(requirement)
print("colcon-common-extensions")
