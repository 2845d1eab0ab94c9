"""A simulated robot, and its trees served: `ros2 launch bt_actions simulation.launch.py`.

Takes the arguments of serve.launch.py, too.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SERVE = str(Path(__file__).with_name("serve.launch.py"))


def generate_launch_description() -> LaunchDescription:
    """Describe one `bt-actions sim` and one `bt-actions serve`, in one namespace."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "namespace", default_value="", description="The robot's namespace."
            ),
            DeclareLaunchArgument(
                "speed", default_value="1.0", description="Simulated seconds in one second."
            ),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(SERVE)),
            Node(
                package="bt_actions",
                executable="bt-actions",
                namespace=LaunchConfiguration("namespace"),
                arguments=["sim", "--speed", LaunchConfiguration("speed")],
                output="screen",
            ),
        ]
    )
