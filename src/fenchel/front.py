"""Speed against accuracy, as measured: settings with what they cost and how wrong they are (the ground floor: only the cache is below).

A *setting* (solver, tolerance, step, ...) has a cost and an error. It is *dominated* where another one costs no more and errs no more; the
rest is the *front* (Pareto 1906). The cheapest setting for a wanted accuracy is the cheapest one whose measured error does not exceed it.
Fronts that a user measured are kept in the cache under the fingerprint of the machine; those that come with the package were measured on
random cases, and their errors are quantiles over these.
"""

from __future__ import annotations

import functools
import json
import math
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from .cache import cache_folder, content_hash, replace_file
from .errors import InputError
from .notebook import html_table, text_table

__all__ = ["Front", "Measured", "checked_accuracy", "environment", "fingerprint", "kept_front", "shipped_front"]

SLACK = 0.05  # differences of cost below this share are noise of the clock
ROUNDING = 1e-12  # errors below are rounding, of the trusted answer too, and count as equal


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One setting: its `cost` (unit of the front), its `error` (None: it did not get there, and `failure` says why), further `figures`."""

    setting: Mapping[str, Any]
    cost: float
    error: float | None
    figures: Mapping[str, float | None] = field(default_factory=dict)
    failure: str = ""

    @property
    def name(self) -> str:
        """The setting in one line.

        >>> Measured(setting={"solver": "general", "tolerance": 1e-6}, cost=1.0, error=0.0).name
        'solver general, tolerance 1e-06'
        """
        return ", ".join(f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in self.setting.items())


@dataclass(frozen=True, kw_only=True)
class Front:
    """`points` measured on a `subject` in one run: `measure` says what the error is, `cost` in what the cost is counted."""

    kind: str
    subject: str
    measure: str
    cost: str
    points: tuple[Measured, ...]
    environment: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""

    @property
    def efficient(self) -> tuple[int, ...]:
        """Places of the settings that no other dominates, the cheapest first.

        A setting is dominated where another errs no more and costs no more, and is better in one of the two; costs that differ by less
        than five per cent count as equal, as do errors below 1e-12, and of two equal settings the first one stays.
        """
        good = [k for k, p in enumerate(self.points) if p.error is not None]
        best: dict[float, list[int]] = {}
        for k in good:
            if not any(_dominates(self.points[j], self.points[k]) for j in good):
                best.setdefault(_error(self.points[k]), []).append(k)
        found = []
        for alike in (
            best.values()
        ):  # of one error: equal costs are no order by themselves (1, 1.04 and 1.08), those of the cheapest are
            least = min(self.points[k].cost for k in alike)
            found.append(next(k for k in alike if self.points[k].cost <= least * (1.0 + SLACK)))
        return tuple(sorted(found, key=lambda k: self.points[k].cost))

    def cheapest(self, accuracy: float) -> Measured | None:
        """The cheapest setting whose error is at most `accuracy`, none that another dominates; of those that cost the same (five per cent)
        the most accurate."""
        good = [p for p in self.points if p.error is not None and _error(p) <= accuracy]
        if not good:
            return None
        inside = [self.points[k] for k in self.efficient]
        good = [p for p in good if p in inside]
        least = min(p.cost for p in good)
        return min((p for p in good if p.cost <= least * (1.0 + SLACK)), key=_error)

    @property
    def finest(self) -> float:
        """The smallest error that was measured."""
        return min((_error(p) for p in self.points if p.error is not None), default=math.inf)

    def recommended(self, accuracies: Iterable[float]) -> dict[float, Measured | None]:
        """The cheapest setting for each accuracy."""
        return {accuracy: self.cheapest(accuracy) for accuracy in accuracies}

    def _summary(self) -> tuple[str, tuple[str, ...], list[tuple[str, ...]]]:
        inside = set(self.efficient)
        order = sorted(range(len(self.points)), key=lambda k: self.points[k].cost)
        rows = [
            (
                "*" if k in inside else "",
                self.points[k].name,
                f"{self.points[k].cost:.3g}",
                f"{self.points[k].error:.1e}"
                if self.points[k].error is not None
                else self.points[k].failure or "failed",
            )
            for k in order
        ]
        title = f"{self.kind} of {self.subject}: {len(inside)} of {len(self.points)} settings are not dominated (*)"
        return title, ("", "setting", f"cost [{self.cost}]", f"error ({self.measure})"), rows

    def __repr__(self) -> str:
        title, heads, rows = self._summary()
        return text_table(title, [heads, *rows])

    def _repr_html_(self) -> str:
        return html_table(*self._summary())

    def as_dict(self) -> dict[str, Any]:
        """As plain numbers, words, lists and dictionaries."""
        whole = asdict(self)
        inside = set(self.efficient)
        whole["points"] = [
            _plain(asdict(point)) | {"dominated": k not in inside} for k, point in enumerate(self.points)
        ]
        return whole

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Front:
        """Inverse of `as_dict`."""
        names = ("setting", "cost", "error", "figures", "failure")
        points = tuple(Measured(**{name: point[name] for name in names}) for point in content["points"])
        rest = {name: content[name] for name in ("kind", "subject", "measure", "cost", "environment", "note")}
        return cls(points=points, **rest)


def _error(point: Measured) -> float:
    return math.inf if point.error is None else max(point.error, ROUNDING)


def _dominates(one: Measured, other: Measured) -> bool:
    """Whether `one` errs less at no more cost."""
    return _error(one) < _error(other) and one.cost <= other.cost * (1.0 + SLACK)


def _plain(point: dict[str, Any]) -> dict[str, Any]:
    def finite(value: Any) -> Any:
        return None if isinstance(value, float) and not math.isfinite(value) else value

    point["error"] = finite(point["error"])
    point["figures"] = {name: finite(value) for name, value in point["figures"].items()}
    return point


# -- where fronts are kept -----------------------------------------------------------------------------------------------------


@functools.cache
def environment() -> dict[str, str]:
    """What a measured time depends on: processor, number of processors, Python and the libraries that compute."""
    import importlib.metadata

    found = {
        "processor": _processor(),
        "processors": str(os.cpu_count() or 1),
        "python": platform.python_version(),
    }
    return found | {name: importlib.metadata.version(name) for name in ("numpy", "numba", "scipy", "clarabel")}


def fingerprint() -> str:
    """Hash of `environment`: fronts of another machine or of other libraries are not taken."""
    return content_hash(json.dumps(environment(), sort_keys=True))


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _file(kind: str, key: str) -> Path:
    return cache_folder() / "fronts" / fingerprint() / f"{kind}_{key}.json"


def kept_front(kind: str, key: str) -> Front | None:
    """The front that was measured on this machine for the subject with this key (a hash of it), or None."""
    try:
        return Front.from_dict(json.loads(_file(kind, key).read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep_front(front: Front, key: str) -> Path:
    """Keep a front in the user's cache; returns the file. `StorageError` when the disk refuses."""
    path = _file(front.kind, key)
    write_json(path, front.as_dict())
    return path


def write_json(path: Path, content: Any) -> None:
    """Write JSON, replaced atomically: a kill leaves the file of before. `StorageError` when the disk refuses."""
    replace_file(path, (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode())


@functools.cache
def shipped_front(name: str) -> Mapping[str, Any]:
    """Measurements that come with the package: the content of `fronts/<name>.json`."""
    path = Path(__file__).parent / "fronts" / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8"))


def checked_accuracy(accuracy: Any, what: str = "accuracy") -> float:
    """A wanted relative error, between 0 and 1; `InputError` for anything else."""
    if isinstance(accuracy, bool) or not isinstance(accuracy, (int, float)) or not 0.0 < accuracy < 1.0:
        raise InputError(f"{what} = {accuracy!r}: a relative error between 0 and 1, e.g. 1e-6")
    return float(accuracy)


def quantile(values: Sequence[float], share: float) -> float:
    """The smallest of the values that at least this share of them does not exceed.

    >>> quantile([3.0, 1.0, 2.0], 0.6)
    2.0
    """
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, max(0, math.ceil(share * len(ordered)) - 1))]
