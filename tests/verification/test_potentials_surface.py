"""Sections of elastic domains against the inequalities written a second time, and ψ beside ψ* against closed forms.

Provenance: every f below is the textbook formula of the law in principal stresses or invariants (numpy, no declaration); corner radii of
Tresca and Mohr–Coulomb, the radius of von Mises, apexes and caps are closed forms; ρψ* of linear elasticity is p²/(2K) + J₂/(2G).
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from fenchel.errors import DeclarationError, InputError
from fenchel.potentials import Law, dev, forces, indicator, inner, isotropic, norm, parameters, sym_tensor, tr
from fenchel.potentials.energy_pair import energy_pair
from fenchel.potentials.library import ENTRIES, LAWS
from fenchel.potentials.surface import COMPRESSION, deviator, deviatoric, meridian

BAND = 1e-9
CHORD = 1e-3
SQRT2 = 2.0**0.5


# -- the inequalities, once more ---------------------------------------------------------------------------------------------------


def matrices(a):
    found = np.zeros((len(a), 3, 3))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        found[:, i, j] = found[:, j, i] = a[:, k] / (1.0 if k < 3 else SQRT2)
    return found


def principal(a):
    """Ascending."""
    return np.linalg.eigvalsh(matrices(a))


def mean(a):
    return a[:, :3].sum(axis=1) / 3.0


def root_j2(a):
    shear = a - mean(a)[:, None] * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    return np.sqrt((shear**2).sum(axis=1) / 2.0)


def f_von_mises(a, v, s):
    moved = a - 2.0 / 3.0 * v["H_k"] * s["alpha"]
    return np.sqrt(3.0) * root_j2(moved) - v["H_i"] * s["p"] - v["sigma_y"]


def f_thermal(a, v, s):
    return np.sqrt(3.0) * root_j2(a) - v["H_i"] * s["p"] - v["sigma_y"]


def f_tresca(a, v, s):
    e = principal(a)
    return e[:, 2] - e[:, 0] - v["H_i"] * s["p"] - v["sigma_y"]


def f_cone(a, v, s):
    return root_j2(a) + np.tan(v["theta_f"]) * mean(a) - v["H_i"] * s["p"] - v["C_0"]


def f_cap(a, v, s):
    over = np.maximum(-mean(a) - v["L"], 0.0)
    cap = np.sqrt(root_j2(a) ** 2 + (v["r"] * over) ** 2) - v["r"] * (v["W"] + v["H_c"] * s["v"])
    return np.maximum(f_cone(a, v, s), cap)


def f_mobilised(a, v, s):
    low, high = np.tan(v["theta_0"]), np.tan(v["theta_f"])
    t = low + (high - low) * s["p"] / (s["p"] + v["p_m"])
    return root_j2(a) + t * mean(a) - v["H_i"] * s["p"] - v["C_0"]


def f_mohr(a, v, s):
    e, sine = principal(a), np.sin(v["phi"])
    half, centre = (e[:, 2] - e[:, 0]) / 2.0, (e[:, 2] + e[:, 0]) / 2.0
    return half + centre * sine - v["H_i"] * s["p"] - v["c"] * np.cos(v["phi"])


def f_rankine(a, v, s):
    return principal(a)[:, 2] - v["H_i"] * s["p"] - v["sigma_t"]


def f_clay(a, v, s):
    """The ellipse q²/M² = P (P_c − P) itself, as its gauge would be: its sign only."""
    end, pressure = 2.0 * (v["a"] + v["H_i"] * s["p"]), -mean(a)
    return 3.0 * root_j2(a) ** 2 / v["M"] ** 2 - pressure * (end - pressure)


def f_sand(a, v, s):
    moved = a - v["H_k"] * s["alpha"]
    return root_j2(moved) + np.tan(v["theta_f"]) * mean(moved) - v["H_i"] * s["p"] - v["C_0"]


def f_sand_k2(a, v, s):
    moved = a - v["H_k"] * s["alpha"]
    return root_j2(moved) + np.tan(v["theta_f"]) * mean(a) - v["H_i"] * s["p"] - v["C_0"]


TRUTH = {
    "von_mises": f_von_mises,
    "tresca": f_tresca,
    "drucker_prager": f_cone,
    "drucker_prager_cap": f_cap,
    "mobilised_friction": f_mobilised,
    "mohr_coulomb": f_mohr,
    "rankine": f_rankine,
    "cam_clay": f_clay,
    "sand": f_sand,
    "sand_k2": f_sand_k2,
    "reinforced_sand": f_sand,
    "texsol": f_sand,
    "texsol_k2": f_sand_k2,
    "thermo_elasto_plastic": f_thermal,
}


def test_every_law_of_the_library_with_a_surface_is_here():
    assert set(TRUTH) == {name for name, law in LAWS.items() if law.surfaces}


def settings(name, hardened):
    """Values, and a state: hardening and a back stress of a third of the yield stress; the same state with zeros for the formulas."""
    entry = ENTRIES[name]
    values = {**entry.values, **entry.worked.temperatures}
    known = {v.name for v in entry.law.internal}
    zero = {"p": 0.0, "v": 0.0, "alpha": np.zeros(6)}
    if not hardened:
        return values, None, zero
    strength = next(values[k] for k in ("sigma_y", "C_0", "c", "sigma_t", "a") if k in values)
    # shear too: the planes are not symmetric about the back stress
    shift = np.array([0.3, -0.1, 0.05, 0.1, 0.0, 0.2])
    full = {
        "p": 0.4 * strength / values["H_i"],
        "v": 0.1 * strength / values.get("H_c", 1.0),
        "alpha": shift * strength / values.get("H_k", 1.0),
    }
    return values, {k: x for k, x in full.items() if k in known}, {**full, **({} if "v" in known else {"v": 0.0})}


@cache
def sections(name, hardened):
    values, state, full = settings(name, hardened)
    law = LAWS[name]
    strength = next(values[k] for k in ("sigma_y", "C_0", "c", "sigma_t", "a") if k in values)
    pressure = values["a"] if name == "cam_clay" else 0.2 * strength
    frame = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    return (
        [
            meridian(law, values, state=state),
            meridian(law, values, state=state, angle=0.4, frame=frame),
            deviatoric(law, values, state=state, pressure=pressure),
        ],
        values,
        full,
    )


def sides(section, points):
    """Signed distances (n, k) of points outside of the ways of a section, in half-widths, those on the limit apart."""
    half = 0.5 * np.ptp(section.points, axis=0)
    corners, points = section.points / half, points / half
    along = np.roll(corners, -1, axis=0) - corners
    length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-300)
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    distance = points @ outward.T - (corners * outward).sum(axis=1)
    good = length > 1e-9
    return distance[:, good], section.cut[good]


VIRGIN = ("tresca", "drucker_prager_cap", "mohr_coulomb", "rankine", "cam_clay", "sand")


@pytest.mark.parametrize(("name", "hardened"), [*((n, True) for n in TRUTH), *((n, False) for n in VIRGIN)])
def test_sampled_stresses_are_inside_as_the_inequality_says(name, hardened):
    """10⁴ stresses of each plane: what the curve encloses keeps f ≤ 0, and what lies beyond a chord by its error breaks it."""
    rng = np.random.default_rng(11)
    found, values, full = sections(name, hardened)
    for section in found:
        low, high = section.points.min(axis=0), section.points.max(axis=0)
        points = rng.uniform(low - 0.2 * (high - low), high + 0.2 * (high - low), size=(10_000, 2))
        f = TRUTH[name](section.tensors(points), values, full)
        size = np.abs(f).max()
        distance, cut = sides(section, points)
        inside = (distance <= 0.0).all(axis=1)
        outside = (distance[:, ~cut] > CHORD).any(axis=1)
        assert 0.1 < inside.mean() < 0.9
        assert outside.sum() > 500
        assert (f[inside] <= BAND * size).all()
        assert (f[outside] > 0.0).all()


@pytest.mark.parametrize("name", TRUTH)
def test_every_point_is_where_the_inequality_changes_its_truth(name):
    found, values, full = sections(name, True)
    for section in found:
        on_surface = ~section.cut | ~np.roll(section.cut, 1)
        out = (section.points - section.centre)[on_surface]
        for stretch, inside in ((1.0 - BAND, True), (1.0 + BAND, False)):
            f = TRUTH[name](section.tensors(section.centre + stretch * out), values, full)
            # a point of a limit that is also of the surface may leave along the surface
            assert ((f <= 0.0) == inside).mean() > (1.0 if not section.unbounded else 0.9) - 1e-12


@pytest.mark.parametrize("name", ["von_mises", "mohr_coulomb", "drucker_prager_cap", "cam_clay"])
def test_chords_are_near_the_boundary_along_rays(name):
    found, values, full = sections(name, True)
    for section in found:
        middle = 0.5 * (section.points + np.roll(section.points, -1, axis=0))[~section.cut] - section.centre
        low, high = np.ones(len(middle)), np.full(len(middle), 1.5)
        for _ in range(60):
            half = 0.5 * (low + high)
            inside = TRUTH[name](section.tensors(section.centre + half[:, None] * middle), values, full) <= 0.0
            low, high = np.where(inside, half, low), np.where(inside, high, half)
        assert (low - 1.0).max() < CHORD


# -- closed forms ----------------------------------------------------------------------------------------------------------------------


def radii(section):
    return np.hypot(*section.points.T), np.degrees(np.arctan2(section.points[:, 1], section.points[:, 0])) % 360.0


def corner_radii(section, angle):
    """Radii of the points within a hundredth of a degree of an angle and its images under 120 degrees."""
    radius, place = radii(section)
    near = np.abs((place - angle + 60.0) % 120.0 - 60.0) < 1e-2
    return radius[near]


def test_von_mises_is_a_circle_of_radius_root_two_k():
    values = dict(E=2e11, nu=0.3, sigma_y=3e8, H_k=0.0, H_i=0.0)
    radius, _ = radii(deviatoric(LAWS["von_mises"], values, pressure=7e8))
    k = 3e8 / np.sqrt(3.0)
    np.testing.assert_allclose(radius, SQRT2 * k, rtol=1e-12)
    cylinder = meridian(LAWS["von_mises"], values)
    np.testing.assert_allclose(np.abs(cylinder.points[~cylinder.cut][:, 1]), k, rtol=1e-12)
    assert cylinder.unbounded


def test_tresca_has_six_corners_on_the_circle_of_von_mises():
    section = deviatoric(LAWS["tresca"], dict(E=2e11, nu=0.3, sigma_y=3e8, H_i=0.0))
    for angle in (0.0, 60.0):
        corners = corner_radii(section, angle)
        assert len(corners) >= 3
        np.testing.assert_allclose(corners.max(), np.sqrt(2.0 / 3.0) * 3e8, rtol=1e-9)
    radius, place = radii(section)
    # straight between the corners: r cos(θ − 30°) = σ_y/√2, so that a corner that is cut off would show at once
    fold = np.radians((place + 30.0) % 60.0 - 30.0)
    np.testing.assert_allclose(radius * np.cos(np.pi / 6.0 - np.abs(fold)), 3e8 / SQRT2, rtol=1e-9)


@pytest.mark.parametrize("pressure", [0.0, 1e4, 1e6])
def test_mohr_coulomb_has_its_two_corner_radii(pressure):
    phi, c = 0.5, 3e3
    section = deviatoric(LAWS["mohr_coulomb"], dict(E=1e7, nu=0.2, phi=phi, c=c, H_i=0.0), pressure=pressure)
    strength = 2.0 * np.sqrt(6.0) * (c * np.cos(phi) + pressure * np.sin(phi))
    # n(0) is extension along an axis, n(60°) compression
    for angle, radius in ((0.0, strength / (3.0 + np.sin(phi))), (60.0, strength / (3.0 - np.sin(phi)))):
        np.testing.assert_allclose(corner_radii(section, angle).max(), radius, rtol=1e-9)
    assert len(section.points) < 80  # six straight sides need no more


def test_rankine_is_a_triangle():
    section = deviatoric(LAWS["rankine"], dict(E=3e10, nu=0.2, sigma_t=3e6, H_i=0.0), pressure=2e6)
    np.testing.assert_allclose(radii(section)[0].max(), np.sqrt(6.0) * 5e6, rtol=1e-9)
    np.testing.assert_allclose(section.points[:, 0].max(), np.sqrt(1.5) * 5e6, rtol=1e-9)  # a side, σ₁ = σ_t


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e12])
def test_drucker_prager_ends_in_its_apex(scale):
    values = dict(E=1e7 * scale, nu=0.2, theta_f=0.3, C_0=2e3 * scale, H_i=0.0)
    section = meridian(LAWS["drucker_prager"], values)
    tip = section.points[np.argmax(section.points[:, 0])]
    np.testing.assert_allclose(tip, [2e3 * scale / np.tan(0.3), 0.0], rtol=1e-9, atol=1e-9 * 2e3 * scale)
    m, s = section.points[~section.cut].T
    np.testing.assert_allclose(np.abs(s), 2e3 * scale - np.tan(0.3) * m, rtol=1e-9, atol=1e-9 * 2e3 * scale)


def test_a_cone_without_cohesion_has_zero_on_its_edge_and_is_drawn():
    values = dict(E=1e7, nu=0.2, theta_f=0.3, C_0=0.0, H_i=0.0)
    section = meridian(LAWS["drucker_prager"], values)
    np.testing.assert_allclose(section.points.max(axis=0)[0], 0.0, atol=1e-9 * np.ptp(section.points[:, 0]))
    with pytest.raises(InputError, match="no point inside"):
        deviatoric(LAWS["drucker_prager"], values, pressure=-1.0)
    np.testing.assert_allclose(
        radii(deviatoric(LAWS["drucker_prager"], values, pressure=1e4))[0], SQRT2 * np.tan(0.3) * 1e4, rtol=1e-9
    )


def test_the_cap_ends_at_its_pressure_and_both_surfaces_are_told():
    values = ENTRIES["drucker_prager_cap"].values
    section = meridian(LAWS["drucker_prager_cap"], values)
    np.testing.assert_allclose(-section.points[:, 0].min(), values["L"] + values["W"], rtol=1e-4)
    assert not section.unbounded
    assert set(section.active) == {0, 1}
    m, s = section.points.T
    corner = (values["r"] * values["W"] - values["C_0"]) / np.tan(values["theta_f"])
    assert np.hypot(m + corner, s - values["r"] * values["W"]).min() < 1e-6 * values["W"]


def test_the_limit_is_where_an_unbounded_domain_is_left_open():
    values = ENTRIES["drucker_prager"].values
    section = meridian(LAWS["drucker_prager"], values, limit=7e4)
    assert section.unbounded
    np.testing.assert_allclose(section.points[:, 0].min(), -7e4)
    np.testing.assert_allclose(section.points[section.cut][:, 0], -7e4)


def test_coordinates_and_tensors_are_inverse_and_measure_what_they_say():
    values = ENTRIES["sand"].values
    rng = np.random.default_rng(5)
    points = rng.normal(size=(50, 2)) * 1e3
    for section in (meridian(LAWS["sand"], values, angle=1.1), deviatoric(LAWS["sand"], values, pressure=2e4)):
        np.testing.assert_allclose(section.coordinates(section.tensors(points)), points, rtol=1e-10, atol=1e-7)
    tensors = meridian(LAWS["sand"], values, angle=1.1).tensors(points)
    np.testing.assert_allclose(mean(tensors), points[:, 0], atol=1e-9)
    np.testing.assert_allclose(root_j2(tensors), np.abs(points[:, 1]), rtol=1e-9)
    flat = deviatoric(LAWS["sand"], values, pressure=2e4).tensors(points)
    np.testing.assert_allclose(mean(flat), -2e4)
    np.testing.assert_allclose(SQRT2 * root_j2(flat), np.hypot(*points.T), rtol=1e-9)
    # Lode's angle of n(θ), by its definition
    for angle in (0.1, 0.7, COMPRESSION):
        n = deviator(angle)[None]
        j3 = np.linalg.det(matrices(n))[0]
        assert np.cos(3.0 * angle) == pytest.approx(1.5 * np.sqrt(3.0) * j3 / root_j2(n)[0] ** 3)


# -- declared by hand -----------------------------------------------------------------------------------------------------------------


E, nu, k, h, g = parameters("E nu k h g")
eps, eps_p, alpha = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("alpha")


def test_a_back_stress_inside_psi_shifts_the_domain_of_the_stress():
    """Prager's ψ = … + h/2 ε^p:ε^p: A = σ − h ε^p is no stress, but σ is A and a constant."""
    A = forces(eps_p, names="A")
    law = Law(
        "prager",
        psi=isotropic(E, nu).energy(eps - eps_p) + h / 2 * inner(eps_p, eps_p),
        phi_star=indicator(norm(dev(A)) - k),
        observable=eps,
        internal=eps_p,
    )
    shift = np.array([1.0, -0.5, -0.5, 0.0, 0.0, 0.0]) * 1e-3
    section = deviatoric(law, dict(E=1e9, nu=0.2, k=1e6, h=5e8), state=dict(eps_p=shift))
    assert section.stress
    away = section.tensors() - 5e8 * shift
    np.testing.assert_allclose(np.sqrt((away**2).sum(axis=1)), 1e6, rtol=1e-9)


def test_a_domain_far_from_zero_is_found():
    """A back stress of ten times the radius: zero stress is outside."""
    A, X = forces(eps_p, alpha, names="A X")
    law = Law(
        "far",
        psi=isotropic(E, nu).energy(eps - eps_p) + h / 2 * inner(alpha, alpha),
        phi_star=indicator(norm(dev(A + X)) - k, tr(A) - g, -tr(A) - g),
        observable=eps,
        internal=(eps_p, alpha),
    )
    values = dict(E=1e9, nu=0.2, k=1e6, h=1e9, g=3e6)
    back = np.array([1e-2, -0.5e-2, -0.5e-2, 0.0, 0.0, 0.0])
    section = meridian(law, values, angle=0.0, state=dict(alpha=back))
    s = np.sqrt(1.5) * 1e7 / SQRT2
    np.testing.assert_allclose(section.points.min(axis=0), [-1e6, s - 1e6 / SQRT2], rtol=1e-9)
    np.testing.assert_allclose(section.points.max(axis=0), [1e6, s + 1e6 / SQRT2], rtol=1e-9)
    assert not section.unbounded
    assert len(section.points) < 80  # a rectangle
    with pytest.raises(InputError, match="no point inside"):
        meridian(law, values, angle=np.pi / 2.0, state=dict(alpha=back))


def test_a_domain_that_does_not_bound_deviators_is_unbounded_in_spite_of_rounding():
    A = forces(eps_p, names="A")
    law = Law(
        "cut_off",
        psi=isotropic(E, nu).energy(eps - eps_p),
        phi_star=indicator(tr(A) - k),
        observable=eps,
        internal=eps_p,
    )
    values = dict(E=1e9, nu=0.2, k=3e6)
    assert deviatoric(law, values).cut.all()
    section = meridian(law, values)
    ends = section.points[~section.cut | ~np.roll(section.cut, 1)]
    np.testing.assert_allclose(ends[:, 0], 1e6, rtol=1e-9)
    assert np.abs(section.points).max() < 1e8


def test_level_sets_of_a_finite_force_function():
    values = ENTRIES["norton"].values
    sigma, rate, n = (values[x] for x in ("sigma_0", "rate_0", "n"))
    level = sigma * rate / (n + 1.0) * 2.0 ** (n + 1.0)
    section = deviatoric(LAWS["norton"], values, level=level)
    np.testing.assert_allclose(radii(section)[0], np.sqrt(2.0 / 3.0) * 2.0 * sigma, rtol=1e-9)
    bingham = ENTRIES["bingham"].values
    section = deviatoric(LAWS["bingham"], bingham, level=0.0)
    np.testing.assert_allclose(radii(section)[0], SQRT2 * bingham["tau_y"], rtol=1e-9)
    with pytest.raises(InputError, match="flat"):
        deviatoric(LAWS["norton"], values, level=0.0)
    with pytest.raises(DeclarationError, match="no surface"):
        deviatoric(LAWS["norton"], values)


def test_what_is_wrong_is_told():
    values = ENTRIES["sand"].values
    with pytest.raises(DeclarationError, match="elastic"):
        meridian(LAWS["wire"], ENTRIES["wire"].values)
    with pytest.raises(InputError, match="no variable 'q'"):
        meridian(LAWS["sand"], values, state=dict(q=1.0))
    with pytest.raises(InputError, match="shape"):
        meridian(LAWS["sand"], values, state=dict(alpha=[1.0, 2.0]))
    with pytest.raises(InputError, match="C_0"):
        meridian(LAWS["sand"], {**values, "C_0": -1.0})
    with pytest.raises(InputError, match="temperature"):
        meridian(LAWS["thermo_elasto_plastic"], ENTRIES["thermo_elasto_plastic"].values)


# -- ψ beside ψ* ----------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [(0, 0, 1, 0, 0, 0), (1, -2, 0.5, 0.3, 0, 1.0)])
def test_the_conjugate_of_linear_elasticity_is_its_closed_form(direction):
    values = dict(E=12e6, nu=0.2)
    pair = energy_pair(LAWS["linear_elastic"], values, direction=direction, strain=2e-3)
    bulk, shear = 12e6 / (3.0 * 0.6), 12e6 / 2.4
    strain = pair.strain[:, None] * np.asarray(direction, dtype=float)
    trace = strain[:, :3].sum(axis=1, keepdims=True)
    sphere = trace / 3.0 * [1, 1, 1, 0, 0, 0]
    stress = 3.0 * bulk * sphere + 2.0 * shear * (strain - sphere)
    expected = mean(stress) ** 2 / (2.0 * bulk) + root_j2(stress) ** 2 / (2.0 * shear)
    assert pair.how == "closed form"
    np.testing.assert_allclose(pair.conjugate, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(pair.stress, stress @ np.asarray(direction, dtype=float), rtol=1e-12, atol=1e-9)
    assert pair.residual < 1e-12 * pair.energy.max()


def test_the_conjugate_is_convex_and_its_tangent_cuts_at_minus_the_energy():
    for name in ("wire", "cam_clay", "reinforced_sand"):
        pair = energy_pair(LAWS[name], ENTRIES[name].values)
        good = np.flatnonzero(np.diff(pair.stress) > 0.0)
        slope = np.diff(pair.conjugate)[good] / np.diff(pair.stress)[good]
        assert all(b >= a - 1e-12 for a, b in pairwise(slope))
        # dψ*/ds is the strain
        middle = 0.5 * (pair.strain[good] + pair.strain[good + 1])
        np.testing.assert_allclose(slope, middle, atol=1.01e-5)


def test_a_conjugate_without_closed_form_is_computed_and_certified():
    pair = energy_pair(LAWS["texsol"], ENTRIES["texsol"].values, count=25)
    assert pair.how == "numerical"
    assert np.isfinite(pair.conjugate).sum() >= 2
    assert pair.residual < 1e-6 * pair.energy.max()
    assert pair.gap < 1e-6 * pair.energy.max()


def test_a_law_declared_by_its_conjugate_is_drawn_from_there():
    sig = sym_tensor("sig")
    law = Law("compliance", psi_star=inner(sig, sig) / (2 * E) + norm(sig) ** 4 / (4 * k), observable=eps)
    pair = energy_pair(law, dict(E=1e7, k=1e15))
    assert pair.residual < 1e-9 * np.abs(pair.conjugate).max()
    s = pair.stress
    np.testing.assert_allclose(pair.conjugate, s**2 / 2e7 + s**4 / 4e15, rtol=1e-6)


def test_a_law_with_density_counts_energy_per_volume():
    rho = parameters("rho_0")
    law = Law("heavy", psi=isotropic(E, nu).energy(eps) / rho, observable=eps, density=rho)
    light = energy_pair(LAWS["linear_elastic"], dict(E=1e7, nu=0.2))
    heavy = energy_pair(law, dict(E=1e7, nu=0.2, rho_0=2000.0))
    np.testing.assert_allclose(heavy.energy, light.energy, rtol=1e-12)
    np.testing.assert_allclose(heavy.conjugate, light.conjugate, rtol=1e-9, atol=1e-12)
