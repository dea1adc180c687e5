# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Watches of external torque and of loads: topics, reaction, log and statuses."""

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.monitor.external_torque import TorqueWatch, check_load_link
from diag_dynamics.nodes.monitor.services import NO_PAYLOAD
from diag_dynamics.nodes.monitor.watch import Watch
from diag_dynamics.text import shortened


class CollisionWatch(Watch):
    """Collisions and contacts by a TorqueWatch, which is None without an observer: `torque`."""

    def __init__(self, robot, node):
        super().__init__(robot, node)
        self.torque = self._options = None
        self._unobserved_frames = set()  # that the log has

    def configure(self, dynamics, settings):
        """See Watch. The observer restarts if model, parameters or input options changed."""
        model, observation = dynamics.model, settings.observation
        for frame in settings.frames:
            if frame not in model.link_names or not model.placement_in_body(frame)[0]:
                raise InputError(
                    f"parameter 'external_wrench.frames' has '{frame}', expected links of robot "
                    f"'{model.name}' that a joint moves."
                )
        link = settings.values["load.link"]
        check_load_link(model, link)
        if observation:
            observation.collision.of_names(model.dof_names)
            observation.contact.of_names(model.dof_names, "contact.threshold")
            observation.covariance_of(model.dof_names)
        options = observation, settings.inputs._replace(stuck_timeout=0.0), link
        before, self._options = self._options, options
        if observation is None:
            self.torque = None
        elif self.torque is None:
            self.torque = TorqueWatch(dynamics, observation, link)
        elif self.torque.dynamics is not dynamics or before != options:
            self.torque.use(dynamics, observation, link)
        if settings.frames:
            dynamics.compile("wrench")
        if observation and observation.covariance:
            dynamics.compile("touched_link", "wrench")  # wrench: of markers

    def accept(self, moment):
        """See Watch. A collision starts the reaction before anything else."""
        if self.torque is None:
            return []
        state = moment.state
        if self._robot.effort_problem(self._node.commands):
            state = state._replace(effort=None, partial=None)
        is_worse = self.torque.accept_state(state)
        self._node.reaction.accept_state(self.torque, moment.received)
        log = self._node.get_logger()
        if self.torque.begins:
            log.warning(shortened(f"Collision: {self.torque.cause}."))
        elif self.torque.contact_begins:
            text = shortened(f"Contact: {self.torque.contact_cause}.")
            log.info(text, throttle_duration_sec=1.0)
        return [self._status(), *self._node.reaction.report()] if is_worse else []

    def publish(self, moment, outputs):
        """See Watch."""
        torque, robot, state = self.torque, self._robot, moment.state
        if torque is None:
            return
        outputs.publish_beside(
            "external_torque",
            state.newest,
            lambda: robot.encoder.external_torque(
                torque.seen, state, torque.alarming, torque.touched
            ),
        )
        if not robot.settings.frames:
            return
        withheld = outputs.publish_wrenches(state.newest, robot.wrench, robot.encoder, state)
        torque.withheld_wrenches += len(withheld)
        if frames := set(withheld) - self._unobserved_frames:
            self._unobserved_frames |= frames
            self._node.get_logger().warning(
                f"No external wrench at {shortened(', '.join(sorted(frames)))}: the joints do "
                "not observe all directions (docs/external-wrench.md)."
            )

    def forget(self):
        """See Watch."""
        if self.torque:
            self.torque.forget()

    def _status(self):
        return self.torque.report(self._robot.assembler.without_effort)

    def report(self):
        """See Watch."""
        if self.torque is None:
            return []
        status = self._status()
        self.torque.start_interval()
        return [status]


class LoadReports(Watch):
    """The load that the TorqueWatch of a robot estimates, if `load.link` is set."""

    @property
    def _load(self):
        return self._robot.torque and self._robot.torque.load

    def publish(self, moment, outputs):
        """See Watch."""
        if not (load := self._load):
            return
        robot, state = self._robot, moment.state
        payload = robot.model.payloads.get(load.link, NO_PAYLOAD)
        outputs.publish_beside(
            "load",
            state.newest,
            lambda: robot.encoder.load(load.link, load.estimate, payload, state),
        )
        if load.begins:
            change = "Picked up" if load.estimate.mass > 0.0 else "Put down"
            self._node.get_logger().info(shortened(f"{change}: {load.describe()}."))

    def report(self):
        """See Watch."""
        return [self._load.report()] if self._load else []
