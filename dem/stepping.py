r"""Moreau–Jean time stepping of an assembly (θ-scheme in leap-frog form).

One step: contacts at the mid configuration q_m = q + h(1−θ)v → v_free = v + h M⁻¹ F → Gauss–Seidel on the impulses, warm-started → residual
and energy recomputed → q_m ← q_m + h v. The state holds q_m, whose motion does not depend on θ; θ says at which end of the step the
configuration of the energy lies, q = q_m − h(1−θ)v. An unconverged step raises, unless `keep_unconverged` says that it is wanted (as in
a study of the artefact).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError
from .bodies import Assembly
from .candidates import Partition, refresh
from .kernels import SceneKernels
from .materials import Laws, Material
from .planes import Plane, box_planes, motion_of
from .residual import SUMS, finish
from .rows import Contacts, aligned

__all__ = ["Contacts", "Drive", "Laws", "Material", "Simulation", "Solver"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Solver:
    """Stopping of the sweeps: relative impulse change `tolerance`, at most `sweep_limit` sweeps a step."""

    tolerance: float = 1e-5
    sweep_limit: int = 2000
    keep_unconverged: bool = False


@dataclass(kw_only=True)
class Drive:
    """What moves the box: per axis a pressure [Pa] (positive in compression) or, where `rate` is finite, the half length's rate [m/s]."""

    pressure: Array = field(default_factory=lambda: np.zeros(3))
    rate: Array = field(default_factory=lambda: np.full(3, np.nan))
    gravity: Array = field(default_factory=lambda: np.zeros(3))


class Simulation:
    """An assembly, its laws and the solver: `advance` makes one step and returns its measures by name.

    Candidates are listed with gaps below `skin` [m]; those with gaps below `reach` [m] are rows of the step (default: what bodies cover
    in two steps, at least 0.04 mean radii). `planes` bound the sample beside the box; `theta` in [½, 1]; `threads` > 1 sweeps in as many
    parts, the same bits for the same number. `kernels` holds the generated code: only what dimension, laws, planes, links and turning
    bodies of the scene require.
    """

    def __init__(
        self,
        assembly: Assembly,
        material: Material | Laws,
        solver: Solver,
        *,
        planes: Sequence[Plane] = (),
        skin: float | None = None,
        reach: float | None = None,
        theta: float = 0.5,
        threads: int = 1,
    ) -> None:
        if not 0.5 <= theta <= 1.0:
            raise InputError(f"theta = {theta}: the scheme is stable for θ in [0.5, 1]")
        if threads < 1:
            raise InputError(f"threads = {threads}: needs at least one")
        self.assembly = a = assembly
        self.material = material
        self.solver = solver
        self.theta = theta
        self._planes = tuple(planes)
        self.skin: float = 0.15 * a.grain_radius if skin is None else skin
        self._reach = 0.04 * assembly.grain_radius if reach is None else reach
        self._reach_grows = reach is None
        self.push_out = False  # rigid overlaps are pushed out (g/h signed): only sensible while velocities are reset
        self.sweeps: int = 0  # of the last step
        self.change: float = 0.0  # relative impulse change of the last sweep
        self.total_sweeps: int = 0
        self.total_rows: int = 0  # contact-iterations done
        self.contacts: Contacts | None = None
        if any(len(plane.normal) != a.dimension for plane in self.planes):
            raise InputError(f"planes: a normal of a {a.dimension}D scene has {a.dimension} components")
        self.laws: Laws = material.laws(beads=bool(a.is_bead.any())) if isinstance(material, Material) else material
        self._linked = self.laws.wire is not None and len(a.links) > 0
        self.kernels: SceneKernels = SceneKernels(
            dimension=a.dimension,
            spin=_spin(a),
            contact=self.laws.contact,
            planes=_friction_of(self.planes, a.boxed),
            wire=self.laws.wire if self._linked else None,
            threads=threads,
        )
        self._partition = Partition(threads) if threads > 1 else None
        if threads > 1:
            _start_threads(threads)
        self._prepare()

    @property
    def planes(self) -> tuple[Plane, ...]:
        """The planes; between steps they may be exchanged for as many with the same normals and frictions, that is for other drives."""
        return self._planes

    @planes.setter
    def planes(self, planes: Sequence[Plane]) -> None:
        same = len(planes) == len(self._planes) and all(
            np.array_equal(new.direction, old.direction) and new.friction == old.friction
            for new, old in zip(planes, self._planes, strict=True)
        )
        if not same:
            raise InputError(
                "planes: normals and frictions stay for the life of a simulation; make a new one for other planes"
            )
        self._planes = tuple(planes)

    def _prepare(self) -> None:
        """Everything that stays the same during the life of the simulation."""
        a, d = self.assembly, self.assembly.dimension
        own = np.array([plane.direction for plane in self.planes]).reshape(-1, d)
        if len(a.plane_place) != len(self.planes):
            a.plane_place = np.array([plane.place for plane in self.planes])
            a.plane_velocity = np.zeros(len(self.planes))
        self._box = d if a.boxed else 0
        normal, sense, dof = (
            box_planes(self._box) if self._box else (np.zeros((0, d)), np.zeros(0), np.zeros(0, dtype=np.int64))
        )
        self._normal = np.concatenate([normal, own])
        self._sense = np.concatenate([sense, np.ones(len(own))])
        self._dof = np.concatenate([dof, self._box + np.arange(len(own))]).astype(np.int64)
        self._grip = np.concatenate([np.zeros(len(normal)), [plane.friction for plane in self.planes]])
        self._fixed = np.isinf(a.mass)
        self._inverse_mass = 1.0 / a.mass
        factor = 2.5 if d == 3 else 2.0
        self._turning = np.where(a.locked, 0.0, factor * self._inverse_mass)
        moving = a.mass[~self._fixed]
        self._floor = 1e-12 * float(moving.mean() if len(moving) else 1.0) * a.grain_radius
        kernels = self.kernels
        columns = kernels.body_columns.total
        self._before, self._free, self._vel = (aligned(len(a.x), columns) for _ in range(3))
        self._bodies = kernels.bodies.module
        self._pairs = kernels.pairs
        self._walls = kernels.walls
        self._links = kernels.links
        step, self._signatures = kernels.step
        for kernel in (self._pairs, self._walls, self._links):
            if kernel is not None:
                _ = kernel.module  # written before the step module imports it
        self._step = step.module
        self._is_bead = a.is_bead
        a.pair_impulse = _fitted(a.pair_impulse, self._pairs.warm if self._pairs else 1)
        a.wall_impulse = _fitted(a.wall_impulse, self._walls.warm if self._walls else 1)
        self._buffers: dict[str, Any] = {}
        self._known: dict[Any, dict[str, float]] = {}  # numbers of the laws at the last steps
        if self._partition is not None and len(a.pairs):
            self._partition.sort(a.pairs, a.listed_x)

    def _refresh_candidates(self, place: Array, reach: float) -> None:
        a = self.assembly
        if len(a.listed_place) == len(place) and reach <= a.listed_reach:
            moved = float(np.max(np.abs(place - a.listed_place), initial=0.0))
            if a.x.size:
                moved = max(moved, np.sqrt(self._bodies.moved(a.x, a.listed_x)))
            if moved < 0.45 * self.skin:
                return
        refresh(a, self._normal, place, self.skin + reach - self._reach, reach, self._partition)

    def _buffer(self, name: str, count: int, columns: int) -> Array:
        """Memory for rows, kept between steps."""
        held = self._buffers.get(name)
        if held is None or len(held) < count:
            held = aligned(count + count // 8 + 8, columns)
            self._buffers[name] = held
        return held

    def _index(self, name: str, count: int, columns: int) -> NDArray[np.int32]:
        held = self._buffers.get(name)
        if held is None or len(held) < count:
            held = np.zeros((count + count // 8 + 8, columns), dtype=np.int32)
            self._buffers[name] = held
        return held

    def _numbers(self, kernel: Any, law: Any, step: float, extra: dict[str, float]) -> dict[str, float]:
        if kernel is None:
            return {}
        key = (kernel.kind, step, self.push_out)
        if key not in self._known:
            if len(self._known) > 8:
                self._known.clear()
            values = dict(zip(law.parameter_names(), self._parameters(law), strict=True))
            self._known[key] = kernel.numbers(values | {"step": step} | extra)
        return self._known[key]

    def _parameters(self, law: Any) -> Array:
        values = np.array(law.parameters())
        if self.push_out and "recovery" in law.parameter_names():
            values[law.parameter_names().index("recovery")] = 1.0
        return values

    def problem(self, step: float, drive: Drive) -> dict[str, Any]:
        """All arguments of the kernels, by name, for a step at the present configuration, impulses at their warm start."""
        a, kernels = self.assembly, self.kernels
        d = a.dimension
        if a.step and a.step != step:
            scale = step / a.step
            a.pair_impulse *= scale
            a.wall_impulse *= scale
            a.link_impulse *= scale
        a.step = step
        place = np.concatenate([np.repeat(-a.half, 2), a.plane_place]) if self._box else a.plane_place.copy()
        gravity = np.asarray(drive.gravity, dtype=float)[:d]
        before, free = self._before, self._free
        self._bodies.prepare(a.velocity, a.spin, self._inverse_mass, self._turning, gravity, step, before, free)
        motion_before, motion, driven, slide = self._motion(step, drive)
        reach = self._reach
        if self._reach_grows:  # a body may not pass through another one between two detections
            speed = self._bodies.fastest(free) + float(np.max(np.abs(motion[:, 0]), initial=0.0))
            reach = max(reach, 2.0 * step * speed) if np.isfinite(speed) else reach
        self._refresh_candidates(place, reach)
        c: dict[str, Any] = {
            "before": before, "free": free, "vel": self._vel, "mass": a.mass, "theta": self.theta, "step": step,
            "motion_before": motion_before, "motion_free": motion, "motion": motion.copy(), "driven": driven, "slide": slide,
            "normal": self._normal, "sense": self._sense, "dof": self._dof, "place": place,
        }  # fmt: skip
        law, wire = self.laws.contact, self.laws.wire
        contact_numbers = self._numbers(self._pairs, law, step, {})
        smallest = {"plane_friction": self.planes[0].friction if self.planes else 0.0}
        wall_numbers = self._numbers(self._walls, law, step, smallest)
        parameter = self._parameters(law) if law is not None else np.zeros(0)
        empty, none = np.empty((0, 1)), np.empty((0, 2), dtype=np.int32)
        pair, row, cold, candidate = none, empty, empty, none[:, 0]
        if self._pairs is not None:
            size = len(a.pairs)
            pair, candidate = self._index("pair", size, 2), self._index("candidate", size, 1)[:, 0]
            row, cold = (
                self._buffer("row", size, self._pairs.columns.total),
                self._buffer("cold", size, self._pairs.cold),
            )
            m = self._pairs.module.collect(
                a.x, a.radius, before, self._is_bead, a.pairs, a.pair_impulse, parameter, reach, step, pair, row, cold, candidate,
                *contact_numbers.values(),
            )  # fmt: skip
            pair, row, cold, candidate = pair[:m], row[:m], cold[:m], candidate[:m]
            if self._partition is not None:
                c["starts"] = self._partition.of_rows(candidate)
                c["part"] = np.zeros((self._partition.parts, 2))
        wall, wall_row, wall_cold, wall_candidate = none, empty, empty, none[:, 0]
        if self._walls is not None:
            size = len(a.walls)
            wall, wall_candidate = self._index("wall", size, 2), self._index("wall_candidate", size, 1)[:, 0]
            wall_row = self._buffer("wall_row", size, self._walls.columns.total)
            wall_cold = self._buffer("wall_cold", size, self._walls.cold)
            m = self._walls.module.collect(
                a.x, a.radius, before, self._is_bead, self._normal, place, self._sense, self._dof, slide, self._grip, motion_before,
                a.walls, a.wall_impulse, parameter, reach, step, wall, wall_row, wall_cold, wall_candidate, *wall_numbers.values(),
            )  # fmt: skip
            wall, wall_row, wall_cold, wall_candidate = wall[:m], wall_row[:m], wall_cold[:m], wall_candidate[:m]
        link, link_row = a.links[:0], empty
        if self._links is not None and wire is not None:
            link, link_row = a.links, self._buffer("link_row", len(a.links), self._links.columns.total)[: len(a.links)]
            self._links.module.collect(
                a.x, before, link, a.link_length, a.link_impulse, np.array(wire.parameters()), step, link_row
            )
        c |= {
            "pair": pair, "row": row, "cold": cold, "wall": wall, "wall_row": wall_row, "wall_cold": wall_cold, "link": link,
            "link_row": link_row,
        }  # fmt: skip
        c |= {f"pairs_{name}": value for name, value in contact_numbers.items()}
        c |= {f"planes_{name}": value for name, value in wall_numbers.items()}
        c["contacts"] = Contacts(
            pair, row, cold, candidate, wall, wall_row, wall_cold, wall_candidate, link, link_row,
            (self._pairs, self._walls, self._links), (contact_numbers, wall_numbers), kernels.turned_weight, self._normal,
            step, a.x, a.half,
        )  # fmt: skip
        return c

    def _motion(self, step: float, drive: Drive) -> tuple[Array, Array, NDArray[np.bool_], Array]:
        """Degrees of freedom of box and planes before the step and without contacts (q, 2), which are driven, and how planes slide."""
        a, d = self.assembly, self.assembly.dimension
        slide = np.zeros((len(self._normal), d))
        before = np.zeros((self._box + len(self.planes), 2))
        free = before.copy()
        driven = np.ones(len(before), dtype=bool)
        if self._box:
            rate = np.asarray(drive.rate, dtype=float)[:d]
            given = driven[:d] = np.isfinite(rate)
            before[:d, 0] = a.box_velocity
            before[:d, 1] = np.where(given, 0.0, 1.0 / a.box_mass)
            free[:d, 1] = before[:d, 1]
            area = 2.0 ** (d - 1) * np.prod(a.half) / a.half
            push = np.asarray(drive.pressure, dtype=float)[:d] * area
            free[:d, 0] = np.where(given, rate, a.box_velocity - step * before[:d, 1] * 2.0 * push)
        if self.planes:
            own, given, slip = motion_of(self.planes, a.plane_velocity, step)
            free[self._box :], driven[self._box :] = own, given
            before[self._box :, 0], before[self._box :, 1] = a.plane_velocity, own[:, 1]
            slide[2 * self._box :] = slip
        return before, free, driven, slide

    def assemble(self, step: float, drive: Drive) -> tuple[Array, Array, Array, Array, NDArray[np.bool_], Contacts]:
        """The one-step problem at the present configuration, impulses at their warm start.

        Returns velocities before and free, degrees of freedom of box and planes before and free (q, 2), which are driven, and the rows. A
        row of velocities is v (3), r·ω (3), 1/m, unused; in two dimensions that of the scene's own kernels.
        """
        c = self.problem(step, drive)
        columns = self.kernels.body_columns.starts

        def standard(rows: Array) -> Array:
            if self.assembly.dimension == 2:
                return rows.copy()
            out = np.zeros((len(rows), 8))
            out[:, 0:3], out[:, 6] = rows[:, 0:3], rows[:, columns["w"]]
            if "s" in columns:
                out[:, 3:6] = rows[:, columns["s"] : columns["s"] + 3]
            elif self.assembly.spin.shape[1]:
                out[:, 3:6] = self.assembly.spin
            return out

        return (
            standard(c["before"]), standard(c["free"]), c["motion_before"], c["motion_free"], c["driven"], c["contacts"]
        )  # fmt: skip

    def advance(self, step: float, drive: Drive) -> dict[str, float]:
        """One step of length `step` [s]; returns the measures of `dem.residual` by name.

        Raises `ConvergenceError` when the sweep limit is reached above the tolerance, `InputError` for a step that is not positive.
        """
        if not (np.isfinite(step) and step > 0.0):
            raise InputError(f"step = {step} s: a time step is positive and finite")
        a, solver = self.assembly, self.solver
        c = self.problem(step, drive)
        rows: Contacts = c["contacts"]
        self.sweeps, self.change = self.sweep(c, tolerance=solver.tolerance, sweep_limit=solver.sweep_limit)
        self.total_sweeps += self.sweeps
        self.total_rows += self.sweeps * (len(rows.pair) + len(rows.touching) + len(rows.link))
        out = np.zeros(len(SUMS))
        c["out"], c["motion"] = out, c["motion_free"].copy()
        c["vel"][:] = c["free"]
        self._step.assess(*(c[name] for name in self._signatures["assess"]))
        self._walls_energy(c, out)
        measures = finish(out, step, len(a.x) - int(self._fixed.sum()), a.elastic_energy, self._floor / step)
        if not np.all(np.isfinite(out)):
            raise ConvergenceError(
                f"the step at t = {a.time:.6g} s is not finite: reduce the step (now {step:.3g} s) or check the overlaps of the start state"
            )
        if self.change > solver.tolerance and not solver.keep_unconverged:
            raise ConvergenceError(
                f"NLGS stopped after {self.sweeps} sweeps at a relative impulse change of {self.change:.2e} "
                f"> {solver.tolerance:.0e} "
                f"(natural map {measures['natural_map']:.2e}, t = {a.time:.6g} s): raise solve.sweep_limit, loosen "
                "solve.tolerance (rigid packings settle for 1e-4), or give the grains a stiffness"
            )
        self._take_over(c, rows, step)
        a.elastic_energy = measures["elastic"]
        a.time += step
        self.contacts = rows
        return measures

    def sweep(self, c: dict[str, Any], *, tolerance: float, sweep_limit: int) -> tuple[int, float]:
        """Gauss–Seidel on the arguments of a step (see `problem`) from its warm start; returns the sweeps and the last relative change."""
        c["vel"][:] = c["free"]
        self._step.warm(*(c[name] for name in self._signatures["warm"]))
        c |= {"tolerance": tolerance, "floor": self._floor / c["step"], "sweep_limit": sweep_limit}
        return self._step.solve(*(c[name] for name in self._signatures["solve"]))

    def fastest(self, drive: Drive, step: float) -> float:
        """Largest speed of a body at the end of a step without contacts [m/s]."""
        gravity = np.asarray(drive.gravity, dtype=float)[: self.assembly.dimension]
        return float(np.sqrt(np.max(np.sum((self.assembly.velocity + step * gravity) ** 2, axis=1), initial=0.0)))

    def change_step(self, step: float) -> None:
        """Let the next step have another length [s]: mid configurations move so that the configurations q stay (see `adaptive`)."""
        a = self.assembly
        if a.step and a.step != step:
            more = (step - a.step) * (1.0 - self.theta)
            a.x += more * a.velocity
            if self._box:
                a.half = a.half + more * a.box_velocity
            a.plane_place = a.plane_place + more * a.plane_velocity

    def _walls_energy(self, c: dict[str, Any], out: Array) -> None:
        """Kinetic energy, work and damping of box and planes that have inertia."""
        theta = self.theta
        before, free, after = c["motion_before"][:, 0], c["motion_free"][:, 0], c["motion"][:, 0]
        for q in np.flatnonzero(~c["driven"]):
            mass = 1.0 / c["motion"][q, 1]
            out[SUMS["kinetic"]] += 0.5 * mass * after[q] ** 2
            out[SUMS["drive"]] += (free[q] - before[q]) * mass * (theta * after[q] + (1.0 - theta) * before[q])
            out[SUMS["damping"]] += (theta - 0.5) * mass * (after[q] - before[q]) ** 2

    def _take_over(self, c: dict[str, Any], rows: Contacts, step: float) -> None:
        """Velocities, positions and impulses at the end of the step become the state."""
        a = self.assembly
        motion = c["motion"][:, 0]
        if self._box:
            half = a.half + step * motion[: self._box]
            if np.any(half <= a.grain_radius):
                raise ConvergenceError(
                    f"the box collapsed at t = {a.time:.6g} s (half lengths {np.array2string(half, precision=2)} m): reduce the step "
                    f"(now {step:.3g} s), stiffen the contacts, or start from a denser sample"
                )
            a.box_velocity = motion[: self._box].copy()
            # the rows of this step still show the box in which they were detected
            a.half = half
        if self.planes:
            a.plane_velocity = motion[self._box :].copy()
            a.plane_place = a.plane_place + step * a.plane_velocity
        rows.x = a.x.copy()
        self._bodies.advance(a.x, c["vel"], a.velocity, a.spin, step)
        if self._pairs is not None:
            self._pairs.module.keep(rows.row, rows.candidate, a.pair_impulse)
        if self._walls is not None:
            self._walls.module.keep(
                rows.touching_row, rows.touching, self._normal, rows.touching_candidate, a.wall_impulse
            )
        if self._links is not None:
            a.link_impulse = rows.tension.copy()


def _start_threads(threads: int) -> None:
    """Start numba's threads, of which a step read from the disk cache knows nothing (it would fall into the void without them)."""
    import numba

    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]


def _spin(a: Assembly) -> Literal["none", "all", "some"]:
    """Which of the bodies that can move turn."""
    locked = a.locked[np.isfinite(a.mass)]
    if not a.spin.shape[1] or (len(locked) and locked.all()):
        return "none"
    return "some" if locked.any() else "all"


def _friction_of(planes: Sequence[Plane], boxed: bool) -> Literal["none", "smooth", "one", "each"]:
    """What friction walls and planes have."""
    found = {plane.friction for plane in planes} | ({0.0} if boxed else set())
    if not found:
        return "none"
    if found == {0.0}:
        return "smooth"
    return "one" if len(found) == 1 else "each"


def _fitted(impulse: Array, columns: int) -> Array:
    """Impulses that a scene with other laws left, in the columns that this one has: without friction only the pressure stays."""
    if impulse.shape[1] == columns:
        return impulse
    out = np.zeros((len(impulse), columns))
    out[:, -1] = impulse[:, -1]
    return out
