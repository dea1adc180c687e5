# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The summary of an Analysis as text for people, and its faults."""

import textwrap

from diag_dynamics.recordings.balance import MIN_EXPLAINED, WINDOW
from diag_dynamics.recordings.findings import NOTE, Finding
from diag_dynamics.recordings.sampling import describe_ratio
from diag_dynamics.text import listed

FEW = 5  # joints, findings and collisions that the text lists one by one
WIDTH = 100  # longest line of the text, as far as names allow


def count_collisions(summary):
    """Return the number of collisions.

    Return None if it is unknown, without a threshold or a result.
    """
    observer = summary["observer"]
    return len(summary["collisions"]) if observer["observed"] and not observer["missing"] else None


def describe_faults(summary):
    """Return what is wrong with a recording or its robot, in words: the causes of exit status 1."""
    efforts = summary["efforts"]
    explained = summary["explained"]
    unit = summary["quality"]["wrong_unit"]
    rejected = sum(summary["rejected"].values())
    causes = {finding["cause"] for finding in summary["findings"]}
    few = f"the power balance explains less than {100 * MIN_EXPLAINED:.0f} % of dK/dt"
    implausible = (
        "no power balance, because efforts exceed 4 times the URDF limits; expected N m or N"
    )
    none = explained is None
    with_efforts = _has_efforts(summary)
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


def make_row(summary):
    """Return the row of a recording in a table of several."""
    return {
        **{name: summary[name] for name in ("recording", "robot", "states", "duration")},
        "kinetic_energy_max": summary["kinetic_energy"]["max"],
        **{name: summary[name] for name in ("explained", "residual_power")},
        "external_torque_max": summary["peaks"].get("external_torque", {}).get("value"),
        "collisions": count_collisions(summary),
        "rejected": sum(summary["rejected"].values()),
        "faults": "; ".join(describe_faults(summary)),
    }


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
    quality = summary["quality"]
    rejected = sum(summary["rejected"].values())
    rate = (
        ""
        if quality["rate"] is None
        else f" at {quality['rate']:.4g} Hz, jitter {quality['jitter'] * 1e3:.2g} ms"
    )
    freedom = len(summary["degrees_of_freedom"])
    states = summary["states"]
    yield f"Robot '{summary['robot']}', {freedom} degree{_s(freedom)} of freedom"
    counted = f"{states} state{_s(states)} in {summary['duration']:.6g} s{rate}"
    yield f"{counted}; {rejected} message{_s(rejected)} rejected"
    if summary["begin"]:
        yield f"Times below start at the first state, {summary['begin']:.6f} s in the recording"
    if quality["without_effort"]:
        yield f"{quality['without_effort']} state{_s(quality['without_effort'])} without effort"


def _about_energy(summary):
    energy = summary["kinetic_energy"]
    peaks = summary["peaks"]
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
    explained = summary["explained"]
    total = summary["explained_with_potential"]
    balance = summary["balance"]
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
            "without contact (--start, --end)"
        )


def _about_collisions(summary):
    observer = summary["observer"]
    peaks = summary["peaks"]
    alarms = summary["collisions"]
    count = f"{len(alarms)} collision{_s(len(alarms))}"
    if "residual_norm" in peaks:
        torque = peaks["external_torque"]
        norm = peaks["residual_norm"]["value"]
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
        f"{_after(summary, alarm['start'])} to {_after(summary, alarm['end'])}, {alarm['text']}"
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
    if moment := contact["worst"]:
        yield (
            f"  {_after(summary, moment['at'])}: {moment['point']} at {100 * moment['usage']:.0f} "
            f"% of the speed allowed by {moment['region']}: {moment['speed']:.3g} m/s, "
            f"{moment['reflected_mass']:.3g} kg, {moment['energy']:.3g} J, {moment['force']:.3g} N"
        )


PARTS = _about_states, _about_energy, _about_balance, _about_collisions, _about_contact
