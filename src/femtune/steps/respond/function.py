"""The function `respond`: frequency responses, complex modes and static displacements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.steps.report.function import checked_page, with_page
from femtune.study.described import source_of
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.steps.respond.result import RespondResult
    from femtune.study.described import Model, Study
    from femtune.study.progress import Progress


@checked
def respond(
    source: Path | str | Study | Model,
    *,
    uff: Path | str | None = None,
    units: str | None = None,
    scatter: float = 0.0,
    floor: float = 0.0,
    seed: int = 1,
    report: Path | str | None = None,
    fresh: bool = False,
    progress: Progress = silent,
    **options: Any,
) -> RespondResult:
    """Frequency responses, complex modes and static displacements of a study, or of a deck alone.

    Parameters
    ----------
    source : as for `info`
    uff : Universal File to write the functions to; with several configurations each has its own, numbered
    units : length-mass-s of a deck, required for a Universal File
    scatter, floor : noise of the functions in the file: standard deviations of real and imaginary part relative to the
        magnitude of each value and to the largest one of each function, as ``sd`` and ``floor`` of FRF residuals
    seed : of the noise
    report : HTML page to write, with pictures of the functions
    fresh : ignore the journal of an earlier run of the study and solve everything again
    progress : receives progress reports
    options : keys of [response] that replace those of the study: ``inputs=["12Z+"]``,
        ``outputs``, ``from_hz``, ``to_hz``, ``step_hz``, ``kind``, ``method``, ``ratio`` …

    Raises
    ------
    FemtuneError : ``response.*``, ``uff.cannot-write``, and as `modes`

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> found = ft.respond(example_deck(), inputs=["5Z+"], from_hz=1.0, to_hz=100.0, step_hz=0.5, ratio=0.01)
    >>> found
    RespondResult: baseline: 1 × 1 accelerance, 1 to 100 Hz, 199 lines, real modes
    >>> found.frfs.values.shape
    (1, 1, 199)
    """
    from femtune.steps.respond.run import FrfNoise, solve_responses  # noqa: PLC0415

    page = checked_page(report)
    file = None if uff is None else Path(uff)
    result = solve_responses(
        source_of(source), options, progress, fresh=fresh, uff=file, units=units, page=page,
        noise=FrfNoise(scatter, floor, seed),
    )  # fmt: skip
    return with_page(result, page, progress)
