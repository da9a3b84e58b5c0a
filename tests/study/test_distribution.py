"""Studies of a pressed plate whose thickness varies: truth from a deck with a property card for each element."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem.random_field import FieldKernel, expansion
from femtune.files.nastran import build_structure, read_deck
from femtune.files.study_file import study_from_text
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.steps.run.result import RunResult
from femtune.study.study import read_study
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
    _folder(tmp_path, None)
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


def _random(text: str = 'random = { length = 0.3, kernel = "gaussian", terms = 3 }') -> str:
    return STUDY.replace('functions = ["1", "u", "1 - v**2"]', text)


@pytest.mark.parametrize("kernel", ["exponential", "gaussian"])
def test_an_expansion_holds_what_its_eigenvalues_say(kernel: FieldKernel) -> None:
    points = np.random.default_rng(2).random((60, 3)) * [1.0, 0.5, 0.0]
    distance = np.linalg.norm(points[:, None] - points, axis=2) / 0.4
    C = np.exp(-distance) if kernel == "exponential" else np.exp(-0.5 * distance**2)
    whole, all_of_it = expansion(points, 0.4, kernel, 60)
    np.testing.assert_allclose(whole @ whole.T, C, atol=1e-10)
    assert all_of_it == pytest.approx(1.0)
    few, part = expansion(points, 0.4, kernel, 5)
    np.testing.assert_allclose(few, whole[:, :5], atol=1e-8)
    values = np.sort(np.linalg.eigvalsh(C))[::-1]
    np.testing.assert_allclose(np.sum(few**2, axis=0), values[:5], rtol=1e-9)
    assert part == pytest.approx(values[:5].sum() / 60)
    # orthogonal, and nothing of the same size leaves less of the covariance
    gram = few.T @ few
    np.testing.assert_allclose(gram, np.diag(np.diag(gram)), atol=1e-9)
    assert np.linalg.norm(C - few @ few.T) == pytest.approx(np.sqrt(np.sum(values[5:] ** 2)))


@pytest.mark.slow
def test_a_random_field_is_found_from_modes(tmp_path: Path) -> None:
    """A thickness of three terms: the amplitudes that made the test are updated from zero."""
    _folder(tmp_path, None)
    true = {"thin1": 0.06, "thin2": -0.05, "thin3": 0.04}
    (tmp_path / "study.toml").write_text(_random())
    study = read_study(tmp_path / "study.toml")
    problem = study.problem()
    x = study.parameters.normalise([true[p.name] for p in study.parameters.free])
    state = problem.follow(x, problem.start(np.zeros(3))).states[0]
    shapes = state.case.sensors @ state.solution.shapes[:, :_COUNT]
    modes = ModeSet(state.solution.freq_hz[:_COUNT], shapes, state.case.test.dofs)
    nodes = range(3, (NX + 1) * (NY + 1) + 1, 4)
    test = measured(tmp_path / "true.bdf", tuple(f"{n}Z+" for n in nodes if n % (NX + 1) != 1), _COUNT)
    write_uff_modes(tmp_path / "plate.uff", replace(test, modes=modes))
    found = ft.update(tmp_path / "study.toml", output=tmp_path / "run")
    assert found.values == pytest.approx(true, abs=2e-4)
    (notice,) = [n for n in study.built.notices if n.code == "distribution.share"]
    check_shown("distribution.share", str(notice).replace(str(tmp_path), "FOLDER"))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("distribution.one-kind", 'functions = ["1"]\nrandom = { length = 0.3 }'),
        ("distribution.one-kind, none", ""),
    ],
)
def test_one_kind_of_functions(tmp_path: Path, name: str, text: str) -> None:
    with pytest.raises((FemtuneError, FemtuneErrors)) as caught:
        study_from_text(_random(text), tmp_path / "study.toml")
    errors = caught.value.errors if isinstance(caught.value, FemtuneErrors) else [caught.value]
    error = next(e for e in errors if e.code == "distribution.one-kind")
    check_shown(name, str(error).replace(str(tmp_path), "FOLDER"))


def test_a_random_field_needs_as_many_elements_as_terms(tmp_path: Path) -> None:
    text = _random('random = { length = 0.3, terms = 3 }\nelements = "1 THRU 2"')
    _folder(tmp_path, None)
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        read_study(tmp_path / "study.toml")
    check_shown("distribution.random", str(caught.value).replace(str(tmp_path), "FOLDER"))
