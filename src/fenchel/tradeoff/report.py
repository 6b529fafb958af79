"""What a front says: its content for front.json, and the recommendation in words."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import StorageError
from ..front import Front

__all__ = ["content_of", "sentences", "write_bytes"]


def content_of(fronts: Sequence[Front], accuracies: Sequence[float]) -> dict[str, Any]:
    """Everything that was measured, and the recommended setting (null: none) per front and accuracy."""
    return {
        "fronts": [front.as_dict() for front in fronts],
        "recommended": [
            {
                "front": front.kind,
                "accuracy": accuracy,
                "setting": None if point is None else dict(point.setting),
                "cost": None if point is None else point.cost,
                "error": None if point is None else point.error,
            }
            for front in fronts
            for accuracy, point in front.recommended(accuracies).items()
        ],
    }


def sentences(front: Front, accuracies: Sequence[float]) -> list[str]:
    """One line per accuracy: what to take."""
    found = []
    for accuracy, point in front.recommended(accuracies).items():
        if point is None:
            found.append(f"for {accuracy:g}: no setting that was tried; the finest reached {front.finest:.1e}")
        else:
            found.append(f"for {accuracy:g}: {point.name} (error {point.error:.1e}, {point.cost:.3g} {front.cost})")
    return found


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file, replaced atomically. `StorageError` when the disk refuses."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(temporary).chmod(0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise StorageError(
            f"{path}: cannot be written ({error.strerror}): free some space or choose another place"
        ) from error
