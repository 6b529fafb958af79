"""The little language in which kernels are written: one text for two and three dimensions, with parts that a scene may not need.

* a line that ends in `#? condition` stays only where the condition on the features of the scene holds (the mark itself goes);
* `$name` is replaced by a value (a column number, an expression of a law);
* `SUM(a_@ * b_@)` is the sum over the components of space, in their order;
* any other line with `@` is repeated for each component of space, with `^` for each component of rotation (three, or one in the plane).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ...errors import DeclarationError

__all__ = ["expand"]


def expand(text: str, dimension: int, features: Mapping[str, Any], values: Mapping[str, Any]) -> str:
    """The kernel for one scene; `DeclarationError` when the text mentions a feature or a value that it was not given."""
    known = {"two": dimension == 2, "three": dimension == 3, **features}
    lines: list[str] = []
    for line in text.strip("\n").split("\n"):
        code, mark, condition = line.partition("#?")
        if mark:
            try:
                wanted = eval(condition.strip(), {"__builtins__": {}}, known)  # our own texts, never a file's
            except NameError as error:
                raise DeclarationError(f"kernel text: {condition.strip()!r}: {error}") from None
            if not wanted:
                continue
            code = code.rstrip()
        code = _values(code, values)
        code = _sums(code, dimension)
        if "@" in code and not code.lstrip().startswith("@"):
            lines += [code.replace("@", str(a)) for a in range(dimension)]
        elif "^" in code:
            lines += [code.replace("^", str(a)) for a in range(3 if dimension == 3 else 1)]
        else:
            lines.append(code)
    return "\n".join(lines) + "\n"


def _values(code: str, values: Mapping[str, Any]) -> str:
    def value(found: re.Match[str]) -> str:
        name = found.group(1)
        if name not in values:
            raise DeclarationError(f"kernel text: ${name} has no value; there are {', '.join(sorted(values))}")
        return str(values[name])

    return re.sub(r"\$([a-z_]+)", value, code)


def _sums(code: str, dimension: int) -> str:
    while (at := code.find("SUM(")) >= 0:
        depth, end = 1, at + 4
        while depth:
            depth += {"(": 1, ")": -1}.get(code[end], 0)
            end += 1
        term = code[at + 4 : end - 1]
        whole = " + ".join(term.replace("@", str(a)) for a in range(dimension))
        code = f"{code[:at]}({whole}){code[end:]}"
    return code
