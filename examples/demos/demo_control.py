# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A push on an arm under control: the monitor detects it, the controller bounds the kinetic energy.

Simulator, controller and monitor run in this process, in lockstep: simulated time depends on the controller's commands,
not on the load of the machine. `python examples/demos/demo_control.py push.png` writes a picture.
"""

import os
import sys

import numpy as np
from diag_dynamics.msg import ControllerStatus, ExternalTorque
from diag_dynamics.srv import SetState
from geometry_msgs.msg import WrenchStamped
from matplotlib.figure import Figure
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.nodes.controller.controller import ControllerNode
from diag_dynamics.nodes.monitor.monitor import MonitorNode
from diag_dynamics.nodes.simulator import SimulatorNode
from diag_dynamics.nodes.support import runner

POSE = {f"panda_joint{k}": q for k, q in enumerate((0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8), 1)}
POSE["panda_finger_joint1"] = 0.02
FORCE, BOUND, THRESHOLD = 40.0, 0.25, 8.0
"""Force on the hand along the y axis of the world [N], bound of the kinetic energy [J], threshold of |r| [√J/s]."""
REST, PUSH, RETURN, AT_REST = 1.0, 1.0, 2.5, 1e-3
"""Simulated time before, during and after the push [s]; kinetic energy of the arm at rest [J]."""

NAMESPACE = f"/demo_control_{os.getpid()}"
QOS = f"qos_overrides.{NAMESPACE}/joint_states.subscription"
SIMULATOR = {"lockstep": True, "rate": 500.0, "wrench_axes": "world", "wrench_timeout": 0.0}
CONTROLLER = {
    "use_sim_time": True,
    "autostart": True,
    "robot_compensates_gravity": False,
}
CONTROLLER |= {
    "max_state_age": 0.5,
    "hold_time": 1.0,
    "initial_mode": "damping",
    "controlled_link": "panda_hand",
}
MONITOR = {"use_sim_time": True, "effort_scale": ["*=1.0"], "effort_includes_gravity": ["*=true"]}
MONITOR |= {"external_torque.gain": 50.0, "collision.threshold": [f"norm={THRESHOLD}"]}
NODES = {
    SimulatorNode: SIMULATOR | {"sensor_noise": [0.0, 0.001, 0.05]},
    ControllerNode: CONTROLLER | {"energy_limit": BOUND, "observer_gain": 200.0},
    MonitorNode: MONITOR
    | {f"{QOS}.reliability": "reliable", f"{QOS}.depth": 5000},  # lockstep does not wait for it
}


class PushNode(Node):
    """Moves the arm to its pose, pushes it, and stores what controller and monitor publish."""

    def __init__(self, picture):
        super().__init__("push")
        self._picture = picture
        self.finished, self.commands, self.residuals = Future(), [], []
        self.begin = self.onset = self.end = None
        self._status, self._story = ControllerStatus(), self._tell_story()
        self._condition = next(self._story)
        self._wrenches = self.create_publisher(WrenchStamped, "external_wrench", 10)
        self.create_subscription(
            ControllerStatus, "diag_dynamics_controller/status", self._accept_status, 5000
        )
        self.create_subscription(
            ExternalTorque, "diag_dynamics/external_torque", self._accept_torque, 5000
        )

    def _tell_story(self):
        """Yield the conditions under which the demo goes on."""
        to_pose = SetState.Request()
        to_pose.state.name, to_pose.state.position = list(POSE), list(POSE.values())
        yield self._is_at_rest
        yield from self._call(SetState, "diag_dynamics_simulator/set_state", to_pose)
        yield from self._call(Trigger, "diag_dynamics_controller/mode/pose", Trigger.Request())
        yield lambda: self._is_at_rest() and self.residuals and self._status.mode == "pose"
        self.begin = self._now()
        self._say("the controller holds the hand in its place", self.begin)
        yield lambda: self._now() >= self.begin + REST
        self.onset = self._push(FORCE, f"a force of {FORCE:g} N pushes the hand")
        yield lambda: self._now() >= self.onset + PUSH
        self.end = self._push(0.0, "the push ends")
        yield lambda: self.residuals[-1][0] >= self.end + RETURN
        self.finished.set_result(report(self, self._picture))  # the shutdown may hang
        yield lambda: False

    def _call(self, kind, name, request):
        client = self.create_client(kind, name)
        yield client.service_is_ready
        future = client.call_async(request)
        yield future.done
        if not future.result().success:
            raise RuntimeError(f"{name}: {future.result().message}")

    def _push(self, force, text):
        message = WrenchStamped()
        message.header.frame_id, message.wrench.force.y = "panda_hand", force
        self._wrenches.publish(message)
        self._say(text, self._now())
        return self._now()

    def _accept_status(self, message):
        self._status, error = message, message.position_error
        displacement = np.linalg.norm([error.x, error.y, error.z])
        self.commands.append((self._now(), message.energy, message.energy_limited, displacement))
        if self.begin and message.phase != ControllerStatus.PHASE_ACTIVE:
            raise RuntimeError(f"the controller is not active: {message.message}")
        while self._condition():
            self._condition = next(self._story)

    def _accept_torque(self, message):
        if message.valid:
            stamp, before = (
                seconds(message.header.stamp),
                bool(self.residuals and self.residuals[-1][2]),
            )
            self.residuals.append((stamp, message.norm, message.collision))
            if self.begin and message.collision != before:
                self._say(
                    f"the monitor reports {'a' if message.collision else 'no'} collision", stamp
                )

    def _now(self):
        return seconds(self._status.header.stamp)

    def _is_at_rest(self):
        return self._status.phase == ControllerStatus.PHASE_ACTIVE and self._status.energy < AT_REST

    def _say(self, text, stamp):
        print(f"{stamp - self.begin:6.3f} s  {text}", flush=True)


def seconds(stamp):
    """Return a stamp in seconds."""
    return stamp.sec + 1e-9 * stamp.nanosec


def summarize(node):
    """Print what has happened; return the series of the picture, and whether all was as it should be."""
    commands, residuals = (np.array(rows, dtype=float) for rows in (node.commands, node.residuals))
    commands, residuals = (
        commands[commands[:, 0] >= node.begin],
        residuals[residuals[:, 0] >= node.begin],
    )
    (t, energy, limited, displacement), (r_t, norm, collision) = commands.T, residuals.T
    pushed, quiet = (t >= node.onset) & (t <= node.end), r_t < node.onset
    detected, over = r_t[~quiet & (collision > 0)], r_t[(r_t > node.end) & (collision == 0)]
    if not (len(detected) and len(over)) or collision[quiet].any():
        raise RuntimeError("the push was not detected, or something else was")
    delay, rest = 1e3 * (detected[0] - node.onset), 1e3 * (over[0] - node.end)
    print(
        f"push of {FORCE:g} N for {node.end - node.onset:.2f} s: collision after {delay:.0f} ms, ",
        end="",
    )
    print(f"over {rest:.0f} ms after its end")
    print(
        f"|r| at most {norm.max():.1f} √J/s, before the push {norm[quiet].max():.1f}, threshold {THRESHOLD:g}"
    )
    print(
        f"K at most {energy.max():.4f} J, its bound {BOUND:g} J ({100 * (energy.max() / BOUND - 1):+.1f} %)"
    )
    print(
        f"during the push the limiter acted on {100 * limited[pushed].mean():.0f} % of the commands"
    )
    print(
        f"hand moved by {1e3 * displacement.max():.0f} mm, and back to within {1e3 * displacement[-1]:.1f} mm"
    )
    series = (t, energy, limited), (r_t, norm, collision), (t, 1e3 * displacement, limited)
    return series, energy.max() <= 1.05 * BOUND and limited[pushed].any()


def draw(path, node, series):
    """Draw kinetic energy, external torque and displacement over time."""
    figure = Figure(figsize=(9, 7.5), layout="constrained")
    panels = (
        ("kinetic energy [J]", "K", "#0b6fb8", BOUND, "bound", "limiter acts"),
        ("external torque |r| [√J/s]", "|r|", "#d1495b", THRESHOLD, "threshold", "collision"),
        ("hand off its place [mm]", "displacement", "#3d7a4a", None, "", ""),
    )
    all_axes = figure.subplots(3, 1, sharex=True)
    for axes, panel, (t, values, active) in zip(all_axes, panels, series, strict=True):
        title, label, color, bound, bound_label, strip = panel
        axes.axvspan(0.0, node.end - node.onset, color="#efefef", lw=0, label=f"push, {FORCE:g} N")
        axes.plot(t - node.onset, values, color=color, label=label)
        axes.set(ylabel=title, ylim=(0.0, 1.35 * max(bound or 0.0, values.max())))
        if bound:
            axes.axhline(bound, color=color, lw=1.0, ls="--", label=f"{bound_label}, {bound:g}")
            top = {
                "transform": axes.get_xaxis_transform(),
                "color": color,
                "alpha": 0.5,
                "lw": 0,
                "step": "post",
            }
            axes.fill_between(t - node.onset, 0.94, 1.0, where=active > 0, label=strip, **top)
        axes.margins(x=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=9)
    axes.set_xlabel("time since the push began [s]")
    figure.savefig(path, dpi=120)


def report(node, picture):
    """Print the result and draw its picture; return whether all was as it should be."""
    series, succeeded = summarize(node)
    if picture:
        draw(picture, node, series)
    return succeeded


def main(picture=None):
    """Run the demo; the status is 1 where the push was not detected or the kinetic energy not bounded."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    nodes = []

    def make_nodes():
        for kind, values in NODES.items():
            values = values | {"robot_description": str(find_urdf("panda"))}
            nodes.append(
                kind(
                    parameter_overrides=[
                        Parameter(name, value=value) for name, value in values.items()
                    ]
                )
            )
        nodes.append(PushNode(picture))
        return nodes[:]

    print(
        "an arm, its controller and the monitor start; the push follows within seconds", flush=True
    )
    names = ["-r", f"__ns:={NAMESPACE}", "-r", "/clock:=clock"]
    logs = ["--log-level", "ERROR"]  # warnings of modes and collisions would repeat the story
    runner.SHUTDOWN_TIMEOUT = 60.0  # [s], for several nodes on a busy machine
    status = runner.run(make_nodes, ["demo_control", "--ros-args", *names, *logs])
    if status or not nodes[-1].finished.done():
        return status or 130
    return 0 if nodes[-1].finished.result() else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
