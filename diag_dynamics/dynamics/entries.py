# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Entry kernels of the methods of DiagonalDynamics, for compiling them in advance."""

from __future__ import annotations

from diag_dynamics.exceptions import InputError
from diag_dynamics.numerics import kernel
from diag_dynamics.sweeps import (
    batch,
    classical,
    contacts,
    derivatives,
    evaluation,
    factorization,
    factors,
    kinematics,
    mobilities,
)
from diag_dynamics.sweeps.evaluation import _link_energies

_WRENCHES = classical.effort_of_wrenches, factorization.epsilon_from_tau

ENTRIES = {
    "evaluate": (evaluation.evaluate, *_WRENCHES, _link_energies),
    "evaluate_batch": (batch.evaluate_many, _link_energies),
    "factors": (factors.factors,),
    "forward_dynamics": (classical.forward_dynamics, classical.effort_of_wrenches),
    "inverse_dynamics": (classical.inverse_dynamics, classical.effort_of_wrenches),
    "mass_matrix": (classical.mass_matrix,),
    "bias": (classical.inverse_dynamics,),
    "gravity_torque": (classical.inverse_dynamics,),
    "nu_from_qd": (factorization.nu_from_qd,),
    "qd_from_nu": (factorization.qd_from_nu,),
    "epsilon_from_tau": (factorization.epsilon_from_tau,),
    "tau_from_epsilon": (factorization.tau_from_epsilon,),
    "m_rate_transposed": (derivatives.m_rate_transposed,),
    "coriolis_bracket": (derivatives.coriolis_bracket,),
    "coriolis_product": (derivatives.coriolis_product,),
    "mass_matrix_rate": (derivatives.mass_matrix_rate,),
    "mass_matrix_rate_times": (derivatives.mass_matrix_rate_times,),
    "log_det": (derivatives.articulated_inertias,),
    "log_det_rate": (derivatives.articulated_inertias,),
    "placement": (kinematics.placement,),
    "jacobian": (kinematics.jacobian, kinematics.placement),
    "link_velocity": (kinematics.motion, kinematics.placement),
    "link_acceleration": (kinematics.motion, kinematics.placement),
    "wrench_factor": (factorization.factor_of_wrenches,),
    "epsilon_from_wrench": (factorization.factor_of_wrenches,),
    "operational_inverse_inertia": (factorization.factor_of_wrenches,),
    "reflected_mass": (factorization.factor_of_wrenches,),
    "mobilities": (mobilities.mobilities,),
    "contact": (contacts.contacts,),
    "contact_batch": (contacts.contacts_each,),
    "impact": (factorization.factor_of_wrenches, factorization.nu_from_qd, factorization.qd_from_nu),
}
"""Entries that a method calls, by its name."""


def compile_methods(methods: tuple[str, ...]) -> None:
    """Compile the entries of methods, or load them from the cache; of all methods if none is given."""
    for name in methods:
        if name not in ENTRIES:
            raise InputError(f"compile: {name!r} is none of {', '.join(ENTRIES)}.")
    for name in methods or ENTRIES:
        for entry in ENTRIES[name]:
            kernel.ready(entry)
