"""Studies of a pressed plate whose thickness varies: truth from a deck with a property card for each element."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.nastran import build_structure, read_deck
from femtune.files.study_file import study_from_text
from femtune.files.uff import write_uff_modes
from femtune.steps.run.result import RunResult
from structures.pressed_plate import NX, NY, TRUTH, plate

from .cantilever import measured

SD = 5e-4
_COUNT = 8

STUDY = f"""
[study]
title = "Pressed plate"
deck = "plate.bdf"
units = "m-kg-s"
journal = false

[test]
file = "plate.uff"

[modes]
count = {_COUNT}

[[distribution]]
name = "THIN"
fields = ["PSHELL 1 T"]
functions = ["1", "u", "1 - v**2"]

[residuals]
frequency_sd = {SD}
shape_sd = 2e-3
""" + "".join(
    f'[[parameter]]\nname = "thin{j}"\nfields = ["DISTRIBUTION THIN F{j}"]\n'
    "absolute = true\nlower = -0.3\nupper = 0.3\n"
    for j in (1, 2, 3)
)


def _folder(folder: Path, seed: int | None) -> Path:
    (folder / "plate.bdf").write_text(plate(varied=False))
    (folder / "true.bdf").write_text(plate(varied=True))
    nodes = range(3, (NX + 1) * (NY + 1) + 1, 4)
    test = measured(folder / "true.bdf", tuple(f"{n}Z+" for n in nodes if n % (NX + 1) != 1), _COUNT)
    if seed is not None:
        rng, modes = np.random.default_rng(seed), test.modes
        assert modes is not None
        size = np.abs(modes.shapes).max(axis=0)
        freq = modes.freq_hz * (1.0 + SD * rng.standard_normal(_COUNT))
        shapes = modes.shapes + 1e-3 * size * rng.standard_normal(modes.shapes.shape)
        test = type(test)(
            test.name, test.units, test.geometry, modes=type(modes)(freq, shapes, modes.dofs)
        )  # fmt: skip
    write_uff_modes(folder / "plate.uff", test)
    return folder


def _run(folder: Path, text: str = STUDY) -> RunResult:
    (folder / "study.toml").write_text(text)
    return ft.run(folder / "study.toml")


@pytest.mark.slow
def test_the_thickness_of_every_element_is_found(tmp_path: Path) -> None:
    """Without noise exactly; the updated deck has the thickness of each element."""
    run = _run(_folder(tmp_path, None), STUDY + "[write]\nwide = true\n")
    assert [run.values[f"thin{j}"] for j in (1, 2, 3)] == pytest.approx(TRUTH, abs=1e-5)
    written = build_structure(read_deck(run.folder / "updated.bdf")).structure
    truth = build_structure(read_deck(tmp_path / "true.bdf")).structure
    for number in range(1, NX * NY + 1):
        one, two = (_thickness_of(s, number) for s in (written, truth))
        assert one == pytest.approx(two, rel=1e-5)


def _thickness_of(structure, number: int) -> float:  # type: ignore[no-untyped-def]
    batch = next(b for b in structure.batches if number in b.ids)
    return float(structure.values.values[batch.roles["t"][batch.ids.tolist().index(number)]])


@pytest.mark.long
def test_with_noise_and_reduced_models_the_truth_lies_within_the_stated_deviations(tmp_path: Path) -> None:
    run = _run(_folder(tmp_path, 3), STUDY + "[reduction]\n")
    assert run.results.update is not None
    for p, true in zip(run.results.update.parameters, TRUTH, strict=True):
        assert p.sd is not None
        assert abs(p.value - true) < 3.5 * p.sd < 0.05
    assert run.results.write_back is not None
    assert len(run.results.write_back.new_cards) == NX * NY


@pytest.mark.parametrize(
    ("code", "old", "new"),
    [
        ("distribution.field", "[residuals]", 'elements = "1 THRU 3"\n[residuals]'),
        ("distribution.function", '"1 - v**2"', '"1 - s**2"'),
        ("distribution.unknown", "DISTRIBUTION THIN F3", "DISTRIBUTION THICK F3"),
        ("distribution.factor", 'F3"]\nabsolute = true', 'F3"]'),
        ("distribution.unused", "[residuals]", '[[distribution]]\nname = "OTHER"\nfields = ["PSHELL 1 T"]\n'
         'functions = ["1"]\n[residuals]'),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(code: str, old: str, new: str, tmp_path: Path) -> None:
    assert old in STUDY
    text = STUDY.replace(old, new).replace('[test]\nfile = "plate.uff"\n', "")
    if code == "distribution.field":
        text += '[[distribution]]\nname = "AGAIN"\nfields = ["PSHELL 1 T"]\nfunctions = ["1"]\nelements = [1, 2]\n'
        text += (
            '[[parameter]]\nname = "b"\nfields = ["DISTRIBUTION AGAIN F1"]\nabsolute = true\nlower = -1\nupper = 1\n'
        )
        text = text.replace("lower = -1\nupper = 1\n", "lower = -0.5\nupper = 0.5\n")
    (tmp_path / "plate.bdf").write_text(plate(varied=False))
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        ft.modes(study_from_text(text, tmp_path / "study.toml").path)
    errors = caught.value.errors if isinstance(caught.value, FemtuneErrors) else (caught.value,)
    found = next(error for error in errors if error.code == code)
    check_shown(code, str(found).replace(str(tmp_path), "."))


def test_functions_without_a_value_are_refused(tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(plate(varied=False))
    text = STUDY.replace('[test]\nfile = "plate.uff"\n', "").replace('"1 - v**2"', '"sqrt(u)"')
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(FemtuneError, match="function 3 is not finite at element 1"):
        ft.modes(tmp_path / "study.toml")


@pytest.mark.parametrize(
    ("bounds", "said"),
    [
        ((-0.3, 0.3, -0.6, 0.5, -0.3, 0.3), "lower of thin2 above"),
        ((-0.9, 0.3, -0.9, 0.9, -0.9, 0.9), "are multiplied by less than"),
        ((-0.3, 1e300, -0.3, 0.3, -0.3, 0.3), "at most 10000 times is allowed"),
        ((-1e300, 1e300, -1e300, 1e300, -1e300, 1e300), "are multiplied by less than"),
    ],
)
def test_bounds_within_which_a_thickness_is_negative_or_huge_are_refused(
    bounds: tuple[float, ...], said: str, tmp_path: Path
) -> None:
    (tmp_path / "plate.bdf").write_text(plate(varied=False))
    head = STUDY[: STUDY.index("[[parameter]]")].replace('[test]\nfile = "plate.uff"\n', "")
    tables = (
        f'[[parameter]]\nname = "thin{j + 1}"\nfields = ["DISTRIBUTION THIN F{j + 1}"]\nabsolute = true\n'
        f"lower = {bounds[2 * j]!r}\nupper = {bounds[2 * j + 1]!r}\n"
        for j in range(3)
    )
    (tmp_path / "study.toml").write_text(head + "".join(tables))
    with pytest.raises(FemtuneError) as caught:
        ft.modes(tmp_path / "study.toml")
    assert caught.value.code.startswith("distribution.range")
    assert said in str(caught.value)
    if bounds[3] == 0.5:
        check_shown("distribution.range", str(caught.value).replace(str(tmp_path), "."))


@pytest.mark.slow
def test_the_bound_that_makes_a_thickness_positive_does(tmp_path: Path) -> None:
    (tmp_path / "plate.bdf").write_text(plate(varied=False))
    text = STUDY.replace('[test]\nfile = "plate.uff"\n', "").replace("lower = -0.3", "lower = -0.5", 1)
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(FemtuneError, match="lower of thin1 above") as caught:
        ft.modes(tmp_path / "study.toml")
    limit = float(str(caught.value).rsplit("above ", 1)[1].split()[0])
    (tmp_path / "study.toml").write_text(text.replace("lower = -0.5", f"lower = {limit + 1e-3}"))
    assert ft.modes(tmp_path / "study.toml").freq_hz[0] > 0.0
    (tmp_path / "study.toml").write_text(text.replace("lower = -0.5", f"lower = {limit - 1e-3}"))
    with pytest.raises(FemtuneError, match="in the deck"):
        ft.modes(tmp_path / "study.toml")
