# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recursions over the links: the only place with the physics, compiled by numba.

Names are those of Jain and Rodriguez (1995), written in body frames and base-to-tip order. There is one body for each
degree of freedom and for each mimic joint; body 0 is the world, and a parent comes before its children. Outward sweeps
run from the base to the tips, inward ones back, and each does a fixed amount of work per body. A joint of several
degrees of freedom is as many bodies in one and the same frame, all but the last without inertia. These, and joints coupled
by mimicry, are a group: degrees of freedom that are eliminated together, see groups.

    X   placement of a body in its parent         P   articulated body inertia (Riccati, Algorithm 4.1)
    S   direction of the degree of freedom        D   SᵀPS + armature, articulated joint inertia
    V   twist of the body                         G   P S D⁻¹
    V⁺  parent's twist seen in the body           Ṗ   rate of P in the body frame (the paper's λ̇)
    v_J motion of the joint, sum of S q̇           P⁺, Ṗ⁺, y⁺, z⁺   the same beyond the joint, τ̄ = I − G Sᵀ applied
    ζ   V × v_J, velocity-dependent acceleration

A sweep takes a robot as :class:`Workspace` holds it: `bodies` are the records of RobotModel (see model), `work` those of
:data:`WORK`, one each per body, `table` the matrices 𝓜 and 𝓜̇ of groups. Sweeps that can fail return a status: 0, `i` if
body i has no articulated inertia, -1 if an input is not finite or no orientation, or is so large that a result is not
finite, MISFIT if a vector has not the robot's length.

bodies: the records that sweeps work on; workspace: their memory. joints: steps that sweeps share. groups: degrees of freedom
that are eliminated together. evaluation, factorization, factors, classical, derivatives, kinematics, mobilities: the sweeps;
contacts: contact at points. batch: sweeps over many states. motions: positions that move along a twist, and locked joints.
"""

from diag_dynamics.sweeps.batch import (
    EPSILON_FROM_TAU,
    FORWARD,
    INVERSE,
    NU_FROM_QD,
    QD_FROM_NU,
    ROW_NUMBERS,
    TAU_FROM_EPSILON,
    effort_of_wrenches_each,
    evaluate_many,
    mass_matrix_each,
    sweep_each,
)
from diag_dynamics.sweeps.classical import (
    accelerations_with_added_inertia,
    effort_of_wrenches,
    first_moment,
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
)
from diag_dynamics.sweeps.contacts import (
    ALONG_MOTION,
    BY_ENERGY,
    BY_FORCE,
    BY_LIMIT,
    CONTACT_COLUMNS,
    CONTACT_ENTRY,
    CONTACTS,
    IN_BODY,
    IN_ROOT,
    contacts,
    contacts_each,
)
from diag_dynamics.sweeps.derivatives import (
    articulated_inertias,
    coriolis_bracket,
    coriolis_product,
    m_rate_transposed,
    mass_matrix_rate,
    mass_matrix_rate_times,
)
from diag_dynamics.sweeps.evaluation import (
    evaluate,
    friction_power,
    link_energies,
    link_energy,
)
from diag_dynamics.sweeps.factorization import (
    epsilon_from_tau,
    factor_of_wrenches,
    joint_inertias,
    nu_from_qd,
    qd_from_nu,
    rates_with_added_inertia,
    tau_from_epsilon,
)
from diag_dynamics.sweeps.factors import factors
from diag_dynamics.sweeps.groups import owns
from diag_dynamics.sweeps.joints import SINGULAR, UNIT_TOLERANCE
from diag_dynamics.sweeps.kinematics import jacobian, motion, placement
from diag_dynamics.sweeps.mobilities import FRAME, mobilities
from diag_dynamics.sweeps.motions import chart_rates, difference, displace, hold, integrate
from diag_dynamics.sweeps.records import (
    BODY,
    LINK,
    WORK,
    WRENCH,
    WRENCHES,
    links_at,
)
from diag_dynamics.sweeps.workspace import (
    ARTICULATED_INERTIA,
    ARTICULATED_INERTIA_RATE,
    BASE_ENERGY,
    CORIOLIS,
    CORIOLIS_UNNORMALIZED,
    EFFORT_POWER,
    ENERGY_SHARE,
    EPSILON,
    GRAVITY,
    KAPPA,
    KINETIC_ENERGY,
    MISFIT,
    NU,
    NU_DOT,
    NUMBERS,
    POSITIONS,
    POWER,
    RATES,
    RESULTS,
    ROWS,
    WIDTH,
    XI,
    XI_DOT,
    BatchWorkspace,
    Workspace,
    clear,
    copy,
    opened,
)

__all__ = [
    "ALONG_MOTION",
    "ARTICULATED_INERTIA",
    "ARTICULATED_INERTIA_RATE",
    "BASE_ENERGY",
    "BODY",
    "BY_ENERGY",
    "BY_FORCE",
    "BY_LIMIT",
    "CONTACTS",
    "CONTACT_COLUMNS",
    "CONTACT_ENTRY",
    "CORIOLIS",
    "CORIOLIS_UNNORMALIZED",
    "EFFORT_POWER",
    "ENERGY_SHARE",
    "EPSILON",
    "EPSILON_FROM_TAU",
    "FORWARD",
    "FRAME",
    "GRAVITY",
    "INVERSE",
    "IN_BODY",
    "IN_ROOT",
    "KAPPA",
    "KINETIC_ENERGY",
    "LINK",
    "MISFIT",
    "NU",
    "NUMBERS",
    "NU_DOT",
    "NU_FROM_QD",
    "POSITIONS",
    "POWER",
    "QD_FROM_NU",
    "RATES",
    "RESULTS",
    "ROWS",
    "ROW_NUMBERS",
    "SINGULAR",
    "TAU_FROM_EPSILON",
    "UNIT_TOLERANCE",
    "WIDTH",
    "WORK",
    "WRENCH",
    "WRENCHES",
    "XI",
    "XI_DOT",
    "BatchWorkspace",
    "Workspace",
    "accelerations_with_added_inertia",
    "articulated_inertias",
    "chart_rates",
    "clear",
    "contacts",
    "contacts_each",
    "copy",
    "coriolis_bracket",
    "coriolis_product",
    "difference",
    "displace",
    "effort_of_wrenches",
    "effort_of_wrenches_each",
    "epsilon_from_tau",
    "evaluate",
    "evaluate_many",
    "factor_of_wrenches",
    "factors",
    "first_moment",
    "forward_dynamics",
    "friction_power",
    "hold",
    "integrate",
    "inverse_dynamics",
    "jacobian",
    "joint_inertias",
    "link_energies",
    "link_energy",
    "links_at",
    "m_rate_transposed",
    "mass_matrix",
    "mass_matrix_each",
    "mass_matrix_rate",
    "mass_matrix_rate_times",
    "mobilities",
    "motion",
    "nu_from_qd",
    "opened",
    "owns",
    "placement",
    "qd_from_nu",
    "rates_with_added_inertia",
    "sweep_each",
    "tau_from_epsilon",
]
