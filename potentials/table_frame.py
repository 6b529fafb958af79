"""What stands around the laws in Table 1: the decomposition, the dissipation inequality, and notes on its signs."""

from __future__ import annotations

from .conjugation.wording import Words, joined, shown
from .ranked import Ranked
from .table import Row
from .table_notation import Notation

__all__ = ["FrameRows"]


class FrameRows:
    """Rows before and after the state and complementary laws."""

    def __init__(self, notation: Notation) -> None:
        self.notation = notation
        self.law = notation.law

    # -- decomposition and dissipation ---------------------------------------------------------------------------------------------

    def opening(self) -> list[Row]:
        eps, tex = shown(self.law.observable)
        stress, stress_tex = self.notation.viscous_stress()
        total = (f"sig = sig_r + {stress}", rf"\boldsymbol{{\sigma}} = \boldsymbol{{\sigma}}^{{r}} + {stress_tex}")
        if not self.notation.reversible:
            if not self.notation.viscous:
                total = (f"{total[0]}, {stress} = 0", rf"{total[1]},\ {stress_tex} = 0")
            return [Row("decomposition", *total), self._dissipation()]
        if self.notation.irreversible:
            names = joined((shown(x) for x in self.notation.irreversible), " + ", " + ")
            split = (f"{eps} = {eps}_r + {names[0]}", rf"{tex} = {tex}^{{r}} + {names[1]}")
            if len(self.notation.irreversible) > 1:
                split = (
                    f"{eps} = {eps}_r + {eps}_ir, {eps}_ir = {names[0]}",
                    rf"{tex} = {tex}^{{r}} + {tex}^{{ir}},\ {tex}^{{ir}} = {names[1]}",
                )
        else:
            split = (f"{eps} = {eps}_r, {eps}_ir = 0", rf"{tex} = {tex}^{{r}},\ {tex}^{{ir}} = 0")
        if self.notation.viscous:
            split = joined([split, total])
        return [Row("decomposition", *split), self._dissipation()]

    def _dissipation(self) -> Row:
        products = []
        if self.notation.viscous:
            products.append(product(self.notation.viscous_stress(), self.notation.rate(self.law.observable), 2))
        products += [product(self.notation.stress(), self.notation.rate(x), 2) for x in self.notation.irreversible]
        for v in self.law.internal:
            products.append(
                product(self.notation.force(v), self.notation.rate(v), v.rank if isinstance(v, Ranked) else 0)
            )
        if self.law.temperature in self.notation.pairs():
            products.append(
                product(("-q/T", r"-\frac{\boldsymbol{q}}{T}"), self.notation.force(self.law.temperature), 1)
            )  # type: ignore[arg-type]
        text, tex = joined(products, " + ", " + ") if products else ("0", "0")
        tex = tex.replace("+ -", "- ")
        return Row("dissipation inequality", f"{text} >= 0", rf"{tex} \geq 0")

    # -- notes -------------------------------------------------------------------------------------------------------------------------

    def notes(self, formulation: str) -> list[Row]:
        rows = []
        if len(self.notation.duals) > 1:
            text = (
                "phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone "
                "has the opposite sign in the other slots"
            )
            tex = (
                r"\varphi^{*} \text{ is the total conjugate: every rate is } +\partial\varphi^{*}\text{; the conjugate in the first "
                r"slot alone has the opposite sign in the others}"
            )
            rows.append(Row("note", text, tex))
        if self.law.temperature is not None and formulation == "strain":
            text = (
                "psi is concave in the temperature: its subdifferential there is that of -psi, with the opposite sign"
            )
            tex = r"\psi \text{ is concave in the temperature: } -\partial(-\psi) \text{ is meant there}"
            rows.append(Row("note", text, tex))
        return rows


def product(force: Words, rate: Words, rank: int) -> Words:
    if rank == 0:
        return f"{force[0]}*{rate[0]}", rf"{force[1]}\,{rate[1]}"
    sign = ":" if rank == 2 else r"\cdot "
    return f"inner({force[0]}, {rate[0]})", f"{force[1]}{sign}{rate[1]}"
