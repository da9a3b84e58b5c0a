"""Files of many programs: read, or refused with a reason; the facts are counted in the raw text here."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import find_peaks

from femtune.errors import FemtuneError
from femtune.files.uff import UffContent, read_uff
from femtune.testdata import renumber
from femtune.units import SI, unit_system


def raw_sets(path: Path) -> list[tuple[str, list[str]]]:
    """(number, lines) of each ASCII data set, by splitting the text at its delimiters."""
    text = path.read_text(encoding="latin-1").replace("\r\n", "\n")
    parts = re.split(r"^ {4}-1 *$\n?", text, flags=re.MULTILINE)
    bodies = [part.splitlines() for part in parts if part.strip()]
    return [(lines[0].strip(), lines[1:]) for lines in bodies]


def raw(path: Path, number: str) -> list[str]:
    """The lines of all data sets of a number."""
    return [line for found, lines in raw_sets(path) if found == number for line in lines]


def read(path: Path) -> UffContent:
    """With units stated only where the raw text has no data set 164."""
    stated = None if "164" in [number for number, _ in raw_sets(path)] else SI
    return read_uff(path, units=SI, file_units=stated)


def permas(path: Path, content: UffContent) -> None:
    lines = raw(path, "2411")
    frame = content.test.geometry
    assert len(frame) == len(lines) // 2 == 441
    wanted = [[float(x) for x in line.replace("D", "E").split()] for line in lines[1::2]]
    np.testing.assert_array_equal(frame.coordinates, wanted)
    assert len(frame.elements) == len(raw(path, "2412")) // 2
    modes = content.test.modes
    assert modes is not None
    heads = [lines for number, lines in raw_sets(path) if number == "2414"]
    assert modes.freq_hz.tolist() == [float(lines[11].split()[1]) for lines in heads]
    assert modes.labels == tuple(str(i + 1) for i in range(10))
    node, first = (line.split() for line in heads[9][13:15])
    at = [k for k, dof in enumerate(modes.dofs) if dof.node == int(node[0])]
    assert set(modes.shapes[at, 9]) <= {float(x) for x in first}


def nx(path: Path, content: UffContent) -> None:
    lines = raw(path, "2411")
    frame = content.test.geometry
    assert len(frame) == len(lines) // 2
    assert content.file_units.length == pytest.approx(1e-3)
    wanted = [[1e-3 * float(x) for x in line.replace("D", "E").split()] for line in lines[1::2]]
    np.testing.assert_allclose(frame.coordinates, wanted, atol=1e-15)
    # System 1, the direction of node 3992: the rows of its matrix as they stand in the file.
    first = [[float(x) for x in line.replace("D", "E").split()] for line in raw(path, "2420")[4:7]]
    assert frame.axes is not None
    np.testing.assert_allclose(frame.axes[0], first, atol=1e-12)
    modes = content.test.modes
    assert modes is not None
    assert (len(modes), modes.normalisation, modes.labels[-1]) == (176, "mass", "176")


def microphone(path: Path, content: UffContent) -> None:
    function = content.functions[0]
    assert len(function.x) == len(function.values) == 79292
    assert function.header.kinds[0] == 17
    assert function.values[0] == pytest.approx(-1.47553e-2, rel=1e-5)
    assert [n.code for n in content.notices] == ["uff.not-an-frf"]


def test_lab(path: Path, content: UffContent) -> None:
    frame = content.test.geometry
    assert len(frame) == len(raw(path, "15")) == 36
    # Traced by hand from the three data sets 82: 1 stroke of 9; strokes 7-8-11-14-17-18, …; 34-33-…-34, 33-32.
    for stroke in ("2 5 6 3 4 1 2 3", "7 8 11 14 17 18", "34 33 36 35 32 31 34", "33 32"):
        assert tuple(map(int, stroke.split())) in frame.lines
    # System 1 of data set 18: x from its origin to the second point, −x and (almost) nothing else.
    assert frame.axes is not None
    node1 = frame.nodes.tolist().index(1)
    np.testing.assert_allclose(frame.axes[node1], [[-1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=2e-7)
    assert ("model", "AME_Test") in content.test.conditions


def salome(path: Path, content: UffContent) -> None:
    assert len(content.test.geometry) == len(raw(path, "2411")) // 2
    lines = raw(path, "2412")
    beams = sum(line.split()[1] in ("11", "21", "22", "24") for line in lines if len(line.split()) == 6)
    others = sum(len(line.split()) == 6 for line in lines) - beams
    assert 3 * beams + 2 * others == len(lines)
    assert len(content.test.geometry.elements) == beams + others
    assert any("2467" in notice.what for notice in content.notices)


def oros(path: Path, content: UffContent) -> None:
    assert len(content.test.geometry) == len(raw(path, "15")) == 96
    assert content.test.geometry.position(7) == pytest.approx([-51.619, 51.619, 50.0])
    assert content.test.geometry.elements[0] == (1, 25, 48, 24)
    assert len(content.test.geometry.elements) == len(raw(path, "2412")) // 2


def non_ascii(path: Path, content: UffContent) -> None:
    values = content.functions[0].values
    assert len(values) == 6
    assert values[2] == pytest.approx(2.5875e-2 - 2.30085e-4j)
    assert content.functions[0].x[5] == pytest.approx(5 * 0.195313)


def spectrum(path: Path, content: UffContent) -> None:
    numbers = np.array([float(x) for line in raw(path, "58")[11:] for x in line.split()]).reshape(-1, 3)
    assert len(content.functions[0].x) == 3201
    np.testing.assert_array_equal(content.functions[0].x, numbers[:3201, 0])
    np.testing.assert_array_equal(content.functions[0].values.real, numbers[:3201, 1])


def time_history(path: Path, content: UffContent) -> None:
    assert content.functions[0].values.tolist() == [float(x) for line in raw(path, "58")[11:] for x in line.split()]
    assert len(content.functions[0].values) == 13


def one_pole(path: Path, content: UffContent) -> None:
    modes = content.test.modes
    assert modes is not None
    pole = -0.1111111 + 41.11111j
    assert modes.freq_hz == pytest.approx([abs(pole) / 2 / np.pi])
    assert modes.damping_ratio == pytest.approx([-pole.real / abs(pole)])
    assert modes.dofs.labels() == ["111111Y+", "111111Z+", "60101Z+"]
    wanted = [0.1111111 + 0.09111111j, 7.111111e-3 + 4.111111e-3j, -0.04111111 - 0.01111111j]
    assert modes.shapes[:, 0] == pytest.approx(wanted)


def translations(path: Path, content: UffContent) -> None:
    modes = content.test.modes
    assert modes is not None
    assert modes.freq_hz.tolist() == [10.0, 12.0, 13.0]
    assert modes.labels == ("1", "2", "3")
    assert len(modes.dofs) == 12
    assert modes.damping_ratio is None
    assert modes.shapes[-1].tolist() == [0.724863, 1.98289, -0.795555]
    assert modes.normalisation == "unknown"


READ: dict[str, Callable[[Path, UffContent], None]] = {
    "2411 and 2414.uff": permas,
    "NX simulation output.uff": nx,
    "Sample_UFF58_ascii.uff": microphone,
    "Sample_UFF58b_bin.uff": microphone,
    "TestLab 161 164 18 15 82.uff": test_lab,
    "groups_test.uff": salome,
    "mesh_Oros-modal_uff15_uff2412.uff": oros,
    "mesh_set2412_to_convert.uff": oros,
    "non_ascii_header.uff": non_ascii,
    "sample_dataset58_psd.uff": spectrum,
    "time-history-not-all-columns-filled.uff": time_history,
    "uff55 sample_test record10.uff": one_pole,
    "uff55_translation.uff": translations,
}
test_lab.__test__ = False  # type: ignore[attr-defined]

REFUSED = {
    "1858.uff": "uff.nothing-usable",
    "Simcenter_nxopen_thickness.uff": "uff.nothing-usable",
    "dataset_milestone_in_header.uff": "uff.truncated",
    "LICENSE": "uff.not-uff",
    "meas_point_1.txt": "uff.not-uff",
    "meas_point_2.txt": "uff.not-uff",
    "meas_point_3.txt": "uff.not-uff",
}


@pytest.mark.parametrize("name", READ)
def test_reads(name: str, shared_data: Path) -> None:
    path = shared_data / "uff" / name
    READ[name](path, read(path))


@pytest.mark.parametrize("name", REFUSED)
def test_refuses_with_a_reason(name: str, shared_data: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        read_uff(shared_data / "uff" / name, units=SI, file_units=SI)
    assert caught.value.code == REFUSED[name]
    assert caught.value.hint


def test_no_file_is_left_out(shared_data: Path) -> None:
    assert {path.name for path in (shared_data / "uff").iterdir()} == set(READ) | set(REFUSED)


def test_the_file_that_ends_early_says_how_early(shared_data: Path) -> None:
    path = shared_data / "uff" / "dataset_milestone_in_header.uff"
    with pytest.raises(FemtuneError) as caught:
        read_uff(path, units=SI, file_units=SI)
    assert caught.value.values == {"expected": 2508876, "found": len(" ".join(raw(path, "58")[11:]).split())}


def test_ascii_and_binary_twins_agree(shared_data: Path) -> None:
    ascii_file, binary_file = (
        read_uff(shared_data / "uff" / name, units=SI, file_units=SI).functions[0]
        for name in ("Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff")
    )
    np.testing.assert_allclose(ascii_file.values, binary_file.values, rtol=1e-5, atol=1e-9)
    np.testing.assert_array_equal(ascii_file.x, binary_file.x)


@pytest.fixture(scope="module")
def aeroplane(shared_data: Path) -> UffContent:
    return read_uff(shared_data / "garteur" / "frf_1995.unv", units=SI, file_units=SI)


def test_aeroplane_has_24_frfs_of_the_declared_length(aeroplane: UffContent, shared_data: Path) -> None:
    frfs = aeroplane.test.frfs
    assert frfs is not None
    assert frfs.values.shape == (24, 1, 3124)
    assert frfs.kind == "accelerance"
    # The file's own number of the reference is 12, and 1012 the response there.
    assert frfs.references.labels() == ["12Z-"]
    assert frfs.freq_hz[[0, -1]] == pytest.approx([4.0039, 4.0039 + 3123 * 1.95312e-2])
    assert {n.code for n in aeroplane.notices} == {"uff.padding", "uff.function-type", "uff.no-position"}
    sensors = re.findall(r"^ *N(\d{4}) +\S+E", (shared_data / "garteur" / "sensors.mail").read_text(), re.M)
    assert sorted(dof.node for dof in frfs.responses) == sorted(map(int, sensors))
    text = raw_sets(shared_data / "garteur" / "frf_1995.unv")[23][1][11:]
    numbers = [float(line[i : i + 13]) for line in text for i in range(0, 78, 13)]
    wanted = np.array(numbers[0:6248:2]) + 1j * np.array(numbers[1:6248:2])
    np.testing.assert_array_equal(frfs.values[23, 0], wanted)
    assert not any(numbers[6248:])
    assert len(numbers) == 2 * 3126


def test_aeroplane_peaks(aeroplane: UffContent) -> None:
    """Published first modes of this structure lie near 6.5, 16.5, 34 (a pair), 50 and 56 Hz."""
    frfs = aeroplane.test.frfs
    assert frfs is not None
    mean = np.sqrt(np.mean(np.abs(frfs.values[:, 0]) ** 2, axis=0))
    peaks = frfs.freq_hz[find_peaks(np.log(mean), prominence=0.5)[0]]
    assert peaks == pytest.approx([6.5, 16.4, 34.0, 50.2, 55.6], abs=0.1)


def test_aeroplane_drive_point_gives_energy_in(aeroplane: UffContent) -> None:
    """At the drive point the imaginary part of +Z/+Z accelerance cannot be negative; 12 is that point, 1012."""
    frfs = renumber(aeroplane.test, {12: 1012}).frfs
    assert frfs is not None
    reference = frfs.references[0]
    row = next(i for i, dof in enumerate(frfs.responses) if dof.node == reference.node)
    drive = frfs.responses[row].sign * reference.sign * frfs.values[row, 0]
    assert drive.imag.min() > -1e-3 * drive.imag.max()


@pytest.mark.slow
def test_aeroplane_units(shared_data: Path, aeroplane: UffContent) -> None:
    path = shared_data / "garteur" / "frf_1995.unv"
    with pytest.raises(FemtuneError) as caught:
        read_uff(path, units=SI)
    assert caught.value.code == "uff.no-units"
    # its labels are m/s2 and N, whatever units are stated for its coordinates
    stated = read_uff(path, units=SI, file_units=unit_system("mm-t-s"))
    assert stated.test.frfs is not None
    assert aeroplane.test.frfs is not None
    np.testing.assert_allclose(stated.test.frfs.values, aeroplane.test.frfs.values, rtol=1e-12)
    assert "uff.unit-label" in {n.code for n in stated.notices}
    inches = read_uff(path, units=unit_system("in-slinch-s"), file_units=SI).test.frfs
    assert inches is not None
    factor = 4.4482216152605 / 0.0254  # (in/s²)/lbf in one (m/s²)/N
    np.testing.assert_allclose(inches.values, factor * aeroplane.test.frfs.values, rtol=1e-12)
