"""The figure of a law: what is on it, that its words do not overlap, and what it refuses."""

from __future__ import annotations

import pickle
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from figure_words import assert_words_apart

from fenchel import cli
from fenchel.errors import InputError
from fenchel.potentials.library import ENTRIES, LAWS
from fenchel.potentials.surface import deviatoric, meridian

DRAWN = (
    "linear_elastic",
    "von_mises",
    "drucker_prager_cap",
    "norton",
    "perzyna",
    "kelvin_voigt",
    "thermo_elasto_plastic",
)


def values_of(name):
    return {**ENTRIES[name].values, **ENTRIES[name].worked.temperatures}


@cache
def plain(name, signs="tension-positive"):
    """Drawn once for the tests that read it."""
    return drawn(name, signs=signs)


def drawn(name, **options):
    return LAWS[name].plot(**options, **values_of(name))


def shear_history(count=40):
    """A path of von Mises in shear and back, by its closed form: pure shear, kinematic and isotropic hardening."""
    v = values_of("von_mises")
    mu, top = v["E"] / (2.0 * (1.0 + v["nu"])), 4e-3
    eps, plastic, total = np.linspace(0.0, top, count), 0.0, 0.0
    sig, p, back = np.zeros(count), np.zeros(count), np.zeros(count)
    for k, e in enumerate(eps):
        trial = 2.0 * mu * (e - plastic)
        chi = -2.0 / 3.0 * v["H_k"] * plastic
        f = np.sqrt(3.0) * abs(trial + chi) - v["H_i"] * total - v["sigma_y"]
        gamma = max(f, 0.0) / (3.0 * mu + v["H_k"] + v["H_i"])
        plastic += np.sqrt(3.0) / 2.0 * gamma
        total += gamma
        sig[k], p[k], back[k] = 2.0 * mu * (e - plastic), total, plastic
    shear = np.zeros((count, 6))
    shear[:, 5] = 2.0**0.5
    tensor = lambda a: shear * a[:, None]  # noqa: E731
    state = {"eps_p": tensor(back), "alpha": tensor(back), "p": p}
    return SimpleNamespace(eps=tensor(eps), sig=tensor(sig), state=state)


@pytest.mark.parametrize("name", DRAWN)
def test_no_words_overlap_or_leave_the_figure(name):
    figure = plain(name, "compression-positive" if name == "drucker_prager_cap" else "tension-positive")
    assert_words_apart(figure, 15)


def lines(ax, label):
    return next(line for line in ax.get_lines() if line.get_label() == label)


def test_the_curves_are_those_of_the_sections_and_axes_have_units():
    values = values_of("tresca")
    figure = plain("tresca")
    left, right, psi, star = figure.axes
    plane = deviatoric(LAWS["tresca"], values)
    shown = lines(right, "$f=0$").get_xydata() * 1e6
    assert np.nanmax(np.hypot(*shown.T)) == pytest.approx(np.sqrt(2.0 / 3.0) * 250e6, rel=1e-9)
    # the first axis up
    np.testing.assert_allclose(shown[0], [-plane.points[0, 1], plane.points[0, 0]], rtol=1e-9)
    assert "MPa" in left.get_xlabel() and "MPa" in left.get_ylabel() and "J_2" in left.get_ylabel()
    assert "MPa" in right.get_xlabel() and "%" in psi.get_xlabel() and "J/m³" in star.get_ylabel()
    line = lines(left, "$f=0$").get_xydata()
    assert np.isnan(line).any()  # the limit is left open
    assert "limit" in figure._supxlabel.get_text()


def test_compression_positive_reverses_the_axes():
    tension, compression = (drawn("rankine", signs=s) for s in ("tension-positive", "compression-positive"))
    for place in (0, 1):
        one, other = (lines(f.axes[place], "$f=0$").get_xydata() for f in (tension, compression))
        np.testing.assert_allclose(other[:, 0], -one[:, 0], atol=1e-9)
        np.testing.assert_allclose(other[:, 1], one[:, 1] if place == 0 else -one[:, 1], atol=1e-9)
    assert "p=-" in compression.axes[0].get_xlabel() and "mean stress" in tension.axes[0].get_xlabel()
    assert "compression +" in compression.axes[1].get_xlabel()


def test_a_path_ends_on_the_surface_that_it_hardened():
    figure = drawn("von_mises", history=shear_history())
    for ax in figure.axes[:2]:
        path, surface, virgin = (lines(ax, label).get_xydata() for label in ("path", "$f=0$", "virgin"))
        end = path[-1]
        near = np.nanmin(np.hypot(*(surface - end).T)) / np.nanmax(np.abs(surface))
        # the meridian of a cylinder is two lines, drawn by few points
        near = (
            np.nanmin(np.abs(surface[:, 1] - end[1])) / np.nanmax(np.abs(surface[:, 1]))
            if ax is figure.axes[0]
            else near
        )
        assert near < 1e-2
        assert np.hypot(*end) > np.nanmin(np.hypot(*virgin.T))
        np.testing.assert_allclose(path[0], 0.0, atol=1e-9)
    assert "principal axes" in figure._supxlabel.get_text()


def test_the_measure_of_the_ordinate_is_q_where_it_is_asked_for():
    top = [np.nanmax(lines(drawn("von_mises", measure=m).axes[0], "$f=0$").get_ydata()) for m in ("sqrt_J2", "q")]
    assert top[1] == pytest.approx(250.0) and top[1] / top[0] == pytest.approx(3.0**0.5)


def test_the_marked_point_keeps_fenchel_young():
    figure = plain("wire")
    assert len(figure.axes) == 2 and "elastic" in figure._supxlabel.get_text()
    (t, psi), (s, star) = (
        next(line for line in ax.get_lines() if line.get_marker() == "o" and len(line.get_xdata()) == 1).get_xydata()[0]
        for ax in figure.axes
    )
    # kPa and per cent
    assert psi + star == pytest.approx(s * 1e3 * t / 100.0, rel=1e-9)
    for ax, x, other in zip(figure.axes, (t, s), (star, psi), strict=True):
        dashed = next(line for line in ax.get_lines() if line.get_linestyle() == "--").get_xydata()
        assert dashed[0, 0] == 0.0 and dashed[1, 0] > x
        assert dashed[0, 1] == pytest.approx(-other, rel=1e-9)
    assert lines(figure.axes[0], "_child0").get_xydata()[:, 1].min() == 0.0


def test_laws_without_surface_are_drawn_by_level_sets_and_say_so():
    figure = plain("norton")
    labels = [line.get_label() for line in figure.axes[1].get_lines()]
    assert sum(label.startswith("φ* =") for label in labels) == 3
    assert "no surface" in figure._supxlabel.get_text()
    perzyna = plain("perzyna")
    shown = lines(perzyna.axes[1], "φ* = 0").get_xydata()
    np.testing.assert_allclose(np.hypot(*shown.T), np.sqrt(2.0 / 3.0) * 250.0, rtol=1e-9)


def test_a_state_is_drawn_with_the_virgin_surface_beside_it():
    figure = LAWS["von_mises"].plot(state={"p": 0.01}, **values_of("von_mises"))
    virgin, now = (np.nanmax(lines(figure.axes[1], label).get_xdata()) for label in ("virgin", "$f=0$"))
    assert now / virgin == pytest.approx((250.0 + 60.0) / 250.0, rel=1e-3)


def test_a_figure_shows_itself_in_a_notebook_and_can_be_pickled():
    figure = plain("linear_elastic")
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert len(pickle.loads(pickle.dumps(figure)).axes) == 2


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (dict(signs="soil"), "signs"),
        (dict(measure="tau"), "measure"),
        (dict(history=object()), "history"),
        (dict(history=shear_history(), state={}), "not both"),
        (dict(direction=(0,) * 6), "direction"),
        (dict(strain=-1.0), "strain"),
    ],
)
def test_wrong_input_is_told(options, word):
    with pytest.raises(InputError, match=word):
        LAWS["von_mises"].plot(**options, **values_of("von_mises"))


def test_a_missing_value_is_told():
    with pytest.raises(InputError, match="sigma_y"):
        LAWS["von_mises"].plot(E=1e9, nu=0.2, H_k=0.0, H_i=0.0)


# -- the command line --------------------------------------------------------------------------------------------------------------------

TRESCA = ["-p", "E=2e11", "-p", "nu=0.3", "-p", "sigma_y=3e8", "-p", "H_i=0"]


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_show_writes_the_figure_beside_the_table(tmp_path, capsys, kind):
    file = tmp_path / f"tresca.{kind}"
    assert cli.main(["show", "tresca", "--plot", str(file), *TRESCA]) == 0
    assert capsys.readouterr().out.startswith("tresca: strain formulation")
    assert file.read_bytes().startswith(b"\x89PNG" if kind == "png" else b"<?xml")


def test_show_refuses_what_has_no_meaning(tmp_path, capsys):
    assert cli.main(["show", "tresca", "--plot", str(tmp_path / "a.pdf"), *TRESCA]) == 2
    assert ".png or .svg" in capsys.readouterr().err
    assert cli.main(["show", "tresca", *TRESCA]) == 2
    assert "--plot" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    # only laws of the library have values of their own
    (tmp_path / "laws.py").write_text("from fenchel.potentials.library import tresca as own\n")
    assert cli.main(["show", f"{tmp_path / 'laws.py'}:own", "--plot", str(tmp_path / "a.png")]) == 2
    assert "have no value" in capsys.readouterr().err and not (tmp_path / "a.png").exists()


@pytest.mark.parametrize("name", ["tresca", "thermo_elasto_plastic"])
def test_a_law_of_the_library_is_drawn_with_its_values(tmp_path, capsys, name):
    entry = ENTRIES[name]
    given = [w for key, value in (entry.values | entry.worked.temperatures).items() for w in ("-p", f"{key}={value!r}")]
    assert cli.main(["show", name, "--plot", str(tmp_path / "one.svg"), *given]) == 0
    assert "values of the library" not in capsys.readouterr().err
    assert cli.main(["show", name, "--plot", str(tmp_path / "other.svg"), *given[:2]]) == 0
    err = capsys.readouterr().err
    assert "values of the library" in err and f"{given[1].partition('=')[0]} = " not in err
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()


def test_sections_are_the_same_wherever_the_package_is_asked_for_them():
    values = values_of("mohr_coulomb")
    one, other = (meridian(LAWS["mohr_coulomb"], values) for _ in range(2))
    np.testing.assert_array_equal(one.points, other.points)
