"""A step of three dimensions used in another dimension: components that do not exist are zero in and must come out as zero.

An isotropic law keeps the mirror symmetry of its data, so that the shears left out vanish. Where they do not (a law that is not isotropic,
or a state that is not symmetric) the step is refused rather than cut.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .dimension import Dimension
from .packing import StatePacking
from .relaxed import Evaluation, condensed, relax

__all__ = ["EmbeddedUpdate"]

Array = NDArray[np.float64]
ROUNDING = 1e-9


@dataclass(frozen=True)
class EmbeddedUpdate:
    """`whole`, an update of three dimensions, in `dimension`; same call, with the components of the dimension."""

    whole: Any
    dimension: Dimension
    packing: StatePacking
    tangent: bool = True

    @classmethod
    def of(cls, whole: Any, dimension: Dimension, tangent: bool = True) -> EmbeddedUpdate:
        """Refuses nothing; the law's own rules were checked when `whole` was made."""
        layout, start = {}, 0
        for name, (_, length) in whole.layout.items():
            layout[name] = (start, dimension.size if length == 6 else length)
            start += layout[name][1]
        return cls(whole, dimension, StatePacking(whole.law, layout, start), tangent)

    @property
    def law(self) -> Any:
        """The law."""
        return self.whole.law

    @property
    def solver(self) -> str:
        """Method of the step."""
        return str(self.whole.solver)

    @property
    def why(self) -> str:
        """Why this method."""
        return str(self.whole.why)

    @property
    def formulation(self) -> str:
        """What drives the step."""
        return str(getattr(self.whole, "formulation", "strain"))

    @property
    def layout(self) -> Mapping[str, tuple[int, int]]:
        """Place of each state variable in a packed row."""
        return self.packing.layout

    def initial_state(self, point_count: int = 1) -> dict[str, Array]:
        """Virgin state."""
        return self.packing.initial_state(point_count)

    def __call__(
        self,
        eps_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> Any:
        """See `Update.__call__`. Raises `InputError` too where a component that does not exist comes out different from zero."""
        shape = self.dimension
        if self.formulation == "stress":
            return self._driven(eps_new, state, dt, certify, values)
        eps = shape.strains(eps_new)
        old = self._widened(self.packing.unpack(self.packing.pack(state, len(eps))))
        if shape.relaxed:
            varying = {k for k, v in values.items() if np.ndim(v)}

            def evaluate(strains: Array, points: Any) -> Evaluation:
                own = {k: np.asarray(v)[points] if k in varying else v for k, v in values.items()}
                part = {k: v[points] for k, v in old.items()}
                out = self.whole(shape.embedded(strains), part, dt, **own)
                return Evaluation(self._narrowed(out.stress), self._block(out.tangent), out.status.copy())

            eps, _ = relax(evaluate, eps, shape.relaxed)
        out = self.whole(shape.embedded(eps), old, dt, certify=certify, **values)
        stress = self._narrowed(out.stress)
        tangent = None if out.tangent is None else self._block(out.tangent)
        if shape.relaxed:
            stress = stress[:, list(shape.given)]
            tangent = None if tangent is None else condensed(tangent, shape.given, shape.relaxed)
        found = {k: self._narrowed(v) if v.ndim == 2 and v.shape[1] == 6 else v for k, v in out.state.items()}
        return replace(out, stress=stress, tangent=tangent if self.tangent else None, state=found, strain=eps)

    def _driven(self, given: Any, state: Any, dt: float, certify: bool, values: Mapping[str, Any]) -> Any:
        """The step from the stresses that are given; those that are relaxed are zero."""
        shape, inside = self.dimension, list(self.dimension.given)
        sig = shape.stresses(given)
        old = self._widened(self.packing.unpack(self.packing.pack(state, len(sig))))
        out = self.whole(shape.embedded(sig), old, dt, certify=certify, **values)
        compliance = None if out.tangent is None else self._block(out.tangent)[:, inside][:, :, inside]
        found = {k: self._narrowed(v) if v.ndim == 2 and v.shape[1] == 6 else v for k, v in out.state.items()}
        return replace(
            out,
            stress=np.ascontiguousarray(sig[:, inside]),
            tangent=compliance if self.tangent else None,
            state=found,
            strain=self._narrowed(out.strain),
        )

    def _widened(self, state: Mapping[str, Array]) -> dict[str, Array]:
        wide = self.whole.layout
        return {k: self.dimension.embedded(v) if wide[k][1] == 6 else v for k, v in state.items()}

    def _narrowed(self, tensors: Array) -> Array:
        places = list(self.dimension.places)
        rest = np.delete(tensors, places, axis=1)
        size = np.abs(tensors).max(initial=0.0)
        if np.abs(rest).max(initial=0.0) > ROUNDING * size:
            raise InputError(
                f"law '{self.law.name}': a shear that does not exist in '{self.dimension.name}' comes out different from zero; use '3d'"
            )
        return np.ascontiguousarray(tensors[:, places])

    def _block(self, tangent: Array) -> Array:
        places = list(self.dimension.places)
        return np.ascontiguousarray(tangent[:, places][:, :, places])
