"""The kernels of a scene, assembled from its dimension, its bodies and its laws: columns, texts, modules, and what they cost in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from types import CodeType, ModuleType
from typing import Any, Literal

import numpy as np

from ...errors import DeclarationError
from ..laws.rule import CONTACT_NAMES, LINK_NAMES, ContactLaw, ContactRule, WireLaw, names_in
from ..residual import SUMS
from .body_text import BODIES
from .detection_text import DETECTION
from .link_text import LINKS
from .pair_text import PAIRS, PAIRS_THREADED
from .plane_text import PLANES
from .step_text import step_text
from .store import load, name_of
from .text import expand

__all__ = ["Columns", "Kernel", "SceneKernels", "detection"]

_PLACE = {"np": np, "max": max, "min": min, "abs": abs, "__builtins__": {}}

Spin = Literal["none", "all", "some"]


@dataclass(frozen=True)
class Columns:
    """Names of the columns of an array of float64, in order: (name, width)."""

    widths: tuple[tuple[str, int], ...]

    @property
    def total(self) -> int:
        """Number of columns."""
        return sum(width for _, width in self.widths)

    @cached_property
    def starts(self) -> dict[str, int]:
        """First column of each name."""
        at, out = 0, {}
        for name, width in self.widths:
            out[name] = at
            at += width
        return out


@dataclass(frozen=True)
class Kernel:
    """One generated module: its kind, its text, the columns of its rows, and the numbers of its law that it takes as arguments."""

    kind: str
    text: str
    columns: Columns
    cold: int = 0  # columns of a row that the sweeps do not read
    warm: int = 0  # columns that a candidate keeps between steps
    scalars: tuple[tuple[str, str], ...] = ()  # (argument, expression)
    needs: tuple[str, ...] = ()

    @cached_property
    def name(self) -> str:
        """Of the generated module: the kind and the hash of its text."""
        return name_of(self.kind, self.text)

    @cached_property
    def module(self) -> ModuleType:
        """Imported, written to disk first where it is new."""
        return load(self.kind, self.text)

    @cached_property
    def expressions(self) -> dict[str, CodeType]:
        """The numbers of the law, compiled; a law class states them, `names_in` checks them, nothing of a file is ever evaluated."""
        return {name: compile(text, f"<{self.kind}.{name}>", "eval") for name, text in self.scalars}

    def numbers(self, values: Mapping[str, float]) -> dict[str, float]:
        """The numbers of the law for the values of its parameters and of the step, by name of the argument."""
        return {name: float(eval(code, _PLACE, dict(values))) for name, code in self.expressions.items()}


@dataclass(frozen=True, kw_only=True)
class SceneKernels:
    """What a scene requires: `dimension` 2 or 3, which bodies turn, laws of contact and wires (None: there are none), planes, threads.

    `planes` says what friction the planes have: none, one coefficient, or one each; `apart` from that they take the law of the contacts.
    """

    dimension: int
    spin: Spin
    contact: ContactLaw | None
    planes: Literal["none", "smooth", "one", "each"] = "none"
    wire: WireLaw | None = None
    threads: int = 1

    def __post_init__(self) -> None:
        if self.dimension not in (2, 3):
            raise DeclarationError(f"dimension = {self.dimension}: a scene has 2 or 3")

    @cached_property
    def rule(self) -> ContactRule:
        """Of the contacts; without a law, that of nothing."""
        return ContactRule(bias="0.0") if self.contact is None else self.contact.rule()

    @cached_property
    def turning(self) -> Spin:
        """Which bodies turn as far as the kernels know: none where nothing can turn them."""
        frictional = bool(self.rule.friction) or self.planes in ("one", "each")
        return self.spin if frictional else "none"

    @cached_property
    def body_columns(self) -> Columns:
        """Of a row of velocities."""
        rotation = 3 if self.dimension == 3 else 1
        names = [("v", self.dimension)]
        if self.turning != "none":
            names.append(("s", rotation))
        names.append(("w", 1))
        if self.turning == "some":
            names.append(("r", 1))
        width = sum(w for _, w in names)
        # a row that fills a cache line, or a half of one, never lies across two of them
        fill = next((full for full in (4, 8) if full >= width), width) - width
        return Columns(tuple(names + ([("unused", fill)] if fill else [])))

    @property
    def turned_weight(self) -> float:
        """W_t over W_n of a contact between bodies that turn: 7/2 for solid spheres, 3 for disks, 1 where nothing turns."""
        return 1.0 if self.turning == "none" else 3.5 if self.dimension == 3 else 3.0

    def _body_values(self) -> dict[str, Any]:
        factor = 2.5 if self.dimension == 3 else 2.0
        starts = self.body_columns.starts
        return {
            "w": starts["w"],
            "s": starts.get("s", -1),
            "r": starts.get("r", -1),
            "last": self.dimension - 1,
            "lever": "" if self.turning == "some" else f"{factor} *",
            "turning": 1.0 + factor if self.turning != "none" else 1.0,
            "turned": f"(1.0 / {1.0 + factor})",
            "inertia": 1.0 / factor,
            "dimension": self.dimension,
        }

    def _features(self) -> dict[str, bool]:
        return {"spin": self.turning != "none", "mixed": self.turning == "some"}

    @cached_property
    def bodies(self) -> Kernel:
        """Velocities, energies and motion of the bodies."""
        text = expand(BODIES, self.dimension, self._features(), self._body_values() | SUMS)
        return Kernel("bodies", text, self.body_columns)

    @cached_property
    def pairs(self) -> Kernel | None:
        """Contacts between two bodies."""
        if self.contact is None:
            return None
        kernel = self._contacts("pairs", PAIRS, self.rule, None)
        if self.threads > 1:
            scalars = "".join(f", {name}" for name, _ in kernel.scalars)
            kernel = Kernel(
                "pairs", kernel.text + "\n\n" + PAIRS_THREADED.strip("\n").replace("$scalars", scalars) + "\n",
                kernel.columns, kernel.cold, kernel.warm, kernel.scalars, kernel.needs,
            )  # fmt: skip
        return kernel

    @cached_property
    def walls(self) -> Kernel | None:
        """Contacts between a body and a plane."""
        if self.planes == "none" or self.contact is None:
            return None
        friction = {"smooth": "", "one": "plane_friction", "each": "grip"}[self.planes]
        tangential = self.rule.tangential_compliance if friction else ""
        if friction and self.rule.normal_compliance and not tangential:
            tangential = self.rule.normal_compliance
        rule = ContactRule(
            bias=self.rule.bias,
            normal_compliance=self.rule.normal_compliance,
            tangential_compliance=tangential,
            friction=friction,
            least=self.rule.least,
            touching=self.rule.touching,
        )
        return self._contacts("planes", PLANES, rule, friction)

    def _contacts(self, kind: str, template: str, rule: ContactRule, friction: str | None) -> Kernel:
        law = self.contact
        assert law is not None
        own = frozenset({"grip", "plane_friction"}) if friction is not None else frozenset()
        terms = {
            "cn": rule.normal_compliance,
            "ct": rule.tangential_compliance,
            "mu": rule.friction,
            "least": rule.least,
        }
        local = CONTACT_NAMES | own - {"plane_friction"}
        mentioned = {
            name: names_in(text, law, CONTACT_NAMES | own) if text else frozenset() for name, text in terms.items()
        }
        column = {name: bool(names & local) for name, names in mentioned.items()}
        collected = names_in(rule.bias, law, CONTACT_NAMES) | names_in(rule.touching, law, CONTACT_NAMES)
        for name in terms:
            if column[name]:
                collected |= mentioned[name]
        frictional = bool(rule.friction)
        turning = self._features() if frictional else {"spin": False, "mixed": False}
        features = {
            **turning,
            "friction": frictional,
            "cn": bool(terms["cn"]),
            "ct": bool(terms["ct"]) and frictional,
            "least": bool(terms["least"]),
            **{f"{name}_column": column[name] for name in terms},
            **{name: name in collected for name in CONTACT_NAMES},
        }
        d = self.dimension
        widths = [("n", d)] if kind == "pairs" else []
        widths.append(("p", d if frictional else 1))
        if features["ct"]:
            widths.append(("e", d))
        widths += [("b", 1), ("iw", 1)]
        if frictional and (kind == "planes" or features["ct"] or features["mixed"]):
            widths.append(("it", 1))
        widths += [(f"{name}_at", 1) for name in terms if column[name]]
        columns = Columns(tuple(widths))
        starts = {name: columns.starts.get(name, -1) for name in ("n", "p", "e", "b", "iw", "it")}
        starts |= {f"{name}_at": columns.starts.get(f"{name}_at", -1) for name in terms}
        scalars = tuple((name, text) for name, text in terms.items() if text and not column[name])
        if not features["ct"]:
            scalars = tuple(s for s in scalars if s[0] != "ct")
        default = {"cn": "0.0", "ct": "0.0", "mu": "0.0", "least": "0.0"}
        access = {
            name: f"row[k, {columns.starts[f'{name}_at']}]" if column[name] else (name if text else default[name])
            for name, text in terms.items()
        }
        parameters = [n for n in law.parameter_names() if n in collected]
        places = {n: k for k, n in enumerate(law.parameter_names())}
        values = {
            **self._body_values(),
            **SUMS,
            **starts,
            **access,
            "warm_n": d if frictional else 0,
            "unpack": "\n    ".join(f"{n} = parameter[{places[n]}]" for n in parameters),
            "scalars": "".join(f", {name}" for name, _ in scalars),
            "touching": rule.touching,
            "bias": rule.bias,
            "friction": rule.friction,
            "normal_compliance": rule.normal_compliance,
            "tangential_compliance": rule.tangential_compliance,
            "least_value": rule.least,
        }
        if features["mixed"] is False and self.turning == "some":
            values["lever"] = ""
        text = expand(template, d, features, values)
        cold = 2 if features["cn"] else 1
        return Kernel(kind, text, columns, cold, d + 1 if frictional else 1, scalars)

    @cached_property
    def links(self) -> Kernel | None:
        """Links between beads."""
        law = self.wire
        if law is None:
            return None
        rule = law.rule()
        mentioned = frozenset().union(*(names_in(t, law, LINK_NAMES) for t in (rule.bias, rule.compliance) if t))
        widths = [("n", self.dimension), ("p", 1), ("iw", 1)]
        if rule.bias:
            widths.append(("b", 1))
        if rule.compliance:
            widths += [("c", 1), ("o", 1)]
        columns = Columns(tuple(widths))
        features = {
            "bias": bool(rule.bias),
            "compliant": bool(rule.compliance),
            "unilateral": rule.unilateral,
            "natural": "natural" in mentioned,
            "approach": "approach" in mentioned,
        }
        places = {n: k for k, n in enumerate(law.parameter_names())}
        values = {
            **self._body_values(),
            **SUMS,
            **{name: columns.starts.get(name, -1) for name in ("n", "p", "b", "c", "o", "iw")},
            "bias": rule.bias,
            "compliance": rule.compliance,
            "unpack": "\n    ".join(f"{n} = parameter[{k}]" for n, k in places.items() if n in mentioned),
        }
        return Kernel("links", expand(LINKS, self.dimension, features, values), columns, 0, 1)

    @cached_property
    def step(self) -> tuple[Kernel, dict[str, tuple[str, ...]]]:
        """The module that sweeps and measures all kinds of rows, and the names of its arguments."""
        kinds = {"pairs": self.pairs, "planes": self.walls, "links": self.links}
        present = {kind: kernel for kind, kernel in kinds.items() if kernel is not None}
        names = {kind: kernel.name for kind, kernel in present.items()} | {"bodies": self.bodies.name}
        scalars = {kind: tuple(name for name, _ in kernel.scalars) for kind, kernel in present.items()}
        text, signatures = step_text(names, scalars, self.threads > 1 and "pairs" in present)
        return Kernel("step", text, Columns(())), signatures

    def all(self) -> tuple[Kernel, ...]:
        """Every generated module of the scene; the modules a module calls come first."""
        kinds = (self.bodies, self.pairs, self.walls, self.links)
        found = [detection(self.dimension, self.wire is not None), *(kernel for kernel in kinds if kernel is not None)]
        for kernel in found:
            _ = kernel.module
        return (*found, self.step[0])

    def bytes_per_contact(self) -> dict[str, int]:
        """Memory [bytes] of one row of each kind: what the sweeps read, what only the measures read, indices, and the warm start."""
        out = {}
        for name, kernel in (("pairs", self.pairs), ("planes", self.walls), ("links", self.links)):
            if kernel is not None:
                # rows, cold rows, warm start; two int32 bodies, their candidate, and the candidate's two bodies
                indices = 8 if name == "links" else 4 * (2 + 1 + 2)
                out[name] = 8 * (kernel.columns.total + kernel.cold + kernel.warm) + indices
        return out

    def report(self) -> dict[str, Any]:
        """Names of the generated modules and bytes of a row of each kind, as a run file holds them."""
        return {"names": " ".join(kernel.name for kernel in self.all()), "bytes": self.bytes_per_contact()}

    def source(self) -> str:
        """The text of all generated modules, to read."""
        return "\n\n".join(f"# {kernel.name}\n{kernel.text}" for kernel in self.all())


@cache
def detection(dimension: int, wires: bool = False) -> Kernel:
    """The kernel of detection in 2 or 3 dimensions, between grains alone or where some bodies are beads of `wires`."""
    values = {
        "dimension": dimension,
        "components": ", ".join(f"c_{a}" for a in range(dimension)),
        "chains": ", wire, rank, apart" if wires else "",
    }
    return Kernel("detection", expand(DETECTION, dimension, {"wires": wires}, values), Columns(()))
