# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write the figures of results/simulation.md: energy audits over minutes, and agreement with Pinocchio and MuJoCo.

python3 benchmarks/referees.py [seconds of the audits], in the sourced environment.
"""

import sys
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [
    str(ROOT / "test" / folder) for folder in ("library", "support")
]  # the scenes are those of the tests

import test_simulation as forces  # noqa: E402

import diag_dynamics as dd  # noqa: E402
from engines import SCENES, by_mujoco, by_pinocchio, distance, ours, scene  # noqa: E402
from robots import robot_path  # noqa: E402

PAGE = ROOT / "benchmarks" / "results" / "simulation.md"
MARK = "<!-- figures, by benchmarks/referees.py -->"
END = "\n## Real time"

DURATION = 0.5
"""How long robots move that are compared [s]."""

AUDITED = {
    "Panda, its gripper coupled by mimicry": (forces.PANDA, {}, 2.0),
    "UR5": (forces.UR5, {}, 2.0),
    "Allegro hand, a hundredth of its friction": (forces.HAND, {}, 0.5),
    "Talos, flying": (forces.TALOS, {"floating_base": True}, 2.0),
}
"""Robots, options, and the largest random effort [N m]."""


def agreement(name):
    """A line of the first table: the distance to each referee after the same motion."""
    it = scene(name)
    sim = ours(it, DURATION)
    ends = by_pinocchio(it, DURATION, 2.5e-4), by_mujoco(it, DURATION, 1e-4)
    return f"| {name} | {it.model.nv} | {' | '.join(f'{distance(it.oracle, sim, *end):.1e}' for end in ends)} |"


def audit(name, seconds):
    """A line of the second table."""
    robot, options, largest = AUDITED[name]
    model = dd.load_urdf(robot_path(robot), **options)
    friction = 0.01 * model.friction if robot == forces.HAND else None
    sim = dd.Simulation(model, friction=friction)
    audits = forces.driven(sim, seconds, largest)
    a = audits[-1]
    turnover = sum(
        max(0.0, later.work - earlier.work) for earlier, later in forces.pairwise(audits)
    )
    numbers = (f"{x:.4g}" for x in (a.work, a.loss, a.energy))
    cells = [name, *numbers, f"{a.residual:.1e}", f"{abs(a.residual) / turnover:.0e}"]
    return f"| {' | '.join(cells)} |"


def main():
    """Measure, print, and put the figures into the page."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 120.0
    warnings.simplefilter("ignore", dd.InertiaWarning)
    lines = [
        f"Distance after {DURATION} s under efforts, damping, a constant push and a payload, |Δq| + |Δq̇| [rad, m, and per",
        "second], steps of 10 µs (`test_mujoco.py` holds it over 0.1 s):",
        "",
        "| robot | nv | Pinocchio: `aba`, Runge–Kutta–Munthe-Kaas of 0.25 ms | MuJoCo: RK4 of 0.1 ms |",
        "|---|---|---|---|",
        *(agreement(name) for name in SCENES),
        "",
        f"Energy [J] over {seconds:g} s at 1 ms, random efforts and pushes on the last link for 50 ms each, hard limits:",
        "",
        "| robot | work | loss | energy | residual | of the work put in |",
        "|---|---|---|---|---|---|",
        *(audit(name, seconds) for name in AUDITED),
    ]
    print("\n".join(lines))
    before, _, figures = PAGE.read_text(encoding="utf-8").partition(MARK)
    _, end, after = figures.partition(END)
    PAGE.write_text(
        before + MARK + "\n\n" + "\n".join(lines) + "\n" + end + after, encoding="utf-8"
    )


if __name__ == "__main__":
    main()
