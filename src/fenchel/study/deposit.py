r"""A slope deposit of the study: the same densified block as that of the triaxial test, with its wires linked, unlinked, or without any.

The fall is followed until the kinetic energy is below 10⁻⁴ of the potential energy set free; beads on their wires would go on
trembling for ever far below that. Then every step starts from rest (`fenchel.dem.relaxation`), until the mean net force of the bodies is
below a hundredth of the mean contact force: the heap that is measured is in static equilibrium. Beside the final state the task keeps
histories of both, and of the wire fabric.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ..campaign import progress_file, report_progress
from ..dem.bodies import Assembly
from ..dem.measures import Network, Repose, angle_of_repose, wire_fabric
from ..dem.preparation import make_sample, material_of
from ..dem.run import Stage, run_stages
from ..dem.slope import SlopeDeposit, slope_start
from ..errors import ConvergenceError, InputError
from ..identify.study import Study

__all__ = ["Deposit", "heap", "loose_block"]

Array = NDArray[np.float64]

EVERY = 40  # steps between two entries of the history
_KEPT = ("step", "time", "kinetic", "fabric_zz", "unbalanced")


class _Heap(SlopeDeposit):
    """The deposit, then the steps from rest, with a history."""

    name = "deposit"
    limit = 2000  # steps from rest

    def __init__(self, assembly: Assembly, *arguments: Any, **options: Any) -> None:
        super().__init__(assembly, *arguments, **options)
        self.history: dict[str, list[float]] = {name: [] for name in _KEPT}
        self.settling = 0
        self.still = 0
        self.unbalanced = np.inf

    @property
    def done(self) -> bool:
        """True after ten steps from rest in equilibrium."""
        return self.still >= 10

    @property
    def fraction(self) -> float:
        """Share of the way to rest."""
        return 0.95 * self.settled + 0.005 * self.still

    def advance(self) -> dict[str, float]:
        """One step; `ConvergenceError` when the heap does not come to rest."""
        if self.steps == 0:
            self._keep()
        if not self.fallen:
            measures = super().advance()
            self.unbalanced = measures["unbalanced"]
            if self.steps % EVERY == 0 or self.fallen:
                self._keep()
            return measures
        return self._settle()

    @property
    def fallen(self) -> bool:
        """Whether the kinetic energy has died out."""
        return self.calm >= 50

    def _settle(self) -> dict[str, float]:
        a = self.assembly
        a.velocity[:] = 0.0
        a.spin[:] = 0.0
        a.plane_velocity[:] = 0.0
        measures = self.pace.advance(self.drive)
        self.settling += 1
        self.unbalanced = measures["unbalanced"]
        self.still = self.still + 1 if self.unbalanced < 1e-2 else 0
        if self.settling >= self.limit and not self.done:
            raise ConvergenceError(
                f"deposit: unbalanced over contact force is {self.unbalanced:.1e} after {self.settling} steps from rest: "
                "tighten the tolerance"
            )
        if self.done:
            self._keep()
        return measures

    def _keep(self) -> None:
        a = self.assembly
        zz = float(wire_fabric(Network.of_assembly(a))[2, 2]) if len(a.links) else np.nan
        row = (float(self.steps), float(a.time), self.ratio if self.steps else 0.0, zz, self.unbalanced)
        for name, value in zip(_KEPT, row, strict=True):
            self.history[name].append(value)

    def state(self) -> dict[str, Any]:
        """What a checkpoint needs."""
        return super().state() | {
            "history": {name: np.array(values) for name, values in self.history.items()},
            "settling": self.settling,
            "still": self.still,
            "unbalanced": self.unbalanced,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Inverse of `state`."""
        super().restore(state)
        self.history = {name: list(state["history"][name]) for name in _KEPT}
        self.settling, self.still = int(state["settling"]), int(state["still"])
        self.unbalanced = float(state["unbalanced"])


def loose_block(study: Study, seed: int, kind: str) -> Assembly:
    """The densified block of a seed; of kind "sand" the one without wires."""
    wires = None if kind == "sand" else study.wires
    return make_sample(study.grains, wires, study.sample, seed)


@dataclass(frozen=True)
class Deposit:
    """One deposit; `kind`: "linked", "unlinked" (the same beads, loose) or "sand" (the same grains, no beads)."""

    study: Study
    seed: int
    kind: str
    folder: Path
    label: str = "deposit"
    tolerance: float = 1e-3
    step: float = 1.0  # over √(d/g)/80
    reach: float = 2.0

    @property
    def name(self) -> str:
        """Of the task, and of its progress file."""
        return f"{self.label}, seed {self.seed}: {self.kind}"

    @property
    def cost(self) -> float:
        """Rough share of the whole work."""
        return (self.study.grains.count / 1000.0) ** 1.5 * {"linked": 4.0, "unlinked": 2.5, "sand": 1.2}[self.kind]

    @property
    def needs(self) -> tuple[str, ...]:
        """Nothing."""
        return ()

    @property
    def run_file(self) -> Path:
        """Where the result is."""
        return self.folder / f"{self.label.replace(' ', '_')}_seed{self.seed}_{self.kind}.h5"

    def settings(self) -> dict[str, Any]:
        """What the result depends on."""
        whole = msgspec.to_builtins(self.study)
        kept = {key: whole[key] for key in ("grains", "sample")} | {
            "wires": None if self.kind == "sand" else whole["wires"]
        }
        return kept | {
            "seed": self.seed, "kind": self.kind, "tolerance": self.tolerance, "step": self.step, "reach": self.reach,
        }  # fmt: skip

    def _stage(self, assembly: Assembly) -> Stage:
        grains = msgspec.structs.replace(self.study.grains, normal_stiffness=None)  # that of the deposit is its own
        law = material_of(grains, None if self.kind == "sand" else self.study.wires)
        return _Heap(
            assembly, replace(law, links=self.kind == "linked"), density=grains.density, rest=1e-4, step_limit=100_000,
            tolerance=self.tolerance, step_fraction=self.step / 80.0,
        )  # fmt: skip

    def __call__(self) -> dict[str, Any]:
        """Let the block fall and settle, or read what it left before."""

        def begin() -> Assembly:
            block = loose_block(self.study, self.seed, self.kind)
            return slope_start(block, density=self.study.grains.density, reach=self.reach)

        return run_stages(
            [self._stage],
            begin,
            self.run_file,
            self.settings(),
            self._content,
            progress=partial(report_progress, progress_file(self.folder, self.name)),
        )

    def _content(self, assembly: Assembly, stage: Stage) -> dict[str, Any]:
        assert isinstance(stage, _Heap)
        return {
            "assembly": assembly.arrays(),
            "history": {name: np.array(values) for name, values in stage.history.items()},
            "quality": {
                "unbalanced": stage.unbalanced,
                "kinetic": stage.ratio,
                "natural_map_max": stage.worst,
                "lost": 1.0 - float(stage.deposited.sum()) / float(np.isfinite(assembly.mass).sum()),
                "steps": float(stage.steps),
                "settling_steps": float(stage.settling),
                "sweeps_mean": stage.simulation.total_sweeps / max(stage.steps, 1),
                "step_cuts": float(stage.pace.cuts),
            },
        }


def heap(content: dict[str, Any], *, azimuths: int = 6) -> Repose | None:
    """The slope of a finished deposit; None where its surface has too few bodies."""
    a = Assembly.from_arrays(content["assembly"])
    kept = np.isfinite(a.mass) & (a.x[:, 2] > -a.grain_radius)
    try:
        return angle_of_repose(a.x[kept], a.radius[kept], azimuths=azimuths)
    except InputError:
        return None
