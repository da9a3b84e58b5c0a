"""The updated deck: written values, split properties, values that could not be written, and the deck read again."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError, Where
from femtune.fem import MODAL
from femtune.fem.distribution import varied_entries
from femtune.fem.fields import AMPLITUDE
from femtune.files.nastran.build import build_allowing
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.field_refs import OF_MATRICES, WITHOUT_CARD
from femtune.files.nastran.write import plan_edits, write_deck
from femtune.journal.owner import owner_of
from femtune.journal.run_files import RUN_FILES, UNVERIFIED_FILE
from femtune.steps.update.record.update import WrittenValue
from femtune.steps.write.facts import edits, new_cards, repointed
from femtune.steps.write.record import WriteBackResults
from femtune.steps.write.verify import value_differences
from femtune.study.inputs import inputs_of_study
from femtune.study.parameters import with_updated_ratios

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.fem import FieldRef
    from femtune.files.built_model import BuiltModel
    from femtune.files.nastran.write import WritePlan, WrittenDeck
    from femtune.parameters import Parameter
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

_OF_NO_CARD = (MODAL, *WITHOUT_CARD)


@dataclass(frozen=True, eq=False)
class WriteBack:
    """What was written, and the written deck read again, of each specimen; None is that of a study without them."""

    record: WriteBackResults
    written: dict[str, tuple[WrittenValue, ...]]
    built: dict[str | None, BuiltModel]


def _reserved(study: Study, run: Path, folder: Path) -> set[str]:
    """Names which changed INCLUDEs must not take: of files of a run, of inputs, and of files that no run has made.

    `folder` is the run folder, or that of a specimen in it.
    """
    of_runs = {name for one in RUN_FILES for name in (one.name, *one.names(study.file))} - {UNVERIFIED_FILE}
    place = os.path.realpath(folder)
    inputs = (Path(os.path.realpath(one.path)) for one in inputs_of_study(study))
    owner = owner_of(run, run)
    there = folder.iterdir() if folder.is_dir() else ()
    others = {path.name for path in there if owner and not owner.made(path.relative_to(run).as_posix())}
    return of_runs | {path.name for path in inputs if str(path.parent) == place} | (others - {UNVERIFIED_FILE})


def check_writable_fields(study: Study, wide: bool) -> None:
    """Check, before the update, that the deck has a place for the values, by the changes at the initial values.

    Raises
    ------
    FemtuneError : ``write.no-card``, ``write.shared``, ``write.no-field``, ``write.unknown-region``, and others of
        `plan_edits`
    """
    names = (None,) if study.specimens is None else study.specimens.names
    for of_part in (study if name is None else study.of_specimen(name) for name in names):
        x = np.zeros(len(of_part.parameters.free))
        _check_places(of_part, x)
        _planned(of_part, x, wide)


def write_back(study: Study, result: UpdateResult, folder: Path, wide: bool) -> WriteBack:
    """Write the updated deck into a folder and read it again; of specimens each one's into a folder of its own.

    Raises
    ------
    FemtuneError : ``run.unwritable`` and the codes ``write.*``
    """
    if study.specimens is None:
        return _write_deck(study, result, folder, folder, wide)
    decks: dict[str | None, WriteBack] = {
        name: _write_deck(study.of_specimen(name), result, folder, folder / name, wide)
        for name in study.specimens.names
    }
    records = [one.record for one in decks.values()]
    # what a common parameter changes is the same in all decks, and is listed once
    together = {
        name: tuple(dict.fromkeys(value for record in records for value in getattr(record, name)))
        for name in WriteBackResults.model_fields
    }
    written = {name: values for one in decks.values() for name, values in one.written.items()}
    built = {name: deck for name, one in decks.items() for deck in one.built.values()}
    return WriteBack(WriteBackResults(**together), written, built)


def _write_deck(study: Study, result: UpdateResult, run: Path, folder: Path, wide: bool) -> WriteBack:
    plan, values = _planned(study, result.x, wide)
    deck = write_deck(plan.edited, folder, UNVERIFIED_FILE, _reserved(study, run, folder))
    rebuilt = build_allowing(read_deck(deck.main), study.file.study.allow_ignored)
    differences = value_differences(study.model.structure, values, rebuilt.structure)
    record = _record(study, plan, deck, run, values).model_copy(update={"differences": tuple(differences)})
    return WriteBack(record, _written(study, plan), {None: with_updated_ratios(rebuilt, values)})


def _planned(study: Study, x: Reals, wide: bool) -> tuple[WritePlan, Mapping[FieldRef, float]]:
    """Changes of the deck, and all values."""
    values = study.model.field_values(x)
    values = {**values, **study.model.structure.values.following(values, study.built.fields)}
    updates = {ref: value for ref, value in values.items() if ref.card not in _OF_NO_CARD}
    return plan_edits(study.built_deck, updates, _regions(study), wide), values


def _check_places(study: Study, x: Reals) -> None:
    """Refuse fields that no card holds, and shared ones if their cards must not be split: the deck would be another
    model than the update."""
    owners = {ref: name for name, ref in _placed(study)}
    varied = {ref for ref, _ in _varied(study)}
    for ref in study.model.field_values(x):
        # an amplitude is written as the values of its elements
        if ref.card in WITHOUT_CARD and ref.card != AMPLITUDE:
            code = "write.no-card/case-control" if ref.card in OF_MATRICES else "write.no-card"
            raise FemtuneError(code, where=_where(study, owners[ref]), parameter=owners[ref], field=ref)
        if ref.region and not study.file.write.split:
            shared, where = replace(ref, region=""), _where(study, owners[ref])
            raise FemtuneError("write.shared", where=where, parameter=owners[ref], field=shared)
    if varied and not study.file.write.split:
        ref = min(varied)
        where, name = study.file.where("write", "split"), owners.get(ref, ref.region)
        raise FemtuneError("write.shared", where=where, parameter=name, field=replace(ref, region=""))


def _where(study: Study, owner: str) -> Where:
    """The table of a parameter of the study."""
    names = [entry.name for entry in study.file.parameter]
    name = study.in_study(owner)
    return study.file.where("parameter", names.index(name), "fields") if name in names else study.file.where("write")


def _regions(study: Study) -> dict[str, Iterable[int]]:
    elements_of = {a.parameter: a.elements for a in study.model.assignments if a.elements is not None}
    varied = [region for _, region in _varied(study)]
    return {**elements_of, **{region: (int(region.split()[-1]),) for region in varied}}


def _varied(study: Study) -> Iterator[tuple[FieldRef, str]]:
    """Values of single elements in distributions, with the name of the region that the element is."""
    table = study.model.structure.values
    yield from ((table.refs[i], table.refs[i].region) for i in sorted(varied_entries(table)))


def _placed(study: Study) -> Iterator[tuple[str, FieldRef]]:
    """Each field with the parameter that sets it, or that sets what it follows from."""
    table = study.model.structure.values
    for placed, i, _ in study.model.placed:
        name = study.model.name_of(placed)
        yield name, table.refs[i]
        yield from ((name, ref) for ref in table.followers([table.refs[i]], study.built.fields))


def _written(study: Study, plan: WritePlan) -> dict[str, tuple[WrittenValue, ...]]:
    out: dict[str, list[WrittenValue]] = {}
    for name, ref in _placed(study):
        if ref in plan.values:
            out.setdefault(name, []).append(WrittenValue(field=str(ref), value=float(plan.values[ref])))
    return {name: tuple(values) for name, values in out.items()}


def _record(
    study: Study, plan: WritePlan, deck: WrittenDeck, folder: Path, values: Mapping[FieldRef, float]
) -> WriteBackResults:
    owners = {ref: name for name, ref in _placed(study)}
    return WriteBackResults(
        files=tuple(str(p.relative_to(folder)) for p in deck.files),
        edits=tuple(edits(study, plan, values, owners)),
        new_cards=tuple(new_cards(study, plan, values, owners)),
        repointed=tuple(repointed(study, plan)),
        splits=tuple(
            f"{s.source} was copied to {s.copy} for the {len(s.elements)} elements of {s.region}" for s in plan.splits
        ),
        without_field=(*_no_fields(study), *_of_modes(values, owners)),
        includes_changed=tuple(f"{c.where}: '{c.before}' became '{c.after}'" for c in deck.include_changes),
    )


def _of_modes(values: Mapping[FieldRef, float], owners: Mapping[FieldRef, str]) -> Iterable[str]:
    for ref, value in values.items():
        if ref.card == MODAL:
            modes = f"mode {ref.id}" if ref.id else "all modes without an individual ratio"
            yield f"{owners[ref]}: the damping ratio {value:.6g} of {modes} is not on any card; enter it in TABDMP1"


def _no_fields(study: Study) -> Iterable[str]:
    used = {name for name, _ in _placed(study)}
    for p in study.parameters.parameters:
        if p.name not in used and p.name not in study.model.foreign:
            yield f"{p.name} has no field in the deck: {_use(p, study)}"


def _use(parameter: Parameter, study: Study) -> str:
    users = [p.name for p in study.parameters.parameters if p.tie and parameter.name in p.tie.names]
    return f"it acts through {', '.join(users)}" if users else "its value is not written"


def check_written(built: BuiltModel, study: Study) -> None:
    """The written deck must have the elements and grid points of the one that was read.

    Raises
    ------
    FemtuneError : ``write.not-read-back``
    """
    before, after = set(study.built.structure.element_kinds), set(built.structure.element_kinds)
    same_grids = np.array_equal(study.built.structure.nodes.ids, built.structure.nodes.ids)
    if before != after or not same_grids:
        raise FemtuneError(
            "write.not-read-back/model-differs",
            values={"elements that differ": ", ".join(map(str, sorted(before ^ after)[:10])) or "none"},
        )
