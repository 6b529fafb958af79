"""The state of many points as named arrays, and packed in rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..potentials import Law
from .declared import packed_layout
from .dimension import Dimension

__all__ = ["StatePacking"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StatePacking:
    """Place (start, length) of each state variable of `law` in a row of `state_size` entries; see `packed_layout`."""

    law: Law
    layout: Mapping[str, tuple[int, int]]
    state_size: int

    @classmethod
    def of(cls, law: Law, size: int = 6) -> StatePacking:
        """Layout of a law with tensors of `size` components."""
        layout, _ = packed_layout(law, size)
        return cls(law, layout, sum(length for _, length in layout.values()))

    def initial_state(self, point_count: int = 1) -> dict[str, Array]:
        """Virgin state: everything zero."""
        if point_count < 0:
            raise InputError(f"initial_state: the number of points is {point_count}; it must not be negative")
        return self.unpack(np.zeros((point_count, self.state_size)))

    def unpack(self, packed: Array) -> dict[str, Array]:
        """Views of packed rows (n, state_size) by name: scalars (n,), vectors (n, 3), tensors (n, size)."""
        return {n: packed[:, s] if length == 1 else packed[:, s : s + length] for n, (s, length) in self.layout.items()}

    def whole(self, packed: Array, dimension: Dimension) -> Array:
        """Rows of the same states in three dimensions."""
        if dimension.size == 6:
            return packed
        tensors = {v.name for v in (*self.law.internal, self.law.observable) if getattr(v, "rank", 0) == 2}
        found = [
            dimension.embedded(v) if n in tensors else v.reshape(len(v), -1) for n, v in self.unpack(packed).items()
        ]
        return np.hstack(found) if found else packed

    def pack(self, state: Mapping[str, Any] | None, point_count: int) -> Array:
        """Packed copy of a state by name; None is the virgin state. `InputError` for unknown names, shapes and NaN."""
        packed = np.zeros((point_count, self.state_size))
        if state is None:
            return packed
        for name in state:
            if name not in self.layout:
                raise InputError(
                    f"law '{self.law.name}' has no internal variable '{name}'; it has: {', '.join(self.layout) or 'none'}"
                )
        for name, (start, length) in self.layout.items():
            if name not in state:
                word = "variable" if name == self.law.observable.name else "internal variable"
                raise InputError(f"law '{self.law.name}': the state lacks the {word} '{name}'")
            value = np.asarray(state[name], dtype=float)
            shape = (point_count,) if length == 1 else (point_count, length)
            if value.shape != shape:
                try:
                    value = np.broadcast_to(value, shape)
                except ValueError:
                    raise InputError(
                        f"state '{name}' has shape {value.shape}; for {point_count} points it must be {shape}"
                    ) from None
            if not np.isfinite(value).all():
                raise InputError(f"state '{name}' holds a value that is not finite")
            packed[:, start : start + length] = value.reshape(point_count, length)
        return packed
