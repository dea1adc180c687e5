# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records and memory of a simulation, and how compiled steps find them: by name, from one address."""

from collections import namedtuple

import numba
import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.compiled.arrays import array_at
from diag_dynamics.compiled.kernel import kernel
from diag_dynamics.simulation.tableau import STAGES

FREE, HELD = 0.0, 2.0
"""Modes of a degree of freedom in a step. 1 and −1 are sliding, one way and the other."""

JOINT = np.dtype(
    [
        ("damping", "f8"),  # [N m s/rad, N s/m]
        ("friction", "f8"),  # of Coulomb [N m, N]
        ("stiffness", "f8"),  # of its limits [N m/rad, N/m]; inf is a hard limit
        ("limit_damping", "f8"),  # of its limits [N m s/rad, N s/m]
    ],
    align=True,
)
"""What resists the motion of one degree of freedom."""

BOUND = np.dtype(
    [
        ("lower", "f8"),  # [rad, m]
        ("upper", "f8"),  # [rad, m]
    ],
    align=True,
)
"""Limits of one position coordinate."""

WORKS = np.dtype(
    [
        ("effort", "f8"),  # of joint efforts [J]
        ("wrenches", "f8"),  # of external wrenches [J]
        ("damping", "f8"),  # of joint damping [J]
        ("friction", "f8"),  # of Coulomb friction [J]
        ("limits", "f8"),  # of limits, without what they store [J]
    ],
    align=True,
)
"""Work done on the robot, by what does it."""

CONDUCT = np.dtype(
    [
        ("mode", "f8"),  # FREE, HELD, or the way that it slides, 1 or −1
        ("spring", "f8"),  # side of the compliant limit that it leans on, 1 or −1; 0 for none
        ("depth", "f8"),  # how far it is beyond a limit, with a sign [rad, m]
        ("turned", "f8"),  # the way that it slid, if friction would turn it round; else 0
        ("seen", "?"),  # it turns round without friction, too
    ],
    align=True,
)
"""What one degree of freedom does in a step. The mode is a number, for friction is against it: −f mode."""

GAP = np.dtype(
    [
        ("sliding", "f8"),  # rate against the way that the joint slides [rad/s, m/s]
        ("limit", "f8"),  # way beyond a limit [rad, m], or force of a compliant one [N m, N]
    ],
    align=True,
)
"""How far one degree of freedom is beyond the end of its mode; negative before it."""

System = namedtuple("System", ["robot", "bodies", "work", "flat", "armature", "joints", "bounds"])
"""A robot and what resists its motion. `flat`: no joint has several degrees of freedom. `armature` is the bodies' own: while
a joint is held, its body has another one."""

Load = namedtuple("Load", ["tau", "wrenches", "in_world"])
"""Joint efforts [N m, N] and wrenches that act through a step, and whether these are in the world's axes."""

State = namedtuple("State", ["q", "qd", "nu"])
"""q [rad, m], q̇ [rad/s, m/s] and ν [J^½]."""

Memory = namedtuple(
    "Memory",
    [
        "pushed",  # efforts of wrenches [N m, N]
        "applied",  # and of drives [N m, N]
        "effort",  # and of all else that acts [N m, N]
        "needed",  # efforts that hold the joints at rest [N m, N]
        "added",  # inertia added to the joint's [kg m², kg]
        "none",  # zeros
        "marks",  # of joints that are held or stopped: not 0
        "momentum",  # what sweeps work in [N m s, N s]
        "qdd",  # q̈ [rad/s², m/s²]
        "before",  # q̇ before an impulse [rad/s, m/s]
        "after",  # q̇ after a step of order 1 [rad/s, m/s]
        "loose",  # the same, without friction of joints that it turns round [rad/s, m/s]
        "u",  # change of positions, on the chart of joints of several degrees of freedom [rad, m]
        "path",  # ∫q̇ over a step [rad, m]
    ],
)
"""Vectors with an entry for each degree of freedom."""

Stage = namedtuple("Stage", ["nu", "before", "impulse", "spent", "square"])
"""Such vectors of a step of order 4: at a stage ν, and before its implicit part [J^½], and the impulse of compliant limits
[N m s, N s]; efforts of drives and friction [N m, N]; ∫q̇² over the step [rad²/s, m²/s]."""

Stages = namedtuple("Stages", ["rates", "charts", "explicit", "implicit", "pushed"])
"""And of all its stages: q̇, the rate of u, ν̇ in its explicit and its implicit part, and efforts of wrenches."""

Gaps = namedtuple("Gaps", ["now", "start", "end", "scale"])
"""Gaps now, at two instants before and after the first one closes, and how much they change over the step."""


def _addresses(group):
    """One address for each of a group of arrays."""
    return np.dtype([(name, "i8") for name in group._fields], align=True)


SIMULATION = np.dtype(
    [
        ("robot", "i8"),  # see sweeps.Workspace
        ("nv", "i8"),  # degrees of freedom
        ("nq", "i8"),  # position coordinates
        ("flat", "?"),  # no joint has several degrees of freedom
        ("armature", "i8"),  # addresses of arrays, from here on
        ("joints", "i8"),
        ("bounds", "i8"),
        ("conduct", "i8"),
        ("place", "i8"),  # q at a stage
        ("rows", "i8"),  # what sweeps.evaluate fills
        ("moment", "i8"),  # what sweeps.first_moment fills
        ("now", _addresses(State)),  # the state, which steps change in place
        ("start", _addresses(State)),  # where the part of a step starts that may be taken anew
        ("last", _addresses(State)),  # where the step starts, should it fail
        ("memory", _addresses(Memory)),
        ("stage", _addresses(Stage)),
        ("stages", _addresses(Stages)),
        ("gaps", _addresses(Gaps)),
        ("taken", "i8"),  # steps
        ("done", WORKS),  # since the simulation was reset
        ("part", WORKS),  # in the part of a step that may be taken anew
        ("before", WORKS),  # before the step, should it fail
    ],
    align=True,
)
"""All that compiled steps know of a simulation."""


class Arrays:
    """A robot, its state and memory: what steps work on.

    Attributes
    ----------
    at : int
        Address of a :data:`SIMULATION`, the one argument that stands for all this. Keep the object while steps are taken.
    record : void
        What lies there.
    workspace : Workspace
    flat : bool
        No joint has several degrees of freedom.
    joints, bounds : ndarray
        Records :data:`JOINT` of degrees of freedom, and :data:`BOUND` of position coordinates.
    state : State
    """

    def __init__(self, nq, nv):
        self.joints, self.bounds = np.zeros(nv, JOINT), np.zeros(nq, BOUND)
        self.state, self._start, self._last = (State(np.zeros(nq), np.zeros(nv), np.zeros(nv)) for _ in range(3))
        self._memory = Memory(*np.zeros((len(Memory._fields), nv)))
        self._stage = Stage(*np.zeros((len(Stage._fields), nv)))
        self._stages = Stages(*np.zeros((len(Stages._fields), STAGES, nv)))
        self._conduct, self._gaps = np.zeros(nv, CONDUCT), Gaps(*np.zeros((len(Gaps._fields), nv), GAP))
        self._place, self._rows, self._moment = np.zeros(nq), np.zeros((sweeps.ROWS, nq)), np.zeros(3)
        self._table = np.zeros(1, SIMULATION)

    def use(self, bodies, gravity):
        """Take the robot of these bodies, as a copy in which joints can be held."""
        self.workspace = sweeps.Workspace(bodies.copy(), gravity)
        self._armature, self.flat = bodies["armature"].copy(), bool((bodies["dofs"][1:] == 1).all())
        self._locate()

    def _locate(self):
        """Write down where everything lies."""
        self.record, self.at = self._table[0], self._table.ctypes.data
        _write(
            self.record,
            robot=self.workspace.robot,
            nv=len(self.joints),
            nq=len(self.bounds),
            flat=self.flat,
            armature=self._armature,
            joints=self.joints,
            bounds=self.bounds,
            conduct=self._conduct,
            place=self._place,
            rows=self._rows,
            moment=self._moment,
        )
        for name, group in (
            ("now", self.state),
            ("start", self._start),
            ("last", self._last),
            ("memory", self._memory),
            ("stage", self._stage),
            ("stages", self._stages),
            ("gaps", self._gaps),
        ):
            _write(self.record[name], **group._asdict())

    def __setstate__(self, copied):
        """Become a copy, whose arrays lie elsewhere."""
        self.__dict__.update(copied)
        self._locate()


def _write(record, **entries):
    """Write numbers, and addresses of arrays, into the fields of a record."""
    for name, entry in entries.items():
        record[name] = entry.ctypes.data if isinstance(entry, np.ndarray) else entry


_simulation_at, _joints_at, _bounds_at, _conduct_at, _gap_at = (
    array_at(numba.from_dtype(record), 1) for record in (SIMULATION, JOINT, BOUND, CONDUCT, GAP)
)
_vector_at, _matrix_at = (array_at(numba.float64, ndim, lent=True) for ndim in (1, 2))


@kernel
def simulation_at(address):
    """Record of a simulation, see :class:`Arrays`."""
    return _simulation_at(address, (1,))[0]


@kernel
def system_of(simulation):
    """Robot and resistance."""
    bodies, _, work, _ = sweeps.opened(simulation.robot)
    return System(
        robot=simulation.robot,
        bodies=bodies,
        work=work,
        flat=simulation.flat,
        armature=_vector_at(simulation.armature, (len(bodies),)),
        joints=_joints_at(simulation.joints, (simulation.nv,)),
        bounds=_bounds_at(simulation.bounds, (simulation.nq,)),
    )


@kernel
def _state(simulation, at):
    nv = simulation.nv
    return State(q=_vector_at(at.q, (simulation.nq,)), qd=_vector_at(at.qd, (nv,)), nu=_vector_at(at.nu, (nv,)))


@kernel
def state_of(simulation):
    """State."""
    return _state(simulation, simulation.now)


@kernel
def start_of(simulation):
    """State where the part of a step starts that may be taken anew."""
    return _state(simulation, simulation.start)


@kernel
def last_of(simulation):
    """State where the step starts."""
    return _state(simulation, simulation.last)


@kernel
def conduct_of(simulation):
    """Records of what degrees of freedom do."""
    return _conduct_at(simulation.conduct, (simulation.nv,))


@kernel
def memory_of(simulation):
    """Vectors of degrees of freedom."""
    at, n = simulation.memory, (simulation.nv,)
    return Memory(
        pushed=_vector_at(at.pushed, n),
        applied=_vector_at(at.applied, n),
        effort=_vector_at(at.effort, n),
        needed=_vector_at(at.needed, n),
        added=_vector_at(at.added, n),
        none=_vector_at(at.none, n),
        marks=_vector_at(at.marks, n),
        momentum=_vector_at(at.momentum, n),
        qdd=_vector_at(at.qdd, n),
        before=_vector_at(at.before, n),
        after=_vector_at(at.after, n),
        loose=_vector_at(at.loose, n),
        u=_vector_at(at.u, n),
        path=_vector_at(at.path, n),
    )


@kernel
def stage_of(simulation):
    """Vectors of a step of order 4."""
    at, n = simulation.stage, (simulation.nv,)
    return Stage(
        nu=_vector_at(at.nu, n),
        before=_vector_at(at.before, n),
        impulse=_vector_at(at.impulse, n),
        spent=_vector_at(at.spent, n),
        square=_vector_at(at.square, n),
    )


@kernel
def stages_of(simulation):
    """Vectors of all its stages."""
    at, shape = simulation.stages, (STAGES, simulation.nv)
    return Stages(
        rates=_matrix_at(at.rates, shape),
        charts=_matrix_at(at.charts, shape),
        explicit=_matrix_at(at.explicit, shape),
        implicit=_matrix_at(at.implicit, shape),
        pushed=_matrix_at(at.pushed, shape),
    )


@kernel
def gaps_of(simulation):
    """Records of gaps."""
    at, n = simulation.gaps, (simulation.nv,)
    return Gaps(
        now=_gap_at(at.now, n),
        start=_gap_at(at.start, n),
        end=_gap_at(at.end, n),
        scale=_gap_at(at.scale, n),
    )


@kernel
def place_of(simulation):
    """Positions at a stage."""
    return _vector_at(simulation.place, (simulation.nq,))


@kernel
def rows_of(simulation):
    """Memory for sweeps.evaluate."""
    return _matrix_at(simulation.rows, (sweeps.ROWS, simulation.nq))


@kernel
def moment_of(simulation):
    """Memory for sweeps.first_moment."""
    return _vector_at(simulation.moment, (3,))


@kernel
def copy_state(source, target):
    """Overwrite a state by another."""
    sweeps.copy(source.q, target.q)
    sweeps.copy(source.qd, target.qd)
    sweeps.copy(source.nu, target.nu)


@kernel
def copy_works(source, target):
    """Overwrite works by others."""
    target.effort, target.wrenches, target.damping = source.effort, source.wrenches, source.damping
    target.friction, target.limits = source.friction, source.limits


@kernel
def clear_works(works):
    """Set works to zero."""
    works.effort = works.wrenches = works.damping = works.friction = works.limits = 0.0


@kernel
def add_works(part, works):
    """Add works of a part of a step."""
    works.effort += part.effort
    works.wrenches += part.wrenches
    works.damping += part.damping
    works.friction += part.friction
    works.limits += part.limits
