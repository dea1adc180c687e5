# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Entry kernels of the methods of DiagonalDynamics, for compiling them in advance."""

from __future__ import annotations

from diag_dynamics import sweeps
from diag_dynamics.compiled import kernel
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps.evaluation import _link_energies

_WRENCHES = sweeps.effort_of_wrenches, sweeps.epsilon_from_tau

ENTRIES = {
    "evaluate": (sweeps.evaluate, *_WRENCHES, _link_energies),
    "evaluate_batch": (sweeps.evaluate_many, _link_energies),
    "factors": (sweeps.factors,),
    "forward_dynamics": (sweeps.forward_dynamics, sweeps.effort_of_wrenches),
    "inverse_dynamics": (sweeps.inverse_dynamics, sweeps.effort_of_wrenches),
    "mass_matrix": (sweeps.mass_matrix,),
    "bias": (sweeps.inverse_dynamics,),
    "gravity_torque": (sweeps.inverse_dynamics,),
    "nu_from_qd": (sweeps.nu_from_qd,),
    "qd_from_nu": (sweeps.qd_from_nu,),
    "epsilon_from_tau": (sweeps.epsilon_from_tau,),
    "tau_from_epsilon": (sweeps.tau_from_epsilon,),
    "m_rate_transposed": (sweeps.m_rate_transposed,),
    "coriolis_bracket": (sweeps.coriolis_bracket,),
    "coriolis_product": (sweeps.coriolis_product,),
    "mass_matrix_rate": (sweeps.mass_matrix_rate,),
    "mass_matrix_rate_times": (sweeps.mass_matrix_rate_times,),
    "log_det": (sweeps.articulated_inertias,),
    "log_det_rate": (sweeps.articulated_inertias,),
    "placement": (sweeps.placement,),
    "jacobian": (sweeps.jacobian, sweeps.placement),
    "link_velocity": (sweeps.motion, sweeps.placement),
    "link_acceleration": (sweeps.motion, sweeps.placement),
    "wrench_factor": (sweeps.factor_of_wrenches,),
    "epsilon_from_wrench": (sweeps.factor_of_wrenches,),
    "operational_inverse_inertia": (sweeps.factor_of_wrenches,),
    "reflected_mass": (sweeps.factor_of_wrenches,),
    "mobilities": (sweeps.mobilities,),
    "contact": (sweeps.contacts,),
    "contact_batch": (sweeps.contacts_each,),
    "impact": (sweeps.factor_of_wrenches, sweeps.nu_from_qd, sweeps.qd_from_nu),
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
