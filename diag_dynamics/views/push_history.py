# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A push on an arm: what of it was seen, and how the kinetic energy was held meanwhile, summed up and drawn."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.text import plain

PERCENT_OVER = 5.0
"""Part by which the kinetic energy may exceed its bound [%]: what pushes comes on top until the observer knows of it."""


class Moment(NamedTuple):
    """One command of the controller: time [s], K [J], whether the limiter took power out, where the hand is off to [m]."""

    time: float
    energy: float
    limited: bool
    displacement: float


class Seen(NamedTuple):
    """One word of the monitor: time [s], |r| [√J/s], whether it is a collision."""

    time: float
    norm: float
    collision: bool


class PushHistory:
    """Samples of a controlled arm, before, while and after something pushes it.

    Parameters
    ----------
    force : float
        Of the push [N].
    bound : float
        On the kinetic energy [J].
    threshold, release : float
        Of |r| [√J/s].

    Attributes
    ----------
    onset, end : float or None
        When the push began and ended [s].
    """

    def __init__(self, force, bound, threshold, release):
        self.force, self.bound, self.threshold, self.release = force, bound, threshold, release
        self.moments, self.seen = [], []
        self.onset = self.end = None

    @property
    def collision(self):
        """When a collision was seen first, and when it was over after the end of the push; None for never [s]."""
        begin = next((s.time for s in self.seen if s.collision), None)
        after = (s.time for s in self.seen if self.end is not None and s.time > self.end and not s.collision)
        return begin, next(after, None)

    @property
    def largest_energy(self):
        """[J]."""
        return max(m.energy for m in self.moments)

    def failures(self):
        """What should have been seen, and was not; a line for each."""
        if not self.moments or not self.seen or self.onset is None or self.end is None:
            return ["There was no push, or nobody said anything."]
        begin, over = self.collision
        found = []
        if begin is None or begin > self.end:
            found.append(f"The push was not seen: |r| stayed below {self.threshold:g} √J/s.")
        elif begin < self.onset:
            found.append(f"A collision was seen {1e3 * (self.onset - begin):.0f} ms before there was a push.")
        elif over is None:
            found.append("The collision was never over.")
        if self.largest_energy > self.bound * (1.0 + PERCENT_OVER / 100.0):
            found.append(f"K rose to {self.largest_energy:.4g} J, beyond its bound of {self.bound:g} J.")
        if not any(m.limited for m in self.moments if m.time >= self.onset):
            found.append("The limiter had nothing to do: the push was too weak to show it.")
        return found

    def summary(self):
        """What to remember of all this, as text lines; of a history without :meth:`failures`."""
        begin, over = self.collision
        pushed = [m for m in self.moments if self.onset <= m.time <= self.end]
        largest = self.largest_energy
        return [
            f"push of {self.force:g} N for {self.end - self.onset:.2f} s: collision seen after "
            f"{1e3 * (begin - self.onset):.0f} ms, over {1e3 * (over - self.end):.0f} ms after its end",
            f"|r| at most {max(s.norm for s in self.seen):.1f} √J/s, before the push "
            f"{max(s.norm for s in self.seen if s.time < self.onset):.1f}, threshold {self.threshold:g}",
            f"K at most {largest:.4f} J, its bound {self.bound:g} J ({100 * (largest / self.bound - 1):+.1f} %)",
            f"while pushed the limiter acted on {100 * np.mean([m.limited for m in pushed]):.0f} % of the commands",
            f"hand moved by {1e3 * max(m.displacement for m in self.moments):.0f} mm, and back to within "
            f"{1e3 * self.moments[-1].displacement:.1f} mm",
        ]

    def picture(self, path, title):
        """Draw K, |r| and where the hand is over time into an image file (format by its suffix)."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to import, and seldom needed
        from matplotlib.figure import Figure

        moments, seen = np.array(self.moments, dtype=float), np.array(self.seen, dtype=float)
        begin = self.onset
        time, seen_time = moments[:, 0] - begin, seen[:, 0] - begin
        figure = Figure(figsize=(9, 7.5), layout="constrained")
        FigureCanvasAgg(figure)
        energy, norm, way = figure.subplots(3, 1, sharex=True)
        energy.plot(time, moments[:, 1], color="#0b6fb8", linewidth=1.5, label="K")
        energy.axhline(self.bound, color="#0b6fb8", linewidth=1.0, linestyle="--", label=f"its bound, {self.bound:g} J")
        energy.set_ylim(0.0, 1.35 * max(self.bound, moments[:, 1].max()))
        _strip(energy, time, moments[:, 2], "#5fb3ce", "limiter acts")
        energy.set_ylabel("kinetic energy [J]")
        norm.plot(seen_time, seen[:, 1], color="#d1495b", linewidth=1.5, label="|r|")
        norm.axhline(
            self.threshold, color="#d1495b", linewidth=1.0, linestyle="--", label=f"threshold, {self.threshold:g}"
        )
        norm.set_ylim(0.0, 1.35 * max(self.threshold, seen[:, 1].max()))
        _strip(norm, seen_time, seen[:, 2], "#e8998d", "collision")
        norm.set_ylabel("external torque |r| [√J/s]")
        way.plot(time, 1e3 * moments[:, 3], color="#3d7a4a", linewidth=1.5, label="displacement")
        way.set_ylim(bottom=0.0)
        way.set_ylabel("hand off its place [mm]")
        way.set_xlabel("time since the push began [s]")
        energy.set_title(plain(title), loc="left", parse_math=False)
        for axes in (energy, norm, way):
            span = axes.axvspan(0.0, self.end - begin, color="#efefef", linewidth=0, zorder=0)
            axes.margins(x=0)
            axes.spines[["top", "right"]].set_visible(False)
        span.set_label(f"push, {self.force:g} N")
        for axes in (energy, norm, way):
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=9)
        figure.savefig(path, dpi=120)


def _strip(axes, time, active, color, label):
    """A strip along the top of axes where something was so."""
    axes.fill_between(
        time,
        0.94,
        1.0,
        where=active > 0.5,
        transform=axes.get_xaxis_transform(),
        color=color,
        linewidth=0,
        step="post",
        label=label,
    )
