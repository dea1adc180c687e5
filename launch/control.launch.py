# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator, the controller and the monitor of one robot; takes the arguments of all three, but for clocks."""

from diag_dynamics.nodes.support.launching import launched


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics control.launch.py -s`."""
    return launched("control")
