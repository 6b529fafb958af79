"""Random laws, values and states: every method, formulation, dimension, precision and number of threads, judged from the declaration.

An answer is judged by what the theory says of it, with the declared expressions evaluated as they stand (`fenchel.potentials.evaluate`):
everything finite; σ = ∂ψ/∂ε; no surface exceeded; (ε̇, α̇) ∈ ∂φ*(Y) by the inequality φ*(Z) ≥ φ*(Y) + rate·(Z − Y) at admissible forces Z,
many of them close to Y, or its counterpart in rates for a law declared by φ; dissipation not negative; duality gap small; tangent
symmetric and positive semidefinite; other methods give the same stress. `check` may not refute a law made of admissible pieces, nor prove
one with a term that no admissible law has.

Tolerances are relative to sizes that the data give before anything cancels (stiffness × strains, stiffness × plastic strains): `SHARP`
of them, beside `LOOSE` of a yield stress; energies also `SHARP` of that at yield. The engine stops at 1e-13 of such sizes; what it keeps
short of that has a residual of 1e-10 and a gap of 1e-8. Values over ±12 decades may leave less of small moduli: there an answer may be
coarse, if its gap says so.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from random_laws import RandomLaw, broken_law, random_law, random_states, random_strains

from fenchel.errors import ConvergenceError, DeclarationError, FenchelError, InputError
from fenchel.potentials.derivative import partial
from fenchel.potentials.evaluate import evaluate

from .case import Failure, digest_of, foreseen

PLAIN = False
SHARP, LOOSE = 1e-9, 1e-6
POINTS = 16
VARIANTS = 6  # further sets of values of a law
TWIN_METHODS = ("closed", "reduced", "principal", "general", "general", "conic", "cvxpy", "explicit")
WAYS = {"stress": 0.22, "dimension": 0.12, "float32": 0.06, "threads": 0.1, "method": 0.4, "tangent off": 0.1}
EXTREME = 0.25  # share of the cases with numbers over ±12 decades


def draw(seed: int) -> dict[str, Any]:
    """A law, the generator of its states, and what is compared."""
    rng = np.random.default_rng([seed, 1])
    extreme = bool(rng.random() < EXTREME)
    drawn = random_law(rng, extreme=extreme)
    return {
        "drawn": drawn, "extreme": extreme, "states": int(rng.integers(1 << 30)), "broken": bool(rng.random() < 0.3),
        "ways": [str(w) for w in rng.choice(list(WAYS), 2, p=list(WAYS.values()))], "method": str(rng.choice(TWIN_METHODS)),
        "dimension": str(rng.choice(["plane_strain", "axisymmetric", "plane_stress", "uniaxial"])),
    }  # fmt: skip


def digest(case: dict[str, Any]) -> str:
    """Of text, values and the generator of states."""
    drawn = case["drawn"]
    return digest_of(drawn.text, repr(sorted(drawn.values.items())), str(case["states"]), drawn.dt.hex())


def judge(case: dict[str, Any]) -> str:
    """See the module."""
    drawn: RandomLaw = case["drawn"]
    admissible(case)
    verdict = steps(case)
    # other values and states of the same code, which is what takes the time; a fifth of the comparisons would do
    rng = np.random.default_rng(case["states"] + 1)
    if not {"egg", "coupled"} & set(drawn.tags):  # of which values hang together
        for k in range(VARIANTS):
            other = replace(drawn, values=varied(drawn, rng))
            steps({**case, "drawn": other, "states": case["states"] + 2 + k, "ways": case["ways"][: k % 3 == 0]})
    return verdict


def varied(drawn: RandomLaw, rng: np.random.Generator) -> dict[str, float]:
    """Values a decade up or down, but bounded ones, exponents and a reference temperature."""
    kept = {p.name for p in drawn.law.parameters if np.isfinite(p.upper)} | {
        "n",
        "n_1",
        "n_h",
        "T_0",
        "t_f",
        "t_f_1",
        "t_f_2",
        "t_m",
    }
    return {k: v if k in kept else v * 10.0 ** rng.uniform(-1.0, 1.0) for k, v in drawn.values.items()}


def steps(case: dict[str, Any]) -> str:
    """One set of values at random states, and the comparisons of the case."""
    drawn: RandomLaw = case["drawn"]
    try:
        update = drawn.law.compile()
    except FenchelError as error:
        if not isinstance(error, DeclarationError):
            raise Failure(f"compile: {error}") from None
        return foreseen(error)
    rng = np.random.default_rng(case["states"])
    try:
        before, state, new = random_states(drawn, update, rng, POINTS)
    except FenchelError as error:
        raise Failure(f"virgin state: {error}") from None
    judge_ = Judge(drawn, before, state, new)
    try:
        answer, kept = stepped(update, new, state, drawn, certify=True, finite=not case["extreme"])
    except InputError as error:
        if not case["extreme"]:
            raise Failure(f"moderate values are refused: {error}") from None
        return foreseen(error)
    if kept.size == 0:
        return "refused (ConvergenceError)"
    judge_.take(kept)
    try:
        judge_.all(answer, update.solver)
    except Failure:
        # the engine's tolerance is relative to the data of its program: with moduli twenty decades apart little is left of it for the
        # small ones. Such an answer must not look certified.
        if not (case["extreme"] and judge_.finite(answer) and uncertain(judge_, answer)):
            raise
        return "answer of extreme values, gap tells that it is coarse"
    for way in case["ways"]:
        compared(case, way, update, judge_, answer)
    return f"answer ({update.solver})" if kept.size == POINTS else f"answer in part ({update.solver})"


def uncertain(judge: Judge, answer: Any) -> bool:
    """Whether the certified gap says that the answer is not one to the accuracy that is asked of moderate laws."""
    work, rounding, trial = judge.energies(answer)
    return bool((answer.gap > 1e-10 * (work + rounding + trial)).any())


def admissible(case: dict[str, Any]) -> None:
    """`check` against what is known of the law."""
    drawn = case["drawn"]
    report = drawn.law.check(**drawn.values)
    if report.admissible is False:
        raise Failure(
            f"check refutes a law of admissible pieces {drawn.tags}: {report.counterexample or report.reasons}"
        )
    if case["broken"]:
        kind, law, values = broken_law(drawn, np.random.default_rng(case["states"]))
        report = law.check(**values)
        # a condition on the temperature, which has no value here, stays open and is told
        if report.admissible is True and not any(condition.on_state for condition in report.conditions):
            raise Failure(f"check proves a law with a term that is not admissible ({kind}, {drawn.tags})")


def stepped(
    update: Any, new: Any, state: Any, drawn: RandomLaw, *, certify: bool = False, finite: bool = False
) -> tuple[Any, Any]:
    """(answer, the points that have one): all points at once, then one by one where some are refused. If `finite`, a refusal because
    numbers are not finite is a failure."""
    count = len(new)
    try:
        return update(new, state, drawn.dt, certify=certify, **drawn.given), np.arange(count)
    except ConvergenceError as error:
        if finite and "not finite" in str(error):
            raise Failure(f"moderate values, and {error}") from None
        foreseen(error)
    good = []
    for i in range(count):
        one = {k: v[i : i + 1] for k, v in state.items()}
        try:
            update(new[i : i + 1], one, drawn.dt, **drawn.given)
            good.append(i)
        except ConvergenceError as error:
            foreseen(error)
    kept = np.array(good, dtype=int)
    if kept.size == 0:
        return None, kept
    try:
        found = update(new[kept], {k: v[kept] for k, v in state.items()}, drawn.dt, certify=certify, **drawn.given)
    except ConvergenceError as error:
        # clarabel starts a point from the scaling of the one before, so that a point at the edge of what is possible may go either way
        foreseen(error)
        return None, np.zeros(0, dtype=int)
    return found, kept


def length(a: Any) -> Any:
    """Size per point of scalars (n,), vectors and tensors (n, k)."""
    a = np.asarray(a, dtype=float)
    return np.abs(a) if a.ndim == 1 else np.sqrt(np.sum((a / _unit(a)) ** 2, axis=1)) * _unit(a)[:, 0]


def _unit(a: Any) -> Any:
    size = np.abs(a).max(axis=1, keepdims=True, initial=0.0)
    return np.where(size > 0.0, size, 1.0)


def dot(a: Any, b: Any) -> Any:
    """Product per point."""
    return a * b if np.ndim(a) == 1 else np.einsum("ij,ij->i", a, b)


class Judge:
    """What the declaration says of answers at given states: arrays per point, sizes of rounding."""

    def __init__(self, drawn: RandomLaw, before: Any, state: dict[str, Any], new: Any) -> None:
        self.drawn, self.law = drawn, drawn.law
        self.before, self.old, self.new = before, state, new
        self.rng = np.random.default_rng(7)

    def take(self, kept: Any) -> None:
        """Only these points."""
        self.before, self.new = self.before[kept], self.new[kept]
        self.old = {k: v[kept] for k, v in self.old.items()}

    # -- numbers of the declaration -------------------------------------------------------------------------------------------------

    def known(self, eps: Any, state: dict[str, Any]) -> dict[Any, Any]:
        """Values by symbol."""
        law, n = self.law, len(eps)
        found: dict[Any, Any] = {p: self.drawn.values[p.name] for p in law.parameters}
        found[law.observable] = eps
        for variable in law.internal:
            found[variable] = state[variable.name]
        if law.temperature is not None:
            found[law.temperature] = np.full(n, self.drawn.heat[law.temperature.name])
        return found

    def stress(self, eps: Any, state: Any) -> Any:
        """∂ψ/∂ε (n, 6)."""
        return np.broadcast_to(evaluate(self.law.stress, self.known(eps, state)), (len(eps), 6))

    def forces(self, eps: Any, state: Any) -> dict[Any, Any]:
        """−∂ψ/∂α by variable."""
        known, n = self.known(eps, state), len(eps)
        found = {}
        for v in self.law.internal:
            shape = (n, 6) if getattr(v, "rank", 0) == 2 else (n,)
            found[v] = np.broadcast_to(-np.asarray(evaluate(partial(self.law.energy, v), known)), shape)
        return found

    def frozen(self) -> dict[Any, Any]:
        """Values of frozen symbols and parameters of φ*."""
        known = self.known(self.before, self.old)
        potential = self.law.phi if self.law.phi is not None else self.law.phi_star
        more = {}
        for f in potential.functions:
            for symbol in f.free_symbols:
                if getattr(symbol, "role", "") == "frozen":
                    more[symbol] = known[symbol.variable]
        return {**known, **more}

    def stiffness(self) -> float:
        """Size of ∂²ψ/∂ε² [Pa] at a yield strain, spherical or sheared."""
        shapes = self.drawn.strain * np.array([[1.0, 1, 1, 0, 0, 0], [1, -1, 0, 0, 0, 0]])
        zero = {k: np.zeros((2, *v.shape[1:])) for k, v in self.old.items()}
        found = length(self.stress(shapes, zero) - self.stress(0.0 * shapes, zero)) / length(shapes)
        return float(found.max())

    def modulus(self, variable: Any) -> float:
        """Size of ∂²ψ/∂α² [Pa] at a yield strain."""
        one = {k: np.zeros((1, *v.shape[1:])) for k, v in self.old.items()}
        none = {k: v.copy() for k, v in one.items()}
        one[variable.name][...] = self.drawn.strain
        zero = np.zeros((1, 6))
        apart = self.forces(zero, one)[variable] - self.forces(zero, none)[variable]
        return float(length(apart)[0] / length(one[variable.name])[0])

    def finite(self, out: Any) -> bool:
        """Whether every number of an answer is one."""
        parts = [out.stress, out.dissipation, out.strain, out.tangent, out.gap, *out.state.values()]
        return all(part is None or bool(np.isfinite(part).all()) for part in parts)

    def energies(self, out: Any) -> tuple[Any, Any, Any]:
        """(forces × changes, the same with forces before anything cancels, energy of the trial) per point [J/m³]."""
        zero, size = np.zeros(len(self.new)), self.sizes(self.new, out.state)
        force, change = (
            self.forces(self.new, out.state),
            {v: out.state[v.name] - self.old[v.name] for v in self.law.internal},
        )
        work = sum((length(force[v]) * length(x) for v, x in change.items()), zero)
        rounding = sum((size[v] * length(x) for v, x in change.items()), zero)
        return work, rounding, size[None] * (length(self.new - self.before) + length(self.new))

    # -- judging --------------------------------------------------------------------------------------------------------------------

    def sizes(self, eps: Any, state: Any) -> dict[Any, Any]:
        """By variable, and under None for the stress: the forces before anything cancels (n,), what rounding is relative to."""
        zero, n = {k: np.zeros_like(v) for k, v in self.old.items()}, len(eps)
        still = np.zeros((n, 6))
        found: dict[Any, Any] = {None: np.full(n, 0.0), **{v: np.full(n, 0.0) for v in self.law.internal}}
        with np.errstate(all="ignore"):
            for e, x in ((eps, zero), (still, state), (still, self.old), (eps, state), (eps, self.old)):
                found[None] = np.fmax(found[None], length(self.stress(e, x)))
                for v, force in self.forces(e, x).items():
                    found[v] = np.fmax(found[v], length(force))
            # the solvers measure all forces in one energy norm: of a force with the modulus H they promise digits of √(H · energy of the
            # trial), more than its own size where a hardening modulus is far above the stiffness of the others
            energy = found[None] * (length(eps) + length(self.before))
            for v in self.law.internal:
                found[v] = np.fmax(found[v], np.sqrt(self.modulus(v) * energy))
        return found

    def all(self, out: Any, who: str, *, eps: Any = None, sharp: float = SHARP, loose: float = LOOSE) -> None:
        """Every condition on an answer."""
        law, drawn = self.law, self.drawn
        eps = self.new if eps is None else eps
        for name, part in (("stress", out.stress), ("dissipation", out.dissipation), ("strain", out.strain),
                           ("tangent", out.tangent), ("gap", out.gap), *out.state.items()):  # fmt: skip
            if part is not None and not np.isfinite(part).all():
                raise Failure(f"{who}: {name} is not finite with status converged")
        if np.any(out.status):
            raise Failure(f"{who}: a status other than converged is returned")
        size = self.sizes(eps, out.state)
        force, change = self.forces(eps, out.state), {v: out.state[v.name] - self.old[v.name] for v in law.internal}
        tolerance = loose * drawn.stress + sharp * size[None]
        stress = self.stress(eps, out.state)
        observable = law.forces.get(law.observable)
        if observable is None:
            self.hold(length(out.stress - stress), tolerance, f"{who}: the stress is not that of the energy")
        else:
            # of a dashpot the rest is viscous, and the strain rate its response
            force[law.observable] = out.stress - stress
            change[law.observable] = eps - self.before
            size[law.observable] = size[None] + length(out.stress)
        work = sum((length(force[v]) * length(x) for v, x in change.items()), np.zeros(len(eps)))
        rounding = sum((size[v] * length(x) for v, x in change.items()), np.zeros(len(eps)))
        energy = drawn.stress * drawn.strain
        slack = loose * work + sharp * (rounding + energy)
        self.hold(-out.dissipation, slack, f"{who}: negative dissipation")
        if change:
            self.flow(force, change, size, work, rounding, who, loose, sharp)
        if out.gap is not None:
            trial = size[None] * length(eps - self.before) + size[None] * length(eps)
            limit = 1e-7 * (work + energy) + 1e-8 * (rounding + trial)
            doubtful = np.flatnonzero(~(out.gap <= limit))
            if doubtful.size and who in ("closed", "reduced", "principal") and not self.answered(eps, doubtful):
                doubtful = doubtful[:0]
            self.hold(out.gap[doubtful], limit[doubtful], f"{who}: duality gap")
        if out.tangent is not None and who != "explicit":
            self.tangent(out.tangent, who, stress, size[None])

    def answered(self, eps: Any, points: Any) -> bool:
        """Whether the general engine has an answer at any of these points: a gap is measured from its answer, and says nothing without."""
        update = self.law.compile(solver="general")
        old = {k: v[points] for k, v in self.old.items()}
        return stepped(update, eps[points], old, self.drawn)[1].size > 0

    def tangent(self, tangent: Any, who: str, stress: Any, size: Any) -> None:
        """Symmetric and positive semidefinite.

        Where the deviator of the stress is what rounding left of a spherical one, the direction of flow is rounding too (its trace is no
        longer zero), and so are entries of the tangent in its share: the limit is 1e-6, or what rounding makes of that direction.
        """
        deviator = stress - stress[:, :3].mean(axis=1, keepdims=True) * np.array([1.0, 1, 1, 0, 0, 0])
        limit = 1e-6 + np.minimum(1e-13 * size / np.maximum(length(deviator), 1e-16 * size + 1e-300), 1e3)
        # a tangent that vanishes (an apex) is the difference of entries of the size of the stiffness
        top = np.abs(tangent).max(axis=(1, 2)) + 1e-6 * self.stiffness()
        skew = np.abs(tangent - tangent.transpose(0, 2, 1)).max(axis=(1, 2))
        self.hold(skew, limit * top, f"{who}: the tangent is not symmetric")
        least = np.linalg.eigvalsh(
            0.5 * (tangent + tangent.transpose(0, 2, 1)) / np.where(top > 0, top, 1)[:, None, None]
        )
        self.hold(-least[:, 0], limit, f"{who}: the tangent has a negative direction")

    def hold(self, value: Any, limit: Any, what: str) -> None:
        """value ≤ limit at every point."""
        bad = np.flatnonzero(~(value <= limit))
        if bad.size:
            i = int(bad[np.argmax(value[bad] / np.maximum(limit[bad], 1e-300))])
            raise Failure(
                f"{what}: {value[i]:.3e} > {limit[i]:.3e} at point {i} ({bad.size} of {len(value)}), {self.drawn.tags}"
            )

    def flow(
        self, force: Any, change: Any, size: Any, work: Any, rounding: Any, who: str, loose: float, sharp: float
    ) -> None:
        """(rates) ∈ ∂φ*(Y), or Y ∈ ∂φ(rates)."""
        if self.law.phi is not None:
            self.flow_of_rates(force, change, size, work, who, loose, sharp)
            return
        law, n = self.law, len(work)
        symbols = law.forces
        base, phi = self.frozen(), law.phi_star
        moved = [v for v in (*law.internal, law.observable) if v in symbols]
        given = {symbols[v]: force[v] for v in moved}

        def surfaces(z: dict[Any, Any]) -> Any:
            values = [np.broadcast_to(evaluate(f, {**base, **z}), (n,)) for f in phi.surfaces]
            return np.max(values, axis=0) if values else np.full(n, -np.inf)

        def finite(z: dict[Any, Any]) -> Any:
            if phi.finite == 0:
                return np.zeros(n)
            return self.drawn.dt * np.broadcast_to(evaluate(phi.finite, {**base, **z}), (n,))

        # how much f changes over forces of the size of their rounding: the largest slope over some directions
        if phi.surfaces:
            zero = {s: np.zeros_like(y) for s, y in given.items()}
            at_zero, slope = surfaces(zero), np.zeros(n)
            for _ in range(12):
                step = {symbols[v]: self.direction(given[symbols[v]], size[v]) for v in moved}
                with np.errstate(all="ignore"):
                    slope = np.fmax(slope, surfaces(step) - at_zero)
            excess = surfaces(given)
            self.hold(excess, loose * np.abs(at_zero) + sharp * slope, f"{who}: a surface is exceeded")
        with np.errstate(all="ignore"):
            here = finite(given)
            if not np.isfinite(here).all():
                raise Failure(f"{who}: φ* is not finite at the forces of the answer")
            for trial in self.trials(given, moved, symbols, surfaces):
                gain = sum((dot(change[v], trial[symbols[v]] - given[symbols[v]]) for v in moved), np.zeros(n))
                there = finite(trial)
                far = sum((length(change[v]) * length(trial[symbols[v]]) for v in moved), np.zeros(n))
                slack = loose * (work + far + np.abs(here)) + sharp * rounding
                wrong = np.where(np.isfinite(there), gain - (there - here), -np.inf)
                self.hold(
                    wrong, slack + sharp * self.drawn.stress * self.drawn.strain, f"{who}: the flow is not that of φ*"
                )

    def direction(self, like: Any, size: Any) -> Any:
        """Random values of the shape of `like`, of the given sizes."""
        found = self.rng.normal(size=np.shape(like))
        unit = length(found)
        return found * (size / unit)[:, None] if found.ndim == 2 else np.sign(found) * size

    def trials(self, given: Any, moved: Any, symbols: Any, surfaces: Any) -> Any:
        """Admissible forces: multiples, neighbours of the answer, random ones, brought into the domain by scaling."""
        n = len(next(iter(given.values())))
        for factor in (0.0, 0.5, 0.999, 1.5):
            yield self.inside({s: factor * y for s, y in given.items()}, surfaces, n)
        reference = sum((length(y) for y in given.values()), np.zeros(n)) + self.drawn.stress
        for width in (1e-3, 1e-2, 0.1, 1.0, 1e-3, 1e-2, 0.1, 1.0):
            yield self.inside({s: y + self.direction(y, width * reference) for s, y in given.items()}, surfaces, n)

    def inside(self, z: Any, surfaces: Any, n: int) -> Any:
        """Scaled towards zero, by bisection, until no surface is exceeded."""
        low, high = np.zeros(n), np.ones(n)
        spread = lambda t, y: y * (t[:, None] if np.ndim(y) == 2 else t)  # noqa: E731
        if not (surfaces(z) > 0).any():
            return z
        good = surfaces(z) <= 0
        for _ in range(50):
            middle = 0.5 * (low + high)
            fits = surfaces({s: spread(middle, y) for s, y in z.items()}) <= 0
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        return {s: spread(np.where(good, 1.0, low), y) for s, y in z.items()}

    def flow_of_rates(
        self, force: Any, change: Any, size: Any, work: Any, who: str, loose: float, sharp: float
    ) -> None:
        """Y ∈ ∂φ(rates): φ(V) ≥ φ(X) + Y·(V − X) at rates V that the indicators allow."""
        law, n, dt = self.law, len(work), self.drawn.dt
        symbols, base, phi = law.forces, self.frozen(), law.phi
        moved = list(symbols)
        rate = {symbols[v]: change[v] / dt for v in moved}
        where = {symbols[v]: v for v in moved}

        def value(z: Any) -> Any:
            return np.broadcast_to(evaluate(phi.finite, {**base, **z}), (n,))

        scale = sum((length(r) for r in rate.values()), np.zeros(n))
        # a rate is the difference of two states: the last digits of what they are made from, over the time step
        digits = length(self.new) + length(self.before)
        for v in moved:
            digits = digits + length(self.old[v.name]) + length(change[v])
        for f in phi.surfaces:
            excess = np.broadcast_to(evaluate(f, {**base, **rate}), (n,))
            self.hold(excess, loose * scale + 1e-11 * digits / dt, f"{who}: a rate is not allowed")
        here, unit = value(rate), self.drawn.stress * self.drawn.strain / dt
        for width in (0.0, 0.5, 2.0, 1e-3, 1e-2, 0.1, 1.0, 10.0, 1e-3, 1e-2, 0.1, 1.0):
            reference = scale + self.drawn.strain / dt
            other = {s: width * r for s, r in rate.items()} if width in (0.0, 0.5, 2.0) else {
                s: r + self.direction(r, width * reference) for s, r in rate.items()
            }  # fmt: skip
            for r in other.values():  # constant volume, and an accumulated rate that is large enough
                if np.ndim(r) == 2 and len(phi.surfaces) >= 2:
                    r[:, :3] -= r[:, :3].mean(axis=1, keepdims=True)
            for s, r in list(other.items()):
                if np.ndim(r) == 1:
                    other[s] = np.maximum(r, sum((length(x) for x in other.values() if np.ndim(x) == 2), np.zeros(n)))
            gain = sum((dot(force[v], other[symbols[v]] - rate[symbols[v]]) for v in moved), np.zeros(n))
            far = sum((size[where[s]] * (length(other[s]) + length(r)) for s, r in rate.items()), np.zeros(n))
            near = sum((length(force[where[s]]) * (length(other[s]) + length(r)) for s, r in rate.items()), np.zeros(n))
            self.hold(
                gain - (value(other) - here), loose * near + sharp * (far + unit), f"{who}: the force is not that of φ"
            )


# -- the same step another way ----------------------------------------------------------------------------------------------------------


def compared(case: dict[str, Any], way: str, update: Any, judge: Judge, answer: Any) -> None:
    """Another method, formulation, precision or dimension at the same points: the same stress, or a foreseen refusal."""
    drawn, law = judge.drawn, judge.law
    size = judge.sizes(judge.new, answer.state)[None]
    tolerance = LOOSE * drawn.stress + SHARP * size + 1e-9 * length(answer.stress)
    try:
        if way == "threads":
            other = law.compile(threads=2)(judge.new, judge.old, drawn.dt, **drawn.given)
            if not np.array_equal(other.stress, answer.stress):
                raise Failure("two threads give another stress than one")
        elif way == "tangent off":
            other = law.compile(tangent=False)(judge.new, judge.old, drawn.dt, **drawn.given)
            judge.hold(length(other.stress - answer.stress), tolerance, "without a tangent: another stress")
        elif way == "float32":
            other = law.compile(precision="float32")(judge.new, judge.old, drawn.dt, **drawn.given)
            if other.stress.dtype == np.float32 and not case["extreme"]:
                judge.hold(
                    length(other.stress - answer.stress), 1e-4 * (drawn.stress + size), "float32: another stress"
                )
        elif way == "method":
            by_method(case["method"], judge, answer, tolerance, case["extreme"])
        elif way == "stress":
            by_stress(judge, answer, size, case["extreme"])
        else:
            by_dimension(case["dimension"], judge, case["extreme"])
    except FenchelError as error:
        foreseen(error)


def by_method(method: str, judge: Judge, answer: Any, tolerance: Any, extreme: bool) -> None:
    """A method by its name; an explicit step is of first order and only has to be finite."""
    drawn, count = judge.drawn, 3 if method == "cvxpy" else len(judge.new)
    few = Judge(drawn, judge.before, judge.old, judge.new)
    few.take(np.arange(count))
    certify = method not in ("explicit", "cvxpy")
    other, kept = stepped(judge.law.compile(solver=method), few.new, few.old, drawn, certify=certify)
    if kept.size == 0:
        return
    if method == "explicit":
        if not np.isfinite(other.stress).all():
            raise Failure("explicit: the stress is not finite")
        return
    if method == "cvxpy":
        if extreme:
            return
        # an interior point, neither scaled nor polished: near the answer, in the size of what was asked
        limit = 1e-3 * (drawn.stress + length(few.stress(few.new, few.old)[kept]))
        judge.hold(length(other.stress - answer.stress[kept]), limit, "cvxpy: another stress")
        return
    few.take(kept)
    if extreme and few.finite(other) and uncertain(few, other):
        return
    judge.hold(length(other.stress - answer.stress[kept]), tolerance[kept], f"{method}: another stress than auto")
    few.all(other, method)


def by_stress(judge: Judge, answer: Any, size: Any, extreme: bool) -> None:
    """Driven by the stress that the strain gave: an answer is judged as a step to the strain that it found."""
    drawn = judge.drawn
    update = judge.law.compile(formulation="stress")
    other, kept = stepped(update, answer.stress, judge.old, drawn, certify=True)
    if kept.size == 0:
        return
    few = Judge(drawn, judge.before, judge.old, judge.new)
    few.take(kept)
    few.new = other.strain
    if extreme and few.finite(other) and uncertain(few, other):
        return
    judge.hold(
        length(other.stress - answer.stress[kept]), 1e-12 * length(answer.stress[kept]), "stress: not the given one"
    )
    # the strain is the unknown: what is left of it, powers in ψ multiply in the stress
    few.all(replace(other, tangent=None), "stress formulation", sharp=10 * SHARP)


def by_dimension(name: str, judge: Judge, extreme: bool) -> None:
    """In another dimension, from a virgin state, against three dimensions at the strains that it says."""
    drawn, law = judge.drawn, judge.law
    flat = law.compile(name)
    rng, n = np.random.default_rng(3), 8
    strains = random_strains(rng, n) * drawn.strain
    dimension = flat.dimension
    chosen = strains[:, [dimension.places[i] for i in dimension.given]]
    state = {k: np.zeros_like(v) for k, v in flat.initial_state(n).items()}
    out, kept = stepped(flat, chosen, state, drawn)
    if kept.size == 0:
        return
    full = dimension.embedded(np.asarray(out.strain, dtype=float))
    for part in (out.stress, out.strain, out.tangent, out.dissipation):
        if not np.isfinite(part).all():
            raise Failure(f"{name}: an answer is not finite with status converged")
    if extreme:
        return
    space = law.compile()
    zero = {k: np.zeros_like(v) for k, v in space.initial_state(len(full)).items()}
    whole = space(full, zero, drawn.dt, **drawn.given)
    few = Judge(drawn, np.zeros_like(full), zero, full)
    scale = few.sizes(full, whole.state)[None]
    limit = LOOSE * drawn.stress + 10 * SHARP * scale
    places = [dimension.places[i] for i in dimension.given] if dimension.relaxed else list(dimension.places)
    judge.hold(length(out.stress - whole.stress[:, places]), limit, f"{name}: another stress than in three dimensions")
    if dimension.relaxed:
        free = [dimension.places[i] for i in dimension.relaxed]
        few.hold(length(whole.stress[:, free]), limit, f"{name}: a stress that should be zero")
