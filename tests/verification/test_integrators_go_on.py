"""A path that goes on from a history: the two pieces are the path in one piece, and consolidation then shear is its closed form."""

from __future__ import annotations

import numpy as np
import pytest

from fenchel import cli
from fenchel.errors import InputError
from fenchel.integrators import StrainStressPath, drive, read_history, read_path, write_history
from fenchel.potentials.library import ENTRIES, LAWS

CUT = 12


def strain_path(rows=30, seed=5):
    """Strains under full control, with shear and a return; temperatures beside them."""
    rng = np.random.default_rng(seed)
    eps = np.vstack([np.zeros(6), np.cumsum(rng.normal(size=(rows - 1, 6)), axis=0)])
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 2.0, rows - 1))])
    return eps, time


def pieces(name, size):
    entry = ENTRIES[name]
    eps, time = strain_path()
    eps = eps * size
    heat = None if entry.law.temperature is None else 300.0 + np.linspace(0.0, 20.0, len(eps))
    control = np.zeros(6, dtype=bool)
    cut = lambda a, s: None if a is None else a[s]  # noqa: E731
    whole = StrainStressPath(time, control, eps, temperature=heat)
    first = StrainStressPath(time[: CUT + 1], control, eps[: CUT + 1], temperature=cut(heat, slice(None, CUT + 1)))
    rest = StrainStressPath(time[CUT:], control, eps[CUT:] - eps[CUT], temperature=cut(heat, slice(CUT, None)))
    return entry.values, whole, first, rest


@pytest.mark.parametrize(("name", "size"), [("von_mises", 1e-3), ("texsol", 5e-4), ("norton", 1e-3), ("maxwell", 1e-3)])
@pytest.mark.parametrize("solver", ["auto", "general"])
def test_two_pieces_are_the_whole(name, size, solver):
    values, whole, first, rest = pieces(name, size)
    update = LAWS[name].compile("3d", solver=solver)
    one = drive(update, whole, values)
    begun = drive(update, first, values)
    found = drive(update, rest, values, after=begun)
    scale = np.abs(one.sig).max()
    np.testing.assert_allclose(found.eps, one.eps[CUT:], rtol=0, atol=1e-12 * np.abs(one.eps).max())
    np.testing.assert_allclose(found.sig, one.sig[CUT:], rtol=0, atol=1e-9 * scale)
    for variable, array in one.state.items():
        np.testing.assert_allclose(
            found.state[variable], array[CUT:], rtol=0, atol=1e-9 * max(np.abs(array).max(), 1e-30)
        )
    np.testing.assert_allclose(found.psi, one.psi[CUT:], rtol=1e-8, atol=1e-9 * np.abs(one.psi).max())
    np.testing.assert_allclose(
        found.dissipation, one.dissipation[CUT:], rtol=0, atol=1e-9 * max(one.dissipation.max(), 1e-30)
    )
    assert len(found.status) == len(whole.time) - CUT and not found.status.any()


def test_a_law_with_a_temperature_goes_on():
    values, whole, first, rest = pieces("thermo_elasto_plastic", 1e-3)
    update = LAWS["thermo_elasto_plastic"].compile("3d")
    one, begun = drive(update, whole, values), drive(update, first, values)
    found = drive(update, rest, values, after=begun)
    np.testing.assert_allclose(found.sig, one.sig[CUT:], rtol=0, atol=1e-9 * np.abs(one.sig).max())
    np.testing.assert_allclose(found.entropy, one.entropy[CUT:], rtol=1e-9)
    np.testing.assert_array_equal(found.temperature, whole.temperature[CUT:])


SAND = dict(E=12e6, nu=0.2, theta_f=0.3, C_0=500.0, H_i=1e4)
P_0 = 50e3


@pytest.fixture
def consolidated(tmp_path):
    ramp = np.linspace(0.0, 1.0, 6)
    np.savetxt(
        tmp_path / "consolidation.csv", np.stack([ramp, ramp * P_0], axis=1), delimiter=",", header="t,p", comments=""
    )
    return tmp_path


def axial(rows=41, end=0.02):
    return np.linspace(0.0, end, rows)


def write(folder, name, header, columns):
    file = folder / name
    np.savetxt(
        file, np.stack(np.broadcast_arrays(*columns), axis=1), delimiter=",", header=header, comments="", fmt="%.17g"
    )
    return file


@pytest.mark.parametrize("signs", ["tension-positive", "compression-positive"])
def test_drained_shear_after_consolidation_is_its_closed_form(consolidated, capsys, signs):
    s = -1.0 if signs == "tension-positive" else 1.0
    z = axial()
    shear = write(consolidated, "shear.csv", "t,sig_xx,sig_yy,eps_zz", (np.arange(len(z)), s * P_0, s * P_0, s * z))
    values = [word for name, value in SAND.items() for word in ("-p", f"{name}={value}")]
    first, second = str(consolidated / "c.out.csv"), str(consolidated / "s.out.csv")
    common = [*values, "--signs", signs]
    assert cli.main(["drive", "drucker_prager", str(consolidated / "consolidation.csv"), *common, "-o", first]) == 0
    assert cli.main(["drive", "drucker_prager", str(shear), *common, "--after", first, "-o", second]) == 0
    capsys.readouterr()
    found = read_history(second, LAWS["drucker_prager"], signs=signs)
    q = found.sig[:, 0] - found.sig[:, 2]
    # bilinear: elastic to the cone, then q rises by E H/(H + E a²) per axial strain, a = 1/√3 − t/3
    t = np.tan(SAND["theta_f"])
    a = 1.0 / np.sqrt(3.0) - t / 3.0
    q_y = (SAND["C_0"] + P_0 * t) / a
    slope = SAND["E"] * SAND["H_i"] / (SAND["H_i"] + SAND["E"] * a**2)
    expected = np.where(SAND["E"] * z < q_y, SAND["E"] * z, q_y + slope * (z - q_y / SAND["E"]))
    np.testing.assert_allclose(q, expected, rtol=0, atol=1e-7 * q.max())
    # strains are whole: those of the consolidation are in them, and its row is the first
    K = SAND["E"] / (3.0 * (1.0 - 2.0 * SAND["nu"]))
    np.testing.assert_allclose(found.eps[:, 2], -P_0 / (3.0 * K) - z, rtol=1e-9, atol=1e-15)
    assert q[0] == pytest.approx(0.0, abs=1e-7 * P_0)
    # the accumulated dissipation is C_0 p
    np.testing.assert_allclose(found.dissipation, SAND["C_0"] * found.state["p"], rtol=1e-8, atol=1e-9)


def test_undrained_shear_after_consolidation_keeps_the_volume(consolidated):
    law = LAWS["drucker_prager"]
    update = law.compile("3d")
    begun = drive(update, consolidated / "consolidation.csv", SAND)
    z = axial(end=0.01)
    found = drive(
        update, write(consolidated, "u.csv", "t,eps_v,eps_zz", (np.arange(len(z)), 0.0, -z)), SAND, after=begun
    )
    np.testing.assert_allclose(found.eps[:, :3].sum(axis=1), begun.eps[-1, :3].sum(), rtol=1e-10)
    G, K, t = SAND["E"] / (2 * (1 + SAND["nu"])), SAND["E"] / (3 * (1 - 2 * SAND["nu"])), np.tan(SAND["theta_f"])
    gamma = np.maximum(np.sqrt(3.0) * G * z - SAND["C_0"] - t * P_0, 0.0) / (G + K * t**2 + SAND["H_i"])
    q = 3.0 * G * (z - gamma / np.sqrt(3.0))
    np.testing.assert_allclose(found.sig[:, 0] - found.sig[:, 2], q, rtol=0, atol=1e-7 * q.max())
    np.testing.assert_allclose(-found.sig[:, :3].mean(axis=1), P_0 + K * t * gamma, rtol=1e-7)


@pytest.mark.parametrize(
    "name", ["von_mises", "texsol", "drucker_prager_cap", "thermo_elasto_plastic", "maxwell", "linear_elastic"]
)
@pytest.mark.parametrize("signs", ["tension-positive", "compression-positive"])
def test_a_history_reads_back_as_it_was_written(tmp_path, name, signs):
    values, whole, _, _ = pieces(name, 5e-4)
    found = drive(LAWS[name].compile("3d"), whole, values)
    write_history(tmp_path / "out.csv", found, whole.time, signs=signs)
    back = read_history(tmp_path / "out.csv", LAWS[name], signs=signs)
    for key in ("eps", "sig", "psi", "dissipation", "status", "temperature", "entropy"):
        one, other = getattr(found, key), getattr(back, key)
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_allclose(other, one, rtol=1e-15, atol=0)
    assert set(back.state) == set(found.state)
    for key, array in found.state.items():
        np.testing.assert_allclose(back.state[key], array, rtol=1e-15, atol=0)


@pytest.mark.parametrize(
    ("header", "columns", "said"),
    [
        ("t,sig_xx,sig_yy,eps_zz", (-P_0, -P_0 / 2, 0.0), "sig_yy = -25000 Pa, but the history that it goes on from ends at -50000 Pa"),
        ("t,eps_zz", (0.0,), "begins at sig_xx = 0 Pa"),
        ("t,p,eps_zz", (2 * P_0, 0.0), "begins at p = 100000 Pa, but the history ends at 50000 Pa"),
        ("t,sig_xx,sig_yy,eps_zz", (-P_0, -P_0, 1e-3), "strains count from there and must be zero"),
    ],
)  # fmt: skip
def test_a_path_that_does_not_begin_where_the_history_ends(consolidated, header, columns, said):
    update = LAWS["drucker_prager"].compile("3d")
    begun = drive(update, consolidated / "consolidation.csv", SAND)
    path = write(consolidated, "bad.csv", header, (np.arange(3), *columns))
    with pytest.raises(InputError, match=said):
        drive(update, path, SAND, after=begun)


def test_what_is_no_history_is_refused(consolidated, capsys):
    law = LAWS["drucker_prager"]
    begun = drive(law, consolidated / "consolidation.csv", SAND)
    shear = write(consolidated, "s.csv", "t,sig_xx,sig_yy,eps_zz", (np.arange(3), -P_0, -P_0, 0.0))
    with pytest.raises(InputError, match="two rows"):
        drive(law, write(consolidated, "one.csv", "t,p", ([0.0], P_0)), SAND, after=begun)
    with pytest.raises(InputError, match="not both"):
        drive(law, shear, SAND, initial_state=begun.state, after=begun)
    with pytest.raises(InputError, match="to go on from holds the state"):
        drive(LAWS["von_mises"], shear, ENTRIES["von_mises"].values, after=begun)
    write_history(consolidated / "out.csv", begun)
    with pytest.raises(InputError, match="no history of law 'von_mises'"):
        read_history(consolidated / "out.csv", LAWS["von_mises"])
    for text in ("", "t,eps_xx\n0,0\n", (consolidated / "out.csv").read_text().replace("0.0", "none")):
        (consolidated / "broken.csv").write_text(text)
        with pytest.raises(InputError, match="no history of law"):
            read_history(consolidated / "broken.csv", law)
    failed = (consolidated / "out.csv").read_text().splitlines()
    (consolidated / "failed.csv").write_text("\n".join([*failed[:-1], failed[-1][:-1] + "1"]) + "\n")
    with pytest.raises(InputError, match="has not converged"):
        read_history(consolidated / "failed.csv", law)
    command = ["drive", "drucker_prager", str(shear), *[w for n, v in SAND.items() for w in ("-p", f"{n}={v}")]]
    for more, said in (
        (["--after", "absent.csv"], "cannot be read"),
        (["--after", str(consolidated / "out.csv"), "--certify"], "leave --certify or --after out"),
        (["--after", str(consolidated / "out.csv"), "-o", str(consolidated / "out.csv")], "history before itself"),
    ):
        assert cli.main([*command, *more]) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and said in err


def test_times_may_begin_before_the_first_row():
    values = ENTRIES["maxwell"].values
    update = LAWS["maxwell"].compile("3d")
    from fenchel.integrators import drive_arrays

    targets = np.zeros((3, 6))
    targets[:, 5] = [1e-3, 1e-3, 2e-3]
    found = drive_arrays(update, [False] * 6, targets, values, times=[0.0, 0.5, 0.7, 1.7])
    mu = values["E"] / (2 * (1 + values["nu"]))
    stress, before = 0.0, 0.0
    for k, dt in enumerate((0.5, 0.2, 1.0)):  # one implicit step: σ = (σ_n + 2μ Δε)/(1 + μ dt/η)
        stress = (stress + 2 * mu * (targets[k, 5] - before)) / (1 + mu * dt / values["eta"])
        before = targets[k, 5]
        assert found.sig[k, 5] == pytest.approx(stress, rel=1e-12)


def test_a_path_without_virgin_row_is_read_only_when_it_goes_on(consolidated):
    file = write(consolidated, "s.csv", "t,sig_xx,sig_yy,eps_zz", (np.arange(3), -P_0, -P_0, 0.0))
    with pytest.raises(InputError, match="virgin state and must be zero"):
        read_path(file)
    assert read_path(file, virgin=False).targets[0, 0] == -P_0
