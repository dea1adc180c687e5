# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regressors of a robot, its filtered rows and their normal equations.

The parameters of a body are m, mc (three), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about its frame's origin.
"""

import math

import numpy as np

from diag_dynamics.dynamics.calls import direction, root_of_rate
from diag_dynamics.exceptions import UnsupportedError
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.numerics import kernel as nk
from diag_dynamics.sweeps import records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps.regressors import PARAMETERS, coefficients, propagate_motions
from diag_dynamics.sweeps.workspace import clear, opened

OWN = DAMPING, FRICTION, OFFSET, ROTOR, LOAD, ROOT = range(6)
COLUMNS = {"damping": DAMPING, "friction": FRICTION, "effort_offset": OFFSET, "armature": ROTOR}
COLUMNS |= {"load_friction": LOAD, "root_friction": ROOT}
"""Unknowns of a degree of freedom beside inertias, by the names of joint parameters."""

RATE = 2.0 * np.pi  # λ of the low-pass [1/s]; at 3 Hz the noise of velocities biases the columns
# States whose rows are in memory at once; rows of a product: in larger ones threads wait
SIZE, PRODUCT = 1000, 60


def require_single_joints(model):
    """Refuse a model with a floating base, or a joint of several degrees of freedom."""
    if model.floating_base or set(model.joint_names) > set(single_joints(model)):
        raise UnsupportedError(
            f"robot '{model.name}' has a floating base, or a joint of several degrees of "
            "freedom; expected neither."
        )


class Regressors:
    """Rows Y_p and Y_g − Y_∂ with d/dt(Y_p π) + (Y_g − Y_∂) π = τ, without friction and rotors.

    Unknowns are ten parameters of each body with inertia, and of those in `also`, then damping,
    Coulomb friction, offset, rotor inertia, load and root friction of each degree of freedom. The
    load is the torque of gravity of the dynamics `load_of`, 0 if None. The row of a degree of
    freedom has `columns` of them, of the bodies that it moves and its own, and then the effort.
    `rows` are their places in the row of all. Normal equations are an array of objects: [Y τ]ᵀ[Y τ]
    of each degree of freedom, and the sum of weights.
    """

    def __init__(self, model, also=()):
        bodies = model.bodies
        nv = model.nv
        self.bodies = np.union1d(np.flatnonzero(bodies["mass"][1:] > 0.0) + 1, np.array(also, int))
        inertial = PARAMETERS * len(self.bodies)
        self.size = inertial + len(OWN) * nv
        moved = np.zeros((nv, len(self.bodies)), bool)
        for number, body in enumerate(self.bodies.tolist()):
            while body > 0:
                moved[bodies["dof"][body], number] = True
                body = int(bodies["parent"][body])
        self.columns = []
        self.rows = []
        end = 0
        self._first = np.full((nv, len(bodies)), -1.0)
        for k in range(nv):
            numbers = np.flatnonzero(moved[k])
            blocks = (PARAMETERS * numbers[:, None] + np.arange(PARAMETERS)).ravel()
            self.columns.append(np.r_[blocks, inertial + len(OWN) * k + np.arange(len(OWN))])
            self._first[k, self.bodies[numbers]] = end + PARAMETERS * np.arange(len(numbers))
            self.rows.append(slice(end, end + len(self.columns[k]) + 1))
            end = self.rows[k].stop
        self.load_of = None
        self._friction_velocity = model.friction_velocity
        self._workspace = model.new_workspace()
        self._directions = np.zeros((len(bodies), len(bodies), 12))

    def own(self, column):
        """Return the unknowns of one kind, of all degrees of freedom."""
        return PARAMETERS * len(self.bodies) + len(OWN) * np.arange(len(self.rows)) + column

    def evaluate(self, q, qd):
        """Return Y_p and Y_g − Y_∂ at states (T, nq) and (T, nv).

        Both have rows of all degrees of freedom, (T, R), that are zero beside inertias.
        """
        momentum, bias = np.empty((2, len(q), self.rows[-1].stop))
        q = np.ascontiguousarray(q)
        qd = np.ascontiguousarray(qd)
        fill_regressors(self._workspace.robot, q, qd, self._first, self._directions, momentum, bias)
        return momentum, bias

    def filtered_rows(self, t, q, qd, tau, known=True):
        """Yield rows and weights of consecutive states from the second one on.

        Rows of joints whose effort is not `known` are zero. A row is λ(Y_p − F Y_p) + F(Y_g − Y_∂),
        F[q̇, tanh(q̇/v₀), 1], λ(q̇ − F q̇), F[|g| tanh(q̇/v₀), q̇/√max(|q̇|, v₀)] and Fτ. F of
        momentum begins at its first value, other filters at 0. The weight is min(1, λΔ/2), as rows
        that are closer than the filter's memory say the same.
        """
        first_own = np.array([row.stop - len(OWN) - 1 for row in self.rows])
        state = None
        for first in range(0, len(t) - 1, SIZE):
            part = slice(first, first + SIZE + 1)
            rates = qd[part]
            time = RATE * t[part]
            momentum, y = self.evaluate(q[part], rates)
            momentum *= RATE
            momentum[:, first_own + ROTOR] = RATE * rates
            y -= momentum
            y[:, first_own + DAMPING] = rates
            y[:, first_own + OFFSET] = 1.0
            y[:, first_own + len(OWN)] = tau[part]
            v0 = self._friction_velocity
            y[:, first_own + FRICTION] = direction(rates, v0)
            if self.load_of:
                y[:, first_own + LOAD] = (
                    np.abs(self.load_of.gravity_torque(q[part])) * y[:, first_own + FRICTION]
                )
            y[:, first_own + ROOT] = root_of_rate(rates, v0)
            filtered = np.empty_like(y)
            filtered[0] = -momentum[0] if state is None else state
            low_pass(time, y, filtered)
            state = filtered[-1]
            rows = momentum[1:] + filtered[1:]
            for k in np.flatnonzero(~(known & np.ones(len(self.rows), bool))):
                rows[:, self.rows[k]] = 0.0
            yield rows, np.minimum(1.0, 0.5 * np.diff(time))

    def sum_rows(self, rows, weights):
        """Return the normal equations of rows."""
        rows = rows * np.sqrt(weights)[:, None]
        sums = np.empty(len(self.rows) + 1, object)
        for k, part in enumerate(self.rows):
            few = np.array_split(rows[:, part], len(rows) // PRODUCT + 1)
            sums[k] = sum(some.T @ some for some in few)
        sums[-1] = weights.sum()
        return sums

    def sum_segment(self, t, q, qd, tau, known=True):
        """Return the normal equations of consecutive states.

        Rows of joints whose effort is not `known` are omitted.
        """
        return sum(self.sum_rows(*some) for some in self.filtered_rows(t, q, qd, tau, known))

    def residual_squares(self, sums, x, any_gain=False):
        """Return sums of squared residuals of each degree of freedom, given all unknowns.

        With `any_gain` they are those beside the best other gain of the effort.
        """
        signed = [np.append(-x[columns], 1.0) for columns in self.columns]
        squares = np.array([y @ product @ y for y, product in zip(signed, sums[:-1], strict=True)])
        if any_gain:
            along = np.array(
                [product[-1] @ y for y, product in zip(signed, sums[:-1], strict=True)]
            )
            efforts = np.array([product[-1, -1] for product in sums[:-1]])
            squares -= along**2 / np.maximum(efforts, 1e-300)
        return np.maximum(squares, 0.0)

    def weighted(self, sums, variance):
        """Return A and b over all rows, each degree of freedom's over its variance.

        b is by degree of freedom, (size, nv).
        """
        A = np.zeros((self.size, self.size))
        b = np.zeros((self.size, len(self.rows)))
        for k, (columns, product) in enumerate(zip(self.columns, sums[:-1], strict=True)):
            A[np.ix_(columns, columns)] += product[:-1, :-1] / variance[k]
            b[columns, k] = product[:-1, -1] / variance[k]
        return A, b


# --- Kernels ---


@nk.large_kernel
def propagate_directions(bodies, gravity, q, qd, work, directions):
    """Compute V and −g in the frame of each body, and its own and inboard directions.

    ``directions[i, k]`` has S_k, a mimic joint's times its multiplier, and V_k × S_k in the frame
    of body i, V_k that of the joint's last body.
    """
    propagate_motions(bodies, len(bodies) - 1, gravity, q, qd, work)
    for i in range(1, len(bodies)):
        body = bodies[i]
        w = work[i]
        X = records.placement_of(w)
        V = records.motion_of(w.V)
        a = body.parent
        while a > 0:
            for half in range(0, 12, 6):
                inboard = records.motion_of(directions[body.parent, a, half:])
                records.set_motion(directions[i, a, half:], sp.motion_to_child(X, inboard))
            a = bodies[a].parent
        if body.rank == body.dofs - 1:
            for j in range(i - body.rank, i + 1):  # bodies of one joint share a frame
                S = sp.motion_along(bodies[j].direction, work[j].multiplier)
                changing = sp.motion_along(bodies[j].direction, work[j].multiplier_rate)
                turning = sp.add_motion(sp.cross_motion(V, S), changing)
                records.set_motion(directions[i, j], S)
                records.set_motion(directions[i, j, 6:], turning)


@nk.entry_kernel(
    nk.ROBOT,
    nk.MATRIX,
    nk.MATRIX,
    nk.MATRIX,
    nk.FILLED_STATES,
    nk.FILLED_MATRIX,
    nk.FILLED_MATRIX,
    nogil=True,
)
def fill_regressors(robot, Q, QD, first, directions, momentum, bias):
    """Fill rows of Y_p and Y_g − Y_∂ at states, a row of Q and QD each; all joints' rows in one.

    ``first[k, i]`` is where the parameters of body i begin in the row of degree of freedom k, or
    −1. `directions`, (N + 1, N + 1, 12), is memory to work in.
    """
    bodies, gravity, work, _ = opened(robot)
    for t in range(len(Q)):
        propagate_directions(bodies, gravity, Q[t], QD[t], work, directions)
        clear(momentum[t])
        clear(bias[t])
        for i in range(1, len(bodies)):
            if first[bodies[i].dof, i] < 0.0:
                continue
            V = records.motion_of(work[i].V)
            up = records.motion_of(work[i].acceleration)
            a = i
            while a > 0:
                at = int(first[bodies[a].dof, i])
                S = records.motion_of(directions[i, a])
                turning = records.motion_of(directions[i, a, 6:])
                momentum_row = coefficients(S, V)
                gravity_of = coefficients(S, up)
                kinetic = coefficients(turning, V)
                for j in range(PARAMETERS):
                    momentum[t, at + j] += momentum_row[j]
                    bias[t, at + j] += gravity_of[j] - kinetic[j]
                a = bodies[a].parent


@nk.entry_kernel(nk.VECTOR, nk.MATRIX, nk.FILLED_MATRIX, nogil=True)
def low_pass(time, y, w):
    """Filter the columns of y by λ/(s + λ) in place of w[1:], given w[0]; `time` is λt.

    Exact for inputs that are straight between states: w⁺ = E w + (c − E) y + (1 − c) y⁺ with
    E = exp(−λΔ) and c = (1 − E)/(λΔ).
    """
    for t in range(1, len(time)):
        step = time[t] - time[t - 1]
        decay = math.exp(-step)
        mean = -math.expm1(-step) / step
        old = mean - decay
        new = 1.0 - mean
        for j in range(y.shape[1]):
            w[t, j] = decay * w[t - 1, j] + old * y[t - 1, j] + new * y[t, j]
