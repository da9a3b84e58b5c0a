"""An update on reduced models that is checked on the full model: the bases are enriched until both agree."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.executor import Executor
from femtune.model import EigenSolution, ModelPoint
from femtune.model.eigen.slepc import slepc_is_chosen
from femtune.model.reduce import (
    Components,
    ComponentTrainer,
    Division,
    Trained,
    Trainer,
    TrainingRules,
    TrainingStatus,
    certified_error,
    divide,
    modes_nearby,
)
from femtune.model.reduce.estimate import DEPENDENT
from femtune.residuals import CaseState, ComparedCase, Evaluation, FrfResidual, ResidualBlock, UpdateProblem
from femtune.residuals.frf.model_way import settle_all
from femtune.residuals.frf.on_reduced import ReducedFrfs, modes_for, port_rows, served, wanted_of
from femtune.residuals.frf.residual import KnownFunctions
from femtune.residuals.state import reduced_case
from femtune.updating.equation_error import equation_error_phases
from femtune.updating.minimum import MinimumRules, look_further
from femtune.updating.result import Iteration, UpdateResult
from femtune.updating.sensitivity_method import (
    SensitivityMethod,
    Walk,
    certificate,
    linear_model,
    moving_parameters,
    update,
)
from femtune.updating.starts import DEFAULT_RULES, MultiStart, Sample, StartResult, StartRules, follow_up, multi_start

SEARCH = 10.0
"""Ratio of the tolerance during the search to that at the final point."""
KEPT = 3
"""Full solutions reserved for the final points of searches."""
RANKED_FROM = 5_000
"""DOFs from which candidates of a training are ranked, as an estimate at each of them would cost too much."""
_ABOVE_LINES = 1.1
"""Modes up to this many times the highest line of FRFs are trained for as modes, those above by their responses."""
_DETERMINED = 1e-10
"""Singular value of a Jacobian, relative to the largest, below which a direction is rounding."""
_FINER_RESPONSES = 0.1
"""Factor on the tolerance of FRFs where a basis is trained again because it was not accurate enough."""
_BEGUN = "basis that a training begins with"
_STEPS = 1
"""Steps of inverse iteration in a training: one step reduces an error of 1 % of a frequency to 0.01 % or less."""


class Told(Protocol):
    """Receiver of the progress of an update on reduced models."""

    def trained(self, name: str, trained: Trained) -> None:
        """After every full solution of the training of a configuration."""
        ...

    def estimated(self, name: str, trained: Trained, count: int) -> None:
        """After every estimate: `count` candidates were estimated with this basis, of those in `trained.points`."""
        ...

    def searched(self, number: int) -> None:
        """Search `number` has ended; the full models are solved next."""
        ...


class _Nobody:
    """Ignores all progress."""

    def trained(self, name: str, trained: Trained) -> None:
        """Nothing."""

    def estimated(self, name: str, trained: Trained, count: int) -> None:
        """Nothing."""

    def searched(self, number: int) -> None:
        """Nothing."""


@dataclass(frozen=True)
class ReductionRules:
    """Tolerances and limits of reduced models.

    Parameters
    ----------
    tolerance : relative frequency error, certified by a full solution where the search ends
    full_solutions : of each configuration at most, the first one and those that certify included
    order : of each reduced model at most
    components : with them, models of configurations with at least two components are assembled from reduced components
    frf_tolerance : what the difference of the FRFs of reduced and full models may move parameters at the end, in their
        standard deviations
    """

    tolerance: float = 1e-4
    full_solutions: int = 20
    order: int = 600
    components: Components | None = None
    frf_tolerance: float = 0.01


@dataclass(frozen=True)
class ReducedComponent:
    """A component of a reduced model.

    Parameters
    ----------
    dofs, interface_dofs : free DOFs of its own and at the interface
    max_hz, modes : its fixed-interface modes where the training began, up to a frequency
    vectors : its own coordinates at the end: these modes, those of other points, and parts of full modes
    builds : points at which it was computed
    """

    name: str
    dofs: int
    interface_dofs: int
    max_hz: float
    modes: int
    vectors: int
    builds: int


@dataclass(frozen=True)
class ReducedCaseFacts:
    """The reduced model of one configuration at the end.

    Parameters
    ----------
    order : of the last model
    full_solutions : of the full model for its modes: those of the training and one where each search ended
    estimate : worst estimated relative frequency error at the candidates of the box, before the search
    certified_error : worst true one at the end point, of the model that the search used; NaN where none was made
    status : how the training before the search ended
    components : the components that it is assembled from; none where the basis is of the whole
    truncation : worst true error where the training began, of the components' truncated modes; NaN without components
    interface_dofs : DOFs of all interfaces; None without components
    functions : number of FRF residuals that the model serves
    """

    configuration: str
    order: int
    full_solutions: int
    estimate: float
    certified_error: float
    status: TrainingStatus
    components: tuple[ReducedComponent, ...] = ()
    truncation: float = float("nan")
    interface_dofs: int | None = None
    functions: int = 0


@dataclass(frozen=True)
class FrfAgreement:
    """FRF residuals of reduced models at one point, without and with the full models' modes and responses there.

    Parameters
    ----------
    mean, largest : root mean square and largest difference of their values, in standard deviations
    shift : how far the difference moves the combination of parameters that it moves most, in its standard deviation
        as the FRFs determine it
    compared : False where the full models' modes and responses lie within the bases up to linear dependence, so that
        there is no difference
    """

    mean: float
    largest: float
    shift: float
    compared: bool = True


@dataclass(frozen=True)
class Agreement:
    """Reduced models beside the full ones at one point.

    Parameters
    ----------
    frequencies : worst relative frequency error of each
    functions : of the FRF residuals; None if the reduced models serve none
    """

    frequencies: tuple[float, ...]
    functions: FrfAgreement | None

    @property
    def frequency(self) -> float:
        """The largest frequency error."""
        return max(self.frequencies, default=0.0)

    def within(self, rules: ReductionRules) -> bool:
        """True within the tolerances."""
        same = self.functions is None or self.functions.shift <= rules.frf_tolerance
        return self.frequency <= rules.tolerance and same


def frf_agreement(reduced: Sequence[ResidualBlock], better: Sequence[ResidualBlock]) -> FrfAgreement:
    """Blocks of the reduced models beside those of the same models with the full ones' modes and responses."""
    off = np.concatenate([b.values - r.values for r, b in zip(reduced, better, strict=True)])
    jacobian = np.concatenate([r.jacobian for r in reduced])
    U, size, _ = la.svd(jacobian, full_matrices=False)
    U = U[:, size > _DETERMINED * size.max(initial=0.0)]
    return FrfAgreement(
        float(np.sqrt(np.mean(off**2))), float(np.abs(off).max(initial=0.0)), float(np.linalg.norm(U.T @ off))
    )


@dataclass(frozen=True)
class ReducedUpdate:
    """An update on reduced models; `result` is of the full model at the end point.

    Parameters
    ----------
    cases : facts of each configuration
    rounds : what happened each time the search ended, a sentence each
    certified : True where full and reduced models agree within the tolerances at the end point
    search : the reduced models, enriched at the end, from which another update may go on; None if nothing was
        reduced
    functions : agreement of the FRFs at the end point; None if the reduced models serve none
    """

    result: UpdateResult
    cases: tuple[ReducedCaseFacts, ...]
    rounds: tuple[str, ...]
    certified: bool
    search: ReducedSearch | None = field(default=None, repr=False)
    functions: FrfAgreement | None = None


@dataclass(frozen=True, eq=False)
class Look:
    """Reduced models beside the full ones where a search has ended.

    Parameters
    ----------
    states : the full models, solved there
    better : the reduced models, enriched there
    agree : whether both agree within the tolerances
    """

    states: list[CaseState]
    better: list[Trained]
    there: Agreement
    agree: bool


@dataclass(eq=False)
class ReducedSearch:
    """Reduced models of the cases that modes or FRFs serve, and the history of the search on them.

    Parameters
    ----------
    reduced : positions of these cases in the problem
    functions : FRF residuals of each that its reduced model serves
    estimates : what was known before the search, without the basis
    """

    problem: UpdateProblem
    rules: ReductionRules
    reduced: list[int]
    functions: list[tuple[FrfResidual, ...]]
    trainers: list[Trainer | ComponentTrainer]
    trained: list[Trained]
    estimates: list[Trained]
    history: list[Iteration]

    def part(self, problem: UpdateProblem) -> ReducedSearch:
        """The reduced models of those cases that another problem has too, by their names."""
        positions = {case.name: i for i, case in enumerate(problem.cases)}
        at = [k for k, i in enumerate(self.reduced) if self.problem.cases[i].name in positions]
        places = [positions[self.problem.cases[self.reduced[k]].name] for k in at]
        functions, trainers, trained, estimates = (
            [of[k] for k in at] for of in (self.functions, self.trainers, self.trained, self.estimates)
        )
        return ReducedSearch(problem, self.rules, places, functions, trainers, trained, estimates, [])  # type: ignore[arg-type]

    def reduced_problem(self) -> UpdateProblem:
        cases = list(self.problem.cases)
        for i, trained, functions in zip(self.reduced, self.trained, self.functions):
            cases[i] = reduced_case(cases[i], trained.model, functions)
        return replace(self.problem, cases=tuple(cases))

    def telling(self, report: Callable[[Iteration], None]) -> Callable[[Iteration], None]:
        """A receiver of iterations that follow those of the history: they are kept, then reported."""

        def tell(iteration: Iteration) -> None:
            self.history.append(iteration)
            report(iteration)

        return tell

    @property
    def cases(self) -> list[ComparedCase]:
        """The cases that are reduced."""
        return [self.problem.cases[i] for i in self.reduced]

    def solutions(self, states: Sequence[CaseState]) -> list[EigenSolution]:
        """Full modes of the cases that are reduced, as many as something there needs; of large models from the reduced
        ones there."""
        four = zip(self.reduced, self.functions, self.trainers, self.trained)
        return [_most_modes(states[i], functions, _nearly(t, m, states[i], functions)) for i, functions, t, m in four]

    @property
    def serves_all(self) -> bool:
        """True if no part of the problem needs the full models."""
        residuals = [r for case in self.reduced_problem().cases for r in case.residuals]
        return not self.problem.residuals and all(isinstance(r, ReducedFrfs) for r in residuals)

    def errors(self, x: Reals, solutions: Sequence[EigenSolution]) -> list[float]:
        """Worst relative frequency errors of the reduced models at a point where the full ones are solved."""
        out = []
        for trainer, trained, solution in zip(self.trainers, self.trained, solutions):
            values = solution.eigenvalues[: min(solution.wanted, trainer.rules.count)]
            out.append(float(certified_error(trained.model, x, values).max(initial=0.0)))
        return out

    def agreement(self, x: Reals, solutions: Sequence[EigenSolution], better: Sequence[Trained]) -> Agreement:
        """The reduced models beside the full ones at a point where these are solved.

        Parameters
        ----------
        better : the models enriched there, see `enriched`
        """
        errors = self.errors(x, solutions)
        if not any(self.functions):
            return Agreement(tuple(errors), None)
        pair = ([b for _, blocks in self._functions(x, of) for b in blocks] for of in (self.trained, better))
        agreement = frf_agreement(*pair)
        return Agreement(tuple(errors), replace(agreement, compared=self._enlarged(better)))

    def _functions(
        self, x: Reals, trained: Sequence[Trained]
    ) -> Iterator[tuple[tuple[int, FrfResidual, KnownFunctions], list[ResidualBlock]]]:
        """FRF residuals that some reduced models serve: the case's position, functions, and blocks."""
        for i, functions, model in zip(self.reduced, self.functions, (t.model for t in trained)):
            case = reduced_case(self.problem.cases[i], model, functions)
            state = CaseState(case, case.configured.at(x))
            for residual in case.residuals:
                if isinstance(residual, ReducedFrfs):
                    computed = residual.functions(state, True)
                    full_residual = residual.own
                    yield (i, full_residual, KnownFunctions(*computed, model.order)), full_residual.compared(*computed)

    def assess(self, x: Reals, states: Sequence[CaseState], better: Sequence[Trained]) -> Evaluation:
        """Residuals of the full models; of FRFs those of the bases that hold the full models' modes and responses."""
        for (i, residual, functions), _ in self._functions(x, better):
            residual.keep(states[i], functions)
        return self.problem.assess(x, states)

    def assessed(self, before: Evaluation) -> Evaluation:
        """Residuals and derivatives where the training began, of FRFs those of the reduced models.

        Raises
        ------
        FemtuneError : those of the residuals, ``residual.nothing-compared``
        """
        state = self.assess(before.x, list(before.states), self.trained)
        self.problem.check_compared(state)
        return state

    def enriched(self, x: Reals, solutions: Sequence[EigenSolution]) -> list[Trained]:
        """The models with the full modes, and the static responses that FRFs need, at a point where they are solved.

        Parts of them below a threshold are left out. If that leaves nothing of those for FRFs, all that is linearly
        independent is kept, since the models would be compared with themselves otherwise.
        """
        if not any(self.functions) and all(e <= self.rules.tolerance for e in self.errors(x, solutions)):
            # nothing would use them
            return self.trained
        finer = [finer_trainer(t, self.rules.tolerance) for t in self.trainers]
        better = [t.enriched(m, x, s) for t, m, s in zip(finer, self.trained, solutions)]
        if any(self.functions) and not self._enlarged(better):
            whole = [with_thresholds(t, DEPENDENT, DEPENDENT) for t in self.trainers]
            better = [t.enriched(m, x, s) for t, m, s in zip(whole, self.trained, solutions)]
        return better

    def _enlarged(self, better: Sequence[Trained]) -> bool:
        return any(b.model.order > t.model.order for t, b in zip(self.trained, better, strict=True))

    def look(self, x: Reals, rounds: list[str]) -> Look:
        """The full models solved where a search has ended, beside the reduced ones; `rounds` gets a sentence."""
        states = self.problem.solved(x)
        solutions = self.solutions(states)
        better = self.enriched(x, solutions)
        if better is not self.trained:
            # two bases of a large model are more than its own matrices and factors
            self.trained = [without_basis(t) for t in self.trained]
        there = self.agreement(x, solutions, better)
        rounds.append(round_sentence(len(rounds) + 1, self, there))
        return Look(states, better, there, there.within(self.rules))

    def take(self, better: list[Trained]) -> bool:
        """Go on with enriched models; False if they are no larger."""
        before, self.trained = self.trained, better
        return [t.model.order for t in before] != [t.model.order for t in better]

    def facts(self, errors: Sequence[float]) -> tuple[ReducedCaseFacts, ...]:
        """Facts of each reduced model, with its certified errors at the end."""
        five = zip(self.cases, self.trained, self.estimates, errors, self.functions)
        return tuple(
            ReducedCaseFacts(
                configuration=c.name,
                order=t.model.order,
                full_solutions=len(t.certified) + 1,
                estimate=first.worst_estimate,
                certified_error=error,
                status=first.status,
                components=reduced_components(t),
                truncation=t.certified[0].error,
                interface_dofs=None if t.components is None else len(t.components.interface),
                functions=len(functions),
            )
            for c, t, first, error, functions in five
        )

    @property
    def used_up(self) -> bool:
        return any(len(t.certified) + 1 >= self.rules.full_solutions for t in self.trained)


def reduced_components(trained: Trained) -> tuple[ReducedComponent, ...]:
    """Facts of each component; none for a basis of the whole model."""
    parts = () if trained.components is None else trained.components.parts
    return tuple(
        ReducedComponent(
            p.part.name, len(p.part.interior), len(p.part.boundary), p.max_hz, p.modes, len(p.columns), len(p.built)
        )
        for p in parts
    )


NOBODY: Told = _Nobody()


NOTHING_REDUCED = (
    "no model was reduced because no configuration compares modes or FRFs that a reduced model serves; "
    "the search used the full model"
)


def update_reduced(
    problem: UpdateProblem,
    method: SensitivityMethod,
    rules: ReductionRules,
    report: Callable[[Iteration], None] = lambda i: None,
    start: Evaluation | None = None,
    told: Told = NOBODY,
    active: Sequence[str] | None = None,
    search: ReducedSearch | None = None,
    further: MinimumRules | None = None,
) -> ReducedUpdate:
    """The update of `update`, its iterations on reduced models that are trained on the box of the parameters.

    Where the search ends the full models are solved. While they disagree by more than the tolerance their modes
    enrich the bases and the search goes on from there; the end is the full model's, with its residuals and covariance.

    Parameters
    ----------
    report, start, active : as for `update`
    told : receives the progress of training and searches
    search : reduced models of an earlier update of the same problem, which are not trained again
    further : with it, a better minimum is looked for on the reduced models after the first search, see `look_further`

    Raises
    ------
    FemtuneError : ``correlate.no-pairs``, ``eigen.*``, ``reduce.*``, and what `update` raises of `active` and priors
    """
    before = start or unassessed(problem)
    if not any(state.case.on_modes or _served(state, rules) for state in before.states):
        # there is nothing that a reduced model would serve
        before = start or problem.assess(before.x, before.states)
        updated = update(problem, method, report, before, active)
        if further is not None:
            updated = look_further(problem, method, updated, further, report)
        return ReducedUpdate(updated, (), (NOTHING_REDUCED,), True)
    search = train(problem, rules, before, told, active) if search is None else replace(search, history=[])
    before = start or search.assessed(before)
    side = method.regularisation.settle(linear_model(problem, before, moving_parameters(problem, active)))
    method = replace(method, regularisation=side)
    x, rounds, minimum = before.x, list[str](), None
    while True:
        result = _search(search, method, x, report, active)
        if further is not None and minimum is None:
            # the history of the search is that of its first and only update so far
            result = look_further(search.reduced_problem(), method, result, further, search.telling(report))
            minimum = result.minimum
        told.searched(len(rounds) + 1)
        x, look = result.x, search.look(result.x, rounds)
        if look.agree or search.used_up or not search.take(look.better):
            break
        # full modes, whose room the next look needs
        del look
    full = search.assess(x, problem.paired_as(result.after, look.states), look.better)
    facts, better = search.facts(look.there.frequencies), replace(search, trained=look.better)
    end = replace(on_full_model(problem, method, before, full, result, search.history), minimum=minimum)
    return ReducedUpdate(end, facts, tuple(rounds), look.agree, better, look.there.functions)


def unassessed(problem: UpdateProblem, x: Reals | None = None) -> Evaluation:
    """The states at a point, or at the initial values, their comparisons settled, without any residual."""
    x = np.zeros(len(problem.parameters.free)) if x is None else x
    states = problem.solved(x)
    for state in states:
        settle_all(state)
    return Evaluation(x, tuple(states), (), has_derivatives=False)


def train(
    problem: UpdateProblem,
    rules: ReductionRules,
    before: Evaluation,
    told: Told,
    active: Sequence[str] | None = None,
) -> ReducedSearch:
    """Reduced models of all cases, trained from the states of `before` on the box of the parameters that move.

    Cases of one state of the structure, such as those of nominally identical specimens, share one training.
    """
    trainers: list[Trainer | ComponentTrainer] = []
    trained, moving = list[Trained](), np.zeros(len(before.x), bool)
    moving[moving_parameters(problem, active)] = True
    by_case = [_served(state, rules) for state in before.states]
    which = [i for i, case in enumerate(problem.cases) if case.on_modes or by_case[i]]
    functions = [by_case[i] for i in which]
    for i, frfs in zip(which, functions):
        case, state = problem.cases[i], before.states[i]
        most = max(rules.full_solutions - KEPT, 1)
        ranked = case.configured.n_free >= RANKED_FROM
        asked = TrainingRules(_count(state, frfs), SEARCH * rules.tolerance, most, rules.order, ranked=ranked)
        hears = partial(told.trained, case.name), partial(told.estimated, case.name)
        wanted = tuple(wanted_of(state, r) for r in frfs)
        rows = sp.csr_array(sp.vstack([case.sensors, *port_rows(frfs, wanted)], format="csr"))
        known = _most_modes(state, frfs)
        division = _division(case, rules)
        solve = partial(_solve, case, known, ranked and division is None)
        common = (rows, solve, *hears, before.x, moving & _acting(case))
        if division is None or rules.components is None:
            trainers.append(Trainer(case.configured, asked, *common, wanted))
        else:
            trainers.append(ComponentTrainer(case.configured, asked, rules.components, division, *common))
        trained.append(_shared(trainers, trained) or trainers[-1].train(_begun(trainers[-1], state)))
    estimates = [without_basis(t) for t in trained]
    return ReducedSearch(problem, rules, which, functions, trainers, trained, estimates, [])


def _begun(trainer: Trainer | ComponentTrainer, state: CaseState) -> Trained:
    """The basis that a training begins with; that which FRFs of a state were computed with, where there is one."""
    known = state.shared.pop(_BEGUN, None)
    return trainer.start() if known is None or not isinstance(trainer, Trainer) else trainer.again(known)


def keep_functions(
    problem: UpdateProblem, rules: ReductionRules, states: Sequence[CaseState], smallest: int | None = None
) -> None:
    """Compute the FRFs of large models, and their derivatives, on the bases that their training begins with.

    The bases hold all modes up to twice the highest line and the static responses to all forces, as a superposition of
    the full model does, whose derivatives take as long as many solutions. Nothing is done for models with fewer free
    DOFs than `smallest` (`RANKED_FROM`), and where no reduced model serves the FRFs.
    """
    smallest = RANKED_FROM if smallest is None else smallest
    for state in states:
        settle_all(state)
        functions = _served(state, rules)
        if not functions or state.case.configured.n_free < smallest:
            continue
        known, wanted = _most_modes(state, functions), tuple(wanted_of(state, r) for r in functions)
        asked = TrainingRules(_count(state, functions), SEARCH * rules.tolerance, ranked=True, inner=0)
        rows = sp.csr_array(sp.vstack([state.case.sensors, *port_rows(functions, wanted)], format="csr"))
        solve = partial(_solve, state.case, known, False)
        begun = Trainer(state.case.configured, asked, rows, solve, base=state.point.x, functions=wanted).start()
        state.shared[_BEGUN] = begun
        case = reduced_case(state.case, begun.model, functions)
        there = CaseState(case, case.configured.at(state.point.x))
        for residual in case.residuals:
            if isinstance(residual, ReducedFrfs):
                residual.own.keep(state, KnownFunctions(*residual.functions(there, True), begun.model.order))


def without_basis(trained: Trained) -> Trained:
    """The reduced model and what is known of it, which answers all but the full model's shapes."""
    return replace(trained, basis=np.zeros((0, trained.model.order)))


def _acting(case: ComparedCase) -> NDArray[np.bool_]:
    """(k,) parameters that have an effect in a case: none of other specimens."""
    model = case.configured.model
    return np.array([p.name not in model.foreign for p in model.parameters.free], bool)


def _shared(trainers: Sequence[Trainer | ComponentTrainer], trained: Sequence[Trained]) -> Trained | None:
    """The earlier training that serves the last trainer; None if none has the same matrices and points."""
    last = trainers[-1]
    for other, basis in zip(trainers, trained):
        if isinstance(last, Trainer) and isinstance(other, Trainer) and last.served_by(other):
            return last.taken_from(other, basis)
    return None


def _division(case: ComparedCase, rules: ReductionRules) -> Division | None:
    return None if rules.components is None else divide(case.configured, rules.components)


def _served(state: CaseState, rules: ReductionRules) -> tuple[FrfResidual, ...]:
    """FRF residuals that the reduced model of a case serves; none where it is assembled from components."""
    return served(state) if _division(state.case, rules) is None else ()


def _count(state: CaseState, functions: Sequence[FrfResidual]) -> int:
    """Modes whose frequencies matter: those that are compared, and those at and just above the lines of FRFs."""
    counts = [state.solution.wanted] if state.case.on_modes else []
    for residual in functions:
        freq_hz = modes_for(state, residual).freq_hz
        counts.append(int((freq_hz <= _ABOVE_LINES * residual.highest_hz).sum()) + 1)
    return max(counts)


def _most_modes(
    state: CaseState, functions: Sequence[FrfResidual], start: EigenSolution | None = None
) -> EigenSolution:
    """The largest of the solutions that something in a case needs."""
    counts = [modes_for(state, residual, start) for residual in functions]
    return max([state.solution, *counts] if state.case.on_modes else counts, key=lambda s: s.wanted)


def _nearly(
    trainer: Trainer | ComponentTrainer, trained: Trained, state: CaseState, functions: Sequence[FrfResidual]
) -> EigenSolution | None:
    """Modes of a reduced model from which those of a large one are found with few solutions; None of a small one."""
    if not functions or not trainer.rules.ranked or trained.components is not None:
        return None
    counts = [count for count, _ in (residual.way.modes or (None, None) for residual in functions) if count]
    return modes_nearby(trained, state.full, max(counts, default=trainer.rules.count))


def finer_trainer(trainer: Trainer | ComponentTrainer, tolerance: float) -> Trainer | ComponentTrainer:
    """A trainer that keeps smaller parts of new modes: at an end shapes count, whose error is that of a root."""
    negligible = min(trainer.rules.negligible, 1e-2 * float(np.sqrt(tolerance)))
    return with_thresholds(trainer, negligible, _FINER_RESPONSES * trainer.rules.responses)


def with_thresholds(
    trainer: Trainer | ComponentTrainer, negligible: float, responses: float
) -> Trainer | ComponentTrainer:
    """A trainer with other thresholds of an enrichment."""
    rules = replace(trainer.rules, negligible=negligible, responses=responses)
    # full solutions where a search ends are told as such
    return replace(trainer, rules=rules, report=lambda trained: None)


def _solve(
    case: ComparedCase, known: EigenSolution, improves: bool, point: ModelPoint, count: int, start: EigenSolution | None
) -> EigenSolution:
    """Modes of the full model for a training; those that are known where it is asked there for as many or fewer.

    Parameters
    ----------
    improves : modes of large models are found by inverse iteration from `start`: what they miss of the modes is far
        below the tolerance of a training
    """
    if count <= known.wanted and np.array_equal(point.x, known.point.x):
        return known
    if improves and start is not None and not point.depends_on_frequency and not slepc_is_chosen():
        return case.solver.improved(start, _STEPS)
    # whoever keeps solutions keeps them by the model alone, not by where they started
    return case.solver.modes(point, count, None)


def _search(
    search: ReducedSearch,
    method: SensitivityMethod,
    x: Reals,
    report: Callable[[Iteration], None],
    active: Sequence[str] | None,
) -> UpdateResult:
    """The update on the reduced models from x, its iterations numbered on."""
    reduced = search.reduced_problem()

    def number_on(iteration: Iteration) -> None:
        renumbered = replace(iteration, number=len(search.history))
        # the first point of a further search is the last one of that before
        if iteration.number or not search.history:
            search.history.append(renumbered)
            report(renumbered)

    return update(reduced, method, number_on, reduced.start(x), active)


def round_sentence(number: int, search: ReducedSearch, there: Agreement) -> str:
    order = " and ".join(str(t.model.order) for t in search.trained)
    verdict = _verdict(there.frequency <= search.rules.tolerance)
    sentence = (
        f"search {number} with order {order}: at the final point the largest frequency difference from the full model "
        f"is {100.0 * there.frequency:.2g} %, {verdict} of {100.0 * search.rules.tolerance:.2g} %"
    )
    frfs = there.functions
    if frfs is None:
        return sentence
    if not frfs.compared:
        return (
            f"{sentence}; the full model's modes and static responses there lie within the bases, which need "
            "no others for the FRFs"
        )
    verdict = _verdict(frfs.shift <= search.rules.frf_tolerance)
    return (
        f"{sentence}; the full model's modes and static responses there change the FRF residuals by {frfs.mean:.2g} "
        f"(root mean square) and at most {frfs.largest:.2g} standard deviations, and would move the parameters by "
        f"{frfs.shift:.2g} standard deviations, "
        f"{verdict} of {search.rules.frf_tolerance:.2g}"
    )


def _verdict(within: bool) -> str:
    return "within the tolerance" if within else "above the tolerance"


def on_full_model(
    problem: UpdateProblem,
    method: SensitivityMethod,
    before: Evaluation,
    full: Evaluation,
    result: UpdateResult,
    history: Sequence[Iteration],
) -> UpdateResult:
    """The result at the final point with residuals, Jacobian and covariance of the full model."""
    there = update(problem, replace(method, max_iterations=0, smallest_change=0.0), start=full, active=result.active)
    walk = Walk(problem, moving_parameters(problem, result.active), there.side)
    return replace(
        there, status=result.status, before=before, history=tuple(history),
        number=len(history) - len(result.history) + result.number,
        certificate=certificate(walk, full, result.smallest_change), smallest_change=result.smallest_change,
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# Many starts on reduced models: distinct ends follow the models while these are enriched where the best start ends.


Compared = Callable[[UpdateProblem], UpdateProblem]

NO_SIDE = SensitivityMethod(smallest_change=0.0)


@dataclass(frozen=True)
class ReducedStarts:
    """All starts, and the update at the best end as of `update_reduced`; results of the other starts are those of
    reduced models."""

    starts: MultiStart
    update: ReducedUpdate


def multi_start_reduced(
    problem: UpdateProblem,
    method: SensitivityMethod,
    reduction: ReductionRules,
    rules: StartRules = DEFAULT_RULES,
    *,
    equation_error: bool = True,
    nominal: Evaluation | None = None,
    points: Reals | None = None,
    active: Sequence[str] | None = None,
    known: Mapping[tuple[int, int], StartResult] | None = None,
    report: Callable[[StartResult], None] | None = None,
    executor: Executor | None = None,
    sampled: Mapping[int, Sample] | None = None,
    report_sample: Callable[[Sample], None] | None = None,
    told: Told = NOBODY,
) -> ReducedStarts:
    """`multi_start` on reduced models, which the full models certify at the best end.

    While they disagree there by more than the tolerance, the full modes enrich the bases and each distinct end goes on
    from where it is: of starts that reached one optimum the best, and the others end with it, see `follow_up`. With
    `equation_error` starts are first followed, and the best end certified, by that residual; the asked ones come after.

    Parameters
    ----------
    equation_error : whether starts first go through `equation_error_phases`; hops are judged by the equation error then
    nominal, points, active, known, report, executor, sampled, report_sample : as for `multi_start`
    told : as for `update_reduced`

    Raises
    ------
    FemtuneError : as `multi_start` and `update_reduced`
    """
    before = nominal or unassessed(problem)
    search = train(problem, reduction, before, told, active)
    before = nominal or search.assessed(before)
    side = method.regularisation.settle(linear_model(problem, before, moving_parameters(problem, active)))
    method = replace(method, regularisation=side)
    run = _Run(problem, method, reduction, search, told, active, [])
    reduced = run.search.reduced_problem()
    options: dict[str, Any] = {
        "points": points, "active": active, "known": known, "report": report, "executor": executor, "sampled": sampled,
        "report_sample": report_sample,
    }  # fmt: skip
    if equation_error and any(len(case.test) for case in problem.cases):
        *first, last = equation_error_phases(reduced)
        outcome = multi_start(last, NO_SIDE, rules, first=first, **options)
        outcome = run.certify(outcome, lambda p: equation_error_phases(p)[-1], NO_SIDE)
        # the look at its end left the basis with the enriched models only
        assert run.at_end is not None
        run.search.take(run.at_end.better)
        outcome = follow_up(outcome, run.search.reduced_problem(), method, side, active, unfinished=True)
    else:
        outcome = multi_start(reduced, method, rules, **options)
    outcome = run.certify(outcome, lambda p: p, method)
    look = run.at_end
    assert look is not None
    states = problem.paired_as(outcome.best.after, look.states)
    full = run.search.assess(outcome.best.x, states, look.better)
    best = on_full_model(problem, method, before, full, outcome.best, outcome.best.history)
    facts = run.search.facts(look.there.frequencies)
    search = replace(run.search, trained=look.better)
    reduced_update = ReducedUpdate(best, facts, tuple(run.rounds), look.agree, search, look.there.functions)
    return ReducedStarts(replace(outcome, best=best), reduced_update)


@dataclass(eq=False)
class _Run:
    """Reduced models and their agreement with the full ones at the best result."""

    problem: UpdateProblem
    method: SensitivityMethod
    reduction: ReductionRules
    search: ReducedSearch
    told: Told
    active: Sequence[str] | None
    rounds: list[str]
    at_end: Look | None = None

    def certify(self, found: MultiStart, compared: Compared, method: SensitivityMethod) -> MultiStart:
        """The ends of starts once the full models agree at the best of them, or no more full solutions are allowed."""
        while True:
            self.told.searched(len(self.rounds) + 1)
            look = self.at_end = self.search.look(found.best.x, self.rounds)
            if look.agree or self.search.used_up or not self.search.take(look.better):
                return found
            # full modes, whose room the next look needs
            self.at_end = None
            del look
            reduced = compared(self.search.reduced_problem())
            found = follow_up(found, reduced, method, found.best.side, self.active)
