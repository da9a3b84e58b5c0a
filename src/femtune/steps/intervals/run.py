"""The step intervals: frequencies of a box of parameters, or the box that gives frequencies between limits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.arguments import checked
from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file import StudyFile, is_deck, read_study_file
from femtune.files.study_file.intervals import IntervalsTable
from femtune.model.response.rigid import is_rigid
from femtune.steps.intervals.record import BoxInterval, IntervalPredictions, PredictedInterval
from femtune.steps.report.function import checked_page, with_page
from femtune.steps.result import Arrays, ResultWithPage
from femtune.steps.results import Results
from femtune.steps.select.run import check_parameters
from femtune.study.described import StudySource, source_of
from femtune.study.error_places import errors_at
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.rows import Rows, rows_of
from femtune.study.solved import nominal, solve
from femtune.study.study import load_study
from femtune.uncertainty import FrequenciesByOrder, StochasticStatus, definite_signs, interval_bounds, interval_update

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.uncertainty import Bounds, IntervalResult

_COUNT = 6
"""Frequencies of each configuration if the study gives neither limits nor a number."""
_FIRST_BOX = 0.25
"""Ends of the first box between the initial value and the bounds of each parameter."""
_MOST_PARAMETERS = 8
"""Parameters up to which all corners of the box are solved if their effects are not known to be monotone: 2⁸ = 256."""
_MOST_NAMED = 4
"""Intervals that the first sentence gives."""


@dataclass(frozen=True, eq=False, repr=False)
class IntervalsResult(ResultWithPage):
    """Box of the parameters, and the extreme frequencies of all models in it.

    `record` is that of results.json, ``intervals``; `results` has it with the facts of the study, `arrays` the arrays
    by key (none), `report` the page, None without one.
    """

    page = "intervals"
    record: IntervalPredictions
    results: Results
    arrays: Arrays
    report: Path | None = None

    @property
    def frequencies(self) -> Rows:
        """Lowest and highest value of each frequency, Hz."""
        return rows_of(self.record.frequencies, "configuration", "mode", "lower_hz", "upper_hz", "inside")

    @property
    def parameters(self) -> Rows:
        """Ends of the box, in the units of the parameters."""
        return rows_of(self.record.parameters, "parameter", "lower", "upper")

    def _sentences(self) -> list[str]:
        return list(self.record.sentences)

    def _table(self) -> Rows:
        return self.frequencies


@checked
def intervals(source: StudySource, *, report: Path | str | None = None, progress: Progress = silent) -> IntervalsResult:
    """Extreme frequencies of all models between the bounds, or the box that gives frequencies between limits.

    Parameters
    ----------
    source : a study; [intervals] has the limits
    report : HTML page to write
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``quantify.interval``, ``study.no-parameters``, and errors in the files

    Source: Khodaparast, Mottershead and Badcock (2011), with corners in place of a surrogate.

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> root = ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.8, upper=1.2)
    >>> model = ft.read_deck(example_deck(), units="m-kg-s")
    >>> found = ft.intervals(ft.Study(title="beam", model=model, parameters=[root], intervals={"count": 2}))
    >>> [(row.mode, round(row.lower_hz, 2), round(row.upper_hz, 2)) for row in found.frequencies]
    [(1, 25.51, 30.69), (2, 44.7, 44.7)]
    """
    page, described = checked_page(report), source_of(source)
    watch = Stopwatch(call("intervals", described))
    with watch.step("read"):
        # before the model is read, since this runs the solver
        file = described if isinstance(described, StudyFile) or is_deck(described) else read_study_file(described)
        if isinstance(file, StudyFile) and file.solver is not None:
            raise FemtuneError("external.study/update", key="intervals")
        study = load_study(described, progress)
        check_parameters(study)
    with watch.step("intervals"), errors_at(study.file.where("intervals")):
        record = _found(study, study.file.intervals or IntervalsTable(), progress)
    results = Results(provenance=provenance(inputs_of(study), watch), study=study_facts(study), intervals=record)
    return with_page(IntervalsResult(record, results, {}), page, progress)


def _found(study: Study, table: IntervalsTable, progress: Progress) -> IntervalPredictions:
    free = study.parameters.free
    names = [case.name for case in study.cases]
    stated = table.configuration or names[0]
    if stated not in names:
        raise FemtuneError(
            "quantify.interval/configuration", hint=did_you_mean(stated, names), name=stated, known=", ".join(names)
        )
    box = np.array([p.lower for p in free]), np.array([p.upper for p in free])
    limits, update, solutions = np.array(table.limits_hz, float).reshape(-1, 2), None, 0
    if len(limits):
        progress.step("box of the parameters", 0, None)
        update = _box_of(study, study.cases[names.index(stated)], limits)
        box, solutions = (update.lower, update.upper), update.solutions
    rows: list[PredictedInterval] = []
    proven = True
    for case in study.cases:
        progress.step(f"frequencies of {case.name}", 0, None)
        count = table.count or len(limits) or _COUNT
        bounds = interval_bounds(_outputs(study, case, count), *box, definite_signs(case.configured))
        solutions, proven = solutions + bounds.solutions, proven and bounds.proven
        rows += _rows(case.name, bounds, limits if case.name == stated else np.zeros((0, 2)))
    error = None if update is None else _error(update, limits)
    outside = [p.name for p, low, high in zip(free, *box) if low < p.lower or high > p.upper]
    return IntervalPredictions(
        of_limits=update is not None,
        ok=update is None or (update.status is StochasticStatus.CONVERGED and not outside),
        proven=proven,
        error_percent=error,
        solutions=solutions,
        parameters=tuple(
            BoxInterval(parameter=p.name, lower=float(low), upper=float(high)) for p, low, high in zip(free, *box)
        ),
        frequencies=tuple(rows),
        sentences=tuple(_sentences(rows, update, error, proven, outside)),
    )


def _outputs(study: Study, case: StudyCase, count: int) -> FrequenciesByOrder:
    """The lowest elastic frequencies of a configuration, as many as the model has."""
    solution = solve(study, case, nominal(study))
    rigid = int(np.sum(is_rigid(solution)))
    return FrequenciesByOrder(case.configured, min(count, case.configured.n_free - rigid), rigid)


def _box_of(study: Study, case: StudyCase, limits: Reals) -> IntervalResult:
    free, signs = study.parameters.free, definite_signs(case.configured)
    if len(free) > _MOST_PARAMETERS and not signs.all():
        raise FemtuneError("quantify.interval/parameters", values={"parameters": len(free)}, most=_MOST_PARAMETERS)
    outputs = _outputs(study, case, len(limits))
    if outputs.count < len(limits):
        raise FemtuneError("quantify.interval/count", values={"limits": len(limits), "frequencies": outputs.count})
    start = (
        np.array([p.nominal - _FIRST_BOX * (p.nominal - p.lower) for p in free]),
        np.array([p.nominal + _FIRST_BOX * (p.upper - p.nominal) for p in free]),
    )
    try:
        return interval_update(outputs, (limits[:, 0], limits[:, 1]), start, signs)
    except FemtuneError as error:
        lower, upper = (np.array(error.values.get(key, ())) for key in ("lower", "upper"))
        if error.code != "quantify.interval" or len(lower) != len(free):
            raise
        bounds = interval_bounds(outputs, np.array([p.lower for p in free]), np.array([p.upper for p in free]), signs)
        reach = "; ".join(f"{low:.5g} to {high:.5g}" for low, high in zip(bounds.lower, bounds.upper))
        names = ", ".join(p.name for p, low, high in zip(free, lower, upper) if high <= low)
        raise FemtuneError("quantify.interval/no-box", names=names, reach=reach) from error


def _rows(case: str, bounds: Bounds, limits: Reals) -> Iterator[PredictedInterval]:
    for j, (low, high) in enumerate(zip(bounds.lower, bounds.upper)):
        stated = (float(limits[j, 0]), float(limits[j, 1])) if j < len(limits) else None
        yield PredictedInterval(
            configuration=case, mode=j + 1, lower_hz=float(low), upper_hz=float(high), limits_hz=stated,
            inside=bool(bounds.inside[j].any()),
        )  # fmt: skip


def _error(update: IntervalResult, limits: Reals) -> float:
    """Largest relative difference, %."""
    found = np.concatenate([update.bounds.lower, update.bounds.upper])
    return 100.0 * float(np.abs(found / limits.T.ravel() - 1.0).max())


def _sentences(
    rows: Sequence[PredictedInterval],
    update: IntervalResult | None,
    error: float | None,
    proven: bool,
    outside: Sequence[str],
) -> Iterator[str]:
    if update is None:
        of = len({row.configuration for row in rows})
        first = ", ".join(f"{row.lower_hz:.5g} to {row.upper_hz:.5g} Hz" for row in rows[:_MOST_NAMED])
        more = f", and {len(rows) - _MOST_NAMED} more" if len(rows) > _MOST_NAMED else ""
        where = "" if of == 1 else f" ({of} configurations)"
        yield f"Between the bounds of the parameters the frequencies are{where}: {first}{more}."
    elif not update.status.ok:
        yield f"The box of the parameters did not converge: {update.status.value}."
    else:
        yield f"The extreme frequencies of the box differ from the limits by {error:.2g} % at most."
        if update.status is not StochasticStatus.CONVERGED:
            yield (
                "The limits do not determine all ends of the box: other boxes have the same extreme frequencies. This "
                "one is the nearest to the first box."
            )
    if outside:
        yield (
            f"The box is wider than the bounds of {', '.join(outside)}: models between the bounds do not have "
            "frequencies at all of these limits."
        )
    yield (
        "The extremes are proven by monotony."
        if proven
        else "The extremes were found at the corners and by a search, which is no proof."
    )
