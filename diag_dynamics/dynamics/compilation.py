# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The compiled functions that methods of DiagonalDynamics call, to compile them in advance."""

from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.sweeps import (
    classical,
    contacts,
    couplings,
    derivatives,
    evaluation,
    external,
    factorization,
    group_steps,
    kinematics,
    mobilities,
    regressors,
)

METHODS = {
    evaluation.evaluate: "evaluate log_det_rate",
    evaluation.link_energies: "evaluate",
    factorization.factors: "factors inverse_mass_matrix log_det",
    classical.forward_dynamics: "forward_dynamics",
    classical.inverse_dynamics: "inverse_dynamics coriolis_torque gravity_torque",
    classical.momentum: "momentum",
    classical.effort_of_wrenches: "evaluate forward_dynamics inverse_dynamics",
    classical.mass_matrix: "mass_matrix",
    classical.first_moment: "center_of_mass potential_energy",
    regressors.regressor: "regressor",
    factorization.transform: "nu_from_qd qd_from_nu epsilon_from_tau tau_from_epsilon evaluate "
    "impact coriolis_bracket_times",
    factorization.factor_of_wrenches: "wrench_factor epsilon_from_wrench reflected_mass impact "
    "operational_inverse_inertia",
    derivatives.m_rate_transposed_times: "m_rate_transposed_times coriolis_bracket_times",
    derivatives.coriolis_matrix_times: "coriolis_matrix_times coriolis_bracket_times",
    derivatives.mass_matrix_rate: "mass_matrix_rate",
    kinematics.placement: "placement jacobian link_velocity link_acceleration",
    kinematics.jacobians: "jacobian wrench",
    kinematics.motion: "link_velocity link_acceleration",
    mobilities.mobilities: "mobilities",
    external.touched_link: "touched_link",
    contacts.contacts: "contact_limits",
}
"""Methods by the function that they call for one state."""


def compile_methods(model: RobotModel, *methods: str) -> None:
    """Compile the functions of these methods, or of all, for one state.

    Functions that only groups or changing ratios of the model call are compiled, too.
    """
    names = set(" ".join(METHODS.values()).split())
    for name in methods:
        if name not in names:
            raise InputError(f"compile: {name!r} is none of {', '.join(sorted(names))}.")
    for entry, users in METHODS.items():
        if not methods or not set(methods).isdisjoint(users.split()):
            entry.compile()
    if (model.bodies["first"] < model.bodies["last"]).any():
        for step in group_steps.STEPS.values():
            step.compile()
    if model.coupling_tables:
        couplings.couple.compile()
