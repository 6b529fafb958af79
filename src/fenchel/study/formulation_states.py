"""Random states of any declared law, its numbers there, and its conjugate as a supremum that no rule of conjugation enters.

ψ*(σ, X) = sup over ε of σ:ε − ψ(ε, X) is found by Newton's method on σ = ∂ψ/∂ε, the second derivatives by central differences. At the
supremum the value does not depend on the strain to first order, so that it is exact to rounding although the derivatives are not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..potentials import Law
from ..potentials.evaluate import evaluate
from ..potentials.library import ENTRIES, Entry
from ..potentials.scalars import ScalarVariable
from ..potentials.spectral import eigenvalues, from_matrix
from ..potentials.vector import VectorSymbol

__all__ = [
    "DEVIATOR",
    "IDENTITY",
    "Array",
    "Numbers",
    "State",
    "corners",
    "difference",
    "distinct_energies",
    "dot",
    "elasticity",
    "from_kinks",
    "given_heat",
    "is_one_sided",
    "is_slack",
    "magnitude",
    "random_states",
    "rotated",
    "size_of",
    "supremum",
    "warmth",
]  # fmt: skip

Array = NDArray[np.float64]
State = Mapping[str, Any]

IDENTITY = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
DEVIATOR = np.eye(6) - np.outer(IDENTITY, IDENTITY) / 3.0
_WEIGHTS = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


class Numbers:
    """Expressions of a law as functions of a state by name, at the values of its parameters."""

    def __init__(self, law: Law, values: Mapping[str, float]) -> None:
        self.law, self.values = law, {p: values[p.name] for p in law.parameters}
        self.variables = (law.observable, *law.internal, *((law.temperature,) if law.temperature is not None else ()))

    def __call__(self, thing: Any, state: State, more: Mapping[Any, Any] | None = None) -> Any:
        known = {v: state[v.name] for v in self.variables if v.name in state}
        return evaluate(thing, self.values | known | dict(more or {}))

    def energy(self, state: State) -> Array:
        """ψ [J/m³]."""
        return self(self.law.energy, state)

    def stress(self, state: State) -> Array:
        """σ^r = ∂ψ/∂ε [Pa]."""
        return self(self.law.stress, state)

    def entropy(self, state: State) -> Array:
        """s = −∂ψ/∂T [J/(m³ K)]; zero for an isothermal law."""
        return np.zeros(()) if self.law.temperature is None else self(self.law.entropy, state)

    def force(self, variable: Any, state: State) -> Array:
        """A = −∂ψ/∂α of an internal variable."""
        return np.broadcast_to(self(self.law.force_laws[variable], state), np.shape(state[variable.name]))


def distinct_energies() -> dict[str, Entry]:
    """One law of the library for each energy."""
    first = {e.law.energy: e.law.name for e in reversed(ENTRIES.values())}
    return {name: entry for name, entry in ENTRIES.items() if name in first.values()}


def dot(a: Any, b: Any) -> Array:
    """Product of two fields of scalars (n,), vectors (n, 3) or tensors (n, 6), point by point."""
    product = np.asarray(a) * np.asarray(b)
    return product.sum(axis=-1) if product.ndim > 1 else product


def size_of(a: Any) -> Array:
    """Euclidean norm, point by point."""
    return np.sqrt(dot(a, a))


def rotated(rng: np.random.Generator, principal: Array) -> Array:
    """Tensors (n, 6) with the given principal values (n, 3), in random directions."""
    q, _ = np.linalg.qr(rng.normal(size=(len(principal), 3, 3)))
    return from_matrix(np.einsum("nik,nk,njk->nij", q, principal, q))


def elasticity(lam: float, mu: float) -> Array:
    """λ I⊗I + 2μ 𝕀, (6, 6)."""
    return lam * np.outer(IDENTITY, IDENTITY) + 2.0 * mu * np.eye(6)


def magnitude(entry: Entry) -> float:
    """Size of a strain at which the law does what it is made for: that of its worked value."""
    return float(np.linalg.norm(entry.worked.eps))


def _width(variable: Any) -> tuple[int, ...]:
    if isinstance(variable, ScalarVariable):
        return ()
    return (3,) if isinstance(variable, VectorSymbol) else (6,)


def random_states(entry: Entry, rng: np.random.Generator, n: int) -> dict[str, Array]:
    """n states by name: strains of the size of the worked value, a tenth of it plastic, scalars not negative, 300 to 350 K."""
    law, size = entry.law, magnitude(entry)
    found = {law.observable.name: size / np.sqrt(6) * rng.normal(size=(n, 6))}
    for variable in law.internal:
        value = 0.1 * size * rng.normal(size=(n, *_width(variable)))
        found[variable.name] = np.abs(value) if value.ndim == 1 else value
    if law.temperature is not None:
        found[law.temperature.name] = 300.0 + 50.0 * rng.random(n)
    return found


def corners(entry: Entry, rng: np.random.Generator, segments: int, steps: int, size: float = 2.0) -> Array:
    """A strain path (segments·steps, 6) from zero, straight between random corners."""
    places = size * magnitude(entry) / np.sqrt(6) * rng.normal(size=(segments, 6))
    places = np.vstack([np.zeros(6), places])
    share = np.arange(1, steps + 1)[:, None] / steps
    return np.concatenate([a + share * (b - a) for a, b in pairwise(places)])


def warmth(law: Law, value: Any = 320.0) -> dict[str, Any]:
    """The temperature under its name, for a law that has one."""
    return {} if law.temperature is None else {law.temperature.name: value}


def given_heat(law: Law, state: State) -> dict[str, Any]:
    """The temperature of a state, for the update of a law that has one."""
    return {} if law.temperature is None else {law.temperature.name: state[law.temperature.name]}


def difference(function: Callable[[float], Any], h: float) -> Any:
    """Derivative at 0 by the central difference of order eight."""
    return sum(w * (function(k * h) - function(-k * h)) for k, w in _WEIGHTS) / h


def is_slack(numbers: Numbers, state: State) -> bool:
    """True for a law that carries no stress at all in compression: its ψ* is infinite outside a cone of stresses."""
    compressed = {**state, numbers.law.observable.name: -1e-3 * np.tile(IDENTITY, (len(state["eps"]), 1))}
    return not np.abs(numbers.stress(compressed)).any()


def is_one_sided(numbers: Numbers, state: State) -> bool:
    """True for a law whose stress does not turn with the strain: its energy has kinks in the second derivative."""
    name = numbers.law.observable.name
    there, back, rest = (numbers.stress({**state, name: t * state[name]}) for t in (1.0, -1.0, 0.0))
    return bool(np.abs(there + back - 2 * rest).max() > 1e-9 * np.abs(there).max())


def from_kinks(strain: Array) -> Array:
    """How far a strain (n, 6) is from a kink of a unilateral energy: the least of |ε_i| and |tr ε|, (n,)."""
    principal = eigenvalues(strain)
    return np.minimum(np.abs(principal).min(axis=-1), np.abs(principal.sum(axis=-1)))


def supremum(numbers: Numbers, stress: Array, state: State, start: Array) -> tuple[Array, Array]:
    """(ψ*, the strain of the supremum) at stresses (n, 6); NaN where Newton's method does not end. The strain of `state` is not used."""
    name = numbers.law.observable.name
    size = float(np.abs(start).max()) or 1.0

    def excess(strain: Array) -> Array:
        return stress - numbers.stress({**state, name: strain})

    def lacking(strain: Array) -> Array:
        return numbers.energy({**state, name: strain}) - dot(stress, strain)

    strain, value = start.copy(), lacking(start)
    going = np.ones(len(strain), dtype=bool)
    for _ in range(80):
        slopes = [(excess(strain - d) - excess(strain + d)) / (2e-4 * size) for d in 1e-4 * size * np.eye(6)]
        stiffness = np.stack(slopes, axis=-1)
        stiffness += 1e-9 * np.abs(stiffness).max() * np.eye(6)
        step = going[:, None] * np.linalg.solve(stiffness, excess(strain)[..., None])[..., 0]
        for _ in range(30):  # shorter, until the energy does not rise by more than rounding
            worse = lacking(strain + step) > value + 1e-13 * (np.abs(value) + size_of(stress) * size)
            step[worse] *= 0.5
            if not worse.any():
                break
        strain = strain + step
        value = lacking(strain)
        going &= np.abs(step).max(axis=1) > 1e-10 * size
        if not going.any():
            break
    return np.where(going, np.nan, -value), strain
