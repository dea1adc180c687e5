# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of recorded data: efforts that nothing measured, and hypotheses about efforts.

Smoothed efforts are compared with columns: torques of gravity, of inertia and of point masses at
the robot's ends. What friction, an offset and a rotor explain is removed from all of them first. A
hypothesis is a sum of columns. It is judged by the fraction of the squared efforts that it leaves,
and by what an unknown payload would leave.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model import RobotModel
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.optional import require
from diag_dynamics.recordings.balance import MAX_GAP
from diag_dynamics.recordings.states import States
from diag_dynamics.recordings.velocities import interpolated, turning_dofs
from diag_dynamics.recordings.windows import column_maxima

ZERO, CONSTANT, TRAVEL, MIN_STATES = 1e-12, 1e-9, 0.01, 1000
"""Effort up to which it is 0 [N m, N], range of a constant one over its largest value, travel that
needs torque [rad, m], and fewest states after which a constant effort is unknown."""

UNSCALED = "in an unknown unit"
MISSING = "missing or implausible"
PUSHED = 0.05  # travel of a robot that stands and is pushed [rad, m]

MAX_STATES, MOVING, MIN_RUN = 20_000, 0.01, 20
"""First states in motion that are compared, velocity of any joint in motion [rad/s, m/s], fewest
states of a run."""

CUTOFF, MAX_CUTOFF, ORDER, MEMORY = 5.0, 0.9, 4, 3.0
"""Low-pass: cutoff frequency [Hz], its largest value over half of the rate, order, and length of
its response [s]."""

GRAVITY, INERTIAL, DAMPING, FRICTION, OFFSET, ROTOR, COLUMNS = range(7)
"""Columns of torque: of gravity, of inertia, and of what resists: rate, its sign, a constant, and
the acceleration. Point masses and efforts follow them."""

BLOCK, MAX_BLOCKS, MIN_BLOCKS = 0.5, 32, 4
"""Length of a block [s], which doubles beyond so many blocks, and fewest blocks for a standard
error."""

ERRORS, SMALL_ERRORS = 4.0, 8.0
"""Standard errors on both sides of a factor that contain the true one, and below the limits of a
light joint."""

MODEL_ERROR = 0.1  # torque that a model may miss at any joint over the largest one of its kind
LIMITS, WIDE_LIMITS, GEARED_LIMITS = (0.6, 1.6), (0.2, 5.0), (0.2, 100.0)
"""Accepted factors: of gravity and of all joints; of inertia; and of inertia with an unknown
rotor."""

MAX_LEFT, ALIKE, SLIGHT, NEGLIGIBLE = 0.4, 2.0, 5e-3, 3e-4
"""Ratio to what the model leaves, and to what a payload or another hypothesis leaves, up to which
one is accepted; and fractions of what the model leaves, and of the efforts' squares, that make no
difference."""

MAX_UNLOADED = 0.02  # fraction of the efforts' squares that a payload may leave
CENTRES = 0.1 * np.eye(4, 3)  # of point masses in axes of the links at the robot's ends [m]
MAX_ENDS = 3
OTHER_SIGN = -1.6, -0.4  # factors of an effort of the other sign
LIGHT, VERY_LIGHT = 0.5, 0.2
"""Torque of a joint over that of a joint with a right effort, below which a small factor, or a
large one and one of the other sign, may be the model's fault."""

EXCHANGE = 4.0  # factor by which an exchange of two joints reduces the square that is left
SINGULAR = 1e-9  # fraction of a column's square below which it depends on others

SIGN = (
    "efforts of all joints seem to have the opposite sign (effort_scale: '*=-1'), or gravity "
    "points the other way, as for a robot on a ceiling (parameter gravity)"
)


class EffortRange:
    """Find efforts that are unknown: 0, constant or missing throughout, or in an unknown unit.

    The effort_scale of a model is NaN for a joint in an unknown unit. `states` is their number. The
    six coordinates of a floating base, which no drive moves, count as measured.
    """

    def __init__(self, model):
        self._names = model.dof_names
        self.states = 0
        scales = [model.effort_scale.get(name, 1.0) for name in model.dof_names]
        self._unscaled = np.isnan(np.array(scales, float))
        self._driven = np.arange(model.nv) >= (6 if model.floating_base else 0)
        self._low = np.full((2, model.nv), np.inf)
        self._high = -self._low

    def add_values(self, positions, efforts):
        """Add positions and efforts, (T, n) each; NaN for efforts that are missing."""
        self.states += len(efforts)
        for row, values in enumerate((efforts, positions)):
            self._low[row] = np.minimum(self._low[row], -column_maxima(-values))
            self._high[row] = np.maximum(self._high[row], column_maxima(values))

    @property
    def moved(self):
        """Whether any joint has moved farther than a push moves a robot that stands."""
        return bool(np.any(self._high[1] - self._low[1] > PUSHED))

    @property
    def measures(self):
        """Whether the effort of any joint can have been measured."""
        return bool((self._words() == "")[self._driven].any())

    def hide_constant(self, states):
        """Add States.

        Return them without efforts of joints that have moved while their efforts were constant.
        """
        self.add_values(states.position[:, -len(self._names) :], states.effort)
        constant = self._constant()
        is_clear = self.states >= MIN_STATES and constant.any() and self.measures
        return states.without_efforts(constant) if is_clear else states

    def groups(self):
        """Return joints whose efforts are unknown by the word for these."""
        words = self._words()
        names = np.array(self._names)
        return {word: names[words == word].tolist() for word in dict.fromkeys(words) if word}

    def unmeasured(self):
        """Return which efforts are unknown, in words; or an empty text."""
        groups = self.groups()
        if len(groups.get(MISSING, ())) == self._driven.sum():
            return ""
        return "; ".join(describe_unknown(word, names) for word, names in groups.items())

    def _words(self):
        """Return the word for the unknown effort of each joint, empty for a measured one."""
        is_missing = ~np.isfinite(self._low[0])
        is_zero = np.maximum(np.abs(self._low[0]), np.abs(self._high[0])) < ZERO
        conditions = [is_missing & self._unscaled, is_missing, is_zero, self._constant()]
        words = np.select(conditions, [UNSCALED, MISSING, "0", "constant"], "")
        is_judged = self._driven & (self.states > 1)
        return np.where(is_judged, words, "")

    def _constant(self):
        """Return which joints moved while their efforts were constant or missing, bool (n,)."""
        low, lowest = self._low
        high, highest = self._high
        with np.errstate(invalid="ignore"):
            is_constant = high - low <= CONSTANT * np.maximum(np.abs(low), np.abs(high))
            return self._driven & (highest - lowest > TRAVEL) & is_constant


def describe_unknown(word, names):
    """Return the text on joints whose efforts are unknown, by the word for these."""
    entries = ",".join(f"{name}=false" for name in names)
    by = "(effort_scale)" if word == UNSCALED else f"throughout (effort_available: {entries})"
    return f"efforts of {', '.join(names)} are {word} {by}"


def smoothed(t, q, qd, tau):
    """Return q, q̇, τ and q̈ at even times, through a zero-phase Butterworth low-pass."""
    signal = require("scipy.signal", "the judgement of efforts")
    even = np.linspace(t[0], t[-1], len(t))
    step = even[1] - even[0]
    values = interpolated(np.hstack([q, qd, tau]), t, even)
    cutoff = min(2.0 * CUTOFF * step, MAX_CUTOFF)
    padding = int(min(len(t) - 1, np.ceil(MEMORY / step)))
    smooth = signal.sosfiltfilt(
        signal.butter(ORDER, cutoff, output="sos"), values, 0, padlen=padding
    )
    q, qd, tau = np.split(smooth, [q.shape[1], q.shape[1] + qd.shape[1]], axis=1)
    return tuple(map(np.ascontiguousarray, (q, qd, tau, np.gradient(qd, step, axis=0))))


def remaining(products, signals, rest):
    """Return products (…, m, m) of columns without the parts that others explain.

    Kept columns are rows of (k, m), the others rows of (r, m).
    """
    inner = rest @ products @ rest.T
    across = rest @ products @ signals.T
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(inner, axis1=-2, axis2=-1), 1e-300))[..., None]
    inverse = np.linalg.pinv(
        inner * scale * np.swapaxes(scale, -1, -2), rcond=SINGULAR, hermitian=True
    )
    across *= scale
    whole = signals @ products @ signals.T
    left = whole - np.swapaxes(across, -1, -2) @ inverse @ across
    squares, before = (np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (left, whole))
    is_left = squares > SINGULAR * before
    return left * is_left[..., None] * is_left[..., None, :]


def _regress(products, column, rest):
    """Return squares of a column without what the rest explains, and slopes of efforts over it.

    The squares are 0 if the column depends on the rest.
    """
    efforts = np.eye(len(column))[-products.shape[-3] :]
    left = remaining(products, np.vstack([column, efforts]), rest)
    square = np.where(
        left[..., 0, 0] > SINGULAR * (products @ column @ column), left[..., 0, 0], 0.0
    )
    with np.errstate(all="ignore"):
        return square, np.diagonal(left[..., 0, 1:], axis1=-2, axis2=-1) / np.where(
            square, square, np.nan
        )


def largest_of_kind(model, values):
    """Return for each joint the largest value of a joint of its kind, rotary or prismatic.

    The shape is (nv,).
    """
    slides = np.array(sliding_dofs(model))
    return np.array([values[slides == is_sliding].max(initial=0.0) for is_sliding in slides])


def jackknife(values):
    """Return variances of numbers, given them without each block in turn, (blocks, n)."""
    count = len(values)
    return (count - 1) / count * ((values - values.mean(axis=0)) ** 2).sum(axis=0)


def _standard_errors(values):
    """Return standard errors of numbers without each block in turn; inf if they are unknown."""
    if len(values) < MIN_BLOCKS:
        return np.full(values.shape[1], np.inf)
    return np.sqrt(np.nan_to_num(jackknife(values), nan=np.inf, posinf=np.inf))


class Relation(NamedTuple):
    """Factors from the model's torque to the measured effort, by joint.

    The shape of each is (nv,), but for the first three.
    """

    model: RobotModel
    hypotheses: Hypotheses
    weight: Hypotheses  # without offsets, which would hide the weight of a robot that hardly moves
    factor: np.ndarray  # slope over the torque of the base; NaN if the motion does not show it
    error: np.ndarray  # its standard error, by blocks of time left out
    model_error: np.ndarray  # error of the factor due to the model
    heavy: np.ndarray  # whether most of the torque is gravity, bool
    geared: np.ndarray  # whether the factor contains that of an unknown rotor, bool
    torque: np.ndarray  # standard deviation of the torque without friction and offset [N m, N]

    def limits(self):
        """Return the smallest and the largest accepted factor, shape (2, nv)."""
        limits = np.where(self.heavy[:, None], LIMITS, WIDE_LIMITS)
        return np.where(self.geared[:, None], GEARED_LIMITS, limits).T

    def judged(self):
        """Return which joints have a factor that tells 1 from 0, bool."""
        return ERRORS * self.error < 1.0

    def wrong(self):
        """Return which joints have a factor beyond limits and errors, bool.

        A factor that is 0 by its error has to be 1.
        """
        low, high = self.limits()
        spread = ERRORS * self.error
        margin = spread + self.model_error
        low = np.where(self.judged() & (np.abs(self.factor) <= spread), 1.0, low)
        return (self.factor + margin < low) | (self.factor - margin > high)

    def doubtful(self):
        """Return which joints have a factor below 0 or far from 1, bool.

        The error of the model does not count here.
        """
        low, high = np.where(self.geared[:, None], GEARED_LIMITS, WIDE_LIMITS).T
        spread = ERRORS * self.error
        small = self.factor + SMALL_ERRORS * self.error < low
        return small | (self.factor + spread < 0.0) | (self.factor - spread > high)


def end_links(model):
    """Return names of the last links of the robot's chains, at most MAX_ENDS."""
    ends = np.setdiff1d(np.arange(1, len(model.bodies)), model.bodies["parent"])[-MAX_ENDS:]
    return [model.link_names[link] for link in model.bodies["link"][ends]]


class EffortRelation:
    """Compare efforts with torques of a model.

    It has a fixed base and joints of one degree of freedom. Point masses at links, such as the ends
    of the robot, are compared, too.
    """

    def __init__(self, model, links=()):
        self._model = model
        self._dynamics = DiagonalDynamics(model)
        self._links = links
        self._bare = DiagonalDynamics(functools.reduce(RobotModel.without_payload, links, model))
        self._loaded = [
            DiagonalDynamics(self._bare.model.with_payload(link, 1.0, centre))
            for link in links
            for centre in CENTRES
        ]
        self._turning = turning_dofs(model)
        size = COLUMNS + len(self._loaded) + model.nv
        self._rows = 0
        self._length = BLOCK
        self._blocks = np.zeros((0, model.nv, size, size))
        self._low, self._high = np.full((2, model.nv), [[np.inf], [-np.inf]])

    def columns(self, t, q, qd, tau):
        """Return columns of states, (nv, T, 6 and more), and smoothed efforts, (T, nv).

        States are without gaps, columns and efforts at even times.
        """
        q, qd, tau, qdd = smoothed(t, np.where(self._turning, np.unwrap(q, axis=0), q), qd, tau)
        self._low = np.minimum(self._low, q.min(axis=0))
        self._high = np.maximum(self._high, q.max(axis=0))
        pull = self._dynamics.gravity_torque(q)
        inertial = self._dynamics.inverse_dynamics(q, qd, qdd) - pull
        turned = np.tanh(qd / max(self._model.friction_velocity, 1e-9))
        unloaded = self._bare.inverse_dynamics(q, qd, qdd) if self._loaded else 0.0
        loads = [dynamics.inverse_dynamics(q, qd, qdd) - unloaded for dynamics in self._loaded]
        resistance = qd, turned, np.ones_like(qd), qdd
        columns = np.stack([pull, inertial, *resistance, *loads], axis=-1)
        return columns.transpose(1, 0, 2), tau

    def add_run(self, t, q, qd, tau):
        """Add states without gaps: times [s], positions, rates, and efforts [N m, N].

        Positions are in rad and m, rates in rad/s and m/s.
        """
        if len(t) < 2:
            return
        number = ((t - t[0]) // self._length).astype(int)
        columns, tau = self.columns(t, q, qd, tau)
        columns = np.concatenate(
            [columns, np.broadcast_to(tau, (self._model.nv, *tau.shape))], axis=-1
        )
        parts = np.split(columns, np.flatnonzero(np.diff(number)) + 1, axis=1)
        self._blocks = np.concatenate(
            [self._blocks, [part.transpose(0, 2, 1) @ part for part in parts]]
        )
        self._rows += len(tau)
        while len(self._blocks) > MAX_BLOCKS:
            self._blocks = np.add.reduceat(self._blocks, np.arange(0, len(self._blocks), 2))
            self._length *= 2.0

    def fit(self):
        """Return the :class:`Relation`.

        A joint that stands has no factor, because stiction may carry any torque.
        """
        model = self._model
        count = max(self._rows, 1)
        whole = self._blocks.sum(axis=0)
        columns = np.eye(self._blocks.shape[-1])
        samples = np.concatenate([whole[None], whole - self._blocks])
        pull = columns[GRAVITY]
        inertia = columns[INERTIAL]
        plain = pull + inertia
        rest = columns[DAMPING:COLUMNS]
        offset = columns[[OFFSET]]
        signals = np.delete(columns, np.arange(DAMPING, COLUMNS), axis=0)
        moved = self._high - self._low > PUSHED
        resistances = rest, np.delete(rest, OFFSET - DAMPING, axis=0)
        squares = [_regress(whole, plain, resistance)[0] / count for resistance in resistances]
        hypotheses = [
            Hypotheses(
                model,
                self._links,
                remaining(samples, signals, resistance) / count,
                np.where(moved, square, 0.0),
            )
            for resistance, square in zip(resistances, squares, strict=True)
        ]
        base = hypotheses[0].base @ signals[: -model.nv]
        factors = _regress(samples, base, rest)[1]
        inertial = _regress(samples, inertia, np.vstack([pull, rest[:-1]]))[1]
        geared = moved & ~np.isfinite(factors[0]) & np.isfinite(inertial[0])
        factors = np.where(moved, np.where(geared, inertial, factors), np.nan)
        with_rotor = _regress(whole, plain, rest[:-1])[0] / count
        torque = np.sqrt(np.where(moved, np.where(geared, with_rotor, squares[0]), 0.0))
        static = np.sqrt(whole @ plain @ plain / count)
        with np.errstate(all="ignore"):
            missing = MODEL_ERROR * largest_of_kind(model, np.where(moved, torque, static))
            model_error = np.where(torque > 0.0, missing / torque, np.inf)
        return Relation(
            model,
            *hypotheses,
            factors[0],
            _standard_errors(factors[1:]),
            model_error,
            _regress(whole, pull, offset)[0] > _regress(whole, inertia, offset)[0],
            geared,
            torque,
        )


class Hypotheses:
    """Fractions of the squared efforts of all joints that sums of columns leave.

    Squared torques are given by joint. Products are those of columns without what resists, of all
    states and without each block of time, (S, nv, m, m). `base` is the sum of the model; with the
    payload at `links` that leaves least, if that is possible and leaves little.
    """

    def __init__(self, model, links, products, square):
        self._model = model
        self._links = links
        self._joints = np.arange(model.nv)
        count = -model.nv
        self._tiny = np.maximum(MODEL_ERROR**2 * largest_of_kind(model, square), 1e-300)
        self._weight = np.where(square > 0.0, 1.0 / (square + self._tiny), 0.0)
        self._is_alone = np.count_nonzero(self._weight) < min(2, model.nv)
        self._inner = products[..., :count, :count]
        self._across = products[..., :count, count:]
        self._own = self._across[0, self._joints, :, self._joints]
        self._efforts = np.diagonal(products[..., count:, count:], axis1=-2, axis2=-1)
        self._whole = np.maximum(
            self._efforts[:, self._joints, self._joints] @ self._weight, 1e-300
        )
        columns = np.eye(products.shape[-1])
        free = remaining(products, columns[count:], columns[:count])
        self._noise = self._share(free[:, self._joints, self._joints, self._joints])
        self.plain = 1.0 * (np.arange(len(self._own[0])) <= INERTIAL)
        self._misfit = self._left(self.plain)
        self.base, self._spread = self._with_best_payload()
        reach = np.linalg.norm(model.bodies["translation"], axis=1).sum()
        masses = self.base[INERTIAL + 1 :].reshape(-1, len(CENTRES))
        moment = np.linalg.norm(masses @ CENTRES, axis=1).sum()
        is_possible = np.abs(masses.sum(axis=1)).sum() <= model.total_mass
        is_possible &= moment <= model.total_mass * reach
        if not is_possible or self._left(self.base)[0] > MAX_UNLOADED:
            self.base = self.plain
        self._loaded = self._left(self.base)
        self._slight = SLIGHT * min(1.0, self._misfit[0])

    def _share(self, squares):
        """Return fractions of the squared efforts.

        Squares are given of all states and without each block, (S, nv).
        """
        return squares @ self._weight / self._whole

    def _with_best_payload(self):
        """Return the plain sum with the best multiples of point masses, and how these spread.

        The spread is twice the inverse of the second derivatives of what is left.
        """
        places = np.arange(INERTIAL + 1, len(self.plain))
        inner = np.einsum("k,kij->ij", self._weight, self._inner[0])
        missing = self._weight @ (self._own - self._inner[0] @ self.plain)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(inner)[places], 1e-200))
        matrix = inner[np.ix_(places, places)] * scale[:, None] * scale
        inverse = np.linalg.pinv(matrix, 1e-6, hermitian=True)
        columns = self.plain.copy()
        columns[places] += scale * (inverse @ (scale * missing[places]))
        spread = np.linalg.inv(matrix + SINGULAR * np.eye(len(matrix))) * scale[:, None] * scale
        return columns, spread * self._whole[0]

    def _squares(self, columns):
        """Return squares of efforts (columns) less torques of joints (rows), (S, nv, nv)."""
        torque = (self._inner @ columns @ columns)[..., None]
        return np.maximum(self._efforts - 2.0 * (columns @ self._across) + torque, 0.0)

    def _left(self, columns, order=None):
        """Return the fraction that a sum leaves beyond that of freely scaled columns, (S,).

        Each joint has factors of its own for all columns.
        """
        squares = self._squares(columns)[:, self._joints, self._joints if order is None else order]
        return np.maximum(self._share(squares) - self._noise, 0.0)

    def _is_below(self, left, limit):
        """Return whether a fraction is below a limit by the error of their ratio."""
        ratio = (left + NEGLIGIBLE) / np.maximum(limit, 1e-12)
        return bool(ratio[0] + ERRORS * _standard_errors(ratio[1:, None])[0] < 1.0)

    def best(self, *hypotheses):
        """Return the text of the hypothesis that leaves least.

        The text is empty if fewer than two joints move, or the model or a payload leaves as little.
        """
        if self._is_alone:
            return ""
        accepted = [
            (left[0], text)
            for left, text in filter(None, hypotheses)
            if self._is_below(left, MAX_LEFT * self._misfit)
            and left[0] <= ALIKE * (self._loaded[0] + self._slight)
        ]
        least = min((left for left, _ in accepted), default=0.0)
        texts = (text for left, text in accepted if left <= ALIKE * (least + self._slight))
        return next(texts, "")

    def fault(self):
        """Return the text of the best of all hypotheses; empty if none is."""
        return self.best(self.without_gravity(), self.scale(), self.order(), self.nothing())

    def nothing(self):
        """Explain the efforts by friction and noise alone."""
        return self._left(0.0 * self.plain), (
            "no effort follows the motion. Check that efforts are measured, and at these joints"
        )

    def payload(self):
        """Return the mass that the model lacks or has too much, in words.

        The text is empty if fewer than two joints move, none fits, or no mass leaves as little.
        """
        is_below = self._is_below(self._loaded, MAX_LEFT * self._misfit)
        if self._is_alone or self._misfit[0] < SLIGHT or not is_below:
            return ""
        masses = self.base[INERTIAL + 1 :].reshape(-1, len(CENTRES)).sum(axis=1)
        k = int(np.argmax(np.abs(masses)))
        places = slice(k * len(CENTRES), (k + 1) * len(CENTRES))
        spread = self._spread[places, places].sum()
        left = self._loaded[0]
        error = np.sqrt(spread * (ALIKE * (left + self._slight) - left))
        mass = abs(masses[k])
        link = self._links[k]
        if error > mass:
            return ""
        carries, lacks = ("robot", "model") if masses[k] > 0.0 else ("model", "robot")
        return (
            f"the {carries} seems to have about {mass:.2g} ± {error:.1g} kg at {link} that the "
            f"{lacks} lacks, or heavier links "
            f"(diag-dynamics identify --what friction,payload:{link})"
        )

    def scale(self):
        """Explain the efforts by one factor of all of them."""
        square = self._weight @ (self._inner[0] @ self.plain @ self.plain)
        factor = float(self._weight @ self._own @ self.plain / max(square, 1e-300))
        if factor == 0.0 or LIMITS[0] < factor < LIMITS[1]:
            return None
        left = self._left(factor * self.plain)
        nothing = self.nothing()[0]
        if not self._is_below(left, MAX_LEFT * nothing):
            return None
        sign = " and the opposite sign" if factor < 0.0 else ""
        payload = self.payload()
        if LIMITS[0] < -factor < LIMITS[1]:
            return left, SIGN
        return left, (
            f"efforts of all joints seem to have another unit{sign}: they are {factor:.3g} times "
            f"the model torque (effort_scale: '*={1.0 / factor:.3g}', or by joint from "
            f"diag-dynamics identify --what gains,friction){', or ' * bool(payload)}{payload}"
        )

    def without_gravity(self):
        """Explain the efforts by inertia alone."""
        left = self._left(np.where(np.arange(len(self.plain)) == INERTIAL, 1.0, 0.0))
        text = "gravity seems to be missing in the efforts (effort_includes_gravity: '*=false')"
        is_followed = left[0] + self._noise[0] < 1.0 - MAX_LEFT
        return left, text if is_followed else f"{text}, or efforts do not follow the motion"

    def order(self):
        """Explain the efforts by another order.

        An exchange of two joints has to reduce the rest by EXCHANGE.
        """
        squares = self._squares(self.plain)[0] + self._tiny[:, None]
        cost = np.log(np.maximum(squares * self._weight[:, None], 1e-300))
        apart = ~np.eye(len(cost), dtype=bool)
        cost[apart] += 0.5 * np.log(EXCHANGE)
        still = self._weight == 0.0
        cost[apart & (still | still[:, None])] = 1e3
        order = require("scipy.optimize", "the judgement of efforts").linear_sum_assignment(cost)[1]
        moved = np.flatnonzero(order != self._joints)
        if not len(moved):
            return None
        names = np.array(self._model.dof_names)
        joints = ", ".join(names[moved])
        columns = ", ".join(names[order[moved]])
        return self._left(self.plain, order), (
            f"efforts seem to be exchanged: those of {joints} are in the columns of {columns} "
            "(order of the joints)"
        )


class MotionSample:
    """Keep the first states with efforts in motion of a model, and judge their efforts."""

    def __init__(self, model):
        self._model = model
        self._parts = [States.empty(model.nq, model.nv)]
        self._remaining = (
            0 if model.floating_base or model.nq != model.nv or not model.nv else MAX_STATES
        )

    def add_states(self, states):
        """Add states."""
        if self._remaining:
            moving = states.effort_known & (np.abs(states.velocity) > MOVING).any(axis=1)
            rows = np.flatnonzero(moving & np.isfinite(states.effort).all(axis=1))[
                : self._remaining
            ]
            self._parts.append(states[rows])
            self._remaining -= len(rows)

    def fault(self):
        """Return the :class:`Fault` of efforts.

        Return None if nothing is wrong, or nothing can be said.
        """
        compared = EffortRelation(self._model, end_links(self._model))
        states = States.concatenate(self._parts)
        steps = np.diff(states.stamp)
        bounds = np.flatnonzero((steps < 0) | (steps > MAX_GAP * SECOND) | states.jumped[1:]) + 1
        is_later = np.append(True, steps > 0)
        is_later[bounds] = True
        for rows in np.split(np.arange(len(states)), bounds):
            run = states[rows[is_later[rows]]]
            if len(run) >= MIN_RUN:
                compared.add_run(
                    (run.stamp - run.stamp[0]) / SECOND, run.position, run.velocity, run.effort
                )
        relation = compared.fit()
        payload = relation.hypotheses.payload()
        return find_fault(relation) or (Fault(payload, light=True) if payload else None)


class Fault(NamedTuple):
    """What would explain the efforts, in words."""

    text: str
    light: bool = (
        False  # whether it is of light joints alone, of which the model may miss something
    )


def find_fault(relation: Relation) -> Fault | None:
    """Return the fault of efforts; None if nothing is wrong."""
    if text := relation.hypotheses.fault():
        return Fault(text)
    torque = relation.torque
    factor = relation.factor
    wrong = relation.wrong()
    right = relation.judged() & ~wrong
    turned = (
        (factor >= OTHER_SIGN[0])
        & (factor <= OTHER_SIGN[1])
        & (np.abs(factor) > ERRORS * relation.error)
    )
    small = ~turned & (factor < relation.limits()[0])
    largest = largest_of_kind(relation.model, np.where(right, torque, 0.0))
    heavy = wrong & (torque >= np.where(small, LIGHT, VERY_LIGHT) * largest)
    if heavy.any():
        named = (
            heavy & turned if np.any(heavy & turned) else heavy & (torque == torque[heavy].max())
        )
        return Fault(_describe_joints(relation, named))
    if text := relation.weight.best(relation.weight.without_gravity()):
        return Fault(text)
    doubtful = wrong | relation.doubtful()
    text = f"{_describe_joints(relation, doubtful)}; or the model lacks the load of a light joint"
    return Fault(text, light=True) if doubtful.any() else None


def _describe_joints(relation, chosen):
    """Return the faults of the efforts of `chosen` joints, a mask; equal advice stands once."""
    texts = {}
    for k in np.flatnonzero(chosen):
        text, advice = _describe_joint(relation, k)
        texts.setdefault(advice, []).append(text)
    return "; ".join("; ".join(joints) + advice for advice, joints in texts.items())


def _describe_joint(relation, k):
    """Return the fault of the effort of joint number k, and what to do about it."""
    name = relation.model.dof_names[k]
    factor = relation.factor[k]
    error = ERRORS * relation.error[k]
    low, high = relation.limits()[:, k]
    begin = f"the effort of joint '{name}'"
    text = f"{factor:.3g} ± {error:.2g} times the model torque"
    if abs(factor) <= error:
        text = f"{begin} does not follow the motion: it is {text}"
        return text, ". Check that it is measured at its joint"
    if OTHER_SIGN[0] <= factor <= OTHER_SIGN[1]:
        return f"{begin} has the opposite sign: it is {text} (effort_scale: '{name}=-1')", ""
    return f"{begin} is {text}; expected {low:g} to {high:g}", (
        ". Check unit (N m, N), side of the gear and order of the joints "
        "(effort_scale). For raw units of drives use diag-dynamics identify --what gains,friction"
    )
