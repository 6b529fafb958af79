"""ψ along a direction of strain, and ψ* along the stresses that it answers with.

At fixed internal variables and temperature, with ε = t e and s = σ:e,

    ρψ(t e) + ρψ*(σ) = s t   where σ = ρ ∂ψ/∂ε at t e,        ρψ + ρψ* ≥ σ:ε everywhere   (Fenchel–Young),

so that s ↦ ψ*(σ) is the conjugate of t ↦ ψ(t e): the tangent of either curve cuts its ordinate at minus the value of the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from sympy import S

from ..errors import FenchelError, InputError
from .derivative import partial
from .elastic_domain import Setting
from .evaluate import evaluate
from .law import Law

__all__ = ["EnergyPair", "energy_pair"]

APART = 12  # a conjugate that is a program at each point is solved at every twelfth one


@dataclass(frozen=True)
class EnergyPair:
    """`strain` t [-] and `stress` s = σ:e [Pa] (n,), `energy` ρψ and `conjugate` ρψ* [J/m³] (n,) at them (NaN where a
    conjugate that is a program was not solved); `how` the second of the two was
    found: "closed form", "numerical" with its largest `gap` [J/m³], or "Fenchel–Young" where only the equality gives it (`missing` says
    why). `at_rest` is ρψ without strain."""

    strain: Any
    stress: Any
    energy: Any
    conjugate: Any
    how: str
    gap: float = 0.0
    missing: str = ""
    at_rest: float = 0.0

    @property
    def residual(self) -> float:
        """Largest |ρψ + ρψ* − s t| [J/m³], zero by the theorem."""
        import numpy as np

        return float(np.nanmax(np.abs(self.energy + self.conjugate - self.stress * self.strain)))


def energy_pair(
    law: Law,
    values: Mapping[str, Any],
    *,
    direction: Any = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    strain: float = 1e-3,
    state: Mapping[str, Any] | None = None,
    count: int = 101,
) -> EnergyPair:
    """The pair for |t| ≤ `strain` [-] along `direction` (6,) Mandel, at the internal variables of `state` (zero without).

    ψ* is evaluated apart from ψ: its closed form, or the certified supremum at fewer points. A law declared by a ψ* whose conjugate has no
    rule is followed along the stresses s e instead. Raises `InputError` for a direction of zero and wrong values.
    """
    import numpy as np

    setting = Setting(law, values, state)
    e = np.asarray(direction, dtype=float)
    if e.shape != (6,) or not np.isfinite(e).all() or not (e * e).sum() > 0.0:
        raise InputError("direction must be six finite Mandel components, not all zero")
    if not (np.isfinite(strain) and strain > 0.0):
        raise InputError(f"strain = {strain}: the largest strain of the picture must be positive")
    try:
        energy, stress = law.energy, law.stress
    except FenchelError as reason:
        return _along_stress(law, setting, e, float(strain), count, str(reason))
    conjugate = _Conjugate(law, setting)
    t = np.linspace(-strain, strain, count)
    table = {**setting.table, law.observable: t[:, None] * e}
    psi = np.broadcast_to(evaluate(energy, table), t.shape)
    sig = np.broadcast_to(evaluate(stress, table), (len(t), 6))
    s = sig @ e
    rest = float(evaluate(energy, {**setting.table, law.observable: np.zeros(6)}))
    try:
        some = np.arange(count) if conjugate.quick else np.arange(0, count, APART) + ((count - 1) % APART) // 2
        star = np.full(count, np.nan)
        star[some], gap = conjugate.values(sig[some])
        if not np.isfinite(star[some]).all():
            raise InputError("the conjugate is infinite at a stress of the law")
        return EnergyPair(t, s, psi, star, "closed form" if conjugate.quick else "numerical", gap, "", rest)
    except FenchelError as reason:
        return EnergyPair(t, s, psi, s * t - psi, "Fenchel–Young", missing=str(reason), at_rest=rest)


@lru_cache(maxsize=64)
def _conjugate(law: Law) -> Any:
    from .conjugation import partial_conjugate

    return partial_conjugate(law)


class _Conjugate:
    """ρψ* at stresses: declared, by rule, or point by point."""

    def __init__(self, law: Law, setting: Setting) -> None:
        self.law, self.setting = law, setting
        self.found: Any = None
        if law.psi is not None:
            self.found = _conjugate(law)
        self.quick = self.found is None or self.found.closed

    def values(self, sig: Any) -> tuple[Any, float]:
        """Values (n,) and the largest gap."""
        import numpy as np

        data = {k: v for k, v in self.setting.table.items() if k != self.law.observable}
        if self.found is None:
            rho = S.One if self.law.density is None else self.law.density
            return evaluate(rho * self.law.psi_star, {**data, self.law.stress_symbol: sig}), 0.0
        dual = self.found.duals[self.law.observable]
        if self.quick:
            return self.found.value({**data, dual: sig}), 0.0
        from .conjugation import numerical_conjugate

        rows = [
            numerical_conjugate(self.found.function, (self.law.observable,), {self.law.observable: row}, data)
            for row in sig
        ]
        return np.array([r.value for r in rows]), max(r.gap for r in rows)


def _along_stress(law: Law, setting: Setting, e: Any, strain: float, count: int, reason: str) -> EnergyPair:
    import numpy as np

    rho = S.One if law.density is None else law.density
    symbol: Any = law.stress_symbol
    slope = partial(rho * law.psi_star, symbol)
    data = {k: v for k, v in setting.table.items() if k != law.observable}

    def at(s: Any) -> Any:
        table = {**data, symbol: s[:, None] * e}
        return np.broadcast_to(evaluate(slope, table), (len(s), 6)) @ e / (e @ e), evaluate(rho * law.psi_star, table)

    ends = np.exp2(np.arange(-20.0, 120.0))
    with np.errstate(all="ignore"):
        reached = np.abs(at(ends)[0])
    end = ends[np.argmax(reached >= strain)] if (reached >= strain).any() else ends[20]
    s = np.linspace(-end, end, count) * (e @ e)
    t, star = at(s / (e @ e))
    star = np.broadcast_to(star, t.shape)
    return EnergyPair(t, s, s * t - star, star, "Fenchel–Young", missing=reason)
