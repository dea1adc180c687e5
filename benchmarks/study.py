# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Study of control in (ν, ε) against joint PD, computed torque and Cartesian impedance: `make study`.

The plant is Pinocchio, which shares no code with the laws. Everything is simulated from fixed seeds. The run writes
study.json, study.md and plots into results, and the generated parts of docs/control-study.md.
"""

import argparse
import json
import os
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pinocchio as pin
import study_page

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

STEP, PERIOD = 2.5e-4, 1e-3  # [s] of the plant and of the loop
PEAK = (
    0.7  # peak torque of every tuned law in the nominal case, relative to the joints' effort limits
)
FRICTION, CREEP = (
    0.02,
    5e-3,
)  # Coulomb friction relative to effort limits; velocity of its tanh(1) [rad/s, m/s]
SETTLED = 0.05  # distance from the place of rest relative to the step
RUNAWAY = 100.0  # velocity of a diverged run [rad/s, m/s]
FINGER = 0.015  # step of fingers [m]


class Robot(NamedTuple):
    """A robot: the regulated link, home, locked joints, mimic joints with their sources, and the step of a joint [rad]."""

    name: str
    link: str
    home: tuple
    locked: Mapping = MappingProxyType({})
    mimic: Mapping = MappingProxyType({})
    step: float = 0.4


PANDA, TALOS = (
    (0, -0.5, 0, -2, 0, 1.6, 0.8),
    (0, 0.1, 0.2, 0.3, 0.2, -1.2, 0.2, -0.2, -0.3, -0.2, -1.2, -0.2),
)
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
UPPER = {"torso_1_joint", "torso_2_joint"} | {
    f"arm_{side}_{k}_joint" for side in ("left", "right") for k in range(1, 6)
}
ROBOTS = {
    "Panda": Robot("panda", "panda_hand", PANDA, dict.fromkeys(FINGERS, 0.02)),
    "UR5": Robot("ur5", "tool0", (0.0, -1.2, 1.4, -0.6, 1.2, 0.3)),
    "Talos, 12 joints": Robot("talos_reduced", "arm_left_7_link", TALOS, step=0.25),
    "Panda with fingers": Robot(
        "panda", "panda_hand", (*PANDA, 0.02), mimic={FINGERS[1]: FINGERS[0]}
    ),
}


class Rigid:
    """Rigid-body quantities of independent joints by Pinocchio: rates of all joints are G q̇."""

    def __init__(self, label, scale=1.0, payload=0.0):
        robot = ROBOTS[label]
        full = pin.buildModelFromUrdf(str(find_urdf(robot.name)))
        self.locked, q = dict(robot.locked), pin.neutral(full)
        if robot.name == "talos_reduced":
            self.locked = dict.fromkeys((name for name in full.names[1:] if name not in UPPER), 0.0)
        for name, value in self.locked.items():
            q[full.joints[full.getJointId(name)].idx_q] = value
        self.model = model = pin.buildReducedModel(
            full, [full.getJointId(name) for name in self.locked], q
        )
        for inertia in model.inertias:
            inertia.mass, inertia.inertia = scale * inertia.mass, scale * inertia.inertia
        self.frame = model.getFrameId(robot.link)
        if payload:
            frame = model.frames[self.frame]
            at = frame.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1]))
            model.appendBodyToJoint(frame.parentJoint, pin.Inertia.FromSphere(payload, 0.05), at)
        self.data, every = model.createData(), list(model.names[1:])
        self.names = [name for name in every if name not in robot.mimic]
        self.used = [every.index(name) for name in self.names]
        self.G = np.array(
            [[float(robot.mimic.get(name, name) == x) for x in self.names] for name in every]
        )
        self.limit, self.home = model.effortLimit[self.used], np.array(robot.home, dtype=float)

    def mass(self, q):
        """Return M, shape (n, n)."""
        return self.G.T @ pin.crba(self.model, self.data, self.G @ q) @ self.G

    def bias(self, q, qd):
        """Return Coriolis and gravity torques [N m, N]."""
        return self.G.T @ pin.nle(self.model, self.data, self.G @ q, self.G @ qd)

    def gravity(self, q):
        """Return gravity torques [N m, N]."""
        return self.G.T @ pin.computeGeneralizedGravity(self.model, self.data, self.G @ q)

    def pose(self, q):
        """Return position and rotation of the link."""
        pin.forwardKinematics(self.model, self.data, self.G @ q)
        placement = pin.updateFramePlacement(self.model, self.data, self.frame)
        return placement.translation.copy(), placement.rotation.copy()

    def jacobian(self, q):
        """Return the link's Jacobian in the root's axes, shape (6, n)."""
        return (
            pin.computeFrameJacobian(
                self.model, self.data, self.G @ q, self.frame, pin.LOCAL_WORLD_ALIGNED
            )
            @ self.G
        )

    def energies(self, q, qd):
        """Return the kinetic energy [J] of each row."""
        return np.array([0.5 * float(v @ self.mass(x) @ v) for x, v in zip(q, qd, strict=True)])

    def random(self, rng):
        """Return a random pose within the joint limits and 2.5 rad."""
        lower, upper = (
            self.model.lowerPositionLimit[self.used],
            self.model.upperPositionLimit[self.used],
        )
        return rng.uniform(np.maximum(lower, -2.5), np.minimum(upper, 2.5))


class Plant(Rigid):
    """A simulated robot: semi-implicit steps, implicit in the friction."""

    def __init__(self, label, scale=1.0, payload=0.0, friction=0.0):
        super().__init__(label, scale, payload)
        self.friction, self.plain = friction * self.limit, not friction and not ROBOTS[label].mimic
        self.q, self.qd = self.home.copy(), np.zeros(len(self.home))

    def advance(self, tau, period):
        """Hold torques for a period [s]."""
        for _ in range(round(period / STEP)):
            q, qd = self.q, self.qd
            if self.plain:
                qdd = pin.aba(self.model, self.data, q, qd, tau)
            else:
                drag = self.friction * np.tanh(qd / CREEP)
                slope = self.friction / np.maximum(np.abs(qd), CREEP)
                qdd = np.linalg.solve(
                    self.mass(q) + np.diag(STEP * slope), tau - drag - self.bias(q, qd)
                )
            self.qd = qd + STEP * qdd
            self.q = q + STEP * self.qd


@cache
def nominal(label):
    """Return the robot that laws are designed with, its home's mass matrix, and its DiagonalDynamics."""
    rigid, robot = Rigid(label), ROBOTS[label]
    locked = {name: value for name, value in rigid.locked.items() if name != FINGERS[1]}
    dyn = dd.DiagonalDynamics(dd.load_robot(robot.name, locked_joints=locked))
    if list(dyn.model.dof_names) != rigid.names:
        raise SystemExit(f"joints are {dyn.model.dof_names}; expected {rigid.names}.")
    return rigid, rigid.mass(rigid.home), dyn


# --- Laws: functions of q, qd and a target (q, qd, qdd); a scale x [1/s] sets all gains


def joint_gains(label, x, ratio=1.0):
    """Return joint stiffness, with limits reached at 1 rad or 1 m for x = 10, and damping with a ratio at home."""
    rigid, M, _ = nominal(label)
    K = (x / 10.0) ** 2 * rigid.limit
    return K, 2.0 * ratio * np.sqrt(K * np.diag(M))


def nu_joints(label, x):
    """JointRegulation, critically damped."""
    law = dd.JointRegulation(nominal(label)[2], joint_gains(label, x)[0], 1.0)
    return lambda q, qd, target: law.command(q, qd, *target).tau


def nu_tracking(label, x, bound=0.0):
    """JointTracking: both poles at x."""
    law = dd.JointTracking(nominal(label)[2], x, x, bound=bound, width=0.3)
    return lambda q, qd, target: law.command(q, qd, *target).tau


LINEAR, ANGULAR = 4.0, 0.4  # stiffness at x = 1 [N/m, N m/rad]


def nu_pose(label, x):
    """PoseRegulation, critically damped: its target moves, but has no velocity."""
    gains = {"position_stiffness": LINEAR * x * x, "orientation_stiffness": ANGULAR * x * x}
    rigid, _, dyn = nominal(label)
    law = dd.PoseRegulation(dyn, ROBOTS[label].link, damping_ratio=1.0, null_frequency=x, **gains)

    def command(q, qd, target):
        law.aim(*rigid.pose(target[0]))
        return law.command(q, qd).tau

    return command


def joint_pd(label, x):
    """Joint PD and gravity compensation, critically damped at home joint by joint."""
    rigid, (K, D) = nominal(label)[0], joint_gains(label, x)
    return lambda q, qd, target: rigid.gravity(q) + K * (target[0] - q) + D * (target[1] - qd)


def computed_torque(label, x):
    """Computed torque: both poles at x."""
    rigid = nominal(label)[0]

    def command(q, qd, target):
        q_d, qd_d, qdd_d = target
        return rigid.mass(q) @ (qdd_d + x * x * (q_d - q) + 2.0 * x * (qd_d - qd)) + rigid.bias(
            q, qd
        )

    return command


def impedance(label, x):
    """Cartesian impedance: damping is critical at home, the null space is damped at the rate 2x."""
    rigid = nominal(label)[0]
    K = x * x * np.repeat([LINEAR, ANGULAR], 3)

    def inertia(q):
        J, M = rigid.jacobian(q), rigid.mass(q)
        return J, M, np.linalg.pinv(J @ np.linalg.solve(M, J.T), rcond=1e-6, hermitian=True)

    def root_of(A):
        values, axes = np.linalg.eigh(A)
        return axes * np.sqrt(values.clip(0.0)) @ axes.T

    root = root_of(inertia(rigid.home)[2])
    inverse = np.linalg.pinv(root, rcond=1e-4)
    D = 2.0 * root @ root_of(inverse @ np.diag(K) @ inverse) @ root

    def command(q, qd, target):
        (position, axes), (p, R) = rigid.pose(target[0]), rigid.pose(q)
        error = np.concatenate([position - p, pin.log3(axes @ R.T)])
        moving = rigid.jacobian(target[0]) @ target[1]
        J, M, reflected = inertia(q)
        null = 2.0 * x * (M @ qd - J.T @ (reflected @ (J @ qd)))
        return rigid.gravity(q) + J.T @ (K * error + D @ (moving - J @ qd)) - null

    return command


LAWS = {
    "ν joints": nu_joints,
    "ν tracking": nu_tracking,
    "ν robust": lambda label, x: nu_tracking(label, x, 20.0),
    "ν pose": nu_pose,
    "joint PD": joint_pd,
    "computed torque": computed_torque,
    "impedance": impedance,
}
OMITTED = ("ν robust", "regulation")  # its bound alone takes the peak torque of a step


# --- Regulation and tracking


class Condition(NamedTuple):
    """What differs from the model and the loop that a law was tuned with."""

    scale: float = 1.0
    payload: float = 0.0
    friction: float = 0.0
    period: float = PERIOD
    delay: int = 0  # periods


NOMINAL = Condition()
CONDITIONS = {
    "nominal, 1 kHz": NOMINAL,
    "masses +20 %": Condition(scale=1.2),
    "masses −20 %": Condition(scale=0.8),
    "payload 2 kg": Condition(payload=2.0),
    "friction": Condition(friction=FRICTION),
    "200 Hz": Condition(period=5 * PERIOD),
    "delay 2 ms": Condition(delay=2),
}
SECONDS = {"regulation": 2.5, "tracking": 4.0}
TRANSIENT = 1.0  # [s] of tracking that its rms error leaves out


def target_of(label, task):
    """Return the target as a function of time: a step from home, or sines that begin 0.1 rad away from the robot."""
    rigid, size = nominal(label)[0], ROBOTS[label].step
    home, n = rigid.home, len(rigid.home)
    unit = np.where(np.arange(n) % 2, -1.0, 1.0) * [
        FINGER / size if "finger" in name else 1.0 for name in rigid.names
    ]
    step, pace = size * unit, np.linspace(1.5, 3.0, n)
    if task == "regulation":
        return lambda t: (home + step, np.zeros(n), np.zeros(n))

    def sines(t):
        angle = pace * t
        q = home + 0.1 * unit + step * (1 - np.cos(angle))
        return q, step * pace * np.sin(angle), step * pace**2 * np.cos(angle)

    return sines


def run(label, law, target, seconds, condition=NOMINAL, *, stop=np.inf, push=None, start=None):
    """Return times, q, qd and torques of a run, which ends where it diverges or a torque exceeds `stop` limits.

    `push` is a torque as a function of time and q; `start` are q and qd, by default home at rest.
    """
    plant, rows = Plant(label, condition.scale, condition.payload, condition.friction), []
    if start is not None:
        plant.q, plant.qd = start
    waiting = [plant.gravity(plant.q)] * condition.delay
    for k in range(round(seconds / condition.period)):
        t, q, qd = k * condition.period, plant.q, plant.qd
        waiting.append(law(q, qd, target(t)))
        tau = waiting.pop(0)
        rows.append((t, q, qd, tau))
        if not np.abs(qd).max() < RUNAWAY or (np.abs(tau) > stop * plant.limit).any():
            break
        plant.advance(tau if push is None else tau + push(t, q), condition.period)
    return [np.array(column) for column in zip(*rows, strict=True)]


def tune(label, name, task):
    """Return the scale of gains whose nominal run has the peak torque PEAK, by bisection of its logarithm."""
    low, high, count, target = 0.5, 60.0, round(SECONDS[task] / PERIOD), target_of(label, task)
    while high > 1.005 * low:
        middle = float(np.sqrt(low * high))
        done = (
            len(run(label, LAWS[name](label, middle), target, SECONDS[task], stop=PEAK)[0]) == count
        )
        low, high = (middle, high) if done else (low, middle)
    return low


def judge(label, task, times, q, qd, tau):
    """Return figures of a run by name; of one that diverged none."""
    if times[-1] + 6 * PERIOD < SECONDS[task]:
        return None
    rigid, target = nominal(label)[0], target_of(label, task)
    chosen = slice(None, None, max(1, round(2 * PERIOD / times[1])))
    hand = np.array([rigid.pose(x)[0] for x in q[chosen]])
    error = np.array([rigid.pose(target(t)[0])[0] for t in times[chosen]]) - hand
    power = np.abs(tau * qd).sum(axis=1)
    figures = {
        "peak": float((np.abs(tau) / rigid.limit).max()),
        "energy": float(power.mean() * SECONDS[task]),
    }
    if task == "tracking":
        late = times[chosen] >= TRANSIENT
        return figures | {"rms": 1e3 * float(np.sqrt((error[late] ** 2).sum(axis=1).mean()))}
    away, size = hand - hand[-1], np.linalg.norm(error[0])
    direction = (hand[-1] - hand[0]) / np.linalg.norm(hand[-1] - hand[0])
    outside = np.flatnonzero(np.linalg.norm(away, axis=1) > SETTLED * size)
    return figures | {
        "settling": float(times[chosen][outside[-1]]),
        "overshoot": 100.0 * float(max(0.0, (away @ direction).max()) / size),
        "final": 1e3 * float(np.linalg.norm(error[-1])),
    }


def contest(label, name, task):
    """Return the scale of a law and its figures by condition."""
    x = tune(label, name, task)
    law, target = LAWS[name](label, x), target_of(label, task)
    runs = {key: run(label, law, target, SECONDS[task], one) for key, one in CONDITIONS.items()}
    figures = {key: judge(label, task, *columns) for key, columns in runs.items()}
    return {"robot": label, "law": name, "task": task, "scale": x, "figures": figures}


# --- Damping, coupling and energy limits


RATE = 5.0  # damping rate c [1/s], √(q/r) of the cost; r is 1
RATIO, SHARE = 0.7, 0.4  # damping ratio; limit of ½ν_k² relative to that of the sum
LONG = 3.0  # [s] of a step with limits


def damping(label, starts):
    """Return rates of decay of K relative to 2c, and costs relative to √(qr) K(0), by law, an entry for each start."""
    (rigid, M, dyn), rng = nominal(label), np.random.default_rng(1)
    D = RATE * np.diag(M)
    laws = {f"ν, {c:g}": dd.RateDamping(dyn, c) for c in (RATE, RATE / 2, 2 * RATE)}
    calls = {key: lambda q, qd, _, law=law: law.command(q, qd).tau for key, law in laws.items()}
    calls["joint damping"] = lambda q, qd, _: rigid.gravity(q) - D * qd
    found = {key: {"rate": [], "cost": []} for key in calls}
    for _ in range(starts):
        start = rigid.random(rng), rng.normal(size=len(M))
        for key, law in calls.items():
            t, q, qd, tau = run(label, law, lambda t: None, 2.0, start=start)
            K, u = (
                rigid.energies(q, qd),
                [one - rigid.gravity(x) for one, x in zip(tau, q, strict=True)],
            )
            efforts = np.array(
                [one @ np.linalg.solve(rigid.mass(x), one) for one, x in zip(u, q, strict=True)]
            )
            found[key]["rate"].append(float(np.log(K[0] / K[400]) / (2 * RATE * t[400])))
            found[key]["cost"].append(
                float(np.sum(RATE**2 * K + 0.5 * efforts)) * PERIOD / float(RATE * K[0])
            )
    return {"robot": label, "laws": found}


def ratios(label, poses):
    """Return least damping ratios of all modes by law, sorted over the poses; laws are tuned alike at home."""
    (rigid, M, dyn), rng, n = nominal(label), np.random.default_rng(2), len(nominal(label)[1])
    K, D = joint_gains(label, 10.0, RATIO)
    law, middle = (
        dd.JointRegulation(dyn, K, RATIO),
        np.sqrt(np.trace(np.linalg.solve(M, np.diag(K))) / n),
    )
    found = {"ζ law": [], "constant c": [], "joint damping": []}
    for _ in range(poses):
        q = rigid.random(rng)
        M, units = rigid.mass(q), 1e-3 * np.eye(n)
        taus = [[law.command(q, sign * unit, q).tau for unit in units] for sign in (-1.0, 1.0)]
        matrices = (np.array(taus[0]) - taus[1]).T / 2e-3, 2 * RATIO * middle * M, np.diag(D)
        for least, damped in zip(found.values(), matrices, strict=True):
            below = np.linalg.solve(M, np.hstack([-np.diag(K), -damped]))
            poles = np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, n), below]))
            least.append(float((-poles.real / np.abs(poles)).min()))
    return {"robot": label, "laws": {key: sorted(least) for key, least in found.items()}}


def coupling(label, scales):
    """Return, by law, how far other joints move relative to a disturbed one, and its own way [rad]: medians over joints."""
    rigid, found = nominal(label)[0], {}
    home = rigid.home, 0.0 * rigid.home, 0.0 * rigid.home
    for name, x in scales.items():
        law, rows = LAWS[name](label, x), []
        for k in [k for k, joint in enumerate(rigid.names) if "finger" not in joint]:
            pulse = 0.2 * rigid.limit * (np.arange(len(rigid.limit)) == k)
            q = run(
                label, law, lambda t: home, 1.0, push=lambda t, _, pulse=pulse: pulse * (t < 0.1)
            )[1]
            way = np.abs(q - rigid.home).max(axis=0)
            rows.append((max(w for j, w in enumerate(way) if j != k), way[k]))
        others, own = np.array(rows).T
        found[name] = {"coupling": float(np.median(others / own)), "own": float(np.median(own))}
    return {"robot": label, "laws": found}


def energies(label, x):
    """Return figures of K on a step by limiter, of the worst of four pushes of 40 N for 0.2 s at the link."""
    rigid, _, dyn = nominal(label)
    law, target = (
        dd.JointRegulation(dyn, joint_gains(label, x)[0], 1.0),
        target_of(label, "regulation"),
    )
    found, bound, tau = {}, np.inf, rigid.gravity(rigid.home)
    forces = np.random.default_rng(3).normal(size=(4, 3))
    forces *= 40.0 / np.linalg.norm(forces, axis=1, keepdims=True)

    def measure(kind, force):
        observer, clock = dd.DisturbanceObserver(dyn, 50.0, effort="held"), iter(range(10000))
        share = SHARE * bound if "joints" in kind else np.inf
        limiter = dd.EnergyLimiter(dyn, bound, share, 100.0)

        def limited(q, qd, to):
            nonlocal tau
            seen = observer.update(PERIOD * next(clock), q, qd, tau)
            external = seen.residual if "observer" in kind and seen.valid else None
            tau = limiter.filter(q, qd, law.command(q, qd, *to), PERIOD, external).tau
            return tau

        def push(t, q):
            return rigid.jacobian(q)[:3].T @ force if 0.3 <= t < 0.5 else 0.0 * q

        t, q, qd, _ = run(label, limited, target, 1.5, push=push)
        largest = max(
            float(dyn.evaluate(*state).energy_share.max()) for state in zip(q, qd, strict=True)
        )
        return t, rigid.energies(q, qd), largest

    for kind in ("none", "sum", "sum, observer", "joints", "joints, observer"):
        runs = [measure(kind, force) for force in forces]
        bound = bound if np.isfinite(bound) else 0.1 * float(runs[0][1].max())
        above = [t[bound * 1.01 < K] for t, K, _ in runs]
        found[kind] = {
            "peak": max(float(K.max() / bound) for _, K, _ in runs),
            "joint": max(largest / (SHARE * bound) for *_, largest in runs),
            "recovery": max([0.0, *(float(times[-1] - 0.5) for times in above if len(times))]),
        }
    return {"robot": label, "limit": bound, "laws": found}


def costs(label, x):
    """Return when a step is settled without limits, with one of K, and in Limits, which limit effort rates, too."""
    rigid, _, dyn = nominal(label)
    law = dd.JointRegulation(dyn, joint_gains(label, x)[0], 1.0)
    target, found = target_of(label, "regulation"), {}

    def settling(torque):
        t, q, qd, _ = run(label, torque, target, LONG)
        away = np.abs((q - target(0.0)[0]) / (q[0] - target(0.0)[0])).max(axis=1)
        energy = rigid.energies(q, qd).max()
        return {"settling": float(t[np.flatnonzero(away > SETTLED)[-1]]), "peak": float(energy)}

    def free(q, qd, to):
        return law.command(q, qd, *to).tau

    def limited(q, qd, to):
        return limiter.filter(q, qd, law.command(q, qd, *to), PERIOD).tau

    def in_limits(q, qd, to):
        return limits.filter(q, qd, law.command(q, qd, *to), PERIOD).effort

    found["none"] = settling(free)
    bound = 0.1 * found["none"]["peak"]
    limiter = dd.EnergyLimiter(dyn, bound, rate=100.0)
    limits = dd.Limits(dyn, energy_limit=bound, energy_rate=100.0)
    found["EnergyLimiter"] = settling(limited)
    found["Limits"] = settling(in_limits)
    return {"robot": label, "limit": bound, "laws": found}


# --- The whole study


def study(robots, names, starts, poses):
    """Return all results of some robots and laws."""
    with ProcessPoolExecutor(2) as pool:
        pairs = [(label, name, task) for label in robots for task in SECONDS for name in names]
        jobs = {"contests": [pool.submit(contest, *pair) for pair in pairs if pair[1:] != OMITTED]}
        jobs["damping"] = [pool.submit(damping, label, starts) for label in robots]
        jobs["ratios"] = [pool.submit(ratios, label, poses) for label in robots]
        scales = {label: {} for label in robots}
        for one in (job.result() for job in jobs["contests"]):
            if one["task"] == "regulation" and one["law"] not in ("ν pose", "impedance"):
                scales[one["robot"]][one["law"]] = one["scale"]
        jobs["coupling"] = [pool.submit(coupling, label, scales[label]) for label in robots]
        jobs["energies"] = [
            pool.submit(energies, label, scales[label]["ν joints"]) for label in robots
        ]
        jobs["costs"] = [pool.submit(costs, label, scales[label]["ν joints"]) for label in robots]
        return {key: [rounded(job.result()) for job in some] for key, some in jobs.items()}


def with_costs():
    """Return the last results with new costs of limits."""
    found = json.loads((study_page.RESULTS / "study.json").read_text(encoding="utf-8"))
    scales = {(one["robot"], one["law"], one["task"]): one["scale"] for one in found["contests"]}
    robots = {label: scales[label, "ν joints", "regulation"] for label in ("Panda", "UR5")}
    found["costs"] = [rounded(costs(label, x)) for label, x in robots.items()]
    return found


def rounded(value):
    """Return a result with four digits."""
    if isinstance(value, dict):
        return {key: rounded(one) for key, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


def main():
    """Run the study, and write data, tables, plots and the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument(
        "--short", action="store_true", help="a minute: two laws of a UR5, into build/study"
    )
    options.add_argument(
        "--output", type=Path, metavar="FOLDER", help="default: benchmarks/results and the page"
    )
    options.add_argument(
        "--costs", action="store_true", help="a minute: only what limits cost a Panda and a UR5"
    )
    chosen = options.parse_args()
    few, full = (["UR5"], ["ν joints", "joint PD"], 1, 20), (list(ROBOTS), list(LAWS), 10, 300)
    found = with_costs() if chosen.costs else study(*(few if chosen.short else full))
    folder = chosen.output or (
        study_page.RESULTS.parents[1] / "build/study" if chosen.short else study_page.RESULTS
    )
    folder.mkdir(parents=True, exist_ok=True)
    parts = {
        key: ",\n".join(json.dumps(one, ensure_ascii=False) for one in some)
        for key, some in found.items()
    }
    text = ",\n".join(f'"{key}": [\n{lines}]' for key, lines in parts.items())
    (folder / "study.json").write_text(f"{{\n{text}\n}}\n", encoding="utf-8")
    study_page.write(folder, official=folder == study_page.RESULTS)
    print(f"Written: {folder}")


if __name__ == "__main__":
    main()
