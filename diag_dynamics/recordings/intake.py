# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the monitor makes of the messages it receives, in columns: states, and counts of what made none."""

from collections import Counter
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.assembler import JointStateAssembler, joints_of
from diag_dynamics.assembly.frozen import Frozen
from diag_dynamics.assembly.jumps import INTERLEAVED
from diag_dynamics.assembly.odometry import OdometryBase
from diag_dynamics.assembly.rejected import RejectedError, cause_of
from diag_dynamics.assembly.whole import WithBase
from diag_dynamics.bags.messages import Messages
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.recordings.refused_units import RefusedUnits
from diag_dynamics.recordings.seams import LoggedGaps
from diag_dynamics.recordings.states import States
from diag_dynamics.wire.definitions import read_message
from diag_dynamics.wire.joint_states import KnownJointStates
from diag_dynamics.wire.many import Run
from diag_dynamics.wire.odometry import odometry_of

JOINT_STATE, ODOMETRY = "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry"

ABSURD = "absurd value"
"""Cause of messages that are refused for what they say of a joint."""

LOST = "lost by gaps in stamps"
"""Name of the count of states that never came."""

FEW = 7
"""Names of joints that a text has."""

MAX_ARRIVED = 1000
"""Names of joints in messages that are kept."""

MOST_TOLD = 20
"""Rejections whose text is kept, of each cause."""


class Rejection(NamedTuple):
    """One message that made no state."""

    log_time: int
    cause: str
    text: str


class Intake:
    """Takes serialized messages in, piece by piece; log time stands for the time of reception.

    Assembly and judgement are the monitor's: what it would publish is handed out, bit for bit, and what it would count is
    counted. Only states that cannot be evaluated are found later.

    Parameters
    ----------
    model : RobotModel
    settings : Settings
        The monitor's.
    names : JointNames, optional
        Map of the names of joints in messages.

    Attributes
    ----------
    assembler : JointStateAssembler
    names : JointNames or None
    arrived : dict
        Names of joints in messages, in their order, at most :data:`MAX_ARRIVED` of them; values are None.
    rejections : list of Rejection
        The first :data:`MOST_TOLD` of each cause.
    units : RefusedUnits
    """

    def __init__(self, model, settings, names=None):
        values = settings.values
        self.names, self.arrived = names, {}
        self._model, self._settings, self._dynamics = model, settings, DiagonalDynamics(model)
        self.assembler = JointStateAssembler(joints_of(model), settings.inputs, names.map_name if names else None)
        self._joint_states = KnownJointStates(self.assembler, self._read)
        self._joint_states.configure()
        self._refuses_frozen = values["frozen_values"] == "refuse"
        self.frozen = Frozen(self.assembler.names, values["frozen_timeout"], self._refuses_frozen)
        self._base = self._with_base = None
        if model.floating_base:
            self._base = OdometryBase(model, values["odom_twist_frame"] == "header")
            self._base.configure(settings.inputs)
            self._with_base = WithBase(self._base, self.assembler)
        self._counts, self._before = Counter(), Counter()  # the latter: all that was counted until `anew`
        self.rejections, self._texts = [], Counter()
        self.units = RefusedUnits(model)
        self._moved = 0  # jumps of positions that the last state knows of

    @property
    def counts(self):
        """How many messages there were and what became of them, by the monitor's names for it."""
        counts = self._all_counts()
        counts.subtract(self._before)
        return +counts + Counter({LOST: self.assembler.gaps.lost})

    def _all_counts(self):
        jumps = self._base.jumps if self._base else 0
        return self._counts + self.assembler.counts + Counter({"time jumped back": jumps})

    def anew(self):
        """Count from here on; what the assembler knows stays. Gaps in stamps are kept for :meth:`LoggedGaps.replay`."""
        self._before = self._all_counts()
        self.rejections, self._texts = [], Counter()
        self.frozen.told = Counter()
        self.units.forget()
        self.assembler.gaps = LoggedGaps()

    def memory(self):
        """What later states and counts depend on, but for gaps; see `diag_dynamics.recordings.seams`."""
        whole = self._with_base.memory() if self._with_base else None
        moved = self.assembler.counts["positions jumped"] > self._moved
        return [self.assembler.memory(), self.frozen.memory(), whole, moved]

    @property
    def last_texts(self):
        """Texts on the last time that something was counted, by what."""
        names, own = self.assembler.last_foreign, self.assembler.names
        foreign = f"{', '.join(names[:FEW])}{' …' * (len(names) > FEW)}"
        return {
            "positions jumped": self.assembler.jumps.last,
            INTERLEAVED: self.assembler.jumps.contradiction,
            "mimic disagreement": self.assembler.last_disagreement,
            "foreign": f"messages without a joint of this robot, of {foreign}; the robot has {', '.join(own[:FEW])}"
            f"{' …' * (len(own) > FEW)}",
        }

    def reject(self, now, error):
        """Count a state that was handed out, but cannot be evaluated."""
        self._counts["published"] -= 1
        self._reject("rejected", now, error)

    def take(self, messages, kinds):
        """Take messages in.

        Parameters
        ----------
        messages : Messages
        kinds : ndarray of str
            Type of each connection's messages: JOINT_STATE or ODOMETRY.

        Returns
        -------
        States
        """
        if self._base:
            return self._beside_odometry(messages, kinds)
        joint_states = np.isin(messages.connection, np.flatnonzero(kinds == JOINT_STATE))
        if not joint_states.all():
            messages = Messages(messages.data, *(column[joint_states] for column in messages[1:]))
        return self._joints_alone(messages)

    def _joints_alone(self, messages):
        count, width = len(messages.at), len(self.assembler.names)
        self._counts["received"] += count
        run = Run(self._joint_states, messages, width)
        made, received, estimated, moved = np.zeros((4, count), dtype=bool)
        first = 0
        while first < count:
            end = run.take(first)
            if end > first:
                made[first:end] = True
                made[first + np.array(list(self._noted(run, first, end)), dtype=int)] = False
            if end < count:
                state = self._guarded("rejected", int(messages.log_time[end]), self._of_one, messages, end)
                if state is not None:
                    run.put(end, state)
                    made[end], received[end], estimated[end] = (
                        True,
                        state.stamp_is_receive_time,
                        state.velocity_estimated,
                    )
                    moved[end] = self._has_moved()
            first = end + 1
        self._counts["published"] += int(made.sum())
        if made.all():
            made = slice(None)
        taken = run.taken
        states = States(
            taken.newest,
            taken.oldest,
            messages.log_time,
            taken.position,
            taken.velocity,
            taken.effort,
            taken.with_effort,
            received,
            estimated,
            moved,
        )
        return self._with_gravity(states[made])

    def _noted(self, run, first, end):
        """Take note of a run of states; those of them that are refused for frozen values."""
        taken = run.taken
        refused = self.frozen.judge_many(taken.newest[first:end], taken.position[first:end], taken.velocity[first:end])
        begin = first
        for k, text in ((first + k, text) for k, text in refused.items()):
            run.note(begin, k + 1)
            self._reject("rejected", int(taken.newest[k]), RejectedError("frozen", text))
            self.assembler.gaps.pause()
            begin = k + 1
        run.note(begin, end)
        return refused

    def _read(self, raw):
        """The JointState of its bytes, whose names are kept."""
        message = read_message(raw, JOINT_STATE)
        if len(self.arrived) < MAX_ARRIVED:
            self.arrived |= dict.fromkeys(message.name[: MAX_ARRIVED - len(self.arrived)])
        return message

    def _of_one(self, messages, k):
        """The state that one message makes."""
        at, size = int(messages.at[k]), int(messages.size[k])
        now = int(messages.log_time[k])
        raw = messages.data[at : at + size].tobytes()
        try:
            state = self._joint_states.update(raw, now)
        except RejectedError as error:
            if error.cause == ABSURD and not self.units.full:
                message = self._read(raw)
                message.name = [self.names.map_name(name) for name in message.name] if self.names else message.name
                self.units.take(message)
            raise
        if state is None:
            return None
        if self._with_base:
            state = self._with_base.state(state, self._settings.values["odom_timeout"])
            if state is None:
                self._counts["before odometry"] += 1
                return None
        self._judge_frozen(state)
        return state

    def _judge_frozen(self, state):
        self.frozen.judge(state.newest, lambda: state)

    def _of_odometry(self, messages, k):
        """The state that one message about the base makes, of a robot that is all base."""
        at, size = int(messages.at[k]), int(messages.size[k])
        message = odometry_of(messages.data[at : at + size].tobytes(), partial(read_message, kind=ODOMETRY))
        self._base.update(message, int(messages.log_time[k]))
        state = self._with_base.state_of_base(self._settings.values["odom_timeout"])
        if state is not None:
            self._judge_frozen(state)
        return state

    def _beside_odometry(self, messages, kinds):
        """States of a robot with a floating base, one message at a time."""
        found, times = [], []
        for k in range(len(messages.at)):
            kind, now = kinds[messages.connection[k]], int(messages.log_time[k])
            if kind == JOINT_STATE:
                self._counts["received"] += 1
                state, what = self._guarded("rejected", now, self._of_one, messages, k), "published"
            else:
                self._counts["odometry received"] += 1
                state = self._guarded("odometry rejected", now, self._of_odometry, messages, k)
                what = "published from odometry"
            if state is not None:
                self._counts[what] += 1
                found.append((state, self._has_moved()))
                times.append(now)
        nq, nv = self._model.nq, self._model.nv
        unknown = np.full(nv, np.nan)
        return self._with_gravity(
            States(
                np.array([state.newest for state, _ in found], dtype=int),
                np.array([state.oldest for state, _ in found], dtype=int),
                np.array(times, dtype=int),
                np.array([state.position for state, _ in found]).reshape(-1, nq),
                np.array([state.velocity for state, _ in found]).reshape(-1, nv),
                np.array([unknown if state.effort is None else state.effort for state, _ in found]).reshape(-1, nv),
                np.array([state.effort is not None for state, _ in found], dtype=bool),
                np.array([state.stamp_is_receive_time for state, _ in found], dtype=bool),
                np.array([state.velocity_estimated for state, _ in found], dtype=bool),
                np.array([moved for _, moved in found], dtype=bool),
            )
        )

    def _with_gravity(self, states):
        """States whose efforts hold gravity, where they are said not to."""
        without = self.assembler.efforts.without_gravity
        if without is None or not states.effort_known.any():
            return states
        gravity = self._dynamics.gravity_torque_batch(states.position)
        joints = gravity.shape[1] - len(without)
        gravity[:, :joints] = 0.0  # of a base, on which no effort acts
        gravity[:, joints:] *= without
        return replace(states, effort=states.effort + gravity)

    def _has_moved(self):
        """Whether positions have jumped since this was asked last."""
        before, self._moved = self._moved, self.assembler.counts["positions jumped"]
        return self._moved > before

    def _guarded(self, what, now, action, *arguments):
        """Nothing that was recorded may end the reading of the rest."""
        try:
            return action(*arguments)
        except Exception as error:
            self._reject(what, now, error)
            if what == "rejected":
                self.assembler.gaps.pause()  # its stamp may not have been looked at
            return None

    def _reject(self, what, now, error):
        cause = f"{what}: {cause_of(error)}"
        self._counts[cause] += 1
        self._texts[cause] += 1
        if self._texts[cause] <= MOST_TOLD:
            self.rejections.append(Rejection(now, cause, str(error)))
