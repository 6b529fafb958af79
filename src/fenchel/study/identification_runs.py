"""Tasks of the identification: tests of grains and wires at several pressures, the law identified from them, and planted data."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Computation, Task
from ..dem.record import PhaseHistory
from ..dem.run import load_record
from ..identify.curves import Curves, curves
from ..identify.elastic import elastic_moduli, unit_wire
from ..identify.fit import fit_law
from ..identify.hardening import misfit_of, sensitivity
from ..identify.identification import identify_law
from ..identify.jsonable import jsonable
from ..identify.options import IdentifyOptions, Specimen
from ..identify.parameters import LawParameters
from ..identify.replay import replay
from ..identify.study import Study
from ..identify.tasks import Prepare, Test
from .grain_runs import Setting, study_of
from .sizes import Size, size_named

__all__ = [
    "GRAINS", "TABLE_3", "choice_task", "identify_study", "identify_tasks", "planted", "planted_tasks", "planted_tests",
]  # fmt: skip

Array = NDArray[np.float64]

LABEL = "identify"
CYCLE = (0.0, -0.01, 0.006, -0.01)
TABLE_3 = LawParameters(E_s=12.167e6, E_w=0.332e6, nu=0.2, theta_f=0.079, C_0=2842.0, H_k=0.944e6, H_i=0.472e6)
GRAINS = LawParameters(E_s=13e6, E_w=0.9e6, nu=0.12, theta_f=0.30, C_0=4500.0, H_k=2.6e6, H_i=0.15e6)


def identify_study(size: Size) -> Study:
    """The study whose law is identified: two beads per grain, wires of 60 beads, free of tension at each pressure."""
    setting = Setting(
        per_grain=2.0, path=CYCLE, pressures=size.pressures, held_out=size.held_out,
        seeds=tuple(range(1, size.identify_seeds + 1)),
    )  # fmt: skip
    return study_of(size.identify_grains, setting)


def _runs(size: Size, folder: Path) -> tuple[list[Prepare], list[Test]]:
    study = identify_study(size)
    seeds = study.solve.seeds
    tests = [Test(study, seed, p, on, folder, LABEL) for seed in seeds for p in study.pressures for on in (True, False)]
    return [Prepare(study, seed, folder, LABEL) for seed in seeds], tests


def identified(size: str, folder: Path) -> dict[str, Any]:
    """The law from the tests of a size: every number of the identification, as JSON text, and the curves of the first pressure."""
    import json

    whole = size_named(size)
    study = identify_study(whole)
    specimens = []
    for seed in study.solve.seeds:
        mine = [t for t in _runs(whole, folder)[1] if t.seed == seed]
        specimens.append(
            Specimen(
                seed=seed,
                linked={t.pressure: load_record(t.run_file) for t in mine if t.linked},
                control={t.pressure: load_record(t.run_file) for t in mine if not t.linked},
            )
        )
    found = identify_law(specimens, study.options())
    numbers = jsonable(found)
    del numbers["seconds"]
    tests = [curves(t.history()) for s in specimens for t in s.linked.values()]
    hard = found.pooled.hardening
    assert hard is not None
    monotone = _cut(tests)
    block = {
        name: np.linalg.svd(sensitivity(group, found.law, ("H_k", "H_i"), replay), compute_uv=False)
        for name, group in (("cycle", tests), ("first leg", monotone))
    }
    own = {
        "nu_wire_alone": _poisson_of_wires(tests, study.options()),
        "H_eff_by_pressure": np.array([_hardening(group, found) for group in _grouped(tests)]),
        "pressures": np.array(sorted({t.pressure for t in tests})),
        "condition_cycle": float(block["cycle"][0] / block["cycle"][1]),
        "condition_first_leg": float(block["first leg"][0] / max(block["first leg"][1], 1e-300)),
    }
    return {"identification": json.dumps(numbers, sort_keys=True), **own}


def _grouped(tests: list[Curves]) -> list[list[Curves]]:
    return [[t for t in tests if t.pressure == p] for p in sorted({t.pressure for t in tests})]


def _cut(tests: list[Curves]) -> list[Curves]:
    """The first legs."""
    from dataclasses import fields, replace

    out = []
    for t in tests:
        first = t.leg == 0
        arrays = {f.name: getattr(t, f.name)[first] for f in fields(t) if f.name != "pressure"}
        out.append(replace(t, **arrays))
    return out


def _hardening(tests: list[Curves], found: Any) -> float:
    """H_eff at one pressure, least squares of √J₂ = C_0 + t P_s + H_eff p with the pooled C_0 and t, first legs."""
    from ..identify.curves import deviator, pressure
    from ..identify.yielding import plastic_strain

    e, y = found.pooled.elastic, found.pooled.yielding
    top = bottom = 0.0
    for t in tests:
        _, p = plastic_strain(t, e.E_s, e.nu)
        rows = (t.leg == 0) & (p >= 2e-4)
        rest = deviator(t.sand)[rows] / np.sqrt(3.0) - y.C_0 - y.t * pressure(t.sand)[rows]
        top, bottom = top + float(rest @ p[rows]), bottom + float(p[rows] @ p[rows])
    return top / bottom


def _poisson_of_wires(tests: list[Curves], options: IdentifyOptions) -> float:
    """ν that fits the wire stress alone, by the unilateral law."""
    from scipy.optimize import minimize_scalar

    strain, stress = [], []
    for t in tests:
        rows = (t.leg == 0) & (np.abs(t.box_strain) <= options.window_wire)
        strain.append(t.strain[rows])
        stress.append((t.wire - t.wire[0])[rows])
    e, s = np.concatenate(strain), np.concatenate(stress)

    def misfit(nu: float) -> float:
        m = unit_wire(e, nu)
        return float(np.sum((s - m * float(np.sum(m * s)) / float(np.sum(m * m))) ** 2))

    answer: Any = minimize_scalar(misfit, bounds=(0.0, 0.49), method="bounded")
    return float(answer.x)


def planted_tests(
    law: LawParameters,
    pressures: tuple[float, ...],
    path: tuple[float, ...] = CYCLE,
    *,
    step: float = 5e-5,
    noise: float = 0.0,
    seed: int = 0,
) -> list[Curves]:
    """Tests made by the law itself; `noise` is relative to the pressure (stress) and to 1e-3 (strain)."""
    legs = [np.linspace(a, b, max(2, round(abs(b - a) / step) + 1)) for a, b in pairwise(path)]
    axial = np.concatenate([[path[0]], *(leg[1:] for leg in legs)])
    leg = np.concatenate([[0], *(np.full(len(part) - 1, k) for k, part in enumerate(legs))])
    rng = np.random.default_rng([13, seed])
    out = []
    for p in pressures:
        run = replay(law, p, axial)
        stress = run.stress + noise * p * rng.normal(size=run.stress.shape)
        strain = run.strain + noise * 1e-3 * rng.normal(size=run.strain.shape)
        zero = np.zeros_like(stress)
        out.append(
            curves(
                PhaseHistory(
                    pressure=p, linked=True, leg=leg, axial_strain=axial, wall_strain=strain, wall_stress=stress, strain_sand=strain,
                    strain_wire=strain, stress_grains=stress - run.wire, stress_beads=zero, stress_links=run.wire,
                )
            )
        )  # fmt: skip
    return out


def planted(samples: int) -> dict[str, Any]:
    """What the procedure makes of data whose parameters are known: recovery, conditioning, intervals under noise, cost surface."""
    pressures = (5e4, 7e4, 9e4)
    options = IdentifyOptions(fit_frames=100)
    out: dict[str, Any] = {}
    for name, law in (("table_3", TABLE_3), ("grains", GRAINS)):
        fit = fit_law(planted_tests(law, pressures), options, replay)
        truth = law.to_json()
        out[name] = {key: fit.parameters.to_json()[key] / truth[key] - 1.0 for key in truth}
        block = {}
        for path_name, path in (
            ("reversal", CYCLE),
            ("monotone", (0.0, -0.01)),
            ("unloading", (0.0, -0.01, -0.0085, -0.01)),
        ):
            tests = planted_tests(law, pressures, path)
            values = np.linalg.svd(sensitivity(tests, law, ("H_k", "H_i"), replay), compute_uv=False)
            block[path_name] = float(values[0] / max(values[1], 1e-300))
        out[name]["condition"] = block
        single = fit_law(planted_tests(law, pressures, (0.0, -0.01)), options, replay)
        assert single.hardening is not None
        joint = single.hardening.joint
        exact = law.H_k * (0.5 + law.t**2 / 3.0) + law.H_i
        out[name]["monotone"] = {
            "separable": joint.separable, "H_k_error": joint.parameters.H_k / law.H_k - 1.0, "H_eff_error": joint.H_eff / exact - 1.0,
        }  # fmt: skip
    out["noise"] = _coverage(GRAINS, pressures, max(8, samples // 25))
    out["surface"] = _surface(TABLE_3, pressures)
    return out


def _coverage(law: LawParameters, pressures: tuple[float, ...], realisations: int) -> dict[str, float]:
    """Share of noise realisations whose 95 % interval from the scatter of the others holds the planted moduli."""
    from scipy.stats import t as student

    found = [
        elastic_moduli(planted_tests(law, pressures, (0.0, -0.005), step=2e-5, noise=0.002, seed=k), IdentifyOptions())
        for k in range(realisations)
    ]
    out: dict[str, float] = {"realisations": float(realisations), "noise": 0.002}
    for name in ("E_s", "E_w", "nu"):
        x = np.array([getattr(f, name) for f in found])
        truth = getattr(law, name)
        half = float(student.ppf(0.975, len(x) - 2)) * np.array([np.delete(x, k).std(ddof=1) for k in range(len(x))])
        out[f"{name}_coverage"] = float(np.mean(np.abs(x - truth) <= half * np.sqrt(1.0 + 1.0 / (len(x) - 1))))
        out[f"{name}_bias"] = float(x.mean() / truth - 1.0)
        out[f"{name}_deviation"] = float(x.std(ddof=1) / truth)
    return out


def _surface(law: LawParameters, pressures: tuple[float, ...], count: int = 13) -> dict[str, Array]:
    """Misfit of q over (H_k, H_i) around the planted point, rms / max|q|, without and with a reversal."""
    from dataclasses import replace

    scale = np.linspace(0.4, 1.6, count)
    out = {"H_k": scale * law.H_k, "H_i": scale * law.H_i}
    for name, path in (("monotone", (0.0, -0.01)), ("reversal", CYCLE)):
        tests = planted_tests(law, pressures[:1], path, step=2e-4)
        out[name] = np.array(
            [[misfit_of(tests, replace(law, H_k=k, H_i=i), replay) for i in out["H_i"]] for k in out["H_k"]]
        )
    return out


def identify_tasks(size: Size, folder: Path) -> list[Task]:
    """The tests, the identification from them."""
    prepare, tests = _runs(size, folder)
    names = tuple(t.name for t in tests)
    return [
        *prepare,
        *tests,
        Computation("L: identification", identified, folder, {"size": size.name}, names, cost=8.0, in_folder=True),
    ]


def choice_task(size: Size, folder: Path) -> Computation:
    """The three costs on the linked tests of the identification."""
    from .formulation_choice import discrete_choice

    linked = [t for t in _runs(size, folder)[1] if t.linked]
    return Computation(
        "choice: grains", discrete_choice, folder, {"files": [t.run_file.name for t in linked], "seed": 1},
        tuple(t.name for t in linked), cost=6.0, in_folder=True,
    )  # fmt: skip


def planted_tasks(size: Size, folder: Path) -> list[Task]:
    """Planted data."""
    return [Computation("L: planted data", planted, folder, {"samples": size.samples}, cost=4.0)]
