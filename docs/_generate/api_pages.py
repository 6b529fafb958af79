"""Directive `public-names`: everything in `__all__` of a module, by autodoc.

```{public-names} fenchel.potentials
```
"""

from __future__ import annotations

import importlib
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from public_surface import listed
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles


class PublicNames(SphinxDirective):
    """The doc of the module, then classes with their members, functions and data in the order of `__all__`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        module = importlib.import_module(self.arguments[0])
        lines = [f".. automodule:: {module.__name__}", "   :no-members:", ""]
        for name, kind in listed(module.__name__):
            path = f"{module.__name__}.{name}"
            if kind == "class":
                lines += [f".. autoclass:: {path}", "   :members:", "   :show-inheritance:", ""]
            elif kind == "function":
                lines += [f".. autofunction:: {path}", ""]
            else:
                lines += [f".. py:data:: {path}", f"   :type: {type(getattr(module, name)).__name__}", ""]
        node = nodes.Element()
        node.document = self.state.document
        nested_parse_with_titles(self.state, StringList(lines, source=module.__name__), node)
        return node.children


def setup(sphinx: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    sphinx.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True, "version": "1"}
