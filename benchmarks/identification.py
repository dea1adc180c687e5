# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Identification: CPU-seconds of a recording of seven joints, without reading it and without compiling.

A Panda with its fingers held, 1 kHz, a Fourier series of 0.1 Hz, noise as of its encoders and sensors.
`python benchmarks/identification.py [STATES]` prints the table.
"""

import resource
import sys

import numpy as np

import diag_dynamics as dd
from diag_dynamics.identification.normal_equations import Regressors
from diag_dynamics.recordings.states import States

HELD = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
TASKS = {
    "friction, rotors": ("friction", "rotors"),
    "friction, rotors, inertias": ("friction", "rotors", "inertias"),
    "payload": ("payload:panda_hand",),
}
TARGET = 5.0
"""CPU-seconds of 100,000 rows."""


def motion(model, states):
    """Times, positions, rates and efforts as a driver would tell them."""
    rng, t = np.random.default_rng(1), np.arange(states) * 1e-3
    w = 0.2 * np.pi * np.arange(1, 6)
    a, b = rng.normal(size=(2, model.nv, 5)) / np.arange(1, 6)
    sine, cosine = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q, qd = sine @ a.T + cosine @ b.T, (cosine * w) @ a.T - (sine * w) @ b.T
    qdd = -(sine * w**2) @ a.T - (cosine * w**2) @ b.T
    scale = np.minimum(
        0.35 * (model.upper - model.lower) / np.abs(q).max(axis=0), 1.7 / np.abs(qd).max(axis=0)
    )
    q, qd, qdd = 0.5 * (model.lower + model.upper) + scale * q, scale * qd, scale * qdd
    tau = (
        dd.DiagonalDynamics(model).inverse_dynamics(q, qd, qdd)
        + 0.3 * qd
        + 0.3 * np.tanh(qd / 5e-3)
    )
    noise = rng.normal(size=(3, *q.shape))
    return t, q + 1e-4 * noise[0], qd + 1e-2 * noise[1], tau + 0.3 * noise[2]


def spent():
    """CPU time of this process, of all its threads [s]."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def measure(states):
    """CPU-seconds by what is done; each is done once before, for the compiler."""
    model = dd.load_robot("panda", locked_joints=HELD)
    lighter = model.with_parameters(
        {"payloads": {"panda_link4": {"mass": 0.5, "com": [0.0, 0.0, 0.1]}}}
    )
    t, q, qd, tau = motion(lighter, states)
    stamp, none = np.round(t * 1e9).astype(np.int64) + 10**9, np.zeros(states, dtype=bool)
    recording = dd.Recording(
        model, States(stamp, stamp, stamp, q, qd, tau, ~none, none, none, none), 10**9, {}, []
    )

    def sums():
        return Regressors(model).sum_segment(t, q, qd, tau)

    calls = {"regressors, filter and normal equations": sums}
    calls |= {
        name: lambda what=what: dd.identify(recording, model, what) for name, what in TASKS.items()
    }
    found = {}
    for name, call in calls.items():
        call()
        begun = spent()
        call()
        found[name] = spent() - begun
    return states, found


def table(measured):
    """Lines of identification.md."""
    states, found = measured
    lines = [
        f"{states} states of seven joints at 1 kHz, in memory; `dd.identify`, its checks and its judgement of what is held",
        f"out included. Target: {TARGET:g} CPU-seconds of 100,000 rows.",
        "",
        "| | CPU-seconds | of 100,000 rows | |",
        "|---|---|---|---|",
    ]
    for name, seconds in found.items():
        each = seconds * 1e5 / states
        lines.append(
            f"| {name} | {seconds:.2f} | {each:.2f} | {'met' if each <= TARGET else 'missed'} |"
        )
    return lines


if __name__ == "__main__":
    print("\n".join(table(measure(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000))))
