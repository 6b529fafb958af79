"""The main job: from a study file to a report. Runs are tasks on the local cores; a study that was stopped goes on where it was."""

from __future__ import annotations

import platform
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec

from .. import __version__
from ..campaign import run_campaign
from ..dem.bodies import Assembly
from ..dem.record import TriaxialRecord
from ..dem.storage import load_run, replace_file
from ..errors import InputError
from .identification import Identification, identify_law
from .options import Specimen
from .report import write_report
from .runs_info import RunsInfo, SampleView, quality_rows, series_of
from .study import Study, demo_study, read_study
from .tasks import Prepare, Test, probes_of

__all__ = ["run_study"]


def run_study(
    study_file: Path | str | None,
    directory: Path | str,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    show: bool = True,
    signs: str = "tension-positive",
) -> Identification:
    """Make the samples, test them, identify the law, write `report.html`, `report.json`, `law.py` and `runs/*.h5` into `directory`.

    `study_file` None takes the study that fenchel carries; `jobs` None takes all cores, `scheduler` is the address of a dask
    scheduler to run on instead; `signs` is for the axes of
    the figures. Raises `InputError` for a bad study, `ConvergenceError` when a step or a fit does not converge, `StorageError` when a
    file cannot be written; finished runs stay and are taken up by the next call.
    """
    directory = Path(directory)
    if study_file is None:
        study, text = demo_study()
    else:
        study = read_study(study_file)
        text = Path(study_file).read_bytes()
    folder = directory / "runs"
    _spare(directory, text)
    clock = {"start": time.perf_counter()}
    _warm_up(study)
    clock["compilation"] = time.perf_counter()
    seeds = study.solve.seeds
    prepare = [Prepare(study, seed, folder) for seed in seeds]
    has_wires = study.wires is not None and study.wires.count > 0
    kinds = [True, False] if study.wires is not None and study.wires.control and has_wires else [True]
    tests = [Test(study, seed, p, linked, folder) for seed in seeds for p in study.pressures for linked in kinds]
    probes = probes_of(study, folder) if study.solve.stiffness_probe else []
    folder.mkdir(parents=True, exist_ok=True)
    results = run_campaign(
        [*prepare, *tests, *probes], folder, jobs=jobs, scheduler=scheduler, show=show, label="whole study"
    )
    replace_file(directory / "study.toml", text)  # only now: runs of another study have refused by then
    clock["runs"] = time.perf_counter()
    records: list[TriaxialRecord] = [results[test.name] for test in tests]
    if show:
        print("fitting the law, then writing the report", file=sys.stderr, flush=True)
    identification = identify_law(_specimens(tests, records), study.options())
    clock["identification"] = time.perf_counter()
    info = _runs_info(study, prepare[0], tests, records, [results[probe.name] for probe in probes], clock)
    write_report(identification, info, directory, signs=signs)
    return identification


def _spare(directory: Path, text: bytes) -> None:
    """Refuse to write over a study or a law that no study run here has left."""
    if (directory / "runs").exists():
        return
    study, law = directory / "study.toml", directory / "law.py"
    for path in (study, law):
        if path.exists() and not (path == study and path.read_bytes() == text):
            raise InputError(f"{path}: is there already and not from a study run here; choose another folder")


def _warm_up(study: Study) -> None:
    """Compile the kernels once here, so that the worker processes find them on the disk."""
    import numpy as np

    from ..dem.preparation import material_of
    from ..dem.stepping import Drive, Simulation, Solver
    from ..dem.triaxial import TriaxialTest

    x = np.array([[0.0, 0.0, -0.5e-3], [0.0, 0.0, 0.5e-3]])
    pair = Assembly.of_spheres(
        x, np.full(2, 0.5e-3), np.full(2, 1e-5), np.full(3, 1e-3), wire=np.zeros(2, dtype=np.int64), rank=np.arange(2)
    )
    law = material_of(study.grains, study.wires)
    smooth = replace(law, friction=study.sample.friction, bead_friction=study.sample.friction)
    rigid = replace(law, normal_stiffness=np.inf, tangential_stiffness=np.inf)
    # what preparation, tests, controls and probes ask for: each combination is code of its own
    for kind in (smooth, law, rigid):
        for links in {False, kind.links}:
            Simulation(pair.copy(), replace(kind, links=links), Solver(keep_unconverged=True)).advance(1e-5, Drive())
    test = TriaxialTest(
        pair, law, Solver(keep_unconverged=True), pressure=1.0, density=2600.0, strain_path=(0.0, -1e-3)
    )
    test.advance()


def _specimens(tests: Sequence[Test], records: Sequence[TriaxialRecord]) -> list[Specimen]:
    out = []
    for seed in dict.fromkeys(t.seed for t in tests):
        mine = [(t, r) for t, r in zip(tests, records, strict=True) if t.seed == seed]
        out.append(
            Specimen(
                seed=seed,
                linked={t.pressure: r for t, r in mine if t.linked},
                control={t.pressure: r for t, r in mine if not t.linked},
            )
        )
    return out


def _runs_info(
    study: Study,
    prepared: Prepare,
    tests: Sequence[Test],
    records: Sequence[TriaxialRecord],
    probes: Sequence[dict[str, Any]],
    clock: dict[str, float],
) -> RunsInfo:
    from importlib.metadata import version

    content, _ = load_run(prepared.state_file(study.pressures[0]))
    assembly = Assembly.from_arrays(content["assembly"])
    stamps = list(clock.items())
    prestressed = study.wires is not None and study.wires.state == "prestressed" and study.wires.control
    return RunsInfo(
        settings=_with_units(study),
        seconds={name: now - before for (_, before), (name, now) in pairwise(stamps)},
        versions={
            "fenchel": __version__,
            "python": platform.python_version(),
            **{name: version(name) for name in ("numpy", "scipy", "numba", "sympy", "cvxpy", "clarabel")},
        },
        sample=SampleView(
            positions=assembly.x,
            radii=assembly.radius,
            wire=assembly.wire,
            title=f"seed {prepared.seed} at {study.pressures[0] / 1e3:g} kPa",
        ),
        series=series_of(records),
        quality=quality_rows(records),
        stiffness=probes,
        stiffness_note=_stiffness_note(probes),
        notes=[
            "The control of prestressed wires starts from the state at rest with links and rearranges when they are cut."
        ]
        if prestressed
        else [],
        files=[str(t.run_file.relative_to(t.folder.parent)) for t in tests],
    )


def _with_units(study: Study) -> dict[str, Any]:
    """Every setting of a study, "table.key [unit]": value."""
    out: dict[str, Any] = {}
    for name in study.__struct_fields__:
        table = getattr(study, name)
        if not isinstance(table, msgspec.Struct):
            out[name] = "none" if table is None else table
            continue
        for field in msgspec.inspect.type_info(type(table)).fields:  # type: ignore[attr-defined]
            unit = (getattr(field.type, "extra_json_schema", None) or {}).get("unit", "–")
            value = getattr(table, field.name)
            label = f"{name}.{field.name}" + ("" if unit in ("–", "1") else f" [{unit}]")
            if value is None or isinstance(value, bool):
                value = "–" if value is None else "yes" if value else "no"
            out[label] = list(value) if isinstance(value, tuple) else value
    return out


def _stiffness_note(probes: Sequence[dict[str, Any]]) -> str:
    """One sentence on what the probes show."""
    key = "E_s at 0.02 % [MPa]"
    own = [row[key] for row in probes if row["grains"] == "compliant"]
    rigid = [row[key] for row in probes if row["grains"] == "rigid"]
    inside = [row["E_s in the sphere [MPa]"] for row in probes if row["grains"] == "compliant"]
    parts = []
    if own:
        parts.append(
            f"With the grains of the study the secant moves by {100 * (max(own) - min(own)) / own[0]:.2g} % at half the tolerance "
            f"and half the step, the E_s of the sphere by {100 * (max(inside) - min(inside)) / inside[0]:.2g} %."
        )
    if rigid:
        parts.append(
            f"With rigid grains the same sample shows {min(rigid):.3g} to {max(rigid):.3g} MPa: "
            "that stiffness is an artefact of sweeps and step, not of the sample."
        )
    if parts:
        parts.append(
            "Secants are wall stress over box strain; the E_s of the law is read inside the sphere, which is stiffer than the box."
        )
    return " ".join(parts)
