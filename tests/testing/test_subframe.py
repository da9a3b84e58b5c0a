"""The subframe: one connected structure, of the mass of its drawing, without mechanisms, alike at every size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from femtune.fem import Structure
from femtune.fem.assemble import assemble
from femtune.files.nastran import BuiltDeck, build_structure, read_deck
from structures.meshed import MeshedStructure
from structures.shells import model_at_nominal, natural_frequencies
from structures.subframe import (
    FIRST_SENSOR,
    SENSORS,
    Subframe,
    batch_masses,
    main,
    mesh_quality,
    subframe,
    subframe_study_parameters,
    write_subframe,
)

SIZES = (5_000, 10_000, 40_000)
FINE = 150_000


@pytest.fixture(scope="module")
def smallest() -> Subframe:
    return subframe(5_000)


@pytest.fixture(scope="module")
def built(smallest: Subframe, tmp_path_factory: pytest.TempPathFactory) -> BuiltDeck:
    return build_structure(read_deck(write_subframe(smallest, tmp_path_factory.mktemp("deck") / "subframe.bdf")))


def pieces(structure: MeshedStructure) -> int:
    """Number of parts that hang together by elements and rigid ties."""
    links = [np.stack([b.rows[:, i], b.rows[:, i - 1]]) for b in structure.elements for i in range(b.rows.shape[1])]
    links += [np.stack([tie.rows, np.full(len(tie.rows), tie.centre)]) for tie in structure.rigid]
    ends = np.concatenate(links, axis=1)
    graph = coo_array((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(len(structure.xyz),) * 2)
    return int(connected_components(graph, directed=False)[0])


def translation(structure: Structure) -> NDArray[np.float64]:
    out = np.zeros(structure.nodes.n_dofs)
    out[2::6] = 1.0
    return out


@pytest.fixture(scope="module", params=[True, False], ids=["solids", "shells"])
def fine(request: pytest.FixtureRequest) -> Subframe:
    return subframe(FINE, request.param)


@pytest.mark.slow
def test_the_size_is_met_and_the_mass_stays(fine: Subframe) -> None:
    mass = mesh_quality(fine).mass
    assert 15.0 < mass < 25.0
    for n_dofs in SIZES:
        made = subframe(n_dofs, solids=bool(fine.group("rubber front")))
        assert made.n_dofs == pytest.approx(n_dofs, rel=0.1)
        assert mesh_quality(made).mass == pytest.approx(mass, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("n_dofs", [*SIZES, FINE])
def test_elements_are_not_badly_distorted(n_dofs: int) -> None:
    quality = mesh_quality(subframe(n_dofs))
    assert quality.aspect < 15.0
    assert quality.warp < 0.02
    assert quality.skew_deg < 55.0
    assert quality.jacobian > 0.3


@pytest.mark.slow
@pytest.mark.parametrize("n_dofs", SIZES)
def test_it_is_one_piece_without_free_or_double_nodes(n_dofs: int) -> None:
    made = subframe(n_dofs)
    quality = mesh_quality(made)
    assert pieces(made) == 1
    assert quality.unused_nodes == 0
    assert quality.nearest > 5e-4
    assert len(np.unique(made.node_ids)) == len(made.node_ids)


@pytest.mark.slow
def test_without_its_bolts_the_brackets_come_off(smallest: Subframe) -> None:
    kept = tuple(tie for tie in smallest.rigid if tie.name != "bolt")
    loose = MeshedStructure("loose", smallest.node_ids, smallest.xyz, smallest.elements, (), (), kept)
    assert pieces(loose) == 1 + 4 + 8


def test_the_masses_of_members_follow_from_their_sections(smallest: Subframe) -> None:
    masses = {p.id: 0.0 for p in smallest.properties}
    for batch, mass in zip(smallest.elements, batch_masses(smallest), strict=True):
        masses[batch.property] += mass
    # rubber and inner sleeves are prisms over octagons, as high as the straightened ends (0.9 times the drawing)
    octagon, height = 4.0 * np.sin(np.pi / 4.0), 0.9 * 0.05
    assert masses[17] == pytest.approx(2 * octagon * (0.027**2 - 0.013**2) * height * 1100.0, rel=1e-3)
    assert masses[19] == pytest.approx(4 * octagon * (0.013**2 - 0.007**2) * height * 7850.0, rel=1e-3)


@pytest.mark.slow
def test_the_deck_reads_back_as_what_was_made(smallest: Subframe, built: BuiltDeck) -> None:
    assert [notice.code for notice in built.notices if notice.level == "warning"] == []
    structure = built.structure
    order = np.argsort(smallest.node_ids)
    np.testing.assert_array_equal(np.sort(structure.nodes.ids), smallest.node_ids[order])
    back = np.argsort(structure.nodes.ids)
    np.testing.assert_allclose(structure.nodes.xyz[back], smallest.xyz[order], atol=1e-10)
    one = translation(structure)
    assert one @ (assemble(structure, "mass") @ one) == pytest.approx(mesh_quality(smallest).mass, rel=1e-6)


@pytest.mark.slow
def test_six_rigid_modes_and_no_mechanism(smallest: Subframe, built: BuiltDeck) -> None:
    assert model_at_nominal(built.structure).stiffness.shape[0] == smallest.n_dofs
    freq_hz = natural_frequencies(built.structure, 12)
    assert np.all(freq_hz[:6] < 0.1)
    assert np.all(freq_hz[6:] > 60.0)


@pytest.mark.slow
@pytest.mark.parametrize("boundary", ["held", "loaded"])
def test_held_or_loaded_at_its_mounts(smallest: Subframe, tmp_path: Path, boundary: str) -> None:
    deck = read_deck(write_subframe(smallest, tmp_path / "deck.bdf", boundary))
    freq_hz = natural_frequencies(build_structure(deck).structure, 7)
    if boundary == "held":
        assert 10.0 < freq_hz[0] < 100.0
    else:
        assert freq_hz[5] < 0.1
        assert 10.0 < freq_hz[6] < 100.0


def test_an_unknown_boundary_is_refused(smallest: Subframe, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="glued"):
        write_subframe(smallest, tmp_path / "deck.bdf", "glued")


@pytest.mark.slow
def test_sensors_sit_at_the_same_places_in_every_mesh(smallest: Subframe) -> None:
    finer = subframe(20_000)
    assert smallest.sensors == tuple(range(FIRST_SENSOR, FIRST_SENSOR + SENSORS))
    coarse, fine = (m.xyz[np.isin(m.node_ids, m.sensors)][np.argsort(m.node_ids[np.isin(m.node_ids, m.sensors)])]
                    for m in (smallest, finer))  # fmt: skip
    np.testing.assert_allclose(coarse, fine, atol=1e-12)
    assert sum(mass.name == "accelerometer" for mass in smallest.masses) == SENSORS


@pytest.mark.slow
def test_another_seed_puts_the_sensors_elsewhere(smallest: Subframe) -> None:
    other = subframe(5_000, seed=3)
    places = [m.xyz[np.isin(m.node_ids, m.sensors)] for m in (smallest, other)]
    assert not np.array_equal(*places)


@pytest.mark.slow
@pytest.mark.parametrize("solids", [True, False])
def test_the_parameters_of_the_study_are_fields_of_the_deck(tmp_path: Path, solids: bool) -> None:
    deck = write_subframe(subframe(5_000, solids), tmp_path / "deck.bdf")
    fields = build_structure(read_deck(deck)).fields
    parameters = subframe_study_parameters(solids)
    assert len(set(parameters)) == 15
    assert set(parameters) <= set(fields)


@pytest.mark.long
def test_frequencies_converge_with_the_size(tmp_path: Path) -> None:
    found = []
    for n_dofs in (5_000, 10_000, 20_000, 40_000):
        structure = build_structure(read_deck(write_subframe(subframe(n_dofs), tmp_path / "deck.bdf"))).structure
        found.append(natural_frequencies(structure, 26)[6:])
    errors = [float(np.abs(one / found[-1] - 1.0).max()) for one in found[:-1]]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.05


def test_the_module_writes_a_deck(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "out.bdf"
    assert main(["5000", str(path), "shells"]) == 0
    assert "degrees of freedom" in capsys.readouterr().out
    assert path.read_text().startswith("$ car subframe without the solids")
    assert main(["many"]) == 2
    assert "usage" in capsys.readouterr().err
