"""What a scene file says: grains, wires, sample, triaxial test, solver. Every key with its unit; nothing is ever evaluated.

The structs are frozen and refuse unknown keys; `read_toml` turns every complaint into one line with the path of the key.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta

from ..errors import InputError

__all__ = [
    "Grains",
    "Sample",
    "Scene",
    "SceneSolve",
    "SceneTriaxial",
    "TestPath",
    "Wires",
    "check_scene",
    "read_scene",
    "read_toml",
]

Name = Literal["rigid_rod", "elastic_rod", "rigid_wire", "elastic_wire"]


def key_meta(text: str, unit: str, **bounds: Any) -> Meta:
    """What a key means, its unit and its bounds."""
    return Meta(description=text, extra_json_schema={"unit": unit}, **bounds)


_key = key_meta


class Grains(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The grains: spheres, uniform by number between two radii."""

    count: Annotated[int, _key("number of grains", "1", ge=1, le=1_000_000)] = 1000
    radius: Annotated[tuple[float, float], _key("smallest and largest radius", "m")] = (0.75e-3, 1.39e-3)
    density: Annotated[float, _key("mass density of a grain", "kg/m³", gt=0)] = 2600.0
    friction: Annotated[float, _key("Coulomb coefficient between grains", "1", ge=0)] = 0.4
    normal_stiffness: Annotated[float | None, _key("normal contact stiffness; leave out for rigid grains", "N/m")] = (
        None
    )
    stiffness_ratio: Annotated[float, _key("tangential over normal stiffness", "1", gt=0)] = 0.8


class Wires(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The wires: chains of beads, each bead with the mass of a mean grain."""

    law: Annotated[Name, _key("link law: rigid_rod, elastic_rod, rigid_wire or elastic_wire", "–")] = "elastic_wire"
    count: Annotated[int, _key("number of wires", "1", ge=0)] = 75
    beads: Annotated[int, _key("beads of a wire", "1", ge=2)] = 20
    spacing: Annotated[float, _key("distance of neighbouring beads when laid", "m", gt=0)] = 1.07e-3
    bead_radius: Annotated[float, _key("radius of a bead", "m", gt=0)] = 0.43e-3
    stiffness: Annotated[float, _key("force per unit strain of a link (EA)", "N", gt=0)] = 100.0
    prestrain: Annotated[float, _key("π in the natural length (1+π) l₀; negative pre-tensions", "1", gt=-1)] = 0.0
    friction: Annotated[float | None, _key("Coulomb coefficient of beads; default: that of the grains", "1")] = None
    state: Annotated[
        Literal["stress_free", "prestressed"],
        _key(
            "stress_free: reference lengths reset at each pressure; prestressed: links act from the preparation on", "–"
        ),
    ] = "stress_free"
    control: Annotated[bool, _key("repeat every test with the same beads unlinked", "–")] = True


class Sample(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the sample is made before the test."""

    solid_fraction: Annotated[float, _key("of grains and beads, before compression", "1", ge=0.1, le=0.62)] = 0.57
    friction: Annotated[float, _key("Coulomb coefficient during compression: 0 gives a dense sample", "1", ge=0)] = 0.0
    tolerance: Annotated[
        float, _key("relative impulse change that stops the sweeps of the preparation", "1", gt=0, lt=1)
    ] = 1e-4


class TestPath(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every triaxial test says: lateral walls keep the pressure, the axial ones follow a strain path."""

    __test__ = False  # no test of pytest

    strain_path: Annotated[
        tuple[float, ...], _key("logarithmic axial strains to visit, tension positive, first 0", "1")
    ] = (0.0, -0.01)
    inertial_number: Annotated[float, _key("I = ε̇ d √(ρ/P), sets the rate", "1", gt=0, le=0.1)] = 5e-4
    sphere: Annotated[float, _key("radius of the measuring sphere over the half width of the box", "1", gt=0, le=1)] = (
        0.8
    )
    frame_strain: Annotated[
        float, _key("axial strain between stored frames (a quarter of it at the start)", "1", gt=0)
    ] = 1e-4


class SceneTriaxial(TestPath, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The triaxial test of a scene."""

    pressure: Annotated[float, _key("confining pressure", "Pa")] = 5e4


class SceneSolve(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The solver of the one-step problems."""

    tolerance: Annotated[float, _key("relative impulse change that stops the sweeps of the test", "1", gt=0, lt=1)] = (
        1e-5
    )
    sweep_limit: Annotated[
        int, _key("most sweeps a step; reached above the tolerance the run stops with an error", "1", ge=1)
    ] = 5000
    step: Annotated[float, _key("time step over the inertial time d √(ρ/P)", "1", gt=0, le=1)] = 0.05


class Scene(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One sample and one test: `fenchel dem SCENE.toml -o RUN.h5`."""

    seed: Annotated[int, _key("of the random sample", "1", ge=0, le=2**63 - 1)] = 1
    grains: Annotated[Grains, _key("the grains", "–")] = Grains()
    wires: Annotated[Wires | None, _key("the wires; leave out for sand alone", "–")] = None
    sample: Annotated[Sample, _key("the preparation", "–")] = Sample()
    triaxial: Annotated[SceneTriaxial, _key("the test", "–")] = SceneTriaxial()
    solve: Annotated[SceneSolve, _key("the solver", "–")] = SceneSolve()
    accuracy: Annotated[
        Annotated[float, msgspec.Meta(gt=0, lt=1)] | None,
        _key(
            "relative error wanted of the deviator: chooses step and tolerance of the test from what was measured", "1"
        ),
    ] = None


Kind = TypeVar("Kind")


def read_toml(path: Path | str, kind: type[Kind]) -> Kind:
    """Read a TOML file into a struct; `InputError` names file, key, rule and remedy in one line."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}): check the name") from None
    return parse_toml(data, kind, str(path))


def parse_toml(data: bytes, kind: type[Kind], name: str) -> Kind:
    """Parse TOML text into a struct (see `read_toml`)."""
    try:
        return msgspec.toml.decode(data, type=kind)
    except msgspec.ValidationError as error:
        text = str(error)
        what, _, place = text.partition(" - at `$")
        key = place.rstrip("`").lstrip(".") or "top level"
        if "unknown field" in what:
            what += f"; allowed: {', '.join(_fields_at(kind, key))}"
        if "enum value" in what:
            what += f"; allowed: {', '.join(_values_at(kind, key))}"
        raise InputError(f"{name}: {key}: {what[:1].lower()}{what[1:]}") from None
    except (msgspec.DecodeError, UnicodeDecodeError, ValueError) as error:
        raise InputError(f"{name}: not valid TOML ({error}): see the file format page for an example") from None


def _fields_at(kind: Any, key: str) -> list[str]:
    """Names of the keys allowed at a dotted place of a struct type."""
    info = _bare(msgspec.inspect.type_info(kind))
    for part in [] if key == "top level" else key.split("."):
        if isinstance(info, msgspec.inspect.StructType):
            info = next((_inner(f.type, part) for f in info.fields if f.encode_name == part.partition("[")[0]), info)
    return [f.encode_name for f in info.fields] if isinstance(info, msgspec.inspect.StructType) else []


def _values_at(kind: Any, key: str) -> list[str]:
    """The words allowed at a dotted place of a struct type."""
    info = _bare(msgspec.inspect.type_info(kind))
    for part in key.split("."):
        info = next(_inner(f.type, part) for f in info.fields if f.encode_name == part.partition("[")[0])
    return [str(value) for value in getattr(info, "values", ())]


def _inner(info: Any, part: str) -> Any:
    """The type at a key, or that of the items where the key counts them (`plane[0]`)."""
    info = _bare(info)
    return _bare(info.item_type) if "[" in part and hasattr(info, "item_type") else info


def _bare(info: Any) -> Any:
    while isinstance(info, msgspec.inspect.Metadata):
        info = info.type
    if isinstance(info, msgspec.inspect.UnionType):
        return next((t for t in map(_bare, info.types) if isinstance(t, msgspec.inspect.StructType)), info)
    return info


def check_finite(struct: msgspec.Struct, name: str, at: str = "") -> None:
    """Refuse NaN and infinities anywhere in a struct."""
    for field in struct.__struct_fields__:
        value = getattr(struct, field)
        key = f"{at}{field}"
        for place, item in enumerate(value if isinstance(value, tuple) else (value,)):
            if isinstance(item, msgspec.Struct):
                check_finite(item, name, f"{key}[{place}]." if isinstance(value, tuple) else f"{key}.")
            elif isinstance(item, float) and not math.isfinite(item):
                raise InputError(f"{name}: {key} = {item}: must be a finite number")


def check_bodies(grains: Grains, wires: Wires | None, sample: Sample, name: str) -> None:
    """Rules between the keys of grains, wires and sample."""
    small, large = grains.radius
    if not 0.0 < small <= large:
        raise InputError(f"{name}: grains.radius = [{small:g}, {large:g}]: needs 0 < smallest ≤ largest, in metres")
    if not 1e-7 <= small <= large <= 1e2:
        raise InputError(f"{name}: grains.radius = [{small:g}, {large:g}]: must lie between 1e-7 and 1e2 m")
    if large > 100.0 * small:
        raise InputError(f"{name}: grains.radius: ratio {large / small:.3g} is above 100; narrow the distribution")
    if grains.normal_stiffness is not None and grains.normal_stiffness <= 0.0:
        raise InputError(
            f"{name}: grains.normal_stiffness = {grains.normal_stiffness:g}: must be positive, in N/m; leave it out for rigid grains"
        )
    if wires is None or wires.count == 0:
        return
    if wires.friction is not None and wires.friction < 0.0:
        raise InputError(f"{name}: wires.friction = {wires.friction:g}: must be ≥ 0")
    mean_cube = (large**2 + small**2) * (large + small) / 4.0
    bead_volume = wires.count * wires.beads * wires.bead_radius**3
    side = (4.0 / 3.0 * math.pi * (grains.count * mean_cube + bead_volume) / sample.solid_fraction) ** (1.0 / 3.0)
    length = (wires.beads - 1) * wires.spacing
    if wires.spacing > side:
        raise InputError(
            f"{name}: wires.spacing = {1e3 * wires.spacing:.3g} mm is wider than the box ({1e3 * side:.3g} mm): a link does not fit"
        )
    if length > 5.0 * side:
        raise InputError(
            f"{name}: wires: one wire of {wires.beads} beads is {1e3 * length:.3g} mm long, more than five sides of the box "
            f"({1e3 * side:.3g} mm): it does not fit; fewer beads, smaller spacing or more grains"
        )
    if bead_volume > grains.count * mean_cube:
        raise InputError(f"{name}: wires: the beads take more volume than the grains; fewer or smaller beads")


def check_path(path: tuple[float, ...], name: str) -> None:
    """Rules of a strain path."""
    if len(path) < 2 or path[0] != 0.0:
        raise InputError(
            f"{name}: triaxial.strain_path must start at 0 and visit at least one strain, e.g. [0.0, -0.01]"
        )
    if any(a == b for a, b in zip(path[1:], path[:-1], strict=True)):
        raise InputError(f"{name}: triaxial.strain_path repeats a strain; every entry must differ from the one before")
    if max(abs(e) for e in path) > 0.2:
        raise InputError(f"{name}: triaxial.strain_path goes beyond 20 %; the model is one of small strain")


def check_pressure(grains: Grains, pressure: float, key: str, name: str) -> None:
    """A cohesionless sample needs a positive confining pressure, one that moves a grain within finite time."""
    if not pressure > 0.0:
        raise InputError(
            f"{name}: {key} = {pressure:g} Pa: grains without cohesion need a positive confining pressure, e.g. 5e4"
        )
    if math.isinf(grains.density / pressure):
        raise InputError(
            f"{name}: {key} = {pressure:g} Pa: the inertial time d √(ρ/P) is beyond the largest number; raise the pressure, e.g. 5e4"
        )


def check_soft(grains: Grains, pressure: float, key: str, name: str) -> None:
    """Contacts that yield by a good part of a radius are no contacts of grains: mean overlap is about 2 r̄/κ, κ = k_n/(P d)."""
    if grains.normal_stiffness is None:
        return
    kappa = grains.normal_stiffness / (pressure * sum(grains.radius))
    if kappa < 10.0:
        raise InputError(
            f"{name}: {key} = {pressure:g} Pa: κ = k_n/(P d) = {kappa:.2g} is below 10, the grains would run into one another; "
            "lower the pressure or raise grains.normal_stiffness"
        )


def check_sphere(count: int, sphere: float, path: tuple[float, ...], name: str) -> None:
    """A strain needs grains in the measuring sphere, a stress needs all of the sphere in the box."""
    if sphere > math.exp(min(path)):
        raise InputError(
            f"{name}: triaxial.sphere = {sphere:g} sticks out of the box when it is shortened by {-min(path):.2g}: "
            f"at most {math.exp(min(path)):.3g}"
        )
    inside = count * math.pi / 6.0 * sphere**3
    if inside < 8.0:
        raise InputError(
            f"{name}: triaxial.sphere = {sphere:g} holds about {inside:.2g} of the {count} grains: needs 8; widen it or take more grains"
        )


def check_accuracy(scene: Any, name: str) -> None:
    """`accuracy` chooses what `solve` would say."""
    if scene.accuracy is None:
        return
    for key in ("tolerance", "step"):
        default = {f.name: f.default for f in msgspec.structs.fields(type(scene.solve))}.get(key)
        if default is not None and getattr(scene.solve, key) != default:
            raise InputError(f"{name}: accuracy chooses solve.{key}: leave one of them out")


def check_scene(scene: Scene, name: str = "scene") -> Scene:
    """Rules that reach across keys; raises `InputError`, returns the scene."""
    check_finite(scene, name)
    check_accuracy(scene, name)
    check_bodies(scene.grains, scene.wires, scene.sample, name)
    check_pressure(scene.grains, scene.triaxial.pressure, "triaxial.pressure", name)
    check_soft(scene.grains, scene.triaxial.pressure, "triaxial.pressure", name)
    check_path(scene.triaxial.strain_path, name)
    check_sphere(scene.grains.count, scene.triaxial.sphere, scene.triaxial.strain_path, name)
    return scene


def read_scene(path: Path | str) -> Scene:
    """Read and check a scene file."""
    return check_scene(read_toml(path, Scene), str(path))
