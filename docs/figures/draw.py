# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw the figures of docs/concepts.md as SVG beside each module. The docs build does so; git ignores the pictures."""

import sys
from importlib import import_module
from pathlib import Path

import matplotlib

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

FIGURES = (
    "own_and_induced",
    "sweeps",
    "articulated_inertia",
    "factors",
    "energy_exchange",
    "flexible_arm",
    "flexible_links",
    "closed_loops",
)


def draw(folder=HERE):
    """Write all of them into a folder."""
    from style import RULES

    for name in FIGURES:
        with matplotlib.rc_context(RULES):
            picture = import_module(name).draw()
            picture.savefig(
                Path(folder) / f"{name}.svg",
                transparent=True,
                metadata={"Date": None, "Creator": None},
            )


if __name__ == "__main__":
    draw()
