"""What a scene of free bodies says: grains, single bodies, planes, a floor of beads, chains, laws, and how long they move.

It is a scene file with a table `[motion]` instead of `[triaxial]`. Every key with its unit; nothing is ever evaluated.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from ..errors import InputError
from .bodies import Assembly
from .laws import CONTACT_LAWS, CompliantSignoriniCoulomb, ContactLaw, NewtonRestitution, Signorini, SignoriniCoulomb
from .materials import Laws, Material
from .planes import Plane
from .scene import Name, check_accuracy, check_finite, key_meta, read_toml
from .shapes import chain, hexagonal_floor, lattice

__all__ = ["MotionScene", "bodies_of", "is_motion", "laws_of", "planes_of", "read_motion_scene"]

_key = key_meta
Vector = tuple[float, ...]


class LooseGrains(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Grains set on a square lattice that fills a block from its lower corner, with random radii, places and velocities."""

    count: Annotated[int, _key("number of grains", "1", ge=0, le=1_000_000)]
    low: Annotated[Vector, _key("lower corner of the block", "m")]
    high: Annotated[Vector, _key("upper corner of the block", "m")]
    radius: Annotated[tuple[float, float], _key("smallest and largest radius, uniform by number", "m")] = (4e-3, 6e-3)
    density: Annotated[float, _key("mass density (in two dimensions per area, kg/m²)", "kg/m³", gt=0)] = 2600.0
    rotation: Annotated[bool, _key("whether the grains can turn", "–")] = True
    jitter: Annotated[float, _key("random speed, normally distributed per component", "m/s", ge=0)] = 0.0


class SingleBody(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One sphere, or one disk in two dimensions."""

    position: Annotated[Vector, _key("centre at the start", "m")]
    radius: Annotated[float, _key("radius", "m", gt=0)]
    mass: Annotated[float | None, _key("mass; leave out for a fixed body", "kg")] = None
    velocity: Annotated[Vector, _key("at the start; default: at rest", "m/s")] = ()
    rotation: Annotated[bool, _key("whether the body can turn", "–")] = True


class PlaneKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A plane: fixed, or driven by one of velocity, force, pressure."""

    normal: Annotated[Vector, _key("direction into the sample, of any length", "1")]
    point: Annotated[Vector, _key("a point of the plane at the start", "m")]
    friction: Annotated[float, _key("Coulomb coefficient", "1", ge=0)] = 0.0
    velocity: Annotated[Vector | None, _key("of a driven plane; what lies in the plane drags like a belt", "m/s")] = (
        None
    )
    force: Annotated[float | None, _key("along the normal, into the sample", "N")] = None
    pressure: Annotated[float | None, _key("on `area`", "Pa")] = None
    area: Annotated[float | None, _key("that `pressure` acts on", "m²")] = None
    mass: Annotated[float | None, _key("inertia of a plane with force or pressure", "kg")] = None
    mobility: Annotated[float | None, _key("of a servo instead of the mass: speed per missing force", "m/(N s)")] = None
    speed_limit: Annotated[float | None, _key("of a servo", "m/s")] = None


class FloorKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A floor of fixed touching beads on a hexagonal lattice."""

    radius: Annotated[float, _key("of a bead", "m", gt=0)]
    low: Annotated[tuple[float, float], _key("lower corner of the rectangle it covers", "m")]
    high: Annotated[tuple[float, float], _key("upper corner", "m")]
    top: Annotated[float, _key("height of the highest points", "m")] = 0.0


class ChainKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A straight chain of beads."""

    start: Annotated[Vector, _key("centre of the first bead", "m")]
    direction: Annotated[Vector, _key("of the chain, of any length", "1")]
    beads: Annotated[int, _key("number of beads", "1", ge=2, le=1_000_000)]
    spacing: Annotated[float, _key("distance of neighbours, the reference length", "m", gt=0)]
    bead_radius: Annotated[float, _key("of a bead", "m", gt=0)]
    bead_mass: Annotated[float, _key("of a bead", "kg", gt=0)]
    hung: Annotated[Literal["none", "first", "both"], _key("which end beads are fixed", "–")] = "none"


class ContactKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The contact law and its parameters."""

    law: Annotated[
        Literal["signorini", "signorini_coulomb", "compliant_signorini_coulomb", "newton_restitution"],
        _key("signorini, signorini_coulomb, compliant_signorini_coulomb or newton_restitution", "–"),
    ] = "signorini_coulomb"
    friction: Annotated[float, _key("Coulomb coefficient", "1", ge=0)] = 0.5
    bead_friction: Annotated[float | None, _key("where a bead takes part; default: the same", "1")] = None
    recovery: Annotated[
        float, _key("part of an overlap of rigid bodies that is pushed out a step", "1", ge=0, le=1)
    ] = 0.0
    restitution: Annotated[float, _key("e of newton_restitution", "1", ge=0, le=1)] = 0.0
    normal_stiffness: Annotated[float | None, _key("of the compliant law", "N/m")] = None
    stiffness_ratio: Annotated[float, _key("tangential over normal stiffness", "1", gt=0)] = 0.8


class WireKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The law of the links."""

    law: Annotated[Name, _key("rigid_rod, elastic_rod, rigid_wire or elastic_wire", "–")] = "elastic_wire"
    stiffness: Annotated[float, _key("force per unit strain of a link (EA)", "N", gt=0)] = 100.0
    prestrain: Annotated[float, _key("π in the natural length (1+π) l₀; negative pre-tensions", "1", gt=-1)] = 0.0
    length_correction: Annotated[bool, _key("whether rigid links correct their length", "–")] = True


class MotionKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the bodies move."""

    duration: Annotated[float, _key("time simulated", "s", gt=0)]
    step: Annotated[float, _key("time step, the longest one where it adapts", "s", gt=0)]
    gravity: Annotated[Vector, _key("acceleration; default: none", "m/s²")] = ()
    theta: Annotated[float, _key("of the scheme", "1", ge=0.5, le=1)] = 0.5
    least_step: Annotated[float | None, _key("let the step adapt down to this", "s")] = None
    frames: Annotated[int, _key("states stored, evenly in time", "1", ge=1, le=100_000)] = 100
    threads: Annotated[
        int, _key("parts swept at the same time; the same bits for the same number", "1", ge=1, le=64)
    ] = 1
    skin: Annotated[float | None, _key("largest gap of a listed pair; default 0.15 mean radii", "m")] = None


class MotionSolve(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The solver of the one-step problems."""

    tolerance: Annotated[float, _key("relative impulse change that stops the sweeps", "1", gt=0, lt=1)] = 1e-5
    sweep_limit: Annotated[int, _key("most sweeps a step", "1", ge=1)] = 20_000
    keep_unconverged: Annotated[bool, _key("go on from a step that reached the limit; its residual is told", "–")] = (
        False
    )


class MotionScene(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Free bodies and how long they move: `fenchel dem SCENE.toml -o RUN.h5`."""

    motion: Annotated[MotionKeys, _key("how long, in which steps, under which gravity", "–")]
    seed: Annotated[int, _key("of the random grains", "1", ge=0, le=2**63 - 1)] = 1
    dimension: Annotated[Literal[2, 3], _key("3: spheres; 2: disks, nothing has a third component", "1")] = 3
    grains: Annotated[LooseGrains | None, _key("many grains", "–")] = None
    body: Annotated[tuple[SingleBody, ...], _key("single bodies, one table each: [[body]]", "–")] = ()
    plane: Annotated[tuple[PlaneKeys, ...], _key("planes, one table each: [[plane]]", "–")] = ()
    floor: Annotated[FloorKeys | None, _key("a floor of fixed beads", "–")] = None
    chain: Annotated[tuple[ChainKeys, ...], _key("chains of beads, one table each: [[chain]]", "–")] = ()
    contact: Annotated[ContactKeys, _key("the contact law", "–")] = ContactKeys()
    wire: Annotated[WireKeys, _key("the law of the links of chains", "–")] = WireKeys()
    solve: Annotated[MotionSolve, _key("the solver", "–")] = MotionSolve()
    accuracy: Annotated[
        Annotated[float, msgspec.Meta(gt=0, lt=1)] | None,
        _key("relative error wanted of the centre of mass: chooses step and tolerance from a measured front", "1"),
    ] = None


def is_motion(path: Path | str) -> bool:
    """Whether a scene file has a table `[motion]`; False where it cannot be read, which its reader then says."""
    try:
        return "motion" in msgspec.toml.decode(Path(path).read_bytes())
    except (OSError, ValueError, msgspec.DecodeError):
        return False


def read_motion_scene(path: Path | str) -> MotionScene:
    """Read and check a scene of free bodies; `InputError` names file, key, rule and remedy in one line."""
    return check_motion_scene(read_toml(path, MotionScene), str(path))


def check_motion_scene(scene: MotionScene, name: str = "scene") -> MotionScene:
    """Rules that reach across keys; raises `InputError`, returns the scene."""
    d = scene.dimension
    check_finite(scene, name)
    check_accuracy(scene, name)
    vectors = {"motion.gravity": scene.motion.gravity or (0.0,) * d}
    if scene.grains is not None:
        vectors |= {"grains.low": scene.grains.low, "grains.high": scene.grains.high}
    for k, body in enumerate(scene.body):
        vectors |= {f"body[{k}].position": body.position, f"body[{k}].velocity": body.velocity or (0.0,) * d}
        if body.mass is not None and not body.mass > 0.0:
            raise InputError(
                f"{name}: body[{k}].mass = {body.mass:g}: must be positive, in kg; leave it out for a fixed body"
            )
    for k, plane in enumerate(scene.plane):
        vectors |= {f"plane[{k}].normal": plane.normal, f"plane[{k}].point": plane.point}
    for k, links in enumerate(scene.chain):
        vectors |= {f"chain[{k}].start": links.start, f"chain[{k}].direction": links.direction}
    for key, vector in vectors.items():
        if len(vector) != d:
            raise InputError(f"{name}: {key} has {len(vector)} components: a scene with dimension = {d} needs {d}")
    if scene.floor is not None and d == 2:
        raise InputError(
            f"{name}: floor: a lattice of beads needs dimension = 3; in the plane take fixed bodies or a plane"
        )
    if scene.grains is not None and not 0.0 < scene.grains.radius[0] <= scene.grains.radius[1]:
        low, high = scene.grains.radius
        raise InputError(f"{name}: grains.radius = [{low:g}, {high:g}]: needs 0 < smallest ≤ largest, in metres")
    if scene.motion.step > scene.motion.duration:
        raise InputError(
            f"{name}: motion.step = {scene.motion.step:g} s is longer than motion.duration = {scene.motion.duration:g} s"
        )
    least = scene.motion.least_step
    if least is not None and not 0.0 < least <= scene.motion.step:
        raise InputError(f"{name}: motion.least_step = {least:g} s: needs 0 < least_step ≤ motion.step")
    if scene.motion.skin is not None and not scene.motion.skin > 0.0:
        raise InputError(f"{name}: motion.skin = {scene.motion.skin:g}: must be positive, in metres")
    law, stiffness = scene.contact.law, scene.contact.normal_stiffness
    if (law == "compliant_signorini_coulomb") != (stiffness is not None):
        raise InputError(
            f"{name}: contact.normal_stiffness belongs to law = 'compliant_signorini_coulomb', which needs it, in N/m"
        )
    if stiffness is not None and not stiffness > 0.0:
        raise InputError(f"{name}: contact.normal_stiffness = {stiffness:g}: must be positive, in N/m")
    if scene.contact.bead_friction is not None and scene.contact.bead_friction < 0.0:
        raise InputError(f"{name}: contact.bead_friction = {scene.contact.bead_friction:g}: must be ≥ 0")
    for k in range(len(scene.plane)):
        try:
            planes_of(scene, only=k)
        except InputError as error:
            raise InputError(f"{name}: plane[{k}]{str(error).removeprefix('plane')}") from None
    return scene


def planes_of(scene: MotionScene, only: int | None = None) -> list[Plane]:
    """The planes of a scene."""
    chosen = scene.plane if only is None else (scene.plane[only],)
    planes = []
    for keys in chosen:
        given: dict[str, Any] = msgspec.structs.asdict(keys)
        if given["speed_limit"] is None:
            del given["speed_limit"]
        planes.append(Plane(**given))
    return planes


def laws_of(scene: MotionScene) -> Laws:
    """The laws of a scene."""
    c, w = scene.contact, scene.wire
    beads = bool(scene.chain)
    bead_friction = c.bead_friction if beads else None
    contact: ContactLaw
    if c.law == CompliantSignoriniCoulomb.label:
        k_n = float(c.normal_stiffness or math.inf)
        contact = CompliantSignoriniCoulomb(
            friction=c.friction, k_n=k_n, k_t=k_n * c.stiffness_ratio, bead_friction=bead_friction
        )
    elif c.law == NewtonRestitution.label:
        contact = NewtonRestitution(restitution=c.restitution, friction=c.friction)
    elif c.law == SignoriniCoulomb.label:
        contact = SignoriniCoulomb(friction=c.friction, recovery=c.recovery, bead_friction=bead_friction)
    else:
        assert CONTACT_LAWS[c.law] is Signorini
        contact = Signorini(recovery=c.recovery)
    if not beads:
        return Laws(contact=contact)
    links = Material(
        wire_law=w.law, wire_stiffness=w.stiffness, prestrain=w.prestrain, length_correction=w.length_correction
    )
    return Laws(contact=contact, wire=links.laws().wire)


def bodies_of(scene: MotionScene) -> Assembly:
    """The bodies of a scene: grains, single bodies, floor, chains, in this order. Raises `InputError` when grains do not fit."""
    d = scene.dimension
    rng = np.random.default_rng(scene.seed)
    x, radius, mass, velocity, locked = (
        [np.zeros((0, d))],
        [np.zeros(0)],
        [np.zeros(0)],
        [np.zeros((0, d))],
        [np.zeros(0, dtype=bool)],
    )

    def add(places: np.ndarray, r: np.ndarray, m: np.ndarray, v: np.ndarray | None = None, turns: bool = True) -> None:
        x.append(places)
        radius.append(r)
        mass.append(m)
        velocity.append(np.zeros_like(places) if v is None else v)
        locked.append(np.full(len(places), not turns))

    if (g := scene.grains) is not None:
        r = rng.uniform(g.radius[0], g.radius[1], g.count)
        places = lattice(g.count, np.array(g.low), np.array(g.high), 2.0 * g.radius[1] * (1.0 + 1e-6))
        places = places + (g.radius[1] - r)[:, None] * rng.uniform(-1.0, 1.0, places.shape)
        solid = 4.0 / 3.0 * np.pi * r**3 if d == 3 else np.pi * r**2
        add(places, r, g.density * solid, g.jitter * rng.normal(size=places.shape), g.rotation)
    for body in scene.body:
        m = np.inf if body.mass is None else body.mass
        v = np.array([body.velocity]) if body.velocity else None
        add(np.array([body.position]), np.array([body.radius]), np.array([m]), v, body.rotation)
    if (f := scene.floor) is not None:
        places = hexagonal_floor(f.radius, f.low, f.high, top=f.top)
        add(places, np.full(len(places), f.radius), np.full(len(places), np.inf))
    loose = sum(map(len, x))
    wire, rank = [np.full(loose, -1, dtype=np.int64)], [np.zeros(loose, dtype=np.int64)]
    for k, links in enumerate(scene.chain):
        places, number, place = chain(
            np.array(links.start), np.array(links.direction), links.beads, links.spacing, wire=k
        )
        m = np.full(links.beads, links.bead_mass)
        m[{"none": [], "first": [0], "both": [0, -1]}[links.hung]] = np.inf
        add(places, np.full(links.beads, links.bead_radius), m)
        wire.append(number)
        rank.append(place)
    a = Assembly.of_spheres(
        np.concatenate(x),
        np.concatenate(radius),
        np.concatenate(mass),
        wire=np.concatenate(wire),
        rank=np.concatenate(rank),
        locked=np.concatenate(locked) | np.isinf(np.concatenate(mass)),
    )
    a.velocity[:] = np.concatenate(velocity)
    return a
