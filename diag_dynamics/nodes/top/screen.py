# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of `top`: what the keys choose, drawn by rich for a terminal of any size."""

import math

import numpy as np
from rich.console import Group
from rich.layout import Layout
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from diag_dynamics.nodes.top.robot import ENERGY, EXTERNAL, QUANTITIES, SLOT
from diag_dynamics.text import duration, number, plain

WINDOWS = 5, 10, 30, 60
"""Times that charts show [s]."""

SORTS = "base to tip", "by value", "by peak", "by limit"
KEYS = "q quit  1-6 values  s sort  r reset  space pause  +- time  ↑↓ scroll  tab o all"
BLOCKS, LETTERS = " ▁▂▃▄▅▆▇█", " .:-=+*#@"

WIDE, MAX_SILENCE, NEAR = 60, 1.0, 0.7
"""Columns of a wide terminal; time without a state that is an error [s]; fraction of a limit that is near."""


class Charts:
    """Magnitudes over time as blocks, from zero to a scale; one chart of `height` lines for each column of values."""

    def __init__(self, values, scales, styles, height=1):
        self.values, self.scales, self.styles, self.height = values, scales, styles, height

    def __rich_measure__(self, console, options):
        return Measurement(1, options.max_width)

    def __rich_console__(self, console, options):
        begins = np.linspace(0, len(self.values), options.max_width, endpoint=False).astype(int)
        most, scales = 8 * self.height, np.where(self.scales, self.scales, 1.0)
        levels = np.ceil(most * np.fmax.reduceat(self.values, begins) / scales)
        levels = np.nan_to_num(np.clip(levels, 1, most)).astype(int)
        characters = np.array(list(LETTERS if options.ascii_only else BLOCKS))
        yield _lines(
            Text("".join(characters[np.clip(column - 8 * row, 0, 8)]), style)
            for column, style in zip(levels.T, self.styles, strict=True)
            for row in reversed(range(self.height))
        )


class View:
    """What the keys have chosen; `reset` and `quit` are requests to the owner of the robots."""

    def __init__(self, note=""):
        self.quantity, self.sort, self.window, self.robot, self.scroll = 0, 0, 1, 0, 0
        self.paused = self.reset = self.quit = self.overview = False
        self._note = note

    def press(self, key):
        """Apply a key: a character, or up, down, left, right."""
        if key in "123456":
            self.quantity = int(key) - 1
        elif key in ("left", "right"):
            self.quantity = (self.quantity + (1 if key == "right" else -1)) % len(QUANTITIES)
        elif key in ("up", "down"):
            self.scroll = max(0, self.scroll + (1 if key == "down" else -1))
        elif key in "+=-":
            self.window = min(max(self.window + (-1 if key == "-" else 1), 0), len(WINDOWS) - 1)
        elif key == "s":
            self.sort = (self.sort + 1) % len(SORTS)
        elif key == "\t":
            self.robot += 1
        elif key == " ":
            self.paused = not self.paused
        elif key == "o":
            self.overview = not self.overview
        self.reset, self.quit = key == "r", self.quit or key == "q"

    def draw(self, robots, now, width, height):
        """Return the frame of at least one robot, at a steady time [s], for a terminal of this size."""
        robot = robots[self.robot % len(robots)]
        parts = [self._title(robots, robot, now, width)]
        if self.overview:
            parts.append(self._overview(robots, now))
        elif robot.names:
            parts += self._robot(robot, width >= WIDE, height - 2)
        else:
            parts.append(Text(f"waiting for states on {plain(robot.topic)}", "dim"))
        frame = Layout()
        frame.split_column(Layout(Group(*parts)), Layout(_line((KEYS, "dim")), size=1))
        return frame

    def _title(self, robots, robot, now, width):
        silence, style = robot.silence(now), "reverse"
        count = f" {self.robot % len(robots) + 1}/{len(robots)}" if len(robots) > 1 else ""
        status = f" {robot.rate(now)} Hz" if robot.names else ""
        if silence > MAX_SILENCE:
            status, style = f" no state for {duration(silence)}", "reverse bold red"
        elif robot.names and width >= WIDE:
            status += f"  {duration(robot.latency)} late"
        text = f" {plain(robot.title)}{count}{status}{' PAUSED' if self.paused else ''}"
        return Text(f"{text:{width - len(self._note) - 1}}{self._note:{width}}", style, no_wrap=True, overflow="crop")

    def _robot(self, robot, wide, height):
        """Return lines, chart and table of a robot."""
        energy, peak = f"{number(robot.energy)} J", f"{number(robot.energy_peak)} J"
        power = f"{number(robot.power)} W" if robot.power == robot.power else "unknown: no efforts"
        power = [("   net power ", "dim"), power] if wide else []
        lines = [_line(("K ", "dim"), (energy, "bold"), ("  peak ", "dim"), peak, *power)]
        if robot.torque[0] == robot.torque[0]:
            norms = _norm(robot.torque, "N m"), ("  r ", "dim"), _norm(robot.residual, "√J/s")
            lines.append(_line(("m r ", "dim"), *norms))
        if robot.rejected:
            lines.append(_line((f"{robot.rejected} invalid messages", "yellow")))
        if robot.alarm:
            lines.append(_line((f"ALARM {plain(robot.alarm)}", "bold red")))
        rows = height - len(lines) - 1
        tall = min(max(rows - len(robot.names), rows // 4), 20)
        if tall >= 3:
            lines.append(self._chart(robot, tall))
            rows -= tall
        return [*lines, self._table(robot, max(rows, 0), wide)]

    def _recent(self, slots):
        return slots[-round(WINDOWS[self.window] / SLOT) :]

    def _chart(self, robot, height):
        """Return the kinetic energy, or the largest value or fraction of a limit of all joints."""
        quantity, limits = QUANTITIES[self.quantity], robot.limits[self.quantity]
        limited, values = bool(np.isfinite(limits).any()), self._recent(robot.values[:, self.quantity])
        label = f"of {quantity.limit}" if limited else f"{quantity.symbol} {quantity.unit}"
        scale = 1.0 if limited else robot.external_scale()
        if self.quantity == ENERGY:
            values, label = self._recent(robot.energies), "K J"
        else:
            values = np.fmax.reduce(values / limits if limited else values, axis=1)
        most = np.nanmax(values, initial=0.0)
        scale = max(most, scale) if self.quantity == EXTERNAL else most
        grid = Table.grid(padding=(0, 1), expand=True)
        grid.add_column(justify="right", style="dim", no_wrap=True, width=12)
        grid.add_column(ratio=1)
        labels = "\n".join([number(scale), label, *[""] * (height - 3), "0"])
        style = _style(most, 1.0 if limited else math.inf)
        grid.add_row(labels, Charts(values[:, None], [scale], [style], height))
        return grid

    def _table(self, robot, rows, wide):
        q, quantity, order = self.quantity, QUANTITIES[self.quantity], self._order(robot)
        self.scroll = min(self.scroll, max(0, len(order) - rows))
        shown = order[self.scroll : self.scroll + rows]
        last, limits, values = robot.last[q, shown], robot.limits[q, shown], self._recent(robot.values[:, q, shown])
        fractions = np.abs(last) / limits
        styles = [_style(*pair) for pair in zip(fractions, limits, strict=True)]
        names = [_name(robot.names[k], 30 if wide else 12) for k in shown]
        columns = {f"joint, {SORTS[self.sort]}" if wide else "joint": names}
        columns[f"{quantity.symbol} {quantity.unit}"] = map(Text, map(number, last), styles)
        if wide:
            columns["peak"] = map(Text, map(number, robot.peak[q, shown]))
        if np.isfinite(robot.limits[q]).any():
            texts = [f"{100 * fraction:.0f} %" if fraction > 0.0 else "" for fraction in fractions]
            columns["of limit" if wide else "%"] = map(Text, texts, styles)
        hidden = f", {len(shown)} of {len(order)}" if len(shown) < len(order) else ""
        scale = robot.external_scale() if q == EXTERNAL else 0.0
        scales = np.where(np.isfinite(limits), limits, np.nanmax(values, initial=scale))
        charts = Charts(values, scales, styles)
        return _make_table(columns, f"{quantity.name}, {WINDOWS[self.window]} s{hidden}", charts)

    def _order(self, robot):
        size, limits = np.abs(robot.last[self.quantity]), robot.limits[self.quantity]
        fraction = size / limits if np.isfinite(limits).any() else size
        key = (np.zeros_like(size), size, robot.peak[self.quantity], fraction)[self.sort]
        return np.argsort(-np.nan_to_num(key), kind="stable")

    def _overview(self, robots, now):
        robots = [robot for robot in robots if robot.names]
        styles = ["bold red" if robot.alarm or robot.silence(now) > MAX_SILENCE else "cyan" for robot in robots]
        columns = {
            "robot": [_name(robot.title, 30) for robot in robots],
            "K J": [Text(number(robot.energy)) for robot in robots],
            "peak": [Text(number(robot.energy_peak)) for robot in robots],
            "Hz": [Text(str(robot.rate(now))) for robot in robots],
        }
        values = np.array([self._recent(robot.energies) for robot in robots]).T
        charts = Charts(values, np.nanmax(values, axis=0, initial=0.0), styles) if robots else ""
        return _make_table(columns, f"kinetic energy, {WINDOWS[self.window]} s", charts)


def _line(*parts):
    return Text.assemble(*parts, no_wrap=True, overflow="ellipsis")


def _lines(texts):
    lines = Text("\n", no_wrap=True).join(texts)
    lines.no_wrap = True
    return lines


def _make_table(columns, heading, charts):
    """Return a table of one row: rich takes its time for each cell."""
    table = Table(box=None, padding=(0, 1, 0, 0), expand=True, header_style="dim underline")
    for k, name in enumerate(columns):
        table.add_column(name, justify="right" if k else "left", no_wrap=True, min_width=7)
    table.add_column(heading, ratio=1, no_wrap=True)
    table.add_row(*(_lines(cells) for cells in columns.values()), charts)
    return table


def _norm(pair, unit):
    value, threshold = pair
    bound = f" of {number(threshold)}" if threshold < math.inf else ""
    return f"{number(value)}{bound} {unit}", _style(value / threshold, threshold)


def _style(fraction, limit):
    """Return the style of a value at a fraction of its limit."""
    if not (limit < math.inf and fraction == fraction):
        return "cyan"
    return "bold red" if fraction > 1.0 else "yellow" if fraction > NEAR else "green"


def _name(name, width):
    """Return a name; of a long one the end, which differs from joint to joint."""
    text = Text(plain(name))
    return text if text.cell_len <= width else Text("…") + text[1 - width :]
