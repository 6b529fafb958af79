"""Module text of a law whose step is not generated: what was declared and its state laws, as functions of one point.

Only what the law mentions stands in it. The step itself is solved by the general method, `fenchel.integrators.general_update`.
"""

from __future__ import annotations

import re
from typing import Any

from sympy import default_sort_key
from sympy.printing.str import StrPrinter

from ..potentials import Law
from ..potentials.atoms.eig_sum import EigSumLeaf
from ..potentials.scalars import Parameter, ScalarVariable
from ..potentials.tensor import TensorSymbol
from ..potentials.vector import VectorSymbol
from .structure import is_data

__all__ = ["declared_module"]

_ALGEBRA = "Abs I Max dev eig_max eig_min eig_sum eigen_dyad inner norm pos spectral step tr".split()  # noqa: SIM905
_NUMPY = ("arccos", "arcsin", "arctan", "cos", "cosh", "exp", "log", "sin", "sinh", "sqrt", "tan", "tanh")
_RENAMED = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}


class _PointPrinter(StrPrinter):
    """Python text: names of frozen values and rates as identifiers, spectral functions by lambdas."""

    def _print(self, expr: Any, **kwargs: Any) -> str:
        if isinstance(expr, (ScalarVariable, TensorSymbol, VectorSymbol)):
            return _name(expr)
        if isinstance(expr, EigSumLeaf):
            function, tensor = expr.args
            return f"eig_sum(lambda {function.variables[0]}: {self._print(function.expr)}, {self._print(tensor)})"  # type: ignore[attr-defined]
        if type(expr).__name__ == "SpectralTensor":
            function, tensor = expr.args
            return f"spectral(lambda {function.variables[0]}: {self._print(function.expr)}, {self._print(tensor)})"
        if type(expr).__name__ == "EigenDyad":
            return f"eigen_dyad({self._print(expr.args[0])}, {expr.args[1]})"
        return super()._print(expr, **kwargs)


def _name(symbol: Any) -> str:
    role = getattr(symbol, "role", "state")
    return f"{role}_{symbol.variable.name}" if role in ("frozen", "rate") else symbol.name


def _text(expression: Any) -> str:
    return str(_PointPrinter({"full_prec": True}).doprint(expression))


def declared_module(law: Law, why: str) -> str:
    """Text of the module; `why` says why there is no generated step."""
    state = (law.observable, *law.internal, *((law.temperature,) if law.temperature is not None else ()))
    functions = [("energy_", "Free energy per volume [J/m3].", state, law.energy)]
    functions.append(("stress_", "Reversible stress [Pa].", state, law.stress))
    for variable, force in law.force_laws.items():
        functions.append((f"force_{variable.name}_", f"Force of {variable}.", state, force))
    if law.temperature is not None:
        functions.append(("entropy_", "Entropy per volume [J/(m3 K)].", state, law.entropy))
    potential, word = (law.phi, "phi") if law.phi is not None else (law.phi_star, "phi_star")
    if potential is not None:
        arguments = _arguments(potential.functions)
        if potential.finite != 0:
            functions.append((f"{word}_", f"Finite part of {word} [W/m3].", arguments, potential.finite))
        for number, surface in enumerate(potential.surfaces, start=1):
            functions.append((f"surface_{number}_", "Function f of {f <= 0}.", arguments, surface))
    body: list[str] = []
    for name, what, arguments, expression in functions:
        body += ["", "", *_function(law, name, what, arguments, expression)]
    gathered = _gathered(law, potential)
    body += ["", "", *gathered] if gathered else []
    joined = "\n".join(body)
    algebra = [w for w in _ALGEBRA if re.search(rf"\b{w}\b", joined)]
    numbers = [w for w in _NUMPY if re.search(rf"\b{w}\(", joined)]
    head = [
        f'"""The law `{law.name}`, written by fenchel: its step is solved by `general` ({why}).',
        "",
        "Strain [-] and stress [Pa] in Mandel components, one point.",
        "",
        *law.text.splitlines(),
        '"""',
        "",
        *([f"from numpy import {', '.join(numbers)}", ""] if numbers else []),
        *([f"from fenchel.integrators.point_algebra import {', '.join(algebra)}"] if algebra else []),
    ]
    return "\n".join(head).rstrip() + "\n" + joined + "\n"


def _arguments(expressions: tuple[Any, ...]) -> tuple[Any, ...]:
    found: set[Any] = set()
    for expression in expressions:
        symbols = expression.atoms(TensorSymbol, VectorSymbol, ScalarVariable)
        owners = {s.variable for s in symbols if s.role != "state"}
        found |= {s for s in symbols if s.role != "state" or s not in owners}
        found |= {s for s in symbols & owners if is_data(s) and s.role == "state" and s in expression.free_symbols}
    return tuple(sorted(found, key=default_sort_key))


def _function(law: Law, name: str, what: str, arguments: tuple[Any, ...], expression: Any) -> list[str]:
    text = _text(expression)
    for old, new in _RENAMED.items():
        text = re.sub(rf"\b{old}\(", f"{new}(", text)
    used = {s for s in expression.free_symbols if isinstance(s, Parameter)}
    values = [f"    {p.name} = values_[{i}]" for i, p in enumerate(law.parameters) if p in used]
    words = ", ".join([*(_name(a) for a in arguments), "values_"])
    return [f"def {name}({words}):", f'    """{what}"""', *values, f"    return {text}"]


def _gathered(law: Law, potential: Any) -> list[str]:
    state = (law.observable, *law.internal, *((law.temperature,) if law.temperature is not None else ()))
    words = ", ".join([*(_name(a) for a in state), "values_"])
    calls = ", ".join(f"force_{v.name}_({words})" for v in law.force_laws)
    lines: list[str] = []
    if calls:
        lines += [
            f"def forces_({words}):",
            '    """Forces of the internal variables, as declared."""',
            f"    return ({calls},)",
        ]
    if potential is not None and potential.surfaces:
        words = ", ".join([*(_name(a) for a in _arguments(potential.functions)), "values_"])
        calls = ", ".join(f"surface_{i}_({words})" for i in range(1, len(potential.surfaces) + 1))
        lines += ["", ""] if lines else []
        lines += [f"def surfaces_({words}):", '    """Functions f of {f <= 0}."""', f"    return ({calls},)"]
    return lines
