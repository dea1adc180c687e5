# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One state at a time, called from Python."""

from functools import partial
from operator import attrgetter

from cases import CLASSES, COMPARED, targets
from peers import QUANTITIES
from rows import Row
from timing import interleaved, ratio

FIELDS = f"`evaluate`, then its {len(QUANTITIES)} fields read"
FACTORS = "`crba`, `cholesky.decompose`, U√D, inverse"

fields = attrgetter(*QUANTITIES)


def measure(case, pinocchio, mujoco, rounds):
    """Seconds per call of the library and its peers, in turns."""
    dyn, q, qd, tau = case.dynamics, case.q, case.qd, case.tau
    evaluate = partial(dyn.evaluate, q, qd, tau)
    ours = {
        "evaluate": evaluate,
        "fields": lambda: fields(evaluate()),
        "forward_dynamics": partial(dyn.forward_dynamics, q, qd, tau),
        "factors": partial(dyn.factors, q),
    }
    own = pinocchio.positions(q), pinocchio.vectors(qd), pinocchio.vectors(tau)
    return interleaved(ours | pinocchio.calls(*own) | {"mj_forward": mujoco.forward}, rounds)


def rows(times, dof):
    """Lines of the table, from times and degrees of freedom by robot; targets are by robot."""

    def row(subject, ours, peer, theirs, over, limits=None):
        names = [
            name for name in times if (name in limits if limits else dof[name] in CLASSES[over])
        ]
        found = {name: ratio(times[name][ours], times[name][theirs]) for name in names}
        return Row(subject, peer, over, limits, found)

    bare, aba, dense = "`evaluate`", "`pin.aba`", "NumPy and Pinocchio route"
    return [
        row(bare, "evaluate", aba, "aba", COMPARED, targets(1.15, 1.1, 0.78)),
        row(FIELDS, "fields", aba, "aba", COMPARED, targets(1.75, 1.6, 1.0)),
        row(bare, "evaluate", dense, "dense_evaluate", "all robots"),
        row(FIELDS, "fields", dense, "dense_evaluate", "all robots"),
        row(
            "`forward_dynamics`", "forward_dynamics", aba, "aba", COMPARED, targets(0.75, 0.66, 0.5)
        ),
        row("`factors`", "factors", FACTORS, "dense_factors", COMPARED, targets(1.1, 0.95, 0.65)),
    ]


COLUMNS = {
    "`evaluate` / `pin.aba`": ("evaluate", "aba"),
    "fields read / `pin.aba`": ("fields", "aba"),
    "`evaluate` / `pin.aba`, default convention": ("evaluate", "aba_default"),
    "`evaluate` / dense": ("evaluate", "dense_evaluate"),
    "`forward_dynamics` / `pin.aba`": ("forward_dynamics", "aba"),
    "`factors` / dense": ("factors", "dense_factors"),
    "`evaluate` / `mj_forward`": ("evaluate", "mj_forward"),
}
"""What the table of single robots shows: ours and theirs."""
