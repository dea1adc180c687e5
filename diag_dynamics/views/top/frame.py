# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A frame of `top`: lines of text for a terminal of any size."""

import math
import unicodedata
from dataclasses import dataclass

import numpy as np

from diag_dynamics.text import duration, number, plain
from diag_dynamics.views.top.choices import HELP, SORTS
from diag_dynamics.views.top.drawing import chart, sparkline
from diag_dynamics.views.top.history import RobotHistory
from diag_dynamics.views.top.quantities import ENERGY, EXTERNAL, QUANTITIES

BOLD, DIM, PLAIN, TITLE = "1", "2", "", "7"
CALM, NEAR, ABOVE, BLUE = "32", "33", "1;31", "36"
"""Colours: far from a limit, near it, above it; where there is none."""

NEARLY = 0.7
"""Part of a limit from which it is near."""

TALLEST = 20
"""Lines that a chart has at most."""

SILENT = 1.0
"""Time without a state from which that is told [s]."""


@dataclass
class Shown:
    """A robot as it is shown.

    Attributes
    ----------
    title : str
    history : RobotHistory or None
        None before the first state.
    rate : float
        Of states [Hz].
    late : float
        From a stamp to its arrival [s].
    power : float
        Net power of efforts and gravity, ν·(ε − ε_g) [W]; NaN without efforts.
    silent : float
        Since the last state [s].
    torque, residual : tuple of float
        ‖m r‖ [N m] and |r| [√J/s], and their thresholds; NaN where they are not known.
    alarm : str
        What is in alarm; empty if nothing is.
    waiting : str
        What is waited for while there is no state.
    refused : int
        Messages that made no sense.
    """

    title: str
    history: RobotHistory | None = None
    rate: float = 0.0
    late: float = math.nan
    power: float = math.nan
    silent: float = 0.0
    torque: tuple = (math.nan, math.inf)
    residual: tuple = (math.nan, math.inf)
    alarm: str = ""
    waiting: str = ""
    refused: int = 0


def frame(robots, choices, width, height, colours=True, fancy=True):
    """Lines of a frame: no more than `height`, none wider than `width`.

    Parameters
    ----------
    robots : list of Shown
        At least one.
    choices : Choices
    width, height : int
        Of the terminal, in characters.
    colours : bool
        Whether it has them.
    fancy : bool
        Whether it has blocks and braille.
    """
    robot = robots[choices.robot % len(robots)]
    lines = [_title(robots, robot, choices, width, colours)]
    body = max(0, height - 2)
    if choices.help:
        lines += _help(width, body, colours)
    elif choices.overview and len(robots) > 1:
        lines += _overview(robots, choices, width, body, colours, fancy)
    elif robot.history is None:
        said = robot.waiting + (f"; {robot.refused} messages made no sense" if robot.refused else "")
        lines += [_line([(text, DIM)], width, colours) for text in _wrapped(said, width)][:body]
    else:
        lines += _robot(robot, choices, width, body, colours, fancy)
    lines = lines[: height - 1]
    lines += [""] * (height - 1 - len(lines))
    return [*lines, _footer(choices, width, colours)]


def _title(robots, robot, choices, width, colours):
    silent = robot.history is not None and robot.silent > SILENT
    count = f" {choices.robot % len(robots) + 1}/{len(robots)}" if len(robots) > 1 else ""
    said = f" no state for {duration(robot.silent)}" if silent else ""
    if not said and robot.history is not None:
        late = f"  {duration(robot.late)} late" if width >= 60 and robot.late == robot.late else ""
        said = f" {robot.rate:.0f} Hz{late}"
    said += " PAUSED" if choices.paused else ""
    rest = f"{count}{said} "
    name = _cut(plain(robot.title), width - len(rest) - 1)
    return _line([(f" {name}{rest}".ljust(width), f"{TITLE};{ABOVE}" if silent else TITLE)], width, colours)


def _robot(robot, choices, width, rows, colours, fancy):
    history, of = robot.history, QUANTITIES[choices.quantity]
    lines = _headlines(robot, width, colours)
    order = _order(history, choices)
    left = rows - len(lines) - 1  # but for the heading of the table
    drawn = max(min(max(left - len(order), left // 4), left // 2, TALLEST), 0)
    if drawn >= 2:
        lines += _chart(robot, choices, width, drawn, colours, fancy)
    left -= drawn if drawn >= 2 else 0
    return lines + _table(robot, choices, order, width, left, colours, fancy, of)


def _headlines(robot, width, colours):
    history, narrow = robot.history, width < 60
    peak = history.total_peak
    parts = [("K ", DIM), (f"{number(history.total)} J", BOLD), ("  peak ", DIM), (f"{number(peak)} J", PLAIN)]
    if not narrow and peak > 0.0:
        parts.append((f" {history.newest - history.total_peak_at:.0f} s ago", DIM))
    if not narrow:
        power = f"{number(robot.power)} W" if robot.power == robot.power else "unknown: no efforts"
        parts += [("   net power ", DIM), (power, PLAIN)]
    lines = [_line(parts, width, colours)]
    if robot.torque[0] == robot.torque[0]:
        parts = [("m r ", DIM), *_judged(robot.torque, "N m"), ("  r ", DIM), *_judged(robot.residual, "√J/s")]
        lines.append(_line(parts, width, colours))
    if robot.refused:
        lines.append(_line([(f"{robot.refused} messages made no sense", NEAR)], width, colours))
    if robot.alarm:
        lines.append(_line([(f"ALARM {plain(robot.alarm)}", ABOVE)], width, colours))
    return lines


def _judged(pair, unit):
    value, threshold = pair
    part = value / threshold
    bound = f" of {number(threshold)}" if threshold < math.inf else ""
    return [(f"{number(value)}{bound} {unit}", _colour(part, threshold < math.inf))]


def _colour(part, limited):
    if not limited or part != part:
        return BLUE
    return ABOVE if part > 1.0 else NEAR if part > NEARLY else CALM


def _order(history, choices):
    """Joints that are wanted, in the order in which they are shown."""
    q, wanted = choices.quantity, choices.wanted.lower()
    order = [k for k, name in enumerate(history.names) if wanted in name.lower()]
    key = None
    if SORTS[choices.sort] == "value":
        key = np.abs(history.last[q])
    elif SORTS[choices.sort] == "peak":
        key = history.peak[q]
    elif SORTS[choices.sort] == "part of limit":
        part = np.abs(history.last[q]) / history.limits[q]
        key = part if np.isfinite(history.limits[q]).any() else np.abs(history.last[q])
    if key is not None:
        key = np.nan_to_num(key)
        order.sort(key=lambda k: -key[k])
    return order


def _chart(robot, choices, width, rows, colours, fancy):
    history, of, q, margin = robot.history, QUANTITIES[choices.quantity], choices.quantity, 9
    count = max(1, width - margin) * (2 if fancy else 1)
    limits = history.limits[q]
    limited = bool(np.isfinite(limits).any())
    if q == ENERGY:
        values, what, unit = history.recent_total(choices.window, count), "K", "J"
    else:
        each = history.recent(choices.window, q, count)
        each = each / limits if limited else each
        known = ~np.isnan(each).all(axis=1)
        values = np.full(count, np.nan)
        if known.any():
            values[known] = np.nanmax(each[known], axis=1)
        what, unit = (f"of {of.of_limit[:5]}", "") if limited else (of.symbol, of.unit)
    most = float(np.nanmax(values)) if not np.isnan(values).all() else 0.0
    shade = _colour(most, limited) if q != ENERGY else BLUE
    if q == EXTERNAL:
        most = max(most, 1.0 if limited else _threshold_of_norms(robot))
    lines = []
    drawn = chart(values, most, rows, fancy)
    for k, text in enumerate(drawn):
        label = f"{number(most)} {unit}" if k == 0 else what if k == 1 and rows > 2 else "0" if k == rows - 1 else ""
        lines.append(_line([(_cut(label, margin - 1).rjust(margin - 1) + " ", DIM), (text, shade)], width, colours))
    return lines


def _table(robot, choices, order, width, rows, colours, fancy, of):
    history, q = robot.history, choices.quantity
    limits = history.limits[q]
    limited = bool(np.isfinite(limits).any())
    wide = width >= 60
    longest = max([5, *(_cells(plain(history.names[k])) for k in order)])
    name_width = min(longest, max(8, width // 4 if wide else width - 27))
    widths = 8, 9 if wide else 0, 6 if limited else 0
    left = max(0, width - name_width - 1 - sum(widths) - 2)
    ages = width >= 100
    left -= 8 if ages else 0
    heading = f"{'joint':{name_width}} {of.symbol + ' ' + of.unit:>8}"
    heading += f"{'peak':>9}" if wide else ""
    heading += f"{'ago':>8}" if ages else ""
    heading += f"{'of ' + of.of_limit if wide and len(of.of_limit) < 4 else '%':>6}" if limited else ""
    heading += f"  last {choices.window:g} s"
    shown_rows = max(0, rows)
    first = min(choices.scroll, max(0, len(order) - shown_rows))
    choices.scroll = first
    shown = order[first : first + shown_rows]
    if len(order) > len(shown):
        heading += f" ({first + 1}-{first + len(shown)} of {len(order)})"
    lines = [_line([(heading, f"{DIM};4")], width, colours)]
    sparks = history.recent(choices.window, q, max(left, 1)) if left else None
    least = _threshold_of_norms(robot) if q == EXTERNAL else 0.0
    for k in shown:
        value, limit = history.last[q, k], limits[k]
        part = abs(value) / limit
        shade = _colour(part, math.isfinite(limit))
        parts = [(_padded(_cut(plain(history.names[k]), name_width, tail=True), name_width) + " ", PLAIN)]
        parts.append((number(value).rjust(8), f"{BOLD};{shade}" if shade != BLUE else BOLD))
        if wide:
            parts.append((number(history.peak[q, k]).rjust(9), DIM))
        if ages:
            ago = history.newest - history.peak_at[q, k]
            parts.append(((f"{ago:.0f} s" if ago == ago else "-").rjust(8), DIM))
        if limited:
            parts.append(((f"{100 * part:.0f} %" if math.isfinite(limit) and part == part else "").rjust(6), shade))
        if sparks is not None:
            most = limit if math.isfinite(limit) else max(_most(sparks, shown), least)
            parts.append(("  " + sparkline(sparks[:, k], most, fancy), shade))
        lines.append(_line(parts, width, colours))
    if not order:
        lines.append(_line([(f"no joint has '{plain(choices.wanted)}' in its name", DIM)], width, colours))
    return lines


def _threshold_of_norms(robot):
    """External torque of a joint at which ‖m r‖ or |r| reaches its threshold [N m, N]; 0 without one."""
    (_, threshold), (norm, norm_threshold) = robot.torque, robot.residual
    if threshold < math.inf:
        return threshold
    if norm_threshold < math.inf and norm > 0.0:
        return float(np.nanmax(np.abs(robot.history.last[EXTERNAL]), initial=0.0)) * norm_threshold / norm
    return 0.0


def _most(sparks, shown):
    values = sparks[:, shown]
    return float(np.nanmax(values)) if not np.isnan(values).all() else 0.0


def _overview(robots, choices, width, rows, colours, fancy):
    """A row for each robot."""
    longest = max(_cells(plain(robot.title)) for robot in robots)
    name_width = min(longest, max(8, width // 3))
    left = max(0, width - name_width - 30)
    heading = f"{'robot':{name_width}} {'K J':>8} {'peak':>8} {'Hz':>5}  last {choices.window:g} s"
    lines = [_line([(heading, f"{DIM};4")], width, colours)]
    for k, robot in enumerate(robots[: max(0, rows - 1)]):
        name = _padded(_cut(plain(robot.title), name_width, tail=True), name_width) + " "
        if robot.history is None:
            lines.append(_line([(name, PLAIN), ("no state yet", DIM)], width, colours))
            continue
        shade = ABOVE if robot.alarm or robot.silent > SILENT else BLUE
        spark = robot.history.recent_total(choices.window, max(left, 1))
        most = float(np.nanmax(spark)) if not np.isnan(spark).all() else 0.0
        mark = BOLD if k == choices.robot % len(robots) else PLAIN
        numbers = f"{number(robot.history.total):>8} {number(robot.history.total_peak):>8} {robot.rate:5.0f}  "
        lines.append(
            _line([(name, mark), (numbers, shade), (sparkline(spark, most, fancy)[:left], shade)], width, colours)
        )
    return lines


def _help(width, rows, colours):
    wide = max(len(keys) for keys, _ in HELP) + 2
    lines = []
    for keys, what in HELP:
        first, *more = _wrapped(what, max(10, width - wide))
        lines.append(_line([(keys.ljust(wide), BOLD), (first, PLAIN)], width, colours))
        lines += [_line([(" " * wide + text, PLAIN)], width, colours) for text in more]
    return lines[:rows]


def _footer(choices, width, colours):
    if choices.typing:
        return _line([(f"/{plain(choices.wanted)}_", BOLD), ("  Enter keeps it, Esc drops it", DIM)], width, colours)
    of = QUANTITIES[choices.quantity]
    narrow = width < 60
    said = [f"{choices.quantity + 1} {of.name}", SORTS[choices.sort] if narrow else f"sort: {SORTS[choices.sort]}"]
    if choices.wanted:
        said.append(f"/{plain(choices.wanted)}")
    keys = "? q" if narrow else "? help  q end"
    return _line([("  ".join(said), BOLD), ("  " + keys, DIM)], width, colours)


# --- Text of a certain width


def _cells(text):
    """Columns that a text takes on a terminal."""
    if text.isascii():
        return len(text)
    return sum(0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)


def _cut(text, width, tail=False):
    """The text in so many columns at most; of a long one the beginning, or the tail, which tells joints apart."""
    if _cells(text) <= width:
        return text
    if width < 1:
        return ""
    kept, used = [], 1
    for c in reversed(text) if tail else text:
        used += _cells(c)
        if used > width:
            break
        kept.append(c)
    return "…" + "".join(reversed(kept)) if tail else "".join(kept) + "…"


def _padded(text, width):
    return text + " " * (width - _cells(text))


def _line(parts, width, colours):
    """Texts with their codes as one line, cut where the terminal ends."""
    line, left = [], width
    for text, code in parts:
        text = _cut(text, left) if _cells(text) > left else text
        left -= _cells(text)
        line.append(f"\x1b[{code}m{text}\x1b[0m" if colours and code and text else text)
        if left <= 0:
            break
    return "".join(line)


def _wrapped(text, width):
    """Lines of words, none wider than that if it can be helped."""
    lines = [""]
    for word in plain(text).split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append(word)
        else:
            lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


# --- A line for a terminal that can do no more

FEW = 4
"""Joints that it has."""


def line_of(shown):
    """What there is to say of a robot, in one line."""
    history = shown.history
    if history is None:
        return f"{shown.title}: {shown.waiting}"
    if shown.silent > SILENT:
        return f"{shown.title}: no state for {duration(shown.silent)}"
    shares = history.last[ENERGY]
    most = [f"{history.names[k]} {number(shares[k])}" for k in np.argsort(shares)[::-1][:FEW]]
    said = [f"{shown.title}: K {number(history.total)} J, peak {number(history.total_peak)}", f"{', '.join(most)} J"]
    limits, values = history.limits[EXTERNAL], history.last[EXTERNAL]
    part = np.abs(values) / limits
    if np.isfinite(limits).any() and not np.isnan(part).all():
        k = int(np.nanargmax(part))
        said.append(f"external {history.names[k]} {number(values[k])} of {number(limits[k])} N m")
    said.append(f"{shown.rate:.0f} Hz")
    if shown.alarm:
        said.append(f"ALARM {shown.alarm}")
    return "; ".join(said)
