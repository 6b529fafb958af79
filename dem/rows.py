"""The rows of one step, as they were solved: what homogenisation, certificates and exports read.

The columns are those that the scene's kernels have; `contact`, `wall`, `wall_row` and `link_row` show them in one fixed layout of three
dimensions, with zeros for what the scene does not have. Arrays are views that the next step overwrites.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .kernels import Kernel

__all__ = ["Contacts", "aligned"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]


def aligned(rows: int, columns: int) -> Array:
    """Zeros of shape (rows, columns) whose first row starts on a cache line."""
    memory = np.zeros(rows * columns + 8)
    skip = (-memory.ctypes.data // 8) % 8
    return memory[skip : skip + rows * columns].reshape(rows, columns)


@dataclass
class Contacts:
    """The one-step problem: bodies and rows of contacts, walls and links, step, and the configuration of detection."""

    pair: Ints  # (m, 2) bodies i < j
    row: Array  # (m, columns)
    cold: Array  # (m, 1 or 2): gap [m], normal impulse of the step before
    candidate: Ints  # (m,)
    touching: Ints  # (w, 2): body, plane; planes 2 axis, 2 axis + 1 are those of the box
    touching_row: Array
    touching_cold: Array
    touching_candidate: Ints
    link: Ints  # (l, 2)
    links: Array
    kernels: tuple[Kernel | None, Kernel | None, Kernel | None]  # of contacts, walls, links
    numbers: tuple[dict[str, float], dict[str, float]]  # of the laws of contacts and walls
    turning: float  # W_t over W_n
    normal_of_planes: Array  # (P, d)
    step: float
    x: Array
    half: Array

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.x.shape[1]

    def _column(self, which: int, name: str) -> int:
        kernel = self.kernels[which]
        return -1 if kernel is None else kernel.columns.starts.get(name, -1)

    def _get(self, which: int, name: str, array: Array) -> Array:
        at = self._column(which, name)
        if at >= 0:
            return array[:, at]
        key = name.removesuffix("_at")
        return np.full(len(array), self.numbers[which].get(key, 0.0))

    @property
    def normal(self) -> Array:
        """Normals of the contacts (m, d), from the second body to the first."""
        return self.row[:, : self.dimension]

    @property
    def impulse(self) -> Array:
        """Impulses of the contacts (m, d) [N s], on the first body."""
        return self._impulse(0, self.row, self.normal)

    @property
    def wall_impulse(self) -> Array:
        """Impulses of the walls on the bodies (w, d) [N s]."""
        return self._impulse(1, self.touching_row, self.normal_of_planes[self.touching[:, 1]])

    def _impulse(self, which: int, row: Array, normal: Array) -> Array:
        at = self._column(which, "p")
        if at < 0:
            return np.zeros_like(normal)
        kernel = self.kernels[which]
        assert kernel is not None
        if dict(kernel.columns.widths)["p"] == 1:
            return row[:, at : at + 1] * normal
        return row[:, at : at + self.dimension]

    @property
    def gap(self) -> Array:
        """Gaps of the contacts at detection (m,) [m]."""
        return self.cold[:, 0]

    @property
    def friction(self) -> Array:
        """Coefficients of the contacts (m,)."""
        return self._get(0, "mu_at", self.row)

    @property
    def cn(self) -> float:
        """Normal compliance 1/(k_n h²) where it is one number, else 0."""
        return self.numbers[0].get("cn", 0.0)

    @property
    def ct(self) -> float:
        """Tangential compliance 1/(k_t h²) where it is one number, else 0."""
        return self.numbers[0].get("ct", 0.0)

    @property
    def contact(self) -> Array:
        """Columns n (3), p (3), p_t⁰ (3), b, 1/(W_n + c_n), 1/(W_t + c_t), μ, g, p_n⁰, candidate."""
        out = np.zeros((len(self.pair), 16))
        out[:, 0:3], out[:, 3:6] = self.normal, self.impulse
        if (at := self._column(0, "e")) >= 0:
            out[:, 6:9] = self.row[:, at : at + 3]
        out[:, 9], out[:, 10] = self._get(0, "b", self.row), self._get(0, "iw", self.row)
        turned = self._column(0, "it") >= 0
        out[:, 11] = self._get(0, "it", self.row) if turned else out[:, 10] / self.turning
        out[:, 12], out[:, 13] = self.friction, self.gap
        if self.cold.shape[1] > 1:
            out[:, 14] = self.cold[:, 1]
        out[:, 15] = self.candidate
        return out

    @property
    def wall(self) -> Ints:
        """Contacts with the box (w, 3): body, axis, side ±1."""
        body, plane = self.touching[:, 0], self.touching[:, 1]
        return np.stack([body, plane // 2, 2 * (plane % 2) - 1], axis=1).astype(np.int32)

    @property
    def wall_row(self) -> Array:
        """Columns p, b, 1/(W_n + c_n), g, p⁰, candidate of the walls."""
        out = np.zeros((len(self.touching), 6))
        out[:, 0] = np.sum(self.wall_impulse * self.normal_of_planes[self.touching[:, 1]], axis=1)
        out[:, 1], out[:, 2] = self._get(1, "b", self.touching_row), self._get(1, "iw", self.touching_row)
        out[:, 3] = self.touching_cold[:, 0]
        if self.touching_cold.shape[1] > 1:
            out[:, 4] = self.touching_cold[:, 1]
        out[:, 5] = self.touching_candidate
        return out

    @property
    def tension(self) -> Array:
        """Tension impulses of the links (l,) [N s]."""
        at = self._column(2, "p")
        return self.links[:, at] if at >= 0 else np.zeros(0)

    @property
    def link_row(self) -> Array:
        """Columns n (3), tension impulse, β, 1/(W_n + c), c, tension of the step before."""
        out = np.zeros((len(self.link), 8))
        if len(self.link):
            out[:, 0:3] = self.links[:, :3]
            for place, name in ((3, "p"), (4, "b"), (5, "iw"), (6, "c"), (7, "o")):
                if (at := self._column(2, name)) >= 0:
                    out[:, place] = self.links[:, at]
        return out
