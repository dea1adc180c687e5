# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiles what nearly every test calls, into the cache on disk, before workers do so each for
itself.
"""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

from diag_dynamics.numerics.kernel import precompile


def equations():
    """All methods of DiagonalDynamics."""
    precompile("diag_dynamics.sweeps")


def simulation():
    """The steps of the simulation."""
    precompile("diag_dynamics.simulation.steps")


def messages():
    """What turns bytes into bytes."""
    precompile("diag_dynamics.joint_states")


def in_two_processes():
    """Compile the two big parts side by side; nothing where they are compiled already."""
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        for part in [pool.submit(part) for part in (simulation, equations)]:
            part.result()
