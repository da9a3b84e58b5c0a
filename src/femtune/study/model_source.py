"""What the model of a study is made of, and what can be done with it: a deck, matrices, runs, or an external solver."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from femtune.errors import FemtuneError, Notice
from femtune.files.built_model import BuiltModel
from femtune.files.nastran.build import BuiltDeck, build_allowing
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.inventory import MISSING
from femtune.files.nastran.left_out import preloads
from femtune.files.study_file import ConfigurationSolver
from femtune.files.study_file.matrices import MatrixEntry
from femtune.files.study_file.runs import RunsModelTable
from femtune.files.study_file.solver import SolverTable
from femtune.files.study_file.study_table import StudyTable
from femtune.study.cases import ModesOfDeck

if TYPE_CHECKING:
    from femtune.fem import NodeTable
    from femtune.files.study_file import ConfigurationEntry, StudyFile
    from femtune.study.drawn_mesh import DrawnMesh
    from femtune.study.progress import Progress


Built = TypeVar("Built", bound="BuiltModel")


def _loaded(name: str) -> Callable[..., Any]:
    """The function ``module:function`` of this package that builds a model.

    It is loaded only if the study needs it, and by its name, because it asks for its source in turn.
    """
    module, _, function = name.partition(":")
    build: Callable[..., Any] = getattr(import_module(f"femtune.study.{module}"), function)
    return build


@dataclass(frozen=True, eq=False)
class ModelSource(ABC, Generic[Built]):
    """Source of the model of a study. Each variant states what its models can do; no other code needs to know it."""

    file: StudyFile

    title: ClassVar[str] = "Matrices of"
    """Word before the name of the model in titles."""
    writes_back: ClassVar[bool] = False
    """True where updated values are written to a copy of what the model is made of, which is then read and solved."""
    no_write_back: ClassVar[str] = ""
    """Code of the alert that nothing is written back; "" if the updated model is written."""
    has_elements: ClassVar[bool] = False
    """True for a model of elements with cards and properties."""
    has_structure: ClassVar[bool] = True
    """True where mass and stiffness are those of the structure, so that it can be weighed and moved as a rigid body."""
    moves_fields: ClassVar[bool] = True
    """True where a parameter changes fields of cards or factors of matrices; else it is a variable of the runs."""
    needs_runs: ClassVar[bool] = False
    """True if other values of the parameters need another run, and derivatives are differences of runs."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in the study: the deck, the first matrix, the table of runs or the first template."""

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that the model is read from, the first of which names it, without those that they include."""
        return (self.file.path_of(self.name),)

    def input_of(self, entry: ConfigurationEntry) -> Hashable:
        """What the model of a configuration is made of; equal for configurations that share it."""
        return self.name

    def prepared(self) -> StudyFile:
        """The study with what must be known before the model is built."""
        return self.file

    @abstractmethod
    def built(self, progress: Progress, fresh: bool, around: bool) -> Built:
        """The model, unless the study was given it.

        Parameters
        ----------
        fresh : runs that are known are run again
        around : False for the model at the initial values alone, where the step runs other points
        """

    def completed(self, built: Built) -> StudyFile:
        """The study with what the model states."""
        return self.file

    def doubts(self, built: Built) -> tuple[Notice, ...]:
        """Warnings of contradictions in what was read, which are often the cause of later errors."""
        return ()

    def mesh(self, nodes: NodeTable) -> DrawnMesh | None:
        """The mesh to be drawn for a model without elements; None if there is none."""
        return _loaded("imported_model:mesh_of_grid")(self.file, nodes)


def model_source(file: StudyFile) -> ModelSource[Any]:
    """What the model of a study is made of."""
    return SOURCES[type(file.source)](file)


_MOST_MODES = 100_000
_HIGHEST_HZ = 1e12
"""Largest values of `count` and `max_hz` in [modes]; METHOD of a deck may state larger ones."""


class FromDeck(ModelSource[BuiltDeck]):
    """The deck of [study]."""

    title = "Deck"
    writes_back = True
    has_elements = True

    @property
    def name(self) -> str:
        assert self.file.study.deck is not None
        return self.file.study.deck

    def built(self, progress: Progress, fresh: bool, around: bool) -> BuiltDeck:
        progress.step("reading the deck", 0, None)
        allowed = self.file.study.allow_ignored
        built = self.file.given.model or build_allowing(read_deck(self.file.path_of(self.name)), allowed)
        assert isinstance(built, BuiltDeck)
        self._check_allowed(built)
        return _loaded("named_fields:with_named_fields")(self.file, built)

    def _check_allowed(self, built: BuiltDeck) -> None:
        """Cards that the model lacks must be among those that the study allows to be ignored."""
        allowed = {name.upper() for name in self.file.study.allow_ignored}
        if allowed and (loaded := [error for name, error in preloads(built.deck).items() if name not in allowed]):
            raise loaded[0]
        missing = [c for c in built.cards if c.use == MISSING and c.name not in allowed]
        if missing:
            names = ", ".join(f"{c.name} ({c.count})" for c in missing)
            raise FemtuneError("deck.unsupported-element/not-allowed", where=missing[0].where, names=names)

    def completed(self, built: BuiltDeck) -> StudyFile:
        """The study with the number of modes of the deck's METHOD, if it does not state one."""
        asked, method = self.file.modes, built.eigen_method
        if asked.count is not None or asked.max_hz is not None or method is None:
            return self.file
        if method.wanted and method.wanted > 0:
            # a number beyond that of the DOFs means all modes
            count = min(method.wanted, max(built.structure.nodes.n_dofs, 1), _MOST_MODES)
            return self.file.model_copy(update={"modes": ModesOfDeck(count=count)})
        if method.upper_hz and method.upper_hz > 0.0:
            return self.file.model_copy(update={"modes": ModesOfDeck(max_hz=min(method.upper_hz, _HIGHEST_HZ))})
        return self.file

    def doubts(self, built: BuiltDeck) -> tuple[Notice, ...]:
        """Warnings of units and dimensions that contradict each other."""
        from femtune.study.plausible_sections import section_notices  # noqa: PLC0415
        from femtune.study.plausible_units import unit_notices, weight_densities  # noqa: PLC0415

        of_units = unit_notices(self.file, built) if self.file.given.units_known else weight_densities(built)
        return (*of_units, *section_notices(built.structure))

    def mesh(self, nodes: NodeTable) -> DrawnMesh | None:
        """None: the elements are drawn."""
        return None


_WITH_DOF_LIST = (".sti", ".mas")
"""Suffixes of the matrices of CalculiX, which writes the DOFs to a file beside them."""


class FromMatrices(ModelSource[BuiltModel]):
    """Matrices of another solver, [[matrix]]."""

    no_write_back = "write.no-deck/run"

    @property
    def name(self) -> str:
        return self.file.matrix[0].file

    @property
    def files(self) -> tuple[Path, ...]:
        """Matrices, with the lists of their DOFs, and what [model] names; not those that were given as arrays."""
        asked, given = self.file.model, self.file.given.matrices
        names = [m.file for m in self.file.matrix if m.file not in given] + [
            n for n in (asked.grid, asked.dofs, asked.listing) if n
        ]
        paths = [self.file.path_of(name) for name in names]
        lists = [p.with_suffix(".dof") for p in paths if p.suffix in _WITH_DOF_LIST]
        return tuple(dict.fromkeys([*paths, *(p for p in lists if p.is_file())]))

    def built(self, progress: Progress, fresh: bool, around: bool) -> BuiltModel:
        """The model, whose modes are compared with those that the solver listed."""
        progress.step("reading the matrices", 0, None)
        built = self.file.given.model or _loaded("imported_model:build_imported")(self.file)
        progress.step("comparing their modes with the listed ones", 0, None)
        return replace(
            built, notices=(*built.notices, _loaded("imported_model:compare_listed")(self.file, built.structure))
        )


class FromRuns(ModelSource[BuiltModel]):
    """A table of runs of another solver, [runs]."""

    no_write_back = "write.no-deck/runs"
    has_structure = False
    moves_fields = False

    @property
    def table(self) -> RunsModelTable:
        """[runs]."""
        assert self.file.runs is not None
        return self.file.runs

    @property
    def name(self) -> str:
        return self.table.file

    @property
    def files(self) -> tuple[Path, ...]:
        """The tables of the configurations, and the grid points."""
        return self._with_grid(str(self.input_of(entry)) for entry in self.file.configurations)

    def _with_grid(self, names: Iterable[str]) -> tuple[Path, ...]:
        grid = self.file.model.grid
        return tuple(dict.fromkeys(map(self.file.path_of, (*names, *([] if grid is None else [grid])))))

    def input_of(self, entry: ConfigurationEntry) -> Hashable:
        """Its table."""
        return entry.runs or self.table.file

    def built(self, progress: Progress, fresh: bool, around: bool) -> BuiltModel:
        progress.step("fitting the runs", 0, None)
        return self.file.given.model or _loaded("runs_model:build_of_runs")(self.file)

    def completed(self, built: BuiltModel) -> StudyFile:
        """With the modes that the runs have, and measured frequencies as a test."""
        return _loaded("runs_model:with_modes_of_runs")(self.file, built)


class FromSolver(FromRuns):
    """An external solver, [solver]: runs at the values of the parameters that are asked for."""

    no_write_back = "write.no-deck/solver"
    needs_runs = True

    @property
    def solver(self) -> SolverTable:
        """[solver]."""
        assert self.file.solver is not None
        return self.file.solver

    @property
    def name(self) -> str:
        return self.file.study.deck or self.solver.templates[0]

    @property
    def files(self) -> tuple[Path, ...]:
        """The deck or the first template, and the grid points."""
        return self._with_grid([self.name])

    def input_of(self, entry: ConfigurationEntry) -> Hashable:
        """Inputs of a configuration that override those of the study."""
        return (entry.solver or ConfigurationSolver()).model_dump_json()

    def prepared(self) -> StudyFile:
        """With initial values for all parameters, and the polynomials that are fitted to the runs."""
        return _loaded("external:of_solver")(self.file)

    def built(self, progress: Progress, fresh: bool, around: bool) -> BuiltModel:
        return self.file.given.model or _loaded("external:build_of_solver")(self.file, progress, fresh, around)


SOURCES: dict[type[Any], type[ModelSource[Any]]] = {
    StudyTable: FromDeck,
    MatrixEntry: FromMatrices,
    RunsModelTable: FromRuns,
    SolverTable: FromSolver,
}
"""The class of the source by the table of the study that describes it."""
