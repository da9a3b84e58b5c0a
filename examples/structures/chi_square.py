"""Every kind of residual on a right model with noisy data: how often is the model rejected at a level of 5 %?

The noise has the standard deviation that is stated, and is drawn on what was measured. The residual is that of the
noisy data, made by its own class; the linearised least-squares fit follows in one projection, for all draws at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.special import chdtrc

from femtune.arrays import Complexes, Reals
from femtune.fem import FieldRef
from femtune.modal import FrfSet
from femtune.model import Assignment, Configuration, EigenSolution, ModelPoint, configure, parametric_model, solve_modes
from femtune.model.damping import ModalDamping, constant_damping
from femtune.model.response import frf, make_ports, mass_response
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import (
    AntiresonanceResidual,
    CaseState,
    CentreResidual,
    ComparedCase,
    ComplexEigenvalueResidual,
    DampingResidual,
    DisplacementResidual,
    DynamicResidual,
    FlexibilityResidual,
    ForceResidual,
    FrequencyCovariance,
    FrequencyResidual,
    FrfForm,
    FrfResidual,
    FrfScatter,
    InertiaResidual,
    MacResidual,
    MassResidual,
    ModelWay,
    OfPairs,
    PairingRules,
    Residual,
    ResidualBlock,
    ShapeResidual,
    StaticTest,
    StrainResidual,
    Weights,
    antiresonance_residual,
    case_without_modes,
    frf_residual,
    measured_antiresonances,
    state_at,
)
from femtune.residuals.frequency import frequency_residual
from femtune.residuals.poles import PoleResidual, pole_of
from femtune.validation import goodness_of_fit
from structures.frames import make_structure
from structures.frames import masses as concentrated
from structures.springs import factor_model, simulated_case, spring_structure, with_poles

LEVEL = 0.05
FREQUENCY_SD, SHAPE_SD, FORCE_SD, MASS_SD, RATIO_SD = 1e-4, 1e-3, 1e-3, 1e-3, 1e-5
SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (3, 4, 600.0), (0, 3, 150.0)]
MODEL = factor_model(spring_structure(SPRINGS, [1.0, 2.0, 1.5, 1.0, 0.8]), {"a": [1, 2], "b": [4], "m": [1002]})
TRUTH = np.array([0.15, -0.2, 0.1])
DAMPED_TRUTH = (0.15, 0.3)
DAMPED = factor_model(
    spring_structure(SPRINGS, [1.0, 2.0, 1.5, 1.0, 0.8], [(-1, 1, 0.8), (3, 4, 1.0)], 0.01),
    {"a": [1, 2, 3], "c": [2001, 2002]},
)
CORRELATED = 0.5 * np.eye(5) + 0.5
UNEQUAL = np.diag([1.0, 2.0, 0.5, 3.0, 1.5])

Draw = Callable[[np.random.Generator], Sequence[ResidualBlock]]


@dataclass(frozen=True)
class Trial:
    """A kind of residual in one of its forms.

    Parameters
    ----------
    exact : the blocks of data without noise, with derivatives
    draw : those of noisy data; what they have of derivatives does not matter
    """

    kind: str
    form: str
    exact: Sequence[ResidualBlock]
    draw: Draw


@dataclass(frozen=True)
class Rejections:
    """What the test says of many draws.

    Parameters
    ----------
    values, freedom : number of residuals, and degrees of freedom
    rate : share of the draws that are rejected at `LEVEL`
    plain_rate : the same if every value were counted as independent
    why_not : why the kind is not tested; the rate is then what the test would give if it were made
    """

    trial: Trial
    values: int
    freedom: int
    rate: float
    plain_rate: float
    why_not: str

    @property
    def tested(self) -> bool:
        """Whether an update tests this kind."""
        return not self.why_not


def rejections(trial: Trial, draws: int, seed: int = 1) -> Rejections:
    """The linear fit and the χ² test of many draws."""
    rng = np.random.default_rng(seed)
    r = np.array([np.concatenate([b.values for b in trial.draw(rng)]) for _ in range(draws)])
    exact = [replace(b, not_normal="") for b in trial.exact]
    freedom = goodness_of_fit(exact).degrees_of_freedom
    root = sp.block_diag([replace(b, jacobian=np.eye(len(b.values))).whitened().jacobian for b in exact])
    J = np.vstack([b.whitened().jacobian for b in exact])
    U, s, _ = np.linalg.svd(J, full_matrices=False)
    U = U[:, s > 1e-10 * s.max()]
    chi2 = _left_over(r @ root.T, U)
    _check(exact, r[0], chi2[0])
    plain = np.linalg.qr(np.vstack([b.jacobian for b in exact]) @ _independent(J))[0]
    plain_rate = float(np.mean(chdtrc(r.shape[1] - U.shape[1], _left_over(r, plain)) < LEVEL))
    why = "; ".join(dict.fromkeys(b.not_normal for b in trial.exact if b.not_normal))
    return Rejections(trial, r.shape[1], freedom, float(np.mean(chdtrc(freedom, chi2) < LEVEL)), plain_rate, why)


def _left_over(r: Reals, U: Reals) -> Reals:
    """(draws,) sums of squares of what no parameters remove; the linear fit takes the part in the range U."""
    return np.asarray(np.sum(r**2, axis=1) - np.sum((r @ U) ** 2, axis=1))


def _independent(J: Reals) -> Reals:
    """(k, rank) combinations of parameters that J depends on."""
    _, s, vt = np.linalg.svd(J, full_matrices=False)
    return np.asarray(vt[s > 1e-10 * s.max()].T)


def _check(exact: Sequence[ResidualBlock], r: Reals, chi2: float) -> None:
    """What is computed for all draws at once is what `goodness_of_fit` computes of one."""
    parts = np.split(r, np.cumsum([len(b.values) for b in exact])[:-1])
    found = goodness_of_fit([replace(b, values=part) for b, part in zip(exact, parts)])
    np.testing.assert_allclose(found.chi_square, chi2, rtol=1e-9)


def trials() -> Iterator[Trial]:
    """Every kind in every form."""
    yield from _of_frequencies()
    for residual in (ShapeResidual, StrainResidual):
        yield from _of_shapes(residual)
    yield from _of_derived_shapes()
    yield from _of_forces()
    yield from _of_masses()
    yield from _of_functions()
    yield from _of_poles()


# ----------------------------------------------------------------------------------------------------
# Modes.


def _case() -> ComparedCase:
    case = simulated_case(MODEL, list(TRUTH), range(5), 4, count=5)
    return replace(case, test=replace(case.test, normalisation="mass"))


def _of_pairs(
    kind: str,
    form: str,
    residual: OfPairs,
    noisy: Callable[..., ComparedCase],
    case: ComparedCase,
    truth: Sequence[float] = tuple(TRUTH),
) -> Trial:
    """A residual of paired modes at the true parameters; the noise changes the test of the case alone."""
    pairs = list(state_at(case, np.array(truth)).pairs(derivatives=True))

    def draw(rng: np.random.Generator) -> Sequence[ResidualBlock]:
        measured = noisy(case, rng)
        return residual.of_pairs([replace(pair, case=measured) for pair in pairs])

    return Trial(kind, form, residual.of_pairs(pairs), draw)


def _of_frequencies() -> Iterator[Trial]:
    case = _case()
    f, covariance = case.test.freq_hz, FREQUENCY_SD**2 * CORRELATED[:4, :4]

    def by_sd(power: float) -> Callable[..., ComparedCase]:
        def noisy(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
            freq = f * (1.0 + FREQUENCY_SD * rng.standard_normal(len(f))) ** power
            return replace(case, test=replace(case.test, freq_hz=freq))

        return noisy

    def together(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
        return replace(case, test=replace(case.test, freq_hz=rng.multivariate_normal(f, covariance)))

    yield _of_pairs("frequency", "frequency", FrequencyResidual(FREQUENCY_SD), by_sd(1.0), case)
    yield _of_pairs("frequency", "eigenvalue", FrequencyResidual(FREQUENCY_SD, "eigenvalue"), by_sd(0.5), case)
    yield _of_pairs("frequency", "covariance", FrequencyCovariance(covariance), together, case)


def _of_poles() -> Iterator[Trial]:
    """A damped chain and a ring with repeated modes, each with a factor on springs and one on dashpots."""
    case = simulated_case(DAMPED, DAMPED_TRUTH, range(5), 4, count=5)
    yield from _of_damped(with_poles(case, DAMPED_TRUTH), DAMPED_TRUTH, "")
    springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    structure = spring_structure(springs, [1.0] * 6, [(-1, i, 0.2) for i in range(6)])
    ring, zero = factor_model(structure, {"a": [1, 4], "c": [2001]}), (0.0, 0.0)
    rules = PairingRules(mac_gate=0.2, relative_gap=0.05)
    case = simulated_case(ring, zero, range(6), 6, rules=rules)
    yield from _of_damped(with_poles(case, zero), zero, ", repeated modes")


def _of_damped(case: ComparedCase, truth: Sequence[float], words: str) -> Iterator[Trial]:
    f, ratio = case.test.freq_hz, case.test.damping_ratio
    assert ratio is not None
    m, poles = len(f), pole_of(f, ratio)
    spread = np.concatenate([FREQUENCY_SD * f, np.full(m, RATIO_SD)])
    joint = np.outer(spread, spread) * (0.5 * np.eye(2 * m) + 0.5)
    case = replace(case, test=replace(case.test, freq_sd_hz=spread[:m], damping_sd=spread[m:], covariance=joint))

    def measured(case: ComparedCase, freq: Reals, ratio: Reals) -> ComparedCase:
        return replace(case, test=replace(case.test, freq_hz=freq, damping_ratio=ratio))

    def of_poles(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
        noise = FREQUENCY_SD * (rng.standard_normal(m) + 1j * rng.standard_normal(m))
        noisy = poles + np.abs(poles) * noise
        return measured(case, np.abs(noisy) / (2.0 * np.pi), -noisy.real / np.abs(noisy))

    def of_ratios(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
        return measured(case, f, ratio * (1.0 + FREQUENCY_SD * rng.standard_normal(m)))

    def by_test(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
        z = np.concatenate([f, ratio]) + spread * rng.standard_normal(2 * m)
        return measured(case, z[:m], z[m:])

    def together(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
        z = rng.multivariate_normal(np.concatenate([f, ratio]), joint)
        return measured(case, z[:m], z[m:])

    forms: list[tuple[str, type[PoleResidual], PoleResidual, Callable[..., ComparedCase]]] = [
        ("sd", ComplexEigenvalueResidual, ComplexEigenvalueResidual(sd=FREQUENCY_SD), of_poles),
        ("sd", DampingResidual, DampingResidual(sd=FREQUENCY_SD), of_ratios),
    ]
    for kind in (ComplexEigenvalueResidual, DampingResidual):
        forms.append(("sd of the test", kind, kind(sd="test"), by_test))
        forms.append(("covariance of the test", kind, kind(covariance="test"), together))
    for form, kind, residual, noisy in forms:
        yield _of_pairs(kind.label, form + words, residual, noisy, case, truth)


def _noisy_shapes(scaling: str, covariance: Reals) -> Callable[..., ComparedCase]:
    """Noise on every entry of the shape in its scale."""
    root = np.linalg.cholesky(covariance)

    def noisy(case: ComparedCase, rng: np.random.Generator) -> ComparedCase:
        shapes = case.test.shapes
        size = np.abs(shapes).max(axis=0) if scaling == "largest-entry" else np.linalg.norm(shapes, axis=0)
        changed = shapes + size * (root @ rng.standard_normal(shapes.shape))
        return replace(case, test=replace(case.test, shapes=changed))

    return noisy


def _of_shapes(residual: type[ShapeResidual]) -> Iterator[Trial]:
    for scaling in ("unit-norm", "scale-factor", "largest-entry", "mass"):
        weights = {
            "": (Weights(SHAPE_SD), SHAPE_SD**2 * np.eye(5)),
            ", deviations of the sensors": (Weights(SHAPE_SD * np.diag(UNEQUAL)), SHAPE_SD**2 * UNEQUAL**2),
            ", covariance": (Weights(covariance=SHAPE_SD**2 * CORRELATED), SHAPE_SD**2 * CORRELATED),
        }
        # strain gauges differ from other sensors in nothing but their rows in the model
        words_of = weights if residual is ShapeResidual else [""]
        for words in words_of:
            weight, covariance = weights[words]
            shapes = residual(weight, scaling)  # type: ignore[arg-type]
            yield _of_pairs(residual.label, scaling + words, shapes, _noisy_shapes(scaling, covariance), _case())
    if residual is ShapeResidual:
        for scaling in ("unit-norm", "mass"):
            yield _of_repeated_modes(scaling)


def _of_repeated_modes(scaling: str) -> Trial:
    """A ring with two pairs of repeated modes, each compared as one subspace."""
    springs = [(i, (i + 1) % 6, 40.0) for i in range(6)] + [(-1, i, 10.0) for i in range(6)]
    ring = factor_model(spring_structure(springs, [1.0] * 6), {"a": [1], "b": [3], "m": [1002]})
    rules = PairingRules(mac_gate=0.2, relative_gap=0.05)
    case = simulated_case(ring, (0.0, 0.0, 0.0), range(6), 6, rules=rules)
    case = replace(case, test=replace(case.test, normalisation="mass"))
    state = state_at(case, np.zeros(3))
    residual, noisy = ShapeResidual(SHAPE_SD, scaling), _noisy_shapes(scaling, SHAPE_SD**2 * np.eye(6))  # type: ignore[arg-type]

    def draw(rng: np.random.Generator) -> Sequence[ResidualBlock]:
        return residual.blocks(CaseState(noisy(case, rng), state.point, state.groups, state.solution), False)

    return Trial("shape", f"{scaling}, repeated modes", residual.blocks(state, True), draw)


def _of_derived_shapes() -> Iterator[Trial]:
    noisy = _noisy_shapes("unit-norm", SHAPE_SD**2 * np.eye(5))
    for form in ("root", "ratio", "difference"):
        # the largest value that noise of one entry gives
        yield _of_pairs("MAC", form, MacResidual(SHAPE_SD**2, form), noisy, _case())  # type: ignore[arg-type]
    for part in ("matrix", "diagonal"):
        yield _of_pairs("flexibility", part, FlexibilityResidual(SHAPE_SD, part), noisy, _case())


# ----------------------------------------------------------------------------------------------------
# Forces: data whose equation error is the noise itself.


def _of_forces() -> Iterator[Trial]:
    for sensors in (tuple(range(5)), (0, 2, 4)):
        yield _of_dynamic(sensors)
    for sensors in (tuple(range(5)), (0, 2, 4)):
        for residual in (DisplacementResidual, ForceResidual):
            yield _of_static(residual, sensors)


def _of_dynamic(sensors: tuple[int, ...]) -> Trial:
    """Noise w on the forces of every DOF: (K − λ_e M)ψ = w gives the data λ_e and ψ, the mode in ψ as it was."""
    case = simulated_case(MODEL, list(TRUTH), sensors, 3, count=5)
    state, modes = state_at(case, TRUTH), solve_modes(MODEL.at(TRUTH), 5)
    residual = DynamicResidual(FORCE_SD)
    # each mode with its largest measured entry one
    at = np.array(case.sensors @ modes.shapes)
    scale = 1.0 / at[np.abs(at).argmax(axis=0), range(5)]

    def measured(i: int, w: Reals) -> tuple[float, Reals]:
        loads = modes.shapes.T @ w
        value = float(modes.eigenvalues[i] - loads[i] / scale[i])
        return value, case.sensors @ (modes.shapes @ (loads / (modes.eigenvalues - value)))

    def draw(rng: np.random.Generator) -> Sequence[ResidualBlock]:
        found = [measured(i, FORCE_SD * rng.standard_normal(5)) for i in range(3)]
        freq = np.sqrt([value for value, _ in found]) / (2.0 * np.pi)
        test = replace(case.test, freq_hz=freq, shapes=np.stack([shape for _, shape in found], axis=1))
        return residual.blocks(replace(state, case=replace(case, test=test)), False)

    return Trial("dynamic", f"{len(sensors)} of 5 DOFs measured", residual.blocks(state, True), draw)


def _of_static(residual: type[DisplacementResidual] | type[ForceResidual], sensors: tuple[int, ...]) -> Trial:
    stiffness = MODEL.at(TRUTH).stiffness.toarray()
    force = np.array([0.0, -4.0, 0.0, 10.0, 2.0])
    n_g = MODEL.transformation.shape[0]
    at = MODEL.free[list(sensors)]
    rows = sp.csr_array((np.ones(len(at)), (range(len(at)), at)), shape=(len(at), n_g))
    load = sp.csr_array((force, (np.zeros(5, int), MODEL.free)), shape=(1, n_g))
    exact = np.linalg.solve(stiffness, force)[list(sensors)]
    state = state_at(case_without_modes(MODEL, ()), TRUTH)
    displaced = residual is DisplacementResidual
    weights = Weights(SHAPE_SD) if displaced else FORCE_SD

    def of(measured: Reals) -> Residual:
        return residual(StaticTest("pull", load, rows, measured), weights)  # type: ignore[arg-type]

    def draw(rng: np.random.Generator) -> Sequence[ResidualBlock]:
        if displaced:
            return of(exact + SHAPE_SD * rng.standard_normal(len(at))).blocks(state, False)
        loads = force + FORCE_SD * rng.standard_normal(5)
        return of(np.linalg.solve(stiffness, loads)[list(sensors)]).blocks(state, False)

    return Trial(residual.label, f"{len(sensors)} of 5 DOFs measured", of(exact).blocks(state, True), draw)


# ----------------------------------------------------------------------------------------------------
# Mass properties.


def _of_masses() -> Iterator[Trial]:
    """Four masses, two of them factors; each property was measured twice."""
    xyz = [[0.5, -0.3, 0.2], [1.0, 0.2, 0.0], [0.3, 1.0, 0.5], [-0.4, 0.1, 0.8]]
    structure = make_structure(xyz, [concentrated([0, 1, 2, 3], {"M": [1.0, 2.0, 1.5, 0.7]})])
    assignments = [Assignment("m", FieldRef("CONM2", 1, "M")), Assignment("n", FieldRef("CONM2", 3, "M"))]
    parameters = ParameterSet((Parameter("m", 1.0, 0.5, 2.0), Parameter("n", 1.0, 0.5, 2.0)))
    model = configure(parametric_model(structure, parameters, assignments), Configuration())
    state = state_at(case_without_modes(model, ()), np.array([0.1, -0.1]))
    origin, found = (0.0, 0.0, 0.0), mass_response(state.full).properties
    upper = np.triu_indices(3)

    def inertia(values: Reals) -> InertiaResidual:
        matrix = np.zeros((3, 3))
        matrix[upper] = values
        return InertiaResidual(matrix + np.triu(matrix, 1).T, origin, Weights(MASS_SD))

    exact = mass_response(state.full, origin).properties.inertia[upper]
    yield _of_property(lambda m: MassResidual(float(m[0]), Weights(MASS_SD)), np.array([found.mass]), state)
    yield _of_property(lambda x: CentreResidual(x, Weights(MASS_SD)), np.asarray(found.centre), state)
    yield _of_property(inertia, exact, state)


def _of_property(make: Callable[[Reals], Residual], exact: Reals, state: CaseState) -> Trial:
    def blocks(measured: Sequence[Reals], derivatives: bool) -> list[ResidualBlock]:
        return [b for values in measured for b in make(values).blocks(state, derivatives)]

    def draw(rng: np.random.Generator) -> Sequence[ResidualBlock]:
        return blocks([exact + MASS_SD * rng.standard_normal(len(exact)) for _ in range(2)], False)

    return Trial(make(exact).label, "measured twice", blocks([exact, exact], True), draw)


# ----------------------------------------------------------------------------------------------------
# Measured FRFs.


class _Solved(FrfResidual):
    """Its model's functions are solved once."""

    known: tuple[Complexes, Complexes]

    def functions(self, model: ModelPoint | EigenSolution, derivatives: bool = False) -> tuple[Complexes, Complexes]:
        """Those that are known."""
        return self.known


def _of_functions() -> Iterator[Trial]:
    modes = solve_modes(MODEL.at(TRUTH), 5)
    ports = make_ports(MODEL, ["1X+", "4X+"], ["1X+", "3X+", "5X+"])
    damping = constant_damping(0.01)
    lines, fine = np.linspace(0.5, 9.0, 25), np.linspace(0.5, 9.0, 600)
    exact = frf(modes, ports, lines, "accelerance", "real-modes", damping=damping)
    for form in ("linear", "log-magnitude", "log-complex"):
        yield _of_frfs(exact, modes, form, damping)  # type: ignore[arg-type]
    light = frf(modes, ports, fine, "accelerance", "real-modes", damping=constant_damping(1e-3))
    yield _of_zeros(light, modes)


def _of_frfs(exact: FrfSet, modes: EigenSolution, form: FrfForm, damping: ModalDamping) -> Trial:
    part = 1e-3
    found, _ = frf_residual(modes, exact, form=form, scatter=FrfScatter(part), way=ModelWay(damping=damping))
    sd = part * np.abs(exact.values) if form == "linear" else np.full(exact.values.shape, part)
    residual = _Solved(found.configuration, found.measured, found.places, sd, found.regions, form, found.way)
    object.__setattr__(residual, "known", found.functions(modes, True))

    def draw(rng: np.random.Generator) -> Sequence[ResidualBlock]:
        shape = exact.values.shape
        noise = part * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
        noisy = replace(residual, measured=replace(found.measured, values=exact.values * (1.0 + noise)))
        object.__setattr__(noisy, "known", residual.known)
        return noisy.compare(modes)

    return Trial(FrfResidual.label, form, residual.compare(modes), draw)


def _of_zeros(exact: FrfSet, modes: EigenSolution) -> Trial:
    found, _ = antiresonance_residual(modes, exact, measured_antiresonances(exact), FREQUENCY_SD)
    # the test's are those of the damped functions; take the undamped ones of the model itself
    off = [float(b.values[0]) * FREQUENCY_SD + 1.0 for b in found.compare(modes, False)]
    true = tuple(replace(z, freq_hz=z.freq_hz * ratio) for z, ratio in zip(_in_order(found), off))
    exact_blocks = replace(found, zeros=true).compare(modes)
    eigenvalue = [(2.0 * np.pi * z.freq_hz) ** 2 for z in true]

    def draw(rng: np.random.Generator) -> Sequence[ResidualBlock]:
        noisy = [z.freq_hz * (1.0 + FREQUENCY_SD * rng.standard_normal()) for z in true]
        values = (frequency_residual(v, np.zeros(0), f, FREQUENCY_SD)[0] for v, f in zip(eigenvalue, noisy))
        return [replace(b, values=v) for b, v in zip(exact_blocks, values)]

    return Trial(AntiresonanceResidual.label, "", exact_blocks, draw)


def _in_order(residual: AntiresonanceResidual) -> list:
    return [z for zeros in residual.by_function() for z in zeros]
