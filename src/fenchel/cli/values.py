"""Parameter values of a law, from `-p NAME=VALUE` and from a TOML file."""

from __future__ import annotations

import math
import re
from pathlib import Path

import typer

from ..errors import InputError

__all__ = ["PARAMETERS", "VALUES", "parameter_values"]

VALUES = typer.Option([], "-p", metavar="NAME=VALUE", help="A parameter of the law; may be repeated.")
PARAMETERS = typer.Option(None, "--parameters", metavar="P.toml", help="Parameters from a file of NAME = VALUE lines.")


def parameter_values(pairs: list[str], file: Path | None = None) -> dict[str, float]:
    """Values by name; those of `pairs` take precedence over those of `file` (a TOML file of `NAME = VALUE` lines)."""
    values = {} if file is None else _from_file(file)
    given: dict[str, float] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        name = name.strip()
        if not equals or not name:
            raise InputError(f'-p "{pair}": write NAME=VALUE, as in -p E_s=1e8')
        if name in given:
            raise InputError(f"-p {name} is given twice: give it once")
        try:
            value = float(text)
        except ValueError:
            raise InputError(f'-p {name}: "{text}" is not a number{_meant(name, text)}') from None
        given[name] = _finite(f"-p {name}", value)
    return {**values, **given}


def _meant(name: str, text: str) -> str:
    """What to write in place of a decimal comma or of a number with a unit."""
    comma = text.strip().replace(",", ".")
    if text.count(",") == 1 and _is_number(comma):
        return f": write -p {name}={comma}"
    unit = re.fullmatch(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*[a-zA-Zµ°%][a-zA-Z0-9/.^]*\s*", text)
    if unit and _is_number(unit.group(1)) and not text.strip().startswith("0x"):
        return ": give the value in SI units without a unit, as in 200e9 for 200 GPa"
    return ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _from_file(file: Path) -> dict[str, float]:
    import tomllib

    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        raise InputError(f"{file}: not a TOML file: {problem}") from None
    values = {}
    for name, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{file}: {name} must be a number, not {type(value).__name__}: write {name} = 1.0")
        values[name] = _finite(f"{file}: {name}", float(value))
    return values


def _finite(where: str, value: float) -> float:
    if not math.isfinite(value):
        raise InputError(f"{where} = {value}: a parameter must be a finite number")
    return value
