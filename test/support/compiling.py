"""Compiles what nearly every test calls, into the cache on disk, before workers do so each for itself."""

import multiprocessing
import warnings
from concurrent.futures import ProcessPoolExecutor

import diag_dynamics as dd
import robots


def arm():
    """Any robot will do."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dd.InertiaWarning)
        return dd.load_urdf(robots.TwoLinkArm().urdf)


def equations():
    """All methods of DiagonalDynamics."""
    dd.DiagonalDynamics(arm()).compile()


def simulation():
    """The steps of the simulation."""
    dd.Simulation(arm()).advance(steps=0)


def messages():
    """What turns bytes into bytes."""
    from diag_dynamics.compiled.kernel import ready
    from diag_dynamics.nodes.wire import encoding as encoded
    from diag_dynamics.nodes.wire import joint_states as known
    from diag_dynamics.nodes.wire import pipeline

    for entry in (known._take, encoded._write, pipeline._serve):
        ready(entry)


def in_two_processes():
    """Compile the two big parts side by side; nothing where they are compiled already."""
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        for part in [pool.submit(part) for part in (simulation, equations)]:
            part.result()
