# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""An oracle of robots with loops that knows positions of point masses, and nothing of spatial algebra or of the library.

A body is six point masses of its URDF's inertia, a rotor one coordinate more. Positions are functions of the independent
joints; the others follow from Newton's method on the distances that the loops close. Derivatives are hyper-dual numbers:
(f, ∂f/∂a, ∂f/∂b, ∂²f/∂a∂b) of each number, products by the product rule. Then M = Σ μ JᵀJ, c = Σ μ Jᵀ J̇ q̇, and the
diagonalized quantities are those of the factor M = m mᵀ, m upper triangular.
"""

import xml.etree.ElementTree as ET

import numpy as np


def product(f, x, y):
    """Return a bilinear function of hyper-dual numbers."""
    return (
        f(x[0], y[0]),
        f(x[1], y[0]) + f(x[0], y[1]),
        f(x[2], y[0]) + f(x[0], y[2]),
        f(x[3], y[0]) + f(x[1], y[2]) + f(x[2], y[1]) + f(x[0], y[3]),
    )


def constant(value):
    """Return a hyper-dual number without derivatives."""
    return value, 0 * value, 0 * value, 0 * value


def add(x, y):
    """Return a sum."""
    return tuple(a + b for a, b in zip(x, y, strict=True))


def sine_and_cosine(x):
    """Return sine and cosine."""
    s, c = np.sin(x[0]), np.cos(x[0])
    return (s, c * x[1], c * x[2], c * x[3] - s * x[1] * x[2]), (
        c,
        -s * x[1],
        -s * x[2],
        -s * x[3] - c * x[1] * x[2],
    )


def polynomial(coefficients):
    """Return a polynomial of hyper-dual numbers, the constant first."""

    def value(x):
        result = constant(0.0 * x[0])
        for coefficient in coefficients[::-1]:
            result = add(product(np.multiply, result, x), constant(coefficient + 0.0 * x[0]))
        return result

    return value


def _numbers(element, name, default):
    return np.array((default if element is None else element.get(name, default)).split(), float)


def _rotation(rpy):
    (a, b, c), (d, e, f) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
    y = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    z = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    return z @ y @ x


def point_masses(link):
    """Return masses and positions of six points with the inertia of a <link>."""
    inertial = link.find("inertial")
    if inertial is None:
        return np.zeros(0), np.zeros((0, 3))
    mass = float(inertial.find("mass").get("value"))
    at = {key: float(value) for key, value in inertial.find("inertia").items()}
    inertia = np.array([[at["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
    second, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    assert second.min() > 0.0, link.get("name")
    away = axes * np.sqrt(3.0 * second / mass)
    return np.full(6, mass / 6.0), _numbers(inertial.find("origin"), "xyz", "0 0 0") + np.hstack(
        [away, -away]
    ).T


class PointMasses:
    """A robot whose `pairs` of points (link, point, link, point) coincide, and whose `curves` give follower by source.

    `start` has all positions, nearly closed; `armature` is by joint. `names` are independent joints in order.
    """

    def __init__(
        self, urdf, names, pairs, start, armature=None, curves=None, gravity=(0.0, 0.0, -9.81)
    ):
        robot = ET.fromstring(urdf)
        self.joints = {
            joint.get("name"): joint
            for joint in robot.findall("joint")
            if joint.get("type") != "fixed"
        }
        self.of_child = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}
        self.links = {link.get("name"): point_masses(link) for link in robot.findall("link")}
        self.names, self.pairs, self.curves = list(names), pairs, curves or {}
        self.followers = [name for name in self.joints if name not in names]
        self.start, self.armature, self.gravity = dict(start), armature or {}, np.array(gravity)

    def _places(self, q):
        """Return rotation and position of each link, hyper-dual."""
        places = {}

        def place(link):
            if link not in places:
                joint = self.of_child.get(link)
                places[link] = (
                    self._beyond(joint, q, *place(joint.find("parent").get("link")))
                    if joint is not None
                    else (
                        constant(np.eye(3)),
                        constant(np.zeros(3)),
                    )
                )
            return places[link]

        for link in self.links:
            place(link)
        return places

    def _beyond(self, joint, q, R, p):
        origin, axis = joint.find("origin"), _numbers(joint.find("axis"), "xyz", "1 0 0")
        p = add(p, product(np.matmul, R, constant(_numbers(origin, "xyz", "0 0 0"))))
        R = product(np.matmul, R, constant(_rotation(_numbers(origin, "rpy", "0 0 0"))))
        name, axis = joint.get("name"), axis / np.linalg.norm(axis)
        if name not in self.joints:
            return R, p
        if joint.get("type") == "prismatic":
            return R, add(p, product(np.matmul, R, tuple(x * axis for x in q[name])))
        K = np.cross(np.eye(3), axis)
        s, c = sine_and_cosine(q[name])
        turn = tuple(a * K - b * (K @ K) for a, b in zip(s, c, strict=True))
        return product(np.matmul, R, add(turn, constant(np.eye(3) + K @ K))), p

    def _open(self, q):
        """Return the distances that loops close."""
        places, errors = self._places(q), []
        for a, point_a, b, point_b in self.pairs:
            ends = [
                add(
                    product(np.matmul, places[link][0], constant(np.array(x, float))),
                    places[link][1],
                )
                for link, x in ((a, point_a), (b, point_b))
            ]
            errors.append(add(ends[0], tuple(-x for x in ends[1])))
        for name, (source, curve) in self.curves.items():
            one = add(q[name], tuple(-x for x in curve(q[source])))
            errors.append(tuple(np.atleast_1d(x) for x in one))
        return tuple(np.concatenate(part) for part in zip(*errors, strict=True))

    def close(self, q, a=None, b=None):
        """Return all positions of a state, with derivatives in the directions a and b of the independent joints."""
        zero = np.zeros(len(self.names))
        a, b = zero if a is None else a, zero if b is None else b
        all = {name: constant(self.start[name]) for name in self.followers}
        all |= {name: (*x, 0.0) for name, *x in zip(self.names, q, a, b, strict=True)}
        if not self.followers:
            return all
        for step in range(60):
            still = {name: constant(x[0]) for name, x in all.items()}
            J = np.array(
                [
                    self._open(still | {name: (still[name][0], 1.0, 0.0, 0.0)})[1]
                    for name in self.followers
                ]
            ).T
            change = np.linalg.lstsq(J, np.array(self._open(all)).T, rcond=1e-9)[0]
            change *= min(1.0, 0.3 / max(1e-300, np.abs(change[:, 0]).max()))
            for name, d in zip(self.followers, change, strict=True):
                all[name] = tuple(x - y for x, y in zip(all[name], d, strict=True))
            if step > 3 and np.abs(change).max() < 1e-13 * (
                1.0 + np.abs([all[name] for name in self.followers]).max()
            ):
                break
        assert np.abs(self._open(all)[0]).max() < 1e-11
        return all

    def _points(self, q, a, b):
        """Return masses, and their coordinates hyper-dual: points, then rotors."""
        all = self.close(q, a, b)
        places = self._places(all)
        masses = np.concatenate([np.repeat(m, 3) for m, _ in self.links.values()])
        x = []
        for link, (_, r) in self.links.items():
            turned = product(lambda R, r: r @ R.T, places[link][0], constant(r))
            x.append(add(turned, tuple(np.broadcast_to(p, r.shape) for p in places[link][1])))
        x = tuple(np.concatenate([np.ravel(one) for one in part]) for part in zip(*x, strict=True))
        rotors = tuple(np.array([all[name][k] for name in self.armature]) for k in range(4))
        masses = np.concatenate([masses, list(self.armature.values())])
        return masses, tuple(np.concatenate(part) for part in zip(x, rotors, strict=True))

    def at(self, q, qd):
        """Return M, c, gravity's torque, G of the followers, and ν, C and ε_g."""
        unit = np.eye(len(q))
        found = [self._points(q, e, qd) for e in unit]
        mass = found[0][0]
        J, turned = (np.array([x[k] for _, x in found]).T for k in (1, 3))
        weight = np.zeros_like(mass)
        count = len(mass) - len(self.armature)
        weight[:count] = np.tile(self.gravity, count // 3)
        M, rate = J.T @ (mass[:, None] * J), turned.T @ (mass[:, None] * J)
        c, g = J.T @ (mass * (turned @ qd)), -J.T @ (mass * weight)
        reverse = slice(None, None, -1)
        m = np.linalg.cholesky(M[reverse, reverse])[reverse, reverse]  # upper triangular
        inverse = np.linalg.inv(m)
        inner = inverse @ (rate + rate.T) @ inverse.T
        m_rate = m @ (np.triu(inner, 1) + 0.5 * np.diag(np.diag(inner)))
        return M, c, g, m.T @ qd, inverse @ c - m_rate.T @ qd, inverse @ g
