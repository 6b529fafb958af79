"""Paths that leave nothing unknown, by steps that have no tangent: the unpolished cone program and the explicit scheme."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..potentials import Law
from ..potentials.evaluate import evaluate
from .thermal import thermal_input, thermal_results

if TYPE_CHECKING:
    from .history import History, Plan

__all__ = ["follow_prescribed", "has_tangent"]

Array = NDArray[np.float64]


def has_tangent(update: Any) -> bool:
    """False for the methods that leave the derivative of the answer out, so that nothing unknown can be solved for."""
    return update.solver not in ("cvxpy", "explicit")


def follow_prescribed(
    update: Any,
    plan: Plan,
    values: Mapping[str, Any],
    initial_state: Mapping[str, Any] | None,
    steps: Array,
    temperatures: Any,
) -> History:
    """The steps of a path of which every component is prescribed in what drives the update; `steps` [s] (n,).

    Raises `InputError` if a component is unknown, `ConvergenceError` where a step fails.
    """
    from .history import History

    law, turned = update.law, update.solver != "explicit" and update.turned
    if plan.unknowns:
        word, other = ("stress", "strain") if turned else ("strain", "stress")
        raise InputError(
            f"solver '{update.solver}' has no tangent, and this path leaves {plan.unknowns} unknown {word} components: prescribe every "
            f"{word} and no {other}, or use solver 'auto'"
        )
    n = len(plan.base)
    given = dict(values)
    if temperatures is not None:
        if law.temperature is None:
            raise InputError(f"law '{law.name}' has no temperature; leave the temperatures out")
        given[law.temperature.name] = np.broadcast_to(np.asarray(temperatures, dtype=float), (n,))
    heat, rest = thermal_input(law, given, n)
    kelvin = np.broadcast_to(heat.temperature, (n,))
    state = None if initial_state is None else {k: np.asarray(v, dtype=float)[None] for k, v in initial_state.items()}
    answers, states, lost = np.zeros((n, 6)), [], np.zeros(n)
    for row in range(n):
        here = {**rest} if law.temperature is None else {**rest, law.temperature.name: float(kelvin[row])}
        out = update(plan.base[row : row + 1], state, float(steps[row]), **here)
        answers[row], state, lost[row] = (out.strain if turned else out.stress)[0], out.state, out.dissipation[0]
        states.append(state)
    eps, sig = (answers, plan.base) if turned else (plan.base, answers)
    named = {name: np.concatenate([s[name] for s in states]) for name in states[0]} if states else {}
    entropy, _ = thermal_results(law, heat, eps, named, rest)
    return History(
        eps.copy(),
        sig.copy(),
        named,
        _energy(law, eps, named, law.values(rest), kelvin),
        np.cumsum(lost),
        np.zeros(n, dtype=np.int64),
        None if law.temperature is None else kelvin.copy(),
        entropy,
    )


def _energy(law: Law, eps: Array, state: Mapping[str, Array], numbers: Mapping[str, float], kelvin: Array) -> Array:
    """ψ [J/m³] along a path, shape (n,)."""
    known: dict[Any, Any] = {p: numbers[p.name] for p in law.parameters}
    known |= {law.observable: eps, **{v: state[v.name] for v in law.internal}}
    if law.temperature is not None:
        known[law.temperature] = kelvin
    return np.broadcast_to(evaluate(law.energy, known), (len(eps),)).copy()
