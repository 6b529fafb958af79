"""Random states of any law of the registry, and the numbers of its expressions there; nothing here names a law."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fenchel.potentials.evaluate import evaluate
from fenchel.potentials.scalars import ScalarVariable
from fenchel.potentials.vector import VectorSymbol


def shape(variable, n):
    """Shape of the values of a variable at n points."""
    if isinstance(variable, ScalarVariable):
        return (n,)
    return (n, 3) if isinstance(variable, VectorSymbol) else (n, 6)


def random_states(entry, rng, n, amplitude=1.0):
    """States by name at n points: strains of the size of the worked value's, a tenth of it plastic, scalars ≥ 0, a warm temperature."""
    law, size = entry.law, amplitude * np.linalg.norm(entry.worked.eps)
    x = {law.observable.name: size * rng.normal(size=(n, 6)) / np.sqrt(6)}
    for variable in law.internal:
        value = 0.1 * size * rng.normal(size=shape(variable, n))
        x[variable.name] = np.abs(value) if isinstance(variable, ScalarVariable) else value
    if law.temperature is not None:
        x[law.temperature.name] = 300.0 + 50.0 * rng.random(n)
    return x


def environment(law, values, x):
    """Values by symbol, for `evaluate`."""
    found = {symbol: values[symbol.name] for symbol in law.parameters}
    symbols = [law.observable, *law.internal] + ([law.temperature] if law.temperature is not None else [])
    return found | {symbol: x[symbol.name] for symbol in symbols if symbol.name in x}


def number(thing, law, values, x, **more):
    """An expression of the law at the states x; `more` are values of further symbols, by symbol."""
    return evaluate(thing, environment(law, values, x) | more.get("symbols", {}))


def temperatures(law, value=None):
    """The keyword of the temperature for an update, if the law has one."""
    return {} if law.temperature is None else {law.temperature.name: 320.0 if value is None else value}


def moving(entry, rng, segments, steps, amplitude=2.0):
    """A random strain path (segments·steps, 6) from zero, piecewise straight, of the size of the worked value's strain."""
    corners = amplitude * np.linalg.norm(entry.worked.eps) / np.sqrt(6) * rng.normal(size=(segments, 6))
    corners = np.vstack([np.zeros(6), corners])
    s = np.arange(1, steps + 1)[:, None] / steps
    return np.concatenate([a + s * (b - a) for a, b in pairwise(corners)])


def derivative(function, t, h):
    """df/dt by the central difference of order eight."""
    weights = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
    return sum(w * (function(t + k * h) - function(t - k * h)) for k, w in weights) / h
