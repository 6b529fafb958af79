"""Numerical operators on symmetric 3×3 tensors in Mandel components, called by generated modules.

Eigenvalues and vectors by deflation: the best separated root of the characteristic polynomial in closed form, its vector as the
largest cross product, a plane rotation for the other two, Rayleigh quotients for all three. Exactly repeated eigenvalues are no
special case: the rotation of a multiple of the identity is the identity.
"""

from __future__ import annotations

import math

from ..cache import njit
from .key import kernels_hash

__all__ = ["add_positive_derivative", "norm6", "positive_part"]

_FOLDER = kernels_hash()


@njit(folder=_FOLDER, inline="never")
def norm6(a):
    """Euclidean norm of six components; the plain sum of squares unless it would leave the range of the exponent."""
    total = a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + a[3] * a[3] + a[4] * a[4] + a[5] * a[5]
    if 1e-280 < total < 1e280:
        return math.sqrt(total)
    largest = 0.0
    for i in range(6):
        size = abs(a[i])
        if not size <= largest:
            largest = size
    if largest == 0.0 or not largest < math.inf:
        return largest
    total = 0.0
    for i in range(6):
        part = a[i] / largest
        total += part * part
    return largest * math.sqrt(total)


@njit(folder=_FOLDER)
def eigen(t, out):
    """Eigenvalues in `out[0:3]`, orthonormal eigenvectors as columns of `out[3:12]` (row-major 3×3), of the Mandel tensor `t`."""
    half = 0.7071067811865476
    scale = 0.0
    for i in range(6):
        scale = max(scale, abs(t[i]))
    for i in range(12):
        out[i] = 0.0
    if scale == 0.0 or not scale < math.inf:
        out[3] = out[7] = out[11] = 1.0
        return
    a, b, c = t[0] / scale, t[1] / scale, t[2] / scale
    f, e, d = half * t[3] / scale, half * t[4] / scale, half * t[5] / scale
    mean = (a + b + c) / 3.0
    x, y, z = a - mean, b - mean, c - mean
    j2 = 0.5 * (x * x + y * y + z * z) + f * f + e * e + d * d
    if j2 < 1e-30:
        out[0], out[1], out[2] = t[0], t[1], t[2]
        out[3] = out[7] = out[11] = 1.0
        return
    j3 = x * (y * z - f * f) - d * (d * z - f * e) + e * (d * f - y * e)
    radius = math.sqrt(j2 / 3.0)
    cosine = min(1.0, abs(j3) / (2.0 * radius * radius * radius))
    # u = cos(arccos(x)/3) solves 4u³ − 3u = x in [√3/2, 1]: a cubic, 6e-5 off, and two steps of Newton's method
    u = 0.8660254 + cosine * (0.1665 + cosine * (-0.0448 + cosine * 0.0123))
    u -= ((4.0 * u * u - 3.0) * u - cosine) / (12.0 * u * u - 3.0)
    u -= ((4.0 * u * u - 3.0) * u - cosine) / (12.0 * u * u - 3.0)
    root = 2.0 * radius * u
    if j3 < 0.0:
        root = -root
    # rows of dev T − root I; their largest cross product spans the kernel
    p0, p1, p2 = x - root, y - root, z - root
    u0, u1, u2 = d * f - e * p1, e * d - p0 * f, p0 * p1 - d * d
    v0, v1, v2 = d * p2 - e * f, e * e - p0 * p2, p0 * f - d * e
    w0, w1, w2 = p1 * p2 - f * f, f * e - d * p2, d * f - p1 * e
    nu, nv, nw = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2, w0 * w0 + w1 * w1 + w2 * w2
    if nv > nu and nv >= nw:
        u0, u1, u2, nu = v0, v1, v2, nv
    elif nw > nu:
        u0, u1, u2, nu = w0, w1, w2, nw
    size = 1.0 / math.sqrt(nu)
    u0, u1, u2 = u0 * size, u1 * size, u2 * size
    # an orthonormal basis (v, w) of the complement of u
    if abs(u0) > abs(u2):
        size = 1.0 / math.sqrt(u0 * u0 + u1 * u1)
        v0, v1, v2 = -u1 * size, u0 * size, 0.0
    else:
        size = 1.0 / math.sqrt(u1 * u1 + u2 * u2)
        v0, v1, v2 = 0.0, -u2 * size, u1 * size
    w0, w1, w2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    s0, s1, s2 = a * v0 + d * v1 + e * v2, d * v0 + b * v1 + f * v2, e * v0 + f * v1 + c * v2
    r0, r1, r2 = a * w0 + d * w1 + e * w2, d * w0 + b * w1 + f * w2, e * w0 + f * w1 + c * w2
    vv, vw, ww = v0 * s0 + v1 * s1 + v2 * s2, v0 * r0 + v1 * r1 + v2 * r2, w0 * r0 + w1 * r1 + w2 * r2
    if vw != 0.0:
        ratio = (ww - vv) / (2.0 * vw)
        tangent = (1.0 if ratio >= 0.0 else -1.0) / (abs(ratio) + math.sqrt(1.0 + ratio * ratio))
        cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
        sine = tangent * cosine
        v0, w0 = cosine * v0 - sine * w0, sine * v0 + cosine * w0
        v1, w1 = cosine * v1 - sine * w1, sine * v1 + cosine * w1
        v2, w2 = cosine * v2 - sine * w2, sine * v2 + cosine * w2
        vv, ww = vv - tangent * vw, ww + tangent * vw
    uu = u0 * (a * u0 + d * u1 + e * u2) + u1 * (d * u0 + b * u1 + f * u2) + u2 * (e * u0 + f * u1 + c * u2)
    out[0], out[1], out[2] = uu * scale, vv * scale, ww * scale
    out[3], out[4], out[5] = u0, v0, w0
    out[6], out[7], out[8] = u1, v1, w1
    out[9], out[10], out[11] = u2, v2, w2


@njit(folder=_FOLDER, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def positive_part(t, eigen_, out):
    """Spectral positive part of `t` into `out`; the decomposition is left in `eigen_`. Returns Σ ⟨t_i⟩²."""
    root = 1.4142135623730951
    eigen(t, eigen_)
    for i in range(6):
        out[i] = 0.0
    total = 0.0
    if eigen_[0] >= 0.0 and eigen_[1] >= 0.0 and eigen_[2] >= 0.0:
        for i in range(6):
            out[i] = t[i]
            total += t[i] * t[i]
        return total
    for k in range(3):
        value = eigen_[k]
        if value > 0.0:
            x, y, z = eigen_[3 + k], eigen_[6 + k], eigen_[9 + k]
            out[0] += value * x * x
            out[1] += value * y * y
            out[2] += value * z * z
            out[3] += root * value * y * z
            out[4] += root * value * x * z
            out[5] += root * value * x * y
            total += value * value
    return total


@njit(folder=_FOLDER, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def add_positive_derivative(weight, eigen_, tangent):
    """Add weight · D[·]^≥ to `tangent`, a row of 36: Θ_ij = (⟨e_i⟩−⟨e_j⟩)/(e_i−e_j), and H(e_i) for equal values.

    With all but one eigenvalue positive the complement is summed, 𝕀 minus the derivative of the negative part: three dyads at most.
    """
    count = 0
    for k in range(3):
        if eigen_[k] > 0.0:
            count += 1
    if count == 0:
        return
    if count >= 2:
        for i in range(6):
            tangent[7 * i] += weight
        if count == 3:
            return
    # the eigenvalue that stands alone with its sign
    l = 0
    for k in range(3):
        if (eigen_[k] > 0.0) == (count == 1):
            l = k
    sign = weight if count == 1 else -weight
    x, y, z = eigen_[3 + l], eigen_[6 + l], eigen_[9 + l]
    for k in range(3):
        m = (l + k) % 3
        p, q, r = eigen_[3 + m], eigen_[6 + m], eigen_[9 + m]
        if k == 0:
            part, first, second = sign, 1.0, 1.4142135623730951
        else:
            part = sign * (eigen_[l] / (eigen_[l] - eigen_[m]))
            first, second = 1.4142135623730951, 1.0
        if part == 0.0:
            continue
        half = 0.5 * second if k == 0 else second
        d0, d1, d2 = first * x * p, first * y * q, first * z * r
        d3, d4, d5 = half * (y * r + z * q), half * (x * r + z * p), half * (x * q + y * p)
        for i in range(6):
            factor = part * (
                d0 if i == 0 else d1 if i == 1 else d2 if i == 2 else d3 if i == 3 else d4 if i == 4 else d5
            )
            tangent[6 * i] += factor * d0
            tangent[6 * i + 1] += factor * d1
            tangent[6 * i + 2] += factor * d2
            tangent[6 * i + 3] += factor * d3
            tangent[6 * i + 4] += factor * d4
            tangent[6 * i + 5] += factor * d5
