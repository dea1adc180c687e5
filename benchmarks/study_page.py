# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables and plots of the study: study.md and plots in results, and the generated tables of docs/control-study.md."""

import json
import re
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("agg")
from matplotlib import pyplot as plt

RESULTS = Path(__file__).resolve().parent / "results"
PAGE = RESULTS.parents[1] / "docs" / "control-study.md"
TIE, FLOOR = 0.01, 0.01  # relative and absolute difference that counts as none [s, mm, %]
METRICS = {
    "settling": ("regulation", "settling time [s]"),
    "overshoot": ("regulation", "overshoot [%]"),
    "final": ("regulation", "final error [mm]"),
    "rms": ("tracking", "rms error [mm]"),
}
COLORS = ("#0072B2", "#56B4E9", "#009E73", "#CC79A7", "#D55E00", "#000000", "#E69F00")
MARKERS, STYLES = "osD^vPX", ("-", "--", "-.")
STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9,
    "figure.constrained_layout.use": True,
    "figure.dpi": 170,
    "font.size": 9,
    "grid.alpha": 0.3,
    "legend.fontsize": 8,
    "legend.frameon": False,
}


def write(folder, official):
    """Write tables and plots of study.json into its folder, and the tables of the page if it is official."""
    data = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    (folder / "study.md").write_text(details(data), encoding="utf-8")
    with plt.rc_context(STYLE):
        draw_ratios(data["ratios"]).savefig(folder / "study_ratios.png")
        draw_contests(data["contests"]).savefig(folder / "study_contests.png")
        plt.close("all")
    if official:
        PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), data), encoding="utf-8")


def filled(text, data):
    """Return a page with its generated tables, which stand between comments `study: name` and `end`."""
    parts = {
        "ratios": laws_table(data["ratios"], spread),
        "wins": wins_table(data["contests"]),
        "summary": summary(data),
    }
    part = r"<!-- study: (\w+) -->\n.*?<!-- end -->"
    return re.sub(
        part,
        lambda m: f"<!-- study: {m[1]} -->\n{parts[m[1]]}\n<!-- end -->",
        text,
        flags=re.DOTALL,
    )


def spread(values):
    """Return the range of values as text; one number if both ends are equal."""
    return "–".join(dict.fromkeys(f"{end:.2f}" for end in (min(values), max(values))))


def laws_table(section, cell):
    """Return a table of robots by laws."""
    rows = [[one["robot"], *map(cell, one["laws"].values())] for one in section]
    return table(["", *section[0]["laws"]], rows)


def table(head, rows):
    """Return a table of Markdown."""
    return "\n".join(
        "|".join(["", *map(str, row), ""]) for row in (head, ["---"] * len(head), *rows)
    )


def text_of(value):
    """Return a figure with two or three digits; of a run that diverged a dash."""
    if not np.isfinite(value):
        return "–"
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}" if value >= 1 else f"{value:.2f}"


def figures(contests, task, metric):
    """Return figures by condition, robot and law; inf where a run diverged."""
    found = {}
    for one in (one for one in contests if one["task"] == task):
        for condition, row in one["figures"].items():
            laws = found.setdefault(condition, {}).setdefault(one["robot"], {})
            laws[one["law"]] = np.inf if row is None else row[metric]
    return found


def verdict(laws):
    """Return 1 if the best law is one in (ν, ε), −1 if another, 0 for a tie, by the law's names."""
    ours, others = (
        min(x for name, x in laws.items() if name.startswith("ν") == is_ours)
        for is_ours in (True, False)
    )
    if max(ours, others) - min(ours, others) <= max(TIE * min(ours, others), FLOOR):
        return 0
    return 1 if ours < others else -1


def medians(robots):
    """Return the median figure of robots by law."""
    return {
        name: float(np.median([laws[name] for laws in robots.values()]))
        for name in next(iter(robots.values()))
    }


def wins_table(contests):
    """Return on how many robots a law in (ν, ε) is best, another one, or neither, by condition and metric."""
    rows = {}
    for metric, (task, _) in METRICS.items():
        for condition, robots in figures(contests, task, metric).items():
            verdicts = [verdict(laws) for laws in robots.values()]
            rows.setdefault(condition, []).append(
                "/".join(str(verdicts.count(x)) for x in (1, 0, -1))
            )
    head = ["ν/tie/other", *(title.split(" [")[0] for _, title in METRICS.values())]
    return table(head, [[condition, *cells] for condition, cells in rows.items()])


def compared(contests, metric, ours, other):
    """Return figures of two laws by robot and condition, shape (2, n), where neither diverged."""
    found = figures(contests, METRICS[metric][0], metric)
    pairs = np.array(
        [[laws[ours], laws[other]] for robots in found.values() for laws in robots.values()]
    ).T
    return pairs[:, np.isfinite(pairs).all(axis=0)]


def summary(data):
    """Return what (ν, ε) loses and wins as a list."""
    contests, moved = data["contests"], [one["laws"] for one in data["coupling"]]
    same = compared(contests, "rms", "ν tracking", "computed torque")
    settling = compared(contests, "settling", "ν joints", "joint PD")
    shoot = compared(contests, "overshoot", "ν joints", "joint PD").max(axis=1)
    friction = [
        laws["ν joints"] / laws["joint PD"]
        for laws in figures(contests, "regulation", "final")["friction"].values()
    ]
    rms = figures(contests, "tracking", "rms")
    lag = [laws["ν pose"] / laws["impedance"] for laws in rms["nominal, 1 kHz"].values()]
    loaded = [
        laws["ν robust"] / min(laws["joint PD"], laws["computed torque"])
        for laws in rms["payload 2 kg"].values()
    ]
    ratio = [laws["ν joints"]["coupling"] / laws["joint PD"]["coupling"] for laws in moved]
    lost = [one["law"] for one in contests for row in one["figures"].values() if row is None]
    peaks = {
        kind: max(one["laws"][kind]["peak"] for one in data["energies"])
        for kind in ("sum", "sum, observer")
    }
    slower = {
        kind: [
            one["laws"][kind]["settling"] / one["laws"]["none"]["settling"] for one in data["costs"]
        ]
        for kind in ("EnergyLimiter", "Limits")
    }
    heavy = rms["nominal, 1 kHz"]["Talos, 12 joints"]["ν robust"]
    decays = [one["laws"][key] for key in ("ν, 5", "joint damping") for one in data["damping"]]
    rates, costs = (
        np.array([one[key] for one in decays]).reshape(2, -1) for key in ("rate", "cost")
    )
    return f"""\
* **Tie**: tracking errors of ν tracking and computed torque differ by at most {np.abs(np.diff(same, axis=0)).max():.1f} mm.
* **Loss**: joint PD settles before ν joints in {(settling[0] > settling[1]).sum()} of {settling.shape[1]} cases.
  It overshoots by up to {shoot[1]:.1f} %, ν joints by {shoot[0]:.1f} %.
  With friction ν joints stops {spread(friction)} times as far off.
* **Loss**: a disturbed joint moves others {spread(ratio)} times as far under ν joints as under joint PD.
* **Loss**: ν pose lacks the target velocity. Its tracking error is {spread(lag)} times that of impedance.
* **Loss**: the bound of ν robust takes torque from its gains: {heavy:.1f} mm on Talos without a disturbance.
* **Loss**: pushes of 40 N raise K to {peaks["sum"]:.2f} K_max, with the observer to {peaks["sum, observer"]:.2f} K_max.
* **Cost**: with a tenth of the peak energy a step takes {spread(slower["EnergyLimiter"])} times as long,
  in `Limits` {spread(slower["Limits"])}.
* **Win** on {sum(x < 1 for x in loaded)} of {len(loaded)} robots: with an unknown payload ν robust has
  {spread(loaded)} times the error of the better of PD and computed torque.
* **Win**: {lost.count("joint PD")} runs of joint PD and {lost.count("impedance")} of impedance diverged,
  {sum(name.startswith("ν") for name in lost)} in (ν, ε).
* **Win**: under rate damping K decays at {spread(rates[0])} times 2c and costs {spread(costs[0])} times √(qr) K(0).
  Joint damping has {spread(rates[1])} and {spread(costs[1])}."""


METHOD = """\
Figures of the [control study](../../docs/control-study.md), written by `make study`. A dash: diverged.

* **Plant**: Pinocchio, steps of 0.25 ms, semi-implicit; the loop has 1 kHz. It shares no code with the laws.
* **Equal torque**: bisection scales all gains of a law by x until the largest |τ|/limit of its nominal run is 0.7. The other
  conditions keep these gains.
* **Gains**: ν joints (`JointRegulation`) and joint PD have joint stiffness (x/10)² limit/rad, ν pose (`PoseRegulation`) and
  impedance 4x² N/m and 0.4x² N m/rad. ν tracking (`JointTracking`) and computed torque have both poles at x. ν robust adds
  ρ = 20 √J/s with φ = 0.3 √J; it has no regulation, because the bound alone takes the torque. Damping is critical; PD and
  impedance have that of the home pose. PD has no feedforward, ν pose no target velocity.
* **Regulation**: steps of all joints by 0.4 rad, of Talos by 0.25 rad, of fingers by 15 mm. Settling ends within 5 % of the
  step from the place of rest. Figures are of the hand.
* **Tracking**: sines of all joints, 0.1 rad away at the start; rms error after 1 s.
* **Conditions**: friction is Coulomb, 2 % of the limits; the payload is 0.1 m beyond the link.
* **Energy limits**: K_max is a tenth of the peak of the step, 0.4 of it for each joint. The push has four directions;
  figures are of the worst. **Cost of limits**: K_max as above, without pushes; settling is that of all joints. `Limits`
  also has effort limits and an effort rate of 1000 N m/s.
* **Coupling**: a pulse of 20 % of the limit for 0.1 s. **Damping**: constant c is 2ζ rms ω at home; joint damping is
  diagonal and tuned at home.
"""


def details(data):
    """Return all figures of regulation and tracking by robot and condition; the best of a row is bold."""
    lines = ["# Study of control", "", METHOD.rstrip()]
    for task in ("regulation", "tracking"):
        scales = figures([one | {"figures": {"": one}} for one in data["contests"]], task, "scale")[
            ""
        ]
        head, rows = (
            list(next(iter(scales.values()))),
            [[robot, *laws.values()] for robot, laws in scales.items()],
        )
        lines += [
            "",
            f"## {task.capitalize()}",
            "",
            "Scales of gains [1/s]:",
            "",
            table(["robot", *head], rows),
        ]
        shown = {metric: title for metric, (where, title) in METRICS.items() if where == task}
        for metric, title in (shown | {"energy": "work [J]"}).items():
            rows = []
            for condition, robots in figures(data["contests"], task, metric).items():
                for robot, laws in robots.items():
                    best = min(laws.values())
                    cells = (
                        f"**{text_of(x)}**" if x == best else text_of(x) for x in laws.values()
                    )
                    rows.append([robot, condition, *cells])
            lines += [
                "",
                f"### {title[0].upper()}{title[1:]}",
                "",
                table(["robot", "condition", *head], rows),
            ]
    others = {
        "Damping: Decay of K relative to 2c; ∫½(25|ν|² + |u|²)dt relative to √(qr) K(0); ten starts at c = 5 1/s": laws_table(
            data["damping"], lambda row: f"{spread(row['rate'])}; {spread(row['cost'])}"
        ),
        "Coupling: Largest way of another joint relative to that of a disturbed joint; the latter [mrad]": laws_table(
            data["coupling"], lambda row: f"{row['coupling']:.2f}; {1e3 * row['own']:.0f}"
        ),
        "Energy limits: Peaks of K and of a joint's share relative to limits; time above 1.01 K_max after a push": laws_table(
            data["energies"],
            lambda row: f"{row['peak']:.3g}; {row['joint']:.3g}; {row['recovery']:.2f} s",
        ),
        "Cost of limits: Settling time of a step, and peak of K [J]": laws_table(
            data["costs"], lambda row: f"{row['settling']:.2f} s; {row['peak']:.3g}"
        ),
    }
    for title, text in others.items():
        lines += ["", f"## {title.split(':')[0]}", "", f"{title.split(': ')[1]}.", "", text]
    return "\n".join([*lines, ""])


def draw_ratios(ratios):
    """Return a plot of the least damping ratio over the poses."""
    figure, every = plt.subplots(2, 2, figsize=(4.6, 4.4), sharex=True, sharey=True)
    for axes, one in zip(every.ravel(), ratios, strict=False):
        for (law, least), color, style in zip(
            one["laws"].items(), COLORS[::2], STYLES, strict=False
        ):
            axes.plot(least, np.linspace(0, 100, len(least)), style, color=color, lw=2, label=law)
        axes.set_title(one["robot"])
    every[0, 0].set(xlim=(0, 0.75), xticks=[0, 0.2, 0.4, 0.6])
    figure.legend(*every[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    figure.supxlabel("least damping ratio of all modes", fontsize=9)
    figure.supylabel("poses below [%]", fontsize=9)
    return figure


def draw_contests(contests):
    """Return a plot of settling times and tracking errors, medians over the robots by condition and law."""
    figure, every = plt.subplots(2, 1, figsize=(4.6, 6.0), sharex=True)
    for axes, metric in zip(every, ("settling", "rms"), strict=True):
        task, title = METRICS[metric]
        rows = {
            condition: medians(robots)
            for condition, robots in figures(contests, task, metric).items()
        }
        for k, name in enumerate(dict.fromkeys(one["law"] for one in contests)):
            place, values = (
                np.arange(len(rows)) + 0.1 * (k - 3),
                [row.get(name, np.nan) for row in rows.values()],
            )
            axes.plot(place, values, MARKERS[k], color=COLORS[k], ms=5, label=name)
        finite = np.isfinite([value for row in rows.values() for value in row.values()]).all()
        absent = "" if finite else "; absent: diverged"
        axes.set(title=f"{task.capitalize()}: median {title}{absent}")
        if task == "tracking":
            axes.set(
                yscale="log",
                yticks=[0.01, 0.1, 1, 10, 100],
                yticklabels=["0.01", "0.1", "1", "10", "100"],
            )
        else:
            axes.set_ylim(0)
        axes.grid(axis="x", alpha=0)
    every[1].set_xticks(range(len(rows)), list(rows), rotation=40, ha="right")
    figure.legend(*every[1].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
