"""Loads of the static step of a preload: FORCE, MOMENT, loads along bars, pressures and gravity, combined by LOAD."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError, Notice
from femtune.fem.elements import KINDS
from femtune.fem.elements.connector import WELD
from femtune.fem.elements.curved_bar import CURVED_BAR
from femtune.fem.elements.shear_panel import SHEAR_PANEL
from femtune.fem.preload import Preload
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.bars import element_frame
from femtune.files.nastran.building import LARGEST_VALUE, Building, listed_numbers
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.case_control import CaseCommand
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.surplus import surplus_notice

_POINT = "SID G CID F N1 N2 N3"
_ALONG = "SID G F G1 G2 G3 G4"
_FIELDS = {
    "LOAD": "SID S",
    "FORCE": _POINT,
    "MOMENT": _POINT,
    "FORCE1": _ALONG,
    "MOMENT1": _ALONG,
    "FORCE2": _ALONG,
    "MOMENT2": _ALONG,
    "SLOAD": "SID S1 F1 S2 F2 S3 F3",
    "GRAV": "SID CID A N1 N2 N3 MB",
    "PLOAD": "SID P G1 G2 G3 G4",
    "PLOAD1": "SID EID TYPE SCALE X1 P1 X2 P2",
    "PLOAD2": "SID P",
    "PLOAD4": "SID EID P1 P2 P3 P4 G1 G34 CID N1 N2 N3 SORL LDIR",
}
_FOLLOWING = ("PLOAD", "PLOAD2", "PLOAD4", "FORCE1", "FORCE2", "MOMENT1", "MOMENT2")
# cards with loads that LOAD of case control may select, but that are not read
_OTHERS = ("PLOADX1", "PLOADB3", "RFORCE", "RFORCE1", "SPCD", "SPCR", "ACCEL", "ACCEL1", "LOADCYH", "LOADCYN",
           "LOADCYT", "FORCEAX", "MOMAX", "PRESAX")  # fmt: skip
_NO_CONTINUATION = ("FORCE", "FORCE1", "FORCE2", "MOMENT", "MOMENT1", "MOMENT2", "GRAV", "PLOAD", "PLOAD1", "SLOAD")
_BARS = ("CBAR", "CBEAM")
_WITHOUT_DIFFERENTIAL = (CURVED_BAR.key, SHEAR_PANEL.key, WELD.key)


def preload_command(deck: Deck) -> CaseCommand | None:
    """The command that selects a static preload with loads for the modes, or None."""
    case = deck.case_control
    if case.preload is None or not case.preload.loads:
        return None
    return next((c for c in case.effective if c.is_preload), None)


def is_read(deck: Deck, name: str) -> bool:
    """Whether cards of a name are read as loads of a preload."""
    return name in _FIELDS and preload_command(deck) is not None


def preload_request(deck: Deck, command: CaseCommand) -> str:
    """The command that selects the preload, for messages: ``STATSUB = 1 (LOAD = 3)``."""
    case = deck.case_control
    loads = ", ".join(c.text for c in (case.preload.loads if case.preload else ()))
    return command.text + (f" ({loads})" if loads else "")


def read_preload(building: Building, grids: Grids, batches: Sequence[ElementBatch]) -> Preload | None:
    """The static preload of the modes; errors are gathered (``deck.preload``, ``deck.missing-set``, fields)."""
    deck = building.deck
    command = preload_command(deck)
    if command is None:
        _check_subcase(building)
        return None
    subcase = deck.case_control.preload
    assert subcase is not None
    request = preload_request(deck, command)
    loads = _Loads(building, grids, batches, request)
    for load in subcase.loads:
        with building.errors.catch():
            if load.name != "LOAD":
                raise _refused(command, request, load.text)
            loads.select(load)
    for record in building.records("SPC"):
        with building.errors.catch():
            if any(record.real(name, 0.0) != 0.0 for name in ("D1", "D2")):
                raise _refused(record.card, request, "an enforced displacement (SPC)")
    building.notices.append(Notice("deck.preload-solved", where=command.where, level="info", request=request))
    if loads.following:
        names = ", ".join(sorted(loads.following))
        building.notices.append(Notice("deck.following-load", where=command.where, cards=names))
    without = sorted({b.card for b in batches if b.kind in _WITHOUT_DIFFERENTIAL})
    if without:
        building.notices.append(Notice("deck.no-differential", where=command.where, cards=", ".join(without)))
    return Preload(loads.forces, loads.acceleration, subcase.spc, subcase.mpc, request)


def _check_subcase(building: Building) -> None:
    """Error ``deck.preload`` if the preload of the modes is not from another subcase of the deck."""
    case = building.deck.case_control
    command = next((c for c in case.effective if c.is_preload), None)
    if command is not None and case.preload is None:
        building.errors.errors.append(
            FemtuneError("deck.preload/subcase", where=command.where, request=command.text, name=command.name)
        )


def _refused(at: CaseCommand | Card, request: str, what: str) -> FemtuneError:
    where = at.where if isinstance(at, CaseCommand) else at.where()
    return FemtuneError("deck.preload/load", where=where, request=request, load=what, name="STATSUB")


@dataclass
class _Loads:
    """Forces on the g-set and the acceleration, to which cards are added."""

    building: Building
    grids: Grids
    batches: Sequence[ElementBatch]
    request: str
    forces: Reals = field(init=False)
    acceleration: Reals = field(default_factory=lambda: np.zeros(3))
    following: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.forces = np.zeros(self.grids.table.n_dofs)

    @cached_property
    def _elements(self) -> dict[int, tuple[ElementBatch, int]]:
        """Shells and solids by number: their batch, and their row in it."""
        surfaces = [b for b in self.batches if KINDS[b.kind].faces or KINDS[b.kind].sides]
        return {int(n): (b, i) for b in surfaces for i, n in enumerate(b.ids)}

    def select(self, command: CaseCommand) -> None:
        """Add the loads of the set that a LOAD command selects."""
        number = command.number
        by_set = self._by_set()
        parts = [(1.0, number)]
        for card in self.building.deck.by_name("LOAD"):
            if card.integer(0, 0) == number:
                parts += _combination(card)
        has_loads = False
        for scale, part in parts:
            for card in by_set.get(part, ()):
                has_loads = True
                with self.building.errors.catch():
                    self._add(card, scale)
        if not has_loads:
            known = ", ".join(map(str, sorted(by_set))) or "none"
            values = {"known": known}
            raise FemtuneError(
                "deck.missing-set/loads", where=command.where, values=values, number=number, request=self.request
            )

    def _by_set(self) -> Mapping[int, list[Card]]:
        out: dict[int, list[Card]] = {}
        for name in (*_FIELDS, *_OTHERS):
            if name != "LOAD":
                for card in self.building.deck.by_name(name):
                    out.setdefault(card.integer(0, 0), []).append(card)
        return out

    def _add(self, card: Card, scale: float) -> None:
        if card.name not in _FIELDS:
            raise _refused(card, self.request, card.name)
        record = CardEntry(card, tuple(_FIELDS[card.name].split()))
        huge = next((i for i in range(len(card.fields)) if card.is_real(i) and abs(card.real(i)) > LARGEST_VALUE), None)
        if huge is not None:
            raise card.error("deck.field-value", index=huge)
        beyond = [i for i in range(8, len(card.fields)) if not card.blank(i)]
        if beyond and card.name in _NO_CONTINUATION:
            self.building.notices.append(surplus_notice(card, beyond))
        if card.name in _FOLLOWING:
            self.following.add(card.name)
        _READERS[card.name](self, record, scale)

    def vector(self, number: int, record: CardEntry, vector: Reals, rotation: bool = False) -> None:
        """Add a force or moment in the basic frame at a grid point."""
        self._at(self.grids.row(number, record), vector, rotation)

    def _at(self, row: int, vector: Reals, rotation: bool = False) -> None:
        start = 6 * row + 3 * rotation
        self.forces[start : start + 3] += self.grids.table.frames[row].T @ vector

    def point(self, record: CardEntry, scale: float) -> None:
        """FORCE and MOMENT."""
        row = self.grids.row(record.integer("G"), record)
        frame = self.grids.systems.get(record.integer("CID", 0), record).frame(self.grids.table.xyz[row])
        vector = frame @ np.array(record.reals("N1", "N2", "N3"))
        self._at(row, scale * record.real("F") * vector, record.name == "MOMENT")

    def along(self, record: CardEntry, scale: float) -> None:
        """FORCE1 and MOMENT1 from G1 to G2; FORCE2 and MOMENT2 along the product of two such lines."""
        x = [
            self.grids.location(record.integer(name), record)
            for name in ("G1", "G2", "G3", "G4")[: 2 if record.name.endswith("1") else 4]
        ]
        vector = x[1] - x[0] if len(x) == 2 else np.cross(x[1] - x[0], x[3] - x[2])
        size = float(np.linalg.norm(vector))
        if size == 0.0:
            raise record.error("deck.field-value/load-direction", at="G1")
        self.vector(
            record.integer("G"), record, scale * record.real("F") * vector / size, record.name.startswith("MOMENT")
        )

    def scalar(self, record: CardEntry, scale: float) -> None:
        """SLOAD."""
        for k in "123":
            number = record.integer("S" + k, 0)
            if number:
                self.forces[self.grids.dof(number, 0, record)] += scale * record.real("F" + k)

    def gravity(self, record: CardEntry, scale: float) -> None:
        """GRAV, in a rectangular system."""
        system = self.grids.systems.get(record.integer("CID", 0), record)
        vector = system.frame(np.zeros(3)) @ np.array(record.reals("N1", "N2", "N3"))
        self.acceleration = self.acceleration + scale * record.real("A") * vector

    def on_points(self, record: CardEntry, scale: float) -> None:
        """PLOAD: pressure on the face of three or four grid points, along its normal by the right-hand rule."""
        numbers = [n for name in ("G1", "G2", "G3", "G4") if (n := record.integer(name, 0))]
        rows = np.array([self.grids.row(n, record) for n in numbers])
        self._pressure(rows, np.full(len(rows), scale * record.real("P")))

    @cached_property
    def _bars(self) -> dict[int, tuple[ElementBatch, int]]:
        """Bars and beams by number: their batch, and their row in it."""
        return {int(n): (b, i) for b in self.batches if b.card in _BARS for i, n in enumerate(b.ids)}

    def on_bars(self, record: CardEntry, scale: float) -> None:
        """PLOAD1: a force or moment at a point of a bar, or a linearly varying one along it."""
        number, kind, places = record.integer("EID"), record.text("TYPE"), record.text("SCALE")
        if number not in self._bars:
            raise record.error("deck.field-value/loaded-bar", number=number)
        if kind not in _KINDS_ON_BARS:
            raise record.error("deck.field-value/load-type", at="TYPE", known=", ".join(_KINDS_ON_BARS))
        if places not in ("LE", "FR"):
            raise _refused(record.card, self.request, f"PLOAD1 with SCALE = {places or 'blank'}")
        batch, i = self._bars[number]
        if batch.facts["pins"][i].any():
            raise _refused(record.card, self.request, "PLOAD1 on a bar with pin flags")
        ends, arms = batch.nodes[i], [batch.facts[name][i] for name in ("offset_a", "offset_b")]
        line = self.grids.table.xyz[ends[1]] + arms[1] - self.grids.table.xyz[ends[0]] - arms[0]
        frame = element_frame(line, batch.facts["orientation"][i]) if kind.endswith("E") else np.eye(3)
        unit = 1.0 if places == "FR" else 1.0 / float(np.linalg.norm(line))
        first, last = unit * record.real("X1"), unit * record.real("X2", record.real("X1"))
        if not -_END_TOLERANCE <= first <= last <= 1.0 + _END_TOLERANCE:
            raise record.error(
                "deck.field-value/place-on-bar", at="X2" if -_END_TOLERANCE <= first <= 1.0 + _END_TOLERANCE else "X1"
            )
        loads = np.array([record.real("P1"), record.real("P2", record.real("P1"))])
        # some preprocessors write a zero in this field for a single load
        if first == last and loads[1] not in (0.0, loads[0]):
            raise record.error("deck.field-value/single-load-on-bar", at="P2")
        forces = _of_bar(line, (first, last), np.outer(scale * loads, frame[:, "XYZ".index(kind[1])]), kind[0] == "M")
        for row, arm, (force, moment) in zip(ends, arms, forces):
            self._at(int(row), force)
            self._at(int(row), moment + np.cross(arm, force), rotation=True)

    def on_shells(self, record: CardEntry, scale: float) -> None:
        """PLOAD2: pressure on shells, along their normals."""
        for number in listed_numbers(record, record.card.fields[2:8]):
            rows = self._face(number, record, None)
            self._pressure(rows, np.full(len(rows), scale * record.real("P")))

    def on_faces(self, record: CardEntry, scale: float) -> None:
        """PLOAD4: pressure on shells along their normals, on faces of solids inwards, or in a given direction."""
        card = record.card
        first = record.integer("EID")
        thru = card.text(6) == "THRU"
        numbers = list(range(first, card.integer(7) + 1)) if thru else [first]
        if thru:
            known = self._elements
            numbers = [n for n in numbers if n in known]
        if record.text("SORL", "SURF") != "SURF" or record.text("LDIR", "NORM") != "NORM":
            raise _refused(card, self.request, "PLOAD4 with SORL or LDIR")
        direction = None
        if any(not record.blank(name) for name in ("N1", "N2", "N3")):
            system = self.grids.systems.get(record.integer("CID", 0), record)
            direction = np.array(record.reals("N1", "N2", "N3"))
            size = float(np.linalg.norm(direction))
            if size == 0.0:
                raise record.error("deck.field-value/load-direction", at="N1")
            direction = direction / size
        corners = None if thru else tuple(record.integer(name, 0) for name in ("G1", "G34"))
        for number in numbers:
            rows = self._face(number, record, corners)
            first_value = record.real("P1")
            values = np.array([record.real(f"P{k + 1}", first_value) for k in range(len(rows))])
            if direction is None:
                self._pressure(rows, scale * values)
            else:
                turn = system.frame(self.grids.table.xyz[rows].mean(axis=0))
                self._pressure(rows, scale * values, turn @ direction)

    def _face(self, number: int, record: CardEntry, corners: tuple[int, ...] | None) -> Integers:
        """Rows of the corners of a shell, or of the face of a solid, its normal inwards."""
        if number not in self._elements:
            raise record.error("deck.field-value/loaded-element", number=number)
        batch, i = self._elements[number]
        kind, nodes = KINDS[batch.kind], batch.nodes[i]
        if kind.surface is not None or kind.volume is not None:
            raise _refused(record.card, self.request, f"{record.name} on {batch.card} with mid-side grid points")
        if kind.shell or not kind.sides:
            return np.asarray(nodes)
        if not corners or not corners[0]:
            raise record.error("deck.field-value/loaded-face", number=number)
        ids = self.grids.table.ids[nodes].tolist()
        first, other = (ids.index(n) if n in ids else -1 for n in corners)
        for side in kind.sides:
            local = [k for k in side if k >= 0]
            if first in local and self._meant(local, first, other, len(nodes)):
                rows = nodes[local]
                x = self.grids.table.xyz
                normal = np.cross(x[rows[1]] - x[rows[0]], x[rows[2]] - x[rows[0]])
                outwards = normal @ (x[rows].mean(axis=0) - x[nodes].mean(axis=0)) > 0.0
                return np.asarray(rows[::-1] if outwards else rows)
        raise record.error("deck.field-value/loaded-face", number=number)

    def _meant(self, local: list[int], first: int, other: int, count: int) -> bool:
        """Whether G34 fits a face: the corner opposite to G1 of four, none of three, or the one off a CTETRA's face."""
        if count == 4:
            return other >= 0 and other not in local
        if len(local) == 3:
            return other < 0
        return other in local and abs(local.index(first) - local.index(other)) == 2

    def _pressure(self, rows: Integers, values: Reals, direction: Reals | None = None) -> None:
        xyz = self.grids.table.xyz[rows]
        if len(rows) == 3:
            points = np.array([[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
            r, s = points.T
            N = np.stack([1 - r - s, r, s], axis=1)
            slopes = np.broadcast_to(np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]), (3, 2, 3))
            weights = np.full(3, 1 / 6)
        else:
            g = 1 / np.sqrt(3.0)
            r, s = np.array([[-g, -g], [g, -g], [g, g], [-g, g]]).T[:, :, None]
            x, y = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])
            N = (1 + r * x) * (1 + s * y) / 4
            slopes = np.stack([x * (1 + s * y), (1 + r * x) * y], axis=1) / 4
            weights = np.ones(4)
        bases = slopes @ xyz
        area = np.cross(bases[:, 0], bases[:, 1]) * weights[:, None]
        if direction is not None:
            area = np.linalg.norm(area, axis=1)[:, None] * direction
        for row, force in zip(rows, N.T @ (area * (N @ values)[:, None])):
            self._at(int(row), force)


# ----------------------------------------------------------------------------------------------------
# Loads along bars.


_KINDS_ON_BARS = tuple(a + b + c for a in "FM" for b in "XYZ" for c in ("", "E"))
_END_TOLERANCE = 1e-6
"""Distance by which a load may be beyond the ends of a bar, as a fraction of its length: rounding of X1 and X2."""


def _of_bar(line: Reals, places: tuple[float, float], loads: Reals, moments: bool) -> Reals:
    """(2, 2, 3) forces and moments at the ends that are work-equivalent to a load along a bar.

    Displacements are linear along the axis and cubic across it, as of a shear-rigid bar.

    Parameters
    ----------
    line : from end A to end B
    places : start and end, as fractions of the length; equal for a concentrated load
    loads : (2, 3) at these places, per length unless concentrated
    moments : True for moments, False for forces
    """
    size = float(np.linalg.norm(line))
    axis = line / size
    out = np.zeros((2, 2, 3))
    x, weights = np.polynomial.legendre.leggauss(4)
    parts, weights = 0.5 * (1.0 + x), 0.5 * weights * (places[1] - places[0]) * size
    if places[0] == places[1]:
        parts, weights = np.zeros(1), np.ones(1)
    for part, weight in zip(parts, weights):
        s = places[0] + part * (places[1] - places[0])
        load = weight * (loads[0] + part * (loads[1] - loads[0]))
        along = (load @ axis) * axis
        across = load - along
        share = np.array([1.0 - s, s])[:, None]
        if moments:
            slope, turn = _cubic_slopes(s)
            out[:, 0] += slope[:, None] / size * np.cross(across, axis)
            out[:, 1] += share * along + turn[:, None] * across
        else:
            deflection, turn = _cubics(s)
            out[:, 0] += share * along + deflection[:, None] * across
            out[:, 1] += turn[:, None] * size * np.cross(axis, across)
    return out


def _cubics(s: float) -> tuple[Reals, Reals]:
    """Deflection at a fraction of the length for unit deflections, and per length for unit rotations, of both ends."""
    bent = s * s * (3.0 - 2.0 * s)
    return np.array([1.0 - bent, bent]), np.array([s * (1.0 - s) ** 2, -s * s * (1.0 - s)])


def _cubic_slopes(s: float) -> tuple[Reals, Reals]:
    """Derivatives of `_cubics`."""
    bent = 6.0 * s * (1.0 - s)
    return np.array([-bent, bent]), np.array([(1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)])


def _combination(card: Card) -> Iterable[tuple[float, int]]:
    """LOAD: factors and numbers of the sets that it combines."""
    whole = card.real(1)
    for at in range(2, len(card.fields), 2):
        if not card.blank(at):
            yield whole * card.real(at), card.integer(at + 1)


_READERS: dict[str, Callable[[_Loads, CardEntry, float], None]] = {
    "FORCE": _Loads.point,
    "MOMENT": _Loads.point,
    "FORCE1": _Loads.along,
    "MOMENT1": _Loads.along,
    "FORCE2": _Loads.along,
    "MOMENT2": _Loads.along,
    "SLOAD": _Loads.scalar,
    "GRAV": _Loads.gravity,
    "PLOAD": _Loads.on_points,
    "PLOAD1": _Loads.on_bars,
    "PLOAD2": _Loads.on_shells,
    "PLOAD4": _Loads.on_faces,
}
