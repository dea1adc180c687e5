"""The simulator, the controller and the monitor of one robot; takes the arguments of all three."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

# The simulator lets time go where the machine is busy, so that its stamps fall behind the machine's clock for good: all go by
# its own. Brakes hold the robot until the controller's first command, and after its last one.
INCLUDED = {
    "simulator.launch.py": {
        "publish_clock": "true",
        "use_sim_time": "false",
        "without_command": "brake",
        "command_timeout": "0.5",
    },
    "controller.launch.py": {"use_sim_time": "true"},
    "monitor.launch.py": {"use_sim_time": "true"},
}


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics control.launch.py -s`."""
    launch = [FindPackageShare("diag_dynamics"), "launch"]
    # Each in a group of its own, which keeps the default params_file of one from becoming that of the other.
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "mimic",
                default_value="embed",
                description="mimic joints, for all: coupled to their leaders (embed), independent (free) or locked (lock)",
            ),
            # Of the simulator this is known: its drives add nothing unless they are told to.
            DeclareLaunchArgument(
                "robot_compensates_gravity", default_value="false", description="as the simulator's compensates_gravity"
            ),
            DeclareLaunchArgument("autostart", default_value="true", description="of the controller"),
            *(
                GroupAction(
                    [
                        IncludeLaunchDescription(
                            PathJoinSubstitution([*launch, file]), launch_arguments=arguments.items()
                        )
                    ]
                )
                for file, arguments in INCLUDED.items()
            ),
        ]
    )
