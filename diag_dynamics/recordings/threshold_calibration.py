# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of thresholds on recordings without contact."""

from __future__ import annotations

from collections.abc import Iterable

from diag_dynamics.checks import instance, positive
from diag_dynamics.collision.calibration import Calibration, calibrate_residuals
from diag_dynamics.collision.detector import HOLD_OFF, RELEASE, STANDING, STICTION, Thresholds
from diag_dynamics.collision.residuals import Residuals, poisson_interval
from diag_dynamics.control.dead_zone import DeadZone
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.data_checks import EffortRange, MotionSample
from diag_dynamics.recordings.external_torque import Observer, require_efforts, require_same_robot
from diag_dynamics.recordings.findings import require_plausible
from diag_dynamics.recordings.recording import Recording


def calibrate(
    recordings: Recording | Iterable[Recording | Iterable[Recording]],
    dynamics: DiagonalDynamics,
    gain: float = 25.0,
    false_alarms: float = 1 / 60,
    false_contacts: float | None = None,
    *,
    release: float = RELEASE,
    hold_off: float = HOLD_OFF,
    standing: float = STANDING,
    stiction: float = STICTION,
    friction: bool | None = None,
    threads: int | None = None,
) -> Calibration:
    """Return the thresholds of an :class:`Detector` for a rate of false alarms.

    Each detector (a joint's |m r|, ‖m r‖, |r|) gets its own spread times one common factor. All
    detectors together then have alarms at the requested rate at most, with a confidence of 90 % for
    recordings of at least 2.5 / `false_alarms`. Those of shorter ones may have more.

    Parameters
    ----------
    recordings : Recording, or iterable of recordings
        Of the motions that the detector is for, without contact. An iterable of pieces, as
        :func:`stream_recording` yields them, stands for one recording, and takes bounded memory.
    dynamics : DiagonalDynamics
        Of the robot, as the monitor will have it.
    gain : float
        Of the observer [1/s].
    false_alarms : float
        Rate of all detectors together [1/s].
    false_contacts : float, optional
        Rate of the lower thresholds, for contact [1/s]; by default ten times that of false alarms.
    release, hold_off, standing, stiction
        As of :class:`Thresholds`.
    friction : bool, optional
        Whether the observer subtracts the friction of the model; by default if the model has any.
    threads : int, optional
        For evaluation, by default one for each processor.

    Returns
    -------
    Calibration
        Its `warnings` name recordings that are too short, parts that are unlike one another, and
        faults of efforts.

    Raises
    ------
    InputError
        An argument is wrong, a recording is of another robot or has no efforts, or there are too
        few peaks for any threshold.
    """
    poisson_interval(0)  # without SciPy fail before hours are read
    names = instance("dynamics", dynamics, DiagonalDynamics).model.dof_names
    gain = positive("gain", gain, "[1/s]")
    if friction is None:
        friction = dynamics.model.has_friction
    positive("false_alarms", false_alarms, "[1/s]")
    template = Thresholds({}, release, hold_off, standing, stiction)
    residuals = Residuals(len(names))
    efforts = EffortRange(dynamics.model)
    zone = DeadZone(dynamics, stiction, gain)
    faults = {}
    for recording in [recordings] if isinstance(recordings, Recording) else recordings:
        motion = MotionSample(dynamics.model)
        residuals.start_recording()
        zone.reset()
        observer = Observer(dynamics, gain, friction=friction, threads=threads)
        states = 0
        with_efforts = False
        counts = {}
        findings = []
        path = None
        for piece in [recording] if isinstance(recording, Recording) else recording:
            require_same_robot(dynamics, piece)
            states += len(piece)
            with_efforts = with_efforts or piece.tau is not None
            counts = piece.counts  # these and the findings are of all pieces until here
            findings = piece.findings
            path = piece.path
            efforts.add_values(piece.states.position[:, -len(names) :], piece.states.effort)
            motion.add_states(piece.states)
            for batch, (residual, torque, _, valid) in observer.observe_states(piece.states):
                columns = batch.position, batch.velocity, residual, torque, batch.jumped
                lowered = zone.lower(batch.stamp, *columns)
                residuals.add_states(batch.stamp, *lowered, valid, torque)
        require_plausible(findings)
        if not with_efforts:
            require_efforts(states > 0, counts)
        if fault := motion.fault():
            name = f"'{path}': " if path else ""
            certain = "may be" if fault.light else "are"
            faults[f"{name}{fault.text}: thresholds {certain} wrong"] = True
    if not efforts.states:
        raise InputError("recordings is empty; expected at least one.")
    unmeasured = efforts.unmeasured()
    if unmeasured and not efforts.measures:
        raise InputError(f"{unmeasured}. Record the efforts of the joints.")
    warnings = [unmeasured] * bool(unmeasured) + list(faults)
    if not efforts.moved:
        warnings.append("no joint moves: the thresholds hold for a robot at rest")
    return calibrate_residuals(
        residuals,
        names,
        false_alarms,
        template,
        false_contacts=false_contacts,
        gain=gain,
        friction=friction,
        warnings=tuple(warnings),
        dead_zones=dict(zip(names, zone.largest.tolist(), strict=True)),
    )
