"""A study put together: deck, parameters, configurations and tests as one frozen whole."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from femtune.errors import ErrorCollector, FemtuneError, Notice, Where
from femtune.files.nastran.build import BuiltModel, build_structure
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.inventory import MISSING
from femtune.files.nastran.located import located
from femtune.files.study_file import ModesTable, StudyFile, read_study_file, with_modes
from femtune.files.study_file.source import Source
from femtune.model import ParametricModel, parametric_model
from femtune.parameters import ParameterSet
from femtune.residuals import ModelSolver, ResidualRules, UpdateProblem, direct
from femtune.study.assignments import assignments, parameter_set, targets
from femtune.study.cases import StudyCase, on_model, study_case
from femtune.study.derived import check_derived
from femtune.study.imported_model import build_imported, compare_listed, mesh_of_grid
from femtune.study.mode_ratios import with_parameters_of_modes
from femtune.study.named_fields import with_named_fields
from femtune.study.progress import Progress, silent
from femtune.study.residual_builders import with_residuals
from femtune.study.solvers import check_solvers

_DECK_SUFFIXES = (".bdf", ".dat", ".nas", ".fem", ".bulk", ".pch", ".inc", ".blk")


@dataclass(frozen=True, eq=False)
class Study:
    """Everything that the steps need; `notices` are those of tests and sensors, `solver` solves the full model.

    `units_known` is False for a deck alone, which tells none.
    """

    file: StudyFile
    built: BuiltModel
    model: ParametricModel
    cases: tuple[StudyCase, ...]
    notices: tuple[Notice, ...]
    solver: ModelSolver = field(default=direct, repr=False)
    units_known: bool = True

    @property
    def parameters(self) -> ParameterSet:
        """The parameters of the study."""
        return self.model.parameters

    @property
    def rules(self) -> ResidualRules:
        """How paired modes are compared, as [residuals] says.

        Where the study has [[residual]] tables, frequencies are compared by [residuals] only if it says how well.
        """
        table = self.file.residuals
        by_rule = not self.file.residual or "frequency_sd" in table.model_fields_set
        return ResidualRules(
            table.frequency_sd if by_rule else 0.0,  # type: ignore[arg-type]
            table.shape_sd,
            table.frequency_form,
            table.shape_form,
            table.shape_scaling,
            table.scatter,
        )

    def problem(self) -> UpdateProblem:
        """The update problem of all configurations that are not kept for validation.

        Raises
        ------
        FemtuneError : ``study.no-test``
        """
        cases = tuple(used for used in (c.used for c in self.cases) if used is not None)
        if not cases:
            raise self.no_test("the update may use, or a [[residual]]")
        return UpdateProblem(cases, self.parameters, self.rules)

    def no_test(self, purpose: str) -> FemtuneError:
        """The error that no configuration has modes for a purpose, with what each of them has instead."""
        return FemtuneError(
            "study.no-test",
            f"no configuration has a test with modes that {purpose}",
            where=Where(str(self.file.path)),
            values={c.name: _what_is_there(c) for c in self.cases},
            hint='give a configuration test = "file.uff" with modes (data sets 55)',
        )


def _what_is_there(case: StudyCase) -> str:
    if case.test is None:
        return "it has no test"
    if case.modal is None:
        return f"{case.entry.test} has no modes" + (", only frequency responses" if case.test.frfs else "")
    return "it is kept for validation"


def is_deck(path: Path | str) -> bool:
    """True for a path that names a deck rather than a study."""
    return Path(path).suffix.lower() in _DECK_SUFFIXES


def read_study(path: Path | str, progress: Progress = silent) -> Study:
    """As `load_study`, for steps that need a test.

    Raises
    ------
    FemtuneError : ``study.deck-alone`` for a deck, and as `load_study`
    """
    if is_deck(path):
        raise FemtuneError(
            "study.deck-alone",
            "this step needs a study, and this is a deck",
            where=Where(str(path)),
            hint="write a study (TOML) of the deck and its test; info, modes and respond also take a deck alone",
        )
    return load_study(path, progress)


def load_study(path: Path | str, progress: Progress = silent) -> Study:
    """Read a study with its deck and tests, or a deck alone.

    Raises
    ------
    FemtuneError : whatever is wrong with any of the files; set-up errors are shown together
    """
    check_solvers()
    path = Path(path)
    file = _study_of_deck(path) if is_deck(path) else read_study_file(path)
    built = with_parameters_of_modes(file, _built(file, progress))
    with located(built):
        study = _assembled(_with_modes_of_deck(file, built), built, progress)
    if file.imported:
        mesh = mesh_of_grid(file, built.structure.nodes)
        study = replace(study, cases=tuple(replace(case, mesh=mesh) for case in study.cases))
    return replace(study, units_known=not is_deck(path))


def _built(file: StudyFile, progress: Progress) -> BuiltModel:
    """The model of the deck, or of matrices, whose modes are compared with those that were listed."""
    if file.imported:
        progress.step("reading the matrices", 0, None)
        built = build_imported(file)
        progress.step("comparing their modes with the listed ones", 0, None)
        return replace(built, notices=(*built.notices, compare_listed(file, built.structure)))
    progress.step("reading the deck", 0, None)
    built = build_structure(read_deck(file.deck_path), bool(file.study.allow_ignored))
    _check_allowed(file, built)
    _check_not_empty(built)
    return with_named_fields(file, built)


def _with_modes_of_deck(file: StudyFile, built: BuiltModel) -> StudyFile:
    """Where the study does not say how many modes, the deck's own METHOD does."""
    asked, method = file.modes, built.eigen_method
    if asked.count is not None or asked.max_hz is not None or method is None:
        return file
    if method.wanted:
        return file.model_copy(update={"modes": ModesTable(count=method.wanted)})
    if method.upper_hz and method.upper_hz > 0.0:
        return file.model_copy(update={"modes": ModesTable(max_hz=method.upper_hz)})
    return file


def _study_of_deck(path: Path) -> StudyFile:
    # the units do not matter where no test is read
    file = StudyFile.model_validate({"study": {"title": path.name, "deck": path.name, "units": "m-kg-s"}})
    file._path, file._source = path, Source(str(path))
    return file


def _check_allowed(file: StudyFile, built: BuiltModel) -> None:
    """Cards that the model lacks must be among those that the study allows to be ignored."""
    allowed = {name.upper() for name in file.study.allow_ignored}
    missing = [c for c in built.cards if c.use == MISSING and c.name not in allowed]
    if missing:
        names = ", ".join(f"{c.name} ({c.count})" for c in missing)
        raise FemtuneError(
            "deck.unsupported-element",
            f"the deck has elements that are not understood and that the study does not allow to be ignored: {names}",
            where=missing[0].where,
            hint="add them to allow_ignored in [study] if the modes do not depend on them",
        )


def _check_not_empty(built: BuiltModel) -> None:
    """A deck without points would make every parameter and sensor look wrong."""
    if not built.structure.nodes.n_dofs:
        raise FemtuneError(
            "deck.no-points",
            "the deck has neither grid points nor scalar points",
            where=Where(str(built.deck.files[0].file)),
            values={"cards": len(built.deck.cards)},
            hint="name the file that holds the bulk data, or check that it is complete",
        )


def _assembled(file: StudyFile, built: BuiltModel, progress: Progress) -> Study:
    """Parameters, configurations and tests on a deck that was built."""
    errors = ErrorCollector()
    model = None
    with errors.catch():
        found = targets(file, built)
        model = parametric_model(built.structure, parameter_set(found, built), assignments(found))
        check_derived(file, model.parameters)
    notices: list[Notice] = []
    cases: list[StudyCase] = []
    base = model or parametric_model(built.structure, ParameterSet(()), ())
    for i, entry in enumerate(file.configurations):
        progress.step(f"configuration {entry.name}", i, len(file.configurations))
        with errors.catch():
            case, remarks = study_case(file, base, entry)
            cases.append(with_residuals(file, case, built.modal_damping))
            notices += remarks
    ErrorCollector(list({str(e): e for e in errors.errors}.values())).raise_if_any()
    assert model is not None
    return Study(file, built, model, tuple(cases), tuple(dict.fromkeys(notices)))


def with_modes_asked(study: Study, count: int | None, max_hz: float | None) -> Study:
    """The study with another number of modes, or another upper frequency, in all its configurations.

    Raises
    ------
    FemtuneError : as `with_modes`
    """
    file = with_modes(study.file, count, max_hz)
    count, max_hz = file.modes.wanted, file.modes.max_hz
    cases = []
    for case in study.cases:
        compared = None if case.compared is None else replace(case.compared, count=count, max_hz=max_hz)
        cases.append(replace(case, compared=compared))
    return replace(study, file=file, cases=tuple(cases))


def solved_by(study: Study, solver: ModelSolver) -> Study:
    """The same study with another solver of the full model, in all its configurations."""
    pairs = ((c, c.compared) for c in study.cases)
    cases = (c if some is None else replace(c, compared=replace(some, solver=solver)) for c, some in pairs)
    return replace(study, solver=solver, cases=tuple(cases))


def on_deck(study: Study, built: BuiltModel) -> Study:
    """The same study on another deck of the same grid points (the updated one), without parameters."""
    with located(built):
        model = parametric_model(built.structure, ParameterSet(()), ())
        cases = tuple(on_model(c, model) for c in study.cases)
    return replace(study, built=built, model=model, cases=cases)
