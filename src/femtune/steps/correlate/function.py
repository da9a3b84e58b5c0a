"""The function `correlate`: test against model."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.errors import Notice
from femtune.files.study_file import with_expansion
from femtune.journal.run_files import numbered
from femtune.steps.correlate.expanded_files import check_expansion_asked, write_expanded_files
from femtune.steps.correlate.result import CorrelateResult
from femtune.steps.correlate.versions import model_records
from femtune.steps.held_folder import held_for_solver
from femtune.steps.info.facts import model_facts, sensor_results
from femtune.steps.judge.facts.acceptance import acceptance
from femtune.steps.judge.verdict import judgement_of_comparisons
from femtune.steps.report.function import checked_page, with_page
from femtune.steps.respond.run import check_places
from femtune.study.described import StudySource, Test, source_of
from femtune.study.inputs import check_outputs, inputs_of_study
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.solutions import looking_up
from femtune.study.solved import nominal
from femtune.study.study import read_study

if TYPE_CHECKING:
    from femtune.steps.correlate.versions import ModelRecords
    from femtune.steps.judge.record.judgement import JudgementResults
    from femtune.steps.results import Results
    from femtune.study.progress import Progress
    from femtune.study.provenance import Inputs
    from femtune.study.study import Study


@checked
def correlate(
    source: StudySource,
    test: Test = None,
    *,
    expand: str | None = None,
    uff: Path | str | None = None,
    choices: Path | str | None = None,
    report: Path | str | None = None,
    fresh: bool = False,
    progress: Progress = silent,
    **tables: Any,
) -> CorrelateResult:
    """Test against model: pairs, frequency errors, MAC, criteria, in each configuration that has a test.

    Parameters
    ----------
    source : a study (an object, or the path of its TOML file); or a model, with the other tables as keywords
    test : what `read_test` returned, or the path of its file; with a model
    expand : expand the test shapes to the model: "serep", "dynamic" or "mdre"; "none"; None: as stated in the study
    choices : file of choices that were made on the page of a report
    uff : Universal File for the expanded shapes; with several configurations each has its own, with its number in the
        name
    report : HTML page to write, with a first page to sign: a single self-contained file
    fresh : ignore the journal of an earlier run of the study and solve everything again
    progress : receives progress reports
    tables : keywords of `Study`: ``modes={"count": 12}``, ``sensors={"tolerance": 0.01}``, ``units``, ``output`` …

    Raises
    ------
    FemtuneError : ``study.no-test``, ``correlate.*``, ``eigen.*``, ``uff.cannot-write``, ``write.overwrites-input``,
        and errors in the files

    Source: Allemang and Brown (1982); Lieven and Ewins (1988).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> found = ft.correlate(model, test)
    >>> found.pairs.column("freq_error_percent").round(2)
    array([ 4.39,  0.  , -0.88,  0.  ])
    >>> found.mac.shape
    (4, 6)
    >>> expanded = ft.correlate(model, test, expand="dynamic", uff="expanded.uff")
    >>> expanded.expanded["baseline"].shapes.shape, [path.name for path in expanded.files]
    ((16, 4), ['expanded.uff'])
    """
    page = checked_page(report)
    watch = Stopwatch(call("correlate", source if isinstance(source, Path | str) else "study"))
    given = source_of(source, test=test, choices=choices, **tables)
    with held_for_solver(given, "correlate"):
        study = read_study(given, progress)
    study = replace(study, file=with_expansion(study.file, expand))
    if all(case.modal is None for case in study.cases):
        raise study.no_test("can be compared")
    files = [] if uff is None else numbered(Path(uff), len(study.cases))
    if uff is not None:
        check_expansion_asked(study, Path(uff))
        check_places(study, files, Path(uff))
    if page is not None:
        check_outputs(inputs_of_study(study), [page])
    inputs = inputs_of(study)
    arrays: dict[str, NDArray[Any]] = {}
    with looking_up(study, fresh) as found:
        solved = model_records(found.study, "before", nominal(study), {}, arrays, progress)
    records = solved.correlations
    judged = judgement_of_comparisons(records, solved.modes, acceptance(study))
    written = write_expanded_files(study, records, arrays, files)
    remarks = [Notice(a.code, a.sentence, level=a.level) for r in records for a in r.alerts if a.level != "info"]
    result = CorrelateResult(
        records,
        arrays=arrays,
        remarks=(*found.remarks, *remarks),
        files=tuple(written),
        judgement=judged,
        whole=partial(_whole, study, solved, judged, inputs, watch),
    )
    return with_page(result, page, progress)


def _whole(study: Study, solved: ModelRecords, judged: JudgementResults, inputs: Inputs, watch: Stopwatch) -> Results:
    """All that a page of the comparison shows."""
    from femtune.steps.results import Results  # noqa: PLC0415  records of all steps, which only a page wants

    return Results(
        provenance=provenance(inputs, watch, (m.solver for m in solved.modes)),
        study=study_facts(study),
        model=model_facts(study),
        sensors=tuple(s for s in (sensor_results(study, c) for c in study.cases) if s is not None),
        modes=solved.modes,
        correlations=solved.correlations,
        mode_shapes=solved.shapes,
        judgement=judged,
        alerts=tuple(a for c in solved.correlations for a in c.alerts),
    )
