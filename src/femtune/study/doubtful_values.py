"""Values of a study that no structure or test has: bounds at which elements lose their meaning, lengths as large as the
model, percentages that were written as fractions, added masses as heavy as the structure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.errors import Notice
from femtune.fem.checks import mass_properties
from femtune.fem.fields import FieldRef
from femtune.files.nastran.field_units import field_nature
from femtune.modal.plausible_damping import LARGEST_RATIO
from femtune.model import grid_matrix

if TYPE_CHECKING:
    from femtune.fem.structure import Structure
    from femtune.files.study_file import StudyFile
    from femtune.files.study_file.parameter import Parameter as ParameterEntry
    from femtune.model import ParametricModel
    from femtune.study.cases import StudyCase
    from femtune.study.parameters import Target

LARGEST_POSITION_SD = 0.05
"""Standard deviation of the position of a sensor over the size of the model, from which its unit is doubted: 5 cm on a
structure of one metre. Sensors are placed to millimetres."""
LARGEST_TOLERANCE = 0.25
"""Tolerance of the assignment of sensors over the size of the model, from which every test node matches some point."""
LARGEST_ANGLE_SD_DEG = 45.0
"""Standard deviation of the rotation of a sensor from which its direction is not known at all."""
LARGEST_ADDED_MASS = 0.5
"""Added masses over the mass of the structure, from which the unit of the masses is doubted."""
LARGEST_LOSS_FACTOR = 2.0
"""Loss factor above which a bound is doubted; damping layers reach about 1."""
LARGEST_SD = {
    "frequency_sd": 0.2, "common_frequency_sd": 0.2, "shape_sd": 0.5,
}  # fmt: skip
"""Relative standard deviations from which a percentage is suspected, by key: at 20 % frequencies hardly count, and
shapes whose entries are off by half of the largest one have no meaning."""
LARGEST_PRIOR_SD = 2.0
"""Standard deviation of a prior on a factor from which a percentage is suspected: it hardly says anything."""
_ELEMENT_NEEDS = frozenset({"P", "L", "L²", "L⁴", "M/L³"})
"""Units of values without which an element has no stiffness or no mass: moduli, thicknesses, areas, second moments of
area, densities. Springs, masses and damping may vanish."""
_POISSON = (-1.0, 0.5)
"""Limits of the Poisson's ratio of an isotropic material."""


def value_doubts(
    file: StudyFile, model: ParametricModel, targets: Sequence[Target], cases: Sequence[StudyCase]
) -> tuple[Notice, ...]:
    """All notices of doubtful values in the tables of a study."""
    return (
        *_bounds(file, model.structure, targets),
        *_lengths(file, model.structure),
        *_angles(file),
        *_ratios(file),
        *_deviations(file),
        *_masses(model, cases),
    )


# ----------------------------------------------------------------------------------------------------
# Bounds of parameters.


def _bounds(file: StudyFile, structure: Structure, targets: Sequence[Target]) -> Iterator[Notice]:
    for target in targets:
        entry = target.entry
        if entry.tie is not None:
            continue
        for key in ("lower", "nominal", "upper"):
            given = getattr(entry, key)
            doubt = None if given is None else next(_problems(structure, target, float(given), key), None)
            if doubt is not None:
                ref, value, problem = doubt
                in_percent, plain = "parameter.meaningless-bound/percent", "parameter.meaningless-bound"
                yield Notice(
                    in_percent if _in_percent(entry) else plain, where=target.where, parameter=entry.name,
                    key=key, given=float(given), field=ref, value=value, problem=problem, **_as_factors(entry),
                )  # fmt: skip
                break


def _in_percent(entry: ParameterEntry) -> bool:
    """Whether bounds are plausible as changes in percent."""
    lower, upper = entry.lower, entry.upper
    percent = lower is not None and upper is not None and -100.0 < lower <= -1.0 and upper >= 1.0
    return percent and not entry.absolute


def _as_factors(entry: ParameterEntry) -> dict[str, Any]:
    if not _in_percent(entry) or entry.lower is None or entry.upper is None:
        return {}
    return {"low": 1.0 + entry.lower / 100.0, "high": 1.0 + entry.upper / 100.0}


def _problems(structure: Structure, target: Target, given: float, key: str) -> Iterator[tuple[FieldRef, float, str]]:
    """Fields that have no meaning at a value of the parameter, with their values."""
    for ref in target.refs:
        at = structure.values.index(ref)
        if at is None or (not field_nature(ref).positive and ref.name != "NU"):
            continue
        in_deck = float(structure.values.values[at])
        value = given if target.entry.absolute else given * in_deck
        problem = _problem(ref, value, in_deck, key)
        if problem:
            yield ref, value, problem


def _problem(ref: FieldRef, value: float, in_deck: float, key: str) -> str:
    if ref.name == "NU":
        return "" if _POISSON[0] < value < _POISSON[1] else "no isotropic material has it"
    if value < 0.0 <= in_deck:
        return "it must not be negative"
    if value == 0.0 and in_deck > 0.0 and field_nature(ref).unit in _ELEMENT_NEEDS:
        return "the elements then have no stiffness or no mass"
    if _is_ratio(ref) and value >= (LARGEST_RATIO if key == "nominal" else 1.0):
        return "no structure has this damping ratio; it is a fraction, not a percentage"
    if _is_loss_factor(ref) and value > LARGEST_LOSS_FACTOR:
        return "no material has such a loss factor; it is a fraction, not a percentage"
    return ""


def _is_ratio(ref: FieldRef) -> bool:
    return (ref.card, ref.name) == ("MODAL", "ZETA")


def _is_loss_factor(ref: FieldRef) -> bool:
    return ref.name.startswith("GE") or (ref.card, ref.name) == ("PARAM", "G")


# ----------------------------------------------------------------------------------------------------
# Lengths, angles, damping ratios, standard deviations.


def _lengths(file: StudyFile, structure: Structure) -> Iterator[Notice]:
    nodes = structure.nodes
    size = float(np.linalg.norm(np.ptp(nodes.xyz, axis=0))) if nodes.has_coordinates and len(nodes.xyz) else 0.0
    if not size:
        return
    codes = {
        "position_sd": (LARGEST_POSITION_SD, "study.large-length/position-sd"),
        "tolerance": (LARGEST_TOLERANCE, "study.large-length/tolerance"),
    }
    for key, (limit, code) in codes.items():
        value = _largest(getattr(file.sensors, key))
        if value >= limit * size:
            where = file.where("sensors", key)
            yield Notice(code, where=where, value=value, size=size, percent=100.0 * value / size)
    for i, entry in enumerate(file.configuration):
        for j, mass in enumerate(entry.masses):
            value = float(np.linalg.norm(mass.offset))
            if value >= size:
                where = file.where("configuration", i, "masses", j)
                yield Notice("study.large-length", where=where, key="offset", value=value, size=size)


def _largest(given: float | dict[int, float] | None) -> float:
    return max(given.values(), default=0.0) if isinstance(given, dict) else float(given or 0.0)


def _angles(file: StudyFile) -> Iterator[Notice]:
    places = [(file.sensors, ("sensors",)), *((r, ("residual", i)) for i, r in enumerate(file.residual))]
    for table, place in places:
        value = _largest(getattr(table, "angle_sd_deg", 0.0))
        if value >= LARGEST_ANGLE_SD_DEG:
            yield Notice("study.large-angle", where=file.where(*place, "angle_sd_deg"), value=value)


def _ratios(file: StudyFile) -> Iterator[Notice]:
    """Damping ratios that the study states."""
    tables: list[tuple[object, tuple[str | int, ...]]] = [
        (file.response, ("response",)), (file.plan, ("plan",)), (file.equalise, ("equalise",)),
        *((entry, ("vibration", i)) for i, entry in enumerate(file.vibration)),
    ]  # fmt: skip
    for table, place in tables:
        for key in ("ratio", "ratios", "damping_ratio", "damping"):
            given = getattr(table, key, None)
            values = [v for v in (given if isinstance(given, tuple) else (given,)) if isinstance(v, float | int)]
            worst = max(values, default=0.0)
            if worst >= LARGEST_RATIO:
                facts: dict[str, Any] = {"key": key, "value": worst, "percent": 100.0 * worst, "meant": worst / 100.0}
                yield Notice("study.damping-doubtful", where=file.where(*place, key), **facts)


def _deviations(file: StudyFile) -> Iterator[Notice]:
    tables: list[tuple[object, tuple[str | int, ...]]] = [
        (file.residuals, ("residuals",)), (file.plan, ("plan",)), (file.validation, ("validate",)),
    ]  # fmt: skip
    for table, place in tables:
        for key, limit in LARGEST_SD.items():
            yield from _large_sd(file, table, (*place, key), key, key, limit)
    for i, residual in enumerate(file.residual):
        known = LARGEST_SD.get(f"{residual.kind}_sd")
        if known is not None:
            name = f"sd of the {residual.kind} residual"
            yield from _large_sd(file, residual, ("residual", i, "sd"), "sd", name, known)
    for i, parameter in enumerate(file.parameter):
        if not parameter.absolute and parameter.sd is not None and parameter.sd >= LARGEST_PRIOR_SD:
            facts: dict[str, Any] = {"parameter": parameter.name, "value": parameter.sd, "meant": parameter.sd / 100.0}
            yield Notice("study.large-sd/prior", where=file.where("parameter", i, "sd"), **facts)


def _large_sd(
    file: StudyFile, table: object, place: tuple[str | int, ...], key: str, name: str, limit: float
) -> Iterator[Notice]:
    stated = getattr(table, key, None)
    if isinstance(stated, float | int) and stated >= limit:
        facts: dict[str, Any] = {
            "key": name,
            "word": key,
            "value": stated,
            "percent": 100.0 * stated,
            "meant": stated / 100.0,
        }
        of = "shape" if "shape" in name else "frequency"
        yield Notice(
            "study.large-sd" if of == "frequency" else "study.large-sd/shape", where=file.where(*place), **facts
        )


# ----------------------------------------------------------------------------------------------------
# Added masses.


def _masses(model: ParametricModel, cases: Sequence[StudyCase]) -> Iterator[Notice]:
    """Configurations whose added masses are as heavy as the structure; those of a file of masses are told by `info`."""
    for case in cases:
        configuration = case.configured.configuration
        added = sum(m.mass for m in configuration.masses)
        if not added or not model.structure.batches:
            continue
        whole = mass_properties(model.structure.nodes, grid_matrix(model, configuration, "mass")).directional_mass.max()
        structure = float(whole) - added
        if structure > 0.0 and added >= LARGEST_ADDED_MASS * structure:
            heaviest = max(configuration.masses, key=lambda m: m.mass)
            yield Notice(
                "study.heavy-masses", configuration=case.name, added=added, structure=structure,
                ratio=added / structure, node=heaviest.node, mass=heaviest.mass,
            )  # fmt: skip
