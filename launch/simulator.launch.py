# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator: moves a robot and publishes its joint_states and robot_description."""

from diag_dynamics.nodes.support.launching import launched


def generate_launch_description():
    """Describe the launch; the arguments are listed by `ros2 launch diag_dynamics simulator.launch.py -s`."""
    return launched("simulator")
