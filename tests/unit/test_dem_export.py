"""Exports, read back by code that shares nothing with the writer: parsers of the published formats, the library extxyz, and those of
ParaView and OVITO where they are installed.
"""

from __future__ import annotations

import base64
import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from fenchel.cli import main
from fenchel.dem import Assembly, Drive, Material, Simulation, Solver
from fenchel.dem.export import (
    VtkSeries,
    draw_networks,
    export_run,
    network_of_run,
    write_extended_xyz,
    write_picture,
    write_vtk,
)
from fenchel.dem.measures import Network
from fenchel.dem.packing import densify
from fenchel.dem.storage import load_run, save_run
from fenchel.errors import InputError


@pytest.fixture(scope="module")
def network() -> Network:
    rng = np.random.default_rng(5)
    a = densify(rng, rng.uniform(0.75e-3, 1.39e-3, 60), wire_count=4, beads=6, spacing=1.07e-3, bead_radius=0.43e-3)
    law = Material(friction=0.4, bead_friction=0.3, normal_stiffness=4.3e4, tangential_stiffness=3.4e4)
    simulation = Simulation(a, law, Solver(tolerance=1e-4))
    for _ in range(40):
        simulation.advance(2.4e-5, Drive(pressure=np.full(3, 5e4)))
    return Network.of_simulation(simulation)


@pytest.fixture(scope="module")
def flat() -> Network:
    """Three disks under gravity between the walls of a box, in the plane."""
    x = np.array([[-1.0, -2.0], [1.0, -2.0], [0.0, -2.0 + np.sqrt(3.0)]])
    a = Assembly.of_spheres(1e-3 * x, np.full(3, 1e-3), np.full(3, 1e-3), np.array([2e-3, 3e-3]))
    simulation = Simulation(a, Material(friction=0.5), Solver(tolerance=1e-8))
    drive = Drive(pressure=np.zeros(2), rate=np.zeros(2), gravity=np.array([0.0, -9.81]))
    for _ in range(3):
        simulation.advance(1e-4, drive)
    return Network.of_simulation(simulation)


# --- VTK


def read_poly_data(file: Path) -> tuple[dict[str, int], dict[str, dict[str, np.ndarray]]]:
    """Numbers of the piece, and the arrays by section: after the description of the format, not after the writer."""
    root = ET.parse(file).getroot()
    assert root.attrib["type"] == "PolyData" and root.attrib["byte_order"] == "LittleEndian"
    assert root.attrib["header_type"] == "UInt64"
    (data,) = root
    piece = data.find("Piece")
    assert piece is not None
    numbers = {key: int(value) for key, value in piece.attrib.items()}
    sections: dict[str, dict[str, np.ndarray]] = {}
    for section in (*piece, *data.findall("FieldData")):
        arrays = sections.setdefault(section.tag, {})
        for array in section:
            code = {"Float64": "<f8", "Int64": "<i8"}[array.attrib["type"]]
            text = (array.text or "").strip()
            if array.attrib["format"] == "ascii":
                values = np.array(text.split(), dtype=code)
            else:
                raw = base64.b64decode(text, validate=True)
                (size,) = np.frombuffer(raw[:8], dtype="<u8")
                assert size == len(raw) - 8
                values = np.frombuffer(raw[8:], dtype=code)
            parts = int(array.attrib.get("NumberOfComponents", 1))
            arrays[array.attrib["Name"]] = values.reshape(-1, parts) if parts > 1 else values
    return numbers, sections


def cells(section: dict[str, np.ndarray]) -> list[list[int]]:
    ends = section["offsets"].tolist()
    assert not ends or ends[-1] == len(section["connectivity"])
    return [section["connectivity"][a:b].tolist() for a, b in pairwise([0, *ends])]


def test_bodies_as_points(network: Network, tmp_path: Path) -> None:
    files = write_vtk(network, tmp_path / "state")
    assert [f.name for f in files] == ["state.bodies.vtp", "state.contacts.vtp", "state.wires.vtp"]
    numbers, found = read_poly_data(files[0])
    n = len(network.x)
    assert numbers == {
        "NumberOfPoints": n,
        "NumberOfVerts": n,
        "NumberOfLines": 0,
        "NumberOfStrips": 0,
        "NumberOfPolys": 0,
    }
    np.testing.assert_array_equal(found["Points"]["Points"], network.x)
    assert cells(found["Verts"]) == [[k] for k in range(n)] and cells(found["Lines"]) == []
    data = found["PointData"]
    np.testing.assert_array_equal(data["radius"], network.radius)
    np.testing.assert_array_equal(data["velocity"], network.velocity)
    np.testing.assert_array_equal(data["phase"], (network.wire >= 0).astype(int))
    np.testing.assert_array_equal(data["wire"], network.wire)
    np.testing.assert_array_equal(data["rank"], network.rank)
    assert data["contacts"].sum() == 2 * len(network.pair) + len(network.wall)
    assert found["FieldData"]["TimeValue"] == [network.time]


def test_forces_and_tensions_as_lines(network: Network, tmp_path: Path) -> None:
    files = write_vtk(network, tmp_path / "state")
    numbers, found = read_poly_data(files[1])
    m, w = len(network.pair), len(network.wall)
    assert m > 50 and w > 10 and numbers["NumberOfLines"] == m + w and numbers["NumberOfVerts"] == 0
    points, lines, data = found["Points"]["Points"], cells(found["Lines"]), found["CellData"]
    assert lines[:m] == network.pair.tolist()
    np.testing.assert_array_equal(data["normal_force"][:m], network.normal_force)
    force = network.normal_force[:, None] * network.normal + network.tangential_force
    np.testing.assert_allclose(data["force"][:m], force, rtol=1e-14)
    np.testing.assert_allclose(
        np.linalg.norm(data["force"], axis=1) ** 2, data["normal_force"] ** 2 + data["tangential_force"] ** 2
    )
    assert set(data["kind"].tolist()) <= {0, 1, 2, 3} and np.sum(data["kind"] == 3) == w
    assert 0.9 < data["mobilised"].max() <= 1.0 + 1e-12
    # a line to a wall ends on the wall, up to the depth of the contact, and the wall pushes along it
    for line, force in zip(lines[m:], data["force"][m:], strict=True):
        body, end = points[line[0]], points[line[1]]
        axis = int(np.argmax(np.abs(force)))
        assert np.abs(end[axis]) == pytest.approx(network.half[axis], rel=0.02)
        assert np.dot(force, body - end) == pytest.approx(np.linalg.norm(force) * np.linalg.norm(body - end))
    numbers, found = read_poly_data(files[2])
    assert cells(found["Lines"]) == network.link.tolist() and numbers["NumberOfLines"] == 20
    np.testing.assert_array_equal(found["CellData"]["tension"], network.tension)
    np.testing.assert_array_equal(found["CellData"]["wire"], np.repeat(np.arange(4), 5))
    np.testing.assert_allclose(found["CellData"]["length"], network.link_length)


def test_a_plane_sample_lies_in_the_plane(flat: Network, tmp_path: Path) -> None:
    files = write_vtk(flat, tmp_path / "flat")
    assert len(files) == 2  # no wires
    _, bodies = read_poly_data(files[0])
    np.testing.assert_array_equal(bodies["Points"]["Points"], np.column_stack([flat.x, np.zeros(3)]))
    _, contacts = read_poly_data(files[1])
    assert len(flat.pair) >= 2 and contacts["CellData"]["force"].shape[1] == 3
    assert np.all(contacts["CellData"]["force"][:, 2] == 0.0)
    block = write_extended_xyz(flat, tmp_path / "flat.xyz").read_text().splitlines()
    assert len(block) == 5 and all(line.split()[3] == "0" for line in block[2:])


def test_a_sample_without_forces_is_exported_too(tmp_path: Path) -> None:
    a = Assembly.of_spheres(np.zeros((1, 3)), np.ones(1), np.ones(1))
    network = Network.of_assembly(a)
    numbers, _ = read_poly_data(write_vtk(network, tmp_path / "one")[1])
    assert numbers["NumberOfLines"] == 0
    text = write_extended_xyz(network, tmp_path / "one.xyz").read_text()
    assert "Lattice" not in text and text.startswith("1\n")
    assert write_picture(network, tmp_path / "one.png").stat().st_size > 1000


def test_a_series_is_a_collection_of_instants(network: Network, tmp_path: Path) -> None:
    series = VtkSeries(tmp_path / "run")
    for time in (0.0, 0.25, 1e-7):
        series.add(replace(network, time=time))
    for kind in ("bodies", "contacts", "wires"):
        root = ET.parse(tmp_path / f"run.{kind}.pvd").getroot()
        sets = root.findall("Collection/DataSet")
        assert [float(s.attrib["timestep"]) for s in sets] == [0.0, 0.25, 1e-7]
        for s in sets:
            numbers, found = read_poly_data(tmp_path / s.attrib["file"])
            assert found["FieldData"]["TimeValue"] == [float(s.attrib["timestep"])] and numbers["NumberOfPoints"] > 0


def test_the_library_of_paraview_reads_it(network: Network, flat: Network, tmp_path: Path) -> None:
    import vtk  # pyright: ignore[reportMissingImports]
    from vtk.util.numpy_support import vtk_to_numpy  # pyright: ignore[reportMissingImports]

    for state in (network, flat):
        for file in write_vtk(state, tmp_path / "state"):
            reader = vtk.vtkXMLPolyDataReader()
            reader.SetFileName(str(file))
            reader.Update()
            assert reader.GetErrorCode() == 0
            data = reader.GetOutput()
            numbers, found = read_poly_data(file)
            assert (
                data.GetNumberOfPoints() == numbers["NumberOfPoints"]
                and data.GetNumberOfLines() == numbers["NumberOfLines"]
            )
            np.testing.assert_array_equal(vtk_to_numpy(data.GetPoints().GetData()), found["Points"]["Points"])
            for where, get in (("PointData", data.GetPointData()), ("CellData", data.GetCellData())):
                assert get.GetNumberOfArrays() == len(found[where])
                for name, values in found[where].items():
                    np.testing.assert_array_equal(vtk_to_numpy(get.GetArray(name)), values)


# --- extended XYZ


def read_extended_xyz(file: Path) -> list[tuple[dict[str, str], dict[str, np.ndarray]]]:
    """Blocks of (keys, columns) after the description of the format."""
    lines = file.read_text().splitlines()
    blocks = []
    while lines:
        count, head = int(lines[0]), lines[1]
        keys = {a: b or c for a, b, c in re.findall(r'(\w+)=(?:"([^"]*)"|(\S+))', head)}
        rows = [line.split() for line in lines[2 : 2 + count]]
        columns, at = {}, 0
        fields = keys["Properties"].split(":")
        for name, kind, width in zip(fields[::3], fields[1::3], map(int, fields[2::3]), strict=True):
            read = {"S": str, "R": float, "I": int}[kind]
            values = np.array([[read(word) for word in row[at : at + width]] for row in rows])
            columns[name] = values[:, 0] if width == 1 else values
            at += width
        assert all(len(row) == at for row in rows)
        blocks.append((keys, columns))
        lines = lines[2 + count :]
    return blocks


def test_extended_xyz_holds_the_bodies_to_the_last_bit(network: Network, tmp_path: Path) -> None:
    moved = replace(network, x=network.x + 1e-4, time=2.0, fixed=np.arange(len(network.x)) == 0)
    blocks = read_extended_xyz(write_extended_xyz([network, moved], tmp_path / "run.xyz"))
    assert len(blocks) == 2
    for (keys, columns), state in zip(blocks, (network, moved), strict=True):
        np.testing.assert_array_equal(columns["pos"], state.x)
        np.testing.assert_array_equal(columns["radius"], state.radius)
        np.testing.assert_array_equal(columns["velo"], state.velocity)
        np.testing.assert_array_equal(columns["wire"], state.wire)
        np.testing.assert_array_equal(columns["rank"], state.rank)
        np.testing.assert_array_equal(columns["id"], np.arange(len(state.x)) + 1)
        assert columns["contacts"].sum() == 2 * len(state.pair) + len(state.wall)
        lattice = np.array(keys["Lattice"].split(), dtype=float).reshape(3, 3)
        np.testing.assert_array_equal(lattice, np.diag(2.0 * state.half))
        np.testing.assert_array_equal(np.array(keys["Origin"].split(), dtype=float), -state.half)
        assert float(keys["Time"]) == state.time and keys["pbc"] == "F F F"
    assert blocks[0][1]["species"].tolist() == ["grain"] * 60 + ["bead"] * 24 and blocks[1][1]["species"][0] == "fixed"


@pytest.mark.parametrize("parser", ["C", "Python"])
def test_the_library_of_the_format_reads_it(network: Network, flat: Network, tmp_path: Path, parser: str) -> None:
    """extxyz, by the authors of the specification: its two parsers, one generated from the grammar, share nothing with the writer."""
    import extxyz

    states = [network, replace(network, time=2.0, fixed=np.arange(len(network.x)) == 3)]
    file = write_extended_xyz(states, tmp_path / "run.xyz")
    frames = extxyz.read_dicts(file, use_cextxyz=parser == "C")
    assert len(frames) == 2
    for frame, state in zip(frames, states, strict=True):
        assert frame.natoms == len(state.x) and frame.info["Time"] == state.time and not np.any(frame.pbc)
        np.testing.assert_array_equal(frame.cell, np.diag(2.0 * state.half))
        np.testing.assert_array_equal(frame.info["Origin"], -state.half)
        for name, values in {
            "pos": state.x, "radius": state.radius, "velo": state.velocity, "wire": state.wire, "rank": state.rank,
        }.items():  # fmt: skip
            np.testing.assert_array_equal(frame.arrays[name], values, err_msg=name)
        assert frame.arrays["contacts"].sum() == 2 * len(state.pair) + len(state.wall)
        assert frame.arrays["species"].tolist() == [
            "fixed" if held else "bead" if bead else "grain"
            for held, bead in zip(state.fixed, state.is_bead, strict=True)
        ]
    plane = extxyz.read_dicts(write_extended_xyz(flat, tmp_path / "flat.xyz"), use_cextxyz=parser == "C")
    np.testing.assert_array_equal(plane.arrays["pos"], np.column_stack([flat.x, np.zeros(3)]))
    # a state by itself has no box, and no lattice
    loose = write_extended_xyz(replace(network, half=np.full(3, np.inf)), tmp_path / "loose.xyz")
    assert not np.any(extxyz.read_dicts(loose, use_cextxyz=parser == "C").cell)


def test_ovito_reads_it(network: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    io = pytest.importorskip(
        "ovito.io", reason="ovito is not installed: it is too large for the locks; see the tests without it"
    )
    file = write_extended_xyz([network, replace(network, time=1.0)], tmp_path / "run.xyz")
    pipeline = io.import_file(str(file))
    assert pipeline.source.num_frames == 2
    data = pipeline.compute(0)
    order = np.argsort(data.particles["Particle Identifier"][...])
    np.testing.assert_allclose(
        data.particles["Position"][...][order], network.x, rtol=1e-15
    )  # read by a parser of its own
    np.testing.assert_allclose(data.particles["Radius"][...][order], network.radius)
    np.testing.assert_allclose(data.particles["Velocity"][...][order], network.velocity, rtol=1e-15)
    assert {t.name for t in data.particles.particle_types.types} == {"grain", "bead"}
    np.testing.assert_allclose(np.diag(data.cell[:3, :3]), 2.0 * network.half)
    np.testing.assert_allclose(data.cell[:3, 3], -network.half)


# --- pictures


def test_a_picture_has_axes_with_units_and_a_line_per_force(network: Network, tmp_path: Path) -> None:
    figure = draw_networks(network, thickness=1.0)
    contacts, wires, *bars = figure.axes
    assert contacts.get_xlabel() == "x [mm]" and contacts.get_ylabel() == "z [mm]" and wires.get_xlabel() == "x [mm]"
    units = [re.search(r"\[(\w?N)\]", bar.get_ylabel()) for bar in bars]
    assert len(bars) == 2 and all(units)
    scale = {"N": 1.0, "mN": 1e3, "µN": 1e6}[units[0][1]]  # pyright: ignore[reportOptionalSubscript]
    lines = [c for c in contacts.collections if hasattr(c, "get_segments")]
    seen = np.abs(network.wall_normal[:, 1]) < 0.5
    assert len(lines[0].get_segments()) == len(network.pair) + int(seen.sum())
    force = np.append(network.normal_force, network.wall_force[seen])
    np.testing.assert_allclose(np.sort(lines[0].get_array()), scale * np.sort(force))
    drawn = sum(len(c.get_segments()) for c in wires.collections)
    assert drawn == len(network.link)
    low, high = contacts.get_xlim()
    assert (
        low < 1e3 * (network.x[:, 0] - network.radius).min() and high > 1e3 * (network.x[:, 0] + network.radius).max()
    )
    # lying samples stand one above the other
    lying = replace(network, x=network.x * np.array([3.0, 1.0, 0.5]), half=np.full(3, np.inf))
    top, bottom = draw_networks(lying).axes[:2]
    assert top.get_ylabel() == bottom.get_ylabel() == "z [mm]" and bottom.get_xlabel() == "x [mm]"
    # a thin slice holds fewer
    thin = next(c for c in draw_networks(network).axes[0].collections if hasattr(c, "get_segments"))
    off = network.x[:, 1] - 0.5 * (network.x[:, 1].min() + network.x[:, 1].max())
    half = 2.0 * network.grain_radius
    inside = np.sum(np.abs(off[network.pair].mean(axis=1)) <= half) + np.sum(np.abs(off[network.wall[seen, 0]]) <= half)
    assert 0 < len(thin.get_segments()) == inside < len(lines[0].get_segments())
    assert draw_networks(network, view="yz").axes[0].get_xlabel() == "y [mm]"
    one, two = (write_picture(network, tmp_path / f"{k}.svg").read_bytes() for k in "ab")
    assert len(one) == len(two) and b"<svg" in one
    assert write_picture(network, tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_that_cannot_be_drawn(network: Network, flat: Network, tmp_path: Path) -> None:
    for view in ("xx", "z", "xyz", "north"):
        with pytest.raises(InputError, match="two different axes"):
            draw_networks(network, view=view)
    with pytest.raises(InputError, match="endings"):
        write_picture(network, tmp_path / "picture.vtp")
    assert not list(tmp_path.iterdir())
    assert draw_networks(flat).axes[0].get_ylabel() == "y [mm]"
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="choose another place"):
        write_vtk(network, tmp_path / "taken" / "run")


# --- from run files and from the command line

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
strain_path = [0.0, -1e-3]
inertial_number = 2e-3
"""


def test_the_command_exports_now_or_later(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, run = tmp_path / "scene.toml", tmp_path / "run.h5"
    scene.write_text(SCENE)

    def call(*more: str) -> str:
        assert main(["dem", str(scene), "-o", str(run), "--quiet", *more]) == 0
        return capsys.readouterr().out

    assert "exported" in call("--export", "xyz")
    before = run.read_bytes()
    told = json.loads(call("--resume", "--json", "--export", "vtk", "--export", "picture"))
    assert run.read_bytes() == before  # read, not run again
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == [
        "run.bodies.vtp", "run.contacts.vtp", "run.h5", "run.png", "run.wires.vtp", "run.xyz", "scene.toml",
    ]  # fmt: skip
    assert [Path(p).name for p in told["exports"]] == ["run.bodies.vtp", "run.contacts.vtp", "run.wires.vtp", "run.png"]
    network = network_of_run(run)
    content, _ = load_run(run)
    ((_, columns),) = read_extended_xyz(tmp_path / "run.xyz")
    np.testing.assert_array_equal(columns["pos"], network.x)
    np.testing.assert_allclose(network.x, content["assembly"]["x"], atol=1e-6)
    assert set(np.unique(network.friction)) == {0.2, 0.35}
    import extxyz

    frame, stored = extxyz.read_dicts(tmp_path / "run.xyz"), content["assembly"]
    # places are those at which the contacts were detected, a step before the end
    np.testing.assert_allclose(frame.arrays["pos"], stored["x"] - stored["step"] * stored["velocity"], rtol=1e-14)
    for name in ("radius", "wire", "rank"):
        np.testing.assert_array_equal(frame.arrays[name], stored[name], err_msg=name)
    assert frame.info["Time"] == stored["time"]
    _, found = read_poly_data(tmp_path / "run.contacts.vtp")
    assert 0.9 < found["CellData"]["mobilised"].max() <= 1.0 + 1e-9
    assert main(["dem", str(scene), "-o", str(run), "--resume", "--quiet", "--export", "stl"]) == 2
    assert "picture" in capsys.readouterr().err


def test_a_run_that_goes_on_is_exported_and_results_without_sample_are_refused(tmp_path: Path) -> None:
    from fenchel.dem.preparation import make_sample, preparation
    from fenchel.dem.scene import Grains, Sample, SceneSolve

    grains = Grains(count=40, normal_stiffness=4.3e4)
    a = make_sample(grains, None, Sample(), 1)
    stage = preparation(grains, None, Sample(), SceneSolve(), 5e4)[0](a)
    for _ in range(30):
        stage.advance()
    save_run(tmp_path / "half.h5", {"stage": 0, "state": stage.state(), "assembly": a.arrays()}, {"scene": {}})
    (file,) = export_run(tmp_path / "half.h5", "xyz")
    ((_, columns),) = read_extended_xyz(file)
    assert columns["contacts"].sum() > 40
    save_run(tmp_path / "results.h5", {"a": np.zeros(3)}, {})
    with pytest.raises(InputError, match="no sample"):
        export_run(tmp_path / "results.h5", "vtk")
    with pytest.raises(InputError, match="vtk, xyz, picture, plot"):
        export_run(tmp_path / "half.h5", "stl")  # pyright: ignore[reportArgumentType]


def test_a_motion_is_exported_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, run = tmp_path / "drop.toml", tmp_path / "drop.h5"
    scene.write_text("""
[motion]
duration = 2e-2
step = 1e-3
gravity = [0.0, 0.0, -9.81]
[[body]]
position = [0.0, 0.0, 1.01e-2]
radius = 1e-2
mass = 1e-2
[[plane]]
normal = [0.0, 0.0, 1.0]
point = [0.0, 0.0, 0.0]
""")
    assert main(["dem", str(scene), "-o", str(run), "--quiet", "--json", "--export", "vtk", "--export", "xyz"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["measures"]["grain_wall"] == 1 and told["measures"]["active_length"] is None
    ((keys, columns),) = read_extended_xyz(tmp_path / "drop.xyz")
    assert "Lattice" not in keys and columns["contacts"] == [1] and len(told["exports"]) == 3
