"""What setup.cfg cannot say in a way that colcon understands; all other metadata is there."""

import sys
from pathlib import Path

from setuptools import Distribution, setup

SHARE = "share/bt_actions"
SHARED = [
    *sorted(Path("trees").rglob("*.y*ml")),
    *sorted(Path("launch").glob("*.launch.py")),
    *sorted(Path("foxglove").glob("*.json")),
]

# colcon installs the command itself there (setup.cfg), and calls `install` or `develop`.
IS_WHEEL = any(word.endswith("_wheel") for word in sys.argv)
FOR_ROS2_RUN = [("lib/bt_actions", ["resource/lib/bt-actions"])] if IS_WHEEL else []

# setuptools leaves data files out of an editable install, because it asks the distribution for
# `has_data` (command/editable_wheel.py, _run_install), a name that only this line gives it.
Distribution.has_data = Distribution.has_data_files

setup(
    # In setup.cfg it becomes an object that colcon-python-setup-py cannot read back.
    python_requires=">=3.11,<3.13",
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/bt_actions"]),
        (SHARE, ["package.xml"]),
        *FOR_ROS2_RUN,
        *((f"{SHARE}/{path.parent}", [str(path)]) for path in SHARED),
    ],
)
