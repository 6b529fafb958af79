"""`--signs`: tension positive inside, always; what is read and written turns where it is read and written."""

from __future__ import annotations

from enum import StrEnum

import typer

__all__ = ["SIGNS", "Signs"]


class Signs(StrEnum):
    """Which sense of stress and strain is positive in files and tables."""

    tension = "tension-positive"
    compression = "compression-positive"


SIGNS = typer.Option(Signs.tension, "--signs", help="Signs of stress and strain in what is read and written.")
