"""The record of a posterior distribution, from its samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.document.numbers import counted, interval, listed
from femtune.sampling import GOOD_ERROR, bends, weighted_quantiles
from femtune.sampling.chains import MIXED
from femtune.steps.posterior.problem import completed
from femtune.steps.posterior.record import (
    BentPair,
    FurtherTest,
    ModelErrorClass,
    OtherRegion,
    PosteriorFrequency,
    PosteriorNoise,
    PosteriorParameter,
    PosteriorResults,
    WantedChange,
)
from femtune.steps.update.facts.update import citations
from femtune.study.record import alert

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.arrays import Flags, Integers, Reals
    from femtune.files.study_file import PosteriorTable
    from femtune.sampling import Likelihood, PosteriorSamples
    from femtune.steps.posterior.model_errors import ModelErrors
    from femtune.steps.posterior.predictions import SampledPredictions
    from femtune.study.record import Alert
    from femtune.updating import UpdateResult

_ENDS = np.array([0.025, 0.5, 0.975])
_SHIFT = 0.2
"""Shift of a median in standard deviations, up to which the linearised residuals do: a 95 % interval that is shifted so
far holds 94 %."""
_END_SHIFT = 0.3
"""Shift of an end of a 95 % interval in standard deviations, up to which they do."""
_QUANTILE_SD = 2.67
"""Standard deviation of the 2.5 % quantile of n samples of a normal distribution, times √n: √(0.025·0.975)/φ(1.96)."""
_AS_WIDE = 0.9
"""Standard deviation over that before the test, above which the data tell nothing."""
_MOST_ANEW = 0.05
"""Weighted part of the samples with another pairing from which a warning is given."""
_MOST_FAILED = 0.01
"""Share of failed solutions above which a warning is given: the distribution lacks the points where they failed."""
_LARGE_FULL_ERROR = 0.5
"""Standard deviation of log likelihood between full and reduced model, above which the weights would not be those of
the full model: one effective sample of five is lost there."""
_FEWEST = 400.0
"""Effective samples below which ends of 95 % intervals vary by 0.13 standard deviations or more."""


_RARE = 0.01
"""Part of the samples that are as far from the others as measured frequencies, below which a warning is given."""
_MOST_WANTED = 5
"""Changes that are listed."""
_WIDER = 1.1
"""Interval over that with errors of the data alone, above which it is named."""


@dataclass(frozen=True, eq=False)
class OutsideOptimum:
    """An optimum outside the samples: where, difference of log likelihood to the best sample, number of starts."""

    x: Reals
    difference: float
    starts: int


@dataclass(frozen=True, eq=False)
class SampledFacts:
    """All that the record is made of.

    Parameters
    ----------
    moving : positions of the sampled parameters
    anew : (n,) samples at which the pairing is another one
    """

    table: PosteriorTable
    result: UpdateResult
    moving: Integers
    samples: PosteriorSamples
    likelihood: Likelihood
    anew: Flags
    recalled: int
    seconds: float
    executor: str
    starts: int
    regions: tuple[OutsideOptimum, ...]
    errors: ModelErrors
    left_out: tuple[str, ...]
    reduced_orders: tuple[int, ...]
    full_error: float | None
    further: tuple[FurtherTest, ...]
    predictions: SampledPredictions
    remarks: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the sampled parameters."""
        return tuple(self.result.parameters.free[i].name for i in self.moving)

    def complete(self, x: Reals) -> Reals:
        """(n, k) with the parameters that rest."""
        return completed(self.result.x, x, self.moving)


def posterior_results(facts: SampledFacts, arrays: dict[str, NDArray[Any]]) -> PosteriorResults:
    """The record; samples and weights are put into `arrays`."""
    s, table = facts.samples, facts.table
    keys = {name: f"posterior/{name}" for name in ("samples", "weights", "linear", "sizes")}
    parameters = facts.result.parameters
    arrays[keys["samples"]] = np.asarray(parameters.denormalise(facts.complete(s.x)))[:, facts.moving]
    arrays[keys["weights"]] = s.weights.values
    arrays[keys["linear"]] = np.asarray(parameters.denormalise(facts.complete(s.linear)))[:, facts.moving]
    arrays[keys["sizes"]] = np.exp(s.theta)
    estimates, noise = tuple(_parameters(facts)), tuple(_noise(facts))
    coordinates = s.x
    bent = tuple(
        BentPair(first=facts.names[b.first], second=facts.names[b.second], share_percent=100.0 * b.share)
        for b in bends(coordinates, s.weights.values)
    )
    chance = 2.0 * _QUANTILE_SD / np.sqrt(s.weights.effective)
    off = [p for p in estimates if not _linear_does(p, chance)]
    anew = float(s.weights.values @ facts.anew)
    others = tuple(
        OtherRegion(
            values=tuple(map(float, parameters.denormalise(r.x))), log_likelihood_difference=r.difference,
            starts=r.starts,
        )
        for r in facts.regions
    )  # fmt: skip
    record = PosteriorResults(
        noise=table.noise, discrepancy=table.discrepancy, no_model_errors=facts.errors.reason,
        fields_left_out=facts.errors.left_out, changes_not_settled=facts.errors.not_settled,
        model_errors=tuple(_model_errors(facts)), wanted=tuple(_wanted(facts)),
        seed=table.seed, draws=len(s.x), effective=s.weights.effective, k_hat=s.weights.k_hat,
        drawn_from=s.route, degree=s.degree, surrogate_error=s.error, r_hat=s.r_hat, displacement=s.displacement,
        stages=s.stages, further=facts.further, further_sd=table.further_sd,
        predictions=facts.predictions.asked, predictions_failed=facts.predictions.failed,
        frequencies=facts.predictions.frequencies, unused_chance=facts.predictions.chance,
        functions=facts.predictions.functions,
        log_evidence=s.log_evidence, log_evidence_sd=s.log_evidence_sd, gradient_solutions=s.gradients,
        plain_solutions=s.plain, failed=s.failed, paired_anew_percent=100.0 * anew, recalled=facts.recalled,
        seconds=facts.seconds, executor=facts.executor, parameters=estimates, free=facts.names, noise_levels=noise,
        bent=bent, others=others, starts=facts.starts, linear_enough=not off, tried=s.tried, left_out=facts.left_out,
        reduced_orders=facts.reduced_orders, full_model_error=facts.full_error, samples_key=keys["samples"],
        weights_key=keys["weights"], linear_key=keys["linear"], sizes_key=keys["sizes"], sentences=(),
        citations=citations(("ching2007",) if s.route == "tmcmc" else ("vehtari2024", "neal2011", "meng1996")),
    )  # fmt: skip
    sentences = (*_sentences(record, off), *facts.remarks)
    return record.model_copy(update={"sentences": sentences, "alerts": tuple(limits_of(record))})


def _parameters(facts: SampledFacts) -> Iterator[PosteriorParameter]:
    s, result = facts.samples, facts.result
    w, parameters = s.weights.values, result.parameters
    values, intervals = result.values, result.interval()
    sampled = parameters.at_samples(facts.complete(s.x))
    linear = parameters.at_samples(facts.complete(s.linear))
    of_data = None if s.of_data is None else parameters.at_samples(facts.complete(s.of_data))
    before = _prior_sd(facts)
    for name in parameters.names:
        if not np.ptp(sampled[name]):
            continue
        mean = float(w @ sampled[name])
        sd = float(np.sqrt(w @ (sampled[name] - mean) ** 2))
        low, median, high = map(float, weighted_quantiles(sampled[name], w, _ENDS))
        l_low, l_median, l_high = map(float, np.quantile(linear[name], _ENDS))
        interval, of_prior = intervals[name], before.get(name)
        yield PosteriorParameter(
            parameter=name, value=values[name], mean=mean, median=median, sd=sd, interval_95=(low, high),
            linear_median=l_median, linear_sd=float(linear[name].std()), linear_interval_95=(l_low, l_high),
            update_interval_95=interval if np.isfinite(interval).all() else None, prior_sd=of_prior,
            of_bounds=of_prior is not None and sd > _AS_WIDE * of_prior,
            of_data_sd=None if of_data is None else float(of_data[name].std()),
            of_data_interval_95=None if of_data is None else _interval(of_data[name]),
        )  # fmt: skip


def _interval(values: Reals) -> tuple[float, float]:
    low, _, high = map(float, np.quantile(values, _ENDS))
    return low, high


def _model_errors(facts: SampledFacts) -> Iterator[ModelErrorClass]:
    s, first = facts.samples, len(facts.likelihood.estimated)
    for j, one in enumerate(facts.errors.classes, start=first):
        low, median, high = weighted_quantiles(100.0 * np.exp(s.theta[:, j]), s.weights.values, _ENDS).tolist()
        count = facts.errors.of.count(one.name)
        yield ModelErrorClass(what=one.name, count=count, sd_percent=median, interval_95=(low, high))


def _wanted(facts: SampledFacts) -> Iterator[WantedChange]:
    """Mean changes over the samples, those that move the residuals most by themselves first."""
    errors, s = facts.errors, facts.samples
    if not errors.classes:
        return
    factors = s.weights.values @ facts.likelihood.factors(s.residuals, s.theta)
    changes = errors.turn @ factors
    size = np.abs(changes) * errors.effects
    for i in np.argsort(-size)[:_MOST_WANTED]:
        if size[i] == 0.0:
            return
        yield WantedChange(what=errors.names[i], of=errors.of[i], change_percent=100.0 * float(changes[i]))


def _prior_sd(facts: SampledFacts) -> dict[str, float]:
    parameters = facts.result.parameters
    informed = bool(np.any(facts.result.side.informative)) and len(facts.result.side.matrix) > 0
    lower, upper = (parameters.denormalise(ends) for ends in parameters.limits)
    uniform = (upper - lower) / np.sqrt(12.0)
    prior_sd = np.minimum(parameters.prior[1] * parameters.scale, uniform) if informed else uniform
    return {parameters.free[i].name: float(prior_sd[i]) for i in facts.moving}


def _noise(facts: SampledFacts) -> Iterator[PosteriorNoise]:
    likelihood, s = facts.likelihood, facts.samples
    for i, group in enumerate(likelihood.groups):
        if group.name == "prior":
            continue
        if not group.estimated:
            yield PosteriorNoise(residuals=group.name, count=group.count, factor=1.0, interval_95=None)
            continue
        factor = np.exp(s.theta[:, likelihood.estimated.index(i)])
        low, median, high = map(float, weighted_quantiles(factor, s.weights.values, _ENDS))
        yield PosteriorNoise(residuals=group.name, count=group.count, factor=median, interval_95=(low, high))


def _linear_does(p: PosteriorParameter, chance: float) -> bool:
    """Whether linearised residuals give the same interval; `chance` is what ends may differ by in any case."""
    ends = zip(p.interval_95, p.linear_interval_95)
    return abs(p.median - p.linear_median) <= (_SHIFT + 0.5 * chance) * p.sd and all(
        abs(a - b) <= (_END_SHIFT + chance) * p.sd for a, b in ends
    )


def _ends(low: float, high: float) -> str:
    return " … ".join(interval(low, high))


def _size(p: PosteriorParameter) -> float:
    return max(abs(a - b) for a, b in zip(p.interval_95, p.linear_interval_95)) / p.sd


def _sentences(record: PosteriorResults, off: list[PosteriorParameter]) -> Iterator[str]:
    if off:
        worst = max(off, key=_size)
        (a, b), (c, d) = worst.interval_95, worst.linear_interval_95
        others = [p.parameter for p in off if p is not worst]
        further = f"; further off are {listed(others)}" if others else ""
        yield (
            f"The intervals of linearised residuals do not hold: that of {worst.parameter} would be {_ends(c, d)}, and "
            f"is {_ends(a, b)}{further}."
        )
    else:
        yield (
            "The intervals of linearised residuals are accurate enough here, with the same size of the errors: no "
            f"median differs by more than {_SHIFT} standard deviations, and no end of an interval by more than "
            f"{_END_SHIFT}."
        )
    for level in record.noise_levels:
        if level.interval_95 is not None:
            low, high = level.interval_95
            yield (
                f"The errors of {level.residuals} are {level.factor:.2g} times as large as stated "
                f"({low:.2g} … {high:.2g})."
            )
    yield from _of_model(record)
    if record.fields_left_out:
        fields, are = ("field", "is") if record.fields_left_out == 1 else ("fields", "are")
        yield (
            f"{record.fields_left_out} {fields} of the deck {are} not among the unknown changes, since there are too "
            "many; their errors are not in the intervals."
        )
    blind = [p.parameter for p in record.parameters if p.of_bounds]
    if blind:
        yield f"The data contain no information about {listed(blind)}: the distribution is as wide as before the test."
    if record.bent:
        pairs = [f"{b.first} and {b.second}" for b in record.bent[:3]]
        yield f"Their joint distribution is bent: {listed(pairs)}."
    if record.further:
        best = record.further[0]
        most = max(best.parameters, key=lambda p: p.sd / p.sd_after if p.sd_after else np.inf)
        yield (
            f"A test of {best.configuration}, {len(best.modes)} frequencies with errors of "
            f"{100.0 * record.further_sd:.2g} %, is expected to bring {best.bits:.1f} bits; the standard deviation of "
            f"{most.parameter} would fall from {most.sd:.2g} to {most.sd_after:.2g}."
        )
    yield from _predicted(record)
    weights = f"k̂ = {record.k_hat:.2f}" if record.drawn_from != "tmcmc" else f"after {record.stages} stages of TMCMC"
    yield (
        f"{record.effective:.0f} of {record.draws} samples are effective, {weights}; the logarithm of the evidence is "
        f"{record.log_evidence:.2f} ± {record.log_evidence_sd:.2f}."
    )


def _of_model(record: PosteriorResults) -> Iterator[str]:
    """What errors of the model do to the intervals."""
    wider = [p for p in record.parameters if p.of_data_sd]
    if wider:
        most = max(wider, key=lambda p: p.sd / (p.of_data_sd or 1.0))
        ratio, (low, high), (a, b) = (
            most.sd / (most.of_data_sd or 1.0),
            most.of_data_interval_95 or (0, 0),
            most.interval_95,
        )
        if ratio > _WIDER:
            yield (
                f"Errors of the model widen the intervals: that of {most.parameter} is {_ends(a, b)}; errors of the "
                f"data alone would give {_ends(low, high)}."
            )
        else:
            yield "Errors of the model hardly widen the intervals: no standard deviation by more than 10 %."
    elif record.discrepancy == "none":
        yield 'Errors of the model are not in the intervals; discrepancy = "properties" in [posterior] adds them.'
    else:
        yield f"Errors of the model are not in the intervals: {record.no_model_errors}."
    if record.wanted:
        first = record.wanted[0]
        yield (
            f"Among the properties that are no parameters, the most probable change is that of {first.what}: "
            f"{first.change_percent:+.2g} % ({first.of})."
        )


def _unused(record: PosteriorResults) -> tuple[list[PosteriorFrequency], list[PosteriorFrequency]]:
    """Predicted frequencies that were measured and not used, and those of them outside their interval."""
    unused = [f for f in record.frequencies if f.measured_inside is not None and not f.used]
    return unused, [f for f in unused if not f.measured_inside]


def _predicted(record: PosteriorResults) -> Iterator[str]:
    unused, outside = _unused(record)
    if unused:
        missed = [f"{f.measured_hz:.5g} Hz ({_ends(*f.interval_95)})" for f in outside]
        names = f"; outside: {listed(missed)}" if missed else ""
        inside = len(unused) - len(outside)
        yield (
            f"Of {counted(len(unused), 'measured frequency', 'measured frequencies')} that the update did not use, "
            f"{inside} {'is' if inside == 1 else 'are'} in the 95 % interval that was predicted{names}."
        )
    for one in record.functions:
        share = one.measured_inside_percent
        of_test = "" if share is None else f"; {share:.0f} % of the measured lines are in them"
        yield f"The 95 % bands of the FRFs of {one.configuration} are {one.width_db:.2g} dB wide (median){of_test}."


def limits_of(record: PosteriorResults) -> Iterator[Alert]:
    if record.others:
        values = "; ".join(
            ", ".join(f"{n} = {v:.4g}" for n, v in zip(record.free, o.values)) for o in record.others[:3]
        )
        yield alert(
            "problem",
            "posterior.other-region",
            regions="another" if len(record.others) == 1 else f"{len(record.others)} others",
            values=values,
        )
    if record.paired_anew_percent > 100.0 * _MOST_ANEW:
        yield alert("warning", "posterior.paired-anew", percent=record.paired_anew_percent)
    if record.r_hat is not None and record.r_hat > MIXED:
        yield alert("warning", "posterior.slow-chains", r_hat=record.r_hat)
    if record.surrogate_error is not None and record.surrogate_error > GOOD_ERROR:
        yield alert("warning", "posterior.rough", sd=record.surrogate_error)
    if record.effective < _FEWEST:
        yield alert("warning", "posterior.few-effective", effective=record.effective, draws=record.draws)
    if record.failed > _MOST_FAILED * (record.gradient_solutions + record.plain_solutions):
        yield alert("warning", "posterior.failed", failed=record.failed)
    if record.full_model_error is not None and record.full_model_error > _LARGE_FULL_ERROR:
        yield alert("warning", "posterior.reduced-model", sd=record.full_model_error)
    unused, outside = _unused(record)
    if record.unused_chance is not None and record.unused_chance < _RARE:
        percent = 100.0 * record.unused_chance
        yield alert("warning", "posterior.prediction-missed", percent=percent, outside=len(outside), unused=len(unused))
    if record.predictions_failed > _MOST_FAILED * record.predictions:
        yield alert(
            "info", "posterior.predictions-failed", failed=record.predictions_failed, predictions=record.predictions
        )
    yield from _not_in_likelihood(record)


def _not_in_likelihood(record: PosteriorResults) -> Iterator[Alert]:
    """What the likelihood has otherwise than asked for."""
    if record.changes_not_settled:
        yield alert("warning", "posterior.changes-not-settled", reason=record.changes_not_settled)
    if record.left_out:
        yield alert("warning", "posterior.left-out", kinds="; ".join(record.left_out))
    stated = [n.residuals for n in record.noise_levels if n.interval_95 is None]
    if record.noise != "stated" and stated:
        yield alert("info", "posterior.noise-as-stated", kinds=listed(stated))
