"""A small aeroplane of the dimensions of the GARTEUR SM-AG19 testbed as a deck of bars; units m, kg, s.

Fuselage 1.5 × 0.15 × 0.05 m, wing 2 m × 0.1 × 0.01, tip drums 0.4 × 0.1 × 0.01, vertical tail 0.3 × 0.1 × 0.01 and
horizontal tail 0.4 × 0.1 × 0.01, aluminium; wing and vertical tail stand on elastic joints. (Balmes and Wright (1997),
GARTEUR group on ground vibration testing; the damping layer of the testbed's wing is not modelled.)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from femtune.files.nastran.lines import format_real

FUSELAGE, WING, TAIL, DRUM = 1, 2, 3, 4
WING_JOINT, TAIL_JOINT, BOLTED, TAILPLANE_JOINT = 21, 22, 23, 24
WING_X, WING_Z = 0.6, 0.08
TAIL_X, TAIL_Z = 1.45, 0.075
STIFF = 1e9
"""N/m and Nm/rad of what does not give way."""
NOMINAL = {"wing_bending": 8.3333e-9, "wing_torsion": 3.25e-8, "wing_chord": 8.3333e-7, "fuselage": 1.5625e-6,
           "tail_torsion": 3.25e-8, "tail_roll": 2.0e3, "wing_yaw": 4.0e4}  # fmt: skip
"""Second moments of area in m⁴ and joint stiffnesses in Nm/rad; their fields are in `FIELDS`."""
FIELDS = {"wing_bending": "PBAR 2 I1", "wing_torsion": "PBAR 2 J", "wing_chord": "PBAR 2 I2",
          "fuselage": "PBAR 1 I2", "tail_torsion": "PBAR 3 J", "tail_roll": "PBUSH 22 K4",
          "wing_yaw": "PBUSH 21 K6"}  # fmt: skip


@dataclass(frozen=True)
class Line:
    """Grid points first, first + 1, … from `start` on, `step` apart, with a bar of one property between neighbours."""

    first: int
    count: int
    start: tuple[float, float, float]
    step: tuple[float, float, float]
    property: int
    up: tuple[float, float, float]

    def points(self) -> Iterator[tuple[int, tuple[float, float, float]]]:
        """Number and place of each grid point."""
        for i in range(self.count):
            x, y, z = (a + i * d for a, d in zip(self.start, self.step))
            yield self.first + i, (x, y, z)


def lines() -> tuple[Line, ...]:
    """All members."""
    up, side = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
    h, k = 0.05, 0.1
    return (
        Line(1000, 16, (0.0, 0.0, 0.0), (k, 0.0, 0.0), FUSELAGE, up),
        Line(2000, 41, (WING_X, -1.0, WING_Z), (0.0, h, 0.0), WING, up),
        Line(3000, 7, (TAIL_X, 0.0, TAIL_Z), (0.0, 0.0, h), TAIL, side),
        Line(4000, 9, (TAIL_X, -0.2, TAIL_Z + 0.3), (0.0, h, 0.0), TAIL, up),
        Line(5000, 9, (WING_X - 0.2, -1.0, WING_Z), (h, 0.0, 0.0), DRUM, up),
        Line(6000, 9, (WING_X - 0.2, 1.0, WING_Z), (h, 0.0, 0.0), DRUM, up),
    )


def deck_text(factors: Mapping[str, float] | None = None, tailplane: float = STIFF) -> str:
    """The deck; `factors` multiply the values of `NOMINAL` by name, for the twin that is tested.

    `tailplane` is the rolling stiffness of the joint between vertical and horizontal tail, which the deck takes for
    rigid.
    """
    values = {name: value * (factors or {}).get(name, 1.0) for name, value in NOMINAL.items()}
    return "\n".join([*_head(), *_properties(values, tailplane), *_members(), *_joints(), "ENDDATA", ""])


def _head() -> Iterator[str]:
    yield from ("SOL 103", "CEND", "TITLE = SMALL AEROPLANE", "METHOD = 1", "BEGIN BULK")
    yield from ("PARAM,COUPMASS,1", "PARAM,AUTOSPC,YES", "EIGRL,1,,,16", "MAT1,1,72.+9,,.33,2700.")


def _properties(v: Mapping[str, float], tailplane: float) -> Iterator[str]:
    yield _card("PBAR", FUSELAGE, 1, 7.5e-3, 1.40625e-5, v["fuselage"], 4.9e-6)
    yield _card("PBAR", WING, 1, 1e-3, v["wing_bending"], v["wing_chord"], v["wing_torsion"])
    yield _card("PBAR", TAIL, 1, 1e-3, 8.3333e-9, 8.3333e-7, v["tail_torsion"])
    yield _card("PBAR", DRUM, 1, 1e-3, 8.3333e-9, 8.3333e-7, 3.25e-8)
    for number, roll, yaw in ((WING_JOINT, STIFF, v["wing_yaw"]), (TAIL_JOINT, v["tail_roll"], STIFF)):
        yield _card("PBUSH", number, "K", STIFF, STIFF, STIFF, roll, STIFF, yaw)
    yield _card("PBUSH", BOLTED, "K", *[STIFF] * 6)
    yield _card("PBUSH", TAILPLANE_JOINT, "K", *[STIFF] * 3, tailplane, STIFF, STIFF)


def _card(name: str, *fields: object) -> str:
    return ",".join([name, *(format_real(f, 8) if isinstance(f, float) else str(f) for f in fields)])


def _members() -> Iterator[str]:
    for line in lines():
        for number, place in line.points():
            yield _card("GRID", number, "", *place)
        for number in range(line.first, line.first + line.count - 1):
            yield _card("CBAR", number, line.property, number, number + 1, *line.up)


def _joints() -> Iterator[str]:
    """Rigid arms from the fuselage's axis to where wing and tail stand, and elastic joints there."""
    yield _card("GRID", 7001, "", WING_X, 0.0, WING_Z)
    yield _card("GRID", 7002, "", TAIL_X, 0.0, TAIL_Z)
    yield "RBE2,9001,1006,123456,7001"
    yield "RBE2,9002,1015,123456,7002"
    middle = 2000 + 20
    bushes = ((WING_JOINT, 7001, middle), (TAIL_JOINT, 7002, 3000), (TAILPLANE_JOINT, 3006, 4004),
              (BOLTED, 2000, 5004), (BOLTED, 2040, 6004))  # fmt: skip
    for k, (number, a, b) in enumerate(bushes):
        yield _card("CBUSH", 8001 + k, number, a, b, "", "", "", 0)
