# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Build the site: `python docs/site/build.py FOLDER`. A warning or an unresolved reference is an error."""

import os
import subprocess
import sys
from pathlib import Path

from sphinx.cmd.build import main

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
REPORT = ROOT / "docs" / "report_panda.html"
"""Sample report, which the site links to."""


def build(folder):
    """Write the site into a folder; returns the exit status."""
    if not REPORT.exists():
        command = [sys.executable, ROOT / "docs" / "sample_report.py"]
        subprocess.run(
            command,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            check=True,
        )
    kept = Path(folder).with_name(
        f"{Path(folder).name}-pages"
    )  # what Sphinx has read, for the next time
    options = ["-q", "-n", "-W", "-b", "html", "-c", str(HERE), "-d", str(kept)]
    status = main([*options, str(ROOT), str(folder)])
    if status == 0:
        print(Path(folder, "index.html").resolve())
    return status


if __name__ == "__main__":
    sys.exit(build(*sys.argv[1:]))
