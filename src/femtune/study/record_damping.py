"""Record of the damping that a deck describes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.fem import FieldRef, Structure
from femtune.files.nastran.build import BuiltModel
from femtune.study.results_model import DampingFacts, DampingField

_VISCOUS = frozenset({"B", *(f"B{i}" for i in range(1, 7)), "CE", "CR", "C"})
_OF_VISCOUS_CARDS = ("PDAMP", "CDAMP2", "CDAMP4", "PBUSH", "PVISC", "PBUSH1D")
_Group = tuple[str, str]


def damping_facts(built: BuiltModel) -> DampingFacts:
    """Loss factors and dashpots that are not zero, by card and field, and damping of the whole model and of modes."""
    structure = built.structure
    overall, values = structure.damping, structure.values
    eta = overall.loss_factor
    return DampingFacts(
        overall_loss_factor=None if eta is None else float(values.values[eta]),
        overall_omega_rad_s=overall.overall_omega or None,
        element_omega_rad_s=overall.element_omega or None,
        modal_damping=_modal(built),
        fields=(*_fields(structure), *_of_matrices(structure)),
    )


def _fields(structure: Structure) -> list[DampingField]:
    groups = [_group(ref) if value else None for ref, value in zip(structure.values.refs, structure.values.values)]
    names = list(dict.fromkeys(g for g in groups if g is not None))
    of_entry = np.array([-1 if g is None else names.index(g) for g in groups], dtype=np.int64)
    return [_field(structure, name, of_entry == i) for i, name in enumerate(names)]


def _of_matrices(structure: Structure) -> list[DampingField]:
    """Damping matrices that no element made; their value is their factor."""
    kinds = {"viscous": "viscous", "hysteretic": "loss factor"}
    factors = {m.label: (m, float(structure.values.values[m.roles["FACTOR"]])) for m in structure.assembled}
    return [
        DampingField.model_validate(
            {"kind": kinds[m.kind], "field": label, "cards": 1, "lowest": value, "highest": value, "elements": 0}
        )
        for label, (m, value) in factors.items()
        if m.kind in kinds
    ]


def _group(ref: FieldRef) -> _Group | None:
    """Card and field of a damping value; directions and corners of one kind stand together."""
    if ref.name.startswith("GE"):
        return ref.card, "GE"
    return (ref.card, ref.name.rstrip("123456")) if ref.card in _OF_VISCOUS_CARDS and ref.name in _VISCOUS else None


def _field(structure: Structure, name: _Group, mine: NDArray[np.bool_]) -> DampingField:
    table = structure.values
    follows = np.zeros(len(mine), bool)
    follows[[d.target for d in table.derived]] = True
    # directions that follow the first are no values of their own
    own = mine & ~follows if (mine & ~follows).any() else mine
    users = [b.ids[mine[at]] for b in structure.batches for at in b.roles.values()]
    return DampingField(
        kind="loss factor" if name[1] == "GE" else "viscous",
        field=" ".join(name),
        cards=len({table.refs[i].id for i in np.flatnonzero(own)}),
        lowest=float(table.values[own].min()),
        highest=float(table.values[own].max()),
        elements=len(np.unique(np.concatenate([np.zeros(0, np.int64), *users]))),
    )


def _modal(built: BuiltModel) -> str:
    damping, number = built.modal_damping, built.deck.case_control.damping
    if damping is None or damping.freq_hz is None:
        return ""
    ratios = damping.ratio(damping.freq_hz)
    kind = "imaginary stiffness" if damping.hysteretic else "viscous damping"
    span = f"{damping.freq_hz[0]:g} to {damping.freq_hz[-1]:g} Hz"
    return f"table {number}: damping ratios {ratios.min():g} to {ratios.max():g} from {span}, as {kind}"
