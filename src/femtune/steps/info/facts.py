"""Facts of the model and of its sensors, as records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.fem.checks import (
    grounding_elements,
    mass_properties,
    rigid_body_modes,
    rigid_motion_checks,
)
from femtune.fem.element_shapes import element_shapes
from femtune.files.nastran.constraints import effect_of
from femtune.files.nastran.control import UNDERSTOOD_PARAMS
from femtune.files.nastran.geomcheck import geometry_checks
from femtune.files.nastran.inventory import READ
from femtune.files.study_file import test_files
from femtune.model import grid_matrix
from femtune.model.configuration import held_dofs
from femtune.model.drilling import drilling_modes
from femtune.model.mass_effect import effect_of_masses
from femtune.model.response import effective_mass
from femtune.model.response.rigid import is_rigid
from femtune.steps.info.checks import mass_checks
from femtune.steps.info.neutral_axis import of_neutral_axis
from femtune.steps.init.proposed_parameters import KIND_OF_FIELD, fields_of_kinds
from femtune.study.cases import sensor_tolerance
from femtune.study.plausible_sections import slow_modes
from femtune.study.record import Alert, ModelVersion, Vector3, alert
from femtune.testdata import sensors_at

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.fem import FieldRef, Structure
    from femtune.fem.checks import (
        MassProperties,
        RigidMotionCheck,
    )
    from femtune.fem.element_shapes import ShapeFound
    from femtune.files.built_model import BuiltModel
    from femtune.modal.beside import ModesBeside
    from femtune.model import Configuration, EigenSolution
    from femtune.study.cases import StudyCase
    from femtune.study.record import Level
    from femtune.study.study import Study
from femtune.steps.info.record.model import (
    BesideDeck,
    DampingFacts,
    DampingField,
    DeckParameterRecord,
    EffectiveMasses,
    ElementShapes,
    ElementShapeTest,
    ExciterRecord,
    GroundedDof,
    GroundingElementRecord,
    HeldDof,
    IgnoredCard,
    MatchedSensor,
    ModeBesideDeck,
    ModelConfiguration,
    ModelFacts,
    ModelModes,
    NamedSet,
    OutOfShape,
    RigidBodyCheck,
    SensorResults,
    TestMassEffect,
    TestMassMode,
    UnmatchedSensor,
    UpdatableField,
    UsedCard,
)

_NO_STIFFNESS = "no stiffness from any element (AUTOSPC)"


_NEITHER = "neither stiffness nor mass"


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
    """Damping matrices that no element made; their value is their factor, 1 for those without one."""
    kinds = {"viscous": "viscous", "hysteretic": "loss factor"}
    values = structure.values.values
    factors = {
        m.label: (m, float(values[m.roles["FACTOR"]]) if m.roles else 1.0)
        for m in structure.assembled
        if m.kind in kinds
    }
    return [
        DampingField.model_validate(
            {"kind": kinds[m.kind], "field": label, "cards": 1, "lowest": value, "highest": value, "elements": 0}
        )
        for label, (m, value) in factors.items()
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
    elements = mine & ~follows if (mine & ~follows).any() else mine
    users = [b.ids[mine[at]] for b in structure.batches for at in b.roles.values()]
    return DampingField(
        kind="loss factor" if name[1] == "GE" else "viscous",
        field=" ".join(name),
        cards=len({table.refs[i].id for i in np.flatnonzero(elements)}),
        lowest=float(table.values[elements].min()),
        highest=float(table.values[elements].max()),
        elements=len(np.unique(np.concatenate([np.zeros(0, np.int64), *users]))),
    )


def _modal(built: BuiltModel) -> str:
    damping, number = built.modal_damping, built.damping_number
    if damping is None or damping.freq_hz is None:
        return ""
    ratios = damping.ratio(damping.freq_hz)
    kind = "imaginary stiffness" if damping.hysteretic else "viscous damping"
    span = f"{damping.freq_hz[0]:g} to {damping.freq_hz[-1]:g} Hz"
    return f"table {number}: damping ratios {ratios.min():g} to {ratios.max():g} from {span}, as {kind}"


_MOST_GROUNDING = 10
"""Elements that are listed where rigid motion strains them; the largest ones show the mistake."""


_NOT_TESTED = "not tested: the factorisation hides the inertia"


_AT_OWN_FREQUENCY = "not tested: the stiffness depends on frequency"


def model_facts(study: Study) -> ModelFacts:
    """What was read from the deck, and the model in each configuration."""
    built = study.built
    read = tuple(UsedCard(name=c.name, count=c.count) for c in built.cards if c.use == READ)
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
        element_shapes=_element_shapes(built),
        beside_deck=tuple(map(_beside_deck, built.beside)),
        fields=tuple(_updatable_fields(study)),
    )


_MOST_FIELDS = 200
"""Fields that a reader of the page can make parameters; a longer list would not be read."""


def _updatable_fields(study: Study) -> Iterator[UpdatableField]:
    """Fields with usual bounds, in the order of the deck; none where no deck is changed."""
    if not study.source.writes_back:
        return
    structure = study.built.structure
    numbers = np.unique(np.concatenate([np.zeros(0, np.int64), *(b.ids for b in structure.batches)]))
    row = {ref: i for i, ref in enumerate(structure.values.refs)}
    for one in islice(fields_of_kinds(study.built, KIND_OF_FIELD), _MOST_FIELDS):
        yield UpdatableField(
            name=one.name, field=str(one.ref), what=one.kind.what, value=one.value, lower=one.kind.lower,
            upper=one.kind.upper, elements=_spans(structure.users(row[one.ref]), numbers),
        )  # fmt: skip


_MOST_SPANS = 400
"""Spans of the elements of a field: the results must stay small."""


def _spans(some: NDArray[np.int64], numbers: NDArray[np.int64]) -> tuple[tuple[int, int], ...]:
    """First and last of neighbours among all numbers, both ascending; () where these would be very many."""
    known = some[np.isin(some, numbers)]
    at = np.searchsorted(numbers, known)
    ends = np.flatnonzero(np.diff(at) != 1)
    if not len(known) or len(ends) >= _MOST_SPANS:
        return ()
    firsts, lasts = known[np.append(0, ends + 1)], known[np.append(ends, len(known) - 1)]
    return tuple((int(a), int(b)) for a, b in zip(firsts, lasts))


def _beside_deck(comparison: ModesBeside) -> BesideDeck:
    modes = tuple(
        ModeBesideDeck(
            number=i + 1,
            freq_hz=float(comparison.freq_hz[i]),
            deck_hz=float(comparison.deck_hz[i]),
            difference_percent=100.0 * float(comparison.difference[i]) if comparison.elastic[i] else None,
            mac=None if comparison.mac is None else float(comparison.mac[i]),
            alike=bool(comparison.paired[i]),
        )
        for i in range(len(comparison.freq_hz))
    )
    return BesideDeck(configuration=comparison.configuration, derivatives=comparison.derivatives, modes=modes)


def shapes_remark(built: BuiltModel) -> tuple[Notice, ...]:
    """That elements are out of shape, in one sentence; none where all are within the limits."""
    shapes = _element_shapes(built)
    if not any(t.beyond for t in shapes.tests):
        return ()
    return (Notice("", f"shapes of elements: {shapes.sentence}; femtune info lists them", level="info"),)


def _element_shapes(built: BuiltModel) -> ElementShapes:
    asked = geometry_checks(built.executive_lines)
    if asked.off:
        return ElementShapes(elements=0, tests=(), ignored=asked.unknown, sentence="not tested: GEOMCHECK NONE")
    tests = tuple(map(_shape_test, element_shapes(built.structure, asked.limits)))
    # every element has one test at most that all elements of its shape have
    elements = sum(
        t.tested for t in tests if t.test in ("Q4_SKEW", "T3_SKEW", "BAR_OFF", "BEAM_OFF") or "DETJ" in t.test
    )
    count = f"{elements} element{'' if elements == 1 else 's'}"
    failed = [t.test for t in tests if t.beyond]
    sentence = f"of {count}, some are beyond the limits of {', '.join(failed)}" if failed else (
        f"{count}, all within the limits" if elements else "no shells, solids, bars or beams"
    )  # fmt: skip
    given = tuple(t.test for t in tests if t.test in asked.limits)
    return ElementShapes(elements=elements, tests=tests, given=given, ignored=asked.unknown, sentence=sentence)


def _shape_test(outcome: ShapeFound) -> ElementShapeTest:
    test = outcome.test
    degenerate = outcome.beyond > 0 and test.key.endswith("_DETJ") and outcome.extreme <= 0.0
    return ElementShapeTest(
        test=test.key, meaning=test.meaning, unit=test.unit, limit=outcome.limit, least=test.least,
        tested=outcome.tested, beyond=outcome.beyond, extreme=outcome.extreme, degenerate=degenerate,
        worst=tuple(
            OutOfShape(card=card, element=number, value=value)
            for card, number, value in zip(outcome.cards, outcome.ids, outcome.values)
        ),
    )  # fmt: skip


def alert_of(notice: Notice) -> Alert:
    """A notice as a record."""
    level: Level = "info" if notice.level == "info" else "warning"
    return Alert(level=level, code=notice.code, sentence=notice.what, where=str(notice.where or ""))


def _deck_parameters(study: Study) -> Iterable[DeckParameterRecord]:
    for name, given in study.built.params.items():
        known = name in UNDERSTOOD_PARAMS
        remark = "" if known else "not needed for normal modes, or not supported"
        yield DeckParameterRecord(name=name, value=given.value, understood=known, remark=remark)


def _configuration(study: Study, case: StudyCase) -> ModelConfiguration:
    structure, configuration = study.model.structure, case.configured.configuration
    mass = mass_properties(structure.nodes, grid_matrix(study.model, configuration, "mass"))
    weighed = configuration.weighed_mass
    placed = structure.nodes.has_coordinates and study.source.has_structure
    return ModelConfiguration(
        configuration=configuration.name,
        grids=len(structure.nodes.ids) + len(structure.nodes.scalar_points),
        free_dofs=case.configured.n_free,
        supports=tuple(_supports(study, configuration)),
        constraints=tuple(_constraints(study, configuration)),
        held_dofs=tuple(
            HeldDof(dof=str(d), reason=_NO_STIFFNESS if case.configured.model.structure.hold_singular else _NEITHER)
            for d in case.configured.held_singular
        ),
        mass=mass.mass if study.source.has_structure else None,
        centre_of_gravity=_vector(mass.centre) if placed else None,
        inertia=_matrix(mass.central_inertia) if placed else None,
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
    permanent = held & set(structure.permanent.tolist())
    of_set = (held & set(structure.support_sets[chosen].tolist())) - permanent if chosen is not None else set()
    counts = {
        "grid points themselves (PS)": permanent,
        f"SPC set {chosen}": of_set,
        "configuration": held - permanent - of_set,
    }
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
    if not study.source.has_structure:
        return _not_checked("runs of another solver have no stiffness of the structure")
    if not structure.nodes.has_coordinates:
        return _not_checked("the grid points of the model have no coordinates")
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


def _not_checked(sentence: str) -> RigidBodyCheck:
    """Rigid-body motions are not known, for instance without coordinates."""
    none = (0.0,) * 6
    return RigidBodyCheck(
        strain_energies=none, relative_energies=none, grounded=False, verdict="not tested", sentence=sentence,
        worst_dofs=(), grounding_elements=(),
    )  # fmt: skip


def _supports_inside(checks: tuple[RigidMotionCheck, ...]) -> RigidBodyCheck:
    """Matrices from which constrained degrees of freedom were removed are constrained to ground in an unknown way."""
    return RigidBodyCheck(
        strain_energies=tuple(c.energy for c in checks),
        relative_energies=tuple(c.relative_energy for c in checks),
        grounded=True,
        verdict="not tested",
        sentence="the matrices constrain rigid-body motion; this is so if constrained degrees of freedom were removed",
        worst_dofs=_worst(checks),
    )


def _ending_on_ground(structure: Structure) -> set[int]:
    """Elements with an end on the ground, as springs and bushes may have."""
    return {int(i) for b in structure.batches for i in b.ids[(b.dofs < 0).any(axis=1)]}


def _meant_sentence(elements: tuple[GroundingElementRecord, ...]) -> str:
    names = list(dict.fromkeys(f"{e.card} {e.element}" for e in elements))
    shown = ", ".join(names[:6]) + (f" … ({len(names)} in all)" if len(names) > 6 else "")
    return f"without supports, rigid-body motion strains only elements that are connected to ground: {shown}"


def _grounding(
    structure: Structure, configuration: Configuration, about: NDArray
) -> tuple[GroundingElementRecord, ...]:
    elements = (e for e in grounding_elements(structure, about) if e.id not in configuration.elements_off)
    return tuple(
        GroundingElementRecord(card=e.card, element=e.id, motion=e.motion, relative_energy=e.relative_energy)
        for e in elements
    )


def _rigid_sentence(checks: tuple[RigidMotionCheck, ...], tied: int) -> str:
    bad = [c.motion for c in checks if not c.passed]
    parts = []
    if bad:
        parts.append(
            f"without supports, rigid-body motion {', '.join(bad)} strains the model; it is constrained to ground"
        )
    if tied:
        parts.append(f"{_equations(tied)} prevent rigid-body motion")
    return "; ".join(parts) or "without supports, all six rigid-body motions are free of strain"


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


_OFF = "the study switches it off (sensors_off)"
"""Reason for which a sensor is not compared."""


def sensor_results(study: Study, case: StudyCase) -> SensorResults | None:
    """How the sensors of a configuration found the model; None without a test."""
    if case.sensors is None or case.entry.test is None:
        return None
    by_id, nodes = study.file.sensors.by_id, case.configured.model.structure.nodes
    places = {s.label.node: s.position for s in (case.test.sensors if case.test is not None else ())}
    return SensorResults(
        configuration=case.configured.configuration.name,
        test_file=", ".join(test_files(case.entry)),
        tolerance=None if by_id else sensor_tolerance(study.file, study.built.structure),
        matched=tuple(
            MatchedSensor(
                test_dof=str(m.label),
                test_node=m.label.node,
                model_node=m.node,
                distance=float(m.distance) if np.isfinite(m.distance) else None,
                how=m.how,
                place=_place(places.get(m.label.node)),
                grid_place=_place(nodes.xyz[nodes.position(m.node)])
                if m.node is not None and nodes.has_coordinates and nodes.has_grid(m.node)
                else None,
            )
            for m in case.sensors.matches
        ),
        unmatched=tuple(UnmatchedSensor(test_dof=label, reason=_OFF) for label in case.entry.sensors_off),
        exciters=_exciters(case),
    )


def _exciters(case: StudyCase) -> tuple[ExciterRecord, ...]:
    test = case.test
    if test is None or test.frfs is None:
        return ()
    known = {s.label.node: s.position for s in sensors_at(test.geometry, test.frfs.references)}
    return tuple(ExciterRecord(test_dof=str(dof), place=_place(known.get(dof.node))) for dof in test.frfs.references)


def _place(point: Reals | None) -> tuple[float, float, float] | None:
    if point is None or not np.isfinite(point).all():
        return None
    return float(point[0]), float(point[1]), float(point[2])


_OF_THE_COUNT = ("eigen.none-below", "eigen.many-modes", "eigen.whole-group")
"""Notices on the number of modes that were solved."""


def model_modes(name: str, version: ModelVersion, solution: EigenSolution) -> ModelModes:
    """The wanted modes of a solution with the proof that none is missing."""
    freq = solution.freq_hz
    counted = solution.sturm_count >= 0
    below = int((solution.eigenvalues < solution.sturm_shift).sum())
    shift_hz = float(np.sqrt(max(solution.sturm_shift, 0.0)) / (2.0 * np.pi))
    untested = _AT_OWN_FREQUENCY if solution.point.depends_on_frequency else _NOT_TESTED
    effect = _test_masses(solution)
    sentence = f"the Sturm count is {solution.sturm_count} eigenvalues below {shift_hz:.6g} Hz; {below} were found"
    return ModelModes(
        configuration=name,
        stage=version,
        freq_hz=tuple(float(f) for f in freq),
        rigid_body_modes=_rigid_body_modes(solution),
        sturm_shift_hz=shift_hz if counted else None,
        sturm_count=solution.sturm_count if counted else None,
        modes_below_shift=below if counted else None,
        sturm_sentence="; ".join([sentence if counted else untested, *_by_whom(solution)]),
        effective_masses=_effective_masses(solution),
        solver=solution.method,
        test_masses=effect,
        alerts=(
            *(alert_of(n) for n in solution.notices if n.code in _OF_THE_COUNT),
            *_of_preload(name, solution),
            *_of_slow_modes(solution),
            *_of_held_masses(name, solution),
            *_of_held_without_autospc(name, solution),
            *_of_drilling(name, solution),
            *of_neutral_axis(name, solution),
            *_of_test_masses(name, effect),
        ),
    )


def _of_held_masses(name: str, solution: EigenSolution) -> Iterable[Alert]:
    """Masses at grid points without stiffness: AUTOSPC constrains them, so that they do not contribute to any mode."""
    configured = solution.point.configured
    held = [d for d in configured.held_singular if 1 <= d.component <= 3]
    if not held:
        return
    nodes = configured.model.structure.nodes
    mass = grid_matrix(configured.model, configured.configuration, "mass").diagonal()
    heavy = [str(d)[:-1] for d in held if mass[nodes.dof(d.node, d.component)] > 0.0]
    if heavy:
        shown = ", ".join(heavy[:6]) + (" …" if len(heavy) > 6 else "")
        yield alert("warning", "model.held-mass", configuration=name, grids=shown)


def _of_held_without_autospc(name: str, solution: EigenSolution) -> Iterable[Alert]:
    """DOFs that are constrained although AUTOSPC is off: they would make the eigenproblem singular."""
    configured = solution.point.configured
    held = [str(d)[:-1] for d in configured.held_singular]
    if held and not configured.model.structure.hold_singular:
        shown = ", ".join(held[:6]) + (" …" if len(held) > 6 else "")
        yield alert("info", "model.held-without-autospc", configuration=name, dofs=shown)


def _of_preload(name: str, solution: EigenSolution) -> Iterable[Alert]:
    """That the modes are those of the loaded structure."""
    preload = solution.point.configured.model.structure.preload
    if preload is not None:
        yield alert("info", "model.preload", configuration=name, request=preload.request)


def _of_slow_modes(solution: EigenSolution) -> Iterable[Alert]:
    """That the lowest elastic mode is that of no structure, as with coordinates and sections in different units."""
    elastic = solution.freq_hz[_rigid_body_modes(solution) :]
    return () if not len(elastic) else map(alert_of, slow_modes(solution.point.configured.model.structure, elastic[0]))


def _test_masses(solution: EigenSolution) -> TestMassEffect | None:
    masses = [m for m in solution.point.configured.configuration.masses if m.of_test]
    if not masses:
        return None
    effect, hz = effect_of_masses(solution, masses), solution.freq_hz
    modes = []
    for j in range(_rigid_body_modes(solution), solution.wanted):
        largest = int(np.argmax(effect.shares[:, j]))
        modes.append(
            TestMassMode(
                number=j + 1,
                share_percent=100.0 * float(effect.shares[:, j].sum()),
                shift_percent=100.0 * float(hz[j] / effect.freq_hz[j] - 1.0),
                node=masses[largest].node,
                label=masses[largest].label,
                largest_percent=100.0 * float(effect.shares[largest, j]),
            )
        )
    without = effect.freq_hz[_rigid_body_modes(solution) :]
    first = _rigid_body_modes(solution) + 1
    pairs = [(i, j) for j in range(len(without)) for i in range(j) if without[i] > without[j]]
    return TestMassEffect(
        count=len(masses),
        mass=(total := float(sum(m.mass for m in masses))),
        ratio=_relative_mass(solution, total),
        modes=tuple(modes),
        exchanged=tuple((first + i, first + j) for i, j in pairs),
    )


def _relative_mass(solution: EigenSolution, added: float) -> float | None:
    """Added masses relative to the mass of the structure without them, by its translations."""
    structure = float(effective_mass(solution).total[:3].max()) - added
    return added / structure if structure > 1e-12 * added else None


def _of_test_masses(name: str, effect: TestMassEffect | None) -> Iterable[Alert]:
    """What the test equipment does to the frequencies, and whether it exchanges modes."""
    if effect is None:
        return
    if effect.ratio is not None and effect.ratio > _LARGE_MASS_RATIO:
        yield alert("warning", "model.test-masses/heavy", configuration=name, ratio=effect.ratio)
    if not effect.modes:
        return
    worst = max(effect.modes, key=lambda m: -m.shift_percent)
    facts = {"configuration": name, "count": effect.count, "shift": worst.shift_percent, "mode": worst.number}
    yield alert("info", "model.test-masses", **facts, node=worst.node)
    if effect.exchanged:
        modes = ", ".join(f"{i} and {j}" for i, j in effect.exchanged[:_MOST_DRILLING])
        yield alert("warning", "model.test-masses/exchanged", configuration=name, modes=modes)


_LARGE_MASS_RATIO = 0.3
"""Mass of the test equipment relative to that of the structure, from which a mistake of units is suspected.

Equipment of this mass would change the modes so much that nobody would use it.
"""


_MOST_DRILLING = 6
"""Modes that a notice lists, so that it stays one sentence."""


_MOST_GRIDS = 8
"""Grid points that a notice lists, so that it stays one sentence."""


def _of_drilling(name: str, solution: EigenSolution) -> Iterable[Alert]:
    """That K6ROT, a number without physical meaning, determines some of the modes."""
    drilling = list(drilling_modes(solution))
    if not drilling:
        return
    shown = [f"mode {m.number} ({m.freq_hz:.5g} Hz, {100.0 * m.share:.0f} %)" for m in drilling[:_MOST_DRILLING]]
    more = f" and {len(drilling) - _MOST_DRILLING} more" if len(drilling) > _MOST_DRILLING else ""
    grids = list(dict.fromkeys(grid for m in drilling for grid in m.grids))
    places = ", ".join(map(str, grids[:_MOST_GRIDS])) + (" …" if len(grids) > _MOST_GRIDS else "")
    facts = {"configuration": name, "modes": ", ".join(shown) + more, "grids": places}
    yield alert("warning", "model.drilling", **facts)


def _effective_masses(solution: EigenSolution) -> EffectiveMasses:
    masses = effective_mass(solution)
    # rotations about an unknown centre
    known = 6 if solution.point.configured.model.structure.nodes.has_coordinates else 3
    total = np.where(np.arange(6) < known, masses.total, 0.0)
    fractions = [
        [float(f) if i < known and not np.isnan(f) else None for i, f in enumerate(r)] for r in masses.fractions
    ]
    return EffectiveMasses(total=tuple(map(float, total)), fractions=tuple(map(tuple, fractions)))


def _by_whom(solution: EigenSolution) -> list[str]:
    """That another eigen-solver than the chosen one found the modes."""
    return [n.what for n in solution.notices if n.code == "slepc.not-used"]


def _rigid_body_modes(solution: EigenSolution) -> int:
    """Number of wanted modes, from the lowest, that strain nothing."""
    return int(np.cumprod(is_rigid(solution)[: solution.wanted]).sum())
