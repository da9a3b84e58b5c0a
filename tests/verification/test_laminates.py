"""Laminates: laws by integration through the thickness, Navier's plates, and sections of one material."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.fem.assemble import assemble
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from structures.shells import natural_frequencies

TAPE = {"E1": 25.0, "E2": 1.0, "NU": 0.25, "G12": 0.5, "G1": 0.5, "G2": 0.2, "RHO": 2.0}
CORE = {"E1": 1e-4, "E2": 1e-4, "NU": 0.0, "G12": 1e-4, "G1": 0.02, "G2": 0.01, "RHO": 0.3}
MATERIALS = {1: TAPE, 2: CORE}
Plies = list[tuple[int, float, float]]


def card(number: int, m: dict[str, float]) -> str:
    return f"MAT8,{number},{m['E1']},{m['E2']},{m['NU']},{m['G12']},{m['G1']},{m['G2']},{m['RHO']}\n"


def pcomp(plies: Plies, head: str = "PCOMP,1") -> str:
    return head + "\n" + "".join(f",{mid},{t!r},{angle!r}\n" for mid, t, angle in plies)


def built(folder: Path, text: str) -> BuiltDeck:
    path = folder / "plate.bdf"
    materials = "".join(card(number, m) for number, m in MATERIALS.items())
    path.write_text(f"SOL 103\nCEND\nBEGIN BULK\nPARAM,COUPMASS,-1\n{materials}{text}ENDDATA\n")
    return build_structure(read_deck(path))


ELEMENT = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\nCQUAD4,1,1,1,2,3,4\n"


def roles(folder: Path, text: str) -> dict[str, float]:
    structure = built(folder, ELEMENT + text).structure
    (batch,) = structure.batches
    return {name: float(structure.values.values[at[0]]) for name, at in batch.roles.items()}


def law(found: dict[str, float], letter: str) -> np.ndarray:
    a, b, c, d, e, f = (found[letter + k] for k in ("11", "12", "13", "22", "23", "33"))
    return np.array([[a, b, c], [b, d, e], [c, e, f]])


def turned(m: dict[str, float], angle: float) -> np.ndarray:
    """Plane stress in the laminate's axes, by its compliance and tensor stresses."""
    compliance = np.array([[1 / m["E1"], -m["NU"] / m["E1"], 0], [-m["NU"] / m["E1"], 1 / m["E2"], 0],
                           [0, 0, 1 / m["G12"]]])  # fmt: skip
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    stress = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s], [-c * s, c * s, c * c - s * s]])
    return np.linalg.inv(stress.T @ compliance @ stress)


def turned_shear(m: dict[str, float], angle: float) -> np.ndarray:
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[c, s], [-s, c]])
    return turn.T @ np.diag([m["G1"], m["G2"]]) @ turn


def through_thickness(plies: Plies) -> tuple[np.ndarray, ...]:
    """A, B, D about the middle by Gauss points in every ply."""
    x, w = np.polynomial.legendre.leggauss(4)
    z0, out = -sum(t for _, t, _ in plies) / 2, np.zeros((3, 3, 3))
    for mid, t, angle in plies:
        z = z0 + t * (1 + x) / 2
        out += np.array([np.sum(w * z**k) for k in range(3)])[:, None, None] * turned(MATERIALS[mid], angle) * t / 2
        z0 += t
    return tuple(out)


def shear_stiffness(plies: Plies) -> np.ndarray:
    """Energy of the shear stress that balances cylindrical bending, on a fine grid; moduli as of ν = 0."""
    h = sum(t for _, t, _ in plies)
    z, E, flexible, at = [], [], [], -h / 2
    for mid, t, angle in plies:
        m = MATERIALS[mid] | {"NU": 0.0}
        z.append(np.linspace(at, at + t, 2001))
        E.append(np.tile(np.diag(turned(m, angle))[:2], (2001, 1)))
        flexible.append(np.tile(np.linalg.inv(turned_shear(m, angle)), (2001, 1, 1)))
        at += t

    def integral(values: list[np.ndarray]) -> np.ndarray:
        return sum(np.trapezoid(v, x, axis=0) for v, x in zip(values, z))

    axial = integral(E)
    neutral = integral([e * x[:, None] for e, x in zip(E, z)]) / axial
    bending = integral([e * (x[:, None] - neutral) ** 2 for e, x in zip(E, z)])
    moments, before = [], np.zeros(2)
    for e, x in zip(E, z):
        arms = -e * (x[:, None] - neutral)
        steps = (arms[1:] + arms[:-1]) / 2 * np.diff(x)[:, None]
        moments.append(before + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]))
        before = moments[-1][-1]
    parts = [f[:, :, None] * f[:, None, :] * H for f, H in zip(moments, flexible)]
    return np.linalg.inv(integral(parts) / np.outer(bending, bending))


STACKS: dict[str, Plies] = {
    "oblique": [(1, 0.02, 30.0), (1, 0.01, -50.0), (2, 0.05, 15.0), (1, 0.03, 77.0)],
    "cross-ply": [(1, 0.02, 0.0), (1, 0.02, 90.0)],
    "sandwich": [(1, 0.01, 0.0), (2, 0.2, 0.0), (1, 0.01, 0.0)],
}


@pytest.mark.parametrize("name", STACKS)
def test_laws_are_integrals_through_the_thickness(name: str, tmp_path: Path):
    plies = STACKS[name]
    found, (A, B, D) = roles(tmp_path, pcomp(plies)), through_thickness(plies)
    np.testing.assert_allclose(law(found, "M"), A, atol=1e-13 * A.max())
    np.testing.assert_allclose(law(found, "C"), B, atol=1e-13 * np.abs(D).max() / sum(p[1] for p in plies))
    np.testing.assert_allclose(law(found, "B") / 12, D, atol=1e-13 * D.max())
    shear = np.array([[found["S11"], found["S12"]], [found["S12"], found["S22"]]])
    expected = shear_stiffness(plies)
    np.testing.assert_allclose(shear, expected, atol=1e-6 * expected.max())
    assert found["rho"] == pytest.approx(sum(MATERIALS[mid]["RHO"] * t for mid, t, _ in plies), rel=1e-14)
    assert (found["t"], found["RI"], found["TS"], found["z0"]) == (1.0, 1.0, 1.0, 0.0)


def test_a_symmetric_laminate_is_its_half_and_the_mirrored_half(tmp_path: Path):
    half = STACKS["oblique"]
    one, other = (roles(tmp_path, text) for text in (pcomp(half, "PCOMP,1,,,,,,,SYM"), pcomp([*half, *reversed(half)])))
    for letter in "MB":
        whole = law(other, letter)
        np.testing.assert_allclose(law(one, letter), whole, atol=1e-13 * np.abs(whole).max())
    assert "C11" not in one
    assert np.abs(law(other, "C")).max() < 1e-16 * law(other, "M").max()
    for name in ("S11", "S12", "S22", "rho"):
        assert one[name] == pytest.approx(other[name], rel=1e-12)


def test_options_take_their_part_of_the_stiffness(tmp_path: Path):
    plies = STACKS["oblique"]
    A, _, D = through_thickness(plies)
    h = sum(t for _, t, _ in plies)
    found = {
        name: roles(tmp_path, pcomp(plies, f"PCOMP,1,,,,,,,{name}")) for name in ("MEM", "BEND", "SMEAR", "SMCORE")
    }
    for name, one in found.items():
        np.testing.assert_allclose(law(one, "M"), A if name != "BEND" else 0.0 * A, atol=1e-13 * A.max())
        assert not any(role.startswith("C") for role in one)
    np.testing.assert_allclose(law(found["BEND"], "B") / 12, D, atol=1e-13 * D.max())
    np.testing.assert_allclose(law(found["SMEAR"], "B"), A * h**2, atol=1e-13 * A.max() * h**2)
    assert not law(found["MEM"], "B").any()
    # faces of one mean law: half of them above and half below the core, which is the last ply
    faces = sum(t for _, t, _ in plies[:-1])
    mean = sum(t * turned(MATERIALS[mid], angle) for mid, t, angle in plies[:-1]) / faces
    core = turned(MATERIALS[1], 77.0)
    cubes = (0.03**3, h**3)
    np.testing.assert_allclose(
        law(found["SMCORE"], "B"), core * cubes[0] + mean * (cubes[1] - cubes[0]), atol=1e-13 * D.max() * 12
    )


SHAPE = "GRID,1,,0.,0.,0.\nGRID,2,,1.,.1,.05\nGRID,3,,1.1,.9,0.\nGRID,4,,0.,1.,0.\nGRID,5,,2.,0.2,.1\n"
STEEL = "MAT1,9,2.1+11,,.3,7850.,,,.02\n"
SAME = {
    "plies": ("PCOMP,1,,3.,,,,.02\n,9,.01,,,9,.03\n,9,.02,30.,YES\n", "", ""),
    "symmetric": ("PCOMP,1,,3.,,,,.02,SYM\n,9,.01,,,9,.02\n", "", ""),
    "global": ("PCOMPG,1,,3.,,,,.02\n,7,9,.01\n,3,9,.03\n,12,,.02,30.,YES\n", "", ""),
    "offset": ("PCOMP,1,-.02,3.,,,,.02\n,9,.06\n", "", ",,.01"),
    "both offsets": ("PCOMP,1,-.02,3.,,,,.02\n,9,.06\n", ",,.02", ",,.03"),
}


@pytest.mark.quick(1)
@pytest.mark.parametrize("name", SAME)
def test_plies_of_one_material_are_a_plain_shell(name: str, tmp_path: Path):
    text, lift, plain_lift = SAME[name]
    plain = "PSHELL,1,9,.06,9,,9,.8333333333333333,3.\n"

    def deck(section: str, offset: str) -> str:
        return f"{STEEL}{SHAPE}CQUAD4,1,1,1,2,3,4{offset}\nCTRIA3,2,1,2,5,3{offset}\n{section}"

    one, other = (built(tmp_path, deck(*pair)).structure for pair in ((text, lift), (plain, plain_lift)))
    for kind in ("stiffness", "hysteretic"):
        a, b = (assemble(structure, kind) for structure in (one, other))
        assert abs(a - b).max() <= 1e-12 * abs(b).max(), kind
    # mass moves with ZOFFS, not with Z0
    own = built(tmp_path, deck(plain, lift)).structure
    a, b = (assemble(structure, "mass") for structure in (one, own))
    assert abs(a - b).max() <= 1e-12 * abs(b).max()


def navier(plies: Plies, m: int, n: int, a: float = 1.0) -> float:
    """Frequency of a supported square cross-ply plate (normal displacements on the edges free), first-order shear."""
    A, B, D = through_thickness(plies)
    S, mass = shear_stiffness(plies), sum(MATERIALS[mid]["RHO"] * t for mid, t, _ in plies)
    x, y = m * np.pi / a, n * np.pi / a
    # strains of (U, V) cos·sin, sin·cos, and of rotations alike
    strains = np.array([[-x, 0.0], [0.0, -y], [y, x]])
    K = np.zeros((5, 5))
    K[:2, :2], K[:2, 3:], K[3:, 3:] = strains.T @ A @ strains, strains.T @ B @ strains, strains.T @ D @ strains
    K[3:, :2] = K[:2, 3:].T
    sheared = np.array([[0, 0, x, 1, 0], [0, 0, y, 0, 1.0]])
    K += sheared.T @ np.diag(np.diag(S)) @ sheared
    reduced = K[:3, :3] - K[:3, 3:] @ np.linalg.solve(K[3:, 3:], K[3:, :3])
    return float(np.sqrt(np.linalg.eigvalsh(reduced)[0] / mass) / (2 * np.pi))


def plate(n: int) -> str:
    rows, lines = n + 1, []
    for k in range(rows * rows):
        i, j = divmod(k, rows)
        held = "6" + "23" * (i in (0, n)) + "13" * (j in (0, n)) + "4" * (i in (0, n)) + "5" * (j in (0, n))
        lines.append(f"GRID,{k + 1},,{i / n:.6f},{j / n:.6f},0.,,{''.join(sorted(set(held)))}")
    corners = [i * rows + j + 1 for i in range(n) for j in range(n)]
    lines += [f"CQUAD4,{k},1,{k},{k + rows},{k + rows + 1},{k + 1}" for k in corners]
    return "\n".join(lines) + "\n"


PLATES: dict[str, Plies] = {
    "symmetric": [(1, 0.0025, 0.0), (1, 0.0025, 90.0), (1, 0.0025, 90.0), (1, 0.0025, 0.0)],
    "antisymmetric": [(1, 0.005, 0.0), (1, 0.005, 90.0)],
    "thick antisymmetric": [(1, 0.05, 0.0), (1, 0.05, 90.0)],
    "thick symmetric": [(1, 0.025, 0.0), (1, 0.05, 90.0), (1, 0.025, 0.0)],
    "sandwich": [(1, 0.005, 0.0), (2, 0.1, 0.0), (1, 0.005, 0.0)],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLATES)
def test_plates_of_navier(name: str, tmp_path: Path):
    plies = PLATES[name]
    # with m or n zero the plate shears in its plane
    in_plane = np.sqrt(through_thickness(plies)[0][2, 2] / sum(MATERIALS[mid]["RHO"] * t for mid, t, _ in plies)) / 2.0
    exact = sorted([navier(plies, m, n) for m in range(1, 6) for n in range(1, 6)] + [in_plane] * 2)[:3]
    found = [natural_frequencies(built(tmp_path, plate(n) + pcomp(plies)).structure, 3)[:3] for n in (8, 16)]
    errors = [np.abs(f / exact - 1.0) for f in found]
    assert errors[1].max() < 0.02
    # second order: a law that is wrong would leave an error that does not shrink
    np.testing.assert_allclose((4.0 * found[1] - found[0]) / 3.0, exact, rtol=3e-3)


def test_coupling_is_half_of_an_antisymmetric_plate():
    """Without B the [0/90] plate would be twice as stiff: what the test above sees is no small matter."""
    plies = PLATES["antisymmetric"]
    A, B, D = through_thickness(plies)
    assert np.abs(B).max() ** 2 > 0.3 * A.max() * D.max()
