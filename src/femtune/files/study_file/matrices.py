"""[model], [[matrix]] and [[variable]]: a model of matrices that another solver wrote, in place of a deck."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field, StringConstraints

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import Text
from femtune.files.study_file.lines import Place
from femtune.files.study_file.plain import named_twice, table, tables
from femtune.files.study_file.source import Source
from femtune.files.study_file.table import Table

Name = Annotated[str, StringConstraints(pattern=r"^[A-Z][A-Z0-9]{0,15}$")]
Format = Literal["op4", "op2", "dmig", "abaqus", "calculix", "matrix-market", "ansys"]


class ModelTable(Table):
    """[model]: grid points and rows of the matrices, and the modes that their solver listed."""

    grid: Text | None = None
    dofs: Text | None = None
    hold_singular: bool = False
    listed_hz: tuple[Annotated[float, Field(ge=0)], ...] = ()
    listing: Text | None = None
    listed_tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-4
    polynomial_tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-4


class MatrixEntry(Table):
    """[[matrix]]: one matrix; several of one name are sets of it at values of the variables."""

    name: Name
    kind: Literal["stiffness", "mass", "viscous", "hysteretic"]
    file: Text
    record: Text | None = None
    format: Format | None = None
    factor: float = 1.0
    at: dict[str, float] = Field(default_factory=dict)


class VariableEntry(Table):
    """[[variable]]: what the sets of matrices depend on."""

    name: Name
    nominal: float
    degree: Annotated[int, Field(ge=1, le=8)] = 1
    crossed: bool = False


Data = dict[str, Any]
Problems = Iterator[FemtuneError]


def matrix_rules(data: Data, source: Source) -> Problems:
    """A deck or matrices; variables that exist; sets of one kind."""
    entries = list(tables(data, "matrix"))
    yield from _deck_or_matrices(data, source, bool(entries))
    yield from named_twice(list(tables(data, "variable")), "study.duplicate-name", source)
    names = [entry.get("name") for _, entry in tables(data, "variable")]
    for place, entry in entries:
        yield from _known_variables(place, entry, names, source)
    yield from _sets(entries, source)
    model = table(data, "model")
    if "listed_hz" in model and "listing" in model:
        what = "[model] has both listed_hz and listing"
        yield source.error(("model", "listing"), "study.matrices", what, {}, "keep one of them")


def _deck_or_matrices(data: Data, source: Source, matrices: bool) -> Problems:
    deck = "deck" in table(data, "study")
    if deck and matrices:
        hint = "remove deck; the grid points of a deck are named by grid in [model]"
        yield source.error(("study", "deck"), "study.matrices", "the study has both a deck and [[matrix]]", {}, hint)
    if not deck and not matrices and "study" in data:
        hint = 'add the line  deck = "…"  (or [[matrix]] entries with the matrices of another solver)'
        what = "[study] lacks the key 'deck'"
        yield source.error(("study", "deck"), "study.missing-key", what, {}, hint)
    for name in ("model", "variable"):
        if name in data and not matrices:
            what = f"[{name}] belongs to matrices, and the study has no [[matrix]]"
            yield source.error((name,), "study.matrices", what, {}, f"add [[matrix]] entries, or remove [{name}]")


def _known_variables(place: Place, entry: Data, names: list[Any], source: Source) -> Problems:
    at = entry.get("at")
    for name in at if isinstance(at, dict) else ():
        if name not in names:
            what = f"at names '{name}', which is no [[variable]]"
            hint = f'add [[variable]] name = "{name}" with its nominal value'
            yield source.error((*place, "at"), "study.matrices", what, {}, hint)


def _sets(entries: list[tuple[Place, Data]], source: Source) -> Problems:
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
            what = f"'{name}' is the name of a {before.get('kind')} and of a {entry.get('kind')} matrix"
            yield source.error((*place, "name"), "study.duplicate-name", what, {}, "give each matrix a name of its own")
        elif not before.get("at") or not entry.get("at"):
            what = f"'{name}' is the name of two matrices"
            hint = "rename one; or, where both are sets of one matrix, say at which values: at = { T = 2.0 }"
            yield source.error((*place, "name"), "study.duplicate-name", what, {}, hint)
