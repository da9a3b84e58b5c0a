"""The function `modes`: natural modes of each configuration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from femtune.arguments import checked
from femtune.steps.report.function import checked_page, with_page
from femtune.study.described import source_in_units
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.steps.modes.result import ModesResult
    from femtune.steps.modes.simulated_test import SimulatedTest
    from femtune.study.described import Model, Study
    from femtune.study.progress import Progress
    from femtune.units import UnitSystem


@checked
def modes(
    source: Path | str | Study | Model,
    *,
    count: int | None = None,
    max_hz: float | None = None,
    report: Path | str | None = None,
    units: str | UnitSystem | None = None,
    simulate: SimulatedTest | None = None,
    vtu: Path | str | None = None,
    fresh: bool = False,
    progress: Progress = silent,
) -> ModesResult:
    """Natural modes of each configuration of a study, or of a deck, at the initial values of the parameters.

    Parameters
    ----------
    source : as for `info`
    count, max_hz : number of modes, or highest frequency in Hz, instead of [modes] of the study and METHOD of the deck
    report : HTML page to write, with a picture of each mode: a single self-contained file
    units : length-mass-s of a deck, which does not state them
    simulate : a Universal File to which the modes are written as a simulated test
    vtu : VTU file to write, for ParaView: mesh, mode shapes, values of the parameters (extra ``vtu``)
    fresh : ignore the journal of an earlier run of the study and solve everything again
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``response.units-given``, ``eigen.*``, ``run.unwritable``, ``write.vtu`` and
        ``write.overwrites-input`` before anything is solved, and errors in the files

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> found = ft.modes(example_deck(), count=3)
    >>> found
    ModesResult: baseline: 3 modes: 28.268, 44.695, 201.1 Hz
    >>> found.frequencies
    configuration  mode  freq_hz  rigid_body
    baseline          1  28.2677          no
    baseline          2  44.6952          no
    baseline          3  201.105          no
    >>> found.mode_sets["baseline"].shapes.shape
    (30, 3)
    """
    # imported here, because only a solution needs the journal and the solvers
    from femtune.steps.modes.run import solve_modes  # noqa: PLC0415

    page = checked_page(report)
    file = None if vtu is None else Path(vtu)
    result = solve_modes(
        source_in_units(source, units),
        progress,
        fresh=fresh,
        count=count,
        max_hz=max_hz,
        simulate=simulate,
        vtu=file,
        page=page,
    )
    return with_page(result, page, progress)
