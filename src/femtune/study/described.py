"""Model and Study as Python objects: a study that is assembled in memory is checked like a study file."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.errors import FemtuneError
from femtune.files.nastran.build import build_allowing
from femtune.files.nastran.deck import read_deck as parse_deck
from femtune.files.study_file import Given, frozen, study_from_data
from femtune.files.study_file.reading import is_deck, toml_data, toml_text
from femtune.files.study_file.source import StudyLines, line_numbers
from femtune.testdata import ModalTest
from femtune.units import UnitSystem, unit_system

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.fem import Structure
    from femtune.files.built_model import BuiltModel
    from femtune.files.study_file import StudyFile
    from femtune.files.study_file.objects import Configuration
    from femtune.files.study_file.parameter import Parameter

_NAME = "Study"
"""What errors name in place of a file: the class that users call."""
_KEYS_OF_STUDY = ("title", "units", "allow_ignored", "choices", "journal", "journal_gib")
"""Keys of [study] that are arguments of their own; the other arguments are tables."""
_PLURALS = {
    "parameters": "parameter",
    "residuals": "residual",
    "configurations": "configuration",
    "sensors": "sensor",
    "stages": "stage",
    "loads": "load",
    "matrices": "matrix",
    "variables": "variable",
}
"""Lists may be named in the plural; [residuals] and [sensors], which are tables of their own, are given as mappings."""


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A finite element model, read from a deck or from matrices of another solver. `femtune.read_deck` and
    `femtune.read_matrices` make it; its files are read once only.

    Parameters
    ----------
    path : the deck, or the file of the first matrix
    units : length-mass-s, "" if not given
    built : the assembled model
    tables : the keys of a study file for this model
    matrices : arrays that were given instead of files, by the names that stand for these
    own_model : the function of `femtune.own_model`, in the same way

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> model = ft.read_deck(example_deck(), units="m-kg-s")
    >>> model
    Model: cantilever.bdf, 5 grid points, 5 elements, units m-kg-s
    >>> model.structure.nodes.xyz.shape
    (5, 3)
    """

    path: Path
    units: str
    built: BuiltModel | None
    tables: Mapping[str, Any] = field(default_factory=dict)
    matrices: Mapping[str, Any] = field(default_factory=dict)
    own_model: Mapping[str, Any] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """Grid points, elements and values."""
        return self._known.structure

    @property
    def _known(self) -> BuiltModel:
        if self.built is None:
            raise FemtuneError("external.own-model/no-structure", name=self.path.name)
        return self.built

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Notices of the reader."""
        return () if self.built is None else self.built.notices

    def __repr__(self) -> str:
        if self.built is None:
            return f"{type(self).__name__}: {self.path.name}, a Python function"
        points, elements = len(self.structure.nodes.ids), len(self.structure.element_kinds)
        units = f"units {self.units}" if self.units else "no units"
        return f"{type(self).__name__}: {self.path.name}, {points} grid points, {elements} elements, {units}"


def _plain(value: Any) -> Any:
    """Objects as the data of a file; a study that is a file has none."""
    from femtune.files.study_file.python_table import plain  # noqa: PLC0415

    return plain(value)


def units_word(units: str | UnitSystem | None) -> str:
    """The word of a system of units; "" for None (error ``units.unknown``)."""
    if units is None:
        return ""
    return unit_system(units.word if isinstance(units, UnitSystem) else units).name


def model_of_deck(path: Path | str, units: str | UnitSystem | None, allow_ignored: Sequence[str]) -> Model:
    """A deck, read (errors ``deck.*``)."""
    path, word, allowed = Path(path), units_word(units), tuple(allow_ignored)
    built = build_allowing(parse_deck(path), allowed)
    tables: dict[str, Any] = {"study": {"deck": os.path.abspath(path)}}
    if allowed:
        tables["study"]["allow_ignored"] = allowed
    return Model(path, word, built, tables)


def model_of_matrices(
    kinds: Mapping[str, Any], units: str | UnitSystem | None, dofs: Any = None, **words: Any
) -> Model:
    """Matrices, read; `words` are those of [model] and ``variable`` (errors ``matrices.*``, ``call.argument``)."""
    from femtune.study.given_matrices import GivenMatrices  # noqa: PLC0415  a deck needs none of it
    from femtune.study.imported_model import build_imported  # noqa: PLC0415  readers of other solvers' matrices
    from femtune.study.model_source import model_source  # noqa: PLC0415

    given = GivenMatrices()
    for name, (kind, matrix) in zip("KMCH", kinds.items()):
        given.add(kind, name, matrix)
    if isinstance(dofs, str | Path):
        words["dofs"] = dofs
    elif dofs is not None:
        given.set_dofs(dofs)
    variables = words.pop("variable", None)
    tables = _plain({"matrix": given.entries, "model": {k: v for k, v in words.items() if v is not None}})
    if variables:
        tables["variable"] = _plain(variables)
    data = {**tables, "study": {"title": "matrices", "units": units_word(units) or "m-kg-s"}}
    objects = Given(matrices=given.arrays, dofs=given.dofs)
    file = study_from_data(data, Path.cwd() / "matrices", StudyLines("read_matrices"), objects)
    path = Path(model_source(file).name)
    return Model(path, units_word(units), build_imported(file), tables, given.arrays)


def model_of_function(model: Any, count: int, dofs: Any, units: str | UnitSystem | None, version: str) -> Model:
    """A function of the user (errors as of `femtune.own_model`)."""
    from femtune.study.own_model import INPUT, own_model_of  # noqa: PLC0415  few studies have one

    own = own_model_of(model, dofs, version, "own_model")
    tables = {
        # what a study file would say of a solver; the function takes its place
        "solver": {
            "command": (own.name,), "templates": (INPUT,), "result": "modes.txt", "format": "table",
            "version": own.version,
        },
        "modes": {"count": count},
        "parallel": {"how": "serial"},
    }  # fmt: skip
    return Model(Path(own.name), units_word(units), None, tables, own_model={INPUT: own})


class Study:
    """A study, from a TOML file or from objects; the input of all steps.

    Parameters
    ----------
    source : the TOML file, or another study; the other keywords replace its tables
    model : what `read_deck` or `read_matrices` returned, or the path of a deck
    test : what `read_test` returned or the path of its file; or a mapping with the keys of [test], whose ``file`` may
        be either
    parameters : `Parameter` objects, or mappings with the keys of [[parameter]]
    residuals : residual objects, or mappings with the keys of [[residual]]; a single mapping is the table [residuals]
    configurations : `Configuration` objects, instead of `test`
    units : length-mass-s, if the model does not have them
    output : run folder; by default ``run`` in the current folder
    tables : every other table of the file under its name: ``modes={"count": 12}``, ``update={"starts": 5}``,
        ``correlate``, ``reduction``, ``response``, ``hold_out``, ``derived`` …; ``title`` and the other keys of [study]
        by themselves

    Raises
    ------
    FemtuneError : what is wrong with any of it, several problems together

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> study = ft.Study(
    ...     model=ft.read_deck(example_deck(), units="m-kg-s"),
    ...     test=ft.read_test(example_test(), units="m-kg-s"),
    ...     parameters=[ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.5, upper=2.0)],
    ...     residuals=[ft.FrequencyResidual(sd=0.01)],
    ... )
    >>> study
    Study: cantilever.bdf, 1 configuration, 1 parameter, 1 residual, units m-kg-s
    """

    file: StudyFile
    """The study as its file holds it, checked."""

    @checked
    def __init__(
        self,
        source: Path | str | Study | None = None,
        *,
        model: Model | Path | str | None = None,
        test: ModalTest | Path | str | Mapping[str, Any] | None = None,
        parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
        residuals: Sequence[Any] | Mapping[str, Any] | None = None,
        configurations: Sequence[Configuration | Mapping[str, Any]] | None = None,
        units: str | UnitSystem | None = None,
        output: Path | str | None = None,
        **tables: Any,
    ) -> None:
        words = {"parameters": parameters, "residuals": residuals, "configurations": configurations, **tables}
        if words.get("choices") is not None:
            words["choices"] = os.path.abspath(words["choices"])
        if units is not None:
            words["units"] = units_word(units)
        if output is not None:
            words["output"] = {"folder": os.path.abspath(output)}
        draft = _begun(source)
        draft.add_model(model)
        draft.add_words({name: value for name, value in words.items() if value is not None})
        draft.add_test(test)
        self._data = draft.data
        self.file = draft.finished()

    def __repr__(self) -> str:
        file = self.file
        counts = {"configuration": len(file.configurations), "parameter": len(file.parameter)}
        counts["residual"] = len(file.residual) + len(file.given.residuals)
        said = [f"{n} {word}{'s' if n != 1 else ''}" for word, n in counts.items() if n]
        return f"Study: {', '.join([file.study.title, *said, f'units {file.study.units}'])}"


@dataclass(eq=False)
class _Draft:
    """A study while it is put together: data as in a file, and what is given as objects."""

    data: dict[str, Any]
    path: Path
    source: StudyLines
    given: Given
    tests: dict[str, ModalTest] = field(default_factory=dict)
    residuals: tuple[Any, ...] = ()
    of_file: Mapping[str, Any] | None = None

    def add_model(self, model: Model | Path | str | None) -> None:
        """Set the model, or replace it."""
        if model is None:
            return
        for key in ("matrix", "model", "variable", "solver"):
            self._drop(key)
        study = {k: v for k, v in self.data.get("study", {}).items() if k != "deck"}
        if isinstance(model, Model):
            known = bool(model.units) or "units" in study
            self.given = replace(
                self.given, model=model.built, matrices=model.matrices, own_model=model.own_model, units_known=known
            )
            self.data |= {k: v for k, v in model.tables.items() if k != "study"}
            study = {**study, **model.tables.get("study", {})} | ({"units": model.units} if model.units else {})
            title = model.path.name
        else:
            self.given = replace(self.given, model=None, matrices={}, own_model={}, units_known=True)
            study["deck"], title = os.path.abspath(model), Path(model).name
        self.data["study"] = {"title": title, **study}

    def add_words(self, words: Mapping[str, Any]) -> None:
        """Set tables and lists of tables, or replace them."""
        study = {name: _plain(value) for name, value in words.items() if name in _KEYS_OF_STUDY}
        if study:
            self.data["study"] = {**self.data.get("study", {}), **study}
            self.given = replace(self.given, units_known=self.given.units_known or "units" in study)
        for name, value in words.items():
            if name not in _KEYS_OF_STUDY:
                self._add(name, value)

    def _add(self, name: str, value: Any) -> None:
        listed = isinstance(value, Sequence) and not isinstance(value, str)
        key = _PLURALS.get(name, name) if listed else name
        self._drop(key)
        kept = value
        if key == "residual":
            kept = self._without_own(value)
        elif key == "configuration":
            self._drop("test")
            kept = [self._with_named_test(entry, "test") for entry in value]
        if not listed or kept:
            self.data[key] = _plain(kept)

    def add_test(self, test: ModalTest | Path | str | Mapping[str, Any] | None) -> None:
        """The only test."""
        if test is None:
            return
        table = {"file": test} if not isinstance(test, Mapping) else test
        self._drop("test")
        self.data["test"] = _plain(self._with_named_test(table, "file"))

    def _drop(self, key: str) -> None:
        """Forget the lines of a table that is replaced."""
        self.data.pop(key, None)
        lines = {place: line for place, line in self.source.lines.items() if place[:1] != (key,)}
        self.source = replace(self.source, lines=lines)

    def _without_own(self, residuals: Sequence[Any]) -> list[Any]:
        """Residuals that a study file can describe; residuals of the user's own classes stay objects."""
        self.residuals = tuple(r for r in residuals if hasattr(r, "blocks"))
        for residual in self.residuals:
            _check_own(residual)
        return [r for r in residuals if not hasattr(r, "blocks")]

    def _with_named_test(self, entry: Any, key: str) -> dict[str, Any]:
        """The table with the name of its test in place of the test."""
        table = dict(entry) if isinstance(entry, Mapping) else {n: getattr(entry, n) for n in entry.model_fields_set}
        test = table.get(key)
        if isinstance(test, ModalTest):
            path = os.path.abspath(test.source) if test.source and os.path.isfile(test.source) else ""
            name = path or f"test in memory: {test.name or table.get('name', '')}"
            while name in self.tests and self.tests[name] is not test:
                name += " "
            self.tests[name] = test
            table[key] = name
        elif test is not None:
            several = isinstance(test, list | tuple)
            table[key] = [os.path.abspath(one) for one in test] if several else os.path.abspath(test)
        return table

    def finished(self) -> StudyFile:
        """The study, checked (errors ``study.*`` and others, several together)."""
        if self._only_numbers() and "sensors" not in self.data:
            self.data["sensors"] = {"by_id": True}
        if not self.given.units_known and "units" not in self.data.get("study", {}) and not self._tested():
            # the units of a deck do not matter if nothing is compared with it
            self.data["study"] = {**self.data.get("study", {}), "units": "m-kg-s"}
        data = frozen(self.data)
        text = None if data == self.of_file else json.dumps(data, sort_keys=True, default=repr)
        given = replace(self.given, tests=self.tests, residuals=self.residuals, text=text)
        return study_from_data(data, self.path, self.source, given)

    def _only_numbers(self) -> bool:
        """Whether model and tests are objects without coordinates, so that only their numbers can be compared."""
        model, tests = self.given.model, self.tests.values()
        if self.given.own_model:
            return bool(tests)
        return (
            bool(tests)
            and model is not None
            and not model.structure.nodes.has_coordinates
            and not any(len(test.geometry) for test in tests)
        )

    def _tested(self) -> bool:
        return "test" in self.data or any("test" in c for c in self.data.get("configuration", ()))


def _check_own(residual: Any) -> None:
    """Refuse a class in place of an object, and a method that cannot be called (error ``residual.own``)."""
    if isinstance(residual, type):
        raise FemtuneError("residual.own/class", residual=residual.__name__)
    try:
        signature(residual.blocks).bind(None, True)
    except (TypeError, ValueError) as error:
        values = {"expected": "blocks(self, state, derivatives)"}
        name = type(residual).__name__
        raise FemtuneError("residual.own/signature", values=values, residual=name, reason=error) from None


def _begun(source: Path | str | Study | None) -> _Draft:
    """A draft from a file, from another study, or from nothing."""
    if isinstance(source, Study):
        given = source.file.given
        return _Draft(
            dict(source._data), source.file.path, source.file._source, given, dict(given.tests), given.residuals
        )
    if source is None:
        return _Draft({}, Path.cwd() / "study", StudyLines(_NAME), Given())
    path = Path(source)
    text = toml_text(path)
    data = toml_data(text, path)
    return _Draft(dict(data), path, StudyLines(str(path), line_numbers(text)), Given(), of_file=data)


StudySource = Path | str | Study | Model
"""What a step takes: a study file, a study or a model."""
Test = ModalTest | Path | str | Mapping[str, Any] | None
"""The test of a study that is not described by a file."""


def source_of(source: Path | str | Study | Model, **words: Any) -> Path | str | StudyFile:
    """What a step reads: a path as it is; a model or a path with further words as a study."""
    given = {name: value for name, value in words.items() if value is not None}
    if "choices" in given:
        given["choices"] = os.path.abspath(given["choices"])
    if isinstance(source, Study):
        return (Study(source, **given) if given else source).file
    if isinstance(source, Model):
        return Study(model=source, **given).file
    if not given:
        return source
    return (Study(model=source, **given) if is_deck(source) else Study(source, **given)).file


def source_in_units(source: Path | str | Study | Model, units: str | UnitSystem | None) -> Path | str | StudyFile:
    """What a step reads, with units for a deck, which does not state them.

    Raises
    ------
    FemtuneError : ``response.units-given`` for other units than those of the source, ``units.unknown``
    """
    if units is None:
        return source_of(source)
    word = units_word(units)
    if isinstance(source, Model):
        known = source.units
    else:
        known = "" if not isinstance(source, Study) and is_deck(source) else Study(source).file.study.units
    if known and units_word(known) != word:
        raise FemtuneError("response.units-given", values={"units": word, "units of the study": known})
    return source_of(source, units=word)
