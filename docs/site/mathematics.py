# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Formulas as MathML, which browsers draw by themselves: neither a script nor a font has to be fetched.

Sphinx's own way is MathJax from another server; a copy of it would be 2 MB of scripts and fonts.
"""

import xml.etree.ElementTree as ET

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

NAMESPACE = "http://www.w3.org/1998/Math/MathML"

ACCENTS = set("˙¨¯ˉ^~→")
"""Signs above a letter. docutils takes a lower index behind one for a text below the letter."""


def as_mathml(text, block):
    """Return MathML of a formula in LaTeX.

    Raises
    ------
    docutils.utils.math.MathError
        for a command that docutils does not know; the build then ends.
    """
    ET.register_namespace("", NAMESPACE)
    formula = ET.fromstring(tex2mathml(text, as_block=block))
    for node in list(formula.iter(f"{{{NAMESPACE}}}munderover")):
        if (node[2].text or "").strip() in ACCENTS:
            letter, index, accent = node
            node[:] = [ET.Element(f"{{{NAMESPACE}}}mover", accent="true"), index]
            node[0].extend([letter, accent])
            node.tag = f"{{{NAMESPACE}}}msub"
    return ET.tostring(formula, encoding="unicode")


def inline(translator, node):
    """Write a formula within a line."""
    translator.body.append(as_mathml(node.astext(), block=False))
    raise SkipNode


def block(translator, node):
    """Write a formula of its own line; wide ones scroll."""
    translator.body.append(f'<div class="formula">{as_mathml(node.astext(), block=True)}</div>')
    raise SkipNode


def setup(app):
    """Take the place of Sphinx's renderers."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
