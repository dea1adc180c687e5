"""The simulator, the controller and the monitor of one robot; takes the arguments of all three, but for clocks."""

from launch.substitutions import LaunchConfiguration

from diag_dynamics.nodes.launching import launch_together

# The simulator lets time go where the machine is busy. All go by its own clock, which stands still then: by the machine's,
# states would be too old at once.
GIVEN = {
    "simulator": {
        "publish_clock": "true",
        "use_sim_time": "false",
        "compensates_gravity": LaunchConfiguration("robot_compensates_gravity"),
    },
    "controller": {"use_sim_time": "true"},
    "monitor": {"use_sim_time": "true"},
}

# Brakes hold the robot until the controller's first command, and after its last one.
DEFAULTS = {
    "robot_compensates_gravity": (
        "false",
        "whether the simulator adds gravity itself, and the controller leaves it out",
    ),
    "autostart": ("true", "of the controller"),
    "check_time": (
        "0.0",
        "how long the controller asks who takes its commands for its joints: the simulator does not say [s]",
    ),
    "without_command": ("brake", "drives without a command: no effort (zero) or brake"),
    "command_timeout": ("0.5", "how long one holds [s]; 0: for ever"),
}


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics control.launch.py -s`."""
    return launch_together(GIVEN, DEFAULTS)
