# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The path of a stranger: every block of docs/tutorial.md, in its order, in an empty folder."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from pages import blocks_of

ROOT = Path(__file__).parents[2]
PATIENCE = 300.0
"""A command that has not said its text, or not ended, by then has failed [s]."""

pytestmark = [pytest.mark.full, pytest.mark.live, pytest.mark.ros]


class Terminal:
    """A bash that runs one block; what it says is kept, and it can be interrupted as by Ctrl-C."""

    def __init__(self, block, folder, environment):
        self.block, self.said, self.heard = block, [], threading.Condition()
        self.process = subprocess.Popen(
            ["bash", "-euo", "pipefail", "-c", block.code],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            with self.heard:
                self.said.append(line)
                self.heard.notify_all()
        with self.heard:
            self.heard.notify_all()

    def __str__(self):
        return f"docs/tutorial.md, line {self.block.line}:\n{''.join(self.said[-60:])}"

    def wait_for(self, text):
        """Wait until it has printed a text, or until it has ended and can do so no more."""
        with self.heard:
            there = self.heard.wait_for(
                lambda: text in "".join(self.said) or not self.reader.is_alive() or self.process.poll() is not None,
                PATIENCE,
            )
        if self.process.poll() is not None:
            self.reader.join(PATIENCE)
        assert there and text in "".join(self.said), f"never said '{text}': {self}"

    def ends_well(self):
        """Wait for its end, with status 0."""
        assert self.process.wait(PATIENCE) == 0, str(self)

    def interrupt(self):
        """End it, and all that it has started."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
        self.process.wait(PATIENCE)
        self.reader.join(PATIENCE)


def test_the_path_of_a_stranger(ros_domain, tmp_path, monkeypatch):
    """It goes through to the end, and what the page promises is printed."""
    monkeypatch.chdir(tmp_path)
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(ros_domain),
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
    }
    names, running = {}, {}
    blocks = blocks_of(ROOT / "docs" / "tutorial.md")
    assert len(blocks) > 15
    try:
        for block in blocks:
            if block.how == "not run":
                assert block.what
            elif block.how == "end":
                for name in block.what.split(", "):
                    running.pop(name).interrupt()
            elif block.how == "hear":
                name, text = block.what.split(", ")
                running[name].wait_for(text)
            elif block.language == "python":
                assert block.how == "run"
                exec(compile("\n" * block.line + block.code, "docs/tutorial.md", "exec"), names)
            else:
                assert block.language == "bash", block
                terminal = Terminal(block, tmp_path, environment)
                if block.how == "run in the background":
                    name, _, texts = block.what.partition(", until ")
                    running[name] = terminal
                    for text in texts.split(", and ") if texts else ():
                        terminal.wait_for(text)
                elif block.how == "run until":
                    try:
                        terminal.wait_for(block.what)
                    finally:
                        terminal.interrupt()
                else:
                    assert block.how == "run", block
                    terminal.ends_well()
            for name, one in running.items():
                assert one.process.poll() is None, f"{name} has ended: {one}"
    finally:
        for terminal in running.values():
            terminal.interrupt()
    assert running == {}
    assert {"arm.urdf", "arm.yaml", "alarms.yaml"} <= {path.name for path in tmp_path.iterdir()}
