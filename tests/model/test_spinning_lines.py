"""A free straight line of bars turns about itself without stiffness or mass: AUTOSPC holds it, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.deck_models import model_of

from femtune.model import solve_modes
from femtune.model.configured import ConfiguredModel

N, LENGTH, E, RHO, A, I1 = 40, 4.0, 7.0e10, 2700.0, 1e-3, 8e-8
# roots of cosh x cos x = 1
ROOTS = np.array([4.730040744862704, 7.853204624095838, 10.995607838001671])


def line(folder: Path, *more: str, autospc: str = "YES", cards: str = "PARAM,COUPMASS,1") -> ConfiguredModel:
    """A free beam along an oblique line, every other point in a rotated displacement frame."""
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    grids = [
        f"GRID,{i + 1},,{x[0]:.12f},{x[1]:.12f},{x[2]:.12f},{5 * (i % 2)}"
        for i, x in enumerate(LENGTH / N * np.arange(N + 1)[:, None] * direction)
    ]
    bars = [f"CBAR,{i},1,{i},{i + 1},0.,1.,1." for i in range(1, N + 1)]
    head = ["CORD2R,5,,1.,2.,3.,2.,4.,3.", ",1.,2.,7.", "MAT1,1,7.+10,,.3,2700.", "PBAR,1,1,1.-3,8.-8,8.-8,1.6-7"]
    text = "\n".join([*head, *grids, *bars, f"PARAM,AUTOSPC,{autospc}", cards, *more, "ENDDATA", ""])
    (folder / "line.bdf").write_text(text)
    return model_of(folder / "line.bdf")


@pytest.mark.parametrize("cards", ["PARAM,COUPMASS,1", "PARAM,COUPMASS,-1"])
def test_the_spin_is_held(tmp_path: Path, cards: str) -> None:
    configured = line(tmp_path, cards=cards)
    (held,) = configured.held_singular
    assert str(held)[:-1].endswith(("RX", "RY", "RZ"))
    found = solve_modes(configured.at(np.zeros(0)), 11).freq_hz
    exact = np.repeat(ROOTS, 2) ** 2 / (2 * np.pi * LENGTH**2) * np.sqrt(E * I1 / (RHO * A))
    assert found[4] < 1e-3 * exact[0]
    np.testing.assert_allclose(found[5:11], exact, rtol=1e-4 if cards.endswith(",1") else 5e-3)


def test_without_autospc_it_is_held_as_well(tmp_path: Path) -> None:
    """It has no mass either, so that no mode changes."""
    found = [solve_modes(line(tmp_path, autospc=word).at(np.zeros(0)), 11).freq_hz[5:] for word in ("YES", "NO")]
    np.testing.assert_allclose(*found, rtol=1e-9)


@pytest.mark.parametrize(
    "card",
    [
        "SPC1,1,123456,1",  # not selected: nothing changes
        "CONM2,91,7,,1.,,,,,\n,1.,,1.,,,1.",
        "CELAS2,91,100.,3,4",
        "GRID,99,,0.,5.,0.\nCBAR,91,1,3,99,1.,0.,0.",
    ],
)
def test_what_resists_is_not_held(tmp_path: Path, card: str) -> None:
    held = line(tmp_path, card).held_singular
    assert len(held) == (1 if card.startswith("SPC1") else 0)
