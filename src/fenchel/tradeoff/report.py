"""What a front says: its content for front.json, and the recommendation in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..front import Front

__all__ = ["content_of", "sentences"]


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
