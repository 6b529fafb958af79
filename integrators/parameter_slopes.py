"""Derivatives by the parameters of what a reduced step reads, from sympy, as numpy functions of all points at once.

    numbers(θ, dt)                the coefficients c of the step and ∂c/∂θ;
    functions(z, s, γ, θ, dt)     ∂f_i/∂θ and ∂(∇Φ + Σ γ_i ∇f_i)/∂θ at fixed reduced forces z, ∂ ln C_j/∂θ and ∂N_j/∂θ of the power
                                  terms C_j y^N_j, and ∂R/∂θ of forces R of non-linear hardening at fixed s.

θ are the parameters in order, then the temperature if the law has one; the functions are also differentiated by the scalars frozen at the
start of the step, which stand behind. The same reduction serves all methods, the closed form too: its surface is one more affine one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Add, Expr, Function, S, Symbol, cse, log, numbered_symbols

from ..potentials import Law
from ..potentials.atoms.positive_part import tidy
from ..potentials.printer import NumberPrinter
from .coefficients import reduced_numbers, strain_numbers
from .plan import LINES, METRIC, STRAIN_START
from .reduced_structure import Reduction, find_reduction
from .reduced_text import RATE_TIME
from .structure import internal_scalars

__all__ = ["FunctionSlopes", "ParameterSlopes", "parameter_slopes"]

Array = NDArray[np.float64]


class _Inverse(Function):
    """1/x, and zero at zero: an element of the subdifferential of a norm."""

    is_real = True


class _ArrayPrinter(NumberPrinter):
    """Numbers as numpy text."""

    def _print_PositivePart(self, expr: Any) -> str:
        return f"np.maximum({self._print(expr.args[0])}, 0.0)"

    def _print_Step(self, expr: Any) -> str:
        return f"np.where({self._print(expr.args[0])} > 0.0, 1.0, 0.0)"

    def _print__Inverse(self, expr: Any) -> str:
        return f"_inverse({self._print(expr.args[0])})"

    def _print_log(self, expr: Any) -> str:
        return f"_log({self._print(expr.args[0])})"


def _inverse(x: Any) -> Any:
    return np.where(x != 0.0, 1.0 / np.where(x != 0.0, x, 1.0), 0.0)


def _log(x: Any) -> Any:
    """ln x, and zero at zero, where a power with a positive exponent stands before it."""
    return np.log(np.where(x == 0.0, 1.0, x))


def array_function(outputs: list[Expr], arguments: list[str]) -> Callable[..., list[Any]]:
    """Numpy function of the named arguments, with shared subexpressions computed once."""
    guarded = [
        e.replace(
            lambda p: p.is_Pow and p.exp.could_extract_minus_sign() and not p.base.is_number,
            lambda p: _Inverse(p.base**-p.exp),
        )
        for e in outputs
    ]
    shared, found = cse(guarded, symbols=numbered_symbols("x", real=True), order="canonical")
    renamed = {x: Symbol(f"{x}_", real=True) for x, _ in shared}
    printer = _ArrayPrinter()

    def code(e: Any) -> str:
        return str(printer.doprint(e.xreplace(renamed))).replace("math.", "np.")

    lines = [f"def evaluated({', '.join(arguments)}):"]
    lines += [f"    {renamed[x]} = {code(e)}" for x, e in shared]
    lines += [f"    return [{', '.join(code(e) for e in found)}]"]
    space: dict[str, Any] = {"np": np, "_inverse": _inverse, "_log": _log}
    exec("\n".join(lines), space)
    return space["evaluated"]


@dataclass(frozen=True)
class FunctionSlopes:
    """At n points and K directions (θ, then frozen scalars): `surfaces` (n, m, K), `gradient` (n, unknowns, K), `logarithms` and
    `exponents` (n, terms, K) with the values `power_logarithms`, `power_exponents` (n, terms), `forces` (n, moving, K)."""

    surfaces: Array
    gradient: Array
    power_logarithms: Array
    power_exponents: Array
    logarithms: Array
    exponents: Array
    forces: Array


@dataclass(frozen=True)
class ParameterSlopes:
    """Coefficients and functions of one law with their derivatives by θ."""

    law: Law
    reduction: Reduction
    plan: tuple[int, ...]
    entries: tuple[Expr, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of θ."""
        heat = (self.law.temperature.name,) if self.law.temperature is not None else ()
        return (*(p.name for p in self.law.parameters), *heat)

    @cached_property
    def symbols(self) -> tuple[Any, ...]:
        """Symbols of θ."""
        heat = (self.law.temperature,) if self.law.temperature is not None else ()
        return (*self.law.parameters, *heat)

    @cached_property
    def _numbers(self) -> tuple[Callable[..., list[Any]], list[tuple[int, int]]]:
        places, slopes = [], []
        for i, e in enumerate(self.entries):
            for j, s in enumerate(self.symbols):
                slope = tidy(e.diff(s)) if s in e.free_symbols else S.Zero
                if slope != 0:
                    places.append((i, j))
                    slopes.append(slope)
        return array_function([*self.entries, *slopes], [*self.names, RATE_TIME.name]), places

    def numbers(self, theta: list[Any], dt: Any) -> tuple[Array, Array]:
        """(c (L, N), ∂c/∂θ (L, N, K)) with L one, or the number of points where θ or dt has one value each."""
        function, places = self._numbers
        with np.errstate(all="ignore"):
            found = function(*theta, dt)
        size = len(self.entries)
        length = max([1, *(np.size(f) for f in found)])
        values, slopes = np.empty((length, size)), np.zeros((length, size, len(self.names)))
        for i in range(size):
            values[:, i] = found[i]
        for (i, j), slope in zip(places, found[size:], strict=True):
            slopes[:, i, j] = slope
        return values, slopes

    @cached_property
    def _functions(self) -> tuple[Callable[..., list[Any]], list[tuple[str, tuple[int, ...]]]]:
        r = self.reduction
        frozen = {s: Symbol(f"frozen_{s.variable.name}_", real=True) for s in r.frozen_scalars}
        directions = [*self.symbols, *frozen.values()]
        places: list[tuple[str, tuple[int, ...]]] = []
        outputs: list[Expr] = []

        def put(where: str, place: tuple[int, ...], expression: Any) -> None:
            if expression != 0:
                places.append((where, place))
                outputs.append(expression)

        def slope(expression: Any, symbol: Any) -> Any:
            return tidy(expression.diff(symbol)) if symbol in expression.free_symbols else S.Zero

        functions = [f.xreplace(frozen) for f in r.functions]
        finite = (RATE_TIME * r.finite).xreplace(frozen)
        gammas = [Symbol(f"gamma_{i}_", real=True) for i in range(len(functions))]
        gradient = [
            Add(tidy(finite.diff(z)), *(g * tidy(f.diff(z)) for g, f in zip(gammas, functions, strict=True)))
            for z in r.unknowns
        ]
        for j, s in enumerate(directions):
            for i, f in enumerate(functions):
                put("surfaces", (i, j), slope(f, s))
            for i, g in enumerate(gradient):
                put("gradient", (i, j), slope(g, s))
        for i, (weight, k, p) in enumerate(() if r.soft is None else r.soft.terms):
            logarithm = (log(RATE_TIME * weight * p) + p * log(k)).xreplace(frozen)
            exponent = (p - 1).xreplace(frozen)
            put("power_logarithms", (i,), logarithm)
            put("power_exponents", (i,), exponent)
            for j, s in enumerate(directions):
                put("logarithms", (i, j), slope(logarithm, s))
                put("exponents", (i, j), slope(exponent, s))
        if not r.moduli.quadratic:
            table = dict(zip(internal_scalars(self.law), r.moduli.slopes, strict=True))
            for j, s in enumerate(directions):
                for i, variable in enumerate(r.scalars):
                    put("forces", (i, j), slope(table[variable], s))
        arguments = [str(z) for z in r.unknowns] + [str(s) for s in r.scalars] + [str(f) for f in frozen.values()]
        arguments += [str(g) for g in gammas]
        return array_function(outputs, [*arguments, *self.names, RATE_TIME.name]), places

    def functions(self, z: Array, s: Array, gamma: Array, theta: list[Any], dt: Any) -> FunctionSlopes:
        """Derivatives at n points: z (n, unknowns), s moving then frozen scalars (n, ·), γ (n, surfaces)."""
        r, n = self.reduction, len(z)
        function, places = self._functions
        with np.errstate(all="ignore"):
            found = function(*z.T, *s.T, *gamma.T, *theta, dt)
        width = len(self.names) + len(r.frozen_scalars)
        terms = 0 if r.soft is None else len(r.soft.terms)
        made = {
            "surfaces": np.zeros((n, len(r.functions), width)),
            "gradient": np.zeros((n, len(r.unknowns), width)),
            "power_logarithms": np.zeros((n, terms)),
            "power_exponents": np.zeros((n, terms)),
            "logarithms": np.zeros((n, terms, width)),
            "exponents": np.zeros((n, terms, width)),
            "forces": np.zeros((n, len(r.scalars), width)),
        }
        for (where, place), value in zip(places, found, strict=True):
            made[where][(slice(None), *place)] = value
        return FunctionSlopes(**made)


@lru_cache(maxsize=32)
def parameter_slopes(law: Law) -> ParameterSlopes:
    """Of a law whose step is reduced; `NoReduction` for another."""
    reduction = find_reduction(law)
    numbers = reduced_numbers(reduction)
    numbers.plan[LINES] = numbers.size
    if reduction.affine:
        for i, f in enumerate(reduction.surfaces):
            rest = f.xreplace(dict.fromkeys(reduction.unknowns, S.Zero))
            numbers.add(f"surface {i}", *(f.diff(z) for z in reduction.unknowns), rest)
    numbers.plan[STRAIN_START] = strain_numbers(numbers, reduction)
    return ParameterSlopes(law, reduction, tuple(numbers.plan), tuple(e for _, g in numbers.groups for e in g))


def lines_of(plan: tuple[int, ...]) -> tuple[int, int]:
    """Places of the metric and of the affine surfaces among the coefficients."""
    return plan[METRIC], plan[LINES]
