# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Status of joints without data, and of the names that arrive in their place."""

from functools import lru_cache

from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.statuses import OK, STALE, WARN, Status
from diag_dynamics.recordings.joint_names import listed, propose_maps

GRACE_PERIOD = 0.5
"""Time after the first message in which all joints may arrive [s]."""

_propose_maps = lru_cache(1)(propose_maps)


def joint_coverage(assembler, ignored, elapsed, is_foreign):
    """Return the status of the joints of a StateAssembler.

    `ignored` are further joints of the robot, `elapsed` is the time since its first message [s] or
    None, and `is_foreign` whether no recent message has a joint of the robot.
    """
    if elapsed is None:
        return Status("joints", STALE, "no joint states")
    missing = list(assembler.joint_names) if is_foreign else assembler.missing
    unknown = assembler.unknown_names(ignored)
    values = {"missing joints": counted(missing), "unknown names": counted(unknown)}
    if not missing:
        return Status("joints", OK, "all joints have data", values)
    if elapsed < GRACE_PERIOD:
        return Status("joints", STALE, "waiting for all joints", values)
    text = f"joints without data: {listed(missing)}"
    if unknown:
        text += f"; unknown names arrive: {listed(unknown)}"
    elif is_foreign or not assembler.arrived:
        text += "; all joint states are empty"
    maps = _propose_maps(tuple(unknown), tuple(missing))
    if maps and len(unknown) == len(missing) == 1:
        maps = [(*unknown, *missing)]
    if maps:
        entries = " or ".join(f"['{name}={joint}']" for name, joint in maps)
        text += f". Set joint_names to {entries}"
    return Status("joints", WARN, text, values)
