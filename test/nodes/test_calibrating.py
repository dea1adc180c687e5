# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of alarms on the running monitor: what it proposes is what dd.calibrate makes of the same states."""

import math
import threading
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from diag_dynamics.srv import Calibrate
from test_external_torque import ENTRY, GAIN, Motion, feed, listening

import diag_dynamics as dd
from diag_dynamics.nodes.monitor import calibrating
from diag_dynamics.nodes.monitor.calibrating import CalibrationRun
from diag_dynamics.nodes.monitor.torque_watch import TorqueWatch
from diag_dynamics.nodes.support.managed import ACTIVE
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS, Observation
from diag_dynamics.recordings.calibration import calibrated
from nodes import BELIEVING, MS, PANDA, Monitor, S, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

EVERY = 20 * MS
STATUS, START, END, CANCEL = (getattr(Calibrate.Request, name) for name in ("STATUS", "START", "END", "CANCEL"))


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda that observes external torque."""
    with Monitor(
        peer, "/calibrating", robot_description=robot(PANDA).path, **{"external_torque.gain": GAIN}
    ) as monitor:
        listening(monitor)
        yield monitor


@pytest.fixture
def monitor(running):
    """It, without a run."""
    yield running
    ask(running, CANCEL)


def ask(monitor, action, **fields):
    """Call the service."""
    return monitor.call(Calibrate, "calibrate", Calibrate.Request(action=action, **fields))


def noisy(panda, count, seed):
    """States `EVERY` apart of a swing, with noise on rates and efforts."""
    motion, rng = Motion(panda, size=0.2), np.random.default_rng(seed)
    step = EVERY // (2 * MS)
    for k in range(count):
        q, qd, tau = motion(k * step)
        yield q, qd + 1e-3 * rng.normal(size=len(qd)), tau + 0.3 * rng.normal(size=len(tau))


def sent(monitor, states):
    """Feed them `EVERY` apart; returns their stamps [ns]."""
    stamps = []
    for state in states:
        monitor.tick(EVERY - 2 * MS)
        feed(monitor, [state])
        stamps.append(monitor.now)
    return stamps


def recorded(path, panda, stamps, states):
    """The same states as a table, read."""
    names = panda.names
    header = ",".join(["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in names)])
    pairs = zip(stamps, states, strict=True)
    rows = [",".join(map(repr, [1e-9 * stamp, *map(float, np.concatenate(state))])) for stamp, state in pairs]
    path.write_text("\n".join([header, *rows]) + "\n")
    parameters = {name: value for name, value in BELIEVING.items() if name in PARAMETERS}
    recording = dd.read_recording(path, panda.path, parameters=parameters)
    assert len(recording) == len(stamps)
    return recording


def test_it_proposes_what_calibrate_does(monitor, panda, tmp_path):
    """State by state the same thresholds, and the file that both write but for where it comes from; the monitor takes it."""
    monitor.tick(10 * S)
    begun = ask(monitor, START, false_alarms=1.0)
    assert begun.success and begun.running and "3 s without an alarm vouch for 1/s" in begun.message
    states = [*noisy(panda, 700, 1)]
    stamps = sent(monitor, states[:300])
    status = ask(monitor, STATUS)
    assert (
        status.success and status.running and status.states == 299 and status.duration == pytest.approx(5.96, abs=1e-6)
    )
    assert "long enough for 1/s" in status.message and not status.parameters and not len(status.joint_thresholds)
    stamps += sent(monitor, states[300:])
    found = ask(monitor, END)
    assert found.success and not found.running, found.message
    recording = recorded(tmp_path / "free.csv", panda, stamps, states)
    dyn = dd.DiagonalDynamics(recording.model)
    expected = dd.calibrate(recording, dyn, GAIN, 1.0, friction=False)
    assert found.states == 699 and found.duration == pytest.approx(expected.duration, abs=1e-6)
    assert dict(zip(found.dof_names, found.joint_thresholds, strict=True)) == pytest.approx(expected.joints, rel=1e-6)
    assert found.torque_norm_threshold == pytest.approx(expected.external_torque, rel=1e-6)
    assert found.threshold == pytest.approx(expected.norm, rel=1e-6)
    assert found.gain == GAIN and f"held out by parts {expected.held_out} alarms" in found.message

    def bare(text):
        return [line for line in text.splitlines() if not line.startswith("#")]

    assert bare(found.parameters) == bare(expected.yaml())
    (tmp_path / "alarms.yaml").write_text(found.parameters)
    values = parameters_of([tmp_path / "alarms.yaml"])
    assert f"From a run of '{monitor.name}'" in found.parameters
    with monitor.having(**values):
        assert monitor.wait_for_report(lambda r: ENTRY in r.entries, "a report")
        said = feed(monitor, [Motion(panda, 60.0, size=0.0)(0)] * 30)
        assert said[-1].collision and said[-1].threshold == pytest.approx(expected.norm, rel=1e-3)
    assert not ask(monitor, END).success


def test_a_run_that_is_too_short(monitor, panda):
    """For any threshold: it goes on. For the rate: it is told by how much, and what is proposed says so."""
    assert ask(monitor, START).message.startswith("begun")
    monitor.tick(10 * S)
    sent(monitor, noisy(panda, 4, 2))
    refused = ask(monitor, END)
    assert not refused.success and refused.running and "too short for any threshold" in refused.message
    sent(monitor, noisy(panda, 700, 3))
    status = ask(monitor, STATUS)
    assert "too short for 1/min by 16" in status.message
    found = ask(monitor, END)
    assert found.success and "too short for 1/min" in found.message
    assert "# too short for 1/min" in found.parameters
    assert yaml.safe_load(found.parameters)["/**"]["ros__parameters"]["external_torque"]["gain"] == GAIN


def test_what_comes_between(monitor, panda):
    """A gap, a state without efforts, time that goes back and alarms of other thresholds are counted, and told of."""
    with monitor.having(**{"external_torque.threshold": 8.0}):
        monitor.tick(10 * S)
        ask(monitor, START)
        states = [*noisy(panda, 800, 4)]
        sent(monitor, states[:60])
        monitor.tick(S)
        sent(monitor, states[60:100])
        q, qd, _ = states[100]
        sent(monitor, [(q, qd, None)])
        sent(monitor, [Motion(panda, 40.0, size=0.0)(0)] * 20)
        monitor.now -= 60 * S
        monitor.tick(2 * MS)
        monitor.feeder.publish(monitor.robot.message(monitor.now, monitor.robot.samples[0]))  # is lost by its jump
        sent(monitor, states[101:])
        message = ask(monitor, STATUS).message
        for text in (
            "in force during the run: 1;",
            "2 gaps",
            ": 1, no effort of any joint",
            ": 1, time went back",
        ):
            assert text in message, message
        monitor.transition("deactivate", "activate")
        monitor.connect(panda)
        assert "begun anew after a jump of time or position, or a pause: 1 times" in ask(monitor, STATUS).message
        found = ask(monitor, END)
        assert found.success and "did something touch the robot?" in found.message
        assert "# alarms by the thresholds in force during the run: 1;" in found.parameters


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"external_torque.gain": 31.0}, "another model, payload, gravity or parameter"),
        ({"gravity": [0.0, 0.0, -9.7]}, "another model, payload, gravity or parameter"),
        ({"external_torque.gain": 0.0}, "external_torque.gain was set to 0"),
    ],
)
def test_another_observer_ends_it(monitor, panda, changes, says):
    ask(monitor, START)
    with monitor.having(**changes):
        status = ask(monitor, STATUS)
        assert status.success and not status.running and says in status.message
        ended = ask(monitor, END)
        assert not ended.success and "proposes nothing" in ended.message and says in ended.message
        assert "no calibration run" in ask(monitor, STATUS).message


def test_another_robot_ends_it(monitor, panda):
    ask(monitor, START)
    with monitor.having(robot_description=panda.urdf):
        assert "another robot_description" in ask(monitor, END).message
        assert ask(monitor, START).success  # of the one in force
    monitor.connect(monitor.robot)


def test_what_is_asked_wrongly(monitor):
    assert "expected STATUS = 0" in ask(monitor, 17).message
    for rate in (-1.0, math.nan, math.inf):
        assert "false_alarms is" in ask(monitor, START, false_alarms=rate).message
    for action in (END, CANCEL):
        assert "no calibration run is on" in ask(monitor, action).message
    assert ask(monitor, START).success
    again = ask(monitor, START)
    assert not again.success and again.running and "end or cancel it first" in again.message
    assert "forgotten" in ask(monitor, CANCEL).message
    with monitor.having(**{"external_torque.gain": 0.0}):
        assert "set it first" in ask(monitor, START).message


@pytest.fixture
def held_up(peer, panda, monkeypatch):
    """The service on a node of this process, which has a run; thresholds are not found before `allowed` is set."""
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
    peer.wait_until(client.service_is_ready, "the service")

    def send(action):
        return client.call_async(Calibrate.Request(action=action, false_alarms=1.0))

    def answer(future):
        peer.wait_until(future.done, "an answer")
        return future.result()

    assert answer(send(START)).success
    residual = np.random.default_rng(5).normal(size=(4000, model.nv))
    torque.run.seen.take(np.arange(4000) * EVERY + S, residual, residual, np.ones(4000, dtype=bool))
    torque.run.first, torque.run.last = S, S + 3999 * EVERY
    yield SimpleNamespace(
        node=node, service=service, send=send, answer=answer, robot=robot_, allowed=allowed, begun=begun
    )
    allowed.set()
    service.destroy()
    peer.node.destroy_client(client)
    peer.drop_node(node)


def test_the_node_is_at_work_while_thresholds_are_found(peer, held_up):
    """Timers and requests are served in the time; a second END is refused, and the first one has its answer."""
    ticks, end = [], held_up.send(END)
    peer.wait_until(held_up.begun.is_set, "the thread")
    held_up.node.create_timer(0.001, lambda: ticks.append(1))
    peer.wait_until(lambda: len(ticks) >= 20, "ticks")
    assert "being found already" in held_up.answer(held_up.send(END)).message
    status = held_up.answer(held_up.send(STATUS))
    assert status.success and status.running and not end.done()
    held_up.robot.torque.run.seen.add(S + 4000 * EVERY, np.zeros(8), np.zeros(8))
    held_up.allowed.set()
    found = held_up.answer(end)
    assert (
        found.success and not found.running and found.states == 4000 and (np.array(found.joint_thresholds) > 1.0).all()
    )
    assert "79.98 s, 4000 states" in found.message and "external_torque" in found.parameters
    assert held_up.robot.torque.run is None


@pytest.mark.parametrize("by", ["cancel", "another robot", "the end of the node"])
def test_what_is_forgotten_while_thresholds_are_found(peer, held_up, by):
    end = held_up.send(END)
    peer.wait_until(held_up.begun.is_set, "the thread")
    if by == "cancel":
        assert "forgotten" in held_up.answer(held_up.send(CANCEL)).message
    elif by == "another robot":
        held_up.robot.torque.run.end("another robot_description is in force")
        held_up.allowed.set()
    else:
        held_up.service._stop()
    refused = held_up.answer(end)
    assert not refused.success and not refused.parameters and not refused.running
    assert ("another robot_description" if by == "another robot" else "forgotten while") in refused.message


def test_without_a_run_nothing_is_kept(panda):
    """A watch that no run listens to holds nothing of its states; one that does is told of in its report."""

    class Robot:
        model = dd.load_urdf(panda.path)

    observation = Observation(GAIN, math.inf, math.inf, False, 0.1)
    robot_ = Robot()
    robot_.torque = TorqueWatch(dd.DiagonalDynamics(robot_.model), observation)
    assert robot_.torque.run is None
    run = robot_.torque.run = CalibrationRun(robot_, 1.0)
    robot_.torque.forget()
    assert run.interrupted == 1 and not run.ended
    for interval in (0.2, 0.31):
        run.take(0, SimpleNamespace(valid=False, reason=f"no sample for {interval} s"), False)
    assert "states without a result: 2, no sample for 0.31 s (the last one)" in run.notes()
    robot_.torque.use(robot_.torque.dynamics, observation)
    assert run.ended and robot_.torque.run is None
