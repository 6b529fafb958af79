"""Claim 5: Fenchel's equality ψ(ε) + ψ*(σ) = σ:ε, of every energy of the library and of energies with kinks.

It holds if and only if σ ∈ ∂ψ(ε), and if and only if ε ∈ ∂ψ*(σ) (Rockafellar 1970, §23); for any other strain ψ(ε) + ψ*(σ) >
σ:ε. ψ* comes from the rules of conjugation, from a supremum found by Newton's method, from a certified cone program, and for the
energies with kinks

    G e:e + c‖e‖,   G e:e + c‖dev e‖,   G e:e + c tr e^≥,   c‖e‖³

from formulas written here: with s the dual of e, ⟨‖s‖ − c⟩²/4G, ⟨‖dev s‖ − c⟩²/4G + (tr s)²/12G, Σ (s_i − P s_i)²/4G with P the
projection on [0, c], and ⅔‖s‖ (‖s‖/3c)^½.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..potentials import dev, inner, norm, numerical_conjugate, parameter, partial_conjugate, pos, sym_tensor, tr
from ..potentials.library import Entry
from ..potentials.spectral import eigenvalues
from .formulation_states import (
    DEVIATOR,
    IDENTITY,
    Array,
    Numbers,
    distinct_energies,
    dot,
    is_slack,
    magnitude,
    random_states,
    rotated,
    size_of,
    supremum,
)

__all__ = ["fenchel_equality"]

Generator = np.random.Generator


def _worst(residual: Array, scale: Array) -> float:
    """The largest residual over its scale; infinite if one is not a number."""
    return float(np.nan_to_num(np.abs(residual) / scale, nan=np.inf).max())


class _Pairs:
    """States of an energy with their stresses; `few` of them where every point costs a cone program."""

    def __init__(self, entry: Entry, rng: Generator, n: int, few: int) -> None:
        self.law, self.numbers, self.rule = entry.law, Numbers(entry.law, entry.values), partial_conjugate(entry.law)
        (self.dual,) = self.rule.duals.values()
        self.name, self.few = self.law.observable.name, few
        self.state = _mixed_states(entry, rng, n if self.rule.closed else few)
        self.strain, self.stress = self.state[self.name], self.numbers.stress(self.state)
        self.energy = self.numbers.energy(self.state)
        self.scale = np.abs(self.energy) + size_of(self.stress) * size_of(self.strain) + 1e-300
        self.conjugate = self.rule.value(self.table(self.state, self.stress))

    def table(self, state: Any, stress: Array) -> dict[Any, Any]:
        """Values by symbol for the rule."""
        data = {v: state[v.name] for v in self.numbers.variables if v != self.law.observable}
        return self.numbers.values | data | {self.dual: stress}

    def by_rule(self) -> float:
        """ψ + ψ* − σ:ε."""
        return _worst(self.energy + self.conjugate - dot(self.stress, self.strain), self.scale)

    def below(self, rng: Generator) -> float:
        """How far ψ(ε′) + ψ*(σ) − σ:ε′ is below zero at strains of other points."""
        other = self.strain[rng.permutation(len(self.strain))]
        above = self.numbers.energy({**self.state, self.name: other}) + self.conjugate - dot(self.stress, other)
        return float((-above / (self.scale + size_of(self.stress) * size_of(other))).max())

    def inside(self) -> Any:
        """Points around whose stress ψ* is finite and smooth: all of them, of wires alone those of extension in all directions."""
        principal = eigenvalues(self.strain)
        slack = is_slack(self.numbers, self.state)
        return principal[:, 0] > (0.05 * np.abs(principal[:, 2]) if slack else -np.inf)

    def by_supremum(self, rng: Generator) -> float:
        """The same with the supremum, begun beside the strain, and the stress of the strain that it ends at."""
        chosen = self.inside()
        there = {k: v[chosen] for k, v in self.state.items()}
        strain, stress, scale = self.strain[chosen], self.stress[chosen], self.scale[chosen]
        beside = 0.01 if is_slack(self.numbers, self.state) else 0.1
        start = strain + beside * size_of(strain)[:, None] * rng.normal(size=strain.shape)
        value, argument = supremum(self.numbers, stress, there, start)
        misfit = self.numbers.stress({**there, self.name: argument}) - stress
        return max(
            _worst(self.energy[chosen] + value - dot(stress, strain), scale),
            _worst(size_of(misfit), size_of(stress)),
        )

    def stress_first(self, rng: Generator) -> float:
        """ψ + ψ* − σ:ε at ε ∈ ∂ψ*(σ), σ given; zero if the rule has no gradient."""
        if not (self.rule.closed and self.rule.has_gradient):
            return 0.0
        chosen = self.inside()
        there, stress = {k: v[chosen] for k, v in self.state.items()}, self.stress[chosen]
        stress = stress + size_of(stress)[:, None] * np.abs(rng.normal(size=(len(stress), 1))) * IDENTITY
        table = self.table(there, stress)
        strain = self.rule.gradient(table)[self.law.observable]
        energy = self.numbers.energy({**there, self.name: strain})
        both = energy + self.rule.value(table) - dot(stress, strain)
        return _worst(both, np.abs(energy) + size_of(stress) * size_of(strain))

    def certified(self, rng: Generator) -> dict[str, float]:
        """ψ* against the certified supremum at few points: against its value, and how far outside the certified bounds."""
        found = {"program": 0.0, "outside": 0.0}
        table = self.table(self.state, self.stress)
        del table[self.dual]
        # where the strain is not unique it runs far off, and the bounds with it
        for i in rng.permutation(np.flatnonzero(self.inside()))[: self.few]:
            row = {s: v[i] if np.ndim(v) else v for s, v in table.items()}
            bound = numerical_conjugate(
                self.law.energy, self.law.observable, {self.law.observable: self.stress[i]}, row
            )
            _compared(found, bound, float(self.conjugate[i]), float(self.scale[i]))
        return found


def _compared(found: dict[str, float], bound: Any, value: float, scale: float) -> None:
    """Raise the worst misfits of a certified supremum to those of this one."""
    found["program"] = max(found["program"], float(abs(bound.value - value) / scale))
    outside = max(bound.value - value, value - bound.value - bound.gap, 0.0)
    found["outside"] = max(found["outside"], float(outside / scale))


def _mixed_states(entry: Entry, rng: Generator, n: int) -> dict[str, Array]:
    """Random states; a fifth of the strains is all compression, a fifth all extension, a fifth has equal principal values."""
    state, part = random_states(entry, rng, n), n // 5
    principal = magnitude(entry) * rng.normal(size=(3 * part, 3))
    principal[:part], principal[part : 2 * part] = -np.abs(principal[:part]), np.abs(principal[part : 2 * part])
    principal[2 * part :, 1] = principal[2 * part :, 0]
    state[entry.law.observable.name][: 3 * part] = rotated(rng, principal)
    return state


# -- energies with kinks ----------------------------------------------------------------------------------------------------------

G, c = parameter("G", lower=0), parameter("c", lower=0)
e = sym_tensor("e_0")
MODULUS, KINK = 3.0, 2.0


def _beyond(length: Array) -> Array:
    return np.maximum(length - KINK, 0.0) ** 2 / (4 * MODULUS)


def _shrunk(s: Array) -> Array:
    principal = eigenvalues(s)
    return ((principal - np.clip(principal, 0.0, KINK)) ** 2).sum(axis=-1) / (4 * MODULUS)


KINKED: dict[str, tuple[Any, Callable[[Array], Array]]] = {
    "norm": (G * inner(e, e) + c * norm(e), lambda s: _beyond(size_of(s))),
    "norm of the deviator": (
        G * inner(e, e) + c * norm(dev(e)),
        lambda s: _beyond(size_of(s @ DEVIATOR)) + dot(s, IDENTITY * np.ones_like(s)) ** 2 / (12 * MODULUS),
    ),
    "trace of the positive part": (G * inner(e, e) + c * tr(pos(e)), _shrunk),
    "cube of the norm": (c * norm(e) ** 3, lambda s: 2 / 3 * size_of(s) * np.sqrt(size_of(s) / (3 * KINK))),
}


def _kinked(energy: Any, exact: Callable[[Array], Array], rng: Generator, n: int, few: int) -> dict[str, float]:
    """ψ* by rule and certified against the formula, where the strain is at the kink and where it is not."""
    duals = rng.normal(size=(n, 6)) * 10.0 ** rng.uniform(-1, 1, size=(n, 1))
    rule = partial_conjugate(energy, e, names="s")
    (dual,) = rule.duals.values()
    expected = exact(duals)
    size = np.abs(expected) + KINK * size_of(duals) / MODULUS
    found = {
        "rule": _worst(rule.value({dual: duals, G: MODULUS, c: KINK}) - expected, size),
        "program": 0.0,
        "outside": 0.0,
    }
    for i in range(few):
        _compared(found, numerical_conjugate(energy, e, {e: duals[i]}, {G: MODULUS, c: KINK}), expected[i], size[i])
    return found


def fenchel_equality(seed: int, count: int, programs: int) -> dict[str, Any]:
    """Claim 5: `count` states of every energy, `programs` of them by cone programs."""
    rng, found = np.random.default_rng(seed), {}
    for name, entry in distinct_energies().items():
        pairs = _Pairs(entry, rng, count, programs)
        found[name] = {
            "rule" if pairs.rule.closed else "shares": pairs.by_rule(),  # at solver precision where ψ* is a program
            "below" if pairs.rule.closed else "shares, below": pairs.below(rng),
            "supremum": pairs.by_supremum(rng),
            "stress first": pairs.stress_first(rng),
            **pairs.certified(rng),
        }
    for name, (energy, exact) in KINKED.items():
        found[name] = _kinked(energy, exact, rng, count, programs)

    def worst(*keys: str) -> float:
        return max(f.get(key, 0.0) for f in found.values() for key in keys)

    numbers = {
        "equality": worst("rule", "supremum", "stress first"),
        "below": max(0.0, worst("below")),
        "programs": worst("shares", "shares, below", "program"),
        "outside": worst("outside"),
        "energies": len(distinct_energies()),
        "kinked": len(KINKED),
        "points": count,
    }
    return {"numbers": numbers, "by law": found}
