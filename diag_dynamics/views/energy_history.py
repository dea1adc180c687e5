# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinetic energy over time: collected while a robot moves, summed up and drawn afterwards."""

from array import array

import numpy as np

from diag_dynamics.text import duration, number, plain
from diag_dynamics.views.parts import oscillates, parts_of

PALETTE = (
    *("#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1", "#76b7b2", "#edc948", "#ff9da7", "#9c755f"),
    *("#86bcb6", "#d37295", "#8cd17d", "#b6992d", "#499894", "#d4a6c8", "#bab0ac"),
)
"""Colours of joints, the same in the terminal and in the picture."""

BAND = "#ececec"
"""Colour from the mean to the maximum of a part of time."""


class EnergyHistory:
    """Samples of the energy of each total joint rate, and of what goes with it.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.

    Attributes
    ----------
    count : int
        Samples taken in.
    stride : int
        Of that many samples, one is kept.
    """

    MOST = 400_000
    """Samples kept; beyond them every second one is dropped, and so on, so that a night is no longer than a minute."""

    def __init__(self, names):
        self.names = list(names)
        self.count = 0
        self.stride = 1
        self._rows = array("d")  # per sample: time, power, relative νᵀC, latency, shares
        self._width = 4 + len(self.names)

    def add(self, time, shares, power, work_rate, latency):
        """Take a sample in.

        Parameters
        ----------
        time : float
            Stamp [s].
        shares : array_like, shape (nv,)
            ½ν_k² [J].
        power : float
            Net power of efforts and gravity, νᵀ(ε − ε_g) [W]; nan if unknown.
        work_rate : float
            |νᵀC| / (|ν||C|), which is zero but for rounding.
        latency : float
            Reception less stamp [s].
        """
        self.count += 1
        if self.count % self.stride:
            return
        self._rows.extend((time, power, work_rate, latency))
        self._rows.extend(shares)
        if len(self._rows) > self.MOST * self._width // max(1, len(self.names) // 8):
            self._rows = array("d", self.samples()[::2].tobytes())
            self.stride *= 2

    def samples(self):
        """All samples kept, shape (T, 4 + nv): time, power, νᵀC, latency, shares. A copy."""
        return np.array(self._rows).reshape(-1, self._width)

    def recent(self, seconds):
        """Samples of the last `seconds`, as :meth:`samples`."""
        window = 1 + int(seconds * 2000 / self.stride)
        samples = np.array(self._rows[-window * self._width :]).reshape(-1, self._width)
        return samples[samples[:, 0] >= samples[-1, 0] - seconds] if len(samples) else samples

    def summary(self):
        """What to remember of all this, as text lines."""
        samples = self.samples()
        if len(samples) < 2:
            return [f"{'A single state' if self.count else 'No state'} arrived: there is nothing to sum up."]
        time, power, work_rate, latency = samples[:, :4].T
        shares = samples[:, 4:]
        total = shares.sum(axis=1)
        span = time[-1] - time[0]
        mean = shares.mean(axis=0)
        most = np.argsort(mean)[::-1][:3]
        parts = ", ".join(f"{plain(self.names[k])} {100 * mean[k] / max(mean.sum(), 1e-300):.0f} %" for k in most)
        median, late = np.quantile(latency, (0.5, 0.99))
        lines = [
            f"{self.count} states in {duration(span)} ({(self.count - 1) / span:.0f} Hz), "
            f"latency {duration(median)} median, {duration(late)} 99 %",
            f"kinetic energy {number(total.min())} … {number(total.max())} J, mean {number(total.mean())} J",
            f"most of it: {parts}",
            f"largest |νᵀC| / (|ν||C|): {number(np.nanmax(work_rate))}",
        ]
        if np.isfinite(power).any():
            lowest, highest = number(np.nanmin(power)), number(np.nanmax(power))
            lines.append(f"net power of efforts and gravity {lowest} … {highest} W")
        return lines

    def picture(self, path, title):
        """Draw the energies over time into an image file (format by its suffix).

        Of more oscillations than the picture has room for, layers and lines are means over parts of time. A grey band goes
        from the minimum to the maximum.
        """
        from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to import, and seldom needed
        from matplotlib.figure import Figure

        samples = self.samples()
        time = samples[:, 0] - samples[0, 0]
        span = time[-1]
        power, shares = samples[:, 1], samples[:, 4:]
        figure = Figure(figsize=(10, 6), layout="constrained")
        FigureCanvasAgg(figure)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        total, label = shares.sum(axis=1), "kinetic energy ½ν² [J]"
        if oscillates(total):
            means, totals = parts_of(time, np.column_stack([power, shares])), parts_of(time, total[:, None])
            above.fill_between(
                means.time, totals.mean[:, 0], totals.maximum[:, 0], color=BAND, linewidth=0, label="maximum of K"
            )
            below.fill_between(means.time, means.minimum[:, 0], means.maximum[:, 0], color=BAND, linewidth=0)
            label += f",\nmean of {duration(means.length)}"
            time, power, shares = means.time, means.mean[:, 0], means.mean[:, 1:]
        else:
            thin = slice(None, None, max(1, len(samples) // 3000))
            time, power, shares = time[thin], power[thin], shares[thin]
        self._stack(above, time, shares)
        above.set_ylabel(label)
        above.set_title(plain(title), parse_math=False)
        handles, names = above.get_legend_handles_labels()
        legend = above.legend(
            handles[::-1], names[::-1], loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=9
        )
        for text in legend.get_texts():
            text.set_parse_math(False)  # a dollar in a name is a dollar
        below.plot(time, power, color="#444444", linewidth=1.0)
        below.axhline(0.0, color="#aaaaaa", linewidth=0.8)
        below.set_ylabel("net power [W]")
        below.set_xlabel("time [s]")
        for axes in (above, below):
            axes.spines[["top", "right"]].set_visible(False)
        above.set_xlim(0.0, span)
        above.set_ylim(bottom=0.0)
        figure.savefig(path, dpi=120)

    def _stack(self, axes, time, shares):
        """Draw a layer for each of the joints with most energy, one for all others, and K."""
        total = shares.sum(axis=1)
        # As many joints as there are colours.
        shown = sorted(np.argsort(np.nanmean(shares, axis=0))[::-1][: len(PALETTE)])
        layers, labels = [shares[:, k] for k in shown], [plain(self.names[k]) for k in shown]
        colours = list(PALETTE[: len(shown)])
        if len(shown) < len(self.names):
            layers.append(total - shares[:, shown].sum(axis=1))
            labels.append(f"{len(self.names) - len(shown)} others")
            colours.append("#dddddd")
        axes.stackplot(time, layers, labels=labels, colors=colours, linewidth=0)
        axes.plot(time, total, color="black", linewidth=1.0, label="total K")
