"""The function `identify`: modes from measured records or FRFs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.files.study_file.python_table import plain
from femtune.journal.run_files import REPORT_FILE
from femtune.steps.identify.result import NothingFound
from femtune.steps.identify.run import identify as find_modes
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.steps.identify.result import IdentifyResult
    from femtune.study.progress import Progress


@checked
def identify(
    source: Path | str,
    *,
    output: Path | str | None = None,
    jobs: int | None = None,
    progress: Progress = silent,
    **options: Any,
) -> IdentifyResult:
    """Identify modes from a time record or FRFs; writes a folder with modes, poles, tables and report.html.

    Parameters
    ----------
    source : an identification file (TOML), or the measured file itself
    output : output folder, instead of that of the file
    jobs : the most set-ups, or levels of the force, that are identified at a time
    progress : receives progress reports
    options : keys of [identify] that replace those of the file: ``band_hz=(2.0, 40.0)``,
        ``methods``, ``largest_order``, ``sampling_hz``, ``units`` …

    Raises
    ------
    FemtuneError : ``record.*``, ``uff.*``, ``identify.*``, ``run.unwritable``

    Source: McKelvey, Akcay and Ljung (1996); Guillaume and others (2003).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> lines = {"from_hz": 5.0, "to_hz": 400.0, "step_hz": 0.25, "ratio": 0.01}
    >>> made = ft.respond(example_deck(), inputs=["5Z+"], outputs=["3Z+", "5Z+"], uff="f.uff", units="m-kg-s", **lines)
    >>> found = ft.identify("f.uff", output="identified", band_hz=(20.0, 100.0), largest_order=10)
    >>> found.modes.freq_hz.round(1), found.modes.damping_ratio.round(3)
    (array([44.7]), array([0.01]))
    """
    # imported here, because pictures take a second to import
    from femtune.reporting.html import write_html  # noqa: PLC0415
    from femtune.steps.identify.page import build_identification_page  # noqa: PLC0415

    given = {key: plain(value) for key, value in options.items()}
    try:
        made = find_modes(source, output, progress, options=given, jobs=jobs)
    except NothingFound as error:
        if error.result is not None:
            page = write_html(build_identification_page(error.result), error.result.folder / REPORT_FILE, progress)
            error.values["page with the poles"] = str(page)
        raise
    made = replace(made, files=(REPORT_FILE, *made.files))
    progress.step("drawing the page", 0, None)
    page = write_html(build_identification_page(made), made.folder / REPORT_FILE, progress)
    return replace(made, report=page)
