r"""Part K: are the homogenised fields what the identification takes them for?

Identities (Love–Weber split by phase, Gauss's theorem for the strain, exactness of the best fit) to rounding on the states that the
triaxial tests left; then the assumptions: one strain for both phases, stresses that add, a sphere that keeps clear of the walls, and
strain measures that agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Task
from ..dem.measures import Network, best_fit_gradient, boundary_gradient, delaunay_gradient, phase_mismatch
from ..dem.record import mandel
from ..errors import FenchelError
from ..identify.tasks import Prepare, Test
from .bead_claims import moved
from .claim import FAIL, PASS, UNDECIDED, Claim, Outcome, Part, Picture, Verdict, decided, judged, taken, unjudged
from .deposit_claims import settings_of
from .field_measures import branches, mean_pressure, sphere_stress
from .grain_runs import BASE, PRESSURE, triaxial
from .length_claims import triaxial_network
from .sizes import Size
from .statistics import few, mean_of

__all__ = ["FIELDS"]

Array = NDArray[np.float64]

CLAIMS = (
    Claim(59, "T", "Love–Weber, the split by phase, Bagi's strain and the best fit are identities.", "1e-12 relative."),
    Claim(
        60, "Q", "Grains and wires share one strain in the triaxial test.",
        "Mismatch below 10 %, bootstrap interval over grains and whole wires.",
    ),
    Claim(61, "T", "The stresses of the phases add up to that of the walls.", "Within 5 % of the wall stress, all along the tests."),
    Claim(
        62, "Q", "A spherical domain limits edge effects.",
        "Pressure in the sphere of 0.8 half widths closer to that of smaller spheres than that of the box.",
    ),
    Claim(63, "Q", "Strain measures agree.", "Bagi's and the best-fit strain within 5 %; that of the walls beside them."),
)  # fmt: skip


class _State:
    def __init__(self, size: Size, folder: Path, results: Mapping[str, Any]) -> None:
        self.size, self.folder = size, folder
        self.records = [
            taken(results, f"{BASE}, seed {seed}: {PRESSURE / 1e3:g} kPa, links on")
            for seed in range(1, size.seeds + 1)
        ]
        tasks = triaxial(size.grains, size.seeds, folder)
        self.pairs = [
            (p, t)
            for p, t in zip(tasks[::2], tasks[1::2], strict=True)
            if isinstance(p, Prepare) and isinstance(t, Test)
        ]
        self.networks = [triaxial_network(size, folder, seed) for seed in range(1, size.seeds + 1)]
        self.settings = settings_of(size) | {"pressure [Pa]": PRESSURE, "axial strain": -0.01}


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    return triaxial(size.grains, size.seeds, folder) if wanted & FIELDS.numbers else []


def _judge(size: Size, folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {59: _identities, 60: _one_strain, 61: _additive, 62: _sphere, 63: _measures}
    if not wanted & FIELDS.numbers:
        return []
    try:
        state = _State(size, folder, results)
    except FenchelError as problem:
        return unjudged(CLAIMS, wanted, problem)
    return judged(CLAIMS, wanted, lambda n: makers[n](state))


def _off(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b) / max(np.linalg.norm(a), np.linalg.norm(b)))


def _by_body(network: Network) -> Array:
    """Σ f ⊗ x over the walls, less the net forces of the bodies ⊗ their centres (3, 3) [J]: the mean stress times the volume."""
    net = np.zeros_like(network.x)
    contact = network.normal_force[:, None] * network.normal + network.tangential_force
    pull = network.tension[:, None] * network.link_vector / network.link_length[:, None]
    pushed = network.wall_force[:, None] * network.wall_normal
    for pairs, force in ((network.pair, contact), (network.link, pull)):
        np.add.at(net, pairs[:, 0], force)
        np.add.at(net, pairs[:, 1], -force)
    np.add.at(net, network.wall[:, 0], pushed)
    body, plane = network.wall.T
    place = network.x[body].copy()
    place[np.arange(len(body)), plane // 2] = np.where(plane % 2, 1.0, -1.0) * network.half[plane // 2]
    return np.einsum("ki,kj->ij", pushed, place) - np.einsum("ki,kj->ij", net, network.x)


def _identities(s: _State) -> Verdict:
    worst: dict[str, float] = dict.fromkeys(
        ("whole box", "walls", "contacts in the sphere", "links in the sphere", "hull", "best fit", "cells"), 0.0
    )
    for seed, (network, record, pair) in enumerate(zip(s.networks, s.records, s.pairs, strict=True)):
        _, vector, force = branches(network)
        whole = np.einsum("ki,kj->ij", force, vector)
        volume = float(np.prod(2.0 * network.half))
        history = record.history()
        sphere = float((3.0 * record.octant_volume.sum() / (4.0 * np.pi)) ** (1.0 / 3.0))
        x, u, _, wire, _ = moved(*pair)
        x, u = x[wire < 0], u[wire < 0]
        gradient = np.random.default_rng([59, seed]).normal(size=(3, 3)) * 1e-2
        here = {
            "whole box": _off(mandel(whole) / volume, record.box_stress[-1]),
            "walls": _off(whole, _by_body(network)),
            "contacts in the sphere": _off(
                mandel(sphere_stress(branches(network, links=False), np.zeros(3), sphere)),
                history.stress_grains[-1] + history.stress_beads[-1],
            ),
            "links in the sphere": _off(
                mandel(sphere_stress(branches(network, links=True), np.zeros(3), sphere)), history.stress_links[-1]
            ),
            "hull": _off(delaunay_gradient(x, u)[0], boundary_gradient(x, u)[0]),
            "best fit": _off(best_fit_gradient(x, x @ gradient.T), gradient),
            "cells": _off(delaunay_gradient(x, x @ gradient.T)[0], gradient),
        }
        worst = {name: max(value, here[name]) for name, value in worst.items()}
    largest = max(worst.values())
    return Verdict(
        claim=59,
        outcome=decided(largest <= 1e-12),
        sentence=f"Stress along branches against stress by bodies and phases and against the walls; strain by cells against that "
        f"of their hull; "
        f"affine fields: largest relative difference on {len(s.networks)} samples {largest:.1e}.",
        value=largest, numbers=worst, settings=s.settings,
    )  # fmt: skip


def _one_strain(s: _State) -> Verdict:
    rows = []
    for prepare, test in s.pairs:
        x, u, _, wire, half = moved(prepare, test)
        inside = np.linalg.norm(x, axis=1) < 0.8 * half.min()
        rng = np.random.default_rng([60, test.seed])
        rows.append(
            phase_mismatch(x[inside], u[inside], wire[inside], rng, samples=min(s.size.permutations, 400), level=0.95)
        )
    found, corrected = mean_of([r.mismatch for r in rows]), mean_of([r.corrected for r in rows])
    noise, low, high = (float(np.mean([getattr(r, name) for r in rows])) for name in ("noise", "low", "high"))
    outcome: Outcome = PASS if high < 0.1 else FAIL if low > 0.1 and corrected.value > 0.1 else UNDECIDED
    return Verdict(
        claim=60,
        outcome=outcome,
        sentence=f"‖ε_s − ε_w‖/‖ε_s‖ is {found.text('.2g')} at 1 % (bootstrap [{low:.2g}, {high:.2g}]), {corrected.value:.2g} less "
        f"what noise adds; "
        f"two halves of the grains differ by {noise:.2g}.",
        value=found.value, low=low, high=high,
        numbers={"mismatch": found.numbers(), "corrected": corrected.numbers(), "halves_of_grains": noise}, settings=s.settings,
        needed="" if outcome != UNDECIDED else "samples of more grains: the bootstrap interval contains 10 %",
    )  # fmt: skip


def _additive(s: _State) -> Verdict:
    worst = max(r.quality["wall_box_difference"] for r in s.records)
    sphere = max(r.quality["wall_sphere_difference"] for r in s.records)
    return Verdict(
        claim=61,
        outcome=decided(worst < 0.05),
        sentence=f"The stresses of the phases over the box differ from that of the walls by {100 * worst:.2g} % at most along all "
        f"tests; over the "
        f"sphere by {100 * sphere:.2g} %.",
        value=worst, numbers={"box": worst, "sphere": sphere}, settings=s.settings,
    )  # fmt: skip


def _sphere(s: _State) -> Verdict:
    shares = np.array([0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
    rows, boxes = [], []
    for network in s.networks:
        parts = branches(network)
        wall = float(
            np.mean(
                [
                    network.wall_force[network.wall[:, 1] == k].sum() / np.prod(np.delete(2 * network.half, k // 2))
                    for k in range(6)
                ]
            )
        )
        _, vector, force = parts
        whole = np.einsum("ki,kj->ij", force, vector) / np.prod(2 * network.half)
        rows.append([mean_pressure(sphere_stress(parts, np.zeros(3), c * network.half.min())) / wall for c in shares])
        boxes.append(mean_pressure(whole) / wall)
    means = [mean_of([r[k] for r in rows]) for k in range(len(shares))]
    inner = float(np.mean([m.value for m in means[:3]]))
    box = mean_of(boxes)
    closer = abs(means[3].value - inner) < abs(box.value - inner)
    return Verdict(
        claim=62,
        outcome=decided(closer),
        sentence=f"Pressure over that of the walls: {means[0].value:.3f} in the sphere of 0.5 half widths, {means[3].value:.3f} in "
        f"that of 0.8, "
        f"{means[5].value:.3f} in that of 1.0, {box.value:.3f} in the box: next to a wall half a grain carries nothing, the sphere "
        f"sees the inside.",
        value=means[3].value, low=means[3].low, high=means[3].high,
        numbers={"radius_over_half_width": shares.tolist(), "sphere_over_wall": [m.value for m in means], "box_over_wall": box.value},
        settings=s.settings,
    )  # fmt: skip


def _measures(s: _State) -> Verdict:
    off, wall, best_zz, bagi_zz = [], [], [], []
    for (prepare, test), record in zip(s.pairs, s.records, strict=True):
        x, u, _, wire, half = moved(prepare, test)
        inside = (np.linalg.norm(x, axis=1) < 0.8 * half.min()) & (wire < 0)
        fit, cells = best_fit_gradient(x[inside], u[inside]), delaunay_gradient(x[inside], u[inside])[0]
        fit, cells = 0.5 * (fit + fit.T), 0.5 * (cells + cells.T)
        box = np.diag(record.wall_strain[-1, :3])
        off.append(_off(fit, cells))
        wall.append(_off(fit, box))
        best_zz.append(fit[2, 2])
        bagi_zz.append(cells[2, 2])
    found, outside = mean_of(off), mean_of(wall)
    return Verdict(
        claim=63,
        outcome=PASS if found.value < 0.05 else FAIL if found.low > 0.05 else UNDECIDED,
        sentence=f"Bagi's and the best-fit strain in the sphere differ by {found.text('.2g')} of their size (ε_zz "
        f"{np.mean(bagi_zz):.5f} and "
        f"{np.mean(best_zz):.5f}); the strain of the walls differs from the best fit by {outside.text('.2g')}.",
        value=found.value, low=found.low, high=found.high,
        numbers={"bagi_to_best_fit": found.numbers(), "walls_to_best_fit": outside.numbers()}, settings=s.settings,
        needed="" if found.value < 0.05 or found.low > 0.05 else few(found, 0.05),
    )  # fmt: skip


def _pictures(_size: Size, _folder: Path, _results: Mapping[str, Any]) -> list[Picture]:
    return []


FIELDS = Part("K", "Homogenised fields", CLAIMS, _tasks, _judge, _pictures)
