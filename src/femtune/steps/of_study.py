"""Steps that require a study with a test and write no run folder: correlate, select, quantify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.assembly.described import StudySource, Test, source_of
from femtune.assembly.progress import silent
from femtune.assembly.study import read_study
from femtune.errors import FemtuneError
from femtune.files.study_file import with_expansion
from femtune.results.solved import nominal
from femtune.results.step_results import CorrelateResult, QuantifyResult, SelectResult
from femtune.results.versions import model_records, start
from femtune.study.expanded_files import check_expansion_asked, write_expanded_files
from femtune.study.respond import check_places, uff_paths
from femtune.study.solutions import looking_up

if TYPE_CHECKING:
    from femtune.assembly.progress import Progress
    from femtune.files.study_file.objects import Parameter


@checked
def correlate(
    source: StudySource,
    test: Test = None,
    *,
    expand: str | None = None,
    uff: Path | str | None = None,
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
    uff : Universal File for the expanded shapes; with several configurations each has its own, with its number in the
        name
    fresh : ignore the journal of an earlier run of the study and solve everything again
    progress : receives progress reports
    tables : keywords of `Study`: ``modes={"count": 12}``, ``sensors={"tolerance": 0.01}``, ``units``, ``output`` …

    Raises
    ------
    FemtuneError : ``study.no-test``, ``correlate.*``, ``eigen.*``, ``uff.cannot-write``, ``write.overwrites-input``,
        and errors in the files

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
    >>> expanded.expanded["as the deck"].shapes.shape, [path.name for path in expanded.files]
    ((16, 4), ['expanded.uff'])
    """
    study = read_study(source_of(source, test=test, **tables), progress)
    study = replace(study, file=with_expansion(study.file, expand))
    if all(case.modal is None for case in study.cases):
        raise study.no_test("can be compared")
    files = [] if uff is None else uff_paths(Path(uff), study)
    if uff is not None:
        check_expansion_asked(study, Path(uff))
        check_places(study, files, Path(uff))
    arrays: dict[str, NDArray[Any]] = {}
    with looking_up(study, fresh) as found:
        records = model_records(found.study, "before", nominal(study), {}, arrays, progress).correlations
    written = write_expanded_files(study, records, arrays, files)
    remarks = [f"[{a.code}] {a.sentence}" for record in records for a in record.alerts if a.level != "info"]
    return CorrelateResult(records, arrays=arrays, remarks=(*found.remarks, *remarks), files=tuple(written))


@checked
def select(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    fresh: bool = False,
    progress: Progress = silent,
    **tables: Any,
) -> SelectResult:
    """Which parameters and combinations of parameters the data determine.

    Parameters
    ----------
    source, test, fresh, progress, tables : as for `correlate`
    parameters, residuals : as for `Study`

    Raises
    ------
    FemtuneError : ``study.no-parameters``, and as `correlate`

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> found = ft.select(model, test, parameters=free, residuals=[ft.FrequencyResidual(sd=0.01)])
    >>> found
    SelectResult: 2 of 2 combinations of parameters are determined
      The data determine all 2 free parameters, some better than others.
    >>> found.jacobian.shape
    (4, 2)
    """
    # what the other steps do without
    from femtune.study.select import check_parameters, select_at  # noqa: PLC0415

    study = read_study(source_of(source, test=test, parameters=parameters, residuals=residuals, **tables), progress)
    check_parameters(study)
    arrays: dict[str, NDArray[Any]] = {}
    with looking_up(study, fresh) as found:
        record = select_at(found.study, start(found.study, progress), arrays, progress)
    return SelectResult(record, arrays, tuple(found.remarks))


@checked
def quantify(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    fresh: bool = False,
    progress: Progress = silent,
    **tables: Any,
) -> QuantifyResult:
    """Mean and covariance of the free parameters from repeated tests, starting from the initial values.

    `run` starts from the updated values.

    Parameters
    ----------
    source, test, fresh, progress, tables : as for `correlate`
    parameters, residuals : as for `Study`

    Raises
    ------
    FemtuneError : ``quantify.no-repeats`` without [quantify], and others of ``quantify.*``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> import numpy as np
    >>> hz = test.modes.freq_hz * (1.0 + 0.01 * np.random.default_rng(1).standard_normal((12, 1)))
    >>> np.savetxt("repeats.csv", hz, delimiter=",", header="1,2,3,4", comments="")
    >>> found = ft.quantify(model, test, parameters=free, quantify={"repeats": "repeats.csv"})
    >>> found.frequencies.column("repeats")
    array([12., 12., 12., 12.])
    """
    from femtune.study.quantify import quantify_at, repeats_of  # noqa: PLC0415
    from femtune.study.select import check_parameters  # noqa: PLC0415

    study = read_study(source_of(source, test=test, parameters=parameters, residuals=residuals, **tables), progress)
    check_parameters(study)
    repeats = repeats_of(study)
    if repeats is None:
        raise FemtuneError("quantify.no-repeats", where=study.file.where("study"))
    arrays: dict[str, NDArray[Any]] = {}
    with looking_up(study, fresh) as found:
        case = next(c for c in found.study.cases if c.name == repeats.case.name)
        record = quantify_at(found.study, replace(repeats, case=case), nominal(study), arrays, progress)
    return QuantifyResult(record, arrays, tuple(found.remarks))
