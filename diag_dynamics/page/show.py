# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is shown of one robot: made of its newest state when somebody asks for it, and of no other."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.page.contact import Touch, told
from diag_dynamics.page.frames import FrameMaker, Seen, States, Told
from diag_dynamics.page.layout import Layout, finite
from diag_dynamics.page.meshes import MeshLibrary

STALE = 1.0
"""Age of the last state from which a robot no longer counts as alive [s]."""

COUNTED = 0.5
"""Time over which states are counted at least, to know how many come a second [s]."""

TOUCHED = 0.1
"""Time between two looks at what a touch would cost [s]."""

NOTHING_YET, NO_STATE = "waiting for a robot", "waiting for the first state"


class Taken(NamedTuple):
    """The newest state of a robot, and what came with it."""

    states: States
    """A single one, of the robot in force."""
    seen: Seen | None = None
    told: Told = Told()
    """Its rate is not looked at: see `count`."""
    received: float = 0.0
    """When it came, as :func:`time.monotonic` has it [s]."""
    count: int | None = 1
    """States that have come since the last one was taken, this one among them; None where some may be lost uncounted."""
    limits: tuple[float, ...] = ()
    """Thresholds of alarms: |m r| of each degree of freedom [N m, N], ‖m r‖ [N m], |r| [J^½/s]; inf where there is none."""


class Newest(NamedTuple):
    """What there is to show."""

    layout: int
    """Number of the layout that the frame is of; 0 while there is none."""
    number: int
    """Of the state; 0 before the first."""
    frame: bytes
    """Empty before the first."""


class Show:
    """One robot for any number of pages: each frame is made once, whoever asks first.

    Whoever reads may do so from any thread; nobody waits for a page.

    Parameters
    ----------
    name : str
        Namespace of the robot, by which pages ask for it.
    take : callable
        Called with the DiagonalDynamics in force by whoever asks for a frame, one at a time; returns the newest state since
        the last call as :class:`Taken`, or None. It raises nothing.
    take_touch : callable
        Likewise of contact, as :class:`~diag_dynamics.page.contact.Touch`; called at most every :data:`TOUCHED`.
    """

    def __init__(
        self,
        name: str,
        take: Callable[[DiagonalDynamics], Taken | None],
        take_touch: Callable[[DiagonalDynamics], Touch | None] = lambda _: None,
    ) -> None:
        self.name = name
        self._take, self._take_touch = take, take_touch
        self._touch: tuple[int, bytes] = (0, b"")
        self._touched = 0.0
        self._lock = threading.Lock()
        self._maker: FrameMaker | None = None
        self._dynamics: DiagonalDynamics | None = None
        self._scene: Mapping[str, Any] | None = None
        self._meshes: MeshLibrary | None = None
        self._limits: tuple[float, ...] = ()
        self._layout, self._layouts, self._waiting = b"", 0, NOTHING_YET
        self._last: Taken | None = None
        self._number, self._head = 0, b""
        self._chosen: dict[str, bytes] = {}
        self._rate = _Rate()
        self._diagnostics: tuple[int, bytes] = (0, b"[]")
        self._worst = ""

    # --- What there is to show ---

    def use(self, dynamics: DiagonalDynamics, scene: Mapping[str, Any] | None, meshes: MeshLibrary | None) -> None:
        """Put a robot in force, with what is drawn of it; `dynamics` is this object's own from now on."""
        maker = FrameMaker(dynamics)
        maker.prepare()
        with self._lock:
            self._maker, self._dynamics, self._scene, self._meshes = maker, dynamics, scene, meshes
            self._limits, self._waiting, self._touch = (), "", (self._touch[0], b"")
            self._forget()
            self._lay_out()

    def wait_for(self, what: str) -> None:
        """Say what is waited for; what is shown already stays, and shows its age."""
        with self._lock:
            self._waiting = what

    def tell(self, diagnostics: Sequence[Mapping[str, Any]]) -> None:
        """Take the newest diagnostics: dicts of level, name, message and values."""
        text, worst = json.dumps(list(diagnostics)).encode(), worst_of(diagnostics)
        with self._lock:
            self._worst = worst
            if text != self._diagnostics[1]:
                self._diagnostics = self._diagnostics[0] + 1, text

    # --- What is shown ---

    def newest(self, link: str = "") -> Newest:
        """The newest frame, with the fields of a link if one is chosen.

        Raises
        ------
        InputError
            The robot has no such link.
        """
        with self._lock:
            if link and self._dynamics is not None:
                self._dynamics.model.placement_in_body(link)  # refuses one that there is not
            self._refresh()
            return Newest(self._layouts, self._number, self._head + self._tail(link) if self._number else b"")

    def layout(self) -> bytes:
        """The layout as JSON; empty while there is none."""
        with self._lock:
            return self._layout

    def mesh(self, sha: str) -> bytes | None:
        """Bytes of a mesh; None if there is none of this hash."""
        with self._lock:
            return self._meshes.data(sha) if self._meshes is not None else None

    def diagnostics(self) -> tuple[int, bytes]:
        """Number of the newest diagnostics, and these as JSON."""
        with self._lock:
            return self._diagnostics

    def touch(self) -> tuple[int, bytes]:
        """Number of the newest contact, and what a touch would cost as JSON; 0 and empty while nothing is told of it."""
        with self._lock:
            now = time.monotonic()
            if self._dynamics is not None and now - self._touched >= TOUCHED:
                self._touched = now
                touch = self._take_touch(self._dynamics)
                if touch is not None:
                    self._touch = self._touch[0] + 1, told(touch, self._dynamics.model)
            return self._touch

    def about(self) -> dict[str, Any]:
        """Who it is, whether it lives, and how old its last state is, for JSON; and why there is none, in words."""
        with self._lock:
            self._refresh()
            age = time.monotonic() - self._last.received if self._last else None
            alive = age is not None and age < STALE
            return {
                "name": self.name,
                "robot": self._dynamics.model.name if self._dynamics else None,
                "alive": alive,
                "age": age,
                "rate": self._rate.value,
                "waiting": self._waiting or ("" if alive else self._worst or (NO_STATE if age is None else "")),
            }

    # --- Below, with the lock ---

    def _forget(self) -> None:
        self._last, self._head, self._number = None, b"", 0
        self._chosen = {}

    def _lay_out(self) -> None:
        if self._maker is None:
            return
        n = len(self._limits) - 2
        thresholds = None
        if n >= 0:
            *_, torque_norm, norm = limits = finite(self._limits)
            thresholds = {
                "external_torque": limits[:n],
                "external_torque_norm": torque_norm,
                "norm": norm,
                "energy": None,
            }
        self._layout = json.dumps(self._maker.layout.to_json(self._scene, thresholds), allow_nan=False).encode()
        self._layouts += 1

    def _refresh(self) -> None:
        """Make a frame of the newest state, if there is one since."""
        if self._maker is None or self._dynamics is None:
            return
        taken = self._take(self._dynamics)
        if taken is None:
            return
        self._rate.count(taken.count, time.monotonic())
        if taken.limits != self._limits:
            self._limits = taken.limits
            self._lay_out()
        frames = self._maker.frames(
            taken.states, taken.seen, taken.told._replace(rate=self._rate.value or float("nan"))
        )
        self._head = frames.tobytes()[: 8 + 4 * self._maker.layout.common]
        self._chosen, self._last = {}, taken
        self._number += 1 if taken.count is None else taken.count

    def _tail(self, link: str) -> bytes:
        """Numbers of the chosen link, NaN where there is none."""
        if self._maker is None or self._last is None:
            return b""
        if link not in self._chosen:
            layout = self._maker.layout
            if link:
                states = self._last.states
                self._chosen[link] = self._maker.chosen(states.q[0], states.nu[0], link).tobytes()
            else:
                self._chosen[link] = nothing(layout)
        return self._chosen[link]


def nothing(layout: Layout) -> bytes:
    """Numbers of the chosen link where none is."""
    return b"\x00\x00\xc0\x7f" * (layout.size - layout.common)


def worst_of(diagnostics: Sequence[Mapping[str, Any]]) -> str:
    """The worst of some diagnostics in words, without the name of its node; empty while all are well."""
    worst = max(diagnostics, key=lambda one: one["level"], default=None)
    if worst is None or not worst["level"]:
        return ""
    return ": ".join(part for part in (worst["name"].partition(": ")[2] or worst["name"], worst["message"]) if part)


class _Rate:
    """States per second, counted over at least :data:`COUNTED`."""

    def __init__(self) -> None:
        self.value: float | None = None
        self._count, self._since = 0, 0.0

    def count(self, count: int | None, now: float) -> None:
        """Take in how many came; None: some may be lost, and it begins anew."""
        if count is None or not self._since:
            self._count, self._since = 0, now
            return
        self._count += count
        if now - self._since >= COUNTED:
            self.value = self._count / (now - self._since)
            self._count, self._since = 0, now
