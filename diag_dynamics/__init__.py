"""Diagonalized Lagrangian dynamics of tree-structured robots (Jain and Rodriguez, 1995)."""

from importlib import import_module
from pkgutil import extend_path

# The generated msg/ and srv/ of the ROS 2 build live in another directory of the same package name.
__path__ = extend_path(__path__, __name__)

__version__ = "0.1.0"

# Loaded when first asked for: who imports only a message shall not wait for a compiler and a URDF library.
_HOME = {
    "load_urdf": "model",
    "Mimic": "model",
    "Payload": "model",
    "RobotModel": "model",
    "DiagonalDynamics": "dynamics",
    "BatchEvaluation": "results",
    "Evaluation": "results",
    "Factors": "results",
    "DiagDynamicsError": "exceptions",
    "InputError": "exceptions",
    "ModelError": "exceptions",
    "MasslessLinkError": "exceptions",
    "InertiaWarning": "exceptions",
    "MimicJointError": "exceptions",
    "SingularMassMatrixError": "exceptions",
    "UnsupportedError": "exceptions",
    "UrdfError": "exceptions",
    "CompliantLimits": "simulation",
    "EnergyAudit": "simulation",
    "Simulation": "simulation",
    "EffortRateLimiter": "control",
    "EffortSaturation": "control",
    "EnergyLimiter": "control",
    "GravityCompensation": "control",
    "JointTracking": "control",
    "PoseRegulation": "control",
    "PositionRepulsion": "control",
    "RateDamping": "control",
    "DisturbanceObserver": "control.observer",
}

__all__ = sorted(_HOME)


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted(set(globals()) | set(_HOME))
