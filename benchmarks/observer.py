# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The disturbance observer on total joint rates beside the classical one on momenta, tuned by the same procedure.

`make bench ARGS="--only observer"` writes observer.md and observer.png into results. Everything is simulated, from a fixed
seed; there are no times in it.

The classical observer (De Luca and Mattone, 2003) is r = K_O[p − p₀ − ∫(τ + C_sᵀq̇ − g + r)dt] with p = Mq̇, here with
Pinocchio's matrices. Both see the same samples and are integrated by the same rule.
"""

from typing import NamedTuple

import matplotlib
import numpy as np
import pinocchio as pin

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

matplotlib.use("agg")
from matplotlib import pyplot as plt

PERIOD, DURATION = 1e-3, 2.0  # [s] of samples, and of a run
GAINS = (25.0, 100.0)  # [1/s]
VELOCITY_NOISE, EFFORT_NOISE = 3e-3, 0.1  # standard deviations [rad/s], [N m]
PUSH = 0.25  # [s] how long a push lasts, and how late it may be seen
SENSITIVITY = 0.95  # part of the pushes that has to be seen for equal sensitivity

ARMS = {
    "panda": {"locked_joints": {"panda_finger_joint1": 0.02}, "mimic": "lock"},
    "ur5_robot": {},
}
TIPS = {
    "panda": ("panda_link4", "panda_link5", "panda_link6", "panda_hand"),
    "ur5_robot": ("forearm_link", "wrist_2_link", "tool0"),
}
CONDITIONS = {
    "noise": "noise alone",
    "model": "noise, 0.2 kg at the tip and 0.3 N m s/rad at each joint that the observers do not know of",
}


class Stream(NamedTuple):
    """Samples of one run: states as measured, efforts held since the sample before, and when a push began."""

    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    onset: int | None


class Arm:
    """A robot as the observers know it, and as it is."""

    def __init__(self, name, condition):
        self.name = name
        self.model = dd.load_urdf(find_urdf(name), **ARMS[name])
        wrong = condition == "model"
        self.true = (
            self.model.with_payload(TIPS[name][-1], 0.2, (0.03, 0.0, 0.05)) if wrong else self.model
        )
        self.damping = np.full(self.model.nv, 0.3 if wrong else 0.0)
        self.dyn, self.plant = dd.DiagonalDynamics(self.model), dd.DiagonalDynamics(self.true)
        full = pin.buildModelFromUrdf(str(find_urdf(name)))
        held = [j for j in full.names[1:] if j not in self.model.dof_names]
        q = pin.neutral(full)
        for joint in held:
            q[full.idx_qs[full.getJointId(joint)]] = 0.02
        self.pin = pin.buildReducedModel(full, [full.getJointId(j) for j in held], q)
        assert tuple(self.pin.names[1:]) == self.model.dof_names and self.pin.nq == self.pin.nv
        self.data = self.pin.createData()

    def run(self, rng, pushed):
        """One motion of all joints under a tracking law that sees what is measured."""
        model, n = self.model, self.model.nv
        law = dd.JointTracking(self.dyn, 20.0, 10.0)
        lower, upper = np.maximum(model.lower, -2.0), np.minimum(model.upper, 2.0)
        centre = 0.5 * (lower + upper) + 0.25 * (upper - lower) * rng.uniform(-1, 1, n)
        pace, phase = rng.uniform(1, 4, n), rng.uniform(0, 2 * np.pi, n)
        swing = rng.uniform(0.2, 0.6, n)
        onset = int(rng.uniform(0.5, DURATION - PUSH) / PERIOD) if pushed else None
        link, force = rng.choice(TIPS[self.name]), rng.normal(size=3)
        force *= np.exp(rng.uniform(np.log(5.0), np.log(40.0))) / np.linalg.norm(force)
        start = centre + swing * np.sin(phase), swing * pace * np.cos(phase)
        plant = dd.Simulation(
            self.true,
            *start,
            step=PERIOD,
            damping=self.damping,
            friction=0.0 * self.damping,
            limits=False,
            effort_limits=False,
        )
        rows, tau = [], np.zeros(n)
        for k in range(int(DURATION / PERIOD)):
            q, true_rate = plant.q, plant.qd
            qd = true_rate + VELOCITY_NOISE * rng.normal(size=n)
            rows.append((q, qd, tau + EFFORT_NOISE * rng.normal(size=n)))
            angle = pace * k * PERIOD + phase
            goal = (
                centre + swing * np.sin(angle),
                swing * pace * np.cos(angle),
                -swing * pace**2 * np.sin(angle),
            )
            tau = law.command(q, qd, *goal).tau
            push = np.zeros(n)
            if pushed and onset <= k < onset + PUSH / PERIOD:
                grown = min(1.0, (k + 1 - onset) * PERIOD / 0.01)
                push = self.plant.tau_from_epsilon(
                    q,
                    self.plant.epsilon_from_wrench(
                        q, link, [*(grown * force), 0, 0, 0], frame="world"
                    ),
                )
            plant.advance(tau + push)
        return Stream(*(np.array(column) for column in zip(*rows, strict=True)), onset)

    def on_total_rates(self, stream, gain):
        """Residuals of the library's observer, and τ_ext ≈ m r."""
        observer = dd.DisturbanceObserver(
            self.dyn, gain, np.inf, effort="held", settles_on="working_moment"
        )
        results = [
            observer.update(k * PERIOD, *sample)
            for k, sample in enumerate(zip(*stream[:3], strict=True))
        ]
        zero = np.zeros(self.model.nv)
        return (
            np.array([zero if x.residual is None else x.residual for x in results]),
            np.array([zero if x.external_torque is None else x.external_torque for x in results]),
        )

    def on_momenta(self, stream, gain):
        """Residuals of the classical observer, which estimate τ_ext as they are, and √(rᵀM⁻¹r)."""
        model, data, last = self.pin, self.data, None
        r, rows, norms = np.zeros(model.nv), [], []
        filtered = -np.expm1(-gain * PERIOD)
        for q, qd, tau in zip(*stream[:3], strict=True):
            M = np.triu(pin.crba(model, data, q))
            M += np.triu(M, 1).T
            C_s, g = (
                pin.computeCoriolisMatrix(model, data, q, qd),
                pin.computeGeneralizedGravity(model, data, q),
            )
            now = M @ qd, C_s.T @ qd - g
            if last is not None:
                external = (now[0] - last[0]) / PERIOD - 0.5 * (now[1] + last[1]) - tau
                r = r + filtered * (external - r)
            last = now
            rows.append(r)
            norms.append(np.sqrt(r @ np.linalg.solve(M, r)))
        return np.array(rows), np.array(norms)


DETECTORS = ("ν: |r|", "ν: each r_k", "momenta: |r|", "momenta: each r_k", "momenta: √(rᵀM⁻¹r)")


class Seen(NamedTuple):
    """What the detectors make of a run, a score for each sample, and both estimates of τ_ext."""

    components: tuple  # r on total rates, r on momenta
    norm: np.ndarray  # √(rᵀM⁻¹r) of the latter
    torques: tuple
    onset: int | None

    def scores(self, spread):
        """Scores by detector; components are judged each by its own spread in free motion."""
        ours, theirs = self.components
        return dict(
            zip(
                DETECTORS,
                (
                    np.linalg.norm(ours, axis=1),
                    np.abs(ours / spread[0]).max(axis=1),
                    np.linalg.norm(theirs, axis=1),
                    np.abs(theirs / spread[1]).max(axis=1),
                    self.norm,
                ),
                strict=True,
            )
        )


def watch(arm, stream, gain):
    """What both observers make of a stream."""
    ours, torque = arm.on_total_rates(stream, gain)
    theirs, norm = arm.on_momenta(stream, gain)
    return Seen((ours, theirs), norm, (torque, theirs), stream.onset)


SETTLING = 0.25  # [s] that no detector is judged by at the beginning


def alarms(score, threshold):
    """How often the score rises above the threshold, having been below half of it since."""
    count, alarmed = 0, False
    for value in score[int(SETTLING / PERIOD) :]:
        if alarmed:
            alarmed = value >= 0.5 * threshold
        elif value > threshold:
            count, alarmed = count + 1, True
    return count


def delay(score, onset, threshold):
    """How long after its onset a push is seen [s]; inf if it is not."""
    above = np.flatnonzero(score[onset : onset + int(PUSH / PERIOD)] > threshold)
    return above[0] * PERIOD if len(above) else np.inf


class Row(NamedTuple):
    """What one detector is worth, of pushes and free motions that it was not tuned on."""

    detected: (
        float  # with no false alarm in the tuning's free motion: part of the pushes that is seen
    )
    median: float  # delay [s] of those that are seen by all detectors
    late: float  # 90th percentile of these
    false: float  # false alarms per minute
    false_at_equal: (
        float  # the same where a threshold lets SENSITIVITY of the tuning's pushes be seen
    )
    detected_at_equal: float
    curve: tuple  # false alarms per minute and part detected, over thresholds


def judge(tuning, trial, spread):
    """Rows by detector, thresholds from the first half of the runs."""
    tuned, tried = ([run.scores(spread) for run in runs] for runs in (tuning, trial))
    free = [k for k, run in enumerate(tuning) if run.onset is None]
    pushed = [k for k, run in enumerate(tuning) if run.onset is not None]
    quiet = [k for k, run in enumerate(trial) if run.onset is None]
    hit = [k for k, run in enumerate(trial) if run.onset is not None]
    minutes = len(quiet) * (DURATION - SETTLING) / 60
    delays, rest = {}, {}
    for name in DETECTORS:
        threshold = max(tuned[k][name][int(SETTLING / PERIOD) :].max() for k in free)
        delays[name] = np.array([delay(tried[k][name], trial[k].onset, threshold) for k in hit])
        reach = [
            tuned[k][name][tuning[k].onset : tuning[k].onset + int(PUSH / PERIOD)].max()
            for k in pushed
        ]
        equal = np.quantile(reach, 1 - SENSITIVITY)
        top = np.array(
            [
                tried[k][name][trial[k].onset : trial[k].onset + int(PUSH / PERIOD)].max()
                for k in hit
            ]
        )
        levels = threshold * np.geomspace(0.2, 3.0, 60)
        curve = (
            [sum(alarms(tried[k][name], level) for k in quiet) / minutes for level in levels],
            [(top > level).mean() for level in levels],
        )
        rest[name] = (
            sum(alarms(tried[k][name], threshold) for k in quiet) / minutes,
            sum(alarms(tried[k][name], equal) for k in quiet) / minutes,
            (top > equal).mean(),
            curve,
        )
    common = np.isfinite(list(delays.values())).all(axis=0)
    return {
        name: Row(
            np.isfinite(d).mean(),
            float(np.median(d[common])),
            float(np.quantile(d[common], 0.9)),
            *rest[name],
        )
        for name, d in delays.items()
    }


class Outcome(NamedTuple):
    """Of one arm, condition and gain."""

    rows: dict
    noise: tuple  # rms of both estimates of τ_ext in free motion [N m]
    lag: tuple  # rms error of both for a constant τ_ext on a moving arm, part of it


def lag(arm, rng, gain):
    """Relative rms error of both estimates of a constant joint torque while the arm moves; no noise, the right model."""
    stream = arm.run(rng, False)
    n = arm.model.nv
    push = 5.0 * rng.normal(size=n)
    t = PERIOD * np.arange(len(stream.q))[:, None]
    pace, phase, centre = rng.uniform(1, 4, n), rng.uniform(0, 2 * np.pi, n), stream.q[0]
    q, qd = centre + 0.4 * np.sin(pace * t + phase), 0.4 * pace * np.cos(pace * t + phase)
    qdd = -0.4 * pace**2 * np.sin(pace * t + phase)
    middle = 0.5 * PERIOD  # an effort that is held stands for that of the middle of its interval
    tau = np.array(
        [
            arm.dyn.inverse_dynamics(*x)
            for x in zip(q - middle * qd, qd - middle * qdd, qdd, strict=True)
        ]
    )
    seen = watch(arm, Stream(q, qd, tau - push, None), gain)
    late = slice(int(10 / gain / PERIOD), None)
    return tuple(
        float(np.sqrt(np.mean((x[late] - push) ** 2) / np.mean(push**2))) for x in seen.torques
    )


def measure(arm, gain, streams):
    """Everything of one arm in one condition at one gain."""
    seen = [watch(arm, stream, gain) for stream in streams]
    settled = slice(int(SETTLING / PERIOD), None)
    free = [run for run in seen if run.onset is None]
    half = len(streams) // 2
    spread = [
        np.sqrt(
            np.mean(
                [
                    (run.components[k][settled] ** 2).mean(axis=0)
                    for run in seen[:half]
                    if run.onset is None
                ],
                0,
            )
        )
        for k in range(2)
    ]
    noise = tuple(
        float(np.sqrt(np.mean([np.mean(run.torques[k][settled] ** 2) for run in free])))
        for k in range(2)
    )
    return Outcome(
        judge(seen[:half], seen[half:], spread), noise, lag(arm, np.random.default_rng(5), gain)
    )


HEAD = f"""# Benchmark of disturbance observers

`make bench ARGS="--only observer"`. Runs of {DURATION:g} s at {1 / PERIOD:g} Hz, all joints moving, noise of
{VELOCITY_NOISE:g} rad/s and {EFFORT_NOISE:g} N m; pushes of 5 to 40 N for {PUSH:g} s, at random links, in random directions.
Thresholds come from one half of the runs, figures from the other. *Quiet*: the lowest threshold without a false alarm
in the tuning's free motion. *Equal*: that which lets {SENSITIVITY:.0%} of the tuning's pushes be seen. Delays are of
the pushes that all detectors see. `each r_k`: every component is judged by its own spread in free motion. An alarm
ends at half of its threshold.
"""


def table(outcomes):
    """The results as text."""
    lines = [HEAD]
    for (name, condition, gain), outcome in outcomes.items():
        noise, late = outcome.noise, outcome.lag
        lines += [
            f"## {name}, K_O = {gain:g} 1/s, {CONDITIONS[condition]}",
            "",
            f"τ_ext in free motion, rms: {noise[0]:.2f} N m on total rates, {noise[1]:.2f} N m on momenta.",
            f"Error of a constant joint torque on a moving arm, no noise: {late[0]:.1%} and {late[1]:.1%}.",
            "",
            "| detector | quiet: seen | median delay | 90 % delay | false alarms/min | equal: seen | false alarms/min |",
            "|---|---|---|---|---|---|---|",
        ]
        for detector, row in outcome.rows.items():
            cells = (
                detector.replace("|", r"\|"),
                f"{row.detected:.0%}",
                f"{1e3 * row.median:.0f} ms",
                f"{1e3 * row.late:.0f} ms",
                f"{row.false:.1f}",
                f"{row.detected_at_equal:.0%}",
                f"{row.false_at_equal:.1f}",
            )
            lines.append(f"| {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


COLORS = dict(zip(DETECTORS, ("#0b6fb8", "#5fb3ce", "#d1495b", "#e8998d", "#7a7a7a"), strict=True))


def draw(outcomes, path):
    """How many pushes are seen at how many false alarms."""
    shown = [key for key in outcomes if key[2] == GAINS[-1]]
    figure, axes = plt.subplots(
        len(ARMS),
        len(CONDITIONS),
        figsize=(9, 6.4),
        sharex=True,
        sharey=True,
        squeeze=False,
        constrained_layout=True,
    )
    for ax, key in zip(axes.ravel(), shown, strict=True):
        for detector, row in outcomes[key].rows.items():
            ax.plot(*row.curve, color=COLORS[detector], label=detector, drawstyle="steps-post")
        ax.set_title(
            f"{key[0]}, {'noise' if key[1] == 'noise' else 'noise and a wrong model'}",
            loc="left",
            fontsize=10,
        )
        ax.set_xscale("symlog", linthresh=1.0)
        ax.grid(alpha=0.25)
    axes[0, 0].legend(frameon=False, fontsize=8)
    figure.supxlabel("false alarms per minute of free motion")
    figure.supylabel("part of the pushes that is seen")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def compare(short):
    """Outcomes by arm, condition and gain; `short`: of a fifteenth of the runs."""
    free, pushed = (4, 4) if short else (40, 80)
    outcomes = {}
    for name in ARMS:
        for condition in CONDITIONS:
            arm, rng = Arm(name, condition), np.random.default_rng(17)
            kinds = (
                np.arange(free + pushed) % ((free + pushed) / free) < 1
            )  # free ones spread over both halves
            streams = [arm.run(rng, not is_free) for is_free in kinds]
            for gain in GAINS:
                outcomes[name, condition, gain] = measure(arm, gain, streams)
    return outcomes


def write(outcomes, folder):
    """Write the table and the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "observer.md").write_text(table(outcomes), encoding="utf-8")
    draw(outcomes, folder / "observer.png")
