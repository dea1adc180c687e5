"""The controller: sends efforts to the robot whose joint_states it hears."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics controller.launch.py -s`."""
    params_file = PathJoinSubstitution([FindPackageShare("diag_dynamics"), "config", "controller.yaml"])
    return LaunchDescription(
        [
            # Without a default, as the parameter: who launches has to know.
            DeclareLaunchArgument(
                "robot_compensates_gravity",
                description="whether the robot itself adds what carries its weight to the efforts it is sent (true or false)",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the robot"),
            DeclareLaunchArgument("params_file", default_value=params_file, description="parameters (YAML)"),
            DeclareLaunchArgument("autostart", default_value="false", description="configure and activate at once"),
            DeclareLaunchArgument(
                "controlled_link", default_value="", description="link whose pose is regulated; empty: none"
            ),
            DeclareLaunchArgument(
                "mimic",
                default_value="embed",
                description="mimic joints: coupled to their leaders (embed), independent (free) or locked (lock)",
            ),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="take time from /clock"),
            Node(
                package="diag_dynamics",
                executable="controller",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    LaunchConfiguration("params_file"),
                    {
                        "robot_compensates_gravity": ParameterValue(
                            LaunchConfiguration("robot_compensates_gravity"), value_type=bool
                        ),
                        "autostart": ParameterValue(LaunchConfiguration("autostart"), value_type=bool),
                        "controlled_link": ParameterValue(LaunchConfiguration("controlled_link"), value_type=str),
                        "mimic": LaunchConfiguration("mimic"),
                        "use_sim_time": LaunchConfiguration("use_sim_time"),
                    },
                ],
                output="both",
            ),
        ]
    )
