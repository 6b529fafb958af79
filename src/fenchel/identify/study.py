"""What a study file says: the scene of every sample, the pressures, the seeds, and how to identify. Every key with its unit."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from ..dem.scene import (
    Grains,
    Sample,
    SceneSolve,
    TestPath,
    Wires,
    check_bodies,
    check_finite,
    check_path,
    check_pressure,
    check_soft,
    check_sphere,
    parse_toml,
    read_toml,
)
from ..errors import InputError
from .options import IdentifyOptions

__all__ = ["Identify", "Study", "StudySolve", "StudyTriaxial", "check_study", "demo_study", "read_study"]


def _key(text: str, unit: str, **bounds: Any) -> Meta:
    return Meta(description=text, extra_json_schema={"unit": unit}, **bounds)


class StudyTriaxial(TestPath, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The tests: one per pressure and seed, with links and, as the control, without."""

    pressures: Annotated[tuple[float, ...], _key("confining pressures that are fitted", "Pa")] = (5e4, 7e4, 9e4)
    held_out: Annotated[tuple[float, ...], _key("confining pressures that are predicted, not fitted", "Pa")] = (6e4,)
    strain_path: Annotated[
        tuple[float, ...], _key("logarithmic axial strains to visit, tension positive, first 0", "1")
    ] = (0.0, -0.01, 0.006, -0.01)


class StudySolve(SceneSolve, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The solver of the one-step problems, and the seeds."""

    seeds: Annotated[tuple[int, ...], _key("one sample each", "1")] = (1, 2)
    stiffness_probe: Annotated[
        bool, _key("measure E_s against tolerance and step, for the grains as they are and for rigid ones", "–")
    ] = True


class Identify(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the law is identified from the fields."""

    split: Annotated[
        Literal["links", "total"], _key("stress of the bead contacts: to the sand, or to the wires", "–")
    ] = "links"
    strain: Annotated[
        Literal["shared", "own"], _key("shared: the strain of the sand for both phases; own: each phase its own", "–")
    ] = "shared"
    window_sand: Annotated[float, _key("axial strain up to which the sand is taken as elastic", "1", gt=0)] = 2e-4
    window_wire: Annotated[float, _key("the same for the wires", "1", gt=0)] = 5e-3
    yield_offset: Annotated[float, _key("plastic axial strain at which the yield stress is read", "1", gt=0)] = 2e-4


class Study(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A whole identification: `fenchel identify STUDY.toml -o DIR`."""

    grains: Annotated[Grains, _key("the grains", "–")] = Grains()
    wires: Annotated[Wires | None, _key("the wires; leave out for sand alone", "–")] = None
    sample: Annotated[Sample, _key("the preparation", "–")] = Sample()
    triaxial: Annotated[StudyTriaxial, _key("the tests", "–")] = StudyTriaxial()
    solve: Annotated[StudySolve, _key("the solver and the seeds", "–")] = StudySolve()
    identify: Annotated[Identify, _key("the identification", "–")] = Identify()

    @property
    def pressures(self) -> tuple[float, ...]:
        """All confining pressures, fitted and held out, rising [Pa]."""
        return tuple(sorted(self.triaxial.pressures + self.triaxial.held_out))

    def options(self) -> IdentifyOptions:
        """The options of the identification."""
        return IdentifyOptions(held_out=self.triaxial.held_out, **msgspec.structs.asdict(self.identify))


def check_study(study: Study, name: str = "study") -> Study:
    """Rules that reach across keys; raises `InputError`, returns the study."""
    check_finite(study, name)
    check_bodies(study.grains, study.wires, study.sample, name)
    check_path(study.triaxial.strain_path, name)
    check_sphere(study.grains.count, study.triaxial.sphere, study.triaxial.strain_path, name)
    if study.triaxial.strain_path[1] > 0.0:
        raise InputError(
            f"{name}: triaxial.strain_path: the first leg must shorten the sample (a negative strain); "
            "yield is read there, e.g. [0.0, -0.01, 0.006, -0.01]"
        )
    if -study.triaxial.strain_path[1] <= study.identify.window_sand:
        raise InputError(
            f"{name}: triaxial.strain_path: the first leg ends inside identify.window_sand = {study.identify.window_sand:g}: "
            "shorten further, so that there is plastic flow to read"
        )
    if 0.25 * study.triaxial.frame_strain > study.identify.window_sand:
        raise InputError(
            f"{name}: triaxial.frame_strain = {study.triaxial.frame_strain:g}: leaves no frame in identify.window_sand = "
            f"{study.identify.window_sand:g}; the first frames are a quarter of it apart"
        )
    for key in ("pressures", "held_out"):
        for pressure in getattr(study.triaxial, key):
            check_pressure(study.grains, pressure, f"triaxial.{key}", name)
            check_soft(study.grains, pressure, f"triaxial.{key}", name)
    if len({f"{pressure:.5g}" for pressure in study.pressures}) < len(study.pressures):  # as run files are named
        raise InputError(
            f"{name}: triaxial.pressures and triaxial.held_out repeat a pressure (to five digits); name each once"
        )
    if len(study.triaxial.pressures) < 2:
        raise InputError(
            f"{name}: triaxial.pressures = {list(study.triaxial.pressures)}: cohesion and friction need two or more to fit, "
            "e.g. [5e4, 7e4, 9e4]"
        )
    seeds = study.solve.seeds
    if not seeds or len(set(seeds)) < len(seeds) or min(seeds) < 0 or max(seeds) >= 2**63:
        raise InputError(f"{name}: solve.seeds = {list(seeds)}: needs at least one, all different, from 0 to 2^63 - 1")
    return study


def read_study(path: Path | str) -> Study:
    """Read and check a study file."""
    return check_study(read_toml(path, Study), str(path))


def demo_study() -> tuple[Study, bytes]:
    """The study that fenchel carries (`fenchel identify --demo`), and its text."""
    text = resources.files("fenchel.identify").joinpath("demo.toml").read_bytes()
    return check_study(parse_toml(text, Study, "demo.toml"), "demo.toml"), text
