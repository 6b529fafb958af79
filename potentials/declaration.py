"""What may stand in a declaration: every rule with the symbol that breaks it and what to write instead."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy import AccumBounds, Derivative, DiracDelta, Expr, Heaviside, I, Piecewise, S, Symbol, sign

from ..errors import DeclarationError
from .atoms import ATOMS
from .atoms.atom import Invariant
from .derivative import variables_of
from .extended import Extended, as_extended, scalar_expression
from .names import checked_name
from .ranked import Ranked
from .roles import is_variable
from .scalars import Parameter, ScalarVariable, Temperature
from .tensor import PositiveTensor, TensorSymbol
from .vector import VectorSymbol

if TYPE_CHECKING:
    from .law import Law

__all__ = ["check_declaration", "normalise", "stress_of"]


_NOT_FINITE = (S.NaN, S.ComplexInfinity, S.Infinity, S.NegativeInfinity, I, AccumBounds)


def normalise(law: Law) -> dict[str, Any]:
    """Fields of a law in canonical form: sympy expressions, `Extended` force functions, tuples."""
    rule = f"law '{checked_name(law.name, 'law')}'"
    found: dict[str, Any] = {}
    if (law.psi is None) == (law.psi_star is None):
        said = "neither" if law.psi is None else "both"
        raise DeclarationError(f"{rule}: give one of psi= and psi_star=, not {said}")
    if law.phi is not None and law.phi_star is not None:
        raise DeclarationError(f"{rule}: give one of phi= and phi_star=, not both; each follows from the other")
    for key in ("psi", "psi_star"):
        value = getattr(law, key)
        if isinstance(value, Extended):
            raise DeclarationError(
                f"{rule}: {key} holds an indicator; a free energy is finite, constraints belong to phi_star"
            )
        if value is not None:
            found[key] = scalar_expression(value, f"{rule}: {key}", "a free energy is a scalar")
    for key in ("phi", "phi_star"):
        value = getattr(law, key)
        if value is not None:
            found[key] = as_extended(value, f"{rule}: {key}")
    if law.density is not None:
        found["density"] = _density(law.density, rule)
    if not isinstance(law.note, str):
        raise DeclarationError(f"{rule}: note must be text, not {type(law.note).__name__}")
    found["internal"] = _tuple(law.internal)
    if law.irreversible is not None:
        found["irreversible"] = _tuple(law.irreversible)
    return found


def _density(value: Any, rule: str) -> Expr:
    remedy = "density must be a positive number or an expression in parameters [kg/m3]"
    density = scalar_expression(value, f"{rule}: density", remedy)
    if variables_of(density) or density.is_nonpositive or (density.is_number and not density.is_positive):
        raise DeclarationError(f"{rule}: {remedy}, not {density}")
    if density.has(*_NOT_FINITE):
        raise DeclarationError(f"{rule}: {remedy}, finite and real, not {density}")
    return density


def _tuple(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, (tuple, list)) else (value,)


def stress_of(law: Law) -> TensorSymbol | None:
    """The stress symbol of ψ*: the one tensor in it that is neither the observable nor internal."""
    if law.psi_star is None:
        return None
    found = [
        t for t in law.psi_star.atoms(TensorSymbol) if t.role == "state" and t not in (*law.internal, law.observable)
    ]
    if law.observable in variables_of(law.psi_star) or len(found) != 1:
        shown = ", ".join(sorted(str(t) for t in found)) or "none"
        raise DeclarationError(
            f"law '{law.name}': psi_star must be written in one stress tensor, for example sig = sym_tensor('sig'), and internal "
            f"variables; tensors in it that are neither: {shown}"
        )
    return found[0]


def check_declaration(law: Law) -> None:
    """Raise `DeclarationError` for the first rule that the declaration breaks."""
    rule = f"law '{law.name}'"
    _variables(law, rule)
    declared = {law.observable, *law.internal}
    stress = stress_of(law)
    if law.psi is not None:
        _expression(rule, "psi", law.psi, declared, ())
    else:
        _expression(rule, "psi_star", law.psi_star, declared | {stress}, ())
    for word, potential, role in (("phi_star", law.phi_star, "force"), ("phi", law.phi, "rate")):
        if potential is not None:
            for function in potential.functions:
                _expression(rule, word, function, declared, (role, "frozen"))
                for symbol in sorted(variables_of(function), key=str):
                    _state_in_force_function(rule, word, symbol, role)
    _names(law, rule, declared)
    for tensor in law.irreversible or ():
        if tensor not in law.internal or not isinstance(tensor, TensorSymbol):
            raise DeclarationError(
                f"{rule}: irreversible names '{tensor}', which is not an internal tensor; list it in internal=(...)"
            )
    _ = law.forces  # two names for one force are refused there


def _state_in_force_function(rule: str, word: str, symbol: Any, role: str) -> None:
    if symbol.role == role or isinstance(symbol, Temperature):
        return
    other = {"force": "forces", "rate": "rates"}
    if symbol.role == "state":
        raise DeclarationError(
            f"{rule}: {word} mentions the state '{symbol}'; it may depend on {other[role]} and on frozen({symbol}) only, "
            f"see {other[role]}(...)"
        )
    raise DeclarationError(
        f"{rule}: {word} mentions the {symbol.role} '{symbol}'; {word} is a function of {other[role]}(...)"
    )


def _variables(law: Law, rule: str) -> None:
    if not (isinstance(law.observable, TensorSymbol) and law.observable.role == "state"):
        raise DeclarationError(f"{rule}: observable must be a tensor variable, sym_tensor('eps'), not {law.observable}")
    seen = {law.observable.name}
    for variable in law.internal:
        if isinstance(variable, Temperature):
            raise DeclarationError(
                f"{rule}: the temperature '{variable}' is not an internal variable; it is found in psi by itself"
            )
        if not is_variable(variable):
            raise DeclarationError(
                f"{rule}: internal variable {variable} must be sym_tensor(...), vector(...) or scalar(...)"
            )
        if variable.name in seen:
            raise DeclarationError(f"{rule}: the variable '{variable.name}' is declared twice")
        seen.add(variable.name)


def _names(law: Law, rule: str, declared: set[Any]) -> None:
    names = [p.name for p in law.parameters]
    taken = {v.name for v in declared} | {f.name for f in law.forces.values()}
    taken |= {law.temperature.name} if law.temperature is not None else set()
    for name in names:
        if names.count(name) > 1:
            raise DeclarationError(
                f"{rule}: two parameters are called '{name}' with different bounds or units; declare it once"
            )
        if name in taken:
            raise DeclarationError(f"{rule}: '{name}' is both a parameter and a variable; rename one")
    for force in law.forces.values():
        if force.name in {v.name for v in declared}:
            raise DeclarationError(f"{rule}: '{force.name}' is both a force and a variable; rename one")
    temperatures = {t for e in law._expressions() for t in e.atoms(Temperature)}
    if len(temperatures) > 1:
        raise DeclarationError(f"{rule}: two temperatures: {', '.join(sorted(map(str, temperatures)))}; a law has one")
    if temperatures and next(iter(temperatures)).name in {v.name for v in declared}:
        raise DeclarationError(f"{rule}: '{law.temperature}' is both the temperature and a variable; rename one")


def _expression(rule: str, what: str, expression: Expr, declared: set[Any], roles: tuple[str, ...]) -> None:
    if expression.has(*_NOT_FINITE):
        raise DeclarationError(
            f"{rule}: {what} holds a number that is not finite and real; write finite real coefficients"
        )
    if expression.has(Heaviside, DiracDelta, sign, Piecewise, Derivative):
        raise DeclarationError(f"{rule}: {what} holds {_odd(expression)}; write kinks with pos(...), Max, Abs or norm")
    for node in expression.atoms(Symbol):
        if not isinstance(node, (Parameter, ScalarVariable)) and not _bound(expression, node):
            raise DeclarationError(
                f"{rule}: '{node}' in {what} is a bare symbol; declare it with parameter(...) or scalar(...)"
            )
    for leaf in sorted(expression.atoms(Invariant), key=str):
        _leaf(rule, what, leaf)
    symbols = expression.atoms(TensorSymbol, VectorSymbol, ScalarVariable)
    for symbol in sorted(symbols, key=str):
        owner = symbol if symbol.role == "state" else symbol.variable
        if owner not in declared and not isinstance(owner, Temperature):
            raise DeclarationError(f"{rule}: '{owner}' is used in {what} but not declared; add it to internal=(...)")
        if symbol.role != "state" and symbol.role not in roles:
            if not roles:
                raise DeclarationError(
                    f"{rule}: {what} mentions a {symbol.role} ('{symbol}'); a free energy depends on state variables only"
                )
            raise DeclarationError(
                f"{rule}: {what} mentions the {symbol.role} '{symbol}'; it is a function of {roles[0]}s"
            )
    _functions(rule, what, expression)


def _functions(rule: str, what: str, expression: Any) -> None:
    """Every function must have an atom, or hold parameters only."""
    if isinstance(expression, Ranked):
        raise DeclarationError(
            f"{rule}: rank mismatch: {what} holds a function of the {expression.kind} {expression}; scalar functions take scalars, "
            "for example norm, tr, inner, eig_max of it; eig_sum(g, T) sums g over its eigenvalues"
        )
    if expression.is_Atom or not variables_of(expression):
        return
    if type(expression) not in ATOMS and expression.func.__name__ not in ("Add", "Mul"):
        raise DeclarationError(
            f"{rule}: {what} holds '{expression.func.__name__}' of a variable, which potentials do not know; they know "
            f"{', '.join(sorted(a.word for a in ATOMS.values()))}"
        )
    if isinstance(expression, Invariant):
        return
    for argument in expression.args:
        _functions(rule, what, argument)


def _bound(expression: Any, symbol: Symbol) -> bool:
    return symbol not in expression.free_symbols


def _odd(expression: Expr) -> str:
    return next(str(a.func.__name__) for a in expression.atoms(Heaviside, DiracDelta, sign, Piecewise, Derivative))


def _leaf(rule: str, what: str, leaf: Invariant) -> None:
    for quantity in leaf.args:
        if not isinstance(quantity, Ranked):
            continue
        for atom, coefficient in quantity.terms().items():
            found = {s for s in variables_of(coefficient) if not isinstance(s, Temperature)}
            if found:
                raise DeclarationError(
                    f"{rule}: the coefficient {coefficient} of a tensor in {what} depends on the state; it may hold parameters only"
                )
            if atom.has(PositiveTensor):
                raise DeclarationError(
                    f"{rule}: {leaf} in {what} is not available; use inner(pos(e), pos(e)) or tr(pos(e))"
                )
