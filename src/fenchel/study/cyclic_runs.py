r"""Runs of the cyclic test: loops at stated parameters, elastic slopes against closed forms, and what the numbers depend on.

Slope of a stress along z alone where nothing flows, each wire term acting or not (Hooke with λ = λ_s + λ_w or λ_s, and 2(μ_s + μ_w) or 2μ_s
in the lateral and in the axial direction):

    k = −λ/(2λ + 2μ_r),   E = λ (1 + 2k) + 2μ_z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cyclic import CyclicTest, Loops, cyclic_compression
from .models import MODELS, SETS, model_values

__all__ = [
    "CRITERIA",
    "LONG",
    "LOOPS",
    "elastic_slopes",
    "in_order",
    "loops_of",
    "loops_to_stabilise",
    "refinements",
    "run_model",
    "slope",
    "table_rows",
]

Array = NDArray[np.float64]

CRITERIA = (1e-2, 1e-3, 1e-4)  # change of the end stresses per loop
LOOPS = 20
LONG = 60  # so that late stabilisation is seen


@cache
def _update(model: str) -> Any:
    return MODELS[model].compile("3d")


def run_model(model: str, values: Mapping[str, float], test: CyclicTest) -> Loops:
    """The test on a model, with the values that it has parameters for."""
    return cyclic_compression(_update(model), model_values(MODELS[model], values), test)


def loops_to_stabilise(loops: Loops, criterion: float) -> int:
    """Loops until stabilised; one more than there are if never."""
    return loops.stabilised_at(criterion) or loops.low.size + 1


def loops_of(values: Mapping[str, float], extension: float = 0.0) -> dict[str, Any]:
    """The three models under the test of the study: curves and numbers per loop, and loops to stabilise in a test three times as long."""
    found: dict[str, Any] = {}
    for model in MODELS:
        r = run_model(model, values, CyclicTest(loops=LOOPS, extension=extension))
        long = run_model(model, values, CyclicTest(loops=LONG, extension=extension))
        found[model] = {
            "strain": r.strain, "stress": r.stress, "low": r.low, "high": r.high, "slope_low": r.slope_low, "slope_high": r.slope_high,
            "residual": r.residual, "growth": r.growth, "change": r.change,
            "stabilised": np.array([loops_to_stabilise(long, c) for c in CRITERIA]),
        }  # fmt: skip
    return found


def in_order(peaks: Mapping[str, Array]) -> bool:
    """Whether peaks [Pa] rise from sand over texsol to reinforced sand, in every loop."""
    slack = 1.0 + 1e-9
    return bool(
        (peaks["sand"] <= slack * peaks["texsol"]).all() and (peaks["texsol"] <= slack * peaks["reinforced"]).all()
    )


def slope(model: str, values: Mapping[str, float], *, volume: bool, lateral: bool, axial: bool) -> float:
    """Closed form of the elastic slope [Pa] of a model; the flags say which terms of the wires act: those of growing volume, of lateral and
    of axial extension. Wires of reinforced sand always act, sand has none."""
    lam_s, mu_s = _lame(values["E_s"], values["nu_s"])
    lam_w, mu_w = _lame(values["E_w"], values.get("nu_w", values["nu_s"])) if model != "sand" else (0.0, 0.0)
    acts = (volume, lateral, axial) if model == "texsol" else (True, True, True)
    lam, mu_r, mu_z = lam_s + lam_w * acts[0], mu_s + mu_w * acts[1], mu_s + mu_w * acts[2]
    return lam * (1.0 - 2.0 * lam / (2.0 * lam + 2.0 * mu_r)) + 2.0 * mu_z


def _lame(young: float, poisson: float) -> tuple[float, float]:
    return young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson))


def elastic_slopes(seed: int, samples: int) -> dict[str, Any]:
    """Small tension and compression of virgin material against the closed forms, at random moduli and at the stated sets."""
    rng = np.random.default_rng(seed)
    drawn = [
        SETS["stiff"] | dict(E_s=1e7 * a, E_w=1e7 * a * b, nu_s=float(c), nu_w=float(d))
        for a, b, c, d in zip(
            rng.uniform(0.3, 3.0, samples), 10.0 ** rng.uniform(-2.0, 0.5, samples), *rng.uniform(0.0, 0.45, (2, samples)), strict=True
        )
    ]  # fmt: skip
    worst = dict.fromkeys(MODELS, 0.0)
    for values, model in product(drawn, MODELS):
        measured, closed = _measured(model, values), _closed(model, values)
        worst[model] = max(worst[model], float(np.abs(measured / closed - 1.0).max()))
    ratios = {name: {m: float(_measured(m, v)[0] / _measured(m, v)[1]) for m in MODELS} for name, v in SETS.items()}
    slopes = {name: {m: _measured(m, v) for m in MODELS} for name, v in SETS.items()}
    return {"worst": worst, "ratios": ratios, "slopes": slopes}


def _measured(model: str, values: Mapping[str, float], size: float = 1e-6) -> Array:
    """Slopes in tension and in compression [Pa]."""
    from ..integrators import drive_arrays

    targets = np.zeros((4, 6))
    targets[1::2, 2] = size, -size
    history = drive_arrays(
        _update(model), [True, True, False, True, True, True], targets, model_values(MODELS[model], values)
    )
    return history.sig[1::2, 2] / targets[1::2, 2]


def _closed(model: str, values: Mapping[str, float]) -> Array:
    return np.array([
        slope(model, values, volume=True, lateral=False, axial=True),
        slope(model, values, volume=False, lateral=True, axial=False),
    ])  # fmt: skip


def refinements(name: str, steps: Sequence[int]) -> dict[str, Any]:
    """What the loops depend on: steps per half loop; and the same loops on one linear finite element."""
    values = SETS[name]
    counts, residuals = {}, {}
    for model in MODELS:
        found = [run_model(model, values, CyclicTest(loops=LONG, steps=n)) for n in steps]
        counts[model] = np.array([loops_to_stabilise(f, 1e-3) for f in found])
        residuals[model] = np.array([f.residual[LOOPS - 1] for f in found])
    return {"loops": counts, "residual": residuals, "element": {model: _one_element(model, values) for model in MODELS}}


def _one_element(model: str, values: Mapping[str, float], loops: int = 3) -> float:
    """Largest difference [-] of the end forces between one axisymmetric element with a free side and the material point."""
    from ..integrators.fe import Body, Support, cylinder_section, solve

    test = CyclicTest(loops=loops, steps=10)
    point = run_model(model, values, test)
    update = MODELS[model].compile("axisymmetric")
    body = Body(cylinder_section(0.05, 0.1, 1, 1), update, model_values(MODELS[model], values), "axisymmetric", "Q1")
    times, strain = np.arange(point.strain.size, dtype=float), test.axial()
    supports = [
        Support("axis", x=0.0), Support("bottom", y=0.0), Support("top", y=lambda t: 0.1 * float(np.interp(t, times, strain))),
    ]  # fmt: skip
    top = body.basis.get_dofs("top").all(["u^2"])
    stress = np.array([s.force[top].sum() for s in solve(body, times, supports)]) / (np.pi * 0.05**2)
    return float(np.abs(stress - point.stress[1:]).max() / np.abs(point.stress).max())


def table_rows() -> dict[str, Any]:
    """The rows of Table 3 of the study, by confining pressure of its triaxial tests: loops to stabilise and residual strain."""
    from .identification_claims import STUDY_TABLE

    pressure = STUDY_TABLE["P"]
    loops = {model: np.zeros(pressure.size, dtype=np.int64) for model in MODELS}
    residual = {model: np.zeros(pressure.size) for model in MODELS}
    for row, model in product(range(pressure.size), MODELS):
        values = SETS["table 3"] | {k: float(STUDY_TABLE[k][row]) for k in ("E_s", "E_w", "H_k", "H_i")}
        found = run_model(model, values, CyclicTest(loops=LONG))
        loops[model][row] = loops_to_stabilise(found, 1e-3)
        residual[model][row] = found.residual[LOOPS - 1]
    return {"pressure": pressure, "loops": loops, "residual": residual}
