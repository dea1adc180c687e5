# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results: read-only and permanent, of one state and of many."""

import copy
import pickle

import numpy as np
import pytest

import diag_dynamics as dd
from accuracy import QUANTITIES

COUNT = 20
"""States of a batch."""

MODELS = {
    "panda": lambda: dd.load_robot("panda"),
    "go2, floating": lambda: dd.load_robot("go2", floating_base=True),
}

COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
}


@pytest.fixture(scope="module", params=MODELS)
def dyn(request):
    return dd.DiagonalDynamics(MODELS[request.param]())


def state(dyn, seed=0):
    return dyn.model.neutral, *np.random.default_rng(seed).standard_normal((2, dyn.model.nv))


def states(dyn, count=COUNT):
    return [
        np.array(column)
        for column in zip(*(state(dyn, seed) for seed in range(count)), strict=True)
    ]


def every_kind(dyn):
    """Return one result of each kind."""
    more = {"f_ext": {dyn.model.link_names[-1]: np.ones(6)}, "friction": True}
    q, qd, tau = state(dyn)
    return {
        "new": dyn.evaluate(q, qd, tau),
        "new, with all": dyn.evaluate(q, qd, tau, **more),
        "batch": dyn.evaluate(*states(dyn), **more),
        "batch, without all": dyn.evaluate(*states(dyn)),
    }


def assert_equal(one, other):
    for name in QUANTITIES:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


# --- Read-only values


def test_results_are_read_only(dyn):
    for kind, result in every_kind(dyn).items():
        for name in QUANTITIES:
            with pytest.raises(AttributeError):
                setattr(result, name, 1.0)
            value = getattr(result, name)
            if isinstance(value, np.ndarray) and np.shares_memory(value, getattr(result, name)):
                assert not value.flags.writeable, (kind, name)
        with pytest.raises(AttributeError):
            result.something_new = 1.0
    factors = dyn.factors(dyn.model.neutral)
    assert not any(array.flags.writeable for array in factors)


@pytest.mark.parametrize("way", COPIES)
def test_copies_are_permanent(dyn, way):
    for result in every_kind(dyn).values():
        twin = COPIES[way](result)
        assert type(twin) is type(result)
        terms = [x for x in (twin.nu, twin.external, twin.friction) if x is not None]
        assert not any(term.flags.writeable for term in terms)
        assert_equal(twin, result)
