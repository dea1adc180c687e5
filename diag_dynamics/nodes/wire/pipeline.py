"""From the bytes of a joint state to the bytes of all messages about it, in one compiled pass."""

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.compiled.addresses import Addresses, indices_at, matrix_at, vector_at
from diag_dynamics.compiled.kernel import COUNT, entry_kernel, ready
from diag_dynamics.nodes.wire.encoding import link_energy_at, write
from diag_dynamics.nodes.wire.joint_states import NO_EFFORT, WITH_EFFORT, WITHOUT_EFFORT, take, times_at, value_at
from diag_dynamics.nodes.wire.topics import WITH_LINK_ENERGY

_ROBOT, _NV, _LINKS, _LINK_COUNT, _ROWS, _SHEETS, _BITS, _SIZE = 0, 1, 2, 3, 4, 5, 7, 9
"""Where in the table of a Pipeline are: the robot, its degrees of freedom, its links, how many; the rows of what is
evaluated; Sheets without efforts, and with; the bits of these; and its size."""


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

    Attributes
    ----------
    newest : int
        Stamp of the state [ns].
    kinetic_energy : float
    effort_power : float or None
    """

    def __init__(self, known, dynamics, encoder):
        model = dynamics.model
        self._known, self._encoder, self._sheets = known, encoder, None
        self._workspace = sweeps.Workspace(model.bodies, model.gravity)
        self._evaluated = np.zeros((sweeps.ROWS, model.nv))
        links = np.ascontiguousarray(model.links)
        self._addresses = Addresses(self._workspace.robot, model.nv, links, len(links), self._evaluated, *[0] * 4)
        self._found = 0

    def serve(self, raw, now, wanted):
        """Serve a serialized joint state.

        Parameters
        ----------
        raw : bytes
        now : int
            Time of reception [ns].
        wanted : int
            Sum of the topics.BITS of topics that messages are wanted of.

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
        self._found, _, served, self.newest, self.kinetic_energy, power = found
        self.effort_power = power if self._found == WITH_EFFORT else None
        if not served:
            self._sheets = None
        return served

    def _look_for_sheets(self):
        self._sheets = {WITHOUT_EFFORT: self._encoder.sheets(False), WITH_EFFORT: self._encoder.sheets(True)}
        for found, sheets in self._sheets.items():
            self._addresses.table[_SHEETS + found - 1] = sheets.addresses.at if sheets else 0
            self._addresses.table[_BITS + found - 1] = sheets.bits if sheets else 0

    @property
    def state(self):
        """The RobotState that was taken in last."""
        return self._known.state(self._found)

    @property
    def energy_share(self):
        """½ν_k² [J]."""
        nu = self._evaluated[sweeps.NU]
        return 0.5 * nu * nu

    def messages(self, topics):
        """Those of topics that were wanted."""
        sheets = self._sheets[self._found]
        return [sheets.encoded(topic) for topic in topics]


@entry_kernel(*[COUNT] * 6)
def _serve(known, layout, now, mode, pipeline, wanted):
    """What was taken in, and its stamp, as of :func:`take`; whether all is written; the state's stamp, K and νᵀ(ε − ε_g)."""
    found, stamp = take(known, layout, now, mode)
    at = indices_at(pipeline, (_SIZE,))
    sheets = at[_SHEETS + found - 1]
    if found == 0 or wanted & ~at[_BITS + found - 1] != 0:
        return found, stamp, False, 0, 0.0, 0.0
    times, position, velocity = times_at(known), value_at(known, 0), value_at(known, 1)
    effort = value_at(known, 2 if found == WITH_EFFORT else NO_EFFORT)
    robot, rows = at[_ROBOT], matrix_at(at[_ROWS], (sweeps.ROWS, at[_NV]))
    if sweeps.evaluate_within(robot, position, velocity, effort, rows) != 0:
        return found, stamp, False, 0, 0.0, 0.0
    energy, power = sweeps.energy_and_power_within(rows, at[_NV])
    told = power if found == WITH_EFFORT else 0.0
    newest, oldest = times[0], times[1]
    if wanted:
        no_friction = vector_at(robot, (0,))
        write(sheets, wanted, newest, oldest, False, False, energy, told, 0, rows, position, effort, no_friction)
    if wanted & WITH_LINK_ENERGY:
        bodies, _, work, _ = sweeps.opened(robot)
        links = sweeps.links_at(at[_LINKS], (at[_LINK_COUNT],))
        if not sweeps.energies_of_links(bodies, links, work, velocity, link_energy_at(sheets)):
            return found, stamp, False, 0, 0.0, 0.0
    return found, stamp, True, newest, energy, power
