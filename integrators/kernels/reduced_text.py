"""The step of a law as a projection of a few numbers, as numba text: trial values, the projection by a method, then tensors again.

With B = Σ a_k A_k at frozen internal variables the trial numbers are z = (‖dev B‖, T, R), T_i = Σ b_ik tr A_k (kind 0), or the
principal values of B in descending order and R (kind 1). The method returns the increments e conjugate to z and P = ∂e/∂z^tr; then,
with n = dev B/‖dev B‖,

    kind 0   ΔX_k = a_k e_q n + Σ b_ik e_i I,    tangent c₀ 𝕀 + c₁ I⊗I + c₂ n⊗n + c₃ (n⊗I + I⊗n);
    kind 1   ΔX_k = a_k Σ e_i n_i⊗n_i,           tangent by P and (e_i − e_j)/(b_i − b_j), no eigenvector derivative.

P is symmetric, the Hessian of an envelope. Written per layout of the state and kind, for the components that exist and the precision
of the arrays; a law enters through numbers and the method through a pointer. Points are taken in blocks of `BLOCK`.

Plan: see `plan`. Coefficients: stiffness pair, stress at zero, pair ∂B/∂ε, B at zero; per tensor pair ∂B/∂X_k, moduli pair, a_k; per
trace ∂T/∂(tr ε), T at zero, and per tensor ∂T/∂(tr X_k), b_k; per scalar force R at zero and ∂R/∂s; then what method and strain
terms read.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..plan import (
    FROZEN,
    KIND,
    METRIC,
    MOVING,
    NORM,
    PLACES,
    SCALAR_START,
    SCALARS,
    STRAIN,
    STRAIN_START,
    TENSORS,
    TRACE_START,
    TRACES,
    UNKNOWNS,
)
from .closed_text import WORK, wide

__all__ = ["BLOCK", "reduced_text", "trial_text"]

BLOCK = 64
PAIRS = ((1, 2), (2, 0), (0, 1))
EIGEN = {6: "eigen", 4: "eigen_plane", 3: "eigen_axes"}
# component of sym(v_l ⊗ v_m) in the rows of the vectors, by the place of the component among six
ROWS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
COMPONENTS = {6: (0, 1, 2, 3, 4, 5), 4: (0, 1, 2, 5), 3: (0, 1, 2)}


class _Text:
    """Lines of one function; `plan` and sizes are known when it is written."""

    def __init__(self, size: int, plan: Sequence[int], single: bool) -> None:
        self.size, self.plan, self.single = size, plan, single
        self.n = range(size)
        self.unknowns, self.tensors, self.scalars = plan[UNKNOWNS], plan[TENSORS], plan[SCALARS]
        self.traces, self.moving, self.frozen, self.norm = plan[TRACES], plan[MOVING], plan[FROZEN], plan[NORM]
        self.principal = plan[KIND] == 1
        self.places = plan[PLACES:]
        self.lines: list[str] = []

    def add(self, depth: int, *texts: str) -> None:
        self.lines.extend("    " * depth + t for t in texts)

    def trace_start(self, i: int) -> int:
        return self.plan[TRACE_START] + (2 + 2 * self.tensors) * i

    def old(self, k: int) -> str:
        """Old values of tensor k as locals."""
        p = self.places[k]
        return f"{', '.join(f'x{i}' for i in self.n)} = {', '.join(wide(f'x[{p + i}]', self.single) for i in self.n)}"

    # -- trial numbers -----------------------------------------------------------------------------------------------------

    def trial(self, depth: int) -> None:
        n, add = self.n, self.add
        add(depth, f"{', '.join(f'e{i}' for i in n)} = {', '.join(wide(f'e[{i}]', self.single) for i in n)}")
        if self.principal or self.traces:
            add(depth, "trace = e0 + e1 + e2")
        for i in range(self.traces):
            add(depth, f"t{i} = c[{self.trace_start(i) + 1}] + c[{self.trace_start(i)}] * trace")
        whole = self.principal or self.norm
        if whole:
            add(depth, f"{', '.join(f'b{i}' for i in n)} = {', '.join(f'c[3] * e{i}' for i in n)}")
        if self.principal:
            add(depth, "sphere = c[5] + c[4] * trace")
        for k in range(self.tensors):
            o = 6 + 5 * k
            add(depth, self.old(k))
            if whole:
                add(
                    depth,
                    f"w = c[{o}]",
                    f"{', '.join(f'b{i}' for i in n)} = {', '.join(f'b{i} + w * x{i}' for i in n)}",
                )
            if self.principal or self.traces:
                add(depth, "trace = x0 + x1 + x2")
            if self.principal:
                add(depth, f"sphere += c[{o + 1}] * trace")
            for i in range(self.traces):
                add(depth, f"t{i} += c[{self.trace_start(i) + 2 + 2 * k}] * trace")
        if self.principal:
            self._principal_trial(depth)
        elif self.norm:
            # twice: what rounding of a large mean leaves is no part of a small deviator
            for _ in range(2):
                add(depth, "mean = (b0 + b1 + b2) * THIRD", "b0, b1, b2 = b0 - mean, b1 - mean, b2 - mean")
            add(depth, "b = blocks[i]", f"{', '.join(f'b[{i}]' for i in n)} = {', '.join(f'b{i}' for i in n)}")
            add(depth, f"q = {' + '.join(f'b{i} * b{i}' for i in n)}")
            add(depth, f"trial[i, 0] = math.sqrt(q) if 1e-280 < q < 1e280 else norm_of(b, {self.size})")
        for i in range(self.traces):
            add(depth, f"trial[i, {self.norm + i}] = t{i}")
        head = self.unknowns - self.moving
        scalars = self.places[self.tensors :]
        for j in range(self.moving):
            o = self.plan[SCALAR_START] + (1 + self.scalars) * j
            sums = "".join(f" + c[{o + 1 + i}] * x[{scalars[i]}]" for i in range(self.scalars))
            add(depth, f"trial[i, {head + j}] = c[{o}]{sums}")
        for j in range(self.moving + self.frozen):
            add(depth, f"trial[i, {self.unknowns + j}] = x[{scalars[self.scalars + j]}]")

    def _principal_trial(self, depth: int) -> None:
        add, n = self.add, self.n
        add(depth, "b, a = blocks[i], axes[i]")
        add(
            depth,
            f"{', '.join(f'b[{i}]' for i in n)} = {', '.join(f'b{i}' + (' + sphere' if i < 3 else '') for i in n)}",
        )
        add(depth, f"{EIGEN[self.size]}(b, a)", "descending(a)")
        add(depth, "trial[i, 0], trial[i, 1], trial[i, 2] = a[0], a[1], a[2]")

    # -- from the projection back to tensors ---------------------------------------------------------------------------------

    def finish(self, depth: int) -> None:
        n, add, size = self.n, self.add, self.size
        count = self.unknowns
        add(depth, f"{', '.join(f'e{i}' for i in n)} = {', '.join(wide(f'e[{i}]', self.single) for i in n)}")
        add(depth, "trace = e0 + e1 + e2", "sphere = c[2] + c[1] * trace")
        add(depth, f"{', '.join(f's{i}' for i in n)} = {', '.join(f'c[0] * e{i}' for i in n)}")
        lost = " + ".join(f"f[{j}] * f[{count + j}]" for j in range(count)) or "0.0"
        add(depth, f"dissipation[m] = {lost}")
        if self.principal:
            first, step = 2 * count, count + 1
            add(depth, "f0, f1, f2 = f[0], f[1], f[2]")
            flat = ["f0", "f1", "f2", *(f"f[{first + step * k}]" for k in range(3))]
            add(depth, f"live = {' or '.join(f'{v} != 0.0' for v in flat)}")
            zeros = [*(f"g{i}" for i in n), *(f"d{k}{i}" for k in range(3) for i in n)]
            zeros += [f"v{k}{r}" for k in range(3) for r in range(3)]
            add(depth, f"{' = '.join(zeros)} = 0.0", "if live:")
            self._dyads(depth + 1)
            add(depth + 1, *(f"g{i} = f0 * d0{i} + f1 * d1{i} + f2 * d2{i}" for i in n))
        elif self.norm:
            self._slip(depth)
            add(depth, f"{', '.join(f'g{i}' for i in n)} = {', '.join(f'slip * b{i}' for i in n)}")
        flows = self.principal or self.norm
        for k in range(self.tensors):
            p, o = self.places[k], 6 + 5 * k
            parts = [f"c[{self.trace_start(j) + 3 + 2 * k}] * f[{self.norm + j}]" for j in range(self.traces)]
            if parts:
                add(depth, f"ball = {' + '.join(parts)}")
            add(depth, self.old(k))
            if flows:
                add(depth, f"w = c[{o + 4}]")
            for i in n:
                flow = f"w * g{i}" if flows else ""
                ball = "ball" if parts and i < 3 else ""
                joined = " + ".join(t for t in (flow, ball) if t)
                if joined:
                    add(depth, f"x{i} += {joined}")
            add(depth, f"{', '.join(f'y[{p + i}]' for i in n)} = {', '.join(f'x{i}' for i in n)}")
            add(depth, f"w = c[{o + 2}]")
            add(depth, f"{', '.join(f's{i}' for i in n)} = {', '.join(f's{i} + w * x{i}' for i in n)}")
            add(depth, f"sphere += c[{o + 3}] * (x0 + x1 + x2)")
        places = self.places[self.tensors :]
        for j in range(self.scalars):
            add(depth, f"y[{places[j]}] = x[{places[j]}]")
        head = count - self.moving
        for j in range(self.moving):
            p = places[self.scalars + j]
            add(depth, f"y[{p}] = x[{p}] + f[{head + j}]")
        add(depth, "s0, s1, s2 = s0 + sphere, s1 + sphere, s2 + sphere")
        terms = self.plan[STRAIN]
        sign = "-" if terms < 0 else ""
        separate = terms > 0 and self.single
        force, stiff = ("force", "stiff") if separate else ("s", "t")
        add(depth, f"{', '.join(f'{force}[{i}]' for i in n)} = {', '.join(f'{sign}s{i}' for i in n)}")
        add(depth, "if want:")
        if self.principal:
            add(depth + 1, "if live:")
            self._principal_tangent(depth + 2, stiff, sign)
            add(depth + 1, "else:")
            self._isotropic(depth + 2, stiff, f"{sign}c[0]", f"{sign}c[1]")
        else:
            self._norm_tangent(depth + 1, stiff, sign)
        if terms > 0:
            start = self.plan[STRAIN_START]
            if separate:
                add(depth, f"{', '.join(f'strain[{i}]' for i in n)} = {', '.join(f'e{i}' for i in n)}")
                add(depth, f"rest(strain, force, scratch, c[{start}:], want, stiff)")
                add(depth, f"{', '.join(f's[{i}]' for i in n)} = {', '.join(f'force[{i}]' for i in n)}")
                add(depth, "if want:", f"    for j in range({size * size}):", "        t[j] = stiff[j]")
            else:
                add(depth, f"rest(e, s, scratch, c[{start}:], want, t)")
        total = " + ".join(f"{force}[{i}]" for i in n)
        add(depth, f"if status[m] == 0 and not math.isfinite({total} + dissipation[m]):", "    status[m] = 2")

    def _slip(self, depth: int) -> None:
        """e_q/q; where the deviator is rounding of the strain it is taken at its limit P_qq."""
        add, n, metric = self.add, self.n, self.plan[METRIC]
        add(depth, "b, q = blocks[i], trial[i, 0]")
        add(depth, f"{', '.join(f'b{i}' for i in n)} = {', '.join(f'b[{i}]' for i in n)}")
        add(depth, f"size = max({', '.join(f'abs(e{i})' for i in n)})", f"slip = f[{2 * self.unknowns}]")
        add(depth, "if q > 1e-13 * abs(c[3]) * size and abs(f[0]) < 1e280 * q:", "    slip = f[0] / q")
        add(depth, f"if c[{metric}] > 0.0:", f"    slip = min(max(slip, 0.0), 1.0 / c[{metric}])")

    def _dyads(self, depth: int) -> None:
        add = self.add
        add(depth, "a = axes[i]")
        for k in range(3):
            add(depth, f"v{k}0, v{k}1, v{k}2 = a[{3 + k}], a[{6 + k}], a[{9 + k}]")
            for i, place in enumerate(COMPONENTS[self.size]):
                r, s = ROWS[place]
                add(depth, f"d{k}{i} = {'' if r == s else 'ROOT * '}v{k}{r} * v{k}{s}")

    def _norm_tangent(self, depth: int, stiff: str, sign: str) -> None:
        add, n, size, count = self.add, self.n, self.size, self.unknowns
        first = 2 * count
        slopes = [f"c[{self.trace_start(i)}]" for i in range(self.traces)]
        cross = [f"{g} * f[{first + count * (self.norm + i)}]" for i, g in enumerate(slopes)] if self.norm else []
        ball = [
            f"{g} * ({h} * f[{first + count * (self.norm + i) + self.norm + j}])"
            for i, g in enumerate(slopes)
            for j, h in enumerate(slopes)
        ]
        add(depth, f"ball = {' + '.join(ball) or '0.0'}")
        if not self.norm:
            self._isotropic(depth, stiff, f"{sign}c[0]", f"{sign}(c[1] - ball)")
            return
        add(depth, f"cross = {' + '.join(cross) or '0.0'}", "drop = c[3] * (c[3] * slip)", "k2, k3 = 0.0, 0.0")
        add(depth, f"k0, k1 = {sign}(c[0] - drop), {sign}(c[1] + drop / 3.0 - ball)")
        add(depth, "if q > 0.0:")
        add(depth + 1, f"k2, k3 = {sign}(drop - c[3] * (c[3] * f[{first}])), {sign}(-c[3] * cross)")
        add(depth + 1, f"{', '.join(f'b{i}' for i in n)} = {', '.join(f'b{i} / q' for i in n)}")
        add(
            depth,
            f"{', '.join(f'u{i}' for i in n)} = {', '.join(f'k2 * b{i}' + (' + k3' if i < 3 else '') for i in n)}",
        )
        add(
            depth,
            f"{', '.join(f'h{i}' for i in n)} = {', '.join(f'k3 * b{i}' + (' + k1' if i < 3 else '') for i in n)}",
        )
        for i in n:
            entries = [f"u{i} * b{j}" + (f" + h{i}" if j < 3 else "") + (" + k0" if i == j else "") for j in n]
            add(depth, f"{', '.join(f'{stiff}[{size * i + j}]' for j in n)} = {', '.join(entries)}")

    def _isotropic(self, depth: int, stiff: str, c0: str, c1: str) -> None:
        """c₀ 𝕀 + c₁ I⊗I."""
        self.add(depth, f"k0, k1 = {c0}, {c1}")
        for i in self.n:
            entries = ["k1 + k0" if i == j else "k1" if i < 3 and j < 3 else "0.0" for j in self.n]
            entries = ["k0" if i == j and i > 2 else e for j, e in enumerate(entries)]
            self.add(depth, f"{', '.join(f'{stiff}[{self.size * i + j}]' for j in self.n)} = {', '.join(entries)}")

    def _principal_tangent(self, depth: int, stiff: str, sign: str) -> None:
        """C − G P G with G = g₀ 𝕀 + g₁ I⊗I in principal values, and the quotients on the mixed dyads."""
        add, n, size, count = self.add, self.n, self.size, self.unknowns
        first = 2 * count
        pairs = PAIRS if size > 3 else ()  # a diagonal tensor has no mixed components
        names = {(k, l): f"p{min(k, l)}{max(k, l)}" for k in range(3) for l in range(3)}
        add(depth, "g_0, g_1 = c[3], c[4]")
        if pairs:
            metric = self.plan[METRIC]
            add(depth, f"own = c[{metric}] - c[{metric + 1}]", "most = 1.0 / own if own > 0.0 else math.inf")
        for k in range(3):
            add(depth, *(f"p{k}{l} = f[{first + count * k + l}]" for l in range(k, 3)))
        add(depth, *(f"z{k} = {' + '.join(names[k, l] for l in range(3))}" for k in range(3)))
        add(depth, "total = g_1 * (g_1 * (z0 + z1 + z2))")
        for k, l in pairs:
            add(
                depth,
                f"q{k}{l} = theta(a[{k}], a[{l}], f{k}, f{l}, {names[k, k]}, {names[l, l]}, {names[k, l]}, size_of(a), most)",
            )
        for k in range(3):
            add(
                depth,
                *(f"{names[k, l]} = g_0 * (g_0 * {names[k, l]} + g_1 * (z{k} + z{l})) + total" for l in range(k, 3)),
            )
        for k, l in pairs:
            add(depth, f"q{k}{l} = g_0 * (g_0 * q{k}{l})")
            for i, place in enumerate(COMPONENTS[size]):
                r, s = ROWS[place]
                body = f"ROOT * v{k}{r} * v{l}{r}" if r == s else f"v{k}{r} * v{l}{s} + v{k}{s} * v{l}{r}"
                add(depth, f"m{k}{l}{i} = {body}")
        for j in n:
            for k in range(3):
                terms = " + ".join(f"{names[k, l]} * d{l}{j}" for l in range(3))
                add(depth, f"r{k} = {terms}")
            add(depth, *(f"w{k}{l} = q{k}{l} * m{k}{l}{j}" for k, l in pairs))
            for i in range(j + 1):
                terms = [f"d{k}{i} * r{k}" for k in range(3)] + [f"m{k}{l}{i} * w{k}{l}" for k, l in pairs]
                iso = (["c[0]"] if i == j else []) + (["c[1]"] if i < 3 and j < 3 else [])
                value = f"{' + '.join(iso)} - ({' + '.join(terms)})" if iso else f"-({' + '.join(terms)})"
                value = f"-({value})" if sign else value
                mirror = f" = {stiff}[{size * j + i}]" if i != j else ""
                add(depth, f"{stiff}[{size * i + j}]{mirror} = {value}")

    def whole(self) -> str:
        add, count, size = self.add, self.unknowns, self.size
        arguments = "method, law, rest, eps, old, new, stress, tangent, want, dissipation, status, coefficients, plan"
        add(0, f"def step({arguments}):")
        add(1, '"""One implicit step at every point; see `fenchel.integrators.kernels.reduced_text`."""')
        add(1, f"count = min(eps.shape[0], {BLOCK})", "last = tangent.shape[0] - 1")
        add(1, "varying = 1 if coefficients.shape[0] > 1 else 0")
        add(1, f"trial = np.zeros((count, {count + self.moving + self.frozen + 1}))")
        add(1, f"found = np.zeros((count, {2 * count + count * count + 1}))")
        if self.principal or self.norm:
            add(1, f"blocks = np.zeros((count, {size}))")
        if self.principal:
            add(1, "axes = np.zeros((count, 12))")
        if self.plan[STRAIN] > 0:
            add(1, f"scratch = np.zeros({WORK})")
            if self.single:
                add(1, f"strain, force, stiff = np.zeros({size}), np.zeros({size}), np.zeros({size * size})")
        add(1, f"for start in range(0, eps.shape[0], {BLOCK}):")
        add(2, f"block = min({BLOCK}, eps.shape[0] - start)", "for i in range(block):", "    m = start + i")
        add(3, "c, e, x = coefficients[varying * m], eps[m], old[m]")
        self.trial(3)
        add(2, "method(law, trial, coefficients, varying * start, plan, found, status[start : start + block], block)")
        add(2, "for i in range(block):", "    m = start + i", "    c, f = coefficients[varying * m], found[i]")
        add(3, "e, x, y, s, t = eps[m], old[m], new[m], stress[m], tangent[min(m, last)]")
        self.finish(3)
        return "\n".join(self.lines) + "\n"


def trial_text(size: int, plan: Sequence[int]) -> str:
    """Text of `trials`, the first part of a reduced step alone: trial numbers, B and its eigenvalues at every point."""
    text = _Text(size, plan, False)
    text.add(0, "def trials(eps, old, coefficients, trial, blocks, axes):")
    text.add(1, '"""Trial numbers at every point; see `fenchel.integrators.kernels.reduced_text`."""')
    text.add(1, "varying = 1 if coefficients.shape[0] > 1 else 0", "for i in range(eps.shape[0]):")
    text.add(2, "c, e, x = coefficients[varying * i], eps[i], old[i]")
    text.trial(2)
    return "\n".join(text.lines) + "\n"


def reduced_text(size: int, plan: Sequence[int], single: bool) -> str:
    """Text of `step` for tensors of `size` components; `single` for arrays of float32."""
    return _Text(size, plan, single).whole()
