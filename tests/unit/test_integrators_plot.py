"""The figure of a path: its curves are the columns of the history, with units, under either convention of signs."""

from __future__ import annotations

import numpy as np
import pytest
from figure_words import assert_words_apart

from fenchel import cli
from fenchel.errors import InputError
from fenchel.integrators.history import History

ROWS = 30


def history(seed=3, **changes):
    """Any numbers: nothing that is drawn may depend on a law."""
    rng = np.random.default_rng(seed)
    walk = lambda size: np.cumsum(rng.normal(size=(ROWS, 6)), axis=0) * size  # noqa: E731
    arrays = {"eps": walk(1e-4), "sig": walk(5e3), "state": {"p": np.zeros(ROWS)}}
    arrays |= {
        "psi": rng.random(ROWS) * 40,
        "dissipation": np.cumsum(rng.random(ROWS)),
        "status": np.zeros(ROWS, dtype=int),
    }
    return History(**(arrays | changes))


def curves(panel):
    return [line.get_xydata() for line in panel.get_lines() if len(line.get_xdata()) == ROWS]


@pytest.mark.parametrize("signs", ["tension-positive", "compression-positive"])
@pytest.mark.parametrize("measure", ["q", "sqrt_J2"])
@pytest.mark.parametrize(("component", "place", "plain"), [("11", 0, 1.0), ("33", 2, 1.0), ("12", 5, 2**-0.5)])
def test_the_curves_are_the_columns(signs, measure, component, place, plain):
    found = history()
    figure = found.plot(component=component, measure=measure, signs=signs, title="a path")
    sign = 1.0 if signs == "tension-positive" else -1.0
    stress, path, volume, energy = figure.axes
    ((x, y),) = (c.T for c in curves(stress))
    np.testing.assert_allclose(x, sign * 100.0 * plain * found.eps[:, place], rtol=1e-12)
    np.testing.assert_allclose(y, sign * plain * found.sig[:, place] / 1e3, rtol=1e-12)
    ((x, y),) = (c.T for c in curves(path))
    s = found.sig
    # J₂ by the differences of the normal stresses and the shear, not by the norm of the deviator
    j2 = ((s[:, 0] - s[:, 1]) ** 2 + (s[:, 1] - s[:, 2]) ** 2 + (s[:, 2] - s[:, 0]) ** 2) / 6 + (s[:, 3:] ** 2).sum(
        axis=1
    ) / 2
    np.testing.assert_allclose(x, sign * s[:, :3].sum(axis=1) / 3e3, rtol=1e-12)
    np.testing.assert_allclose(y, np.sqrt((3.0 if measure == "q" else 1.0) * j2) / 1e3, rtol=1e-12)
    ((x, y),) = (c.T for c in curves(volume))
    np.testing.assert_allclose(y, sign * 100.0 * found.eps[:, :3].sum(axis=1), rtol=1e-12)
    (x, stored), (again, lost) = (c.T for c in curves(energy))
    np.testing.assert_allclose(stored, found.psi, rtol=1e-12)
    np.testing.assert_allclose(lost, found.dissipation, rtol=1e-12)
    np.testing.assert_allclose(np.diff(x), 100.0 * np.sqrt((np.diff(found.eps, axis=0) ** 2).sum(axis=1)), rtol=1e-12)
    np.testing.assert_array_equal(x, again)
    said = " ".join(a.get_xlabel() + a.get_ylabel() for a in figure.axes)
    assert said.count("[kPa]") == 3 and said.count("[%]") == 4 and "[J/m³]" in said
    assert (r"\sqrt{3J_2}" in path.get_ylabel()) == (measure == "q")
    assert ("contraction +" in volume.get_ylabel()) == (sign < 0) and ("p=-" in path.get_xlabel()) == (sign < 0)
    assert_words_apart(figure, 25)


def test_the_component_that_moves_most_is_drawn():
    eps = np.zeros((ROWS, 6))
    eps[:, 2] = np.linspace(0.0, -1e-3, ROWS)
    eps[:, 5] = np.linspace(0.0, 1e-3, ROWS) * 2**0.5  # as much shear, without the factor of Mandel
    assert "{33}" in history(eps=eps).plot().axes[0].get_xlabel()
    eps[:, 5] *= 1.01
    assert "{12}" in history(eps=eps).plot().axes[0].get_xlabel()
    still = history(eps=np.zeros((ROWS, 6)), sig=np.zeros((ROWS, 6)), psi=np.zeros(ROWS), dissipation=np.zeros(ROWS))
    assert "{33}" in still.plot().axes[0].get_xlabel()


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ({"component": "zz"}, "component = 'zz'"),
        ({"measure": "J2"}, "measure = 'J2'"),
        ({"signs": "soil"}, 'signs = "soil"'),
    ],
)
def test_unknown_words_are_refused(option, said):
    with pytest.raises(InputError, match=said) as reason:
        history().plot(**option)
    assert "use" in str(reason.value)


def test_a_notebook_shows_the_figure():
    assert history().plot()._repr_png_().startswith(b"\x89PNG")


def test_the_command_line_draws_what_it_drives(tmp_path, capsys):
    path = tmp_path / "path.csv"
    path.write_text("t,eps_zz\n0,0\n1,0.001\n2,0.002\n")
    values = ["-p", "E=2e11", "-p", "nu=0.3", "-p", "sigma_y=2e8", "-p", "H_k=0", "-p", "H_i=1e9"]
    for kind, head in (("svg", b"<?xml"), ("png", b"\x89PNG")):
        file = tmp_path / f"path.{kind}"
        assert (
            cli.main(["drive", "von_mises", str(path), *values, "--plot", str(file), "--signs", "compression-positive"])
            == 0
        )
        assert file.read_bytes().startswith(head)
    capsys.readouterr()
    assert cli.main(["drive", "von_mises", "missing.csv", "--plot", str(tmp_path / "path.jpg")]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "write --plot path.png" in err
