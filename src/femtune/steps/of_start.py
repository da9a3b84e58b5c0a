"""The steps around a new study: init and check."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from femtune.arguments import checked
from femtune.assembly.described import units_word
from femtune.assembly.progress import silent

if TYPE_CHECKING:
    from femtune.assembly.progress import Progress
    from femtune.study.first_study.check import CheckResult
    from femtune.study.first_study.make import InitResult
    from femtune.units import UnitSystem


@checked
def init(
    deck: Path | str,
    test: Path | str,
    folder: Path | str = ".",
    *,
    units: str | UnitSystem | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> InitResult:
    """Write a first study, ``study.toml``, from a deck and a test; its comments give the reasons for each value.

    Units are guessed from materials, coordinates and mass; sensors are assigned by coordinates, after a change of axes
    or by number; parameters are proposed by what the test modes could determine. If the test has functions or records
    instead of modes, the modes are identified first, and ``identify.toml`` is written too.

    Parameters
    ----------
    deck : Nastran deck
    test : Universal File with modes or FRFs, or a record
    folder : for the files; it is made where it is not there
    units : length-mass-s of the deck; guessed where nothing is said
    force : replace files that are there
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``init.exists``, ``init.no-modes``, ``run.unwritable``, and errors in deck and test

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> made = ft.init(example_deck(), example_test())
    >>> made
    InitResult: study.toml: units m-kg-s, 4 test modes, 4 paired, 3 parameters
    >>> ft.correlate(made.path).pairs.column("mac").round(2)
    array([1., 1., 1., 1.])
    """
    # numerical packages that a check does without
    from femtune.study.first_study.make import init_study  # noqa: PLC0415

    return init_study(Path(deck), Path(test), Path(folder), units_word(units) or None, force, progress)


@checked
def check(source: Path | str, *, progress: Progress = silent) -> CheckResult:
    """All mistakes of a study, of its deck and of its tests at once; nothing is solved.

    Tables with mistakes are set aside, so that those in the others are found too.

    Parameters
    ----------
    source : a study file, or a deck
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``study.missing-file`` where the file is not there; mistakes in it are in the result

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> made = ft.init(example_deck(), example_test())
    >>> ft.check(made.path)
    CheckResult: study.toml: no errors, no warnings
    >>> broken = made.path.read_text().replace("upper = 1.25", "upper = 0.5").replace("PBAR 1 I2", "PBAR 7 I2")
    >>> _ = made.path.write_text(broken)
    >>> [problem.code for problem in ft.check(made.path).record.problems]
    ['parameter.bounds', 'study.unknown-field']
    """
    from femtune.study.first_study.check import check_study  # noqa: PLC0415

    return check_study(Path(source), progress)
