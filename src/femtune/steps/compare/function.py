"""The function `compare`: modes of two models of one structure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.arguments import checked
from femtune.errors import FemtuneError, Notice, Where
from femtune.steps.correlate.result import CorrelateResult
from femtune.steps.held_folder import held_for_solver
from femtune.study.described import Model, source_of, units_word
from femtune.study.progress import silent
from femtune.study.study import load_study

if TYPE_CHECKING:
    from femtune.study.progress import Progress
    from femtune.units import UnitSystem
from femtune.steps.correlate.function import correlate


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
    from femtune.steps.compare.run import MORE_MODES, mapped_meshes, modes_on_other_mesh  # noqa: PLC0415

    sides = [source_of(source) for source in (first, second)]
    loaded = []
    for side in sides:
        with held_for_solver(side, "compare"):
            loaded.append(load_study(side, progress))
    one, other = loaded
    mapping = mapped_meshes(one, other, tolerance, points)
    word = units_word(units) or None
    if word is None and not one.units_known:
        raise FemtuneError("response.units-needed/compared", where=Where(str(one.file.path)))
    test = modes_on_other_mesh(sides[0], other, mapping, word, progress, count=count)
    more = None if count is None else {"count": count + MORE_MODES}
    result = correlate(second, test, sensors={"by_id": True}, modes=more, units=units, progress=progress)
    table = np.column_stack([mapping.first, mapping.second, mapping.distance])
    distances = f"{mapping.distance.mean():.3g}, the largest {mapping.distance.max():.3g}."
    told = f"{len(mapping.distance)} points are compared; the mean distance between the meshes is {distances}"
    arrays = {**result.arrays, "common_points": table}
    return replace(result, arrays=arrays, remarks=(Notice("", told, level="info"), *result.remarks))
