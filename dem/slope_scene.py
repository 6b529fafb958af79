"""A slope deposit from a scene file: one with a table `[slope]` instead of `[triaxial]`. Every key with its unit; nothing is evaluated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from ..errors import InputError
from .bodies import Assembly
from .materials import Material
from .measures import Repose
from .run import Progress, Stage, run_stages
from .samples import LogNormal, Sieve, Sizes, UniformByNumber, UniformByVolume, random_sample
from .scene import Name, check_accuracy, check_finite, key_meta, read_toml
from .slope import SlopeDeposit, slope_start

__all__ = [
    "QUALITY",
    "SlopeScene",
    "deposit_of",
    "is_slope",
    "quality_of",
    "read_slope_scene",
    "repose_of",
    "run_slope",
    "start_of",
]

_key = key_meta

QUALITY = {  # unit and meaning of what a finished deposit says about itself
    "angle": ("°", "angle of repose, mean over azimuths"),
    "angle_low": ("°", "lower end of its 95 % interval over azimuths"),
    "angle_high": ("°", "upper end"),
    "height": ("m", "of the heap above the tops of the floor"),
    "reach": ("m", "distance at which the mean profile falls to 5 % of the height"),
    "lost": ("1", "share of the bodies that rolled off the floor"),
    "kinetic": ("1", "kinetic energy over the potential energy set free"),
    "natural_map_max": ("1", "largest residual ‖p − P_K(p − ρû)‖/‖p‖ of a step, recomputed"),
    "overlap_max_over_radius": ("1", "largest overlap at the end over the mean radius"),
    "steps": ("1", "time steps"),
    "step_cuts": ("1", "halvings of the step"),
    "sweeps_mean": ("1", "sweeps a step"),
    "contact_iterations": ("1", "rows times sweeps"),
}


class SlopeGrains(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The grains of the block."""

    count: Annotated[int, _key("number of grains", "1", ge=10, le=1_000_000)] = 1000
    sizes: Annotated[
        Literal["number", "volume", "lognormal", "sieve"],
        _key("number: radii uniform by number; volume: by volume; lognormal; sieve", "–"),
    ] = "number"
    radius: Annotated[tuple[float, float], _key("smallest and largest radius (number, volume)", "m")] = (
        0.28e-3,
        0.52e-3,
    )
    median: Annotated[float | None, _key("median radius by number (lognormal)", "m")] = None
    spread: Annotated[float | None, _key("standard deviation of ln r (lognormal)", "1")] = None
    opening: Annotated[tuple[float, ...], _key("diameters of the sieve curve, ascending (sieve)", "m")] = ()
    passing: Annotated[tuple[float, ...], _key("shares of the mass that pass, from 0 to 1 (sieve)", "1")] = ()
    density: Annotated[float, _key("mass density of grains and beads", "kg/m³", gt=0)] = 2600.0
    friction: Annotated[float, _key("Coulomb coefficient", "1", ge=0)] = 0.5


class SlopeWires(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The wires of the block, free of tension when it is released."""

    density: Annotated[float, _key("wire length per volume of the block", "m⁻²", gt=0)]
    beads: Annotated[int, _key("beads of a wire", "1", ge=2)] = 40
    spacing: Annotated[float | None, _key("of the beads; default: the mean grain radius", "m")] = None
    bead_radius: Annotated[float | None, _key("default: 0.4 mean grain radii", "m")] = None
    laying: Annotated[Literal["walks", "layers"], _key("walks in all directions, or horizontal layers", "–")] = "layers"
    layers: Annotated[int, _key("number of layers", "1", ge=1)] = 8
    law: Annotated[Name, _key("rigid_rod, elastic_rod, rigid_wire or elastic_wire", "–")] = "elastic_wire"
    stiffness: Annotated[float, _key("force per unit strain of a link (EA)", "N", gt=0)] = 100.0
    friction: Annotated[float | None, _key("Coulomb coefficient of beads; default: that of the grains", "1")] = None


class SlopeKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The deposit."""

    solid_fraction: Annotated[float, _key("of the block", "1", ge=0.1, le=0.62)] = 0.57
    gravity: Annotated[float, _key("acceleration", "m/s²", gt=0)] = 9.81
    reach: Annotated[float, _key("how far the floor goes beyond the block, in heights of it", "1", gt=0, le=10)] = 2.0
    stiffness_factor: Annotated[float, _key("k_n over ρ g H d of the block", "1", gt=0)] = 2000.0
    rest: Annotated[float, _key("kinetic over potential energy set free at which the heap rests", "1", gt=0, lt=1)] = (
        1e-6
    )
    step_limit: Annotated[int, _key("most time steps; reached in motion the run stops with an error", "1", ge=1)] = (
        20_000
    )
    azimuths: Annotated[int, _key("in which the slope is fitted", "1", ge=2, le=36)] = 6


class SlopeSolve(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The solver of the one-step problems."""

    tolerance: Annotated[
        float,
        _key(
            "relative impulse change that stops the sweeps; ten and a hundred times tighter near rest", "1", gt=0, lt=1
        ),
    ] = 1e-3
    sweep_limit: Annotated[int, _key("most sweeps; a step that needs more is halved", "1", ge=1)] = 3000


class SlopeScene(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A densified block released on a floor of fixed beads: `fenchel dem SCENE.toml -o RUN.h5`."""

    slope: Annotated[SlopeKeys, _key("the deposit", "–")]
    seed: Annotated[int, _key("of the random block", "1", ge=0, le=2**63 - 1)] = 1
    grains: Annotated[SlopeGrains, _key("the grains", "–")] = SlopeGrains()
    wires: Annotated[SlopeWires | None, _key("the wires; leave out for sand alone", "–")] = None
    solve: Annotated[SlopeSolve, _key("the solver", "–")] = SlopeSolve()
    accuracy: Annotated[
        Annotated[float, msgspec.Meta(gt=0, lt=1)] | None,
        _key("relative error wanted of the angle: chooses the tolerance from a measured front", "1"),
    ] = None


def is_slope(path: Path | str) -> bool:
    """Whether a scene file has a table `[slope]`; False where it cannot be read, which its reader then says."""
    try:
        return "slope" in msgspec.toml.decode(Path(path).read_bytes())
    except (OSError, ValueError, msgspec.DecodeError):
        return False


def read_slope_scene(path: Path | str) -> SlopeScene:
    """Read and check the scene of a deposit; `InputError` names file, key, rule and remedy in one line."""
    return check_slope_scene(read_toml(path, SlopeScene), str(path))


def check_slope_scene(scene: SlopeScene, name: str = "scene") -> SlopeScene:
    """Rules that reach across keys; raises `InputError`, returns the scene."""
    check_finite(scene, name)
    check_accuracy(scene, name)
    grains, wires = scene.grains, scene.wires
    wanted = {
        "number": ("radius",),
        "volume": ("radius",),
        "lognormal": ("median", "spread"),
        "sieve": ("opening", "passing"),
    }
    for key in wanted[grains.sizes]:
        if getattr(grains, key) in (None, ()):
            raise InputError(f"{name}: grains.{key}: is needed for sizes = {grains.sizes!r}")
    try:
        sizes_of(grains)
    except InputError as error:
        raise InputError(
            f"{name}: grains.{'.'.join(wanted[grains.sizes])}: {str(error).removeprefix('sizes: ')}"
        ) from None
    if wires is not None:
        for key in ("spacing", "bead_radius"):
            value = getattr(wires, key)
            if value is not None and not value > 0.0:
                raise InputError(f"{name}: wires.{key} = {value:g}: must be positive, in metres")
        if wires.friction is not None and wires.friction < 0.0:
            raise InputError(f"{name}: wires.friction = {wires.friction:g}: must be ≥ 0")
    return scene


def sizes_of(grains: SlopeGrains) -> Sizes:
    """The size distribution that the keys mean."""
    if grains.sizes == "sieve":
        return Sieve(opening=grains.opening, passing=grains.passing)
    if grains.sizes == "lognormal":
        return LogNormal(median=float(grains.median or 0.0), spread=float(grains.spread or 0.0))
    kind = UniformByNumber if grains.sizes == "number" else UniformByVolume
    return kind(small=grains.radius[0], large=grains.radius[1])


def start_of(scene: SlopeScene) -> Assembly:
    """The block above its floor."""
    g, w = scene.grains, scene.wires
    chains: dict[str, Any] = {}
    if w is not None:
        chains = {
            "wire_density": w.density, "beads": w.beads, "spacing": w.spacing, "bead_radius": w.bead_radius, "laying": w.laying,
            "layers": w.layers,
        }  # fmt: skip
    block = random_sample(
        np.random.default_rng(scene.seed),
        sizes_of(g),
        g.count,
        solid_fraction=scene.slope.solid_fraction,
        density=g.density,
        **chains,
    )
    return slope_start(block, density=g.density, reach=scene.slope.reach)


def deposit_of(scene: SlopeScene, assembly: Assembly) -> SlopeDeposit:
    """The deposit of a block."""
    g, w, s = scene.grains, scene.wires, scene.slope
    law = Material(friction=g.friction, bead_friction=g.friction, links=False)
    if w is not None:
        law = Material(
            friction=g.friction,
            bead_friction=g.friction if w.friction is None else w.friction,
            wire_law=w.law,
            wire_stiffness=w.stiffness,
        )
    return SlopeDeposit(
        assembly, law, density=g.density, gravity=s.gravity, stiffness_factor=s.stiffness_factor, rest=s.rest,
        step_limit=s.step_limit, tolerance=scene.solve.tolerance, sweep_limit=scene.solve.sweep_limit,
    )  # fmt: skip


def run_slope(
    scene_file: Path | str | SlopeScene,
    run_file: Path | str,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    every: float = 30.0,
) -> dict[str, Any]:
    """Let the block come to rest and leave everything in `run_file`; returns the content of the file.

    `quality` holds what `QUALITY` names (nan for the slope of a heap with too few bodies on its surface), `profile` the mean free surface
    (distance and height [m]) and the angles of the azimuths [°]. Raises `InputError` for a bad scene or run file, `ConvergenceError` for a
    heap that does not come to rest, `StorageError` when the file cannot be written.
    """
    scene = check_slope_scene(scene_file) if isinstance(scene_file, SlopeScene) else read_slope_scene(scene_file)
    from .accuracy import resolved

    chosen, choice = resolved(scene, run_file)
    assert isinstance(chosen, SlopeScene)
    settings = {"scene": msgspec.to_builtins(scene), **choice}
    if Path(run_file).exists() and not resume:
        raise InputError(f"{run_file}: exists already; say --resume to go on with it, or choose another name")

    def finish(assembly: Assembly, stage: Stage) -> dict[str, Any]:
        assert isinstance(stage, SlopeDeposit)
        found = repose_of(stage, scene)
        return {
            "quality": quality_of(stage, found),
            "profile": {"distance": found.distance, "height": found.profile, "angles": found.angles},
            "kernels": stage.simulation.kernels.report(),
            "assembly": assembly.arrays(),
        }

    return run_stages(
        [lambda assembly: deposit_of(chosen, assembly)],
        lambda: start_of(scene),
        run_file,
        settings,
        finish,
        progress=progress,
        every=every,
    )


def repose_of(stage: SlopeDeposit, scene: SlopeScene) -> Repose:
    """The slope of a heap; nan of one with too few bodies on its surface: the deposit is there all the same, only its angle is not."""
    try:
        return stage.repose(azimuths=scene.slope.azimuths)
    except InputError:
        none = np.zeros(0)
        return Repose(
            angle=np.nan,
            low=np.nan,
            high=np.nan,
            angles=none,
            height=np.nan,
            reach=np.nan,
            distance=none,
            profile=none,
        )


def quality_of(stage: SlopeDeposit, found: Repose) -> dict[str, float]:
    """What `QUALITY` names."""
    moving = int(np.isfinite(stage.assembly.mass).sum())
    return {
        "angle": found.angle,
        "angle_low": found.low,
        "angle_high": found.high,
        "height": found.height,
        "reach": found.reach,
        "lost": 1.0 - float(stage.deposited.sum()) / moving,
        "kinetic": stage.ratio,
        "natural_map_max": stage.worst,
        "overlap_max_over_radius": stage.overlap / stage.assembly.grain_radius,
        "steps": float(stage.steps),
        "step_cuts": float(stage.pace.cuts),
        "sweeps_mean": stage.simulation.total_sweeps / max(stage.steps, 1),
        "contact_iterations": float(stage.simulation.total_rows),
    }
