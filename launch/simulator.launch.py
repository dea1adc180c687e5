"""The simulator: moves a robot and publishes its joint_states and robot_description."""

from diag_dynamics.nodes.launching import launch_of_node

ARGUMENTS = {
    "robot_description": (str, "URDF of the robot, or its path"),
    "mimic": (str, "mimic joints: coupled to their leaders (embed), independent (free) or locked (lock)"),
    "without_command": (str, "drives without a command: no effort (zero) or brake"),
    "command_timeout": (float, "how long one holds [s]; 0: for ever"),
    "compensates_gravity": (bool, "drives add what carries the robot to the efforts they are sent"),
    "publish_clock": (bool, "simulated time goes out on /clock"),
}

ALIASES = {"urdf": ("robot_description", "the same")}


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics simulator.launch.py -s`."""
    return launch_of_node("simulator", ARGUMENTS, ALIASES)
