"""Prints constraints.txt: the exact version of every distribution in the given environments.

Run it on environments of every supported Python that hold all there is (.venv and .colcon/venv):
    python scripts/constraints.py <environment>/bin/python ... > constraints.txt
"""

import subprocess
import sys

HEADER = """\
# The exact version of every package that any target of the Makefile installs, ROS 2 Jazzy included.
# Made by scripts/constraints.py. setup.cfg and the build environment of bt_actions name the same.
"""
# The ROS wheels carry metadata of a second distribution each (rclpy beside ros-rclpy), which no
# index has and pip did not install by that name.
LIST = """
import re
from importlib.metadata import distributions
for found in distributions():
    if (found.read_text("INSTALLER") or "").strip() == "pip":
        print(re.sub("[-_.]+", "-", found.name).lower(), found.version)
"""
OURS = {"bt-actions", "bt-actions-interfaces", "robot-control-interfaces", "pip"}

versions: dict[str, set[str]] = {}
for python in sys.argv[1:]:
    listed = subprocess.run([python, "-c", LIST], capture_output=True, text=True, check=True)
    for line in listed.stdout.splitlines():
        name, version = line.split()
        versions.setdefault(name, set()).add(version)

differing = {name: found for name, found in versions.items() if len(found) > 1}
if differing:
    sys.exit(f"One version each, please; these environments differ: {differing}")
print(HEADER, end="")
for name in sorted(versions.keys() - OURS):
    print(f"{name}=={versions[name].pop()}")
