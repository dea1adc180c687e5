# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From the bytes of a joint state to the bytes of all messages about it, in one compiled pass."""

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.compiled.kernel import COUNT, entry_kernel, ready
from diag_dynamics.compiled.tables import Addresses, Table, array
from diag_dynamics.nodes.encoded.encoding import Vectors, Written, sheets_at, write
from diag_dynamics.nodes.encoded.powers import powers
from diag_dynamics.nodes.encoded.topic_bits import WITH_LINK_ENERGY
from diag_dynamics.wire.joint_states import WITH_EFFORT, WITHOUT_EFFORT, known_at, take

PIPELINE = Table(
    "Pipeline",
    robot=int,  # that of the Workspace
    links=array(sweeps.LINK),
    rows=array(float, 2),  # of what is evaluated
    no_friction=array(float),
    sheets_without_effort=int,  # addresses of Sheets, and their bits
    bits_without_effort=int,
    sheets_with_effort=int,
    bits_with_effort=int,
    bit_of_link_energy=int,
    resistance=int,  # address of a Resistance
)
"""What :func:`_serve` has to know of a robot."""


_NOTHING = 0, 0.0, 0.0, (0.0, 0.0)
"""What is said of a state that is not served."""


def compile_pipeline():
    """Compile what pipelines call, or load it: no state of a robot that gets one later shall wait for that."""
    ready(_serve)


class Pipeline:
    """Takes joint states in, evaluates them and writes the messages about them, as long as nothing about them is unusual.

    Of the last state that was served, attributes are what those of the same name of an Evaluation are.

    Parameters
    ----------
    known : KnownJointStates
        Its states are whole: the base is fixed, and efforts are complete.
    dynamics : DiagonalDynamics
    encoder : EncodedMessages
        What has been laid out there already is written.
    resistance : Addresses
        Those of :class:`Powers`.

    Attributes
    ----------
    newest : int
        Stamp of the state [ns].
    kinetic_energy : float
    effort_power : float or None
    powers : tuple of float
        As :class:`Powers` gives them.
    """

    def __init__(self, known, dynamics, encoder, resistance):
        model = dynamics.model
        self._known, self._encoder, self._sheets = known, encoder, None
        self._resistance = resistance  # it keeps what its address is of
        self._workspace = sweeps.Workspace(model.bodies, model.gravity)
        self._evaluated = np.zeros((sweeps.ROWS, model.nv))
        links = np.ascontiguousarray(model.links)
        self._addresses = Addresses(
            PIPELINE,
            robot=self._workspace.robot,
            links=links,
            rows=self._evaluated,
            no_friction=np.zeros(0),
            sheets_without_effort=0,
            bits_without_effort=0,
            sheets_with_effort=0,
            bits_with_effort=0,
            bit_of_link_energy=WITH_LINK_ENERGY,
            resistance=resistance.at,
        )
        self._found = 0

    def serve(self, raw, now, wanted):
        """Serve a serialized joint state.

        Parameters
        ----------
        raw : bytes
        now : int
            Time of reception [ns].
        wanted : int
            Sum of the topic_bits.BITS of topics that messages are wanted of.

        Returns
        -------
        bool or None
            None: it has not been taken in. False: it has, and :attr:`state` has to be evaluated in the ordinary way.
        """
        if self._sheets is None:
            self._look_for_sheets()
        found = self._known.taken(raw, now, _serve, self._addresses.at, wanted)
        if found is None:
            self._sheets = None  # what comes now may be laid out for the next ones
            return None
        self._found, _, served, (self.newest, self.kinetic_energy, power, self.powers) = found
        self.effort_power = power if self._found == WITH_EFFORT else None
        if not served:
            self._sheets = None
        return served

    def _look_for_sheets(self):
        self._sheets = {WITHOUT_EFFORT: self._encoder.sheets(False), WITH_EFFORT: self._encoder.sheets(True)}
        for found, name in ((WITHOUT_EFFORT, "without_effort"), (WITH_EFFORT, "with_effort")):
            sheets = self._sheets[found]
            self._addresses[f"sheets_{name}"] = sheets.addresses.at if sheets else 0
            self._addresses[f"bits_{name}"] = sheets.bits if sheets else 0

    @property
    def state(self):
        """The RobotState that was taken in last."""
        return self._known.state(self._found)

    @property
    def rows(self):
        """The rows that the sweep has filled."""
        return self._evaluated

    @property
    def energy_share(self):
        """½ν_k² [J]."""
        nu = self._evaluated[sweeps.NU]
        return 0.5 * nu * nu

    def messages(self, topics):
        """Those of topics that were wanted."""
        sheets = self._sheets[self._found]
        return [sheets.encoded(topic) for topic in topics]


_pipeline_at = PIPELINE.opened


@entry_kernel(*[COUNT] * 6)
def _serve(known, layout, now, mode, pipeline, wanted):
    """What was taken in, and its stamp, as of :func:`take`; whether all is written; and numbers of the state.

    The numbers are its stamp, K, νᵀ(ε − ε_g), and what :func:`powers` says.

    These are bare tuples: to make a named one takes Python half a microsecond, a seventh of the time for a small robot.
    """
    found, stamp = take(known, layout, now, mode)
    unserved = found, stamp, False, _NOTHING
    at, with_effort = _pipeline_at(pipeline), found == WITH_EFFORT
    sheets = at.sheets_with_effort if with_effort else at.sheets_without_effort
    if found == 0 or wanted & ~(at.bits_with_effort if with_effort else at.bits_without_effort) != 0:
        return unserved
    state = known_at(known)
    position, velocity = state.state_position, state.state_velocity
    effort = state.state_effort if with_effort else state.no_effort
    if sweeps.evaluate_within(at.robot, position, velocity, effort, at.rows) != 0:
        return unserved
    energy, power = sweeps.energy_and_power_within(at.rows, len(velocity))
    stamps = state.stamps[0]
    if wanted:
        told = Written(stamps.newest, stamps.oldest, False, False, energy, power if with_effort else 0.0, 0)
        write(sheets, wanted, told, Vectors(at.rows, position, effort, at.no_friction))
    if wanted & at.bit_of_link_energy:
        bodies, _, work, _ = sweeps.opened(at.robot)
        if not sweeps.energies_of_links(bodies, at.links, work, velocity, sheets_at(sheets).link_energy):
            return unserved
    return found, stamp, True, (stamps.newest, energy, power, powers(at.rows, velocity, at.resistance))
