"""The general engine: a small cone program at every point, compiled once per machine; sizes and cones are run-time data.

    min ½ yᵀ diag(p) y + qᵀy + Σ g(s)   over   s = h − G y ∈ K,    0 ≤ p ≤ 1,    q = q₀ + q₁ d,   h = h₀ + h₁ d,

with scalar convex terms g (see `scalar_terms`) of single entries of s, d the data of the point (strain, old state, …). Two methods share
the work. Proximal augmented Lagrangian: at multipliers λ the inner problem

    min_y ½ yᵀ diag(p) y + qᵀy + (1/2τ) ‖Π_{K*}(λ + τ(Gy − h))‖² + ½ ρ ‖y − y₀‖²

is strongly convex and C^{1,1}; its Newton matrix diag(p + ρ) + τ GᵀVG, V an element of the generalised Jacobian of the projection, is
positive definite at apex, corner and on redundant constraints alike: it converges from anywhere. Near the solution Newton's method for
the natural map

    p y + q + Gᵀλ = 0,    λ = Π_{K*}(λ + Gy − h)

takes over for as long as it lowers its residual fast, with the matrix diag(p) + GᵀV(I(1 + δ) − V)⁻¹G. The tangent is the derivative of
the same map with the same V, refined with the same matrix, so that stress and tangent never disagree about the region. The program is
positively homogeneous of degree one in (q, h), so each point is brought to unit size first (Rockafellar 1976; Qi & Sun 1993).
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from ..cache import njit
from .cone_blocks import PENALTY, SLOPE, SPREAD, Cones, Jacobian, add_curvature, apply, linearise, project_all
from .cone_projection import ORTHANT, SEMIDEFINITE
from .key import files_hash
from .scalar_terms import POWER_TERM, proximal_step, scaled_term
from .small_cholesky import FAST, factor, substitute

__all__ = ["CONVERGED", "ITERATION_LIMIT", "NOT_FINITE", "ROUNDING", "solve_points"]

CONVERGED, ROUNDING, ITERATION_LIMIT, NOT_FINITE = range(4)

_FOLDER = files_hash(
    "cone_blocks.py", "cone_projection.py", "general.py", "scalar_terms.py", "small_cholesky.py", "spectral.py"
)
_EPS = 2.220446049250313e-16
_DELTA = 1e-8
_TURNS = 60

# unknowns: y0, trial, slope, direction, kept_y, one, two; rows: v, w, image, v_next, kept_l, spread, more
Room = namedtuple("Room", "y0 trial slope direction kept_y one two v w image v_next kept_l spread more matrix")


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def _times(Gt, y, out):
    """out = G y."""
    for r in range(out.size):
        out[r] = 0.0
    for j in range(y.size):
        x = y[j]
        if x != 0.0:
            for r in range(out.size):
                out[r] += x * Gt[j, r]


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def _add_transposed(G, w, out):
    """out += Gᵀ w."""
    for r in range(w.size):
        x = w[r]
        if x != 0.0:
            for i in range(out.size):
                out[i] += x * G[r, i]


@njit(folder=_FOLDER, nogil=True)
def _largest(a):
    """Largest modulus; infinite where an entry is not a number."""
    found = 0.0
    for i in range(a.size):
        size = abs(a[i])
        if not size <= found:
            found = size if size == size else math.inf
    return found


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def _start_matrix(p, rho, matrix):
    for i in range(p.size):
        for j in range(i):
            matrix[i, j] = 0.0
        matrix[i, i] = p[i] if p[i] >= 0.5 else p[i] + rho


@njit(folder=_FOLDER, nogil=True)
def _level(p, cones, q, y, v, rho, tau, alphas, betas, room, jacobian):
    """Value and slope of the inner problem at y, where v = λ + τ(Gy − h); w = Π_{K*}(v). Returns (value, largest entry of the slope)."""
    w, slope, y0 = room.w, room.slope, room.y0
    total = project_all(cones, alphas, betas, tau, v, w, jacobian)
    square = 0.0
    for r in range(w.size):
        square += w[r] * w[r]
    total += 0.5 * square / tau
    for i in range(p.size):
        step = y[i] - y0[i] if p[i] < 0.5 else 0.0
        total += y[i] * (0.5 * p[i] * y[i] + q[i]) + 0.5 * rho * step * step
        slope[i] = p[i] * y[i] + q[i] + rho * step
    _add_transposed(cones.G, w, slope)
    largest = _largest(slope)
    return (total, largest) if largest < math.inf else (math.inf, math.inf)


@njit(folder=_FOLDER, nogil=True)
def _natural(p, cones, q, h, y, lam, alphas, betas, steep, room, jacobian):
    """Natural map at (y, λ): −(py + q + Gᵀλ) in `slope`, Π(v) − λ in `more`, v = λ + Gy − h. Returns (its largest entry, scale)."""
    v, w, slope, more = room.v, room.w, room.slope, room.more
    _times(cones.Gt, y, v)
    for r in range(v.size):
        v[r] += lam[r] - h[r]
    project_all(cones, alphas, betas, 1.0, v, w, jacobian)
    for r in range(v.size):
        more[r] = w[r] - lam[r]
    for b in range(cones.kinds.size if steep else 0):
        if cones.kinds[b] == POWER_TERM and betas[b] < 2.0:
            r = cones.starts[b]
            more[r], jacobian.numbers[b, 0] = _steep_power(alphas[b], betas[b], lam[r], lam[r] - v[r])
    for i in range(p.size):
        slope[i] = p[i] * y[i] + q[i]
    _add_transposed(cones.G, lam, slope)
    for i in range(p.size):
        slope[i] = -slope[i]
    return max(_largest(slope), _largest(more)), max(_largest(lam), _largest(y))


@njit(folder=_FOLDER, nogil=True)
def _steep_power(c, k, lam, s):
    """Row of the natural map for C|s|ᵏ, k < 2, with a penalty t of its own: (residual, e), both as they read at t = 1.

    The slope of λ = −g′(s) has no bound at zero. With t above g″ Newton's method follows s, which finds that corner in one step, where
    following λ halves the distance at best; the equation (1 − e) dλ − e t G dy = w − λ is then brought to t = 1.
    """
    bend = 0.0
    if lam != 0.0:
        bend = (k - 1.0) * abs(lam) * (abs(lam) / (c * k)) ** (-1.0 / (k - 1.0))
    if s != 0.0:
        bend = max(bend, c * k * (k - 1.0) * abs(s) ** (k - 2.0))
    t = min(max(100.0 * bend, 1.0), 1e12)
    w, e, _ = proximal_step(POWER_TERM, c, k, lam - t * s, t)
    if not e < 1.0:
        return (w - lam) / t, 1.0
    bend = t * e / (1.0 - e)
    return (w - lam) * (1.0 + bend / t) / (1.0 + bend), bend / (1.0 + bend)


@njit(folder=_FOLDER, nogil=True)
def _has_steep(cones, betas):
    for b in range(cones.kinds.size):  # noqa: SIM110
        if cones.kinds[b] == POWER_TERM and betas[b] < 2.0:
            return True
    return False


@njit(folder=_FOLDER, nogil=True)
def _kkt_factor(p, cones, v, room, jacobian):
    """Factor of diag(p) + GᵀV(I(1 + δ) − V)⁻¹G."""
    linearise(cones, jacobian)
    _start_matrix(p, _DELTA, room.matrix)
    add_curvature(cones, jacobian, v, SLOPE, 1.0, _DELTA, room.matrix, room.one, room.two)
    factor(room.matrix)


@njit(folder=_FOLDER, nogil=True)
def _kkt_step(cones, v, first, second, dy, dl, room, jacobian):
    """Solve p dy + Gᵀdλ = `first`, (I(1 + δ) − V) dλ − V G dy = `second` by the factor of `_kkt_factor`."""
    apply(cones, jacobian, v, SPREAD, 1.0, _DELTA, second, room.spread)
    for r in range(dl.size):
        dl[r] = -room.spread[r]
    for i in range(dy.size):
        dy[i] = first[i]
    _add_transposed(cones.G, dl, dy)
    substitute(room.matrix, dy)
    _times(cones.Gt, dy, room.image)
    apply(cones, jacobian, v, SLOPE, 1.0, _DELTA, room.image, dl)
    for r in range(dl.size):
        dl[r] += room.spread[r]


@njit(folder=_FOLDER, nogil=True)
def _finish(p, cones, q, h, y, lam, alphas, betas, tolerance, room, jacobian):
    """Newton's method for the natural map from (y, λ), in place, while each step divides the residual by four; then, where there are powers
    below two, once more with `_steep_power`. Returns (status, residual, steps); where it stops short, (y, λ) are the best met.
    """
    n, m = p.size, h.size
    steep = False
    residual, scale = _natural(p, cones, q, h, y, lam, alphas, betas, steep, room, jacobian)
    for steps in range(16):
        # one step more than the tolerance asks for leaves rounding alone
        if residual <= 0.01 * tolerance * min(scale, 1.0):
            return CONVERGED, residual, steps
        if residual <= 4.0 * _EPS * (1.0 + scale):
            return (CONVERGED if residual <= tolerance * min(scale, 1.0) else ROUNDING), residual, steps
        _kkt_factor(p, cones, room.v, room, jacobian)
        _kkt_step(cones, room.v, room.slope, room.more, room.direction, room.v_next, room, jacobian)
        for i in range(n):
            room.kept_y[i] = y[i]
            y[i] += room.direction[i]
        for r in range(m):
            room.kept_l[r] = lam[r]
            lam[r] += room.v_next[r]
        before, scale_before = residual, scale
        residual, scale = _natural(p, cones, q, h, y, lam, alphas, betas, steep, room, jacobian)
        if not residual <= 0.25 * before:
            if not residual < before:
                for i in range(n):
                    y[i] = room.kept_y[i]
                for r in range(m):
                    lam[r] = room.kept_l[r]
                residual, scale = before, scale_before
            if residual <= tolerance * min(scale, 1.0):
                return CONVERGED, residual, steps + 1
            if not steep and _has_steep(cones, betas):
                steep = True
                residual, scale = _natural(p, cones, q, h, y, lam, alphas, betas, steep, room, jacobian)
                continue
            return (ROUNDING if residual <= 64.0 * _EPS * (1.0 + scale) else ITERATION_LIMIT), residual, steps + 1
    return ITERATION_LIMIT, residual, 16


@njit(folder=_FOLDER, nogil=True)
def _solve_point(p, cones, q, h, alphas, betas, y, lam, tolerance, tau, limit, room, jacobian):
    """Solve one program of unit size from (y, λ), in place. Returns (status, residual, Newton steps, outer turns)."""
    n, m = p.size, h.size
    y0, trial, v, w, slope, direction, image = (
        room.y0, room.trial, room.v, room.w, room.slope, room.direction, room.image,
    )  # fmt: skip
    # where the start is the solution (an elastic point)
    residual, scale = _natural(p, cones, q, h, y, lam, alphas, betas, False, room, jacobian)
    if residual <= 0.01 * tolerance * min(scale, 1.0) or residual <= 4.0 * _EPS * (1.0 + scale):
        return CONVERGED, residual, 0, 0
    steps, stalled = 0, 0
    best = math.inf
    inner, try_below = 1e-2, 0.1
    status, residual = ITERATION_LIMIT, math.inf
    rho = 1e-3
    # powers and exponentials are flat where they do not act: only a stiff penalty sees them
    highest = 1e5
    for b in range(cones.kinds.size):
        if cones.kinds[b] > SEMIDEFINITE:
            highest = 1e11
    for turn in range(1, _TURNS + 1):
        for i in range(n):
            y0[i] = y[i]
        _times(cones.Gt, y, v)
        for r in range(m):
            v[r] = lam[r] + tau * (v[r] - h[r])
        value, size = _level(p, cones, q, y, v, rho, tau, alphas, betas, room, jacobian)
        for _ in range(limit):
            if size <= inner:
                break
            linearise(cones, jacobian)
            _start_matrix(p, rho, room.matrix)
            add_curvature(cones, jacobian, v, PENALTY, tau, 0.0, room.matrix, room.one, room.two)
            factor(room.matrix)
            for i in range(n):
                direction[i] = -slope[i]
            substitute(room.matrix, direction)
            along = 0.0
            for i in range(n):
                along += slope[i] * direction[i]
            _times(cones.Gt, direction, image)
            steps += 1
            length, taken = 1.0, False
            before, size_before = value, size
            while length > 1e-9:
                for i in range(n):
                    trial[i] = y[i] + length * direction[i]
                for r in range(m):
                    room.v_next[r] = v[r] + length * tau * image[r]
                value, size = _level(p, cones, q, trial, room.v_next, rho, tau, alphas, betas, room, jacobian)
                # near the minimum the value is flat to rounding; there the slope decides
                if value <= before + 1e-4 * length * along or size <= 0.9 * size_before:
                    taken = True
                    break
                length *= 0.5
            if not taken:
                value, size = _level(p, cones, q, y, v, rho, tau, alphas, betas, room, jacobian)
                break
            for i in range(n):
                y[i] = trial[i]
            for r in range(m):
                v[r] = room.v_next[r]
        # residuals at (y, w): stationarity without the proximal term, and feasibility with complementarity |w − λ|/τ
        stationary, feasible, scale, reach = 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            step = rho * (y[i] - y0[i]) if p[i] < 0.5 else 0.0
            stationary = max(stationary, abs(slope[i] - step))
            reach = max(reach, abs(y[i]))
        for r in range(m):
            feasible = max(feasible, abs(w[r] - lam[r]) / tau)
            scale = max(scale, abs(w[r]))
            lam[r] = w[r]
        scale = max(scale, reach)
        residual = max(stationary, feasible)
        if not residual < math.inf:
            return NOT_FINITE, residual, steps, turn
        if residual <= 0.01 * tolerance * min(scale, 1.0):
            return CONVERGED, residual, steps, turn
        if residual <= 8.0 * _EPS * (1.0 + scale) or (stalled >= 3 and best <= 64.0 * _EPS * (1.0 + scale)):
            return ROUNDING, residual, steps, turn
        if residual <= try_below:
            status, found, more = _finish(p, cones, q, h, y, lam, alphas, betas, tolerance, room, jacobian)
            steps += more
            if status != ITERATION_LIMIT:
                return status, found, steps, turn
            try_below = 0.1 * residual
            residual = min(residual, found)
        if residual <= tolerance * min(scale, 1.0):
            return CONVERGED, residual, steps, turn
        stalled = stalled + 1 if residual > 0.5 * best else 0
        if stalled > 8:
            return ITERATION_LIMIT, residual, steps, turn
        # rounding of Gy − h reaches the multipliers τ times enlarged: no residual below it can be asked of this penalty
        noise = 4.0 * _EPS * (1.0 + scale + tau * reach)
        if residual <= 8.0 * noise and tau > 1.0:
            tau = max(0.01 * tau, 1.0)
        elif residual > 0.05 * best or residual > 1e-3:
            tau = min(10.0 * tau, highest)
            rho = max(0.1 * rho, 1e-7)
        best = min(best, residual)
        inner = max(min(0.1 * residual, 1e-2), 4.0 * _EPS * (1.0 + scale + tau * reach))
    return ITERATION_LIMIT, residual, steps, _TURNS


@njit(folder=_FOLDER, nogil=True)
def _at_rest(cones, y, h1_zero, v, jacobian):
    """True where y = 0 with every multiplier inside its cone: G dy = 0, so that nothing moves with the data if G has full column rank."""
    if not h1_zero:
        return False
    for i in range(y.size):
        if y[i] != 0.0:
            return False
    for b in range(cones.kinds.size):
        if cones.kinds[b] >= POWER_TERM:
            return False
        if cones.kinds[b] == ORTHANT:
            for r in range(cones.starts[b], cones.starts[b] + cones.sizes[b]):
                if not v[r] > 0.0:
                    return False
        elif jacobian.marks[b] != 1:
            return False
    return True


@njit(folder=_FOLDER, nogil=True)
def _derivatives(p, cones, q1t, h1t, h1_zero, C, v, dy, dl, step_y, step_l, room, jacobian, out):
    """∂²W/∂ε² = C + q₁ᵀ dy/dε − h₁ᵀ dλ/dε, (dy, dλ) the derivative of the natural map's zero. Returns the relative residual left."""
    n, m = dy.size, dl.size
    _kkt_factor(p, cones, v, room, jacobian)
    first, second = room.slope, room.more
    worst = 0.0
    for c in range(6):
        goal = max(_largest(q1t[c]), _largest(h1t[c]), 1e-300)
        for i in range(n):
            dy[i] = 0.0
            first[i] = -q1t[c, i]
        for r in range(m):
            dl[r] = 0.0
            second[r] = -h1t[c, r]
        if not h1_zero:
            apply(cones, jacobian, v, PENALTY, 1.0, 0.0, second, room.image)
            for r in range(m):
                second[r] = room.image[r]
        last, size = math.inf, goal
        for turn in range(20):
            _kkt_step(cones, v, first, second, step_y, step_l, room, jacobian)
            for i in range(n):
                dy[i] += step_y[i]
            for r in range(m):
                dl[r] += step_l[r]
            # the second step repeats what the first has gained
            if turn == 1 and size * size <= 1e-14 * goal * goal:
                last = size * size / goal
                break
            # what is left: −q₁ − p dy − Gᵀdλ, and V(dλ + G dy − h₁) − dλ
            for i in range(n):
                first[i] = 0.0
            _add_transposed(cones.G, dl, first)
            for i in range(n):
                first[i] = -q1t[c, i] - p[i] * dy[i] - first[i]
            _times(cones.Gt, dy, room.image)
            for r in range(m):
                room.image[r] += dl[r] - h1t[c, r]
            apply(cones, jacobian, v, PENALTY, 1.0, 0.0, room.image, second)
            for r in range(m):
                second[r] -= dl[r]
            size = max(_largest(first), _largest(second))
            if size <= 1e-13 * goal or not size < 0.5 * last:
                break
            last = size
        worst = max(worst, min(size, last) / goal)
        for i in range(6):
            value = C[i, c]
            for k in range(n):
                value += q1t[i, k] * dy[k]
            if not h1_zero:
                for r in range(m):
                    value -= h1t[i, r] * dl[r]
            out[i, c] = value
    return worst


@njit(folder=_FOLDER, nogil=True)
def _shifted(cones, h1t, v, shift, everywhere, out):
    """out = v less `shift` times the unit of each cone, of those whose right sides move with the data, or of all.

    Where multiplier and slack both vanish to rounding, V is noise; with data in h its choice may contradict itself.
    """
    for r in range(v.size):
        out[r] = v[r]
    for b in range(cones.kinds.size):
        kind, s, size = cones.kinds[b], cones.starts[b], cones.sizes[b]
        moved = everywhere
        for k in range(h1t.shape[0]):
            for r in range(s, s + size):
                if h1t[k, r] != 0.0:
                    moved = True
        if moved and kind <= SEMIDEFINITE:
            count = size if kind == ORTHANT else (3 if kind == SEMIDEFINITE else 1)
            for r in range(s, s + count):
                out[r] -= shift


@njit(folder=_FOLDER, nogil=True)
def _tangent(
    p, cones, q, h, y, lam, alphas, betas, q1t, h1t, h1_zero, pinned, C, dy, dl, step_y, step_l, v, room, jacobian, out,
):  # fmt: skip
    """Tangent at a solution; `pinned` if G has full column rank; `v` (m,) is room."""
    _natural(p, cones, q, h, y, lam, alphas, betas, True, room, jacobian)
    if pinned and _at_rest(cones, y, h1_zero, room.v, jacobian):
        for i in range(6):
            for c in range(6):
                out[i, c] = C[i, c]
        return
    for r in range(v.size):
        v[r] = room.v[r]
    scale, shift = max(_largest(lam), _largest(y), 1.0), 1e-12
    for attempt in range(3):
        if attempt > 0 or not h1_zero:
            _shifted(cones, h1t, room.v, scale * shift, attempt > 0, v)
            shift *= 100.0
            project_all(cones, alphas, betas, 1.0, v, room.w, jacobian)
        worst = _derivatives(p, cones, q1t, h1t, h1_zero, C, v, dy, dl, step_y, step_l, room, jacobian, out)
        if worst <= 1e-8:
            return


@njit(folder=_FOLDER, nogil=True)
def solve_points(
    p, G, Gt, grams, q0, q1t, h0, h1t, C, c1, kinds, starts, sizes, alphas, betas, guess, data, warm, y_all, l_all,
    slopes, tangents, want_tangent, residuals, statuses, counts, turns, tolerance, tau_start, limit,
):  # fmt: skip
    """The program at every row d of `data` (N, D).

    `y_all` (N, n), `l_all` (N, m) take the solutions and hold the start where `warm`; else it is y = 0, λ = `guess` q. `slopes` (N, D)
    takes ∂W/∂d = C d + c₁ + q₁ᵀy − h₁ᵀλ, `tangents` (N, 6, 6) its derivative by the first six data. `residuals` are relative to the size
    of (q, h), `counts` Newton steps and `turns` outer turns. `q1t`, `h1t` are transposed.
    """
    n, m, width = p.size, h0.size, data.shape[1]
    blocks = kinds.size
    cones = Cones(kinds, starts, sizes, G, Gt, grams)
    jacobian = Jacobian(
        np.zeros(blocks, dtype=np.int64), np.zeros((blocks, 6)), np.zeros((blocks, 6, 6)), np.zeros((blocks, 3, 3)),
        np.zeros(m), np.zeros(60),
    )  # fmt: skip
    room = Room(
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n),
        np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros((n, n)),
    )  # fmt: skip
    shapes, scales = np.zeros(blocks), np.zeros(blocks)
    y, q, dy, step_y = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    lam, h, dl, step_l, place = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    h1_zero = True
    for k in range(width):
        if _largest(h1t[k]) > 0.0:
            h1_zero = False
    # guess · G = −𝕀 where the columns of G are independent
    pinned = True
    for i in range(n):
        for j in range(n):
            number = 1.0 if i == j else 0.0
            for r in range(m):
                number += guess[i, r] * G[r, j]
            if not abs(number) < 1e-8:
                pinned = False
    for point in range(data.shape[0]):
        for i in range(n):
            q[i] = q0[i]
        for r in range(m):
            h[r] = h0[r]
        for k in range(width):
            number = data[point, k]
            for i in range(n):
                q[i] += number * q1t[k, i]
        if not h1_zero:
            for k in range(width):
                number = data[point, k]
                for r in range(m):
                    h[r] += number * h1t[k, r]
        scale = max(_largest(q), _largest(h))
        if not scale < math.inf:
            statuses[point] = NOT_FINITE
            continue
        if scale == 0.0:
            scale = 1.0
        for b in range(blocks):
            shapes[b], scales[b] = alphas[b], betas[b]
            if kinds[b] >= POWER_TERM:
                shapes[b], scales[b] = scaled_term(kinds[b], alphas[b], betas[b], scale)
        for i in range(n):
            q[i] /= scale
            y[i] = y_all[point, i] / scale if warm else 0.0
        for r in range(m):
            h[r] /= scale
            lam[r] = l_all[point, r] / scale if warm else 0.0
        if not warm:
            for i in range(n):
                number = q[i]
                for r in range(m):
                    lam[r] += number * guess[i, r]
        status, residual, count, turn = _solve_point(
            p, cones, q, h, shapes, scales, y, lam, tolerance, tau_start, limit, room, jacobian
        )
        statuses[point], residuals[point], counts[point], turns[point] = status, residual, count, turn
        for i in range(n):
            y_all[point, i] = y[i] * scale
        for r in range(m):
            l_all[point, r] = lam[r] * scale
        for k in range(width):
            value = c1[k]
            for j in range(width):
                value += C[k, j] * data[point, j]
            for i in range(n):
                value += q1t[k, i] * y_all[point, i]
            if not h1_zero:
                for r in range(m):
                    value -= h1t[k, r] * l_all[point, r]
            slopes[point, k] = value
        if want_tangent:
            _tangent(
                p, cones, q, h, y, lam, shapes, scales, q1t, h1t, h1_zero, pinned, C, dy, dl, step_y, step_l, place, room,
                jacobian, tangents[point],
            )  # fmt: skip
