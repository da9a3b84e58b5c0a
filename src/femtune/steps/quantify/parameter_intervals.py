"""Intervals of the parameters from the smallest and largest frequencies of repeated tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.steps.quantify.record import IntervalResults, OutputInterval, ParameterInterval
from femtune.uncertainty import Counted, FrequenciesByOrder, definite_signs, interval_update

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.uncertainty import FrequencyOutputs, IntervalResult, StochasticResult

_HALF_WIDTH = 2.0
"""Half-width of the first box of the parameters, in standard deviations: about the extremes of twenty normal values."""
_LEAST_HALF_WIDTH = 1e-3
"""Least half-width of the first box, in initial standard deviations.

A parameter whose standard deviation is zero must still be able to move.
"""
_MOST_PARAMETERS = 8
"""Parameters up to which all corners of the box are solved if their effects are not known to be monotone.

2⁸ = 256 solutions.
"""

_OF_ORDER = " Close modes may change places: frequencies of repeats and model are compared in ascending order."
"""Remark where frequencies are compared by their order."""


def parameter_intervals(outputs: FrequencyOutputs, result: StochasticResult, hz: Reals) -> IntervalResults:
    """The box whose extrema are the smallest and largest frequencies of the repeats `hz` (n, m), from mean ± 2 σ.

    A box that cannot be found is a result with a sentence.

    Raises
    ------
    FemtuneError : ``quantify.interval`` for more than eight parameters whose effect is not known to be monotone
    """
    if outputs.paired.states[0].case.configured.model.tables:
        return _without("they are not computed for values that depend on frequency ([[frequency_table]])", 0)
    measured = np.nanmin(hz, axis=0), np.nanmax(hz, axis=0)
    by_order = _by_order(outputs, hz)
    half = np.maximum(_HALF_WIDTH * result.sd, _LEAST_HALF_WIDTH * result.start_sd)
    case = outputs.paired.states[0].case
    signs = _signs(outputs) if by_order is None else definite_signs(case.configured)
    counted = Counted(outputs if by_order is None else by_order)
    if len(half) > _MOST_PARAMETERS and not signs.all():
        raise FemtuneError("quantify.interval/parameters", values={"parameters": len(half)}, most=_MOST_PARAMETERS)
    try:
        box = interval_update(counted, measured, (result.mean - half, result.mean + half), signs)
    except FemtuneError as error:
        return _without(error.what, counted.solutions)
    return _record(outputs, result, box, measured, by_order is not None)


def _by_order(outputs: FrequencyOutputs, hz: Reals) -> FrequenciesByOrder | None:
    """Frequencies by their order, where modes may change places in the repeats and the table does not follow them.

    A table of frequencies without shapes has the lowest one first in each test. Where two columns overlap, its extremes
    are those of the first and the second frequency, whichever the motions are. The model modes must follow each other,
    since one between them that was not measured would change places with them unseen.

    Returns
    -------
    None where all modes can be followed: no columns overlap and no modes are close, or the table follows them itself
    """
    state = outputs.paired.states[0]
    models = sorted(j for _, of_group in state.groups for j in of_group)
    # a row with a gap says nothing of the order across it
    ascending = not (np.diff(hz, axis=1) < 0.0).any()
    overlap = bool((np.nanmax(hz, axis=0)[:-1] > np.nanmin(hz, axis=0)[1:]).any())
    close = any(len(tests) > 1 for tests, _ in state.groups)
    consecutive = models == list(range(models[0], models[0] + hz.shape[1]))
    if not (ascending and consecutive and (overlap or close)):
        return None
    return FrequenciesByOrder(state.case.configured, len(models), models[0])


def _without(reason: str, solutions: int) -> IntervalResults:
    sentence = f"No intervals of the parameters were found: {reason}."
    return IntervalResults(ok=False, proven=False, sentence=sentence, solutions=solutions, parameters=(), outputs=())


def _signs(outputs: FrequencyOutputs) -> Reals:
    """(k,) +1 or −1 where every frequency grows or falls with a parameter, 0 where that is not known.

    A frequency of close modes is a mean over their subspace, for which nothing is proven.
    """
    state = outputs.paired.states[0]
    if any(len(tests) > 1 for tests, _ in state.groups):
        return np.zeros(len(outputs.problem.parameters.free))
    return definite_signs(state.case.configured)


def _record(
    outputs: FrequencyOutputs,
    result: StochasticResult,
    box: IntervalResult,
    measured: tuple[Reals, Reals],
    by_order: bool,
) -> IntervalResults:
    bounds = box.bounds
    target = np.concatenate(measured)
    error = float(np.abs(np.concatenate([bounds.lower, bounds.upper]) / target - 1.0).max())
    return IntervalResults(
        ok=box.status.ok,
        proven=bounds.proven,
        sentence=_sentence(box, error, by_order),
        solutions=box.solutions,
        parameters=tuple(
            ParameterInterval(parameter=n, lower=float(a), upper=float(b))
            for n, a, b in zip(result.names, box.lower, box.upper)
        ),
        outputs=tuple(
            OutputInterval(
                label=label, measured_lower_hz=float(a), measured_upper_hz=float(b),
                model_lower_hz=float(c), model_upper_hz=float(d),
            )
            for label, a, b, c, d in zip(outputs.modes, *measured, bounds.lower, bounds.upper)
        ),
    )  # fmt: skip


def _sentence(box: IntervalResult, error: float, by_order: bool) -> str:
    if not box.status.ok:
        return f"The intervals of the parameters did not converge: {box.status.value}."
    proof = "proven by monotony" if box.bounds.proven else "found by a search, which is no proof"
    known = "" if box.status.name == "CONVERGED" else " The frequencies do not determine all ends of the intervals."
    return (
        f"The extreme frequencies of the box differ from those of the repeats by {100 * error:.2g} % at most; they are "
        f"{proof}.{known}{_OF_ORDER if by_order else ''}"
    )
