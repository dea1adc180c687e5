# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write docs/report_panda.html, the report of a simulated Panda that is pushed three times, and has 20 g more than its URDF.

``python docs/sample_report.py``; the build of the site runs it.
"""

import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from diag_dynamics.cli.main import main
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.model import load_urdf
from diag_dynamics.simulation.drives import Sensors

sys.path.append(str(Path(__file__).resolve().parents[1] / "examples" / "demos"))
from demo_identify import NOISE, Push, record

LENGTH, PUSHED = 16.0, (4.0, 8.5, 12.6)
HELD = {"panda_finger_joint1": 0.03}


def motion(model, length=LENGTH):
    """A swing of all joints about the middle of their ranges, which begins and ends at rest."""
    t = np.arange(0.0, length, 0.004)
    ramp = np.clip(np.minimum(t, length - t) / 2.0, 0.0, 1.0)
    amount = ramp * ramp * (3.0 - 2.0 * ramp)
    middle, swing = (
        0.5 * (model.lower + model.upper),
        np.minimum(0.2 * (model.upper - model.lower), 0.55),
    )
    pace = 2.2 + 0.7 * (np.arange(model.nv) * 0.618 % 1.0)
    q = middle + amount[:, None] * swing * np.sin(pace * t[:, None] + np.arange(model.nv))
    qd = np.gradient(q, t, axis=0)
    return t, q, qd, np.gradient(qd, t, axis=0)


def sample(folder):
    """The recording, as a table in a folder; returns its path."""
    model = load_urdf(find_urdf("panda"), locked_joints=HELD)
    force = {
        PUSHED[0]: (0.0, 35.0, 0.0),
        PUSHED[1]: (-30.0, 0.0, 15.0),
        PUSHED[2]: (0.0, -25.0, -25.0),
    }
    pushes = [
        Push("panda_hand", begin, begin + 0.25, np.array(push)) for begin, push in force.items()
    ]
    robot, sensors = model.with_payload("panda_hand", 0.02), Sensors(NOISE)
    states = record(robot, model, sensors, *motion(model), pushes)
    path = Path(folder) / "panda_run.npz"
    np.savez(path, **states)  # columns in the order of the joints
    return path


if __name__ == "__main__":
    target = Path(__file__).resolve().parent / "report_panda.html"
    with tempfile.TemporaryDirectory() as folder:
        path = sample(folder)
        os.chdir(folder)  # reports have the path of the recording
        held = ",".join(f"{name}={angle}" for name, angle in HELD.items())
        parameters = [
            f"locked_joints={held}",
            "external_torque.gain=25.0",
            "collision.threshold=norm=12.0",
        ]
        main(
            ["analyse", path.name, "--urdf", "panda", "--set", *parameters, "--report", str(target)]
        )
