"""A study with everything that it refers to: deck, parameters, configurations and tests."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import ErrorCollector, FemtuneError, Notice, Where, with_notices
from femtune.files.nastran.build import BuiltDeck
from femtune.files.nastran.error_places import errors_at_cards
from femtune.files.study_file import Given, StudyFile, is_deck, read_study_file, test_files, with_modes
from femtune.files.study_file.source import StudyLines
from femtune.model import frequency_table, parametric_model
from femtune.model.distributed import check_slepc
from femtune.model.full_model import direct
from femtune.model.solvers.factorise import solver_asked
from femtune.parameters import DerivedQuantity, ParameterSet, parse_expression
from femtune.study.cases import States, on_model
from femtune.study.doubtful_values import value_doubts
from femtune.study.model_source import model_source
from femtune.study.parameters import assignments, parameter_set, targets, with_parameters_of_modes
from femtune.study.progress import silent
from femtune.study.specimens import specimens_of_study

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from femtune.files.built_model import BuiltModel
    from femtune.files.study_file import ConfigurationEntry
    from femtune.files.uff import UffFile
    from femtune.model import ConfiguredModel, FrequencyTable, ParametricModel
    from femtune.model.full_model import ModelSolver
    from femtune.model.reduce import Alone, Components
    from femtune.residuals import UpdateProblem
    from femtune.study.cases import StudyCase
    from femtune.study.model_source import ModelSource
    from femtune.study.parameters import Target
    from femtune.study.progress import Progress
    from femtune.study.specimens import Specimens


@dataclass(frozen=True, eq=False)
class Study:
    """Everything that the steps need; `notices` are those of tests and sensors, `solver` solves the full model.

    With `specimens`, `model` is that of the first of them, or of the only `specimen` that the study is limited to.

    `units_known` is False for a deck alone, which does not state units.
    """

    file: StudyFile
    built: BuiltModel
    model: ParametricModel
    cases: tuple[StudyCase, ...]
    notices: tuple[Notice, ...]
    solver: ModelSolver = field(default=direct, repr=False)
    units_known: bool = True
    components: Components | None = None
    specimens: Specimens | None = None
    specimen: str | None = None

    @property
    def source(self) -> ModelSource:
        """The source of the model, which states what can be done with it."""
        return model_source(self.file)

    @property
    def writes_deck(self) -> bool:
        """True where an update writes a deck with the updated values, which is then read and solved."""
        return self.source.writes_back and self.file.write.deck

    @property
    def built_deck(self) -> BuiltDeck:
        """The model with its deck, for writing updated values back."""
        assert isinstance(self.built, BuiltDeck)
        return self.built

    @property
    def parameters(self) -> ParameterSet:
        """The parameters of the study; of all its specimens if it has any."""
        return self.model.parameters

    def in_study(self, name: str) -> str:
        """The name in the study of a parameter of the update."""
        return name if self.specimens is None else self.specimens.in_study(name)

    def expand(self, names: Iterable[str]) -> tuple[str, ...]:
        """The parameters of the update that names in the study stand for."""
        if self.specimens is None:
            return tuple(names)
        return tuple(dict.fromkeys(individual for name in names for individual in self.specimens.expand(name)))

    def of_specimen(self, name: str) -> Study:
        """The study of one specimen, with the parameters of all; those of others have no effect."""
        assert self.specimens is not None
        cases = tuple(c for c in self.cases if c.entry.specimen == name)
        return replace(self, model=self.specimens.models[name], cases=cases, specimen=name)

    def problem(self) -> UpdateProblem:
        """The update problem of all configurations that are not kept for validation.

        Raises
        ------
        FemtuneError : ``study.no-test``
        """
        from femtune.residuals import UpdateProblem  # noqa: PLC0415  a step that updates nothing does without

        cases = tuple(used for used in (c.used for c in self.cases) if used is not None)
        if not cases:
            raise self.no_test("the update may use, and none has a [[residual]]")
        stated = self.file.residuals
        return UpdateProblem(cases, self.parameters, scatter=stated.scatter, common_sd=stated.common_frequency_sd)

    def no_test(self, purpose: str) -> FemtuneError:
        """The error that no configuration has modes for a purpose; it states what each of them has instead."""
        return FemtuneError(
            "study.no-test",
            where=Where(str(self.file.path)),
            values={c.name: _what_is_there(c) for c in self.cases},
            purpose=purpose,
        )


def _what_is_there(case: StudyCase) -> str:
    if case.test is None:
        return "it has no test"
    if case.modal is None:
        names = ", ".join(test_files(case.entry))
        return f"{names} has no modes" + (", only frequency responses" if case.test.frfs else "")
    return "it is kept for validation"


def read_study(
    source: Path | str | StudyFile, progress: Progress = silent, *, fresh: bool = False, around: bool = True
) -> Study:
    """As `load_study`, for steps that need a test.

    Raises
    ------
    FemtuneError : ``study.deck-alone`` for a deck, and as `load_study`
    """
    if not isinstance(source, StudyFile) and is_deck(source):
        raise FemtuneError("study.deck-alone", where=Where(str(source)))
    return load_study(source, progress, fresh=fresh, around=around)


def load_study(
    source: Path | str | StudyFile, progress: Progress = silent, *, fresh: bool = False, around: bool = True
) -> Study:
    """Read a study with its deck and tests, or a deck alone; objects that a study was given are not read again.

    A study of an external solver is run around its initial values, or at these alone for a step that runs other points
    (`around` = False); with `fresh` what was run before is run again.

    Raises
    ------
    FemtuneError : whatever is wrong with any of the files; set-up errors are shown together
    """
    check_solvers()
    if isinstance(source, StudyFile):
        file = source
    else:
        file = _study_of_deck(Path(source)) if is_deck(source) else read_study_file(source)
    file = model_source(file).prepared()
    made_of = model_source(file)
    built = with_parameters_of_modes(file, made_of.built(progress, fresh, around))
    file = made_of.completed(built)
    doubts = made_of.doubts(built)
    with errors_at_cards(built), with_notices(doubts):
        study = _assembled(file, built, progress)
    mesh = made_of.mesh(built.structure.nodes)
    cases = study.cases if mesh is None else tuple(replace(case, mesh=mesh) for case in study.cases)
    return replace(study, cases=cases, notices=(*doubts, *study.notices), units_known=file.given.units_known)


def _study_of_deck(path: Path) -> StudyFile:
    if any(0xD800 <= ord(c) <= 0xDFFF for c in path.name):
        raise FemtuneError(
            "deck.unreadable", where=Where(str(path)), strerror="its name is not text in UTF-8; rename it"
        )
    # units do not matter if no test is read
    file = StudyFile.model_validate({"study": {"title": path.name, "deck": path.name, "units": "m-kg-s"}})
    file._path, file._source, file._given = path, StudyLines(str(path)), Given(units_known=False)
    return file


def _assembled(file: StudyFile, built: BuiltModel, progress: Progress) -> Study:
    """Parameters, configurations and tests on a deck that was built."""
    errors = ErrorCollector()
    model, specimens = None, None
    moved: tuple[Target, ...] = ()
    with errors.catch():
        moved = targets(file, built)
        model = parametric_model(built.structure, parameter_set(moved, built), assignments(moved), tables_of(file))
        check_derived(file, model.parameters)
        specimens = specimens_of_study(file, model)
    notices = [_acts(table) for table in model.tables] if model is not None else []
    cases: list[StudyCase] = []
    tests: dict[Path, UffFile] = {}
    base = model or parametric_model(built.structure, ParameterSet(()), ())
    presence, states = _Presence(file, built, base), States(file, base, specimens)
    with errors.catch():
        presence.read()
    for i, entry in enumerate(file.configurations):
        progress.step(f"configuration {entry.name}", i, len(file.configurations))
        with errors.catch():
            case, remarks = _with_test(file, states.case(entry, presence.of(entry)), tests)
            cases.append(_with_residuals(file, case, built))
            notices += remarks
    ErrorCollector(list({str(e): e for e in errors.errors}.values())).raise_if_any()
    if file.sensors.position_sd or file.sensors.angle_sd_deg:
        from femtune.study.residuals import check_placement  # noqa: PLC0415

        check_placement(file, cases)
    assert model is not None
    notices += value_doubts(file, model, moved, cases)
    model = model if specimens is None else specimens.models[specimens.names[0]]
    return Study(
        file, built, model, tuple(cases), tuple(dict.fromkeys(notices)),
        components=presence.components, specimens=specimens,
    )  # fmt: skip


@dataclass(eq=False)
class _Presence:
    """The components of a study, and which of them are present in a configuration."""

    file: StudyFile
    built: BuiltModel
    model: ParametricModel
    components: Components | None = None

    def read(self) -> None:
        """The elements of the components; the module is imported only if a study has some (errors of
        `components_of`)."""
        if self.file.component:
            from femtune.study.components import components_of  # noqa: PLC0415

            self.components = components_of(self.file, self.built)

    def of(self, entry: ConfigurationEntry) -> Alone | None:
        """What is present; None if a configuration does not list components (errors of `present_components`)."""
        if self.components is None or entry.components is None:
            return None
        from femtune.study.components import present_components  # noqa: PLC0415

        return present_components(self.file, entry, self._whole, self.components)

    @cached_property
    def _whole(self) -> ConfiguredModel:
        from femtune.study.components import whole_structure  # noqa: PLC0415

        return whole_structure(self.model)


def tables_of(file: StudyFile) -> tuple[FrequencyTable, ...]:
    """The tables over frequency of a study (errors ``table.values``)."""
    return tuple(
        frequency_table(entry.targets, entry.freq_hz, entry.factor, file.where("frequency_table", i))
        for i, entry in enumerate(file.frequency_table)
    )


def _acts(table: FrequencyTable) -> Notice:
    """Notices of the tables over frequency, for the report."""
    low, high, least, most = (f(v) for v in (table.freq_hz, table.factor) for f in (min, max))
    field = ", ".join(map(str, table.fields))
    return Notice("table.acts", level="info", field=field, low=low, high=high, least=least, most=most)


def _with_test(file: StudyFile, case: StudyCase, tests: dict[Path, UffFile]) -> tuple[StudyCase, tuple[Notice, ...]]:
    """The configuration with its test; readers of tests are imported only if there is a test."""
    if case.entry.test is None:
        return case, ()
    from femtune.study.measured import with_test  # noqa: PLC0415

    return with_test(file, case, tests)


def _with_residuals(file: StudyFile, case: StudyCase, built: BuiltModel) -> StudyCase:
    """The configuration with its residuals; the module is imported only if something is compared."""
    if case.modal is None and not file.residual and not file.given.residuals:
        return case
    from femtune.study.residuals import with_residuals  # noqa: PLC0415

    return with_residuals(file, case, built.modal_damping)


def with_modes_asked(study: Study, count: int | None, max_hz: float | None) -> Study:
    """The study with another number of modes, or another upper frequency, in all its configurations.

    Raises
    ------
    FemtuneError : as `with_modes`
    """
    if count is None and max_hz is None:
        return study
    file = with_modes(study.file, count, max_hz)
    count, max_hz = file.modes.count, file.modes.max_hz
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


def on_decks(study: Study, built: Mapping[str | None, BuiltModel]) -> Study:
    """The same study on other decks of the same grid points (the updated ones), without parameters.

    `built` has the deck of each specimen; under None that of a study without specimens.
    """
    models = {}
    for name, deck in built.items():
        with errors_at_cards(deck):
            models[name] = parametric_model(deck.structure, ParameterSet(()), (), tables_of(study.file))
    cases = []
    for case in study.cases:
        with errors_at_cards(built[case.entry.specimen]):
            cases.append(on_model(case, models[case.entry.specimen]))
    first = next(iter(built))
    return replace(study, built=built[first], model=models[first], cases=tuple(cases))


# ----------------------------------------------------------------------------------------------------
# The chosen solvers are checked before anything is read, so that a misspelt name is reported at once.


def check_solvers() -> None:
    """Refuse solvers that FEMTUNE_SOLVER or FEMTUNE_EIGENSOLVER names and that are not installed.

    Raises
    ------
    FemtuneError : ``solver.unavailable``, ``slepc.not-installed``, ``slepc.launcher``
    """
    errors = ErrorCollector()
    with errors.catch():
        solver_asked()
    with errors.catch():
        check_slepc()
    errors.raise_if_any()


# ----------------------------------------------------------------------------------------------------
# Derived quantities of a study.


def quantities(study: Study) -> tuple[DerivedQuantity, ...]:
    """The quantities of the study; those of individual parameters once for each specimen."""
    declared = _quantities(study.file)
    return declared if study.specimens is None else tuple(study.specimens.quantities(declared))


def _quantities(file: StudyFile) -> tuple[DerivedQuantity, ...]:
    return tuple(
        DerivedQuantity(d.name, parse_expression(d.expression, file.where("derived", i, "expression")), d.unit)
        for i, d in enumerate(file.derived)
    )


def check_derived(file: StudyFile, parameters: ParameterSet) -> None:
    """Refuse expressions without a value at the start, all together (error ``tie.value``)."""
    errors = ErrorCollector()
    for quantity in _quantities(file):
        with errors.catch():
            quantity.at(parameters, np.zeros(len(parameters.free)))
    errors.raise_if_any()
