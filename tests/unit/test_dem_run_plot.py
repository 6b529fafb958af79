"""`Run`: what is drawn is what the run file says, with units on the axes; a view without pyvista says what to install."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenchel.cli import main
from fenchel.dem import Run, load_record, read_run, run_scene
from fenchel.dem.export.sample_panel import QUANTITIES, body_values
from fenchel.dem.measures import Network
from fenchel.dem.storage import save_run
from fenchel.errors import InputError

SCENE = """
seed = 4
[grains]
count = 60
friction = 0.35
normal_stiffness = 4.3e4
[wires]
count = 4
beads = 6
friction = 0.2
[triaxial]
strain_path = [0.0, -2e-3, -1e-3]
inertial_number = 2e-3
"""

DROP = """
dimension = 2
[motion]
duration = 2e-2
step = 1e-3
gravity = [0.0, -9.81]
[[body]]
position = [0.0, 1.01e-2]
radius = 1e-2
mass = 1e-2
[[plane]]
normal = [0.0, 1.0]
point = [0.0, 0.0]
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("run")
    (folder / "scene.toml").write_text(SCENE)
    run_scene(folder / "scene.toml", folder / "run.h5")
    return read_run(folder / "run.h5")


def axes_by_label(figure: Any) -> dict[tuple[str, str], Any]:
    return {(a.get_xlabel(), a.get_ylabel()): a for a in figure.axes}


def curve(axis: Any) -> tuple[np.ndarray, np.ndarray]:
    """All points of a panel, those where two legs meet once."""
    parts = [line.get_xydata() for line in axis.lines]
    points = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
    return points[:, 0], points[:, 1]


def test_a_run_reads_as_what_it_is(run: Run) -> None:
    assert run.kind == "triaxial" and run.path.name == "run.h5"
    np.testing.assert_array_equal(run.record.wall_stress, load_record(run.path).wall_stress)
    assert len(run.network.x) == 60 + 24 and run.settings["scene"]["seed"] == 4


@pytest.mark.parametrize("signs", ["tension-positive", "compression-positive"])
def test_the_curves_of_a_test_are_those_of_the_file(run: Run, signs: str) -> None:
    panels = axes_by_label(run.plot(signs=signs))
    sign = 1.0 if signs == "tension-positive" else -1.0
    axial = rf"axial strain $\varepsilon_{{zz}}$ [%] ({'extension' if sign > 0 else 'compression'} +)"
    stress = r"equivalent stress $\sqrt{J_2}$ [kPa]"
    stored = run.content["record"]
    lateral, vertical = stored["wall_stress"][:, :2], stored["wall_stress"][:, 2]
    # √J₂ by principal differences, not by the norm of the deviator
    sides = (lateral[:, 0] - lateral[:, 1], lateral[:, 1] - vertical, vertical - lateral[:, 0])
    equivalent = np.sqrt(sum(side**2 for side in sides) / 6.0)
    x, y = curve(panels[axial, stress])
    np.testing.assert_allclose(x, sign * 100.0 * stored["axial_strain"], rtol=1e-12)
    np.testing.assert_allclose(1e3 * y, equivalent, rtol=1e-9, atol=1e-6)
    x, y = curve(panels[r"mean pressure $p=-\mathrm{tr}\,\sigma/3$ [kPa]", stress])
    np.testing.assert_allclose(1e3 * x, -(lateral.sum(axis=1) + vertical) / 3.0, rtol=1e-12)
    word = "dilation" if sign > 0 else "contraction"
    x, y = curve(panels[axial, rf"volume strain $\varepsilon_{{v}}$ [%] ({word} +)"])
    np.testing.assert_allclose(y, sign * 100.0 * stored["wall_strain"][:, :3].sum(axis=1), rtol=1e-12)
    phases = panels["axial strain walked [%]", r"$\sqrt{J_2}$ of a phase [kPa]"]
    assert [line.get_label() for line in phases.lines] == ["grains", "beads", "wires"]
    for line, name in zip(phases.lines, ("stress_grains", "stress_beads", "stress_links"), strict=True):
        t = stored["history"][name]
        p = t[:, :3].mean(axis=1)
        j2 = 0.5 * ((t[:, :3] - p[:, None]) ** 2).sum(axis=1) + (t[:, 3:] ** 2).sum(axis=1)
        np.testing.assert_allclose(1e3 * line.get_ydata(), np.sqrt(j2), rtol=1e-9, atol=1e-6)
    # legs are told by their dashes too
    first = panels[axial, stress].lines
    assert [line.get_label() for line in first] == ["leg 1: shortening", "leg 2: extension"]
    assert len({line.get_linestyle() for line in first}) == 2


def test_the_sample_shows_the_bodies_of_its_slice(run: Run) -> None:
    network = run.network
    for view, (a, b, depth) in {"xz": (0, 2, 1), "yz": (1, 2, 0), "xy": (0, 1, 2)}.items():
        figure = run.plot(view=view, quantity="radius", thickness=4e-3)
        panel = next(axis for axis in figure.axes if axis.get_xlabel() == f"{'xyz'[a]} [mm]")
        assert panel.get_ylabel() == f"{'xyz'[b]} [mm]"
        bar = next(axis for axis in figure.axes if axis.get_ylabel().startswith("radius"))
        assert bar.get_ylabel() == "radius of a body [mm]"
        (bodies, *wires) = panel.collections
        low, high = (network.x - network.radius[:, None]).min(axis=0), (network.x + network.radius[:, None]).max(axis=0)
        off = network.x[:, depth] - 0.5 * (low + high)[depth]
        inside = (np.abs(off) <= 2e-3) & ~network.is_bead
        assert 10 < inside.sum() < 60
        np.testing.assert_allclose(np.sort(bodies.get_array()), np.sort(1e3 * network.radius[inside]), rtol=1e-12)
        # the viewer looks against first axis × second axis: far bodies are drawn first
        side = float(np.cross(np.eye(3)[a], np.eye(3)[b])[depth])
        order = np.argsort(side * network.x[inside, depth], kind="stable")
        np.testing.assert_allclose(bodies.get_array(), 1e3 * network.radius[inside][order], rtol=1e-12)
        middle = network.x[network.link].mean(axis=1)[:, depth] - 0.5 * (low + high)[depth]
        assert [len(lines.get_segments()) for lines in wires] == [int((np.abs(middle) <= 2e-3).sum())] * 2


def squeezed(force: float) -> Network:
    """A sphere of radius 2 mm between two walls of a box."""
    nothing = np.zeros((0, 2), dtype=np.int64)
    return Network(
        x=np.zeros((1, 3)), radius=np.array([2e-3]), wire=np.array([-1]), rank=np.array([0]), velocity=np.array([[3.0, 0.0, 4.0]]),
        fixed=np.array([False]), half=np.full(3, 2e-3), pair=nothing, normal=np.zeros((0, 3)), normal_force=np.zeros(0),
        tangential_force=np.zeros((0, 3)), friction=np.zeros(0), wall=np.array([[0, 4], [0, 5]]), wall_force=np.full(2, force),
        wall_normal=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), link=nothing, tension=np.zeros(0), time=0.0,
    )  # fmt: skip


def test_the_quantities_of_a_body(run: Run) -> None:
    alone = squeezed(7.0)
    # σ_zz = −2 F r/V, nothing else
    assert body_values(alone, "pressure")[0] == pytest.approx(2.0 * 7.0 * 2e-3 / (4.0 * np.pi * 8e-9), rel=1e-12)
    assert body_values(alone, "speed")[0] == pytest.approx(5.0) and body_values(alone, "contacts")[0] == 2.0
    network = run.network
    trace = np.zeros(len(network.x))  # of Σ f ⊗ (c − x) = V σ, contact by contact
    for (i, j), n, f in zip(network.pair, network.normal, network.normal_force, strict=True):
        trace[i] += (f * n) @ (-network.radius[i] * n)
        trace[j] += (-f * n) @ (network.radius[j] * n)
    for (i, _), n, f in zip(network.wall, network.wall_normal, network.wall_force, strict=True):
        trace[i] += (f * n) @ (-network.radius[i] * n)
    volume = 4.0 / 3.0 * np.pi * network.radius**3
    np.testing.assert_allclose(body_values(network, "pressure"), -trace / (3.0 * volume), rtol=1e-9, atol=1e-9)
    assert set(QUANTITIES) == {"pressure", "contacts", "speed", "radius"}
    for name in QUANTITIES:
        assert body_values(network, name).shape == (84,)


def test_every_other_kind_of_file(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "drop.toml"
    scene.write_text(DROP)
    assert (
        main(
            [
                "dem",
                str(scene),
                "-o",
                str(tmp_path / "drop.h5"),
                "--quiet",
                "--export",
                "plot",
                "--signs",
                "compression-positive",
            ]
        )
        == 0
    )
    assert "drop.plot.png" in capsys.readouterr().out
    assert (tmp_path / "drop.plot.png").read_bytes().startswith(b"\x89PNG")
    motion = read_run(tmp_path / "drop.h5")
    assert motion.kind == "motion"
    panels = axes_by_label(motion.plot(quantity="speed"))
    energy = next(axis for (x, y), axis in panels.items() if x == "time [s]" and y.startswith("energy ["))
    np.testing.assert_array_equal(energy.lines[0].get_xdata(), motion.content["frames"]["time"])
    profile = {"distance": np.array([0.0, 1e-2]), "height": np.array([5e-3, 0.0]), "angles": np.zeros(2)}
    quality = {"angle": 26.6, "angle_low": 25.0, "angle_high": 28.0}
    save_run(tmp_path / "heap.h5", {"assembly": run.content["assembly"], "profile": profile, "quality": quality}, {})
    heap = read_run(tmp_path / "heap.h5")
    assert heap.kind == "slope" and "26.6° (25.0° to 28.0°)" in heap.plot().get_suptitle()
    surface = axes_by_label(heap.plot())["distance from the axis [mm]", "height of the free surface [mm]"]
    np.testing.assert_allclose(surface.lines[0].get_xydata(), [[0.0, 5.0], [10.0, 0.0]])
    save_run(tmp_path / "half.h5", {"stage": 0, "state": {}, "assembly": run.content["assembly"]}, {})
    half = read_run(tmp_path / "half.h5")
    assert half.kind == "unfinished" and half.plot().get_suptitle().endswith("not finished")
    with pytest.raises(InputError, match="--resume"):
        _ = half.record
    save_run(tmp_path / "state.h5", {"assembly": run.content["assembly"]}, {})
    assert read_run(tmp_path / "state.h5").kind == "state"
    for words in ({"view": "xx"}, {"quantity": "colour"}, {"thickness": 0.0}, {"signs": "up"}):
        with pytest.raises(InputError, match=next(iter(words))):
            run.plot(**words)


def test_all_bodies_alike_still_have_a_scale() -> None:
    from matplotlib.figure import Figure

    from fenchel.dem.export.sample_panel import draw_sample

    for quantity in QUANTITIES:
        for network in (squeezed(7.0), replace(squeezed(0.0), velocity=np.zeros((1, 3)))):
            figure = Figure()
            draw_sample(figure, figure.subplots(), network, quantity=quantity)
            low, high = figure.axes[0].collections[0].get_clim()
            assert np.isfinite([low, high]).all() and low < high


def test_a_view_without_pyvista_says_what_to_install(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(InputError, match=r"pip install fenchel\[view\]") as said:
        run.view()
    assert "\n" not in str(said.value)
    with pytest.raises(InputError, match="quantity"):
        run.view(quantity="colour")


def test_a_view_with_pyvista(run: Run) -> None:
    plotter = run.view(show=False)
    assert [title.strip() for title in list(plotter.scalar_bars.keys())] == ["pressure of a body [kPa]"]
    assert plotter.screenshot(None, return_img=True).std() > 1.0


def test_reading_a_run_imports_no_drawing(run: Run) -> None:
    code = (
        f"import sys; from fenchel.dem import read_run; read_run({str(run.path)!r}); print('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
