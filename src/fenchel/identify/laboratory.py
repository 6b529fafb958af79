"""Laboratory files in, a fitted law out: the other main job of `fenchel identify`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import InputError
from .laboratory_file import read_laboratory
from .laboratory_fit import LaboratoryFit, fit_laboratory
from .laboratory_report import write_laboratory_report

__all__ = ["identify_laboratory"]


def identify_laboratory(
    files: Sequence[Path | str],
    directory: Path | str | None = None,
    *,
    law: str = "sand",
    held_out: Sequence[Path | str] = (),
    start: Mapping[str, float] | None = None,
    hold: Sequence[str] = (),
    signs: str = "compression-positive",
    confining_pressures: Sequence[float] = (),
    volume_weight: float = 1.0,
    show: bool = False,
) -> LaboratoryFit:
    """Read triaxial tests, fit a law to them, predict those held out; write report and law into `directory` unless it is None.

    `law` is a name of the library or `file.py:name`. `start` and `hold` as in `fit_laboratory`. `signs` are those of the files and of the
    axes of the report. `confining_pressures` [Pa], one per file, `held_out` after `files`, take the place of the comment lines.
    Errors as of `read_laboratory`, `fit_laboratory` and `write_laboratory_report`, and `InputError` where `directory` holds the report of
    other tests; nothing is written before all is computed.
    """
    from ..potentials import load_law

    paths = [*files, *held_out]
    if not files:
        raise InputError("identify needs a laboratory file to fit to: fenchel identify LAB.csv -o DIR")
    if confining_pressures and len(confining_pressures) != len(paths):
        raise InputError(
            f"{len(confining_pressures)} confining pressures for {len(paths)} files: give one per file, in their order, held-out files last"
        )
    levels = confining_pressures or [None] * len(paths)
    tests = [read_laboratory(p, signs=signs, confining_pressure=level) for p, level in zip(paths, levels, strict=True)]
    declared = load_law(law)
    if directory is not None:
        _check_folder(Path(directory), [test.name for test in tests])
    fit = fit_laboratory(
        declared,
        tests[: len(files)],
        law_name=law,
        held_out=tests[len(files) :],
        start=start,
        hold=hold,
        volume_weight=volume_weight,
        progress=_tell if show else lambda text: None,
    )
    if directory is not None:
        from ..potentials.library import LAWS

        place = None if law in LAWS else Path(law.rpartition(":")[0])
        write_laboratory_report(fit, directory, signs=signs, law_file=place)
    return fit


def _check_folder(folder: Path, names: list[str]) -> None:
    """A report of the same tests may be made again; one of others is kept."""
    report = folder / "report.json"
    try:
        content = json.loads(report.read_text(encoding="utf-8"))
        there = sorted(str(test["name"]) for test in content["tests"])
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as problem:
        raise InputError(f"{report}: cannot be read ({problem.strerror}): choose another folder") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        there = []
    if there != sorted(names):
        raise InputError(
            f"{folder}: holds the report of {', '.join(there) or 'something else'}: choose another folder, or remove that report"
        )


def _tell(text: str) -> None:
    import sys

    print(text, file=sys.stderr)
