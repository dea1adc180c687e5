# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality of recorded data: rate, gaps, repeated and clipped values, velocities that are not those of the positions."""

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.model.single_joints import places
from diag_dynamics.recordings.windows import WindowIntegrals, column_counts, column_maxima

WINDOW, MAX_INTERVAL = 0.05, 0.1
"""Time over which positions are compared with velocities, and longest interval between states for that [s]."""

GAP_PERIODS = 3.0
"""Interval in periods from which it is a gap, to 2 %."""

MIN_INTERVAL, BINS, BIN_WIDTH = 1e-7, 2001, np.log(1e10) / 2000
"""Logarithmic bins of intervals: lower bound of the first one [s], number, width."""

MIDDLES = MIN_INTERVAL * np.exp((np.arange(BINS) + 0.5) * BIN_WIDTH)

MAX_VELOCITY_ERROR, REST = 0.2, 2e-4
"""Root mean square of Δq − ∫q̇dt over that of Δq from which there is a warning, and of Δq of a joint at rest [rad, m]."""

CLIPPED_STATES, CLIPPED_SHARE = 20, 1e-3
"""States, and fraction of all, at the largest value from which it is a bound."""

MAX_ERROR_LEFT, MIN_PERIODS = 0.8, 1.0
"""Fraction of the velocity error without the delay up to which there is a delay, and periods of one worth a warning."""

SAMPLE, MAX_LEVELS, MOVING = 5000, 0.2, 0.05
"""First states that units and steps are judged by, fraction of distinct values of a signal with steps, and speed at
which a position has to change [rad/s, m/s]."""

MANY = 0.01
"""Fraction of repeated stamps or states worth a warning."""

CORRELATION, RATIO_ERROR, WRONG_RATIO = 0.9, 1.1, 1.5
"""Squared correlation of Δq with q̇dt of a ratio, factor up to which a ratio is a known one, and from which it is wrong."""

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
"""Causes by the ratio of Δq to q̇dt."""

UNKNOWN = "times, positions or velocities seem to have a wrong unit"


class Quality:
    """Judge the data of states of a robot, batch by batch."""

    def __init__(self, model):
        self._at = model.nq - model.nv  # a floating base has one coordinate more than rates, and is left out
        self._skip = 6 if model.floating_base else 0
        self._joints = model.dof_names[self._skip :]
        self._turns = places([name for name in self._joints if name in model.continuous_joints], self._joints)
        count = len(self._joints)
        self._windows, self._last = WindowIntegrals(WINDOW), None
        self._sums = np.zeros((4, count))  # of Δq², Δq̇², (Δq − ∫q̇dt)² and (Δq − ∫q̇dt)Δq̇
        self._still = np.zeros(count, dtype=int)
        self._largest = {name: np.zeros((2, count)) for name in ("velocity", "effort")}  # and how often
        self._intervals = np.zeros((3, BINS))  # number, sums of distances from MIDDLES, and of their squares
        self._sample = []
        self._longest = 0.0, None
        self._count = self._without_effort = self._estimated = self._same_stamp = self._same_state = 0
        self._elapsed, self.begin, self.end = 0, None, None

    def add_states(self, states):
        """Add states."""
        count, skip = len(states), self._skip
        self._without_effort += count - int(states.effort_known.sum())
        self._estimated += int(states.velocity_estimated.sum())
        self.begin, self.end = states.stamp[0] if self.begin is None else self.begin, states.stamp[-1]
        columns = (
            states.stamp,
            states.position[:, skip + self._at :],
            states.velocity[:, skip:],
            states.effort[:, skip:],
        )
        if self._count < SAMPLE:
            self._sample.append([column[: SAMPLE - self._count] for column in columns])
        for name, values in zip(self._largest, columns[2:], strict=True):
            self._count_largest(name, np.abs(values))
        self._count += count
        jumped = states.jumped
        if self._last:
            columns = [np.concatenate(pair) for pair in zip(self._last, columns, strict=True)]
            jumped = np.append(False, jumped)
        self._last = [column[-1:].copy() for column in columns]
        self._compare(*columns, jumped)

    def _count_largest(self, name, values):
        largest, number = self._largest[name]
        top = np.maximum(column_maxima(values), 0.0)
        here = column_counts(values == top)
        self._largest[name][:] = np.maximum(largest, top), number * (largest >= top) + here * (top >= largest)

    def _compare(self, stamps, position, velocity, effort, jumped):
        """Compare neighbours, and positions with velocities over windows."""
        self._add_intervals(stamps)
        elapsed = np.diff(stamps) / SECOND
        steps = np.zeros((len(stamps), 2, position.shape[1]))  # Δq and ∫q̇dt
        moved, integral = steps[1:, 0], steps[1:, 1]
        np.subtract(position[1:], position[:-1], out=moved)
        same, again = moved == 0.0, elapsed == 0.0
        self._still += column_counts(same & (np.abs(velocity[1:]) >= MOVING))
        k = np.flatnonzero(same[:, 0])
        k = k[same[k].all(axis=1)]
        same = (velocity[k + 1] == velocity[k]) & (effort[k + 1] == effort[k])
        self._same_state += int(same.all(axis=1).sum())
        self._same_stamp += int(again.sum())
        moved[:, self._turns] = _wrapped(moved[:, self._turns])
        moved[again] = 0.0
        np.multiply(0.5 * elapsed[:, None], velocity[:-1] + velocity[1:], out=integral)
        follows = again | ((elapsed > 0.0) & (elapsed <= MAX_INTERVAL) & ~jumped[1:])
        *_, sums, change = self._windows.integrate(
            stamps, np.append(False, follows), steps.reshape(len(stamps), -1), velocity
        )
        moved, integral = np.split(sums, 2, axis=1)
        apart = moved - integral
        pairs = (moved, moved), (change, change), (apart, apart), (apart, change)
        self._sums += [(one * other).sum(axis=0) for one, other in pairs]

    def _add_intervals(self, stamps):
        elapsed = np.diff(stamps)
        forward = elapsed[elapsed > 0]
        if not len(forward):
            return
        self._elapsed += int(forward.sum())
        k = int(np.argmax(elapsed))
        self._longest = max(self._longest, (elapsed[k] * 1e-9, int(stamps[k])), key=lambda one: one[0])
        forward = forward * 1e-9
        bins = np.clip(np.log(forward / MIN_INTERVAL) / BIN_WIDTH, 0, BINS - 1).astype(int)
        apart = forward - MIDDLES[bins]
        for row, weights in zip(self._intervals, (None, apart, apart * apart), strict=True):
            row += np.bincount(bins, weights, minlength=BINS)

    @property
    def duration(self):
        """Time from the first state to the last one, without jumps back of stamps [s]."""
        return self._elapsed * 1e-9

    def _regularity(self):
        """Return period and root mean square deviation of intervals [s], and number of gaps."""
        number, apart, squares = self._intervals
        if not number.any():
            return None, None, 0
        k = int(np.searchsorted(np.cumsum(number), number.sum() / 2))
        period = float(MIDDLES[k] + apart[k] / number[k])  # mean of the median's bin
        first = 1 + int(np.searchsorted(MIDDLES, GAP_PERIODS * period))
        off = MIDDLES[:first] - period
        total = (squares[:first] + 2.0 * off * apart[:first] + off**2 * number[:first]).sum()
        return period, float(np.sqrt(max(total, 0.0) / number[:first].sum())), int(number[first:].sum())

    def report(self):
        """Return numbers of all states: dict with those of joints in `joints`; times [s], stamps [ns]."""
        joints = {name: self._of_joint(j) for j, name in enumerate(self._joints)}
        period, jitter, gaps = self._regularity()
        return {
            "rate": None if period is None else 1.0 / period,
            "jitter": jitter,
            "gaps": gaps,
            "longest_gap": float(self._longest[0]),
            "longest_gap_at": self._longest[1],
            "repeated_states": self._same_state,
            "repeated_stamps": self._same_stamp,
            "without_effort": self._without_effort,
            "estimated_velocity": self._estimated,
            "velocity_delay": _delay(joints.values()),
            "wrong_unit": self._wrong_unit(),
            "joints": joints,
        }

    def _of_joint(self, j):
        travel, change, apart, together = self._sums[:, j]
        left = apart - (together * together / change if change > 0.0 else 0.0)
        largest = {name: values[:, j] for name, values in self._largest.items()}
        often = max(CLIPPED_STATES, CLIPPED_SHARE * self._count)
        return {
            "velocity_error": float(np.sqrt(apart / travel)) if travel > 0.0 else None,
            "velocity_delay": float(together / change) if change > 0.0 else None,
            "velocity_error_without_delay": float(np.sqrt(max(left, 0.0) / travel)) if travel > 0.0 else None,
            "still": int(self._still[j]),
            **{f"largest_{name}": float(value) for name, (value, _) in largest.items()},
            "clipped": [name for name, (value, number) in largest.items() if value > 0.0 and number >= often],
            "steps": self._steps(j),
        }

    def _first_states(self):
        return [np.concatenate(column) for column in zip(*self._sample, strict=True)]

    def _steps(self, j):
        """Return the smallest step of each signal that has steps, by quantity."""
        found = {}
        for name, values in zip(("position", "velocity", "effort"), self._first_states()[1:], strict=True):
            values = values[np.isfinite(values[:, j]), j]
            levels = np.unique(values)
            if 2 < len(levels) <= MAX_LEVELS * len(values):
                found[name] = float(np.diff(levels).min())
        return found

    def _ratios(self):
        """Return the ratio of Δq to q̇dt of each joint; NaN if they do not correlate."""
        stamps, position, velocity, _ = self._first_states()
        elapsed = np.diff(stamps)[:, None] * 1e-9
        if not (elapsed > 0.0).any():
            return np.full(len(self._joints), np.nan)
        moved, integral = np.diff(position, axis=0), 0.5 * elapsed * (velocity[1:] + velocity[:-1])
        moved[:, self._turns] = _wrapped(moved[:, self._turns])
        regular = (elapsed > 0.0) & (elapsed < 2.0 * np.median(elapsed[elapsed > 0.0]))
        moved, integral = moved * regular, integral * regular
        travel, change, together = (moved**2).sum(0), (integral**2).sum(0), (moved * integral).sum(0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(together**2 > CORRELATION * travel * change, together / change, np.nan)

    def _wrong_ratios(self):
        """Return names and ratios of joints whose positions and velocities disagree, by cause."""
        found = {}
        for name, ratio in zip(self._joints, self._ratios(), strict=True):
            if np.isfinite(ratio) and not 1.0 / RATIO_ERROR < ratio < RATIO_ERROR:
                found.setdefault(_cause(ratio), []).append((name, ratio))
        return found

    def _wrong_unit(self):
        """Return `cause` and `factor` of a wrong unit on which all joints in motion agree, or None."""
        causes = self._wrong_ratios()
        if len(causes) != 1:
            return None
        ((cause, found),) = causes.items()
        ratios = np.array([ratio for _, ratio in found])
        if len(found) < np.isfinite(self._ratios()).sum():
            return None
        unlike = ratios.max() > RATIO_ERROR * ratios.min() or 1.0 / WRONG_RATIO < ratios[0] < WRONG_RATIO
        if cause == UNKNOWN and unlike:
            return None
        return {"cause": cause.partition(" (")[0], "factor": float(np.median(ratios))}

    def warnings(self):
        """Return warnings, a sentence each."""
        warnings, report = [], self.report()
        rate, windows = report["rate"], max(self.duration / WINDOW, 1.0)
        at_rest = (
            np.sqrt(self._sums[0] / windows) < REST
        )  # noise of positions is not the integral of that of velocities
        for cause, found in self._wrong_ratios().items():
            which = "all joints" if len(found) == len(self._joints) else ", ".join(name for name, _ in found)
            factor = four_digits(found[0][1])
            warnings.append(f"{which}: positions change {factor} times as fast as velocities say: {cause}")
        if rate is not None and rate * MAX_INTERVAL < 1.0:
            warnings.append(
                f"states are {1.0 / rate:.3g} s apart: over more than {MAX_INTERVAL:g} s nothing is integrated, "
                "so that there is neither a balance of power nor an external torque"
            )
        for rests, (name, of) in zip(at_rest, report["joints"].items(), strict=True):
            warnings += _warnings_of_joint(name, of, rests)
        delay = report["velocity_delay"]
        if delay is not None and abs(delay) * rate > MIN_PERIODS:
            when = "late: filtered, perhaps" if delay > 0.0 else "early"
            warnings.append(f"velocities come {abs(delay) * 1e3:.2g} ms {when}, against positions")
        if report["gaps"]:
            warnings.append(f"{report['gaps']} gaps, the longest of {report['longest_gap']:.3g} s")
        if self._same_stamp > MANY * self._count:
            warnings.append(
                f"{self._same_stamp} of {self._count} states have the time of the one before: several messages "
                "have one time, as those of an arm and its gripper, or times need more digits"
            )
        if self._same_state > MANY * self._count:
            warnings.append(f"{self._same_state} of {self._count} states repeat the one before")
        return warnings


def _warnings_of_joint(name, of, at_rest):
    error, delay, left = (of[key] for key in ("velocity_error", "velocity_delay", "velocity_error_without_delay"))
    warnings = [f"joint '{name}': {what} often is just {of[f'largest_{what}']:.6g}: clipped" for what in of["clipped"]]
    if error is None or error <= MAX_VELOCITY_ERROR or at_rest:
        return warnings
    late = ""
    if delay is not None and left < 0.7 * error:
        late = f"; they are {'late' if delay > 0.0 else 'early'} by {abs(delay) * 1e3:.3g} ms"
    return [f"joint '{name}': velocities are not the slope of positions ({error:.0%} apart{late})", *warnings]


def _wrapped(angles):
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def _cause(ratio):
    """Return the cause of a ratio of Δq to q̇dt."""
    apart = {cause: abs(np.log(ratio / one)) for one, cause in RATIOS.items() if ratio / one > 0.0}
    cause = min(apart, key=apart.get)
    return cause if apart[cause] < np.log(RATIO_ERROR) else UNKNOWN


def four_digits(value):
    """Return a number with four digits, without an exponent where it has five places."""
    return f"{float(f'{value:.4g}'):g}"


def _delay(joints):
    """Return the median delay of joints that show one; None if less than half of those in motion do."""
    moving = [one for one in joints if one["velocity_error"] is not None]
    delays = [
        one["velocity_delay"]
        for one in moving
        if one["velocity_delay"] is not None
        and one["velocity_error_without_delay"] < MAX_ERROR_LEFT * one["velocity_error"]
    ]
    return float(np.median(delays)) if delays and 2 * len(delays) >= len(moving) else None
