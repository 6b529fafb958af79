r"""Global homotopy: the curve of interior points that leads from any start to a solution, followed through its turning points.

    G(x, y, τ) = y − W̄x − q̄ − (s(y, τ) − κτ) e₀ − τR₀ = 0 ,   x∘y = τ g₀ e ,   s = √(‖y_T‖² + κ²τ²) ,

holds at τ = 1 by the choice of R₀ and g₀, and at τ = 0 is the problem itself. Without friction the curve is monotone in τ and any interior
point method follows it. With friction it turns back, often dozens of times: methods that only decrease τ stall there, as a complementary
pivoting scheme without its artificial variable would (Lemke 1965). Here τ is a coordinate like the others: tangent, curvature and
correction come from one factorisation of A = W̄ + (I − E)P², and the side to go is the sign of det A, which is constant times dτ/ds along
one curve (Chow, Mallet-Paret and Yorke 1978; Allgower and Georg 1990).

Why the curve arrives: for symmetric W and q = w + Hᵀv with w·r ≥ 0 on K (gaps, no driven squeezing), the energy x·y = τ g₀ n bounds x for
every τ > 0, so that generically the curve reaches every small τ; as τ → 0 it has a solution as limit, or the reactions grow beyond
all bounds and there are only approximate ones.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .cones import Folded, follow, jordan, right_side, scale_cones, to_local, unfold
from .linear import BlockSystem
from .monitor import Monitor
from .newton import polish
from .sweeps import product

__all__ = ["solve_homotopy"]

Array = NDArray[np.float64]

_KAPPA = 1.0
_LONGEST = 0.7  # step along the curve, in the local norm of the worst contact
_TIGHT = 0.2  # correction, in the same norm, up to which a point counts as on the curve
_TIGHTEST = 0.002  # how far that bound is lowered where the curve turns sharply
_LOOSE = 0.6  # correction up to which it may be brought there; beyond, the step is repeated at half its length
_SHORTEST = 1e-4  # step below which the curve counts as lost
_TRAIL, _CALM = 10, 40  # points kept to go back to; points after which the bound is relaxed again


@dataclass
class _Point:
    x: Array
    y: Array
    tau: float
    residual: Array  # G
    lack: Array  # τ g₀ e − λ∘λ


class _Curve:
    """The homotopy of one problem from x₀ = y₀ = start e₀."""

    def __init__(self, blocks: Blocks, start: float) -> None:
        n = len(blocks.mu)
        self.blocks, self.work, self.system = blocks, Folded(blocks), BlockSystem(blocks)
        x = np.zeros((n, 3))
        x[:, 0] = start
        self.g0, self.r0 = start * start, np.zeros((n, 3))
        self.pa, self.pb, self.c, self.b = (np.empty((n, 3)) for _ in range(4))
        first = self.point(x, x.copy(), 1.0)
        if first is None:
            raise np.linalg.LinAlgError("the start is no interior point")
        self.r0 = first.residual
        first.residual = np.zeros((n, 3))
        self.first = first

    def point(self, x: Array, y: Array, tau: float) -> _Point | None:
        """The point with its residuals and scaling, or None outside the cones."""
        w, b = self.work, self.blocks
        if not scale_cones(x, y, _KAPPA * tau, w.root, w.square, w.block, w.middle, w.slope, w.slip):
            return None
        residual, lack = np.empty_like(x), np.empty_like(x)
        product(b.pointer, b.column, w.value, w.q, x, residual)
        residual = y - residual - tau * self.r0
        residual[:, 0] -= w.slip - _KAPPA * tau
        jordan(w.middle, w.middle, lack)
        np.negative(lack, out=lack)
        lack[:, 0] += tau * self.g0
        return _Point(x, y, tau, residual, lack)

    def near(self, at: _Point) -> bool:
        """Whether the residuals of the point scaled last are below its own distance to the boundary."""
        to_local(self.work.root, at.residual, at.residual, self.pa, self.pb)
        size = at.tau * self.g0
        lack = np.sqrt(np.max(np.einsum("ij,ij->i", at.lack, at.lack)))
        gap = np.sqrt(np.max(np.einsum("ij,ij->i", self.pb, self.pb)))
        return bool(lack <= size and gap <= np.sqrt(size))

    def factorise(self) -> None:
        value = self.work.value.copy()
        value[self.blocks.place] += self.work.block
        self.system.factorise(value)

    def step(self, v: Array, g: Array) -> tuple[Array, Array]:
        """dx, dy of the linear system for a lack v and a residual g."""
        w = self.work
        right_side(w.middle, w.root, w.slope, v, g, self.c, self.b)
        dx = self.system.solve(self.b)
        dy = np.empty_like(dx)
        follow(w.root, w.square, self.c, dx, dy)
        return dx, dy


@dataclass
class _Expansion:
    """The curve near a point: correction, and first and second derivative with respect to log τ and arc length."""

    at: _Point
    dx: Array
    dy: Array
    dl: float
    vx: Array
    vy: Array
    ax: Array
    ay: Array
    al: float
    speed: float
    side: float

    def ahead(self, delta: float, share: float = 1.0) -> tuple[Array, Array, float]:
        """The point predicted at the distance `delta`, with a share of the correction."""
        s = self.side * delta / max(self.speed, 1.0)
        h = 0.5 * s * s
        change = share * self.dl + s + h * self.al
        tau = self.at.tau * (1.0 + change) if change > -0.9 else 0.1 * self.at.tau
        x = self.at.x + share * self.dx + s * self.vx + h * self.ax
        return x, self.at.y + share * self.dy + s * self.vy + h * self.ay, tau


def _expand(curve: _Curve, at: _Point) -> tuple[_Expansion, float]:
    """Expansion at a point just scaled and factorised, and the length of the correction in the local norm; `side` is left to the caller."""
    w, n = curve.work, len(at.x)
    size = at.tau * curve.g0
    drift = -at.tau * curve.r0
    drift[:, 0] -= _KAPPA * _KAPPA * at.tau**2 / w.slip - _KAPPA * at.tau
    target = np.zeros_like(at.x)
    target[:, 0] = size
    vx, vy = curve.step(target, drift)
    dx, dy = curve.step(at.lack, at.residual)
    va, vb = np.empty_like(vx), np.empty_like(vx)
    squared, worst = to_local(w.root, vx, vy, va, vb)
    to_local(w.root, dx, dy, curve.pa, curve.pb)
    norm = size + squared
    dl = -float(np.vdot(va, curve.pa) + np.vdot(vb, curve.pb)) / norm
    dx += dl * vx
    dy += dl * vy
    length = to_local(w.root, dx, dy, curve.pa, curve.pb)[1] / np.sqrt(size)
    # second derivative: of the smoothed ‖y_T‖ in G, of the product x∘y in the complementarity
    width = _KAPPA * at.tau
    along = np.einsum("ij,ij->i", w.slope, vy[:, 1:]) + width * width / w.slip
    bend = np.zeros((n, 3))
    bend[:, 0] = -(vy[:, 1] ** 2 + vy[:, 2] ** 2 + width * width - along**2) / w.slip
    jordan(va, vb, target)
    ax, ay = curve.step(-2.0 * target, bend)
    to_local(w.root, ax, ay, curve.pa, curve.pb)
    al = -float(np.vdot(va, curve.pa) + np.vdot(vb, curve.pb)) / norm
    ax += al * vx
    ay += al * vy
    return _Expansion(at, dx, dy, dl, vx, vy, ax, ay, al, worst / np.sqrt(size), 1.0), length


def solve_homotopy(blocks: Blocks, monitor: Monitor, *, limit: int = 1_000_000, start: float = 1.0) -> None:
    """Follow the curve from a cold start, polishing by Newton's method once per decade of τ below 1e-6; `limit` counts factorisations."""
    curve = _Curve(blocks, start)
    at = curve.point(curve.first.x, curve.first.y, 1.0)
    trail: deque[_Expansion] = deque(maxlen=_TRAIL)
    delta, tight, forward, next_polish = 0.5, _TIGHT, 0, 1e-6
    corrections, before, calm = 0, np.inf, 0
    for _ in range(limit):
        if at is None or monitor.out_of_time:
            return
        try:
            curve.factorise()
            monitor.factorisations += 1
            fresh, length = _expand(curve, at)
        except np.linalg.LinAlgError:
            fresh, length = None, np.inf
        if fresh is not None and (not trail or length <= tight):
            sign = curve.system.sign()
            forward = forward or sign
            fresh.side = -1.0 if sign == forward else 1.0
            if trail:
                easy = corrections == 0 and length < 0.5 * tight
                delta = min(_LONGEST, delta * (2.0 if easy else 1.2 if corrections < 2 else 0.7))
            calm += 1
            if calm > _CALM and tight < _TIGHT:
                tight, calm = min(_TIGHT, 4.0 * tight), 0
            trail.append(fresh)
            corrections, before = 0, np.inf
            if monitor(unfold(at.x, blocks.mu)):
                return
            if at.tau < next_polish and fresh.side < 0.0:
                next_polish = 0.1 * at.tau
                polish(blocks, monitor, limit=25, start=unfold(at.x, blocks.mu))
                if monitor.converged:
                    return
            at = _advance(curve, fresh, delta)
        elif fresh is not None and length <= min(_LOOSE, 0.7 * before) and corrections < 4:
            corrections, before = corrections + 1, length
            at = _advance(curve, fresh, 0.0, min(1.0, 0.3 / length))
        else:
            at = None
        while at is None and trail:
            delta, corrections, before = 0.5 * delta, 0, np.inf
            if delta < _SHORTEST:
                # the last points have left the curve without a word: go back some way, and keep closer to it from there
                if tight <= _TIGHTEST:
                    return
                tight, calm, delta = 0.25 * tight, 0, 0.1
                back = trail[0]
                trail.clear()
                trail.append(back)
            at = _advance(curve, trail[-1], delta)


def _advance(curve: _Curve, base: _Expansion, delta: float, share: float = 1.0) -> _Point | None:
    at = curve.point(*base.ahead(delta, share))
    return at if at is not None and curve.near(at) else None
