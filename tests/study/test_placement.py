"""[sensors] position_sd and angle_sd_deg: in the weights of shape residuals, results and report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.residuals.weights import ResidualBlock
from femtune.steps.correlate.versions import start
from femtune.study.progress import silent
from femtune.study.solved import nominal
from femtune.study.study import read_study

from .cantilever import EI, Bench, modes_of_deck

SHAPES = '[[residual]]\nkind = "shape"\nsd = 0.01\n{}'


def _blocks(study: Path) -> list[ResidualBlock]:
    found = start(read_study(study), silent)
    return [b for b in found.blocks if b.kind == "shape"]


def _slopes(bench: Bench, labels: list[str], count: int = 4) -> np.ndarray:
    """∂u_y/∂x = RZ and ∂u_z/∂x = −RY at the sensors, of the modes of the deck."""
    shapes = modes_of_deck(bench.folder / "beam.bdf", count)[1].reshape(5, 6, -1)
    rows = [(int(label[0]) - 1, label[1]) for label in labels]
    return np.array([shapes[n, 5] if d == "Y" else -shapes[n, 4] for n, d in rows])[:, :count]


def test_the_covariance_of_a_shape_residual_has_the_slopes_of_the_mode(bench: Bench) -> None:
    deck = bench.folder / "beam.bdf"
    test = bench.measure(deck)
    bench.uff(test)
    study = bench.study(
        EI + "[sensors]\nposition_sd = 0.02\n" + SHAPES.format('scaling = "mass"\nmass_scaled = true\n')
    )
    found = start(read_study(study), silent)
    assert test.modes is not None
    labels = test.modes.dofs.labels()
    slopes = _slopes(bench, list(labels))
    for block, psi, slope in zip([b for b in found.blocks if b.kind == "shape"], test.modes.shapes.T, slopes.T):
        size = np.linalg.norm(psi)
        wanted = 1e-4 + (0.02 * slope / size) ** 2
        assert block.sd == pytest.approx(np.sqrt(np.mean(wanted)), rel=1e-3)


@pytest.mark.parametrize("scaling", ["unit-norm", "largest-entry", "scale-factor"])
@pytest.mark.slow
def test_residuals_of_displaced_sensors_have_unit_covariance(bench: Bench, scaling: str) -> None:
    """|r|² of shapes read beside the grid points, with and without the stated deviation of the position."""
    deck, sigma = bench.folder / "beam.bdf", 0.01
    test = bench.measure(deck, count=3)
    assert test.modes is not None
    slopes = _slopes(bench, list(test.modes.dofs.labels()), 3)
    rng, plain, stated = np.random.default_rng(2), [], []
    nodes = [d.node for d in test.modes.dofs]
    for _ in range(12):
        shift = {n: sigma * rng.standard_normal() for n in set(nodes)}
        moved = test.modes.shapes + np.array([shift[n] for n in nodes])[:, None] * slopes
        size = np.abs(moved).max(axis=0) if scaling == "largest-entry" else np.linalg.norm(moved, axis=0)
        moved = moved + 1e-4 * size * rng.standard_normal(moved.shape)
        bench.uff(replace(test, modes=replace(test.modes, shapes=moved)))
        shapes = f'[[residual]]\nkind = "shape"\nsd = 1e-4\nscaling = "{scaling}"\n'
        stated += [b.whitened() for b in _blocks(bench.study(f"{EI}[sensors]\nposition_sd = {sigma}\n{shapes}"))]
        plain += [b.whitened() for b in _blocks(bench.study(EI + shapes))]
    freedom = sum(len(b.values) - b.lost for b in stated)
    assert freedom == 12 * 3 * 7
    assert sum(float(b.values @ b.values) for b in stated) / freedom == pytest.approx(1.0, abs=0.25)
    assert sum(float(b.values @ b.values) for b in plain) / freedom > 50.0


def test_the_jacobian_is_weighted_like_the_residuals(beam: Bench) -> None:
    """Central differences of the residuals, whose weights stay those of the start."""
    study = read_study(
        beam.study(f"{EI}[sensors]\nposition_sd = 0.01\nangle_sd_deg = 1.0\n[residuals]\nshape_sd = 0.01\n")
    )
    problem = study.problem()
    x = nominal(study)
    at, h = problem.start(x), 1e-5
    for k in range(2):
        step = h * np.eye(2)[k]
        slope = (problem.follow(x + step, at).residuals - problem.follow(x - step, at).residuals) / (2.0 * h)
        np.testing.assert_allclose(at.jacobian[:, k], slope, atol=2e-6 * np.abs(slope).max())


@pytest.mark.slow
def test_results_and_report_have_the_effect_of_the_placement(beam: Bench) -> None:
    study = beam.study(
        f"{EI}[sensors]\nposition_sd = {{ 5 = 0.01 }}\nangle_sd_deg = 2.0\n[residuals]\nshape_sd = 0.01\n"
    )
    result = ft.run(study)
    found = result.results.correlations[0].placement
    assert found is not None
    assert found.position_sd == (0.0, 0.01)
    assert found.angle_sd_deg == pytest.approx((2.0, 2.0))
    assert [m.test_label for m in found.modes] == ["1", "2", "3", "4"]
    assert all(0.0 < m.sd_percent <= m.largest_percent and 0.0 < m.mac_loss < 0.1 for m in found.modes)
    assert result.status == "CONVERGED"
    assert list(result.values.values()) == pytest.approx([1.3, 0.85], rel=1e-3)
    assert "effect of the placement of the sensors" in (result.folder / "report.html").read_text()


@pytest.mark.slow
def test_the_stated_deviation_lowers_the_weight_of_shapes(beam: Bench) -> None:
    def scale(tail: str) -> float:
        return _blocks(beam.study(f"{EI}{tail}[residuals]\nshape_sd = 0.01\n"))[0].sd

    shape = read_study(beam.study(f"{EI}[residuals]\nshape_sd = 0.01\n")).problem().cases[0].test.shapes[:, 0]
    # relative to the largest entry, in the scale of unit norm
    assert scale("") == pytest.approx(0.01 * np.abs(shape).max() / np.linalg.norm(shape))
    assert scale("[sensors]\nposition_sd = 0.05\n") > 0.015


@pytest.mark.slow
def test_sensors_that_are_held_out_and_reduced_models_keep_the_covariance(beam: Bench) -> None:
    tail = '[sensors]\nposition_sd = 0.01\n[residuals]\nshape_sd = 0.01\n[[hold_out]]\nsensors = ["3Z+"]\n[reduction]\n'
    result = ft.update(beam.study(EI + tail))
    assert result.status == "CONVERGED"
    assert list(result.values.values()) == pytest.approx([1.3, 0.85], rel=1e-3)


@pytest.mark.parametrize(
    ("key", "code"),
    [
        ("position_sd = -0.1", "study.value"),
        ('position_sd = "1 mm"', "study.type"),
        ("angle_sd_deg = { 5 = -1.0 }", "study.value"),
        ("position_sd = { 77 = 0.01 }", "sensor.placement-unknown"),
        ("angle_sd_deg = nan", "study.value"),
        ("angle_sd_deg = { tip = 1.0 }", "study.type"),
        ("position_sd = { 5 = true }", "study.type"),
    ],
)
def test_bad_values_are_errors(beam: Bench, key: str, code: str) -> None:
    with pytest.raises(FemtuneError) as error:
        ft.correlate(beam.study(f"{EI}[sensors]\n{key}\n"))
    assert error.value.code == code
    check_shown(f"{code}, placement of sensors: {key}", str(error.value).replace(f"{beam.folder}/", ""))
    assert error.value.where is not None
