"""Bootstrap of measured FRFs: spread of the parameters by drawing frequency lines again, or by drawing noise.

Each run starts from the optimum of all data and takes Gauss-Newton steps on its own data: on frequency lines, or on
single entries, drawn with replacement from the measured ones; or on all of them with noise of the stated standard
deviations added to the functions of the model at the optimum (a parametric bootstrap).

Where the residuals compare FRFs of an identified test, the lines, entries or noise are those of the measured FRFs
behind it; what they change in the identified FRFs is added to the residuals, see `femtune.identification.redrawn`.

Sources: B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap, 1993, chapters 6, 9 and 13; for the limits of the
intervals, T. C. Hesterberg, What Teachers Should Know About the Bootstrap, The American Statistician 69, 2015.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtr, stdtrit

from femtune.arrays import Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.identification.kinds import DRAWINGS, Drawing
from femtune.identification.redrawn import RedrawnTest
from femtune.parameters import ParameterSet
from femtune.residuals import Evaluation, ResidualBlock, UpdateProblem
from femtune.residuals.identified import drawn_changes, identified_tests
from femtune.selection import determined
from femtune.uncertainty.kinds import Jacobian
from femtune.updating.regularisation import SideConstraint
from femtune.updating.search import LocalModel

_FEWEST_LINES = 3
"""Frequency lines of a configuration, and converged runs, without which there is no spread to estimate."""
_HALVINGS = 8
"""Lengths of a step that are tried: the whole one, and down to 1/128 of it."""
_CONTRACTION = 0.5
"""Size of a step relative to the one before, above which derivatives at the optimum are too far away: with a ratio
below, ten steps gain three digits."""
_PILOTS = 200
"""Draws for the linearised spread where the FRFs are those of an identified test."""
_PILOT_SEED = 1 << 62
"""Stream of random numbers of the pilot draws; runs have their numbers, which never reach it."""
_SHARE = 0.05
"""A free parameter is undetermined if more than this part of it is in combinations that the data leave open."""


@dataclass(frozen=True)
class BootstrapRules:
    """Resampling, and convergence of the runs.

    Parameters
    ----------
    method : "lines": frequency lines with replacement, all functions of a line together; "entries": single values of
        the functions; "noise": the functions at the optimum with noise of the stated standard deviations
    runs, seed : number of runs; run i draws from its own generator, by the seed and i
    jacobian : "shared": steps with the derivatives at the optimum, with those of the point only where these do not
        converge, and one Gauss-Newton step of the identification of an identified test; "own": always with those of
        the point, and with another identification
    tolerance : a run ends with the first step below this part of the standard deviation, in every parameter
    most_steps : runs that need more have not converged
    checked : number of runs of "shared" that are repeated with "own" derivatives, for the largest difference
    """

    method: Drawing = "lines"
    runs: int = 1000
    seed: int = 0
    jacobian: Jacobian = "shared"
    tolerance: float = 0.01
    most_steps: int = 20
    checked: int = 5


@dataclass(frozen=True, eq=False)
class BootstrapRun:
    """One run.

    Parameters
    ----------
    x : (k,) normalised parameters where it ended
    converged : False if the steps did not become small
    steps, solutions : number of steps, and of points at which the model was solved
    own : whether derivatives at another point than the optimum were needed
    problem : why the model could not be solved; "" otherwise
    """

    x: Reals
    converged: bool
    steps: int
    solutions: int
    own: bool = False
    problem: str = ""


# ----------------------------------------------------------------------------------------------------
# What is drawn: rows of the residuals that belong together.


@dataclass(frozen=True, eq=False)
class Drawn:
    """Groups of residuals that are drawn together.

    Parameters
    ----------
    group : (n,) group of each residual, from 0
    stratum : (g,) configuration of each group; as many groups are drawn from a configuration as it has
    """

    group: Integers
    stratum: Integers

    def counts(self, rng: np.random.Generator) -> Reals:
        """(g,) how many times each group is drawn."""
        out = np.zeros(len(self.stratum))
        for one in np.unique(self.stratum):
            members = np.flatnonzero(self.stratum == one)
            out[members] = np.bincount(rng.integers(len(members), size=len(members)), minlength=len(members))
        return out


def drawn_groups(blocks: Sequence[ResidualBlock], method: Drawing) -> Drawn:
    """Frequency lines, or single entries, of residuals of measured FRFs.

    Raises
    ------
    FemtuneError : ``bootstrap.no-lines`` for other residuals; ``bootstrap.few-lines``
    """
    others = sorted({b.kind for b in blocks if b.samples is None and len(b.values)})
    if others:
        raise FemtuneError("bootstrap.no-lines", kinds=", ".join(others))
    keys = [key for i, b in enumerate(blocks) for key in _keys(i, b, method)]
    known = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    cases = {name: i for i, name in enumerate(dict.fromkeys(b.configuration for b in blocks))}
    drawn = Drawn(np.array([known[k] for k in keys], np.int64), np.array([cases[str(k[0])] for k in known], np.int64))
    for name, i in cases.items():
        if (lines := int(np.sum(drawn.stratum == i))) < _FEWEST_LINES:
            raise FemtuneError("bootstrap.few-lines", configuration=name, lines=lines)
    return drawn


def _keys(number: int, block: ResidualBlock, method: Drawing) -> list[tuple[object, ...]]:
    assert block.samples is not None
    if method == "lines":
        return [(block.configuration, hz) for hz in block.samples.freq_hz.tolist()]
    return [(block.configuration, number, entry) for entry in block.samples.entry.tolist()]


def noise_of(block: ResidualBlock, rng: np.random.Generator, size: float) -> Reals:
    """(n,) residuals of a model that is right, from noise of `size` times the stated standard deviations."""
    chance = size * rng.standard_normal(len(block.values))
    samples = block.samples
    if samples is None or samples.log_sd is None:
        return chance
    complex_ = len(np.unique(samples.entry)) < len(chance)
    n = len(chance) // 2 if complex_ else len(chance)
    sd = samples.log_sd[:n]
    imaginary = chance[n:] if complex_ else size * rng.standard_normal(n)
    ratio = -np.log(1.0 + sd * (chance[:n] + 1j * imaginary)) / sd
    return np.concatenate([ratio.real, ratio.imag]) if complex_ else ratio.real


# ----------------------------------------------------------------------------------------------------
# The runs.


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """The optimum, and what is drawn around it. Called with the number of a run it makes that run.

    Parameters
    ----------
    at : the problem at the optimum, with derivatives
    side : side constraint of the update, kept in all runs
    moving : (k,) parameters that the update moves
    size : what the stated standard deviations are multiplied by, for noise
    """

    problem: UpdateProblem
    at: Evaluation
    side: SideConstraint
    moving: Flags
    rules: BootstrapRules
    size: float = 1.0

    def __call__(self, number: int) -> BootstrapRun:
        """The run with a number from 0."""
        return self._run(number, self.rules.jacobian == "own")

    def check(self, number: int) -> BootstrapRun:
        """The same run with derivatives at every point."""
        return self._run(number, True)

    @cached_property
    def identified(self) -> tuple[RedrawnTest, ...]:
        """Identified tests whose FRFs are compared."""
        return identified_tests(self.at.weighted)

    def optimum(self) -> BootstrapRun:
        """The run on all data as they are: the optimum near the point that the derivatives belong to."""
        n = len(self.at.residuals)
        return self._walked(np.ones(n), np.zeros(n), self.rules.jacobian == "own")

    @cached_property
    def drawn(self) -> Drawn | None:
        """What is drawn of the residuals; None for noise and for identified tests (errors of `drawn_groups`)."""
        if self.rules.method == "noise":
            return None
        groups = drawn_groups(self.at.weighted, self.rules.method)
        return None if self.identified else groups

    @cached_property
    def groups(self) -> int:
        """Number of lines or entries that are drawn from; of residuals for noise."""
        if self.identified:
            return sum(test.drawn_from(self.rules.method) for test in self.identified)
        return len(self.at.residuals) if self.drawn is None else len(self.drawn.stratum)

    @cached_property
    def free(self) -> Flags:
        """(k,) moving parameters that are not at a bound at the optimum."""
        lower, upper = self.problem.parameters.bounds
        near = 1e-9 * np.minimum(upper - lower, 1.0)
        return np.asarray(self.moving & (self.at.x - lower > near) & (upper - self.at.x > near))

    @cached_property
    def sd(self) -> Reals:
        """(k,) linearised standard deviations of the runs, as if there were no bounds; 0 of parameters that rest."""
        return np.sqrt(np.diag(self.linear_covariance))

    @cached_property
    def linear_covariance(self) -> Reals:
        """(k, k) covariance of the first steps: H⁻¹ (Σ s sᵀ) H⁻¹ with the gradients s of what is drawn together.

        For noise H⁻¹ JᵀJ H⁻¹ with the size of the noise. H = JᵀJ, with the rows of the side constraint. For identified
        tests from two hundred draws.
        """
        J = self._scaled(self.at.jacobian)
        inverse = np.linalg.pinv(J.T @ J + self._side_matrix, hermitian=True)
        if self.identified:
            steps = np.array([self._pilot(i) @ J for i in range(_PILOTS)])
            middle = np.atleast_2d(np.cov(steps.T))
        elif self.drawn is None:
            middle = self.size**2 * (J.T @ J)
        else:
            sums = np.zeros((len(self.drawn.stratum), J.shape[1]))
            np.add.at(sums, self.drawn.group, J * self.at.residuals[:, None])
            # what is drawn varies about the mean of its configuration
            for one in np.unique(self.drawn.stratum):
                sums[self.drawn.stratum == one] -= sums[self.drawn.stratum == one].mean(axis=0)
            middle = sums.T @ sums
        spread = self.problem.parameters.prior[1]
        return np.asarray(inverse @ middle @ inverse * np.outer(spread, spread))

    @cached_property
    def fisher_covariance(self) -> Reals:
        """(k, k) inverse Fisher information, with the stated standard deviations times `size`; 0 where at rest."""
        J, spread = self._scaled(self.at.jacobian), self.problem.parameters.prior[1]
        inverse = np.linalg.pinv(J.T @ J + self._side_matrix, hermitian=True)
        return np.asarray(self.size**2 * inverse * np.outer(spread, spread))

    def _scaled(self, jacobian: Reals) -> Reals:
        """Columns in units of the prior standard deviations; those of parameters that rest are zero."""
        return np.asarray(jacobian * self.problem.parameters.prior[1] * self.moving)

    @cached_property
    def _side_matrix(self) -> Reals:
        rows = self._scaled(self.side.rows(self.at.x)[1])
        return np.asarray(rows.T @ rows)

    def check_determined(self) -> None:
        """Refuse free parameters that data and side constraint leave open (error ``bootstrap.undetermined``)."""
        rows = np.vstack([self._scaled(self.at.jacobian), self._scaled(self.side.rows(self.at.x)[1])])[:, self.free]
        _, s, vt = np.linalg.svd(rows, full_matrices=False)
        open_ = np.linalg.norm(vt[~determined(s)], axis=0) > _SHARE
        if open_.any():
            names = [p.name for p, f in zip(self.problem.parameters.free, self.free) if f]
            raise FemtuneError("bootstrap.undetermined", parameters=", ".join(n for n, o in zip(names, open_) if o))

    def _pilot(self, number: int) -> Reals:
        """(n,) change of the residuals in one draw beside those of the runs."""
        return self._changes(np.random.default_rng([self.rules.seed, _PILOT_SEED, number]), False)

    def _changes(self, rng: np.random.Generator, own: bool) -> Reals:
        """(n,) change of the residuals with one draw of the measured FRFs of identified tests, and with other noise."""
        changes = drawn_changes(self.at.weighted, self.rules.method, rng, complete=own)
        pairs = zip(self.at.weighted, changes)
        return np.concatenate([noise_of(b, rng, self.size) if c is None else c for b, c in pairs])

    def drawn_data(self, number: int, own: bool = False) -> tuple[Reals, Reals]:
        """(n,) roots of the weights of the residuals of a run, and what is added to them."""
        rng = np.random.default_rng([self.rules.seed, number])
        if self.identified:
            added = self._changes(rng, own)
            return np.ones(len(added)), added - self.at.residuals if self.rules.method == "noise" else added
        if self.drawn is not None:
            return np.sqrt(self.drawn.counts(rng))[self.drawn.group], np.zeros(len(self.at.residuals))
        noise = np.concatenate([noise_of(b, rng, self.size) for b in self.at.weighted])
        return np.ones(len(noise)), noise - self.at.residuals

    def _run(self, number: int, own: bool) -> BootstrapRun:
        try:
            data = self.drawn_data(number, own)
        except FemtuneError as error:
            return BootstrapRun(self.at.x, False, 0, 0, own, error.what)
        return self._walked(*data, own)

    def _walked(self, root: Reals, added: Reals, own: bool) -> BootstrapRun:
        walk = _Walk(self, root, added, self.at, own)
        try:
            return walk.go()
        except FemtuneError as error:
            return BootstrapRun(walk.at.x, False, walk.steps, walk.solutions, walk.own, error.what)


@dataclass(eq=False)
class _Walk:
    """The steps of one run."""

    of: Bootstrap
    root: Reals
    added: Reals
    at: Evaluation
    own: bool
    steps: int = 0
    solutions: int = 0

    def go(self) -> BootstrapRun:
        rules, before = self.of.rules, np.inf
        jacobian = self.at.jacobian
        while self.steps < rules.most_steps:
            d = self._local(self.at, jacobian).step()
            self.steps += 1
            size = self._in_sd(d)
            if size <= rules.tolerance:
                return BootstrapRun(self.at.x + d, True, self.steps, self.solutions, self.own)
            if size > _CONTRACTION * before and not self.own:
                # derivatives at the optimum are too far away: the step is taken again with those of the point
                self.own, before = True, np.inf
                self.at, jacobian = self._with_derivatives()
                continue
            self._move(d)
            if self.own:
                jacobian = self.at.jacobian
            before = size
        return BootstrapRun(self.at.x, False, self.steps, self.solutions, self.own)

    def _with_derivatives(self) -> tuple[Evaluation, Reals]:
        if not self.at.has_derivatives:
            self.solutions += 1
            self.at = self.of.problem.follow(self.at.x, self.of.at)
        return self.at, self.at.jacobian

    def _in_sd(self, d: Reals) -> float:
        """Largest step in standard deviations."""
        sd = self.of.sd
        floor = 1e-9 * self.of.problem.parameters.prior[1]
        return float(np.max(np.abs(d) / np.maximum(sd, floor), initial=0.0))

    def _move(self, d: Reals) -> None:
        """To the end of the step; with derivatives of the point back again as long as the objective is higher."""
        before = self._objective(self.at)
        for halving in range(_HALVINGS if self.own else 1):
            x = self.at.x + 0.5**halving * d
            self.solutions += 1
            evaluation = self.of.problem.follow(x, self.of.at, self.own)
            if not self.own or self._objective(evaluation) <= before * (1.0 + 1e-12):
                break
        self.at = evaluation

    def _values(self, at: Evaluation) -> Reals:
        return np.asarray(self.root * (at.residuals + self.added))

    def _objective(self, at: Evaluation) -> float:
        side = self.of.side.rows(at.x)[0]
        values = self._values(at)
        return float(values @ values + side @ side)

    def _local(self, at: Evaluation, jacobian: Reals) -> LocalModel:
        values, rows = self.of.side.rows(at.x)
        lower, upper = self.of.problem.parameters.bounds
        moving = self.of.moving
        return LocalModel(
            np.concatenate([self._values(at), values]),
            np.vstack([self.root[:, None] * jacobian, rows]),
            np.where(moving, np.minimum(lower - at.x, 0.0), 0.0),
            np.where(moving, np.maximum(upper - at.x, 0.0), 0.0),
            self.of.problem.parameters.prior[1],
            self.of.side.held,
        )


# ----------------------------------------------------------------------------------------------------
# What the runs say.


@dataclass(frozen=True, eq=False)
class BootstrapParameter:
    """One parameter over the runs, in its unit.

    Parameters
    ----------
    value : at the optimum of all data
    mean, sd : of the runs
    linear_sd : linearised standard deviation of the runs
    fisher_sd : by the inverse Fisher information at the optimum
    lower, upper : limits of the interval
    at_bound : part of the runs that ended at a bound of it
    """

    name: str
    value: float
    mean: float
    sd: float
    linear_sd: float
    fisher_sd: float
    lower: float
    upper: float
    at_bound: float

    @property
    def cov(self) -> float:
        """Coefficient of variation sd/|mean|, of the parameter and not of its relative change; NaN for a mean of 0."""
        return self.sd / abs(self.mean) if self.mean else float("nan")

    @property
    def bias(self) -> float:
        """Mean less the value at the optimum, in standard deviations of the runs; 0 without scatter."""
        return (self.mean - self.value) / self.sd if self.sd > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class BootstrapResult:
    """All runs and their statistics.

    Parameters
    ----------
    runs : in the order of their numbers
    check : the first of them again, with derivatives at every point
    groups : number of lines or entries that were drawn from
    identified : whether these are the measured ones behind FRFs of an identified test
    """

    parameters: ParameterSet
    rules: BootstrapRules
    at: Reals
    moving: Flags
    runs: tuple[BootstrapRun, ...]
    check: tuple[BootstrapRun, ...]
    groups: int
    linear_covariance: Reals
    fisher_covariance: Reals
    identified: bool = False

    @cached_property
    def samples(self) -> Reals:
        """(runs, k) normalised parameters of the runs that converged."""
        values = [r.x for r in self.runs if r.converged]
        return np.array(values) if values else np.zeros((0, len(self.at)))

    @property
    def solutions(self) -> int:
        """Number of points at which the model was solved."""
        return sum(r.solutions for r in (*self.runs, *self.check))

    @cached_property
    def correlation(self) -> Reals:
        """(k, k) correlation of the free parameters; 0 beside those that rest."""
        sd = self.samples.std(axis=0, ddof=1)
        safe = np.where(sd > 0.0, sd, 1.0)
        return np.asarray(np.atleast_2d(np.cov(self.samples.T)) / np.outer(safe, safe))

    @cached_property
    def difference(self) -> float | None:
        """Largest difference of runs with shared and with own derivatives, in standard deviations; None: no check."""
        sd = np.sqrt(np.diag(self.linear_covariance))
        some = sd > 0.0
        differences = [
            float(np.abs((a.x - b.x)[some] / sd[some]).max(initial=0.0))
            for a, b in zip(self.runs, self.check)
            if a.converged and b.converged
        ]
        return max(differences) if differences else None

    def interval(self, values: Reals, level: float = 0.95) -> tuple[float, float]:
        """Equal-tailed percentiles of values (runs,), for a level that allows for the number of lines.

        The percentiles of a bootstrap are too narrow by the factor √((g − k)/g) of g groups and k parameters, and as
        those of a normal distribution where Student's t is due; the level is raised so that both are made up for.
        """
        k = int(self.moving.sum())
        degrees = max(self.groups - k, 1)
        wide = float(np.sqrt(self.groups / degrees) * stdtrit(degrees, 0.5 + 0.5 * level))
        tail = float(ndtr(-wide)) if self.rules.method != "noise" else 0.5 - 0.5 * level
        low, high = np.quantile(values, [tail, 1.0 - tail])
        return float(low), float(high)

    @cached_property
    def found(self) -> tuple[BootstrapParameter, ...]:
        """Statistics of all parameters, tied ones too."""
        values, samples = self.parameters.values(self.at), self.parameters.at_samples(self.samples)
        jets, bound = self.parameters.jets(self.at), self._at_bound
        out = []
        for name in self.parameters.names:
            gradient, some = jets[name].grad, samples[name]
            linear, fisher = (
                float(np.sqrt(max(gradient @ c @ gradient, 0.0)))
                for c in (self.linear_covariance, self.fisher_covariance)
            )
            limits = self.interval(some)
            mean, sd = float(some.mean()), float(some.std(ddof=1))
            at = bound.get(name, 0.0)
            out.append(BootstrapParameter(name, values[name], mean, sd, linear, fisher, *limits, at))
        return tuple(out)

    @cached_property
    def _at_bound(self) -> Mapping[str, float]:
        lower, upper = self.parameters.bounds
        near = 1e-9 * np.minimum(upper - lower, 1.0)
        at = ((self.samples - lower <= near) | (upper - self.samples <= near)).mean(axis=0)
        return {p.name: float(a) for p, a in zip(self.parameters.free, at)}

    @property
    def sentences(self) -> tuple[str, ...]:
        """Conclusions from the runs, most important first."""
        return (*_spread(self), *_bias(self), *_method(self), *_trouble(self))


_NOTABLE_BIAS = 0.5
"""Bias in standard deviations from which a sentence says so; below, it adds less than 12 % to the root mean square
error."""
_NOTABLE_RATIO = 1.3
"""Ratio of bootstrap and Fisher standard deviations from which they disagree. A hundred runs know their own to 7 %."""
_AGREEMENT = 0.1
"""Difference of runs by both ways, in standard deviations, up to which they agree."""
_NO_SCATTER = 1e-12
"""Standard deviation relative to the mean, below which it is rounding."""
_APART = 1.0
"""Difference of runs by another identification, in standard deviations, above which its choices matter."""
_WHY_UNLIKE = (
    "which trusts the stated standard deviations of the FRFs: these do not describe the residuals",
    "which takes the errors of the compared lines as independent; those of an identified test are not",
)


def _spread(result: BootstrapResult) -> list[str]:
    moved = [p for p in result.found if p.sd > _NO_SCATTER * abs(p.mean)]
    if not moved:
        return ["The runs have no scatter: the model reproduces the data exactly."]
    known = [p for p in moved if np.isfinite(p.cov)]
    what = DRAWINGS[result.rules.method].label
    out = [f"{len(result.samples)} bootstrap runs: {what}."]
    if result.identified:
        out.append("What is drawn are the measured FRFs; each run identifies the test again and equalises its damping.")
    if known:
        worst = max(known, key=lambda p: p.cov)
        out.append(f"The largest coefficient of variation is {100 * worst.cov:.2g} % ({worst.name}).")
    ratio = [p.sd / p.fisher_sd for p in moved if p.fisher_sd > 0.0]
    if (
        ratio
        and not 1.0 / _NOTABLE_RATIO < (middle := float(np.median(ratio))) < _NOTABLE_RATIO
        and (result.rules.method != "noise" or result.identified)
    ):
        out.append(
            f"The standard deviations are {middle:.2g} times those by the inverse Fisher information (median), "
            f"{_WHY_UNLIKE[result.identified]}."
        )
    return out


def _bias(result: BootstrapResult) -> list[str]:
    biased = [p for p in result.found if abs(p.bias) > _NOTABLE_BIAS]
    if not biased:
        return []
    listed = ", ".join(f"{p.name} {p.bias:+.2g} σ" for p in biased)
    cause = (
        "noise at antiresonances biases logarithms; weight the residual by the noise (floor, averages)"
        if result.rules.method == "noise"
        else "the model does not describe all lines equally well, or few lines dominate"
    )
    return [f"The mean of the runs differs from the result by more than half a standard deviation ({listed}): {cause}."]


def _method(result: BootstrapResult) -> list[str]:
    if result.difference is None:
        return []
    verdict = "agree" if result.difference <= _AGREEMENT else "do not agree"
    if result.identified:
        said = (
            f"{len(result.check)} runs with another identification, which chooses the modes again, differ from those "
            f"with one step of the identification by at most {result.difference:.2g} σ."
        )
        why = "The choice of modes depends on the noise, which the standard deviations do not contain."
        return [said, why] if result.difference > _APART else [said]
    return [
        f"{len(result.check)} runs with derivatives at every point {verdict} with those with shared derivatives: the "
        f"largest difference is {result.difference:.2g} σ."
    ]


def _trouble(result: BootstrapResult) -> list[str]:
    out = []
    failed = [r for r in result.runs if r.problem]
    open_ = len(result.runs) - len(result.samples) - len(failed)
    if open_:
        out.append(f"{open_} of {len(result.runs)} runs did not converge and are left out.")
    if failed:
        reason = failed[0].problem
        out.append(f"{len(failed)} of {len(result.runs)} runs could not be solved and are left out: {reason}.")
    held = [p.name for p in result.found if p.at_bound > 0.0]
    if held:
        out.append(f"Some runs end at a bound of {', '.join(held)}; the spread of these parameters is cut off there.")
    return out


def bootstrap_result(work: Bootstrap, runs: Sequence[BootstrapRun], check: Sequence[BootstrapRun]) -> BootstrapResult:
    """The statistics of runs (error ``bootstrap.no-runs`` where fewer than three converged)."""
    result = BootstrapResult(
        parameters=work.problem.parameters,
        rules=work.rules,
        at=work.at.x,
        moving=work.moving,
        runs=tuple(runs),
        check=tuple(check),
        groups=work.groups,
        linear_covariance=work.linear_covariance,
        fisher_covariance=work.fisher_covariance,
        identified=bool(work.identified),
    )
    if len(result.samples) < _FEWEST_LINES:
        reason = next((r.problem for r in runs if r.problem), "the steps did not become small")
        raise FemtuneError("bootstrap.no-runs", converged=len(result.samples), runs=len(runs), reason=reason)
    return result


def bootstrap_of(
    problem: UpdateProblem,
    at: Evaluation,
    side: SideConstraint,
    active: Sequence[str],
    rules: BootstrapRules,
    misfit: float = 1.0,
) -> Bootstrap:
    """The bootstrap about an optimum.

    Parameters
    ----------
    at : the problem there, with derivatives
    side : side constraint of the update; one that acts on single steps is no part of the optimum and is left out
    active : names of the parameters that the update moved
    misfit : root mean square of the residuals where the stated standard deviations are relative weights

    Raises
    ------
    FemtuneError : ``bootstrap.no-lines``, ``bootstrap.few-lines``, ``bootstrap.undetermined``
    """
    moving = np.array([p.name in active for p in problem.parameters.free])
    if side.renewed:
        side = replace(side, matrix=side.matrix[:0], target=side.target[:0], renewed=None)
    problem = problem.to_send()
    at = problem.unsolved(at)
    bootstrap = Bootstrap(problem, at, side, moving, rules, misfit if problem.scatter == "estimated" else 1.0)
    assert bootstrap.groups
    bootstrap.check_determined()
    # every run and the result need it: computed here, it is sent to the workers
    assert bootstrap.linear_covariance.size
    return bootstrap
