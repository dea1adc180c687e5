# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality of recorded data: rate, gaps, repeats, velocities that are not those of the positions."""

from collections import Counter

import numpy as np

from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model.loading import singular_balls
from diag_dynamics.recordings.balance import MAX_GAP
from diag_dynamics.recordings.states import States
from diag_dynamics.recordings.velocities import (
    RATIO_ERROR,
    UNKNOWN,
    WINDOW,
    VelocityRelation,
    cause_of_ratio,
    position_changes,
    position_ratios,
)
from diag_dynamics.recordings.windows import WindowIntegrals

GAP_PERIODS = 3.0  # interval in periods above which it is a gap
RESOLUTION = 100  # of intervals [ns]

MAX_VELOCITY_ERROR, REST = 0.2, 2e-4
"""Root mean square of Δq − ∫q̇dt over that of Δq from which there is a warning, and of Δq of a
joint at rest [rad, m]."""

MIN_PERIODS = 1.0  # of a delay worth a warning
MANY = 0.01  # fraction of repeated stamps or states worth a warning
SAMPLE = 5000  # first states that units and ball joints are judged by

WRONG_RATIO = 1.5  # factor from which an unknown ratio is wrong


class Quality:
    """Judge the data of states of a robot, batch by batch.

    `begin` and `end` are the first and the last stamp [ns].
    """

    def __init__(self, model):
        skip = 6 if model.floating_base else 0  # a floating base is left out
        self._model = model
        self._joints = model.dof_names[skip:]
        count = len(self._joints)
        self._q = slice(model.nq - count, None)
        self._v = slice(skip, None)
        self._continuous = np.array(
            [name in model.continuous_joints for name in self._joints], bool
        )
        self._windows = WindowIntegrals(WINDOW)
        self._last = None
        self._relation = VelocityRelation(count)
        self._intervals = Counter()  # numbers of intervals by their lengths [RESOLUTION]
        self._sample = None
        self._ratios = None  # of Δq to ∫q̇dt
        self._longest = 0.0
        counts = "repeated_states", "repeated_stamps", "without_effort"
        self._counts = dict.fromkeys(counts, 0)
        self._count = 0
        self._elapsed = 0
        self.begin = None
        self.end = None

    @property
    def duration(self):
        """Time from the first state to the last one, without jumps back of stamps [s]."""
        return self._elapsed / SECOND

    def add_states(self, states):
        """Add states."""
        self._counts["without_effort"] += int(np.count_nonzero(~states.effort_known))
        self.begin = states.stamp[0] if self.begin is None else self.begin
        self.end = states.stamp[-1]
        if self._sample is None:
            self._sample = states.position[:SAMPLE]
        self._count += len(states)
        if self._last:
            states = States.concatenate([self._last, states])
        self._last = States(*(column[-1:].copy() for column in states.columns()))
        self._add_intervals(states.stamp)
        self._compare(states)

    def _add_intervals(self, stamps):
        elapsed = np.diff(stamps)
        forward = elapsed[elapsed > 0]
        if not len(forward):
            return
        self._elapsed += int(forward.sum())
        self._longest = max(self._longest, float(forward.max() * 1e-9))
        rounded = np.maximum(np.round(forward / RESOLUTION), 1.0)
        lengths, numbers = np.unique(rounded, return_counts=True)
        self._intervals.update(dict(zip(lengths.tolist(), numbers.tolist(), strict=True)))

    def _compare(self, states):
        """Compare neighbours, and positions with velocities over windows."""
        stamps = states.stamp
        velocity = states.velocity[:, self._v]
        effort = states.effort[:, self._v]
        elapsed = np.diff(stamps) / SECOND
        steps = np.zeros((len(stamps), 2, len(self._joints)))  # Δq and ∫q̇dt
        steps[1:, 0] = position_changes(states.position[:, self._q], self._continuous)
        steps[1:, 1] = 0.5 * elapsed[:, None] * (velocity[:-1] + velocity[1:])
        repeats = (steps[1:, 0] == 0.0) & (np.diff(velocity, axis=0) == 0.0)
        repeats &= effort[1:] == effort[:-1]
        self._counts["repeated_states"] += int(np.count_nonzero(repeats.all(axis=1)))
        if self._ratios is None:
            self._ratios = position_ratios(
                elapsed[:SAMPLE], steps[1 : SAMPLE + 1, 0], steps[1 : SAMPLE + 1, 1]
            )
        again = elapsed == 0.0
        self._counts["repeated_stamps"] += int(np.count_nonzero(again))
        follows = again | ((elapsed > 0.0) & (elapsed <= MAX_GAP) & ~states.jumped[1:])
        follows = np.append(False, follows)
        *_, sums, change = self._windows.integrate(
            stamps, follows, steps.reshape(len(steps), -1), velocity
        )
        self._relation.add_steps(*np.split(sums, 2, axis=1), change)

    def _regularity(self):
        """Return period and root mean square deviation of intervals [s], and number of gaps."""
        if not self._intervals:
            return None, None, 0
        lengths, numbers = np.transpose(sorted(self._intervals.items()))
        seconds = lengths * RESOLUTION / SECOND
        period = seconds[np.searchsorted(np.cumsum(numbers), numbers.sum() / 2)]
        regular = seconds <= GAP_PERIODS * period
        variance = np.average((seconds[regular] - period) ** 2, weights=numbers[regular])
        return float(period), float(np.sqrt(variance)), int(numbers[~regular].sum())

    def report(self):
        """Return numbers of all states and warnings, a dict with those of joints in `joints`.

        Times are in s.
        """
        ratios = dict(zip(self._joints, self._ratios.tolist(), strict=True))
        wrong_unit, warnings = _judge_ratios(ratios)
        warnings += self._warn_of_balls()
        period, jitter, gaps = self._regularity()
        delay, joints = self._report_velocities()
        report = {
            "rate": None if period is None else 1.0 / period,
            "jitter": jitter,
            "gaps": gaps,
            "longest_gap": self._longest,
            **self._counts,
            "velocity_delay": delay,
            "wrong_unit": wrong_unit,
            "joints": joints,
        }
        return report, [*warnings, *self._warnings(report)]

    def _warn_of_balls(self):
        """Return warnings of ball joints that come near the singularity of their hinges."""
        counts = Counter()
        for q in self._sample if self._model.description.balls else ():
            counts.update(singular_balls(self._model, q).keys())
        return [
            f"ball joint '{name}' is within 10° of the singularity of its hinges in {count} of "
            f"the first {len(self._sample)} states: rates and efforts of its hinges are large there"
            for name, count in counts.items()
        ]

    def _report_velocities(self):
        """Return the median delay of velocities, and errors by joint.

        The median is None if less than half of the joints in motion show a delay.
        """
        relation = self._relation
        error = relation.error
        delay = relation.delay
        moves = np.isfinite(error)
        shows = moves & relation.shows_delay
        is_common = shows.any() and 2 * shows.sum() >= moves.sum()
        joints = {
            name: {"velocity_error": None if np.isnan(x) else float(x)}
            for name, x in zip(self._joints, error, strict=True)
        }
        return float(np.median(delay[shows])) if is_common else None, joints

    def _warnings(self, report):
        """Return warnings, a sentence each, but for those of ratios."""
        rate = report["rate"] or np.inf
        delay = report["velocity_delay"] or 0.0
        same_state = report["repeated_states"]
        same_stamp = report["repeated_stamps"]
        many = MANY * self._count
        warnings = {
            f"states are {1.0 / rate:.3g} s apart; power balance and external torque need "
            f"intervals of at most {MAX_GAP:g} s": rate * MAX_GAP < 1.0
        }
        # Noise of positions at rest is not the integral of that of velocities.
        moves = np.sqrt(self._relation.travel / max(self.duration / WINDOW, 1.0)) >= REST
        for moving, (name, joint) in zip(moves, report["joints"].items(), strict=True):
            error = joint["velocity_error"] or 0.0
            apart = (
                f"joint '{name}': velocities differ from the derivative of the positions by "
                f"{error:.0%}"
            )
            warnings[apart] = moving and error > MAX_VELOCITY_ERROR
        late = "later (filtered?)" if delay > 0.0 else "earlier"
        gaps = report["gaps"]
        warnings |= {
            f"velocities are {abs(delay) * 1e3:.2g} ms {late} than positions": abs(delay) * rate
            > MIN_PERIODS,
            f"{gaps} gap{'s' * (gaps > 1)}, the longest of {report['longest_gap']:.3g} s": gaps,
            f"{same_stamp} of {self._count} states repeat the previous time stamp: messages of arm "
            "and gripper, or times with too few digits": same_stamp > many,
            f"{same_state} of {self._count} states repeat the previous state": same_state > many,
        }
        return [text for text, applies in warnings.items() if applies]


def _judge_ratios(ratios):
    """Return the wrong unit on which all moving joints agree, or None, and warnings.

    Ratios are those of Δq to ∫q̇dt.
    """
    causes = {}
    moving = sum(map(np.isfinite, ratios.values()))
    for name, ratio in ratios.items():
        if np.isfinite(ratio) and not 1.0 / RATIO_ERROR < ratio < RATIO_ERROR:
            causes.setdefault(cause_of_ratio(ratio) or UNKNOWN, {})[name] = ratio
    warnings = []
    unit = None
    for cause, wrong in causes.items():
        text = "all joints" if len(wrong) == len(ratios) else ", ".join(wrong)
        factors = np.array(list(wrong.values()))
        factor = float(np.median(factors))
        warnings.append(f"{text}: {describe_ratio(factor)}: {cause}")
        is_clear = (
            factors.max() <= RATIO_ERROR * factors.min()
            and not 1.0 / WRONG_RATIO < factor < WRONG_RATIO
        )
        if len(wrong) == moving and (cause != UNKNOWN or is_clear):
            unit = {"cause": cause.partition(" (")[0], "factor": factor}
    return unit, warnings


def describe_ratio(ratio):
    """Return a ratio of Δq to ∫q̇dt in words, with four digits.

    It has no exponent at five places.
    """
    return f"positions change {float(f'{ratio:.4g}'):g} times as fast as the velocities"
