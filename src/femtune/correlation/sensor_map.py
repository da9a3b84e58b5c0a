"""SensorMap: from the displacements of the model to what the sensors of a test measure."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from femtune.arrays import Reals
from femtune.correlation.generalised import GeneralisedSensor
from femtune.dofs import Dof, DofSet
from femtune.errors import ErrorCollector, FemtuneError, Notice
from femtune.fem.structure import NodeTable, Structure
from femtune.testdata import ModalTest, Sensor

# ----------------------------------------------------------------------------------------------------
# The model's node nearest to a point, and what a test's coordinates look like when none is near.


_TIE = 1e-6
"""Distances that differ by less than this fraction of the tolerance are equal."""

LENGTH_FACTORS = {
    1.0: "",
    0.001: "millimetres where the model has metres",
    1000.0: "metres where the model has millimetres",
    0.01: "centimetres where the model has metres",
    100.0: "metres where the model has centimetres",
    10.0: "centimetres where the model has millimetres",
    0.1: "millimetres where the model has centimetres",
    25.4: "inches where the model has millimetres",
    1.0 / 25.4: "millimetres where the model has inches",
    0.0254: "inches where the model has metres",
    1.0 / 0.0254: "metres where the model has inches",
    0.3048: "feet where the model has metres",
    1.0 / 0.3048: "metres where the model has feet",
    12.0: "feet where the model has inches",
    1.0 / 12.0: "inches where the model has feet",
    304.8: "feet where the model has millimetres",
    1.0 / 304.8: "millimetres where the model has feet",
    2.54: "inches where the model has centimetres",
    1.0 / 2.54: "centimetres where the model has inches",
}
"""Factors between units of length, and what they mean."""
_UNIT_TOLERANCE = 0.03
"""Error of a fitted scale of coordinates up to which a factor between units explains it. Factors of length differ from
each other by far more."""
_LEAST_PLACES = 4
"""Points from which coordinates are judged: three always fit some motion and scale."""
_LARGE_FACTOR = 9.9
"""Least factor between two units of length that extents alone can show: those of test and model differ by up to two."""
_COVERED = (0.9, 2.2)
"""Extent of the model over that of the sensors in the right unit: they cover 45 to 110 % of it."""


@dataclass(frozen=True)
class Near:
    """The node nearest to a point, its distance, and other nodes at the same distance."""

    node: int
    distance: float
    others: tuple[int, ...] = ()


class NodeSearch:
    """Nearest grid points of a model."""

    def __init__(self, nodes: NodeTable, tolerance: float) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  slow to import, and wanted where a test has sensors

        self._ids, self._xyz, self._tolerance = nodes.ids, nodes.xyz, tolerance
        self._tree = cKDTree(nodes.xyz) if len(nodes.ids) else None

    def near(self, point: Reals) -> Near:
        """Nearest node; the lowest number among equally near ones. Node 0 at infinity for a model without nodes."""
        if self._tree is None:
            return Near(0, np.inf)
        distance, _ = self._tree.query(point)
        at = self._tree.query_ball_point(point, distance + _TIE * self._tolerance)
        ids = sorted(int(self._ids[i]) for i in at)
        return Near(ids[0], float(distance), tuple(ids[1:]))

    def looks_like(self, points: Reals) -> str:
        """Which unit or order of axes would put every point on a node of its own; "" if none would."""
        return self._fitting(points)[1]

    def fitting_factor(self, points: Reals) -> tuple[float, str]:
        """The factor of the unit alone that does so, and the words; 1 and "" if none does."""
        return self._fitting(points, axes=False)

    def _fitting(self, points: Reals, axes: bool = True) -> tuple[float, str]:
        different = np.unique(points, axis=0)
        if self._tree is None or len(different) < 2:
            return 1.0, ""
        changes = axis_changes() if axes else itertools.islice(axis_changes(), 1)
        for (factor, words), (order, matrix) in itertools.product(LENGTH_FACTORS.items(), changes):
            distance, at = self._tree.query(factor * different @ matrix.T)
            if (distance <= self._tolerance).all() and len(set(at)) == len(different):
                return factor, _in_words(words, factor, order)
        return 1.0, ""


def axis_changes() -> Iterator[tuple[str, Reals]]:
    """The 48 ways to exchange and turn round axes, the identity first."""
    for order, signs in itertools.product(itertools.permutations(range(3)), itertools.product((1, -1), repeat=3)):
        matrix = np.zeros((3, 3))
        matrix[range(3), order] = signs
        yield ", ".join(f"{'-' if s < 0 else ''}{'XYZ'[i]}" for i, s in zip(order, signs)), matrix


def _in_words(words: str, factor: float, axes: str) -> str:
    parts = []
    if words:
        parts.append(f"the test's coordinates look like {words} (factor {factor:.6g})")
    if axes != "X, Y, Z":
        parts.append(f"the model's X, Y, Z look like the test's {axes}")
    return " and ".join(parts)


Row = dict[int, float]
"""Coefficients of g-set DOFs."""

_UNKNOWN = np.full(3, np.nan)
_BY_ID = "by id"
"""How sensors are assigned that have the number of their grid point."""


@dataclass(frozen=True)
class Match:
    """Place of a sensor in the model.

    `how` is "nearest", "by id", "given" or "combination"; `node` is None for a combination; `distance` is NaN
    where the test gives no position.
    """

    label: Dof
    node: int | None
    distance: float
    how: str


@dataclass(frozen=True)
class Unmatched:
    """A sensor without node within the tolerance, and the nearest one all the same (None if the model has none)."""

    label: Dof
    position: tuple[float, ...]
    nearest: int | None
    distance: float


@dataclass(frozen=True, eq=False)
class SensorMap:
    """From model to sensors.

    Parameters
    ----------
    matrix : (s, n_g) sparse, from g-set displacements (in the nodes' displacement frames) to sensors
    dofs : labels of the s sensors; the rows hold for these signs
    matches : one a sensor
    unmatched : sensors that were left out because no node is near
    notices : ties, far nodes, test nodes that share a node of the model
    """

    matrix: csr_array
    dofs: DofSet
    matches: tuple[Match, ...]
    unmatched: tuple[Unmatched, ...] = ()
    notices: tuple[Notice, ...] = ()


@dataclass(frozen=True, eq=False)
class _Request:
    """The options of the user."""

    nodes: NodeTable
    search: NodeSearch
    tolerance: float
    by_id: bool
    given: Mapping[int, int]
    combinations: Mapping[tuple[int, str], GeneralisedSensor]


def map_sensors(
    test: ModalTest,
    structure: Structure,
    *,
    tolerance: float,
    by_id: bool = False,
    given: Mapping[int, int] | None = None,
    combinations: Sequence[GeneralisedSensor] = (),
    leave_unmatched: bool = False,
    leave_out: Collection[int] = (),
) -> SensorMap:
    """Put every sensor of a test on the model.

    A combination comes first, then a node given by hand, then equal numbers if `by_id` and for scalar points of the
    model, else the nearest node. DOFs
    of the test's modes without geometry need one of the first three; their directions are taken in the basic frame.

    Parameters
    ----------
    test : in the units and axes of the model
    tolerance : largest distance of a node from its sensor, in the model's unit of length
    by_id : test nodes carry the numbers of the model's
    given : model node for some of the test nodes
    combinations : sensors that are combinations of model DOFs, see `rigid_motion_sensor`
    leave_unmatched : leave sensors without node out, listed in the result, instead of raising
    leave_out : test nodes whose sensors are not compared

    Raises
    ------
    FemtuneError : ``sensor.unmatched``, ``sensor.no-position``, ``sensor.given-unknown``, ``sensor.too-far``
        (assigned by number, beyond the tolerance), ``sensor.combination-unused``, ``sensor.tolerance``,
        ``model.unknown-node``; all that apply together
    """
    table = {(c.dof.node, c.dof.direction): c for c in combinations}
    request = _Request(
        structure.nodes, NodeSearch(structure.nodes, tolerance), tolerance, by_id, dict(given or {}), table
    )
    every, same_place = _with_places(_sensors(test, request))
    sensors = tuple(s for s in every if s.label.node not in leave_out)
    left_out = [s.label for s in every if s.label.node in leave_out]
    _check_requests(every, request, combinations)
    errors = ErrorCollector()
    placed: list[tuple[Match, Row]] = []
    unmatched: list[Unmatched] = []
    nowhere: list[Sensor] = []
    for sensor in sensors:
        with errors.catch():
            placement = _place(sensor, request)
            if placement is None:
                nowhere.append(sensor)
            else:
                unmatched.append(placement) if isinstance(placement, Unmatched) else placed.append(placement)
    if nowhere:
        errors.errors.append(_no_position(nowhere, same_place, request))
    if unmatched and not leave_unmatched:
        errors.errors.append(_unmatched_error(unmatched, len(sensors), request))
    # the model of an external solver may know no places
    far = (
        [m for m, _ in placed if m.how == _BY_ID and m.distance > tolerance] if structure.nodes.has_coordinates else []
    )
    if far:
        errors.errors.append(_too_far(far, placed, sensors, request))
    errors.raise_if_any()
    _check_one_grid([match for match, _ in placed], sensors, request)
    built = _build(placed, tuple(unmatched), sensors, request)
    notices = (*built.notices, *_without_distance(same_place, sensors))
    if left_out:
        notices += (Notice("sensor.left-out", level="info", names=", ".join(map(str, left_out))),)
    return replace(built, notices=notices)


def _with_places(sensors: Sequence[Sensor]) -> tuple[tuple[Sensor, ...], Reals | None]:
    """The sensors, and the one place that a file gives to all its points where it knows none, which is then dropped."""
    places = {s.label.node: s.position for s in sensors if np.isfinite(s.position).all()}
    points = np.array(list(places.values())).reshape(-1, 3)
    if len(points) < _LEAST_PLACES or np.ptp(points, axis=0).any():
        return tuple(sensors), None
    return tuple(replace(s, position=_UNKNOWN) for s in sensors), points[0]


def _without_distance(same_place: Reals | None, sensors: Sequence[Sensor]) -> tuple[Notice, ...]:
    if same_place is None:
        return ()
    count = len({s.label.node for s in sensors})
    return (Notice("sensor.no-distance", level="info", count=count, place=_coordinates(same_place)),)


def _coordinates(point: Sequence[float] | Reals) -> str:
    return f"({', '.join(f'{x:.6g}' for x in point)})"


def _check_one_grid(matches: Sequence[Match], sensors: Sequence[Sensor], request: _Request) -> None:
    """Several points of the test must not end at one grid point: shapes cannot be compared there."""
    nearest = [m for m in matches if m.how == "nearest"]
    points = {s.label.node: s.position for s in sensors if s.label.node in {m.label.node for m in nearest}}
    grids = {m.node for m in nearest}
    if len(points) < _LEAST_PLACES or len(grids) > 1 or len(nearest) < len(matches):
        return
    places, xyz = np.array(list(points.values())), request.nodes.xyz
    guess = _extent_words(places, xyz)
    raise FemtuneError(
        "sensor.one-grid",
        values={
            "extent of the test": f"{np.ptp(places, axis=0).max():.4g}",
            "extent of the model": f"{np.ptp(xyz, axis=0).max():.4g}",
            "tolerance": f"{request.tolerance:.4g}",
        },
        hint=guess or None,
        count=len(points),
        node=next(iter(grids)),
    )


def _sensors(test: ModalTest, request: _Request) -> tuple[Sensor, ...]:
    """The placed sensors, then DOFs of the modes that have no place, and those of FRFs that find the model without."""
    of_frfs = [] if test.frfs is None else [*test.frfs.responses, *test.frfs.references]
    extra = [*(test.modes.dofs if test.modes else ()), *(d for d in of_frfs if _needs_no_place(d, request))]
    known = {(s.label.node, s.label.direction) for s in test.sensors}
    new = {(d.node, d.direction): d for d in reversed(extra) if (d.node, d.direction) not in known}
    return (*test.sensors, *(Sensor(d, _UNKNOWN, _basic_direction(d)) for d in reversed(list(new.values()))))


def _needs_no_place(dof: Dof, request: _Request) -> bool:
    return _by_number(dof, request) or dof.node in request.given or (dof.node, dof.direction) in request.combinations


def _by_number(dof: Dof, request: _Request) -> bool:
    """True if equal numbers decide: always for scalar points of the model, which have no coordinates."""
    if dof.direction == "S":
        return request.by_id or request.nodes.has_scalar(dof.node)
    return request.by_id and request.nodes.has_grid(dof.node)


def _basic_direction(dof: Dof) -> Reals:
    return dof.sign * np.eye(3)[(dof.component - 1) % 3]


def _check_requests(sensors: Sequence[Sensor], request: _Request, combinations: Sequence[GeneralisedSensor]) -> None:
    errors = ErrorCollector()
    with errors.catch():
        _check_tolerance(request.tolerance)
    with errors.catch():
        _check_given({s.label.node for s in sensors}, request.given)
    with errors.catch():
        _check_combinations(DofSet(s.label for s in sensors), DofSet(c.dof for c in combinations))
    errors.raise_if_any()


def _check_tolerance(tolerance: float) -> None:
    if not 0.0 < tolerance < np.inf:
        raise FemtuneError("sensor.tolerance", values={"tolerance": tolerance})


def _check_given(test_nodes: set[int], given: Mapping[int, int]) -> None:
    unknown = sorted(set(given) - test_nodes)
    if unknown:
        raise FemtuneError("sensor.given-unknown", values={"test nodes": ", ".join(map(str, unknown[:10]))})


def _check_combinations(labels: DofSet, wanted: DofSet) -> None:
    unknown = [str(d) for d in wanted if d not in labels]
    if unknown:
        raise FemtuneError("sensor.combination-unused", values={"labels": ", ".join(unknown[:10])})


def _place(sensor: Sensor, request: _Request) -> tuple[Match, Row] | Unmatched | None:
    """Match and row of one sensor; None if its place is unknown."""
    label, nodes = sensor.label, request.nodes
    combination = request.combinations.get((label.node, label.direction))
    if combination is not None:
        return Match(label, None, np.nan, "combination"), _combined(label, combination, nodes)
    if label.node in request.given:
        return _at_node(sensor, request.given[label.node], "given", nodes)
    if _by_number(label, request):
        return _at_node(sensor, label.node, _BY_ID, nodes)
    return _nearest(sensor, request)


def _nearest(sensor: Sensor, request: _Request) -> tuple[Match, Row] | Unmatched | None:
    if not np.isfinite(sensor.position).all():
        return None
    near = request.search.near(sensor.position)
    if request.by_id or near.distance > request.tolerance:
        return Unmatched(sensor.label, tuple(map(float, sensor.position)), near.node or None, near.distance)
    match, row = _at_node(sensor, near.node, "nearest", request.nodes)
    return replace(match, distance=near.distance), row


def _no_position(nowhere: Sequence[Sensor], same_place: Reals | None, request: _Request) -> FemtuneError:
    """One error of all sensors without place; the hint says whether their numbers are those of grid points."""
    names = ", ".join(str(s.label) for s in nowhere[:_LISTED])
    names += f" and {len(nowhere) - _LISTED} more" if len(nowhere) > _LISTED else ""
    numbered = all(request.nodes.has_grid(s.label.node) for s in nowhere)
    hint = "their numbers are those of grid points: write by_id = true in [sensors]" if numbered else None
    if same_place is not None:
        place = _coordinates(same_place)
        return FemtuneError("sensor.no-position/same-place", hint=hint, sensor_labels=names, place=place)
    scalar = all(s.label.direction == "S" for s in nowhere)
    kind = "scalar points" if scalar else "grid points"
    tail = f", and the model has no {kind} with these numbers" if request.by_id or scalar else ""
    return FemtuneError("sensor.no-position", hint=hint, sensor_labels=names, also=tail)


_LISTED = 8
"""Names in a message; it stays one line or two."""


def _at_node(sensor: Sensor, node: int, how: str, nodes: NodeTable) -> tuple[Match, Row]:
    if sensor.label.direction == "S":
        return Match(sensor.label, node, np.nan, how), {nodes.dof(node, 0): float(sensor.label.sign)}
    i = nodes.position(node)
    distance = float(np.linalg.norm(nodes.xyz[i] - sensor.position))
    # u_basic = frame @ u, and the sensor sees direction · u_basic
    seen = nodes.frames[i].T @ sensor.direction
    first = 6 * i + (3 if sensor.is_rotation else 0)
    return Match(sensor.label, node, distance, how), {first + k: float(c) for k, c in enumerate(seen) if abs(c) > 1e-14}


def _combined(label: Dof, combination: GeneralisedSensor, nodes: NodeTable) -> Row:
    row: Row = {}
    for node, component, coefficient in combination.terms:
        at = nodes.dof(node, component)
        row[at] = row.get(at, 0.0) + label.sign * combination.dof.sign * coefficient
    return row


def _build(
    placed: Sequence[tuple[Match, Row]],
    unmatched: tuple[Unmatched, ...],
    sensors: Sequence[Sensor],
    request: _Request,
) -> SensorMap:
    entries = [(r, c, value) for r, (_, row) in enumerate(placed) for c, value in row.items()]
    rows, columns, values = zip(*entries) if entries else ((), (), ())
    shape = (len(placed), request.nodes.n_dofs)
    matches = tuple(match for match, _ in placed)
    notices = (*_ties(matches, sensors, request), *_far(matches, request.tolerance), *_shared(matches))
    notices += _scaled(matches, sensors, request)
    if unmatched:
        names = ", ".join(str(u.label) for u in unmatched)
        notices += (Notice("sensor.left-out", names=names),)
    matrix = csr_array((np.array(values, float), (rows, columns)), shape=shape)
    return SensorMap(matrix, DofSet(match.label for match in matches), matches, unmatched, notices)


def _ties(matches: Sequence[Match], sensors: Sequence[Sensor], request: _Request) -> tuple[Notice, ...]:
    """One notice of the first sensor that is equally close to several nodes, with the number of the others."""
    place = {(s.label.node, s.label.direction): s.position for s in sensors}
    ties_of_nodes: dict[int, Near] = {}
    for match in matches:
        if match.how == "nearest" and match.label.node not in ties_of_nodes:
            ties_of_nodes[match.label.node] = request.search.near(place[match.label.node, match.label.direction])
    ties = [(test_node, near) for test_node, near in ties_of_nodes.items() if near.others]
    if not ties:
        return ()
    test_node, near = ties[0]
    others = ", ".join(map(str, near.others[:_LISTED]))
    more = f"; {len(ties) - 1} more test nodes are equally close to several grid points" if len(ties) > 1 else ""
    return (Notice("sensor.tie", node=near.node, others=others, test_node=test_node, more=more),)


def _far(matches: Sequence[Match], tolerance: float) -> tuple[Notice, ...]:
    """One notice of the farthest, with the number of the others."""
    far = {m.label.node: m for m in matches if m.distance > tolerance}
    if not far:
        return ()
    worst = max(far.values(), key=lambda m: m.distance)
    more = f"; {len(far) - 1} more test nodes are farther than the tolerance" if len(far) > 1 else ""
    return (
        Notice(
            "sensor.far-from-node", test_node=worst.label.node, node=worst.node, method=worst.how,
            distance=worst.distance, tolerance=tolerance, more=more,
        ),
    )  # fmt: skip


def _shared(matches: Sequence[Match]) -> tuple[Notice, ...]:
    """Model nodes that stand for several test nodes: their sensors cannot differ in the model."""
    users: dict[int, set[int]] = {}
    for match in matches:
        if match.node is not None:
            users.setdefault(match.node, set()).add(match.label.node)
    shared = {node: sorted(who) for node, who in users.items() if len(who) > 1}
    if not shared:
        return ()
    node, who = max(shared.items(), key=lambda item: len(item[1]))
    names = ", ".join(map(str, who[:_LISTED])) + (f" and {len(who) - _LISTED} more" if len(who) > _LISTED else "")
    more = f"; {len(shared) - 1} more grid points have several test nodes" if len(shared) > 1 else ""
    return (Notice("sensor.shared-node", test_nodes=names, node=node, more=more),)


def _scaled(matches: Sequence[Match], sensors: Sequence[Sensor], request: _Request) -> tuple[Notice, ...]:
    """A warning where the coordinates of the test are those of the model in another unit of length.

    Points that are assigned by number must be in one ratio to their grid points. Where grid points were found by their
    distance, most points of the test share one, and the extents are in that ratio.
    """
    place = {(s.label.node, s.label.direction): s.position for s in sensors}
    measured_at = {m.label.node: (place[m.label.node, m.label.direction], m) for m in matches if m.node is not None}
    pairs = [(p, m) for p, m in measured_at.values() if np.isfinite(p).all() and request.nodes.has_grid(m.node or 0)]
    if len(pairs) < _LEAST_PLACES:
        return ()
    points = np.array([p for p, _ in pairs])
    grids = np.array([request.nodes.xyz[request.nodes.position(m.node or 0)] for _, m in pairs])
    if any(m.how != "nearest" for _, m in pairs):
        words = unit_ratio(points, grids)
    elif 2 * len({m.node for _, m in pairs}) <= len(np.unique(points, axis=0)):
        words = _extent_words(points, request.nodes.xyz)
    else:
        words = ""
    return (Notice("sensor.units", words=words),) if words else ()


def _fitted_ratio(points: Reals, grids: Reals) -> float:
    """Ratio of the coordinates of grid points to those of their test points; 1 without a common ratio."""
    points, grids = points - points.mean(axis=0), grids - grids.mean(axis=0)
    square = float((points * points).sum())
    ratio = float((points * grids).sum()) / square if square > 0.0 else 1.0
    left = np.linalg.norm(grids - ratio * points)
    return ratio if ratio > 0.0 and left <= _UNIT_TOLERANCE * np.linalg.norm(grids) else 1.0


def unit_ratio(points: Reals, grids: Reals) -> str:
    """The units that the ratio of the places of grid points and of their test points (n, 3) belongs to, in words.

    "" where the ratio is near 1, none that is known, or not the same for all points.
    """
    ratio = _fitted_ratio(points, grids)
    factor = min(LENGTH_FACTORS, key=lambda known: abs(np.log(ratio / known)))
    near = abs(np.log(ratio / factor)) <= _UNIT_TOLERANCE
    return _in_words(LENGTH_FACTORS[factor], factor, "X, Y, Z") if near else ""


def length_factor(points: Reals, nodes: NodeTable) -> tuple[float, str]:
    """The factor between units of length that would put points (n, 3) onto a model, and what it is; 1 and "" if none.

    It puts every point on a grid point of its own, or gives the points the extent of the model.
    """
    xyz = nodes.xyz
    size = float(np.linalg.norm(np.ptp(xyz, axis=0))) if len(xyz) else 0.0
    factor, words = NodeSearch(nodes, 1e-3 * size).fitting_factor(points) if size else (1.0, "")
    return (factor, words) if words else _extent_factor(points, xyz)


def _extent_words(points: Reals, grids: Reals) -> str:
    return _extent_factor(points, grids)[1]


def _extent_factor(points: Reals, grids: Reals) -> tuple[float, str]:
    """The factor that the ratio of the largest extents of model and test belongs to; 1 and "" without one."""
    of_test, of_model = (float(np.ptp(x, axis=0).max()) if len(x) else 0.0 for x in (points, grids))
    if not (0.0 < of_test < np.inf and of_model > 0.0):
        return 1.0, ""
    ratio, (least, most) = of_model / of_test, _COVERED
    large = (f for f in LENGTH_FACTORS if max(f, 1.0 / f) >= _LARGE_FACTOR and least <= ratio / f <= most)
    factor = min(large, key=lambda known: abs(np.log(ratio / known)), default=1.0)
    return factor, _in_words(LENGTH_FACTORS[factor], factor, "X, Y, Z")


def _unmatched_error(unmatched: Sequence[Unmatched], total: int, request: _Request) -> FemtuneError:
    values = {str(u.label): _distance_in_words(u) for u in unmatched[:20]}
    if len(unmatched) > 20:
        values["…"] = f"and {len(unmatched) - 20} more"
    why = (
        "grid point with their number"
        if request.by_id
        else f"grid point within the tolerance of {request.tolerance:.4g}"
    )
    points = np.array([u.position for u in unmatched])
    guess = request.search.looks_like(points) if len(unmatched) == total else ""
    if not guess and 2 * len(unmatched) > total >= _LEAST_PLACES:
        guess = _extent_words(points, request.nodes.xyz)
    return FemtuneError(
        "sensor.unmatched",
        values=values,
        hint=guess or "check the units and axes of the test, increase the tolerance, or assign grid points manually",
        n_unmatched=len(unmatched),
        total=total,
        missing=why,
    )


def _too_far(
    far: Sequence[Match], placed: Sequence[tuple[Match, Row]], sensors: Sequence[Sensor], request: _Request
) -> FemtuneError:
    """Sensors whose grid points of the same number are beyond the tolerance, the farthest first."""
    nodes = {m.label.node: m for m in far}
    worst = sorted(nodes.values(), key=lambda m: -m.distance)
    values = {str(m.label): f"{m.distance:.4g} from grid point {m.node}" for m in worst[:20]}
    if len(worst) > 20:
        values["…"] = f"and {len(worst) - 20} more"
    matches = [m for m, _ in placed]
    units = _scaled(matches, sensors, request)
    return FemtuneError(
        "sensor.too-far",
        values=values,
        hint=units[0].what if units else None,
        count=len(nodes),
        total=len({m.label.node for m in matches}),
        tolerance=request.tolerance,
    )


def _distance_in_words(u: Unmatched) -> str:
    place = _coordinates(u.position)
    if u.nearest is None:
        return f"at {place}, the model has no grid points"
    return f"at {place}, nearest grid point {u.nearest}, distance {u.distance:.4g}"
