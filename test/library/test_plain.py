# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The switch DIAG_DYNAMICS_PLAIN: numba's documented interface alone, and the same numbers."""

import os
import pickle
import subprocess
import sys

import numpy as np

# Pickles what is computed of some robots, by name; of a floating base, of coupled joints and of plain chains.
SCRIPT = """
import pickle, sys, warnings
import numpy as np
import diag_dynamics as dd
from diag_dynamics.model.example_robots import find_urdf

warnings.simplefilter("ignore")
found = {}
for name, options in (("ur5_robot", {}), ("panda", {}), ("go2", {"floating_base": True})):
    model = dd.load_urdf(find_urdf(name), **options)
    dyn, rng = dd.DiagonalDynamics(model), np.random.default_rng(3)
    q, (qd, tau) = model.neutral, rng.standard_normal((2, model.nv))
    states = [np.tile(x, (11, 1)) for x in (q, qd, tau)]
    m, l, unit, D = dyn.factors(q)
    found[name] = {
        **{f"evaluate: {name}": x for name, x in dyn.evaluate(q, qd, tau).to_dict().items() if x is not None},
        **{f"batch: {name}": x for name, x in dyn.evaluate_batch(*states).to_dict().items() if x is not None},
        "mass_matrix": dyn.mass_matrix(q),
        "forward_dynamics": dyn.forward_dynamics(q, qd, tau),
        "m": m,
        "l": l,
        "D": D,
    }
sys.stdout.buffer.write(pickle.dumps((found, sorted(sys.modules))))
"""

PRIVATE = {"native", "lent", "parts", "store", "registers", "addressed"}


def computed(plain):
    environment = os.environ | {"DIAG_DYNAMICS_PLAIN": plain}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, timeout=900)
    assert done.returncode == 0, done.stderr.decode()
    found, modules = pickle.loads(done.stdout)
    return found, {name.rsplit(".", 1)[1] for name in modules if name.startswith("diag_dynamics.compiled.")}


def test_plainly_compiled_kernels_give_the_same_numbers():
    """To 10 ε of what is largest in a quantity."""
    plain, modules = computed("1")
    assert not modules & PRIVATE
    fast, modules = computed("")
    assert modules >= PRIVATE
    for name, quantities in fast.items():
        for quantity, expected in quantities.items():
            scale, difference = np.abs(expected).max(), np.abs(plain[name][quantity] - expected).max()
            assert difference <= 10 * np.finfo(float).eps * scale, (name, quantity, difference / scale)
