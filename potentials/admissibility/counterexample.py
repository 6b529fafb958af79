"""A counter-example with numbers: points by the name of the variable, values there, and by how much the rule is broken."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

__all__ = ["CounterExample"]

Point = dict[str, Any]


@dataclass(frozen=True)
class CounterExample:
    """`points` (floats, lists of three, lists of six Mandel components, by name) and the `values` of `function` there; for convexity the
    third point is the middle of the first two. `violation` > 0 is the amount by which `rule` is broken, in the unit of the function.
    `parameters` and `data` (temperature, frozen state) hold for all points."""

    rule: str
    function: str
    points: tuple[Point, ...]
    values: tuple[float, ...]
    violation: float
    parameters: dict[str, float] = field(default_factory=dict)
    data: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "rule": self.rule,
            "function": self.function,
            "points": [dict(p) for p in self.points],
            "values": list(self.values),
            "violation": self.violation,
            "parameters": dict(self.parameters),
            "data": dict(self.data),
            "text": str(self),
        }

    def __str__(self) -> str:
        return f"{self.rule}: {self._numbers()}{self._where()}"

    def _numbers(self) -> str:
        shown = [f"{self.function}({_point(p)}) = {v:.6g}" for p, v in zip(self.points, self.values, strict=True)]
        if len(shown) < 3:
            return " and ".join(shown)
        return f"{shown[0]} and {shown[1]}, but half way between them {shown[2]}"

    def _where(self) -> str:
        given = {**self.parameters, **self.data}
        return " with " + ", ".join(f"{name} = {_number(value)}" for name, value in given.items()) if given else ""


def _point(point: Point) -> str:
    return ", ".join(f"{name} = {_number(value)}" for name, value in point.items())


def _number(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return "0" if not any(value) else "(" + ", ".join(f"{x:.6g}" for x in value) + ")"
    return f"{value:.6g}"
