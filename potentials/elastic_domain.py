"""The elastic domain of a law as a set of one tensor: that of the stress, every other force held at a given state.

φ* is a function of forces. The force of a tensor that ψ holds as ε − ε^p is the stress less what a state gives (a back stress); the forces
of the other variables follow from the state alone. Where the force is not the stress less a constant (wires beside the sand carry a part
of the stress), the set is that of the force.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from sympy import Expr, S

from ..errors import DeclarationError, InputError
from .conjugation.slots import mentions
from .derivative import partial
from .evaluate import evaluate
from .law import Law
from .ranked import Ranked
from .scalars import Parameter
from .tensor import SymmetricTensor, TensorSymbol

__all__ = ["Domain", "Setting", "domain_of"]


class Setting:
    """Numbers of a law at a state: `table` by symbol, of parameters, temperature, observable, internal and frozen variables.

    `values` by name, the temperature among them; `state` by name, tensors (6,) Mandel, vectors (3,), scalars, the observable allowed; what
    is left out is zero. `InputError` for a name that the law does not have and for a shape that is not that of the variable.
    """

    def __init__(self, law: Law, values: Mapping[str, Any], state: Mapping[str, Any] | None) -> None:
        import numpy as np

        self.law = law
        given = dict(values)
        heat = law.temperature
        self.table: dict[Any, Any] = {}
        if heat is not None:
            if heat.name not in given:
                raise InputError(f"law '{law.name}': give the temperature, {heat.name}=... in K")
            self.table[heat] = _number(law, heat.name, given.pop(heat.name))
        symbols = {p.name: p for p in law.parameters}
        self.values = law.admissible_values(given)
        self.table |= {symbols[name]: value for name, value in self.values.items()}
        known = {v.name: v for v in (law.observable, *law.internal)}
        for name in state or {}:
            if name not in known:
                raise InputError(f"law '{law.name}' has no variable '{name}'; it has: {', '.join(known)}")
        for name, variable in known.items():
            shape = () if not isinstance(variable, Ranked) else ((6,) if variable.rank == 2 else (3,))
            value = np.asarray((state or {}).get(name, np.zeros(shape)), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(
                    f"law '{law.name}': the state '{name}' has shape {value.shape}; it must be {shape}, finite"
                )
            self.table[variable] = value
        potential = law.phi if law.phi is not None else law.phi_star
        for function in () if potential is None else potential.functions:
            for symbol in _variables(function):
                if symbol.role == "frozen":
                    self.table[symbol] = self.table[symbol.variable]

    def number(self, thing: Any) -> Any:
        """Number of an expression in parameters and state."""
        return evaluate(thing, self.table)


@dataclass(frozen=True)
class Domain:
    """{A : f(A, …) ≤ 0 for all f of `functions`}, the tensor A in the place of `moving` symbols.

    `shifts` are the constants (6,) that are taken from A for each of them, `fixed` the numbers of everything else. `stress` is True where A
    is the stress; `symbol` what A is called, in LaTeX; `variable` whose force it is; `viscous` the finite part of φ*.
    `flat` is taken for −f inside, where f is zero on a whole set.
    """

    functions: tuple[Expr, ...]
    moving: tuple[Any, ...]
    shifts: tuple[Any, ...]
    fixed: Mapping[Any, Any]
    stress: bool
    symbol: str
    variable: Any
    viscous: Expr = S.Zero
    flat: float = 0.0

    def gap(self, tensors: Any) -> Any:
        """max f at tensors (n, 6) [Pa], (n,): ≤ 0 in the domain, NaN counts as outside."""
        import numpy as np

        table = dict(self.fixed)
        for symbol, shift in zip(self.moving, self.shifts, strict=True):
            table[symbol] = tensors - shift
        with np.errstate(all="ignore"):
            found = [np.broadcast_to(evaluate(f, table), (len(tensors),)) for f in self.functions]
        highest = np.max(found, axis=0)
        return np.where(np.isnan(highest), np.inf, np.where(highest <= 0.0, np.minimum(highest, -self.flat), highest))

    def active(self, tensors: Any) -> Any:
        """Place of the largest of the functions at tensors (n, 6), (n,)."""
        import numpy as np

        if len(self.functions) == 1:
            return np.zeros(len(tensors), dtype=int)
        return np.argmax([replace(self, functions=(f,)).gap(tensors) for f in self.functions], axis=0)

    def level(self, tensors: Any) -> Any:
        """Finite part of φ* [W/m³] at tensors (n, 6)."""
        return replace(self, functions=(self.viscous,), flat=0.0).gap(tensors)

    def below(self, level: float) -> Domain:
        """The level set {φ* ≤ level} of the finite part; at level 0, where φ* vanishes, the elastic domain of a law with overstress."""
        return replace(self, functions=(self.viscous - level,), flat=1.0 if level == 0.0 else 0.0)

    @cached_property
    def hints(self) -> Any:
        """Tensors (k, 6) near which the domain may lie."""
        import numpy as np

        fixed = [
            -np.asarray(v) for s, v in self.fixed.items() if getattr(s, "role", "") == "force" and np.shape(v) == (6,)
        ]
        return np.array([np.zeros(6), *self.shifts, *(v + self.shifts[0] for v in fixed)])


def domain_of(law: Law, values: Mapping[str, Any], state: Mapping[str, Any] | None = None) -> Domain:
    """Domain of a law at a state (virgin without one).

    Its functions are the surfaces of φ*, none for a law without. Raises `InputError` for values or a state that the law does not take, and
    `DeclarationError` where φ* is unknown or no tensor force enters it.
    """
    setting = Setting(law, values, state)
    potential = law.force_potential
    if potential is None:
        word = "it is elastic" if law.phi is None else "no rule gives the conjugate of its phi"
        raise DeclarationError(f"law '{law.name}' has no force function: {word}")
    slots = {s.variable: s for f in potential.functions for s in _variables(f) if s.role == "force"}
    laws = _force_laws(law, setting)
    tensors = [v for v in (*law.internal, law.observable) if v in slots and isinstance(v, TensorSymbol)]
    driven = [v for v in tensors if v == law.observable or laws[v][1]]
    if not driven:
        raise DeclarationError(f"law '{law.name}': phi_star mentions no tensor force that follows the strain")
    first = driven[0]
    moving, shifts, fixed = [], [], dict(setting.table)
    stress = first != law.observable and laws[first][2] is not None
    for v in driven:
        if v == first and not stress:
            moving, shifts = [*moving, slots[v]], [*shifts, setting.number(SymmetricTensor.linear(()))]
        elif stress and v != law.observable and laws[v][2] is not None:
            moving, shifts = [*moving, slots[v]], [*shifts, setting.number(laws[v][2])]
    for v, symbol in slots.items():
        if symbol not in moving:
            fixed[symbol] = _held(law, v, laws, setting)
    elastic = r"\sigma^{r}" if law.observable in law.forces else r"\sigma"
    name = elastic if stress else (r"\sigma^{ir}" if first == law.observable else _letter(slots[first]))
    return Domain(potential.surfaces, tuple(moving), tuple(shifts), fixed, stress, name, first, potential.finite)


def _held(law: Law, variable: Any, laws: Mapping[Any, Any], setting: Setting) -> Any:
    """The force of a variable that does not move with the tensor: what the state gives; zero of the observable and of the temperature."""
    import numpy as np

    if variable in laws:
        expression, _, _ = laws[variable]
        table = {**setting.table, law.stress_symbol: np.zeros(6)} if law.psi is None else setting.table
        return evaluate(expression, table) if not isinstance(expression, (int, float)) else float(expression)
    return np.zeros(3 if variable == law.temperature else 6)


def _force_laws(law: Law, setting: Setting) -> dict[Any, tuple[Any, bool, Any]]:
    """By internal variable: its force, whether that follows the strain (or the stress), and σ less it where this is constant, else None."""
    found: dict[Any, tuple[Any, bool, Any]] = {}
    if law.psi is None:
        # at fixed stress: A = ρ ∂ψ*/∂x
        stress: Any = law.stress_symbol
        rho = S.One if law.density is None else law.density
        for v in law.internal:
            force = partial(rho * law.psi_star, v)
            found[v] = _related(v, force, stress, stress)
        return found
    for v, force in law.force_laws.items():
        found[v] = _related(v, force, law.stress, law.observable)
    return found


def _related(variable: Any, force: Any, stress: Any, driver: Any) -> tuple[Any, bool, Any]:
    follows = mentions(force, {driver})
    if not (follows and isinstance(variable, TensorSymbol)):
        return force, follows, None
    rest = stress - force
    return force, True, None if mentions(rest, {driver}) else rest


def _variables(function: Any) -> list[Any]:
    from .scalars import ScalarVariable
    from .vector import VectorSymbol

    found = function.atoms(TensorSymbol, VectorSymbol, ScalarVariable)
    return sorted((s for s in found if not isinstance(s, Parameter)), key=str)


def _letter(symbol: Any) -> str:
    from sympy import latex

    return latex(symbol).replace(r"\boldsymbol", "")


def _number(law: Law, name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"law '{law.name}': {name} must be a number, not {type(value).__name__}") from None
