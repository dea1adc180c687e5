# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stacked operators of Jain and Rodriguez (1995), dense. Imports nothing of diag_dynamics.

`Operators` builds the paper's stacked operators, as dense matrices, from Pinocchio's placements,
inertias and motion subspaces, in the paper's own axes: spatial vectors are angular first, at each
body's origin, in the axes of the world, so that φ(k, k−1) is [[1, l~], [0, 1]] (4.7). Bodies are
numbered base to tip here, and a body may carry several: E_φ has the tree's pattern, which changes
none of the identities.
"""

from functools import cached_property

import numpy as np
import pinocchio as pin


def tilde(a):
    """Return a~ with a~ b = a × b."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def cross(X):
    """Return X~ of a spatial vector [a; b] (5.5)."""
    return np.block([[tilde(X[:3]), np.zeros((3, 3))], [tilde(X[3:]), tilde(X[:3])]])


def stacked(blocks):
    """Return the block diagonal matrix (5.6)."""
    rows, columns = blocks[0].shape
    out = np.zeros((len(blocks) * rows, len(blocks) * columns))
    for k, block in enumerate(blocks):
        out[k * rows : (k + 1) * rows, k * columns : (k + 1) * columns] = block
    return out


ANGULAR_FIRST = np.r_[3:6, 0:3]


class Operators:
    """H, φ, M, P, D, G, K, ψ … of a robot with joints of one degree of freedom, in Pinocchio's
    order of bodies.

    Where the paper has Ω_δ = (H*θ')~ left of P it means the rotation of a revolute joint, for which
    Ω_δ* = −Ω_δ. With `turn` = −Ω_δ* there instead, the identities hold for prismatic joints too.
    Both are the same for revolute ones.
    """

    def __init__(self, oracle, q, qd):
        """Place the bodies and run Algorithm 4.1."""
        self.oracle = oracle
        model = oracle.model
        data = oracle.data
        self.parents = [parent - 1 for parent in list(model.parents)[1:]]
        self.n = n = oracle.nv
        assert list(model.nvs)[1:] == [1] * n
        configuration = oracle.configuration(q)
        columns = [
            pin.computeJointJacobian(model, data, configuration, j).reshape(6, n)
            for j in range(1, n + 1)
        ]
        pin.forwardKinematics(model, data, configuration)
        placements = list(data.oMi)[1:]
        turns = [np.kron(np.eye(2), X.rotation) for X in placements]
        self.origins = [X.translation.copy() for X in placements]
        self.H = stacked(
            [
                (R @ c[ANGULAR_FIRST, k])[None]
                for k, (R, c) in enumerate(zip(turns, columns, strict=True))
            ]
        )
        inertias = [
            body.matrix()[np.ix_(ANGULAR_FIRST, ANGULAR_FIRST)] for body in list(model.inertias)[1:]
        ]
        self.M = stacked([R @ body @ R.T for R, body in zip(turns, inertias, strict=True)])
        self.E_phi = np.zeros((6 * n, 6 * n))
        for k, parent in enumerate(self.parents):
            if parent >= 0:
                shift = np.eye(6)
                shift[:3, 3:] = tilde(self.origins[k] - self.origins[parent])
                self.E_phi[self.at(parent), self.at(k)] = shift
        self.one = np.eye(6 * n)
        self.I = np.eye(n)
        self.phi = np.linalg.inv(self.one - self.E_phi)
        self.rates = oracle.to_pin(qd)
        self.armature = np.diag(model.armature)
        self._algorithm_4_1()

    @staticmethod
    def at(k):
        """Return where body k is."""
        return slice(6 * k, 6 * k + 6)

    def block(self, A, k):
        """Return the diagonal block of body k."""
        return A[self.at(k), self.at(k)]

    def diagonal(self, A):
        """Return the block diagonal part."""
        return stacked([self.block(A, k) for k in range(self.n)])

    def children(self, k):
        """Return the bodies that body k carries next."""
        return [j for j, parent in enumerate(self.parents) if parent == k]

    def _algorithm_4_1(self):
        """P = φ P⁺ φ* + M, D = H P H*, G = P H* D⁻¹, τ̄ = 1 − G H, P⁺ = τ̄ P, from the tips to the
        base.
        """
        P = self.M.copy()
        D = np.zeros(self.n)
        G = np.zeros((6 * self.n, self.n))
        rest = np.zeros_like(self.M)
        for k in reversed(range(self.n)):
            at = self.at(k)
            H = self.H[k, self.at(k)]
            inner = P[at, at]
            D[k] = H @ inner @ H + self.armature[k, k]
            G[at, k] = inner @ H / D[k]
            rest[at, at] = np.eye(6) - np.outer(G[at, k], H)
            if self.parents[k] >= 0:
                inboard = self.at(self.parents[k])
                shift = self.E_phi[inboard, at]
                P[inboard, inboard] += shift @ rest[at, at] @ inner @ shift.T
        self.P = P
        self.D = np.diag(D)
        self.G = G
        self.tau_bar = rest
        self.K = self.E_phi @ G
        self.E_psi = self.E_phi @ rest
        self.psi = np.linalg.inv(self.one - self.E_psi)

    @cached_property
    def root(self):
        """Return D^½."""
        return np.sqrt(self.D)

    @cached_property
    def unit(self):
        """Return 1 + HφK."""
        return self.I + self.H @ self.phi @ self.K

    @cached_property
    def inverse(self):
        """Return 1 − HψK."""
        return self.I - self.H @ self.psi @ self.K

    @cached_property
    def V(self):
        """Return the bodies' velocities φ*H*θ' (4.3)."""
        return self.phi.T @ self.H.T @ self.rates

    @cached_property
    def V_cross(self):
        """Return V~."""
        return stacked([cross(self.V[self.at(k)]) for k in range(self.n)])

    @cached_property
    def delta(self):
        """Return Ω_δ = (H*θ')~ (6.3)."""
        inner = self.H.T @ self.rates
        return stacked([cross(inner[self.at(k)]) for k in range(self.n)])

    @cached_property
    def turn(self):
        """Return −Ω_δ*, which is Ω_δ of revolute joints."""
        return -self.delta.T

    @cached_property
    def rate(self):
        """Return λ̇ of (7.2): λ̇(k) = ψ λ̇(k−1) ψ* + X + X*, X = Ω_δ P."""
        X = self.turn @ self.P
        out = self.diagonal(X + X.T)
        for k in reversed(range(self.n)):
            for child in self.children(k):
                shift = self.E_psi[self.at(k), self.at(child)]
                out[self.at(k), self.at(k)] += shift @ self.block(out, child) @ shift.T
        return out

    @cached_property
    def P_rate(self):
        """Return P' in the body's own axes: Σ ψ λ̇ ψ* over the bodies carried (6.4)."""
        return self.diagonal(self.E_psi @ self.rate @ self.E_psi.T)

    def partial_rate(self, i):
        """Return λ_i of (A.16): 0 outboard of i, H~P − PH~ at i, ψλ_iψ* inboard."""
        turn = cross(self.H[i, self.at(i)])
        out = np.zeros_like(self.M)
        out[self.at(i), self.at(i)] = -turn.T @ self.block(self.P, i) - self.block(self.P, i) @ turn
        k = self.parents[i]
        while k >= 0:
            for child in self.children(k):
                shift = self.E_psi[self.at(k), self.at(child)]
                out[self.at(k), self.at(k)] += shift @ self.block(out, child) @ shift.T
            k = self.parents[k]
        return out

    def body(self, k):
        """Return the body that the caller's degree of freedom k moves."""
        return int(self.oracle._order[k])

    def mine(self, x):
        """Return a vector or matrix over the joints in the caller's order."""
        return self.oracle.from_pin(x)
