"""A law fitted to laboratory tests by least squares.

What the tests do not tell apart is not fitted: while the columns of the Jacobian, each of length one, have a condition number above
`CONDITION`, a parameter among those that cause it keeps its start value and the rest is fitted again. On monotonic tests these are H_k and
H_i, of which only H_eff = H_k(½ + t²/3) + H_i is felt (t = tan θ_f); H_k then carries it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..drawing import Signs, shown
from ..errors import InputError
from ..notebook import Summary
from .estimate_view import HEADS as ESTIMATE_HEADS
from .estimate_view import estimate_figure, estimate_rows
from .laboratory_file import LaboratoryTest
from .laboratory_interval import LaboratoryEstimate, estimates_of, leave_one_out
from .laboratory_problem import LaboratoryProblem, relative_scales
from .laboratory_replay import LaboratoryRun, replay_laboratory, thin_laboratory
from .laboratory_start import start_values

__all__ = ["LaboratoryFit", "LaboratoryReplay", "fit_laboratory"]

Array = NDArray[np.float64]
CONDITION = 300.0  # of the unit columns of the Jacobian; above it parameters are not told apart
PART = 0.3  # of the largest weight in the weakest direction: parameters above it cause it
# Of parameters that are not told apart, the first of these keeps its start value.
HELD_FIRST = ("H_i", "C_0", "c", "nu_s", "nu")


@dataclass(frozen=True, kw_only=True, repr=False)
class LaboratoryReplay(Summary):
    """One test and the law along it; errors are rms (law − data)/max|data|."""

    test: LaboratoryTest
    run: LaboratoryRun
    held_out: bool
    error_q: float
    error_second: float  # of the volume strain (drained) or the pore pressure (undrained)

    def _title(self) -> str:
        return f"{self.test.name} and the law" + (", held out" if self.held_out else "")


@dataclass(frozen=True, kw_only=True, repr=False)
class LaboratoryFit(Summary):
    """A law with the `values` of its parameters [SI], their `estimates`, and every test replayed, the held-out ones last."""

    law: Any
    law_name: str
    values: dict[str, float]
    fitted: tuple[str, ...]
    estimates: dict[str, LaboratoryEstimate]
    replays: tuple[LaboratoryReplay, ...]
    condition: float  # of the unit columns of the fitted parameters
    misfit: float  # root mean square of the relative residuals
    confidence: float
    volume_weight: float

    HEADS: ClassVar[tuple[str, ...]] = ESTIMATE_HEADS

    def plot(self, *, signs: str = "compression-positive") -> Any:
        """A matplotlib figure: q, volume strain and pore pressure against the axial strain, measured and by the law. `InputError` for
        other `signs` than "tension-positive" and "compression-positive"."""
        from .laboratory_figures import curve_figure

        return shown(curve_figure(self, Signs(signs)))

    def plot_paths(self, *, signs: str = "compression-positive") -> Any:
        """A matplotlib figure: q against the effective mean pressure, measured and by the law."""
        from .laboratory_figures import path_figure

        return shown(path_figure(self, Signs(signs)))

    def plot_intervals(self) -> Any:
        """A matplotlib figure: the fitted values with their intervals, each over its value; `InputError` if all were held."""
        if not self.fitted:
            raise InputError("the fit has no fitted parameter: all were held, and there is no interval to draw")
        return shown(estimate_figure({name: self.estimates[name] for name in self.fitted}))

    def _title(self) -> str:
        return f"law '{self.law_name}' fitted to {sum(not replay.held_out for replay in self.replays)} test(s), misfit {self.misfit:.3g}"

    def _rows(self) -> list[tuple[str, ...]]:
        return estimate_rows(self.estimates)


def fit_laboratory(
    law: Any,
    tests: Sequence[LaboratoryTest],
    *,
    law_name: str = "",
    held_out: Sequence[LaboratoryTest] = (),
    start: Mapping[str, float] | None = None,
    hold: Sequence[str] = (),
    volume_weight: float = 1.0,
    confidence: float = 0.95,
    progress: Callable[[str], None] = lambda text: None,
) -> LaboratoryFit:
    """Fit the parameters of `law` to `tests` and predict `held_out`.

    `start` gives start values by name; what it lacks is read off the curves for a law of the library called `law_name`, else it is the
    default of the parameter. Parameters in `hold` keep their start value. Raises `InputError` for a law or a call that cannot be fitted,
    `ConvergenceError` where the law cannot follow a test from the start values, or the fit does not settle.
    """
    if not tests:
        raise InputError("a fit needs a test: give one laboratory file or more")
    if not (isfinite(volume_weight) and volume_weight >= 0.0):
        raise InputError(f"volume weight {volume_weight:g}: it must be zero or positive")
    if not 0.5 <= confidence < 1.0:
        raise InputError(f"confidence {confidence:g}: need 0.5 <= confidence < 1")
    _check_law(law)
    update = law.compile("3d", tangent=True)
    values = _start(law, law_name, tests, start or {}, hold)
    thin = [thin_laboratory(test) for test in tests]
    free = [name for name in values if name not in hold]
    begin, reasons = dict(values), dict.fromkeys(hold, "held")
    problem = LaboratoryProblem(update, thin, values, free, volume_weight)
    problem.exact(problem.start())
    while True:
        progress(f"fit of {', '.join(free)}")
        y = problem.solve()
        values = problem.at(y)
        columns = problem.columns(y)
        pushed = problem.pushed(y, columns) & np.array([values[n] != begin[n] for n in free], dtype=bool)
        name, why, condition = _not_told(free, columns, pushed)
        if name is None:
            break
        free.remove(name)
        values[name] = begin[name]
        reasons[name] = why
        problem = LaboratoryProblem(update, thin, values, free, volume_weight)
    files = leave_one_out(update, thin, values, free, volume_weight, progress)
    estimates = estimates_of(law, law_name, problem, y, columns, begin, reasons, files, confidence)
    replays = [_replayed(update, values, test, False) for test in tests]
    replays += [_replayed(update, values, test, True) for test in held_out]
    residual = problem.residual(y)
    return LaboratoryFit(
        law=law,
        law_name=law_name or law.name,
        values=values,
        fitted=tuple(free),
        estimates=estimates,
        replays=tuple(replays),
        condition=condition,
        misfit=float(np.sqrt(residual @ residual / (len(tests) * (1.0 + volume_weight)))),
        confidence=confidence,
        volume_weight=volume_weight,
    )


def _check_law(law: Any) -> None:
    if law.temperature is not None:
        raise InputError(
            f"law '{law.name}' has a temperature, which a laboratory file does not tell: take an isothermal law"
        )
    if "viscous" in law.check().kind:
        raise InputError(
            f"law '{law.name}' depends on the rate, and a laboratory file has no time: take a rate-independent law"
        )
    if not law.parameters:
        raise InputError(f"law '{law.name}' has no parameters: there is nothing to fit")


def _start(
    law: Any, law_name: str, tests: Sequence[LaboratoryTest], given: Mapping[str, float], hold: Sequence[str]
) -> dict[str, float]:
    known = {symbol.name: symbol for symbol in law.parameters}
    for word, names in (("start value", tuple(given)), ("parameter to hold", tuple(hold))):
        for name in names:
            if name not in known:
                raise InputError(f"law '{law.name}' has no parameter '{name}' ({word}); it has: {', '.join(known)}")
    found = start_values(law_name, tests) | dict(given)
    out, missing = {}, []
    for name, symbol in known.items():
        value = found.get(name, symbol.default)
        if value is None:
            missing.append(name)
            continue
        out[name] = float(value) if name in given else float(np.clip(value, symbol.lower, symbol.upper))
    if missing:
        raise InputError(
            f"law '{law.name}': the curves do not tell where to start with {', '.join(missing)}; give "
            + " ".join(f"-p {name}=VALUE" for name in missing)
        )
    return law.values(out)


def _not_told(free: Sequence[str], columns: Array, pushed: NDArray[np.bool_]) -> tuple[str | None, str, float]:
    """The parameter that must be held, the reason, and the condition number of the unit columns, those of `pushed` left out."""
    size = np.linalg.norm(columns, axis=0)
    places = [int(k) for k in np.flatnonzero(~pushed)]
    if not places:
        return None, "", 1.0
    silent = [k for k in places if size[k] <= 1e-7 * max(size.max(), 1e-300)]
    if silent:
        return free[silent[0]], "these tests do not feel it: kept at its start value", inf
    unit = columns[:, places] / size[places]
    _, singular, rows = np.linalg.svd(unit, full_matrices=False)
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0.0 else inf
    if condition <= CONDITION:
        return None, "", condition
    weights = np.abs(rows[-1])
    among = [free[place] for place, weight in zip(places, weights, strict=True) if weight >= PART * weights.max()]
    chosen = next((name for name in HELD_FIRST if name in among), among[-1])
    others = ", ".join(name for name in among if name != chosen)
    return chosen, f"not told apart from {others}: kept at its start value", condition


def _replayed(update: Any, values: Mapping[str, float], test: LaboratoryTest, held_out: bool) -> LaboratoryReplay:
    run = replay_laboratory(update, values, test)
    q, second = relative_scales(test, 1.0)
    return LaboratoryReplay(
        test=test,
        run=run,
        held_out=held_out,
        error_q=float(np.linalg.norm((run.q - test.q) * q)),
        error_second=float(np.linalg.norm((run.second - test.second) * second)),
    )
