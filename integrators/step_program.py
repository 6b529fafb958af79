"""The implicit step as one small cone program whose data are affine in (ε, old state, …): assembly, reduction, scaling.

    W(d) = min_x ½ xᵀPx + …   over the increments, the multipliers of φ* and auxiliary unknowns,

from two canonical forms: ψ over (ε, X), and either φ* over the forces Y or φ over the rates. φ* enters through its dual,

    dt φ(D/dt) = sup_{v = (Y, aux)} Y·D − dt (½ vᵀPv + qᵀv)  s.t. h − Gv ∈ K, Ev = e
               = min_{z ∈ K*, y, r} hᵀz + eᵀy + |r|²/(2 dt)  s.t. Gᵀz + Eᵀy + Fᵀr + dt q = (D, 0),   P = FᵀF,

so that X = X_n + D is a linear function of the multipliers and the step is one minimisation (Rockafellar 1970, §30). Equalities are
eliminated by an orthonormal basis of their null space; the quadratic is brought to the identity on its range; every cone block is scaled to
norm one. Stress and forces are derivatives of W by its data (envelope theorem), exact also where ψ has kinks.

Driven by the stress the strain is one of the unknowns, min over (ε, x) of W − σ:ε with d = (σ, …): the minimum is −W*(σ), its slope −ε.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .canonical import CanonicalForm, Cone, dual_cones
from .cone_projection import EXPONENTIAL, POWER, SEMIDEFINITE
from .natural_units import cleaned, natural_units

__all__ = ["FlowForm", "Stacked", "StepProgram", "assemble", "flow_of_dual", "flow_of_rates", "stacked"]

Array = NDArray[np.float64]
RANK = 1e-10


@dataclass(frozen=True)
class FlowForm:
    """dt φ(D/dt) = min ½ wᵀPw + qᵀw over w with D = L w + l₀ on `moved` places of (ε, X), E w = e₀, h − G w ∈ K."""

    P: Array
    q: Array
    L: Array
    l0: Array
    E: Array
    e0: Array
    G: Array
    h: Array
    cones: tuple[Cone, ...]
    constant: float = 0.0


def _factor_of(P: Array) -> Array:
    """F with P = FᵀF; an eigenvalue of the wrong sign beyond rounding is refused earlier."""
    values, vectors = np.linalg.eigh(P) if P.size else (np.zeros(0), np.zeros((0, 0)))
    keep = values > 1e-13 * max(float(values.max(initial=0.0)), 1e-300)
    return np.sqrt(values[keep])[:, None] * vectors[:, keep].T


def flow_of_dual(form: CanonicalForm, dt: float) -> FlowForm:
    """From φ* over (Y, aux): unknowns (z, y, r), see the module's docstring."""
    F = _factor_of(form.P)
    k, cone_rows, equal_rows = form.first, form.G.shape[0], form.E.shape[0]
    maps = np.vstack([form.G, form.E, F]).T
    size = maps.shape[1]
    P = np.zeros((size, size))
    P[cone_rows + equal_rows :, cone_rows + equal_rows :] = np.eye(F.shape[0]) / dt
    q = np.concatenate([form.h, form.e, np.zeros(F.shape[0])])
    G = np.zeros((cone_rows, size))
    G[:, :cone_rows] = -np.eye(cone_rows)
    return FlowForm(
        P,
        q,
        maps[:k],
        dt * form.q[:k],
        maps[k:],
        -dt * form.q[k:],
        G,
        np.zeros(cone_rows),
        dual_cones(form.cones),
        -dt * form.constant,
    )


def flow_of_rates(form: CanonicalForm, dt: float) -> FlowForm:
    """From φ over (rates, aux): D = dt · rates."""
    size, k = form.q.size, form.first
    L = np.zeros((k, size))
    L[:, :k] = dt * np.eye(k)
    return FlowForm(
        dt * form.P, dt * form.q, L, np.zeros(k), form.E, form.e, form.G, form.h, form.cones, dt * form.constant
    )


@dataclass(frozen=True)
class StepProgram:
    """Reduced program min ½ yᵀ diag(p) y + qᵀy s.t. h − Gy ∈ K, q = q0 + q1 d, h = h0 + h1 d; d = (ε, X_n, ε_n if `strain_flows`),
    with σ in place of ε if `stress`.

    W = value + ½ dᵀCd + c1·d; X = X_n + `increment`; `misfit` rows must vanish for the equalities to have a solution. The unknowns
    of the stacked program are `whole` (1, d, y), its rows are divided by `units`.
    """

    p: Array
    G: Array
    q0: Array
    q1: Array
    h0: Array
    h1: Array
    C: Array
    c1: Array
    c0: float
    cones: tuple[Cone, ...]
    increment_0: Array
    increment_d: Array
    increment_y: Array
    misfit_0: Array
    misfit_d: Array
    state_size: int
    strain_flows: bool
    unbounded: bool
    whole: Array = field(default_factory=lambda: np.zeros((0, 0)))
    units: Array = field(default_factory=lambda: np.zeros(0))
    stress: bool = False

    def cone_arrays(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array, Array]:
        """(kinds, starts, sizes, first and second number of the cone or scalar term)."""
        kinds = np.array([c.kind for c in self.cones], dtype=np.int64)
        sizes = np.array([c.size for c in self.cones], dtype=np.int64)
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64) if sizes.size else sizes
        numbers = np.array([(c.alpha, c.beta) for c in self.cones], dtype=float).reshape(-1, 2).T
        return kinds, starts, sizes, numbers[0].copy(), numbers[1].copy()

    @cached_property
    def engine_arrays(self) -> tuple[Any, ...]:
        """What the compiled engine reads, see `general.solve_points`."""
        from .engine_arrays import engine_arrays

        return engine_arrays(self)

    @cached_property
    def compact(self) -> Any:
        """The same program with scalar terms in place of cones where that can be, see `compact`."""
        from .compact import compact

        return compact(self)

    def increments(self, data: Array, y: Array) -> Array:
        """X − X_n, shape (n, state_size)."""
        return self.increment_0 + data @ self.increment_d.T + y @ self.increment_y.T


@dataclass(frozen=True)
class Stacked:
    """The step before reduction: the quadratic form `full` of (1, d, x), E (1, d, x) = 0, H (1, d) − G x ∈ K, X = `X` (1, d, x)."""

    full: Array
    E: Array
    G: Array
    H: Array
    cones: tuple[Cone, ...]
    X: Array


def assemble(
    energy: CanonicalForm,
    flow: FlowForm | None,
    moved: Sequence[int],
    state_size: int,
    strain_flows: bool,
    stress: bool = False,
) -> StepProgram:
    """The step of ψ = `energy` over (ε, X, aux) with `flow` on the places `moved` of (ε, X) (ε: 0 … 5); driven by σ if `stress`."""
    s = stacked(energy, flow, moved, state_size, strain_flows, stress)
    width = 6 + state_size + (6 if strain_flows else 0)
    return replace(_reduce(s.full, s.E, s.G, s.H, s.cones, s.X, width, state_size, strain_flows), stress=stress)


def stacked(
    energy: CanonicalForm,
    flow: FlowForm | None,
    moved: Sequence[int],
    state_size: int,
    strain_flows: bool,
    stress: bool = False,
) -> Stacked:
    """Both forms over the common unknowns; arguments as for `assemble`."""
    m = state_size
    width = 6 + m + (6 if strain_flows else 0)
    aux = energy.q.size - energy.first
    flows = 0 if flow is None else flow.q.size
    free = 6 if stress else 0
    n = free + aux + flows
    # B: (1, d, x) ↦ (ε, X, aux of ψ); x = (ε if driven by σ, aux, w)
    size = 6 + m + aux
    first, own = 1 + width + free, 1 + width + free + aux
    strain = slice(1 + width, first) if stress else slice(1, 7)
    B = np.zeros((size, 1 + width + n))
    B[:6, strain] = np.eye(6)
    B[6 : 6 + m, 7 : 7 + m] = np.eye(m)
    B[6 + m :, first:own] = np.eye(aux)
    E_rows: list[Array] = []
    if flow is not None:
        places = np.asarray(moved)
        internal = places >= 6
        B[places[internal], own:] += flow.L[internal]
        B[places[internal], 0] += flow.l0[internal]
        if strain_flows:
            # L w + l₀ = ε − ε_n
            row = np.zeros((6, 1 + width + n))
            row[:, 0] = flow.l0[~internal]
            row[:, own:] = flow.L[~internal]
            row[:, strain] -= np.eye(6)
            row[:, 7 + m : 13 + m] += np.eye(6)
            E_rows.append(row)
        row = np.zeros((flow.E.shape[0], 1 + width + n))
        row[:, 0] = -flow.e0
        row[:, own:] = flow.E
        E_rows.append(row)
    W = np.zeros((flows, 1 + width + n))
    W[:, own:] = np.eye(flows)
    row = energy.E @ B
    row[:, 0] -= energy.e
    E_rows.append(row)
    E = np.vstack(E_rows)
    G_energy = energy.G @ B
    h_energy = -G_energy[:, : 1 + width].copy()
    h_energy[:, 0] += energy.h
    G, H = G_energy[:, 1 + width :], h_energy
    cones = energy.cones
    if flow is not None:
        h_flow = np.zeros((flow.G.shape[0], 1 + width))
        h_flow[:, 0] = flow.h
        G = np.vstack([G, flow.G @ W[:, 1 + width :]])
        H = np.vstack([H, h_flow])
        cones = cones + flow.cones
    # quadratic form in (1, d, x)
    full = B.T @ energy.P @ B
    slope = B.T @ energy.q
    if flow is not None:
        full += W.T @ flow.P @ W
        slope += W.T @ flow.q
    full[0, :] += slope
    full[:, 0] += slope
    full[0, 0] += 2.0 * (energy.constant + (0.0 if flow is None else flow.constant))
    if stress:
        full[1:7, strain] -= np.eye(6)
        full[strain, 1:7] -= np.eye(6)
    return Stacked(full, E, G, H, cones, B[6 : 6 + m])


def _column_scale(P: Array, E: Array, G: Array, cones: Sequence[Cone]) -> Array:
    """Positive column scales that bring [P; E; G] near unit size, rows of E and G being free to scale.

    First the logarithms of all entries by least squares (Curtis and Reid, 1972), with those of the curvatures, which have no row to
    scale: a unit that several unknowns share shows only in rows that tie them to others (a multiplier by a strength of 1e9 Pa, a rate over
    a short step). Then largest entries in turn (Ruiz, 2001), which is all where ψ has powers or exponentials: their cones tie units
    that rows do not show.
    """
    rows = np.vstack([E, G])
    scale, left = np.ones(rows.shape[1]), np.ones(rows.shape[0])
    if not any(cone.kind in (EXPONENTIAL, POWER) for cone in cones):
        scale = _geometric_scale(np.diag(P), rows)
        across = np.abs(rows * scale[None, :]).max(axis=1, initial=0.0)
        left /= np.where(across > 0.0, across, 1.0)
    for _ in range(12):
        inside = np.abs(P * scale[:, None] * scale[None, :])
        outside = np.abs(rows * left[:, None] * scale[None, :])
        size = np.maximum(np.sqrt(inside.max(axis=0, initial=0.0)), outside.max(axis=0, initial=0.0))
        scale /= np.sqrt(np.where(size > 0.0, size, 1.0))
        outside = np.abs(rows * left[:, None] * scale[None, :])
        across = outside.max(axis=1, initial=0.0)
        left /= np.sqrt(np.where(across > 0.0, across, 1.0))
    return scale


def _geometric_scale(curvature: Array, rows: Array) -> Array:
    """exp c with least Σ (log |a_ij| + r_i + c_j)² over the entries of the rows plus Σ (½ log P_jj + c_j)² over the curvatures."""
    m, n = rows.shape
    i, j = np.nonzero(rows)
    curved = np.flatnonzero(curvature > 0.0)
    system = np.zeros((len(i) + len(curved), m + n))
    entries = np.arange(len(i))
    system[entries, i] = system[entries, m + j] = 1.0
    system[len(i) + np.arange(len(curved)), m + curved] = 1.0
    known = np.concatenate([np.log(np.abs(rows[i, j])), 0.5 * np.log(curvature[curved])])
    return np.exp(np.linalg.lstsq(system, -known, rcond=None)[0][m:])


def _costed(P: Array, E: Array, G: Array, cones: tuple[Cone, ...]) -> NDArray[np.bool_]:
    """Unknowns that meet one entry of an exponential or power cone and nothing else: they only carry a cost."""
    single = (np.count_nonzero(G, axis=0) == 1) & ~P.any(axis=0) & ~E.any(axis=0)
    flat = np.concatenate([np.full(c.size, c.kind > SEMIDEFINITE) for c in cones]) if cones else np.zeros(0, dtype=bool)
    return single & (flat[np.abs(G).argmax(axis=0)] if flat.size else False)


def _outside(basis: Array, taken: NDArray[np.bool_]) -> Array:
    """Orthonormal basis of what the columns of `basis` span without the unit vectors `taken`."""
    if not taken.any():
        return basis
    rest = np.where(taken[:, None], 0.0, basis)
    u, s, _ = np.linalg.svd(rest, full_matrices=False)
    return u[:, s > 0.5]


def _reduce(
    full: Array, E: Array, G: Array, H: Array, cones: tuple[Cone, ...], X: Array, width: int, m: int, strain_flows: bool
) -> StepProgram:
    """Eliminate equalities, whiten, scale; arguments are maps of (1, d, x) (H of (1, d))."""
    k = 1 + width
    n = full.shape[0] - k
    scale = _column_scale(full[k:, k:], E[:, k:], G, cones)
    D = np.ones(k + n)
    D[k:] = scale
    full, E, X = full * D[:, None] * D[None, :], E * D, X * D
    G = G * scale
    sizes = np.linalg.norm(E[:, k:], axis=1)
    E = E / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    costed = _costed(full[k:, k:], E[:, k:], G, cones)
    E_rest = np.where(costed, 0.0, E[:, k:])
    u, s, vt = np.linalg.svd(E_rest) if E.size else (np.zeros((0, 0)), np.zeros(0), np.eye(n))
    rank = int((s > RANK * s.max(initial=0.0)).sum())
    misfit = u[:, rank:].T @ E[:, :k] if E.size else np.zeros((0, k))
    misfit = misfit[np.abs(misfit).max(axis=1, initial=0.0) > 1e-12]
    N = cleaned(_outside(vt[rank:].T, costed))
    # x = S (1, d) + x', x' in the span of N
    S = -(vt[:rank].T / s[:rank]) @ (u[:, :rank].T @ E[:, :k]) if rank else np.zeros((n, k))
    S[np.abs(S) < 1e-15 * np.abs(S).max(initial=0.0)] = 0.0
    whole = np.vstack([np.hstack([np.eye(k), np.zeros((k, n))]), np.hstack([S, np.eye(n)])])
    full = whole.T @ full @ whole
    X = X @ whole
    H = H - G @ S
    units = natural_units(N, np.eye(n)[:, costed], full[k:, k:], G, H[:, 0], full[k:, :k], cones)
    T, blocks = units.columns, units.rows
    G, H = G @ T / blocks[:, None], H / blocks[:, None]
    linear = T.T @ full[k:, :k]
    return StepProgram(
        units.curvature,
        np.ascontiguousarray(G),
        linear[:, 0].copy(),
        np.ascontiguousarray(linear[:, 1:]),
        H[:, 0].copy(),
        np.ascontiguousarray(H[:, 1:]),
        np.ascontiguousarray(full[1:k, 1:k]),
        full[1:k, 0].copy(),
        0.5 * float(full[0, 0]),
        cones,
        X[:, 0].copy(),
        X[:, 1:k] - np.hstack([np.zeros((m, 6)), np.eye(m), np.zeros((m, width - 6 - m))]),
        X[:, k:] @ T,
        misfit[:, 0].copy(),
        misfit[:, 1:].copy(),
        m,
        strain_flows,
        units.unbounded,
        scale[:, None] * np.hstack([S, T]),
        blocks,
    )
