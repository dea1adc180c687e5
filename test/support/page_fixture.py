# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data that the package writes for the page, for the page's own tests: ``python3
test/support/page_fixture.py``.

web/test/frames.test.js reads the file. test_page.py checks that the package still writes it.

The robot has closed forms: two links of 1 m in a horizontal plane, point masses of 2 kg and 1 kg at
their ends, the elbow at a right angle, joint rates of 2 and −1 rad/s.
"""

import base64
import json
import math
from pathlib import Path

import numpy as np

import diag_dynamics as dd
from coupling import mimicking
from diag_dynamics.page.frames import FrameMaker, States
from diag_dynamics.page.layout import tree_of
from diag_dynamics.page.meshes import pack
from diag_dynamics.page.scene import scene_of
from diag_dynamics.page.stream import Received, RobotStream
from robots import BOX, description, joint, link, random_tree

PATH = Path(__file__).parents[2] / "web" / "test" / "fixture.json"

NO_INERTIA = (0.0,) * 6
ARM = description(
    "arm",
    link("base"),
    link("upper", 2.0, (1.0, 0.0, 0.0), NO_INERTIA),
    link("lower", 1.0, (1.0, 0.0, 0.0), NO_INERTIA),
    joint("arm_shoulder", "revolute", "base", "upper"),
    joint("arm_elbow", "revolute", "upper", "lower", xyz=(1, 0, 0)),
)
Q, QD, EFFORT = np.array([0.3, 0.5 * math.pi]), np.array([2.0, -1.0]), np.array([5.0, 1.0])
EXTERNAL, T = np.array([0.5, -0.25]), 1.7e9 + 0.25
CONTACT = {
    "contact_limits_worst": np.array([0.0]),
    "contact_limits_position": np.array([[0.0, 1.0, 2.0]]),
    "contact_limits_speed": np.array([[0.5, 0.0]]),
    "contact_limits_mass": np.array([[3.0, 0.0]]),
    "contact_limits_energy": np.array([[0.375, 0.0]]),
    "contact_limits_allowed": np.array([[0.4, math.inf]]),
}
POINTS = (("tool", "lower"), ("arm", "upper"))
"""Two points; the second one is at rest and has no limit."""


def content():
    """Return what the file contains."""
    model = dd.load_urdf(ARM)
    dyn = dd.DiagonalDynamics(model)
    scene = scene_of(model, ARM)
    residual = dyn.epsilon_from_tau(Q, EXTERNAL)[None]
    observed = {
        "residual": residual,
        "external_torque": EXTERNAL[None],
        "norm": np.linalg.norm(residual, axis=1),
    }
    state = States.of(
        T,
        Q,
        QD,
        EFFORT,
        dyn.evaluate(Q, QD, EFFORT),
        **observed,
        **CONTACT,
        collision=True,
    )
    flags = {"velocity_estimated": True, "receive_time": True}
    unknown = States.of(T + 0.1, Q, QD, None, dyn.evaluate(Q, QD), **flags)
    limits = (12.0, math.inf, math.inf, 8.0)
    received = [Received(state, 0.0, 1, limits, POINTS) for state in (state, unknown)]
    stream = RobotStream("/arm", lambda _: received.pop(0))
    stream.set_robot(dyn, scene, None)
    newest = [stream.newest("lower") for _ in range(2)]
    return {
        "layout": json.loads(newest[0].layout[1]),
        "frames": [_text(frame) for *_, frame in newest],
        "states": _states(dyn),
        "kinematics": _kinematics(),
    }


def _kinematics():
    """Return trees of robots with positions, and the library's placements of their links."""
    tree = random_tree(12, 6)
    gripper = random_tree(13, 4).replace("</robot>", "")
    locked = {dd.load_urdf(tree).joint_names[2]: 0.3}
    leader = dd.load_urdf(f"{gripper}</robot>").joint_names[1]
    jaws = ""
    for kind in ("revolute", "prismatic"):
        jaw = joint(kind, kind, "link_3", f"{kind}_jaw", axis=(0.6, 0.0, 0.8), rpy=(1, 2, 3))
        jaws += mimicking(jaw, leader, -0.5, 0.2) + link(f"{kind}_jaw", *BOX.values())
    robots = [
        dd.load_urdf(random_tree(11, 5, kinds=("revolute", "prismatic", "planar", "floating"))),
        dd.load_urdf(tree, floating_base=True, locked_joints=locked),
        dd.load_urdf(f"{gripper}{jaws}</robot>"),
    ]
    result = []
    rng = np.random.default_rng(4)
    for model in robots:
        dyn = dd.DiagonalDynamics(model)
        q = model.random(rng)
        placements = [dyn.placement(q, name).T.ravel().tolist() for name in model.link_names]
        result.append({"tree": tree_of(model), "q": q.tolist(), "placements": placements})
    return result


def _states(dyn):
    """Return states of a report, one per second.

    K is 10 t, the energy of each link t, and D is infinite. All other numbers are those of one
    state.
    """
    maker = FrameMaker(dyn, POINTS)
    state = States.of(0.0, Q, QD, EFFORT, dyn.evaluate(Q, QD, EFFORT), **CONTACT)
    t = np.arange(6.0)
    numbers = np.tile(maker.frames(state)["numbers"][0].astype(float), (len(t), 1))
    numbers[:, maker.layout.places["K"]] = 10.0 * t[:, None]
    numbers[:, maker.layout.places["link_energy"]] = t[:, None]
    numbers[:, maker.layout.places["D"]] = math.inf
    return {"count": len(t), "block": _text(pack(t, numbers))}


def _text(data):
    return base64.b64encode(data).decode()


if __name__ == "__main__":
    PATH.write_text(json.dumps(content(), separators=(",", ":")) + "\n", encoding="utf-8")
