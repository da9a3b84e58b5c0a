"""The step init: a commented study from a deck and a test."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from femtune.correlation.guessed_sensors import AskedSensors, GuessedSensors, guess_sensors
from femtune.correlation.sensor_map import map_sensors
from femtune.correlation.suspension import with_suspension
from femtune.correlation.unit_factor import unit_factor
from femtune.document.figures.sensors import TestPoint, test_points_svg
from femtune.document.figures.shapes import Wireframe
from femtune.document.numbers import counted
from femtune.dofs import DofSet
from femtune.errors import FemtuneError, FemtuneErrors, Where
from femtune.fem.checks import mass_properties
from femtune.files.deviations import with_deviations
from femtune.files.shape_table import is_shape_table, read_shape_table
from femtune.files.study_file import Given, frozen, study_from_data
from femtune.files.study_file.choices import check_contents, with_choices
from femtune.files.study_file.reading import read_study_choices
from femtune.files.study_file.source import StudyLines
from femtune.files.uff import read_uff
from femtune.files.uff.scan import names_universal
from femtune.files.whole_file import write_whole
from femtune.modal import ModeSet
from femtune.model.configured import grid_matrix
from femtune.model.kinds import BASELINE
from femtune.model.response.rigid import is_rigid
from femtune.residuals import ComparedCase, FrequencyResidual, ShapeResidual, modes_at_sensors, pair_case
from femtune.steps.init.guessed_units import GuessedUnits, guess_units, unit_words
from femtune.steps.init.proposed_parameters import FREQUENCY_SD, SHAPE_SD, FieldCandidate, Proposed, candidates, ranked
from femtune.steps.init.written import StudyText
from femtune.steps.result import StepResult
from femtune.steps.run_folder import check_writable, unwritable
from femtune.steps.step import STUDY_FILE
from femtune.study.cases import sensor_tolerance
from femtune.study.described import model_of_deck
from femtune.study.drawn_mesh import RIGID, thinned, whole_mesh
from femtune.study.exchanged_axes import mean_mac
from femtune.study.inputs import Input, check_outputs
from femtune.study.measured import BEYOND_TEST
from femtune.study.progress import silent
from femtune.study.record import Record
from femtune.study.rows import Rows, rows_of
from femtune.study.sensor_hints import named_length
from femtune.study.solved import nominal, solve
from femtune.study.study import load_study
from femtune.testdata import convert_units
from femtune.testdata.checks import real_modes
from femtune.testdata.convert import place, scaled_coordinates
from femtune.units import SI, unit_system

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals
    from femtune.correlation import Pairing
    from femtune.files.study_file import StudyFile
    from femtune.files.study_file.choices import StudyChoices
    from femtune.model import EigenSolution
    from femtune.study.cases import StudyCase
    from femtune.study.described import Model
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.testdata import ModalTest
    from femtune.units import UnitSystem

_PAIRS = re.compile(r"pairs = \[.*?\]")
"""The key as a remark offers it."""
PICTURE_FILE = "sensors.svg"
"""Picture of the test points on the mesh."""
IDENTIFY_FILE = "identify.toml"
IDENTIFIED_FOLDER = "identified"
_MOST_GRIDS = 60
"""Grid points at which shapes are taken as measured if no sensor could be assigned.

They must be enough to distinguish the lowest modes, and few enough for a quick ranking.
"""
_MOST_UNPROPOSED = 15
"""Candidates that are not proposed and still listed one by one, so that the study stays short."""


_LEAST_MAC = 0.6
"""Mean MAC from which mode shapes decide where the test points are."""
_BETTER_BY = 0.1
"""By how much the mean MAC must be larger than with the other motions: noise and errors of the model change a mean over
several modes by less."""


class ProposedParameter(Record):
    """A field of the deck that the study updates, or that it could update."""

    name: str
    """Name of the parameter."""
    field: str
    """The field of the deck."""
    what: str
    """What the field is: a material, a property, a joint or a mass."""
    value: float
    """Its value in the deck, in units of the deck."""
    lower: float
    """Lower bound of the factor on the value."""
    upper: float
    """Upper bound."""
    proposed: bool
    """Whether the study updates it."""
    sd_percent: float | None
    """Expected standard deviation from the measured modes beside the other proposed parameters, in % of the value; None
    if they leave it open."""
    alone_percent: float | None
    """The same if all others were known; None without effect."""
    like: str
    """A proposed parameter with nearly the same effect; "" if there is none."""


class FirstStudy(Record):
    """What `init` found and wrote."""

    files: tuple[str, ...]
    """The files that were written, the study first."""
    units: str
    """Units of the deck: length-mass-s."""
    unit_reasons: tuple[str, ...]
    """Why these units."""
    test_units: str | None
    """Units of the test; None if its file states them."""
    sensors: str
    """How test points are assigned to grid points."""
    supports: str
    """What was found of the supports."""
    rigid_body_modes: int
    """Number of rigid-body modes of the model, which are not compared."""
    test_modes: int
    """Number of test modes."""
    paired: int | None
    """Number of test modes that are paired with modes of the deck as it is; None if they were not compared."""
    agreement: str
    """How the modes of the deck as it is agree with those of the test; "" if they were not compared."""
    max_hz: float | None
    """Highest frequency up to which modes of the model are solved; None without test modes."""
    parameters: tuple[ProposedParameter, ...]
    """The proposed parameters in the order of selection, and then the others that were compared."""
    chosen: tuple[str, ...] = ()
    """Parameters that the choices of a report have in place of the proposed ones, in words."""
    doubts: tuple[str, ...]
    """What should be checked before the study is run."""
    picture: str = ""
    """The picture of the test points on the mesh; "" if there is none."""


@dataclass(frozen=True, eq=False, repr=False)
class InitResult(StepResult):
    """A first study.

    Parameters
    ----------
    path : the study file
    record : what was found
    """

    path: Path
    record: FirstStudy

    @property
    def parameters(self) -> Rows:
        """One line for each field that was compared."""
        return rows_of(self.record.parameters, *ProposedParameter.model_fields)

    @property
    def overview(self) -> str:
        """What was found, line by line."""
        record = self.record
        said = [*self._sentences()[:1], f"  units: {'; '.join(record.unit_reasons)}", f"  sensors: {record.sensors}"]
        said += [f"  picture: {record.picture}"] if record.picture else []
        said += [f"  supports: {record.supports}", f"  modes: {record.agreement}"]
        said += [f"  parameter {words}, chosen on the page of a report" for words in record.chosen]
        for p in record.parameters:
            if p.proposed and not record.chosen:
                bounds = f"{p.lower:g} to {p.upper:g}, ±{_percent(p.sd_percent)}"
                said.append(f"  parameter {p.name}: {p.field} ({p.what}), {bounds}")
        return "\n".join([*said, *(f"check: {doubt}" for doubt in record.doubts)])

    def _sentences(self) -> list[str]:
        record = self.record
        n = len(record.chosen) or sum(p.proposed for p in record.parameters)
        paired = "" if record.paired is None else f", {record.paired} paired"
        return [
            f"{self.path.name}: units {record.units}, {record.test_modes} test modes{paired}, "
            f"{counted(n, 'parameter')}",
            *record.doubts,
        ]

    def _table(self) -> Rows:
        return self.parameters


def asked_sensors(origin: Sequence[float] | None, tolerance: float | None, by_id: bool) -> AskedSensors:
    """What the user states of the sensors (error ``init.option``)."""
    if tolerance is not None and not 0.0 < tolerance < np.inf:
        raise FemtuneError("init.option", name="tolerance", value=tolerance, expected="a positive length")
    if origin is None:
        return AskedSensors(None, tolerance, by_id)
    if len(origin) != 3 or not np.isfinite(np.asarray(origin, float)).all():
        raise FemtuneError("init.option", name="origin", value=list(origin), expected="three numbers")
    return AskedSensors((float(origin[0]), float(origin[1]), float(origin[2])), tolerance, by_id)


def init_study(
    deck: Path,
    test: Path,
    folder: Path,
    units: str | None,
    asked: AskedSensors,
    force: bool,
    progress: Progress = silent,
    choices: Path | None = None,
) -> InitResult:
    """Write a first study into a folder, with the `choices` of a report.

    Raises
    ------
    FemtuneError : ``study.choices``, ``init.exists``, ``init.no-modes``, ``run.unwritable``,
        ``write.overwrites-input``, and errors in the deck and in the test
    """
    _check_absent(folder, force)
    progress.step("reading the deck", 0, None)
    chosen = None if choices is None else _chosen(choices, deck, test)
    model = model_of_deck(deck, units, ())
    assert model.built is not None  # a deck always builds one
    inputs = [*(Input(Path(name), Where(name), "deck") for name in model.built.files), _test_input(test)]
    check_outputs(inputs, [folder / STUDY_FILE, folder / PICTURE_FILE])
    check_writable(folder)
    progress.step("reading the test", 0, None)
    measured = _measured(test, folder, force, units, inputs, progress)
    draft = _Draft(model, deck, measured, folder, units, asked, chosen)
    draft.guess()
    draft.compare(progress)
    text = draft.text()
    path, picture = folder / STUDY_FILE, draft.picture()
    try:
        write_whole(path, text.encode())
        if picture:
            write_whole(folder / PICTURE_FILE, picture.encode())
    except OSError as error:
        raise unwritable(folder, error) from error
    draft.drawn = picture != ""
    return InitResult(path, draft.record(path))


def _chosen(path: Path, deck: Path, test: Path) -> StudyChoices:
    """The choices, if they are of this deck and test and of one configuration (errors ``study.choices``)."""
    choices, where = read_study_choices(path), Where(str(path))
    check_contents(choices, where, [deck, test])
    of = (*choices.pair, *choices.never_pair, *choices.leave_out, *choices.sensor_off)
    names = list(dict.fromkeys(one.configuration for one in of))
    if len(names) > 1:
        raise FemtuneError("study.choices/several", where=where, names=", ".join(names), count=len(names))
    return choices


def _test_input(path: Path) -> Input:
    return Input(path, Where(str(path)), "test file")


def _check_absent(folder: Path, force: bool) -> None:
    if not force and os.path.lexists(folder / STUDY_FILE):
        raise FemtuneError("init.exists", where=Where(str(folder / STUDY_FILE)))


@dataclass(frozen=True, eq=False)
class _Measured:
    """A test with modes.

    Parameters
    ----------
    file : the file that the study names
    units : of the test; None where its file states none
    of : words on where the modes come from
    deviations : file of the standard deviations of the modes; None without one
    files : written beside
    source : the functions or the record from which the modes were identified
    doubts : what the identification tells of its data and modes
    """

    test: ModalTest
    file: Path
    units: UnitSystem | None
    of: str
    deviations: Path | None = None
    files: tuple[Path, ...] = ()
    source: Path | None = None
    doubts: tuple[str, ...] = ()


def _measured(
    path: Path, folder: Path, force: bool, units: str | None, inputs: Sequence[Input], progress: Progress
) -> _Measured:
    if is_shape_table(path):
        return _Measured(read_shape_table(path, SI), path, None, f"the modes of {path.name}")
    if names_universal(path):
        test, stated = _read(path)
        if test.modes is not None:
            test, deviations = _with_deviations_beside(test, path)
            return _Measured(test, path, stated, f"the modes of {path.name}", deviations)
        if test.frfs is not None and stated is None:
            # functions need units; those of the deck are as good as any for the identification
            stated = unit_system(units) if units else SI
    else:
        stated = unit_system(units) if units else None
    return _identified(path, folder, force, stated, inputs, progress)


def _read(path: Path) -> tuple[ModalTest, UnitSystem | None]:
    try:
        test = read_uff(path, units=None).test
        return test, test.units
    except FemtuneError as error:
        if error.code != "uff.no-units":
            raise
    return read_uff(path, units=None, file_units=SI).test, None


def _with_deviations_beside(test: ModalTest, path: Path) -> tuple[ModalTest, Path | None]:
    """The test with the standard deviations that an identification wrote beside it, if they are of its modes."""
    from femtune.steps.identify.write import DEVIATIONS_FILE  # noqa: PLC0415

    deviations = path.with_name(DEVIATIONS_FILE)
    assert test.modes is not None
    if not deviations.is_file():
        return test, None
    try:
        return replace(test, modes=with_deviations(test.modes, deviations)), deviations
    except FemtuneError as error:
        if error.code != "test.deviations":
            raise
        return test, None


def _identified(
    path: Path, folder: Path, force: bool, units: UnitSystem | None, inputs: Sequence[Input], progress: Progress
) -> _Measured:
    """Modes identified from functions or a record, with the identification file that repeats it."""
    from femtune.steps.identify.request import asked_of  # noqa: PLC0415
    from femtune.steps.identify.run import identify  # noqa: PLC0415
    from femtune.steps.identify.write import MODES_FILE  # noqa: PLC0415

    target, results = folder / IDENTIFY_FILE, folder / IDENTIFIED_FOLDER
    for written in (target, results / MODES_FILE):
        if not force and os.path.lexists(written):
            raise FemtuneError("init.exists", where=Where(str(written)))
    check_outputs(inputs, [target], [results])
    asked = asked_of(path, {}).identify
    kind = "frfs" if asked.frfs else "spectra" if asked.spectra else "record"
    text = StudyText()
    text.say(f"Identification of modes from {path.name}: femtune identify {IDENTIFY_FILE}")
    text.table("[identify]")
    text.key(kind, _relative(path, folder))
    if units is not None and not names_universal(path):
        text.key("units", units.name)
    text.off(["band_hz = [2.0, 60.0]    # frequency range of the modes", "largest_order = 40"])
    if kind == "record":
        text.off(
            ["", "[[channel]]    # one for each column of a table: sensor and quantity", "column = 1", 'dof = "1Z+"']
        )
    text.table("[output]")
    text.key("folder", IDENTIFIED_FOLDER)
    try:
        write_whole(target, text.text.encode())
    except OSError as error:
        raise unwritable(folder, error) from error
    made = identify(target, None, progress)
    modes = made.folder / MODES_FILE
    if MODES_FILE not in made.files or not len(made.modes):
        raise FemtuneError("init.no-modes", where=Where(str(path)), identification=str(target))
    test, own = _read(modes)
    test, deviations = _with_deviations_beside(test, modes)
    files = (target, modes, *([] if deviations is None else [deviations]))
    doubts = tuple(f"identification: {n.what}" for n in made.found.notices if n.level != "info")
    return _Measured(test, modes, own, f"modes identified from {path.name}", deviations, files, path, doubts)


def _relative(path: Path, folder: Path) -> str:
    """A path as the study names it: relative where it is on the same drive."""
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:
        return path.resolve().as_posix()


@dataclass(eq=False)
class _Draft:
    """A study as far as it is known."""

    model: Model
    deck: Path
    measured: _Measured
    folder: Path
    stated: str | None
    asked: AskedSensors
    chosen: StudyChoices | None = None
    units: GuessedUnits | None = None
    sensors: GuessedSensors | None = None
    pairing: Pairing | None = None
    proposed: tuple[Proposed, ...] = ()
    skipped: int = 0
    notices: tuple[str, ...] = ()
    rigid: int = 0
    solved_hz: float = 0.0
    supports: str = ""
    mass: float = 0.0
    errors: tuple[str, ...] = ()
    range: str = ""
    drawn: bool = False

    def guess(self) -> None:
        """Units and sensors."""
        structure, measured = self.model.structure, self.measured
        numbers, points = _points(measured.test)
        guessed = guess_units(structure, points, measured.units)
        if self.stated is not None:
            guessed = replace(guessed, units=unit_system(self.stated), reasons=("as stated",), doubts=())
        self.units = guessed
        numbers, points = _points(_in_units(measured.test, guessed))
        guess = guess_sensors(structure, numbers, points, self.asked)
        if guess.factor != 1.0 and guessed.of_test is not None and (unit := self._unit_of(guess.factor)):
            # the file states no unit: the one that puts the points onto the mesh
            self.units = replace(guessed, of_test=unit_system(unit))
            numbers, points = _points(_in_units(measured.test, self.units))
            guess = guess_sensors(structure, numbers, points, self.asked)
        self.sensors = guess

    def _unit_of(self, factor: float) -> str:
        """The system whose unit of length is that of the test, where its coordinates need a factor; "" if none is."""
        assert self.units is not None
        assert self.units.of_test is not None
        return named_length(factor * self.units.of_test.length)

    def compare(self, progress: Progress) -> None:
        """Modes of the model as the deck has it, beside those of the test; the parameters ranked."""
        assert self.sensors is not None
        progress.step("assigning the sensors", 0, None)
        assert self.model.built is not None
        fields = candidates(self.model.built)
        try:
            study = load_study(self._file(fields, True), progress)
        except FemtuneError as error:
            self.errors = tuple(_folded(error.errors if isinstance(error, FemtuneErrors) else (error,)))
            study = load_study(self._file(fields, False), progress)
        progress.step("modes of the model", 0, None)
        case = study.cases[0]
        solution = solve(study, case, nominal(study))
        self.solved_hz = float(np.max(solution.freq_hz, initial=0.0))
        self.rigid = int(is_rigid(solution)[: solution.wanted].sum())
        if self._decided_by_shapes(case, solution):
            study = load_study(self._file(fields, True), progress)
            case = study.cases[0]
        self._describe(study)
        if case.compared is not None and len(case.compared.test):
            model_modes = modes_at_sensors(case.compared, solution)
            paired = pair_case(case.compared, solution)
            self.pairing = with_suspension(case.compared.test, model_modes, paired, self.rigid)
            told = (*self.pairing.notices, *unit_factor(case.compared.test, model_modes, self.pairing))
            self.notices = (*(n.what for n in told if n.level != "info"), *_of_deck(study))
            self.range = _agreement(self.pairing, case.compared.test, model_modes)
        if fields:
            progress.step("ranking the parameters", 0, None)
            own = _own_test(study, solution, self._highest)
            if len(own.test):
                ranking, self.skipped = ranked(fields, study.parameters, own, solution)
                self.proposed = tuple(ranking)
        solution.forget_factors()

    def _decided_by_shapes(self, case: StudyCase, solution: EigenSolution) -> bool:
        """Whether mode shapes decide for another one of the motions that put the test points onto the mesh equally
        well."""
        assert self.sensors is not None
        every = (self.sensors, *self.sensors.others)
        if len(every) == 1 or case.compared is None or not len(case.compared.test):
            return False
        values = np.array([self._likeness(one, case, solution) for one in every])
        best = int(np.argmax(values))
        if values[best] < _LEAST_MAC:
            return False
        near = np.flatnonzero(values >= values[best] - _BETTER_BY)
        first = every[near[0]]
        if len(near) == 1:
            other = np.delete(values, best).max()
            words = (
                f"{first.words}; of {len(every)} motions that put the test points onto the mesh this one fits the mode "
                f"shapes best (mean MAC {values[best]:.2f}, the next {other:.2f})"
            )
            self.sensors = replace(first, words=words)
        else:
            several = (
                f"{len(near)} motions put the test points onto the mesh equally well, and the mode shapes do not "
                "decide between them (the structure is symmetric, or the motions differ by few elements); if this is "
                "the wrong one, state rotation and origin of [test]"
            )
            self.sensors = replace(first, several=several)
        return bool(near[0] != 0)

    def _likeness(self, one: GuessedSensors, case: StudyCase, solution: EigenSolution) -> float:
        """Mean MAC of the test modes with modes of the model, with the test points where a guess puts them."""
        assert self.units is not None
        assert case.compared is not None
        test = scaled_coordinates(_in_units(self.measured.test, self.units), one.factor)
        rotation, origin = one.test.get("rotation", np.eye(3)), one.test.get("origin", np.zeros(3))
        test = place(test, rotation, origin, allow_mirrored=True)
        assert test.modes is not None
        structure = case.configured.model.structure
        try:
            mapped = map_sensors(
                replace(test, modes=real_modes(test.modes).modes, frfs=None),
                structure,
                tolerance=one.sensors.get("tolerance") or sensor_tolerance(self._file((), False), structure),
                leave_out=one.sensors.get("leave_out", ()),
                leave_unmatched=True,
            )
        except FemtuneError:
            return 0.0
        modes = real_modes(test.modes).modes.select_dofs(mapped.dofs)
        rows = mapped.matrix @ case.configured.transformation
        freq = solution.freq_hz[: solution.wanted]
        apart = np.abs(freq[None] / modes.freq_hz[:, None] - 1.0) > case.compared.rules.frequency_gate
        return mean_mac(np.real(modes.shapes), np.asarray(rows @ solution.shapes[:, : solution.wanted]), apart)

    @property
    def _highest(self) -> float:
        modes = self.measured.test.modes
        assert modes is not None
        return float(np.max(modes.freq_hz))

    @property
    def max_hz(self) -> float:
        """Upper frequency of the modes of the model, three digits."""
        return float(f"{BEYOND_TEST * self._highest:.3g}")

    def _file(self, fields: Sequence[FieldCandidate], with_test: bool) -> StudyFile:
        """The study with all candidates as parameters."""
        assert self.units is not None
        assert self.sensors is not None
        data: dict[str, Any] = {
            "study": {
                "title": self.deck.name,
                "deck": os.path.abspath(self.deck),
                "units": self.units.units.name,
                "journal": False,
            },
            "parameter": [one.table for one in fields],
        }
        if with_test:
            data["test"] = self._test_table(lambda path: str(path.resolve()))
            data["sensors"] = self.sensors.sensors
        given = Given(model=self.model.built)
        return study_from_data(frozen(data), self.folder / STUDY_FILE, StudyLines(STUDY_FILE), given)

    def _test_table(self, named: Callable[[Path], str]) -> dict[str, Any]:
        assert self.units is not None
        assert self.sensors is not None
        table: dict[str, Any] = {"file": named(self.measured.file)}
        if self.measured.deviations is not None:
            table["deviations"] = named(self.measured.deviations)
        if self.units.of_test is not None and self._has_shapes:
            table["units"] = self.units.of_test.name
        table |= self.sensors.test
        if self.chosen is None:
            return table
        # a first study has one test, whatever its configuration was called
        parts = ("pair", "never_pair", "leave_out", "sensor_off")
        here = {
            part: tuple(one.model_copy(update={"configuration": BASELINE}) for one in getattr(self.chosen, part))
            for part in parts
        }
        chosen = self.chosen.model_copy(update={**here, "parameter": ()})
        merged: dict[str, Any] = with_choices({"test": table}, chosen, Where(STUDY_FILE))["test"]
        return merged

    def _describe(self, study: Study) -> None:
        assert self.units is not None
        structure, case = self.model.structure, study.cases[0]
        configuration = case.configured.configuration
        self.mass = mass_properties(structure.nodes, grid_matrix(study.model, configuration, "mass")).mass
        held = structure.default_support_set
        if self.rigid:
            self.supports = (
                f"the model has {self.rigid} rigid-body modes, which are not compared, so the test must also be "
                "free-free"
            )
        else:
            self.supports = "the deck holds the structure"
        if held is not None:
            self.supports += f" (SPC set {held} of the case control)"
        elif structure.support_sets:
            sets = ", ".join(map(str, sorted(structure.support_sets)))
            self.supports += f"; the deck has SPC sets that its case control does not select: {sets}"

    @property
    def doubts(self) -> tuple[str, ...]:
        """What should be checked."""
        assert self.units is not None
        assert self.sensors is not None
        few: tuple[str, ...] = ()
        if self.pairing is not None and 2 * len(self.pairing.pairs) < self._test_modes - self.pairing.suspension_count:
            few = (
                f"only {len(self.pairing.pairs)} of {self._test_modes} test modes are paired: compare the pictures of "
                "femtune correlate before the update",
            )
        several = (self.sensors.several,) if self.sensors.several else ()
        of_test = self.measured.doubts
        return (*of_test, *self.units.doubts, *self.sensors.doubts, *several, *self.notices, *self.errors, *few)

    @property
    def _has_shapes(self) -> bool:
        modes = self.measured.test.modes
        return modes is not None and len(modes.dofs) > 0

    @property
    def _test_modes(self) -> int:
        modes = self.measured.test.modes
        return 0 if modes is None else len(modes)

    def text(self) -> str:
        """The study file."""
        assert self.units is not None
        assert self.sensors is not None
        text = StudyText()
        text.say(
            f"Written by femtune init from {self.deck.name} and {self.measured.of}. Lines that begin with # are "
            "remarks."
        )
        text.say("Check it with: femtune check study.toml; run it with: femtune run study.toml")
        if self.doubts:
            text.say("", "Check before the first run:")
            text.listed(self.doubts)
        text.table("[study]")
        text.key("title", self.deck.stem)
        text.key("deck", _relative(self.deck, self.folder))
        text.say(f"Units of the deck, {unit_words(self.units.units)}:")
        text.listed(
            (
                *self.units.reasons,
                f"the mass of the model is {self.mass:.4g} ({self.mass * self.units.units.mass:.4g} kg)",
            )
        )
        text.key("units", self.units.units.name)
        self._modes(text)
        self._test(text)
        self._parameters(text)
        self._residuals(text)
        return text.text

    def _residuals(self, text: StudyText) -> None:
        """The standard deviations of the test where it has those of all modes, and guesses otherwise."""
        modes = self.measured.test.modes
        assert modes is not None
        of_test = {"frequency_sd": not FrequencyResidual("test").without_sd(modes)}
        if self._has_shapes:
            of_test["shape_sd"] = not ShapeResidual("test").without_sd(modes)
        guesses = {
            "frequency_sd": (FREQUENCY_SD, "relative"),
            "shape_sd": (SHAPE_SD, "of an entry of a shape, relative to its largest entry"),
        }
        assumed = [key for key, known in of_test.items() if not known]
        text.table("[residuals]")
        if len(assumed) < len(of_test):
            text.say('"test": the standard deviations that the test states, which are those of the measurement alone.')
        if assumed:
            text.say(
                "The test does not state these standard deviations. They are guesses, so that residuals of another "
                "size say nothing of the model. State the repeatability of your test if you know it, and delete its "
                "key from the list."
            )
        for key, known in of_test.items():
            text.key(key, *(("test",) if known else guesses[key]))
        if assumed:
            text.key("assumed", assumed)

    def _modes(self, text: StudyText) -> None:
        modes = self.measured.test.modes
        assert modes is not None
        text.table("[modes]")
        text.say(
            f"The test has {len(modes)} modes from {np.min(modes.freq_hz):.4g} to {np.max(modes.freq_hz):.4g} Hz; the "
            f"model is solved up to {BEYOND_TEST:g} times that. {self.supports[:1].upper()}{self.supports[1:]}."
        )
        if self.solved_hz >= self._highest:
            text.key("max_hz", self.max_hz)

    def _test(self, text: StudyText) -> None:
        assert self.units is not None
        assert self.sensors is not None
        text.table("[test]")
        text.say(f"Sensors: {self.sensors.words}.")
        if self.range:
            text.say(f"The deck as it is: {self.range}")
        for name, value in self._test_table(lambda path: _relative(path, self.folder)).items():
            text.key(name, value, "the file states none" if name == "units" else "")
        for line in self._offered_pairs:
            text.off([line])
        if self.measured.source is not None:
            text.say(
                f"The functions themselves can be compared too: name {_relative(self.measured.source, self.folder)} as "
                'the test of a [[configuration]] and add a [[residual]] with kind = "frf".'
            )
        if self.sensors.sensors:
            text.table("[sensors]")
            for name, value in self.sensors.sensors.items():
                text.key(name, value)

    @property
    def _offered_pairs(self) -> list[str]:
        """The lines `pairs = …` of the remarks, for the table of the test, which is the place of this key."""
        return list(dict.fromkeys(line for notice in self.notices for line in _PAIRS.findall(notice)))

    def _parameters(self, text: StudyText) -> None:
        taken = [p for p in self.proposed if p.proposed]
        others = [p for p in self.proposed if not p.proposed]
        of_shapes = f" and {100 * SHAPE_SD:g} % in shapes" if self._has_shapes else ""
        text.lines.append("")
        text.say(
            "Parameters: factors on fields of the deck, within bounds that are usual for materials, properties, joints "
            "and masses. The order is that of the information that the test modes give (with errors of "
            f"{100 * FREQUENCY_SD:g} % in frequencies{of_shapes}); ± is the expected standard deviation beside the "
            "other parameters of the study."
        )
        if not taken:
            text.say("No field of the deck is determined by the test modes: add [[parameter]] tables of your own.")
        chosen = () if self.chosen is None else self.chosen.parameter
        if chosen:
            text.say("The parameters are those that were chosen on the page of a report, instead of the proposed ones.")
        for p in chosen:
            text.table("[[parameter]]")
            text.key("name", p.name)
            text.key("fields", p.fields)
            text.key("lower", p.lower)
            text.key("upper", p.upper)
        for one in taken if not chosen else ():
            c = one.candidate
            text.table("[[parameter]]")
            text.say(
                f"{c.kind.what}, {c.value:.5g} in the deck; ±{_percent(one.sd_percent)}, alone "
                f"±{_percent(one.alone_percent)}"
            )
            for name, value in c.table.items():
                text.key(name, value)
        if others:
            text.lines.append("")
            text.say("Not proposed, because the test modes do not determine them beside the parameters above:")
        for one in others[:_MOST_UNPROPOSED]:
            text.say(_not_proposed(one), indent="- ")
        left = len(others[_MOST_UNPROPOSED:]) + self.skipped
        if left:
            text.say(f"and {left} more fields with less effect.", indent="- ")

    def picture(self) -> str:
        """The test points on the mesh, as SVG; "" without coordinates."""
        assert self.units is not None
        assert self.sensors is not None
        nodes = self.model.structure.nodes
        if not nodes.has_coordinates or not len(nodes.xyz):
            return ""
        numbers, points = _points(_in_units(self.measured.test, self.units))
        rotation, origin = (
            np.array(self.sensors.test.get(k, d)) for k, d in (("rotation", np.eye(3)), ("origin", 0.0))
        )
        moved = self.sensors.factor * points @ rotation.T + origin
        shown = [
            TestPoint(int(n), _place(x), self._grid(int(n), x)) for n, x in zip(numbers, moved) if np.isfinite(x).all()
        ]
        mesh = thinned(nodes.xyz, whole_mesh(self.model.structure))
        if not shown or (not len(mesh.lines) and not len(mesh.faces)):
            return ""
        return test_points_svg(Wireframe(nodes.xyz, mesh.lines, mesh.kinds == RIGID, mesh.faces), shown)

    def _grid(self, number: int, place: Reals) -> tuple[float, float, float] | None:
        """Place of the grid point of a test point; None if it has none."""
        assert self.sensors is not None
        nodes, keys = self.model.structure.nodes, self.sensors.sensors
        if number in keys.get("leave_out", ()) or not self.sensors.found:
            return None
        if keys.get("by_id"):
            return _place(nodes.xyz[nodes.position(number)]) if nodes.has_grid(number) else None
        return _place(nodes.xyz[int(np.argmin(np.sum((nodes.xyz - place) ** 2, axis=1)))])

    def record(self, path: Path) -> FirstStudy:
        """The same as data."""
        assert self.units is not None
        assert self.sensors is not None
        return FirstStudy(
            files=(
                str(path),
                *([str(path.parent / PICTURE_FILE)] if self.drawn else []),
                *map(str, self.measured.files),
            ),
            units=self.units.units.name,
            unit_reasons=self.units.reasons,
            test_units=None if self.units.of_test is None else self.units.of_test.name,
            sensors=self.sensors.words,
            supports=self.supports,
            rigid_body_modes=self.rigid,
            test_modes=self._test_modes,
            paired=None if self.pairing is None else len(self.pairing.pairs),
            agreement=self.range,
            max_hz=self.max_hz,
            parameters=tuple(map(_recorded, self.proposed)),
            chosen=tuple(
                f"{p.name}: {', '.join(' '.join(field.split()) for field in p.fields)}, {p.lower:g} to {p.upper:g}"
                for p in (() if self.chosen is None else self.chosen.parameter)
            ),
            doubts=self.doubts,
            picture=str(path.parent / PICTURE_FILE) if self.drawn else "",
        )


def _place(point: Reals) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])


def _folded(errors: Sequence[FemtuneError]) -> Iterator[str]:
    """The first error of each kind, with the number of the others."""
    counts = Counter(error.code for error in errors)
    for error in {one.code: one for one in reversed(errors)}.values():
        more = f"; and {counts[error.code] - 1} more of this kind" if counts[error.code] > 1 else ""
        yield f"[{error.code}] {error.what}{more}"


def _recorded(one: Proposed) -> ProposedParameter:
    c = one.candidate
    return ProposedParameter(
        name=c.name, field=str(c.ref), what=c.kind.what, value=c.value, lower=c.kind.lower, upper=c.kind.upper,
        proposed=one.proposed, sd_percent=one.sd_percent, alone_percent=one.alone_percent, like=one.like,
    )  # fmt: skip


def _not_proposed(one: Proposed) -> str:
    c = one.candidate
    if one.alone_percent is None:
        return f"{c.ref} ({c.kind.what}): without effect"
    if one.like:
        return f"{c.ref} ({c.kind.what}): nearly the same effect as {one.like}"
    return f"{c.ref} ({c.kind.what}): ±{_percent(one.sd_percent)} beside them, ±{_percent(one.alone_percent)} alone"


def _percent(value: float | None) -> str:
    return "∞" if value is None else f"{value:.2g} %"


def _points(test: ModalTest) -> tuple[Integers, Reals]:
    """Numbers of the points that have sensors of modes, and their places; NaN without geometry."""
    modes = test.modes
    assert modes is not None
    numbers = np.array(sorted({dof.node for dof in modes.dofs if dof.component}), dtype=np.int64)
    frame = test.geometry
    points = [frame.position(int(n)) if int(n) in frame else np.full(3, np.nan) for n in numbers]
    return numbers, np.array(points, float).reshape(-1, 3)


def _in_units(test: ModalTest, guessed: GuessedUnits) -> ModalTest:
    if guessed.of_test is not None:
        test = replace(test, units=guessed.of_test)
    return convert_units(test, guessed.units)


def _own_test(study: Study, solution: EigenSolution, highest: float) -> ComparedCase:
    """The model at the sensors of the test, with its own elastic modes up to the highest test frequency as the test."""
    case = study.cases[0]
    alone = case.compared is not None and len(case.compared.test) > 0 and not len(case.compared.test.dofs)
    if case.compared is not None and (alone or case.compared.sensors.shape[0] > 1):
        rows, dofs = case.compared.sensors, case.compared.test.dofs
    else:
        nodes = case.configured.model.structure.nodes
        some = np.unique(np.linspace(0, len(nodes.ids) - 1, min(_MOST_GRIDS, len(nodes.ids))).astype(int))
        at = (6 * some[:, None] + np.arange(3)).ravel()
        rows = sp.csr_array(case.configured.transformation[at])
        dofs = DofSet(nodes.describe(int(i)) for i in at)
    rigid = is_rigid(solution)[: solution.wanted]
    inside = np.flatnonzero(~rigid & (solution.freq_hz <= 1.05 * highest))
    if not len(inside):
        inside = np.flatnonzero(~rigid)
    shapes = rows @ solution.shapes[:, inside]
    seen = (np.abs(shapes).max(axis=0, initial=0.0) > 0.0) | alone
    test = ModeSet(solution.freq_hz[inside[seen]], shapes[:, seen], dofs, source="model")
    return ComparedCase(case.configured, test, rows, max_hz=None)


def _of_deck(study: Study) -> tuple[str, ...]:
    """What is doubtful about the deck, in words."""
    return tuple(n.what for n in study.built.notices if n.level != "info")


def _agreement(pairing: Pairing, test: ModeSet, model: ModeSet) -> str:
    """How test and model agree, in words."""
    pairs = pairing.pairs
    if not pairs:
        return f"no test mode of {len(test)} is paired."
    errors = [100.0 * (model.freq_hz[p.model] / test.freq_hz[p.test] - 1.0) for p in pairs]
    macs = [p.mac for p in pairs if np.isfinite(p.mac)]
    of_shapes = f"MAC {_range(macs, '.2f')}" if macs else "no MAC without shapes"
    count = pairing.suspension_count
    suspension = f", and {count} of the suspension {'are' if count > 1 else 'is'} set apart" if count else ""
    paired = f"{len(pairs)} of {len(test) - count} test modes are paired{suspension}"
    return f"{paired}; frequency errors {_range(errors, '+.2g')} %, {of_shapes}."


def _range(values: list[float], form: str) -> str:
    """The smallest and the largest value; one number if both look alike."""
    return " to ".join(dict.fromkeys(f"{end:{form}}" for end in (min(values), max(values))))
