"""[model], [[matrix]] and [[variable]]: a model from matrices of another solver, instead of a deck."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field, StringConstraints

from femtune.errors import FemtuneError, did_you_mean
from femtune.fem.fields import MatrixKind
from femtune.files.formats import MatrixFormatKey
from femtune.files.study_file.kinds import Components, Elements, Fraction, GroupName, NamesFile, Number, Text, TomlTable
from femtune.files.study_file.runs import is_of_runs
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, named_twice, table, tables, texts

Name = Annotated[str, StringConstraints(pattern=r"^[A-Z][A-Z0-9]{0,15}$")]


class ModelTable(TomlTable):
    """[model]: grid points and rows of the matrices, and the modes that their solver listed."""

    grid: Annotated[Text, NamesFile("file of grid points")] | None = None
    """Coordinates of the nodes: a deck, or an input file with `*NODE` blocks. Default: points without coordinates,
    assigned to the test by number. Example: `"frame.bdf"`"""
    dofs: Annotated[Text, NamesFile("list of DOFs")] | None = None
    """List of the DOFs of the rows, one per line: node and component (1 to 6, 0 for a scalar point); needed if the
    matrix file does not contain them. Example: `"frame.dof"`"""
    hold_singular: bool = False
    """Constrain DOFs without stiffness, as Nastran's AUTOSPC does. Example: `true`"""
    listed_hz: tuple[Annotated[float, Field(ge=0)], ...] = ()
    """Natural frequencies listed by the solver, Hz, in ascending order from the first; rigid-body modes may be omitted.
    Example: `[12.31, 15.02]`"""
    listing: Annotated[Text, NamesFile("list of modes")] | None = None
    """Listing file of the solver with its natural frequencies, instead of `listed_hz`: f06 of Nastran, .dat of CalculiX
    or Abaqus. Example: `"frame.f06"`"""
    listed_tolerance: Fraction = 1e-4
    """Largest relative difference between a frequency and the listed one. Example: `1e-3`"""
    polynomial_tolerance: Fraction = 1e-4
    """Largest error of a polynomial at the additional set, relative to the change between the sets. Example: `1e-6`"""


class MatrixEntry(TomlTable):
    """[[matrix]]: one matrix; several of one name are sets of it at values of the variables."""

    name: Name
    """Name of the matrix: capital letters and digits. Several tables with the same name, each with `at`, are sets of
    one matrix. Example: `"FRAME"`"""
    kind: MatrixKind
    """`"stiffness"`, `"mass"`, `"viscous"` or `"hysteretic"`; the imaginary part of a stiffness matrix is read as
    hysteretic damping. Example: `"mass"`"""
    file: Annotated[Text, NamesFile("file of a matrix")]
    """The matrix file. Example: `"frame.op4"`"""
    record: Text | None = None
    """Name of the matrix in a file with several matrices. Default: the first one. Example: `"KAA"`"""
    format: MatrixFormatKey | None = None
    """`"op4"`, `"op2"`, `"dmig"`, `"abaqus"`, `"calculix"`, `"matrix-market"` or `"ansys"`. Default: detected from
    content and extension. Example: `"dmig"`"""
    factor: float = 1.0
    """Factor on the values of the file: a unit conversion or a sign. Example: `1e-3`"""
    at: dict[str, float] = Field(default_factory=dict)
    """Values of the variables for this set; variables that are not given have their nominal values. Example: `{ T = 1.5
    }`"""


class VariableEntry(TomlTable):
    """[[variable]]: a variable of the matrix sets."""

    name: Name
    """Name of the variable: capital letters and digits. Example: `"T"`"""
    nominal: float
    """Value of the variable in the nominal model. Example: `2.0`"""
    degree: Annotated[int, Field(ge=1, le=8)] = 1
    """Polynomial degree of the matrices: 3 for the thickness of a shell. Example: `3`"""
    crossed: bool = False
    """Include products with other crossed variables: needed if two variables act on the same elements. Example:
    `true`"""


def matrix_rules(data: Data, source: StudyLines) -> Problems:
    """A deck or matrices are required, variables must exist, and sets must be of one kind."""
    entries = list(tables(data, "matrix"))
    yield from _deck_or_matrices(data, source, bool(entries))
    yield from named_twice(list(tables(data, "variable")), "study.duplicate-name/earlier", source)
    names = [entry.get("name") for _, entry in tables(data, "variable")]
    for place, entry in entries:
        yield from _known_variables(place, entry, names, source)
    yield from _sets(entries, source)
    model = table(data, "model")
    if "listed_hz" in model and "listing" in model:
        yield source.error(("model", "listing"), "study.matrices/two-lists-of-modes", {})


def _deck_or_matrices(data: Data, source: StudyLines, matrices: bool) -> Problems:
    deck = "deck" in table(data, "study")
    if is_of_runs(data):
        return
    if deck and matrices:
        hint = "remove deck; if only its grid points are needed, name it by grid in [model]"
        yield source.error(("study", "deck"), "study.matrices/deck-and-matrices", {}, hint=hint)
    if not deck and not matrices and "study" in data:
        yield source.error(("study", "deck"), "study.missing-key/deck", {})
    for name in ("model", "variable"):
        if name in data and not matrices:
            yield source.error((name,), "study.matrices/table-without-matrices", {}, name=name)


def _known_variables(place: Place, entry: Data, names: list[Any], source: StudyLines) -> Problems:
    at = entry.get("at")
    for name in at if isinstance(at, dict) else ():
        if name not in names:
            yield source.error((*place, "at"), "study.matrices/unknown-variable", {}, name=name)


def _sets(entries: list[tuple[Place, Data]], source: StudyLines) -> Problems:
    """Entries of one name are sets of one matrix: of one kind, each at a point."""
    first: dict[str, tuple[Place, Data]] = {}
    for place, entry in entries:
        name = entry.get("name")
        if not isinstance(name, str):
            continue
        _, before = first.setdefault(name, (place, entry))
        if before is entry:
            continue
        if before.get("kind") != entry.get("kind"):
            yield source.error(
                (*place, "name"),
                "study.duplicate-name/matrices-of-two-kinds",
                {},
                name=name,
                earlier_kind=before.get("kind"),
                kind=entry.get("kind"),
            )
        elif not before.get("at") or not entry.get("at"):
            yield source.error((*place, "name"), "study.duplicate-name/matrices-without-points", {}, name=name)


# ----------------------------------------------------------------------------------------------------
# [[generic]]: groups of elements whose stiffness is parameterised by its own eigenvalues and shapes.


class GenericEntry(TomlTable):
    """A group of elements; its fields are ``GENERIC NAME K1`` … and ``GENERIC NAME S1-2``."""

    name: GroupName
    """Name of the group in fields: capital letters and digits. Example: `"JOINT"`"""
    elements: Elements
    """Elements of the group: a text with THRU, BY and EXCEPT, or a list; an element can belong to one group only.
    Example: `"3, 4, 7, 8"`"""
    nodes: tuple[Number, ...] = ()
    """Grid points to which the stiffness of the group is condensed first. Default: all its grid points. Example: `[3,
    9]`"""
    components: Components = "123456"
    """Components of these grid points that the eigenvectors contain; the others are condensed. Example: `"126"`"""


def generic_rules(data: Data, source: StudyLines) -> Iterator[FemtuneError]:
    """Names must be unique; parameters must name each group, and existing groups only."""
    entries = list(tables(data, "generic"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    groups = [entry["name"] for _, entry in entries if isinstance(entry.get("name"), str)]
    used = set()
    for place, parameter in tables(data, "parameter"):
        for text in texts(parameter.get("fields")):
            words = text.split()
            if len(words) < 2 or words[0] != "GENERIC":
                continue
            used.add(words[1])
            if words[1] not in groups:
                hint = did_you_mean(words[1], groups) or f'add [[generic]] name = "{words[1]}" with its elements'
                yield source.error((*place, "fields"), "generic.unknown", {}, hint=hint, name=words[1])
    for place, entry in entries:
        name = entry.get("name")
        if isinstance(name, str) and name not in used:
            yield source.error((*place, "name"), "generic.unused", {}, name=name)
