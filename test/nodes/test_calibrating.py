# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of alarms on the running monitor: it proposes what dd.calibrate makes of the same states."""

import math
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from diag_dynamics.srv import Calibrate

import diag_dynamics as dd
from diag_dynamics.nodes.monitor import calibrating
from diag_dynamics.nodes.monitor.torque_watch import TorqueWatch
from diag_dynamics.nodes.support.managed import ACTIVE
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS, Observation
from diag_dynamics.recordings.calibration import calibrated
from nodes import BELIEVING, MS, PANDA, Monitor, S, robot
from pushed import GAIN, Motion, feed, subscribed

PERIOD = 20 * MS
STATUS, START, END, CANCEL = (getattr(Calibrate.Request, name) for name in ("STATUS", "START", "END", "CANCEL"))


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda that observes external torque."""
    parameters = {"robot_description": robot(PANDA).path, "external_torque.gain": GAIN}
    with Monitor(peer, "/calibrating", outputs=["state"], **parameters) as monitor:
        yield subscribed(monitor).connect(robot(PANDA))


@pytest.fixture
def monitor(running):
    """Return it without a run."""
    yield running
    call(running, CANCEL)


def call(monitor, action, **fields):
    """Call the service."""
    return monitor.call(Calibrate, "calibrate", Calibrate.Request(action=action, **fields))


def noisy(panda, count, seed):
    """Return states `PERIOD` apart of a swing, with noise on rates and efforts."""
    motion, rng = Motion(panda, size=0.2), np.random.default_rng(seed)
    for k in range(count):
        q, qd, tau = motion(k * PERIOD // (2 * MS))
        yield q, qd + 1e-3 * rng.normal(size=len(qd)), tau + 0.3 * rng.normal(size=len(tau))


def publish(monitor, states):
    """Publish states `PERIOD` apart; return their stamps [ns]."""
    stamps = []
    for state in states:
        monitor.tick(PERIOD - 2 * MS)
        feed(monitor, [state])
        stamps.append(monitor.now)
    return stamps


def recorded(path, panda, stamps, states):
    """Return the recording of a table with the same states."""
    header = ",".join(["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in panda.names)])
    pairs = zip(stamps, states, strict=True)
    rows = [",".join(map(repr, [1e-9 * stamp, *map(float, np.concatenate(state))])) for stamp, state in pairs]
    path.write_text("\n".join([header, *rows]) + "\n")
    parameters = {name: value for name, value in BELIEVING.items() if name in PARAMETERS}
    return dd.read_recording(path, panda.path, parameters=parameters)


def without_comments(text):
    """Return the lines of a file but for comments."""
    return [line for line in text.splitlines() if not line.startswith("#")]


def test_it_proposes_what_calibrate_does(monitor, panda, tmp_path):
    """The same thresholds and the same file but for its comments; the monitor takes its parameters."""
    monitor.tick(10 * S)
    begun = call(monitor, START, false_alarms=1.0)
    assert begun.success
    assert begun.running
    assert "3 s without an alarm vouch for 1/s" in begun.message
    states = [*noisy(panda, 500, 1)]
    stamps = publish(monitor, states[:300])
    status = call(monitor, STATUS)
    assert (status.success, status.running, status.states) == (True, True, 299)
    assert status.duration == pytest.approx(5.96, abs=1e-6)
    assert "long enough for 1/s" in status.message
    stamps += publish(monitor, states[300:])
    found = call(monitor, END)
    assert found.success, found.message
    recording = recorded(tmp_path / "free.csv", panda, stamps, states)
    expected = dd.calibrate(recording, dd.DiagonalDynamics(recording.model), GAIN, 1.0)
    assert (found.states, found.gain, found.running) == (499, GAIN, False)
    assert found.duration == pytest.approx(expected.duration, abs=1e-6)
    assert dict(zip(found.dof_names, found.joint_thresholds, strict=True)) == pytest.approx(expected.joints, rel=1e-6)
    assert found.torque_norm_threshold == pytest.approx(expected.external_torque, rel=1e-6)
    assert found.threshold == pytest.approx(expected.norm, rel=1e-6)
    assert f"held out by parts {expected.held_out} alarms" in found.message
    assert without_comments(found.parameters) == without_comments(expected.yaml())
    assert f"From a run of '{monitor.name}'" in found.parameters
    (tmp_path / "alarms.yaml").write_text(found.parameters)
    with monitor.having(**parameters_of([tmp_path / "alarms.yaml"])):
        message = feed(monitor, [Motion(panda, 60.0, size=0.0)(0)] * 30)[-1]
        assert message.collision
        assert message.threshold == pytest.approx(expected.norm, rel=1e-3)
    assert not call(monitor, END).success


def test_a_run_that_is_too_short(monitor, panda):
    """Too short for any threshold it goes on; too short for the rate, the proposal says so."""
    call(monitor, START)
    monitor.tick(10 * S)
    publish(monitor, noisy(panda, 4, 2))
    refused = call(monitor, END)
    assert (refused.success, refused.running) == (False, True)
    assert "too short for any threshold" in refused.message
    publish(monitor, noisy(panda, 600, 3))
    assert "too short for 1/min by 16" in call(monitor, STATUS).message
    found = call(monitor, END)
    assert found.success
    assert "too short for 1/min" in found.message
    assert "# too short for 1/min" in found.parameters


def test_interruptions(monitor, panda):
    """A gap, a state without efforts, time that goes back, a pause and alarms are counted and reported."""
    states = [*noisy(panda, 600, 4)]
    with monitor.having(**{"external_torque.threshold": 8.0}):
        monitor.tick(10 * S)
        call(monitor, START)
        publish(monitor, states[:60])
        monitor.tick(S)
        publish(monitor, states[60:100])
        publish(monitor, [(*states[100][:2], None)])
        publish(monitor, [Motion(panda, 40.0, size=0.0)(0)] * 20)
        monitor.now -= 60 * S
        monitor.torque.forget()
        publish(monitor, states[101:])
        message = call(monitor, STATUS).message
        for text in ("in force during the run: 1;", "2 gaps", ": 1, no effort of any joint", ": 1, time went back"):
            assert text in message
        monitor.transition("deactivate", "activate")
        assert "begun anew after a jump of time or position, or a pause: 1 times" in call(monitor, STATUS).message
        found = call(monitor, END)
        assert found.success
        assert "did something touch the robot?" in found.message
        assert "# alarms by the thresholds in force during the run: 1;" in found.parameters


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"external_torque.gain": 31.0}, "another model, payload, gravity or parameter"),
        ({"gravity": [0.0, 0.0, -9.7]}, "another model, payload, gravity or parameter"),
        ({"external_torque.gain": 0.0}, "external_torque.gain was set to 0"),
        ({"robot_description": robot(PANDA).urdf}, "another robot_description"),
    ],
)
def test_another_observer_ends_it(monitor, changes, reason):
    """The run is over, and proposes nothing."""
    call(monitor, START)
    with monitor.having(**changes):
        status = call(monitor, STATUS)
        assert (status.success, status.running) == (True, False)
        assert reason in status.message
        ended = call(monitor, END)
        assert not ended.success
        assert reason in ended.message
        assert "no calibration run" in call(monitor, STATUS).message


def test_wrong_requests(monitor):
    """Each is refused with its reason."""
    assert "expected STATUS = 0" in call(monitor, 17).message
    for rate in (-1.0, math.nan, math.inf):
        assert "false_alarms is" in call(monitor, START, false_alarms=rate).message
    for action in (END, CANCEL):
        assert "no calibration run is on" in call(monitor, action).message
    assert call(monitor, START).success
    again = call(monitor, START)
    assert (again.success, again.running) == (False, True)
    assert "end or cancel it first" in again.message
    assert "forgotten" in call(monitor, CANCEL).message
    with monitor.having(**{"external_torque.gain": 0.0}):
        assert "set it first" in call(monitor, START).message


# --- while a thread finds thresholds


@pytest.fixture
def held_up(peer, panda, monkeypatch):
    """Return the service on a node of the test's, with a run; its thread waits for `allowed`."""
    node, allowed, begun = peer.extra_node("held_up", "/held_up"), threading.Event(), threading.Event()
    model = dd.load_urdf(panda.path)
    torque = TorqueWatch(dd.DiagonalDynamics(model), Observation(GAIN, math.inf, math.inf, False, 0.1))
    values = {"alarm.release": 0.7, "alarm.hold_off": 0.5, "alarm.standing": 2.0, "parameters_file": ""}
    robot_ = SimpleNamespace(model=model, torque=torque, settings=SimpleNamespace(values=values))

    def find(*arguments, **options):
        begun.set()
        assert allowed.wait(60.0)
        return calibrated(*arguments, **options)

    monkeypatch.setattr(calibrating, "calibrated", find)
    node.phase = ACTIVE
    service = calibrating.CalibrationService(node, lambda: robot_)
    client = peer.node.create_client(Calibrate, "/held_up/held_up/calibrate")

    def send(action):
        future = client.call_async(Calibrate.Request(action=action, false_alarms=1.0))
        peer.graph.spin()
        return future

    def answer(future):
        """Let time go by until the thread has ended: the graph waits for it."""
        allowed.set()
        return peer.wait_until(future.done, "an answer") and future.result()

    assert send(START).result().success
    residual = np.random.default_rng(5).normal(size=(4000, model.nv))
    torque.run.seen.take(np.arange(4000) * PERIOD + S, residual, residual, np.ones(4000, dtype=bool))
    torque.run.first, torque.run.last = S, S + 3999 * PERIOD
    end = send(END)
    assert begun.wait(60.0)
    yield SimpleNamespace(service=service, send=send, answer=answer, robot=robot_, end=end)
    allowed.set()
    service.destroy()
    peer.drop_node(node)


def test_requests_while_thresholds_are_found(held_up):
    """A second END is refused, STATUS is answered, and the first END has its answer."""
    assert "being found already" in held_up.send(END).result().message
    status = held_up.send(STATUS).result()
    assert status.success
    assert status.running
    assert not held_up.end.done()
    held_up.robot.torque.run.seen.add(S + 4000 * PERIOD, np.zeros(8), np.zeros(8))
    found = held_up.answer(held_up.end)
    assert (found.success, found.running, found.states) == (True, False, 4000)
    assert (np.array(found.joint_thresholds) > 1.0).all()
    assert "79.98 s, 4000 states" in found.message
    assert held_up.robot.torque.run is None


@pytest.mark.parametrize("by", ["cancel", "another robot", "the end of the node"])
def test_a_run_that_ends_while_thresholds_are_found(held_up, by):
    """END is refused."""
    if by == "cancel":
        assert "forgotten" in held_up.send(CANCEL).result().message
    elif by == "another robot":
        held_up.robot.torque.run.end("another robot_description is in force")
    else:
        held_up.service._stop()
    refused = held_up.answer(held_up.end)
    assert (refused.success, refused.parameters, refused.running) == (False, "", False)
    assert ("another robot_description" if by == "another robot" else "forgotten while") in refused.message
