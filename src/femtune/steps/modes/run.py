"""The step modes: natural modes of a study or deck, and their page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import NDArray

from femtune.journal.run_files import numbered
from femtune.modal import ModeSet
from femtune.model import EigenSolution
from femtune.steps.held_folder import held_for_solver
from femtune.steps.info.checks import mesh_check
from femtune.steps.info.facts import model_facts, model_modes, shapes_remark
from femtune.steps.modes.result import ModesResult
from femtune.steps.respond.run import check_places
from femtune.study.cases import StudyCase
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.solutions import looking_up
from femtune.study.solved import nominal, solved_cases
from femtune.study.study import load_study, with_modes_asked

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.steps.info.record.model import ModelModes
    from femtune.steps.modes.record import ModeShapes
    from femtune.steps.modes.simulated_test import SimulatedTest
    from femtune.steps.results import Results
    from femtune.study.progress import Progress
    from femtune.study.provenance import Inputs
    from femtune.study.study import Study
    from femtune.testdata import ModalTest

Arrays = dict[str, NDArray]


def solve_modes(
    source: Path | str | StudyFile,
    progress: Progress = silent,
    *,
    fresh: bool = False,
    count: int | None = None,
    max_hz: float | None = None,
    simulate: SimulatedTest | None = None,
    vtu: Path | None = None,
    page: Path | None = None,
) -> ModesResult:
    """Modes of a study, or of a deck, at the initial values of the parameters.

    Parameters
    ----------
    fresh : do not take solutions from the journal of the study's run folder
    count, max_hz : in place of [modes] of the study and of METHOD of the deck
    simulate : writes the modes as a test would have measured them
    vtu : VTU file of the mesh, the modes and the values of the parameters
    page : where the report will be written; neither a file that is read nor one of the others

    Raises
    ------
    FemtuneError : ``eigen.*``, and as `check_simulated` and `check_vtu`
    """
    if simulate is not None:
        from femtune.steps.modes.simulated_test import check_simulated, write_simulated  # noqa: PLC0415
    if vtu is not None:
        from femtune.steps.modes.vtu_files import check_vtu, write_vtu_files  # noqa: PLC0415

    watch = Stopwatch(call("modes", source))
    with watch.step("read"):
        with held_for_solver(source, "modes"):
            loaded = with_modes_asked(load_study(source, progress), count, max_hz)
        if simulate is not None:
            check_simulated(loaded, simulate)
        asked = [path for path in (vtu, None if simulate is None else simulate.path) if path is not None]
        several = [file for path in asked for file in numbered(path, len(loaded.cases))]
        check_places(loaded, [*([] if page is None else [page]), *several], None if simulate is None else simulate.path)
        if vtu is not None:
            check_vtu(loaded, vtu)
        inputs = _each_once(inputs_of(loaded))
    with watch.step("modes"), looking_up(loaded, fresh) as looked_up:
        solved = list(solved_cases(looked_up.study, progress))
        records = tuple(model_modes(case.name, "before", solution) for case, solution in solved)
    with watch.step("mesh"):
        progress.step("errors due to the mesh", 0, None)
        meshes = [mesh_check(looked_up.study, case, solution) for case, solution in solved]
        records = tuple(r.model_copy(update={"mesh": mesh}) for r, mesh in zip(records, meshes))
    if simulate is not None:
        write_simulated(loaded, simulate, solved)
    if vtu is not None:
        write_vtu_files(loaded, nominal(loaded), {case.name: solution for case, solution in solved}, vtu)
    for _, solution in solved:
        # whoever keeps the result need not keep gigabytes of factors
        solution.forget_factors()

    def whole() -> tuple[Results, Arrays]:
        return _whole(loaded, solved, records, inputs, watch, progress)

    remarks = (*looked_up.remarks, *shapes_remark(loaded.built))
    return ModesResult(records, remarks=remarks, shapes=lambda: _mode_sets(loaded, solved), whole=whole)


Solved = Sequence[tuple[StudyCase, EigenSolution]]


def simulate_tests(
    source: Path | str | StudyFile,
    wanted: SimulatedTest,
    progress: Progress = silent,
    *,
    count: int | None = None,
    max_hz: float | None = None,
    fresh: bool = False,
) -> list[ModalTest]:
    """The tests that the modes of a study or deck would give, one a configuration; parameters as of `solve_modes`."""
    from femtune.steps.modes.simulated_test import check_simulated, simulated  # noqa: PLC0415

    with held_for_solver(source, "modes"):
        loaded = with_modes_asked(load_study(source, progress), count, max_hz)
    check_simulated(loaded, wanted)
    with looking_up(loaded, fresh) as found:
        return simulated(loaded, wanted, list(solved_cases(found.study, progress)))


def _mode_sets(study: Study, solved: Solved) -> dict[str, ModeSet]:
    """By configuration, with shapes at all DOFs of the model."""
    dofs = study.model.structure.nodes.dof_set()
    return {
        case.name: ModeSet(
            solution.freq_hz,
            case.configured.transformation @ solution.shapes[:, : solution.wanted],
            dofs,
            normalisation="mass",
            source=f"model, {case.name}",
        )
        for case, solution in solved
    }


def _whole(
    study: Study, solved: Solved, records: tuple[ModelModes, ...], inputs: Inputs, watch: Stopwatch, progress: Progress
) -> tuple[Results, Arrays]:
    """All that a page of the modes shows."""
    from femtune.steps.results import Results  # noqa: PLC0415  records of all steps, which only a page wants

    arrays: Arrays = {}
    shapes = tuple(_drawn(i, case, solution, arrays) for i, (case, solution) in enumerate(solved))
    progress.step("mass and rigid-body check", 0, None)
    with watch.step("checks"):
        model = model_facts(study)
    facts = study_facts(study)
    if not study.units_known:
        facts = facts.model_copy(update={"units": ""})
    results = Results(
        provenance=provenance(inputs, watch, (modes.solver for modes in records)),
        study=facts,
        model=model,
        modes=records,
        mode_shapes=shapes,
        alerts=tuple(a for record in records for a in record.alerts),
    )
    return results, arrays


def _drawn(i: int, case: StudyCase, solution: EigenSolution, arrays: Arrays) -> ModeShapes:
    """The shapes for pictures; what was measured is no matter here."""
    from femtune.steps.correlate.facts import array_prefix  # noqa: PLC0415
    from femtune.steps.modes.shapes import MOST_MODES, mode_shapes  # noqa: PLC0415

    first = replace(solution, wanted=min(solution.wanted, MOST_MODES))
    alone = replace(case, test=None, sensors=None, compared=None)
    return mode_shapes(alone, "before", first, array_prefix("before", case.name, i + 1), arrays)


def _each_once(inputs: Inputs) -> Inputs:
    """A deck without a study file."""
    return replace(inputs, files=tuple(file for file in inputs.files if file != inputs.study_file))
