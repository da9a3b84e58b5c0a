"""The function `simulate`: a simulated modal test from the modes of a model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.arguments import checked
from femtune.errors import FemtuneError
from femtune.study.described import source_of, units_word
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.study.described import Model, Study
    from femtune.study.progress import Progress
    from femtune.testdata import ModalTest
    from femtune.units import UnitSystem


@checked
def simulate(
    source: Path | str | Study | Model,
    sensors: Sequence[str],
    *,
    configuration: str | None = None,
    count: int | None = None,
    max_hz: float | None = None,
    units: str | UnitSystem | None = None,
    frequency_scatter: float = 0.0,
    shape_scatter: float = 0.0,
    seed: int = 1,
    progress: Progress = silent,
) -> ModalTest:
    """Simulated modal test: modes of a model at sensors, with random errors; rigid-body modes are left out.

    Parameters
    ----------
    source : as for `info`
    sensors : ``"12Z+"``, or nodes and components: ``"101 THRU 160:123"``, along the displacement axes of the points
    configuration : name of the configuration, if the study has several
    count, max_hz : as for `modes`
    units : length-mass-s of a deck, which does not state them
    frequency_scatter : standard deviation of each frequency, relative to it
    shape_scatter : standard deviation at each sensor, relative to the largest entry of the shape
    seed : of the random errors
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``response.units-needed``, ``response.units-given``, ``dof.syntax``, ``study.support``,
        ``model.unknown-node``, ``study.unknown-configuration``, and as `modes`

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> test = ft.simulate(example_deck(), ["5Y+", "5Z+"], units="m-kg-s", count=4, frequency_scatter=0.002)
    >>> test.modes.shapes.shape
    (2, 4)
    """
    from femtune.steps.modes.run import simulate_tests  # noqa: PLC0415
    from femtune.steps.modes.simulated_test import SimulatedTest  # noqa: PLC0415

    wanted = SimulatedTest(
        None, tuple(sensors), units_word(units) or None, frequency_scatter, shape_scatter, seed
    )  # fmt: skip
    tests = simulate_tests(source_of(source), wanted, progress, count=count, max_hz=max_hz)
    names = [test.name for test in tests]
    if configuration is None and len(tests) == 1:
        return tests[0]
    if configuration not in names:
        code = "study.unknown-configuration/none-named" if configuration is None else "study.unknown-configuration/name"
        values = {"configurations": ", ".join(names)}
        raise FemtuneError(code, values=values, configuration=configuration, first=names[0])
    return tests[names.index(configuration)]
