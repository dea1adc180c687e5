# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exceptions of the package; each names the thing, its value and what was expected."""

from __future__ import annotations

from collections.abc import Iterable

from diag_dynamics.text import shortened


def shown(error: BaseException) -> str:
    """Return the text of an exception, shortened and without control characters."""
    return shortened(str(error.args[0])) if error.args else ""


class DiagDynamicsError(Exception):
    """Base of all exceptions of this package.

    ``str`` escapes control characters, see `diag_dynamics.text.plain`; `args` keep them.
    """

    def __str__(self) -> str:
        return shown(self)


class InputError(DiagDynamicsError, ValueError):
    """An argument has the wrong shape, type or value.

    The text names the argument, its value and the expectation.
    """


class ModelError(DiagDynamicsError, ValueError):
    """A robot cannot be turned into a model.

    Catch it for all faults of a file; its subclasses tell them apart.
    """


class UrdfError(ModelError):
    """A URDF is malformed, or not a tree of links and known joints.

    The text names the link, joint or element to correct.
    """


class UnsupportedError(ModelError, NotImplementedError):
    """A feature of the robot, or an option, that this version does not offer yet.

    The file is valid; the robot may load without the feature, or with another option.
    """


class ModelWarning(UserWarning):
    """The file of a robot has a probable mistake, or a feature that the model ignores.

    The robot loads; `diag-dynamics inspect` has all findings. Python can make it an error.
    """

    def __str__(self) -> str:
        return shown(self)


class InertiaWarning(ModelWarning):
    """A link's inertia is not that of a rigid body; the model uses it as it is.

    Results are those of the inertia in the file.
    """


class LoopWarning(ModelWarning):
    """A closed loop or a ball joint is nearly singular, or the start is a dead point of a motor.

    Rates of dependent joints are large there, and results lose digits.
    """


class LoopError(UrdfError):
    """A closed loop cannot be built from its description, or closed at these positions.

    The text names the loop, or its joint, to correct.
    """


class MimicJointError(UrdfError):
    """Mimic joints are coupled in a way that the model does not support.

    Attributes
    ----------
    joints : tuple of str
        The joints concerned.
    """

    def __init__(self, message: str, joints: Iterable[str]) -> None:
        super().__init__(message, joints)
        self.joints: tuple[str, ...] = tuple(joints)


class MasslessLinkError(ModelError):
    """Joints that move no inertia about (or along) their axis: the mass matrix is singular.

    Attributes
    ----------
    joints : tuple of str
        The joints concerned, base to tip.
    articulated_inertia : tuple of float
        D of each of them [kg m², prismatic: kg].
    """

    def __init__(
        self, message: str, joints: Iterable[str], articulated_inertia: Iterable[float]
    ) -> None:
        super().__init__(message, joints, articulated_inertia)
        self.joints: tuple[str, ...] = tuple(joints)
        self.articulated_inertia: tuple[float, ...] = tuple(map(float, articulated_inertia))


class SingularMassMatrixError(DiagDynamicsError, ArithmeticError):
    """The mass matrix is singular at the given configuration, though not at others.

    Attributes
    ----------
    joint : str
        The first joint, from the tip, without articulated inertia.
    articulated_inertia : float
        Its D [kg m², prismatic: kg].
    """

    def __init__(self, message: str, joint: str, articulated_inertia: float) -> None:
        super().__init__(message, joint, articulated_inertia)
        self.joint = joint
        self.articulated_inertia = articulated_inertia


class RejectedError(Exception):
    """A message, or the state that it completes, is invalid; `cause` is a short key for counts."""

    def __init__(self, cause: str, message: str) -> None:
        super().__init__(message)
        self.cause = cause

    def __str__(self) -> str:
        return shown(self)


def cause_of(error: Exception) -> str:
    """Return the cause by which a rejected message or state is counted."""
    if isinstance(error, RejectedError):
        return error.cause
    return type(error).__name__ if isinstance(error, DiagDynamicsError) else "internal error"


# --- Names of other libraries

FOREIGN_NAMES = {
    "dyn.inverse_dynamics": "rnea mj_inverse qfrc_inverse",
    "dyn.forward_dynamics": "aba forwardDynamics mj_forward qacc",
    "dyn.mass_matrix": "crba mj_fullM mj_crb",
    "dyn.inverse_mass_matrix": "computeMinverse mj_solveM",
    "dyn.factors": "cholesky mj_factorM qLD",
    "dyn.coriolis_torque + dyn.gravity_torque": "nle nonLinearEffects mj_rne qfrc_bias",
    "dyn.coriolis_matrix_times": "computeCoriolisMatrix getCoriolisMatrix",
    "dyn.gravity_torque": "computeGeneralizedGravity",
    "dyn.friction_torque": "qfrc_passive",
    "dyn.potential_energy": "computePotentialEnergy mj_energyPos",
    "dyn.evaluate": "computeAllTerms computeKineticEnergy mj_energyVel",
    "dyn.center_of_mass": "centerOfMass jacobian_com jacobianCenterOfMass subtree_com "
    "mj_jacSubtreeCom",
    "dyn.regressor": "computeJointTorqueRegressor",
    "dyn.placement": "framesForwardKinematics updateFramePlacements oMf mj_kinematics xpos xmat",
    "dyn.jacobian": "computeFrameJacobian getFrameJacobian mj_jac mj_jacBody",
    "dyn.link_velocity": "getFrameVelocity mj_objectVelocity cvel",
    "dyn.link_acceleration": "getFrameClassicalAcceleration getFrameAcceleration "
    "mj_objectAcceleration",
    "model.dof_names": "names idx_vs jnt_dofadr",
    "model.link_names": "frames getFrameId nbody",
    "model.lower": "lowerPositionLimit jnt_range",
    "model.upper": "upperPositionLimit",
    "model.effort_limit": "effortLimit jnt_actfrcrange",
    "model.velocity_limit": "velocityLimit",
    "model.armature": "rotorInertia dof_armature",
    "model.total_mass": "computeTotalMass mj_getTotalmass",
    "model.neutral": "neutral qpos0",
    "model.random": "randomConfiguration",
    "model.integrate": "integrate mj_integratePos",
    "model.difference": "difference mj_differentiatePos",
    "dd.load_urdf": "buildModelFromUrdf buildModelFromXML",
    "dd.load_mjcf": "buildModelFromMJCF MjModel",
    "dd.DiagonalDynamics": "createData Data MjData",
    "dd.Simulation": "mj_step",
}
"""Names in Pinocchio, then in MuJoCo, by those here; docs/names.md has what differs."""


def attribute_error(owner: object, name: str) -> AttributeError:
    """Return the error of an attribute that an object or the package does not have."""
    kind = owner if isinstance(owner, str) else type(owner).__name__
    text = f"{kind} has no attribute {name!r}"
    for substitute, names in FOREIGN_NAMES.items():
        if name in names.split():
            return AttributeError(
                f"{text}; expected {substitute}. docs/names.md lists what differs."
            )
    return AttributeError(text, name=name, obj=owner)
