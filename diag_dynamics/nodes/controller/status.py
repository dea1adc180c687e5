# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the controller says with every command, as a message."""

from diag_dynamics.control import PoseError
from diag_dynamics.msg import ControllerStatus
from diag_dynamics.nodes.support.diagnostics import shortened
from diag_dynamics.nodes.support.messages import doubles, to_time


def status_message(loop, sent):
    """Return ControllerStatus of a command that a loop has made."""
    command = sent.command
    model, limiter = loop.dynamics.model, loop.efforts.energy_limiter
    message = ControllerStatus(mode=loop.mode, phase=loop.supervisor.phase, message=shortened(loop.supervisor.reason))
    message.header.stamp, message.header.frame_id = to_time(sent.stamp), model.root_link
    message.dof_names, message.state_age = list(model.dof_names), sent.age
    message.effort_command, message.saturated_dofs = doubles(sent.effort), list(sent.saturated)
    message.energy, message.energy_limited = loop.energy, sent.energy_limited
    message.energy_limit_valid = limiter is not None
    message.energy_limit = limiter.limit if limiter else 0.0
    message.contact_limited = sent.contact_limited
    if (bound := loop.efforts.contact_limiter) and bound.seen and command is not None:
        message.contact_valid, message.contact_link = True, bound.seen.link
        message.contact_energy, message.contact_energy_limit = bound.seen.energy, bound.seen.limit
    if command is None:
        return message
    message.lyapunov, message.lyapunov_rate_predicted = command.lyapunov, command.lyapunov_rate
    message.lyapunov_valid = sent.lyapunov_rate is not None
    message.lyapunov_rate_measured = sent.lyapunov_rate or 0.0
    if isinstance(command.error, PoseError):
        message.pose_error_valid = True
        for field, vector in zip((message.position_error, message.orientation_error), command.error, strict=True):
            field.x, field.y, field.z = map(float, vector)
    elif command.error is not None:
        message.tracking_error, message.tracking_error_valid = doubles(command.error), True
    return message
