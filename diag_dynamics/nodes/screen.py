# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots of `top` and their frames: what the keys choose, as lines for a terminal of any size."""

import math
from collections import deque, namedtuple

import numpy as np
from lxml import etree
from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style

from diag_dynamics.text import duration, number, plain

SLOT, SLOTS, MAX_HOLD = 0.05, 1200, 5
"""Length [s] and number of slots, which store the largest values of their time, and of how many one state fills."""

Quantity = namedtuple("Quantity", "name symbol unit limit", defaults=("",))
QUANTITIES = (
    Quantity("energy", "½ν²", "J"),
    Quantity("torque", "τ", "N m", "limit"),
    Quantity("external torque", "m r", "N m", "threshold"),
    Quantity("velocity", "q̇", "rad/s", "limit"),
    Quantity("exchange", "νC", "W"),
    Quantity("inertia", "D", "kg m²"),
)
ENERGY, TORQUE, EXTERNAL, VELOCITY, EXCHANGE, INERTIA = range(len(QUANTITIES))

UNKNOWN = (math.nan, math.inf)
"""A norm and its threshold without a result of the observer."""


class Robot:
    """States, external torques and limits of one robot.

    Arrays have the shape (quantities, nv); `values` and `energies` have one for each slot, the newest last.
    """

    def __init__(self, title, topic):
        self.title, self.topic, self.names, self.rejected, self.alarm = title, topic, [], 0, ""
        self.latency = self.power = math.nan
        self.torque = self.residual = UNKNOWN
        self._received, self._external, self._thresholds, self._urdf = (
            deque(maxlen=5000),
            [],
            [],
            {},
        )

    @property
    def energy(self):
        """Kinetic energy [J]."""
        return float(self.last[ENERGY].sum())

    def rate(self, now):
        """Return the number of states of the last second."""
        while len(self._received) > 1 and self._received[0] <= now - 1.0:
            self._received.popleft()  # the last one is the begin of a silence
        return len(self._received) if self.silence(now) < 1.0 else 0

    def silence(self, now):
        """Return the time since the last state [s]."""
        return now - self._received[-1] if self._received else 0.0

    def reset_peaks(self):
        """Reset the largest magnitudes of all states."""
        if self.names:
            self.peak, self.energy_peak = np.zeros_like(self.last), 0.0

    def accept_state(self, message, now, steady):
        """Store a state, received at a time of the node's clock [ns] and of the steady clock [s]."""
        if self.names != list(message.dof_names):
            self.names, self._slot = list(message.dof_names), None
            self.last = np.full((len(QUANTITIES), len(self.names)), math.nan)
            self.values = np.full((SLOTS, *self.last.shape), math.nan, dtype=np.float32)
            self.energies = np.full(SLOTS, math.nan)
            self.reset_peaks()
            self._set_limits()
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        self._store(1e-9 * stamp, self._quantities(message))
        self.latency = 1e-9 * (now - stamp)
        self.power = message.power if message.effort_valid else math.nan
        self._received.append(steady)

    def accept_external_torque(self, message, *_):
        """Store a result of the observer."""
        self._external, self.alarm = np.array(message.external_torque), ""
        self.torque = self.residual = UNKNOWN
        if message.valid:
            self.torque = message.torque_norm, _limit(message.torque_norm_threshold)
            self.residual = message.norm, _limit(message.threshold)
            self._thresholds = [_limit(threshold) for threshold in message.torque_threshold]
            self._set_limits()
            joints = zip(message.dof_names, message.joint_collision, strict=False)
            above = ", ".join(name for name, collision in joints if collision)
            self.alarm = (
                f"collision: {above}" if above else "collision" if message.collision else ""
            )

    def accept_description(self, message, *_):
        """Read the limits of effort and velocity of a URDF."""
        parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
        joints = etree.fromstring(message.data.encode(), parser).iterfind("joint[limit]")
        limits = {joint.get("name"): joint.find("limit") for joint in joints}
        self._urdf = {
            name: [_limit(float(limit.get(key, 0.0))) for key in ("effort", "velocity")]
            for name, limit in limits.items()
        }
        self._set_limits()

    def external_scale(self):
        """Return the external torque at which ‖m r‖ or |r| reaches its threshold; 0 without one."""
        (_, threshold), (norm, norm_threshold) = self.torque, self.residual
        if threshold < math.inf:
            return threshold
        if norm_threshold < math.inf and norm > 0.0:
            return np.nanmax(np.abs(self.last[EXTERNAL]), initial=0.0) * norm_threshold / norm
        return 0.0

    def _set_limits(self):
        self.limits = np.full((len(QUANTITIES), len(self.names)), math.inf)
        for k, name in enumerate(self.names):
            self.limits[[TORQUE, VELOCITY], k] = self._urdf.get(name, math.inf)
        if len(self._thresholds) == len(self.names):
            self.limits[EXTERNAL] = self._thresholds

    def _quantities(self, message):
        values, nu = np.full(self.last.shape, math.nan), np.array(message.nu)
        values[ENERGY], values[EXCHANGE] = 0.5 * nu * nu, nu * np.array(message.coriolis)
        values[VELOCITY], values[INERTIA] = message.velocity, message.articulated_inertia
        if message.effort_valid:
            values[TORQUE] = message.effort
        if len(self._external) == len(self.names):
            values[EXTERNAL] = self._external
        return values

    def _store(self, stamp, values):
        size, energy, slot = np.abs(values), float(values[ENERGY].sum()), math.floor(stamp / SLOT)
        self.peak, self.energy_peak = np.fmax(self.peak, size), max(self.energy_peak, energy)
        count = slot - self._slot if self._slot is not None else SLOTS
        count = min(count, SLOTS) if count >= 0 else SLOTS  # time has jumped back
        for slots, new in ((self.values, size), (self.energies, energy)):
            if count:
                slots[:-count] = slots[count:]
                slots[-count:] = new if count <= MAX_HOLD else math.nan
            slots[-1] = np.fmax(slots[-1], new)
        self._slot, self.last = slot, values


def _limit(value):
    """Return a limit; inf where there is none."""
    return value if 0.0 < value < math.inf else math.inf


# --- Frames

WINDOWS = 5, 10, 30, 60
"""Times that charts show [s]."""

SORTS = "base to tip", "by value", "by peak", "by limit"
KEYS = "q quit", "1-6 values", "s sort", "space pause", "r reset", "+- time", "↑↓ scroll"
KEYS_OF_SEVERAL = (*KEYS[:4], "tab next", "o all", *KEYS[4:])
"""Keys in order of their use: of one robot, and of several; a narrow terminal shows the first ones."""

BLOCKS, LETTERS = np.array(list(" ▁▂▃▄▅▆▇█")), np.array(list(" .:-=+*#@"))

WIDE, MAX_SILENCE, NEAR = 60, 1.0, 0.7
"""Columns of a wide terminal; time without a state that is an error [s]; fraction of a limit that is near."""

LABELS, NUMBERS = 12, 7
"""Columns of the labels of a chart, and of the numbers of a table."""


class View:
    """What the keys have chosen; `reset` and `quit` are requests to the owner of the robots.

    Charts consist of `characters` for 0 to 8 eighths.
    """

    def __init__(self, note="", characters=BLOCKS):
        self.quantity, self.sort, self.window, self.robot, self.scroll = 0, 0, 1, 0, 0
        self.paused = self.reset = self.quit = self.overview = False
        self._note, self._characters = note, characters

    def press(self, key):
        """Apply a key: a character, or up, down, left, right."""
        if key in "123456":
            self.quantity = int(key) - 1
        elif key in ("left", "right"):
            self.quantity = (self.quantity + (1 if key == "right" else -1)) % len(QUANTITIES)
        elif key in ("up", "down"):
            self.scroll = max(0, self.scroll + (1 if key == "down" else -1))
        elif key in "+=-":
            self.window = min(max(self.window + (-1 if key == "-" else 1), 0), len(WINDOWS) - 1)
        elif key == "s":
            self.sort = (self.sort + 1) % len(SORTS)
        elif key == "\t":
            self.robot += 1
        elif key == " ":
            self.paused = not self.paused
        elif key == "o":
            self.overview = not self.overview
        self.reset, self.quit = key == "r", self.quit or key == "q"

    def draw(self, robots, now, width, height):
        """Return the frame of at least one robot, at a steady time [s]: `height` lines of segments, `width` cells each."""
        robot = robots[self.robot % len(robots)]
        lines = [self._title(robots, robot, now, width)]
        if self.overview:
            lines += self._overview(robots, now, width)
        elif robot.names:
            lines += self._robot(robot, width, height - 2)
        else:
            lines.append([(f"waiting for states on {plain(robot.topic)}", "dim")])
        lines = (lines + [[]] * height)[: height - 1]
        return [_fit(line, width) for line in [*lines, _keys(len(robots), width)]]

    def _title(self, robots, robot, now, width):
        silence, style = robot.silence(now), "reverse"
        title, status = f" {plain(robot.title)}", f" {robot.rate(now)} Hz" if robot.names else ""
        if self.overview:
            title, status, silence = f" {len(robots)} robot{'s' * (len(robots) > 1)}", "", 0.0
        elif len(robots) > 1:
            title += f" {self.robot % len(robots) + 1}/{len(robots)}"
        if silence > MAX_SILENCE:
            status, style = f" no state for {duration(silence)}", "reverse bold red"
        elif status and width >= WIDE:
            status += f"  {duration(robot.latency)} late"
        text = f"{title}{status}{' PAUSED' if self.paused else ''}"
        space = width - cell_len(text) - cell_len(self._note) - 1
        return [(f"{text}{' ' * space}{self._note}{' ' * width}", style)]

    def _robot(self, robot, width, height):
        """Return lines, chart and table of a robot."""
        wide = width >= WIDE
        energy, peak = f"{number(robot.energy)} J", f"{number(robot.energy_peak)} J"
        power = f"{number(robot.power)} W" if robot.power == robot.power else "unknown: no efforts"
        power = [("   net power ", "dim"), (power, "")] if wide else []
        lines = [[("K ", "dim"), (energy, "bold"), ("  peak ", "dim"), (peak, ""), *power]]
        if robot.torque[0] == robot.torque[0]:
            norms = (
                _norm(robot.torque, "N m", wide),
                ("  r ", "dim"),
                _norm(robot.residual, "√J/s", wide),
            )
            lines.append([("m r ", "dim"), *norms])
        if robot.rejected:
            lines.append([(f"{robot.rejected} invalid messages", "yellow")])
        if robot.alarm:
            lines.append([(f"ALARM {plain(robot.alarm)}", "bold red")])
        rows = height - len(lines) - 1
        tall = min(max(rows - len(robot.names), rows // 4), 20)
        if tall >= 3 and width > LABELS:
            lines += self._chart(robot, width - LABELS - 1, tall)
            rows -= tall
        return [*lines, *self._table(robot, max(rows, 0), width)]

    def _recent(self, slots):
        return slots[-round(WINDOWS[self.window] / SLOT) :]

    def _chart(self, robot, width, height):
        """Return the kinetic energy, or the largest value or fraction of a limit of all joints."""
        quantity, limits = QUANTITIES[self.quantity], robot.limits[self.quantity]
        limited, values = (
            bool(np.isfinite(limits).any()),
            self._recent(robot.values[:, self.quantity]),
        )
        label = f"of {quantity.limit}" if limited else f"{quantity.symbol} {quantity.unit}"
        if self.quantity == ENERGY:
            values, label = self._recent(robot.energies), "K J"
        else:
            values = np.fmax.reduce(values / limits if limited else values, axis=1)
        largest = np.nanmax(values, initial=0.0)
        bound = (1.0 if limited else robot.external_scale()) if self.quantity == EXTERNAL else 0.0
        scale, style = max(largest, bound), _style(largest, 1.0 if limited else math.inf)
        labels = [
            f"{100 * scale:.0f} %" if limited else number(scale),
            label,
            *[""] * (height - 3),
            "0",
        ]
        rows = self._bars(values[:, None], scale, width, height)
        return [
            [(f"{text:>{LABELS}} ", "dim"), (row, style)]
            for text, row in zip(labels, rows, strict=True)
        ]

    def _bars(self, values, scales, width, height=1):
        """Return magnitudes over time as texts, from zero to a scale: `height` texts for each column of values."""
        begins = np.linspace(0, len(values), max(width, 1), endpoint=False).astype(int)
        levels = np.ceil(
            8 * height * np.fmax.reduceat(values, begins) / np.where(scales, scales, 1.0)
        )
        levels = np.nan_to_num(np.clip(levels, 1, 8 * height)).astype(int)
        eighths = np.clip(levels.T[:, None] - 8 * np.arange(height)[::-1, None], 0, 8)
        return ["".join(row) for rows in self._characters[eighths].tolist() for row in rows]

    def _table(self, robot, rows, width):
        q, quantity, order, wide = (
            self.quantity,
            QUANTITIES[self.quantity],
            self._order(robot),
            width >= WIDE,
        )
        self.scroll = min(self.scroll, max(0, len(order) - rows))
        shown = order[self.scroll : self.scroll + rows]
        last, limits, values = (
            robot.last[q, shown],
            robot.limits[q, shown],
            self._recent(robot.values[:, q, shown]),
        )
        fractions = np.abs(last) / limits
        styles = [_style(*pair) for pair in zip(fractions, limits, strict=True)]
        columns = {
            f"joint, {SORTS[self.sort]}" if wide else "joint": (
                [robot.names[k] for k in shown],
                None,
            )
        }
        columns[f"{quantity.symbol} {quantity.unit}"] = map(number, last), styles
        if wide:
            columns["peak"] = map(number, robot.peak[q, shown]), None
        if np.isfinite(robot.limits[q]).any():
            texts = [f"{100 * fraction:.0f} %" if fraction > 0.0 else "" for fraction in fractions]
            columns["of limit" if wide else "limit"] = texts, styles
        scale = robot.external_scale() if q == EXTERNAL else 0.0
        scales = np.where(np.isfinite(limits), limits, np.nanmax(values, initial=scale))
        hidden = f", {len(shown)} of {len(order)}" if len(shown) < len(order) else ""
        heading = f"{quantity.name}, " if wide else ""
        return self._rows(
            columns, f"{heading}{WINDOWS[self.window]} s{hidden}", values, scales, styles, width
        )

    def _order(self, robot):
        size, limits = np.abs(robot.last[self.quantity]), robot.limits[self.quantity]
        fraction = size / limits if np.isfinite(limits).any() else size
        key = (np.zeros_like(size), size, robot.peak[self.quantity], fraction)[self.sort]
        return np.argsort(-np.nan_to_num(key), kind="stable")

    def _overview(self, robots, now, width):
        robots = [robot for robot in robots if robot.names]
        styles = [
            "bold red" if robot.alarm or robot.silence(now) > MAX_SILENCE else "cyan"
            for robot in robots
        ]
        columns = {
            "robot": ([robot.title for robot in robots], None),
            "K J": ([number(robot.energy) for robot in robots], None),
            "peak": ([number(robot.energy_peak) for robot in robots], None),
            "Hz": ([str(robot.rate(now)) for robot in robots], None),
        }
        values = (
            np.array([self._recent(robot.energies) for robot in robots]).reshape(len(robots), -1).T
        )
        scales = np.nanmax(values, axis=0, initial=0.0)
        return self._rows(
            columns, f"kinetic energy, {WINDOWS[self.window]} s", values, scales, styles, width
        )

    def _rows(self, columns, heading, values, scales, styles, width):
        """Return a table: a name, numbers, and a chart for each row; columns are texts and styles by heading."""
        wide, plains = width >= WIDE, [""] * len(styles)
        lines = [[] for _ in range(len(styles) + 1)]
        for k, (title, (texts, colours)) in enumerate(columns.items()):
            texts = [
                title,
                *(texts if k else [_shorten(plain(text), 30 if wide else 12) for text in texts]),
            ]
            size = max(0 if k == 0 else NUMBERS, *map(cell_len, texts))
            for line, text, style in zip(
                lines, texts, ["dim underline", *(colours or plains)], strict=True
            ):
                space = " " * (size - cell_len(text))
                line.append((f"{space}{text}" if k else f"{text}{space}", style))
                line.append(("  " if wide else " ", "dim underline" if line is lines[0] else ""))
        lines[0].append((f"{heading:{width}}", "dim underline"))
        left = width - sum(cell_len(text) for text, _ in lines[0][:-1])
        if styles and left > 0:
            for line, row, style in zip(
                lines[1:], self._bars(values, scales, left), styles, strict=True
            ):
                line.append((row, style))
        return lines


def _fit(line, width):
    """Return segments of texts and styles, as wide as the terminal."""
    return Segment.adjust_line_length(
        [Segment(text, Style.parse(style)) for text, style in line], width
    )


def _keys(robots, width):
    """Return the line of as many keys as there is space for."""
    text, *others = KEYS_OF_SEVERAL if robots > 1 else KEYS
    for key in others:
        text = f"{text}  {key}" if len(text) + len(key) + 2 <= width else text
    return [(text, "dim")]


def _norm(pair, unit, wide):
    value, threshold = pair
    bound = f"{' of ' if wide else '/'}{number(threshold)}" if threshold < math.inf else ""
    return f"{number(value)}{bound} {unit}", _style(value / threshold, threshold)


def _style(fraction, limit):
    """Return the style of a value at a fraction of its limit."""
    if not (limit < math.inf and fraction == fraction):
        return "cyan"
    return "bold red" if fraction > 1.0 else "yellow" if fraction > NEAR else "green"


def _shorten(name, width):
    """Return a name; of a long one the end, which differs from joint to joint."""
    while cell_len(name) > width:
        name = f"…{name[2:]}"
    return name
