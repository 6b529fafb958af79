"""The emitted steps as compiled functions: one per layout of a state, components that exist, and precision of the arrays."""

from __future__ import annotations

import functools
from typing import Any

from ...cache import content_hash, load_text
from ..key import kernels_hash
from .closed_text import closed_text
from .reduced_text import EIGEN, reduced_text, trial_text
from .terms_text import DERIVATIVE, POSITIVE, terms_text

__all__ = ["step_kernel", "step_text", "terms_kernel", "trial_kernel"]

_HEAD = '''"""Written by fenchel.integrators.kernels; do not edit."""

import math

import numpy as np

from fenchel.cache import njit
from fenchel.integrators.kernel_types import {signature}
{imports}
FOLDER = __name__


@njit(folder=FOLDER, signature_or_function={signature}, nogil=True)
'''
_SPECTRAL = {6: "spectral", 4: "spectral_plane", 3: "spectral_plane"}


def step_text(kind: str, size: int, plan: tuple[int, ...], single: bool) -> str:
    """Text of the module of a step; `kind` is "closed" or "reduced"."""
    body = (closed_text if kind == "closed" else reduced_text)(size, plan, single)
    return _head(body, size, "STEP_SIGNATURE_32" if single else "STEP_SIGNATURE") + body


def _head(body: str, size: int, signature: str) -> str:
    """Head of a module that imports what its body calls."""
    words = [w for w in ("ROOT", "THIRD", "descending", "norm_of", "size_of", "theta") if w in body]
    called = [w for w in (EIGEN[size], POSITIVE[size], DERIVATIVE[size]) if f"{w}(" in body]
    imports = f"from fenchel.integrators.kernels.point import {', '.join(words)}\n" if words else ""
    imports += f"from fenchel.integrators.{_SPECTRAL[size]} import {', '.join(called)}\n" if called else ""
    return _HEAD.format(signature=signature, imports=imports)


@functools.cache
def step_kernel(kind: str, size: int, plan: tuple[int, ...], single: bool = False) -> Any:
    """Compiled step for tensors of `size` components and a plan; `single` for arrays of float32."""
    return _loaded(f"{kind}_step", step_text(kind, size, plan, single)).step


@functools.cache
def trial_kernel(size: int, plan: tuple[int, ...]) -> Any:
    """Compiled trial numbers of a reduced step."""
    body = trial_text(size, plan)
    return _loaded("trial_numbers", _head(body, size, "TRIAL_SIGNATURE") + body).trials


@functools.cache
def terms_kernel(size: int) -> Any:
    """Compiled unilateral energies of the strain, a `rest` of a step."""
    body = terms_text(size)
    return _loaded("strain_terms", _head(body, size, "LAW_SIGNATURE") + body).terms


def _loaded(kind: str, text: str) -> Any:
    return load_text("kernels", f"fenchel_{kind}_{content_hash(text, kernels_hash())}", lambda: text)
