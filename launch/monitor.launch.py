# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor: publishes the diagonalized dynamics of the robot whose joint_states it hears."""

from diag_dynamics.nodes.support.launching import launched


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics monitor.launch.py -s`."""
    return launched("monitor")
