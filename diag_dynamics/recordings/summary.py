# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an analysis has found, as numbers for programs and as text for people."""

import re
import textwrap

from diag_dynamics.collision.events import Alarm
from diag_dynamics.recordings.account import NOTE, Finding, without_efforts
from diag_dynamics.recordings.balance import WINDOW
from diag_dynamics.recordings.explained import PART
from diag_dynamics.recordings.quality import four_digits

REJECTED = "rejected: "
"""Begins the names of counts of joint states that were rejected."""

FEW = 5
"""Joints, findings and collisions that the text tells of one by one."""

JOINED = "\u00a0"
"""Space at which no line ends, until lines are made."""

WIDTH = 100
"""Longest line of the text, where nobody says another one."""


def summary_of(outcome):
    """Numbers of an analysis that is over, in SI units; times are those of the recording.

    Parameters
    ----------
    outcome : Outcome

    Returns
    -------
    dict
        `robot`, `degrees_of_freedom`; `states`, `duration`, `begin`, `end` [s]; `counts` of messages by what became of them,
        and `rejected` by cause; `kinetic_energy`: `mean`, `max` [J], `at` [s], `share`, the largest of each joint, and
        `histogram`: `from`, `to` [J], `states`; `peaks`; `explained`, `explained_with_potential`, `residual_power` [W]: None
        without efforts; `balance`; `efforts`: in words `unmeasured`, those that are 0, constant or missing throughout, and
        `says`, their fault where the balance is bad; `observer`, with `missing`, parameters without which no collision is
        told of,
        `observed`, the number of states of which the observer has a result, and `says`, what is not known therefore;
        `collisions`: `start`, `end`, `joints`, `norm`, and where thresholds of alarms were given `first`, `exceeded` and
        `told`; `contact`, with limits of it: `above`, how long any point was above its limit, `of`, both [s],
        `above_by_point`, and `worst`, moments by `usage`, the part of the allowed speed; `quality`; `warnings`;
        `findings`: `cause`, `count`, `text`.
    """
    quality, balance, peaks, names = outcome.quality, outcome.balance, outcome.peaks, outcome.names
    offset, counts = outcome.offset, outcome.account.counts

    def time(stamp):
        return None if stamp is None else (stamp - offset) * 1e-9

    balance.moved, unmeasured = outcome.efforts.moved, outcome.efforts.complaint()
    good = balance.explained is not None and balance.explained >= PART
    wrong_efforts = None if good or unmeasured else outcome.motion.complaint()
    energy, energy_at, _ = peaks.largest.get("kinetic_energy", (None, None, None))
    report = quality.report()
    report["longest_gap_at"] = time(report["longest_gap_at"])
    begin, end = quality.begin, quality.end
    return {
        "robot": outcome.robot,
        "degrees_of_freedom": list(names),
        "states": outcome.states,
        "duration": quality.duration,
        "begin": time(begin),
        "end": time(end),
        "counts": dict(sorted(counts.items())),
        "rejected": {
            cause.removeprefix(REJECTED): n for cause, n in sorted(counts.items()) if cause.startswith(REJECTED) and n
        },
        "kinetic_energy": {
            "mean": outcome.mean_energy,
            "max": energy,
            "at": time(energy_at),
            "share": _by_name(names, peaks.of_each.get("energy_share")),
            "histogram": outcome.histogram.told(),
        },
        "peaks": {
            quantity: {"value": value, "at": time(at), "of": whose}
            for quantity, (value, at, whose) in peaks.largest.items()
        },
        "explained": balance.explained,
        "explained_with_potential": balance.explained_total,
        "residual_power": balance.residual_power,
        "balance": {
            "windows": balance.residual.count,
            "length": WINDOW,
            "moments": {name: getattr(balance, name).told() for name in ("kinetic", "total", "residual")},
            "says": _judgement(balance, unmeasured, wrong_efforts),
            "joints": {
                name: {"residual_power": rms, "share": share} for name, (rms, share) in balance.of_joints().items()
            },
        },
        "efforts": {"unmeasured": unmeasured, "says": wrong_efforts.text if wrong_efforts else ""},
        "observer": {
            "gain": outcome.gain,
            "threshold": None if outcome.threshold == float("inf") else outcome.threshold,
            "judged": list(outcome.collisions.judged),
            "missing": list(outcome.missing),
            "observed": outcome.observed,
            "says": _says_of_contacts(outcome, report["without_effort"]),
        },
        "collisions": [
            {"start": time(one.start), "end": time(one.end), "joints": list(one.joints), "norm": one.norm}
            | _exceeded(one)
            for one in outcome.collisions.found
        ],
        "contact": outcome.touches.told(time) if outcome.touches else None,
        "quality": report,
        "warnings": [text for text in (unmeasured, *quality.warnings()) if text],
        "findings": [{"cause": one.cause, "count": one.count, "text": one.text} for one in outcome.account.findings()],
    }


def _judgement(balance, unmeasured, wrong):
    """Return what the balance says, with what is wrong with the efforts; powers show faults of all joints, too."""
    if unmeasured:
        return balance.judgement(unmeasured, instead=True)
    if wrong is None:
        return balance.judgement()
    if wrong.kind in ("gravity", "order"):
        return balance.judgement(wrong.text, instead=True)
    return balance.judgement() if wrong.kind != "joint" and balance.cause() else balance.judgement(wrong.text)


def _says_of_contacts(outcome, without_effort):
    """What is not known of contacts, and for want of what; empty where all is."""
    said, missing, states = [], outcome.missing, outcome.states
    unknown = states - outcome.observed
    if not outcome.observed:
        why = (
            without_efforts(outcome.account.counts)
            if without_effort == states
            else "the observer has no result at any state"
        )
        said.append(f"Nothing is known of contacts: {why}.")
    elif unknown > 1 and not missing:  # the first one never has a result
        said.append(f"Of {unknown} of {states} states nothing is known: the observer has no result there.")
    if missing:
        lacks = f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not set"
        if outcome.observed:
            lacks = f"Nothing is known of contacts: {lacks}"
        useless = (
            ", without which external_torque.threshold does not count" if missing == ("external_torque.gain",) else ""
        )
        said.append(
            f"{lacks}{useless}. diag-dynamics calibrate finds thresholds, and writes them with their gain for --alarms."
        )
    return " ".join(said)


def wrongs_of(summary):
    """What is not right about a recording, or about its robot, in words, of a summary."""
    rejected = sum(summary["rejected"].values())
    explained, efforts = summary["explained"], summary["efforts"]
    return [
        text
        for text, is_so in (
            ("part of it could not be read", any(one["cause"] == "unread" for one in summary["findings"])),
            (f"{rejected} message{' was' if rejected == 1 else 's were'} rejected", rejected > 0),
            (
                f"the balance of power explains less than {100 * PART:.0f} % of dK/dt",
                explained is not None and explained < PART,
            ),
            ("there are efforts, but no balance of power", explained is None and _has_efforts(summary)),
            (
                "no balance of power, because efforts are beyond what can be (absurd.effort): are they in N m or N?",
                explained is None and any(one["cause"] == "absurd effort" for one in summary["findings"]),
            ),
            (_about_unit(summary["quality"]["wrong_unit"]), summary["quality"]["wrong_unit"] is not None),
            (efforts["says"], efforts["says"]),
        )
        if is_so
    ]


def _about_unit(wrong):
    """The cause for which units of positions, velocities and times do not agree."""
    return (
        wrong and f"{wrong['cause']} (positions change {four_digits(wrong['factor'])} times as fast as velocities say)"
    )


def _has_efforts(summary):
    """Return whether any state has efforts."""
    return summary["states"] > summary["quality"]["without_effort"]


def _exceeded(alarm):
    """Of an alarm, what rose first, and how far each detector was above which threshold."""
    if not isinstance(alarm, Alarm):
        return {}
    exceeded = {one.detector: {"value": one.value, "threshold": one.threshold} for one in alarm.exceeded}
    return {"first": alarm.first, "exceeded": exceeded, "told": alarm.told()}


def _by_name(names, values):
    return {} if values is None else dict(zip(names, map(float, values), strict=True))


def text_of(summary, width=WIDTH):
    """The same for people: lines of no more than so many characters, as far as names allow. Times are from the beginning."""
    lines = [*_about_states(summary), *_about_energy(summary), *_about_balance(summary), *_about_collisions(summary)]
    lines += _about_contact(summary)
    notes = [one["text"] for one in summary["findings"] if one["cause"] == NOTE]
    faults = [Finding(**one) for one in summary["findings"] if one["cause"] != NOTE]
    for heading, texts in (("Worth knowing", [*map(str, faults), *summary["warnings"]]), ("How it was read", notes)):
        if texts:
            lines += ["", heading, *_some(texts, "more; --json has all")]
    return "\n".join(_wrapped(line, width) for line in lines)


def _wrapped(line, width):
    """The line, and what does not fit in it farther in below; no word is cut."""
    inward = (len(line) - len(line.lstrip()) + 2) * " "
    line = re.sub(r"(?<=\d) (?=(?:s|ms|J|W|N|Hz|rad)\b)", JOINED, line)  # a number and its unit
    line = textwrap.fill(line, width, subsequent_indent=inward, break_long_words=False, break_on_hyphens=False)
    return line.replace(JOINED, " ")


def _after(summary, time):
    """A time of the recording as seconds after its first state."""
    return f"{time - summary['begin']:.3f} s"


def _about_contact(summary):
    contact = summary["contact"]
    if not contact:
        return []
    lines = ["", f"Limits of contact exceeded for {contact['above']:.3g} s of {contact['of']:.6g} s"]
    by_point = sorted(contact["above_by_point"].items(), key=lambda one: -one[1])
    if by_point:
        lines += [f"  by {', '.join(f'{name} {seconds:.3g} s' for name, seconds in by_point[:FEW])}"]
    for one in contact["worst"][:FEW]:
        at = _after(summary, one["at"])
        lines.append(
            f"  {at}: {one['point']} at {100 * one['usage']:.0f} % of the speed allowed by {one['region']}: "
            f"{one['speed']:.3g} m/s, {one['reflected_mass']:.3g} kg, {one['energy']:.3g} J, {one['force']:.3g} N"
        )
    return lines


def _about_states(summary):
    quality, rejected = summary["quality"], sum(summary["rejected"].values())
    rate = "" if quality["rate"] is None else f" at {quality['rate']:.4g} Hz"
    jitter = "" if quality["jitter"] is None else f", jitter {quality['jitter'] * 1e3:.2g} ms"
    lines = [
        f"Robot '{summary['robot']}', {len(summary['degrees_of_freedom'])} degrees of freedom",
        f"{summary['states']} states in {summary['duration']:.6g} s{rate}{jitter}; {rejected} messages rejected",
    ]
    if summary["begin"]:
        lines.append(f"Times below are from the first state on, at {summary['begin']:.6f} s in the recording")
    if quality["without_effort"]:
        lines.append(f"{quality['without_effort']} states without effort")
    return lines


def _about_energy(summary):
    energy = summary["kinetic_energy"]
    if energy["max"] is None:
        return []
    shares = sorted(energy["share"].items(), key=lambda one: -one[1])[:FEW]
    at = _after(summary, energy["at"])
    lines = [
        "",
        f"Kinetic energy: at most {energy['max']:.4g} J at {at}, {energy['mean']:.4g} J on average",
        "  largest shares: " + ", ".join(f"{name} {share:.3g} J" for name, share in shares),
    ]
    for what, label, unit in (("velocity", "velocity", "rad/s or m/s"), ("effort", "effort", "N m or N")):
        if what in summary["peaks"]:
            peak = summary["peaks"][what]
            lines.append(
                f"  largest {label}: {peak['value']:.4g} {unit} at {peak['of']}, {_after(summary, peak['at'])}"
            )
    return lines


def _about_balance(summary):
    if summary["explained"] is None:
        says = summary["balance"]["says"] if _has_efforts(summary) else "no efforts"
        wrong = summary["efforts"]["says"]
        return ["", f"No balance of power: {says}.", *([f"  {wrong}"] if wrong else [])]
    total = summary["explained_with_potential"]
    also = "" if total is None else f" (with potential energy {total:.3f})"
    lines = [
        "",
        f"Balance of power over windows of {summary['balance']['length']:g} s: explained {summary['explained']:.3f}{also}, "
        f"residual {summary['residual_power']:.3g} W rms",
        f"  {summary['balance']['says']}",
    ]
    if summary["collisions"] and summary["explained"] < PART:
        lines.append(
            "  collisions are in it, and the power of a push is in no effort: judge the balance where nothing touches the "
            "robot (--start, --end)"
        )
    worst = sorted(summary["balance"]["joints"].items(), key=lambda one: -one[1]["share"])[:FEW]
    lines.append("  residual by joint: " + ", ".join(f"{name} {of['residual_power']:.2g} W" for name, of in worst))
    return lines


def _about_collisions(summary):
    observer, peaks = summary["observer"], summary["peaks"]
    says = [f"  {observer['says']}"] if observer["says"] else []
    if "residual_norm" not in peaks:
        return ["", "External torque", *says]
    norm, torque = peaks["residual_norm"], peaks["external_torque"]
    lines = [
        "",
        f"External torque (observer of {_gain_in_words(observer)}): at most {torque['value']:.4g} N m or N at "
        f"{torque['of']}, {_after(summary, torque['at'])}; |r| at most {norm['value']:.4g} J^0.5/s",
    ]
    found = summary["collisions"]
    count = f"{len(found)} collision{'' if len(found) == 1 else 's'}"
    if observer["judged"]:
        lines.append(f"  {count}, by thresholds of {', '.join(observer['judged'])}")
    elif observer["threshold"] is None:
        return [*lines, *says]
    else:
        lines.append(f"  {count} above {observer['threshold']:g} J^0.5/s")
    told = [
        f"{_after(summary, one['start'])} to {_after(summary, one['end'])}, "
        + (one.get("told") or f"|r| {one['norm']:.3g}, {', '.join(one['joints'])}")
        for one in found
    ]
    return [*lines, *says, *_some(told, "more")]


def _gain_in_words(observer):
    """Return the gain, and why it is not the parameter's."""
    why = " because external_torque.gain is not set" if "external_torque.gain" in observer["missing"] else ""
    return f"gain {observer['gain']:g}/s{why}"


def _some(texts, more):
    lines = [f"  {text}" for text in texts[:FEW]]
    return [*lines, f"  … {len(texts) - FEW} {more}"] if len(texts) > FEW else lines
