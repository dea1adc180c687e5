# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS-free library; colcon builds the ROS package by CMakeLists.txt and never runs this file."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class WithDefinitions(build_py):
    """Puts the definitions of messages beside the modules: recordings are written with them where there is no ROS."""

    def run(self):
        """Copy modules, then definitions."""
        super().run()
        if not self.editable_mode:
            folder = Path(self.build_lib) / "diag_dynamics" / "definitions"
            folder.mkdir(parents=True, exist_ok=True)
            for definition in sorted(Path(__file__).parent.glob("msg/*.msg")):
                shutil.copy(definition, folder)


setup(cmdclass={"build_py": WithDefinitions})  # pyproject.toml says the rest
