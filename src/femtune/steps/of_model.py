"""Steps that need a model alone: info, modes, plan, respond."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.assembly.described import source_of, units_word
from femtune.assembly.progress import silent
from femtune.assembly.study import load_study
from femtune.errors import FemtuneError
from femtune.results.checks import checks_of_modes
from femtune.results.model import alert_of, model_facts
from femtune.results.step_results import InfoResult
from femtune.steps.pages import checked_page, with_page

if TYPE_CHECKING:
    from femtune.assembly.described import Model, Study
    from femtune.assembly.progress import Progress
    from femtune.results.step_results import ModesResult, PlanResult, RespondResult
    from femtune.study.simulated_test import SimulatedTest
    from femtune.testdata import ModalTest
    from femtune.units import UnitSystem


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
      as the deck: 5 points, 24 free DOFs, mass 9.85, rigid-body check: pass
    """
    study = load_study(source_of(source), progress)
    progress.step("mass and rigid-body check", 0, None)
    facts = model_facts(study)
    progress.step("errors due to the mesh", 0, None)
    checks, told = checks_of_modes(study)
    checks = [*facts.checks, *checks]
    notices = (*map(alert_of, study.notices), *facts.notices, *told)
    return InfoResult(facts.model_copy(update={"checks": tuple(checks), "notices": notices}))


@checked
def modes(
    source: Path | str | Study | Model,
    *,
    count: int | None = None,
    max_hz: float | None = None,
    report: Path | str | None = None,
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
    simulate : a Universal File to which the modes are written as a simulated test
    vtu : VTU file to write, for ParaView: mesh, mode shapes, values of the parameters (extra ``vtu``)
    fresh : ignore the journal of an earlier run of the study and solve everything again
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``eigen.*``, ``run.unwritable``, ``write.vtu`` and ``write.overwrites-input`` before anything is
        solved, and errors in the files

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> found = ft.modes(example_deck(), count=3)
    >>> found
    ModesResult: as the deck: 3 modes: 28.268, 44.695, 201.1 Hz
    >>> found.frequencies
    configuration  mode  freq_hz  rigid_body
    as the deck       1  28.2677          no
    as the deck       2  44.6952          no
    as the deck       3  201.105          no
    >>> found.mode_sets["as the deck"].shapes.shape
    (30, 3)
    """
    # the journal and the solvers are imported by those who solve
    from femtune.study.natural_modes import solve_modes  # noqa: PLC0415

    page = checked_page(report)
    file = None if vtu is None else Path(vtu)
    result = solve_modes(
        source_of(source), progress, fresh=fresh, count=count, max_hz=max_hz, simulate=simulate, vtu=file, page=page
    )
    return with_page(result, page, progress)


@checked
def plan(
    source: Path | str | Study | Model,
    *,
    uff: Path | str | None = None,
    csv: Path | str | None = None,
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
    PlanResult: as the deck: 5 uniaxial sensors for 4 target modes
      largest AutoMAC 0.025, condition number 1.37
      info: candidates that do not move in any target mode are left out: 1
    >>> len(found.sensors), found.auto_mac.shape, found.files[0].name
    (5, (4, 4), 'sensors.csv')
    """
    from femtune.study.planning.files import PlanFiles  # noqa: PLC0415
    from femtune.study.planning.run import plan_test  # noqa: PLC0415

    page = checked_page(report)
    files = PlanFiles(*(None if path is None else Path(path) for path in (uff, csv)))
    result = plan_test(source_of(source), options, progress, fresh=fresh, files=files, units=units, page=page)
    return with_page(result, page, progress)


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
    RespondResult: as the deck: 1 × 1 accelerance, 1 to 100 Hz, 199 lines, real modes
    >>> found.frfs.values.shape
    (1, 1, 199)
    """
    from femtune.study.respond import FrfNoise, solve_responses  # noqa: PLC0415

    page = checked_page(report)
    file = None if uff is None else Path(uff)
    result = solve_responses(
        source_of(source), options, progress, fresh=fresh, uff=file, units=units, page=page,
        noise=FrfNoise(scatter, floor, seed),
    )  # fmt: skip
    return with_page(result, page, progress)


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
    from femtune.study.natural_modes import simulate_tests  # noqa: PLC0415
    from femtune.study.simulated_test import SimulatedTest  # noqa: PLC0415

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
