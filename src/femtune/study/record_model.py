"""Records of the deck and the model, from a study put together."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.fem import Structure
from femtune.fem.checks import (
    MassProperties,
    RigidMotionCheck,
    grounding_elements,
    mass_properties,
    rigid_body_modes,
    rigid_motion_checks,
)
from femtune.files.nastran.control import UNDERSTOOD_PARAMS
from femtune.files.nastran.dof_sets import effect_of
from femtune.files.nastran.inventory import READ
from femtune.model import Configuration, EigenSolution, grid_matrix
from femtune.model.configuration import held_dofs
from femtune.model.response import effective_mass
from femtune.model.response.rigid import is_rigid
from femtune.study.cases import StudyCase, sensor_tolerance
from femtune.study.load import Study
from femtune.study.record_checks import mass_checks
from femtune.study.record_damping import damping_facts
from femtune.study.results_base import Alert, Level, Stage, Vector3
from femtune.study.results_model import (
    CardCount,
    DeckParameter,
    EffectiveMasses,
    GroundedDof,
    GroundingElement,
    HeldDof,
    IgnoredCard,
    MatchedSensor,
    ModelConfiguration,
    ModelFacts,
    ModelModes,
    NamedSet,
    RigidBodyCheck,
    SensorResults,
)

_MOST_GROUNDING = 10

_NOT_TESTED = "not tested: the factorisation hides the inertia"


def model_facts(study: Study) -> ModelFacts:
    """What was read from the deck, and the model in each configuration."""
    built = study.built
    read = tuple(CardCount(name=c.name, count=c.count) for c in built.cards if c.use == READ)
    ignored = tuple(
        IgnoredCard(name=c.name, count=c.count, first_file=c.where.file, first_line=c.where.line or 1, reason=c.use)
        for c in built.cards
        if c.use != READ
    )
    return ModelFacts(
        cards_read=read,
        cards_ignored=ignored,
        deck_parameters=tuple(_deck_parameters(study)),
        dof_sets=tuple(
            NamedSet(name=name, dofs=len(dofs), effect=effect_of(name))
            for name, dofs in built.structure.dof_sets.items()
        ),
        notices=tuple(alert_of(n) for n in built.notices),
        configurations=tuple(_configuration(study, case) for case in study.cases),
        damping=damping_facts(built),
        checks=mass_checks(study),
    )


def alert_of(notice: Notice) -> Alert:
    """A notice as a record."""
    level: Level = "info" if notice.level == "info" else "warning"
    return Alert(level=level, code=notice.code, sentence=notice.what, where=str(notice.where or ""))


def _deck_parameters(study: Study) -> Iterable[DeckParameter]:
    for name, given in study.built.deck.params.items():
        known = name in UNDERSTOOD_PARAMS
        remark = "" if known else "not needed for normal modes, or not understood"
        yield DeckParameter(name=name, value=given.value, understood=known, remark=remark)


def _configuration(study: Study, case: StudyCase) -> ModelConfiguration:
    structure, configuration = study.model.structure, case.configured.configuration
    mass = mass_properties(structure.nodes, grid_matrix(study.model, configuration, "mass"))
    weighed = configuration.weighed_mass
    return ModelConfiguration(
        configuration=configuration.name,
        grids=len(structure.nodes.ids) + len(structure.nodes.scalar_points),
        free_dofs=case.configured.n_free,
        supports=tuple(_supports(study, configuration)),
        constraints=tuple(_constraints(study, configuration)),
        held_dofs=tuple(
            HeldDof(dof=str(d), reason="without stiffness of any element (AUTOSPC)")
            for d in case.configured.held_singular
        ),
        mass=mass.mass,
        centre_of_gravity=_vector(mass.centre) if structure.nodes.located else None,
        inertia=_matrix(mass.central_inertia) if structure.nodes.located else None,
        weighed_mass=weighed,
        mass_difference_percent=None if weighed is None else 100.0 * (mass.mass / weighed - 1.0),
        rigid_body_check=_rigid_body_check(study, configuration, mass),
        overlay=tuple(_overlay(configuration)),
    )


def _vector(values: NDArray) -> Vector3:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _matrix(values: NDArray) -> tuple[Vector3, Vector3, Vector3]:
    return _vector(values[0]), _vector(values[1]), _vector(values[2])


def _supports(study: Study, configuration: Configuration) -> Iterable[str]:
    """What holds how many DOFs, each DOF counted once."""
    structure = study.model.structure
    chosen = configuration.support_set
    chosen = structure.default_support_set if chosen is None else chosen
    held = set(held_dofs(structure, configuration).tolist())
    own = held & set(structure.permanent.tolist())
    of_set = (held & set(structure.support_sets[chosen].tolist())) - own if chosen is not None else set()
    counts = {"grid points themselves (PS)": own, f"SPC set {chosen}": of_set, "configuration": held - own - of_set}
    return (f"{name}: {_dofs(len(dofs))}" for name, dofs in counts.items() if dofs)


def _dofs(count: int) -> str:
    return f"{count} DOF" if count == 1 else f"{count} DOFs"


def _constraints(study: Study, configuration: Configuration) -> Iterable[str]:
    structure = study.model.structure
    number = configuration.multipoint_set
    number = structure.default_multipoint_set if number is None else number
    rigid = structure.rigid.keep(~np.isin(structure.rigid.owner, list(configuration.elements_off)))
    if number is not None:
        yield f"MPC set {number}: {_equations(len(structure.multipoint_sets[number]))}"
    if len(rigid):
        yield f"rigid elements: {_equations(len(rigid))}"


def _equations(count: int) -> str:
    return f"{count} equation" if count == 1 else f"{count} equations"


def _overlay(configuration: Configuration) -> Iterable[str]:
    off = sorted(configuration.elements_off)
    if off:
        shown = ", ".join(map(str, off[:12])) + (f" … ({len(off)} in all)" if len(off) > 12 else "")
        yield f"elements off: {shown}"
    for mass in configuration.masses:
        yield f"mass {mass.mass:g} at grid point {mass.node}" + (f" ({mass.label})" if mass.label else "")
    for node, components in configuration.supports_added:
        yield f"support added: {node}:{components}"
    for node, components in configuration.supports_removed:
        yield f"support removed: {node}:{components}"


def _rigid_body_check(study: Study, configuration: Configuration, mass: MassProperties) -> RigidBodyCheck:
    structure = study.model.structure
    if not structure.nodes.located:
        return _not_located()
    stiffness = grid_matrix(study.model, configuration, "stiffness")
    checks = rigid_motion_checks(structure.nodes, stiffness, mass.centre)
    grounded = not all(c.passed for c in checks)
    tied = _grounding_equations(study, configuration)
    elements = _grounding(structure, configuration, mass.centre) if grounded else ()
    if grounded and structure.assembled and not structure.batches:
        return _supports_inside(checks)
    meant = bool(elements) and not tied and {e.element for e in elements} <= _ending_on_ground(structure)
    return RigidBodyCheck(
        strain_energies=tuple(c.energy for c in checks),
        relative_energies=tuple(c.relative_energy for c in checks),
        grounded=grounded or bool(tied),
        verdict="fail" if (grounded or tied) and not meant else "pass",
        sentence=_meant_sentence(elements) if meant else _rigid_sentence(checks, tied),
        worst_dofs=_worst(checks),
        grounding_elements=elements[:_MOST_GROUNDING],
    )


def _not_located() -> RigidBodyCheck:
    """Without coordinates nothing is known of rigid motions."""
    none = (0.0,) * 6
    sentence = "the points of the model have no coordinates"
    return RigidBodyCheck(
        strain_energies=none, relative_energies=none, grounded=False, verdict="not tested", sentence=sentence,
        worst_dofs=(), grounding_elements=(),
    )  # fmt: skip


def _supports_inside(checks: tuple[RigidMotionCheck, ...]) -> RigidBodyCheck:
    """Matrices whose held degrees of freedom were left out are tied to the ground, and nothing tells by what."""
    return RigidBodyCheck(
        strain_energies=tuple(c.energy for c in checks),
        relative_energies=tuple(c.relative_energy for c in checks),
        grounded=True,
        verdict="not tested",
        sentence="the matrices resist rigid motion, as they do where held degrees of freedom were left out of them",
        worst_dofs=_worst(checks),
    )


def _ending_on_ground(structure: Structure) -> set[int]:
    """Elements with an end on the ground, as springs and bushes may have."""
    return {int(i) for b in structure.batches for i in b.ids[(b.dofs < 0).any(axis=1)]}


def _meant_sentence(elements: tuple[GroundingElement, ...]) -> str:
    names = list(dict.fromkeys(f"{e.card} {e.element}" for e in elements))
    shown = ", ".join(names[:6]) + (f" … ({len(names)} in all)" if len(names) > 6 else "")
    return f"without its supports rigid motion strains nothing but elements that end on the ground: {shown}"


def _grounding(structure: Structure, configuration: Configuration, about: NDArray) -> tuple[GroundingElement, ...]:
    found = (e for e in grounding_elements(structure, about) if e.id not in configuration.elements_off)
    return tuple(
        GroundingElement(card=e.card, element=e.id, motion=e.motion, relative_energy=e.relative_energy) for e in found
    )


def _rigid_sentence(checks: tuple[RigidMotionCheck, ...], tied: int) -> str:
    bad = [c.motion for c in checks if not c.passed]
    parts = []
    if bad:
        parts.append(
            f"rigid motion {', '.join(bad)} strains the model without its supports: something ties it to the ground"
        )
    if tied:
        parts.append(f"{_equations(tied)} do not let the model move as a rigid body")
    return "; ".join(parts) or "without its supports the model moves in all six rigid motions without strain"


def _worst(checks: tuple[RigidMotionCheck, ...]) -> tuple[GroundedDof, ...]:
    worst = max(checks, key=lambda c: c.relative_force)
    return tuple(GroundedDof(dof=str(dof), force=force) for dof, force in worst.worst)


def _grounding_equations(study: Study, configuration: Configuration) -> int:
    """Number of active equations that a rigid motion violates (equations on scalar points do not count)."""
    structure = study.model.structure
    number = configuration.multipoint_set
    number = structure.default_multipoint_set if number is None else number
    rows = [structure.rigid.keep(~np.isin(structure.rigid.owner, list(configuration.elements_off)))]
    rows += [] if number is None else [structure.multipoint_sets[number]]
    motions = rigid_body_modes(structure.nodes)
    count = 0
    for part in rows:
        gap, size = np.zeros((len(part), 6)), np.zeros((len(part), 6))
        np.add.at(gap, part.row, part.coefficient[:, None] * motions[part.dof])
        np.add.at(size, part.row, np.abs(part.coefficient[:, None] * motions[part.dof]))
        scalar = np.zeros(len(part), bool)
        scalar[part.row[part.dof >= 6 * len(structure.nodes.ids)]] = True
        count += int(((np.abs(gap) > 1e-8 * np.maximum(size, 1e-300)).any(axis=1) & ~scalar).sum())
    return count


def sensor_results(study: Study, case: StudyCase) -> SensorResults | None:
    """How the sensors of a configuration found the model; None without a test."""
    if case.sensors is None or case.entry.test is None:
        return None
    by_id = study.file.sensors.by_id
    return SensorResults(
        configuration=case.configured.configuration.name,
        test_file=case.entry.test,
        tolerance=None if by_id else sensor_tolerance(study.file, study.built.structure),
        matched=tuple(
            MatchedSensor(
                test_dof=str(m.label),
                test_node=m.label.node,
                model_node=m.node,
                distance=float(m.distance) if np.isfinite(m.distance) else None,
                how=m.how,
            )
            for m in case.sensors.matches
        ),
        unmatched=(),
    )


def model_modes(name: str, stage: Stage, solution: EigenSolution) -> ModelModes:
    """The wanted modes of a solution with the proof that none is missing."""
    freq = solution.freq_hz
    counted = solution.sturm_count >= 0
    below = int((solution.eigenvalues < solution.sturm_shift).sum())
    shift_hz = float(np.sqrt(max(solution.sturm_shift, 0.0)) / (2.0 * np.pi))
    sentence = (
        f"{solution.sturm_count} eigenvalues lie below {shift_hz:.6g} Hz by the signs of the pivots, {below} were found"
    )
    return ModelModes(
        configuration=name,
        stage=stage,
        freq_hz=tuple(float(f) for f in freq),
        rigid_body_modes=_rigid_body_modes(solution),
        sturm_shift_hz=shift_hz if counted else None,
        sturm_count=solution.sturm_count if counted else None,
        modes_below_shift=below if counted else None,
        sturm_sentence="; ".join([sentence if counted else _NOT_TESTED, *_by_whom(solution)]),
        effective_masses=_effective_masses(solution),
        solver=solution.method,
    )


def _effective_masses(solution: EigenSolution) -> EffectiveMasses:
    found = effective_mass(solution)
    # rotations about a centre that nobody knows
    known = 6 if solution.point.configured.model.structure.nodes.located else 3
    total = np.where(np.arange(6) < known, found.total, 0.0)
    fractions = [
        [float(f) if i < known and not np.isnan(f) else None for i, f in enumerate(r)] for r in found.fractions
    ]
    return EffectiveMasses(total=tuple(map(float, total)), fractions=tuple(map(tuple, fractions)))


def _by_whom(solution: EigenSolution) -> list[str]:
    """That another eigen-solver than the chosen one found the modes."""
    return [n.what for n in solution.notices if n.code == "slepc.not-used"]


def _rigid_body_modes(solution: EigenSolution) -> int:
    """Number of wanted modes, from the lowest, that strain nothing."""
    return int(np.cumprod(is_rigid(solution)[: solution.wanted]).sum())
