"""The function `init`: a first study from a deck and a test."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.arguments import checked
from femtune.study.described import units_word
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.steps.init.run import InitResult
    from femtune.study.progress import Progress
    from femtune.units import UnitSystem


@checked
def init(
    deck: Path | str,
    test: Path | str,
    folder: Path | str = ".",
    *,
    units: str | UnitSystem | None = None,
    origin: Sequence[float] | None = None,
    tolerance: float | None = None,
    by_id: bool = False,
    choices: Path | str | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> InitResult:
    """Write a first study, ``study.toml``, from a deck and a test; its comments give the reasons for each value.

    Units are guessed from materials, coordinates and mass; sensors are assigned by coordinates, after a change of axes,
    origin or unit where the coordinates need it, and by number only without coordinates; parameters are proposed by
    what the test modes could determine. If the test has functions or records instead of modes, the modes are identified
    first, and ``identify.toml`` is written too.

    Parameters
    ----------
    deck : Nastran deck
    test : Universal File or table with modes, FRFs, or a record
    folder : for the files; it is made where it is not there
    units : length-mass-s of the deck; guessed where nothing is said
    origin : position of the origin of the test in the model, in the unit of the deck; found where nothing is said
    tolerance : largest distance of a test point from its grid point, in the unit of the deck
    by_id : test points have the numbers of their grid points, whatever their coordinates are
    choices : file of choices that were made on the page of a report of the same deck and test: pairs, modes that are
        left out, sensors, and the parameters instead of those proposed
    force : replace files that are there
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``init.exists``, ``init.no-modes``, ``init.option``, ``run.unwritable``, ``study.choices``, and
        errors in deck and test

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> made = ft.init(example_deck(), example_test())
    >>> made
    InitResult: study.toml: units m-kg-s, 4 test modes, 4 paired, 4 parameters
    >>> ft.correlate(made.path).pairs.column("mac").round(2)
    array([1., 1., 1., 1.])
    """
    # imported here, because `check` does not need the numerical packages
    from femtune.steps.init.run import asked_sensors, init_study  # noqa: PLC0415

    asked = asked_sensors(origin, tolerance, by_id)
    return init_study(Path(deck), Path(test), Path(folder), units_word(units) or None, asked, force, progress,
                      None if choices is None else Path(choices))  # fmt: skip
