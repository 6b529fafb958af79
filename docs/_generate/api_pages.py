"""Directive `public-names`: everything in `__all__` of a module, by autodoc.

```{public-names} fenchel.potentials
```
"""

from __future__ import annotations

import importlib
import inspect
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles


class PublicNames(SphinxDirective):
    """The doc of the module, then classes with their members, functions and data in the order of `__all__`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        module = importlib.import_module(self.arguments[0])
        names = list(getattr(module, "__all__", ()))
        lines = [f".. automodule:: {module.__name__}", "   :no-members:", ""]
        for name in names:
            item = getattr(module, name)
            home = getattr(item, "__module__", None) or module.__name__
            if not f"{home}.".startswith(f"{module.__name__}."):
                continue  # it has its path in another room
            if inspect.isclass(item):
                lines += [f".. autoclass:: {module.__name__}.{name}", "   :members:", "   :show-inheritance:", ""]
            elif inspect.isroutine(item):
                lines += [f".. autofunction:: {module.__name__}.{name}", ""]
        node = nodes.Element()
        node.document = self.state.document
        nested_parse_with_titles(self.state, StringList(lines, source=module.__name__), node)
        return node.children


def setup(sphinx: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    sphinx.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True, "version": "1"}
