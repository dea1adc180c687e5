# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""API reference: one page for each public name, written into docs/api from docstrings, and links to these pages."""

import inspect
import pydoc
import re

from docutils import nodes
from sphinx.addnodes import pending_xref

import diag_dynamics

TITLES = {
    "description": "Robot models",
    "model": "Robot models",
    "dynamics": "Dynamics",
    "results": "Dynamics",
    "simulation": "Simulation",
    "control": "Control and observation",
    "collision": "Collision and contact limits",
    "recordings": "Recordings",
    "identification": "Identification",
    "exceptions": "Exceptions and warnings",
}
"""Titles of groups by the package or module that defines a name."""

RESULTS = (
    "results.Factors",
    "results.Momentum",
    "results.ExternalWrench",
    "results.TouchedLink",
    "collision.predicted_contact.PredictedContact",
    "collision.predicted_contact.Impact",
    "dynamics.flexible_joints.FlexibleEvaluation",
    "simulation.simulation.EnergyAudit",
    "recordings.external_torque.Observed",
    "identification.excitation.Excitation",
    "identification.result.Identification",
)
"""Types of results, which methods return and nobody constructs, by their modules."""

HEAD = "# API reference\n\nVectors have the order of `model.dof_names`. Units are SI. Batches have a leading axis T.\n"


def groups():
    """Return the public names and those of results by title of their group."""
    found = {title: [] for title in TITLES.values()}
    for name in (*diag_dynamics.__all__, *RESULTS):
        if name != "plot":
            found[TITLES[value_of(name).__module__.split(".")[1]]].append(name)
    return found | {"Plots": ["plot"]}


def value_of(name):
    """Return the class, function or module of a name in the package."""
    if name in diag_dynamics.__all__:
        return getattr(diag_dynamics, name)
    return pydoc.locate(f"diag_dynamics.{name}")


def summary(name):
    """Return the first line of a docstring, without markup of roles."""
    line = inspect.getdoc(value_of(name)).splitlines()[0]
    return re.sub(r":\w+:`~?([^`]*)`", r"`\1`", line).replace("|", r"\|")


def page(name):
    """Return the text of the page of a public name."""
    value = value_of(name)
    kind = (
        "class" if inspect.isclass(value) else "module" if inspect.ismodule(value) else "function"
    )
    options = {"class": "   :members:\n", "module": "   :members:\n", "function": ""}[kind]
    if kind == "class" and not issubclass(value, (Exception, tuple)):
        options += "   :inherited-members:\n"
    title = name if name in RESULTS else f"dd.{name}"
    return f"# {title}\n\n```{{eval-rst}}\n.. auto{kind}:: diag_dynamics.{name}\n{options}```\n"


def index():
    """Return the text of the page that lists all public names."""
    parts, names = [HEAD], []
    for title, members in groups().items():
        rows = [f"| [{name}]({name}.md) | {summary(name)} |" for name in members]
        parts.append("\n".join([f"## {title}\n", "| name | |", "|---|---|", *rows, ""]))
        names += members
    parts.append("\n".join(["```{toctree}", ":hidden:", "", *names, "```", ""]))
    return "\n".join(parts)


def write_pages(app, _config):
    """Write pages that changed, and delete pages of names that are gone."""
    folder = app.srcdir / "docs" / "api"
    folder.mkdir(exist_ok=True)
    names = [name for members in groups().values() for name in members]
    pages = {folder / f"{name}.md": page(name) for name in names} | {folder / "index.md": index()}
    for path in set(folder.glob("*.md")) - set(pages):
        path.unlink()
    for path, text in pages.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def link_names(app, doctree):
    """Link names in code, such as dd.identify, to their pages."""
    document = app.env.docname
    prefix = r"(?:dd\.)?" if document == "docs/library" else r"dd\."
    for literal in list(doctree.findall(nodes.literal)):
        match = re.fullmatch(prefix + r"(\w+)(?:\(.*\))?", literal.astext())
        if (
            match
            and match[1] in diag_dynamics.__all__
            and not isinstance(literal.parent, nodes.reference)
        ):
            kind = {"refdomain": "py", "reftype": "obj", "reftarget": f"diag_dynamics.{match[1]}"}
            link = pending_xref("", refdoc=document, refexplicit=True, refwarn=True, **kind)
            literal.replace_self(link)
            link += literal


def find_names_in_all_modules(_app, _what, _name, _object, _options, lines):
    """Find classes and methods of docstrings by their last names: results have modules of their own."""
    lines[:] = [re.sub(":(class|meth):`", r":\1:`.", line) for line in lines]


def setup(app):
    """Write pages before Sphinx looks for them."""
    app.connect("autodoc-process-docstring", find_names_in_all_modules)
    app.connect("config-inited", write_pages)
    app.connect("doctree-read", link_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
