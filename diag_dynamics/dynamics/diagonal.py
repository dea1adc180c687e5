# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""DiagonalDynamics: the dynamics of one robot, as users call it."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.compiled.progress import steps
from diag_dynamics.contact.points import ContactPoint
from diag_dynamics.dynamics.contacts import Contacts
from diag_dynamics.exceptions import InputError, SingularMassMatrixError


class DiagonalDynamics(Contacts):
    """Diagonalized and classical dynamics of one robot, in O(N) sweeps over its links.

    Only what is a matrix takes as long as its entries. Threads may share one; each call
    is one thread's, so that one for each is faster. Results never alias its workspace.

    Vectors of rates and efforts have shape (nv,) and are in the order of ``model.dof_names``: qd [rad/s, m/s], tau [N m,
    N], nu [J^½], epsilon [J^½/s]. Positions q [rad, m] have shape (nq,), in the order of ``model.coordinate_names``.
    Every method raises :class:`InputError` if a vector has another shape, is not finite or no orientation, naming the
    joint, and those that factorize raise :class:`SingularMassMatrixError` if M is singular at q.

    External wrenches are a dict of six numbers, force [N] then moment [N m], by link name; each acts at its link's origin,
    in the link's axes (``frame="link"``) or in those of the world (``frame="world"``).

    Parameters
    ----------
    model : RobotModel
        What :func:`load_urdf` returned.
    """

    def compile(self, *methods: str) -> None:
        """Compile methods, or load them from the cache: afterwards no call of them waits for the compiler.

        Parameters
        ----------
        *methods : str
            Names of methods of this class; all, if none is given.

        Raises
        ------
        InputError
            A name is not that of a method that is compiled.
        """
        probe = DiagonalDynamics(self.model)
        zero, q, root = self._zero, self.model.neutral, self.model.root_link
        wrench = {root: np.zeros(6)}

        def evaluate() -> tuple[float, Array]:
            s = probe.evaluate(q, zero, zero, wrench)
            return s.kinetic_energy, s.link_energy

        calls = {
            "evaluate": evaluate,
            "evaluate_batch": lambda: probe.evaluate_batch(q[None], zero[None], zero[None]).link_energy,
            "factors": lambda: probe.factors(q),
            "forward_dynamics": lambda: probe.forward_dynamics(q, zero, zero, wrench),
            "inverse_dynamics": lambda: probe.inverse_dynamics(q, zero, zero, wrench),
            "mass_matrix": lambda: probe.mass_matrix(q),
            "bias": lambda: probe.bias(q, zero),
            "gravity_torque": lambda: probe.gravity_torque(q),
            "nu_from_qd": lambda: probe.nu_from_qd(q, zero),
            "qd_from_nu": lambda: probe.qd_from_nu(q, zero),
            "epsilon_from_tau": lambda: probe.epsilon_from_tau(q, zero),
            "tau_from_epsilon": lambda: probe.tau_from_epsilon(q, zero),
            "m_rate_transposed": lambda: probe.m_rate_transposed(q, zero, zero),
            "coriolis_bracket": lambda: probe.coriolis_bracket(q, zero, zero),
            "coriolis_product": lambda: probe.coriolis_product(q, zero, zero),
            "mass_matrix_rate": lambda: probe.mass_matrix_rate(q, zero),
            "mass_matrix_rate_times": lambda: probe.mass_matrix_rate_times(q, zero, zero),
            "log_det": lambda: probe.log_det(q),
            "log_det_rate": lambda: probe.log_det_rate(q, zero),
            "placement": lambda: probe.placement(q, root),
            "jacobian": lambda: probe.jacobian(q, root),
            "link_velocity": lambda: probe.link_velocity(q, zero, root),
            "link_acceleration": lambda: probe.link_acceleration(q, zero, zero, root),
            "wrench_factor": lambda: probe.wrench_factor(q, root),
            "epsilon_from_wrench": lambda: probe.epsilon_from_wrench(q, root, np.zeros(6)),
            "operational_inverse_inertia": lambda: probe.operational_inverse_inertia(q, root),
            "mobilities": lambda: probe.mobilities(q),
            "contact": lambda: probe.contact(q, zero, [ContactPoint(root, root)]),
            "contact_batch": lambda: probe.contact_batch(q[None], zero[None], [ContactPoint(root, root)]),
            "impact": lambda: probe.impact(q, zero, root, (1.0, 0.0, 0.0)),
            "reflected_mass": lambda: probe.reflected_mass(q, root, (1.0, 0.0, 0.0)),
        }
        for name in methods:
            if name not in calls:
                raise InputError(f"compile: {name!r} is none of {', '.join(calls)}.")
        for name in steps(methods or tuple(calls)):
            with suppress(SingularMassMatrixError):  # at this one configuration; it is compiled all the same
                calls[name]()
