"""Unilateral energies of the strain alone, added to stress and tangent, as numba text.

    w ⟨a tr ε + s⟩²          σ += 2 w a ⟨·⟩ I,              tangent += 2 w a² H(·) I⊗I;
    w tr ⟨a ε + s I⟩²        σ += 2 w a (a ε + s I)^≥,      tangent += 2 w a² D[·]^≥.

Coefficients: number of trace terms, number of spectral terms, then (w, a, s) of each.
"""

from __future__ import annotations

__all__ = ["DERIVATIVE", "POSITIVE", "terms_text"]

POSITIVE = {6: "positive_part", 4: "positive_part_plane", 3: "positive_part_axes"}
DERIVATIVE = {
    6: "add_positive_derivative",
    4: "add_positive_derivative_plane",
    3: "add_positive_derivative_axes",
}


def terms_text(size: int) -> str:
    """Text of `terms` for tensors of `size` components."""
    n = range(size)
    strain = ", ".join(f"work[{i}]" for i in n)
    shifted = ", ".join(f"a * e[{i}]" + (" + shift" if i < 3 else "") for i in n)
    return "\n".join(
        [
            "def terms(e, s, work, c, want, t):",
            '    """Add the unilateral energies of the strain; see `fenchel.integrators.kernels.terms_text`."""',
            "    o = 2",
            "    for _ in range(int(c[0])):",
            "        w, a, shift = c[o], c[o + 1], c[o + 2]",
            "        o += 3",
            "        value = a * (e[0] + e[1] + e[2]) + shift",
            "        if value > 0.0:",
            "            value, slope = 2.0 * w * a * value, 2.0 * w * a * a",
            "            s[0], s[1], s[2] = s[0] + value, s[1] + value, s[2] + value",
            "            if want:",
            *(f"                t[{size * i + j}] += slope" for i in range(3) for j in range(3)),
            "    for _ in range(int(c[1])):",
            "        w, a, shift = c[o], c[o + 1], c[o + 2]",
            "        o += 3",
            f"        {strain} = {shifted}",
            f"        {POSITIVE[size]}(work, work[12:24], work[6:12])",
            "        size = 2.0 * w * a",
            *(f"        s[{i}] += size * work[{6 + i}]" for i in n),
            "        if want:",
            f"            {DERIVATIVE[size]}(size * a, work[12:24], t)",
            "",
        ]
    )
