"""The monitor node: joint_states and robot_description in, diagonalized dynamics out."""

import codecs
import sys
from collections import Counter

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.msg import (
    CoriolisTerm,
    DiagonalizedState,
    JointSpaceDynamics,
    KineticEnergy,
    MassMatrixFactors,
    TotalJointRates,
    WorkingMoments,
)
from diag_dynamics.nodes.diagnostics import Diagnostics, counted
from diag_dynamics.nodes.joint_states import JointStateAssembler, RejectedError, RobotState
from diag_dynamics.nodes.messages import MessageMaker, to_time
from diag_dynamics.nodes.odometry import OdometryBase
from diag_dynamics.nodes.parameters import Spec, declare, wrong
from diag_dynamics.nodes.robot import COMPILED, load_robot, single_joints
from diag_dynamics.nodes.robot import PARAMETERS as ROBOT_PARAMETERS
from diag_dynamics.nodes.runner import main_of
from diag_dynamics.nodes.services import DynamicsServices

TOPICS = {
    "total_joint_rates": (TotalJointRates, 0.0),
    "working_moments": (WorkingMoments, 0.0),
    "coriolis": (CoriolisTerm, 0.0),
    "mass_matrix_factors": (MassMatrixFactors, 50.0),
    "kinetic_energy": (KineticEnergy, 0.0),
    "joint_space_dynamics": (JointSpaceDynamics, 50.0),
    "state": (DiagonalizedState, 0.0),
}
"""Each output topic: its type, and the highest rate it is published at by default [Hz], 0 for every state."""

PARAMETERS = {
    "robot_description": Spec(
        "",
        "URDF, or the path of one. If it is empty, the topic robot_description is used, and used again whenever a new "
        "description arrives there.",
        read_only=True,
    ),
    **ROBOT_PARAMETERS,
    "odom_twist_frame": Spec(
        "child",
        "Axes of the twist in odom: those of child_frame_id (child), as REP 147 has it, or of header.frame_id (header).",
        read_only=True,
        choices=("child", "header"),
    ),
    "odom_timeout": Spec(
        0.5,
        "Largest time between the stamps of odom and of the joints [s]; 0 for no limit.",
        minimum=0.0,
    ),
    "joint_timeout": Spec(
        0.5,
        "Largest age of a joint's last values against the newest joint's [s]; where one is older, nothing is "
        "published. 0 for no limit.",
        minimum=0.0,
    ),
    "mimic_tolerance": Spec(
        0.01,
        "Largest distance of a coupled mimic joint's own position from that which its leader gives it [rad, m]; beyond it, "
        "diagnostics warn and services refuse. 0: not compared.",
        minimum=0.0,
    ),
    "publish_inverse_factor": Spec(False, "Whether mass_matrix_factors carries l, the inverse of m."),
    "publish_friction": Spec(
        False, "Whether state and coriolis carry the URDF's damping and friction, which no other term ever holds."
    ),
    **{
        f"max_rate.{topic}": Spec(rate, f"Highest rate of ~/{topic} [Hz]; 0 for every state.", minimum=0.0)
        for topic, (_, rate) in TOPICS.items()
    },
}


class RateLimit:
    """Lets through what comes no sooner than a period after what it let through before, by the stamps."""

    def __init__(self, rate):
        self._period = 1e9 / rate if rate else 0.0
        self._last = self._next = None

    def due(self, stamp):
        """Whether a message stamped `stamp` [ns] goes out, and note that it does."""
        if not self._period:
            return True
        # A hair early is on time, lest a source of exactly this rate with jittering stamps lose every second message.
        # A stamp before the last one means that time has started anew.
        if self._last is not None and self._last <= stamp < self._next - 0.05 * self._period:
            return False
        on_time = self._last is not None and abs(stamp - self._next) < self._period
        self._next = (self._next if on_time else stamp) + self._period
        self._last = stamp
        return True


class MonitorNode(Node):
    """See the module; parameters are in :data:`PARAMETERS`, topics in :data:`TOPICS`."""

    def __init__(self, **kwargs):
        super().__init__("diag_dynamics", **kwargs)
        self._values = values = declare(self, PARAMETERS)
        self._limits = {topic: RateLimit(values[f"max_rate.{topic}"]) for topic in TOPICS}
        self._out = {topic: self.create_publisher(kind, f"~/{topic}", 10) for topic, (kind, _) in TOPICS.items()}
        self._dynamics = self._maker = self._assembler = self._base = self._description = None
        self._revision = 0
        self._description_error = ""
        self._counts, self._last_counts = Counter(), Counter()
        self._last_rejection = ""
        self._last_stamp = None

        self.add_on_set_parameters_callback(self._set_parameters)
        DynamicsServices(self, self._in_force, self._use)
        self._diagnostics = Diagnostics(self, "joint states", self._report)
        if values["robot_description"]:
            self._load(values["robot_description"])
            if self._description_error:
                raise InputError(f"parameter 'robot_description' refused: {self._description_error}")
        else:
            once = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self.create_subscription(String, "robot_description", self._take_description, once)
            self.get_logger().info(f"Waiting for a robot on {self.resolve_topic_name('robot_description')}.")
        if values["floating_base"]:
            self.create_subscription(Odometry, "odom", self._take_odometry, qos_profile_sensor_data)
        self.create_subscription(JointState, "joint_states", self._take_joint_state, qos_profile_sensor_data)

    # --- The model ---

    def _take_description(self, message):
        # What comes from a topic is text and never a path: bytes are not looked up. It has been decoded already, whatever
        # encoding it declares, which the byte-order mark says.
        self._load(codecs.BOM_UTF8 + message.data.lstrip("\ufeff").encode(errors="replace"))

    def _load(self, description):
        """Make a new robot the one in force; keep the old one if the new one is not valid."""
        if description == self._description:
            self._description_error = ""
            return
        try:
            model = load_robot(self, description, self._values)
            dynamics = DiagonalDynamics(model)
            dynamics.compile(*COMPILED)
        except DiagDynamicsError as error:
            kept = f"; keeping robot '{self._dynamics.model.name}'" if self._dynamics else ""
            self._description_error = str(error)
            self.get_logger().error(f"robot_description refused{kept}: {error}")
            return
        except Exception as error:  # nothing that arrives may end the node
            self._description_error = f"internal error: {error!r}"
            self.get_logger().error(f"robot_description refused: {error!r}")
            return
        if self._dynamics and self._dynamics.model.payloads:
            gone = ", ".join(self._dynamics.model.payloads)
            self.get_logger().warning(f"The payloads on {gone} are gone with the robot_description they belonged to.")
        self._description, self._description_error = description, ""
        self._use(model, dynamics)
        self._assembler = JointStateAssembler(
            single_joints(model),
            self._values["joint_timeout"],
            model.mimics,
            self._values["mimic_tolerance"],
            model.continuous_joints,
        )
        self._base = OdometryBase(model, self._values["odom_twist_frame"] == "header") if model.floating_base else None
        self.get_logger().info(
            f"Ready: robot '{model.name}', {model.nv} degrees of freedom, {model.total_mass:.6g} kg; "
            f"listening to {self.resolve_topic_name('joint_states')}."
        )

    def _use(self, model, dynamics=None):
        """Put a model in force: another robot, or the same one with another payload or gravity."""
        self._revision += 1
        self._dynamics = dynamics or DiagonalDynamics(model)
        self._maker = MessageMaker(model, self._revision)

    def _in_force(self):
        """What the services work with."""
        return (self._dynamics, self._maker, self._assembler.followers) if self._dynamics else None

    # --- Every message ---

    def _take_joint_state(self, message):
        self._counts["received"] += 1
        if self._dynamics is None:
            self._counts["before the model"] += 1
            return
        self._guarded(lambda: self._evaluate(self._assembler.update(message, self._now())))

    def _take_odometry(self, message):
        self._counts["odometry received"] += 1
        if self._base is not None:
            self._guarded(lambda: self._use_odometry(message))

    def _use_odometry(self, message):
        self._base.update(message, self._now())
        if not self._assembler.names:  # a robot that is all base: no joint state will ever come
            nothing, at = np.zeros(0), self._base.stamp
            self._evaluate(RobotState(nothing, nothing, None, at, at, False))

    def _evaluate(self, state):
        if state is not None and self._base is not None:
            state = self._base.with_joints(state, self._values["odom_timeout"])
            self._counts["before odometry"] += state is None
        if state is not None:
            self._publish(state)
            self._counts["published"] += 1
            self._last_stamp = state.newest

    def _guarded(self, action):
        """Nothing that arrives may end the node."""
        try:
            action()
        except RejectedError as rejection:
            self._reject(rejection.cause, str(rejection))
        except DiagDynamicsError as error:
            self._reject(type(error).__name__, str(error))
        except Exception as error:
            self._reject("internal error", repr(error))

    def _now(self):
        return self.get_clock().now().nanoseconds

    def _reject(self, cause, message):
        self._counts[f"rejected: {cause}"] += 1
        self._last_rejection = message
        self.get_logger().warning(f"Rejected: {message}", throttle_duration_sec=5.0)

    def _publish(self, state):
        """Evaluate, and publish where somebody listens."""
        dynamics, maker = self._dynamics, self._maker
        q, qd = state.position, state.velocity
        s = dynamics.evaluate(q, qd, state.effort, friction=self._values["publish_friction"])
        stamp, inverse = to_time(state.newest), self._values["publish_inverse_factor"]
        for topic, make in (
            ("state", lambda: maker.state(stamp, s, state)),
            ("kinetic_energy", lambda: maker.kinetic_energy(stamp, s, state)),
            ("total_joint_rates", lambda: maker.total_joint_rates(stamp, s, state)),
            ("working_moments", lambda: maker.working_moments(stamp, s, state)),
            ("coriolis", lambda: maker.coriolis(stamp, s, state)),
            ("mass_matrix_factors", lambda: maker.mass_matrix_factors(stamp, dynamics.factors(q), inverse, state)),
            ("joint_space_dynamics", lambda: self._joint_space_dynamics(stamp, q, qd, state)),
        ):
            publisher = self._out[topic]
            if publisher.get_subscription_count() and self._limits[topic].due(state.newest):
                publisher.publish(make())

    def _joint_space_dynamics(self, stamp, q, qd, state):
        dynamics = self._dynamics
        M, c, g = dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
        return self._maker.joint_space_dynamics(stamp, M, c, g, state)

    # --- Parameters and diagnostics ---

    def _set_parameters(self, parameters):
        for parameter in parameters:
            reason = wrong(parameter.name, parameter.value, PARAMETERS)
            if reason:
                return SetParametersResult(successful=False, reason=reason)
        for parameter in parameters:
            self._apply(parameter.name, parameter.value)
        return SetParametersResult(successful=True)

    def _apply(self, name, value):
        self._values[name] = value
        if name.startswith("max_rate."):
            self._limits[name.removeprefix("max_rate.")] = RateLimit(value)
        elif name == "joint_timeout" and self._assembler:
            self._assembler.timeout = value
        elif name == "mimic_tolerance" and self._assembler:
            self._assembler.followers.tolerance = value
        elif name == "gravity" and self._dynamics:
            self._use(self._dynamics.model.with_gravity(value))

    def _report(self):
        counts = self._counts + (self._assembler.counts if self._assembler else Counter())
        recent = counts - self._last_counts
        self._last_counts = counts
        level, message = self._judge(recent)
        values = {"input rate [Hz]": recent["received"], "output rate [Hz]": recent["published"]}
        if self._dynamics:
            model = self._dynamics.model
            values |= {
                "robot": model.name,
                "degrees of freedom": model.nv,
                "total mass [kg]": f"{model.total_mass:.6g}",
                "mimic joints": counted(model.mimics),
                "locked joints": counted(model.locked_joints),
            }
        if self._last_stamp is not None:
            age = (self.get_clock().now().nanoseconds - self._last_stamp) * 1e-9
            values["age of the last state [s]"] = f"{age:.6f}"
        values |= dict(sorted(counts.items()))
        if self._last_rejection:
            values["last rejection"] = self._last_rejection
        if self._assembler and self._assembler.last_disagreement:
            values["last mimic disagreement"] = self._assembler.last_disagreement
        return level, message, values

    def _judge(self, recent):
        """Level and message for what happened within the last second."""
        if self._description_error:
            return DiagnosticStatus.ERROR, f"robot_description refused: {self._description_error}"
        if self._dynamics is None:
            return DiagnosticStatus.WARN, "no robot_description yet"
        rejected = sum(count for cause, count in recent.items() if cause.startswith("rejected"))
        disagreeing = recent["mimic disagreement"]
        if rejected:
            return DiagnosticStatus.WARN, f"{rejected} messages rejected: {self._last_rejection}"
        if disagreeing:
            return (
                DiagnosticStatus.WARN,
                f"{disagreeing} messages with mimic joints astray: {self._assembler.last_disagreement}",
            )
        if recent["published"]:
            return DiagnosticStatus.OK, "publishing"
        if recent["before odometry"]:
            return DiagnosticStatus.WARN, f"no odometry yet on {self.resolve_topic_name('odom')}"
        missing = self._assembler.missing
        if recent["received"] and missing:
            return DiagnosticStatus.WARN, f"joints that never arrived: {', '.join(missing)}"
        return DiagnosticStatus.STALE, "no joint states"


main = main_of(MonitorNode)

if __name__ == "__main__":
    sys.exit(main())
