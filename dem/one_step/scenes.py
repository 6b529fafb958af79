r"""The next step of a simulation as a one-step problem in global form, to be solved by any solver or written as an FCLIB file.

Degrees of freedom: v and r·ω of each body (r²/I = 5/(2m): the inverse mass of r·ω is 2.5/m), then those of box and planes. Contacts are
rows n, t₁, t₂ with u = v_i − v_j − (r_i ω_i + r_j ω_j) × n. What the format has no word for is put into its terms without approximation:

* a compliance c on a row is one more degree of freedom of mass 1/c that the row alone moves: Hᵀ M⁻¹ H gains c;
* a body or plane of infinite mass, or one that is driven, moves the rows through w and has no degree of freedom in H;
* a wire pulls: a frictionless contact with the normal reversed; a rod is two of them, opposed;
* a frictionless wall is a contact with μ = 0, the shift b of the law goes into w.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import InputError
from ..rows import Contacts
from ..stepping import Drive, Simulation
from .problem import OneStepProblem

__all__ = ["problem_of"]

Array = NDArray[np.float64]
Index = NDArray[np.integer]


@dataclass
class _Rows:
    """Triplets of H, shifts w and coefficients, three rows a contact."""

    row: list[Index] = field(default_factory=list)
    dof: list[Index] = field(default_factory=list)
    value: list[Array] = field(default_factory=list)
    shift: list[Array] = field(default_factory=list)
    mu: list[Array] = field(default_factory=list)
    soft: list[tuple[list[Index], Array]] = field(
        default_factory=list
    )  # rows (−1 − row: reversed) that share compliances
    count: int = 0

    def new(self, shift: Array, mu: Array) -> Index:
        """Numbers of the first rows of as many contacts as `mu` has entries; `shift` (k, 3)."""
        first = self.count + 3 * np.arange(len(mu))
        self.count += 3 * len(mu)
        self.shift.append(shift)
        self.mu.append(mu)
        return first

    def add(self, row: Index, dof: Index, value: Array) -> None:
        self.row.append(row)
        self.dof.append(dof)
        self.value.append(value)


def problem_of(simulation: Simulation, step: float, drive: Drive, *, title: str = "") -> OneStepProblem:
    """The problem that `simulation.advance(step, drive)` would solve; the simulation is left as it is.

    Reactions are impulses [N s], velocities [m/s]. Order of the contacts: between bodies, with box and planes, links. Raises `InputError`
    for scenes of two dimensions (FCLIB problems of fenchel have three) and for laws with a least impulse other than zero (cohesion).
    """
    a = simulation.assembly
    if a.dimension != 3:
        raise InputError(
            "a scene of two dimensions makes no one-step problem: those are written for three (normal, two tangents)"
        )
    law = simulation.laws.contact
    if law is not None and law.rule().least:
        raise InputError(
            f"the contact law {law.label} has a least impulse other than zero: such a law is no Coulomb cone"
        )
    probe = Simulation(
        a.copy(),
        simulation.laws,
        simulation.solver,
        planes=simulation.planes,
        skin=simulation.skin,
        theta=simulation.theta,
    )
    probe.push_out = simulation.push_out
    _, free, _, motion, _, _ = probe.assemble(step, drive)
    args = probe.problem(step, drive)
    contacts: Contacts = args["contacts"]
    turn = np.where(a.locked, 0.0, 2.5 * free[:, 6])
    inverse = np.concatenate([np.repeat(free[:, 6], 3), np.repeat(turn, 3), motion[:, 1]])
    velocity = np.concatenate([free[:, 0:3].ravel(), free[:, 3:6].ravel(), motion[:, 0]])
    rows = _Rows()
    _add_pairs(rows, contacts, free[:, 6], turn)
    _add_planes(rows, simulation, contacts, args, free[:, 6], turn)
    if len(contacts.link):
        _add_links(rows, contacts, bool(simulation.laws.wire and simulation.laws.wire.rule().unilateral))
    return _closed(rows, inverse, velocity, title)


def _add_pairs(rows: _Rows, contacts: Contacts, w: Array, turn: Array) -> None:
    table, i, j = contacts.contact, contacts.pair[:, 0], contacts.pair[:, 1]
    frames, mu, w_n = _frames(table[:, 0:3]), table[:, 12], w[i] + w[j]
    cn = _compliance(table[:, 10], w_n)
    ct = np.where(mu > 0.0, _compliance(table[:, 11], w_n + turn[i] + turn[j]), 0.0)
    shift = -ct[:, None] * np.einsum("ksa,ka->ks", frames, table[:, 6:9])
    shift[:, 0] = table[:, 9]
    first = rows.new(shift, mu)
    _join(rows, first, i, frames, len(w), 1.0)
    _join(rows, first, j, frames, len(w), -1.0)
    _soften(rows, first, cn, ct)


def _add_planes(
    rows: _Rows, simulation: Simulation, contacts: Contacts, args: dict[str, Any], w: Array, turn: Array
) -> None:
    """Contacts with box and planes: the degree of freedom of the plane acts on the normal, its sliding is given."""
    i, plane = contacts.touching[:, 0], contacts.touching[:, 1]
    own = [p.friction for p in simulation.planes]
    mu = np.concatenate([np.zeros(len(args["normal"]) - len(own)), own])[plane]
    frames = _frames(args["normal"][plane])
    dof, sense, motion = args["dof"][plane], args["sense"][plane], args["motion_free"]
    table = contacts.wall_row
    cn = _compliance(table[:, 2], w[i] + motion[dof, 1])
    shift = -np.einsum("ksa,ka->ks", frames, args["slide"][plane])
    shift[:, 0] = table[:, 1]
    ct = np.zeros(len(i))
    kernel = contacts.kernels[1]
    if kernel is not None and "e" in kernel.columns.starts and "it" in kernel.columns.starts:
        at, it = kernel.columns.starts["e"], kernel.columns.starts["it"]
        ct = np.where(mu > 0.0, _compliance(contacts.touching_row[:, it], w[i] + turn[i]), 0.0)
        before = np.einsum("ksa,ka->ks", frames, contacts.touching_row[:, at : at + 3])
        shift[:, 1:] -= ct[:, None] * before[:, 1:]
    first = rows.new(shift, mu)
    _join(rows, first, i, frames, len(w), 1.0)
    rows.add(first, 6 * len(w) + dof, -sense)
    _soften(rows, first, cn, ct)


def _add_links(rows: _Rows, contacts: Contacts, unilateral: bool) -> None:
    """A wire as a contact that pulls: u' = −(u_n + β) + c r; a rod as two opposed ones, which share its compliance."""
    table, i, j = contacts.link_row, contacts.link[:, 0], contacts.link[:, 1]
    frames = _frames(table[:, 0:3])
    compliances = []
    for sign in (-1.0,) if unilateral else (-1.0, 1.0):
        shift = np.zeros((len(table), 3))
        shift[:, 0] = sign * table[:, 4]
        first = rows.new(shift, np.zeros(len(table)))
        for body, side in ((i, sign), (j, -sign)):
            for axis in range(3):
                rows.add(first, 3 * body + axis, side * frames[:, 0, axis])
        compliances.append(first)
    held = np.flatnonzero(table[:, 6] > 0.0)
    rows.soft.append(([-c[held] - 1 if k else c[held] for k, c in enumerate(compliances)], table[held, 6]))


def _frames(normal: Array) -> Array:
    """Rows normal, t₁, t₂ of each contact, shape (k, 3, 3)."""
    helper = np.zeros(normal.shape)
    helper[np.arange(len(normal)), np.argmin(np.abs(normal), axis=1)] = 1.0
    first = np.asarray(np.cross(normal, helper), dtype=np.float64)
    first /= np.sqrt(np.sum(first * first, axis=1, keepdims=True))
    second = np.asarray(np.cross(normal, first), dtype=np.float64)
    return np.stack([normal, first, second], axis=1)


def _compliance(inverse_sum: Array, w: Array) -> Array:
    """c of 1/(W + c), zero where it is round-off of W."""
    c = 1.0 / inverse_sum - w
    return np.where(c > 1e-13 * w, c, 0.0)


def _join(rows: _Rows, first: Index, body: Index, frames: Array, n: int, sign: float) -> None:
    """Velocity and rotation of one of the bodies in the rows: u = ± v − (r ω) × n."""
    for s in range(3):
        for axis in range(3):
            rows.add(first + s, 3 * body + axis, sign * frames[:, s, axis])
    for s in (1, 2):
        lever = np.cross(frames[:, s], frames[:, 0])  # −t · (s × n) = s · (t × n)
        for axis in range(3):
            rows.add(first + s, 3 * n + 3 * body + axis, lever[:, axis])


def _soften(rows: _Rows, first: Index, cn: Array, ct: Array) -> None:
    """A degree of freedom of its own for every compliant row."""
    for s, c in ((0, cn), (1, ct), (2, ct)):
        held = np.flatnonzero(c > 0.0)
        rows.soft.append(([first[held] + s], c[held]))


def _closed(rows: _Rows, inverse: Array, velocity: Array, title: str) -> OneStepProblem:
    row, dof, value = np.concatenate(rows.row), np.concatenate(rows.dof), np.concatenate(rows.value)
    w = np.concatenate(rows.shift).ravel()
    given = inverse == 0.0  # of infinite mass, or driven: what it does is known
    moved = given[dof]
    np.add.at(w, row[moved], value[moved] * velocity[dof[moved]])
    row, dof, value = row[~moved], dof[~moved], value[~moved]
    mass, dofs = np.where(given, 1.0, 1.0 / np.where(given, 1.0, inverse)), len(inverse)
    parts = [(row, dof, value)]
    masses = [mass]
    for ends, c in rows.soft:
        own = dofs + np.arange(len(c))
        parts += [
            (end, own, np.ones(len(c))) if np.all(end >= 0) else (-end - 1, own, -np.ones(len(c))) for end in ends
        ]
        masses.append(1.0 / c)
        dofs += len(c)
    row, dof, value = (np.concatenate([part[k] for part in parts]) for k in range(3))
    h = sp.csr_matrix((value, (dof, row)), shape=(dofs, rows.count))
    whole = np.concatenate(masses)
    free = np.concatenate([velocity, np.zeros(dofs - len(velocity))])
    return OneStepProblem.of_bodies(sp.diags(whole), h, whole * free, w, np.concatenate(rows.mu), title=title)
