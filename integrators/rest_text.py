"""An energy of the strain alone that is no square of positive parts, as numba text: its gradient and its Hessian, added in place.

rest_(ε, σ, work, c, want, tangent):   σ += ∂ψ_0/∂ε,   tangent += ∂²ψ_0/∂ε²  (a row of 36).
"""

from __future__ import annotations

from sympy import Expr

from ..potentials import Law
from ..potentials.derivative import partial, second_derivative
from .kernels.terms_text import DERIVATIVE
from .structure import NoReduction
from .writer import Writer

__all__ = ["rest_text"]


def rest_text(law: Law, rest: Expr, size: int = 6) -> tuple[list[str], list[Expr]]:
    """Lines of `rest_` and the expressions that it reads as c; nothing for no energy."""
    if rest == 0:
        return [], []
    constants: dict[Expr, str] = {}
    writer = Writer(constants, size)
    writer.tensor_into("stress_", partial(rest, law.observable), add=True)
    writer.line("if want_ == 0:")
    writer.line("return", 1)
    operator = second_derivative(rest, law.observable, law.observable)
    if operator.functions or operator.extremes or operator.sandwiched:
        raise NoReduction(f"law '{law.name}': psi holds a spectral function of the strain")
    writer.line(f"c0_ = {writer.code(operator.c0)}")
    writer.line(f"c1_ = {writer.code(operator.c1)}")
    for text in (
        f"for i_ in range({size}):",
        f"    tangent_[{size + 1} * i_] += c0_",
        "for i_ in range(3):",
        "    for j_ in range(3):",
        f"        tangent_[{size} * i_ + j_] += c1_",
    ):
        writer.line(text)
    for weight, tensor in operator.spectral:
        number = writer.spectrum(tensor)
        writer.uses.add(DERIVATIVE[size])
        writer.line(f"{DERIVATIVE[size]}({writer.code(weight)}, eigen{number}_, tangent_)")
    for weight, left, right in operator.dyads:
        writer.tensor_into("work_[0]", left)
        writer.line("left_ = work_[0].copy()")
        writer.tensor_into("work_[0]", right)
        writer.line(f"weight_ = {writer.code(weight)}")
        writer.line(f"for i_ in range({size}):")
        writer.line(f"for j_ in range({size}):", 1)
        writer.line(f"tangent_[{size} * i_ + j_] += weight_*left_[i_]*work_[0][j_]", 2)
    text = [
        "@njit(folder=FOLDER, signature_or_function=LAW_SIGNATURE)",
        f"def rest_({law.observable}, stress_, work_row_, c_, want_, tangent_):",
        '    """Add stress and tangent of the energy of the strain that has no form of its own."""',
        f"    work_ = np.zeros(({6 + 4 * len(writer.spectra)}, 12))",
        *(f"    {name} = c_[{i}]" for i, name in enumerate(constants.values())),
        *writer.lines,
    ]
    return ["", "", *text], list(constants)
