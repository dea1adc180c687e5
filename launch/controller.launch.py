"""The controller: sends efforts to the robot whose joint_states it hears."""

from diag_dynamics.nodes.launching import launch_of_node

ARGUMENTS = {
    # Without a default, as the parameter: who launches has to know.
    "robot_compensates_gravity": (
        bool,
        "whether the robot adds what carries its weight to the efforts it is sent; required",
    ),
    "autostart": (bool, "configure and activate at once"),
    "controlled_link": (str, "link whose pose is regulated"),
    "check_time": (float, "how long the effort controller may take to say its joints [s]; 0: it is not asked"),
    "mimic": (str, "mimic joints: coupled to their leaders (embed), independent (free) or locked (lock)"),
}


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics controller.launch.py -s`."""
    return launch_of_node("controller", ARGUMENTS)
