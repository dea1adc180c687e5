# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is left of an analysis when it is over: it can be sent to another process, and that of the next piece added to it."""

from diag_dynamics.recordings.balance import Balance
from diag_dynamics.recordings.effort_range import EffortRange
from diag_dynamics.recordings.histogram import Histogram
from diag_dynamics.recordings.motion_sample import MotionSample
from diag_dynamics.recordings.peaks import Peaks
from diag_dynamics.recordings.seams import agree


class Outcome:
    """All that a summary tells of.

    Parameters
    ----------
    model : RobotModel
    quality : Quality
    gain, threshold : float
        Of the observer.
    missing : tuple of str
        Parameters for want of which no collision is told of.
    collisions : Collisions or Alarms
        What gathers them.
    touches : Touches, optional
        What gathers contact, where there are limits.

    Attributes
    ----------
    robot, names : str, tuple of str
        Name of the model, and of its degrees of freedom.
    balance : Balance
    quality : Quality
    efforts : EffortRange
    motion : MotionSample
    peaks : Peaks
    collisions : Collisions or Alarms
    touches : Touches or None
    histogram : Histogram
        Of the kinetic energy [J].
    states, observed : int
        How many there were, and of how many the observer has a result.
    account : Account
        Of the messages; set when the analysis is over, as the next three are.
    offset : int
        By how much stamps are later than times in the recording [ns].
    begin, end : dict
        What was known at the first message and after the last one; see `diag_dynamics.recordings.seams`.
    """

    def __init__(self, model, quality, gain, threshold, missing, collisions, touches=None):
        self.robot, self.names, self.gain, self.threshold = model.name, tuple(model.dof_names), gain, threshold
        self.missing = tuple(missing)
        self.balance, self.quality, self.peaks = Balance(self.names), quality, Peaks()
        self.efforts, self.motion = EffortRange(self.names), MotionSample(model)
        self.collisions, self.histogram, self.touches = collisions, Histogram(), touches
        self.states, self.observed, self._kinetic = 0, 0, 0.0
        self.account = self.begin = self.end = None
        self.offset = 0

    def take_energy(self, kinetic_energy):
        """Take in K at states [J]."""
        self.states += len(kinetic_energy)
        self._kinetic += float(kinetic_energy.sum())
        self.histogram.take(kinetic_energy)

    @property
    def mean_energy(self):
        """Mean of K over the states [J]."""
        return self._kinetic / self.states if self.states else None

    def is_followed_by(self, other):
        """Whether another one begins with what this one knows at its end."""
        return agree(self.end, other.begin)

    def add(self, other):
        """Take in that of the next piece."""
        for name in ("account", "balance", "quality", "efforts", "motion", "peaks", "collisions", "histogram"):
            getattr(self, name).add(getattr(other, name))
        if self.touches:
            self.touches.add(other.touches)
        if not self.states:
            self.offset = other.offset
        self.states += other.states
        self.observed += other.observed
        self._kinetic += other._kinetic
        self.end = other.end
