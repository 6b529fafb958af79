"""The path of a history in the space where the surfaces of a law are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import DeclarationError, InputError
from .elastic_domain import Setting, domain_of
from .evaluate import evaluate
from .law import Law
from .spectral import decompose

__all__ = ["Path", "path_of"]

SHEAR = 1e-9


@dataclass(frozen=True)
class Path:
    """`tensors` (n, 6) [Pa] in Mandel components, `state` after the last row by name, `frame` (3, 3) with the principal axes of the last
    tensor as columns (None: those of the components), `angle` [rad] of its deviator there, `leaves` the largest part of a deviator off the
    diagonal of the frame, relative to the largest; `largest_strain` [-]."""

    tensors: Any
    state: Mapping[str, Any]
    frame: Any
    angle: float
    leaves: float
    largest_strain: float

    @property
    def size(self) -> float:
        """Largest norm of a deviator [Pa]."""
        import numpy as np

        return float(np.sqrt((_deviators(self.tensors) ** 2).sum(axis=1)).max())


def path_of(law: Law, values: Mapping[str, Any], history: Any) -> Path:
    """Path of a `History` (`eps` [-] and `sig` [Pa] (n, 6), `state` by name): of its stress, or of the force that enters
    the surfaces. `InputError` for what is no history of this law."""
    import numpy as np

    try:
        eps, sig = np.asarray(history.eps, dtype=float), np.asarray(history.sig, dtype=float)
        states = {name: np.asarray(value, dtype=float) for name, value in history.state.items()}
    except (AttributeError, TypeError, ValueError):
        raise InputError("history must be what drive returns: eps and sig (n, 6), state by name") from None
    if eps.shape != sig.shape or eps.ndim != 2 or eps.shape[1] != 6 or len(eps) == 0:
        raise InputError(f"history: eps {eps.shape} and sig {sig.shape} must both be (n, 6), n > 0")
    names = {v.name for v in law.internal}
    if set(states) != names:
        raise InputError(f"history holds the state {sorted(states)}; law '{law.name}' has {sorted(names)}")
    state = {law.observable.name: eps[-1], **{name: value[-1] for name, value in states.items()}}
    tensors = _tensors(law, values, eps, sig, states, getattr(history, "temperature", None))
    deviators = _deviators(tensors)
    last = deviators[-1]
    largest = float(np.abs(deviators).max()) or 1.0
    frame = None
    if np.abs(deviators[:, 3:]).max() > SHEAR * largest and np.abs(last).max() > SHEAR * largest:
        frame = np.array(decompose(tensors[-1])[1])
    principal = np.diagonal(_turned(deviators, frame), axis1=1, axis2=2)
    off = np.sqrt(np.maximum((deviators**2).sum(axis=1) - (principal**2).sum(axis=1), 0.0)).max() / largest
    x = np.sqrt(2.0 / 3.0) * (principal[-1] @ np.array([1.0, -0.5, -0.5]))
    y = (principal[-1, 1] - principal[-1, 2]) / np.sqrt(2.0)
    angle = float(np.arctan2(y, x)) if np.hypot(x, y) > SHEAR * largest else np.pi / 3.0
    n = np.array([np.cos(angle), np.sin(angle)])
    across = np.column_stack(
        [
            np.sqrt(2.0 / 3.0) * (principal @ np.array([1.0, -0.5, -0.5])),
            (principal[:, 1] - principal[:, 2]) / np.sqrt(2.0),
        ]
    )
    aside = float(np.abs(across[:, 0] * n[1] - across[:, 1] * n[0]).max()) / largest
    return Path(tensors, state, frame, angle, max(float(off), aside), float(np.abs(eps).max()))


def _tensors(law: Law, values: Mapping[str, Any], eps: Any, sig: Any, states: Mapping[str, Any], heat: Any) -> Any:
    import numpy as np

    try:
        domain = domain_of(law, values)
    except DeclarationError:
        return sig
    if domain.stress and law.observable not in law.forces:
        return sig
    table = {**Setting(law, values, None).table, law.observable: eps}
    table |= {v: states[v.name] for v in law.internal}
    if law.temperature is not None and heat is not None:
        table[law.temperature] = np.asarray(heat, dtype=float)
    if domain.stress:
        return np.broadcast_to(evaluate(law.stress, table), eps.shape)
    if domain.variable == law.observable:
        return sig - evaluate(law.stress, table)
    return np.broadcast_to(evaluate(law.force_laws[domain.variable], table), eps.shape)


def _deviators(tensors: Any) -> Any:
    found = tensors.copy()
    found[:, :3] -= tensors[:, :3].sum(axis=1, keepdims=True) / 3.0
    return found


def _turned(tensors: Any, frame: Any) -> Any:
    """Matrices (n, 3, 3) in the frame."""
    import numpy as np

    root = np.sqrt(0.5)
    matrices = np.zeros((len(tensors), 3, 3))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        matrices[:, i, j] = matrices[:, j, i] = tensors[:, k] * (1.0 if k < 3 else root)
    return matrices if frame is None else frame.T @ matrices @ frame
