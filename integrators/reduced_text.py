"""The scalar functions of a reduced step as numba text: surfaces, viscous part and hardening with their derivatives.

    functions_(z, s, γ, c, level, out)

writes f (level 0), gradients (1) and the Hessian of Φ + Σ γ_i f_i (2) in the order that `reduced_projection` reads: f (m) · gradients (m n)
· ∇Φ (n) · Hessian (n n) · Φ, ψ_s · forces (r) · ∂²ψ_s (r r) · number, logarithms (4) and exponents (4) of the power
terms · sizes of the terms of f at zero force (m).
"""

from __future__ import annotations

from typing import Any

from sympy import Abs, Add, Expr, Function, S, Symbol, cse, log, numbered_symbols

from ..potentials.atoms.positive_part import tidy
from ..potentials.printer import NumberPrinter
from .reduced_structure import Reduction
from .structure import internal_scalars

__all__ = ["POWERS", "RATE_TIME", "function_text", "output_size"]

RATE_TIME = Symbol("dt", positive=True)
POWERS = 4


class Reciprocal(Function):
    """1/x, and zero at zero: with q = 0 that is an element of the subdifferential of a norm."""

    is_real = True


class _GuardedPrinter(NumberPrinter):
    """Numbers as `number_code` writes them, half-integer powers by roots, and `Reciprocal`."""

    def _print_Pow(self, expr: Any, rational: bool = False) -> str:
        base, exponent = expr.as_base_exp()
        if exponent.is_Rational and exponent.q == 2 and exponent.p in (3, 5):
            inside = self._print(base)
            return "(" + "*".join([f"({inside})"] * (exponent.p // 2) + [f"math.sqrt({inside})"]) + ")"
        return str(super()._print_Pow(expr, rational))

    def _print_Reciprocal(self, expr: Any) -> str:
        inside = self._print(expr.args[0])
        return f"(1.0/({inside}) if {inside} != 0.0 else 0.0)"


def _guarded(expression: Any) -> Any:
    """Negative powers of what may vanish as `Reciprocal`."""
    return expression.replace(
        lambda e: e.is_Pow and e.exp.could_extract_minus_sign() and not e.base.is_number,
        lambda e: Reciprocal(e.base**-e.exp),
    )


def _code(expression: Expr) -> str:
    return str(_GuardedPrinter().doprint(expression))


def output_size(reduction: Reduction) -> int:
    """Length of `out`."""
    m, n, r = len(reduction.functions), len(reduction.unknowns), len(reduction.scalars)
    return m + m * n + n + n * n + 2 + r + r * r + 1 + 2 * POWERS + m


def function_text(reduction: Reduction, first_constant: int) -> tuple[list[str], list[Expr]]:
    """Lines of `functions_`, and the expressions in parameters, dt and T that it reads as c[first_constant:]."""
    moving = {s: Symbol(f"frozen_{s.variable.name}_", real=True) for s in reduction.frozen_scalars}
    local = {*reduction.unknowns, *reduction.scalars, *moving.values()}
    constants: dict[Expr, Symbol] = {}

    def ready(expression: Expr) -> Expr:
        return _hoisted(expression.xreplace(moving), local, constants)

    levels = _outputs(reduction, ready)
    flat = [_guarded(e) for level in levels for _, e in level]
    shared, found = cse(flat, symbols=numbered_symbols("x", real=True), order="canonical")
    renamed = {x: Symbol(f"{x}_", real=True) for x, _ in shared}
    shared = [(renamed[x], e.xreplace(renamed)) for x, e in shared]
    found = [e.xreplace(renamed) for e in found]
    lines = [
        '    """Surfaces, viscous part and hardening in the reduced forces; see `fenchel.integrators.reduced_text`."""'
    ]
    lines += [f"    {z} = z_[{i}]" for i, z in enumerate(reduction.unknowns)]
    lines += [f"    {s} = s_[{j}]" for j, s in enumerate(reduction.scalars)]
    r = len(reduction.scalars)
    lines += [f"    {moving[s]} = s_[{r + j}]" for j, s in enumerate(reduction.frozen_scalars)]
    lines += [f"    {k} = c_[{first_constant + i}]" for i, k in enumerate(constants.values())]
    nonlinear = not reduction.moduli.quadratic
    if nonlinear:
        # the forces follow from the variables; they replace what was handed in
        start = reduction.first_scalar
        table = dict(zip(internal_scalars(reduction.law), reduction.moduli.slopes, strict=True))
        for j, s in enumerate(reduction.scalars):
            lines.append(f"    {reduction.unknowns[start + j]} = {_code(ready(table[s]))}")
    written: set[Any] = set()
    position = 0
    for number, level in enumerate(levels):
        if number:
            lines += [f"    if level_ < {number}:", "        return"]
        needed = _needed([found[position + i] for i in range(len(level))], shared, written)
        for x, e in shared:
            if x in needed:
                lines.append(f"    {x} = {_code(e)}")
                written.add(x)
        for place, _ in level:
            lines.append(f"    out_[{place}] = {_code(found[position])}")
            position += 1
    head = [
        "@njit(folder=FOLDER, signature_or_function=LAW_SIGNATURE)",
        "def functions_(z_, s_, gamma_, c_, level_, out_):",
    ]
    return [*head, *lines], list(constants)


def _outputs(reduction: Reduction, ready: Any) -> list[list[tuple[int, Expr]]]:
    unknowns = reduction.unknowns
    m, n, r = len(reduction.functions), len(unknowns), len(reduction.scalars)
    g, phi = m, m + m * n
    hessian = phi + n
    values = hessian + n * n
    forces = values + 2
    block = forces + r
    powers = block + r * r
    functions = [ready(f) for f in reduction.functions]
    finite = ready(RATE_TIME * reduction.finite)
    zero: list[tuple[int, Expr]] = [(i, f) for i, f in enumerate(functions)]
    zero.append((values, finite))
    nonlinear = not reduction.moduli.quadratic
    place = {s: j for j, s in enumerate(internal_scalars(reduction.law))}
    if nonlinear:
        zero.append((values + 1, ready(reduction.moduli.scalar_energy)))
        zero += [(forces + j, ready(reduction.moduli.slopes[place[s]])) for j, s in enumerate(reduction.scalars)]
    if reduction.soft is not None:
        zero.append((powers, ready(S(len(reduction.soft.terms)))))
        for i, (weight, k, p) in enumerate(reduction.soft.terms):
            logarithm = log(RATE_TIME * weight * p) + (p * log(k) if k != 1 else S.Zero)
            zero += [(powers + 1 + i, ready(logarithm)), (powers + 1 + POWERS + i, ready(p - 1))]
    for i, f in enumerate(reduction.functions):
        # terms that cancel at zero force: what rounding of f is measured by
        at_zero = f.xreplace(dict.fromkeys(unknowns, S.Zero))
        zero.append((powers + 1 + 2 * POWERS + i, ready(Add(*(Abs(t) for t in Add.make_args(at_zero))))))
    one: list[tuple[int, Expr]] = []
    for i, f in enumerate(functions):
        one += [(g + n * i + k, tidy(f.diff(z))) for k, z in enumerate(unknowns)]
    slopes = [tidy(finite.diff(z)) for z in unknowns]
    one += [(phi + k, e) for k, e in enumerate(slopes)]
    if nonlinear:
        for i, x in enumerate(reduction.scalars):
            for j, y in enumerate(reduction.scalars):
                one.append((block + r * i + j, ready(reduction.moduli.scalar_block[place[x]][place[y]])))
    gammas = [Symbol(f"gamma_[{i}]", real=True) for i in range(m)]
    two: list[tuple[int, Expr]] = []
    for k in range(n):
        for l, y in enumerate(unknowns):
            entry = tidy(slopes[k].diff(y))
            for i in range(m):
                entry = entry + gammas[i] * tidy(one[n * i + k][1].diff(y))
            two.append((hessian + n * k + l, entry))
    return [zero, one, two]


def _needed(roots: list[Expr], shared: list[tuple[Any, Expr]], written: set[Any]) -> set[Any]:
    table = dict(shared)
    found: set[Any] = set()
    stack = [s for e in roots for s in e.free_symbols]
    while stack:
        symbol = stack.pop()
        if symbol in table and symbol not in found and symbol not in written:
            found.add(symbol)
            stack += list(table[symbol].free_symbols)
    return found


def _hoisted(expression: Any, local: set[Any], constants: dict[Expr, Symbol]) -> Any:
    """The expression with its largest parts free of `local` symbols replaced by constants."""
    if not expression.free_symbols & local:
        if expression.is_Number:
            return expression
        return constants.setdefault(expression, Symbol(f"k{len(constants)}_", real=True))
    if not expression.args:
        return expression
    if expression.is_Add or expression.is_Mul:
        fixed = [a for a in expression.args if not a.free_symbols & local]
        moving = [_hoisted(a, local, constants) for a in expression.args if a.free_symbols & local]
        joined = expression.func(*fixed)
        if not joined.is_Number:
            joined = constants.setdefault(joined, Symbol(f"k{len(constants)}_", real=True))
        return expression.func(joined, *moving)
    return expression.func(*(_hoisted(a, local, constants) for a in expression.args))
