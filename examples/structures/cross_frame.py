"""A plane free frame with a cross bar, and simulated FRF tests of it: for studies of FRF calibration.

Rectangle of 1.0 × 0.6 m with a cross bar at x = 0.5 m; steel bars of 20 × 12 mm, which bend about the 12 mm side. The
parameters are the relative moduli of four groups: bottom, top, both sides, cross bar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.arrays import Complexes, Reals
from femtune.fem import FieldRef
from femtune.identification import EqualisedTest, InputKnown, equalised_test
from femtune.identification.kinds import Drawing
from femtune.modal import FrfSet
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    ModelPoint,
    SubspaceDerivative,
    configure,
    constant_damping,
    damping_by_mode,
    parametric_model,
    solve_modes,
)
from femtune.model.full_model import direct
from femtune.model.response import Ports, frf, make_ports
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import (
    FrfResidual,
    FrfScatter,
    ModelWay,
    Scatter,
    UpdateProblem,
    case_without_modes,
    frf_residual,
)
from femtune.uncertainty import Bootstrap, BootstrapRules, BootstrapRun, bootstrap_of, bootstrap_result
from femtune.updating import NoRegularisation, SensitivityMethod, update
from structures.frames import bars, make_structure

GROUPS = ("bottom", "top", "sides", "cross")
TRUTH = np.array([0.12, -0.10, 0.08, -0.15])
E, NU, DENSITY, WIDTH, DEPTH = 2.1e11, 0.3, 7850.0, 0.020, 0.012
LONG, SHORT = 8, 6
MODES = 40
FROM_HZ, TO_HZ = 20.0, 420.0
BOUND = 0.30

_INPUTS = ((0.0, 0.0), (0.25, 0.6))
_OUTPUTS = ((0.0, 0.0), (0.25, 0.6), (1.0, 0.0), (0.5, 0.3), (0.75, 0.0), (0.0, 0.3), (1.0, 0.6))


def cross_frame() -> ConfiguredModel:
    """The frame with its four moduli, held out of its plane."""
    points: dict[tuple[float, float], int] = {}
    parts = [[_line(points, *ends) for ends in group] for group in _LINES]
    xyz = np.array([(x, y, 0.0) for x, y in points])
    area, bending = WIDTH * DEPTH, WIDTH * DEPTH**3 / 12.0
    section = {
        "E": E, "G": E / (2.0 + 2.0 * NU), "rho": DENSITY, "A": area, "I1": DEPTH * WIDTH**3 / 12.0, "I2": bending,
        "J": 3.0 * bending,
    }  # fmt: skip
    beams = [bars(np.concatenate(lines), section, orientation=(0.0, 0.0, 1.0)) for lines in parts]
    structure = make_structure(xyz, beams, consistent_mass=True, lumped_along=0.0)
    fields = [
        Assignment(name, FieldRef("CBAR", 1000 * i + 1 + e, "E"))
        for i, (name, lines) in enumerate(zip(GROUPS, parts))
        for e in range(sum(map(len, lines)))
    ]
    parameters = ParameterSet(tuple(Parameter(name, 1.0, 1.0 - BOUND, 1.0 + BOUND) for name in GROUPS))
    model = parametric_model(structure, parameters, fields)
    supports = tuple((int(node), "345") for node in structure.nodes.ids)
    return configure(model, Configuration(supports_added=supports))


_LINES = (
    [((0.0, 0.0), (1.0, 0.0), LONG)],
    [((0.0, 0.6), (1.0, 0.6), LONG)],
    [((0.0, 0.0), (0.0, 0.6), SHORT), ((1.0, 0.0), (1.0, 0.6), SHORT)],
    [((0.5, 0.0), (0.5, 0.6), SHORT)],
)


def _line(
    points: dict[tuple[float, float], int], a: tuple[float, float], b: tuple[float, float], count: int
) -> np.ndarray:
    """(count, 2) positions of the ends of the elements between two points."""
    along = np.linspace(a, b, count + 1).round(9)
    at = [points.setdefault((float(x), float(y)), len(points)) for x, y in along]
    return np.column_stack([at[:-1], at[1:]])


def ports_of(model: ConfiguredModel) -> Ports:
    """Forces along y at two points; motions along x and y at seven."""
    xy = model.model.structure.nodes.xyz[:, :2]

    def node(point: tuple[float, float]) -> int:
        return 1 + int(np.linalg.norm(xy - point, axis=1).argmin())

    outputs = [f"{node(p)}{axis}+" for p in _OUTPUTS for axis in "XY"]
    return make_ports(model, [f"{node(p)}Y+" for p in _INPUTS], outputs)


def frequency_lines(ratio: float, in_band: int = 3) -> Reals:
    """Lines from 20 to 420 Hz, so many of them in a half-power bandwidth 2ζf."""
    count = int(np.ceil(in_band * np.log(TO_HZ / FROM_HZ) / (2.0 * ratio))) + 1
    return np.geomspace(FROM_HZ, TO_HZ, count)


class DenseModes:
    """Modes of a small model by LAPACK: thousands of calibrations of a hundred DOFs take minutes, not hours."""

    def modes(self, point: ModelPoint, count: int | None, max_hz: float | None) -> EigenSolution:
        """The lowest modes; no Sturm check is needed where all are computed."""
        assert count is not None
        values, shapes = la.eigh(point.stiffness.toarray(), point.mass.toarray(), driver="gvd")
        shift = -0.1 * float(values[3])
        return EigenSolution(point, values[:count], np.ascontiguousarray(shapes[:, :count]), count, shift, shift, 0)

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """As of any solution."""
        return direct.derivative(solution, members, rows)


@dataclass(frozen=True, eq=False)
class KnownAtTruth(FrfResidual):
    """An FRF residual whose functions at the true parameters are known with their derivatives."""

    at_truth: tuple[Complexes, Complexes] = field(default=(np.zeros(0), np.zeros(0)), repr=False)

    def functions(self, model: ModelPoint | EigenSolution, derivatives: bool = False) -> tuple[Complexes, Complexes]:
        """As of any residual."""
        point = model.point if isinstance(model, EigenSolution) else model
        return self.at_truth if np.array_equal(point.x, TRUTH) else super().functions(model, derivatives)


@dataclass(frozen=True)
class Campaigns:
    """Simulated tests with a damping ratio and a noise floor, and their calibrations; called with a seed, one of them.

    Parameters
    ----------
    floor : σ of real and imaginary part of the noise, as a part of the largest magnitude of each FRF
    weighted : whether the residual is weighted by the noise, or all lines alike
    draws : number of linearised bootstrap runs for the intervals
    """

    ratio: float = 0.02
    floor: float = 0.003
    weighted: bool = True
    in_band: int = 3
    draws: int = 1000

    @cached_property
    def model(self) -> ConfiguredModel:
        """The frame."""
        return cross_frame()

    @cached_property
    def way(self) -> ModelWay:
        """40 modes on both sides."""
        return ModelWay("real-modes", (MODES, None), constant_damping(self.ratio), residual_vectors=False)

    @cached_property
    def at_truth(self) -> EigenSolution:
        """Modes at the true parameters."""
        return solve_modes(self.model.at(TRUTH), MODES)

    @cached_property
    def exact(self) -> FrfSet:
        """Accelerances without noise."""
        lines, way = frequency_lines(self.ratio, self.in_band), self.way
        return frf(
            self.at_truth, ports_of(self.model), lines, "accelerance", way.method, damping=way.damping,
            residual_vectors=way.residual_vectors,
        )  # fmt: skip

    def test(self, seed: int) -> FrfSet:
        """The functions with circular noise."""
        chance = np.random.default_rng(seed).standard_normal((2, *self.exact.values.shape))
        size = self.floor * np.abs(self.exact.values).max(axis=2, keepdims=True)
        return replace(self.exact, values=self.exact.values + size * (chance[0] + 1j * chance[1]))

    @cached_property
    def functions(self) -> tuple[Complexes, Complexes]:
        """The functions at the truth and their derivatives, which all tests share."""
        residual, _ = frf_residual(self.at_truth, self.exact, way=self.way)
        return residual.functions(self.at_truth, True)

    def problem(self, seed: int) -> UpdateProblem:
        """The calibration of a test."""
        scatter = FrfScatter(0.0, self.floor) if self.weighted else FrfScatter(0.05)
        residual, _ = frf_residual(self.at_truth, self.test(seed), scatter=scatter, way=self.way)
        facts = {f.name: getattr(residual, f.name) for f in fields(residual)}
        case = case_without_modes(
            self.model, (KnownAtTruth(**facts, at_truth=self.functions),), count=MODES, solver=DenseModes()
        )
        kind: Scatter = "stated" if self.weighted else "estimated"
        return UpdateProblem((case,), self.model.model.parameters, scatter=kind)

    def bootstrap(self, seed: int, method: Drawing = "lines", runs: int = 1000) -> Bootstrap:
        """The bootstrap of a test about its calibration.

        With noise weights the truth is so near that its derivatives serve all steps; otherwise it is a whole update.
        """
        problem, rules = self.problem(seed), BootstrapRules(method, runs)
        start = problem.start(TRUTH)
        names = [p.name for p in problem.parameters.free]
        side = NoRegularisation().side(len(TRUTH))
        if self.weighted:
            steps = bootstrap_of(problem, start, side, names, replace(rules, tolerance=1e-4))
            x = steps.optimum().x
            blocks = problem.follow(x, start, False).blocks
            shared = tuple(replace(new, jacobian=old.jacobian) for new, old in zip(blocks, start.blocks))
            return bootstrap_of(problem, replace(start, x=x, blocks=shared), side, names, rules)
        found = update(problem, SensitivityMethod(tolerance=1e-6), start=start)
        r = found.after.residuals
        return bootstrap_of(problem, found.after, side, names, rules, float(np.sqrt(r @ r / (len(r) - len(TRUTH)))))

    def __call__(self, seed: int) -> Campaign:
        """A test, its calibration and its linearised bootstrap."""
        work = self.bootstrap(seed)
        lower, upper = first_steps_interval(work, self.draws, seed)
        sd = np.sqrt(np.diag(work.fisher_covariance))
        entries = replace(work, rules=replace(work.rules, method="entries"))
        return Campaign(work.at.x, work.sd, entries.sd, sd, lower, upper)


@dataclass(frozen=True, eq=False)
class Campaign:
    """Of one test, each (4,): estimate, linearised standard deviations, Fisher's, and limits of the 95 % intervals."""

    x: Reals
    lines_sd: Reals
    entries_sd: Reals
    fisher_sd: Reals
    lower: Reals
    upper: Reals


def first_steps_interval(work: Bootstrap, runs: int, seed: int) -> tuple[Reals, Reals]:
    """Limits by the first Gauss-Newton steps of all runs at once, without bounds."""
    assert work.drawn is not None
    J, r, group = work.at.jacobian, work.at.residuals, work.drawn.group
    k, lines = J.shape[1], len(work.drawn.stratum)
    matrices, slopes = np.zeros((lines, k, k)), np.zeros((lines, k))
    np.add.at(matrices, group, J[:, :, None] * J[:, None, :])
    np.add.at(slopes, group, J * r[:, None])
    rng = np.random.default_rng([seed, 1])
    counts = np.array([work.drawn.counts(rng) for _ in range(runs)])
    H = np.einsum("bl,lij->bij", counts, matrices)
    steps = -np.linalg.solve(H, (counts @ slopes)[:, :, None])[:, :, 0]
    found = bootstrap_result(work, [BootstrapRun(work.at.x + d, True, 1, 0) for d in steps], [])
    limits = np.array([found.interval(column) for column in found.samples.T])
    return limits[:, 0], limits[:, 1]


# ----------------------------------------------------------------------------------------------------
# Tests of uneven damping, which are identified first.


ZETA = (0.004, 0.02, 0.01, 0.03, 0.006, 0.015, 0.008, 0.02, 0.01, 0.005)
"""Of the elastic modes; those above have 1 %."""
EQUAL = 0.02
LINES = np.arange(20.0, 345.0, 0.4)


@dataclass(frozen=True)
class IdentifiedCampaigns:
    """Simulated tests; called with a seed, the calibration (4,) of one, with an identification of its own.

    Parameters
    ----------
    floor : σ of real and imaginary part of the noise, as a part of the largest magnitude of each FRF
    """

    floor: float = 0.0003

    @cached_property
    def frame(self) -> Campaigns:
        """Its model, and the modes at the true parameters."""
        return Campaigns(ratio=EQUAL)

    @cached_property
    def exact(self) -> FrfSet:
        """Accelerances without noise."""
        zeta = (0.0, 0.0, 0.0, *ZETA, *([0.01] * (MODES - 3 - len(ZETA))))
        return frf(self.frame.at_truth, ports_of(self.frame.model), LINES, "accelerance", damping=damping_by_mode(zeta))

    def test(self, seed: int) -> FrfSet:
        """The functions with circular noise."""
        chance = np.random.default_rng(seed).standard_normal((2, *self.exact.values.shape))
        size = self.floor * np.abs(self.exact.values).max(axis=2, keepdims=True)
        return replace(self.exact, values=self.exact.values + size * (chance[0] + 1j * chance[1]))

    def identified(self, seed: int) -> EqualisedTest:
        """The test with one damping ratio."""
        return equalised_test(self.test(seed), EQUAL, InputKnown(largest_order=26))

    def calibrated(self, seed: int) -> Bootstrap:
        """The bootstrap of a test about its calibration: lines are drawn."""
        work = self._search(seed)
        problem = work.problem
        return replace(work, at=problem.unsolved(problem.follow(work.optimum().x, work.at)), rules=BootstrapRules())

    def _search(self, seed: int) -> Bootstrap:
        """What finds the calibration of a test from the truth."""
        test, model = self.identified(seed), self.frame.model
        way = ModelWay("real-modes", (MODES, None), constant_damping(EQUAL))
        residual, _ = frf_residual(self.frame.at_truth, test.frfs, scatter=FrfScatter(0.0, 0.003), way=way)
        residual = replace(residual, identified=test.redrawn)
        case = case_without_modes(model, (residual,), count=MODES, solver=DenseModes())
        problem = UpdateProblem((case,), model.model.parameters)
        start, names = problem.start(TRUTH), [p.name for p in problem.parameters.free]
        side = NoRegularisation().side(len(TRUTH))
        return bootstrap_of(problem, start, side, names, BootstrapRules(tolerance=1e-3))

    def __call__(self, seed: int) -> Reals:
        """The calibrated parameters."""
        return self._search(seed).optimum().x
