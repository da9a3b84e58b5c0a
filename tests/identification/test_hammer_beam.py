"""A free beam hit by a roving hammer; its functions lie beside the checkout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.identification import (
    Limits,
    ModalFit,
    Rule,
    as_modes,
    choose,
    chosen_poles,
    driving_points,
    fit_modes,
    join_tables,
    n4sid_poles,
    normal_equations,
    plscf_poles,
    scaled_shapes,
    subspace,
)
from femtune.identification.shapes import fit_remarks
from femtune.modal import FrfSet, mac

pytestmark = pytest.mark.slow

_STATED_HZ = (112.0, 307.0, 596.0, 974.0)
"""What the owners of the data state, as bands around these."""


@pytest.fixture(scope="module")
def fit(shared_data: Path) -> ModalFit:
    """Every fifth of the lines between 65 and 985 Hz; by reciprocity the hit points are the responses."""
    with np.load(shared_data / "hammer_beam" / "frf_9pts.npz") as file:
        lines, values = file["frequency"], file["accelerance"]
    keep = np.flatnonzero((lines >= 65.0) & (lines <= 985.0))[::5]
    points = DofSet.parse(f"{i + 1}X+" for i in range(9))
    # the accelerometer sits at 0.5 m, where the fourth hit is, and looks the other way
    frfs = FrfSet(lines[keep], values[:, None, keep], points, DofSet.parse(["4X-"]), "accelerance")
    table = join_tables(
        [
            n4sid_poles(subspace(frfs, 60), range(2, 61, 2)),
            plscf_poles(normal_equations(frfs, 30), range(2, 31)),
        ]
    )
    return fit_modes(frfs, chosen_poles(choose(table, Limits(), Rule(collinearity=0.9)), table).poles)


def test_four_modes_within_half_a_percent_of_what_its_owners_state(fit: ModalFit) -> None:
    modes = as_modes(fit)
    assert len(modes) == 4
    np.testing.assert_allclose(modes.freq_hz, _STATED_HZ, rtol=5e-3)
    assert modes.damping_ratio is not None
    assert (modes.damping_ratio < 5e-4).all()


def test_the_driving_point_has_positive_modal_mass(fit: ModalFit) -> None:
    made = scaled_shapes(fit, driving_points(fit.measured))
    assert made.mass_normalised
    assert (made.mass_sign > 0.99).all()


def _free_beam(order: int) -> np.ndarray:
    """Euler's beam at the hits; they lie evenly about 0.65 m, so it is 1.3 m long."""
    root = (4.730040745, 7.853204624, 10.99560784, 14.13716549)[order]
    x = root / 1.3 * np.array([0.1, 0.25, 0.375, 0.5, 0.65, 0.8, 0.925, 1.05, 1.2])
    s = (np.cosh(root) - np.cos(root)) / (np.sinh(root) - np.sin(root))
    return np.cosh(x) + np.cos(x) - s * (np.sinh(x) + np.sin(x))


def test_shapes_are_those_of_a_free_beam(fit: ModalFit) -> None:
    shapes = as_modes(fit).shapes
    assert min(mac(shapes[:, [r]], _free_beam(r)[:, None])[0, 0] for r in range(4)) > 0.975


def test_the_hits_disagree_by_more_than_noise(fit: ModalFit) -> None:
    """The beam got lower from hit to hit, by 4 to 10 in 100,000: the bars of all nine must cover that, and are told."""
    told = [r for r in fit_remarks(fit, scaled_shapes(fit)) if r.notice.code == "identify.functions-disagree"]
    assert len(told) == 4
    frfs, alone = fit.measured, []
    for i in range(9):
        one = FrfSet(frfs.freq_hz, frfs.values[[i]], frfs.responses.select([i]), frfs.references, frfs.kind)
        alone.append(as_modes(fit_modes(one, fit.poles)).freq_hz)
    drift = np.polyfit(np.arange(8), np.array(alone)[1:], 1)[0]
    assert (drift < 0.0).all()
    scatter = np.std(alone, axis=0) / 3.0
    sd = as_modes(fit).freq_sd_hz
    assert sd is not None
    assert (sd > 0.1 * scatter).all()
