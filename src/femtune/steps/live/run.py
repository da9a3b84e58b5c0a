"""Make the live model of the report: second reduction of the models of an update, with a certificate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.live import LiveModel, LivePorts, SecondBasis, Separated, live_model, second_basis, separated_terms
from femtune.model.live.basis import is_whole
from femtune.model.live.matrices import solved
from femtune.model.reduce import ReducedModel, reduce_model, reduced_modes
from femtune.model.reduce.estimate import extend
from femtune.model.reduce.function_estimate import missed_responses
from femtune.model.reduce.training import candidates
from femtune.model.response import TIMES_HIGHEST_LINE
from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.residual import FrfResidual
from femtune.steps.live.certificate import (
    MOST_ERROR,
    CertifiedLive,
    FirstModel,
    FullModel,
    elastic_groups,
    frequency_error,
)
from femtune.steps.live.frfs import (
    MOST_OUTPUTS,
    ComparedFunctions,
    compared_functions,
    function_percent,
    live_values,
)
from femtune.steps.live.record import (
    LiveCertificate,
    LiveCheck,
    LiveConfiguration,
    LiveDraws,
    LiveFactor,
    LiveFunctionErrors,
    LiveFunctions,
    LiveOtherPart,
    LivePair,
    LiveParameter,
    LivePart,
    LiveRegion,
    LiveResults,
    LiveTermRecord,
)
from femtune.steps.live.residuals import PagePart, page_parts
from femtune.steps.modes.shapes import shape_rows

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.model import ConfiguredModel, EigenSolution
    from femtune.residuals import CaseState, Evaluation
    from femtune.steps.update.run import FoundParameters
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

MOST_PARAMETERS = 40
"""Parameters that a page offers at most."""
SMALL = 250
"""Degrees of freedom up to which a live model is made of the full matrices, which takes a fraction of a second."""
MOST_ORDER = 165
"""Order up to which a page solves the model within 50 ms."""
MOST_BYTES = 3_500_000
"""Bytes of all matrices of a page, of which base64 makes a third more."""
DRAWING_BYTES = 700_000
"""Bytes of the vectors that shapes are drawn with."""
_POINTS = 50
"""Points of the certificate, in the region and within the ranges of the parameters each; there are corners besides."""
_CORNERS = 32
"""Corners of the ranges at most: all of them for up to five parameters, else some that are drawn."""
_FULL_POINTS = 4
"""Points, in the region and in the ranges each, at which the live model of a reduced one is compared with the full one:
the two at which it differs most from the reduced one, and two more."""
MOST_PERCENT = 3.0
"""Error of a frequency, in %, from which no live model is made for these ranges of the parameters."""
_NARROW = 0.25
"""Part of the width of the samples by which narrower ranges go beyond them."""
_REGION_SNAPSHOTS = 24
"""Points of the region at which modes are taken for the second basis."""
_BOUNDS_SNAPSHOTS = 48
"""The same in the bounds, where modes change more."""
_ABOVE = 6
"""Modes above the wanted ones that are taken there: at other points they become some of these."""
_TRAINING = 6
"""The same for the first basis where the full model is solved, in the region and in the bounds each."""
_REGION_TARGET = 3e-5
"""Relative frequency error in the region at which the order is large enough: a third of what a page should keep."""
_BOUNDS_TARGET = 3e-4
"""The same in the bounds."""
_LEVEL = 0.95
_SHOWN = 20
"""Models that the data allow, of those that a page shows."""
_DRAWN_LINEAR = 300
"""Samples of the linearised distribution that a page weighs."""
_MOST_MASS_POINTS = 60
_MOST_CARRIED = 8
"""Points of a reduced live model that can carry a mass: each takes three vectors."""
_UNDETERMINED = 100.0
"""Widths of the samples that a combination of parameters is taken to have where the data leave it undetermined."""
_LEAST_WIDTH = 1e-9
_ORDERS = 1.25
"""Ratio of two orders that are tried one after the other."""
_MOST_MODES = 120
"""Modes up to twice the highest line from which the functions are not drawn: the basis has room for no more."""
_DRAWN = 1e-3
"""Part of a motion that drawing may leave out."""
_SEED = 36
"""Of the points, so that a study gives the same page again."""


def live_results(
    study: Study,
    found: FoundParameters,
    arrays: dict[str, NDArray],
    progress: Progress,
    sampled: Sampled | None = None,
) -> LiveResults | None:
    """The live model at the end of an update; None where there is nothing to change or to show.

    Its arrays go into `arrays`. Where it is not possible, the result says why. `sampled` are the samples of a posterior
    distribution, where there is one.
    """
    result, wanted = found.result, study.file.output.live
    states = [s for s in result.after.states if _shown(s)]
    if wanted is False or not result.parameters.free or not states:
        return None
    reason = _impossible(study, result) or _too_large(found, states, wanted)
    if reason:
        return LiveResults(reason=reason)
    region = _Region.of(result)
    made = _Making(study, found, region, progress, result.parameters.bounds)
    configurations, stored = made.every(states)
    narrowed = ""
    if isinstance(configurations, str) and region is not None:
        narrowed, made.box = configurations, region.box(result, sampled)
        configurations, stored = made.every(states)
    if isinstance(configurations, str):
        return LiveResults(reason=narrowed or configurations)
    stored["live/x"] = np.asarray(result.x, float)
    kinds: dict[str, float] = {}
    for block in result.after.blocks:
        kinds[block.kind] = kinds.get(block.kind, 0.0) + float(block.values @ block.values)
    configurations = _same_kinds(configurations, result.after)
    done = {part.kind for c in configurations for part in c.parts} | _computed_functions(configurations, result.after)
    others = tuple(LiveOtherPart(kind=k, chi_square=v) for k, v in kinds.items() if k not in done)
    arrays |= stored
    return LiveResults(
        parameters=_parameters(result, made.box), narrowed=narrowed, x_key="live/x",
        region=region.record(arrays) if region else None,
        draws=_draws(result, region, sampled, made.box, bool(others), arrays),
        configurations=tuple(configurations), others=others, solutions=made.solutions,
    )  # fmt: skip


def _shown(state: CaseState) -> bool:
    """Whether a page has something to show of a configuration: modes, or FRFs that are compared."""
    case = state.case.on_full_model
    return (case.on_modes and bool(len(state.case.test))) or any(
        isinstance(settled(one), FrfResidual) for one in case.residuals
    )


def _computed_functions(configurations: Sequence[LiveConfiguration], at: Evaluation) -> set[str]:
    """Kinds of FRF residuals of which the page computes all, with the values of the update."""
    kinds = {f.label for c in configurations for f in c.functions if f.label}
    out = set()
    for kind in kinds:
        wanted = {b.configuration for b in at.blocks if b.kind == kind}
        known = {c.configuration: c for c in configurations}
        residuals = {
            s.case.name: [r for r in s.case.on_full_model.residuals if settled(r).label == kind] for s in at.states
        }
        whole = all(
            name in known
            and len([f for f in known[name].functions if f.label == kind and f.sd_key]) == len(residuals.get(name, ()))
            for name in wanted
        )  # fmt: skip
        if whole:
            out.add(kind)
    return out


def _impossible(study: Study, result: UpdateResult) -> str:
    """Why no live model can be made of a study, in words; "" where one can."""
    if study.source.needs_runs:
        return "the model is solved by an external program, whose matrices femtune does not have"
    if study.file.frequency_table:
        return "stiffness or damping depends on frequency"
    if len(result.parameters.free) > MOST_PARAMETERS:
        return f"there are {len(result.parameters.free)} parameters; a page offers up to {MOST_PARAMETERS}"
    return ""


def _too_large(found: FoundParameters, states: Sequence[CaseState], wanted: bool | str) -> str:
    large = [s.case.on_full_model.configured.n_free for s in states if _trained(found, s) is None]
    most = max(large, default=0)
    if wanted is True or most <= SMALL:
        return ""
    compared = 2 * _FULL_POINTS
    return (
        f"the model has {most:,} degrees of freedom and was not reduced for the update; `live = true` in [output] "
        f"makes one from about {2 * _TRAINING + compared} more solutions of each configuration, and with [reduction] "
        f"it takes {compared} of them"
    )


def _trained(found: FoundParameters, state: CaseState) -> tuple[ReducedModel, Reals] | None:
    """The reduced model of the update and its basis; None without one."""
    search = found.search
    for k, i in enumerate([] if search is None else search.reduced):
        assert search is not None
        if search.problem.cases[i].name == state.case.name and len(search.trained[k].basis):
            return search.trained[k].model, search.trained[k].basis
    return None


_Box = tuple["Reals", "Reals"]
"""Lower and upper ends (k,) of the ranges of the normalised parameters."""


def _parameters(result: UpdateResult, box: _Box) -> tuple[LiveParameter, ...]:
    intervals, values, bounds = result.interval(), result.values, result.parameters.bounds
    out = []
    for i, p in enumerate(result.parameters.free):
        low, high = intervals[p.name]
        interval = (low, high) if np.isfinite([low, high]).all() else None
        out.append(
            LiveParameter(
                name=p.name, unit=p.unit, nominal=p.nominal, updated=values[p.name],
                lower=p.lower if box[0][i] == bounds[0][i] else p.nominal + p.scale * float(box[0][i]),
                upper=p.upper if box[1][i] == bounds[1][i] else p.nominal + p.scale * float(box[1][i]),
                scale=p.scale, interval_95=interval,
            )
        )  # fmt: skip
    return tuple(out)


# ----------------------------------------------------------------------------------------------------
# The 95 % region.


@dataclass(frozen=True, eq=False)
class _Region:
    """Points with |A (x − x̂) + b|² ≤ limit within the bounds, and samples of the distribution that are in it."""

    at: Reals
    moving: NDArray[np.bool_]
    rows: Reals
    offset: Reals
    limit: float
    inside: Reals
    size: Reals

    @classmethod
    def of(cls, result: UpdateResult) -> _Region | None:
        posterior = result.covariance.posterior
        if posterior is None or not len(posterior.samples):
            return None
        x = posterior.samples
        d = (x - posterior.at)[:, posterior.moving]
        q = np.sum((d @ posterior.rows.T + posterior.offset) ** 2, axis=1)
        limit = float(np.quantile(q, _LEVEL))
        inside = q <= limit
        return cls(posterior.at, posterior.moving, posterior.rows, posterior.offset, limit, x[inside], q[inside])

    def points(self, count: int, seed: int, certified: bool = False) -> Reals:
        """(count, k) samples: half from the outer half of the region; those to certify are none to train with."""
        random = np.random.default_rng(seed)
        # neighbours in the sequence of the samples are no random halves of it
        half = np.random.default_rng(_SEED).permutation(len(self.inside))[int(certified) :: 2]
        every, size = self.inside[half], self.size[half]
        outer = np.flatnonzero(size >= np.median(size))
        some = random.choice(outer, count // 2, replace=len(outer) < count)
        more = random.choice(len(every), count - count // 2, replace=len(every) < count)
        return every[np.concatenate([some, more])]

    def box(self, result: UpdateResult, sampled: Sampled | None) -> _Box:
        """Ranges about the region, the samples of a posterior distribution and the updated point, within the bounds."""
        x = np.vstack([self.inside, np.asarray(result.x)[None], *([] if sampled is None else [sampled.x])])
        low, high, (lower, upper) = x.min(axis=0), x.max(axis=0), result.parameters.bounds
        more = np.maximum(_NARROW * (high - low), 1e-3 * (upper - lower))
        return np.maximum(low - more, lower), np.minimum(high + more, upper)

    def record(self, arrays: dict[str, NDArray]) -> LiveRegion:
        # combinations that the data leave undetermined are as wide as the samples, many times over
        width = _UNDETERMINED * np.maximum(np.ptp(self.inside[:, self.moving], axis=0), _LEAST_WIDTH)
        both = np.vstack([self.rows, np.diag(1.0 / width)])
        right = np.concatenate([self.offset, np.zeros(len(width))])
        change = -np.linalg.lstsq(both, right, rcond=None)[0]
        least = float(np.sum((self.rows @ change + self.offset) ** 2))
        at = self.at[self.moving]
        stored = {
            "at": at, "rows": self.rows, "offset": self.offset, "centre": at + change,
            "precision": both.T @ both,
        }  # fmt: skip
        arrays |= {f"live/region/{name}": a for name, a in stored.items()}
        keys = {f"{name}_key": f"live/region/{name}" for name in stored}
        return LiveRegion(
            moving=tuple(np.flatnonzero(self.moving).tolist()), limit=self.limit,
            radius_square=max(self.limit - least, 0.0), **keys,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sampled:
    """Samples of a posterior distribution: `x` (n, k), normalised, and their `weights` (n,)."""

    x: Reals
    weights: Reals


def _draws(
    result: UpdateResult, region: _Region | None, sampled: Sampled | None, box: _Box, others: bool,
    arrays: dict[str, NDArray],
) -> LiveDraws | None:  # fmt: skip
    """From the posterior where there is one, else from the linearised distribution."""
    random = np.random.default_rng(_SEED)
    if sampled is not None:
        chosen = random.choice(len(sampled.x), _SHOWN, p=sampled.weights / sampled.weights.sum())
        arrays["live/draws"] = sampled.x[chosen]
        return LiveDraws(source="posterior", x_key="live/draws")
    posterior = result.covariance.posterior
    if region is None or posterior is None:
        return None
    x = posterior.samples
    x = x[random.choice(len(x), min(_DRAWN_LINEAR, len(x)), replace=False)]
    # samples beyond narrowed ranges are beyond the 95 % limit too
    x = x[((x >= box[0]) & (x <= box[1])).all(axis=1)]
    d = (x - posterior.at)[:, posterior.moving]
    arrays["live/draws"] = x
    arrays["live/draws_linear"] = np.sum((d @ posterior.rows.T + posterior.offset) ** 2, axis=1)
    reason = "some residuals are not computed again" if others else ""
    if len(result.side.matrix) and result.smallest_change is None:
        reason = "the update has a side constraint beside the residuals"
    return LiveDraws(
        source="linear", x_key="live/draws", linear_key="live/draws_linear",
        degrees=posterior.degrees if np.isfinite(posterior.degrees) else None,
        factors=tuple(LiveFactor(kind=k, factor=f) for k, f in result.covariance.factors.items()), reason=reason,
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# One configuration.


@dataclass(frozen=True, eq=False)
class _First:
    """The model that the live one is made of.

    Parameters
    ----------
    basis : (n_free, r); None where the model is the full one
    """

    model: ReducedModel
    basis: Reals | None

    def full(self, vectors: Reals) -> Reals:
        """Vectors in the DOFs of the full model."""
        return vectors if self.basis is None else np.asarray(self.basis @ vectors)

    def seen(self, forces: sp.csc_array | None) -> Reals | None:
        """Forces (n_free, f) in the coordinates of the model; None without any."""
        if forces is None:
            return None
        return np.asarray(forces.toarray() if self.basis is None else (forces.T @ self.basis).T)


class _TooManyModesError(Exception):
    """The lines of the functions reach over more modes than a page has room for."""

    def __init__(self, count: int) -> None:
        super().__init__(f"there are {count} modes up to twice the highest line, and a page takes {_MOST_MODES}")


@dataclass(eq=False)
class _Making:
    """Makes the live models of all configurations for ranges of the parameters."""

    study: Study
    found: FoundParameters
    region: _Region | None
    progress: Progress
    box: _Box
    solutions: int = 0
    known: dict[str, _First] = field(default_factory=dict)
    functions: dict[str, tuple[tuple[ComparedFunctions, ...], str]] = field(default_factory=dict)

    @property
    def result(self) -> UpdateResult:
        return self.found.result

    def every(self, states: Sequence[CaseState]) -> tuple[list[LiveConfiguration] | str, dict[str, NDArray]]:
        """The records with their arrays, or why they cannot be made for these ranges."""
        out: list[LiveConfiguration] = []
        arrays: dict[str, NDArray] = {}
        for i, state in enumerate(states):
            self.progress.step(f"live model: {state.case.name}", i, len(states))
            one = self._configuration(i, state, arrays)
            if isinstance(one, str):
                return one, {}
            out.append(one)
        return out, arrays

    def _configuration(self, number: int, state: CaseState, arrays: dict[str, NDArray]) -> LiveConfiguration | str:
        configured, x = state.case.on_full_model.configured, np.asarray(self.result.x, float)
        count, name = state.solution.wanted, state.case.name
        try:
            groups = separated_terms(configured, x, ("stiffness", "mass"), self.box)
            if isinstance(groups, str):
                return groups
            if name not in self.known:
                case = next(c for c in (self.found.study or self.study).cases if c.name == name)
                self.functions[name] = compared_functions(self.study, case, state, x)
                try:
                    self.known[name] = self._first(state, configured, count)
                except _TooManyModesError as error:
                    self.functions[name] = (), str(error)
                    self.known[name] = self._first(state, configured, count)
            return self._made(state, self.known[name], groups, x, count, f"live/{number + 1}", arrays)
        except FemtuneError as error:
            return f"the model cannot be solved at all values of the parameters: {error.what}"
        except np.linalg.LinAlgError:
            return f"K − σM is not positive definite at some values of the parameters ({name})"

    def _made(
        self, state: CaseState, first: _First, groups: Sequence[Separated], x: Reals, count: int, prefix: str,
        arrays: dict[str, NDArray],
    ) -> LiveConfiguration | str:  # fmt: skip
        snapshots = (
            [] if is_whole(first.model)
            else [*self._region_points(_REGION_SNAPSHOTS, 1), *self._bounds_points(_BOUNDS_SNAPSHOTS, 1)]
        )  # fmt: skip
        case = next(c for c in (self.found.study or self.study).cases if c.name == state.case.name)
        points, parts = _mass_points(case, first), []
        if points and not is_whole(first.model):
            parts.append(sp.csc_array(_translations(points, case).T))
        if (driven := _forces(self.functions[case.name][0])) is not None:
            parts.append(driven)
        forces = first.seen(sp.csc_array(sp.hstack(parts, format="csc")) if parts else None)
        most = min(MOST_ORDER, first.model.order)
        basis = second_basis(first.model, x, snapshots, count + _ABOVE, most, forces)
        vectors, model = self._smallest(first, basis, groups, x, count)
        if not model.terms:
            return f"no parameter changes stiffness or mass ({state.case.name})"
        return self._record(case, state, first, vectors, model, points, prefix, arrays)

    def _first(self, state: CaseState, configured: ConfiguredModel, count: int) -> _First:
        trained, functions = _trained(self.found, state), self.functions[state.case.name][0]
        if trained is None and configured.n_free <= SMALL:
            return _First(reduce_model(configured, np.eye(configured.n_free), shift=float(state.solution.shift)), None)
        forces, solution = _forces(functions), None
        if forces is not None:
            solution = self._up_to_lines(state, configured, functions)
            count = max(count, solution.wanted)
        if trained is None:
            return self._region_trained(state, configured, count, forces, solution)
        if solution is None or forces is None or all(f.label for f in functions):
            return _First(*trained)
        # a basis that was trained for modes alone
        model, basis = trained
        metric = state.full.symmetric_stiffness.plus(-model.shift, state.full.symmetric_mass)
        basis = extend(basis, np.hstack([solution.shapes, missed_responses(solution, forces)]), metric)
        return _First(reduce_model(configured, basis, shift=model.shift), basis)

    def _up_to_lines(
        self, state: CaseState, configured: ConfiguredModel, functions: Sequence[ComparedFunctions]
    ) -> EigenSolution:
        """Modes of the full model at the updated point up to twice the highest line."""
        top = TIMES_HIGHEST_LINE * max(float(f.freq_hz[-1]) for f in functions)
        solution = state.case.on_full_model.solver.modes(configured.at(np.asarray(self.result.x)), None, top)
        self.solutions += 1
        if solution.wanted > _MOST_MODES:
            raise _TooManyModesError(solution.wanted)
        return solution

    def _region_trained(
        self, state: CaseState, configured: ConfiguredModel, count: int, forces: sp.csc_array | None,
        at_update: EigenSolution | None,
    ) -> _First:  # fmt: skip
        """From modes of the full model at the updated point, in the region and in the bounds."""
        points = [*self._region_points(_TRAINING, 2), *self._bounds_points(_TRAINING, 2)]
        columns, solver, shift = [state.solution.shapes], state.case.on_full_model.solver, float(state.solution.shift)
        if at_update is not None and forces is not None:
            columns += [at_update.shapes, missed_responses(at_update, forces)]
        for i, x in enumerate(points):
            self.progress.step(f"live model of {state.case.name}: solutions of the full model", i, len(points))
            solution = solver.modes(configured.at(x), count, None)
            columns.append(solution.shapes)
            if forces is not None:
                columns.append(missed_responses(solution, forces))
        self.solutions += len(points)
        metric = state.point.symmetric_stiffness.plus(-shift, state.point.symmetric_mass)
        columns = [c[:, (size := np.linalg.norm(c, axis=0)) > 0.0] / size[size > 0.0] for c in columns]
        basis = np.linalg.qr(np.hstack(columns))[0]
        gram = basis.T @ (metric @ basis)
        size, turned = np.linalg.eigh(0.5 * (gram + gram.T))
        basis = basis @ (turned / np.sqrt(size))
        return _First(reduce_model(configured, basis, shift=shift), basis)

    def _region_points(self, count: int, seed: int, certified: bool = False) -> Reals:
        k = len(self.result.x)
        return np.zeros((0, k)) if self.region is None else self.region.points(count, _SEED + seed, certified)

    def _bounds_points(self, count: int, seed: int) -> Reals:
        return candidates(*self.box, count - count // 4, count // 4, _SEED + 10 * seed)

    def _corners(self) -> Reals:
        """(c, k) corners of the ranges: all of them for few parameters, else both ends and some that are drawn."""
        k, (lower, upper) = len(self.result.x), self.box
        if 2**k <= _CORNERS:
            high = (np.arange(2**k)[:, None] >> np.arange(k)) & 1
        else:
            drawn = np.random.default_rng(_SEED).integers(0, 2, (_CORNERS - 2, k))
            high = np.vstack([np.zeros(k, int), np.ones(k, int), drawn])
        return np.where(high == 1, upper, lower)

    def _smallest(
        self, first: _First, basis: SecondBasis, groups: Sequence[Separated], x: Reals, count: int
    ) -> tuple[Reals, LiveModel]:
        """The live model of the lowest order whose errors at some points are small enough, else of the largest one."""
        most = basis.vectors.shape[1]
        tried = [(_REGION_TARGET, self._region_points(6, 4)), (_BOUNDS_TARGET, self._bounds_points(8, 4))]
        whole = is_whole(first.model)
        some = [] if whole else [(target, p) for target, points in tried for p in points]
        known = [(target, p, _solved_first(first.model, p, count)) for target, p in some]
        order, last = float(most if whole else min(basis.count + 8, most)), None
        while True:
            vectors = basis.leading(round(order))
            model = live_model(first.model, vectors, groups, x, count, box=self.box)
            room = sum(t.triangle.nbytes for t in model.terms) <= MOST_BYTES // max(1, len(self.result.after.states))
            if not room and last is not None:
                return last
            last = vectors, model
            live = [solved(model, p) for _, p, full in known if full is not None]
            wanted = [(target, full) for target, _, full in known if full is not None]
            if all(m is not None and frequency_error(m.eigenvalues, full) <= t for m, (t, full) in zip(live, wanted)):
                return last
            if round(order) >= most:
                return last
            order = min(order * _ORDERS, float(most))

    def _record(
        self, case: StudyCase, state: CaseState, first: _First, vectors: Reals, model: LiveModel,
        points: Sequence[int], prefix: str, arrays: dict[str, NDArray],
    ) -> LiveConfiguration | str:  # fmt: skip
        test, residuals = state.case.test, self.study.problem().residuals
        full = first.full(vectors)
        sensors = np.asarray(state.case.on_full_model.sensors @ full, np.float32)
        groups = elastic_groups(state, model)
        known = {i for tests, _ in groups for i in tests}
        parts = page_parts(self.result.after, self.result.after.states.index(state), residuals, known)
        certified = CertifiedLive(model, sensors.astype(float), state, parts)
        chosen, why_not = self.functions[case.name]
        ports = [_ports_of(f, full, model) for f in chosen]
        (region, bounds, region_full, bounds_full), errors = self._certificates(
            certified, first, vectors, full, [(f, p) for f, p in zip(chosen, ports)]
        )
        worst = max(c.frequency_percent for c in (region, bounds, region_full, bounds_full) if c is not None)
        if worst > MOST_PERCENT:
            return _too_inaccurate(worst, model.order, state.case.name)
        polynomials = np.concatenate([np.zeros(0), *(t.function.coefficients.ravel() for t in model.terms)])
        starts = np.cumsum([0, *(t.function.coefficients.size for t in model.terms)])
        weights = np.concatenate([np.zeros(0), *(p.weights.ravel() for p in parts if p.weights is not None)])
        stored: dict[str, NDArray] = {
            "theta": model.theta,
            "triangles": np.array([t.triangle for t in model.terms]).reshape(len(model.terms), -1),
            "polynomials": polynomials,
            "sensors": sensors,
            "test_shapes": np.asarray(test.shapes, float),
            "weights": weights,
            **self._drawing(case, full, model),
            **self._mass_rows(points, case, full),
        }
        functions = [_function_record(f, p, e, f"{prefix}/functions_{i}", arrays)
                     for i, (f, p, e) in enumerate(zip(chosen, ports, errors))]  # fmt: skip
        checks = []
        inside = self._region_points(1, 6)
        for i, x in enumerate([*inside, *self._bounds_points(3 - len(inside), 6)]):
            modes = solved(model, x)
            if modes is not None:
                stored |= {f"check_{i}_x": np.asarray(x), f"check_{i}": modes.eigenvalues}
                keys = {"x_key": f"{prefix}/check_{i}_x", "eigenvalues_key": f"{prefix}/check_{i}"}
                sums = tuple(float(np.sum(np.abs(p.values(model, np.asarray(x))) ** 2)) for p in ports)
                checks.append(LiveCheck(chi_square=certified.chi_square(modes), functions=sums, **keys))
        arrays |= {f"{prefix}/{name}": a for name, a in stored.items()}
        drawn = {name: f"{prefix}/{name}" for name in ("drawing", "drawing_weights", "mass_rows") if name in stored}
        return LiveConfiguration(
            configuration=case.name, order=model.order, dofs=state.case.on_full_model.configured.n_free,
            count=model.count, shift=model.shift,
            theta_key=f"{prefix}/theta",
            terms=tuple(
                LiveTermRecord(
                    kind="mass" if t.kind == "mass" else "stiffness", parameters=t.function.parameters,
                    shape=t.function.coefficients.shape[1:], first=int(first_at), scale=t.scale,
                )
                for t, first_at in zip(model.terms, starts)
            ),
            triangles_key=f"{prefix}/triangles", polynomials_key=f"{prefix}/polynomials",
            sensors_key=f"{prefix}/sensors", test_shapes_key=f"{prefix}/test_shapes",
            sensor_labels=tuple(map(str, test.dofs)),
            mass_points=tuple(f"grid {n}" for n in points),
            test_labels=tuple(test.labels),
            test_freq_hz=tuple(map(float, test.freq_hz)),
            pairs=tuple(
                LivePair(test=i, mode=j, modes=tuple(models))
                for tests, models in groups for i, j in zip(tests, models)
            ),
            parts=_part_records(parts), weights_key=f"{prefix}/weights",
            region=region, bounds=bounds, region_full=region_full, bounds_full=bounds_full, checks=tuple(checks),
            drawing_key=drawn.get("drawing"), drawing_weights_key=drawn.get("drawing_weights"),
            mass_rows_key=drawn.get("mass_rows"), functions=tuple(functions), functions_reason=why_not,
        )  # fmt: skip

    def _certificates(
        self, certified: CertifiedLive, first: _First, vectors: Reals, full: Reals,
        functions: Sequence[tuple[ComparedFunctions, LivePorts]],
    ) -> tuple[_Certificates, list[_FunctionErrors]]:  # fmt: skip
        """In the region and the ranges, beside the model that the live one is made of, and both beside the full one;
        and the errors of the functions beside the full one."""
        state, corners = certified.state, self._corners()
        case = state.case.on_full_model
        rows = np.asarray(case.sensors.toarray() if first.basis is None else case.sensors @ first.basis)
        other = FirstModel("full model" if first.basis is None else "reduced model", first.model, rows, vectors)
        region = self._region_points(_POINTS, 5, certified=True)
        bounds = np.vstack([candidates(*self.box, _POINTS, 0, _SEED + 50), corners])
        inside, inside_errors = certified.beside(other, region, 0)
        wide, wide_errors = certified.beside(other, bounds, len(corners))
        assert wide is not None
        too_large = max(inside_errors.max(initial=0.0), wide_errors.max()) > MOST_PERCENT
        if too_large or (first.basis is None and not functions):
            return (inside, wide, None, None), [(None, None) for _ in functions]
        done = iter(range(2 * _FULL_POINTS))
        found: list[list[tuple[float, int]]] = [[] for _ in functions]

        def told() -> None:
            self.progress.step(f"live model of {state.case.name} beside the full model", next(done), 2 * _FULL_POINTS)
            self.solutions += 1

        def also(x: Reals, solution: EigenSolution) -> None:
            for (one, ports), percents in zip(functions, found):
                values = live_values(ports, certified.live, x)
                percents.append((MOST_ERROR, 0) if values is None else function_percent(values, one.of_full(solution)))

        # the functions of the full model have modes up to twice the highest line
        least = max((p.count for _, p in functions), default=0)
        whole = FullModel(state, case.configured, full, told, least, also)
        at, beyond = _to_compare(inside_errors, len(region)), _to_compare(wide_errors, _POINTS)
        inside_full, _ = certified.beside(whole, region[at], 0)
        of_region = [_function_errors(one, p) for (one, _), p in zip(functions, found)]
        for percents in found:
            percents.clear()
        wide_full, _ = certified.beside(whole, bounds[beyond], sum(i >= _POINTS for i in beyond))
        errors = list(zip(of_region, [_function_errors(one, p) for (one, _), p in zip(functions, found)]))
        if first.basis is None:
            inside_full = wide_full = None
        return (inside, wide, inside_full, wide_full), errors

    @staticmethod
    def _mass_rows(points: Sequence[int], case: StudyCase, full: Reals) -> dict[str, NDArray]:
        """Translations of the points that can carry a mass."""
        if not points:
            return {}
        rows = _translations(points, case)
        return {"mass_rows": np.asarray(rows @ full, np.float32).reshape(len(points), 3, -1)}

    def _drawing(self, case: StudyCase, full: Reals, model: LiveModel) -> dict[str, NDArray]:
        """Vectors in which the shapes of the points lie, in steps of 8 bits, and their parts in the live model."""
        shown = shape_rows(case)
        points = len(shown.mesh.used)
        if not points:
            return {}
        motion = np.asarray(sp.csr_array(shown.matrix[: 3 * points]) @ full)
        where = [model.at, *self._region_points(4, 7), *self._bounds_points(8, 7)]
        shapes = np.hstack([m.shapes for x in where if (m := solved(model, x)) is not None])
        seen = motion @ shapes
        seen /= np.maximum(np.linalg.norm(seen, axis=0), 1e-300)
        left, size, _ = np.linalg.svd(seen, full_matrices=False)
        most = max(model.count, DRAWING_BYTES // (3 * points * max(1, len(self.result.after.states))))
        left = left[:, : min(int((size > _DRAWN * size[0]).sum()), most)]
        steps = np.abs(left).max(axis=0) / 127.0
        return {
            "drawing": np.round(left / steps).astype(np.int8).reshape(points, 3, -1),
            "drawing_weights": np.asarray(steps[:, None] * (left.T @ motion), np.float32),
        }


def _forces(functions: Sequence[ComparedFunctions]) -> sp.csc_array | None:
    """(n_free, f) unit forces at the inputs and at some outputs, each once; None without functions."""
    parts = [m for f in functions for m in (f.ports.inputs, f.ports.outputs.T[:, :MOST_OUTPUTS])]
    if not parts:
        return None
    together = sp.csc_array(sp.hstack(parts, format="csc")).toarray()
    return sp.csc_array(np.unique(np.where(_leading(together) < 0.0, -together, together), axis=1))


def _leading(columns: Reals) -> Reals:
    """The first entry of each column that is not zero."""
    return np.asarray(columns[np.argmax(columns != 0.0, axis=0), np.arange(columns.shape[1])])


def _ports_of(one: ComparedFunctions, full: Reals, model: LiveModel) -> LivePorts:
    """The functions on the live model, with the rows as they are stored."""
    seen, driven = (
        np.asarray(np.asarray(r @ full), np.float32).astype(float) for r in (one.ports.outputs, one.ports.inputs.T)
    )
    return LivePorts(one.kind, seen, driven, one.freq_hz, one.modes(model), one.damping)


_Certificates = tuple[LiveCertificate | None, LiveCertificate, LiveCertificate | None, LiveCertificate | None]
_FunctionErrors = tuple[LiveFunctionErrors | None, LiveFunctionErrors | None]


def _function_errors(one: ComparedFunctions, found: Sequence[tuple[float, int]]) -> LiveFunctionErrors | None:
    if not found:
        return None
    percent, worst = max(found)
    output, of_input = divmod(worst, len(one.inputs))
    return LiveFunctionErrors(
        points=len(found), percent=min(percent, MOST_ERROR), function=f"{one.outputs[output]} by {one.inputs[of_input]}"
    )


def _function_record(
    one: ComparedFunctions, ports: LivePorts, errors: _FunctionErrors, prefix: str, arrays: dict[str, NDArray]
) -> LiveFunctions:
    stored: dict[str, NDArray] = {"hz": ports.freq_hz, "test": one.test, "outputs": ports.outputs.astype(np.float32),
              "inputs": ports.inputs.astype(np.float32)}  # fmt: skip
    if one.sd is not None:
        stored["sd"] = one.sd
    if one.shift is not None:
        stored["shift"] = one.shift
    arrays |= {f"{prefix}/{name}": array for name, array in stored.items()}
    return LiveFunctions(
        kind=one.kind, unit=one.unit, look=one.look, outputs=one.outputs, inputs=one.inputs,
        freq_key=f"{prefix}/hz", every=one.every, test_values_key=f"{prefix}/test", outputs_key=f"{prefix}/outputs",
        inputs_key=f"{prefix}/inputs", modes=ports.count, damping=one.how,
        damping_ratios=tuple(map(float, one.damping.ratios)), damping_hz=tuple(map(float, one.damping.freq_hz)),
        hysteretic=one.damping.hysteretic, loss_factor=one.damping.loss_factor, label=one.label, form=one.form,
        sd_key=f"{prefix}/sd" if "sd" in stored else None, shift_key=f"{prefix}/shift" if "shift" in stored else None,
        region=errors[0], bounds=errors[1],
    )  # fmt: skip


def _same_kinds(configurations: list[LiveConfiguration], at: Evaluation) -> list[LiveConfiguration]:
    """Without parts of kinds that the page can compute in some of the configurations only."""
    every = {(b.kind, b.configuration) for b in at.blocks}
    done = {(p.kind, c.configuration) for c in configurations for p in c.parts}
    whole = {kind for kind, _ in every if all(pair in done for pair in every if pair[0] == kind)}
    return [c.model_copy(update={"parts": tuple(p for p in c.parts if p.kind in whole)}) for c in configurations]


def _to_compare(errors: Reals, inner: int) -> list[int]:
    """Positions of the two points with the largest errors, of the first inner point and of the last one (a corner where
    there are corners), filled up with further inner ones."""
    worst = np.argsort(-errors, kind="stable")[:2].tolist()
    order = [*worst, 0, len(errors) - 1, *range(1, inner)]
    return list(dict.fromkeys(i for i in order if 0 <= i < len(errors)))[:_FULL_POINTS]


def _too_inaccurate(percent: float, order: int, configuration: str) -> str:
    if percent >= MOST_ERROR:
        return (
            f"at some values of the parameters either the model or a live model of order {order} has no modes, and the "
            f"other one has some ({configuration})"
        )
    return (
        f"a live model of order {order} would have errors of {percent:.2g} % at some values of the parameters, and the "
        f"limit is {MOST_PERCENT:.0f} % ({configuration})"
    )


def _mass_points(case: StudyCase, first: _First) -> list[int]:
    """Grid points of sensors at which a mass can be added: all of a model that is kept whole, and of one with the full
    matrices some whose static responses are put into the second basis."""
    if first.basis is not None:
        return []
    matches = () if case.sensors is None else case.sensors.matches
    known = set(case.configured.model.structure.nodes.ids.tolist())
    points = [n for n in dict.fromkeys(m.node for m in matches if m.node is not None) if n in known]
    if is_whole(first.model):
        return points[:_MOST_MASS_POINTS]
    spread = np.linspace(0, len(points) - 1, min(len(points), _MOST_CARRIED)).round().astype(int)
    return [points[i] for i in sorted(set(spread.tolist()))]


def _translations(points: Sequence[int], case: StudyCase) -> sp.csr_array:
    """(3 points, n_free) rows that see the translations of grid points."""
    at = [case.configured.model.structure.nodes.position(n) for n in points]
    return sp.csr_array(case.configured.transformation[(6 * np.array(at)[:, None] + np.arange(3)).ravel()])


def _part_records(parts: Sequence[PagePart]) -> tuple[LivePart, ...]:
    out, first = [], 0
    for p in parts:
        at = None if p.weights is None else first
        first += 0 if p.weights is None else p.weights.size
        out.append(
            LivePart(
                kind=p.kind, quantity=p.quantity, form=p.form, test=p.test, sd=p.sd,
                sensors=tuple(p.sensors.tolist()), weights_first=at,
                weights_size=0 if p.weights is None else len(p.weights), common=p.common,
            )
        )  # fmt: skip
    return tuple(out)


def _solved_first(model: ReducedModel, x: Reals, count: int) -> Reals | None:
    try:
        return reduced_modes(model.at(x), count).eigenvalues[:count]
    except FemtuneError:
        return None
