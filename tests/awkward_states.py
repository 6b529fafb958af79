"""States at which steps are hard: strains over 14 decades, with apexes, edges, corners, repeated and nearly repeated eigenvalues.

Shares of `increments`: an eighth each of exactly repeated, nearly repeated (relative gap 1e-8, 1e-12, 1e-15), spherical, spherical up to
rounding, zero strain, strong dilation (the apex of a cone) and general strains; the last eighth, and half of the general ones, are made
so that the answer lies on an edge of a principal law or at the corner of two surfaces; of other laws they are general.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from law_states import temperatures
from law_truth import I6, TRUTHS, turned

NAMES = ("repeated", "near", "spherical", "rounded", "zero", "dilation", "edge", "general")
EDGED = ("tresca", "mohr_coulomb", "rankine", "drucker_prager_cap")
LOW, HIGH = -12.0, 2.0


def modulus(values):
    """The stiffness [Pa] that makes a strain of a yield stress."""
    return values.get("E", values.get("E_s", values.get("mu_w", 0.0)))


def yield_strain(name, values):
    return TRUTHS[name].unit(SimpleNamespace(**values)) / modulus(values)


def kinds(n):
    """Kind of each of n states, a place in `NAMES`."""
    return np.arange(n) % len(NAMES)


def increments(name, values, rng, n):
    """Strain increments (n, 6) of 10^[−12, 2] yield strains."""
    kind = kinds(n)
    size = 10.0 ** rng.uniform(LOW, HIGH, n)
    e = turned(rng, rng.normal(size=(n, 3)))
    pick = [kind == k for k in range(len(NAMES))]
    e[pick[0]] = repeated(rng, int(pick[0].sum()))
    e[pick[1]] = nearly_repeated(rng, int(pick[1].sum()))
    e[pick[2]] = rng.choice([-1.0, 1.0], int(pick[2].sum()))[:, None] * I6
    rounded = int(pick[3].sum())
    e[pick[3]] = rng.choice([-1.0, 1.0], rounded)[:, None] * I6 + 2e-16 * rng.normal(size=(rounded, 6))
    e[pick[4]] = 0.0
    if name in EDGED:
        pick[6] |= pick[7] & (np.arange(n) // len(NAMES) % 2 == 0)
    many = int(pick[5].sum())
    size[pick[5]] = 10.0 ** rng.uniform(1.0, HIGH, many)
    e[pick[5]] = turned(rng, 1.0 + 0.05 * rng.normal(size=(many, 3)))
    e[pick[6]], size[pick[6]] = on_edge(name, values, rng, int(pick[6].sum()))
    return e * (size * yield_strain(name, values))[:, None]


def repeated(rng, n):
    """Two or three equal eigenvalues, exactly: along the axes of components, or as equal shears (eigenvalues 2x, −x, −x)."""
    e = np.zeros((n, 6))
    pair = rng.normal(size=(n, 2))
    odd = rng.integers(0, 3, n)
    e[:, :3] = pair[:, :1]
    e[np.arange(n), odd] = pair[:, 1]
    e[::4] = 0.0
    e[::4, 3:] = pair[::4, :1]
    e[1::8, :3] = pair[1::8, :1]
    return e


def nearly_repeated(rng, n):
    gap = rng.choice([1e-8, 1e-12, 1e-15], (n, 1))
    values = rng.choice([-1.0, 1.0], (n, 1)) * (1.0 + gap * rng.normal(size=(n, 3)))
    values[::2, 2] = rng.normal(size=len(values[::2]))
    e = turned(rng, values)
    along = np.arange(n) % 3 == 0
    e[along] = 0.0
    e[along, :3] = values[along]
    return e


def on_edge(name, values, rng, n):
    """(directions, sizes) of trial strains above an edge or a corner: the answer plus flows of both faces, as strains of yield."""
    flow = 10.0 ** rng.uniform(-1.0, 1.5, n)
    if name in ("tresca", "mohr_coulomb", "rankine"):
        v = SimpleNamespace(**values)
        s = {"tresca": 0.0, "rankine": 1.0}.get(name, np.sin(getattr(v, "phi", 0.0)))
        # σ₁ = σ₂ > σ₃, or σ₁ > σ₂ = σ₃, then flow (u, 1 − u) on the equal pair
        k = TRUTHS[name].unit(v)
        u, depth = rng.uniform(0.05, 0.95, n), 10.0 ** rng.uniform(-0.5, 0.5, n) * k
        upper = rng.random(n) < (1.0 if name == "rankine" else 0.5)
        limit = v.c * np.cos(v.phi) if name == "mohr_coulomb" else k
        a, b = ((1 + s) / 2, (1 - s) / 2) if name == "mohr_coulomb" else (1.0, 1.0 - s)
        gamma = flow * k / values["E"]
        reach = limit + values["H_i"] * gamma
        low = -depth if b == 0 else np.full(n, -reach / 2)
        high = (reach + b * low) / a
        stress = np.where(upper[:, None], np.stack([high, high, low], 1), np.stack([high, low, low], 1))
        on_two = np.stack([a * u, a * (1 - u), np.full(n, -b)], 1)
        on_low = np.stack([np.full(n, a), -b * u, -b * (1 - u)], 1)
        D = gamma[:, None] * np.where(upper[:, None], on_two, on_low)
        nu = values["nu"]
        strain = ((1 + nu) * stress - nu * stress.sum(1, keepdims=True)) / values["E"] + D
        e = turned(rng, strain)
        e[::2] = 0.0
        e[::2, :3] = strain[::2]
    elif name == "drucker_prager_cap":
        v = SimpleNamespace(**values)
        k = v.W / values["E"]
        g1, g2 = flow * k, 10.0 ** rng.uniform(-1.0, 1.5, n) * k
        # on both surfaces: t P + C₀ + H_i γ₁ = r √((W + H_c r γ₂)² − (P − L)²), by bisection in P
        t, W = np.tan(v.theta_f), v.W + v.H_c * v.r * g2
        low, high = np.full(n, v.L), v.L + W
        for _ in range(80):
            P = 0.5 * (low + high)
            inside = v.C_0 + v.H_i * g1 + t * P < v.r * np.sqrt(np.maximum(W**2 - (P - v.L) ** 2, 0.0))
            low, high = np.where(inside, P, low), np.where(inside, high, P)
        shear = (v.C_0 + v.H_i * g1 + t * P) * np.sqrt(2.0)
        n_dir = turned(rng, rng.normal(size=(n, 3)))
        n_dir -= n_dir[:, :3].mean(1, keepdims=True) * I6
        n_dir /= np.linalg.norm(n_dir, axis=1, keepdims=True)
        root = v.r * W
        d = g1 / np.sqrt(2.0) + g2 * shear / (2 * root)
        volume = t * g1 - g2 * v.r**2 * (P - v.L) / root
        G, K = values["E"] / 2 / (1 + values["nu"]), values["E"] / 3 / (1 - 2 * values["nu"])
        e = n_dir * (shear / (2 * G) + d)[:, None] + I6 * ((volume - P / K) / 3)[:, None]
    else:
        return turned(rng, rng.normal(size=(n, 3))), flow
    return e / yield_strain(name, values), np.ones(n)


def heated(law, rng, n):
    """Temperatures by name, 300 to 350 K at every point, for a law that has one."""
    found = temperatures(law)
    return {name: 300.0 + 50.0 * rng.random(n) for name in found}


def prestrained(update, name, values, rng, n, dt):
    """(state, strains) at the end of three random steps of up to some yield strains: admissible, as they were stepped to."""
    law, eps, state = update.law, np.zeros((n, 6)), None
    for _ in range(3):
        size = yield_strain(name, values) * 10.0 ** rng.uniform(-1.0, 1.0, n)
        eps = eps + turned(rng, rng.normal(size=(n, 3))) * size[:, None]
        state = update(eps, state, dt, **values, **heated(law, rng, n)).state
    return state, eps


def load(update, name, values, rng, n, dt=1.0):
    """(old state, strains, temperatures by name) of n states, the first half virgin.

    Of the others, half are strained on from where they are, and half from the strain at which they are free of stress, so that a special
    increment is a special trial.
    """
    law = update.law
    eps = increments(name, values, rng, n)
    half = n // 2
    state = {k: np.zeros_like(x) for k, x in update.initial_state(n).items()}
    if law.internal or "eps" in state:
        before, strain = prestrained(update, name, values, rng, n - half, dt)
        for k, x in before.items():
            state[k][half:] = x
        plastic = TRUTHS[name].plastic
        # in blocks of the kinds, so that every kind meets both
        free = (np.arange(n - half) // len(NAMES)) % 2 == 0
        start = np.where(free[:, None], before[plastic], strain) if plastic else strain
        zero = kinds(n)[half:] == NAMES.index("zero")
        eps[half:] += np.where(zero[:, None], 0.0, start)
    return state, eps, heated(law, rng, n)
