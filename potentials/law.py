"""A law: a free energy ψ, a force function φ*, and the names of its variables.

Generalised standard material, per unit volume and at constant temperature:

    σ = ∂ψ/∂ε,   A_m = −∂ψ/∂α_m,   α̇_m ∈ ∂_{A_m} φ*(A).

`Law` holds the declaration and nothing else; state laws, table, admissibility, text, update and conic program are derived on demand.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from sympy import Expr, Symbol, default_sort_key, sstr, sympify

from ..errors import DeclarationError, InputError
from .derivative import gradient
from .forces import Indicator
from .invariants import Invariant
from .names import checked_name
from .scalars import ForceScalar, Parameter, ScalarVariable
from .tensor import ForceTensor, PositiveTensor, SymmetricTensor, TensorSymbol

__all__ = ["Law"]

Variable = TensorSymbol | ScalarVariable
Force = ForceTensor | ForceScalar


@dataclass(frozen=True)
class Law:
    """Declared law. `psi` [J/m³], `phi_star` an `indicator(...)` or None (elastic), one observable strain, internal variables.

    Raises `DeclarationError` where the declaration breaks a rule; see `check` for admissibility.
    """

    name: str
    psi: Expr
    phi_star: Indicator | None = None
    observable: TensorSymbol = field(default_factory=lambda: TensorSymbol("eps"))
    internal: tuple[Variable, ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        checked_name(self.name, "law")
        if isinstance(self.psi, SymmetricTensor):
            raise DeclarationError(f"law '{self.name}': rank mismatch: psi is a tensor, an energy is a scalar")
        object.__setattr__(self, "psi", sympify(self.psi, strict=True))
        inner = self.internal
        object.__setattr__(
            self, "internal", (inner,) if isinstance(inner, (TensorSymbol, ScalarVariable)) else tuple(inner)
        )
        if self.phi_star is not None and not isinstance(self.phi_star, Indicator):
            raise DeclarationError(
                f"law '{self.name}': phi_star must be indicator(f, ...) so far, not {type(self.phi_star).__name__}"
            )
        self._check_variables()
        self._check_expressions()

    # -- what was declared -------------------------------------------------------------------------------------------------

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters in alphabetical order of their names."""
        found: set[Any] = set()
        for expression in self._expressions():
            found |= {s for s in expression.free_symbols if isinstance(s, Parameter)}
        return tuple(sorted(found, key=lambda s: s.name))

    @cached_property
    def forces(self) -> dict[Variable, Force]:
        """Force symbol of each variable that φ* mentions."""
        found: dict[Variable, Force] = {}
        for function in self.surfaces:
            for force in sorted(function.atoms(ForceTensor, ForceScalar), key=default_sort_key):
                if found.setdefault(force.variable, force) != force:
                    raise DeclarationError(
                        f"law '{self.name}': two names for the force of '{force.variable}'; call forces(...) once"
                    )
        return found

    @property
    def surfaces(self) -> tuple[Expr, ...]:
        """Functions f of φ* = I{f ≤ 0, ...}."""
        return () if self.phi_star is None else self.phi_star.functions

    @cached_property
    def text(self) -> str:
        """Canonical text of the declaration, the key under which generated code is kept."""
        lines = [f"law {self.name}", f"psi = {sstr(self.psi, full_prec=True)}"]
        lines += [f"f = {sstr(f, full_prec=True)}" for f in self.surfaces]
        lines += [f"observable = {self.observable}"]
        lines += [f"internal = {'tensor' if isinstance(v, TensorSymbol) else 'scalar'} {v}" for v in self.internal]
        lines += [f"force {self.forces[v]} of {v}" for v in self.internal if v in self.forces]
        lines += [f"parameters = {' '.join(p.name for p in self.parameters)}"]
        return "\n".join(lines)

    # -- state laws --------------------------------------------------------------------------------------------------------

    @cached_property
    def stress(self) -> SymmetricTensor:
        """State law σ = ∂ψ/∂ε."""
        return gradient(self.psi, self.observable)  # type: ignore[return-value]

    @cached_property
    def force_laws(self) -> dict[Variable, Any]:
        """State laws A_m = −∂ψ/∂α_m of every internal variable."""
        return {v: -gradient(self.psi, v) for v in self.internal}

    # -- values ------------------------------------------------------------------------------------------------------------

    def values(self, given: Mapping[str, Any]) -> dict[str, float]:
        """Parameter values by name, in the order of `parameters`; `InputError` names the first wrong one."""
        known = {p.name: p for p in self.parameters}
        for name in given:
            if name not in known:
                raise InputError(f"law '{self.name}' has no parameter '{name}'; it has: {', '.join(known) or 'none'}")
        found: dict[str, float] = {}
        for name, symbol in known.items():
            value = given.get(name, symbol.default)
            if value is None:
                raise InputError(f"law '{self.name}': parameter '{name}' has no value; give {name}=...")
            try:
                number = float(value)
            except (TypeError, ValueError):
                raise InputError(
                    f"law '{self.name}': parameter '{name}' must be a number, not {type(value).__name__}"
                ) from None
            if not math.isfinite(number):
                raise InputError(f"law '{self.name}': parameter '{name}' is {number}; it must be finite")
            if not symbol.lower <= number <= symbol.upper:
                hint = "; softening is not modelled" if number < 0 and symbol.note.startswith("hardening") else ""
                raise InputError(
                    f"law '{self.name}': parameter '{name}' = {number:g} lies outside [{symbol.lower:g}, {symbol.upper:g}]{hint}"
                )
            found[name] = number
        return found

    def with_parameters(self, *, name: str | None = None, **expressions: Any) -> Law:
        """The same law with parameters replaced by expressions in other parameters, all at once."""
        known = {p.name: p for p in self.parameters}
        table = {}
        for key, value in expressions.items():
            if key not in known:
                raise DeclarationError(f"law '{self.name}' has no parameter '{key}'; it has: {', '.join(known)}")
            new = sympify(value, strict=True)
            if not isinstance(new, Expr):
                raise DeclarationError(f"parameter '{key}' must be replaced by a scalar expression")
            table[known[key]] = new
        star = None if self.phi_star is None else Indicator(tuple(f.xreplace(table) for f in self.surfaces))  # type: ignore[arg-type]
        return replace(self, name=name or self.name, psi=self.psi.xreplace(table), phi_star=star)

    # -- what is derived elsewhere ---------------------------------------------------------------------------------------------

    def table(self, formulation: str = "strain", split: str = "total") -> Any:
        """Block of Table 1 for this law, with `.text()`, `.latex()`, `.json()`; see `fenchel.potentials.table`."""
        from .table import build_table

        return build_table(self, formulation, split)

    def check(self, **values: Any) -> Any:
        """Admissibility by composition rules: `.admissible` True, False or None, `.conditions`, `.reasons`."""
        from .admissibility import check

        return check(self, values)

    def compile(
        self, dimension: str = "3d", *, formulation: str = "strain", solver: str = "auto", tangent: bool = True
    ) -> Any:
        """The implicit step as an `Update`; see `fenchel.integrators.build_update`."""
        return _integrators().build_update(self, dimension, formulation=formulation, solver=solver, tangent=tangent)

    def source(self, dimension: str = "3d") -> str:
        """Text of the generated module."""
        return _integrators().module_source(self, dimension)

    def conic(self, eps_new: Any, state: Any = None, **values: Any) -> Any:
        """The same step as a cvxpy problem; see `fenchel.integrators.conic`."""
        return _integrators().conic_step(self, eps_new, state, values)

    def __str__(self) -> str:
        return self.text

    # -- checks ------------------------------------------------------------------------------------------------------------

    def _expressions(self) -> tuple[Expr, ...]:
        return (self.psi, *self.surfaces)

    def _check_variables(self) -> None:
        if not isinstance(self.observable, TensorSymbol) or isinstance(self.observable, ForceTensor):
            raise DeclarationError(f"law '{self.name}': observable must be a tensor variable, sym_tensor('eps')")
        seen = {self.observable.name}
        for variable in self.internal:
            if not isinstance(variable, (TensorSymbol, ScalarVariable)) or isinstance(
                variable, (ForceTensor, ForceScalar)
            ):
                raise DeclarationError(
                    f"law '{self.name}': internal variable {variable} must be sym_tensor(...) or scalar(...)"
                )
            if variable.name in seen:
                raise DeclarationError(f"law '{self.name}': the variable '{variable.name}' is declared twice")
            seen.add(variable.name)

    def _check_expressions(self) -> None:
        declared = {self.observable, *self.internal}
        rule = f"law '{self.name}'"
        for what, expression in (("psi", self.psi), *(("phi_star", f) for f in self.surfaces)):
            for symbol in sorted(expression.free_symbols, key=str):
                if type(symbol) is Symbol or not isinstance(symbol, (Parameter, ScalarVariable)):
                    raise DeclarationError(
                        f"{rule}: '{symbol}' in {what} is a bare symbol; declare it with parameter(...) or scalar(...)"
                    )
            for leaf in expression.atoms(Invariant):
                _check_leaf(rule, what, leaf)
            symbols = [s for s in expression.atoms(TensorSymbol) if not isinstance(s, ForceTensor)]
            symbols += [s for s in expression.atoms(ScalarVariable) if not isinstance(s, ForceScalar)]
            owners = [s.variable for s in expression.atoms(ForceTensor, ForceScalar)]
            for symbol in sorted({*symbols, *owners}, key=str):
                if symbol not in declared:
                    raise DeclarationError(
                        f"{rule}: '{symbol}' is used in {what} but not declared; add it to internal=(...)"
                    )
            if what == "psi" and owners:
                raise DeclarationError(f"{rule}: psi mentions a force; a free energy depends on state variables only")
            states = set(symbols) - set(owners)
            if what == "phi_star" and (states or expression.atoms(ScalarVariable) - expression.atoms(ForceScalar)):
                shown = ", ".join(sorted(str(s) for s in states))
                raise DeclarationError(
                    f"{rule}: phi_star mentions the state {shown}; it may depend on forces only, see forces(...)"
                )
        if self.observable in self.forces:
            raise DeclarationError(
                f"{rule}: phi_star mentions the force of '{self.observable}' (viscous stress); not modelled yet"
            )
        names = [p.name for p in self.parameters]
        for name in names:
            if names.count(name) > 1:
                raise DeclarationError(
                    f"{rule}: two parameters are called '{name}' with different bounds or units; declare it once"
                )
            if name in {v.name for v in declared}:
                raise DeclarationError(f"{rule}: '{name}' is both a parameter and a variable; rename one")

    def check_evolution(self) -> None:
        """Refuse an internal variable that ψ weighs but φ* does not move."""
        for variable in self.internal:
            if variable not in self.forces and self.psi.has(variable):
                raise DeclarationError(
                    f"law '{self.name}': the internal variable '{variable}' cannot evolve, because phi_star does not mention its force; "
                    f"add forces({variable}) to phi_star or take the variable out"
                )


def _check_leaf(rule: str, what: str, leaf: Invariant) -> None:
    for tensor in leaf.args:
        assert isinstance(tensor, SymmetricTensor)
        for atom, coefficient in tensor.terms().items():
            if coefficient.has(Invariant) or coefficient.atoms(ScalarVariable):
                raise DeclarationError(
                    f"{rule}: the coefficient {coefficient} of a tensor in {what} depends on the state; it may hold parameters only"
                )
            if atom.has(PositiveTensor):
                raise DeclarationError(f"{rule}: {leaf} in {what} is not available; use inner(pos(e), pos(e))")


def _integrators() -> Any:
    # The rooms point one way: potentials imports nothing of ours. The step is found by name, when it is asked for, so that the
    # layers stay one-directional at import time and `import fenchel.potentials` stays light.
    return importlib.import_module("..integrators", __package__)
