"""An extension of Griffe: the roles and the math blocks of docstrings in the Markdown that the pages are made of."""

import re
import textwrap

import griffe

ROLE = re.compile(r":(?:func|class|meth|attr|mod|data|exc):`~?([^`]+)`")
INLINE = re.compile(r":math:`([^`]+)`")
BLOCK = re.compile(r"^([ ]*)\.\. math::[ ]*(.*)\n((?:(?:\1[ ]+.*)?\n)*(?:\1[ ]+.*)?)", re.MULTILINE)
# In Markdown "[fx, fy] [N]" is a reference to "N"; code and formulas stay as they are.
BRACKETS = re.compile(r"(`+.+?`+|\$\$.+?\$\$|\$[^$]+\$)|(\]\s*)\[", re.DOTALL)


class DocstringMarkup(griffe.Extension):
    """Rewrite each docstring before it is parsed."""

    def on_instance(self, *, obj: griffe.Object, **_) -> None:
        """Turn ``:func:`name``` into code, ``:math:`` and ``.. math::`` into formulas between dollars."""
        if obj.docstring:
            obj.docstring.value = in_markdown(obj.docstring.value)


def in_markdown(text: str) -> str:
    """Return a docstring with Markdown in the place of roles and math blocks."""

    def block(match: re.Match) -> str:
        formula = textwrap.dedent("\n".join((match[2], textwrap.dedent(match[3])))).strip()
        return textwrap.indent(f"\n$$\n{formula}\n$$\n\n", match[1])

    markdown = INLINE.sub(r"$\1$", ROLE.sub(r"`\1`", BLOCK.sub(block, text)))
    return BRACKETS.sub(lambda match: match[1] or rf"{match[2]}\[", markdown)
