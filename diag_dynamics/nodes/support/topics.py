# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of nodes, and the monitor's topics for publishers and docs/interfaces.md.

The module needs no ROS.
"""

from typing import NamedTuple

NODES = {
    "monitor": "diag_dynamics",
    "simulator": "diag_dynamics_simulator",
    "controller": "diag_dynamics_controller",
    "view": "diag_dynamics_view",
}
"""Name of each executable's node. Topics, services and access policies contain it."""


class Topic(NamedTuple):
    """A topic; parameters have its highest rate, and MessageMaker a method of its name."""

    name: str
    type: str
    """Type of the message: ``package/Name``, or the name of a message of this package."""
    meaning: str
    condition: str = ""
    """Parameter without which nothing is published."""


TOPICS = (
    Topic(
        "kinetic_energy",
        "KineticEnergy",
        "kinetic energy, by total joint rate and by link, and its rate",
    ),
    Topic("state", "DiagonalizedState", "all quantities of one evaluation"),
    Topic("total_joint_rates", "TotalJointRates", "ν, ξ"),
    Topic("working_moments", "WorkingMoments", "ε, κ"),
    Topic("coriolis", "CoriolisTerm", "C, C_ξ, ε_g"),
    Topic(
        "mass_matrix_factors",
        "MassMatrixFactors",
        "m, D; ℓ with publish_inverse_factor",
    ),
    Topic("joint_space_dynamics", "JointSpaceDynamics", "M, c, g"),
    Topic(
        "external_torque",
        "ExternalTorque",
        "r, m r, |r| and collision of a disturbance observer",
        condition="external_torque.gain",
    ),
    Topic(
        "external_wrench",
        "geometry_msgs/WrenchStamped",
        "wrench of the environment on the robot at the first of external_wrench.frames",
        condition="external_wrench.frames",
    ),
    Topic(
        "external_wrench_estimates",
        "ExternalWrench",
        "wrench at each frame with its covariance and unobserved directions, also without a result",
        condition="external_wrench.frames",
    ),
    Topic(
        "load",
        "Load",
        "mass and centre of a load with standard deviations, "
        "and whether the external torque is that of a load",
        condition="load.link",
    ),
    Topic(
        "contact_limits",
        "ContactLimits",
        "predicted contact at the worst point of each link: speed, mass, energy, force, margin",
    ),
    Topic(
        "markers",
        "visualization_msgs/MarkerArray",
        "for RViz and Foxglove: links coloured by energy share or collision, and text",
    ),
)
"""All topics of the monitor."""
