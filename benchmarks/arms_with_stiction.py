# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arms of Pinocchio with stiction, on programs that move some of the joints and stop; measured and pushed.

The plant has other inertias than the URDF, rotors, and friction: viscous, Coulomb, by the torque of gravity, and 15 % more at
breakaway. Joints stick by projected Gauss-Seidel on the rates at the end of each step. A drive follows the program, with
noise of rates and efforts and ripple of efforts.
"""

import numba
import numpy as np
import pinocchio as pin

STEP = 2e-3  # [s] of plant and samples
DURATION = 1.0 / 3.0  # [s] of a push


@numba.njit
def rates_with_stiction(mass, impulse, damping, friction, rates, step):
    """Return rates v with M v + h D v + h λ = b and |λ| at most the friction, 0 where a joint sticks."""
    v, n = rates.copy(), len(rates)
    for _ in range(60):
        largest = 0.0
        for k in range(n):
            rest = impulse[k]
            for j in range(n):
                if j != k:
                    rest -= mass[k, j] * v[j]
            moved = max(0.0, abs(rest) - step * friction[k]) / (mass[k, k] + step * damping[k])
            moved *= np.sign(rest)
            largest, v[k] = max(largest, abs(moved - v[k])), moved
        if largest < 1e-9:
            break
    return v


class Program:
    """Motions of random joints to random positions, with a stop after each."""

    def __init__(self, model, rng):
        self.lower = np.maximum(model.lowerPositionLimit, -2.0)
        self.upper = np.minimum(model.upperPositionLimit, 2.0)
        self.rng, self.speed = rng, 0.5 * np.minimum(model.velocityLimit, 2.0)
        self.last = 0.5 * (self.lower + self.upper)
        self.plan(0.0)

    def plan(self, t):
        """Plan a motion that begins at a time [s]."""
        rng, n = self.rng, len(self.lower)
        moves = rng.random(n) < 0.6
        target = self.last + rng.uniform(-0.8, 0.8, n)
        target = np.clip(target, self.lower + 0.2, self.upper - 0.2)
        self.first, self.last = self.last, np.where(moves, target, self.last)
        fastest = (1.875 * np.abs(self.last - self.first) / self.speed).max()
        self.begin, self.duration = t, max(0.8, fastest * rng.uniform(1.0, 2.0))
        self.stop = rng.uniform(0.3, 1.2) if rng.random() < 0.7 else rng.uniform(2.0, 4.0)

    def __call__(self, t):
        """Return position, velocity and acceleration at a time [s]."""
        if t > self.begin + self.duration + self.stop:
            self.plan(t)
        x, T = min(1.0, (t - self.begin) / self.duration), self.duration
        way = self.last - self.first
        place = 10 * x**3 - 15 * x**4 + 6 * x**5
        speed = 30 * x**2 - 60 * x**3 + 30 * x**4
        change = 60 * x - 180 * x**2 + 120 * x**3
        return self.first + way * place, way * speed / T, way * change / T**2


class Arm:
    """An arm by its URDF, and its true parameters."""

    def __init__(self, urdf, seed=7):
        self.model, rng = pin.buildModelFromUrdf(urdf), np.random.default_rng(seed)
        n, effort, velocity = self.model.nv, self.model.effortLimit, self.model.velocityLimit
        self.effort = np.where((effort > 0.0) & (effort < 1e4), effort, 50.0)
        velocity = np.where((velocity > 0.0) & (velocity < 1e2), velocity, 2.0)
        slope = 0.03 * self.effort / velocity
        self.friction = 0.04 * self.effort * rng.uniform(0.7, 1.3, n)
        self.damping, self.armature = slope * rng.uniform(0.7, 1.3, (2, n))
        self.load_friction, self.ripple = 0.05 * rng.uniform(0.5, 1.5, n), rng.uniform(0, 6.3, n)
        self.true = self.model.copy()
        for k in range(1, self.true.njoints):
            inertia = self.true.inertias[k]
            mass, lever = inertia.mass * rng.uniform(0.96, 1.04), 0.003 * rng.normal(size=3)
            size = inertia.inertia * rng.uniform(0.97, 1.03)
            self.true.inertias[k] = pin.Inertia(mass, inertia.lever + lever, size)

    def identified(self, seed=5):
        """Return parameters by joint within 10 % of the true ones."""
        rng, joints = np.random.default_rng(seed), {}
        for k, name in enumerate(list(self.model.names)[1:]):
            damping, friction, armature = rng.uniform([0.9, 0.9, 0.95], [1.1, 1.1, 1.05])
            joints[name] = {
                "damping": float(self.damping[k] * damping),
                "friction": float(self.friction[k] * friction),
                "armature": float(self.armature[k] * armature),
                "load_friction": float(self.load_friction[k]),
            }
        return joints

    def record(self, seconds, seed, count=0, force=0.0):
        """Return stamps [ns], positions, rates and efforts, and the stamps of pushes of a force [N]."""
        model, true, n = self.model, self.true, self.model.nv
        data, rng = true.createData(), np.random.default_rng(seed)
        program, known = Program(model, rng), model.createData()
        pushes = self._pushes(seconds, count, force, rng)
        q, v, integral = program(0.0)[0].copy(), np.zeros(n), np.zeros(n)
        stiffness, rows = 12.0 * self.effort, []
        for k in range(int(seconds / STEP)):
            t = k * STEP
            goal, speed, change = program(t)
            error, lag = goal - q, speed - v
            tau = pin.rnea(model, known, q, v, change) + self.armature * change
            tau += self.friction * np.tanh(speed / 0.02) + self.damping * speed
            integral += 2.0 * STEP * stiffness * error
            integral = np.clip(integral, -self.friction, self.friction)
            tau += stiffness * error + 0.1 * stiffness * lag + integral
            tau = np.clip(tau, -self.effort, self.effort)
            measured = tau * (1.0 + 0.01 * np.sin(12.0 * q + self.ripple))
            measured += 0.002 * self.effort * rng.normal(size=n)
            rows.append((round(1e9 * t), q, v + 1e-3 * rng.normal(size=n), measured))
            q, v = self._step(data, q, v, tau + self._external(data, q, t, pushes))
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        return columns, [round(1e9 * at) for at, _, _ in pushes]

    def _pushes(self, seconds, count, force, rng):
        """Return time, frame and force of pushes beyond the middle of the arm."""
        frames = [
            k
            for k, frame in enumerate(self.model.frames)
            if frame.type == pin.FrameType.BODY and frame.parentJoint > self.model.nv // 2
        ]
        pushes = []
        for k in range(count):
            direction = rng.normal(size=3)
            direction *= force / np.linalg.norm(direction)
            at = seconds * (k + rng.uniform(0.25, 0.75)) / count
            pushes.append((at, int(rng.choice(frames)), direction))
        return pushes

    def _external(self, data, q, t, pushes):
        """Return the torque of the pushes at a time [s]."""
        torque = np.zeros(self.model.nv)
        for at, frame, force in pushes:
            if at <= t < at + DURATION:
                axes = pin.LOCAL_WORLD_ALIGNED
                torque += pin.computeFrameJacobian(self.true, data, q, frame, axes)[:3].T @ force
        return torque

    def _step(self, data, q, v, tau):
        """Return position and rates after a step."""
        true = self.true
        M = pin.crba(true, data, q)
        M = np.triu(M) + np.triu(M, 1).T + np.diag(self.armature)
        gravity = pin.computeGeneralizedGravity(true, data, q)
        friction = self.friction + self.load_friction * np.abs(gravity)
        friction = np.where(np.abs(v) < 1e-3, 1.15, 1.0) * friction
        impulse = M @ v + STEP * (tau - pin.nonLinearEffects(true, data, q, v))
        v = rates_with_stiction(M, impulse, self.damping, friction, v, STEP)
        return pin.integrate(true, q, STEP * v), v
