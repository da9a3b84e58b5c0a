"""Every term of every element: symmetric matrices, exact gradients and Hessians."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.fem.solid_parts import ANISO, lean
from tests.fem.tapered_parts import tapered

from femtune.fem.contribution import Contribution
from femtune.fem.elements import KINDS, contributions
from femtune.fem.structure import Structure
from femtune.testing import check_contribution
from structures.frames import Part, bars, bushes, make_structure, masses, rods, scalars
from structures.shells import Anisotropic, Isotropic, Section, ShellPart, shell_structure
from structures.solids import CARDS, solid_mesh, solid_model

XYZ = [[0.0, 0.0, 0.0], [1.3, 0.2, -0.1], [2.0, 1.0, 0.4]]
PAIRS = [[0, 1], [1, 2]]
SECTION = {
    "E": 2.1e11, "G": 8.1e10, "A": [2e-4, 3e-4], "I1": [1.5e-8, 4e-8], "I2": 6e-9, "J": 1.1e-8, "rho": 7850.0,
    "NSM": 0.3,
}  # fmt: skip
SHEAR = {"K1": [0.85, 0.7], "K2": [0.6, 0.9]}
FRAME = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]


def _turned_frames(n: int = len(XYZ)) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(n)])


WELDED = {"E": 2.1e11, "G": 8.1e10, "rho": 7850.0, "GE": 0.02}


def connector(kind: str, card: str, values: dict[str, float], **facts: list[float]) -> Part:
    """Between end points that follow three grid points by any matrix; rigid motions are tested elsewhere."""
    ends = np.random.default_rng(4).standard_normal((1, 12, 18))
    own = {name: np.array(value) for name, value in facts.items()}
    return Part(kind, card, np.array([[0, 2, 1]]), values, {"ends": ends, "arm": np.array([[0.35, 0.0, 0.0]]), **own})


CASES: dict[str, Part] = {
    "bar": bars(PAIRS, SECTION),
    "bar, offsets": bars(PAIRS, SECTION, offsets=((0.1, 0.2, 0.0), (0.0, -0.1, 0.3))),
    "bar, shear": bars(PAIRS, {**SECTION, **SHEAR}),
    "bar, shear and pins": bars(PAIRS, {**SECTION, **SHEAR}, pins=(5, 10)),
    "beam": bars(PAIRS, SECTION, card="CBEAM"),
    "beam, I12": bars(PAIRS, {**SECTION, "I12": 2e-9}, card="CBEAM"),
    "beam, I12 and shear": bars(PAIRS, {**SECTION, **SHEAR, "I12": 2e-9}, card="CBEAM"),
    "beam, I12 and shear in plane 2": bars(PAIRS, {**SECTION, "K2": 0.6, "I12": 2e-9}, card="CBEAM"),
    "tapered beam": tapered(
        PAIRS[:1], {"E": 2.1e11, "G": 8.1e10, "rho": 7850.0}, [0.0, 1.0],
        {"A": [2e-4, 3e-4], "I1": [1.5e-8, 4e-8], "I2": [6e-9], "J": [1e-8, 2e-8], "NSM": [0.3], "K1": [0.8]},
    ),
    "curved bar": Part(
        "curved-bar", "CBEND", np.array(PAIRS[:1]),
        {**SECTION, "A": 2e-4, "I1": 1.5e-8, "K1": 0.85, "K2": 0.6},
        {"axes": FRAME[None], "radius": np.array([1.1]), "angle": np.array([0.9])},
    ),
    "curved bar without shear": Part(
        "curved-bar", "CBEND", np.array(PAIRS[:1]),
        {**SECTION, "A": 2e-4, "I1": 1.5e-8, "K1": 0.0, "K2": 0.0},
        {"axes": FRAME[None], "radius": np.array([1.1]), "angle": np.array([0.9])},
    ),
    "rod": rods(PAIRS, {"E": 2.1e11, "G": 8.1e10, "A": [2e-4, 3e-4], "J": 1e-8, "rho": 7850.0, "NSM": 0.3}),
    "bush": bushes(PAIRS, {f"K{i}": 1e4 * i for i in range(1, 7)}, frame=FRAME, arm_a=(0.1, 0.2, 0.3)),
    "damped bush": bushes(PAIRS, {f"{x}{i}": 0.1 * i for x in ("K", "B", "GE") for i in range(1, 7)}, frame=FRAME),
    "rod with loss factor": rods(PAIRS, {"E": 2.1e11, "G": 8.1e10, "A": [2e-4, 3e-4], "J": 1e-8, "rho": 1, "GE": 0.02}),
    "bar with loss factor": bars(PAIRS, {**SECTION, **SHEAR, "GE": [0.0, 0.05]}),
    "dashpot": scalars("dashpot", [[0, 7], [3, -1]], "B", [2.0, -3.0]),
    "line dashpot": Part("line-dashpot", "CVISC", np.array(PAIRS), {"CE": 3.0, "CR": [0.2, 0.0]}, {"axis": FRAME[:2]}),
    "line spring": Part("line-spring", "CBUSH1D", np.array([[0, 1], [2, -1]]), {"K": 3, "C": 0.1}, {"axis": FRAME[1:]}),
    "grounded bush": bushes([[2, -1]], {f"K{i}": 1e4 * i for i in range(1, 7)}),
    "concentrated mass": masses([0, 2], {"M": 2.0, "I11": 0.1, "I21": 0.02, "I22": 0.3, "I33": 0.2}, (0.1, 0.0, 0.2)),
    "general mass": Part(
        "general-mass", "CONM1", np.array([[1]]),
        {f"M{i}{j}": 1.0 / (i + j) for i in range(1, 7) for j in range(1, i + 1)}, {"frame": FRAME[None]},
    ),
    "weld": connector("weld", "CWELD", {**WELDED, "D": 0.3}, length=[0.7], fixed=[0.7], factor=[0.0]),
    "weld with a length of its diameter": connector(
        "weld", "CWELD", {**WELDED, "D": 0.3}, length=[0.0], fixed=[0.0], factor=[0.2]
    ),
    "spot weld": connector("weld", "CWELD", {**WELDED, "D": 0.3, "tA": 0.01, "tB": 0.02}, length=[0.7]),
    "fastener": connector("fastener", "CFAST", {**{f"K{i}": 1e4 * i for i in range(1, 7)}, "M": 2.0, "GE": 0.03}),
    "spring": scalars("spring", [[0, 7], [3, -1]], "K", [2e5, 3e4]),
    "scalar mass": scalars("scalar-mass", [[0, 7], [3, -1]], "M", [2.0, 3.0]),
}  # fmt: skip


STEEL = Isotropic(2.1e11, 0.3, 7850.0, GE=0.02)
LAMINA = {"11": 1.4e11, "12": 3e9, "13": 2e9, "22": 1e10, "23": 1e9, "33": 5e9}
PLY = Anisotropic(LAMINA, {"11": 4e9, "12": 5e8, "22": 3e9}, 1600.0, GE=0.04)
FLAT = [[0.0, 0.0, 0.0], [1.3, 0.2, 0.0], [1.1, 1.2, 0.0], [-0.1, 0.9, 0.0], [2.2, 0.7, 0.0]]
WARPED = [[0.0, 0.0, 0.0], [1.3, 0.2, 0.1], [1.1, 1.2, 0.0], [-0.1, 0.9, 0.2], [2.2, 0.7, -0.3]]
CELLS = {"quad": [[0, 1, 2, 3]], "tri": [[0, 1, 2], [1, 4, 2]]}
SECTIONS = {
    "steel": Section(STEEL, 0.02, NSM=0.4, RI=1.1),
    "steel, offset": Section(STEEL, 0.02, 0.015, NSM=0.4),
    "anisotropic, offset": Section(PLY, 0.02, -0.01, NSM=0.4, RI=0.9, TS=0.7),
    "membrane": Section(STEEL, 0.02, 0.01, has_bending=False),
    "bending": Section(STEEL, 0.02, 0.01, has_membrane=False),
    "three laws": Section(STEEL, 0.02, 0.01, bending=PLY, shear=PLY),
}
SHELLS = {
    f"{cells}, {section}, {'warped' if xyz is WARPED else 'flat'}": (xyz, cells, section)
    for cells in CELLS for section in SECTIONS for xyz in (FLAT, WARPED)
}  # fmt: skip


ROTATION = "shell-rotation-tri"


def _shell(name: str, consistent: bool) -> Structure:
    xyz, cells, section = SHELLS[name]
    part = ShellPart(np.array(CELLS[cells]), SECTIONS[section], theta=0.3)
    frames = _turned_frames(len(xyz))
    return shell_structure(np.array(xyz), [part], frames=frames, consistent_mass=consistent, mass_factor=0.5)


def _terms(part: Part, consistent: bool) -> list[tuple[Contribution, dict[str, np.ndarray]]]:
    return _terms_of(make_structure(XYZ, [part], _turned_frames(), consistent_mass=consistent, mass_factor=0.5))


def _terms_of(structure: Structure) -> list[tuple[Contribution, dict[str, np.ndarray]]]:
    batch, values = structure.batches[0], structure.values.values
    return [(c, {r: values[batch.roles[r][c.at]] for r in c.roles}) for c in contributions(batch, structure)]


def test_every_kernel_has_a_case():
    kinds = {part.kind for part in CASES.values()} | {_shell(name, False).batches[0].kind for name in SHELLS}
    kinds.add(ROTATION)
    # tests/fem/elements: test_shear_panel, test_curved_shell; tests/fem/test_generic
    elsewhere = {"shear-panel", "shell-quad8", "shell-tri6", "generic"}
    assert kinds | set(CARDS) | elsewhere == set(KINDS)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SHELLS if name.startswith("tri")])
def test_terms_of_triangles_with_rotations(name: str) -> None:
    structure = _shell(name, False)
    batch = replace(structure.batches[0], kind=ROTATION, card="CTRIAR")
    terms = _terms_of(replace(structure, batches=(batch,)))
    assert {term.matrix for term, _ in terms} == {"stiffness", "mass", "hysteretic"}
    for term, values in terms:
        check_contribution(term, values)


@pytest.mark.quick(2, gate=20)
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_terms(name: str, consistent: bool):
    terms = _terms(CASES[name], consistent)
    assert terms
    for term, values in terms:
        check_contribution(term, values)


@pytest.mark.quick(0, gate=16)
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("name", SHELLS)
def test_terms_of_shells(name: str, consistent: bool):
    terms = _terms_of(_shell(name, consistent))
    for term, values in terms:
        check_contribution(term, values)
    assert {term.matrix for term, _ in terms} == {"stiffness", "mass", "hysteretic"}
    # every value that acts is a role of some term, the offset where there is one
    assert ("z0" in {role for term, _ in terms for role in term.roles}) == (SECTIONS[SHELLS[name][2]].z0 is not None)


@pytest.mark.slow
@pytest.mark.parametrize("material", [STEEL, ANISO], ids=["isotropic", "anisotropic"])
@pytest.mark.parametrize("kind", CARDS)
def test_terms_of_solids(kind: str, material):
    mesh = solid_mesh(lean, (1, 1, 1), kind)
    structure = solid_model(mesh, material, frames=_turned_frames(len(mesh.xyz)), consistent_mass=True, mass_factor=0.5)
    seen = set()
    for term, values in _terms_of(structure):
        # entries of an anisotropic law in several frames are one function
        name = term.matrix, term.label.rstrip("0123456789-") if term.facts else term.label
        if name not in seen:
            check_contribution(term, values)
        seen.add(name)
    assert {matrix for matrix, _ in seen} == {"stiffness", "mass", "hysteretic"}


def test_shear_flexible_bars_are_rational():
    labels = {term.label for term, _ in _terms(CASES["bar, shear"], False)}
    assert {"shear-bending-1", "shear-bending-2", "bending-1", "bending-2"} <= labels


def test_shear_rigid_bars_share_scalars_whatever_their_length():
    for term, _ in _terms(CASES["bar, offsets"], True):
        assert not term.facts


def test_a_wrong_derivative_is_found():
    term, values = _terms(CASES["bar, shear"], False)[0]

    def spoilt(roles, facts):
        exact = term.coefficient(roles, facts)
        return type(exact)(exact.value, exact.grad * (1.0 + 1e-7), exact.hess)

    wrong = Contribution("stiffness", "spoilt", term.at, term.matrices, term.roles, spoilt, term.facts)
    with pytest.raises(AssertionError, match="derivative by"):
        check_contribution(wrong, values)


def test_an_unsymmetric_matrix_is_found():
    term, values = _terms(CASES["bar"], False)[0]
    crooked = term.matrices.copy()
    crooked[0, 0, 1] += 1.0
    wrong = Contribution("stiffness", "crooked", term.at, crooked, term.roles, term.coefficient, term.facts)
    with pytest.raises(AssertionError, match="symmetry"):
        check_contribution(wrong, values)
