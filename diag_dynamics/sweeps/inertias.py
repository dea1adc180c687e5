"""Articulated inertias, filtered at their joint and handed on to the parent: P alone, or P and Ṗ together.

Most of a sweep's arithmetic is here, and done in vector registers. A stack is a 3x3 matrix of lanes: entries of the blocks
A, B and C of P are lanes 0 to 2 of the stack's entries, those of Ṗ lanes 4 to 6. The algebra of 3x3 matrices is that of
spatial, on all blocks at once; what is here moves numbers from block to block.

Where numbers themselves are lanes, one for each of many states, there are no stacks: the same formulas of spatial take
them one inertia after the other, and give the same bits.
"""

from numba.core import types
from numba.extending import overload

from diag_dynamics.compiled.kernel import INLINED, kernel
from diag_dynamics.compiled.lanes import EIGHT, FOUR, chooser, loader, mover, spreader, store
from diag_dynamics.sweeps.bodies import add_to_inertia, inertia_of, set_inertia, symmetric_of, vector_of
from diag_dynamics.sweeps.spatial import (
    ANGULAR_Z,
    NOTHING,
    Inertia,
    add_inertia,
    cross_columns,
    inertia_to_parent,
    less_rank_one,
    less_rank_two,
    matrix_difference,
    matrix_sum,
    outer,
    rigid_inertia,
    rotated,
    transport_along_z,
    transpose,
    turn_columns,
)

# --- Stacks -------------------------------------------------------------------------------------------------

_load_own, _load_one, _load_both = loader(FOUR, 4), loader(FOUR), loader(EIGHT)
_one, _both = spreader(FOUR), spreader(EIGHT)
_of_C, _of_B_and_C, _of_B, _of_rate = (
    chooser(False, False, True, False),
    chooser(False, True, True, False),
    chooser(False, True, False, False),
    chooser(*4 * [False], *4 * [True]),
)
_to_next_block, _A_to_B, _B_to_C = mover(None, 0, 1, None), mover(None, 0, None, None), mover(None, None, 1, None)
_P_to_rate = mover(*4 * [None], 0, 1, 2, None)


@kernel
def _symmetric(M):
    """Blocks A and C mirrored."""
    return (
        M[0],
        (_of_B(M[0][1], M[1][0]), M[1][1], M[1][2]),
        (_of_B(M[0][2], M[2][0]), _of_B(M[1][2], M[2][1]), M[2][2]),
    )


@kernel
def _rows(spread, F):
    """Row factors of F Hᵀ: the force of F in the blocks A and B, its moment in C."""
    f, m = F.force, F.moment
    return (
        _of_C(spread(f[0]), spread(m[0])),
        _of_C(spread(f[1]), spread(m[1])),
        _of_C(spread(f[2]), spread(m[2])),
    )


@kernel
def _columns(spread, F):
    """Column factors of G Fᵀ: the force of F in the block A, its moment in B and C."""
    f, m = F.force, F.moment
    return (
        _of_B_and_C(spread(f[0]), spread(m[0])),
        _of_B_and_C(spread(f[1]), spread(m[1])),
        _of_B_and_C(spread(f[2]), spread(m[2])),
    )


@kernel
def _beside(x, y):
    """Lanes of P from x, those of Ṗ from y."""
    return (_of_rate(x[0], y[0]), _of_rate(x[1], y[1]), _of_rate(x[2], y[2]))


@kernel
def _stack_to_parent(X, M):
    """XᵀP X of all inertias in a stack: see spatial.inertia_to_parent."""
    M = _symmetric(rotated(X.rotation, M))
    shifted = matrix_sum(M, _to_next_block(transpose(cross_columns(X.translation, M))))
    return _symmetric(matrix_sum(shifted, _B_to_C(cross_columns(X.translation, shifted))))


@kernel
def _moved(direction, rate, M):
    """Part of Ṗ⁺ from the motion of the joint: see spatial.transport_along_z."""
    if direction == ANGULAR_Z:
        K = matrix_sum(turn_columns(M, rate), transpose(turn_columns(transpose(M), rate)))
    else:
        N = turn_columns(M, rate)
        K = matrix_sum(_A_to_B(transpose(N)), _B_to_C(matrix_sum(N, transpose(N))))
    return _P_to_rate(K)


@kernel
def _start_stack(body, w):
    own, nothing = _load_own(w.rigid), _one(0.0)
    store(w.P, own)
    store(w.P_rate, ((nothing, nothing, nothing), (nothing, nothing, nothing), (nothing, nothing, nothing)))


@kernel
def _hand_on_stack(w, G, column, X, parent):
    M = _load_one(w.P)
    M = _symmetric(matrix_difference(M, outer(_rows(_one, G), _columns(_one, column))))
    store(parent.P, matrix_sum(_load_one(parent.P), _stack_to_parent(X, M)))


@kernel
def _hand_on_stack_of_both(w, direction, rate, G, column, h, X, parent):
    g_rows, g_columns = _rows(_both, G), _columns(_both, G)
    nothing = (_both(0.0), _both(0.0), _both(0.0))
    M = _load_both(w.P)
    M = matrix_difference(M, outer(g_rows, _beside(_columns(_both, column), _columns(_both, h))))
    M = _symmetric(matrix_difference(M, outer(_beside(nothing, _rows(_both, h)), g_columns)))
    M = matrix_sum(M, _moved(direction, rate, M))
    store(parent.P, matrix_sum(_load_both(parent.P), _stack_to_parent(X, M)))


# --- One after the other ------------------------------------------------------------------------------------


@kernel
def _start(body, w):
    own = rigid_inertia(body.mass, vector_of(body.first_moment), symmetric_of(body.inertia))
    set_inertia(w.P, own)
    set_inertia(w.P_rate, Inertia(NOTHING, NOTHING, NOTHING))


@kernel
def _hand_on(w, G, column, X, parent):
    add_to_inertia(parent.P, inertia_to_parent(X, less_rank_one(inertia_of(w.P), G, column)))


@kernel
def _hand_on_both(w, direction, rate, G, column, h, X, parent):
    P_plus = less_rank_one(inertia_of(w.P), G, column)
    filtered = less_rank_two(inertia_of(w.P_rate), G, h)
    rate_plus = add_inertia(filtered, transport_along_z(direction, rate, P_plus))
    add_to_inertia(parent.P, inertia_to_parent(X, P_plus))
    add_to_inertia(parent.P_rate, inertia_to_parent(X, rate_plus))


# --- What sweeps call ---------------------------------------------------------------------------------------


def hand_on(w, G, column, X, parent):
    """Add Xᵀ τ̄P X to the parent's P, with τ̄P = P − G (P S)ᵀ (Algorithm 4.1)."""


def hand_on_with_rate(w, direction, rate, G, column, h, X, parent):
    """Hand on P as :func:`hand_on`, and Ṗ with it; h = Ṗ S − ½ Ḋ G.

    Ṗ⁺ = Ṗ − G hᵀ − h Gᵀ − (v_J×)ᵀP⁺ − P⁺(v_J×), to the parent as P⁺ is.
    """


def start_own(body, w):
    """P of a body's own mass, and no Ṗ."""


def _of_number(w):
    return isinstance(w.typeof("P").dtype, types.Float)


@overload(start_own, jit_options=INLINED)
def _(body, w):
    form = _start_stack if _of_number(w) else _start
    return lambda body, w: form(body, w)


@overload(hand_on, jit_options=INLINED)
def _(w, G, column, X, parent):
    form = _hand_on_stack if _of_number(w) else _hand_on
    return lambda w, G, column, X, parent: form(w, G, column, X, parent)


@overload(hand_on_with_rate, jit_options=INLINED)
def _(w, direction, rate, G, column, h, X, parent):
    form = _hand_on_stack_of_both if _of_number(w) else _hand_on_both
    return lambda w, direction, rate, G, column, h, X, parent: form(w, direction, rate, G, column, h, X, parent)
