"""Reasons from the search for a better minimum, and from frequencies that the update has made worse."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.numbers import counted
from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.correlate.record.correlation import ModelVersion
    from femtune.steps.results import Results
    from femtune.steps.update.record.search import MinimumResults, TrialFacts

_WORSE_PERCENT = 1.0
"""Frequency error in per cent from which it matters that it has grown; a judgement."""
_GROWN = 1.05
"""Ratio of the root mean square after and before, from which frequencies are worse as a whole: less is the last digits
of both."""
_MOST_NAMED = 3
"""Modes or pairings that a reason names."""


def minimum_reasons(results: Results) -> Iterable[ReasonRecord]:
    """Minima better than that where the update ended, pairings that are open, frequencies worse than at the start."""
    update = results.update
    if update is not None and update.minimum is not None:
        yield from _of_search(update.minimum)
    if update is not None and not update.looked_further:
        yield reason("reservation", "judge.not-looked-further")
    written = any(comparison.stage == "after as written" for comparison in results.correlations)
    yield from _of_frequencies(results, "after as written" if written else "after")


def _of_search(found: MinimumResults) -> Iterator[ReasonRecord]:
    improving = [t for t in found.trials if t.better]
    if improving:
        yield reason(
            "reservation", "judge.better-minimum", tried=improving[-1].sentence, first=found.first_chi_square,
            now=found.chi_square,
        )  # fmt: skip
    for trial in found.trials:
        if trial.held is not None and not trial.better and _open(trial, found):
            yield reason(
                "not accepted", "judge.pairing-open", pairs=trial.sentence, before=trial.before, held=trial.held
            )
    if found.left and not improving:
        more = len(found.left) - _MOST_NAMED
        named = "; ".join([*found.left[:_MOST_NAMED], *([f"and {more} more"] if more > 0 else [])])
        yield reason("reservation", "judge.pairing-not-tried", pairs=named)


def _open(trial: TrialFacts, found: MinimumResults) -> bool:
    """True if the held pairs are better than the result too."""
    return trial.held is not None and trial.held < found.chi_square - 1.0


def _of_frequencies(results: Results, final: ModelVersion) -> Iterator[ReasonRecord]:
    """Of the test modes that are paired before and after: the root mean square, and single ones."""
    before, after = _errors(results, "before"), _errors(results, final)
    both = [key for key in before if key in after]
    if not both:
        return
    then, now = (np.abs([errors[key] for key in both]) for errors in (before, after))
    size = [float(np.sqrt(np.mean(errors**2))) for errors in (then, now)]
    if size[1] > _GROWN * size[0] and now.max() > _WORSE_PERCENT:
        yield reason("not accepted", "judge.frequencies-worse", before=size[0], after=size[1])
    else:
        worse = [i for i in range(len(both)) if now[i] > max(then[i], _WORSE_PERCENT)]
        if worse:
            named = [
                f"{both[i][0]}: mode {both[i][1]} ({before[both[i]]:+.2f} % before, {after[both[i]]:+.2f} % after)"
                for i in worse[:_MOST_NAMED]
            ]
            more = len(worse) - len(named)
            told = "; ".join([*named, *([f"and {counted(more, 'more mode')}"] if more else [])]).replace("-", "−")
            yield reason("reservation", "judge.frequency-worse", modes=told)


def _errors(results: Results, version: ModelVersion) -> dict[tuple[str, str], float]:
    """Frequency errors in per cent by configuration and test mode."""
    return {
        (comparison.configuration, pair.test_label): pair.freq_error_percent
        for comparison in results.correlations
        if comparison.stage == version
        for pair in comparison.pairs
    }
