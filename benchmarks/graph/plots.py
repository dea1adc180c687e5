# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of what was measured of the nodes."""

import matplotlib
import numpy as np
from plots import DENSE, OURS, STYLE, plain

from graph.compare import FLOOR, MONITOR, RATE, SETS, Subject
from graph.sweep import LOSSLESS

matplotlib.use("agg")
from matplotlib import pyplot as plt

NODES = {
    FLOOR: ("the floor: rclpy, nothing computed", DENSE),
    MONITOR: ("monitor", OURS),
}
TITLES = {"all": "all topics listened to"}


def draw(folder, found):
    """Write all of them into a folder."""
    with plt.rc_context(STYLE):
        _latency(found.steady).savefig(folder / "nodes_latency.png")
        _rates(found.searched).savefig(folder / "nodes_rates.png")
        plt.close("all")


def _panels(rows, title):
    figure, axes = plt.subplots(
        rows, len(SETS), figsize=(8.6, 1.6 + 2.7 * rows), sharex=True, sharey="row", squeeze=False
    )
    figure.suptitle(title, x=0.01, ha="left")
    for panel, name in zip(axes[0], SETS, strict=True):
        panel.set_title(TITLES.get(name, f"{name} alone"), fontsize=10)
    return figure, axes


def _legend(figure, panel):
    figure.legend(
        *panel.get_legend_handles_labels(), loc="outside lower center", ncols=len(NODES), fontsize=9
    )


def _latency(steady):
    figure, axes = _panels(
        1, f"Latency at {RATE / 1000:g} kHz: part of the messages that come later"
    )
    for panel, topics in zip(axes[0], SETS.values(), strict=True):
        for node, (label, color) in NODES.items():
            latencies = np.sort(
                np.concatenate([burst.latencies for burst in steady[Subject(node, topics)]])
            )
            later = 1.0 - np.arange(len(latencies)) / len(latencies)
            panel.plot(1e3 * latencies, later, color=color, label=label, drawstyle="steps-post")
        for percent in (50, 99, 99.9):
            panel.axhline(1 - percent / 100, color="0.4", lw=0.8, ls=":")
            panel.text(
                0.01,
                1 - percent / 100,
                f"p{percent:g}",
                transform=panel.get_yaxis_transform(),
                va="bottom",
                fontsize=8,
                color="0.4",
            )
        panel.set(xscale="log", yscale="log", xlabel="publish of joint_states to receipt [ms]")
        plain(
            panel.xaxis, subs=(1,)
        )  # from fractions of a millisecond to a stalled machine's hundreds
    axes[0, 0].set_ylabel("part of the messages")
    _legend(figure, axes[0, 0])
    return figure


def _rates(searched):
    figure, axes = _panels(2, "Rates up to the limit and beyond: loss, and CPU time of the node")
    for (loss, cpu), topics in zip(axes.T, SETS.values(), strict=True):
        for node, (label, color) in NODES.items():
            best = _best(searched[Subject(node, topics)])
            rates = [burst.rate for burst in best]
            loss.plot(
                rates,
                [100 * max(burst.loss, 0.0) for burst in best],
                "o-",
                ms=3.5,
                color=color,
                label=label,
            )
            cpu.plot(rates, [100 * burst.share for burst in best], "o-", ms=3.5, color=color)
        loss.axhline(100 * LOSSLESS, color="0.4", lw=0.8, ls=":")
        loss.set_yscale("symlog", linthresh=0.1)
        loss.set(ylim=(-0.01, 100), yticks=(0, 0.1, 1, 10, 100))
        loss.yaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        loss.yaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        cpu.set(xscale="log", xlabel="joint states per second [Hz]")
        plain(cpu.xaxis)
    axes[1, 0].set_ylim(bottom=0)
    axes[0, 0].set_ylabel("lost [%]")
    axes[1, 0].set_ylabel("CPU time [% of a core]")
    _legend(figure, axes[0, 0])
    return figure


def _best(bursts):
    """Of each rate the burst that lost least: others on the machine only add to that."""
    by_rate = {}
    for burst in bursts:
        if burst.asked not in by_rate or burst.loss < by_rate[burst.asked].loss:
            by_rate[burst.asked] = burst
    return sorted(by_rate.values(), key=lambda burst: burst.rate)
