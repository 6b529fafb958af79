"""The report and the exported law: complete, self-contained, honest; `law.py` replays what was identified."""

from __future__ import annotations

import json
import re
import tomllib

import numpy as np
import planted_law
import pytest

from fenchel.errors import InputError, StorageError
from fenchel.identify import (
    IdentifyOptions,
    LawParameters,
    RunsInfo,
    SampleView,
    Specimen,
    identify_law,
    quality_rows,
    replay,
    series_of,
    write_report,
)
from fenchel.integrators import drive_arrays
from fenchel.potentials import load_law

LAW = planted_law.Planted(E_s=13e6, E_w=0.25e6, nu=0.12, theta_f=0.30, C_0=2500.0, H_k=2.6e6, H_i=0.15e6)
PRESSURES = (5e4, 7e4, 9e4)


def folded(strain, sand, wire):
    """Grains that no law of the family follows: q saturates and the volume shrinks on shortening."""
    sand, strain = sand.copy(), strain.copy()
    q = sand[:, 0] - sand[:, 2]
    sand[:, 2] = sand[:, 0] - q / (1.0 + (np.abs(q) / (0.3 * -sand[0, 0])) ** 2)
    strain[:, :2] -= 0.5 * np.abs(strain[:, 2:3])
    return strain, sand, wire


def specimens(**options):
    return [
        Specimen(
            seed=seed,
            linked={P: planted_law.record(LAW, P, seed, **options) for P in PRESSURES},
            control={P: planted_law.record(LAW, P, seed, linked=False, **options) for P in PRESSURES},
        )
        for seed in (1, 2)
    ]


@pytest.fixture(scope="module")
def found():
    options = IdentifyOptions(held_out=(7e4,), fit_frames=60)
    return identify_law(specimens(), options)


@pytest.fixture(scope="module")
def folder(found, tmp_path_factory):
    rng = np.random.default_rng(0)
    records = [planted_law.record(LAW, P, 1) for P in PRESSURES]
    frames = len(records[0].leg)
    ramp = np.linspace(0.0, 1e-3, frames)
    values = {
        "natural_map": np.full(frames, 1e-5),
        "change": np.full(frames, 1e-6),
        "unbalanced": np.full(frames, 1e-4),
    }
    values |= {"external": ramp, "friction": 0.6 * ramp, "elastic": 0.4 * ramp, "balance": 0.0 * ramp}
    for record in records:
        record.series.update(values)
    info = RunsInfo(
        title="A <test>",
        settings={"grains.count": 1000, "triaxial.pressures": [5e4, 7e4, 9e4]},
        sample=SampleView(
            positions=rng.uniform(0, 0.02, (60, 3)), radii=np.full(60, 1e-3), wire=np.repeat([-1, 0, 1], [40, 10, 10])
        ),
        series=series_of(records),
        quality=quality_rows(records),
        stiffness=[{"contacts": "rigid", "tolerance": 1e-3, "E_s [MPa]": 1.7}],
        stiffness_note="Rigid grains have the stiffness of their solver.",
        files=["runs/seed1.h5"],
    )
    directory = tmp_path_factory.mktemp("report")
    write_report(found, info, directory, signs="compression-positive")
    return directory


def test_replay_is_the_independent_law():
    axial, _ = planted_law.path((0.0, -0.01, 0.006, -0.01))
    for law in (LAW, planted_law.Planted(**{**vars(LAW), "E_w": 0.0, "H_i": 0.0})):
        strain, sand, wire = planted_law.triaxial(law, 5e4, axial)
        run = replay(LawParameters(**vars(law)), 5e4, axial)
        assert np.abs(run.stress - sand - wire).max() < 1e-3
        assert np.abs(run.wire - wire).max() < 1e-3
        assert np.abs(run.strain - strain).max() < 1e-10


def test_the_exported_law_replays_the_identified_one(found, folder):
    """law.py with its path and parameter files, from the virgin state through isotropic compression: same q, same strains."""
    law = load_law(f"{folder / 'law.py'}:law")
    update = law.compile("3d", tangent=True)
    for level in PRESSURES:
        tag = f"{level / 1e3:g}kPa"
        rows = np.loadtxt(folder / f"path_{tag}.csv", delimiter=",", skiprows=1)
        values = tomllib.loads((folder / f"parameters_{tag}.toml").read_text())
        targets = np.zeros((len(rows), 6))
        targets[:, 2], targets[:, 0], targets[:, 1] = rows[:, 1], rows[:, 2], rows[:, 3]
        assert not targets[0].any()
        run = drive_arrays(update, [True, True, False, True, True, True], targets, values)
        own = replay(found.law, -rows[1:, 2], np.concatenate([[0.0], rows[2:, 1] - rows[1, 1]]))
        assert np.abs(run.sig[1:] - own.stress).max() < 1e-6 * level
        assert np.abs(run.eps[1:] - run.eps[1] - own.strain).max() < 1e-9
        assert np.abs(run.sig[1] + level * np.array([1, 1, 1, 0, 0, 0])).max() < 1e-6 * level


def test_the_page_is_self_contained_and_complete(found, folder):
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "A &lt;test&gt;" in page and "<test>" not in page
    assert not re.search(r'(src|href)="(?!data:)', page) and "http" not in re.sub(r"data:[^\"]*", "", page)
    wanted = ("sample", "stress", "fit", "volume", "phases", "wires", "mismatch", "yield", "residuals", "energy")
    assert [key for key in wanted if f'id="figure-{key}"' not in page] == []
    for key in ("values", "stages", "elastic", "predictions", "control", "quality", "stiffness", "settings"):
        assert f'<table id="{key}">' in page, key
    assert page.index("rms error") < page.index('id="values"')  # what it is worth, before the numbers


def test_the_json_holds_the_same_numbers(found, folder):
    data = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert data["identification"]["law"]["E_s"] == found.law.E_s
    assert data["identification"]["estimates"]["H_k"]["value"] == found.estimates["H_k"].value
    assert data["identification"]["control"]["wire_stress_max"] == 0.0
    assert data["runs"]["stiffness"][0]["E_s [MPa]"] == 1.7


def test_a_bad_replay_is_said_first():
    """Data that the law cannot follow: the first sentence says so, with the figure, and the volume has the wrong sign."""
    bad = identify_law(specimens(distort=folded, spread=0.01)[:1], IdentifyOptions(fit_frames=60, jackknife=False))
    worst = max(p.error_q for p in bad.predictions if p.linked)
    assert worst > 0.15
    assert "BADLY" in bad.findings[0] and f"{worst:.1%}" in bad.findings[0]
    assert "No pressure was held out" in bad.findings[1]


def test_refusals(found, tmp_path):
    with pytest.raises(InputError, match="compression-positive"):
        write_report(found, RunsInfo(), tmp_path, signs="up")
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot be written"):
        write_report(found, RunsInfo(), tmp_path / "file")


def test_a_report_needs_no_run_information(found, tmp_path):
    page = write_report(found, RunsInfo(), tmp_path).read_text(encoding="utf-8")
    assert "Quality of the runs" not in page and "figure-sample" not in page
