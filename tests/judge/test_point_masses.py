"""A mass that the deck does not have: derivatives beside differences, neighbourhoods, and a run that names it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.fem import FieldRef
from femtune.files.nastran import build_structure, read_deck
from femtune.judge.point_masses import PointMass, neighbourhoods, points_without_mass
from femtune.judge.widened import widened
from femtune.model import Assignment, Configuration, configure, eigenvalue_derivatives, parametric_model, solve_modes
from femtune.parameters import Parameter, ParameterSet
from structures.wrong_property import FRAME

_MASS = "CONM2,912,28,,1."
_E = Assignment("E", FieldRef("MAT1", 1, "E"))


def test_derivatives_by_masses(tmp_path: Path) -> None:
    """Of zero masses, beside the modes of decks with a small mass; the model itself is unchanged."""
    path = tmp_path / "frame.bdf"
    path.write_text(FRAME.deck)
    structure = build_structure(read_deck(path)).structure
    model = parametric_model(structure, ParameterSet((Parameter("E"),)), [_E])
    masses = [PointMass("a", (23,), 0.5), PointMass("b", (4, 29), 0.5)]
    wide = widened(model, [], masses)
    before = solve_modes(configure(model, Configuration("a")).at(np.zeros(1)), 6)
    solution = solve_modes(configure(wide, Configuration("a")).at(np.zeros(3)), 6)
    np.testing.assert_allclose(solution.freq_hz, before.freq_hz, rtol=1e-9)
    slopes, h = eigenvalue_derivatives(solution)[:6], 1e-4
    for column, cards in ((1, [(23, 0.5 * h)]), (2, [(4, 0.25 * h), (29, 0.25 * h)])):
        more = "".join(f"CONM2,{990 + n},{n},,{m:.6E}\n" for n, m in cards)
        path.write_text(FRAME.deck.replace("ENDDATA", f"{more}ENDDATA"))
        with_mass = build_structure(read_deck(path)).structure
        loaded = parametric_model(with_mass, ParameterSet((Parameter("E"),)), [_E])
        there = solve_modes(configure(loaded, Configuration("a")).at(np.zeros(1)), 6)
        difference = (there.eigenvalues[:6] - before.eigenvalues[:6]) / h
        np.testing.assert_allclose(slopes[:, column], difference, rtol=1e-3, atol=1e-3 * np.abs(difference).max())


def test_points_that_carry_no_mass(tmp_path: Path) -> None:
    """Neither those with a CONM2, nor those that are held."""
    path = tmp_path / "frame.bdf"
    path.write_text(FRAME.deck)
    structure = build_structure(read_deck(path)).structure
    model = parametric_model(structure, ParameterSet((Parameter("E"),)), [_E])
    rows = points_without_mass(structure, [configure(model, Configuration("a"))])
    found = set(structure.nodes.ids[rows].tolist())
    assert not found & {22, 28, 1, 6}
    assert found == set(structure.nodes.ids.tolist()) - {22, 28, 1, 6}


def test_neighbourhoods_of_a_plane() -> None:
    """A square of 16 points has 4 quarters, and each point belongs to one."""
    xyz = np.array([[i, j, 0.0] for i in range(4) for j in range(4)])
    groups = neighbourhoods(xyz, 4)
    assert sorted(np.concatenate(groups).tolist()) == list(range(16))
    assert all(np.ptp(xyz[g], axis=0).max() == 1.0 for g in groups)
    assert len(neighbourhoods(xyz, 50)) == 16
    assert neighbourhoods(np.zeros((3, 3)), 5)[0].tolist() == [0, 1, 2]


def _study(folder: Path, deck: str, parameters: tuple[ft.Parameter, ...]) -> ft.Study:
    true, model = folder / "true.bdf", folder / "model.bdf"
    true.write_text(FRAME.deck)
    model.write_text(deck)
    test = ft.simulate(
        true, FRAME.sensors, units="m-kg-s", count=FRAME.modes, frequency_scatter=0.003, shape_scatter=0.02, seed=1
    )
    own = [ft.Parameter(f"p{i}", fields=[n], lower=0.5, upper=2.0) for i, n in enumerate(FRAME.parameters)]
    return ft.Study(
        model=ft.read_deck(model, units="m-kg-s"), test=test,
        parameters=[*own, *parameters],
        residuals={"frequency_sd": 0.003, "shape_sd": 0.02}, modes={"count": FRAME.modes + 5},
        output=str(folder / "results"),
    )  # fmt: skip


@pytest.mark.slow
def test_a_forgotten_mass_is_named(tmp_path: Path) -> None:
    """Where it is and what it weighs, within the accuracy of a group of points; and the lines make it a parameter."""
    deck = FRAME.deck.replace(_MASS + "\n", "")
    assert deck != FRAME.deck
    result = ft.run(_study(tmp_path, deck, ())).results
    judged = result.judgement
    assert judged is not None
    assert judged.missing is not None
    first = judged.missing.fields[0]
    assert first.field == "mass"
    assert set(first.points) & {27, 28, 29}
    assert first.refit is not None
    assert first.largest_mass is not None
    assert first.refit.factor * first.largest_mass == pytest.approx(1.0, rel=0.15)
    assert judged.verdict == "not accepted"
    assert any(r.sentence.startswith("a mass of about ") for r in judged.reasons)
    card = next(line for line in first.lines.splitlines() if "CONM2" in line and line.startswith("#"))[2:]
    name, fields = (line.partition("= ")[2].strip('[]"') for line in first.lines.splitlines()[3:5])
    (tmp_path / "healed").mkdir()
    with_card = deck.replace("ENDDATA", f"{card}\nENDDATA")
    more = ft.Parameter(name, fields=[fields], lower=0.0, upper=2.0)
    healed = ft.run(_study(tmp_path / "healed", with_card, (more,))).results
    assert healed.update is not None
    found = healed.update.parameters[-1]
    assert found.value * float(card.split(",")[-1]) == pytest.approx(first.refit.factor * first.largest_mass, rel=0.1)
