"""The monitor: publishes the diagonalized dynamics of the robot whose joint_states it hears."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics monitor.launch.py -s`."""
    params_file = PathJoinSubstitution([FindPackageShare("diag_dynamics"), "config", "monitor.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the robot"),
            DeclareLaunchArgument("params_file", default_value=params_file, description="parameters (YAML)"),
            DeclareLaunchArgument(
                "mimic",
                default_value="embed",
                description="mimic joints: coupled to their leaders (embed), independent (free) or locked (lock)",
            ),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="take time from /clock"),
            Node(
                package="diag_dynamics",
                executable="monitor",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    LaunchConfiguration("params_file"),
                    {
                        "mimic": LaunchConfiguration("mimic"),
                        "use_sim_time": LaunchConfiguration("use_sim_time"),
                    },
                ],
                output="both",
            ),
        ]
    )
