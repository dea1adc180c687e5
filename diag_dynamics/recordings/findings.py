# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings of a recording: unreadable data, rejected messages, and notes on its numbers."""

from shlex import quote
from typing import NamedTuple

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.codes import CAUSES, FAST_STEP, INTERLEAVED
from diag_dynamics.recordings.joint_names import JointNames, propose_map
from diag_dynamics.text import MAX_NAMES, listed

SECOND_SOURCE, IMPLAUSIBLE = (f"rejected: {CAUSES[code]}" for code in (INTERLEAVED, FAST_STEP))
DEGREES = f"{IMPLAUSIBLE}, perhaps degrees"  # of most messages of a recording
MIN_REJECTED = 0.5  # fraction of messages with implausible values from which a unit is wrong
SCALES = {"beyond_limits": "position: deg", "beyond_velocity": "velocity: deg/s"}
"""Scales of degrees by the parameters that reject these."""

REJECTED = "rejected: "  # prefix of the counts of rejected joint states
NOTE = "note"  # cause of findings about how a file was understood, of which nothing is wrong

TEXTS = {
    "incomplete": None,
    "foreign": None,
    "empty": "messages without names of joints",
    "positions jumped": None,
    "mimic disagreement": None,
    "implausible effort": "implausible efforts count as unknown (effort_scale, URDF limits)",
    "before odometry": "joint states before the first odometry",
    "time jumped back": "stamps jumped back, and all joints were reset",
    "awaiting velocity": "states before a velocity could be estimated",
}
"""Texts of counts of messages that were not rejected; None for the text on the last time."""


class Finding(NamedTuple):
    """A finding: a short cause such as ``unread``, its count, and a text on the first one."""

    cause: str
    count: int
    text: str

    def __str__(self) -> str:
        return (
            f"{self.cause} ({self.count} ×): {self.text}"
            if self.count > 1
            else f"{self.cause}: {self.text}"
        )


def explain_missing_efforts(counts, joints=()):
    """Return why a recording, or some of its joints, has no efforts, by counts of messages."""
    implausible = counts.get("implausible effort", 0)
    if implausible:
        return (
            f"the recording has no plausible efforts{' of ' * bool(joints)}{', '.join(joints)}: "
            f"those of {implausible} states exceed 4 times the URDF limits. Are they in N m? Else "
            "set effort_scale, and use diag-dynamics identify --what gains,friction"
        )
    return "no state of the recording has efforts of all joints"


def no_states_error(path, findings):
    """Return the InputError about a recording without a valid state, with its main findings."""
    losses = [finding for finding in findings if finding.cause != NOTE]
    losses.sort(key=lambda finding: -finding.count)
    causes = "; ".join(map(str, losses[:3])) or "it has no messages"
    return InputError(f"'{path}' contains no valid state: {causes.removesuffix('.')}.")


def collect_findings(counts, intake, source):
    """Return findings on messages of an Intake and a Source; losses are first, notes are last."""
    findings = [
        Finding("unread", 1, f"{part.file}, {part.where}: {part.what}") for part in source.unread
    ]
    first = {rejection.cause: rejection.text for rejection in reversed(intake.rejections)}
    texts = " ".join(rejection.text for rejection in intake.rejections)
    scale = ", ".join(unit for parameter, unit in SCALES.items() if parameter in texts)
    in_degrees = bool(scale) and counts[IMPLAUSIBLE] > MIN_REJECTED * counts["received"]
    if in_degrees:
        first[IMPLAUSIBLE] += (
            f". If they are degrees, set scale: {{{scale}}} in a column map (docs/recordings.md); "
            "messages must have radians (REP 103)"
        )
    if SECOND_SOURCE in first:
        first[SECOND_SOURCE] += (
            f" ({counts['published']} states accepted, {counts[SECOND_SOURCE]} messages rejected)"
        )
    causes = dict.fromkeys(rejection.cause for rejection in intake.rejections)
    names = {IMPLAUSIBLE: DEGREES} if in_degrees else {}
    findings += [Finding(names.get(cause, cause), counts[cause], first[cause]) for cause in causes]
    texts = intake.assembler.last_texts | _name_texts(intake)
    findings += [
        Finding(cause, counts[cause], TEXTS[cause] or texts[cause])
        for cause in TEXTS
        if counts[cause]
    ]
    for text, number in intake.assembler.stuck.items():
        findings.append(Finding("stuck values", number, text.removeprefix("stuck values: ")))
    return findings + [Finding(NOTE, 1, note) for note in source.notes]


def require_plausible(findings):
    """Reject a recording of which most values are implausible, by an InputError."""
    for finding in findings:
        if finding.cause == DEGREES:
            raise InputError(f"{finding.text}.")


def _name_texts(intake):
    """Return texts on missing joints, and on messages of other joints, by the name of a count."""
    assembler = intake.assembler
    missing = assembler.missing
    unknown = assembler.unknown_names()
    robot = listed(assembler.joint_names)
    foreign = (
        f"messages of other joints: {listed(unknown or assembler.last_foreign)}; the robot has "
        f"{robot}"
    )
    incomplete = "messages before all joints had arrived"
    if not missing:
        return {"foreign": foreign, "incomplete": incomplete}
    present = set(assembler.names).intersection(map(intake.names.map_name, assembler.arrived))
    entries = propose_map(unknown, missing, present, intake.names.entries)
    mapped = set(map(JointNames(dict(entries)).map_name, unknown))
    options = " ".join(quote(f"{name}={joint}") for name, joint in entries) or "NAME=JOINT"
    advice = f"; missing: {listed(missing)}."
    if unknown:
        advice += (
            f" The recording has {listed(unknown)}; map names by --joint-names {options} "
            "(joint_names)."
        )
    if lacking := [joint for joint in missing if joint not in mapped]:
        locks = ",".join(f"{name}=0" for name in lacking)
        value = f"locked_joints={locks}" if len(lacking) <= MAX_NAMES else "'locked_joints=*'"
        advice += f" Lock a joint that the recording lacks: --set {value}"
    return {"foreign": foreign + advice, "incomplete": incomplete + advice}
