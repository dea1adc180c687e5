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
    matrix: bool = False
    """Whether it is not made of the evaluation of a state."""
    condition: str = ""
    """Parameter without which nothing is published."""
    beside: bool = False
    """Whether it is made by itself, beside the others."""


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
        matrix=True,
    ),
    Topic("joint_space_dynamics", "JointSpaceDynamics", "M, c, g", matrix=True),
    Topic(
        "external_torque",
        "ExternalTorque",
        "r, m r, |r| and collision of a disturbance observer",
        condition="external_torque.gain",
        beside=True,
    ),
    Topic(
        "external_wrench",
        "geometry_msgs/WrenchStamped",
        "wrench of the environment on the robot at the first of external_wrench.frames",
        condition="external_wrench.frames",
        beside=True,
    ),
    Topic(
        "external_wrench_estimates",
        "ExternalWrench",
        "wrench at each frame with its covariance and unobserved directions, also without a result",
        condition="external_wrench.frames",
        beside=True,
    ),
    Topic(
        "load",
        "Load",
        "mass and centre of a load with standard deviations, "
        "and whether the external torque is that of a load",
        condition="load.link",
        beside=True,
    ),
    Topic(
        "contact_limits",
        "ContactLimits",
        "predicted contact at the worst point of each link: speed, mass, energy, force, margin",
        beside=True,
    ),
    Topic(
        "markers",
        "visualization_msgs/MarkerArray",
        "for RViz and Foxglove: "
        "links coloured by energy share, ellipsoid of JM⁻¹Jᵀ, velocity, text, collision",
        beside=True,
    ),
)
"""Topics in the order in which messages of a state are published.

Topics for safety are first, matrices last.
"""

MATRICES = tuple(topic.name for topic in TOPICS if topic.matrix)
"""Topics that are not made of the evaluation of a state."""

ORDER = (*(topic.name for topic in TOPICS if not topic.matrix and not topic.beside), *MATRICES)
"""Topics about a state, in the order in which they are published: matrices last."""
