r"""Small scenes whose next step is a contact problem, in units of 50 kPa and millimetres, and fits of what a sweep over them shows.

`packing`: spheres with a few chains of beads, pushed together by the walls of a box for a hundred steps; `cold`: the same without the
impulses of the step before. `cluster`: spheres on a close-packed lattice in free space, touching exactly or with gaps, thrown at random.
`LocalRows`: the contacts of the next step in plain mechanics.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem import Assembly, Drive, Laws, Material, Simulation, Solver
from ..dem.one_step import OneStepProblem
from ..dem.packing import densify

__all__ = ["PRESSURE", "STIFF", "LocalRows", "cluster", "cold", "fitted_exponent", "packing", "reactions"]

Array = NDArray[np.float64]

PRESSURE, DENSITY = 5e4, 2600.0  # Pa, kg/m³
STIFF: dict[str, Any] = dict(normal_stiffness=4e4, tangential_stiffness=3e4)  # N/m


def packing(
    seed: int,
    grains: int,
    material: Material,
    *,
    wires: int = 2,
    beads: int = 5,
    steps: int = 100,
    tolerance: float = 1e-4,
) -> tuple[Simulation, float, Drive]:
    """A sample in a box under 50 kPa after `steps` steps, the length of the next step [s] and its drive."""
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.75e-3, 1.39e-3, grains)
    chains: dict[str, Any] = (
        {"wire_count": wires, "beads": beads, "spacing": 1e-3, "bead_radius": 0.4e-3} if wires else {}
    )
    assembly = densify(rng, radius, solid_fraction=0.5, **chains)
    solver = Solver(tolerance=tolerance, sweep_limit=2000, keep_unconverged=True)
    simulation = Simulation(assembly, material, solver)
    drive = Drive(pressure=np.full(3, PRESSURE))
    step = 0.1 * assembly.grain_radius * float(np.sqrt(DENSITY / PRESSURE))
    for _ in range(steps):
        simulation.advance(step, drive)
    return simulation, step, drive


def cluster(seed: int, laws: Laws, *, gap: float = 0.0) -> Simulation:
    """Sixty spheres of 5 mm on a close-packed lattice around a straight chain of beads, with random velocities and spins.

    Neighbours touch exactly with `gap` = 0; else places are disturbed by that much [m].
    """
    rng = np.random.default_rng(seed)
    r = 5e-3
    edge = np.sqrt(2.0) * r
    grid = np.stack(np.meshgrid(*[np.arange(-4, 5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    x = edge * grid[grid.sum(axis=1) % 2 == 0].astype(float)
    x = x[np.argsort(np.linalg.norm(x, axis=1), kind="stable")[:60]] + gap * rng.normal(size=(60, 3))
    along = np.flatnonzero((np.abs(x[:, 0] - x[:, 1]) < 1e-9) & (np.abs(x[:, 2]) < 1e-9)) if not gap else np.arange(0)
    wire = np.full(60, -1)
    wire[along] = 0
    rank = np.round(x[:, 0] / edge).astype(np.int64)
    a = Assembly.of_spheres(x, np.full(60, r), rng.uniform(0.001, 0.01, 60), wire=wire, rank=rank)
    a.velocity[:] = -10.0 * x + 0.2 * rng.normal(size=(60, 3))
    a.spin[:] = 0.2 * rng.normal(size=(60, 3))
    return Simulation(a, laws, Solver(tolerance=1e-8, sweep_limit=20_000))


def cold(assembly: Assembly, law: Material, tolerance: float, sweep_limit: int = 20_000) -> Simulation:
    """A simulation of a copy without impulses of the step before."""
    a = assembly.copy()
    for impulse in (a.pair_impulse, a.wall_impulse, a.link_impulse):
        impulse[:] = 0.0
    return Simulation(a, law, Solver(tolerance=tolerance, sweep_limit=sweep_limit, keep_unconverged=True))


class LocalRows:
    """The contacts of a problem of `problem_of` in plain mechanics: who touches whom, where, in which frame.

    Frames (k, 3, 3) are read off H, everything else (arms, inertia 2/5 m r², the half lengths of the box) is geometry.
    """

    def __init__(self, problem: OneStepProblem, simulation: Simulation) -> None:
        contacts = simulation.contacts
        assert problem.bodies is not None and contacts is not None
        a, self.box_mass = simulation.assembly, simulation.assembly.box_mass
        self.radius, self.mass = a.radius, a.mass
        self.compliance = contacts.link_row[:, 6]
        self.i = np.concatenate([contacts.pair[:, 0], contacts.touching[:, 0], contacts.link[:, 0]])
        self.pairs, self.walls, self.links = len(contacts.pair), len(contacts.touching), len(contacts.link)
        self.j = np.concatenate([contacts.pair[:, 1], np.full(self.walls, -1), contacts.link[:, 1]])
        self.axis = contacts.touching[:, 1] // 2
        h = problem.bodies.h.tocsc()
        self.frame = np.array([h[3 * i : 3 * i + 3, 3 * k : 3 * k + 3].toarray().T for k, i in enumerate(self.i)])

    def slice(self, name: str) -> slice:
        """The places of pairs, walls or links among the contacts."""
        start = {"pairs": 0, "walls": self.pairs, "links": self.pairs + self.walls}[name]
        return slice(start, start + getattr(self, name))

    def velocities(self, v: Array, omega: Array, box: Array) -> Array:
        """Relative velocities (3n,) from those of bodies (b, 3), their rotations [1/s] and the rates of the half lengths (3,)."""
        n = self.frame[:, 0]
        turning = np.arange(len(self.i)) < self.pairs + self.walls  # links act on centres
        arm = np.where(turning, self.radius[self.i], 0.0)[:, None]
        u = v[self.i] - arm * np.cross(omega[self.i], n)
        other = self.j >= 0
        j = np.where(other, self.j, 0)
        arm = np.where(turning & other, self.radius[j], 0.0)[:, None]
        u -= np.where(other[:, None], v[j], 0.0) + arm * np.cross(omega[j], n)
        # a link pulls: its frame has the reversed normal, and so has its velocity
        local = np.einsum("ksa,ka->ks", self.frame, u)
        local[self.slice("walls"), 0] += box[self.axis]
        return local.ravel()

    def product(self, r: Array) -> Array:
        """W r, matrix-free: impulses on bodies, velocities of bodies, velocities at the contacts."""
        force = np.einsum("ksa,ks->ka", self.frame, r.reshape(-1, 3))
        v, omega = np.zeros((len(self.mass), 3)), np.zeros((len(self.mass), 3))
        box = np.zeros(3)
        # the arm of the first body is −r n, that of the second +r n; links act on centres
        moment = np.cross(self.frame[:, 0], force) * (np.arange(len(self.i)) < self.pairs + self.walls)[:, None]
        inertia = 0.4 * self.mass * self.radius**2
        for body, sign in ((self.i, 1.0), (self.j, -1.0)):
            there = body >= 0
            k = body[there]
            np.add.at(v, k, sign * force[there] / self.mass[k, None])
            np.add.at(omega, k, -(self.radius / inertia)[k, None] * moment[there])
        walls = self.slice("walls")
        np.add.at(box, self.axis, r.reshape(-1, 3)[walls, 0] / self.box_mass[self.axis])
        out = self.velocities(v, omega, box).reshape(-1, 3)
        out[self.slice("links"), 0] += self.compliance * r.reshape(-1, 3)[self.slice("links"), 0]
        return out.ravel()


def reactions(rows: LocalRows, simulation: Simulation) -> Array:
    """The impulses of the step that was made, (3n,) in the frames of the problem."""
    contacts = simulation.contacts
    assert contacts is not None
    force = np.concatenate([contacts.impulse, contacts.wall_impulse, np.zeros((rows.links, 3))])
    r = np.einsum("ksa,ka->ks", rows.frame, force)
    r[rows.slice("links"), 0] = contacts.tension
    return r.ravel()


def fitted_exponent(x: Array, y: Array) -> tuple[float, float, float]:
    """Slope of log y over log x by least squares, with its 95 % interval (Student)."""
    from scipy.stats import linregress, t

    fit: Any = linregress(np.log(x), np.log(y))
    half = float(t.ppf(0.975, len(x) - 2)) * float(fit.stderr) if len(x) > 2 else float("nan")
    return float(fit.slope), float(fit.slope) - half, float(fit.slope) + half
