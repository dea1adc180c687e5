# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Summary of an analysis, as numbers for programs and as text for people."""

import textwrap

import numpy as np

from diag_dynamics.recordings.balance import MIN_EXPLAINED, WINDOW
from diag_dynamics.recordings.findings import (
    NOTE,
    Finding,
    explain_missing_efforts,
    word_for_missing,
)
from diag_dynamics.recordings.quality import describe_ratio
from diag_dynamics.text import listed

REJECTED = "rejected: "  # prefix of the counts of rejected joint states
FEW = 5  # joints, findings and collisions that the text lists one by one
WIDTH = 100  # longest line of the text, as far as names allow


def summarize(analysis):
    """Return the numbers of an Analysis that has run as a dict in SI units.

    The keys are listed in docs/recordings.md.
    """
    balance, peaks, counts = (
        analysis.balance,
        analysis.peaks,
        dict(sorted(analysis.reading.counts.items())),
    )

    def time(stamp):
        return None if stamp is None else float((stamp - analysis.reading.offset) * 1e-9)

    largest, (quality, warnings) = peaks.largest(), analysis.quality.report()
    quality["longest_gap_at"] = time(quality["longest_gap_at"])
    unmeasured = _unmeasured(analysis, quality["without_effort"])
    good = balance.explained is not None and balance.explained >= MIN_EXPLAINED
    good |= balance.is_explained_beside(analysis.collisions.alarms)
    fault = None if good or unmeasured or not analysis.efforts.moved else analysis.motion.fault()
    fault_text = fault.text if fault else ""
    unscaled = analysis.efforts.unscaled
    partial = np.array(analysis.model.dof_names)[~unscaled] if unscaled.any() else ()
    return {
        "robot": analysis.model.name,
        "degrees_of_freedom": list(analysis.model.dof_names),
        "states": analysis.states,
        "duration": analysis.quality.duration,
        "begin": time(analysis.quality.begin),
        "end": time(analysis.quality.end),
        "counts": counts,
        "rejected": {
            key.removeprefix(REJECTED): n
            for key, n in counts.items()
            if key.startswith(REJECTED) and n
        },
        "kinetic_energy": _kinetic_energy(analysis, time),
        "peaks": {
            name: {"value": value, "at": time(at), "of": of}
            for name, (value, at, of) in largest.items()
        },
        "explained": balance.explained,
        "explained_with_potential": balance.explained_total,
        "residual_power": balance.residual_power,
        "balance": balance.summary(unmeasured or fault_text, analysis.collisions.alarms, partial),
        "efforts": {"unmeasured": unmeasured, "text": fault_text},
        "observer": {
            "gain": analysis.gain,
            "judged": list(analysis.collisions.judged),
            "missing": list(analysis.missing),
            "observed": analysis.observed,
            "unobserved": np.array(analysis.model.dof_names)[analysis.unobserved].tolist(),
            "text": " ".join(
                filter(
                    None,
                    (_unobserved(analysis), _unknown_contacts(analysis, quality["without_effort"])),
                )
            ),
        },
        "collisions": _entries(analysis.collisions, time),
        "contacts": _entries(analysis.contacts, time) if analysis.contacts.judged else None,
        "contact_limits": analysis.exposure.summary(time) if analysis.exposure else None,
        "quality": quality,
        "warnings": [unmeasured, *warnings] if unmeasured else warnings,
        "findings": [finding._asdict() for finding in analysis.findings],
    }


def _kinetic_energy(analysis, time):
    """Return mean, maximum with its time, and the largest share of each joint [J]."""
    shares, _, names = analysis.peaks.entries["energy_share"]
    largest, at, _ = analysis.peaks.largest()["kinetic_energy"]
    mean, share = analysis.kinetic / analysis.states, dict(zip(names, shares.tolist(), strict=True))
    return {"mean": mean, "max": largest, "at": time(at), "share": share}


def _unmeasured(analysis, without_effort):
    """Return which efforts cannot have been measured, in words; or an empty text."""
    names, implausible = (
        analysis.reading.intake.assembler.lacking_effort,
        analysis.reading.counts["implausible effort"],
    )
    if not names or implausible or without_effort < analysis.states:
        return analysis.efforts.unmeasured(word_for_missing(analysis.reading.counts))
    return (
        f"efforts of {', '.join(names)} are missing throughout, "
        "so no state has all efforts (locked_joints)"
    )


def _unobserved(analysis):
    """Return a text on joints without external torque, because their efforts are unknown.

    The text is empty if there are none.
    """
    names, some = (
        ", ".join(np.array(analysis.model.dof_names)[analysis.unobserved]),
        not analysis.unobserved.all(),
    )
    if not names:
        return ""
    text = (
        f"External torque of {names if some else 'all joints'}, and with it |r|, is unknown, "
        "because efforts are."
    )
    return text + " Other joints are judged." * some


def _unknown_contacts(analysis, without_effort):
    """Return why collisions are unknown; or an empty text."""
    states, unknown, missing = (
        analysis.states,
        analysis.states - analysis.observed,
        analysis.missing,
    )
    if not analysis.observed:
        why = "the observer has no result at any state"
        why = explain_missing_efforts(analysis.reading.counts) if without_effort == states else why
    elif missing:
        why = (
            f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not set. "
            "diag-dynamics calibrate computes "
            "thresholds for --alarms"
        )
    elif unknown > 1:  # the first one never has a result
        return (
            f"Collisions are unknown at {unknown} of {states} states: "
            "the observer has no result there."
        )
    else:
        return ""
    return f"Collisions are unknown: {why}."


def _entries(alarms, time):
    """Return collisions or contacts."""
    return [
        {
            "start": time(alarm.start),
            "end": time(alarm.end),
            "joints": list(alarm.joints),
            "norm": alarm.norm,
            "first": alarm.first,
            "exceeded": {
                event.detector: {"value": event.value, "threshold": event.threshold}
                for event in alarm.exceeded
            },
            "told": alarm.describe(),
        }
        | ({"link": alarm.link, "confidence": alarm.confidence} if alarm.chi_square else {})
        for alarm in alarms.alarms
    ]


def count_collisions(summary):
    """Return the number of collisions.

    Return None if it is unknown, without a threshold or a result.
    """
    observer = summary["observer"]
    return len(summary["collisions"]) if observer["observed"] and not observer["missing"] else None


def describe_faults(summary):
    """Return what is wrong with a recording or its robot, in words: the causes of exit status 1."""
    efforts, explained, unit = (
        summary["efforts"],
        summary["explained"],
        summary["quality"]["wrong_unit"],
    )
    rejected, causes = (
        sum(summary["rejected"].values()),
        {finding["cause"] for finding in summary["findings"]},
    )
    few = f"the power balance explains less than {100 * MIN_EXPLAINED:.0f} % of dK/dt"
    implausible = (
        "no power balance, because efforts exceed 4 times the URDF limits; expected N m or N"
    )
    none, with_efforts = explained is None, _has_efforts(summary)
    wrongs = {
        "unreadable data": "unread" in causes,
        f"{rejected} rejected message{_s(rejected)}": rejected,
        few: not none
        and explained < MIN_EXPLAINED
        and not summary["balance"]["explained_beside_collisions"],
        "no power balance, although there are efforts": none
        and with_efforts
        and summary["balance"]["moved"],
        efforts["unmeasured"]: none and not with_efforts,
        implausible: none and "implausible effort" in causes,
        f"{unit['cause']} ({describe_ratio(unit['factor'])})" if unit else "": True,
        efforts["text"]: True,
    }
    return [text for text, applies in wrongs.items() if text and applies]


def _has_efforts(summary):
    return summary["states"] > summary["quality"]["without_effort"]


def format_summary(summary):
    """Return the summary for people: lines with times from the first state on."""
    notes = [finding["text"] for finding in summary["findings"] if finding["cause"] == NOTE]
    faults = [
        str(Finding(**finding)) for finding in summary["findings"] if finding["cause"] != NOTE
    ]
    faults += summary["warnings"]
    parts = [list(part(summary)) for part in PARTS]
    for heading, texts in (("Findings", faults), ("Input", notes)):
        parts += [[heading, *_some(texts, "more; --json has all")]] if texts else []
    return "\n\n".join("\n".join(_wrapped(line) for line in part) for part in parts if part)


def _wrapped(line):
    """Return the line with line breaks, the next lines farther in; no word is cut."""
    inward = (len(line) - len(line.lstrip()) + 2) * " "
    return textwrap.fill(
        line, WIDTH, subsequent_indent=inward, break_long_words=False, break_on_hyphens=False
    )


def _some(texts, more):
    lines = [f"  {text}" for text in texts[:FEW]]
    return [*lines, f"  … {len(texts) - FEW} {more}"] if len(texts) > FEW else lines


def _largest(numbers, form):
    """Return the largest few numbers by name, in words."""
    largest = sorted(numbers.items(), key=lambda item: -item[1])[:FEW]
    return ", ".join(form.format(name, number) for name, number in largest)


def _s(count):
    """Return the ending of the plural."""
    return "" if count == 1 else "s"


def _after(summary, time):
    """Return a time of the recording as seconds after its first state."""
    return f"{time - summary['begin']:.3f} s"


def _about_states(summary):
    quality, rejected = summary["quality"], sum(summary["rejected"].values())
    rate = (
        ""
        if quality["rate"] is None
        else f" at {quality['rate']:.4g} Hz, jitter {quality['jitter'] * 1e3:.2g} ms"
    )
    freedom, states = len(summary["degrees_of_freedom"]), summary["states"]
    yield f"Robot '{summary['robot']}', {freedom} degree{_s(freedom)} of freedom"
    counted = f"{states} state{_s(states)} in {summary['duration']:.6g} s{rate}"
    yield f"{counted}; {rejected} message{_s(rejected)} rejected"
    if summary["begin"]:
        yield f"Times below start at the first state, {summary['begin']:.6f} s in the recording"
    if quality["without_effort"]:
        yield f"{quality['without_effort']} state{_s(quality['without_effort'])} without effort"


def _about_energy(summary):
    energy, peaks = summary["kinetic_energy"], summary["peaks"]
    at = _after(summary, energy["at"])
    yield f"Kinetic energy: maximum {energy['max']:.4g} J at {at}, mean {energy['mean']:.4g} J"
    yield f"  largest shares: {_largest(energy['share'], '{} {:.3g} J')}"
    for name, unit in (("velocity", "rad/s or m/s"), ("effort", "N m or N")):
        if peak := peaks.get(name):
            yield (
                f"  largest {name}: {peak['value']:.4g} {unit} at {peak['of']}, "
                f"{_after(summary, peak['at'])}"
            )


def _about_balance(summary):
    explained, total, balance = (
        summary["explained"],
        summary["explained_with_potential"],
        summary["balance"],
    )
    if explained is None:
        none = summary["efforts"]["unmeasured"] or "no efforts"
        yield f"No power balance: {balance['text'] if _has_efforts(summary) else none}."
        if summary["efforts"]["text"]:
            yield f"  {summary['efforts']['text']}"
        return
    also = "" if total is None else f" ({total:.3f} with potential energy)"
    power = summary["residual_power"]
    explains = f"variance explained {explained:.3f}{also}, residual {power:.3g} W rms"
    yield f"Power balance in windows of {WINDOW:g} s: {explains}"
    if balance["partial"]:
        joints = listed(balance["partial"])
        yield f"  partial: of {joints} alone; the model's efforts stand for those of other joints"
    yield f"  {balance['text']}"
    is_doubtful = explained < MIN_EXPLAINED and not balance["explained_beside_collisions"]
    if summary["collisions"] and is_doubtful:
        yield (
            "  the balance includes collisions, whose power no effort contains: select a part "
            "without contact "
            "(--start, --end)"
        )
    joints = {name: numbers["residual_power"] for name, numbers in balance["joints"].items()}
    yield f"  residual by joint: {_largest(joints, '{} {:.2g} W')}"


def _about_collisions(summary):
    observer, peaks, alarms = summary["observer"], summary["peaks"], summary["collisions"]
    count = f"{len(alarms)} collision{_s(len(alarms))}"
    if "residual_norm" in peaks:
        torque, norm = peaks["external_torque"], peaks["residual_norm"]["value"]
        yield (
            f"External torque (observer gain {observer['gain']:g}/s): maximum "
            f"{torque['value']:.4g} N m or N at "
            f"{torque['of']}, {_after(summary, torque['at'])}; maximum |r| {norm:.4g} J^0.5/s"
        )
    else:
        yield "External torque"
    if observer["observed"] and observer["judged"]:
        yield f"  {count}, by thresholds of {', '.join(observer['judged'])}"
    if summary["contacts"] is not None:
        yield (
            f"  {len(summary['contacts'])} contact{_s(len(summary['contacts']))}, "
            "by the lower thresholds"
        )
    if observer["text"]:
        yield f"  {observer['text']}"
    lines = [
        f"{_after(summary, alarm['start'])} to {_after(summary, alarm['end'])}, {alarm['told']}"
        + (f", touched {alarm['link']} ({alarm['confidence']:.0%})" if alarm.get("link") else "")
        for alarm in alarms
    ]
    yield from _some(lines, "more")


def _about_contact(summary):
    if not (contact := summary["contact_limits"]):
        return
    yield f"Contact limits exceeded for {contact['above']:.3g} s of {contact['of']:.6g} s"
    if contact["above_by_point"]:
        yield f"  by {_largest(contact['above_by_point'], '{} {:.3g} s')}"
    for moment in contact["worst"]:
        yield (
            f"  {_after(summary, moment['at'])}: {moment['point']} at "
            f"{100 * moment['usage']:.0f} % of the speed allowed by {moment['region']}: "
            f"{moment['speed']:.3g} m/s, {moment['reflected_mass']:.3g} kg, "
            f"{moment['energy']:.3g} J, {moment['force']:.3g} N"
        )


PARTS = _about_states, _about_energy, _about_balance, _about_collisions, _about_contact
