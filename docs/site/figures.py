# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw the figures of the pages before Sphinx reads them: git does not have them."""

import runpy

import matplotlib


def draw_figures(app, _config):
    """Draw all figures if one is missing or older than the programs that draw them."""
    folder = app.srcdir / "docs" / "figures"
    programs = runpy.run_path(str(folder / "draw.py"))
    pictures = [folder / f"{name}.svg" for name in programs["FIGURES"]]
    newest = max(path.stat().st_mtime for path in folder.glob("*.py"))
    if any(not path.exists() or path.stat().st_mtime < newest for path in pictures):
        matplotlib.use("agg")
        programs["draw"]()


def setup(app):
    """Draw before Sphinx looks for pages and pictures."""
    app.connect("config-inited", draw_figures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
