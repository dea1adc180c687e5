# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo of control: somebody pushes an arm, the monitor sees it, and the controller bounds the kinetic energy.

Simulator, controller and monitor are processes of their own on a real ROS 2 graph, in lockstep: simulated time goes on by the
controller's commands, so what is seen does not depend on how busy the machine is. Its last digits do: the push begins with
the step in which its message arrives, and meets another stretch of the sensors' noise if that is a later one.
"""

import argparse
import math
import os
import sys
import time
from pathlib import Path

from geometry_msgs.msg import WrenchStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from std_srvs.srv import Trigger

from diag_dynamics.control import EnergyLimiter, PoseRegulation, PositionRepulsion
from diag_dynamics.control.observer import DisturbanceObserver
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.msg import ControllerStatus, EnergyAudit, ExternalTorque
from diag_dynamics.nodes.demos.demo import NAMESPACE, Processes, prepared
from diag_dynamics.nodes.demos.energy_view import checked
from diag_dynamics.nodes.support.runner import run
from diag_dynamics.nodes.support.start import listen, stop
from diag_dynamics.srv import SetState
from diag_dynamics.views.push_history import Moment, PushHistory, Seen

HAND = "panda_hand"
READY = {f"panda_joint{k}": q for k, q in enumerate((0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8), 1)} | {
    "panda_finger_joint1": 0.02
}
"""Where the arm begins [rad, m]."""

FORCE = 40.0
"""Of the push, along the y axis of the world [N]."""

BOUND, THRESHOLD = 0.25, 8.0
"""On the kinetic energy [J], and of |r| [√J/s]."""

STILL = 1e-3
"""Kinetic energy below which the arm is at rest, but for the noise of its sensors [J]."""

REST, PUSH, RETURN = 1.0, 1.0, 2.5
"""How long the arm is left alone, pushed, and left alone again [s] of simulated time."""

PERIOD = 0.05
"""Of looking whether there is something to do [s]."""

PATIENCE = 120.0
"""How long the nodes may take for anything [s]."""

SIMULATOR = {"lockstep": True, "rate": 500.0, "wrench_axes": "world", "wrench_timeout": 0.0} | {
    "sensor_noise": [0.0, 0.001, 0.05]
}
CONTROLLER = {
    "use_sim_time": True,
    "autostart": True,
    "robot_compensates_gravity": False,
    "check_time": 0.0,
    "max_state_age": 0.5,
    "hold_time": 1.0,
    "initial_mode": "damping",  # being put elsewhere sets the arm in motion: its efforts are those of where it was
    "controlled_link": HAND,
    "energy_limit": BOUND,
    "observer_gain": 200.0,
}
MONITOR = {
    "use_sim_time": True,
    "effort_scale": ["*=1.0"],
    "effort_includes_gravity": ["*=true"],
    "external_torque.gain": 50.0,
    "external_torque.threshold": THRESHOLD,
    # Nobody waits for it in lockstep: what it is late for it has to find in its queue.
    f"qos_overrides.{NAMESPACE}/joint_states.subscription.reliability": "reliable",
    f"qos_overrides.{NAMESPACE}/joint_states.subscription.depth": 5000,
}


class PushView(Node):
    """Brings the arm where it begins, pushes it, and keeps what controller and monitor say meanwhile.

    Parameters
    ----------
    picture : Path
        Where the picture goes.
    watch : callable
        What it returns, if anything, is why the demo has to end.
    """

    def __init__(self, picture, watch=lambda: None, **kwargs):
        super().__init__("push_view", **kwargs)
        self.finished, self.failure = Future(), None
        self._picture, self._watch = picture, watch
        self._history = PushHistory(FORCE, BOUND, THRESHOLD, 0.5 * THRESHOLD)
        self._begin = self._pushing = None
        self._said = set()
        many = QoSProfile(depth=5000)
        self._wrenches = self.create_publisher(WrenchStamped, "external_wrench", 10)
        self.create_subscription(ControllerStatus, "diag_dynamics_controller/status", self._take_status, many)
        self.create_subscription(ExternalTorque, "diag_dynamics/external_torque", self._take_torque, many)
        self.create_subscription(EnergyAudit, "diag_dynamics_simulator/energy_audit", self._take_audit, many)
        to_begin = SetState.Request()
        to_begin.state.name, to_begin.state.position = list(READY), list(READY.values())
        # A controller without a target regulates the pose that it finds.
        self._calls = [
            (self.create_client(SetState, "diag_dynamics_simulator/set_state"), to_begin),
            (self.create_client(Trigger, "diag_dynamics_controller/mode/pose"), Trigger.Request()),
        ]
        self._asked, self._answer = 0.0, None
        self._moments = 0  # of which the controller has told
        self._still = self._observed = self._idle = False
        self._progress = time.monotonic()
        self.create_timer(PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- Before the push ---

    def _look(self):
        """Lead the arm to where it begins, and end where nothing goes on."""
        self.failure = self.failure or self._watch()
        if time.monotonic() - self._progress > PATIENCE:
            self.failure = self.failure or f"Nothing has happened for {PATIENCE:.0f} s: {self._missing()}."
        if self.failure and not self.finished.done():
            self.finished.set_result(None)
        if self._calls and self._still:
            self._call(*self._calls[0])

    def _missing(self):
        """What is waited for."""
        for here, what in (
            (self._moments, "the controller says nothing"),
            (self._still, "the arm does not come to rest"),
            (not self._calls, f"{self._calls and self._calls[0][0].srv_name} does not answer"),
            (self._observed, "the monitor has no result"),
            (self._idle, "the simulator says nothing"),
        ):
            if not here:
                return what
        return "the simulation stands still"

    def _call(self, client, request):
        """Ask until there is an answer: a service may be found by a client that it does not know yet."""
        if self._answer and self._answer.done():
            answer = self._answer.result()
            self._answer = None
            if answer.success:
                self._calls.pop(0)
                self._progress = time.monotonic()
            else:
                self.failure = f"{client.srv_name}: {answer.message}"
        elif client.service_is_ready() and time.monotonic() - self._asked > 1.0:
            self._asked, self._answer = time.monotonic(), client.call_async(request)

    # --- What is said ---

    def _take_status(self, message):
        now = _seconds(message.header.stamp)
        self._moments += 1
        controlled = message.phase == ControllerStatus.PHASE_ACTIVE
        self._still = controlled and message.energy < STILL
        if self._begin is None:
            if self._calls or not (self._still and self._observed and self._idle) or message.mode != "pose":
                return
            self._begin = now
            self._say(now, "the arm holds its hand where it is")
        if not controlled:
            self.failure = f"The controller has lost the arm: {message.message}"
        if self._over(now):  # and the monitor may be late
            return
        self._progress = time.monotonic()
        e = message.position_error
        displacement = math.sqrt(e.x * e.x + e.y * e.y + e.z * e.z)
        self._history.moments.append(Moment(now - self._begin, message.energy, message.energy_limited, displacement))
        if message.energy_limited and self._history.onset is not None:
            self._say(now, f"the limiter takes power out: K = {message.energy:.3f} J, its bound {BOUND:g} J")
        self._push(now)

    def _push(self, now):
        """Push and let go, each in its time."""
        if self._pushing is None and now - self._begin >= REST:
            self._wrench(FORCE)
            self._pushing = True
        onset = self._history.onset
        if self._pushing and onset is not None and now - self._begin - onset >= PUSH:
            self._wrench(0.0)
            self._pushing, self._history.end = False, now - self._begin
            self._say(now, "the push ends")

    def _over(self, now):
        """Whether all that is to be shown was before this time [s]."""
        return self._history.end is not None and now - self._begin - self._history.end >= RETURN

    def _wrench(self, force):
        message = WrenchStamped()
        message.header.frame_id, message.wrench.force.y = HAND, force
        self._wrenches.publish(message)

    def _take_torque(self, message):
        self._observed = message.valid
        now = _seconds(message.header.stamp)
        if self._begin is None or now < self._begin or not message.valid:
            return
        if self._over(now):
            if not self.finished.done():
                self.finished.set_result(None)
            return
        self._progress = time.monotonic()
        self._history.seen.append(Seen(now - self._begin, message.norm, message.collision))
        if message.collision:
            self._say(now, f"the monitor sees a collision: |r| = {message.norm:.1f} > {message.threshold:g} √J/s")
        elif self._history.end is not None and now - self._begin > self._history.end:
            self._say(now, "the monitor sees no collision any more")

    def _take_audit(self, message):
        """Work of wrenches tells when the push began: it is exactly zero before."""
        self._idle = message.wrenches == 0.0
        if not self._idle and self._begin is not None and self._history.onset is None:
            now = _seconds(message.header.stamp)
            self._history.onset = now - self._begin - 1.0 / SIMULATOR["rate"]
            self._say(now, f"somebody pushes the hand with {FORCE:g} N")

    def _say(self, now, what):
        """Say what happens, once."""
        key = what.split(":")[0]
        if key not in self._said:
            self._said.add(key)
            print(f"{now - self._begin:6.3f} s  {what}", flush=True)

    def conclude(self):
        """Say what there is to remember, and draw it; returns the exit status."""
        if not self.failure:
            failures = self._history.failures()
            if not failures:
                for line in self._history.summary():
                    print(line)
                self._history.picture(self._picture, "A push on an arm that holds its hand in place")
                print(f"picture: {self._picture.resolve()}")
                return 0
            self.failure = "\n".join(failures)
        print(self.failure, file=sys.stderr)
        return 1


def _seconds(stamp):
    return stamp.sec + stamp.nanosec / SECOND


def _compile_control(model):
    """Compile what the controller needs."""
    dynamics = DiagonalDynamics(model)
    PoseRegulation(dynamics, HAND, 12.0, 200.0, 20.0)
    PositionRepulsion(dynamics, 0.1, 100.0, 10.0)
    EnergyLimiter(dynamics, BOUND, 50.0)
    DisturbanceObserver(dynamics, 50.0, THRESHOLD)


def main(args=None):
    """Run the demo; ``--help`` lists the options."""
    parser = argparse.ArgumentParser(prog="demo_control", description=__doc__)
    parser.add_argument("--picture", type=Path, help="file for the picture (default: push_panda.png)")
    parser.set_defaults(duration=None)
    chosen = checked(parser, parser.parse_args(args))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")  # a demo is nobody else's business
    listen()
    processes, view = Processes(), None
    try:
        urdf = find_urdf("panda")
        prepared(urdf, _compile_control)
        print("an arm, its controller and the monitor start; the push comes within ten seconds", flush=True)
        processes.start("simulator", robot_description=urdf, **SIMULATOR)
        processes.start("controller", robot_description=urdf, **CONTROLLER)
        processes.start("monitor", robot_description=urdf, **MONITOR)

        def make_view():
            nonlocal view
            view = PushView(chosen.picture or Path("push_panda.png"), processes.failure, namespace=NAMESPACE)
            return view

        status = run(make_view)
        if stop.asked:
            status = 130
        elif view is not None:
            status = view.conclude()
    except DiagDynamicsError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        status = 1
    except KeyboardInterrupt:
        status = 130
    finally:
        processes.stop()
    return status


if __name__ == "__main__":
    sys.exit(main())
