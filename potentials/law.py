"""A law: a free energy ψ, a force function φ*, and the names of its variables.

Generalised standard material, with the temperature T given during a step:

    σ^r = ρ ∂ψ/∂ε,   A_m = −ρ ∂ψ/∂α_m,   s = −∂ψ/∂T,   (ε̇, α̇_m, −q/T) ∈ ∂φ*(σ^ir, A_m, ∇T),   σ = σ^r + σ^ir.

The force σ^ir of the observable is zero unless φ* mentions it. `Law` holds the declaration and nothing else; state laws, table,
admissibility, text, update and conic program are derived on demand.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from sympy import Expr, S, default_sort_key, latex, sstr

from ..errors import DeclarationError, InputError
from ..notebook import math as math_rows
from .declaration import check_declaration, normalise
from .derivative import partial
from .extended import Extended, scalar_expression
from .scalars import Parameter, ScalarVariable, Temperature
from .tensor import SymmetricTensor, TensorSymbol
from .vector import VectorSymbol

__all__ = ["Law"]

Variable = TensorSymbol | ScalarVariable | VectorSymbol
Force = Any


@dataclass(frozen=True)
class Law:
    """Declared law. `psi` [J/kg, or J/m³ without `density`] or its conjugate `psi_star`; `phi_star` (of forces) or `phi` (of rates)
    [W/m³], an expression, an `indicator(...)` or a sum, or None (elastic); one observable strain; internal variables of any rank.

    `irreversible` names the internal tensors whose sum is ε^ir (reversible split; inferred where ψ holds ε − x). `density` ρ [kg/m³].
    `insist`: conditions of admissibility are not enforced, see `compile`.
    Raises `DeclarationError` where the declaration breaks a rule; see `check` for admissibility.
    """

    name: str
    psi: Any = None
    phi_star: Any = None
    observable: TensorSymbol = field(default_factory=lambda: TensorSymbol("eps"))
    internal: tuple[Variable, ...] = ()
    note: str = ""
    phi: Any = None
    psi_star: Any = None
    irreversible: tuple[TensorSymbol, ...] | None = None
    density: Any = None
    insist: bool = field(default=False, repr=False)

    def __post_init__(self) -> None:
        for key, value in normalise(self).items():
            object.__setattr__(self, key, value)
        check_declaration(self)

    # -- what was declared -------------------------------------------------------------------------------------------------

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters in alphabetical order of their names."""
        found: set[Any] = set()
        for expression in self._expressions():
            found |= {s for s in expression.free_symbols if isinstance(s, Parameter)}
        return tuple(sorted(found, key=lambda s: s.name))

    @cached_property
    def energy(self) -> Expr:
        """ρψ [J/m³] in (ε, X, T); of a law declared by ψ*, its conjugate by rule (`DeclarationError` where no rule is known)."""
        if self.psi is None:
            from .conjugation import energy_from_conjugate

            return energy_from_conjugate(self)
        return self.psi if self.density is None else self.density * self.psi

    @cached_property
    def stress_symbol(self) -> TensorSymbol | None:
        """The tensor that ψ* was declared in: the stress; None for a law declared by ψ."""
        from .declaration import stress_of

        return stress_of(self)

    @cached_property
    def force_potential(self) -> Extended | None:
        """φ*, declared or by rule from φ; None if the law is elastic or no rule is known for its φ."""
        if self.phi is None:
            return self.phi_star
        from .conjugation import force_potential_from_rates

        return force_potential_from_rates(self)

    @cached_property
    def forces(self) -> dict[Any, Force]:
        """Force symbol (or, of a law declared by φ, rate symbol) of each variable that the force function mentions."""
        potential = self.phi if self.phi is not None else self.phi_star
        found: dict[Any, Force] = {}
        if potential is None:
            return found
        for function in potential.functions:
            for symbol in sorted(function.atoms(TensorSymbol, VectorSymbol, ScalarVariable), key=default_sort_key):
                if symbol.role in ("force", "rate") and found.setdefault(symbol.variable, symbol) != symbol:
                    raise DeclarationError(
                        f"law '{self.name}': two names for the force of '{symbol.variable}'; call forces(...) once"
                    )
        return found

    @cached_property
    def frozen(self) -> tuple[Any, ...]:
        """State variables whose value at the start of the step enters φ*: the law is then semi-implicit."""
        potential = self.phi if self.phi is not None else self.phi_star
        found = set()
        for function in () if potential is None else potential.functions:
            symbols = function.atoms(TensorSymbol, VectorSymbol, ScalarVariable)
            found |= {s.variable for s in symbols if s.role == "frozen"}
        return tuple(v for v in (self.observable, *self.internal) if v in found)

    @property
    def surfaces(self) -> tuple[Expr, ...]:
        """Functions f of φ* = … + I{f ≤ 0, ...}."""
        return () if self.phi_star is None else self.phi_star.surfaces

    @property
    def viscous(self) -> Expr:
        """Finite part of φ*, zero for a rate-independent law."""
        return S.Zero if self.phi_star is None else self.phi_star.finite

    @cached_property
    def temperature(self) -> Temperature | None:
        """The temperature that the law mentions, or None."""
        found = sorted({t for e in self._expressions() for t in e.atoms(Temperature)}, key=str)
        return found[0] if found else None

    @cached_property
    def text(self) -> str:
        """Canonical text of the declaration, the key under which generated code is kept."""
        lines = [f"law {self.name}"]
        lines += [f"psi = {_full(self.psi)}"] if self.psi is not None else [f"psi_star = {_full(self.psi_star)}"]
        potential, word = (self.phi, "phi") if self.phi is not None else (self.phi_star, "phi_star")
        if potential is not None:
            lines += [f"{word} = {_full(potential.finite)}"] if potential.finite != 0 else []
            lines += [f"f = {_full(f)}" for f in potential.surfaces]
        lines += [f"density = {_full(self.density)}"] if self.density is not None else []
        lines += [f"observable = {self.observable}"]
        lines += [f"internal = {v.kind if not isinstance(v, ScalarVariable) else 'scalar'} {v}" for v in self.internal]
        lines += [f"force {self.forces[v]} of {v}" for v in (self.observable, *self.internal) if v in self.forces]
        lines += [f"irreversible = {' '.join(v.name for v in self.irreversible)}"] if self.irreversible else []
        lines += [f"temperature = {self.temperature}"] if self.temperature is not None else []
        lines += [f"parameters = {' '.join(p.name for p in self.parameters)}"]
        return "\n".join(lines)

    # -- state laws --------------------------------------------------------------------------------------------------------

    @cached_property
    def stress(self) -> SymmetricTensor:
        """State law σ^r = ρ ∂ψ/∂ε."""
        return partial(self.energy, self.observable)

    @cached_property
    def force_laws(self) -> dict[Variable, Any]:
        """State laws A_m = −ρ ∂ψ/∂α_m of every internal variable."""
        return {v: -partial(self.energy, v) for v in self.internal}

    @cached_property
    def entropy(self) -> Expr:
        """State law ρs = −ρ ∂ψ/∂T [J/(m³ K)]; zero for an isothermal law."""
        return S.Zero if self.temperature is None else -partial(self.energy, self.temperature)

    # -- values ------------------------------------------------------------------------------------------------------------

    def values(self, given: Mapping[str, Any]) -> dict[str, float]:
        """Parameter values by name, in the order of `parameters`; `InputError` names the first wrong one."""
        known = {p.name: p for p in self.parameters}
        for name in given:
            if name not in known:
                raise InputError(f"law '{self.name}' has no parameter '{name}'; it has: {', '.join(known) or 'none'}")
        missing = [p for name, p in known.items() if given.get(name, p.default) is None]
        if missing:
            listed = ", ".join(f"'{p.name}'" + (f" [{p.unit}]" if p.unit else "") for p in missing)
            word, verb = ("parameter", "has") if len(missing) == 1 else ("parameters", "have")
            raise InputError(f"law '{self.name}': {word} {listed} {verb} no value; give {missing[0].name}=...")
        found: dict[str, float] = {}
        for name, symbol in known.items():
            value = given.get(name, symbol.default)
            try:
                number = float(value)
            except (TypeError, ValueError):
                raise InputError(
                    f"law '{self.name}': parameter '{name}' must be a number, not {type(value).__name__}"
                ) from None
            if not math.isfinite(number):
                raise InputError(f"law '{self.name}': parameter '{name}' is {number}; it must be finite")
            if not symbol.lower <= number <= symbol.upper:
                raise InputError(
                    f"law '{self.name}': parameter '{name}' = {number:g} lies outside [{symbol.lower:g}, {symbol.upper:g}]"
                    f"{_hint(symbol, number)}"
                )
            found[name] = number
        return found

    def admissible_values(self, given: Mapping[str, Any]) -> dict[str, float]:
        """`values`, which also keep the conditions that admissibility puts on the parameters; `InputError` names the first broken one."""
        found = self.values(given)
        if not self.insist:
            from .enforce import enforce

            enforce(self, found)
        return found

    def with_parameters(self, *, name: str | None = None, **expressions: Any) -> Law:
        """The same law with parameters replaced by expressions in other parameters, all at once."""
        known = {p.name: p for p in self.parameters}
        table = {}
        for key, value in expressions.items():
            if key not in known:
                raise DeclarationError(f"law '{self.name}' has no parameter '{key}'; it has: {', '.join(known)}")
            table[known[key]] = scalar_expression(
                value, f"the replacement of parameter '{key}'", "write an expression in numbers and parameters"
            )
        changed = {}
        for key in ("psi", "psi_star", "density", "phi", "phi_star"):
            value = getattr(self, key)
            if isinstance(value, Extended):
                changed[key] = value.map(lambda e: e.xreplace(table))
            elif value is not None:
                changed[key] = value.xreplace(table)
        return replace(self, name=name or self.name, **changed)

    # -- what is derived elsewhere ---------------------------------------------------------------------------------------------

    def table(self, formulation: str = "strain", split: str = "total") -> Any:
        """Block of Table 1 for this law, with `.text()`, `.latex()`, `.json()`; see `fenchel.potentials.table`."""
        from .table import build_table

        return build_table(self, formulation, split)

    def check(self, **values: Any) -> Any:
        """Is ψ convex and φ* convex, non-negative and zero at zero? An `AdmissibilityReport`: `.admissible` True (proved), False (refuted)
        or None (undecided), `.conditions`, `.reasons`, `.counterexample`; for all parameters, or for the `values` given."""
        from .admissibility import check

        return check(self, values)

    def compile(
        self,
        dimension: str = "3d",
        *,
        formulation: str = "strain",
        solver: str = "auto",
        tangent: bool = True,
        precision: str = "float64",
        threads: int = 1,
        tolerance: float | None = None,
        accuracy: float | None = None,
        insist: bool = False,
    ) -> Any:
        """The implicit step as an `Update`; see `fenchel.integrators.build_update`. With `accuracy`, the relative error of the stress that
        is wanted, the cheapest setting known to meet it is taken and its answers are checked: `.choice` says which, and why.

        A law that `check` refutes is refused with the counter-example; `insist=True` compiles it all the same and enforces no condition
        on its parameters but their bounds.
        """
        if not insist:
            from .enforce import refuse

            refuse(self)
        law = replace(self, insist=True) if insist else self
        return _integrators().build_update(
            law,
            dimension,
            formulation=formulation,
            solver=solver,
            tangent=tangent,
            precision=precision,
            threads=threads,
            tolerance=tolerance,
            accuracy=accuracy,
        )

    def source(self, dimension: str = "3d") -> str:
        """Text of the generated module."""
        return _integrators().module_source(self, dimension)

    def conic(self, eps_new: Any, state: Any = None, **values: Any) -> Any:
        """The same step as a cvxpy problem; see `fenchel.integrators.conic`."""
        return _integrators().conic_step(self, eps_new, state, values)

    def plot(
        self,
        *,
        history: Any = None,
        state: Mapping[str, Any] | None = None,
        pressure: float | None = None,
        angle: float | None = None,
        direction: Any = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        strain: float | None = None,
        size: float | None = None,
        limit: float | None = None,
        measure: str = "sqrt_J2",
        signs: str = "tension-positive",
        **values: Any,
    ) -> Any:
        """A `matplotlib.figure.Figure`: the surfaces f = 0 in the meridian plane (mean stress, ±√J₂) and in the deviatoric plane, and ρψ
        beside ρψ*, whose sum is σ:ε (Fenchel–Young).

        `values`: parameters by name, and the temperature [K]. `history`: what `drive` returns; its path is drawn, the surfaces are those
        after its last row. `state`: internal variables by name instead, tensors (6,) Mandel; virgin without. The deviatoric plane lies at
        the mean `pressure` −tr σ/3 [Pa], the meridian plane at `angle` [rad] (π/3: triaxial compression along axis 3), see
        `fenchel.potentials.surface`. ψ is drawn along `direction` (6,) Mandel up to `strain` [-]. A finite φ* is drawn by level sets, for
        stresses of `size` [Pa]; what is unbounded ends at `limit` [Pa]. `measure` of the ordinate: "sqrt_J2" or "q" = √(3 J₂); `signs`:
        "tension-positive" or "compression-positive". What has no picture is said under the figure. Raises `InputError` for wrong input.
        """
        from .law_figure import law_figure

        return law_figure(
            self,
            values,
            history=history,
            state=state,
            pressure=pressure,
            angle=angle,
            direction=direction,
            strain=strain,
            size=size,
            limit=limit,
            measure=measure,
            signs=signs,
        )

    def __str__(self) -> str:
        return self.text

    def _repr_latex_(self) -> str:
        return math_rows(_declared(self))

    # -- checks ------------------------------------------------------------------------------------------------------------

    def _expressions(self) -> tuple[Expr, ...]:
        found = [e for e in (self.psi, self.psi_star, self.density) if e is not None]
        for potential in (self.phi_star, self.phi):
            found += [] if potential is None else list(potential.functions)
        return tuple(found)

    def check_evolution(self) -> None:
        """Refuse an internal variable that ψ weighs but φ* does not move."""
        free = self.energy if self.psi is not None else self.psi_star
        for variable in self.internal:
            if variable not in self.forces and free.has(variable):
                raise DeclarationError(
                    f"law '{self.name}': the internal variable '{variable}' cannot evolve, because phi_star does not mention its force; "
                    f"add forces({variable}) to phi_star or take the variable out"
                )


def _hint(symbol: Any, number: float) -> str:
    """What a value out of bounds probably meant."""
    unit = "" if symbol.unit in ("", "1") else f" {symbol.unit}"
    if number < 0 and symbol.note.startswith("hardening"):
        return f"{unit}; softening is not modelled"
    if symbol.unit == "rad" and symbol.lower <= math.radians(number) <= symbol.upper:
        return f" rad; if it is in degrees, {number:g}° = {math.radians(number):.6g} rad"
    return unit


def _declared(law: Law) -> list[tuple[str, str]]:
    """Rows of the declaration: a word and LaTeX."""
    rows = [("law", r"\mathtt{" + law.name.replace("_", r"\_") + "}")]
    rows += [("density", rf"\rho = {latex(law.density)}")] if law.density is not None else []
    psi, star = (r"\psi", law.psi) if law.psi is not None else (r"\psi^{*}", law.psi_star)
    rows.append(("free energy" if law.psi is not None else "conjugate energy", f"{psi} = {latex(star)}"))
    potential, name = (law.phi, r"\varphi") if law.phi is not None else (law.phi_star, r"\varphi^{*}")
    if potential is not None:
        word = "dissipation potential" if law.phi is not None else "force function"
        rows.append((word, f"{name} = {potential.latex()}"))
    rows.append(("observable", latex(law.observable)))
    if law.internal:
        rows.append(("internal", ",\\ ".join(latex(v) for v in law.internal)))
    return rows


def _full(expression: Any) -> str:
    return sstr(expression, full_prec=True)


def _integrators() -> Any:
    # The rooms point one way: potentials imports nothing of ours. The step is found by name, when it is asked for, so that the
    # layers stay one-directional at import time and `import fenchel.potentials` stays light.
    return importlib.import_module("..integrators", __package__)
