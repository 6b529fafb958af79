r"""Moreau–Jean time stepping of an assembly in its box (θ = ½, leap-frog form).

One step: contacts at the mid configuration → v_free = v + h M⁻¹ F → NLGS on the impulses, warm-started → residual and energy recomputed
→ x ← x + h v. An unconverged step raises, unless `keep_unconverged` says that it is wanted (as in a study of the artefact).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError
from .bodies import Assembly
from .contacts import collect_contacts, collect_links, collect_walls, keep_contacts
from .detection import find_pairs, find_wall_pairs
from .nlgs import apply_contacts, apply_links, apply_walls, solve
from .residual import MEASURES, assess
from .wires import WIRE_LAWS

__all__ = ["Contacts", "Drive", "Material", "Simulation", "Solver"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Material:
    """Contact and wire laws of a sample. Stiffness inf: rigid. `links` False: the beads are loose."""

    friction: float = 0.4
    bead_friction: float = 0.4
    normal_stiffness: float = np.inf  # k_n [N/m]
    tangential_stiffness: float = np.inf  # k_t [N/m]
    wire_law: str = "elastic_wire"
    wire_stiffness: float = 100.0  # k [N], force per unit strain
    prestrain: float = 0.0
    length_correction: bool = True
    links: bool = True


@dataclass(frozen=True, kw_only=True)
class Solver:
    """Stopping of the sweeps: relative impulse change `tolerance`, at most `sweep_limit` sweeps a step."""

    tolerance: float = 1e-5
    sweep_limit: int = 2000
    keep_unconverged: bool = False


@dataclass(kw_only=True)
class Drive:
    """What moves the walls: per axis a pressure [Pa] (positive in compression) or, where `rate` is finite, the half length's rate [m/s]."""

    pressure: Array = field(default_factory=lambda: np.zeros(3))
    rate: Array = field(default_factory=lambda: np.full(3, np.nan))
    gravity: Array = field(default_factory=lambda: np.zeros(3))


@dataclass
class Contacts:
    """The one-step problem: index and row arrays of `dem.contacts`, step, compliances, and the configuration of detection."""

    pair: NDArray[np.int32]
    contact: Array
    wall: NDArray[np.int32]
    wall_row: Array
    link: NDArray[np.int32]
    link_row: Array
    step: float
    cn: float
    ct: float
    x: Array
    half: Array


class Simulation:
    """An assembly, its laws and the solver: `advance` makes one step and returns its measures by name."""

    def __init__(self, assembly: Assembly, material: Material, solver: Solver, *, skin: float | None = None) -> None:
        self.assembly = assembly
        self.material = material
        self.solver = solver
        self.skin = 0.15 * assembly.grain_radius if skin is None else skin
        self.push_out = False  # rigid overlaps are pushed out (g/h signed): only sensible while velocities are reset
        self.sweeps = 0  # of the last step
        self.change = 0.0  # relative impulse change of the last sweep
        self.total_sweeps = 0
        self.total_rows = 0  # contact-iterations done
        self.contacts: Contacts | None = None

    def _refresh_candidates(self) -> None:
        a = self.assembly
        moved = np.max(np.abs(a.half - a.listed_half))
        if np.isfinite(moved) and a.x.size:
            moved = max(moved, np.sqrt(np.max(np.sum((a.x - a.listed_x) ** 2, axis=1))))
        if moved < 0.45 * self.skin:
            return
        pairs = find_pairs(a.x, a.radius, a.wire, a.rank, a.apart, self.skin)
        impulse = np.zeros((len(pairs), 4))
        if len(a.pairs) and len(pairs):
            n = np.int64(len(a.x))
            old = a.pairs[:, 0] * n + a.pairs[:, 1]
            new = pairs[:, 0] * n + pairs[:, 1]
            at = np.minimum(np.searchsorted(old, new), len(old) - 1)
            known = old[at] == new
            impulse[known] = a.pair_impulse[at[known]]
        walls = find_wall_pairs(a.x, a.radius, a.half, self.skin)
        wall_impulse = np.zeros(len(walls))
        held = {tuple(w): p for w, p in zip(a.walls.tolist(), a.wall_impulse, strict=True) if p != 0.0}
        for k, w in enumerate(walls.tolist()):
            wall_impulse[k] = held.get(tuple(w), 0.0)
        a.pairs, a.pair_impulse, a.walls, a.wall_impulse = pairs, impulse, walls, wall_impulse
        a.listed_x, a.listed_half = a.x.copy(), a.half.copy()

    def assemble(self, step: float, drive: Drive) -> tuple[Array, Array, Array, Array, NDArray[np.bool_], Contacts]:
        """The one-step problem at the present configuration, impulses at their warm start.

        Returns velocities before and free (n, 8), box before and free (3, 2), driven axes, and the rows.
        """
        a, law = self.assembly, self.material
        if a.step and a.step != step:
            scale = step / a.step
            a.pair_impulse *= scale
            a.wall_impulse *= scale
            a.link_impulse *= scale
        a.step = step
        self._refresh_candidates()
        n = len(a.x)
        before = np.zeros((n, 8))
        before[:, 0:3], before[:, 3:6], before[:, 6] = a.velocity, a.spin, 1.0 / a.mass
        free = before.copy()
        free[:, 0:3] += step * drive.gravity
        driven = np.isfinite(drive.rate)
        box_before = np.zeros((3, 2))
        box_before[:, 0] = a.box_velocity
        box_before[:, 1] = np.where(driven, 0.0, 1.0 / a.box_mass)
        box_free = box_before.copy()
        area = 4.0 * np.prod(a.half) / a.half
        box_free[:, 0] = np.where(
            driven, drive.rate, a.box_velocity - step * box_before[:, 1] * 2.0 * drive.pressure * area
        )
        cn = 1.0 / (law.normal_stiffness * step**2)
        ct = 1.0 / (law.tangential_stiffness * step**2)
        reach = 0.04 * a.grain_radius
        signed = self.push_out or np.isfinite(law.normal_stiffness)
        pair, contact = collect_contacts(
            a.x,
            a.radius,
            before,
            a.is_bead,
            a.pairs,
            a.pair_impulse,
            reach,
            step,
            cn,
            ct,
            law.friction,
            law.bead_friction,
            signed,
        )
        wall, wall_row = collect_walls(
            a.x, a.radius, before, a.half, box_before, a.walls, a.wall_impulse, reach, step, cn, signed
        )
        wire = WIRE_LAWS[law.wire_law]
        link = a.links if law.links else a.links[:0]
        link_row = collect_links(
            a.x,
            before,
            link,
            a.link_length,
            a.link_impulse,
            step,
            law.wire_stiffness if wire.elastic else np.inf,
            law.prestrain,
            law.length_correction,
        )
        return before, free, box_before, box_free, driven, Contacts(
            pair, contact, wall, wall_row, link, link_row, step, cn, ct, a.x.copy(), a.half.copy()
        )  # fmt: skip

    def advance(self, step: float, drive: Drive) -> dict[str, float]:
        """One step of length `step` [s]; returns the measures of `dem.residual` by name.

        Raises `ConvergenceError` when the sweep limit is reached above the tolerance, `InputError` for a step that is not positive.
        """
        if not (np.isfinite(step) and step > 0.0):
            raise InputError(f"step = {step} s: a time step is positive and finite")
        a, law, solver = self.assembly, self.material, self.solver
        before, free, box_before, box_free, driven, rows = self.assemble(step, drive)
        unilateral = WIRE_LAWS[law.wire_law].unilateral
        vel, box = free.copy(), box_free.copy()
        apply_contacts(vel, rows.pair, rows.contact)
        apply_walls(vel, box, rows.wall, rows.wall_row)
        apply_links(vel, rows.link, rows.link_row)
        frictional = law.friction > 0.0 or law.bead_friction > 0.0
        floor = 1e-12 * float(a.mass.mean()) * a.grain_radius / step
        self.sweeps, self.change = solve(
            vel, box, rows.pair, rows.contact, rows.wall, rows.wall_row, rows.link, rows.link_row,
            rows.cn, rows.ct, frictional, unilateral, solver.tolerance, floor, solver.sweep_limit,
        )  # fmt: skip
        self.total_sweeps += self.sweeps
        self.total_rows += self.sweeps * (len(rows.pair) + len(rows.wall) + len(rows.link))
        measures = assess(
            before, free, box_before, box_free, driven, a.mass, rows.pair, rows.contact, rows.wall, rows.wall_row,
            rows.link, rows.link_row, step, rows.cn, rows.ct, unilateral,
        )  # fmt: skip
        measures[15] += a.elastic_energy
        if not np.all(np.isfinite(measures)) or not np.all(np.isfinite(vel)):
            raise ConvergenceError(
                f"the step at t = {a.time:.6g} s is not finite: reduce the step (now {step:.3g} s) or check the overlaps of the start state"
            )
        if self.change > solver.tolerance and not solver.keep_unconverged:
            raise ConvergenceError(
                f"NLGS stopped after {self.sweeps} sweeps at a relative impulse change of {self.change:.2e} "
                f"> {solver.tolerance:.0e} "
                f"(natural map {measures[0]:.2e}, t = {a.time:.6g} s): raise solve.sweep_limit, loosen "
                "solve.tolerance (rigid packings settle for 1e-4), or give the grains a stiffness"
            )
        half = a.half + step * box[:, 0]
        if np.any(half <= a.grain_radius):
            raise ConvergenceError(
                f"the box collapsed at t = {a.time:.6g} s (half lengths {np.array2string(half, precision=2)} m): reduce the step "
                f"(now {step:.3g} s), stiffen the contacts, or start from a denser sample"
            )
        a.elastic_energy = float(measures[9])
        a.velocity, a.spin = vel[:, 0:3].copy(), vel[:, 3:6].copy()
        a.box_velocity = box[:, 0].copy()
        keep_contacts(rows.contact, a.pair_impulse)
        a.wall_impulse[rows.wall_row[:, 5].astype(np.int64)] = rows.wall_row[:, 0]
        if law.links:
            a.link_impulse = rows.link_row[:, 3].copy()
        a.x += step * a.velocity
        a.half = half
        a.time += step
        self.contacts = rows
        return dict(zip(MEASURES, measures.tolist(), strict=True))
