"""Data of the interactive page: geometry, shapes, functions and iterations, in compact form.

The document is plain data: numbers, texts, and arrays packed as base64 of little-endian values. Coordinates and motions
are stored with 16 bits, to 1/65534 of their range. To keep the page small, a large mesh is drawn with fewer faces and
the least important modes are left out; a sentence says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from femtune.document.figures.shapes import closed, outline
from femtune.document.numbers import percent
from femtune.document.page_view import (
    FUNCTION_BYTES,
    CurveView,
    FunctionsView,
    HistoryView,
    IterationFunctionsView,
    IterationModeView,
    LiveShapesView,
    Packed,
    PageView,
    PairView,
    SceneView,
    StageView,
    as_stored,
    coarse,
    coordinates,
    curve_view,
    phases,
    quantised,
    single,
    whole,
)
from femtune.steps.correlate.page.correlation import pair_places, shown_columns
from femtune.steps.live.page import live_view
from femtune.steps.modes.page.mode_shapes import measured_places, structure_of
from femtune.steps.report.choices_view import choices_view
from femtune.steps.report_source import VERSION_HEADS
from femtune.steps.respond.page import ordered_pairs
from femtune.study.drawn_mesh import DrawnMesh, thinned

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.document.figures.shapes import Wireframe
    from femtune.steps.correlate.record.correlation import CorrelationResults, ModePairRecord
    from femtune.steps.equalise.record import MappedDamping
    from femtune.steps.modes.record import ModeShapes
    from femtune.steps.report_source import ReportSource
    from femtune.steps.respond.record import FrfResults, ResponseResults
    from femtune.steps.update.record.iterations import IterationFrfs
    from femtune.steps.update.record.update import IterationRecord


MOTION_BYTES = 2_800_000
"""Bytes of all motions of the model; base64 makes them a third larger. The page must stay small enough to be sent."""
ITERATION_BYTES = 800_000
"""Bytes of the functions at all iterations: the page must stay small enough to be sent."""
_LEAST_FACES = 6_000
"""Faces that a picture keeps however many modes there are.

With fewer the form of a structure is lost, and modes are left out instead.
"""
_BYTES_PER_POINT = 7
"""Bytes of a point in a mode: three components of its motion with two bytes each, and its strain energy with one."""
_MOST_FACES_WITH_EDGES = 3_000
"""Faces up to which all edges are drawn.

Edges of finer meshes would cover the faces, so that only those that show the form are drawn.
"""


def view_of(source: ReportSource) -> PageView:
    """The view of results: shapes of the solved modes, frequency responses, history of the update."""
    kept = [*_real_modes(source), *_complex_modes(source)]
    names = list(dict.fromkeys(m.shapes.configuration for m in kept))
    share = MOTION_BYTES // max(1, len(names))
    scenes = (_scene(source, [m for m in kept if m.shapes.configuration == name], share) for name in names)
    return PageView(
        tuple(s for s in scenes if s),
        tuple(_functions(source)),
        _history(source),
        live=live_view(source),
        choices=choices_view(source),
    )


@dataclass(frozen=True)
class _Modes:
    """The modes of one model version, and how they are called.

    `columns` has the real mode that each of these is, from 0; of complex modes the one that is most alike.
    """

    shapes: ModeShapes
    title: str
    freq_hz: tuple[float, ...]
    columns: tuple[int, ...]
    damping_ratio: tuple[float | None, ...] = ()

    @property
    def is_complex(self) -> bool:
        return bool(self.damping_ratio)


def _real_modes(source: ReportSource) -> Iterable[_Modes]:
    for kept in source.results.mode_shapes:
        if not kept.reason:
            freq_hz = _frequencies(source, kept)
            yield _Modes(kept, VERSION_HEADS[kept.stage], freq_hz, tuple(range(_mode_count(source, kept))))


def _complex_modes(source: ReportSource) -> Iterable[_Modes]:
    for response in source.results.responses:
        kept = response.pole_shapes
        if kept is not None and not kept.reason:
            poles = response.poles
            columns = tuple(p.real_mode - 1 if p.kind == "oscillating" else -1 for p in poles)
            title = f"{VERSION_HEADS[kept.stage]}, complex modes"
            freq_hz = tuple(p.freq_hz for p in poles)
            yield _Modes(kept, title, freq_hz, columns, tuple(p.damping_ratio for p in poles))


@dataclass(frozen=True)
class _Geometry:
    """The mesh that is drawn; `rows` of the points of the results."""

    frame: Wireframe
    mesh: DrawnMesh
    rows: NDArray[np.int64]

    @property
    def lines(self) -> NDArray[np.int64]:
        """The line of the results that each line of elements is: where it was moved, the one nearest to it."""
        ends, of = self.rows[self.mesh.lines[self.mesh.kinds == 0]], self.frame
        numbers = DrawnMesh(of.lines, of.rigid.astype(np.int64), of.faces).line_of(ends)
        moved, elements = np.flatnonzero(numbers < 0), np.flatnonzero(~of.rigid)
        if len(moved):
            middles = cKDTree(of.points[of.lines[elements]].mean(axis=1))
            numbers[moved] = elements[middles.query(of.points[ends[moved]].mean(axis=1))[1]]
        return numbers

    @property
    def face_rows(self) -> NDArray[np.int64]:
        """The face of the results that each face is; where the mesh was thinned, the one with the nearest middle."""
        ends, of = np.where(self.mesh.faces < 0, -1, self.rows[self.mesh.faces]), self.frame
        if np.array_equal(ends, of.faces):
            return np.arange(len(ends))
        middles = cKDTree(of.points[closed(of.faces)].mean(axis=1))
        return np.asarray(middles.query(of.points[closed(ends)].mean(axis=1))[1])


def _scene(source: ReportSource, kept: Sequence[_Modes], share: int) -> SceneView | None:
    shapes = [m.shapes for m in kept]
    frame = structure_of(source, shapes[0])
    if frame is None or not len(frame.points):
        return None
    geometry = _geometry(frame, share, sum(_mode_count(source, m) for m in shapes))
    room = max(1, share // (_BYTES_PER_POINT * len(geometry.rows) * len(kept)))
    # the test is stored with real modes
    measured = next((m for m in reversed(shapes) if m.test_shapes_key), shapes[-1])
    stages = [_stage(source, m, measured, geometry, room) for m in kept]
    test = _test(source, measured, frame)
    points, mesh = frame.points[geometry.rows], geometry.mesh
    return SceneView(
        configuration=shapes[0].configuration,
        note=" ".join(filter(None, (_sentence(shapes[0].simplified or mesh.sentence), _fewer(source, kept, stages)))),
        points=coordinates(points),
        point_numbers=_numbers(source.array(shapes[0].point_numbers_key), geometry.rows),
        faces=whole(closed(mesh.faces)),
        edges=whole(_edges(mesh.faces, points)),
        lines=whole(mesh.lines[mesh.kinds == 0]),
        rigid=whole(mesh.lines[mesh.kinds != 0]),
        stages=tuple(stages),
        live=_live_shapes(source, shapes[-1].configuration, geometry, len(frame.points)),
        **_structure_parts(source, shapes[0], geometry),
        **test,
    )


def _numbers(numbers: NDArray[Any] | None, rows: NDArray[np.int64]) -> Packed | None:
    return None if numbers is None else whole(numbers[rows])


def _structure_parts(source: ReportSource, kept: ModeShapes, geometry: _Geometry) -> dict[str, Any]:
    """Parts of lines and faces: the elements that have the same fields; {} where elements or fields are not known."""
    of_lines, of_faces = source.array(kept.line_elements_key), source.array(kept.face_elements_key)
    fields = [f for f in (source.results.model.fields if source.results.model else ()) if f.elements]
    if of_lines is None or of_faces is None or not fields:
        return {}
    lines, faces = of_lines[geometry.lines], of_faces[geometry.face_rows]
    numbers, which = np.unique(np.concatenate([lines, faces]), return_inverse=True)
    has = np.array([_within(numbers, np.array(f.elements)) for f in fields])
    parts, part = np.unique(has.T, axis=0, return_inverse=True)
    of = part.ravel()[which.ravel()]
    return {
        "line_parts": whole(of[: len(lines)]), "face_parts": whole(of[len(lines) :]),
        "part_fields": tuple(tuple(f.field for f, there in zip(fields, one) if there) for one in parts),
    }  # fmt: skip


def _within(numbers: NDArray[np.int64], spans: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which numbers are in one of some spans (s, 2) in ascending order."""
    at = np.searchsorted(spans[:, 0], numbers, side="right") - 1
    return np.asarray((at >= 0) & (numbers <= spans[at, 1]))


def _live_shapes(source: ReportSource, name: str, geometry: _Geometry, points: int) -> LiveShapesView | None:
    """What the live model draws its shapes with, at the points of the scene."""
    found = source.results.live
    one = next((c for c in found.configurations if c.configuration == name), None) if found else None
    vectors, weights = (None, None) if one is None else map(source.array, (one.drawing_key, one.drawing_weights_key))
    if vectors is None or weights is None or len(vectors) != points:
        return None
    return LiveShapesView(as_stored(vectors[geometry.rows]), as_stored(weights))


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _fewer(source: ReportSource, kept: Sequence[_Modes], stages: Sequence[StageView]) -> str:
    left = max(_mode_count(source, m.shapes) - len(s.stored) for m, s in zip(kept, stages))
    return f"Shapes of {left} of the modes are not stored, to keep the page small." if left > 0 else ""


def _mode_count(source: ReportSource, kept: ModeShapes) -> int:
    motion = source.array(kept.translations_key)
    return 0 if motion is None else motion.shape[2]


def _geometry(frame: Wireframe, share: int, modes: int) -> _Geometry:
    """With so few faces that all modes have room, but not with fewer than a picture needs."""
    mesh = DrawnMesh(frame.lines, frame.rigid.astype(np.int64), frame.faces)
    # points are about as many as faces
    mesh = thinned(frame.points, mesh, most_faces=max(_LEAST_FACES, share // (_BYTES_PER_POINT * max(modes, 1))))
    rows = mesh.used
    return _Geometry(frame, mesh.counted_from(rows), rows)


def _edges(faces: NDArray[np.int64], points: Reals) -> NDArray[np.int64]:
    if len(faces) > _MOST_FACES_WITH_EDGES:
        return outline(faces, points)
    corners = closed(faces)
    sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    return np.unique(sides[sides[:, 0] != sides[:, 1]], axis=0)


def _stage(source: ReportSource, modes: _Modes, measured: ModeShapes, geometry: _Geometry, room: int) -> StageView:
    kept = modes.shapes
    comparison = source.at(kept.configuration, kept.stage)
    motion = source.array(kept.translations_key)
    energy, of_lines = source.array(kept.energy_key), source.array(kept.line_energy_key)
    assert motion is not None
    count = motion.shape[2]
    columns = _wanted(comparison, modes.columns[:count], room)
    stored = np.ascontiguousarray(motion[np.ix_(geometry.rows, np.arange(3), np.array(columns))])
    turn = phases(stored.reshape(-1, len(columns)))
    plain = StageView(
        title=modes.title,
        numbers=tuple(range(1, count + 1)),
        freq_hz=modes.freq_hz[:count],
        stored=tuple(columns),
        motion=quantised((stored * turn).real),
        energy=None if energy is None else coarse(energy[np.ix_(geometry.rows, np.array(columns))]),
        line_energy=None if of_lines is None else coarse(of_lines[np.ix_(geometry.lines, np.array(columns))]),
        damping_ratio=modes.damping_ratio[:count],
        motion_imaginary=quantised((stored * turn).imag) if modes.is_complex else None,
    )
    if comparison is None:
        return plain
    turned = np.ones(count, complex)
    turned[columns] = turn
    return _compared(source, modes, measured, comparison, geometry, plain, turned)


def _frequencies(source: ReportSource, kept: ModeShapes) -> tuple[float, ...]:
    of = (m for m in source.results.modes if (m.configuration, m.stage) == (kept.configuration, kept.stage))
    modes = next(of, None)
    comparison = source.at(kept.configuration, kept.stage)
    return modes.freq_hz if modes else comparison.mac_model_freq_hz if comparison else ()


def _wanted(comparison: CorrelationResults | None, real: Sequence[int], room: int) -> list[int]:
    """Columns of the modes that are stored, in their order: those of pairs first, then elastic ones, then the rest."""
    paired = {n - 1 for p in comparison.pairs for n in _model_numbers(comparison, p)} if comparison else set()
    shown = set(shown_columns(comparison)) if comparison else set()
    order = sorted(range(len(real)), key=lambda j: (real[j] not in paired, real[j] not in shown, j))
    return sorted(order[:room])


def _model_numbers(comparison: CorrelationResults, pair: ModePairRecord) -> tuple[int, ...]:
    cluster = next((c for c in comparison.clusters if c.cluster == pair.cluster), None)
    return cluster.model_numbers if cluster else (pair.model_number,)


@dataclass(frozen=True)
class _Measured:
    """Shapes (sensors, test modes), those of the model at the sensors, and what makes motions of the places of them."""

    test: NDArray[Any]
    seen: NDArray[Any]
    places: Reals
    motions: Reals


def _measured(source: ReportSource, kept: ModeShapes, frame: Wireframe) -> tuple[_Measured, NDArray[np.int64]] | None:
    """The measured shapes and the place of each sensor; None without a test."""
    keys = (
        kept.sensor_positions_key, kept.sensor_directions_key, kept.sensor_rotations_key, kept.test_shapes_key,
        kept.model_at_sensors_key,
    )  # fmt: skip
    arrays = [a for a in map(source.array, keys) if a is not None]
    if len(arrays) < len(keys) or not arrays[3].size:
        return None
    seats, directions, rotations, test, seen = arrays
    places, motions, place_of = measured_places(
        frame, seats.astype(float), directions.astype(float), rotations.astype(bool)
    )
    return _Measured(np.nan_to_num(test), seen.astype(float), places, motions), place_of


def _test(source: ReportSource, kept: ModeShapes, frame: Wireframe) -> dict[str, Any]:
    """The fields of a scene that a test fills."""
    motions, comparison = _measured(source, kept, frame), source.at(kept.configuration, kept.stage)
    if motions is None or comparison is None:
        return {}
    measured, place_of = motions
    moved = np.einsum("pcs,sm->pcm", measured.motions, measured.test)
    return {
        "places": single(measured.places),
        "place_numbers": _place_numbers(source.array(kept.sensor_nodes_key), place_of, len(measured.places)),
        "wire": whole(_wire(source.array(kept.wire_key), place_of, measured.places, frame)),
        "test": quantised(moved.real),
        "test_imaginary": quantised(moved.imag) if np.iscomplexobj(moved) else None,
        "test_labels": comparison.mac_test_labels,
        "test_freq_hz": comparison.mac_test_freq_hz,
        **_slopes(source, comparison),
    }


def _place_numbers(nodes: NDArray[Any] | None, place_of: NDArray[np.int64], count: int) -> Packed | None:
    if nodes is None:
        return None
    numbers, known = np.zeros(count, np.int64), place_of >= 0
    numbers[place_of[known]] = nodes[known]
    return whole(numbers)


def _slopes(source: ReportSource, comparison: CorrelationResults) -> dict[str, Any]:
    selection = source.results.selection
    if selection is None:
        return {}
    sensitivities = (s for s in selection.sensitivities if s.configuration == comparison.configuration)
    percent_of = {s.test_label: s.percent_per_percent for s in sensitivities}
    slopes = tuple(percent_of.get(label, ()) for label in comparison.mac_test_labels)
    return {"parameters": selection.column_labels, "slopes": slopes}


def _wire(wire: NDArray[Any] | None, place_of: NDArray[np.int64], places: Reals, frame: Wireframe) -> NDArray[np.int64]:
    """The wire frame by places; where the test has none, the lines of the model from place to place."""
    if not len(places):
        return np.zeros((0, 2), np.int64)
    if wire is not None and len(wire):
        lines = place_of[wire].reshape(-1, 2)
    else:
        # a place that is not found has the number after the last
        near = cKDTree(places).query(frame.points, distance_upper_bound=1e-6 * _diagonal(frame.points))[1]
        at = np.where(near == len(places), -1, near)
        lines = at[frame.lines[~frame.rigid]].reshape(-1, 2)
    return lines[(lines >= 0).all(axis=1) & (lines[:, 0] != lines[:, 1])]


def _diagonal(points: Reals) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0


def _compared(
    source: ReportSource,
    modes: _Modes,
    of_test: ModeShapes,
    comparison: CorrelationResults,
    geometry: _Geometry,
    plain: StageView,
    turned: NDArray[Any],
) -> StageView:
    """The stage with what the comparison with a test adds; `turned` are the phases that the modes are shown with."""
    motions, mac = _measured(source, of_test, geometry.frame), source.array(comparison.mac_key)
    seen = source.array(modes.shapes.model_at_sensors_key)
    if motions is None or mac is None or seen is None:
        return plain
    measured, _ = motions
    if modes.is_complex:
        measured = replace(measured, seen=seen * turned)
        mac = _mac(measured.test, measured.seen)
        pairs = list(_complex_pairs(comparison, modes, measured))
    else:
        measured = replace(measured, seen=seen.astype(float))
        pairs = [_pair(comparison, measured, p, place) for p, place in _placed_pairs(comparison)]
    moved = np.einsum("pcs,sm->pcm", measured.motions, measured.seen)
    return replace(
        plain,
        mac=single(np.nan_to_num(mac, nan=-1.0)),
        seen=quantised(moved.real),
        seen_imaginary=quantised(moved.imag) if modes.is_complex else None,
        factors=single(_parts(_factors(measured.test, measured.seen))),
        expanded=None if modes.is_complex else _expanded(source, comparison, geometry),
        pairs=tuple(p for p in pairs if set(p.modes) <= {n + 1 for n in plain.stored}),
    )


def _complex_pairs(comparison: CorrelationResults, modes: _Modes, measured: _Measured) -> Iterable[PairView]:
    """The pairs of the real modes, each with the complex mode that is most like its real one."""
    for pair, (row, _) in _placed_pairs(comparison):
        if pair.model_number - 1 in modes.columns:
            column = modes.columns.index(pair.model_number - 1)
            factor = complex(_factors(measured.test[:, [row]], measured.seen[:, [column]])[0, 0])
            yield PairView(row, column, (column + 1,), (1.0,), (factor.real, factor.imag))


def _placed_pairs(comparison: CorrelationResults) -> Iterable[tuple[ModePairRecord, tuple[int, int]]]:
    rows, columns = comparison.mac_test_labels, comparison.mac_model_numbers
    placed = [p for p in comparison.pairs if p.test_label in rows and p.model_number in columns]
    return zip(placed, pair_places(comparison), strict=True)


def _pair(
    comparison: CorrelationResults, measured: _Measured, pair: ModePairRecord, place: tuple[int, int]
) -> PairView:
    """Modes of a cluster are shown in the combination that is nearest to the test's shape."""
    numbers = _model_numbers(comparison, pair)
    test = in_phase(measured.test[:, place[0]])
    seen = measured.seen[:, [n - 1 for n in numbers]]
    weights = np.linalg.lstsq(seen, test, rcond=None)[0] if len(numbers) > 1 else np.ones(1)
    factor = complex(_factors(measured.test[:, [place[0]]], (seen @ weights)[:, None])[0, 0])
    return PairView(*place, numbers, tuple(map(float, weights)), (factor.real, factor.imag))


def in_phase(shape: NDArray[Any]) -> Reals:
    """The real part of a shape, turned in phase so that it is as large as it can be."""
    return np.asarray((shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))).real) if np.iscomplexobj(shape) else shape


def _mac(test: NDArray[Any], seen: NDArray[Any]) -> Reals:
    """(test modes, modes) modal assurance criterion |tᴴm|²/(tᴴt · mᴴm); NaN for a shape without motion."""
    sizes = np.sum(np.abs(test) ** 2, axis=0)[:, None] * np.sum(np.abs(seen) ** 2, axis=0)
    return np.abs(test.conj().T @ seen) ** 2 / np.where(sizes > 0.0, sizes, np.nan)


def _factors(test: NDArray[Any], seen: NDArray[Any]) -> NDArray[Any]:
    """(test modes, modes) modal scale factors tᴴm/tᴴt; 0 for a shape without motion."""
    size = np.sum(np.abs(test) ** 2, axis=0)
    return np.asarray(test.conj().T @ seen / np.where(size > 0.0, size, 1.0)[:, None])


def _parts(values: NDArray[Any]) -> Reals:
    return np.stack([values.real, values.imag], axis=-1)


def _expanded(source: ReportSource, comparison: CorrelationResults, geometry: _Geometry) -> Packed | None:
    """The expanded shapes at the points that are drawn, columns as the rows of the MAC matrix; 0 where not expanded."""
    record = comparison.expansion
    if record is None:
        return None
    shapes, drawn = source.array(record.shapes_key), source.array(record.drawn_key)
    if shapes is None or drawn is None:
        return None
    out = np.zeros((len(geometry.rows), 3, len(comparison.mac_test_labels)))
    for j, mode in enumerate(record.modes):
        if mode.test_label in comparison.mac_test_labels:
            moved = shapes[drawn[geometry.rows], :3, j]
            out[:, :, comparison.mac_test_labels.index(mode.test_label)] = in_phase(np.nan_to_num(moved))
    return quantised(out)


@dataclass(frozen=True)
class _Curves:
    """Functions of one look: values (outputs, inputs, lines), NaN where there are none."""

    look: str
    freq_hz: Reals
    values: NDArray[Any]
    phase: bool = True

    def of(self, outputs: NDArray[Any], inputs: NDArray[Any]) -> CurveView:
        """Those of these places, one after another."""
        return curve_view(self.look, self.freq_hz, self.values[outputs, inputs], self.phase)


def _bytes(curves: Iterable[_Curves]) -> int:
    """Of one function."""
    return 8 * sum(len(c.freq_hz) for c in curves)


def _functions(source: ReportSource) -> Iterable[FunctionsView]:
    responses = [r for r in source.results.responses if r.frfs is not None]
    names, damped = list(dict.fromkeys(r.configuration for r in responses)), source.results.mapped_damping
    share = FUNCTION_BYTES // max(1, len(names) + len(damped))
    for name in names:
        yield _functions_of(source, [r for r in responses if r.configuration == name], share)
    for one in damped:
        yield _with_measured_damping(source, one, share)


def _functions_of(source: ReportSource, responses: Sequence[ResponseResults], share: int) -> FunctionsView:
    frfs = [r.frfs for r in responses if r.frfs is not None]
    last, looks = frfs[-1], ("model",) if len(frfs) == 1 else ("before", "after")
    curves = [
        *_known(source, "test", last.test_freq_key, last.test_values_key),
        *_known(source, "identified", last.identified_freq_key, last.identified_values_key),
        *(c for look, f in zip(looks, frfs) for c in _known(source, look, f.freq_key, f.values_key)),
    ]
    order = ordered_pairs(last)
    shown = order[: max(1, share // max(_bytes(curves), 1))]
    left = len(order) - len(shown)
    # functions are counted input by input
    inputs, outputs = np.divmod(np.array(shown, int), len(last.outputs))
    return FunctionsView(
        configuration=responses[-1].configuration,
        ordinate=_ordinate(last.kind, last.unit),
        titles=tuple(_function_title(last, k) for k in shown),
        curves=tuple(c.of(outputs, inputs) for c in curves),
        note=f"{left} more functions are in the table and in arrays.npz." if left else "",
    )


def _known(
    source: ReportSource, look: str, freq_key: str | None, values_key: str | None, *, phase: bool = True
) -> Iterable[_Curves]:
    freq_hz, values = source.array(freq_key), source.array(values_key)
    if freq_hz is not None and values is not None:
        yield _Curves(look, freq_hz, values, phase)


def _with_measured_damping(source: ReportSource, mapped: MappedDamping, share: int) -> FunctionsView:
    """The test as measured, as identified and with equal damping, and the model with the measured damping."""
    keys = (("before", mapped.before_values_key), ("after", mapped.after_values_key))
    test, identified = _identified_test(source, mapped)
    equal = _equalised(source, mapped)
    curves = [
        test, identified, *(() if equal is None else (equal[0],)),
        *(c for look, key in keys for c in _known(source, look, mapped.freq_key, key)),
    ]  # fmt: skip
    size = np.nan_to_num(np.abs(test.values)).max(axis=2)
    order = np.argsort(-size, axis=None, kind="stable")[: max(1, share // max(_bytes(curves), 1))]
    outputs, inputs = np.unravel_index(order, size.shape)
    left = size.size - len(order)
    notes = (
        "The model has the measured damping of the paired modes.",
        f"Equal damping: {percent(mapped.equalised_percent)} %, as in the update." if equal is not None else "",
        f"The {len(order)} largest functions, of {size.size}." if left else "",
    )
    return FunctionsView(
        configuration=mapped.configuration,
        ordinate=_ordinate(mapped.kind, "" if equal is None else equal[1]),
        titles=tuple(f"{mapped.outputs[i]} by {mapped.inputs[j]}" for i, j in zip(outputs, inputs)),
        curves=tuple(c.of(outputs, inputs) for c in curves),
        note=" ".join(filter(None, notes)),
        section="measured_damping",
    )


def _identified_test(source: ReportSource, mapped: MappedDamping) -> tuple[_Curves, _Curves]:
    (test,) = _known(source, "test", mapped.freq_key, mapped.test_values_key)
    (identified,) = _known(source, "identified", mapped.freq_key, mapped.identified_values_key)
    return test, identified


def _equalised(source: ReportSource, mapped: MappedDamping) -> tuple[_Curves, str] | None:
    """The test with equal damping, by the rows and columns of `mapped`, and the unit; from the last comparison."""
    update = source.results.update
    for frfs in reversed(() if update is None else update.frfs):
        if frfs.configuration == mapped.configuration and _has(mapped, frfs):
            freq_hz, values = source.arrays[frfs.freq_key], source.arrays[frfs.test_values_key]
            out = np.full((len(mapped.outputs), len(mapped.inputs), len(freq_hz)), complex(np.nan, np.nan))
            out[_places(mapped, frfs.outputs, frfs.inputs)] = values
            return _Curves("equalised", freq_hz, out, frfs.phase), frfs.unit
    return None


def _has(mapped: MappedDamping, frfs: IterationFrfs) -> bool:
    return set(frfs.outputs) <= set(mapped.outputs) and set(frfs.inputs) <= set(mapped.inputs)


def _places(mapped: MappedDamping, outputs: Sequence[str], inputs: Sequence[str]) -> tuple[NDArray[Any], ...]:
    return np.ix_([mapped.outputs.index(o) for o in outputs], [mapped.inputs.index(i) for i in inputs])


def _function_title(frfs: FrfResults, k: int) -> str:
    pair = frfs.pairs[k]
    return f"{pair.output} by {pair.input}" + (" (driving point)" if pair.driving_point else "")


def _history(source: ReportSource) -> HistoryView | None:
    update = source.results.update
    if update is None or len(update.history) < 2:
        return None
    facts = {p.name: p for p in source.results.parameters}
    known = [facts.get(name) for name in update.history_parameters]
    return HistoryView(
        iterations=tuple(i.iteration for i in update.history),
        objective_percent=tuple(i.objective_percent for i in update.history),
        parameters=update.history_parameters,
        units=tuple(p.unit if p else "" for p in known),
        nominal=tuple(p.nominal if p else 0.0 for p in known),
        values=tuple(i.parameters for i in update.history),
        modes=tuple(_iteration_modes(update.history)),
        functions=tuple(_iteration_functions(source, f, ITERATION_BYTES // len(update.frfs)) for f in update.frfs),
    )


def _ordinate(kind: str, unit: str) -> str:
    return kind.capitalize() + (f", {unit}" if unit else "")


def _iteration_functions(source: ReportSource, frfs: IterationFrfs, share: int) -> IterationFunctionsView:
    """Functions, evenly spaced if there is no room for all, and every n-th line if there is no room for a whole one."""
    freq, values, test = (source.arrays[key] for key in (frfs.freq_key, frfs.values_key, frfs.test_values_key))
    iterations, _, inputs, lines = values.shape
    thin = slice(None, None, -(-8 * iterations * lines // share))
    whole_, count = values[..., thin], values.shape[1] * inputs
    beside = _beside(source, frfs)
    room = max(1, share // (8 * iterations * whole_.shape[3] + _bytes(beside)))
    shown = sorted(set(np.linspace(0, count - 1, min(room, count)).round().astype(int).tolist()))
    model = whole_.reshape(iterations, count, -1)[:, shown].transpose(1, 0, 2)
    compared = test[..., thin].reshape(count, -1)[shown]
    places = np.divmod(np.array(shown), inputs)
    left = count - len(shown)
    notes = (
        "Magnitudes alone are compared." if not frfs.phase else "",
        f"{left} more compared functions are in arrays.npz." if left else "",
        f"Every {thin.step}th line is shown." if thin.step > 1 else "",
    )
    return IterationFunctionsView(
        configuration=frfs.configuration,
        ordinate=_ordinate(frfs.kind, frfs.unit),
        titles=tuple(f"{frfs.outputs[k // inputs]} by {frfs.inputs[k % inputs]}" for k in shown),
        phase=frfs.phase,
        freq_hz=single(freq[thin]),
        real=single(model.real),
        imaginary=single(model.imag),
        test_real=single(compared.real),
        test_imaginary=single(compared.imag),
        test_look="equalised" if any(c.look == "test" for c in beside) else "test",
        beside=tuple(c.of(*places) for c in beside),
        note=" ".join(filter(None, notes)),
    )


def _beside(source: ReportSource, frfs: IterationFrfs) -> tuple[_Curves, ...]:
    """The identified test, and the test as measured where one with equal damping is compared."""
    for mapped in source.results.mapped_damping:
        if mapped.configuration == frfs.configuration and _has(mapped, frfs):
            at = _places(mapped, frfs.outputs, frfs.inputs)
            return tuple(replace(c, values=c.values[at]) for c in _identified_test(source, mapped))
    return tuple(_known(source, "identified", frfs.identified_freq_key, frfs.identified_values_key))


def _iteration_modes(history: Sequence[IterationRecord]) -> Iterable[IterationModeView]:
    names = dict.fromkeys((m.configuration, m.test_label, m.test_freq_hz) for i in history for m in i.modes)
    for configuration, label, hz in names:
        of = [next((m for m in i.modes if (m.configuration, m.test_label) == (configuration, label)), None)
              for i in history]  # fmt: skip
        yield IterationModeView(
            configuration, label, hz, tuple(None if m is None else m.freq_hz for m in of),
            tuple(None if m is None else m.mac for m in of),
        )  # fmt: skip
