"""Record of the test whether the residuals of an update are noise."""

from __future__ import annotations

from femtune.residuals import ResidualBlock
from femtune.study.load import Study
from femtune.study.results_validation import GoodnessResults, KindOfResiduals
from femtune.update import UpdateResult
from femtune.validate import GoodnessOfFit, goodness_of_fit

_ESTIMATED = "their scatter is estimated from themselves"
_MAC = "the MAC's distance from one is no normal variable: noise always raises it"
_LARGEST = "the scatter of the largest entry is in all others, which shape_sd does not say"


def goodness(study: Study, result: UpdateResult) -> GoodnessOfFit:
    """The test at the end of an update, by the standard deviations that the study states."""
    if not result.after.has_derivatives:
        return goodness_of_fit([])
    why = _untestable(study)
    if study.rules.scatter == "estimated":
        why = dict.fromkeys((block.kind for block in result.after.blocks), _ESTIMATED)
    return goodness_of_fit(result.after.blocks, lost=_lost, untestable=why)


def _lost(block: ResidualBlock) -> int:
    """A shape of unit norm has one independent entry less than sensors."""
    return int(block.kind == "shape" and len(block.values) > 1)


def _untestable(study: Study) -> dict[str, str]:
    table = study.file.residuals
    if table.shape_form == "mac":
        return {"shape": _MAC, "mac": _MAC}
    return {"mac": _MAC} | ({"shape": _LARGEST} if table.shape_scaling == "largest-entry" else {})


def goodness_results(found: GoodnessOfFit) -> GoodnessResults:
    """The test as a record."""
    kinds = (KindOfResiduals(kind=k, chi_square=c, degrees_of_freedom=d, p_value=p) for k, c, d, p in found.by_kind)
    return GoodnessResults(
        chi_square=found.chi_square,
        degrees_of_freedom=found.degrees_of_freedom,
        p_value=found.p_value,
        runs=found.runs,
        runs_p_value=found.runs_p_value,
        largest=found.largest,
        largest_label=found.largest_label,
        by_kind=tuple(kinds),
        verdict=found.outcome.value,
        sentence=found.sentence,
    )
