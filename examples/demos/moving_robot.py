# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page without ROS: robots whose joints follow sines, and whose end-effector link something pushes now and then."""

import argparse
import math
import threading
import time
from pathlib import Path

import numpy as np

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.model import end_effector_link
from diag_dynamics.page.frames import States
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.page.stream import Received, RobotStream

PERIOD, DURATION, FORCE = 6.0, 0.4, 25.0
"""Time from push to push and duration of each [s], force [N]."""


class MovingRobot:
    """States of a robot in motion, as a driver publishes them: number k at k/rate."""

    def __init__(self, model, rate=500.0):
        self.model, self.rate, self._dynamics = model, rate, dd.DiagonalDynamics(model)
        indices = {name: k for k, name in enumerate(model.coordinate_names)}
        self._indices = [
            (k, indices[name]) for k, name in enumerate(model.dof_names) if name in indices
        ]
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper)
        span = np.where(bounded, model.upper - model.lower, 2.0)
        self._centre = np.where(
            bounded, np.where(bounded, model.lower, 0.0) + 0.5 * span, model.neutral
        )
        self._amplitude = np.minimum(0.35 * span, 0.7)
        self._limits = (*np.full(model.nv, 12.0), math.inf, 8.0)
        self._dynamics.epsilon_from_tau(*self.state(0.0)[:2])  # compiled before time begins
        self._first_clock, self._first_stamp, self._last = time.monotonic(), time.time(), -1

    def state(self, t):
        """Return positions, rates, efforts and the external torque at a time [s]."""
        dynamics, q, (qd, qdd) = self._dynamics, self._centre.copy(), np.zeros((2, self.model.nv))
        for k, index in self._indices:
            w = 2.0 * math.pi * (0.15 + 0.25 * ((k + 1) * 0.618 % 1.0))
            amplitude = (-1.0) ** k * self._amplitude[index]
            q[index] += amplitude * math.sin(w * t)
            qd[k], qdd[k] = amplitude * w * math.cos(w * t), -amplitude * w**2 * math.sin(w * t)
        phase = (t % PERIOD) / DURATION
        force = FORCE * math.sin(math.pi * phase) if phase < 1.0 else 0.0
        external = dynamics.jacobian(q, end_effector_link(self.model), frame="world")[1] * force
        return (
            q,
            qd,
            dynamics.inverse_dynamics(q, qd, qdd) + dynamics.friction_torque(qd, q) - external,
            external,
        )

    def take(self, dynamics):
        """Return the newest state for the stream, or None."""
        now = time.monotonic() - self._first_clock
        k = int(now * self.rate)
        if k <= self._last:
            return None
        count, self._last, t = k - self._last, k, k / self.rate
        q, qd, tau, external = self.state(t)
        residual = dynamics.epsilon_from_tau(q, external)
        norm = float(np.linalg.norm(residual))
        collision = bool(
            (np.abs([*external, norm]) > [*self._limits[: self.model.nv], self._limits[-1]]).any()
        )
        observed = {
            "residual": residual[None],
            "external_torque": external[None],
            "norm": np.array([norm]),
        }
        state = self._first_stamp + t, q, qd, tau, dynamics.evaluate(q, qd, tau)
        states = States.of(*state, **observed, collision=collision)
        return Received(states, self._first_clock + t, count, self._limits)


def make_stream(urdf, rate, name):
    """Return the stream of a moving robot, by the path of its URDF."""
    model, meshes = dd.load_urdf(urdf, massless="lock"), MeshLibrary(mesh_folders(urdf))
    stream = RobotStream(name, MovingRobot(model, rate).take)
    stream.set_robot(dd.DiagonalDynamics(model), scene_of(model, urdf, meshes), meshes)
    status = {"level": 0, "name": f"{name}: joint states", "message": "as expected"}
    stream.set_diagnostics([status | {"values": {"joint states": f"{rate:g}/s"}}])
    return stream


def main():
    """Serve moving robots until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "robots", nargs="*", default=["panda"], help="example robots, or paths of URDFs"
    )
    parser.add_argument(
        "--rate", type=float, default=500.0, help="states per second (default: 500)"
    )
    parser.add_argument("--port", type=int, default=8420, help="0: any free one (default: 8420)")
    chosen = parser.parse_args()
    names = (
        ["/"]
        if len(chosen.robots) == 1
        else [f"/{Path(robot).stem}_{k}" for k, robot in enumerate(chosen.robots)]
    )
    robots = zip(chosen.robots, names, strict=True)
    streams = [make_stream(find_urdf(robot), chosen.rate, name) for robot, name in robots]
    server = PageServer(lambda: streams, "127.0.0.1", chosen.port)
    print(f"{', '.join(chosen.robots)}: {server.address}", flush=True)
    server.start()
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        server.stop()


if __name__ == "__main__":
    main()
