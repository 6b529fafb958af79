"""What a triaxial test leaves behind: the hinge between the grains and the identification.

Every homogenised field is a ratio of sums over bodies, so the record keeps the sums, per octant of the measuring sphere.
Leaving one octant out is then a reweighting, which gives the spread within a sample (delete-a-group jackknife).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..notebook import Summary

__all__ = ["PhaseHistory", "TriaxialRecord", "mandel"]

Array = NDArray[np.float64]

_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def mandel(tensor: Array) -> Array:
    """Mandel components, shape (..., 6), of the symmetric part of tensors of shape (..., 3, 3)."""
    symmetric = 0.5 * (tensor + np.swapaxes(tensor, -1, -2))
    out = np.stack([symmetric[..., i, j] for i, j in _PAIRS], axis=-1)
    out[..., 3:] *= np.sqrt(2.0)
    return out


@dataclass(frozen=True, kw_only=True, repr=False)
class PhaseHistory(Summary):
    """Stress and strain of each phase along one test; tension positive, Mandel components, shape (frame_count, 6).

    Strains [-] count from the start of the test (isotropic state at `pressure`, links just switched on); stresses [Pa] are
    whole (they start near -pressure in the grains). `stress_beads` is what the grain contacts of the beads carry:
    split "total": sand = grains, wire = links + beads; split "links": sand = grains + beads, wire = links.
    """

    UNITS: ClassVar[Mapping[str, str]] = {
        "pressure": "Pa",
        "axial_strain": "-",
        "wall_strain": "-",
        "strain_sand": "-",
        "strain_wire": "-",
        "wall_stress": "Pa",
        "stress_grains": "Pa",
        "stress_beads": "Pa",
        "stress_links": "Pa",
    }

    pressure: float  # confining pressure [Pa], positive
    linked: bool  # False: the control with the same beads unlinked
    leg: NDArray[np.int64]  # (frame_count,) 0 first shortening, 1 extension, 2 reloading
    axial_strain: Array  # (frame_count,) of the box along z, logarithmic [-]
    wall_strain: Array  # of the box
    wall_stress: Array  # from the forces on the walls
    strain_sand: Array
    strain_wire: Array
    stress_grains: Array
    stress_beads: Array
    stress_links: Array

    def _title(self) -> str:
        return f"a test at {self.pressure / 1e3:g} kPa by phase, {len(self.leg)} frames"

    def stress_sand(self, split: str = "links") -> Array:
        """Stress of the sand phase under a split of the bead contacts ("links" or "total")."""
        return self.stress_grains + self.stress_beads if split == "links" else self.stress_grains

    def stress_wire(self, split: str = "links") -> Array:
        """Stress of the wire phase under a split of the bead contacts ("links" or "total")."""
        return self.stress_links if split == "links" else self.stress_links + self.stress_beads


@dataclass(frozen=True, kw_only=True, repr=False)
class TriaxialRecord(Summary):
    """One test of one sample at one pressure, with the octant sums that give `PhaseHistory` for any octant weights."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "pressure": "Pa",
        "axial_strain": "-",
        "wall_strain": "-",
        "wall_stress": "Pa",
        "box_stress": "Pa",
        "octant_volume": "m³",
        "grain_moment": "J",
        "bead_moment": "J",
        "link_moment": "J",
    }

    pressure: float
    seed: int
    linked: bool
    leg: NDArray[np.int64]
    axial_strain: Array
    wall_strain: Array
    wall_stress: Array
    box_stress: Array  # homogenised over the whole box, all phases
    octant_volume: Array  # (8,) of the measuring sphere [m3]
    grain_moment: Array  # (frame_count, 8, 3, 3) sum of f ⊗ l inside the sphere, grains [J]
    bead_moment: Array  # the same, grain contacts of the beads
    link_moment: Array  # the same, links
    grain_fit: Array  # (frame_count, 8, 1+3+3+9+9): count, Σx, Σu, Σx⊗x, Σu⊗x over the grains of the reference set
    bead_fit: Array
    series: dict[str, Array] = field(default_factory=dict)  # (frame_count,) measures of `dem.residual`, energies summed
    quality: dict[str, float] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)

    def _title(self) -> str:
        return f"record of a test at {self.pressure / 1e3:g} kPa, {len(self.leg)} frames"

    def history(self, octant_weights: Array | None = None) -> PhaseHistory:
        """Homogenised histories; `octant_weights`, shape (8,), default all one."""
        w = np.ones(8) if octant_weights is None else np.asarray(octant_weights, dtype=float)
        volume = float(w @ self.octant_volume)

        def stress(moment: Array) -> Array:
            return mandel(np.einsum("o,foij->fij", w, moment) / volume)

        return PhaseHistory(
            pressure=self.pressure,
            linked=self.linked,
            leg=self.leg,
            axial_strain=self.axial_strain,
            wall_strain=self.wall_strain,
            wall_stress=self.wall_stress,
            strain_sand=_best_fit_strain(np.einsum("o,fok->fk", w, self.grain_fit)),
            strain_wire=_best_fit_strain(np.einsum("o,fok->fk", w, self.bead_fit)),
            stress_grains=stress(self.grain_moment),
            stress_beads=stress(self.bead_moment),
            stress_links=stress(self.link_moment),
        )


def _best_fit_strain(sums: Array) -> Array:
    """Strain of the affine field nearest to displacements u at centres x, Σ|u' − G x'|² → min (Cundall).

    G = (Σ u' ⊗ x')(Σ x' ⊗ x')⁻¹ with primes for the deviation from the mean; exact for affine fields.
    """
    count = sums[:, 0]
    frames = sums.shape[0]
    if np.any(count < 4):
        return np.zeros((frames, 6))
    sx, su = sums[:, 1:4], sums[:, 4:7]
    xx = sums[:, 7:16].reshape(frames, 3, 3) - sx[:, :, None] * sx[:, None, :] / count[:, None, None]
    ux = sums[:, 16:25].reshape(frames, 3, 3) - su[:, :, None] * sx[:, None, :] / count[:, None, None]
    gradient = np.swapaxes(np.linalg.solve(xx, np.swapaxes(ux, -1, -2)), -1, -2)
    return mandel(np.asarray(gradient, dtype=np.float64))
