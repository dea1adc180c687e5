# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording of a small arm that swings and is pushed once, and reports of it."""

import base64
import json
import re

import numpy as np

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from robots import description, joint, link

RATE, LENGTH, PUSHED = 500.0, 8.0, (2.0, 2.3)

SHAPE = '<collision><geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>'
INERTIA = (2.0, (0.0, 0.0, 0.2), (0.03, 0.0, 0.0, 0.03, 0.0, 0.01))
ARM = description(
    "arm",
    link("base"),
    *(link(name, *INERTIA).replace("</link>", SHAPE) for name in ("upper", "lower", "tool")),
    joint("joint_upper", "revolute", "base", "upper", (0, 0, 1), (0.0, 0.0, 0.4)),
    joint("joint_lower", "revolute", "upper", "lower", (0, 1, 0), (0.0, 0.0, 0.4)),
    joint("joint_tool", "revolute", "lower", "tool", (1, 0, 0), (0.0, 0.0, 0.4)),
)
WATCHED = "collision.threshold=norm=10.0", "external_torque.gain=25.0"


class Recording:
    """A recording of an arm that swings, pushed once; and reports of it."""

    def __init__(self, folder):
        self.folder = folder
        self.urdf = folder / "arm.urdf"
        self.urdf.write_text(ARM)
        (folder / "limits.yaml").write_text(
            "regions: {nobody: {mass: 3.0, stiffness: 20000, force: 60}}"
        )
        self.model = dd.load_urdf(str(self.urdf))
        self.dyn = dd.DiagonalDynamics(self.model)
        self.t, self.q, self.qd, self.tau = self.motion((PUSHED,))

    def motion(self, pushes, forces=(40.0, 40.0)):
        t = np.arange(0.0, LENGTH, 1.0 / RATE)
        pace = 0.7 + 0.3 * np.arange(self.model.nv)
        phase = pace * t[:, None]
        q = 0.6 * np.sin(phase)
        qd = 0.6 * pace * np.cos(phase)
        qdd = -0.6 * pace**2 * np.sin(phase)
        tau = self.dyn.inverse_dynamics(q, qd, qdd)
        for (begin, end), force in zip(pushes, forces, strict=False):
            tau[(t >= begin) & (t < end), 1] -= force
        return t, q, qd, tau

    def analyse(self, name, *options, **columns):
        """Analyse columns; return the path of the report and the summary."""
        path, html, summary = (self.folder / f"{name}.{kind}" for kind in ("npz", "html", "json"))
        np.savez(path, **columns)
        arguments = [
            "analyse",
            path,
            "--urdf",
            self.urdf,
            "--report",
            html,
            "--json",
            summary,
            *options,
        ]
        assert main(list(map(str, arguments))) in (0, 1)
        return html, json.loads(summary.read_text(encoding="utf-8"))

    def columns(self, part=slice(None)):
        return {name: getattr(self, name)[part] for name in ("t", "q", "qd", "tau")}


def parts_of(html):
    """Return the JSON of a report, and its blocks as bytes."""
    text = html.read_text(encoding="utf-8")
    data = re.search(r'<script type="application/json" id="report">(.*?)</script>', text, re.DOTALL)
    blocks = re.findall(r'<script type="text/plain" id="block-\d+">(.*?)</script>', text)
    return json.loads(data[1]), [base64.b64decode(block) for block in blocks]
