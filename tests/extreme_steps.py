"""Steps at the ends of what can be asked, as a table: law, setting, bound, measured error or the words of the refusal.

A cell sets parameters and strains of one law. Its answers are judged by the optimality conditions (`step_optimality`, extended precision),
after one step from the virgin state and again after a second from where that ended; what changes units is held against the same step in
other units, and a million steps along a radial path against one.

The bound of a cell is on the worst residual over its tolerance, 1e-10 × yield stress + 100 × machine epsilon × ‖stiffness‖ × ‖strains‖.
Cells of `REFUSABLE`, listed before any was run, may be refused with a reason instead; no cell may be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
from awkward_states import increments
from law_truth import TRUTHS, lame
from step_optimality import EPS, Step, length

from fenchel.errors import ConvergenceError, InputError
from fenchel.integrators import drive_arrays
from fenchel.potentials.library import ENTRIES

CONES = ("sand", "texsol", "drucker_prager", "drucker_prager_cap")
ALL = (
    "sand",
    "texsol",
    "von_mises",
    "drucker_prager",
    "drucker_prager_cap",
    "mohr_coulomb",
    "tresca",
    "rankine",
    "cam_clay",
    "perzyna",
)
# squares of the trial leave the range of the exponent: of the energy that is dissipated, and inside curved surfaces and powers earlier
REFUSABLE = {(law, "strain 1e+150") for law in ALL}
REFUSABLE |= {(law, "strain 1e+75") for law in ("cam_clay", "drucker_prager_cap", "perzyna")}
# an ellipse that has to grow to 1e9 times the strength of the step: f is the difference of two numbers of that size
REFUSABLE |= {("cam_clay", "H_i/E 1e+09")}
STRENGTH = {
    "von_mises": "sigma_y",
    "perzyna": "sigma_y",
    "tresca": "sigma_y",
    "rankine": "sigma_t",
    "mohr_coulomb": "c",
}
STRENGTH |= dict.fromkeys(CONES, "C_0")


@dataclass(frozen=True)
class Row:
    """One cell: `error` and `bound` as multiples of the tolerance, or the `message` of a refusal."""

    law: str
    setting: str
    bound: float
    error: float = np.nan
    message: str = ""

    @property
    def verdict(self) -> str:
        """right, refused (with a reason, where that may be) or wrong."""
        if self.message:
            return "refused" if (self.law, self.setting) in REFUSABLE else "wrong"
        return "right" if self.error <= self.bound else "wrong"


@dataclass(frozen=True)
class Cell:
    """A law, a setting, changed parameter values, strains as multiples of `scale` (None: increments of awkward states), and a check."""

    law: str
    setting: str
    change: dict[str, float] = field(default_factory=dict)
    scale: float | None = None
    dt: float = 1.0
    check: Callable[[Cell], float] | None = None


# small numbers of every kind of strain: spherical, with repeated eigenvalues, sheared, general
SHAPES = np.array(
    [
        [1, 1, 1, 0, 0, 0],
        [-1, -1, -1, 0, 0, 0],
        [1, 1, -3, 0, 0, 0],
        [-1, -1, 1, 0, 0, 0],
        [1, 1 + 1e-15, 1 - 1e-15, 1e-16, 0, 0],
        [0, 0, 0, 1, 1, 1],
        [1, 0, 0, 0, 0, 0],
        [0, 0, -1, 0, 0, 0],
        [0.3, -0.2, 0.7, 0.1, -0.4, 0.25],
    ]
)


def values_of(cell: Cell) -> dict[str, float]:
    return dict(ENTRIES[cell.law].values) | cell.change


def strains(cell: Cell, seed: int) -> np.ndarray:
    """Strains of the cell: `SHAPES` times its scale, or awkward increments of the law as the library sets it."""
    if cell.scale is not None:
        return SHAPES * cell.scale
    rng = np.random.default_rng(seed)
    return increments(cell.law, dict(ENTRIES[cell.law].values), rng, 64)


def excess(cell: Cell, eps: Any, old: Any, out: Any) -> float:
    """Worst residual over its tolerance; infinite where something is not finite."""
    for part in (out.stress, out.tangent, out.dissipation, *out.state.values()):
        if not np.isfinite(part).all():
            return np.inf
    step = Step(cell.law, values_of(cell), eps, old, out.state, cell.dt)
    worst = 0.0
    for what, residual in step.residuals(out.stress).items():
        worst = max(worst, float((residual / tolerance(step, what == "state law")).max()))
    return worst


def tolerance(step: Step, wires: bool) -> Any:
    """1e-10 × yield stress + 100 × machine epsilon × 2 max(G, 3K/2) (‖ε‖ + ‖ε^p_n‖ + ‖ε^p‖) [Pa]: what the last digits of the strains are
    worth, which near ν = ½ is far more than those of the trial stress. Of the state law that alone, with that of the wires."""
    known = length(step.eps) + length(step.old["eps_p"]) + length(step.new["eps_p"])
    found = 100 * EPS * np.maximum(2 * step.mu, 3 * step.bulk) * known
    found = found + (100 * EPS * length(step.wires()) if wires else 1e-10 * step.unit)
    return np.maximum(found, np.finfo(float).tiny)


def two_steps(cell: Cell) -> float:
    """From the virgin state, and on from there."""
    update, values = ENTRIES[cell.law].law.compile(), values_of(cell)
    eps = strains(cell, 1)
    old = update.initial_state(len(eps))
    out = update(eps, old, cell.dt, **values)
    worst = excess(cell, eps, old, out)
    more = eps + (strains(cell, 2) if cell.scale is None else -1.5 * np.roll(eps, 1, axis=0))
    again = update(more, out.state, cell.dt, **values)
    return max(worst, excess(cell, more, out.state, again))


def other_units(cell: Cell) -> float:
    """Stresses in GPa: the same state, and the stress a billionth, each to 100 × machine epsilon × ‖trial‖ + 1e-10 × yield stress."""
    entry = ENTRIES[cell.law]
    update, plain = entry.law.compile(), values_of(cell)
    factor = {p.name: 1e-9 if str(p.unit).startswith("Pa") else 1.0 for p in entry.law.parameters}
    scaled = {k: v * factor[k] for k, v in plain.items()}
    eps = strains(cell, 1)
    one, two = update(eps, None, cell.dt, **plain), update(eps, None, cell.dt, **scaled)
    step = Step(cell.law, plain, eps, update.initial_state(len(eps)), one.state, cell.dt)
    found = float((np.abs(two.stress * 1e9 - one.stress).max(axis=1) / tolerance(step, False)).max())
    other = Cell(cell.law, cell.setting, {**cell.change, **scaled}, cell.scale, cell.dt)
    return max(found, excess(other, eps, update.initial_state(len(eps)), two))


RADIAL = {
    # direction of the strain; on the face or cone it meets first the answer is linear in the strain
    "sand": (1.0, 0.0, -2.0, 0.0, 0.0, 0.5),
    "texsol": (1.0, 0.0, -2.0, 0.0, 0.0, 0.5),
    "drucker_prager": (1.0, 0.0, -2.0, 0.0, 0.0, 0.5),
    "drucker_prager_cap": (1.0, 0.0, -1.2, 0.0, 0.0, 0.5),
    "von_mises": (1.0, 0.0, -0.5, 0.3, 0.0, 0.5),
    "tresca": (1.0, 0.1, -1.0, 0.0, 0.0, 0.0),
    "mohr_coulomb": (1.0, 0.1, -1.4, 0.0, 0.0, 0.0),
    "rankine": (1.0, 0.0, -0.5, 0.0, 0.0, 0.0),
}
MANY = 1_000_000


def million_steps(cell: Cell) -> float:
    """MANY steps to ten yield strains against one, in units of the yield stress over 1e-9: a million roundings are in between."""
    update, values = ENTRIES[cell.law].law.compile(), values_of(cell)
    end = 10 * values[STRENGTH[cell.law]] / values.get("E", values.get("E_s")) * np.array(RADIAL[cell.law])
    path = np.arange(1, MANY + 1)[:, None] / MANY * end
    many = drive_arrays(update, [False] * 6, path, values).sig[-1]
    one = update(end, None, **values).stress[0]
    assert np.abs(one - elastic(cell, end)).max() > 0.1 * np.abs(one).max(), "the path never left the elastic domain"
    return float(np.abs(many - one).max() / (1e-9 * TRUTHS[cell.law].unit(SimpleNamespace(**values))))


def elastic(cell: Cell, strain: Any) -> Any:
    values = values_of(cell)
    lam, mu = lame(values.get("E", values.get("E_s")), values.get("nu", values.get("nu_s")))
    return lam * strain[:3].sum() * np.array([1, 1, 1, 0, 0, 0]) + 2 * mu * strain


def cells() -> Iterator[Cell]:
    """All cells of the table."""
    for law in ALL:
        values = ENTRIES[law].values
        young = values.get("E", values.get("E_s"))
        poisson = "nu" if "nu" in values else "nu_s"
        for name in ("H_k", "H_i", "H_c"):
            if name in values:
                for ratio in (1e-9, 1e9):
                    yield Cell(law, f"{name}/E {ratio:.0e}", {name: young * ratio})
        if "mu_w" in values:
            for ratio in (1e-9, 1e9):
                lam, mu = lame(young * ratio, 0.2)
                yield Cell(law, f"E_w/E_s {ratio:.0e}", {"lambda_w": lam, "mu_w": mu})
        for nu in (-0.99, 0.499999):
            yield Cell(law, f"nu {nu}", {poisson: nu})
        zero = [name for name in ("H_k", "H_i", "H_c") if name in values]
        for name in zero:
            yield Cell(law, f"{name} 0", {name: 0.0})
        if len(zero) > 1:
            yield Cell(law, "no hardening", dict.fromkeys(zero, 0.0))
        if law in CONES:
            for angle in (0.0, 1.5):
                yield Cell(law, f"theta_f {angle}", {"theta_f": angle})
        if law == "mohr_coulomb":
            for angle in (0.0, 1.5):
                yield Cell(law, f"theta_f {angle}", {"phi": angle})
        if law in STRENGTH:
            yield Cell(law, "C_0 0", {STRENGTH[law]: 0.0})
        yield Cell(law, "100 % strain", {}, 1.0)
        yield Cell(law, "GPa", check=other_units)
        for exponent in (-300, -150, -12, 6, 75, 150):
            yield Cell(law, f"strain 1e{exponent:+d}", {}, 10.0**exponent)
        if law in RADIAL:
            yield Cell(law, "1e6 steps", check=million_steps)
        if law == "perzyna":
            for dt in (1e-12, 1e12):
                yield Cell(law, f"dt {dt:.0e}", dt=dt)


def evaluate(cell: Cell) -> Row:
    """The row of a cell."""
    try:
        return Row(cell.law, cell.setting, 1.0, (cell.check or two_steps)(cell))
    except (ConvergenceError, InputError) as refusal:
        return Row(cell.law, cell.setting, 1.0, message=str(refusal))


def rows(*, million: bool | None = None) -> list[Row]:
    """The table; only the paths of a million steps if `million`, all but them if it is False.

    numpy's own warnings are silenced: what is not finite is found by looking.
    """
    with np.errstate(all="ignore"):
        return [evaluate(c) for c in cells() if million is None or (c.check is million_steps) == million]
