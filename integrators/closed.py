"""Generated module of a law: its numbers for the compiled steps, and the functions that are its own.

coefficients_(values, dt, T)   the numbers that the compiled step reads, one each or one per temperature;
energy_, energies_             ρψ at one point, at many;
functions_, rest_              scalar functions of a curved or viscous step, an energy of the strain: where the law has one.
"""

from __future__ import annotations

from dataclasses import replace

from sympy import Expr, S

from ..potentials import Law
from ..potentials.printer import number_code
from .coefficients import Numbers, closed_numbers, is_closed, is_single, reduced_numbers, strain_numbers
from .conjugate_moduli import conjugate_moduli
from .declared import state_layout
from .plan import STRAIN, STRAIN_START
from .reduced_structure import Reduction, find_reduction
from .reduced_text import RATE_TIME, function_text
from .rest_text import rest_text
from .structure import NoReduction
from .writer import Writer

__all__ = ["closed_module"]

_SHORT = {6: "", 4: " 11, 22, 33, 12", 3: " 11, 22, 33"}
CLOSED_STRAIN = 2
"""Place in the plan of a closed step that says whether there are energies of the strain, or that the step is driven by the stress."""

WHY = {
    "closed": "one surface, affine in one deviator norm, traces and scalar forces: the step is in closed form",
    "reduced": "tensor forces enter through one deviator norm and traces: the step is a projection of a few numbers",
    "principal": "tensor forces enter through principal values of one combination: the step is a projection of these",
}


def closed_module(law: Law, solver: str = "auto", size: int = 6, formulation: str = "strain") -> str:
    """Text of the generated module for tensors of `size` components; `NoReduction` says why a law has no step of that kind.

    With `formulation="stress"` the numbers are those of −ψ*, and the step takes stresses: see `conjugate_moduli`.
    """
    reduction = find_reduction(law)
    _check_kind(reduction, solver)
    if formulation == "stress":
        reduction = replace(reduction, moduli=conjugate_moduli(reduction.moduli, law.name))
    functions: list[str] = []
    own: list[Expr] = []
    if is_closed(reduction) and solver in ("auto", "closed"):
        numbers, method = closed_numbers(reduction, size), "closed"
        turned = CLOSED_STRAIN
    else:
        numbers, turned = reduced_numbers(reduction, size), STRAIN
        method = "principal" if reduction.kind == "principal" else "reduced"
        if reduction.affine:
            _affine(numbers, reduction)
        else:
            functions, own = function_text(reduction, numbers.size)
            numbers.add("constants of functions_", *own)
        numbers.plan[STRAIN_START] = strain_numbers(numbers, reduction)
    if formulation == "stress":
        numbers.plan[turned] = -1
    if reduction.moduli.rest != 0:
        rest, constants = rest_text(law, reduction.moduli.rest, size)
        functions = functions + rest
        numbers.add("constants of rest_", *constants)
    return _module(law, reduction, numbers, method, functions, size, formulation)


def _check_kind(reduction: Reduction, solver: str) -> None:
    rule = f"law '{reduction.law.name}'"
    if solver == "closed" and not is_closed(reduction):
        raise NoReduction(
            f"{rule}: no closed form: it takes one surface, affine in one deviator norm, traces and scalars"
        )
    if solver == "reduced" and not reduction.unknowns:
        raise NoReduction(f"{rule}: nothing flows, there is nothing to reduce; the method for it is 'closed'")
    if solver == "reduced" and reduction.kind != "norm":
        raise NoReduction(f"{rule}: phi_star depends on principal values; the method for them is 'principal'")
    if solver == "principal" and reduction.kind != "principal":
        raise NoReduction(f"{rule}: phi_star does not depend on principal values; the method for it is 'reduced'")


def _method(reduction: Reduction, kind: str) -> str:
    if kind == "closed":
        return kind
    if reduction.affine:
        return f"{kind} affine"
    return f"{kind} single" if is_single(reduction) else kind


def _affine(numbers: Numbers, reduction: Reduction) -> None:
    for i, f in enumerate(reduction.surfaces):
        rest = f.xreplace(dict.fromkeys(reduction.unknowns, S.Zero))
        numbers.add(f"surface {i}: normal, value at zero", *(f.diff(z) for z in reduction.unknowns), rest)


def _module(
    law: Law, reduction: Reduction, numbers: Numbers, method: str, functions: list[str], size: int, formulation: str
) -> str:
    _, width = state_layout(law, size)
    energy, spectral = _energy(law, size)
    source = "spectral" if size == 6 else "spectral_plane"
    point = [name for name in spectral if name == "norm_of"]
    spectral = [name for name in spectral if name not in point]
    imports = [f"from fenchel.integrators.kernels.point import {', '.join(point)}"] if point else []
    imports += [f"from fenchel.integrators.{source} import {', '.join(spectral)}"] if spectral else []
    if functions:
        imports = ["from fenchel.integrators.kernel_types import LAW_SIGNATURE", *imports]
    described = {
        "closed": "closed form (`fenchel.integrators.kernels.closed_text`)",
        "reduced": "projection in "
        + ", ".join(map(str, reduction.unknowns))
        + " (`fenchel.integrators.kernels.reduced_text`), q_ = |dev B|, t_ traces",
        "principal": "projection in the principal values of B and scalar forces (`fenchel.integrators.kernels.reduced_text`)",
    }[method]
    driven = (
        [] if formulation == "strain" else ["Driven by the stress: the numbers of the step are those of −psi*.", ""]
    )
    text = [
        f'"""Implicit step of the law `{law.name}`, written by fenchel: {described}.',
        "",
        *driven,
        f"Strain [-] and stress [Pa] in Mandel components{_SHORT[size]}.",
        "",
        *law.text.splitlines(),
        '"""',
        "",
        "import math",
        "",
        "import numpy as np",
        "",
        "from fenchel.cache import njit",
        *imports,
        "",
        'FOLDER = __name__.rpartition("_")[2]',
        f'METHOD = "{_method(reduction, method)}"',
        f'WHY = "{WHY[method]}"',
        f"COMPONENTS = {size}",
        f"STATE_SIZE = {width}",
        f"VISCOUS = {reduction.finite != 0 or reduction.soft is not None}",
        f"STRAIN_ENERGY = {reduction.moduli.alone}",
        f"OWN_STRAIN_ENERGY = {reduction.moduli.rest != 0}",
        f"SIZE = {numbers.size}",
        f"PLAN = ({', '.join(map(str, numbers.plan))},)",
        "",
        "",
        *_coefficients(law, numbers),
        "",
        "",
        *energy,
    ]
    if functions:
        text += ["", "", *functions]
    return "\n".join(text) + "\n"


def _coefficients(law: Law, numbers: Numbers) -> list[str]:
    time = {s.name for _, g in numbers.groups for e in g for s in e.free_symbols} & {RATE_TIME.name}
    names = " ".join(p.name for p in law.parameters) or "none"
    clock = f", {RATE_TIME.name}: the time step [s]" if time else ""
    heat = f", {law.temperature}: the temperature [K]" if law.temperature is not None else ""
    lines = [
        f"def coefficients_(values_, {RATE_TIME.name}, {law.temperature or 'temperature_'}):",
        f'    """Numbers of the step from the parameters {names}{clock}{heat}."""',
        *(f"    {p.name} = values_[{i}]" for i, p in enumerate(law.parameters)),
        "    return (",
    ]
    for what, group in numbers.groups:
        lines.append(f"        # {what}")
        lines += [f"        {array_code(e)}," for e in group]
    return [*lines, "    )"]


def array_code(expression: Expr) -> str:
    """Python text that numpy evaluates, at arrays as well."""
    return number_code(expression).replace("math.", "np.").replace("max(", "np.maximum(")


def _energy(law: Law, size: int) -> tuple[list[str], list[str]]:
    """`energy_` and the spectral functions it calls."""
    constants: dict[Expr, str] = {}
    writer = Writer(constants, size)
    code = writer.code(law.energy)
    layout, _ = state_layout(law, size)
    views = []
    for name, (start, length) in layout.items():
        views.append(
            f"    {name} = state_[{start}:{start + length}]" if length > 1 else f"    {name} = state_[{start}]"
        )
    heat = [f"    {law.temperature} = temperature_"] if law.temperature is not None else []
    text = [
        "@njit(folder=FOLDER)",
        f"def energy_({law.observable}, state_, temperature_, work_, values_):",
        '    """Free energy per volume [J/m3] at one point."""',
        *(f"    {p.name} = values_[{i}]" for i, p in enumerate(law.parameters)),
        *heat,
        *views,
        *(f"    {name} = {number_code(e)}" for e, name in constants.items()),
        *writer.lines,
        f"    return {code}",
        "",
        "",
        "@njit(folder=FOLDER)",
        "def energies_(eps_, state_, temperature_, values_, psi_):",
        '    """Free energy per volume at every point; the temperature has one entry, or one per point."""',
        f"    work_ = np.zeros(({2 + 4 * len(writer.spectra)}, 12))",
        "    last_ = temperature_.shape[0] - 1",
        "    for m_ in range(eps_.shape[0]):",
        "        psi_[m_] = energy_(eps_[m_], state_[m_], temperature_[min(m_, last_)], work_, values_)",
    ]
    return text, sorted(writer.uses)
