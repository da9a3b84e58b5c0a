"""Errors of the model about the changes that the data want, instead of about none.

The residuals of a model with unknown changes q are nonlinear in q: changes of 10 % move strong data by many standard
deviations more or less than their derivatives at q = 0 say. So they are linearised about the most probable parameters
and changes (x̂, q̂), which are found as by Gauss and Newton: the most probable ones of the linearised residuals, a
solution with derivatives there, and again. The samples then have

    r(x, q) = r(x, 0) + c + D (x − x̂) + B (q − q̂),

with c and D the differences of the residuals and of their derivatives by the parameters at x̂ with and without q̂.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.judge.widened import widened_beside
from femtune.sampling import Known, Shift
from femtune.steps.posterior.problem import likelihood_of, sampler_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from femtune.arrays import Reals
    from femtune.residuals import Evaluation
    from femtune.sampling import Likelihood, SamplingRules, Solving
    from femtune.sampling.kinds import NoiseRule
    from femtune.steps.posterior.model_errors import ModelErrors, UnknownChanges
    from femtune.updating import UpdateResult

_SMALL_MISS = 0.5
"""Length, in standard deviations of the data, of what linearised residuals miss: it changes the log likelihood of
residuals of usual size by about as much."""
MOST_DOFS = 50_000
"""Free DOFs up to which the model is solved with changes: modes and their derivatives by a hundred factors."""
_MOST_ROUNDS = 8
"""Linearisations; three do for values that are 50 % wrong."""
_MOST_APART = 3
"""Changes apart from their class: each is one more size to be sampled."""
_TRIED = 4
"""Changes that are tried apart from their class, those that the data want most by themselves."""
_LEAST_GAIN = 2.0
"""Of log density with the prior of a further standard deviation, which costs two: two of 200 simulated tests of right
models gained as much."""
_HALVINGS = 4
"""Of a step that does not lead to a more probable model: an eighth of it is tried last."""


@dataclass(frozen=True, eq=False)
class _Centre:
    """The model with changes at a point.

    Parameters
    ----------
    raw : (raw,) normalised values of what changes
    at : the evaluation
    known : parameters, residuals and their Jacobian
    """

    raw: Reals
    at: Evaluation
    known: Known


@dataclass(frozen=True, eq=False)
class _Likely:
    """The most probable parameters x (k,) and sizes θ (t,) of linearised residuals, with their log density."""

    errors: ModelErrors
    likelihood: Likelihood
    x: Reals
    theta: Reals
    log_density: float


def about_most_probable(
    changes: UnknownChanges, solving: Solving, result: UpdateResult, noise: NoiseRule, rules: SamplingRules
) -> tuple[Solving, ModelErrors]:
    """The errors of the model, and the model at samples with what their most probable changes add to it.

    Where the linearised residuals hold without changes, these are about none, and the model is as it is; above
    `MOST_DOFS` too. Where they do not hold in the end, the errors say so.
    """
    return _Search(changes, solving, result, noise, rules).run()


@dataclass(frozen=True, eq=False)
class _Search:
    """Of the most probable parameters and changes."""

    changes: UnknownChanges
    solving: Solving
    result: UpdateResult
    noise: NoiseRule
    rules: SamplingRules

    def run(self) -> tuple[Solving, ModelErrors]:
        """See `about_most_probable`."""
        changes = self.changes
        first = here = self._centre(changes.end)
        apart, settled = frozenset[int](), ""
        for number in range(_MOST_ROUNDS):
            slopes = changes.slopes(here.at)
            start = replace(here.known, residuals=here.known.residuals - slopes @ here.raw)
            apart, likely = self._apart(here, start, apart)
            if not likely.errors.classes:
                return self.solving, likely.errors
            if any(case.configured.n_free > MOST_DOFS for case in changes.problem.cases):
                settled = f"the model has more than {MOST_DOFS:,} free DOFs, and was not solved with changes"
                break
            there = self._better(here, likely, start)
            if there is None:
                settled = "no more probable model was found in the direction of the most probable changes"
                break
            missed = there.known.residuals - (
                here.known.residuals + np.asarray(here.known.jacobian) @ (there.known.x - here.known.x)
                + slopes @ (there.raw - here.raw)
            )  # fmt: skip
            small = float(np.linalg.norm(missed)) < _SMALL_MISS
            if small and number == 0:
                break
            here = there
            if small:
                break
        else:
            settled = f"the most probable changes did not converge within {_MOST_ROUNDS} linearisations"
        errors = replace(changes.about(here.at, apart), not_settled=settled)
        return (self.solving if here is first else self._shifted(here)), errors

    def _shifted(self, here: _Centre) -> Solving:
        own = self.solving((here.known.x, True))
        if own.problem or own.jacobian is None:
            raise FemtuneError("posterior.not-sampled", reason=f"at the most probable parameters {own.problem}")
        constant = here.known.residuals - self.changes.slopes(here.at) @ here.raw - own.residuals
        slope = np.asarray(here.known.jacobian) - own.jacobian
        return replace(self.solving, shift=Shift(here.known.x, constant, slope))

    def _centre(self, at: Evaluation) -> _Centre:
        solved = self.solving.of(at)
        return _Centre(
            at.x[self.changes.own :], at, Known(at.x[self.solving.moving], solved.residuals, solved.jacobian)
        )

    def _likely(self, here: _Centre, start: Known, apart: frozenset[int]) -> _Likely:
        errors = self.changes.about(here.at, apart)
        likelihood = likelihood_of(self.solving, self.result, self.noise, errors)
        sampler = replace(sampler_of(self.solving, likelihood, self.rules, _unsolved), start=start)
        return _Likely(errors, likelihood, *sampler.most_likely())

    def _apart(self, here: _Centre, start: Known, apart: frozenset[int]) -> tuple[frozenset[int], _Likely]:
        """Changes whose standard deviation differs from that of their class, as far as the data tell.

        Where one value is wrong and the others of its class are right, a common standard deviation would let the data
        explain it by small changes of many, those among them that shift the parameters.
        """
        likely = self._likely(here, start, apart)
        while len(apart) < _MOST_APART:
            sigma, _ = likely.likelihood.sizes(likely.theta)
            wanted = self.changes.wanted(here.at, start, sigma)[:_TRIED].tolist()
            tried = {i: self._likely(here, start, apart | {i}) for i in wanted if i not in apart}
            best = max(tried, key=lambda i: tried[i].log_density, default=None)
            if best is None or tried[best].log_density < likely.log_density + _LEAST_GAIN:
                break
            apart, likely = apart | {best}, tried[best]
        return apart, likely

    def _better(self, here: _Centre, likely: _Likely, start: Known) -> _Centre | None:
        """The model at the most probable changes, or nearer, if it is more probable than here; None if it is not."""
        sigma, s = likely.likelihood.sizes(likely.theta)

        def cost(one: _Centre) -> float:
            # combinations of unit changes are orthonormal
            q = np.linalg.lstsq(likely.errors.raw, one.raw, rcond=None)[0]
            return float(np.sum((one.known.residuals / sigma) ** 2) + np.sum((q / s) ** 2))

        linear = start.residuals + np.asarray(start.jacobian) @ (likely.x - start.x)
        q = likely.likelihood.factors(linear[None], likely.theta[None])[0]
        step = np.zeros(len(here.at.x))
        step[self.solving.moving] = likely.x - here.known.x
        step[self.changes.own :] = self.changes.within(likely.errors.raw @ q) - here.raw
        for part in 0.5 ** np.arange(_HALVINGS):
            try:
                there = self._centre(widened_beside(self.changes.problem, here.at.x + part * step, here.at))
            except FemtuneError:
                continue
            if len(there.known.residuals) == len(here.known.residuals) and cost(there) < cost(here):
                return there
        return None


def _unsolved(points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
    """The most probable point of linearised residuals needs no solution."""
    raise AssertionError
