"""Generated module of a law whose step has the cone structure, or of an elastic law.

With trial forces at frozen internal variables, B = dev Σ a_k A_k, q = ‖B‖, f the surface:

    elastic  f ≤ 0;
    cone     γ = f/h, h = a² w_q + w_T + w_R, valid while q ≥ γ a w_q;  dev ΔX_k = a_k γ a B/q;
    apex     γ = (f − a q)/(w_T + w_R);  dev ΔX_k = a_k B/w_q;

and tr ΔX_k = 3 b_k γ, Δs_j = r_j γ in both. That the apex is right wherever the cone formula leaves q < 0 follows from convexity.
The consistent tangent is c₀ 𝕀 + c₁ I⊗I + c₂ n⊗n + c₃ (n⊗I + I⊗n), n = B/q, plus the generalised Hessian of the energies of ε.
"""

from __future__ import annotations

from typing import Any

from sympy import Expr, S, Symbol

from ..potentials import Law
from ..potentials.atoms.positive_part import Step
from ..potentials.derivative import Operator, invariants_of, is_constant
from ..potentials.energy_terms import sort_energy
from ..potentials.invariants import NormLeaf
from ..potentials.printer import number_code
from ..potentials.scalars import ForceScalar, ScalarVariable
from ..potentials.tensor import Deviator, IdentityTensor, SymmetricTensor, from_terms
from .driving_text import BATCH, DRIVE
from .structure import ConeStructure, Moduli, find_cone, find_moduli, internal_scalars, internal_tensors
from .writer import Writer

__all__ = ["LIMIT", "NORM", "closed_module", "coupling_list", "stability_list", "state_layout"]


NORM, LIMIT = "weight of the norm", "limit at zero force"
_UNPACK = "    # constants are unpacked here, once all are known"


def state_layout(law: Law) -> tuple[dict[str, tuple[int, int]], int]:
    """Place (start, length) of every internal variable in the packed state, tensors first as declared, and the total length."""
    layout, start = {}, 0
    for variable in law.internal:
        length = 1 if isinstance(variable, ScalarVariable) else 6
        layout[variable.name] = (start, length)
        start += length
    return layout, start


def closed_module(law: Law) -> str:
    """Text of the generated module; raises `NoConeStructure` with the reason if the law has no closed form."""
    moduli = find_moduli(law)
    cone = find_cone(law, moduli) if law.internal else None
    constants: dict[Expr, str] = {}
    point, uses_p = _point(law, moduli, cone, constants)
    energy, uses_e = _energy(law, constants)
    _, size = state_layout(law)
    rows = 2 + 4 * max(uses_p[1], uses_e[1]) + 2
    imports = sorted(uses_p[0] | uses_e[0] | ({"norm6"} if cone else set()))
    names = ", ".join(p.name for p in law.parameters)
    text = [
        f'"""Implicit step of the law `{law.name}`, written by fenchel; strain [-] and stress [Pa] in Mandel components.',
        "",
        *law.text.splitlines(),
        '"""',
        "",
        "import math",
        "",
        "import numpy as np",
        "",
        "from fenchel.cache import njit",
        *([f"from fenchel.integrators.spectral import {', '.join(imports)}"] if imports else []),
        "",
        'FOLDER = __name__.rpartition("_")[2]',
        f"STATE_SIZE = {size}",
        f"WORK_ROWS = {rows}",
        "",
        "",
        "@njit(folder=FOLDER)",
        "def constants_(values_):",
        f'    """Coefficients that depend on the parameters only: {names or "none"}."""',
        *(f"    {p.name} = values_[{i}]" for i, p in enumerate(law.parameters)),
        *(f"    {name} = {number_code(expression)}" for expression, name in constants.items()),
        f"    return ({', '.join([*constants.values(), '0.0'])},)",
        "",
        "",
        *_stability(moduli, cone, law),
        "",
        "",
        *point,
        "",
        "",
        *energy,
    ]
    unpack = f"    ({', '.join([*constants.values(), '_'])},) = c_"
    return "\n".join(text).replace(_UNPACK, unpack) + BATCH + DRIVE


def stability_list(law: Law, moduli: Moduli, cone: ConeStructure | None = None) -> list[tuple[str, Expr]]:
    """Numbers that convexity of ψ and φ*, and φ*(0) = 0, want non-negative, with what they belong to."""
    found: list[tuple[str, Expr]] = []
    for name, operator in [
        (law.observable.name, moduli.strain),
        *((x.name, row[k]) for k, (x, row) in enumerate(zip(internal_tensors(law), moduli.tensors, strict=True))),
    ]:
        zero = dict.fromkeys((*operator.c0.atoms(Step), *operator.c1.atoms(Step)), S.Zero)
        c0: Any = operator.c0.xreplace(zero)
        c1: Any = operator.c1.xreplace(zero)
        for expression in (c0, c0 + 3 * c1):
            if is_constant(expression):
                found.append((name, expression))
        found += [(name, weight) for weight, _ in operator.spectral if is_constant(weight)]
    found += [(s.name, row[k]) for k, (s, row) in enumerate(zip(internal_scalars(law), moduli.scalars, strict=True))]
    found += [(law.observable.name, weight) for weight, _ in sort_energy(law).positive if is_constant(weight)]
    if cone is not None:
        found += [(NORM, cone.a), (LIMIT, -_at_zero_force(law.surfaces[0]))]
    return found


def _at_zero_force(function: Any) -> Any:
    forces = [*invariants_of(function), *function.atoms(ForceScalar)]
    return function.xreplace(dict.fromkeys(forces, S.Zero))


def coupling_list(law: Law, moduli: Moduli) -> list[tuple[tuple[str, ...], tuple[tuple[Expr, ...], ...]]]:
    """Matrices of moduli (deviatoric, spherical, of scalars) with entries off the diagonal, and the variables of their rows.

    What is not constant in the block of the observable can only stiffen it, so that it is taken at its least.
    """

    def least(expression: Any) -> Any:
        return expression.xreplace(dict.fromkeys(expression.atoms(Step), S.Zero))

    names = (law.observable.name, *(x.name for x in internal_tensors(law)))
    rows = [[moduli.strain, *moduli.mixed], *([m, *row] for m, row in zip(moduli.mixed, moduli.tensors, strict=True))]
    found = []
    for kind in (lambda o: o.c0, lambda o: o.c0 + 3 * o.c1):
        matrix = tuple(tuple(least(kind(o)) for o in row) for row in rows)
        if all(is_constant(e) for row in matrix for e in row):
            found.append((names, matrix))
    found.append((tuple(s.name for s in internal_scalars(law)), moduli.scalars))
    return [(n, m) for n, m in found if any(e != 0 for i, row in enumerate(m) for j, e in enumerate(row) if i != j)]


def _stability(moduli: Moduli, cone: ConeStructure | None, law: Law) -> list[str]:
    entries, couplings = stability_list(law, moduli, cone), coupling_list(law, moduli)
    values = [f"    {p.name} = values_[{i}]" for i, p in enumerate(law.parameters)]

    def free(*expressions: Any) -> str:
        return " ".join(sorted({s.name for e in expressions for s in e.free_symbols}))

    text = [
        "def moduli_(values_):",
        '    """Numbers that must not be negative, moduli of psi by variable: (what, parameters in it, value)."""',
        *values,
        "    return (",
        *(f'        ("{name}", "{free(e)}", {number_code(e)}),' for name, e in entries),
        "    )",
        "",
        "",
        "def couplings_(values_):",
        '    """Matrices of moduli that convexity wants semidefinite: (variables, parameters in it, matrix)."""',
        *values,
        "    return (",
    ]
    for names, matrix in couplings:
        text.append(f'        ("{" ".join(names)}", "{free(*(e for row in matrix for e in row))}", (')
        text += [f"            ({', '.join(number_code(e) for e in row)})," for row in matrix]
        text.append("        )),")
    return [*text, "    )"]


def _views(law: Law, source: str, tensors: bool = True, scalars: bool = True) -> list[str]:
    layout, _ = state_layout(law)
    lines = []
    for name, (start, length) in layout.items():
        if length == 6 and tensors:
            lines.append(f"    {name} = {source}[{start}:{start + 6}]")
        elif length == 1 and scalars:
            lines.append(f"    {name} = {source}[{start}]")
    return lines


def _energy(law: Law, constants: dict[Expr, str]) -> tuple[list[str], tuple[set[str], int]]:
    writer = Writer(constants)
    code = writer.code(law.energy)
    writer.line(f"return {code}")
    head = [
        "@njit(folder=FOLDER)",
        f"def energy_({law.observable}, state_, work_, c_):",
        '    """Free energy psi [J/m3]."""',
    ]
    return [*head, _UNPACK, *_views(law, "state_"), *writer.lines], (writer.uses, len(writer.spectra))


def _point(
    law: Law, moduli: Moduli, cone: ConeStructure | None, constants: dict[Expr, str]
) -> tuple[list[str], tuple[set[str], int]]:
    head = [
        "@njit(folder=FOLDER)",
        f"def point_({law.observable}, old_, new_, stress_, tangent_, want_, work_, c_):",
        '    """One implicit step at one point; returns (status, dissipation [J/m3])."""',
    ]
    final = Writer(constants)
    body: list[str] = []
    if cone is not None:
        body = _projection(law, cone, constants, final)
    final.tensor_into("stress_", law.stress)
    if cone is not None:
        _dissipation(law, cone, final)
    final.line("if want_:")
    final.indent = "        "
    _tangent(law, moduli, cone, final)
    final.indent = "    "
    finite = " + ".join(f"stress_[{i}]" for i in range(6))
    final.line(f"status_ = 0 if math.isfinite({finite}) else 2")
    if cone is not None:
        final.line("if not h_ > 0.0:")
        final.line("status_ = 3", 1)
        final.line("return status_, dissipation_")
    else:
        final.line("return status_, 0.0")
    return [*head, _UNPACK, *body, *final.lines], (final.uses, len(final.spectra))


def _projection(law: Law, cone: ConeStructure, constants: dict[Expr, str], final: Writer) -> list[str]:
    """Trial state, region and new internal variables."""
    writer = Writer(constants)
    trial = {law.forces[v]: law.force_laws[v] for v in law.internal if v in law.forces}
    surface: Any = law.surfaces[0].xreplace(trial)
    has_norm = cone.a != 0
    lines = _views(law, "old_")
    if has_norm:
        writer.line("b_ = work_[1, :6]  # deviator of the trial forces, as f weighs them")
        # the deviator is removed numerically from the sum, so that its trace vanishes to rounding
        raw: SymmetricTensor = S.Zero * law.observable
        for weight, x in zip(cone.dev_weights, internal_tensors(law), strict=True):
            raw = raw + weight * law.force_laws[x]
        writer.tensor_into("b_", _without_sphere(raw))
        writer.line("mean_ = (b_[0] + b_[1] + b_[2])/3.0")
        for i in range(3):
            writer.line(f"b_[{i}] -= mean_")
        writer.line("q_ = norm6(b_)")
        norms = list(surface.atoms(NormLeaf))
        assert len(norms) == 1
        writer.leaves[norms[0]] = Symbol("q_")
    else:
        writer.line("q_ = 0.0")
    writer.line(f"f_ = {writer.code(surface)}")
    a, w_q, w_m = (writer.code(x) for x in (cone.a, cone.w_q, cone.w_t + cone.w_r))
    writer.line(f"a_, w_q_, w_m_ = {a}, {w_q}, {w_m}")
    for text in (
        "h_ = 1.0",
        "gamma_ = 0.0  # multiplier",
        "slip_ = 0.0  # deviator of the flow per unit of b_",
        "region_ = 0  # 0 elastic, 1 cone, 2 apex",
        "if not f_ <= 0.0:",
        "    region_ = 1",
        "    h_ = a_*a_*w_q_ + w_m_",
        "    gamma_ = f_/h_",
        "    if q_ >= gamma_*a_*w_q_:",
        "        slip_ = gamma_*a_/q_ if q_ > 0.0 else 0.0",
        "    else:",
        "        region_ = 2",
        "        slip_ = 1.0/w_q_",
        "        gamma_ = (f_ - a_*q_)/w_m_ if w_m_ > 0.0 else q_/(a_*w_q_)",
    ):
        writer.line(text)
    layout, _ = state_layout(law)
    for weight, trace, x in zip(cone.dev_weights, cone.trace_weights, internal_tensors(law), strict=True):
        start = layout[x.name][0]
        writer.line("for i_ in range(6):")
        flow = "" if weight == 0 or not has_norm else f" + {_factor(writer.code(weight))}slip_*b_[i_]"
        writer.line(f"new_[{start} + i_] = old_[{start} + i_]{flow}", 1)
        if trace != 0:
            writer.line(f"sphere_ = {_factor(writer.code(trace))}gamma_")
            for i in range(3):
                writer.line(f"new_[{start + i}] += sphere_")
    for weight, s in zip(cone.scalar_weights, internal_scalars(law), strict=True):
        start = layout[s.name][0]
        writer.line(f"new_[{start}] = old_[{start}] + {_factor(writer.code(weight))}gamma_")
    final.uses |= writer.uses
    return [*lines, *writer.lines, *_views(law, "new_")]


def _factor(code: str) -> str:
    if code == "1.0":
        return ""
    return f"{code}*" if code.replace("_", "").replace(".", "").isalnum() else f"({code})*"


def _without_sphere(tensor: SymmetricTensor) -> SymmetricTensor:
    found: dict[SymmetricTensor, Expr] = {}
    for atom, c in tensor.terms().items():
        if isinstance(atom, IdentityTensor):
            continue
        base = atom.args[0] if isinstance(atom, Deviator) else atom
        assert isinstance(base, SymmetricTensor)
        found[base] = found.get(base, S.Zero) + c
    return from_terms(found)


def _dissipation(law: Law, cone: ConeStructure, writer: Writer) -> None:
    """Σ A_k:ΔX_k + Σ R_j Δs_j at the end of the step, scaled by γ so that extreme steps stay in range."""
    layout, _ = state_layout(law)
    writer.line("dissipation_ = 0.0")
    writer.line("if region_ > 0:")
    writer.indent = "        "
    leaves = dict(writer.leaves)
    writer.line("scale_ = 1.0/gamma_ if gamma_ > 0.0 else 0.0")
    for x in internal_tensors(law):
        if x not in law.forces:
            continue
        start = layout[x.name][0]
        writer.tensor_into("work_[0]", law.force_laws[x])
        writer.line("for i_ in range(6):")
        writer.line(f"dissipation_ += work_[0][i_]*((new_[{start} + i_] - old_[{start} + i_])*scale_)", 1)
    for s, weight in zip(internal_scalars(law), cone.scalar_weights, strict=True):
        if weight != 0:
            writer.line(f"dissipation_ += ({writer.code(law.force_laws[s])})*{_factor(writer.code(weight))}1.0")
    writer.line("dissipation_ *= gamma_")
    writer.indent = "    "
    writer.leaves = leaves


def _tangent(law: Law, moduli: Moduli, cone: ConeStructure | None, writer: Writer) -> None:
    strain: Operator = moduli.strain
    writer.line(f"c0_ = {writer.code(strain.c0)}")
    writer.line(f"c1_ = {writer.code(strain.c1)}")
    low_rank = cone is not None and cone.a != 0
    if cone is not None:
        g_q, g_t = writer.code(cone.g_q), writer.code(cone.g_t)
        lines = ["c2_ = 0.0", "c3_ = 0.0"] if low_rank else []
        lines += [f"g_q_, g_m_ = {g_q}, {g_t}", "if region_ == 1:"]
        if low_rank:
            lines += [
                "    drop_ = g_q_*g_q_*slip_",
                "    c0_ -= drop_",
                "    c1_ += drop_/3.0 - g_m_*g_m_/h_",
                "    c2_ = drop_ - a_*a_*g_q_*g_q_/h_",
                "    c3_ = -a_*g_q_*g_m_/h_",
            ]
        else:
            lines += ["    c1_ -= g_m_*g_m_/h_"]
        if low_rank:
            lines += [
                "elif region_ == 2:",
                "    drop_ = g_q_*g_q_/w_q_",
                "    c0_ -= drop_",
                "    c1_ += drop_/3.0",
                "    if w_m_ > 0.0:",
                "        c1_ -= g_m_*g_m_/w_m_",
            ]
        for text in lines:
            writer.line(text)
    if low_rank:
        for text in (
            "size_ = 1.0/q_ if q_ > 0.0 else 0.0",
            "for i_ in range(6):",
            "    n_ = b_[i_]*size_",
            "    left_ = c2_*n_ + (c3_ if i_ < 3 else 0.0)",
            "    for j_ in range(6):",
            "        tangent_[i_, j_] = left_*(b_[j_]*size_)",
            "    for j_ in range(3):",
            "        tangent_[i_, j_] += c3_*n_",
        ):
            writer.line(text)
    else:
        for text in ("for i_ in range(6):", "    for j_ in range(6):", "        tangent_[i_, j_] = 0.0"):
            writer.line(text)
    for text in (
        "for i_ in range(3):",
        "    for j_ in range(3):",
        "        tangent_[i_, j_] += c1_",
        "for i_ in range(6):",
        "    tangent_[i_, i_] += c0_",
    ):
        writer.line(text)
    for weight, tensor in strain.spectral:
        number = writer.spectrum(tensor)
        writer.uses.add("add_positive_derivative")
        writer.line(
            f"add_positive_derivative({writer.code(weight)}, eigen{number}_, work_[{4 * number + 5}], tangent_)"
        )
    for weight, left, right in strain.dyads:
        writer.tensor_into("work_[0]", left)
        writer.line("left_ = work_[0].copy()")
        writer.tensor_into("work_[0]", right)
        writer.line(f"weight_ = {writer.code(weight)}")
        writer.line("for i_ in range(6):")
        writer.line("for j_ in range(6):", 1)
        writer.line("tangent_[i_, j_] += weight_*left_[i_]*work_[0][j_]", 2)
