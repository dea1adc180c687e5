# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""An oracle of robots with closed loops, from Pinocchio. Imports nothing of diag_dynamics.

Points of links that coincide, and curves of joints that follow others, are constraints. Their
Jacobians J and J̇ give q̇_full = G q̇ and Ġ. Then M = GᵀM_full G, and the rest as
`coupling.Coupled`.
"""

import numpy as np
import pinocchio as pin

from coupling import upper_factor, upper_factor_rate
from derivative_oracles import RateOracle

AXES = pin.LOCAL_WORLD_ALIGNED


class ClosedLoops:
    """A robot whose `pairs` of points (link, point, link, point) coincide.

    `curves` has (source, function) of each joint that follows another; the function returns value,
    slope and second derivative. `start` has all positions, nearly closed. `names` are the
    independent joints in order.
    """

    def __init__(self, urdf, names, pairs, start, armature, curves):
        self.full = full = RateOracle(urdf, armature=armature)
        self.pairs = [(self._frame(*pair[:2]), self._frame(*pair[2:])) for pair in pairs]
        full.data = full.model.createData()
        place = {name: k for k, name in enumerate(full.dof_names)}
        self.independent = [place[name] for name in names]
        self.followers = [k for name, k in place.items() if name not in names]
        self.curves = [(place[name], place[source], f) for name, (source, f) in curves.items()]
        self.start = np.array([start[name] for name in full.dof_names])

    def _frame(self, link, point):
        """Add a frame at a point of a link."""
        model = self.full.model
        body = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
        place = body.placement * pin.SE3(np.eye(3), np.array(point, float))
        name = f"{link} at {point}"
        frame = pin.Frame(name, body.parentJoint, place, pin.FrameType.OP_FRAME)
        return model.addFrame(frame, False)

    def constraints(self, q, qd):
        """Return distances of constraints, J and J̇ of all joints."""
        full = self.full
        model = full.model
        data = full.data
        configuration = full.configuration(q)
        rates = full.to_pin(qd)
        pin.computeJointJacobiansTimeVariation(model, data, configuration, rates)
        pin.updateFramePlacements(model, data)
        distance = []
        J = []
        J_rate = []
        for a, b in self.pairs:
            distance.append(data.oMf[a].translation - data.oMf[b].translation)
            for rows, read in (
                (J, pin.getFrameJacobian),
                (J_rate, pin.getFrameJacobianTimeVariation),
            ):
                ends = [read(model, data, frame, AXES)[:3, full._order] for frame in (a, b)]
                rows.append(ends[0] - ends[1])
        unit = np.eye(full.nv)
        for follower, source, curve in self.curves:
            value, slope, bend = curve(q[source])
            distance.append([q[follower] - value])
            J.append([unit[follower] - slope * unit[source]])
            J_rate.append([-bend * qd[source] * unit[source]])
        return np.concatenate(distance), np.vstack(J), np.vstack(J_rate)

    def close(self, q):
        """Return positions of all joints, by Newton's method from the start."""
        full = self.start.copy()
        full[self.independent] = q
        for _ in range(60):
            distance, J, _ = self.constraints(full, 0.0 * full)
            change = np.linalg.lstsq(J[:, self.followers], distance, rcond=1e-9)[0]
            largest = np.abs(change).max(initial=1e-300)
            full[self.followers] -= min(1.0, 0.3 / largest) * change
            if largest < 1e-14:
                break
        assert np.abs(self.constraints(full, 0.0 * full)[0]).max() < 1e-11
        return full

    def ratios(self, position, qd):
        """Return G and Ġ at positions of all joints."""
        G, G_rate = np.zeros((2, self.full.nv, len(qd)))
        G[self.independent] = np.eye(len(qd))
        _, J, _ = self.constraints(position, 0.0 * position)
        inverse = np.linalg.pinv(J[:, self.followers], rcond=1e-9)
        G[self.followers] = -inverse @ J[:, self.independent]
        G_rate[self.followers] = -inverse @ self.constraints(position, G @ qd)[2] @ G
        return G, G_rate

    def potential_energy(self, q):
        """Return the energy in the field of gravity."""
        return self.full.potential_energy(self.close(q))

    def effort_of(self, q, qd, wrenches):
        """Return GᵀJᵀf of wrenches in the axes of the world."""
        position = self.close(q)
        G, _ = self.ratios(position, qd)
        return G.T @ self.full.effort_of(position, wrenches, "world")

    def regressor(self, q, qd, qdd, links):
        """Return the regressor by parameters of links."""
        position = self.close(q)
        G, G_rate = self.ratios(position, qd)
        return G.T @ self.full.regressor(position, G @ qd, G @ qdd + G_rate @ qd, links)

    def at(self, q, qd):
        """Return M, c, g, ν, C and ε_g."""
        full = self.full
        position = self.close(q)
        G, G_rate = self.ratios(position, qd)
        rate = G @ qd
        M_full = full.mass_matrix(position)
        C_s = full.coriolis_matrix(position, rate)
        M = G.T @ M_full @ G
        change = G_rate.T @ M_full @ G + G.T @ C_s @ G
        c = G.T @ (full.coriolis_torque(position, rate) + M_full @ G_rate @ qd)
        g = G.T @ full.gravity_torque(position)
        unit, D = upper_factor(M)
        m = unit * np.sqrt(D)
        m_rate = upper_factor_rate(m, change + change.T)
        coriolis = np.linalg.solve(m, c) - m_rate.T @ qd
        return M, c, g, m.T @ qd, coriolis, np.linalg.solve(m, g)
