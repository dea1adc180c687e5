"""The simulator: moves a robot and publishes its joint_states and robot_description."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics simulator.launch.py -s`."""
    params_file = PathJoinSubstitution([FindPackageShare("diag_dynamics"), "config", "simulator.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("urdf", default_value="", description="path of the robot's URDF"),
            DeclareLaunchArgument(
                "robot_description",
                default_value=LaunchConfiguration("urdf"),  # the node takes either
                description="the URDF itself, instead of a path",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the robot"),
            DeclareLaunchArgument("params_file", default_value=params_file, description="parameters (YAML)"),
            DeclareLaunchArgument(
                "mimic",
                default_value="embed",
                description="mimic joints: coupled to their leaders (embed), independent (free) or locked (lock)",
            ),
            DeclareLaunchArgument(
                "without_command",
                default_value="zero",
                description="drives without a command: no effort (zero) or brake",
            ),
            DeclareLaunchArgument(
                "command_timeout", default_value="0.0", description="how long one holds [s]; 0: for ever"
            ),
            DeclareLaunchArgument(
                "publish_clock", default_value="false", description="simulated time goes out on /clock"
            ),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="take time from /clock"),
            Node(
                package="diag_dynamics",
                executable="simulator",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    LaunchConfiguration("params_file"),
                    {
                        # a str by type, lest the XML is parsed as YAML
                        "robot_description": ParameterValue(LaunchConfiguration("robot_description"), value_type=str),
                        "mimic": LaunchConfiguration("mimic"),
                        "without_command": LaunchConfiguration("without_command"),
                        "command_timeout": ParameterValue(LaunchConfiguration("command_timeout"), value_type=float),
                        "publish_clock": LaunchConfiguration("publish_clock"),
                        "use_sim_time": LaunchConfiguration("use_sim_time"),
                    },
                ],
                output="both",
            ),
        ]
    )
