"""The simulator and the monitor of one robot; takes the arguments of both."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics demo.launch.py -s`."""
    launch = [FindPackageShare("diag_dynamics"), "launch"]
    # Each in a group of its own, which keeps the default params_file of one from becoming that of the other.
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "mimic",
                default_value="embed",
                description="mimic joints, for both: coupled to their leaders (embed), independent (free) or locked (lock)",
            ),
            *(
                GroupAction([IncludeLaunchDescription(PathJoinSubstitution([*launch, file]))])
                for file in ("simulator.launch.py", "monitor.launch.py")
            ),
        ]
    )
