# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The site: the pages of this repository by Sphinx, with nothing that a browser would fetch from elsewhere.

`make docs` builds it. The source folder is the repository itself, so links between pages are those that GitHub follows.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(HERE)]

import diag_dynamics  # noqa: E402  it lies in the folder that was just put on the path

project = "diag_dynamics"
author = "diag_dynamics maintainers"
project_copyright = author
version = release = diag_dynamics.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "api",
    "excerpts",
    "figures",
    "mathematics",
    "repository",
]
root_doc = "docs/index"
include_patterns = [
    "docs/*.md",
    "docs/api/*.md",
    "docs/howto/*.md",
    "benchmarks/results/*.md",
    "*.md",
]
exclude_patterns = ["build", "README.md", ".*", "*.egg-info", "test", "diag_dynamics"]

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4  # as many as GitHub makes, and the same names
# Types in docstrings are words: "array_like, shape (nv,)".
nitpick_ignore_regex = [("py:class", r"(?!diag_dynamics\.).*")]
suppress_warnings = [
    "myst.header",  # pages that are generated leave a level out
    "ref.python",  # several classes have an attribute of one name
]

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstring says what an argument is, its shape and its unit
autodoc_class_signature = "mixed"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"diag_dynamics {version}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True, "sidebar_hide_name": False}
html_domain_indices = False
pygments_style = "friendly"
pygments_dark_style = "native"
