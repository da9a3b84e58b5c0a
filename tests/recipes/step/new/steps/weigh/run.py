"""The step weigh: mass properties of each configuration, and whether the mass is within its budget."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.arguments import checked
from femtune.model.response.mass import mass_response
from femtune.steps.report.function import checked_page, with_page
from femtune.steps.result import Arrays, ResultWithPage
from femtune.steps.results import Results
from femtune.steps.weigh.record import MassOfConfiguration, WeighResults
from femtune.study.described import StudySource, source_of
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.rows import Rows, rows_of
from femtune.study.study import load_study

if TYPE_CHECKING:
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study


@dataclass(frozen=True, eq=False, repr=False)
class WeighResult(ResultWithPage):
    """Mass properties of each configuration; `record` is that of results.json, ``weigh``."""

    page = "weigh"
    record: WeighResults
    results: Results
    arrays: Arrays
    report: Path | None = None

    @property
    def masses(self) -> Rows:
        """Mass and centre of gravity by configuration, in the units of the study."""
        return rows_of(self.record.configurations, "configuration", "mass", "centre")

    def _sentences(self) -> list[str]:
        return [f"{c.configuration}: mass {c.mass:.6g}" for c in self.record.configurations]

    def _table(self) -> Rows:
        return self.masses


@checked
def weigh(source: StudySource, *, report: Path | str | None = None, progress: Progress = silent) -> WeighResult:
    """Mass, centre of gravity and moments of inertia of each configuration, at the initial values of the parameters.

    Parameters
    ----------
    source : a study or a model; [weigh] states the point of reference and the mass budget
    report : HTML page to write
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``run.unwritable``, and errors in the files

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> ft.weigh(example_deck())
    WeighResult: baseline: mass 9.85
    """
    page, described = checked_page(report), source_of(source)
    watch = Stopwatch(call("weigh", described))
    with watch.step("read"):
        study = load_study(described, progress)
    with watch.step("weigh"):
        record = weighed(study)
    results = Results(provenance=provenance(inputs_of(study), watch), study=study_facts(study), weigh=record)
    return with_page(WeighResult(record, results, {}), page, progress)


def weighed(study: Study) -> WeighResults:
    """The mass properties of all configurations of a study."""
    table = study.file.weigh
    found = tuple(_configuration(study, case) for case in study.cases if study.source.has_structure)
    within = table.budget is None or all(c.mass <= table.budget for c in found)
    return WeighResults(about=table.about, budget=table.budget, within=within, configurations=found)


def _configuration(study: Study, case: StudyCase) -> MassOfConfiguration:
    point = case.configured.at(np.zeros(len(study.parameters.free)))
    found = mass_response(point, study.file.weigh.about).properties
    return MassOfConfiguration(
        configuration=case.name,
        mass=found.mass,
        centre=tuple(found.centre.tolist()),
        moments=tuple(found.inertia.diagonal().tolist()),
    )
