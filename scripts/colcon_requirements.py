"""Prints what `colcon build` on ROS 2 wheels needs: what both packages name, and colcon."""

import configparser
import tomllib
from pathlib import Path

root = Path(__file__).resolve().parents[1]
metadata = configparser.ConfigParser()
metadata.read(root / "setup.cfg")
interfaces = tomllib.loads((root / "interfaces" / "pyproject.toml").read_text())

requirements = metadata["options"]["install_requires"].split("\n")
requirements += interfaces["build-system"]["requires"]
for requirement in requirements:
    # colcon builds robot_control_interfaces itself; a wheel of it beside that would shadow it.
    if requirement and not requirement.startswith(("#", "robot_control_interfaces")):
        print(requirement)
print("colcon-common-extensions")
