# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view of kinetic energy, drawn with rich."""

import numpy as np
from rich.bar import Bar
from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from diag_dynamics.text import duration, number, plain
from diag_dynamics.views.energy_history import PALETTE

_LEVELS = "▁▂▃▄▅▆▇█"
WINDOW = 10.0
"""Seconds that the sparkline shows."""

ECHO = len("^C")
"""Columns left free at the right: the terminal shows a Ctrl-C there. Where that wraps, the last frame is a line too low."""

NARROW = 80 - ECHO
"""Width in characters below which what is said beside the numbers is left out: lines that wrap push out the last ones."""

LONGEST = 12
"""Characters of a joint's name there: its end, which tells it from others."""


def sparkline(values, width):
    """A line of `width` block characters from zero to the largest of the values."""
    values = np.asarray(values, dtype=float)
    if len(values) == 0 or not values.max() > 0.0:
        return _LEVELS[0] * width
    columns = np.array_split(values, width) if len(values) > width else values[:, None]
    means = [column.mean() for column in columns]
    line = "".join(_LEVELS[round(mean / max(means) * (len(_LEVELS) - 1))] for mean in means)
    return line.rjust(width)


def energy_panel(robot, history, height, width, silent=0.0, waiting=""):
    """The view at one instant.

    Parameters
    ----------
    robot : str
        Title.
    history : EnergyHistory
    height, width : int
        Size of the terminal in characters.
    silent : float
        Seconds since the last state arrived.
    waiting : str
        What is being waited for while there is none.
    """
    samples, width = history.recent(WINDOW), width - ECHO
    if len(samples) < 2:
        said = Text(waiting or "waiting for joint states …", style="dim")
        return Panel(said, title=Text(plain(robot)), width=width)
    last = samples[samples[:, 0] > samples[-1, 0] - 1.0]
    shares = last[-1, 4:]
    total = float(shares.sum())
    span = last[-1, 0] - last[0, 0]
    rate = (len(last) - 1) * history.stride / span if span > 0.0 and silent < 1.0 else 0.0
    return Panel(
        Group(
            _headline(samples, last, total, rate, width),
            Text(),
            _shares(history.names, samples[:, 4:], shares, total, height - 9, width),
        ),
        title=Text(plain(robot), style="bold"),
        subtitle=f"[bold red]no state for {duration(silent)}[/]" if silent > 1.0 else "[dim]Ctrl-C ends[/]",
        border_style="red" if silent > 1.0 else "none",
        padding=(1, 2),
        width=width,
    )


def _headline(samples, last, total, rate, width):
    power, work_rate, narrow = last[-1, 1], np.nanmax(last[:, 2], initial=0.0), width < NARROW
    latency, late = np.quantile(last[:, 3], (0.5, 0.99))
    table = Table.grid(padding=(0, 1 if narrow else 2))
    table.add_column(style="dim")
    table.add_column(justify="left")
    energy = samples[:, 4:].sum(axis=1)
    peak = (
        f"  [cyan]{sparkline(energy, max(10, width - 66))}[/]  [dim]peak {number(energy.max())} J in {WINDOW:.0f} s[/]"
    )
    table.add_row("K" if narrow else "kinetic energy", f"[bold]{number(total):>9} J[/]{'' if narrow else peak}")
    known = f"{number(power):>9} W" if np.isfinite(power) else "  unknown" if narrow else "  unknown: no efforts"
    table.add_row("net power" if narrow else "net power νᵀ(ε − ε_g)", f"[bold]{known}[/]")
    table.add_row("|νᵀC|/|ν||C|", f"{number(work_rate):>9}{'' if narrow else '    [dim]Coriolis does no work[/]'}")
    late = f" {duration(latency)}" if narrow else f"   latency {duration(latency)}, 99 % {duration(late)}"
    table.add_row("states", f"{rate:9.0f} Hz{late}")
    return table


def _shares(names, recent, shares, total, rows, width):
    """A bar for each joint's share; where there are more joints than rows, those with most energy of late."""
    kept = range(len(names))
    if len(names) > rows:
        kept = sorted(np.argsort(recent.mean(axis=0))[::-1][: max(1, rows - 1)])
    narrow = width < NARROW
    table = Table.grid(padding=(0, 1 if narrow else 2), expand=True)
    table.add_column(no_wrap=True, style="dim")
    table.add_column(ratio=1)
    table.add_column(justify="right", no_wrap=True)
    table.add_column(justify="right", no_wrap=True, style="dim")
    for k in kept:
        part = shares[k] / total if total > 0.0 else 0.0
        bar = Bar(1.0, 0.0, part, color=PALETTE[k % len(PALETTE)])
        name, percent = plain(names[k]), f"{100 * part:3.0f} %"
        if narrow:
            name, percent = name if len(name) <= LONGEST else f"…{name[1 - LONGEST :]}", ""
        table.add_row(Text(name), bar, f"{number(shares[k])} J", percent)
    if len(kept) < len(names):
        others = total - sum(shares[k] for k in kept)
        table.add_row(f"{len(names) - len(kept)} others", "", f"{number(others)} J", "")
    return table
