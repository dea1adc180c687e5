# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The compiled functions that methods of DiagonalDynamics call, to compile them in advance."""

from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps import (
    batch,
    classical,
    contacts,
    derivatives,
    evaluation,
    external,
    factorization,
    kinematics,
    mobilities,
)

METHODS = {
    evaluation.evaluate: "evaluate",
    evaluation.link_energies: "evaluate evaluate_batch",
    batch.evaluate_many: "evaluate_batch",
    batch.mass_matrix_each: "mass_matrix_batch",
    batch.effort_of_wrenches_each: "evaluate_batch forward_dynamics_batch inverse_dynamics_batch",
    batch.sweep_each: "evaluate_batch forward_dynamics_batch inverse_dynamics_batch bias_batch "
    "gravity_torque_batch nu_from_qd_batch qd_from_nu_batch epsilon_from_tau_batch "
    "tau_from_epsilon_batch momentum_batch",
    factorization.factors: "factors",
    classical.forward_dynamics: "forward_dynamics",
    classical.inverse_dynamics: "inverse_dynamics bias gravity_torque",
    classical.momentum: "momentum",
    classical.effort_of_wrenches: "evaluate forward_dynamics inverse_dynamics",
    classical.mass_matrix: "mass_matrix",
    factorization.nu_from_qd: "nu_from_qd impact",
    factorization.qd_from_nu: "qd_from_nu impact",
    factorization.epsilon_from_tau: "epsilon_from_tau evaluate",
    factorization.tau_from_epsilon: "tau_from_epsilon",
    factorization.factor_of_wrenches: "wrench_factor epsilon_from_wrench reflected_mass impact "
    "operational_inverse_inertia",
    derivatives.m_rate_transposed: "m_rate_transposed",
    derivatives.coriolis_bracket: "coriolis_bracket",
    derivatives.coriolis_product: "coriolis_product",
    derivatives.mass_matrix_rate: "mass_matrix_rate",
    derivatives.mass_matrix_rate_times: "mass_matrix_rate_times",
    derivatives.articulated_inertias: "log_det log_det_rate",
    kinematics.placement: "placement jacobian link_velocity link_acceleration",
    kinematics.jacobian: "jacobian",
    kinematics.motion: "link_velocity link_acceleration",
    mobilities.mobilities: "mobilities",
    external.wrench: "wrench",
    external.wrench_each: "wrench_batch",
    external.touched_link: "touched_link",
    external.touched_link_each: "touched_link_batch",
    contacts.contacts: "contact",
    contacts.contacts_each: "contact_batch",
}
"""Methods by the function that they call."""


def compile_methods(*methods: str) -> None:
    """Compile the functions of these methods, of all if no name follows."""
    known = set(" ".join(METHODS.values()).split())
    for name in methods:
        if name not in known:
            raise InputError(f"compile: {name!r} is none of {', '.join(sorted(known))}.")
    for entry, users in METHODS.items():
        if not methods or not set(methods).isdisjoint(users.split()):
            entry.compile()
