"""Units in which a small cone program is well conditioned: of its unknowns, and of the rows of every cone.

Unknowns that the quadratic curves are whitened; cones are measured by their images; unknowns without curvature get the unit in which
they meet a cone. Rows of one cone share a unit, except in exponential and power cones, which have a constant and a costed entry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .canonical import Cone
from .cone_projection import EXPONENTIAL, EXPONENTIAL_DUAL, ORTHANT, POWER, POWER_DUAL

__all__ = ["NaturalUnits", "cleaned", "natural_units"]

Array = NDArray[np.float64]
CURVED = 1e-13
NOISE = 1e-11  # of an image over the sizes of row and column: what eigenvectors leave of a product that is zero


def cleaned(vectors: Array) -> Array:
    """Rounding noise off orthonormal columns: unknowns of other units must not leak into them."""
    return np.where(np.abs(vectors) < 1e-14, 0.0, vectors)


@dataclass(frozen=True)
class NaturalUnits:
    """x = `columns` y, row r of G and h divided by `rows`[r], P = diag(`curvature`) with entries 1 and 0; `unbounded` if the slope pulls
    along a direction that neither curves nor meets a cone."""

    columns: Array
    rows: Array
    curvature: Array
    unbounded: bool


def natural_units(
    N: Array, costed: Array, P: Array, G: Array, h: Array, slopes: Array, cones: Sequence[Cone]
) -> NaturalUnits:
    """Units for x in the span of the orthonormal columns of `N` and of the unit columns `costed`, unknowns that meet one entry of an
    exponential or power cone and nothing else; `slopes` (n, ·): first the constant linear term, then those by the data."""
    P = N.T @ P @ N
    values, vectors = np.linalg.eigh(0.5 * (P + P.T)) if P.size else (np.zeros(0), np.zeros((0, 0)))
    strong = values > CURVED * max(float(values.max(initial=0.0)), 1e-300)
    basis = cleaned(N @ vectors)
    measured = basis[:, strong] / np.sqrt(values[strong])
    free = basis[:, ~strong]
    plain = np.zeros(G.shape[0], dtype=bool)
    start = 0
    for cone in cones:
        plain[start : start + cone.size] = cone.kind not in (EXPONENTIAL, EXPONENTIAL_DUAL, POWER, POWER_DUAL)
        start += cone.size
    # cones are measured by the unknowns that have a unit, then free unknowns by the cones that have one, in turn
    blocks = _block_norms(_images(G, measured), cones)
    count = int(strong.sum())
    while free.shape[1]:
        known = plain & (blocks > 0.0)
        if not known.any():
            known = plain & (_block_norms(_images(G, free), cones) > 0.0)
            blocks[known] = 1.0
        found, free = _normalised(G[known] / blocks[known, None], free)
        if not found.shape[1]:
            break
        measured = np.hstack([measured, found])
        blocks = np.where(blocks > 0.0, blocks, _block_norms(_images(G, measured), cones))
    blocks[blocks == 0.0] = 1.0
    # the rest meets exponential and power cones only
    _balance(blocks, cones, G, h, np.hstack([measured, free]), costed, slopes[:, 0])
    last, free = _normalised(G / blocks[:, None], free)
    images = np.abs(G / blocks[:, None] @ costed).max(axis=0, initial=0.0)
    measured = np.hstack([measured, last, costed / images])
    pull = free.T @ slopes
    return NaturalUnits(
        measured,
        blocks,
        np.concatenate([np.ones(count), np.zeros(measured.shape[1] - count)]),
        bool(np.abs(pull).max(initial=0.0) > 1e-9 * np.abs(slopes).max(initial=0.0)),
    )


def _normalised(G: Array, free: Array) -> tuple[Array, Array]:
    """Directions of span(free) with orthonormal images under G, and an orthonormal basis of those without image."""
    images = _images(G, free)
    if not images.size:
        return free[:, :0], free
    _, s, vt = np.linalg.svd(images)
    size = np.zeros(free.shape[1])
    size[: s.size] = s
    live = size > 1e-9 * max(float(s.max(initial=0.0)), 1e-300)
    return cleaned(free @ vt[live].T) / size[live], cleaned(free @ vt[~live].T)


def _images(G: Array, columns: Array) -> Array:
    """G times columns, without the noise: a cone that an unknown does not meet must not be measured by it."""
    found = G @ columns
    size = np.linalg.norm(G, axis=1)[:, None] * np.linalg.norm(columns, axis=0)[None, :]
    found[np.abs(found) <= NOISE * size] = 0.0
    return found


def _block_norms(G: Array, cones: Sequence[Cone]) -> Array:
    """Spectral norm of each cone's rows, repeated over them; rows of orthants each for themselves. Noise counts as zero."""
    found = np.zeros(G.shape[0])
    if not G.shape[1]:
        return found
    start = 0
    for cone in cones:
        rows = slice(start, start + cone.size)
        found[rows] = np.linalg.norm(G[rows], axis=1) if cone.kind == ORTHANT else np.linalg.norm(G[rows], 2)
        start += cone.size
    found[found < 1e-13 * found.max(initial=0.0)] = 0.0
    return found


def _balance(
    blocks: Array, cones: Sequence[Cone], G: Array, h: Array, measured: Array, free: Array, slope: Array
) -> None:
    """Units inside exponential and power cones, in place, where one entry is a constant k and another has a cost c.

    A power cone may be scaled by (α, β, αᵃβ¹⁻ᵃ), an exponential cone by one factor. They are chosen so that the constant, the unit of the
    costed entry and its cost have one size s, the load at which the cone and the quadratic bend alike; the third row keeps its scale.
    """
    start = 0
    for cone in cones:
        rows = np.arange(start, start + cone.size)
        start += cone.size
        exponential = cone.kind in (EXPONENTIAL, EXPONENTIAL_DUAL)
        if not exponential and cone.kind not in (POWER, POWER_DUAL):
            continue
        pair = rows[1:] if exponential else rows[:2]
        moving = np.abs(G[pair] @ np.hstack([measured, free])).max(axis=1, initial=0.0) > 0.0
        if moving.sum() != 1:
            continue
        fixed, moved = pair[np.flatnonzero(~moving)[0]], pair[np.flatnonzero(moving)[0]]
        image = G[moved] @ free
        length = float(image @ image)
        cost = -float(image @ (free.T @ slope)) / length if length > 0.0 else 0.0
        constant = float(h[fixed])
        if not (cost > 0.0 and constant > 0.0):
            continue
        if exponential:
            blocks[rows] /= min(max(np.sqrt(cost / constant) * blocks[rows[0]], 1e-4), 1e4)
            continue
        weight = cone.alpha if fixed == rows[0] else 1.0 - cone.alpha
        gap = 2.0 * weight - 1.0
        gap = np.copysign(max(abs(gap), 0.2), gap)
        size = float(np.linalg.norm(G[rows[2]] @ measured)) or 1.0
        log_s = (-np.log(size) + weight * np.log(constant) - (1.0 - weight) * np.log(cost)) / gap
        log_fixed = log_s - np.log(constant)
        log_moved = (-np.log(size) - weight * log_fixed) / (1.0 - weight)
        blocks[fixed], blocks[moved], blocks[rows[2]] = np.exp(-log_fixed), np.exp(-log_moved), size
