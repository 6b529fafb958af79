"""What the library keeps beside a law: where it comes from, values to try it with, and an answer that is known without fenchel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..law import Law

__all__ = ["Entry", "WorkedValue"]


@dataclass(frozen=True)
class WorkedValue:
    """One implicit step from the virgin state, with its answer.

    `eps` [-] and `stress` [Pa] in Mandel components (11, 22, 33, √2·23, √2·13, √2·12); `dt` [s]; `state` holds the internal
    variables that are known; `temperatures` by name [K]; `source` says where the answer comes from; `digits` is to how many it is known.
    """

    eps: tuple[float, ...]
    stress: tuple[float, ...]
    source: str
    state: Mapping[str, float | tuple[float, ...]] = field(default_factory=dict)
    dt: float = 1.0
    temperatures: Mapping[str, float] = field(default_factory=dict)
    digits: int = 12


@dataclass(frozen=True)
class Entry:
    """A law of the library: `law`, `source` (author year), `values` of its parameters in SI units, and a `worked` value at these."""

    law: Law
    source: str
    values: Mapping[str, float]
    worked: WorkedValue
