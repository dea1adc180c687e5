# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Articulated inertias, filtered at their joint and handed on to the parent: P alone, or P and Ṗ together.

Most of a sweep's arithmetic is here, and done in vector registers. A stack is a 3x3 matrix of lanes: entries of the blocks
A, B and C of P are lanes 0 to 2 of the stack's entries, those of Ṗ lanes 4 to 6. The algebra of 3x3 matrices is that of
spatial, on all blocks at once; what is here moves numbers from block to block.

Where numbers themselves are lanes, one for each of many states, there are no stacks: the same formulas of spatial take
them one inertia after the other, and give the same bits.
"""

from numba import types
from numba.extending import overload

from diag_dynamics.compiled.kernel import INLINED, kernel
from diag_dynamics.compiled.lanes import WIDTH
from diag_dynamics.sweeps.bodies import add_to_inertia, inertia_of, set_inertia, symmetric_of, vector_of
from diag_dynamics.sweeps.spatial import (
    NOTHING,
    Inertia,
    add_inertia,
    inertia_to_parent,
    less_rank_one,
    less_rank_two,
    rigid_inertia,
    transport_along_z,
)

if WIDTH > 1:
    from diag_dynamics.sweeps import stacks

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


def _stacked(w):
    """Whether numbers are no lanes themselves, and there are registers for a stack."""
    return WIDTH > 1 and isinstance(w.typeof("P").dtype, types.Float)


@overload(start_own, jit_options=INLINED)
def _(body, w):
    form = stacks.start_stack if _stacked(w) else _start
    return lambda body, w: form(body, w)


@overload(hand_on, jit_options=INLINED)
def _(w, G, column, X, parent):
    form = stacks.hand_on_stack if _stacked(w) else _hand_on
    return lambda w, G, column, X, parent: form(w, G, column, X, parent)


@overload(hand_on_with_rate, jit_options=INLINED)
def _(w, direction, rate, G, column, h, X, parent):
    form = stacks.hand_on_stack_of_both if _stacked(w) else _hand_on_both
    return lambda w, direction, rate, G, column, h, X, parent: form(w, direction, rate, G, column, h, X, parent)
