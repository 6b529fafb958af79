"""Derivatives of a step by the parameters of its law: stress, state and dissipation, exact, in every region.

    σ(θ), X(θ)   with   X = argmin ψ(ε, X; θ) + φ(X − X_n; θ):     total derivatives along θ, given those of X_n and ε.

By implicit differentiation of the optimality conditions at the answer of the compiled step. On a boundary between regions it is the
one-sided derivative of the region that the step, and so its tangent, is in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..notebook import Summary
from .compiled_step import packed_values, step_time
from .dimension import SPACE, require_space
from .failures import raise_failures
from .plan import STRAIN
from .thermal import thermal_input

__all__ = ["Sensitivities", "chosen_names", "derivative_rows", "sensitivities"]

Array = NDArray[np.float64]
BLOCK = 4096


@dataclass(frozen=True, repr=False)
class Sensitivities(Summary):
    """Derivatives at n points by the k parameters `names`, per unit of each: `stress` (n, 6, k) [Pa per unit], Mandel; `state` by name,
    tensors (n, 6, k), scalars (n, k); `dissipation` of the step (n, k) [J/m³ per unit]."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "stress": "Pa/unit",
        "dissipation": "J/m³/unit",
    }

    names: tuple[str, ...]
    stress: Array
    state: dict[str, Array]
    dissipation: Array

    def _title(self) -> str:
        return f"derivatives by {', '.join(self.names)}"


def chosen_names(law: Any, wrt: Any) -> tuple[str, ...]:
    """Names of the parameters asked for; `InputError` for one that the law does not have."""
    known = [p.name for p in law.parameters]
    if wrt is None:
        return tuple(known)
    names = (wrt,) if isinstance(wrt, str) else tuple(wrt)
    heat = [law.temperature.name] if law.temperature is not None else []
    for name in names:
        if name not in (*known, *heat):
            raise InputError(
                f"law '{law.name}' has no parameter '{name}' to differentiate by; it has: {', '.join((*known, *heat)) or 'none'}"
            )
    if len(set(names)) < len(names):
        raise InputError(f"wrt names a parameter twice: {', '.join(names)}")
    return names


def derivative_rows(packing: Any, d_state: Mapping[str, Any] | None, count: int, width: int) -> Array:
    """Derivatives of the old state by name as rows (n, state_size, k); what is not named is zero."""
    rows = np.zeros((count, packing.state_size, width))
    for name, value in (d_state or {}).items():
        if name not in packing.layout:
            raise InputError(f"d_state names '{name}'; the state has: {', '.join(packing.layout) or 'nothing'}")
        start, length = packing.layout[name]
        shape = (count, width) if length == 1 else (count, length, width)
        rows[:, start : start + length] = _checked(f"d_state '{name}'", value, shape).reshape(count, length, width)
    return rows


def _checked(what: str, value: Any, shape: tuple[int, ...]) -> Array:
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what} must be numbers") from None
    if found.shape != shape:
        raise InputError(f"{what} has shape {found.shape}; it must be {shape}")
    if not np.isfinite(found).all():
        raise InputError(f"{what} holds a value that is not finite")
    return found


def sensitivities(
    update: Any,
    eps_new: Any,
    state: Mapping[str, Any] | None,
    dt: float,
    wrt: Sequence[str] | str | None,
    d_state: Mapping[str, Any] | None,
    d_eps: Any,
    values: Mapping[str, Any],
) -> Sensitivities:
    """Take the step and differentiate it; see `Update.sensitivities`."""
    require_space(update, "sensitivities")
    eps = SPACE.strains(eps_new)
    names = chosen_names(update.law, wrt)
    n, k = len(eps), len(names)
    old = update.packing.pack(state, n)
    d_old = derivative_rows(update.packing, d_state, n, k)
    d_strain = np.zeros((n, 6, k)) if d_eps is None else _checked("d_eps", d_eps, (n, 6, k))
    stress, new, lost = derivatives(update, eps, old, step_time(dt), values, names, d_old, d_strain)
    state_by_name = {
        name: new[:, start] if length == 1 else new[:, start : start + length]
        for name, (start, length) in update.packing.layout.items()
    }
    return Sensitivities(names, stress, state_by_name, lost)


def derivatives(
    update: Any,
    eps: Array,
    old: Array,
    dt: Any,
    values: Mapping[str, Any],
    names: tuple[str, ...],
    d_old: Array,
    d_eps: Array,
) -> tuple[Array, Array, Array]:
    """(dσ (n, 6, K), dX (n, size, K), d dissipation (n, K)) on packed arrays; the first columns are those of `names`. `dt` may be (n,)."""
    from .general_update import GeneralUpdate

    if isinstance(update, GeneralUpdate):
        from .sensitivity_general import general_derivatives

        return general_derivatives(update, eps, old, dt, values, names, d_old, d_eps)
    return _reduced(update, eps, old, dt, values, names, d_old, d_eps)


def _reduced(
    update: Any,
    eps: Array,
    old: Array,
    dt: Any,
    values: Mapping[str, Any],
    names: tuple[str, ...],
    d_old: Array,
    d_eps: Array,
) -> tuple[Array, Array, Array]:
    from .parameter_slopes import parameter_slopes
    from .sensitivity_answer import reduced_answer
    from .sensitivity_points import StepData, taken
    from .sensitivity_reduced import step_derivatives

    closed = update.module.METHOD == "closed"
    if update.module.PLAN[2 if closed else STRAIN] < 0:
        raise InputError(
            f"law '{update.law.name}': sensitivities are those of the strain formulation; build the update for it"
        )
    n, width = len(eps), d_eps.shape[2]
    heat, given = thermal_input(update.law, values, n)
    parameters = packed_values(update, given)
    slopes = parameter_slopes(update.law)
    pointers = update.pointers
    kernel = pointers.coefficients(parameters, dt, heat.temperature)
    new, stress, lost = np.empty_like(old), np.empty((n, 6)), np.empty(n)
    status = np.zeros(n, dtype=np.int64)
    if n:
        pointers.run(eps, old, new, stress, np.empty((1, 36)), False, lost, status, kernel)
    raise_failures(status, eps)
    theta: list[Any] = [float(v) for v in parameters]
    if update.law.temperature is not None:
        theta.append(heat.temperature if heat.temperature.size > 1 else float(heat.temperature[0]))
    c, all_slopes = slopes.numbers(theta, dt)
    chosen = [slopes.names.index(name) for name in names]
    dc = np.zeros((*c.shape, width))
    dc[:, :, : len(chosen)] = all_slopes[:, :, chosen]
    if closed:
        answer = reduced_answer(None, np.array(slopes.plan, dtype=np.int64), c, eps, old)
    else:
        answer = reduced_answer(pointers, pointers.plan, kernel, eps, old)
    whole = StepData(eps, old, new, kernel, c, dc, answer, theta, dt, chosen, d_old, d_eps)
    d_stress, d_new, d_lost = np.empty((n, 6, width)), np.empty((n, old.shape[1], width)), np.empty((n, width))
    for start in range(0, n, BLOCK):
        block = slice(start, min(n, start + BLOCK))
        part = whole if n <= BLOCK else taken(whole, block)
        d_stress[block], d_new[block], d_lost[block] = step_derivatives(update, slopes, part)
    return d_stress, d_new, d_lost
