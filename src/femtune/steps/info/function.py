"""The function `info`: facts and checks of the model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from femtune.arguments import checked
from femtune.steps.held_folder import held_for_solver
from femtune.steps.info.checks import checks_of_modes
from femtune.steps.info.facts import alert_of, model_facts
from femtune.steps.info.result import InfoResult
from femtune.study.described import source_of
from femtune.study.progress import silent
from femtune.study.study import load_study

if TYPE_CHECKING:
    from femtune.study.described import Model, Study
    from femtune.study.progress import Progress


@checked
def info(source: Path | str | Study | Model, *, progress: Progress = silent) -> InfoResult:
    """Summary of the deck of a study, or of a deck: cards, mass, rigid-body check, supports, shapes, warnings.

    The modes of a small model are solved for the errors due to the mesh.

    Parameters
    ----------
    source : a study, or a model: an object, or the path of a TOML file or of a deck
    progress : receives progress reports

    Raises
    ------
    FemtuneError : errors in the files

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> ft.info(example_deck())
    InfoResult: 15 cards used, 0 not used
      baseline: 5 points, 24 free DOFs, mass 9.85, rigid-body check: pass
    """
    given = source_of(source)
    with held_for_solver(given, "info"):
        study = load_study(given, progress)
    progress.step("mass and rigid-body check", 0, None)
    facts = model_facts(study)
    progress.step("errors due to the mesh", 0, None)
    checks, told = checks_of_modes(study)
    checks = [*facts.checks, *checks]
    notices = (*map(alert_of, study.notices), *facts.notices, *told)
    return InfoResult(facts.model_copy(update={"checks": tuple(checks), "notices": notices}))
