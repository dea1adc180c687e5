"""Writes the figures of docs/simulation.md: energy audits over minutes, and where Pinocchio and MuJoCo say that a robot goes.

python3 benchmarks/referees.py [seconds of the audits], in the sourced environment.
"""

import sys
import warnings
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "test"))

import diag_dynamics as dd  # noqa: E402
import test_simulation_bodies as bodies  # noqa: E402
import test_simulation_forces as forces  # noqa: E402
from oracles import Oracle  # noqa: E402
from robots import robot_path  # noqa: E402
from test_mujoco import Mujoco  # noqa: E402

PAGE = ROOT / "docs" / "simulation.md"
MARK = "<!-- figures, by benchmarks/referees.py -->"
END = "\n## In real time"

DURATION = 0.5
"""How long robots move that are compared [s]."""

MOVING = {
    "Panda": (forces.PANDA, False),
    "UR5": (forces.UR5, False),
    "Solo 12, flying": (bodies.SOLO, True),
    "Talos, flying": (bodies.TALOS, True),
}

AUDITED = {
    "Panda, its gripper coupled by mimicry": (forces.PANDA, {}, 2.0),
    "UR5": (forces.UR5, {}, 2.0),
    "Allegro hand, a hundredth of its friction": (forces.HAND, {}, 0.5),
    "Talos, flying": (forces.TALOS, {"floating_base": True}, 2.0),
}
"""Robots, options, and the largest random effort [N m]."""


def agreement(name):
    """A line of the first table: the distance to each referee after the same motion."""
    robot, floating = MOVING[name]
    path = robot_path(robot)
    model = dd.load_urdf(path, floating_base=floating, mimic="free")
    oracle = Oracle(path.read_text(), model.dof_names, floating_base=floating)
    q, qd = bodies.start(model, 1, speed=0.3)
    tau = 0.02 * np.random.default_rng(2).normal(size=model.nv)
    zero = np.zeros(model.nv)
    sim = dd.Simulation(model, q, qd, damping=zero, friction=zero, limits=False)
    sim.advance(tau, steps=round(DURATION / sim.step_size))
    pinocchio = bodies.distance(oracle, sim, *bodies.reference(oracle, q, qd, tau, DURATION, 2.5e-4))
    return f"| {name} | {model.nv} | {pinocchio:.1e} | {'—' if floating else f'{by_mujoco(path, model, q, qd, tau):.1e}'} |"


def by_mujoco(path, model, q, qd, tau):
    """Distance to MuJoCo's Runge-Kutta steps of 0.1 ms, with damping of 0.2 N m s/rad, which both have."""
    other = Mujoco(path.read_text(), model.dof_names, False)
    damping = np.full(model.nv, 0.2)
    other.model.opt.timestep, other.model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    other.model.dof_damping[other.dof] = damping
    other.place(q)
    other.data.qvel[other.dof] = qd
    other.data.qfrc_applied[other.dof] = tau
    for _ in range(round(DURATION / 1e-4)):
        mujoco.mj_step(other.model, other.data)
    sim = dd.Simulation(model, q, qd, damping=damping, friction=np.zeros(model.nv), limits=False)
    sim.advance(tau, steps=round(DURATION / sim.step_size))
    return np.linalg.norm(other.data.qpos[other.qpos] - sim.q) + np.linalg.norm(other.data.qvel[other.dof] - sim.qd)


def audit(name, seconds, order):
    """A line of the second table."""
    robot, options, largest = AUDITED[name]
    model = dd.load_urdf(robot_path(robot), **options)
    friction = 0.01 * model.friction if robot == forces.HAND else None
    sim = dd.Simulation(model, friction=friction, order=order)
    audits = forces.driven(sim, seconds, largest)
    a = audits[-1]
    numbers = (a.effort, a.wrenches, a.damping, a.friction, a.limits, a.kinetic + a.potential)
    turnover = sum(
        max(0.0, y.effort - x.effort) + max(0.0, y.wrenches - x.wrenches) for x, y in forces.pairwise(audits)
    )
    cells = [name, f"{order}", *(f"{x:.4g}" for x in numbers), f"{a.residual:.1e}", f"{abs(a.residual) / turnover:.0e}"]
    return f"| {' | '.join(cells)} |"


def main():
    """Measure, print, and put the figures into the page."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 120.0
    warnings.simplefilter("ignore", dd.InertiaWarning)
    lines = [
        f"Distance after {DURATION} s of free motion, |Δq| + |Δq̇| [rad, m, and per second], steps of 1 ms, order 4:",
        "",
        "| robot | nv | Pinocchio: `aba`, Runge–Kutta–Munthe-Kaas of 0.25 ms | MuJoCo: RK4 of 0.1 ms, damped |",
        "|---|---|---|---|",
        *(agreement(name) for name in MOVING),
        "",
        f"Energy [J] over {seconds:g} s at 1 ms, random efforts and pushes on the last link for 50 ms each, hard limits:",
        "",
        "| robot | order | efforts | wrenches | damping | friction | limits | ΔK + ΔU | residual | of the work put in |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *(audit(name, seconds, order) for name in AUDITED for order in (4, 1) if order == 4 or "flying" not in name),
    ]
    print("\n".join(lines))
    before, _, figures = PAGE.read_text(encoding="utf-8").partition(MARK)
    _, end, after = figures.partition(END)
    PAGE.write_text(before + MARK + "\n\n" + "\n".join(lines) + "\n" + end + after, encoding="utf-8")


if __name__ == "__main__":
    main()
