# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analysis of recordings: CPU-seconds of reading, computing and writing, apart and in all, and memory.

A million joint states of nine joints at 1 kHz, zstd in MCAP, as the issue of a robot's day has them.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.writer import Writer
from start import ROOT

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import definition_with_parts, message_type

JOINT_STATE = "sensor_msgs/msg/JointState"
PERIOD = 1_000_000
"""Of the states [ns]."""

STAGES = """\
import os, sys, time
import diag_dynamics as dd
from diag_dynamics.model import load_robot
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.outputs.mcap import McapOutput
from diag_dynamics.recordings.outputs.table_files import TableOutput
from diag_dynamics.recordings.recording import Reading, SIZE
path, model, folder = sys.argv[1], dd.load_urdf(sys.argv[2], mimic="free"), sys.argv[3]
def run(kind):
    reading = Reading(path, model)
    analysis = Analysis(reading, threads=1)
    output = kind(reading) if kind else None
    spent = dict.fromkeys(("read", "compute", "observe", "write"), 0.0)
    pieces = reading.pieces(SIZE)
    observe = analysis._observer.observe_batch
    def observed(*arguments):
        begun = time.process_time()
        try:
            return observe(*arguments)
        finally:
            spent["observe"] += time.process_time() - begun
    analysis._observer.observe_batch = observed
    while True:
        begun = time.process_time()
        piece = next(pieces, None)
        spent["read"] += time.process_time() - begun
        if piece is None:
            break
        if not len(piece.states):
            continue
        begun = time.process_time()
        piece = analysis.analyse_batch(piece.states)
        spent["compute"] += time.process_time() - begun
        if output:
            begun = time.process_time()
            output.write(piece)
            spent["write"] += time.process_time() - begun
    if output:
        begun = time.process_time()
        output.close()
        spent["write"] += time.process_time() - begun
    return [spent[stage] / analysis.states * 1e6 for stage in spent]
parquet = lambda reading: TableOutput(folder + "/out.parquet", reading)
mcap = lambda reading: McapOutput(folder + "/out.mcap", reading, ("state",))
run(parquet)  # compiles, and has everything in the cache
os.remove(folder + "/out.parquet")  # to take away what a file replaces is not the analysis' work
print(*run(parquet), *run(mcap))"""

THREADS = """\
import os, sys, time
import diag_dynamics as dd
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.outputs.table_files import TableOutput
from diag_dynamics.recordings.recording import Reading
path, model, folder = sys.argv[1], dd.load_urdf(sys.argv[2], mimic="free"), sys.argv[3]
def run():
    reading = Reading(path, model)
    analysis = Analysis(reading)
    analysis.run([TableOutput(folder + "/out.parquet", reading)])
run()
os.remove(folder + "/out.parquet")
begun = time.perf_counter()
run()
wall = time.perf_counter() - begun
with open("/proc/self/status") as file:
    lines = dict(line.split(":", 1) for line in file)
print(wall, int(lines["VmHWM"].split()[0]) / 1024, int(lines["RssAnon"].split()[0]) / 1024)"""


class Analysed(NamedTuple):
    """What an analysis takes."""

    parquet: list
    """CPU-microseconds a state of reading, computing, the observer's part of that, and writing, Parquet out."""
    mcap: list
    """Likewise, MCAP out."""
    one_core: float
    """Wall time on one core and on two, that of whole runs [s]."""
    two_cores: float
    memory: float
    """Anonymous memory at the end [MB]."""
    states: int


def write(path, states, joints):
    """Write a recording of slow sines; returns nothing."""
    count = len(joints)
    message = message_type(JOINT_STATE)(
        name=joints, position=[1.0] * count, velocity=[1.0] * count, effort=[1.0] * count
    )
    message.header.frame_id = "base"
    template = Template(message)
    rng = np.random.default_rng(1)
    phase = rng.uniform(0.0, 6.0, count)
    start = 1_700_000_000 * 10**9
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema(
            JOINT_STATE, "ros2msg", definition_with_parts(JOINT_STATE).encode()
        )
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for first in range(0, states, 5000):
            stamp = start + np.arange(first, min(first + 5000, states)) * PERIOD
            t = (stamp - start)[:, None] * 1e-9
            noise = rng.normal(size=(len(stamp), count))
            values = {
                "header.stamp.sec": (stamp // 10**9).astype(np.int32)[:, None],
                "header.stamp.nanosec": (stamp % 10**9).astype(np.uint32)[:, None],
                "position": MIDDLE + 0.02 * np.sin(t + phase),
                "velocity": 0.02 * np.cos(t + phase) + 1e-4 * noise,
                "effort": 5.0 * np.sin(3.0 * t + phase) + 0.05 * noise,
            }
            rows = np.tile(template.data, (len(stamp), 1))
            for field, value in values.items():
                begin, width = template.place(field), value.dtype.itemsize * value.shape[1]
                rows[:, begin : begin + width] = np.ascontiguousarray(value).view(np.uint8)
            for row, log_time in zip(rows, (stamp + 100_000).tolist(), strict=True):
                writer.add_message(channel, log_time, row.tobytes(), log_time)
        writer.finish()


MIDDLE = np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.8, 0.0, 0.02, 0.02])
"""About which the joints move: within the limits of a Panda."""


def measure(states):
    """Analyse a recording of so many states of a Panda, its fingers free: nine joints."""
    urdf = str(find_urdf("panda"))
    joints = single_joints(dd.load_urdf(urdf, mimic="free"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.mcap"
        write(path, states, list(joints))
        numbers = [float(word) for word in _output(STAGES, path, urdf, folder).split()]
        one = _output(THREADS, path, urdf, folder, cores={min(os.sched_getaffinity(0))}).split()
        two = _output(THREADS, path, urdf, folder).split()
    return Analysed(numbers[:4], numbers[4:], float(one[0]), float(two[0]), float(two[2]), states)


def _output(program, *arguments, cores=None):
    def bound():
        if cores:
            os.sched_setaffinity(0, cores)

    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(
        command,
        check=True,
        capture_output=True,
        text=True,
        cwd=ROOT,
        preexec_fn=bound,
        timeout=3000,
    ).stdout


def table(measured):
    """Lines of recordings.md."""
    lines = [
        f"{measured.states} joint states of nine joints at 1 kHz (a Panda with its fingers free), in MCAP with zstd.",
        "CPU-microseconds a state, which is a millisecond of the robot. The observer is part of computing.",
        "",
        "| out | read | compute | of it the observer | write | in all | times real time per CPU-second | target |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, (read, compute, observe, written), target in (
        ("Parquet: state, kinetic energy, observer", measured.parquet, 120),
        ("MCAP: `DiagonalizedState`", measured.mcap, 90),
    ):
        total = read + compute + written
        speed = 1000.0 / total
        met = "met" if speed >= target else "missed"
        numbers = " | ".join(f"{number:.2f}" for number in (read, compute, observe, written, total))
        lines.append(f"| {name} | {numbers} | {speed:.0f} | ≥ {target}: {met} |")
    ratio = measured.one_core / measured.two_cores
    lines += [
        "",
        f"* Two cores are {ratio:.2f} times as fast as one (whole runs, Parquet out; target ≥ 1.6 on two idle cores).",
        f"* Anonymous memory: {measured.memory:.0f} MB (target ≤ 500), whatever the length.",
    ]
    return lines


if __name__ == "__main__":
    print("\n".join(table(measure(int(sys.argv[1]) if len(sys.argv) > 1 else 200_000))))
