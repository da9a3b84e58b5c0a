"""Measures of what the data determine, as records."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.selection import (
    collinearity,
    energy_map,
    fisher_information,
    forward_selection,
    residual_energy,
)
from femtune.selection.information import measure_sentences

if TYPE_CHECKING:
    from femtune.residuals import CaseState, Evaluation
    from femtune.selection import (
        CosineDistances,
        EnergyMap,
        Identifiability,
        Information,
        ResidualEnergy,
        Subset,
    )
    from femtune.study.study import Study
from femtune.steps.select.record.selection import (
    AlikePair,
    GroupEnergy,
    ModeEnergies,
    NearDependence,
    ParameterInformation,
    SelectionMeasures,
    SubsetEntry,
)

Groups = dict[str, tuple[int, ...]]


_MOST_GROUPS = 12
"""Groups of elements for which strain energies are stored: those with the largest share."""


def selection_measures(
    study: Study,
    known: Identifiability,
    at: Evaluation,
    near: CosineDistances | None = None,
    remarks: Sequence[str] = (),
) -> SelectionMeasures:
    """All measures at an evaluation; energies if requested in the study.

    Parameters
    ----------
    near : distances of the parameters from the covariance of repeated tests, where there are any
    remarks : further sentences
    """
    S, names = known.scaled_jacobian, known.names
    alike, information = collinearity(S, names), fisher_information(S, names)
    subset = forward_selection(
        at.jacobian * study.parameters.prior[1],
        at.residuals,
        names,
        lost=sum(at.lost.values()),
        variance_stated=study.file.residuals.scatter == "stated",
    )
    said = [*(near.sentences if near is not None else ()), *remarks]
    groups = _groups(study)
    energies = tuple(_energies(study, at, groups, said)) if groups else ()
    return SelectionMeasures(
        collinearity_index=_finite(alike.index),
        pairs=tuple(AlikePair(first=a, second=b, cosine=c) for a, b, c in alike.pairs),
        dependences=tuple(NearDependence(condition_index=_finite(i), parameters=p) for i, p in alike.dependences),
        information=_information(information, near),
        subset=_subset(subset),
        energy_groups=study.file.select.energies,
        energies=energies,
        sentences=(*measure_sentences(alike, information, subset), *dict.fromkeys(said)),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _information(information: Information, near: CosineDistances | None) -> tuple[ParameterInformation, ...]:
    return tuple(
        ParameterInformation(
            parameter=name,
            sd_alone=_finite(information.alone[i]),
            sd_together=_finite(information.together[i]),
            d_rank=information.d_order.index(i) + 1,
            a_rank=information.a_order.index(i) + 1,
            cosine_distance=None if near is None or near.insensitive[i] else float(near.distance[i]),
        )
        for i, name in enumerate(information.names)
    )


def _subset(subset: Subset) -> tuple[SubsetEntry, ...]:
    return tuple(
        SubsetEntry(
            parameter=s.name,
            cosine=s.cosine,
            left_percent=100.0 * s.left,
            chosen=s.name in subset.chosen,
            candidates=s.candidates,
            p_value=_finite(s.p_value),
        )
        for s in subset.steps
    )


def _groups(study: Study) -> Groups:
    """Element numbers by name of the group; none if no energies are requested."""
    asked = study.file.select.energies
    if asked == "none" and study.file.select.localise:
        asked = "parameters"
    if asked == "none" or not study.source.has_elements:
        return {}
    if asked == "parameters":
        return {p.name: _elements(study, p.name) for p in study.parameters.parameters if _elements(study, p.name)}
    owners = study.built.property_of_elements if asked == "properties" else {}
    groups: dict[str, list[int]] = {}
    for number in sorted(study.built.structure.element_kinds):
        name = f"property {owners[number]}" if number in owners else f"element {number}"
        groups.setdefault(name, []).append(number)
    return {name: tuple(members) for name, members in groups.items()}


def _elements(study: Study, parameter: str) -> tuple[int, ...]:
    """Elements that a parameter affects."""
    structure, elements = study.model.structure, set()
    for name, position, _ in study.model.placed:
        if name == study.in_study(parameter):
            elements |= {int(n) for n in structure.users(position)}
    return tuple(sorted(elements))


def _energies(study: Study, at: Evaluation, groups: Groups, remarks: list[str]) -> Iterator[ModeEnergies]:
    for state in at.states:
        for tests, models in state.groups:
            shares = energy_map(state.solution, groups, models)
            for a, (i, j) in enumerate(zip(tests, models)):
                residual = _residual(study, state, i, groups, remarks) if study.file.select.localise else None
                yield _mode(state, i, float(state.solution.eigenvalues[j]), shares, a, residual)


def _residual(study: Study, state: CaseState, i: int, groups: Groups, remarks: list[str]) -> ResidualEnergy | None:
    case = state.case
    try:
        return residual_energy(
            state.solution, case.sensors, case.test.shapes[:, i].real, float(case.test.freq_hz[i]), groups,
            study.file.select.noise,
        )  # fmt: skip
    except FemtuneError as error:
        remarks.append(f"{case.name}, test mode {case.test.labels[i]}: {error.what}.")
        return None


def _mode(
    state: CaseState, i: int, eigenvalue: float, shares: EnergyMap, column: int, residual: ResidualEnergy | None
) -> ModeEnergies:
    strain, kinetic = shares.strain[:, column], shares.kinetic[:, column]
    rank = np.nan_to_num(strain) if residual is None else residual.share
    order = np.argsort(-np.maximum(rank, 0.0), kind="stable")[:_MOST_GROUPS]
    return ModeEnergies(
        configuration=state.case.name,
        test_label=state.case.test.labels[i],
        freq_hz=float(np.sqrt(max(eigenvalue, 0.0)) / (2.0 * np.pi)),
        contradiction_percent=None if residual is None else 100.0 * residual.error,
        groups=tuple(_group(shares.groups[g], strain[g], kinetic[g], residual, int(g)) for g in order),
    )


def _group(
    name: str, strain: NDArray[np.float64], kinetic: NDArray[np.float64], residual: ResidualEnergy | None, at: int
) -> GroupEnergy:
    return GroupEnergy(
        group=name,
        strain_percent=_finite(100.0 * float(strain)),
        kinetic_percent=100.0 * float(kinetic),
        residual_percent=None if residual is None else 100.0 * float(residual.share[at]),
    )
