"""Bodies against closed forms: patch test, Lamé's tube, Hill's hollow sphere and tube, Prandtl's footing; and runs that stop and go on.

Sources: Lamé 1852; R. Hill, The Mathematical Theory of Plasticity (1950), ch. V (sphere: p = 2Y/3 (1 − c³/b³) + 2Y ln c/a,
u_b = (1−ν) Y c³/(E b²));
L. Prandtl 1920 (smooth and rough strip footing on a cohesive half-plane: q = (2 + π) k).
"""

from itertools import pairwise

import numpy as np
import pytest

from fenchel.errors import ConvergenceError, InputError
from fenchel.integrators.fe import (
    Body,
    Equilibrium,
    Pressure,
    Support,
    quadrature_map,
    read_mesh,
    rectangle,
    ring_section,
    solve,
    walk,
    write_vtk,
)
from fenchel.integrators.fe.meshes import cylinder_section
from fenchel.potentials.library import linear_elastic, sand, texsol, tresca, von_mises

ELASTIC = dict(E=210.0, nu=0.3)
PLASTIC = dict(E=1.0, nu=0.3, H_k=0.0, H_i=0.0, sigma_y=1e-3)
SAND = dict(E_s=12e6, nu_s=0.2, theta_f=0.079, C_0=2842.0, H_k=944e3, H_i=472e3)


@pytest.fixture(scope="module")
def elastic():
    return linear_elastic.compile("3d")


@pytest.fixture(scope="module")
def metal():
    return von_mises.compile("3d")


@pytest.fixture(scope="module")
def ground():
    return sand.compile("3d")


def box(element):
    """A distorted mesh of the unit square or cube with all its sides named "hull"."""
    import skfem

    rng = np.random.default_rng(3)
    made = {
        "Q": lambda: skfem.MeshQuad.init_tensor(np.linspace(0, 1, 4), np.linspace(0, 1, 4)),
        "P": lambda: skfem.MeshTri.init_tensor(np.linspace(0, 1, 4), np.linspace(0, 1, 4)),
        "H": lambda: skfem.MeshHex.init_tensor(*(3 * [np.linspace(0, 1, 3)])),
        "T": lambda: skfem.MeshTet.init_tensor(*(3 * [np.linspace(0, 1, 3)])),
    }
    mesh = made[element[0]]()
    places = mesh.p.copy()
    inside = ((places > 1e-9) & (places < 1 - 1e-9)).all(axis=0)
    places[:, inside] += 0.06 * rng.uniform(-1, 1, places[:, inside].shape)
    mesh = type(mesh)(places, mesh.t)
    return mesh.with_boundaries({"hull": lambda p: ((p < 1e-9) | (p > 1 - 1e-9)).any(axis=0)})


@pytest.mark.parametrize("integration", ["full", "selective"])
@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2", "H1", "T1", "T2"])
def test_patch(elastic, element, integration):
    """A linear displacement of the hull gives one constant strain everywhere, on a distorted mesh."""
    mesh = box(element)
    dim = mesh.dim()
    rng = np.random.default_rng(5)
    slope = 1e-3 * rng.normal(size=(dim, dim))
    body = Body(mesh, elastic, ELASTIC, "3d" if dim == 3 else "plane_strain", element, integration)
    exact = np.zeros(body.basis.N)
    for axis in range(dim):
        dofs = body.basis.get_dofs(elements=True).all([f"u^{axis + 1}"])
        exact[dofs] = slope[axis] @ body.basis.doflocs[:, dofs]
    hull = body.basis.get_dofs("hull").all()
    free = np.setdiff1d(np.arange(body.basis.N), hull)
    stiffness = body.stiffness(Equilibrium.virgin(body).tangent).toarray()
    found = exact.copy()
    found[free] = np.linalg.solve(stiffness[np.ix_(free, free)], -stiffness[np.ix_(free, hull)] @ exact[hull])
    strain = body.strain(found)
    wanted = np.zeros((3, 3))
    wanted[:dim, :dim] = 0.5 * (slope + slope.T)
    mandel = np.array([*np.diag(wanted), *(np.sqrt(2) * wanted[i, j] for i, j in ((1, 2), (0, 2), (0, 1)))])
    assert np.abs(strain - mandel).max() < 1e-14
    assert body.weights.sum() == pytest.approx(1.0, abs=1e-13)


def test_patch_of_a_cylinder(elastic):
    """Uniaxial stress of a cylinder between smooth platens: uniform, and its force is E ε π R²."""
    body = Body(cylinder_section(0.5, 2.0, 3, 5), elastic, ELASTIC, "axisymmetric", "Q1", "selective")
    state = solve(body, [0, 1], [Support("bottom", y=0.0), Support("top", y=-2e-3), Support("axis", x=0.0)])[-1]
    top = body.basis.get_dofs("top").all(["u^2"])
    assert state.force[top].sum() == pytest.approx(-210.0 * 1e-3 * np.pi * 0.25, rel=1e-12)
    assert np.abs(state.stress - [0, 0, -0.21, 0, 0, 0]).max() < 1e-12


def rates(errors):
    return [float(np.log2(a / b)) for a, b in pairwise(errors)]


@pytest.mark.parametrize(("element", "curved", "order", "bound"), [("Q1", False, 2.0, 2e-3), ("Q2", True, 4.0, 2e-5)])
def test_tube_of_lame(elastic, element, curved, order, bound):
    errors = []
    for n in (4, 8, 16):
        body = Body(ring_section(1.0, 2.0, n, n, curved=curved), elastic, ELASTIC, "plane_strain", element)
        state = solve(body, [0, 1], [Support("start", y=0.0), Support("end", x=0.0)], [Pressure("inside", 1e-2)])[-1]
        found = np.abs(state.displacement[body.basis.get_dofs("outside").all(["u^1"])]).max()
        errors.append(abs(found / (2 * (1 - 0.3**2) * 1e-2 * 2 / (210.0 * 3)) - 1))
    assert errors[-1] < bound
    assert all(abs(r - order) < 0.25 for r in rates(errors)), rates(errors)


@pytest.mark.parametrize(("element", "curved", "order", "bound"), [("Q1", False, 2.0, 2e-2), ("Q2", True, 4.0, 3e-4)])
def test_hollow_sphere_half_plastic(metal, element, curved, order, bound):
    a, b, c, Y = 1.0, 2.0, 1.5, 1e-3
    pressure = 2 * Y / 3 * (1 - c**3 / b**3) + 2 * Y * np.log(c / a)
    errors = []
    for n in (4, 8, 16) if element == "Q1" else (2, 4, 8):
        body = Body(ring_section(a, b, n, n, curved=curved), metal, PLASTIC, "axisymmetric", element)
        states = solve(
            body,
            np.linspace(0, 1, 6),
            [Support("start", y=0.0), Support("end", x=0.0)],
            [Pressure("inside", lambda t: pressure * t)],
        )
        found = np.abs(states[-1].displacement[body.basis.get_dofs("outside").all(["u^1"])]).max()
        errors.append(abs(found / ((1 - 0.3) * Y * c**3 / b**2) - 1))
    assert errors[-1] < bound
    assert rates(errors)[-1] > order - 0.3, rates(errors)


@pytest.mark.parametrize(("element", "curved", "order", "bound"), [("Q1", False, 2.0, 1e-2), ("Q2", True, 3.7, 3e-4)])
def test_tube_of_a_tresca_metal_half_plastic(element, curved, order, bound):
    """Hill 1950, ch. V: p = Y/2 (1 − c²/b²) + Y ln(c/a), u_b = (1 − ν²) Y c²/(E b) in plane strain, σ_z between the others."""
    a, b, c, Y = 1.0, 2.0, 1.5, 1e-3
    pressure = 0.5 * Y * (1 - c**2 / b**2) + Y * np.log(c / a)
    update, errors = tresca.compile("plane_strain"), []
    for n in (4, 8, 16) if element == "Q1" else (2, 4, 8):
        values = dict(E=1.0, nu=0.3, sigma_y=Y, H_i=0.0)
        body = Body(ring_section(a, b, n, n, curved=curved), update, values, "plane_strain", element)
        supports = [Support("start", y=0.0), Support("end", x=0.0)]
        state = solve(body, np.linspace(0, 1, 6), supports, [Pressure("inside", lambda t: pressure * t)])[-1]
        found = np.abs(state.displacement[body.basis.get_dofs("outside").all(["u^1"])]).max()
        errors.append(abs(found / ((1 - 0.3**2) * Y * c**2 / b) - 1))
    radius, share = np.linalg.norm(body.points, axis=1), state.dissipation > 0.0
    assert radius[share].max() < c + 0.15 and radius[~share].min() > c - 0.15
    assert errors[-1] < bound
    assert rates(errors)[-1] > order - 0.3, (rates(errors), errors)


@pytest.mark.parametrize("dimension", ["plane_strain", "axisymmetric"])
def test_a_body_with_the_components_of_its_dimension_moves_the_same(dimension):
    wire = dict(lambda_w=1e6, mu_w=2e6)
    found = []
    for kind in ("3d", dimension):
        mesh = cylinder_section(0.5, 1.0, 5, 5)
        body = Body(mesh, texsol.compile(kind), SAND | wire, dimension, "Q1", "selective")
        state = solve(body, [0.0, 0.5, 1.0], ROUGH)[-1]
        found.append(
            (body, state, [quadrature_map(body, state, n)[1] for n in ("stress_zz", "eps_p_xx", "sqrt_J2", "p")])
        )
    (whole, one, maps), (narrow, two, others) = found
    assert (whole.components, narrow.components) == (6, 4)
    assert np.abs(one.displacement - two.displacement).max() < 1e-12
    for left, right in zip(maps, others, strict=True):
        assert np.abs(left).max() > 0 and right == pytest.approx(left, abs=1e-9 * np.abs(left).max())


def test_a_plate_in_plane_stress():
    """Uniform tension: elastic contraction −ν ε, then the yield stress of a perfectly plastic metal."""
    sides = [Support("left", x=0.0), Support("bottom", y=0.0), Support("right", x=lambda t: 2e-3 * t)]
    body = Body(rectangle(1.0, 0.5, 3, 2), von_mises.compile("plane_stress"), PLASTIC, "plane_stress", "Q2")
    state = solve(body, np.linspace(0, 1, 5), sides)[-1]
    assert state.stress == pytest.approx(np.tile([1e-3, 0.0, 0.0], (body.point_count, 1)), abs=1e-9)
    half = solve(body, [0.0, 0.25, 0.4], sides)[0]
    assert half.strain[:, 1] == pytest.approx(-0.3 * half.strain[:, 0], rel=1e-9)
    points, stress = quadrature_map(body, state, "stress_xx")
    assert points.shape == (body.point_count, 2) and stress == pytest.approx(1e-3)
    with pytest.raises(InputError, match="there are: strain_xx"):
        quadrature_map(body, state, "heat")
    with pytest.raises(InputError, match="compile the law for that dimension"):
        Body(rectangle(1.0, 0.5, 3, 2), von_mises.compile("3d"), PLASTIC, "plane_stress")
    with pytest.raises(InputError, match="compile the law for that dimension"):
        Body(rectangle(1.0, 0.5, 3, 2), von_mises.compile("plane_stress"), PLASTIC, "plane_strain")


def footing(metal, n, steps, depth=0.05):
    """Rough rigid strip footing of half width 1 on a cohesive half-plane, k = 1; P2 triangles refined towards the edge."""
    mesh = rectangle(5.0, 3.0, 5 * n, 3 * n, shape="tri")
    for _ in range(2):
        centre = mesh.p[:, mesh.t].mean(axis=1)
        near = np.hypot(centre[0] - 1.0, centre[1] - 3.0) < 4 * np.sqrt(2 * 15 / mesh.t.shape[1])
        mesh = mesh.refined(np.flatnonzero(near))
    sides = {
        "left": lambda p: p[0] < 1e-9,
        "right": lambda p: p[0] > 5 - 1e-9,
        "bottom": lambda p: p[1] < 1e-9,
        "footing": lambda p: (p[1] > 3 - 1e-9) & (p[0] < 1 + 1e-9),
    }
    values = dict(E=1e3, nu=0.3, H_k=0.0, H_i=0.0, sigma_y=np.sqrt(3.0))
    body = Body(mesh.with_boundaries(sides), metal, values, "plane_strain", "P2")
    supports = [
        Support("left", x=0.0),
        Support("right", x=0.0),
        Support("bottom", x=0.0, y=0.0),
        Support("footing", x=0.0, y=lambda t: -depth * t),
    ]
    state = solve(body, np.linspace(0, 1, steps + 1), supports, tolerance=1e-8)[-1]
    return -state.force[body.basis.get_dofs("footing").all(["u^2"])].sum(), mesh.t.shape[1]


def test_footing_of_prandtl_from_above(metal):
    loads = [footing(metal, n, 6)[0] for n in (1, 2)]
    assert 2 + np.pi < loads[1] < loads[0]
    assert loads[1] / (2 + np.pi) - 1 < 0.06


@pytest.mark.validate
def test_footing_of_prandtl_within_two_percent(metal):
    load, _ = footing(metal, 5, 20)
    assert 0.0 < load / (2 + np.pi) - 1 < 0.02


def crushed(update, values, columns=6, rows=6):
    return Body(cylinder_section(0.5, 1.0, columns, rows), update, values, "axisymmetric", "Q1", "selective")


ROUGH = [Support("axis", x=0.0), Support("bottom", x=0.0, y=0.0), Support("top", x=0.0, y=lambda t: -1e-3 * t)]


def test_newton_converges_quadratically(ground):
    state = solve(crushed(ground, SAND), [0.0, 1.0], ROUGH, tolerance=1e-12)[-1]
    tail = [r for r in state.residuals if r > 1e-13][-3:]
    assert state.dissipation.max() > 0.0
    assert tail[-1] < 30 * tail[-2] ** 1.8, state.residuals


def test_a_run_that_stops_goes_on_with_the_same_bits(ground, tmp_path):
    body, times = crushed(ground, SAND, 4, 4), np.linspace(0, 1, 5)
    whole = solve(body, times, ROUGH)
    place = tmp_path / "checkpoint.npz"
    for state in walk(body, times, ROUGH, checkpoint=place):
        if state.time == times[2]:
            break
    rest = list(walk(body, times, ROUGH, start=Equilibrium.load(place, body)))
    assert [s.time for s in rest] == list(times[3:])
    for one, two in zip(whole[-2:], rest, strict=True):
        assert np.array_equal(one.displacement, two.displacement) and np.array_equal(one.stress, two.stress)
    with pytest.raises(InputError, match="another body"):
        Equilibrium.load(place, crushed(ground, SAND, 3, 3))


def test_cycles_dissipate_and_balance(ground):
    """Work of the platen = stored energy + dissipation, up to the second order of implicit Euler, and the dissipation only grows."""

    def stroke(t):
        return -1e-3 * (0.5 - 0.5 * np.cos(np.pi * t))

    supports = [Support("axis", x=0.0), Support("bottom", x=0.0, y=0.0), Support("top", x=0.0, y=stroke)]
    misses = []
    for steps in (8, 16):
        body = crushed(ground, SAND, 4, 4)
        states = solve(body, np.linspace(0, 4, 4 * steps + 1), supports)
        top = body.basis.get_dofs("top").all(["u^2"])
        work, force, height, lost = 0.0, 0.0, 0.0, np.zeros(body.point_count)
        for state in states:
            new, moved = state.force[top].sum(), stroke(state.time)
            work += 0.5 * (force + new) * (moved - height)
            force, height = new, moved
            assert (state.dissipation >= lost - 1e-12).all()
            lost = state.dissipation
        psi = ground.energy(states[-1].strain, states[-1].state, **SAND)
        stored = float(body.weights @ (psi + states[-1].dissipation))
        misses.append(abs(work - stored) / stored)
    assert misses[1] < 0.02 and misses[1] < 0.65 * misses[0], misses


def test_a_step_too_long_is_cut(elastic):
    """A law that refuses strains beyond 1e-3 per step: the body goes there in more steps, and says so if it cannot."""

    class Shy:
        def initial_state(self, count):
            return elastic.initial_state(count)

        def __call__(self, eps, state, dt=1.0, **values):
            if dt > 0.3:
                raise ConvergenceError("too long")
            return elastic(eps, state, dt=dt, **values)

    body = Body(cylinder_section(0.5, 1.0, 2, 2), Shy(), ELASTIC, "axisymmetric")
    start = Equilibrium.virgin(Body(cylinder_section(0.5, 1.0, 2, 2), elastic, ELASTIC, "axisymmetric"))
    state = solve(body, [0.0, 1.0], ROUGH, start=start)[-1]
    assert state.time == 1.0 and state.iterations >= 4
    with pytest.raises(ConvergenceError, match="cuts of the step"):
        solve(body, [0.0, 1e6], ROUGH, start=start)


def test_a_mesh_goes_through_a_file_and_results_open(elastic, tmp_path):
    import meshio

    mesh = rectangle(1.0, 2.0, 2, 3)
    place = tmp_path / "mesh.msh"
    mesh.save(str(place))
    names = {"low": lambda p: p[1] < 1e-9, "high": lambda p: p[1] > 2 - 1e-9}
    body = Body(read_mesh(place, names), elastic, ELASTIC, "plane_strain", "Q1")
    state = solve(body, [0, 1], [Support("low", x=0.0, y=0.0), Support("high", y=-2e-3)])[-1]
    write_vtk(tmp_path / "out.vtu", body, state, {"twice": 2 * state.stress})
    found = meshio.read(tmp_path / "out.vtu")
    assert found.point_data["displacement"][:, 1].min() == pytest.approx(-2e-3)
    stress = body.average(state.stress)
    assert np.allclose(found.cell_data["stress_yy"][0], stress[:, 1])
    assert np.allclose(found.cell_data["stress_xy"][0], stress[:, 5] / np.sqrt(2))
    assert np.allclose(found.cell_data["twice_yy"][0], 2 * stress[:, 1])
    (tmp_path / "bad.msh").write_text("nothing")
    for wrong in (tmp_path / "none.msh", tmp_path / "bad.msh"):
        with pytest.raises(InputError, match="mesh file"):
            read_mesh(wrong)


def test_wrong_bodies_are_refused_in_one_line(elastic):
    mesh = rectangle(1.0, 1.0, 1, 1)
    for change, words in [
        (dict(dimension="plane"), "dimension"),
        (dict(dimension="3d"), "does not fit a mesh"),
        (dict(element="P2"), "does not fit a quad mesh"),
        (dict(integration="reduced"), "full or selective"),
    ]:
        with pytest.raises(InputError, match=words):
            Body(mesh, elastic, ELASTIC, **change)
    body = Body(mesh, elastic, ELASTIC)
    with pytest.raises(InputError, match="no boundary 'roof'"):
        solve(body, [0, 1], [Support("roof", y=0.0)])
    with pytest.raises(InputError, match="no axis z"):
        solve(body, [0, 1], [Support("top", z=0.0)])
    with pytest.raises(InputError, match="increasing"):
        solve(body, [0, 0], [Support("top", y=0.0)])
    with pytest.raises(ConvergenceError, match="singular"):
        solve(body, [0, 1], [], [Pressure("top", 1.0)])
