"""Decks that commercial Nastran solved: listed natural frequencies beside those of the decks as we read them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import rigid_body_modes
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure

from .solving import frequencies, lowest, reduced

LISTED = {
    "beam_modes.dat": [456.660, 456.660, 2674.588, 2674.588, 3554.923, 4507.487, 6626.104, 6626.104, 11111.59,
                       11111.59],
    "pt145.bdf": [39.961, 236.41, 250.44, 701.40, 703.42, 1153.1, 1375.4, 1574.4, 1956.9, 2277.2],
    "satk.dat": [89.5607, 89.5607, 1044.76],
    "cbush.dat": [63.8038, 63.8038, 750.561],
    "actuator_tf_modeling.bdf": [0.0795775, 0.275664],
    "001_ten_bar_truss/modes.dat": [8.9495, 26.957, 27.250, 49.931, 56.885, 62.997, 65.084, 77.128],
    "002_svanberg_beam/modes.dat": [46.464, 146.93, 279.02, 752.99, 815.35, 882.35, 1405.5, 1507.3],
    "003_svanberg_bar/modes.dat": [46.464, 146.93, 279.02, 752.99, 815.35, 882.35, 1405.5, 2059.2],
    "004_72_bar_truss/modes.dat": [25.456, 25.456, 38.941, 68.555, 73.705, 73.705, 111.02, 127.62, 136.66, 136.66],
    "cantilever_bar_reduction/no_super/noReduction.dat": [349.73, 2167.3, 6007.8, 11650, 19045],
}  # fmt: skip
RIGID = {"actuator_tf_modeling.bdf": 1}


def built(decks: Path, name: str) -> BuiltDeck:
    return build_structure(read_deck(decks / name))


@pytest.mark.parametrize("name", LISTED)
def test_listed_frequencies(nastran_decks: Path, name: str) -> None:
    found = frequencies(built(nastran_decks, name).structure)[RIGID.get(name, 0) :]
    # five digits are printed at the most; the rotary inertia that one version gives lumped bars moves the fifth
    np.testing.assert_allclose(found[: len(LISTED[name])], LISTED[name], rtol=5e-5)


def test_every_card_is_accounted_for(nastran_decks: Path) -> None:
    for name in LISTED:
        model = built(nastran_decks, name)
        assert sum(count.count for count in model.cards) == len(model.deck.cards)


def test_missing_includes_are_an_error(nastran_decks: Path) -> None:
    with pytest.raises(FemtuneError, match=r"structure_bah\.inc") as error:
        read_deck(nastran_decks / "bah_plane.bdf")
    assert error.value.code == "deck.missing-include"


SHELLS = {
    # the listed plate is a fine mesh; the other deck has one element of each kind, whose formulations differ
    "plate_py.dat": (6, 0.01, [6333.01, 7495.47, 16238.5, 17161.5]),
    "random_test_bar_plus_tri.bdf": (3, 0.05, [46.014, 47.388, 147.61, 309.85, 441.41, 1334.9, 1793.5]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SHELLS)
def test_listed_frequencies_of_shells(nastran_decks: Path, name: str) -> None:
    rigid, tolerance, listed = SHELLS[name]
    found = lowest(built(nastran_decks, name).structure, rigid + len(listed))[rigid:]
    np.testing.assert_allclose(found, listed, rtol=tolerance)


def test_shells_are_read_with_their_notices(nastran_decks: Path) -> None:
    model = built(nastran_decks, "random_test_bar_plus_tri.bdf")
    assert [(b.card, len(b)) for b in model.structure.batches if b.kind.startswith("shell")] == [
        ("CQUAD4", 1), ("CTRIA3", 1),
    ]  # fmt: skip
    assert model.structure.drilling == 100.0
    (notice,) = [n for n in model.notices if n.code == "deck.missing-set"]
    assert notice.level == "warning"
    assert "no multipoint constraint is applied" in notice.what


@pytest.mark.slow
def test_a_mesh_of_solids_without_a_material_is_refused_where_it_is_blank(nastran_decks: Path) -> None:
    deck = read_deck(nastran_decks / "trunc_cyl_shell.nas")
    with pytest.raises(FemtuneError) as error:
        build_structure(deck)
    assert error.value.code == "deck.blank-field"
    assert error.value.where is not None
    assert (error.value.where.line, error.value.where.record) == (3530, "PSOLID 1")


@pytest.mark.slow
def test_a_mesh_of_solids_with_a_material_is_built(nastran_decks: Path, tmp_path: Path) -> None:
    """The mass is density times the volume that the corners give."""
    text = (nastran_decks / "trunc_cyl_shell.nas").read_text()
    assert text.count("PSOLID,1\n") == 1
    (tmp_path / "mesh.nas").write_text(text.replace("PSOLID,1\n", "PSOLID,1,1\nMAT1,1,2.+11,,.3,7850.\n"))
    structure = built(tmp_path, "mesh.nas").structure
    (batch,) = structure.batches
    assert (batch.kind, len(batch)) == ("tetra4", 2679)
    np.testing.assert_allclose(structure.nodes.xyz[0], [-0.228654, -0.152782, 0.0])
    first, *others = np.moveaxis(structure.nodes.xyz[batch.nodes], 1, 0)
    volume = np.linalg.det(np.stack([corner - first for corner in others], axis=1)).sum() / 6.0
    along_x = rigid_body_modes(structure.nodes)[:, 0]
    np.testing.assert_allclose(along_x @ assemble(structure, "mass") @ along_x, 7850.0 * volume, rtol=1e-10)


def test_two_tetrahedra_are_between_lumped_and_consistent_mass(nastran_decks: Path) -> None:
    """tet10.bdf: every listed mode is above ours with lumped and below ours with consistent mass.

    Two elements hold no wave, so their modes are those of the mass's formulation; MSC's is neither of ours. A quarter
    is the width of that band. The stiffness is compared by listed displacements, beside the tests of the element.
    """
    listed = np.array([87278.5, 91000.0, 102379.0, 266861.0, 283122.0, 343509.0, 489764.0])
    structure = built(nastran_decks, "tet10.bdf").structure
    low, high = (
        frequencies(replace(structure, consistent_mass=consistent))[: len(listed)] / listed
        for consistent in (False, True)
    )
    assert ((low > 0.75) & (low < 1.0)).all()
    assert ((high > 1.0) & (high < 1.25)).all()


def test_higher_listed_values_of_the_bush_deck_are_residual_vectors(nastran_decks: Path) -> None:
    """5522.77 (×2), 16707.5 (×2) and 25385.6 Hz lie beyond the range that the deck asks for.

    They are Ritz values of three modes and the static shapes under unit accelerations, in a program that gives
    lumped bars the rotary inertia ρ I L / 2 at each end. With that inertia added here they come out to all digits.
    """
    s = built(nastran_decks, "cbush.dat").structure
    K, M, T = reduced(s)
    rotary = 2.7957e-6 * np.pi / 4 * 10.0**4 * 20.0 / 2
    nodes = next(b for b in s.batches if b.card == "CBAR").nodes.ravel()
    extra = np.zeros(s.nodes.n_dofs)
    np.add.at(extra, np.concatenate([6 * nodes + 4, 6 * nodes + 5]), rotary)
    M = M + T.T @ (extra[:, None] * T)
    load = T.T @ (assemble(s, "mass") @ rigid_body_modes(s.nodes) + extra[:, None] * rigid_body_modes(s.nodes))
    _, modes = scipy.linalg.eigh(M, K)
    basis = np.column_stack([modes[:, :-4:-1], np.linalg.solve(K, load)])
    q, r, _ = scipy.linalg.qr(basis / np.linalg.norm(basis, axis=0).clip(1e-30), mode="economic", pivoting=True)
    q = q[:, np.abs(np.diag(r)) > 1e-9]
    ritz = scipy.linalg.eigh(q.T @ M @ q, q.T @ K @ q, eigvals_only=True)[::-1]
    found = np.sqrt(1.0 / ritz[ritz > 1e-9 * ritz[0]]) / (2 * np.pi)
    listed = [63.8038, 63.8038, 750.561, 5522.77, 5522.77, 16707.5, 16707.5, 25385.6]
    np.testing.assert_allclose(found[:8], listed, rtol=2e-6)
