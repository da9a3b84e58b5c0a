"""The step check: all mistakes of a study, its deck and its tests at once, before anything is solved.

Only frequencies that name modes of the model, as `leave_out_modes_hz` does, need modes, which are solved for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.errors import FemtuneError, FemtuneErrors, Notice, folded
from femtune.files.nastran.build import build_allowing
from femtune.files.nastran.deck import read_deck
from femtune.files.study_file.reading import is_deck, study_from_data, toml_data, toml_text
from femtune.files.study_file.source import Place, StudyLines, line_numbers, table, tables
from femtune.files.uff import read_uff
from femtune.steps.check.beyond_runs import bounds_beyond_runs
from femtune.steps.check.left_out_modes import check_left_out_modes
from femtune.steps.held_folder import held_for_solver
from femtune.steps.info.checks import mass_checks
from femtune.steps.judge.same_data import check_independent
from femtune.steps.problem import FoundProblem, problem_of_error, problem_of_notice
from femtune.steps.result import StepResult
from femtune.steps.write.run import check_writable_fields
from femtune.study.progress import silent
from femtune.study.record import Record
from femtune.study.repeats import read_repeats
from femtune.study.residuals import modes_without_sd, undamped_functions
from femtune.study.rows import Rows, rows_of
from femtune.study.study import load_study
from femtune.testdata.checks import check_test
from femtune.units import SI

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.study.progress import Progress

_CONSEQUENT_ERRORS = frozenset({"study.missing-key", "tie.unknown", "study.no-test", "sensor.unmatched"})
"""Errors that may only be the consequence of tables that were set aside because of their own mistakes."""
_UNIT_ERRORS = frozenset({"study.units-doubtful", "sensor.units"})
"""Remarks about units, which mean nothing if tables of the study were set aside."""


class CheckedStudy(Record):
    """All that is wrong with a study."""

    study: str
    """The study file."""
    errors: int
    """Number of errors."""
    warnings: int
    """Number of warnings."""
    problems: tuple[FoundProblem, ...]
    """Errors in the order of file and line, and then warnings."""


@dataclass(frozen=True, eq=False, repr=False)
class CheckResult(StepResult):
    """All that is wrong with a study.

    Parameters
    ----------
    record : as data
    errors : as the other steps raise them
    remarks : warnings, the first of each kind with the number of the others
    """

    record: CheckedStudy
    errors: tuple[FemtuneError, ...]
    remarks: tuple[Notice, ...]

    @property
    def ok(self) -> bool:
        """True without errors."""
        return self.record.errors == 0

    @property
    def problems(self) -> Rows:
        """One line for each."""
        return rows_of(self.record.problems, "level", "code", "file", "line", "message")

    def _sentences(self) -> list[str]:
        record = self.record
        return [
            f"{record.study}: {_counted(record.errors, 'error')}, {_counted(record.warnings, 'warning')}",
            *(p.message for p in record.problems if p.level == "error"),
        ]

    def _table(self) -> Rows:
        return self.problems


def _counted(count: int, word: str) -> str:
    return f"{count or 'no'} {word}{'' if count == 1 else 's'}"


def check_study(path: Path, progress: Progress = silent) -> CheckResult:
    """Everything that is wrong with a study file, the deck and the tests.

    Tables with mistakes are set aside, so that what is wrong in the others is found too.
    """
    checked = _Checked(path)
    with checked.catching():
        checked.look(progress)
    errors = checked.errors
    notices = [n for n in checked.notices if n.level != "info"]
    problems = [*map(problem_of_error, errors), *map(problem_of_notice, notices)]
    record = CheckedStudy(study=str(path), errors=len(errors), warnings=len(notices), problems=tuple(problems))
    return CheckResult(record, tuple(errors), tuple(folded(notices)))


@dataclass(eq=False)
class _Checked:
    path: Path
    notices: list[Notice] = field(default_factory=list)
    _found: dict[str, FemtuneError] = field(default_factory=dict)

    @property
    def errors(self) -> list[FemtuneError]:
        """Each once, by file and line; those of the study first."""

        def place(error: FemtuneError) -> tuple[bool, str, int]:
            file = error.where.file if error.where else ""
            return file != str(self.path), file, (error.where and error.where.line) or 0

        return sorted(self._found.values(), key=place)

    @contextmanager
    def catching(self, follows: bool = False) -> Iterator[None]:
        """Keep errors; with `follows` not those that may only follow from others."""
        try:
            yield
        except FemtuneError as error:
            for one in error.errors if isinstance(error, FemtuneErrors) else (error,):
                if not (follows and one.code in _CONSEQUENT_ERRORS):
                    self._found.setdefault(f"{one.code} {one.what} {one.where}", one)

    def look(self, progress: Progress) -> None:
        """The study file, and as much of the rest as it names."""
        if is_deck(self.path):
            self._whole(self.path, progress)
            return
        text = toml_text(self.path)
        data, source = toml_data(text, self.path), StudyLines(str(self.path), line_numbers(text))
        file, aside = self._readable(data, source)
        if file is None:
            self._parts(data, progress)
            return
        before = len(self._found)
        self._whole(file, progress, aside)
        if len(self._found) > before:
            self._parts(data, progress)

    def _readable(self, data: dict[str, Any], source: StudyLines) -> tuple[StudyFile | None, bool]:
        """The study without the tables that have mistakes, and whether there were some; None where nothing is left."""
        aside = False
        for _ in range(_MOST_ROUNDS):
            try:
                return study_from_data(data, self.path, source), aside
            except FemtuneError as error:
                errors = error.errors if isinstance(error, FemtuneErrors) else (error,)
            with self.catching(follows=aside):
                raise FemtuneErrors(errors)
            data, source, changed = _without(data, source, errors)
            if not changed:
                return None, True
            aside = True
        return None, True

    def _whole(self, source: Path | StudyFile, progress: Progress, aside: bool = False) -> None:
        """The study put together: deck, fields, configurations, tests and sensors."""
        with self.catching(follows=aside):
            with held_for_solver(source, "check"):
                study = load_study(source, progress)
            self.notices += [
                n for n in (*study.built.notices, *study.notices) if not (aside and n.code in _UNIT_ERRORS)
            ]
            if study.file.output.vtu and all(case.used is None for case in study.cases):
                self.notices.append(Notice("study.no-update", where=study.file.where("output", "vtu")))
            self.notices += [n for case in study.cases for n in modes_without_sd(study.file, case)]
            free = len(study.parameters.free)
            self.notices += undamped_functions(study.file, study.cases, free, study.built.modal_damping)
            self.notices += bounds_beyond_runs(study)
            with self.catching():
                check_independent(study)
            with self.catching():
                check_left_out_modes(study, progress)
            self.notices += [
                Notice("model.mass-differs", configuration=check.configuration, found=check.sentence)
                for check in mass_checks(study)
                if check.verdict == "fail"
            ]
            if study.file.quantify is not None:
                read_repeats(study, study.file.quantify)
            if study.writes_deck and any(case.used is not None for case in study.cases):
                check_writable_fields(study, study.file.write.wide)

    def _parts(self, data: dict[str, Any], progress: Progress) -> None:
        """The deck and the tests, each by itself."""
        deck = table(data, "study").get("deck")
        if isinstance(deck, str) and (self.path.parent / deck).is_file():
            progress.step("reading the deck", 0, None)
            with self.catching():
                names = table(data, "study").get("allow_ignored")
                allowed = [str(name) for name in names] if isinstance(names, list) else []
                self._tell(build_allowing(read_deck(self.path.parent / deck), allowed).notices)
        names = [table(data, "test").get("file"), *(entry.get("test") for _, entry in tables(data, "configuration"))]
        for name in dict.fromkeys(n for n in names if isinstance(n, str)):
            if (self.path.parent / name).is_file():
                progress.step(f"reading {name}", 0, None)
                with self.catching():
                    self._tell(_notices_of_test(self.path.parent / name))

    def _tell(self, notices: Iterable[Notice]) -> None:
        """Notices that the whole study could not tell, because it has errors."""
        self.notices += [n for n in notices if n not in self.notices]


_MOST_ROUNDS = 20
"""Readings of a study, each without the tables in which the previous one found mistakes.

Every reading removes at least one table; the limit ends the check of a file whose mistakes depend on each other.
"""


def _notices_of_test(path: Path) -> tuple[Notice, ...]:
    """Notices of a test, read in units that do not matter here where its file states none."""
    try:
        content = read_uff(path, units=None)
    except FemtuneError as error:
        if error.code != "uff.no-units":
            raise
        content = read_uff(path, units=None, file_units=SI)
    return (*content.notices, *check_test(content.test))


def _without(
    data: dict[str, Any], source: StudyLines, errors: tuple[FemtuneError, ...]
) -> tuple[dict[str, Any], StudyLines, bool]:
    """The data without the tables in which there are errors, whose other entries keep their lines."""
    starts = sorted((line, place) for place, line in source.lines.items() if _is_table(place, data))
    faulty: set[Place] = set()
    study = dict(table(data, "study"))
    for error in errors:
        line = error.where.line if error.where is not None else None
        before = [place for start, place in starts if line is not None and start <= line]
        if before and before[-1][0] != "study":
            faulty.add(before[-1])
        elif error.where is not None:
            _mend(study, error.where.record.removeprefix("study").removeprefix("."))
    mended = study != table(data, "study")
    if not faulty and not mended:
        return data, source, False
    data = {**data, "study": study} if mended else data
    kept: dict[str, Any] = {}
    lines: dict[Place, int] = {place: line for place, line in source.lines.items() if len(place) == 1}
    for key, value in data.items():
        listed = isinstance(value, tuple) and all(isinstance(entry, dict) for entry in value)
        if not listed:
            if (key,) not in faulty:
                kept[key] = value
                lines |= {place: line for place, line in source.lines.items() if place[0] == key}
            continue
        stay = [i for i in range(len(value)) if (key, i) not in faulty]
        if stay:
            kept[key] = tuple(value[i] for i in stay)
        for new, old in enumerate(stay):
            moved = {p: line for p, line in source.lines.items() if p[:2] == (key, old)}
            lines |= {(key, new, *place[2:]): line for place, line in moved.items()}
    return kept, StudyLines(source.file, lines), True


def _is_table(place: Place, data: dict[str, Any]) -> bool:
    value = data.get(str(place[0]))
    listed = isinstance(value, tuple) and all(isinstance(entry, dict) for entry in value)
    return len(place) == (2 if listed else 1)


_STAND_INS = {"title": "study", "units": "m-kg-s"}


def _mend(study: dict[str, Any], key: str) -> None:
    """A table [study] without the key that is at fault, or with a value in its place; not without its deck."""
    if key in _STAND_INS or not key:
        study |= {name: word for name, word in _STAND_INS.items() if name == key or name not in study}
    elif key != "deck":
        study.pop(key.partition("[")[0].partition(".")[0], None)
