"""`fenchel laws`, `show`, `check`: the library, Table 1 of a law, and whether the law is admissible."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import typer

from .figures import figure_kind, write_figure
from .progress import waiting
from .signs import SIGNS, Signs
from .values import PARAMETERS, VALUES, parameter_values

__all__ = ["LAW", "Formulation", "Split", "register"]

LAW = typer.Argument(
    ..., metavar="LAW", help="A name of the library, or file.py:name; such a file is run as the Python that it is."
)


class Formulation(StrEnum):
    """What drives the law: the strain, or the stress."""

    strain = "strain"
    stress = "stress"


class Measure(StrEnum):
    """Which equivalent stress is drawn: √J₂, or q = √(3 J₂)."""

    sqrt_J2 = "sqrt_J2"
    q = "q"


class Split(StrEnum):
    """Which strain the table is written in: the whole, or its reversible part."""

    total = "total"
    reversible = "reversible"


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("laws")(_laws)
    app.command("show")(_show)
    app.command("check")(_check)


def _laws(json_wanted: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """The library of laws, with their parameters.

    Example: fenchel laws
    """
    from fenchel.potentials.library import LAWS

    from .tables import print_json, print_table

    if json_wanted:
        print_json(
            {
                name: {
                    "description": law.note,
                    "parameters": {
                        symbol.name: {
                            "unit": symbol.unit,
                            "lower": symbol.lower,
                            "upper": symbol.upper,
                            "meaning": symbol.note,
                        }
                        for symbol in law.parameters
                    },
                }
                for name, law in LAWS.items()
            }
        )
        return
    rows = [
        (name, law.note, ", ".join(f"{symbol.name} [{symbol.unit or '-'}]" for symbol in law.parameters))
        for name, law in LAWS.items()
    ]
    print_table(("law", "what it is", "parameters"), rows)


def _show(
    law: str = LAW,
    formulation: Formulation = typer.Option(Formulation.strain, "--formulation", help="What drives the law."),
    split: Split = typer.Option(Split.total, "--split", help="Strain that the table is written in."),
    latex: bool = typer.Option(False, "--latex", help="Print LaTeX."),
    json_wanted: bool = typer.Option(False, "--json", help="Print JSON."),
    plot: Path | None = typer.Option(
        None,
        "--plot",
        metavar="FILE.png|svg",
        help="Draw the surfaces and energies at the values of -p (library: its own).",
    ),
    pairs: list[str] = VALUES,
    parameters: Path | None = PARAMETERS,
    pressure: float | None = typer.Option(
        None,
        "--pressure",
        metavar="Pa",
        help="Mean pressure of the deviatoric plane that is drawn, positive in compression.",
    ),
    measure: Measure = typer.Option(Measure.sqrt_J2, "--measure", help="Equivalent stress of the meridian plane."),
    signs: Signs = SIGNS,
) -> None:
    """Table 1 of a law, and its figure.

    Printed are its potentials, state laws and complementary laws; --plot draws its surfaces and energies.

    Example: fenchel show sand --formulation strain

    Example: fenchel show texsol --plot texsol.png

    Example: fenchel show tresca --plot tresca.png -p E=2e11 -p nu=0.3 -p sigma_y=3e8 -p H_i=0
    """
    from fenchel.errors import InputError
    from fenchel.potentials import load_law

    from .tables import print_json

    if latex and json_wanted:
        raise InputError("show prints either --latex or --json: leave one out")
    if plot is None and (pairs or parameters is not None):
        raise InputError("the table of a law has no values: give --plot FILE.png too, or leave -p and --parameters out")
    if plot is not None:
        figure_kind(plot)
    declared = load_law(law)
    table = declared.table(formulation.value, split=split.value)
    if plot is not None:
        from fenchel.potentials.law_figure import law_figure
        from fenchel.potentials.library import ENTRIES

        values = parameter_values(pairs, parameters)
        if law in ENTRIES:
            usual = ENTRIES[law].values | ENTRIES[law].worked.temperatures
            missing = {name: value for name, value in usual.items() if name not in values}
            if missing:
                told = ", ".join(f"{name} = {value:g}" for name, value in missing.items())
                typer.echo(f"values of the library, which are plausible and not measured: {told}", err=True)
            values |= missing
        with waiting(f"drawing law '{declared.name}'"):
            write_figure(
                law_figure(
                    declared,
                    values,
                    signs=signs.value,
                    pressure=pressure,
                    measure=measure.value,
                ),
                plot,
            )
    if plot is not None:
        typer.echo(f"figure in {plot}", err=True)
    if json_wanted:
        content = table.json()
        if isinstance(content, str):
            typer.echo(content)
        else:
            print_json(content)
    else:
        typer.echo(table.latex() if latex else table.text())


def _check(
    law: str = LAW,
    pairs: list[str] = VALUES,
    parameters: Path | None = PARAMETERS,
    json_wanted: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Is a law admissible?

    Exit code 0 if that is proved, 1 if refuted or undecided, 2 if it is not a valid declaration.

    Without values the answer holds for all parameters that keep the conditions printed; values decide the conditions.

    Example: fenchel check von_mises -p E=2e11 -p nu=0.3
    """
    from fenchel.potentials import load_law

    from .tables import print_json

    report = load_law(law).check(**parameter_values(pairs, parameters))
    if json_wanted:
        print_json(report.as_dict())
    else:
        typer.echo(report.text())
    if report.admissible is not True:
        raise typer.Exit(1)
