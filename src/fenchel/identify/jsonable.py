"""Results as JSON: frozen dataclasses to dicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import Any

import numpy as np

__all__ = ["jsonable"]


def jsonable(value: Any, *, arrays: bool = False) -> Any:
    """Dataclasses to dicts by field, tuples to lists, keys to text, nan and infinity to None; arrays dropped unless asked."""
    if is_dataclass(value) and not isinstance(value, type):
        return {
            f.name: jsonable(getattr(value, f.name), arrays=arrays)
            for f in fields(value)
            if arrays or not isinstance(getattr(value, f.name), np.ndarray)
        }
    if isinstance(value, Mapping):
        return {
            (f"{key:g}" if isinstance(key, float) else str(key)): jsonable(item, arrays=arrays)
            for key, item in value.items()
            if arrays or not isinstance(item, np.ndarray)
        }
    if isinstance(value, np.ndarray):
        return jsonable(value.tolist(), arrays=arrays)
    if isinstance(value, (list, tuple)):
        return [jsonable(item, arrays=arrays) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if isfinite(value) else None
    return value if value is None else str(value)
