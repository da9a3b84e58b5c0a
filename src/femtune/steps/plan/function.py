"""The function `plan`: sensors, exciters and frequency lines for a test."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.steps.report.function import checked_page, with_page
from femtune.study.described import source_of
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.steps.plan.result import PlanResult
    from femtune.study.described import Model, Study
    from femtune.study.progress import Progress


@checked
def plan(
    source: Path | str | Study | Model,
    *,
    uff: Path | str | None = None,
    csv: Path | str | None = None,
    lines: Path | str | None = None,
    units: str | None = None,
    report: Path | str | None = None,
    fresh: bool = False,
    progress: Progress = silent,
    **options: Any,
) -> PlanResult:
    """Plan a test: sensors for target modes of a study, or of a deck alone; no test is needed.

    Parameters
    ----------
    source : as for `info`
    uff : Universal File to write, with the measured points, their axes and trace lines for the test system
    csv : table of the sensors to write
    lines : text file to write, with the frequencies in Hz of the best lines for an identification, one a row; with
        ``identification_lines`` of [plan]
    units : length-mass-s of a deck, required for a Universal File
    report : HTML page to write, with a picture of the sensors
    fresh : ignore the journal of an earlier run of the study and solve everything again
    progress : receives progress reports
    options : keys of [plan] that replace those of the study: ``triaxial=10``, ``uniaxial=15``,
        ``band_hz=(5.0, 400.0)``, ``nodes="101 THRU 300"``, ``method="elimination"`` …

    Raises
    ------
    FemtuneError : ``plan.*``, and as `modes`

    Source: Kammer (1991).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> found = ft.plan(example_deck(), modes=[1, 2, 3, 4], uniaxial=5, csv="sensors.csv")
    >>> found
    PlanResult: baseline: 5 uniaxial sensors for 4 target modes
      largest AutoMAC 0.025, condition number 1.37
      info: candidates that do not move in any target mode are left out: 1
    >>> len(found.sensors), found.auto_mac.shape, found.files[0].name
    (5, (4, 4), 'sensors.csv')
    """
    from femtune.steps.plan.files import PlanFiles  # noqa: PLC0415
    from femtune.steps.plan.run import plan_test  # noqa: PLC0415

    page = checked_page(report)
    files = PlanFiles(*(None if path is None else Path(path) for path in (uff, csv, lines)))
    result = plan_test(source_of(source), options, progress, fresh=fresh, files=files, units=units, page=page)
    return with_page(result, page, progress)
