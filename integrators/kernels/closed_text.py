"""The step of laws with one surface f = a q + T + R − k, affine in one deviator norm q, traces and scalar forces, as numba text.

With B = dev Σ a_k A_k at frozen internal variables, q = ‖B‖:

    elastic  f ≤ 0;
    cone     γ = f/h, h = a² w_q + w_m, valid while q ≥ γ a w_q;   dev ΔX_k = a_k γ a B/q;
    apex     γ = (f − a q)/w_m;                                    dev ΔX_k = a_k B/w_q;

and tr ΔX_k = 3 b_k γ, Δs_j = r_j γ in both; the dissipation is k γ. That the apex is right wherever the cone formula leaves q < 0 follows
from convexity. The tangent is c₀ 𝕀 + c₁ I⊗I + c₂ n⊗n + c₃ (n⊗I + I⊗n), n = B/q. Written per layout of the state, for the components
that exist and the precision of the arrays (all arithmetic is in float64); a law enters through numbers.

Coefficients: a, w_q, w_m, g_q, g_T, f at zero, k, stiffness pair, stress at zero; per tensor k_B, k_T, a_k, b_k, moduli pair; per scalar
k_s, r_j; then those of the energies of the strain. Plan: tensors, scalars, strain terms (1) or not (0), then the places in the packed
state. With -1 the numbers are those of a conjugate, −ψ* over stresses, and stress and tangent change sign: they are strain and compliance.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["closed_text", "wide"]

HEAD = 10


def wide(value: str, single: bool) -> str:
    """Text of an entry in double precision."""
    return f"np.float64({value})" if single else value


def closed_text(size: int, plan: Sequence[int], single: bool) -> str:
    """Text of `step` for tensors of `size` components; `single` for arrays of float32."""
    tensors, scalars, terms = plan[:3]
    places = plan[3:]
    n, normal = range(size), range(3)
    numbers = HEAD + 6 * tensors + 2 * scalars
    lines: list[str] = []

    def add(depth: int, *texts: str) -> None:
        lines.extend("    " * depth + t for t in texts)

    def row(prefix: str, members: Sequence[int] = n) -> str:
        return ", ".join(f"{prefix}{i}" for i in members)

    def load(depth: int) -> None:
        for first in range(0, numbers, 8):
            part = range(first, min(first + 8, numbers))
            add(depth, f"{row('c', part)} = {', '.join(f'c[{i}]' for i in part)}")
        add(depth, "h = c0 * c0 * c1 + c2")

    add(
        0, "def step(method, law, rest, eps, old, new, stress, tangent, want, dissipation, status, coefficients, plan):"
    )
    add(1, '"""One implicit step at every point; see `fenchel.integrators.kernels.closed_text`."""')
    add(1, "varying = coefficients.shape[0] > 1", "last = tangent.shape[0] - 1", f"work = np.zeros({max(size, 6)})")
    if terms > 0:
        add(1, f"scratch = np.zeros({WORK})")
        if single:
            add(1, f"strain, force, stiff = np.zeros({size}), np.zeros({size}), np.zeros({size * size})")
    add(1, "c = coefficients[0]")
    load(1)
    add(1, "for m in range(eps.shape[0]):")
    add(2, "e, x, y, s, t = eps[m], old[m], new[m], stress[m], tangent[min(m, last)]")
    add(2, "if varying:")
    add(3, "c = coefficients[m]")
    load(3)
    add(2, f"{row('e')} = {', '.join(wide(f'e[{i}]', single) for i in n)}")
    add(2, "trace = e0 + e1 + e2", "f = c5 + c4 * trace", "sphere = c9 + c8 * trace")
    add(2, f"{row('b')} = {', '.join(f'c3 * e{i}' for i in n)}")
    add(2, f"{row('s')} = {', '.join(f'c7 * e{i}' for i in n)}")
    for k in range(tensors):
        p, o = places[k], HEAD + 6 * k
        x = [f"x{k}_{i}" for i in n]
        add(2, f"{', '.join(x)} = {', '.join(wide(f'x[{p + i}]', single) for i in n)}")
        add(2, f"{row('b')} = {', '.join(f'b{i} + c{o} * {x[i]}' for i in n)}")
        add(2, f"{row('s')} = {', '.join(f's{i} + c{o + 4} * {x[i]}' for i in n)}")
        add(2, f"trace = {x[0]} + {x[1]} + {x[2]}", f"f += c{o + 1} * trace", f"sphere += c{o + 5} * trace")
    add(2, "# the deviator is removed numerically from the sum, so that its trace vanishes to rounding")
    # driven by the stress the deviator of a nearly spherical one is a direction: its trace vanishes beside itself
    for _ in range(2 if terms < 0 else 1):
        add(2, "mean = (b0 + b1 + b2) * THIRD")
        add(2, f"{row('b', normal)} = {', '.join(f'b{i} - mean' for i in normal)}")
    add(2, f"q = {' + '.join(f'b{i} * b{i}' for i in n)}")
    add(2, "if 1e-280 < q < 1e280:", "    q = math.sqrt(q)", "else:")
    add(3, f"{', '.join(f'work[{i}]' for i in n)} = {row('b')}", f"q = norm_of(work, {size})")
    for j in range(scalars):
        o = HEAD + 6 * tensors + 2 * j
        add(2, f"r{j} = {wide(f'x[{places[tensors + j]}]', single)}", f"f += c{o} * r{j}")
    add(2, "f += c0 * q", "gamma, slip, p_qq, p_qt, p_tt = 0.0, 0.0, 0.0, 0.0, 0.0", "flag = 0")
    add(2, "if not f <= 0.0:")
    add(3, "p_tt = 1.0 / h", "gamma = f * p_tt", "if not h > 0.0:", "    flag = 3")
    add(3, "if q >= gamma * c0 * c1:")
    add(4, "slip = gamma * c0 / q if q > 0.0 else 0.0", "p_qt = c0 * p_tt", "p_qq = c0 * p_qt")
    add(3, "else:")
    add(4, "slip = 1.0 / c1", "p_qq, p_tt = slip, 0.0")
    add(4, "if c2 > 0.0:", "    p_tt = 1.0 / c2", "    gamma = (f - c0 * q) / c2")
    add(4, "else:", "    gamma = q / (c0 * c1)")
    for k in range(tensors):
        p, o = places[k], HEAD + 6 * k
        add(2, f"w, flow = c{o + 2} * slip, c{o + 3} * gamma")
        for i in n:
            add(2, f"y[{p + i}] = x{k}_{i} + {f'(w * b{i} + flow)' if i < 3 else f'w * b{i}'}")
    for j in range(scalars):
        add(2, f"y[{places[tensors + j]}] = r{j} + c{HEAD + 6 * tensors + 2 * j + 1} * gamma")
    add(2, "w = c3 * slip", "sphere -= c4 * gamma")
    sign = "-" if terms < 0 else ""
    for i in n:
        body = f"s{i} - w * b{i}" + (" + sphere" if i < 3 else "")
        add(2, f"s{i} = {sign}({body})" if sign else f"s{i} = {body}")
    add(2, "dissipation[m] = gamma * c6")
    if terms <= 0:
        add(2, f"if flag == 0 and not math.isfinite({' + '.join(f's{i}' for i in n)}):", "    flag = 2")
    force = "force" if terms > 0 and single else "s"
    add(2, f"{', '.join(f'{force}[{i}]' for i in n)} = {row('s')}")
    add(2, "if want:")
    add(3, "drop = c3 * w", f"k0 = {sign}(c7 - drop)", f"k1 = {sign}(c8 + drop * THIRD - c4 * (c4 * p_tt))")
    add(3, f"k2, k3 = {sign}(drop - c3 * (c3 * p_qq)), {sign}(-c3 * (c4 * p_qt))")
    # B/q, not 1/q: a denormal q has no finite reciprocal; no product of two moduli: it may leave the range of the exponent
    add(3, "if q > 0.0:", f"    {row('b')} = {', '.join(f'b{i} / q' for i in n)}")
    add(3, f"{row('u')} = {', '.join(f'k2 * b{i}' + (' + k3' if i < 3 else '') for i in n)}")
    add(3, f"{row('d')} = {', '.join(f'k3 * b{i}' + (' + k1' if i < 3 else '') for i in n)}")
    stiff = "stiff" if terms > 0 and single else "t"
    for i in n:
        entries = [f"u{i} * b{j}" + (f" + d{i}" if j < 3 else "") + (" + k0" if i == j else "") for j in n]
        add(3, f"{', '.join(f'{stiff}[{size * i + j}]' for j in n)} = {', '.join(entries)}")
    if terms > 0:
        if single:
            add(2, f"{', '.join(f'strain[{i}]' for i in n)} = {row('e')}")
            add(2, f"rest(strain, force, scratch, c[{numbers}:], want, stiff)")
            add(2, f"{', '.join(f's[{i}]' for i in n)} = {', '.join(f'force[{i}]' for i in n)}")
            add(2, "if want:", f"    for i in range({size * size}):", "        t[i] = stiff[i]")
        else:
            add(2, f"rest(e, s, scratch, c[{numbers}:], want, t)")
        add(2, f"if flag == 0 and not math.isfinite({' + '.join(f'{force}[{i}]' for i in n)}):", "    flag = 2")
    add(2, "status[m] = flag")
    return "\n".join(lines) + "\n"


WORK = 32
"""Length of the work row of the energies of the strain."""
