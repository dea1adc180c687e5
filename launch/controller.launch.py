# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller: sends efforts to the robot whose joint_states it hears."""

from diag_dynamics.nodes.support.launching import launched


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics controller.launch.py -s`."""
    return launched("controller")
