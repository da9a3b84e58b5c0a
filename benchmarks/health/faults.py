"""Faults of decks, studies and tests, each with the codes that name its cause."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from decks import Model

import femtune as ft
from femtune.steps.files import write_test
from femtune.testdata import ModalTest

_SHELLS, _SOLIDS = ("CQUAD4", "CTRIA3"), ("CHEXA",)


@dataclass
class Planted:
    """A deck with its study and test: tables of the study, keys of its configuration, and the test."""

    model: Model
    test: ModalTest
    tables: dict[str, str] = field(default_factory=dict)
    configuration: list[str] = field(default_factory=list)
    bounds: tuple[str, str, str] = ("MAT1 1 E", "0.7", "1.4")

    def write(self, folder: Path) -> Path:
        """Write deck, test and study; return the study."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "deck.bdf").write_text(self.model.text())
        write_test(self.test, folder / "test.uff")
        name, lower, upper = self.bounds
        lines = [
            "[study]", 'title = "x"', 'deck = "deck.bdf"', f'units = "{self.model.units}"',
            "[[configuration]]", 'name = "as tested"', 'test = "test.uff"', *self.configuration,
            "[[parameter]]", 'name = "p"', f'fields = ["{name}"]', f"lower = {lower}", f"upper = {upper}",
            *(f"[{table}]\n{keys}" for table, keys in self.tables.items()),
        ]  # fmt: skip
        (folder / "study.toml").write_text("\n".join(lines) + "\n")
        return folder / "study.toml"


@dataclass(frozen=True)
class Fault:
    """A kind of fault: `plant` returns False for a deck that cannot have it."""

    name: str
    codes: tuple[str, ...]
    plant: Callable[[Planted], bool]


def sound(model: Model, folder: Path) -> Planted:
    """The deck with a test of its own modes and a study of usual values."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "own.bdf").write_text(model.text())
    held = {int(card[3]) for card in model.named("SPC1")}
    far = [n for n in model.places if n % 2 and n not in held][:12]
    sensors = [f"{n}:{model.measured}" for n in far]
    free = not model.case
    test = ft.simulate(folder / "own.bdf", sensors, units=model.units, count=10 if free else 4)
    assert test.modes is not None
    ratios = np.linspace(0.008, 0.015, len(test.modes))
    modes = replace(test.modes, damping_ratio=ratios)
    tables = {"residuals": "frequency_sd = 0.01\nshape_sd = 0.05", "sensors": "position_sd = 0.003\nangle_sd_deg = 2.0"}
    return Planted(model, replace(test, modes=modes), tables)


def _property(planted: Planted, column: dict[str, int], value: str) -> bool:
    """Set a field of the first property card of some names."""
    for card in planted.model.named(*column):
        at = column[card[0]]
        card.extend([""] * (at + 1 - len(card)))
        card[at] = value
        return True
    return False


def _scale(planted: Planted, fields: dict[str, tuple[int, ...]], factor: float, power: int = 1) -> bool:
    found = False
    for card in planted.model.named(*fields):
        for at in fields[card[0]]:
            card[at] = f"{_number(card[at]) * factor**power:.6g}"
            card[at] += "" if "." in card[at] or "e" in card[at] else "."
            found = True
    return found


def _number(text: str) -> float:
    head, sign, tail = text[:1], "", text[1:]
    for mark in "+-":
        if mark in tail and "e" not in tail:
            tail, sign, power = (*tail.partition(mark)[:2], tail.partition(mark)[2])
            return float(f"{head}{tail}e{sign}{power}")
    return float(text)


def _add(planted: Planted, *lines: str) -> bool:
    planted.model.add(*lines)
    return True


def _nsm1(planted: Planted) -> bool:
    kinds = {"PSHELL", "PBAR", "PCOMP"} & {c[0] for c in planted.model.cards}
    return bool(kinds) and _add(planted, f"NSM1,3,{sorted(kinds)[0]},-4.,1")


def _negative_mass(planted: Planted) -> bool:
    return _add(planted, f"CONM2,99001,{max(planted.model.places)},,-.4")


def _negative_density(planted: Planted) -> bool:
    return _property(planted, {"MAT1": 5}, "-2700.")


def _doubled(planted: Planted) -> bool:
    cards = planted.model.cards
    at = next((i for i, c in enumerate(cards) if c[0] in (*_SHELLS, *_SOLIDS)), None)
    if at is None:
        return False
    planted.model.cards += [
        [cards[at][0], "88001", *cards[at][2:]],
        *(c[:] for c in cards[at + 1 : at + 2] if not c[0]),
    ]
    return True


def _open_seam(planted: Planted) -> bool:
    """Elements beyond the middle get grid points of their own along it."""
    places = planted.model.places
    cards = planted.model.cards
    middle = sorted({round(p[0], 6) for p in places.values()})
    seam = {n for n, p in places.items() if abs(p[0] - middle[len(middle) // 2]) < 1e-6}
    changed = False
    for i, card in enumerate(cards):
        if card[0] not in (*_SHELLS, *_SOLIDS):
            continue
        parts = [card, *(cards[i + 1 : i + 2] if cards[i + 1 : i + 2] and not cards[i + 1][0] else [])]
        count = {"CTRIA3": 3, "CQUAD4": 4, "CHEXA": 8}[card[0]]
        where = [(part, k) for part in parts for k in range(3 if part[0] else 1, len(part))][:count]
        numbers = [int(part[k]) for part, k in where]
        if np.mean([places[n][0] for n in numbers]) > middle[len(middle) // 2] and seam & set(numbers):
            for part, k in where:
                part[k] = str(50000 + int(part[k])) if int(part[k]) in seam else part[k]
            changed = True
    for n in seam if changed else ():
        planted.model.add(f"GRID,{50000 + n},,{places[n][0]:.6f},{places[n][1]:.6f},{places[n][2]:.6f}")
    return changed


def _loose_part(planted: Planted) -> bool:
    if not planted.model.case:
        return False
    planted.model.add(*(f"GRID,{60000 + k},,{3 + (k in (2, 3))}.,{int(k > 2)}.,2." for k in range(1, 5)))
    return _add(planted, "PSHELL,77,1,.01,1,,1", "CQUAD4,88002,77,60001,60002,60003,60004")


def _reversed(planted: Planted) -> bool:
    if planted.model.name not in ("plate with offsets", "laminate"):
        return False
    card = planted.model.named("CQUAD4")[9]
    card[3:7] = card[6:2:-1]
    return True


def _wrong_end(planted: Planted) -> bool:
    places = planted.model.places
    held = {int(card[3]) for card in planted.model.named("SPC1")}
    ends = [n for n in places if n not in held]
    one = ends[0]
    far = max(ends, key=lambda n: float(np.linalg.norm(np.subtract(places[n], places[one]))))
    line = np.abs(np.subtract(places[far], places[one]))
    across = int(np.argmin(line)) + 1
    return _add(planted, f"CELAS2,99002,1000.,{one},{across},{far},{across}")


def _unselected(planted: Planted) -> bool:
    selected = "SPC = 1" in planted.model.case
    planted.model.case.clear()
    return selected


def _millimetres(planted: Planted) -> bool:
    model = planted.model
    if model.named("PSHELL") and model.named("PBAR"):
        return False  # the check compares whole models
    return (
        _scale(planted, {"PSHELL": (3,)}, 1e3)
        or (_scale(planted, {"PBAR": (3,)}, 1e6) and _scale(planted, {"PBAR": (4, 5, 6)}, 1e12))
    )  # fmt: skip


def _weight(planted: Planted) -> bool:
    return _scale(planted, {"MAT1": (5,)}, 9.80665)


def _other_units(planted: Planted) -> bool:
    return _scale(planted, {"MAT1": (2,)}, 1e-6) and _scale(planted, {"MAT1": (5,)}, 1e-12)


def _bounds(name: str, lower: str, upper: str) -> Callable[[Planted], bool]:
    def plant(planted: Planted) -> bool:
        planted.bounds = (name, lower, upper)
        return True

    return plant


def _table(name: str, keys: str) -> Callable[[Planted], bool]:
    def plant(planted: Planted) -> bool:
        planted.tables[name] = keys
        return True

    return plant


def _keys(line: str) -> Callable[[Planted], bool]:
    def plant(planted: Planted) -> bool:
        planted.configuration.append(line.replace("POINT", str(max(planted.model.places))))
        return True

    return plant


def _damping(factor: float) -> Callable[[Planted], bool]:
    def plant(planted: Planted) -> bool:
        modes = planted.test.modes
        assert modes is not None
        assert modes.damping_ratio is not None
        planted.test = replace(planted.test, modes=replace(modes, damping_ratio=factor * modes.damping_ratio))
        return True

    return plant


FAULTS = (
    Fault("non-structural mass below zero", ("deck.negative-value",),
          lambda p: _property(p, {"PSHELL": 8, "PBAR": 7, "PCOMP": 3}, "-4.")),
    Fault("NSM1 below zero", ("deck.negative-value",), _nsm1),
    Fault("mass below zero", ("deck.negative-value",), _negative_mass),
    Fault("density below zero", ("deck.negative-density",), _negative_density),
    Fault("PARAM G in percent", ("deck.large-loss-factor",), lambda p: _add(p, "PARAM,G,2.")),
    Fault("TABDMP1 in percent", ("deck.damping-doubtful",),
          lambda p: _add(p, "TABDMP1,5,CRIT", ",0.,1.5,500.,1.5,ENDT")),
    Fault("doubled element", ("deck.repeated-elements",), _doubled),
    Fault("seam that is not merged", ("deck.coincident-points",), _open_seam),
    Fault("part without support", ("deck.free-part",), _loose_part),
    Fault("reversed normal with an offset", ("deck.alternating-normals",), _reversed),
    Fault("spring with a wrong grid point", ("deck.far-ends",), _wrong_end),
    Fault("supports that are not selected", ("deck.inactive-set",), _unselected),
    Fault("sections in millimetres", ("deck.sections-doubtful",), _millimetres),
    Fault("density in weight units", ("study.units-doubtful",), _weight),
    Fault("materials in mm-t-s", ("study.units-doubtful",), _other_units),
    Fault("bounds in percent", ("parameter.meaningless-bound",), _bounds("MAT1 1 E", "-20", "20")),
    Fault("density that may vanish", ("parameter.meaningless-bound",), _bounds("MAT1 1 RHO", "0.0", "1.2")),
    Fault("position of sensors in millimetres", ("study.large-length",), _table("sensors", "position_sd = 3.0")),
    Fault("angle of 180°", ("study.large-angle",), _table("sensors", "angle_sd_deg = 180.0")),
    Fault("deviation of 100 %", ("study.large-sd",), _table("residuals", "frequency_sd = 1.0")),
    Fault("damping of the test in percent", ("test.damping-doubtful",), _damping(60.0)),
    Fault("damping of the test below zero", ("test.damping-doubtful",), _damping(-1.0)),
    Fault("added mass in grams", ("study.heavy-masses",), _keys("masses = [{ node = POINT, mass = 250.0 }]")),
    Fault("weighed mass of another structure", ("model.mass-differs",), _keys("weighed_mass = 1.0")),
)  # fmt: skip
"""The kinds of faults; a fault is found if one of its codes is told."""
