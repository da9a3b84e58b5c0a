"""Steps that compare and write no run folder: correlate, compare, select, quantify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.assembly.described import Model, StudySource, Test, source_of, units_word
from femtune.assembly.progress import silent
from femtune.assembly.study import load_study, read_study
from femtune.errors import FemtuneError, Notice, Where
from femtune.files.study_file import with_expansion
from femtune.results.solved import nominal
from femtune.results.step_results import CorrelateResult, QuantifyResult, SelectResult
from femtune.results.versions import model_records, start
from femtune.study.expanded_files import check_expansion_asked, write_expanded_files
from femtune.study.respond import check_places, uff_paths
from femtune.study.solutions import looking_up

if TYPE_CHECKING:
    from femtune.assembly.progress import Progress
    from femtune.files.study_file.parameter import Parameter
    from femtune.units import UnitSystem


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
    remarks = [Notice(a.code, a.sentence, level=a.level) for r in records for a in r.alerts if a.level != "info"]
    return CorrelateResult(records, arrays=arrays, remarks=(*found.remarks, *remarks), files=tuple(written))


@checked
def compare(
    first: Path | str | Model,
    second: Path | str | Model,
    *,
    count: int | None = None,
    units: str | UnitSystem | None = None,
    tolerance: float | None = None,
    points: int = 300,
    progress: Progress = silent,
) -> CorrelateResult:
    """Modes of two models of one structure: MAC, pairs, differences of the frequencies of the second from the first.

    The meshes may differ. The shapes are compared at grid points that are each other's nearest. In the result, the
    first model takes the place of the test.

    Parameters
    ----------
    first, second : models, or the paths of decks
    count : number of modes of the first model, and a few less than of the second one, rigid-body modes included
    units : length-mass-s of decks, which do not state them
    tolerance : largest distance of two points that are compared, in the unit of length of the decks; None: a hundredth
        of the diagonal of the first model
    points : number of points at most, which are spread over the structure
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``correlate.no-common-points``, ``response.units-needed``, ``eigen.*``, and errors in the files

    Source: Allemang and Brown (1982).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> found = ft.compare(example_deck(), example_deck(), count=4, units="m-kg-s")
    >>> found.mac.diagonal().round(6)
    array([1., 1., 1., 1.])
    >>> found.arrays["common_points"][0]
    array([2., 2., 0.])
    """
    from femtune.study.two_meshes import MORE_MODES, mapped_meshes, modes_on_other_mesh  # noqa: PLC0415

    sides = [source_of(source) for source in (first, second)]
    one, other = (load_study(side, progress) for side in sides)
    found = mapped_meshes(one, other, tolerance, points)
    word = units_word(units) or None
    if word is None and not one.units_known:
        raise FemtuneError("response.units-needed/compared", where=Where(str(one.file.path)))
    test = modes_on_other_mesh(sides[0], other, found, word, progress, count=count)
    more = None if count is None else {"count": count + MORE_MODES}
    result = correlate(second, test, sensors={"by_id": True}, modes=more, units=units, progress=progress)
    table = np.column_stack([found.first, found.second, found.distance])
    distances = f"{found.distance.mean():.3g}, the largest {found.distance.max():.3g}."
    told = f"{len(found.distance)} points are compared; the mean distance between the meshes is {distances}"
    arrays = {**result.arrays, "common_points": table}
    return replace(result, arrays=arrays, remarks=(Notice("", told, level="info"), *result.remarks))


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

    Source: Friswell and Mottershead (1995).

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
    jobs: int | None = None,
    progress: Progress = silent,
    **tables: Any,
) -> QuantifyResult:
    """Mean and covariance of the free parameters from repeated tests, starting from the initial values.

    `run` starts from the updated values.

    Parameters
    ----------
    source, test, fresh, progress, tables : as for `correlate`
    parameters, residuals : as for `Study`
    jobs : the most samples of the forward check at a time, in place of [parallel]

    Raises
    ------
    FemtuneError : ``quantify.no-repeats`` without [quantify], and others of ``quantify.*``

    Source: Govers and Link (2010); Silva and others (2016).

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
    from femtune.study.executor import with_jobs  # noqa: PLC0415
    from femtune.study.quantify import quantify_at, repeats_of  # noqa: PLC0415
    from femtune.study.select import check_parameters  # noqa: PLC0415

    given = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    study = read_study(with_jobs(given, jobs), progress)
    check_parameters(study)
    repeats = repeats_of(study)
    if repeats is None:
        raise FemtuneError("quantify.no-repeats", where=study.file.where("study"))
    arrays: dict[str, NDArray[Any]] = {}
    with looking_up(study, fresh) as found:
        case = next(c for c in found.study.cases if c.name == repeats.case.name)
        record = quantify_at(found.study, replace(repeats, case=case), nominal(study), arrays, progress)
    return QuantifyResult(record, arrays, tuple(found.remarks))
