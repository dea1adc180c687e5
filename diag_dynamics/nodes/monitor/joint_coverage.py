# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Status of joints without data, and of the names that arrive in their place."""

from functools import lru_cache

from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.statuses import OK, STALE, WARN, Status
from diag_dynamics.recordings.joint_names import propose_map
from diag_dynamics.text import listed

GRACE_PERIOD = 0.5
"""Time after the first message in which all joints may arrive [s]."""

_propose_map = lru_cache(1)(propose_map)


def joint_coverage(assembler, ignored, entries, elapsed, statistics):
    """Return the status of the joints of a StateAssembler.

    `ignored` are further joints of the robot, `entries` pairs of the parameter joint_names,
    `elapsed` is the time since its first message [s] or None, and `statistics` InputStatistics.
    """
    if elapsed is None:
        return Status("joints", STALE, "no joint states")
    missing = list(assembler.joint_names) if statistics.is_foreign else assembler.missing
    unknown = assembler.unknown_names(ignored)
    values = {"missing joints": counted(missing), "unknown names": counted(unknown)}
    if not missing:
        return Status("joints", OK, "all joints have data", values)
    if elapsed < GRACE_PERIOD:
        return Status("joints", STALE, "waiting for all joints", values)
    text = f"joints without data: {listed(missing)}"
    if unknown:
        text += f"; unknown names arrive: {listed(unknown)}"
    elif statistics.is_empty:
        text += "; all joint states are empty"
    present = tuple(joint for joint in assembler.joint_names if joint not in missing)
    proposal = _propose_map(tuple(unknown), tuple(missing), present, tuple(entries))
    if proposal:
        text += f". Set joint_names to {[f'{name}={joint}' for name, joint in proposal]}"
    return Status("joints", WARN, text, values, age=elapsed)
