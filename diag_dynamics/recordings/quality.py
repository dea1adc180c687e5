# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality of recorded data: rate, gaps, repeated and clipped values, velocities that are not those of the positions."""

from copy import copy

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.compiled.tables import Addresses
from diag_dynamics.model.single_joints import places
from diag_dynamics.recordings.kernels import prepare
from diag_dynamics.recordings.kernels.quality import (
    APART,
    AT_EFFORT,
    AT_VELOCITY,
    CHANGE,
    LARGEST_EFFORT,
    LARGEST_VELOCITY,
    NEIGHBOURS,
    STILL,
    SUMS,
    TOGETHER,
    TRAVEL,
    WINDOW,
    compare_neighbours,
)

LENGTH, LONGEST = 0.05, 0.1
"""Time over which positions are compared with velocities [s]: over shorter ones, steps of an encoder are all there is. And
time between two states beyond which they say nothing of each other."""

GAP = 3.0
"""Periods without a state that are a gap, to 2 %."""

SHORTEST, BINS, PER_BIN = 1e-7, 2001, np.log(1e10) / 2000
"""Lower bound of the first bin of intervals [s], their number, and their width as a difference of logarithms. The period is
the mean of the bin that has the median: exact to 1.2 %, whatever the length, and to the nanosecond where intervals are nearly
all the same."""

MIDDLES = SHORTEST * np.exp((np.arange(BINS) + 0.5) * PER_BIN)
"""Of the bins [s]: of distances from these, sums of squares are exact."""

APART_FROM = 0.2
"""Root mean square of Δq − ∫q̇dt in parts of that of Δq, from which a warning is due."""

CLIPPED = 20, 1e-3
"""How many states, and which part of all, have to have just the largest value for it to be a bound."""

TELLING, PERIODS = 0.8, 1.0
"""Part of the velocity error that is left without the delay, up to which there is one; and periods from which it is told."""

SAMPLE = 5000
"""States of the beginning that are looked at for steps."""

SLOW = 2e-4
"""Root mean square of Δq over :data:`LENGTH` below which a joint is at rest [rad, m]: positions have noise there, and it is
not the integral of that of velocities."""

ALIKE = 0.9
"""Squared correlation of Δq with q̇dt from which their ratio is told."""

RATIOS = {
    1e-3: "times seem to be milliseconds (scale: {time: ms} in a map of columns)",
    1e-6: "times seem to be microseconds (scale: {time: us} in a map of columns)",
    1e-9: "times seem to be nanoseconds (scale: {time: ns} in a map of columns)",
    60.0: "times seem to be minutes, 60 s each (scale: {time: min} in a map of columns)",
    3600.0: "times seem to be hours, 3600 s each (scale: {time: h} in a map of columns)",
    86400.0: "times seem to be days, 86400 s each (scale: {time: d} in a map of columns)",
    np.pi / 180.0: "velocities seem to be in degrees (scale: {velocity: deg/s} in a map of columns)",
    180.0 / np.pi: "positions seem to be in degrees (scale: {position: deg} in a map of columns)",
    -1.0: "velocities seem to have the wrong sign",
}
"""Causes by the ratio of Δq to q̇dt; the nearest counts."""

UNKNOWN = "times, positions or velocities seem to have a wrong unit"

SURE = 1.5
"""Factor beyond which a ratio without a known cause is a wrong unit if all joints have it."""

NEAR = 1.1
"""Factor up to which a ratio is one of these, and from which it is none of 1."""

STEPS = 0.2
"""Different values, in parts of all, up to which a signal has steps."""

FIELDS = "position", "velocity", "effort"


class Quality:
    """Looks at states piece by piece.

    Parameters
    ----------
    model : RobotModel
    """

    def __init__(self, model):
        names = model.dof_names
        self._names, count = names, model.nv
        self._at = model.nq - count  # a floating base's coordinates are left out: there is one more than rates
        self._skip = 6 if model.floating_base else 0
        self._joints = names[self._skip :]
        single = [name for name in self._joints if name in model.continuous_joints]
        self._turns = np.zeros(len(self._joints), dtype=bool)
        self._turns[list(places(single, self._joints))] = True
        width = len(self._joints)
        self._sums, self._extremes = np.zeros((len(SUMS), width)), np.zeros((4, width))
        self._repeated = np.zeros(2, dtype=int)
        self._whole, self._begun = np.zeros(1, dtype=int), np.zeros((len(WINDOW), width))
        self._intervals = np.zeros((3, BINS))  # number, and sums of distances from MIDDLES and of their squares
        self._before = None
        self._longest, self._longest_at = 0.0, None
        self._count = self._without_effort = self._estimated = 0
        self._sample, self._sampled = [np.zeros((0, width)) for _ in FIELDS], np.zeros(0, dtype=int)  # and their stamps
        self.begin = self.end = None
        self._elapsed = 0
        prepare(compare_neighbours)

    def anew(self):
        """One that has seen nothing, but goes on from here."""
        other = copy(self)
        other._sums, other._extremes, other._repeated, other._intervals = (
            np.zeros_like(x) for x in (self._sums, self._extremes, self._repeated, self._intervals)
        )
        other._longest, other._longest_at = 0.0, None
        other._count = other._without_effort = other._estimated = 0
        other._sample, other._sampled = [x[:0] for x in self._sample], self._sampled[:0]
        other.begin = other.end = None
        other._elapsed = 0
        return other

    def memory(self):
        """What later results depend on; see `diag_dynamics.recordings.seams`."""
        whole = bool(self._whole[0])
        return {"before": self._before, "whole": whole, "begun": self._begun.copy() if whole else None}

    def add(self, other):
        """Take in what another one has, which has gone on from here."""
        if not other._count:
            return
        self._sums, self._intervals, self._repeated = (
            mine + its
            for mine, its in zip(
                (self._sums, self._intervals, self._repeated),
                (other._sums, other._intervals, other._repeated),
                strict=True,
            )
        )
        for largest, at in ((LARGEST_VELOCITY, AT_VELOCITY), (LARGEST_EFFORT, AT_EFFORT)):
            mine, its = self._extremes[largest], other._extremes[largest]
            counts = self._extremes[at] * (mine >= its) + other._extremes[at] * (its >= mine)
            self._extremes[largest], self._extremes[at] = np.maximum(mine, its), counts
        if other._longest > self._longest:
            self._longest, self._longest_at = other._longest, other._longest_at
        self._count += other._count
        self._elapsed += other._elapsed
        self._without_effort += other._without_effort
        self._estimated += other._estimated
        self._sample = [np.concatenate(pair)[:SAMPLE] for pair in zip(self._sample, other._sample, strict=True)]
        self._sampled = np.concatenate([self._sampled, other._sampled])[:SAMPLE]
        self.begin = other.begin if self.begin is None else self.begin
        self.end = other.end

    def take(self, states):
        """Take in states."""
        count = len(states)
        if not count:
            return
        self._count += count
        self._without_effort += count - int(states.effort_known.sum())
        self._estimated += int(states.velocity_estimated.sum())
        if self.begin is None:
            self.begin = int(states.stamp[0])
        self.end = int(states.stamp[-1])
        columns = self._columns(states)
        known = 0
        if self._before is not None:
            known, columns = 1, tuple(map(np.concatenate, zip(self._before, columns, strict=True)))
        self._take_intervals(columns[0])
        neighbours = Addresses(
            NEIGHBOURS,
            stamp=np.ascontiguousarray(columns[0]),
            **dict(zip(FIELDS, map(np.ascontiguousarray, columns[1:]), strict=True)),
            moved=np.concatenate([np.zeros(known, dtype=bool), states.jumped]),
            turns=self._turns,
            whole=self._whole,
            begun=self._begun,
            sums=self._sums,
            extremes=self._extremes,
            repeated=self._repeated,
        )
        compare_neighbours(neighbours.at, known, round(LENGTH * SECOND), LONGEST)
        if (room := SAMPLE - len(self._sample[0])) > 0:
            self._sample = [
                np.concatenate([sample, column[known : known + room]])
                for sample, column in zip(self._sample, columns[1:], strict=True)
            ]
            self._sampled = np.concatenate([self._sampled, columns[0][known : known + room]])
        self._before = tuple(column[-1:].copy() for column in columns)

    def _columns(self, states):
        """Stamps, and positions, velocities and efforts of the joints."""
        skip = self._skip
        return states.stamp, states.position[:, skip + self._at :], states.velocity[:, skip:], states.effort[:, skip:]

    @property
    def duration(self):
        """Time from the first state to the last one, without what stamps have gone back [s]."""
        return self._elapsed * 1e-9

    def _take_intervals(self, stamps):
        steps = np.diff(stamps)
        self._elapsed += int(steps[steps > 0].sum())
        elapsed = steps * 1e-9
        forward = elapsed[elapsed > 0.0]
        if not len(forward):
            return
        at = np.log(forward / SHORTEST) / PER_BIN
        bins = np.clip(at, 0, BINS - 1).astype(int)
        apart = forward - MIDDLES[bins]
        for row, weights in zip(self._intervals, (None, apart, apart * apart), strict=True):
            row += np.bincount(bins, weights, minlength=BINS)
        k = int(np.argmax(elapsed))
        if elapsed[k] > self._longest:
            self._longest, self._longest_at = float(elapsed[k]), int(stamps[k])

    def _regularity(self):
        """Period, root mean square distance of intervals from it [s], and number of gaps; None, None, 0 without intervals."""
        number, apart, squares = self._intervals
        total = number.sum()
        if not total:
            return None, None, 0
        k = int(np.searchsorted(np.cumsum(number), total / 2))
        period = float(MIDDLES[k] + apart[k] / number[k])
        first = 1 + int(np.searchsorted(MIDDLES, GAP * period))  # the first bin that is wholly beyond
        off = MIDDLES[:first] - period
        sums = squares[:first] + 2.0 * off * apart[:first] + off**2 * number[:first]
        jitter = float(np.sqrt(max(sums.sum(), 0.0) / number[:first].sum()))
        return period, jitter, int(number[first:].sum())

    def report(self):
        """What has been seen, as a dict of numbers, and by joint.

        Returns
        -------
        dict
            `rate` [Hz]; `jitter`, root mean square distance of intervals from their median [s]; `gaps`, their number;
            `longest_gap` [s] and `longest_gap_at`, the stamp before it [ns]; numbers of states: `repeated_states`,
            `repeated_stamps`, `without_effort`, `estimated_velocity`; `velocity_delay`, by how much q̇ comes late [s], the
            median over joints that tell; `wrong_unit`, None or `cause` and `factor` of positions against velocities, on
            which all joints in motion agree. `joints`, of each one: `velocity_error`, root mean square of Δq − ∫q̇dt over
            :data:`LENGTH` in parts of that of Δq; `velocity_delay`; `velocity_error_without_delay`; `still`, the number of
            states in motion with no new position; `largest_velocity`, `largest_effort`; `clipped`, which of the two is a
            bound that is often reached; `steps`, the smallest step by quantity.
        """
        joints = {name: self._of_joint(j) for j, name in enumerate(self._joints)}
        period, jitter, gaps = self._regularity()
        return {
            "rate": None if period is None else 1.0 / period,
            "jitter": jitter,
            "gaps": gaps,
            "longest_gap": self._longest,
            "longest_gap_at": self._longest_at,
            "repeated_states": int(self._repeated[0]),
            "repeated_stamps": int(self._repeated[1]),
            "without_effort": self._without_effort,
            "estimated_velocity": self._estimated,
            "velocity_delay": _delay(joints.values()),
            "wrong_unit": self._wrong_unit(),
            "joints": joints,
        }

    def _of_joint(self, j):
        sums, extremes = self._sums[:, j], self._extremes[:, j]
        travel, change, apart, together = sums[[TRAVEL, CHANGE, APART, TOGETHER]]
        delay = together / change if change > 0.0 else None
        left = apart - together * together / change if change > 0.0 else apart
        least, part = CLIPPED
        often = max(least, part * self._count)
        clipped = [
            name
            for name, largest, at in (
                ("velocity", LARGEST_VELOCITY, AT_VELOCITY),
                ("effort", LARGEST_EFFORT, AT_EFFORT),
            )
            if extremes[largest] > 0.0 and extremes[at] >= often
        ]
        return {
            "velocity_error": float(np.sqrt(apart / travel)) if travel > 0.0 else None,
            "velocity_delay": None if delay is None else float(delay),
            "velocity_error_without_delay": float(np.sqrt(max(left, 0.0) / travel)) if travel > 0.0 else None,
            "still": int(sums[STILL]),
            "largest_velocity": float(extremes[LARGEST_VELOCITY]),
            "largest_effort": float(extremes[LARGEST_EFFORT]),
            "clipped": clipped,
            "steps": self._steps(j),
        }

    def _steps(self, j):
        """Smallest step of each signal that has steps, by quantity."""
        found = {}
        for name, sample in zip(FIELDS, self._sample, strict=True):
            values = sample[:, j][np.isfinite(sample[:, j])]
            levels = np.unique(values)
            if 2 < len(levels) <= STEPS * len(values):
                found[name] = float(np.diff(levels).min())
        return found

    def _ratios(self):
        """Ratio of Δq to q̇dt of each joint, over the states of the sample; NaN where one does not follow the other."""
        position, velocity, _ = self._sample
        elapsed = np.diff(self._sampled)[:, None] * 1e-9
        travelled = np.diff(position, axis=0)
        travelled = np.where(self._turns, (travelled + np.pi) % (2.0 * np.pi) - np.pi, travelled)
        integral = 0.5 * elapsed * (velocity[1:] + velocity[:-1])
        forward = (
            (elapsed > 0.0) & (elapsed < 2.0 * np.median(elapsed[elapsed > 0.0])) if (elapsed > 0.0).any() else False
        )
        travelled, integral = (np.where(forward, x, 0.0) for x in (travelled, integral))
        travel, change, together = (travelled**2).sum(0), (integral**2).sum(0), (travelled * integral).sum(0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(together**2 > ALIKE * travel * change, together / change, np.nan)

    def _causes_of_ratios(self):
        """Names and ratios of joints whose positions and velocities disagree, by cause."""
        found = {}
        for name, ratio in zip(self._joints, self._ratios(), strict=True):
            if 1.0 / NEAR < ratio < NEAR or not np.isfinite(ratio):
                continue
            found.setdefault(_cause(ratio), []).append((name, ratio))
        return found

    def _about_ratios(self):
        """What positions and velocities say of each other's units: sentences."""
        sentences = []
        for cause, found in self._causes_of_ratios().items():
            which = "all joints" if len(found) == len(self._joints) else ", ".join(name for name, _ in found)
            sentences.append(
                f"{which}: positions change {four_digits(found[0][1])} times as fast as velocities say: {cause}"
            )
        return sentences

    def _wrong_unit(self):
        """The cause for which no number is right: that on which all joints in motion agree; None if there is none."""
        causes, ratios = self._causes_of_ratios(), self._ratios()
        if len(causes) != 1:
            return None
        ((cause, found),) = causes.items()
        values = np.array([ratio for _, ratio in found])
        if len(found) < np.isfinite(ratios).sum():
            return None
        if cause == UNKNOWN and (values.max() > NEAR * values.min() or 1.0 / SURE < values[0] < SURE):
            return None
        return {"cause": cause.partition(" (")[0], "factor": float(np.median(values))}

    def warnings(self):
        """What is worth telling, a sentence each."""
        told, report = self._about_ratios(), self.report()
        rate = report["rate"]
        if rate is not None and rate * LONGEST < 1.0:
            told.append(
                f"states are {1.0 / rate:.3g} s apart: over more than {LONGEST:g} s nothing is integrated, so that there is "
                "neither a balance of power nor an external torque"
            )
        windows = 0.0 if self.begin is None else max(self.duration / LENGTH, 1.0)
        still = np.sqrt(self._sums[TRAVEL] / windows) < SLOW if windows else np.ones(len(self._joints), dtype=bool)
        for rests, (name, of) in zip(still, report["joints"].items(), strict=True):
            error, delay, left = (of[x] for x in ("velocity_error", "velocity_delay", "velocity_error_without_delay"))
            if error is not None and error > APART_FROM and not rests:
                late = ""
                if delay is not None and left < 0.7 * error:
                    late = f"; they are {'late' if delay > 0.0 else 'early'} by {abs(delay) * 1e3:.3g} ms"
                told.append(f"joint '{name}': velocities are not the slope of positions ({error:.0%} apart{late})")
            told += [
                f"joint '{name}': {what} often is just {of[f'largest_{what}']:.6g}: clipped" for what in of["clipped"]
            ]
        delay = report["velocity_delay"]
        if delay is not None and abs(delay) * rate > PERIODS:
            when = "late: filtered, perhaps" if delay > 0.0 else "early"
            told.append(f"velocities come {abs(delay) * 1e3:.2g} ms {when}, against positions")
        if report["gaps"]:
            told.append(f"{report['gaps']} gaps, the longest of {report['longest_gap']:.3g} s")
        if self._count and report["repeated_stamps"] > 0.01 * self._count:
            told.append(
                f"{report['repeated_stamps']} of {self._count} states have the time of the one before: several messages have "
                "one time, as those of an arm and its gripper, or times need more digits"
            )
        if self._count and report["repeated_states"] > 0.01 * self._count:
            told.append(f"{report['repeated_states']} of {self._count} states repeat the one before")
        return told


def _cause(ratio):
    """The cause of a ratio of Δq to q̇dt."""
    apart = {cause: abs(np.log(ratio / one)) for one, cause in RATIOS.items() if ratio / one > 0.0}
    cause = min(apart, key=apart.get)
    return cause if apart[cause] < np.log(NEAR) else UNKNOWN


def four_digits(value):
    """A number with four digits, without an exponent where it has five places."""
    return f"{float(f'{value:.4g}'):g}"


def _delay(joints):
    """Median of the delays of joints that tell of one; None if less than half of those in motion do."""
    moving = [one for one in joints if one["velocity_error"] is not None]
    told = [
        one["velocity_delay"]
        for one in moving
        if one["velocity_delay"] is not None and one["velocity_error_without_delay"] < TELLING * one["velocity_error"]
    ]
    return float(np.median(told)) if told and 2 * len(told) >= len(moving) else None
