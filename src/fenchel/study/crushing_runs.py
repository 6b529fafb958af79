"""Runs of the crushing test: the maps of the wire phase, mesh refinement, and where reinforced sand shows wire pressures of both signs.

The wire pressure is computed in two more ways: from the eigenvalues ε_i of the strain, −λ_w ⟨tr ε⟩ − ⅔ μ_w Σ⟨ε_i⟩, and as what the stress
of the body leaves when the stress K_s:(ε − ε^p) of the sand is taken away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .crushing import CrushingTest, WireMap, crush
from .models import MODELS, SETS, equivalent_stress, model_values, wire_stress

__all__ = ["both_signs", "point_force", "refined", "wire_map", "wire_pressures"]

Array = NDArray[np.float64]

DIAMETER = 0.1  # m
LONG = 0.01  # shortening up to which both signs are looked for


@cache
def _update(model: str) -> Any:
    return MODELS[model].compile("axisymmetric")


def _crush(model: str, name: str, test: CrushingTest) -> WireMap:
    return crush(model, _update(model), model_values(MODELS[model], SETS[name]), test)


def wire_map(model: str, name: str, rough: bool = True, steps: int = 10) -> dict[str, Any]:
    """The test on 20 × 20 elements with the parameters of a set; averages over the elements, and the numbers of the claims."""
    values = SETS[name]
    found = _crush(model, name, CrushingTest(rough=rough, steps=steps))
    by_law, by_difference = wire_pressures(found, values, model)
    body = found.body
    middle = body.mesh.p[:, body.mesh.t].mean(axis=1)
    cells = {
        "r": middle[0],
        "z": middle[1],
        "pressure": body.average(found.pressure),
        "equivalent": body.average(found.equivalent),
    }
    bilateral = equivalent_stress(wire_stress("reinforced", found.strain, values))
    scale = float(np.abs(found.state.stress).max())
    return {
        "elements": int(body.mesh.t.shape[1]), "force": found.force, "point force": point_force(model, values, found.force.size),
        "lowest": found.lowest, "highest": found.highest, "weights": found.weights, "pressure": found.pressure,
        "equivalent": found.equivalent, "cells": cells, "scale": scale,
        "by law": float(np.abs(found.pressure - by_law).max() / scale),
        "by difference": float(np.abs(found.pressure - by_difference).max() / scale), "largest by difference": float(by_difference.max()),
        "below bilateral": float((found.equivalent <= bilateral * (1 + 1e-12) + 1e-12 * scale).mean()),
    }  # fmt: skip


def wire_pressures(found: WireMap, values: Mapping[str, float], model: str) -> tuple[Array, Array]:
    """Wire pressure [Pa] at the points from the eigenvalues of the strain, and as the pressure of the body less that of the sand."""
    strain = found.strain
    w = model_values(MODELS["texsol"], values)
    lam, mu = w["lambda_w"], w["mu_w"]
    root = np.sqrt(0.5)
    tensor = np.array([[strain[:, 0], root * strain[:, 5], root * strain[:, 4]],
                       [root * strain[:, 5], strain[:, 1], root * strain[:, 3]],
                       [root * strain[:, 4], root * strain[:, 3], strain[:, 2]]])  # fmt: skip
    principal = np.linalg.eigvalsh(np.moveaxis(tensor, 2, 0))
    volume = principal.sum(axis=1)
    if model == "texsol":
        pulls, grows = np.maximum(principal, 0.0).sum(axis=1), np.maximum(volume, 0.0)
    else:
        pulls = grows = volume * (model != "sand")
    elastic = found.strain[:, :3].sum(axis=1) - found.body.whole(found.state.state["eps_p"])[:, :3].sum(axis=1)
    bulk = values["E_s"] / (3.0 * (1.0 - 2.0 * values["nu_s"]))
    whole = found.body.whole(found.state.stress)[:, :3].mean(axis=1)
    return -lam * grows - 2.0 / 3.0 * mu * pulls, bulk * elastic - whole


def point_force(model: str, values: Mapping[str, float], steps: int) -> float:
    """Force on the platen [N] if the body were one material point with a free side: what smooth platens must give."""
    from ..integrators import drive_arrays

    test = CrushingTest()
    targets = np.zeros((steps + 1, 6))
    targets[:, 2] = -test.shortening * np.linspace(0.0, 1.0, steps + 1)
    update = MODELS[model].compile("3d")
    history = drive_arrays(update, [True, True, False, True, True, True], targets, model_values(MODELS[model], values))
    return float(-history.sig[-1, 2] * np.pi * (test.diameter / 2) ** 2)


def refined(model: str, columns: int, integration: str) -> dict[str, Any]:
    """Force and wire measures on another mesh, Table 3."""
    found = _crush(model, "table 3", CrushingTest(columns=columns, rows=columns, integration=integration))
    order = np.argsort(found.equivalent)
    share = np.cumsum(found.weights[order]) / found.weights.sum()
    return {
        "force": float(found.force[-1]),
        "max": float(found.equivalent.max()),
        "mean": float(np.average(found.equivalent, weights=found.weights)),
        "q95": float(found.equivalent[order][np.searchsorted(share, 0.95)]),
    }


def both_signs(name: str, shapes: Sequence[float], columns: int = 10, steps: int = 20) -> dict[str, Any]:
    """Lowest and highest wire pressure [Pa] of reinforced sand up to 1 % shortening: between rough platens by height over diameter, and
    between smooth ones, where the shape does not matter."""
    found: dict[str, Any] = {"shortening": LONG * np.arange(1, steps + 1) / steps}
    for shape in shapes:
        test = CrushingTest(
            diameter=DIAMETER, height=DIAMETER * shape, columns=columns, rows=columns, shortening=LONG, steps=steps
        )
        m = _crush("reinforced", name, test)
        found[f"rough, {shape:g}"] = {"lowest": m.lowest, "highest": m.highest}
    m = _crush("reinforced", name, CrushingTest(columns=1, rows=1, shortening=LONG, steps=steps, rough=False))
    found["smooth"] = {"lowest": m.lowest, "highest": m.highest}
    return found
