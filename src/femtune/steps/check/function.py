"""The function `check`: all mistakes of a study, before anything is solved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from femtune.arguments import checked
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.steps.check.run import CheckResult
    from femtune.study.progress import Progress


@checked
def check(source: Path | str, *, progress: Progress = silent) -> CheckResult:
    """All mistakes of a study, of its deck and of its tests at once; nothing is solved.

    Tables with mistakes are set aside, so that those in the others are found too.

    Parameters
    ----------
    source : a study file, or a deck; a `Study` of objects was checked when it was made
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
    from femtune.steps.check.run import check_study  # noqa: PLC0415

    return check_study(Path(source), progress)
