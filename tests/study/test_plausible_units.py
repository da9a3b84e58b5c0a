"""Units that contradict the materials of the deck, the frequencies or the coordinates of the test."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.correlation.pairing import pair_modes
from femtune.correlation.unit_factor import FACTORS, unit_factor
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.study.plausible_units import COMMON, SYSTEMS
from femtune.study.study import load_study
from femtune.units import unit_system

from .cantilever import EI, Bench

MATERIAL = "MAT1    1       2.1+11          0.3     7850."


def _notices(bench: Bench, material: str, units: str, more: str = "") -> list[str]:
    text = bench.text.replace(MATERIAL, material).replace("ENDDATA", f"{more}ENDDATA")
    bench.write("beam.bdf", text)
    study = bench.study("", test=None).read_text().replace("m-kg-s", units)
    found = load_study(bench.write("study.toml", study)).notices
    return [n.what.partition("which no material has in ")[2] for n in found if n.code == "study.units-doubtful"]


def _mat1(modulus: float, density: float) -> str:
    return f"MAT1*   1               {modulus:16.9E}                {0.3:16.3f}\n*       {density:16.9E}"


MIXED = "the modulus is that of steel in mm-t-s, but the density in m-kg-s"
WRONG = {
    "tonnes and millimetres": ((2.1e5, 7.85e-9), "m-kg-s", "", "in mm-t-s they are those of steel"),
    "kilograms and millimetres": ((2.1e8, 7.85e-6), "mm-t-s", "", "in mm-kg-s they are those of steel"),
    "SI in a study of millimetres": ((7.0e10, 2700.0), "mm-t-s", "", "in m-kg-s they are those of aluminium"),
    "inches": ((1.0e7, 2.54e-4), "m-kg-s", "", "in in-slinch-s they are those of aluminium"),
    "kips and inches": ((29000.0, 7.34e-7), "m-kg-s", "", "in in-kip-s they are those of steel"),
    "kips and feet": ((4.176e6, 0.01523), "m-kg-s", "", "in ft-kip-s they are those of steel"),
    "weight in inches": ((3.0e7, 0.283), "in-slinch-s", "", "PARAM WTMASS = 0.0025901"),
    "weight in millimetres": ((2.1e5, 7.7e-5), "mm-t-s", "", "PARAM WTMASS = 0.00010197"),
    "weight in SI": ((2.1e11, 77000.0), "m-kg-s", "", "PARAM WTMASS = 0.10197"),
    "modulus in MPa": ((2.1e5, 7850.0), "m-kg-s", "", MIXED),
    "density in kg/m³": ((2.1e5, 7850.0), "mm-t-s", "", MIXED),
    "density in g/cm³": ((2.1e11, 7.85e-6), "m-kg-s", "", "but the density in mm-kg-s"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("values", "units", "fitting", "common"),
    [
        ((2.1e5, 7.85e-9), "mm-kg-s", "mm-t-s", "steel"),
        ((7.0e4, 2.7e-9), "mm-kg-s", "mm-t-s", "aluminium"),
        ((2.1e8, 7.85e-6), "mm-t-s", "mm-kg-s", "steel"),
    ],
)
def test_metals_of_other_units_that_are_possible_are_warned_of(
    bench: Bench, values: tuple[float, float], units: str, fitting: str, common: str
) -> None:
    text = bench.text.replace(MATERIAL, _mat1(*values))
    bench.write("beam.bdf", text)
    study = bench.write("study.toml", bench.study("", test=None).read_text().replace("m-kg-s", units))
    (what,) = [n.what for n in load_study(study).notices if n.code == "study.units-doubtful"]
    assert what.endswith(f'in {fitting} they are those of {common}: write units = "{fitting}" in [study]')


@pytest.mark.parametrize("name", WRONG)
def test_materials_of_other_units_are_warned_of(bench: Bench, name: str) -> None:
    values, units, more, text = WRONG[name]
    (what,) = _notices(bench, _mat1(*values), units, more)
    assert what.startswith(units)
    assert text in what


@pytest.mark.quick(9)
@pytest.mark.parametrize("name", COMMON)
@pytest.mark.parametrize("units", [*SYSTEMS, "mm-g-s", "m-t-s"])
def test_common_materials_in_their_units_are_not(bench: Bench, name: str, units: str) -> None:
    e_low, e_high, rho_low, rho_high = COMMON[name]
    system = unit_system(units)
    for e, rho in ((e_low, rho_high), (e_high, rho_low)):
        values = e * system.length**2 / system.force, rho * system.length**3 / system.mass
        assert _notices(bench, _mat1(*values), units) == []


@pytest.mark.parametrize(
    ("values", "more"),
    [((1.0, 1.0), ""), ((1e3, 1.0), ""), ((2.1e11, 21000.0), ""), ((1e6, 1100.0), ""), ((1e15, 7850.0), ""),
     ((2e5, 1000.0), ""), ((3e7, 40.0), ""), ((5e8, 50.0), ""), ((2.1e11, 0.0), ""), ((2.1e11, 1e-6), ""),
     ((2.1e5, 7.85e-9), "MAT1,2,7.+10,,.3,2700.\nCROD,90,9,1,2\nPROD,9,2,1.-6\n"), ((2.1e11, 40000.0), "")],
)  # fmt: skip
def test_fictitious_and_unusual_materials_are_not(bench: Bench, values: tuple[float, float], more: str) -> None:
    """Smeared masses, rubber, foam, rigid bars, unit values, massless ones, and any beside a possible material."""
    assert _notices(bench, _mat1(*values), "m-kg-s", more) == []


@pytest.mark.parametrize(
    ("name", "values"),
    [("", (2.1e5, 7.85e-9)), (", weight density", (2.1e11, 77000.0)), (", two systems", (2.1e5, 7850.0))],
)
def test_the_message(bench: Bench, name: str, values: tuple[float, float]) -> None:
    bench.write("beam.bdf", bench.text.replace(MATERIAL, _mat1(*values)))
    (notice,) = [n for n in load_study(bench.study("", test=None)).notices if n.code == "study.units-doubtful"]
    check_shown(f"study.units-doubtful{name}", str(notice).replace(f"{bench.folder}/", ""))


def test_info_shows_it(bench: Bench) -> None:
    bench.write("beam.bdf", bench.text.replace(MATERIAL, _mat1(2.1e5, 7.85e-9)))
    found = ft.info(bench.study("", test=None))
    assert [n.level for n in found.notices if n.code == "study.units-doubtful"] == ["warning"]
    assert "warning: MAT1 1 has the modulus" in repr(found)


def test_weight_density_with_wtmass_is_right(bench: Bench) -> None:
    assert _notices(bench, _mat1(3.0e7, 0.283), "in-slinch-s", "PARAM,WTMASS,.00259\n") == []


def test_a_deck_alone_has_no_declared_units(bench: Bench) -> None:
    bench.write("beam.bdf", bench.text.replace(MATERIAL, _mat1(2.1e5, 7.85e-9)))
    assert [n for n in load_study(bench.folder / "beam.bdf").notices if "units" in n.code] == []


# ----------------------------------------------------------------------------------------------------
# The ratio of frequencies.

SHAPES = np.linalg.qr(np.random.default_rng(5).standard_normal((9, 6)))[0]
HZ = np.array([10.0, 17.0, 31.0, 44.0, 60.0, 77.0])


def _modes(freq: Any, columns: Any = range(6)) -> ModeSet:
    return ModeSet(np.asarray(freq), SHAPES[:, list(columns)], DofSet.parse(f"{n}Z+" for n in range(1, 10)))


def _factor(test: ModeSet, model: ModeSet) -> list[str]:
    return [n.what for n in unit_factor(test, model, pair_modes(test, model))]


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("inverse", [1, -1])
def test_ratios_of_mistaken_units(factor: float, inverse: int) -> None:
    off = np.array([1.03, 0.96, 1.05, 0.99, 1.0, 0.97])
    (what,) = _factor(_modes(HZ), _modes(HZ * off * factor**inverse))
    assert ("higher" if inverse > 0 else "lower") in what
    assert FACTORS[factor] in what


@pytest.mark.parametrize("factor", [0.5, 0.7, 1.0, 1.4, 2.0, 2.6, 4.2, 10.0, 15.0])
def test_other_ratios_are_not(factor: float) -> None:
    assert _factor(_modes(HZ), _modes(HZ * factor)) == []


def test_shapes_that_differ_or_ratios_that_scatter_are_not() -> None:
    assert _factor(_modes(HZ[:3], [0, 1, 2]), _modes(31.6 * HZ[:3], [3, 4, 5])) == []
    assert _factor(_modes(HZ), _modes(31.6 * HZ * np.array([1.0, 1.5, 0.6, 1.3, 0.7, 1.0]))) == []
    assert _factor(_modes(HZ[:1], [0]), _modes(31.6 * HZ)) == []


@pytest.mark.slow
def test_the_correlation_says_it(bench: Bench) -> None:
    text = bench.text.replace("CONM2   9       5               2.0\n", "")
    bench.write("beam.bdf", text.replace(MATERIAL, _mat1(2.1e11, 7.85)))
    bench.uff(bench.measure(bench.truth((), text)))
    (found,) = ft.correlate(bench.study("")).records
    (alert,) = [n for n in found.alerts if n.code == "correlate.unit-factor"]
    assert "31.62 times higher" in alert.sentence
    with pytest.raises(FemtuneError) as caught:
        ft.run(bench.study(EI))
    assert caught.value.code == "correlate.no-pairs"
    assert "31.62 times higher" in str(caught.value.hint)


# ----------------------------------------------------------------------------------------------------
# Coordinates.


def _sensors(bench: Bench, factor: float, more: str) -> None:
    made = bench.measure(bench.truth(()))
    geometry = replace(made.geometry, coordinates=factor * made.geometry.coordinates)
    bench.uff(replace(made, geometry=geometry))
    load_study(bench.study(more))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-3, 1e3, 0.0254, 1.0 / 25.4, 12.0, 0.3048])
def test_coordinates_of_sensors_by_number(bench: Bench, factor: float) -> None:
    with pytest.raises(FemtuneError) as caught:
        _sensors(bench, factor, "[sensors]\nby_id = true\n")
    assert caught.value.code == "sensor.too-far"
    assert f"factor {1.0 / factor:.6g}" in caught.value.hint


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.5, 0.7, 5.0])
def test_coordinates_that_no_unit_explains(bench: Bench, factor: float) -> None:
    with pytest.raises(FemtuneError) as caught:
        _sensors(bench, factor, "[sensors]\nby_id = true\n")
    assert caught.value.code == "sensor.too-far"
    assert "factor" not in caught.value.hint


def test_sensors_that_fall_on_one_grid_point(bench: Bench) -> None:
    """Metres in a model of millimetres with a wide tolerance: all sensors are at the root."""
    with pytest.raises(FemtuneError) as caught:
        _sensors(bench, 1e-3, "[sensors]\ntolerance = 0.3\n")
    assert caught.value.code == "sensor.one-grid"
    assert 'write units = "mm-t-s" in [study]' in caught.value.hint


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "words"), [(1e3, "millimetres where the model has metres"), (40.0, "inches")])
def test_the_error_of_unmatched_sensors_says_it_too(bench: Bench, factor: float, words: str) -> None:
    made = bench.measure(bench.truth(()))
    places = factor * made.geometry.coordinates + np.array([0.0, 0.04 * factor, 0.0])
    bench.uff(replace(made, geometry=replace(made.geometry, coordinates=places)))
    with pytest.raises(FemtuneError) as caught:
        load_study(bench.study())
    assert caught.value.code == "sensor.unmatched"
    assert words in str(caught.value.hint)


# ----------------------------------------------------------------------------------------------------
# Sections and coordinates in different units of length: a beam of 1 m and 77 mm.


def _with_coordinates(bench: Bench, factor: float) -> Path:
    text = bench.text
    for x in ("0.25", "0.5", "0.75", "1.0"):
        text = text.replace(f"               {x:<8}0.0", f"               {factor * float(x):<8.3f}0.0")
    return bench.write("beam.bdf", text)


def _doubtful(sentences: Iterable[str]) -> list[str]:
    return [s for s in sentences if "deck.sections-doubtful" in s]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factor", "told"), [(1000.0, True), (0.01, True), (1.001, False), (25.4, False), (0.04, False)]
)
def test_sections_in_another_unit_than_coordinates_are_told_by_info(bench: Bench, factor: float, told: bool) -> None:
    found = ft.info(_with_coordinates(bench, factor)).record.notices
    assert ["sections-doubtful" in n.code for n in found if n.level == "warning"] == [True] * told


def test_a_large_area_or_moment_without_effect_is_not(bench: Bench) -> None:
    bench.write("beam.bdf", bench.text.replace("1.0-3   2.0-7   5.0-7", "1.0+6   2.0-7   5.0-7"))
    assert load_study(bench.folder / "beam.bdf").notices == ()
    bench.write("beam.bdf", bench.text.replace("1.0-3   2.0-7   5.0-7", "1.0-3   2.0+3   5.0+3"))
    assert load_study(bench.folder / "beam.bdf").notices == ()


def test_modes_and_correlate_tell_it_too_also_with_an_error(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _with_coordinates(beam, 1000.0)
    (sentence,) = _doubtful(map(str, ft.modes(path).remarks))
    check_shown("deck.sections-doubtful", sentence)

    def fail(*_: Any, **__: Any) -> None:
        raise FemtuneError("eigen.inaccurate", mode=1, residual=1.0)

    monkeypatch.setattr("femtune.steps.correlate.function.model_records", fail)
    with pytest.raises(FemtuneError) as caught:
        ft.correlate(beam.study("[sensors]\nby_id = true\ntolerance = 1e4\n"))
    assert _doubtful(caught.value.__notes__) == [sentence]


def test_what_is_doubtful_is_told_with_the_error_that_it_causes(beam: Bench) -> None:
    """Coordinates times 1000: all sensors lie nearest to the root."""
    _with_coordinates(beam, 1000.0)
    with pytest.raises(FemtuneError) as caught:
        load_study(beam.study())
    assert caught.value.code == "sensor.one-grid"
    assert [n.code for n in caught.value.notices] == ["deck.sections-doubtful"]


def test_a_lowest_mode_that_no_structure_has_is_told_by_modes(bench: Bench) -> None:
    """Coordinates times 400: f L/c of a cantilever is 1.875²/(2π) sqrt(I/A)/L; 2 kg at its tip have no effect."""
    made = ft.modes(_with_coordinates(bench, 400.0))
    assert _doubtful(map(str, made.remarks)) == []
    (alert,) = (a for a in made.records[0].alerts if a.code == "deck.sections-doubtful")
    ratio = 1.8751**2 / (2.0 * np.pi) * (2e-7 / 1e-3) ** 0.5 / 400.0
    assert f"is {ratio:.1g};" in alert.sentence
    check_shown("deck.sections-doubtful, slow", f"[{alert.code}] {alert.sentence}")


def test_the_lowest_mode_of_a_beam_is_not(bench: Bench) -> None:
    alerts = ft.modes(_with_coordinates(bench, 50.0)).records[0].alerts
    assert [a for a in alerts if a.code == "deck.sections-doubtful"] == []
