# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot that moves by itself, for the page without ROS: ``python3 -m diag_dynamics.demos.moving_robot panda``.

Every joint follows a sine, by the efforts that this takes; now and then something pushes the end-effector link.
"""

from __future__ import annotations

import argparse
import math
import threading
import time
from collections.abc import Sequence

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.model import RobotModel, end_effector_link, load_urdf
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.page.frames import States
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.page.stream import Received, RobotStream

PORT = 8420
"""Where the page is, unless told otherwise."""

EVERY, LASTING, FORCE = 6.0, 0.4, 25.0
"""Time from push to push, how long each lasts [s], and its force [N]."""


class MovingRobot:
    """States of a robot in motion, as a driver sends them: number k at k/rate.

    Parameters
    ----------
    model : RobotModel
    rate : float
        States per second.
    clock : callable
        Gives the time [s].
    """

    def __init__(self, model: RobotModel, rate: float = 500.0, clock=time.monotonic) -> None:
        self.model, self.rate, self._clock = model, rate, clock
        self._dynamics = DiagonalDynamics(model)
        where = {name: k for k, name in enumerate(model.coordinate_names)}
        self._at = [(k, where[name]) for k, name in enumerate(model.dof_names) if name in where]
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper)
        span = np.where(bounded, model.upper - model.lower, 2.0)
        self._centre = np.where(bounded, np.where(bounded, model.lower, 0.0) + 0.5 * span, model.neutral)
        self._swing = np.minimum(0.35 * span, 0.7)
        self._limits = (*np.full(model.nv, 12.0), math.inf, 8.0)
        self._end_effector = end_effector_link(model)
        self._dynamics.epsilon_from_tau(*self.state(0.0)[:2])  # compiled before time begins
        self._first_clock, self._first_stamp, self._last = clock(), time.time(), -1

    def state(self, t: float) -> tuple[Array, Array, Array, Array]:
        """Positions, rates, efforts, and the external torque that is among what acts, at a time [s]."""
        model, dyn = self.model, self._dynamics
        q, (qd, qdd) = self._centre.copy(), np.zeros((2, model.nv))
        for k, at in self._at:
            pace = 2.0 * math.pi * (0.15 + 0.25 * ((k + 1) * 0.618 % 1.0))
            swing = (-1.0) ** k * self._swing[at]
            q[at] += swing * math.sin(pace * t)
            qd[k], qdd[k] = swing * pace * math.cos(pace * t), -swing * pace**2 * math.sin(pace * t)
        pushed = (t % EVERY) / LASTING
        force = FORCE * math.sin(math.pi * pushed) if pushed < 1.0 else 0.0
        external = dyn.jacobian(q, self._end_effector, frame="world")[1] * force
        return q, qd, dyn.inverse_dynamics(q, qd, qdd) + dyn.friction_torque(qd) - external, external

    def take(self, dynamics: DiagonalDynamics) -> Received | None:
        """The newest state, for RobotStream."""
        now = self._clock() - self._first_clock
        k = int(now * self.rate)
        if k <= self._last:
            return None
        count, self._last = k - self._last, k
        t = k / self.rate
        q, qd, tau, external = self.state(t)
        r = dynamics.epsilon_from_tau(q, external)
        norm = float(np.linalg.norm(r))
        colliding = bool((np.abs([*external, norm]) > [*self._limits[: self.model.nv], self._limits[-1]]).any())
        observed = {"residual": r[None], "external_torque": external[None], "norm": np.array([norm])}
        states = States.of(
            *(self._first_stamp + t, q, qd, tau, dynamics.evaluate(q, qd, tau)),
            **observed,
            collision=colliding,
            latency=now - t,
        )
        return Received(states, self._first_clock + t, count, self._limits)


def stream_of(urdf, rate: float, name: str = "/") -> RobotStream:
    """Return the stream of a moving robot, by the path of its URDF."""
    model = load_urdf(urdf, massless="lock")
    stream = RobotStream(name, MovingRobot(model, rate).take)
    meshes = MeshLibrary(mesh_folders(urdf))
    stream.set_robot(DiagonalDynamics(model), scene_of(model, urdf, meshes), meshes)
    values = {"joint states": f"{rate:g}/s"}
    stream.set_diagnostics([{"level": 0, "name": f"{name}: joint states", "message": "as expected", "values": values}])
    return stream


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve one or several moving robots until Ctrl-C."""
    parser = argparse.ArgumentParser(prog="moving_robot", description=__doc__)
    parser.add_argument("robots", nargs="*", default=["panda"], help="example robots, or paths of URDFs")
    parser.add_argument("--rate", type=float, default=500.0, help="states per second (default %(default)s)")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default %(default)s)")
    parser.add_argument("--port", type=int, default=PORT, help="0: any free one (default %(default)s)")
    chosen = parser.parse_args(arguments)
    try:
        names = ["/"] if len(chosen.robots) == 1 else [f"/{robot}_{k}" for k, robot in enumerate(chosen.robots)]
        streams = [
            stream_of(find_urdf(robot), chosen.rate, name) for robot, name in zip(chosen.robots, names, strict=True)
        ]
        server = PageServer(lambda: streams, chosen.host, chosen.port)
    except DiagDynamicsError as error:
        parser.error(str(error))
    print(f"{', '.join(chosen.robots)}: {server.address}", flush=True)
    server.start()
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        server.stop()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
