"""Projections on convex cones and elements of their generalised Jacobians, compiled; cones are run-time data.

    orthant          {s ≥ 0}                          second order   {‖v‖ ≤ t}, s = (t, v)
    semidefinite     3×3 ⪰ 0, Mandel components       exponential    cl {y exp(x/y) ≤ z, y > 0}, s = (x, y, z)
    power            {xᵃ y¹⁻ᵃ ≥ |z|, x, y ≥ 0}        and the duals of the last two

Duals go through Moreau's identity Π_{K*}(v) = v + Π_K(−v). On the exponential and the power cone the projection is one monotone scalar
equation, solved by Newton kept inside a shrinking bracket (Friberg 2023 for the first, Hien 2015 for the second); its Jacobian
comes from the implicit function, never from differences. At kinks the Jacobian of one neighbouring piece is taken.
"""

from __future__ import annotations

import math

from ..cache import njit
from .key import files_hash
from .spectral import eigen

__all__ = [
    "EXPONENTIAL",
    "EXPONENTIAL_DUAL",
    "ORTHANT",
    "POWER",
    "POWER_DUAL",
    "SECOND_ORDER",
    "SEMIDEFINITE",
    "project",
]

ORTHANT, SECOND_ORDER, SEMIDEFINITE, EXPONENTIAL, POWER, EXPONENTIAL_DUAL, POWER_DUAL = range(7)

_FOLDER = files_hash("cone_projection.py", "spectral.py")


@njit(folder=_FOLDER)
def second_order(v, start, size, out, jacobian):
    """Projection of v[start : start + size] into `out`; Jacobian in jacobian[:size, :size]. Returns 0 zero, 1 identity, 2 mixed."""
    t = v[start]
    largest = abs(t)
    for i in range(1, size):
        largest = max(largest, abs(v[start + i]))
    if largest == 0.0:
        for i in range(size):
            out[start + i] = 0.0
        return 0
    total = 0.0
    for i in range(1, size):
        part = v[start + i] / largest
        total += part * part
    length = largest * math.sqrt(total)
    if length <= t:
        for i in range(size):
            out[start + i] = v[start + i]
        return 1
    if length <= -t:
        for i in range(size):
            out[start + i] = 0.0
        return 0
    half = 0.5 * (t + length)
    ratio = half / length
    out[start] = half
    for i in range(1, size):
        out[start + i] = ratio * v[start + i]
    jacobian[0, 0] = 0.5
    for i in range(1, size):
        u = v[start + i] / length
        jacobian[0, i] = jacobian[i, 0] = 0.5 * u
        for j in range(1, i + 1):
            value = (0.5 - ratio) * u * v[start + j] / length
            jacobian[i, j] = value
            jacobian[j, i] = value
        jacobian[i, i] += ratio
    return 2


@njit(folder=_FOLDER)
def semidefinite_parts(v, start, out, thetas, parts, work):
    """Projection on the positive semidefinite tensors with its Jacobian Σ θ_k P_k P_kᵀ, P_k orthonormal in Mandel components.

    The six θ_k go to `thetas`, the P_k to the rows of `parts` (6, 6), those with θ_k = 0 left out of account; `work` holds at least 12 + 6
    entries. Returns 0, 1 or 2 as `second_order`, the parts being set only with 2.
    """
    root = 1.4142135623730951
    part = work[12:18]
    for i in range(6):
        part[i] = v[start + i]
    eigen(part, work)
    count = 0
    for k in range(3):
        if work[k] > 0.0:
            count += 1
    if count == 3:
        for i in range(6):
            out[start + i] = v[start + i]
        return 1
    for i in range(6):
        out[start + i] = 0.0
    if count == 0:
        return 0
    place = 0
    for k in range(3):
        for m in range(k + 1):
            a, b = work[k], work[m]
            thetas[place] = 0.0
            if a > 0.0 or b > 0.0:
                if a > 0.0 and b > 0.0:
                    thetas[place] = 1.0
                else:
                    thetas[place] = a / (a - b) if a > 0.0 else b / (b - a)
                xk, yk, zk = work[3 + k], work[6 + k], work[9 + k]
                xm, ym, zm = work[3 + m], work[6 + m], work[9 + m]
                # Mandel components of sym(n_k ⊗ n_m) of unit norm
                scale = 1.0 if k == m else root
                half = 0.5 * root * scale
                parts[place, 0] = scale * xk * xm
                parts[place, 1] = scale * yk * ym
                parts[place, 2] = scale * zk * zm
                parts[place, 3] = half * (yk * zm + zk * ym)
                parts[place, 4] = half * (xk * zm + zk * xm)
                parts[place, 5] = half * (xk * ym + yk * xm)
                if k == m:
                    for i in range(6):
                        out[start + i] += a * parts[place, i]
            place += 1
    return 2


@njit(folder=_FOLDER)
def semidefinite(v, start, out, jacobian, work):
    """As `semidefinite_parts`, with the Jacobian as a matrix; `work` holds at least 18 + 42 entries."""
    thetas, parts = work[18:24], work[24:60].reshape((6, 6))
    found = semidefinite_parts(v, start, out, thetas, parts, work)
    if found == 2:
        for i in range(6):
            for j in range(6):
                value = 0.0
                for k in range(6):
                    if thetas[k] != 0.0:
                        value += thetas[k] * parts[k, i] * parts[k, j]
                jacobian[i, j] = value
    return found


@njit(folder=_FOLDER)
def _exponential_rays(rho, near_a, near_b, x, y):
    """(a, b, a', b'): lengths along the rays (ρ, 1, e^ρ) and (1, 1 − ρ, −e^−ρ) with a p + b d = (x, y, ·), and their ρ-derivatives.

    `near_a` = ρ − (1 − y/x) for x > 0 and `near_b` = x/y − ρ for y > 0 are given apart, since they cancel in ρ.
    """
    q = rho * rho - rho + 1.0
    a = (x * near_a if x > 0.0 else y + (rho - 1.0) * x) / q
    b = (y * near_b if y > 0.0 else x - rho * y) / q
    slope = 2.0 * rho - 1.0
    return a, b, (x - slope * a) / q, (-y - slope * b) / q


@njit(folder=_FOLDER)
def _exponential_gap(rho, near_a, near_b, x, y, z):
    """ln(a e^ρ + ⟨−z⟩) − ln(b e^−ρ + ⟨z⟩), zero at the projection and increasing in ρ, with its derivative."""
    a, b, da, db = _exponential_rays(rho, near_a, near_b, x, y)
    up, down = math.exp(rho), math.exp(-rho)
    top, bottom = a * up + max(-z, 0.0), b * down + max(z, 0.0)
    if top <= 0.0:
        return -math.inf, 0.0
    if bottom <= 0.0:
        return math.inf, 0.0
    return math.log(top) - math.log(bottom), (a + da) * up / top - (db - b) * down / bottom


@njit(folder=_FOLDER)
def exponential(x, y, z, jacobian):
    """Projection of (x, y, z) on the exponential cone; returns (kind, x, y, z), kind 0 zero, 1 identity, 2 mixed."""
    if y > 0.0:
        ratio = x / y
        if ratio < 700.0 and y * math.exp(ratio) <= z:
            return 1, x, y, z
    # polar cone: x e^(y/x) ≤ −e z, x > 0
    if x > 0.0:
        ratio = y / x
        if ratio < 700.0 and x * math.exp(ratio) <= -math.e * z:
            return 0, 0.0, 0.0, 0.0
    low = 1.0 - y / x if x > 0.0 else -math.inf
    high = x / y if y > 0.0 else math.inf
    if (x <= 0.0 and y <= 0.0) or low > 690.0 or high < -690.0:
        # the faces, and what lies within e^−690 of them
        for i in range(3):
            for j in range(3):
                jacobian[i, j] = 0.0
        keep_x, keep_y, keep_z = x <= 0.0, y > 0.0 and high < -690.0, z >= 0.0
        jacobian[0, 0] = 1.0 if keep_x else 0.0
        jacobian[1, 1] = 1.0 if keep_y else 0.0
        jacobian[2, 2] = 1.0 if keep_z else 0.0
        return 2, x if keep_x else 0.0, y if keep_y else 0.0, z if keep_z else 0.0
    # ρ = low + δ or high − δ, by w = ln δ, from the end that is nearer to the root
    from_low, width = x > 0.0, math.inf
    if x > 0.0 and y > 0.0:
        width = high - low
        middle = 0.5 * (low + high)
        gap, _ = _exponential_gap(middle, 0.5 * width, 0.5 * width, x, y, z)
        from_low = gap > 0.0
        width = 0.5 * width
    origin = low if from_low else high
    sign = 1.0 if from_low else -1.0
    reach = min(width, 700.0 - sign * origin)
    bottom, top = -740.0, math.log(reach)
    w = min(0.0, top - 0.1)
    rho, near_a, near_b = 0.0, 0.0, 0.0
    for _ in range(200):
        delta = math.exp(w)
        rho = origin + sign * delta
        near_a = delta if from_low else rho - low
        near_b = high - rho if from_low else delta
        gap, slope = _exponential_gap(rho, near_a, near_b, x, y, z)
        if gap * sign > 0.0:
            top = w
        else:
            bottom = w
        slope *= sign * delta
        new = w - gap / slope if slope != 0.0 else math.nan
        if not bottom < new < top:
            new = 0.5 * (bottom + top)
        if gap == 0.0 or abs(new - w) <= 1e-16 * max(1.0, abs(w)) or not top > bottom:
            break
        w = new
    a, b, _, _ = _exponential_rays(rho, near_a, near_b, x, y)
    q = rho * rho - rho + 1.0
    up, down = math.exp(rho), math.exp(-rho)
    # differential of (a, b, ρ): columns p = (ρ, 1, e^ρ), d = (1, 1 − ρ, −e^−ρ), g = a p' + b d'; the rays p, d are orthogonal
    gx, gy, gz = a, -b, a * up + b * down
    # n = d × p is normal to both rays, so n·dv = (n·g) dρ; with it the derivative along p follows from p·(dv − g dρ) = |p|² da
    nx, ny, nz = (1.0 - rho) * up + down, -(rho * down) - up, q
    turn = nx * gx + ny * gy + nz * gz
    size = rho * rho + 1.0 + up * up
    pg = rho * gx + gy + up * gz
    for j in range(3):
        normal = nx if j == 0 else (ny if j == 1 else nz)
        along = rho if j == 0 else (1.0 if j == 1 else up)
        drho = normal / turn if turn != 0.0 else 0.0
        da = (along - pg * drho) / size
        jacobian[0, j] = rho * da + a * drho
        jacobian[1, j] = da
        jacobian[2, j] = up * (da + a * drho)
    for i in range(3):
        for j in range(i):
            value = 0.5 * (jacobian[i, j] + jacobian[j, i])
            jacobian[i, j] = value
            jacobian[j, i] = value
    if b * b * (1.0 + (1.0 - rho) ** 2 + down * down) < a * a * size:
        return 2, x - b, y - b * (1.0 - rho), max(z + b * down, 0.0)
    return 2, a * rho, a, a * up


@njit(folder=_FOLDER)
def _power_side(t, product):
    """Positive root of x² − t x − product = 0, without cancellation."""
    root = math.sqrt(t * t + 4.0 * product)
    return 0.5 * (t + root) if t >= 0.0 else 2.0 * product / (root - t)


@njit(folder=_FOLDER)
def power(x, y, z, alpha, jacobian):
    """Projection of (x, y, z) on the power cone; returns (kind, x, y, z), kind 0 zero, 1 identity, 2 mixed."""
    beta = 1.0 - alpha
    size = abs(z)
    if size == 0.0 and x >= 0.0 and y >= 0.0:
        return 1, x, y, z
    if x > 0.0 and y > 0.0 and alpha * math.log(x) + beta * math.log(y) >= math.log(size):
        return 1, x, y, z
    if x <= 0.0 and y <= 0.0:
        if size == 0.0:
            return 0, 0.0, 0.0, 0.0
        if x < 0.0 and y < 0.0 and alpha * math.log(-x / alpha) + beta * math.log(-y / beta) >= math.log(size):
            return 0, 0.0, 0.0, 0.0
    for i in range(3):
        for j in range(3):
            jacobian[i, j] = 0.0
    scale = max(abs(x), abs(y), size)
    if size <= 1e-300 or size < 1e-150 * scale:
        if x > 0.0:
            jacobian[0, 0] = 1.0
        if y > 0.0:
            jacobian[1, 1] = 1.0
        if (x > 0.0 and y > 0.0) or (x > 0.0 and y == 0.0 and alpha > 0.5) or (y > 0.0 and x == 0.0 and beta > 0.5):
            jacobian[2, 2] = 1.0
        return 2, max(x, 0.0), max(y, 0.0), 0.0
    xs, ys, zs = x / scale, y / scale, size / scale
    # r = u zs, 0 < u < 1, by w = ln(u / (1 − u)): the equation is increasing in −w over the whole line
    low, high = -690.0, 690.0
    w, u, v, xn, yn = 0.0, 0.5, 0.5, 1.0, 1.0
    for _ in range(200):
        e = math.exp(-abs(w))
        u = 1.0 / (1.0 + e) if w >= 0.0 else e / (1.0 + e)
        v = e / (1.0 + e) if w >= 0.0 else 1.0 / (1.0 + e)
        product = u * v * zs * zs
        xn, yn = _power_side(xs, alpha * product), _power_side(ys, beta * product)
        gap = alpha * math.log(xn) + beta * math.log(yn) - math.log(zs * u)
        if gap > 0.0:
            low = w
        else:
            high = w
        change = product * (v - u)
        slope = alpha * alpha * change / (xn * (2.0 * xn - xs)) + beta * beta * change / (yn * (2.0 * yn - ys)) - v
        new = w - gap / slope if slope < 0.0 else math.nan
        if not low < new < high:
            new = 0.5 * (low + high)
        if gap == 0.0 or abs(new - w) <= 1e-16 * max(1.0, abs(w)) or not high > low:
            break
        w = new
    r = u * zs
    # differentials: (2x − x₀) dx = x dx₀ + α ((z − 2r) dr + r dz), and the cone's equation α dx/x + β dy/y = dr/r
    px, py = 2.0 * xn - xs, 2.0 * yn - ys
    bend = zs * (v - u)
    bottom = 1.0 / r - alpha * alpha * bend / (xn * px) - beta * beta * bend / (yn * py)
    sign = 1.0 if z >= 0.0 else -1.0
    rx, ry = alpha / px / bottom, beta / py / bottom
    rz = (alpha * alpha * r / (xn * px) + beta * beta * r / (yn * py)) / bottom
    jacobian[0, 0] = (xn + alpha * bend * rx) / px
    jacobian[0, 1] = jacobian[1, 0] = alpha * bend * ry / px
    jacobian[1, 1] = (yn + beta * bend * ry) / py
    jacobian[0, 2] = jacobian[2, 0] = sign * rx
    jacobian[1, 2] = jacobian[2, 1] = sign * ry
    jacobian[2, 2] = rz
    return 2, scale * xn, scale * yn, sign * scale * r


@njit(folder=_FOLDER)
def project(kind, alpha, v, start, size, out, jacobian, work):
    """Projection of v[start : start + size] on the *dual* of the cone `kind`, into `out`; returns 0 zero, 1 identity, 2 mixed Jacobian.

    `work` holds at least 60 entries. Orthants need no call.
    """
    if kind == SECOND_ORDER:
        return second_order(v, start, size, out, jacobian)
    if kind == SEMIDEFINITE:
        return semidefinite(v, start, out, jacobian, work)
    x, y, z = v[start], v[start + 1], v[start + 2]
    if kind == EXPONENTIAL_DUAL:
        found, a, b, c = exponential(x, y, z, jacobian)
    elif kind == POWER_DUAL:
        found, a, b, c = power(x, y, z, alpha, jacobian)
    elif kind == EXPONENTIAL:
        found, a, b, c = exponential(-x, -y, -z, jacobian)
    else:
        found, a, b, c = power(-x, -y, -z, alpha, jacobian)
    if kind in (EXPONENTIAL_DUAL, POWER_DUAL):
        out[start], out[start + 1], out[start + 2] = a, b, c
        return found
    if found == 0:
        out[start], out[start + 1], out[start + 2] = x, y, z
        return 1
    if found == 1:
        out[start], out[start + 1], out[start + 2] = 0.0, 0.0, 0.0
        return 0
    out[start], out[start + 1], out[start + 2] = x + a, y + b, z + c
    for i in range(3):
        for j in range(3):
            jacobian[i, j] = -jacobian[i, j]
        jacobian[i, i] += 1.0
    return 2
