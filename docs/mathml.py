"""Write formulas as MathML, which browsers draw without JavaScript, even off-line.

The module contains a renderer for Sphinx, which uses the converter of docutils.
"""

import re
from html import escape
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number

LETTER = re.compile(r"<mi>(\w)</mi>")
"""A variable. By default browsers draw variables in Unicode's mathematical italics, for which some
machines have no font. The attribute ``mathvariant`` prevents this, and the style sheet makes the
letters italic."""


def mathml(tex: str, block: bool = False) -> str:
    """Return a formula as an element ``<math>``.

    Args:
        tex: LaTeX, as far as docutils supports it.
        block: Whether the formula is displayed on a separate line.

    Raises:
        docutils.utils.math.MathError: For LaTeX that docutils does not support.
    """
    text = re.sub(r"\s+", " ", tex.strip())
    return LETTER.sub(r'<mi mathvariant="normal" class="letter">\1</mi>', tex2mathml(text, block))


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    self.body.append('<div class="math">')  # MyST puts a div with the label around it
    if node.get("number"):
        number = get_node_equation_number(self, node)
        self.body.append(f'<span class="eqno">({escape(str(number))})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append(mathml(node.astext(), block=True))
    self.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer in Sphinx; Sphinx calls this function."""
    app.add_html_math_renderer("perfplast_mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
