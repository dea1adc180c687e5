# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo: a simulated robot, the monitor, and a live view of its kinetic energy, on a real ROS 2 graph."""

import argparse
import os
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.model import load_urdf
from diag_dynamics.model.robot_source import robot_source
from diag_dynamics.nodes.demos.energy_view import STATE, EnergyView, checked, options
from diag_dynamics.nodes.support.children import ends_with
from diag_dynamics.nodes.support.loading import COMPILED
from diag_dynamics.nodes.support.runner import run
from diag_dynamics.nodes.support.start import KINDLY, listen, stop
from diag_dynamics.parameters.view import PARAMETERS
from diag_dynamics.simulation import Simulation

NAMESPACE = f"/demo_{os.getpid()}"
"""Keeps the demo's topics apart from those of a robot, or of another demo, on the same machine."""


class Processes:
    """The nodes that the demo starts, each in a process of its own, and what they said."""

    def __init__(self):
        self._running = {}

    def start(self, node, **parameters):
        """Start a node of this package in the demo's namespace."""
        command = [
            sys.executable,
            "-m",
            f"diag_dynamics.nodes.{node}",
            "--ros-args",
            "-r",
            f"__ns:={NAMESPACE}",
        ]
        command += ["-r", "/clock:=clock"]  # nobody else's, should one simulate
        for name, value in parameters.items():
            command += ["-p", f"{name}:={value}"]
        said = tempfile.TemporaryFile(mode="w+")  # noqa: SIM115 (closed by stop)
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=subprocess.STDOUT,
            preexec_fn=ends_with(os.getpid()),
        )
        self._running[node] = process, said

    def failure(self):
        """Why the demo cannot go on: a node that has ended, with its last words; or None."""
        for node, (process, said) in self._running.items():
            if process.poll() is not None:
                said.seek(0)
                return f"{node} has ended with status {process.returncode}:\n" + "".join(said.readlines()[-15:])
        return None

    def stop(self):
        """End all nodes, kindly at first."""
        for process, _ in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process, said in self._running.values():
            try:
                process.wait(timeout=KINDLY)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            said.close()


def free_port(wanted=PARAMETERS["port"].default):
    """A port of this machine that is free: the wanted one, if it is."""
    for port in (wanted, 0):
        with socket.socket() as probe, suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return probe.getsockname()[1]
    raise InputError("No port of this machine is free: the page cannot be served.")


def prepared(urdf, *more, **options):
    """The robot, for which all is compiled that the nodes will need, once instead of in each of them.

    Parameters
    ----------
    urdf : str or path
    *more : callable
        Compile what else there is, of a model.
    **options
        Of load_urdf.

    Raises
    ------
    InputError
        It has no moving joint.
    """
    with stop.may_be_left(status=130):
        model = load_urdf(urdf, **options)
        if model.nv == 0:
            raise InputError(f"robot '{model.name}' has no moving joint: there is nothing to show.")
        DiagonalDynamics(model).compile(*COMPILED)
        Simulation(model).advance(steps=0)
        for compile_ in more:
            compile_(model)
        return model


def main(args=None):
    """Run the demo; ``--help`` lists the options."""
    parser = options(argparse.ArgumentParser(prog="demo", description=__doc__))
    parser.add_argument("--robot", default="panda", help="a URDF or xacro file, or a name of diag-dynamics robots")
    parser.add_argument("xacro_args", nargs="*", metavar="NAME:=VALUE", help="arguments of a xacro file")
    parser.add_argument("--massless", choices=("error", "lock"), default="error", help="joints that move no inertia")
    parser.add_argument("--mimic", choices=("embed", "free", "lock"), default="embed", help="joints that follow others")
    parser.add_argument("--rate", type=float, default=500.0, help="joint states per second (default %(default)s)")
    chosen = checked(parser, parser.parse_args(args))
    if not 1.0 <= chosen.rate <= 10000.0:
        parser.error(f"argument --rate: {chosen.rate} is not between 1 and 10000")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")  # a demo is nobody else's business
    listen()
    print(f"a simulated robot, {chosen.robot}, its monitor and a page start", flush=True)
    processes = Processes()
    try:
        urdf = robot_source(chosen.robot, chosen.xacro_args)
        remedies = {"massless": chosen.massless, "mimic": chosen.mimic}
        model = prepared(urdf, **remedies)
        processes.start("simulator", robot_description=urdf, motion="wave", rate=chosen.rate, **remedies)
        processes.start("monitor", **remedies)
        port = free_port()
        processes.start("view", port=port, robots=f"[{NAMESPACE}]")
        print(f"page, while the demo runs: http://127.0.0.1:{port}/", flush=True)
        view = None

        def make_view():
            nonlocal view
            options_of_view = (chosen.duration, chosen.picture, processes.failure, STATE)
            view = EnergyView(model.name, *options_of_view, namespace=NAMESPACE)
            return view

        status = run(make_view)
        if view is not None and not status:
            status = view.conclude()
    except DiagDynamicsError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        status = 1
    except KeyboardInterrupt:
        status = 130
    finally:
        processes.stop()
    return status


if __name__ == "__main__":
    sys.exit(main())
