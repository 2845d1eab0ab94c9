"""Serves a robot's trees: `ros2 launch bt_actions serve.launch.py namespace:=r1 trees:=...`."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = [
    DeclareLaunchArgument("namespace", default_value="", description="The robot's namespace."),
    DeclareLaunchArgument(
        "trees",
        default_value="package://bt_actions/trees",
        description="Folders of trees, or package://NAME/trees, with spaces between them.",
    ),
    DeclareLaunchArgument(
        "policy",
        default_value="reject",
        choices=["reject", "queue", "replace", "parallel"],
        description="What to do with a goal while another runs.",
    ),
    DeclareLaunchArgument(
        "max",
        default_value="",
        description="How many goals may wait (queue), or run (parallel).",
    ),
    DeclareLaunchArgument(
        "python",
        default_value="",
        description="Packages whose classes the trees' python: nodes may name.",
    ),
    DeclareLaunchArgument(
        "respawn", default_value="false", description="Start it again when it has ended."
    ),
    DeclareLaunchArgument(
        "sigterm_timeout",
        default_value="15",
        description="Seconds to drain its goals: more than the trees' timeout.cancel.",
    ),
]


def generate_launch_description() -> LaunchDescription:
    """Describe one `bt-actions serve`."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=_serve)])


def _serve(context: LaunchContext) -> list[Node]:
    """Make the node here: an option that is empty is not given to it.

    Its patience is read now; when launch ends, the arguments of a scoped group are gone.
    """
    arguments = ["serve"]
    for option in ("trees", "policy", "max", "python"):
        for word in LaunchConfiguration(option).perform(context).split():
            arguments += [f"--{option}", word]
    return [
        Node(
            package="bt_actions",
            executable="bt-actions",
            namespace=LaunchConfiguration("namespace"),
            arguments=arguments,
            output="screen",
            respawn=LaunchConfiguration("respawn"),
            respawn_delay=2.0,
            sigterm_timeout=LaunchConfiguration("sigterm_timeout").perform(context),
        )
    ]
