"""Numbers of declared expressions, at many points at once (numpy, imported when called).

At a kink the number of a gradient is that of an element of the subdifferential: the gradient of a norm at zero is zero, H(0) = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

from sympy import Expr, Lambda

from ..errors import DeclarationError
from .atoms import ATOMS, atom_of
from .ranked import Ranked
from .spectral import EigenDyad, SpectralTensor, decompose, from_matrix
from .tensor import Deviator, IdentityTensor, PositiveTensor

__all__ = ["evaluate"]


def evaluate(thing: Any, values: Mapping[Any, Any]) -> Any:
    """Value of a scalar expression, (n,) or (), or of a tensor (n, 6) or vector (n, 3).

    `values` maps symbols (variables, forces, rates, frozen values, parameters) to arrays (n,), (n, 6), (n, 3) or numbers. A symbol without
    a value is an error that names it.
    """
    return _plan(thing)(values)


@lru_cache(maxsize=4096)
def _plan(thing: Any) -> _Plan:
    return _Plan(thing)


class _Plan:
    """An expression as a list of numpy operations on slots, every subexpression once; hashing sympy's trees is paid when it is made."""

    def __init__(self, thing: Any) -> None:
        self.symbols: list[tuple[int, Any]] = []
        self.constants: list[tuple[int, Any]] = []
        self.steps: list[tuple[int, Callable[..., Any], tuple[int, ...]]] = []
        self.slots: dict[Any, int] = {}
        self.result = self._slot(thing)

    def __call__(self, values: Mapping[Any, Any]) -> Any:
        import numpy as np

        found: list[Any] = [None] * len(self.slots)
        for slot, value in self.constants:
            found[slot] = value
        for slot, symbol in self.symbols:
            try:
                found[slot] = np.asarray(values[symbol], dtype=float)
            except KeyError:
                raise DeclarationError(f"no value is given for '{symbol}'") from None
        for slot, function, inputs in self.steps:
            found[slot] = function(*[found[i] for i in inputs])
        return found[self.result]

    # -- making the list ----------------------------------------------------------------------------------------------------

    def _slot(self, thing: Any) -> int:
        if thing in self.slots:
            return self.slots[thing]
        if isinstance(thing, Ranked):
            self._ranked(thing)
        else:
            self._scalar(thing)
        return self.slots[thing]

    def _new(self, thing: Any) -> int:
        return self.slots.setdefault(thing, len(self.slots))

    def _step(self, thing: Any, function: Callable[..., Any], *inputs: Any) -> None:
        slots = tuple(self._slot(i) for i in inputs)
        self.steps.append((self._new(thing), function, slots))

    def _constant(self, thing: Any, value: Any) -> None:
        import numpy as np

        self.constants.append((self._new(thing), np.asarray(value, dtype=float)))

    def _ranked(self, thing: Ranked) -> None:
        if isinstance(thing, IdentityTensor):
            self._constant(thing, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        elif isinstance(thing, Deviator):
            self._step(thing, _deviator, thing.args[0])
        elif isinstance(thing, PositiveTensor):
            self._step(thing, _positive, thing.args[0])
        elif isinstance(thing, SpectralTensor):
            self._spectral(thing)
        elif isinstance(thing, EigenDyad):
            place = 2 if thing.args[1] == 1 else 0
            self._step(thing, lambda t: _dyad(t, place), thing.args[0])
        elif thing in thing.terms():
            self.symbols.append((self._new(thing), thing))
        else:
            terms = thing.terms()
            size = 6 if thing.rank == 2 else 3
            inputs = [x for pair in terms.items() for x in pair]
            self._step(thing, lambda *parts: _combined(size, parts), *inputs)

    def _spectral(self, thing: SpectralTensor) -> None:
        bound, others = _bound(thing.args[0])
        self._step(thing, lambda tensor, *given: _of_eigenvalues(tensor, bound(given)), thing.args[1], *others)

    def _scalar(self, thing: Any) -> None:
        if thing.is_number:
            self._constant(thing, float(thing))
        elif thing.is_Symbol:
            self.symbols.append((self._new(thing), thing))
        elif thing.is_Add:
            self._step(thing, lambda *parts: sum(parts[1:], parts[0]), *thing.args)
        elif thing.is_Mul:
            self._step(thing, _product, *thing.args)
        elif type(thing) in ATOMS:
            self._atom(thing)
        else:
            import numpy as np

            word = str(thing.func.__name__)
            name = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "Abs": "abs"}.get(word, word)
            function = getattr(np, name, None)
            if not isinstance(thing, Expr) or function is None:
                raise DeclarationError(f"no numbers are known for {thing}")
            self._step(thing, function, *thing.args)

    def _atom(self, thing: Any) -> None:
        atom = atom_of(thing)
        if not any(isinstance(a, Lambda) for a in thing.args):
            self._step(thing, lambda *parts: atom.value(thing, parts), *thing.args)
            return
        # a function of eigenvalues stands first; its parameters come last
        bound, others = _bound(thing.args[0])
        count = len(thing.args) - 1
        self._step(
            thing, lambda *parts: atom.value(thing, (bound(parts[count:]), *parts[:count])), *thing.args[1:], *others
        )


def _bound(function: Any) -> tuple[Callable[[Any], Callable[[Any], Any]], list[Any]]:
    """A scalar function as given(parameters)(eigenvalues), and the symbols of its parameters."""
    import numpy as np

    body, variable = _plan(function.expr), function.variables[0]
    others = [s for _, s in body.symbols if s != variable]

    def given(parameters: Any) -> Callable[[Any], Any]:
        table = dict(zip(others, (np.asarray(g)[..., None] for g in parameters), strict=True))
        return lambda e: np.broadcast_to(body({**table, variable: e}), e.shape)

    return given, others


def _deviator(tensor: Any) -> Any:
    found = tensor.copy()
    found[..., :3] -= tensor[..., :3].sum(axis=-1, keepdims=True) / 3.0
    return found


def _positive(tensor: Any) -> Any:
    import numpy as np

    return _of_eigenvalues(tensor, lambda e: np.maximum(e, 0.0))


def _of_eigenvalues(tensor: Any, function: Callable[[Any], Any]) -> Any:
    import numpy as np

    values, vectors = decompose(tensor)
    return from_matrix(np.einsum("...ik,...k,...jk->...ij", vectors, function(values), vectors))


def _dyad(tensor: Any, place: int) -> Any:
    n = decompose(tensor)[1][..., :, place]
    return from_matrix(n[..., :, None] * n[..., None, :])


def _combined(size: int, parts: tuple[Any, ...]) -> Any:
    import numpy as np

    total: Any = np.zeros(size)
    for tensor, coefficient in zip(parts[::2], parts[1::2], strict=True):
        total = total + coefficient[..., None] * tensor
    return total


def _product(*parts: Any) -> Any:
    found = parts[0]
    for part in parts[1:]:
        found = found * part
    return found
