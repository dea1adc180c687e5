"""The simulator, the controller and the monitor of one robot; takes the arguments of all three."""

from diag_dynamics.nodes.launching import launch_together

# The simulator lets time go where the machine is busy, so that its stamps fall behind the machine's clock for good: all go by
# its own. Brakes hold the robot until the controller's first command, and after its last one.
GIVEN = {
    "simulator": {
        "publish_clock": "true",
        "use_sim_time": "false",
        "without_command": "brake",
        "command_timeout": "0.5",
    },
    "controller": {"use_sim_time": "true", "check_time": "0.0"},
    "monitor": {"use_sim_time": "true"},
}

# Of the simulator this is known: its drives add nothing unless they are told to.
DEFAULTS = {
    "robot_compensates_gravity": ("false", "as the simulator's compensates_gravity"),
    "autostart": ("true", "of the controller"),
}


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics control.launch.py -s`."""
    return launch_together(GIVEN, DEFAULTS)
