"""Placements of links."""

from diag_dynamics.compiled.kernel import COUNT, FILLED_MATRIX, ROBOT, VECTOR, entry_kernel
from diag_dynamics.sweeps.bodies import placement_of, set_vector
from diag_dynamics.sweeps.joints import are_positions, orientation, place_all
from diag_dynamics.sweeps.spatial import ZERO, add, apply
from diag_dynamics.sweeps.workspace import MISFIT, fit_positions, opened


@entry_kernel(ROBOT, VECTOR, COUNT, FILLED_MATRIX)
def placement(robot, q, body, result):
    """R and, in the last column, the origin of one body in the world, shape (3, 4): a walk down the tree."""
    if not fit_positions(robot, q):
        return MISFIT
    bodies, _, work, _ = opened(robot)
    if not are_positions(bodies, q):
        return -1
    place_all(bodies, q, work)
    R, origin = orientation(bodies, body, work), ZERO
    while body > 0:
        X = placement_of(work[body])
        origin = add(X.translation, apply(X.rotation, origin))
        body = bodies[body].parent
    for k in range(3):
        set_vector(result[k], 0, R[k])
        result[k, 3] = origin[k]
    return 0
