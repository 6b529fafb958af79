"""The samples, deposits and triaxial tests behind the discrete claims, as tasks.

All of them are of one kind: grains of 0.75 to 1.39 mm (mean 1.07 mm, that of the study's triaxial sample), 2600 kg/m³, μ = 0.4, contact
stiffness 20 MPa per diameter; wires of 60 beads spaced by a mean radius, bead radius 0.4 mean radii, k = 100 N, one bead per grain
(ρ_L d² ≈ 0.46, the study's 10⁵ m⁻²). A block is made once per seed; the deposit releases it, the triaxial test compresses it. What
another run changes stands in its label.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..campaign import Task
from ..dem.scene import Grains, Name, Sample, Wires
from ..identify.study import Identify, Study, StudySolve, StudyTriaxial
from ..identify.tasks import Prepare, Test
from .deposit import Deposit
from .sizes import Size

__all__ = [
    "BASE", "BEADS", "FREE", "KINDS", "PRESSURE", "RADIUS", "RIGID", "STIFF", "TAUT", "VARIED", "Setting", "bead_label", "beads_study",
    "deposits",
    "stiffness_label", "stiffness_runs", "study_of", "taut_tests", "triaxial", "varied",
]  # fmt: skip

RADIUS = 1.07e-3  # m, mean of the grains
PRESSURE = 5e4  # Pa
KINDS = ("linked", "unlinked", "sand")
BASE = "block"
TAUT = "block taut"  # wires that pull from the preparation on
RIGID = "rigid wire"


@dataclass(frozen=True)
class Setting:
    """What a run is made of beside its size; the defaults are those of the module's text."""

    beads: int = 60
    per_grain: float = 1.0  # beads over grains
    bead_ratio: float = 0.4
    law: Name = "elastic_wire"
    stiffness: float = 100.0  # N
    state: Literal["stress_free", "prestressed"] = "stress_free"
    friction: float = 0.4
    path: tuple[float, ...] = (0.0, -0.01)
    tolerance: float = 1e-5
    step: float = 0.05
    frame_strain: float = 1e-4
    slope_tolerance: float = 1e-3
    slope_step: float = 1.0
    pressures: tuple[float, ...] = (PRESSURE,)
    held_out: tuple[float, ...] = ()
    seeds: tuple[int, ...] = (1,)


FREE = Setting()
STIFF = Setting(beads=40, per_grain=2.0, state="prestressed", path=(0.0, -0.005), frame_strain=5e-5)
BEADS = Setting(beads=40, per_grain=2.0, state="prestressed", path=(0.0, -0.03), frame_strain=2e-4)

VARIED: dict[str, Setting] = {  # one setting changed at a time
    "as it is": Setting(),
    "tolerance": Setting(tolerance=1e-6, slope_tolerance=1e-4),
    "step": Setting(step=0.025, slope_step=0.5),
    "bead radius": Setting(bead_ratio=0.3),
    "friction": Setting(friction=0.5),
}


def study_of(count: int, setting: Setting) -> Study:
    """The study of `count` grains with a setting."""
    wires = max(1, round(setting.per_grain * count / setting.beads))
    return Study(
        grains=Grains(count=count, friction=setting.friction, normal_stiffness=4.3e4),
        wires=Wires(
            law=setting.law, count=wires, beads=setting.beads, spacing=RADIUS, bead_radius=setting.bead_ratio * RADIUS,
            stiffness=setting.stiffness, state=setting.state,
        ),
        sample=Sample(),
        triaxial=StudyTriaxial(
            pressures=setting.pressures, held_out=setting.held_out, strain_path=setting.path, frame_strain=setting.frame_strain,
        ),
        solve=StudySolve(tolerance=setting.tolerance, step=setting.step, seeds=setting.seeds, stiffness_probe=False),
        identify=Identify(),
    )  # fmt: skip


def deposits(
    count: int,
    seeds: int,
    folder: Path,
    kinds: tuple[str, ...] = KINDS,
    *,
    label: str = BASE,
    setting: Setting | None = None,
) -> list[Deposit]:
    """Deposits of some kinds of every seed."""
    s = setting or Setting()
    return [
        Deposit(study_of(count, s), seed, kind, folder, f"{label} deposit", s.slope_tolerance, s.slope_step)
        for seed in range(1, seeds + 1)
        for kind in kinds
    ]


def triaxial(
    count: int,
    seeds: int,
    folder: Path,
    *,
    label: str = BASE,
    setting: Setting | None = None,
    linked: tuple[bool, ...] = (True,),
) -> list[Any]:
    """Preparations and tests of every seed at every pressure of the setting."""
    study = study_of(count, setting or Setting())
    tasks: list[Any] = []
    for seed in range(1, seeds + 1):
        tasks.append(Prepare(study, seed, folder, label))
        tasks += [Test(study, seed, p, on, folder, label) for p in study.pressures for on in linked]
    return tasks


def taut_tests(size: Size, folder: Path) -> list[Any]:
    """The triaxial tests of the blocks with wires that pull from the preparation on."""
    return triaxial(size.grains, size.seeds, folder, label=TAUT, setting=Setting(state="prestressed"))


def varied(size: Size, folder: Path) -> list[Task]:
    """The pair of deposits and the triaxial test under every setting of `VARIED`."""
    tasks: list[Task] = []
    for name, setting in VARIED.items():
        label = f"vary {name}"
        tasks += deposits(
            size.fine_grains, size.fine_seeds, folder, ("linked", "unlinked"), label=label, setting=setting
        )
        tasks += triaxial(size.fine_grains, size.fine_seeds, folder, label=label, setting=setting)
    return tasks


def stiffness_label(stiffness: float | None, *, strict: bool = False) -> str:
    """Of a sweep over the wire stiffness [N]; None is the rigid wire, `strict` half the tolerance and step."""
    return (RIGID if stiffness is None else f"k {stiffness:g} N") + (" strict" if strict else "")


def stiffness_runs(size: Size, folder: Path) -> list[Task]:
    """Tests with wires of several stiffnesses, the rigid one, and that again under half the tolerance and half the step."""
    from dataclasses import replace

    tasks: list[Task] = []
    for k in (*size.wire_stiffness, None):
        law = replace(STIFF, law="rigid_wire") if k is None else replace(STIFF, stiffness=k)
        tasks += triaxial(size.fine_grains, size.fine_seeds, folder, label=stiffness_label(k), setting=law)
    for k in (max(size.wire_stiffness), None):
        law = replace(STIFF, law="rigid_wire") if k is None else replace(STIFF, stiffness=k)
        strict = replace(law, tolerance=0.5 * law.tolerance, step=0.5 * law.step)
        tasks += triaxial(
            size.fine_grains, size.fine_seeds, folder, label=stiffness_label(k, strict=True), setting=strict
        )
    return tasks


def bead_label(ratio: float) -> str:
    """Of a run with beads of that radius over the mean grain radius."""
    return f"bead {ratio:g}"


def beads_study(size: Size, folder: Path) -> list[Task]:
    """Tests with ever thinner beads, linked and unlinked."""
    from dataclasses import replace

    tasks: list[Task] = []
    for ratio in size.bead_ratios:
        setting = replace(BEADS, bead_ratio=ratio)
        tasks += triaxial(size.fine_grains, size.fine_seeds, folder, label=bead_label(ratio), setting=setting)
    return tasks
