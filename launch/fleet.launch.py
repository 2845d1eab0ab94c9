"""Serves the trees of several robots: `ros2 launch bt_actions fleet.launch.py robots:="r1 r2"`.

All of them on this machine. Takes the arguments of serve.launch.py, too, for each of them.
"""

import runpy
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

SERVE = str(Path(__file__).with_name("serve.launch.py"))


def generate_launch_description() -> LaunchDescription:
    """Describe one `bt-actions serve` a robot."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "robots",
                default_value="r1 r2",
                description="The robots' namespaces, with spaces between them.",
            ),
            # Here, too: launch does not look into a function for what --show-args lists.
            *(each for each in runpy.run_path(SERVE)["ARGUMENTS"] if each.name != "namespace"),
            OpaqueFunction(function=_fleet),
        ]
    )


def _fleet(context: LaunchContext) -> list[IncludeLaunchDescription]:
    robots = LaunchConfiguration("robots").perform(context).split()
    return [
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(SERVE), launch_arguments={"namespace": robot}.items()
        )
        for robot in robots
    ]
