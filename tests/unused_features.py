"""What a feature costs that is not used: the code of scenes and laws without it, held against builds that never had it.

A build that never had a feature is made in a fresh process: before anything is written, what writes the feature is cut out of the
emitters (the lines of kernel texts that only it needs, the branches of the functions that write steps, its laws) or replaced by
something that raises. The code of scenes and laws without the feature, written there, must have the hash of the code that the whole
build writes; what has the feature must be refused there; the whole build, asked for the same, writes it.

Names that stay in the code of what lacks the feature are listed by `rows`: `stay` and `remark` of a feature say which and why.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import io
import itertools
import json
import os
import re
import subprocess
import sys
import tokenize
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from sympy import Rational, log, sqrt, tan

from fenchel.dem import Assembly, Drive, Laws, Simulation, Solver
from fenchel.dem.kernels import SceneKernels, detection, scene_kernels
from fenchel.dem.laws import (
    CompliantSignoriniCoulomb,
    ElasticRod,
    ElasticWire,
    RigidRod,
    RigidWire,
    Signorini,
    SignoriniCoulomb,
)
from fenchel.integrators import build_update, closed, coefficients, dimension, rest_text, thermal, writer
from fenchel.integrators.kernels import closed_text, reduced_text, store, terms_text
from fenchel.integrators.module_store import module_source
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_min,
    forces,
    indicator,
    inner,
    isotropic,
    norm,
    parameter,
    pos,
    scalar,
    sym_tensor,
    temperature,
    tr,
)

__all__ = ["FEATURES", "Feature", "Row", "found_in", "rows"]


class Refused(Exception):
    """The build does not have that."""


# -- scenes ------------------------------------------------------------------------------------------------------------------

FRICTION = SignoriniCoulomb(friction=0.5)
TWO = SignoriniCoulomb(friction=0.5, bead_friction=0.2)
COMPLIANT = CompliantSignoriniCoulomb(friction=0.5, k_n=1e4, k_t=8e3)
SMOOTH = Signorini()


def scene(contact: Any, dimension: int = 3, spin: Any = "all", planes: Any = "none", wire: Any = None) -> SceneKernels:
    return SceneKernels(dimension=dimension, spin=spin, contact=contact, planes=planes, wire=wire)


def scene_code(kernels: SceneKernels) -> str:
    """The text of all modules of a scene, none of them compiled."""
    parts = (kernels.bodies, kernels.pairs, kernels.walls, kernels.links)
    found = [
        detection(kernels.dimension, kernels.wire is not None),
        *(p for p in parts if p is not None),
        kernels.step[0],
    ]
    return "\n".join(kernel.text for kernel in found)


def scene_bytes(kernels: SceneKernels) -> dict[str, int]:
    """Bytes of a row of each kind, and of a row of velocities."""
    return kernels.bytes_per_contact() | {"bodies": 8 * kernels.body_columns.total}


def scene_counted(kernels: SceneKernels) -> dict[str, int]:
    """The same for contacts between two bodies, and for bodies, from the arrays of a step of two bodies that touch."""
    x = np.zeros((2, kernels.dimension))
    x[1, 0] = 1.9e-2
    a = Assembly.of_spheres(x, np.full(2, 1e-2), np.ones(2), locked=np.full(2, kernels.spin == "none"))
    simulation = Simulation(a, Laws(contact=kernels.contact), Solver(keep_unconverged=True))
    problem = simulation.problem(1e-3, Drive())
    rows = problem["contacts"]
    held = (rows.pair, rows.row, rows.cold, rows.candidate, a.pairs, a.pair_impulse)
    return {"pairs": sum(array.nbytes for array in held), "bodies": problem["before"].nbytes // 2}


# -- laws: declared anew each time, for in a build without a feature it cannot even be declared -----------------------------------


def _law(
    name: str,
    *,
    kinematic: bool = False,
    heat: bool = False,
    wires: bool = False,
    pressure: bool = False,
    principal: bool = False,
    elastic: bool = False,
    viscous: bool = False,
) -> Law:
    """Von Mises with isotropic hardening, and what is asked for besides; `principal`: Tresca, `viscous`: its step iterates."""
    eps, eps_p, alpha, p = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("alpha"), scalar("p")
    E, nu = parameter("E", lower=0, unit="Pa"), parameter("nu", lower=-1, upper=0.5, unit="1")
    sigma_y, H_i = parameter("sigma_y", lower=0, unit="Pa"), parameter("H_i", lower=0, unit="Pa")
    elasticity = isotropic(E, nu)
    psi = elasticity.energy(eps if elastic else eps - eps_p)
    if wires:
        lambda_w, mu_w = parameter("lambda_w", lower=0, unit="Pa"), parameter("mu_w", lower=0, unit="Pa")
        psi = psi + lambda_w / 2 * pos(tr(eps)) ** 2 + mu_w * inner(pos(eps), pos(eps))
    if heat:
        T = temperature("T")
        alpha_T, T_0 = parameter("alpha_T", lower=0, unit="1/K"), parameter("T_0", lower=0, unit="K")
        C_v = parameter("C_v", lower=0, unit="J/(m3.K)")
        strain = eps if elastic else eps - eps_p
        psi = psi - 3 * elasticity.bulk * alpha_T * (T - T_0) * tr(strain) - C_v * (T * log(T / T_0) - T + T_0)
    if elastic:
        return Law(name, psi=psi, observable=eps)
    psi = psi + H_i / 2 * p**2
    if kinematic:
        H_k = parameter("H_k", lower=0, unit="Pa")
        A, chi, R = forces(eps_p, alpha, p, names="A chi R")
        psi, B, internal = psi + H_k / 3 * inner(alpha, alpha), A + chi, (eps_p, alpha, p)
    else:
        A, R = forces(eps_p, p, names="A R")
        B, internal = A, (eps_p, p)
    reach = eig_max(B) - eig_min(B) if principal else sqrt(Rational(3, 2)) * norm(dev(B))
    f = reach + R - sigma_y
    if pressure:
        f = f + tan(parameter("theta_f", lower=0, upper=1.57, unit="rad")) / 3 * tr(B)
    phi_star: Any = indicator(f)
    if viscous:
        phi_star = pos(f) ** 2 / (2 * parameter("eta", lower=0, unit="Pa.s"))
    return Law(name, psi=psi, phi_star=phi_star, observable=eps, internal=internal)


def law(kind: str = "3d", **parts: bool) -> Callable[[], tuple[Law, str]]:
    return lambda: (_law("law_here", **parts), kind)


def law_parts(declared: Callable[[], tuple[Law, str]]) -> tuple[str, str, int, int]:
    """Text of the module, text of the step, entries of a state, components of a tensor; nothing is compiled."""
    law, kind = declared()
    size = dimension.dimension_named(kind).size
    module = module_source(law, kind)
    plan = ast.literal_eval(re.search(r"^PLAN = (.*)$", module, re.M).group(1))  # type: ignore[union-attr]
    method = re.search(r'^METHOD = "(\w+)', module, re.M).group(1)  # type: ignore[union-attr]
    width = int(re.search(r"^STATE_SIZE = (\d+)$", module, re.M).group(1))  # type: ignore[union-attr]
    return module, store.step_text("closed" if method == "closed" else "reduced", size, plan, False), width, size


def law_code(declared: Callable[[], tuple[Law, str]]) -> str:
    module, step, *_ = law_parts(declared)
    return module + step


def law_bytes(declared: Callable[[], tuple[Law, str]], tangent: bool = True) -> dict[str, int]:
    """Bytes of a point: strain, old and new state, stress, tangent, dissipation, status."""
    *_, width, size = law_parts(declared)
    return {"point": 8 * (2 * size + 2 * width + 2) + (8 * size * size if tangent else 0)}


def law_counted(declared: Callable[[], tuple[Law, str]], tangent: bool = True) -> dict[str, int]:
    """The same from the arrays of a step of four points."""
    law, kind = declared()
    update = build_update(law, kind, tangent=tangent)
    n, size = 4, update.dimension.size
    # stiff where it has to be, weak elsewhere: any admissible numbers will do
    known = {"nu": 0.3, "E": 1e9, "T_0": 293.0, "theta_f": 0.1}
    values = np.array([known.get(q.name, 1e6) for q in law.parameters])
    heat = np.full(n, 300.0) if law.temperature is not None else np.ones(1)
    numbers = update.pointers.coefficients(values, 1.0, heat)
    eps, old = np.zeros((n, size)), np.zeros((n, update.state_size))
    found = update.run(eps, old, numbers, update.tangent)
    return {"point": sum(a.nbytes for a in (eps, old, *found) if a is not None) // n}


# -- builds that never had a feature --------------------------------------------------------------------------------------------


def refuse(*_: Any, **__: Any) -> Any:
    raise Refused("this build never had that")


def cut(text: str, off: frozenset[str]) -> str:
    """A kernel text without the lines that stand only where one of the features `off` is there."""
    lines = []
    for line in text.split("\n"):
        _, mark, condition = line.partition("#?")
        if mark:
            names = sorted(
                {n.id for n in ast.walk(ast.parse(condition.strip(), mode="eval")) if isinstance(n, ast.Name)} - off
            )
            choices = itertools.product((False, True), repeat=len(names))
            held = (dict.fromkeys(off, False) | dict(zip(names, values, strict=True)) for values in choices)
            code = compile(condition.strip(), "<condition>", "eval")
            if not any(eval(code, {"__builtins__": {}}, known) for known in held):
                continue
        lines.append(line)
    return "\n".join(lines)


def without_lines(*names: str) -> None:
    """Cut the lines of these features out of all kernel texts; asking for one of them raises."""
    off = frozenset(names)
    lost = 0
    for template in ("BODIES", "DETECTION", "LINKS", "PAIRS", "PLANES"):
        whole = getattr(scene_kernels, template)
        setattr(scene_kernels, template, cut(whole, off))
        lost += len(whole) - len(getattr(scene_kernels, template))
    assert lost > 0, f"no line is there for {names}"
    expand = scene_kernels.expand

    def expand_without(text: str, dimension: int, features: Any, values: Any) -> str:
        known = {"two": dimension == 2, "three": dimension == 3, **features}
        if any(known.get(name) for name in off):
            refuse()
        return expand(text, dimension, features, values)

    scene_kernels.expand = expand_without  # type: ignore[assignment]


def rewritten(module: Any, name: str, *changes: tuple[str, str]) -> None:
    """Write a function or class of a module anew with these changes of its text."""
    text = inspect.getsource(getattr(module, name))
    for old, new in changes:
        assert old in text, f"{name}: {old!r} is not there"
        text = text.replace(old, new)
    exec(compile(text, f"<{name} without>", "exec"), module.__dict__)


def guarded(module: Any, name: str, having: Callable[..., bool]) -> None:
    """Refuse the arguments that have the feature."""
    whole = getattr(module, name)

    def checked(*args: Any, **options: Any) -> Any:
        return refuse() if having(*args, **options) else whole(*args, **options)

    setattr(module, name, checked)


def no_wires() -> None:
    without_lines("wires")
    scene_kernels.LINKS = None  # type: ignore[assignment]
    for table in (step_writer_module().SWEPT, step_writer_module().WARMED, step_writer_module().MEASURED):
        del table["links"]
    for wire in (RigidRod, RigidWire, ElasticRod, ElasticWire):
        wire.rule = refuse  # type: ignore[method-assign,assignment]


def step_writer_module() -> Any:
    return sys.modules["fenchel.dem.kernels.step_text"]


def no_friction() -> None:
    without_lines("friction", "mu_column", "ct", "ct_column", "slip", "spin", "mixed")
    for contact in (SignoriniCoulomb, CompliantSignoriniCoulomb):
        contact.rule = refuse  # type: ignore[method-assign,assignment]


def no_rotation() -> None:
    without_lines("spin", "mixed")


def no_compliance() -> None:
    without_lines("cn", "cn_column", "ct", "ct_column")
    CompliantSignoriniCoulomb.rule = refuse  # type: ignore[method-assign,assignment]


def no_third_dimension() -> None:
    without_lines("three")


def no_hardening() -> None:
    """Steps of one tensor: neither loop over tensors is there."""
    rewritten(closed_text, "closed_text", ("for k in range(tensors):", "for k in (0,)[:tensors]:"))
    rewritten(reduced_text, "_Text", ("for k in range(self.tensors):", "for k in (0,)[: self.tensors]:"))
    for module in (store, closed_text):
        module.closed_text = closed_text.closed_text
    guarded(coefficients, "internal_tensors", lambda law: sum(getattr(v, "rank", 0) == 2 for v in law.internal) > 1)


def no_temperature() -> None:
    Law.temperature = None  # type: ignore[assignment,method-assign]
    Law.entropy = property(refuse)  # type: ignore[assignment,method-assign]
    thermal.thermal_results = refuse
    globals()["temperature"] = refuse


def no_strain_energy() -> None:
    """Laws without wires: no unilateral energy of the strain is written, none declared."""
    rewritten(
        closed_text,
        "closed_text",
        ("if terms > 0:", "if False:"),
        ("if terms <= 0:", "if True:"),
        ("terms > 0 and single", "False"),
    )
    store.closed_text = closed_text.closed_text
    rewritten(
        reduced_text,
        "_Text",
        ("if terms > 0:", "if False:"),
        ("separate = terms > 0 and self.single", "separate = False"),
        ("if self.plan[STRAIN] > 0:", "if False:"),
    )
    for module in (terms_text, store):
        module.terms_text = refuse
    rest_text.rest_text = refuse
    closed.rest_text = refuse
    guarded(closed, "strain_numbers", lambda numbers, reduction: bool(reduction.moduli.alone))
    guarded(coefficients, "strain_numbers", lambda numbers, reduction: bool(reduction.moduli.alone))


def no_six_components() -> None:
    for table in (
        reduced_text.EIGEN,
        reduced_text.COMPONENTS,
        terms_text.POSITIVE,
        terms_text.DERIVATIVE,
        store._SPECTRAL,
    ):
        del table[6]
    del closed._SHORT[6]
    guarded(writer.Writer, "__init__", lambda self, constants, size=6, *rest, **options: size == 6)
    guarded(store, "closed_text", lambda size, plan, single: size == 6)
    guarded(store, "reduced_text", lambda size, plan, single: size == 6)


def no_tangent() -> None:
    """Steps that write no tangent: the branches of `want` are gone."""

    def bare(write: Callable[..., str]) -> Callable[..., str]:
        def text(*args: Any) -> str:
            return without_branch(write(*args))

        return text

    for name in ("closed_text", "reduced_text", "terms_text"):
        setattr(store, name, bare(getattr(store, name)))


def without_branch(text: str) -> str:
    lines, depth = [], None
    for line in text.split("\n"):
        here = len(line) - len(line.lstrip())
        if depth is not None and here > depth:
            continue
        depth = here if line.strip() == "if want:" else None
        if depth is None:
            lines.append(line)
    return "\n".join(lines)


# -- the features ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Feature:
    """A feature in a room: what lacks it, what has it, how it is taken out of the build, and the names that stand for it."""

    name: str
    room: str
    remove: Callable[[], None] | None  # None: no build without it can be made, the code of all has it
    without: tuple[Any, ...]
    having: tuple[Any, ...]
    symbols: str  # a regular expression of whole names
    remark: str = ""
    stay: frozenset[str] = frozenset()  # names that stay all the same; the remark says why
    flag: bool = False  # decided when the step runs: it stands in the code of all

    @property
    def code(self) -> Callable[[Any], str]:
        return scene_code if self.room == "scenes" else law_code

    def bytes(self, case: Any) -> dict[str, int]:
        return scene_bytes(case) if self.room == "scenes" else law_bytes(case, self.name != "tangent")

    def counted(self, case: Any) -> dict[str, int]:
        return scene_counted(case) if self.room == "scenes" else law_counted(case, self.name != "tangent")


WIRE_NAMES = r"wires?|ranks?|apart|tied|links?|link_row|\w+_links|tension|natural|compliance"
FEATURES = (
    Feature(
        "wires",
        "scenes",
        no_wires,
        (
            scene(FRICTION),
            scene(FRICTION, planes="each"),
            scene(SMOOTH, 2, planes="smooth"),
            scene(COMPLIANT, spin="some", planes="one"),
        ),
        (scene(FRICTION, wire=RigidRod()), scene(SMOOTH, 2, wire=ElasticWire(stiffness=1.0))),
        WIRE_NAMES + "|beads?",
        "`beads`: an argument of `collect`, one flag per body, not read",
        frozenset({"beads"}),
    ),
    Feature(
        "friction",
        "scenes",
        no_friction,
        (
            scene(SMOOTH),
            scene(SMOOTH, 2, planes="smooth"),
            scene(SMOOTH, planes="smooth", wire=ElasticRod(stiffness=1.0)),
        ),
        (scene(FRICTION), scene(SMOOTH, planes="one"), scene(TWO, 2)),
        r"mu|friction|slip|bound|cut|sliding|tangent|grip|slide|it|[tlq]_\d|[ac]_t",
        "`slide`, `grip`: arguments of the kernels of planes, given per plane, not read",
        frozenset({"slide", "grip"}),
    ),
    Feature(
        "rotation",
        "scenes",
        no_rotation,
        (
            scene(FRICTION, spin="none", planes="each"),
            scene(FRICTION, 2, "none"),
            scene(COMPLIANT, spin="none", wire=RigidWire()),
        ),
        (scene(FRICTION), scene(FRICTION, 2), scene(COMPLIANT, spin="some")),
        r"spin|omega|torque|inertia|turning|s_\d",
        "`spin`, `turning`: arguments of the kernels of bodies, not read",
        frozenset({"spin", "turning"}),
    ),
    Feature(
        "compliance",
        "scenes",
        no_compliance,
        (scene(FRICTION, planes="each"), scene(SMOOTH, 2, planes="smooth"), scene(TWO, spin="some", wire=RigidRod())),
        (scene(COMPLIANT), scene(COMPLIANT, 2, "none", "one")),
        r"cn|ct|k_n|k_t|pairs_cn|pairs_ct|planes_cn|planes_ct",
    ),
    Feature(
        "third dimension",
        "scenes",
        no_third_dimension,
        (scene(FRICTION, 2, planes="each"), scene(COMPLIANT, 2, "some"), scene(SMOOTH, 2, wire=RigidRod())),
        (scene(FRICTION), scene(SMOOTH)),
        r"\w+_2",
    ),
    Feature(
        "wires",
        "laws",
        no_strain_energy,
        (law(), law(principal=True), law("plane_strain", kinematic=True), law(viscous=True)),
        (law(wires=True), law(principal=True, wires=True)),
        r"rest|scratch|positive\w*|add_positive\w*|terms|square\d_|eigen\d_|\w+_w",
        "`rest`: a pointer that every step takes, not called",
        frozenset({"rest"}),
    ),
    Feature(
        "friction (pressure)",
        "laws",
        None,
        (law(),),
        (law(pressure=True),),
        r"theta_f",
        "closed steps read b, k_T and w_m of every law, zero without friction: 8 (2 + 2 per tensor) bytes per law, none per point",
        flag=True,
    ),
    Feature(
        "kinematic hardening",
        "laws",
        no_hardening,
        (law(), law(principal=True), law("plane_strain", pressure=True), law(viscous=True), law(elastic=True)),
        (law(kinematic=True), law(principal=True, kinematic=True)),
        r"alpha|chi|H_k|x1_\d",
    ),
    Feature(
        "temperature",
        "laws",
        no_temperature,
        (law(), law(kinematic=True), law(principal=True), law("plane_strain", wires=True), law(elastic=True)),
        (law(heat=True), law(heat=True, elastic=True)),
        r"T|T_0|C_v|alpha_T|entropy\w*|temperature\w*",
        "`temperature_`: an argument of the module's functions, one entry for all points; the step has none",
        frozenset({"temperature_"}),
    ),
    Feature(
        "third dimension",
        "laws",
        no_six_components,
        (
            law("plane_strain"),
            law("uniaxial", kinematic=True),
            law("plane_strain", principal=True),
            law("plane_strain", wires=True),
        ),
        (law(), law(principal=True), law(wires=True)),
        r"[ebsudg][45]|x\d_[45]|x[45]|d\d[45]|eigen|positive_part|add_positive_derivative",
    ),
    Feature(
        "tangent",
        "laws",
        no_tangent,
        (law(), law(principal=True)),
        (),
        r"tangent|want|drop|stiff|k[23]",
        "`want` is decided when the step runs: the lines stand in every step, without it no (n, 6, 6) is made",
        flag=True,
    ),
)


@dataclass(frozen=True)
class Row:
    """A feature: are the hashes those of the build without it, the names found, bytes, and were cases with the feature refused there."""

    feature: str
    room: str
    same: bool | None  # None: there is no build without the feature
    cases: int
    found: frozenset[str]
    stay: frozenset[str]
    alive: bool  # its names do stand in the code of what has it
    declared: dict[str, int]  # bytes of the first case, by the whole build
    counted: dict[str, int]  # from arrays
    never: dict[str, int]  # by the build that never had it
    more: dict[str, int]  # of a case with the feature
    refused: bool
    flag: bool
    remark: str


def names(code: str) -> set[str]:
    """Names in the code: no comments, no texts for the reader."""
    return {t.string for t in tokenize.generate_tokens(io.StringIO(code).readline) if t.type == tokenize.NAME}


def found_in(code: str, feature: Feature) -> set[str]:
    """Names in the code that stand for the feature."""
    return {name for name in names(code) if re.fullmatch(feature.symbols, name)}


def hashed(code: str) -> str:
    return hashlib.sha256(code.encode()).hexdigest()


def emitted(feature: Feature) -> dict[str, Any]:
    """Hashes and bytes of the cases without the feature; which of those with it are refused."""
    refused = []
    for case in feature.having:
        try:
            feature.code(case)
            refused.append("")
        except Exception as error:
            refused.append(type(error).__name__)
    return {
        "hashes": [hashed(feature.code(case)) for case in feature.without],
        "bytes": [feature.bytes(case) for case in feature.without],
        "refused": refused,
    }


def serve() -> None:
    """Print what builds without one feature each write; every build is a process of its own, forked before anything was written."""
    found = []
    for feature in FEATURES:
        out, into = os.pipe()
        child = os.fork()
        if child == 0:
            status = 1
            try:
                os.close(out)
                if feature.remove is not None:
                    feature.remove()
                with os.fdopen(into, "w") as file:
                    json.dump(emitted(feature), file)
                status = 0
            finally:
                if status:
                    import traceback

                    traceback.print_exc()
                os._exit(status)
        os.close(into)
        with os.fdopen(out) as file:
            text = file.read()
        _, status = os.waitpid(child, 0)
        if status:
            raise SystemExit(f"the build without {feature.name} ({feature.room}) failed")
        found.append(json.loads(text))
    print(json.dumps(found))


@cache
def builds() -> list[dict[str, Any]]:
    """What `serve` prints, from a fresh process."""
    here = str(Path(__file__).resolve().parent)
    call = [
        sys.executable,
        "-c",
        f"import sys; sys.path.insert(0, {here!r}); import unused_features; unused_features.serve()",
    ]
    done = subprocess.run(call, capture_output=True, text=True, timeout=300, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr[-3000:])
    return json.loads(done.stdout)


@cache
def rows() -> tuple[Row, ...]:
    """One row a feature and room."""
    found = []
    for feature, never in zip(FEATURES, builds(), strict=True):
        codes = [feature.code(case) for case in feature.without]
        with_it = [feature.code(case) for case in feature.having]
        here = {n for code in codes for n in found_in(code, feature)}
        first = feature.without[0]
        declared = feature.bytes(first)
        counted = feature.counted(first)
        known = {kind: declared[kind] for kind in declared if kind not in counted}
        more = feature.bytes(feature.having[0]) if feature.having else law_bytes(first)
        found.append(
            Row(
                feature.name,
                feature.room,
                None if feature.remove is None else [hashed(code) for code in codes] == never["hashes"],
                len(codes),
                frozenset(here),
                feature.stay,
                all(found_in(code, feature) - feature.stay for code in with_it),
                declared,
                counted | known,
                never["bytes"][0],
                more,
                bool(never["refused"]) and all(never["refused"]),
                feature.flag,
                feature.remark,
            )
        )
        assert [feature.bytes(case) for case in feature.without] == never["bytes"], feature.name
    return tuple(found)
