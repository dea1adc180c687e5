# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Diagonalized Lagrangian dynamics of tree-structured robots (Jain and Rodriguez, 1995)."""

import typing as _typing
from importlib import import_module as _import_module
from pkgutil import extend_path as _extend_path

# The generated msg/ and srv/ of the ROS 2 build live in another directory of the same package name.
__path__ = _extend_path(__path__, __name__)

__version__ = "0.2.0"

# Imported when first used: a program that imports only a message does not wait for a compiler.
_NAMES = {
    "model": "Curve FlexibleJoint FlexibleLink JointParameters Loop LoopEnd Mimic Parameters "
    "Payload RobotModel load_mjcf load_robot load_urdf",
    "dynamics": "DiagonalDynamics",
    "dynamics.flexible_joints": "FlexibleDynamics",
    "results": "Evaluation",
    "exceptions": "DiagDynamicsError InertiaWarning InputError LoopError LoopWarning "
    "MasslessLinkError MimicJointError ModelError ModelWarning SingularMassMatrixError "
    "UnsupportedError UrdfError",
    "collision.link_geometry": "link_geometry",
    "collision.contact_points": "BodyRegion ContactLimits ContactPoint ContactPoints",
    "simulation": "CompliantLimits Simulation",
    "control.adaptive": "AdaptiveTracking",
    "control.laws": "GravityCompensation JointRegulation JointTracking PoseRegulation RateDamping",
    "control.filters": "Limits",
    "control.limiters": "ContactLimiter EnergyLimiter PositionRepulsion",
    "control.load": "LoadEstimator",
    "control.observer": "DisturbanceObserver",
    "control.tank": "EnergyTank",
    "collision.detector": "Detector Thresholds",
    "collision.calibration": "Calibration",
    "recordings.recording": "Recording read_recording stream_recording",
    "recordings.fleet_analysis": "analyse_fleet",
    "recordings.external_torque": "observe",
    "recordings.threshold_calibration": "calibrate",
    "identification.excitation": "excite",
    "identification.fitting": "identify",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}
_MODULES = ("plot",)  # public modules

if _typing.TYPE_CHECKING:  # for editors and type checkers
    from diag_dynamics import plot as plot
    from diag_dynamics.collision.calibration import Calibration as Calibration
    from diag_dynamics.collision.contact_points import BodyRegion as BodyRegion
    from diag_dynamics.collision.contact_points import ContactLimits as ContactLimits
    from diag_dynamics.collision.contact_points import ContactPoint as ContactPoint
    from diag_dynamics.collision.contact_points import ContactPoints as ContactPoints
    from diag_dynamics.collision.detector import Detector as Detector
    from diag_dynamics.collision.detector import Thresholds as Thresholds
    from diag_dynamics.collision.link_geometry import link_geometry as link_geometry
    from diag_dynamics.control.adaptive import AdaptiveTracking as AdaptiveTracking
    from diag_dynamics.control.filters import Limits as Limits
    from diag_dynamics.control.laws import GravityCompensation as GravityCompensation
    from diag_dynamics.control.laws import JointRegulation as JointRegulation
    from diag_dynamics.control.laws import JointTracking as JointTracking
    from diag_dynamics.control.laws import PoseRegulation as PoseRegulation
    from diag_dynamics.control.laws import RateDamping as RateDamping
    from diag_dynamics.control.limiters import ContactLimiter as ContactLimiter
    from diag_dynamics.control.limiters import EnergyLimiter as EnergyLimiter
    from diag_dynamics.control.limiters import PositionRepulsion as PositionRepulsion
    from diag_dynamics.control.load import LoadEstimator as LoadEstimator
    from diag_dynamics.control.observer import DisturbanceObserver as DisturbanceObserver
    from diag_dynamics.control.tank import EnergyTank as EnergyTank
    from diag_dynamics.dynamics import DiagonalDynamics as DiagonalDynamics
    from diag_dynamics.dynamics.flexible_joints import FlexibleDynamics as FlexibleDynamics
    from diag_dynamics.exceptions import DiagDynamicsError as DiagDynamicsError
    from diag_dynamics.exceptions import InertiaWarning as InertiaWarning
    from diag_dynamics.exceptions import InputError as InputError
    from diag_dynamics.exceptions import LoopError as LoopError
    from diag_dynamics.exceptions import LoopWarning as LoopWarning
    from diag_dynamics.exceptions import MasslessLinkError as MasslessLinkError
    from diag_dynamics.exceptions import MimicJointError as MimicJointError
    from diag_dynamics.exceptions import ModelError as ModelError
    from diag_dynamics.exceptions import ModelWarning as ModelWarning
    from diag_dynamics.exceptions import SingularMassMatrixError as SingularMassMatrixError
    from diag_dynamics.exceptions import UnsupportedError as UnsupportedError
    from diag_dynamics.exceptions import UrdfError as UrdfError
    from diag_dynamics.identification.excitation import excite as excite
    from diag_dynamics.identification.fitting import identify as identify
    from diag_dynamics.model import Curve as Curve
    from diag_dynamics.model import FlexibleJoint as FlexibleJoint
    from diag_dynamics.model import FlexibleLink as FlexibleLink
    from diag_dynamics.model import JointParameters as JointParameters
    from diag_dynamics.model import Loop as Loop
    from diag_dynamics.model import LoopEnd as LoopEnd
    from diag_dynamics.model import Mimic as Mimic
    from diag_dynamics.model import Parameters as Parameters
    from diag_dynamics.model import Payload as Payload
    from diag_dynamics.model import RobotModel as RobotModel
    from diag_dynamics.model import load_mjcf as load_mjcf
    from diag_dynamics.model import load_robot as load_robot
    from diag_dynamics.model import load_urdf as load_urdf
    from diag_dynamics.recordings.external_torque import observe as observe
    from diag_dynamics.recordings.fleet_analysis import analyse_fleet as analyse_fleet
    from diag_dynamics.recordings.recording import Recording as Recording
    from diag_dynamics.recordings.recording import read_recording as read_recording
    from diag_dynamics.recordings.recording import stream_recording as stream_recording
    from diag_dynamics.recordings.threshold_calibration import calibrate as calibrate
    from diag_dynamics.results import Evaluation as Evaluation
    from diag_dynamics.simulation import CompliantLimits as CompliantLimits
    from diag_dynamics.simulation import Simulation as Simulation
else:
    __all__ = sorted((*_HOME, *_MODULES))

    def __getattr__(name):
        if name in _MODULES:
            return _import_module(f"{__name__}.{name}")
        if name not in _HOME:
            error = _import_module(f"{__name__}.exceptions").attribute_error
            raise error(f"module {__name__!r}", name)
        value = getattr(_import_module(f"{__name__}.{_HOME[name]}"), name)
        globals()[name] = value
        return value

    def __dir__():
        return sorted(set(globals()) | set(__all__))
