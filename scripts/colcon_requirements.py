"""Prints what `colcon build` on ROS 2 wheels needs: what the packages name, and colcon."""

import configparser
from pathlib import Path

root = Path(__file__).resolve().parents[1]
metadata = configparser.ConfigParser()
metadata.read(root / "setup.cfg")
ours = tuple(path.parent.name for path in root.glob("interfaces/*/package.xml"))

requirements = metadata["options"]["install_requires"].split("\n")
requirements += (root / "bt_actions/packages/build_environment.txt").read_text().split("\n")
for requirement in requirements:
    # colcon builds the interfaces itself; a wheel of them beside that would shadow them.
    if requirement and not requirement.startswith(("#", *ours)):
        print(requirement)
print("colcon-common-extensions")
