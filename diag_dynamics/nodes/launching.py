"""What the launch files share. It needs launch_ros, as they do, and nothing else imports it."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, TextSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from diag_dynamics.nodes.names import NODES

USE_SIM_TIME = {"use_sim_time": (bool, "take time from /clock")}


def launch_of_node(executable, arguments, aliases=None):
    """One node of this package, with its arguments: each one that is given takes the place of what params_file says.

    Parameters
    ----------
    executable : str
        Its default parameters are in the file of that name in config/.
    arguments : dict
        Type and description of each parameter that is an argument, too; use_sim_time is one of them.
    aliases : dict, optional
        Arguments that are another name, the first one, for one of these; they count where that one is not given.

    Returns
    -------
    LaunchDescription
    """
    arguments, aliases = arguments | USE_SIM_TIME, aliases or {}
    own = PathJoinSubstitution([FindPackageShare("diag_dynamics"), "config", f"{executable}.yaml"])

    def start(context):
        given = {name: LaunchConfiguration(name).perform(context) for name in arguments}
        for alias, (name, _) in aliases.items():
            given[name] = given[name] or LaunchConfiguration(alias).perform(context)
        # With its type, lest an XML be parsed as YAML, or a link 1 be a number.
        parameters = {
            name: ParameterValue(TextSubstitution(text=value), value_type=arguments[name][0])
            for name, value in given.items()
            if value
        }
        return [
            Node(
                package="diag_dynamics",
                executable=executable,
                name=NODES[executable],  # its own; without it a section of that name beats what is given
                namespace=LaunchConfiguration("namespace"),
                parameters=[LaunchConfiguration("params_file"), *([parameters] if parameters else [])],
                output="both",
            )
        ]

    described = {name: text for name, (_, text) in (arguments | aliases).items()}
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the robot"),
            DeclareLaunchArgument("params_file", default_value=own, description="parameters (YAML)"),
            *(
                DeclareLaunchArgument(name, default_value="", description=f"{text}; empty: as in params_file")
                for name, text in described.items()
            ),
            OpaqueFunction(function=start),
        ]
    )


def launch_together(given, defaults=None):
    """Several nodes of this package at once, with the arguments of all of them.

    Parameters
    ----------
    given : dict
        For each node what its launch file is given, whatever the user says.
    defaults : dict, optional
        Arguments whose defaults are others than those of the launch files, whatever params_file says: these, with a
        description.

    Returns
    -------
    LaunchDescription
    """
    file_of = lambda node: PathJoinSubstitution([FindPackageShare("diag_dynamics"), "launch", f"{node}.launch.py"])  # noqa: E731
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=value, description=text)
                for name, (value, text) in (defaults or {}).items()
            ),
            # Each in a group of its own, which keeps the default params_file of one from becoming that of the other.
            *(
                GroupAction([IncludeLaunchDescription(file_of(node), launch_arguments=arguments.items())])
                for node, arguments in given.items()
            ),
        ]
    )
