"""What the identification may be told, and what it is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..dem.record import PhaseHistory, TriaxialRecord
from ..errors import InputError

__all__ = ["IdentifyOptions", "Specimen"]

Test = TriaxialRecord | PhaseHistory


@dataclass(frozen=True, kw_only=True)
class Specimen:
    """One sample (one seed): its tests by confining pressure [Pa], with links and, as the control, without.

    A `TriaxialRecord` carries octant sums and so allows the jackknife; a bare `PhaseHistory` does not.
    """

    seed: int
    linked: Mapping[float, Test]
    control: Mapping[float, Test] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions:
    """Settings of the identification; every one is printed in the report.

    Strain "shared": the strain of the sand stands for both phases, as in the law, which has one strain (and as the grains
    outnumber the beads, it is the less noisy of the two). Strain "own": each phase with its own measured strain. Both are
    computed and reported; this chooses which one enters the law.
    """

    held_out: tuple[float, ...] = ()  # confining pressures [Pa] predicted, not fitted
    split: str = "links"  # stress of the bead contacts: "links" to the sand, "total" to the wires
    strain: str = "shared"  # "shared" or "own"
    window_sand: float = 2e-4  # axial strain of the box up to which the sand is taken as elastic [-]
    window_wire: float = 5e-3  # the same for the wires, whose stress is small at the start [-]
    poisson_bounds: tuple[float, float] = (0.0, 0.49)
    plastic_window: tuple[float, float] = (2e-4, 1.0)  # equivalent plastic strain p used for yield and hardening [-]
    yield_offset: float = 2e-4  # axial plastic strain at which the yield stress is read [-]
    strength_strains: tuple[float, ...] = (0.0025, 0.005, 0.009)  # axial shortening at which q is compared [-]
    condition_limit: float = 1e3  # above it H_k and H_i are not reported apart
    fit_frames: int = 300  # frames per test used by the fit of the whole path
    jackknife: bool = True  # leave each octant of the measuring sphere out in turn
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if self.split not in ("links", "total"):
            raise InputError(f'identify.split = "{self.split}": use "links" or "total"')
        if self.strain not in ("shared", "own"):
            raise InputError(f'identify.strain = "{self.strain}": use "shared" or "own"')
        for name in ("window_sand", "window_wire", "yield_offset", "condition_limit"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"identify.{name} = {getattr(self, name)}: it must be positive")
        low, high = self.poisson_bounds
        if not -1.0 < low < high < 0.5:
            raise InputError(f"identify.poisson_bounds = ({low}, {high}): need -1 < low < high < 0.5")
        if not 0.0 <= self.plastic_window[0] < self.plastic_window[1]:
            raise InputError(f"identify.plastic_window = {self.plastic_window}: need 0 <= low < high")
        if self.fit_frames < 20:
            raise InputError(f"identify.fit_frames = {self.fit_frames}: need 20 or more")
        if not 0.5 <= self.confidence < 1.0:
            raise InputError(f"identify.confidence = {self.confidence}: need 0.5 <= confidence < 1")
