"""The function `screen`: effects of the parameters by designed runs of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.steps.report.function import checked_page, with_page
from femtune.study.described import StudySource, source_of
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.steps.screen.result import ScreenResult
    from femtune.study.progress import Progress


@checked
def screen(
    source: StudySource,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    csv: Path | str | None = None,
    report: Path | str | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **options: Any,
) -> ScreenResult:
    """Which parameters matter for which mode: main effects, elementary effects or Sobol's indices of designed runs.

    Parameters
    ----------
    source : a study (an object, or the path of its TOML file); or a model, with `parameters`
    parameters : as for `Study`
    csv : table of runs to write: values of the free parameters, and frequencies in Hz
    report : HTML page to write, with tables and a picture
    fresh : ignore the journal of an earlier run of the study and solve everything again
    jobs : maximum number of parallel runs; overrides [parallel]
    progress : receives progress reports
    options : keys of [screen] that replace those of the study: ``design``, ``array``, ``levels``, ``trajectories``,
        ``points``, ``on``, ``runs``, ``sample``, ``responses``, ``seed``, ``configuration``

    Raises
    ------
    FemtuneError : ``screen.*``, ``design.*``, ``study.no-parameters``, ``eigen.*``, and errors in the files

    Source: Morris (1991); Sobol' (2001); Saltelli and others (2010).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1", "mass": "CONM2 9 M"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.8, upper=1.2) for name, field in fields.items()]
    >>> found = ft.screen(ft.read_deck(example_deck(), units="m-kg-s"), parameters=free)
    >>> found
    ScreenResult: L9, 9 runs
      More than 10 % of the variation of at least one frequency: mass, root, tip.
      Main effects explain at least 99.8 % of the variation of each frequency.
    >>> first = found.effects[0]
    >>> first.parameter, first.mode, round(first.contribution, 2)
    ('root', 1, 0.75)
    """
    from femtune.steps.screen.run import screen_parameters  # noqa: PLC0415

    page = checked_page(report)
    table = None if csv is None else Path(csv)
    given = source_of(source, parameters=parameters)
    result = screen_parameters(given, options, progress, fresh=fresh, jobs=jobs, table=table)
    return with_page(result, page, progress)
