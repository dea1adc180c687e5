# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""All benchmarks: `make bench`, or this file in the sourced environment. See `table.md` and `nodes.md` in `results`."""

import argparse
import importlib.util
import os
import sys
from pathlib import Path
from typing import NamedTuple

# Matrices are small: threads of the linear algebra would only be in the way of the dense route.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

try:
    import agreement
    import alarms
    import cold
    import contact_limit
    import contacts
    import energy_limit
    import growth
    import identification
    import memory
    import plots
    import recordings
    import report
    import single
    import start
    import stepping
    import throughput
    from cases import FEW, ROBOTS, Case, Robot
    from peers import Mujoco, Pinocchio
    from rows import Measured
    from timing import OtherWork
except ModuleNotFoundError as error:
    sys.exit(f"{error.name} is not installed. The benchmarks need: make setup-tests.")

RESULTS = Path(__file__).resolve().parent / "results"


class Plan(NamedTuple):
    """How much is measured."""

    robots: tuple[Robot, ...]
    rounds: int
    growth_sizes: tuple[int, ...]
    growth_rounds: int
    batch: int  # states
    batch_sizes: tuple[int, ...]
    steps: int
    states: int  # of the stream
    starts: tuple[str, ...]
    start_rounds: int


FULL = Plan(
    robots=ROBOTS,
    rounds=51,
    growth_sizes=growth.SIZES,
    growth_rounds=15,
    batch=20_000,
    batch_sizes=(1, 10, 100, 1000, 10_000, 100_000),
    steps=200,
    states=1_000_000,
    starts=("panda", "talos_reduced"),
    start_rounds=9,
)

SHORT = Plan(
    robots=FEW,
    rounds=3,
    growth_sizes=(32, 64, 128),
    growth_rounds=2,
    batch=1024,
    batch_sizes=(1, 100),
    steps=10,
    states=8 * memory.SIZE,
    starts=("panda",),
    start_rounds=1,
)


PARTS = (
    "library",
    "starts",
    "recordings",
    "identification",
    "alarms",
    "contact",
    "energy",
    "nodes",
)


def main():
    """Measure library, alarms and nodes, and print the tables; with a folder, write tables and plots into it."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument(
        "--short", action="store_true", help="two minutes' worth, which writes nothing by default"
    )
    options.add_argument("--only", choices=PARTS, help="measure one of these alone")
    options.add_argument(
        "--output",
        type=Path,
        metavar="FOLDER",
        help="where to write; by default benchmarks/results",
    )
    arguments = options.parse_args()
    folder = arguments.output
    official = folder is None and not arguments.short
    folder = RESULTS if official else folder
    if folder:
        if folder.exists() and not folder.is_dir():
            options.error(f"--output: {folder} is not a folder")
        folder.mkdir(parents=True, exist_ok=True)
    parts = {
        "library": library,
        "starts": cold_starts,
        "recordings": analyses,
        "identification": identifications,
        "alarms": calibrations,
        "contact": touches,
        "energy": energies,
        "nodes": nodes,
    }
    chosen = [arguments.only] if arguments.only else PARTS
    if "nodes" in chosen and not importlib.util.find_spec("rclpy"):
        options.error(
            "the nodes need a ROS 2: source scripts/env.bash, or leave them out with --only library or alarms"
        )
    for part in chosen:
        parts[part](arguments.short, folder, official)


def library(short, folder, _):
    """Compare outputs and measure the library against its peers."""
    try:
        measured = measure(SHORT if short else FULL)
    except agreement.DisagreementError as error:
        sys.exit(f"Nothing is timed, outputs disagree: {error}")
    table = report.summary(measured.rows)
    print(table)
    if folder:
        plots.draw(folder, measured)
        (folder / "table.md").write_text(report.page(measured), encoding="utf-8")


def cold_starts(short, folder, _):
    """Measure what a first start compiles."""
    _say("measures cold starts")
    found = cold.measure(1 if short else 3)
    print(cold.table(found))
    if folder:
        cold.write(found, report.machine(("numpy", "numba", "llvmlite")), folder)


def analyses(short, folder, _):
    """Measure the analysis of a recording, stage by stage."""
    _say("analyses a recording")
    lines = recordings.table(recordings.measure(50_000 if short else 1_000_000))
    print("\n".join(lines))
    if folder:
        machine = report.machine(("numpy", "numba", "pyarrow", "zstandard"))
        page = "\n".join(["# Benchmark of recordings", "", *lines, "", machine, ""])
        (folder / "recordings.md").write_text(page, encoding="utf-8")


def identifications(short, folder, _):
    """Measure identification from a recording."""
    _say("identifies")
    lines = identification.table(identification.measure(20_000 if short else 100_000))
    print("\n".join(lines))
    if folder:
        page = "\n".join(
            [
                "# Benchmark of identification",
                "",
                *lines,
                "",
                report.machine(("numpy", "numba")),
                "",
            ]
        )
        (folder / "identification.md").write_text(page, encoding="utf-8")


def calibrations(short, folder, _):
    """Compare alarms with and without a dead zone: no times, the same numbers every time."""
    _say("calibrates alarms, and pushes")
    found = alarms.compare(short)
    print(alarms.table(found))
    if folder:
        alarms.write(found, folder)


def touches(short, folder, _):
    """Measure what contact takes beside `evaluate`, and what a limit of it costs in tracking."""
    _say("measures contact")
    costs = contacts.table(contacts.compare(short))
    _say("bounds contacts")
    bounded = contact_limit.table(contact_limit.compare(short))
    print("\n".join([*costs, "", *bounded]))
    if folder:
        machine = report.machine(("numpy", "numba"))
        for name, title, lines in (
            ("contacts", "Benchmark of predicted contact", costs),
            ("contact_limit", "Benchmark of the contact limit", bounded),
        ):
            page = "\n".join([f"# {title}", "", *lines, "", machine, ""])
            (folder / f"{name}.md").write_text(page, encoding="utf-8")


def energies(short, folder, _):
    """Simulate loops that keep a limit of kinetic energy: no times, the same numbers every time."""
    _say("limits energies")
    lines = energy_limit.table(energy_limit.compare(short))
    print("\n".join(lines))
    if folder:
        page = "\n".join(["# Benchmark of the energy limit", "", *lines, ""])
        (folder / "energy_limit.md").write_text(page, encoding="utf-8")


def nodes(short, folder, official):
    """Measure the monitor against a node that computes nothing."""
    import graph.plots  # needs a ROS 2, which the library does not
    import graph.report
    from graph import compare

    try:
        found = compare.measure(compare.SHORT if short else compare.FULL)
    except compare.GraphError as error:
        sys.exit(str(error))
    print(graph.report.summary(found))
    if folder:
        graph.plots.draw(folder, found)
        (folder / "nodes.md").write_text(graph.report.page(found), encoding="utf-8")


def measure(plan):
    """Compare all outputs, then measure."""
    cases = [Case(robot) for robot in plan.robots]
    dof = {case.label: case.dof for case in cases}
    pinocchios, mujocos = [Pinocchio(case) for case in cases], [Mujoco(case) for case in cases]
    arms = throughput.chosen(cases, pinocchios)
    moving = [(case, Pinocchio(case)) for case in map(Case, map(Robot, stepping.ROBOTS))]

    _say("compares outputs")
    errors = [agreement.check(*peers) for peers in zip(cases, pinocchios, mujocos, strict=True)]
    worst = max(*errors, *(stepping.check(*pair) for pair in moving))
    _say(f"outputs of {len(cases)} robots agree to {worst[0]:.0e} ({worst[1]})")

    _say("measures single states")
    single_times = {
        case.label: single.measure(case, *peers, plan.rounds)
        for case, *peers in zip(cases, pinocchios, mujocos, strict=True)
    }
    _say("measures batches")
    others = OtherWork()
    batches = throughput.rows(arms, plan.batch, plan.rounds)
    curves = throughput.curves(*arms[0], plan.batch_sizes, max(3, plan.rounds // 5))
    other_work = others.processors()
    _say(
        f"other work kept {other_work:.2f} processors busy meanwhile, which batches on all of them suffer from"
    )
    _say("measures the simulator")
    steps = stepping.rows(moving, plan.steps, plan.rounds)
    _say("measures growth")
    growth_times = growth.measure(plan.growth_sizes, plan.growth_rounds)
    slopes = growth.exponents(growth_times)
    _say("measures memory")
    memories = memory.rows(plan.states)
    _say("measures starts")
    starts = start.row(plan.starts, plan.start_rounds)

    grows = growth.row(slopes, plan.growth_sizes)
    return Measured(
        agreement=worst,
        single=single_times,
        dof=dof,
        growth=growth_times,
        slopes=slopes,
        throughput=curves,
        batch_sizes=plan.batch_sizes,
        batch_robot=arms[0][0].label,
        other_work=other_work,
        rows=[*single.rows(single_times, dof), *batches, *steps, grows, *memories, starts],
        others=[*batches, *steps, *memories, starts],
    )


def _say(what):
    print(f"… {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
