"""What laboratories hand over, in many forms: lines, hits, headings, units, files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import lfilter

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.records.headings import stated_channel
from femtune.files.uff import write_uff_frfs
from femtune.modal import FrfSet, pole_of
from femtune.testdata import ModalTest
from femtune.units import SI

# ----------------------------------------------------------------------------------------------------
# Lines of machines in files of several kinds.

FREQ, DAMPING = np.array([3.1, 7.4, 8.6, 14.2, 22.5]), np.array([0.01, 0.012, 0.008, 0.015, 0.01])
SHAPES = np.random.default_rng(4).uniform(-1.0, 1.0, (5, 4))
LINE = np.array([0.9, 0.3, 0.5, 0.7])


def operation(factor: float, rate: float, seconds: float, lines: dict[float, float], seed: int) -> np.ndarray:
    """(4, n) accelerations under white forces, with lines of some levels beside the rms."""
    rng, t = np.random.default_rng(seed), np.arange(round(rate * seconds)) / rate
    forces, y = rng.standard_normal((4, t.size)), np.zeros((4, t.size))
    for pole, shape in zip(np.exp(pole_of(factor * FREQ, DAMPING) / rate), SHAPES):
        y += np.outer(shape, lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], shape @ forces))
    rms = y.std()
    for hz, level in lines.items():
        y += level * rms * np.sqrt(2.0) * np.outer(LINE, np.sin(2.0 * np.pi * hz * t + hz))
    return np.asarray(y + 0.03 * rms * rng.standard_normal(y.shape))


def as_npy(values: np.ndarray, rate: float, path: Path) -> tuple[Path, dict[str, object]]:
    np.save(path / "record.npy", values.T)
    return path / "record.npy", {"sampling_hz": rate}


def as_mat(values: np.ndarray, rate: float, path: Path) -> tuple[Path, dict[str, object]]:
    savemat(path / "record.mat", {"y": values.T, "note": np.zeros(1)})
    return path / "record.mat", {"sampling_hz": rate, "variable": "y"}


def as_text(values: np.ndarray, rate: float, path: Path) -> tuple[Path, dict[str, object]]:
    heads, t = "Zeit [s]\tA\tB\tC\tD", np.arange(values.shape[1]) / rate
    np.savetxt(
        path / "record.txt", np.column_stack([t, values.T]), delimiter="\t", header=heads, comments="", fmt="%.7g"
    )
    return path / "record.txt", {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("write", "factor", "rate", "seconds", "band", "lines"),
    [
        (as_npy, 2.0, 200.0, 200.0, (3.0, 60.0), {11.0: 1.0, 22.0: 0.5, 33.0: 0.3}),
        (as_mat, 1.0, 100.0, 240.0, (1.0, 30.0), {16.7: 2.0}),
        (as_text, 6.0, 400.0, 120.0, (10.0, 180.0), {50.0: 0.4, 100.0: 0.4, 150.0: 0.2}),
    ],
)
def test_lines_are_no_modes_whatever_their_frequency_and_the_file(
    write: object, factor: float, rate: float, seconds: float, band: tuple[float, float], lines: dict[float, float],
    tmp_path: Path,
) -> None:  # fmt: skip
    assert callable(write)
    path, options = write(operation(factor, rate, seconds, lines, 5), rate, tmp_path)
    made = ft.identify(path, band_hz=band, **options)
    found = [m.freq_hz for m in made.record.modes]
    assert found == pytest.approx(factor * FREQ, rel=0.01)
    named = [line.freq_hz for line in made.record.harmonics]
    assert all(min(abs(hz - f) for f in named) < 0.05 for hz in lines)


# ----------------------------------------------------------------------------------------------------
# Hits with other modes, quantities, headings and numbers of hits.

MODES = ((43.0, 0.06, 1.0), (91.0, 0.03, 0.7), (128.0, 0.05, 0.8))
RATE = 2048.0


def struck(
    samples: int, derivatives: int, at: tuple[int, ...] = (40,), seed: int = 0, modes: tuple = MODES
) -> np.ndarray:
    """(samples, 2) force and response: displacement, velocity or acceleration."""
    rng, force, y = np.random.default_rng(seed), np.zeros(samples), np.zeros(samples)
    for start in at:
        force[start : start + 6] += 100.0 * np.sin(np.pi * np.arange(6) / 6.0) * rng.uniform(0.7, 1.3)
    # differences to the sample before are exact derivatives of the sampled modes: nothing moves before the force
    difference = np.array(([1.0], [RATE, -RATE], [RATE**2, -2.0 * RATE**2, RATE**2])[derivatives])
    for hz, ratio, part in modes:
        pole = np.exp(pole_of(np.array([hz]), np.array([ratio])) / RATE)[0]
        y += part / hz * lfilter(pole.imag * difference, [1.0, -2.0 * pole.real, abs(pole) ** 2], force)
    noise = rng.standard_normal((samples, 2)) * [0.02, 2e-4 * np.abs(y).max()]
    return np.column_stack([force, y]) + noise


@pytest.mark.slow
@pytest.mark.parametrize(
    ("heads", "derivatives", "delimiter", "decimal", "at"),
    [
        ("Hammer [N];7Z+ [mm]", 0, ";", ".", (40,)),
        ("impact;Vel 7Z+ [m/s]", 1, ";", ",", (40,)),
        ("force,acceleration", 2, ",", ".", (40,)),
        ("Marteau [N]\tAcc 7Z- [g]", 2, "\t", ".", (300, 5500, 9000, 9150, 15000, 20000)),
    ],
)
def test_hits_are_found_by_their_force_in_any_table(
    heads: str, derivatives: int, delimiter: str, decimal: str, at: tuple[int, ...], tmp_path: Path
) -> None:
    values = struck(2048 * (1 if len(at) == 1 else 12), derivatives, at)
    lines = [delimiter.join(f"{x:.7g}" for x in row).replace(".", decimal) for row in values]
    (tmp_path / "hit.csv").write_text("\n".join([heads, *lines]) + "\n", encoding="utf-8")
    made = ft.identify(tmp_path / "hit.csv", sampling_hz=RATE, band_hz=(20.0, 180.0))
    assert [m.freq_hz for m in made.record.modes] == pytest.approx([m[0] for m in MODES], rel=5e-4)
    assert [m.damping_ratio for m in made.record.modes] == pytest.approx([m[1] for m in MODES], rel=5e-3)
    codes = [n.code for n in made.found.notices]
    assert "identify.hits" in codes
    assert ("identify.hit-left-out" in codes) == (len(at) > 1)


@pytest.mark.slow
def test_records_of_a_hit_with_coarse_lines_have_the_modes_of_the_structure_and_no_others(tmp_path: Path) -> None:
    for seed in range(8):
        rng = np.random.default_rng(seed)
        modes = tuple(zip(np.sort(rng.uniform(60.0, 320.0, 3)), rng.uniform(0.01, 0.08, 3), rng.uniform(0.5, 1.0, 3)))
        heads = {"header": "force,acceleration", "comments": "", "delimiter": ",", "fmt": "%.6g"}
        np.savetxt(tmp_path / "hit.csv", struck(2048, 2, seed=seed, modes=modes), **heads)
        made = ft.identify(tmp_path / "hit.csv", sampling_hz=RATE, band_hz=(50.0, 350.0))
        # a pole that has left its cluster is doubtful
        found = [mode.freq_hz for mode in made.record.modes if not mode.doubtful]
        assert found == pytest.approx([hz for hz, _, _ in modes], rel=0.003), seed


@pytest.mark.parametrize(
    ("heading", "quantity"),
    [
        ("impact", "force"), ("Impulse hammer 3Z+", "force"), ("MARTILLO", "force"), ("impact acc 3Z+", "acceleration"),
        ("Impact response [mm/s]", "velocity"), ("compact", "unknown"),
    ],
)  # fmt: skip
def test_a_heading_says_which_column_is_the_force(heading: str, quantity: str) -> None:
    assert stated_channel(heading).quantity == quantity


@pytest.mark.parametrize("rate", [1e-308, 0.0, -5.0, float("nan"), float("inf"), 1e300])
def test_an_impossible_sampling_rate_is_a_message(rate: float, tmp_path: Path) -> None:
    np.save(tmp_path / "record.npy", np.random.default_rng(0).standard_normal((2000, 2)))
    with pytest.raises(FemtuneError) as caught:
        ft.identify(tmp_path / "record.npy", sampling_hz=rate, band_hz=(3.0, 60.0))
    assert "sampling_hz" in str(caught.value)


# ----------------------------------------------------------------------------------------------------
# Universal Files: labels of units, delimiters, remarks.


@pytest.fixture(scope="module")
def file_of_frfs(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, FrfSet]:
    """The text of a file with three accelerances, and these."""
    lines, dofs = np.arange(2.0, 102.0, 0.5), DofSet.parse(["3Z+", "5Z+", "7Z+"])
    poles = pole_of(np.array([11.0, 34.0]), np.array([0.01, 0.02]))
    shapes = np.array([[0.3, 0.8], [0.7, 0.4], [1.0, -0.9]])
    s = 2j * np.pi * lines[:, None]
    values = (shapes * shapes[2]) @ (s**2 / ((s - poles) * (s - poles.conj()))).T
    path = tmp_path_factory.mktemp("uff") / "frfs.uff"
    frfs = FrfSet(lines, values[:, None], dofs, dofs.select([2]), "accelerance")
    write_uff_frfs(path, ModalTest("t", SI, frfs=frfs))
    read = ft.read_test(path).frfs
    assert read is not None
    return path.read_text(encoding="utf-8"), read


def changed(text: str, old: str, new: str, path: Path) -> FrfSet:
    assert old in text
    (path / "changed.uff").write_text(text.replace(old, new), encoding="utf-8", newline="")
    frfs = ft.read_test(path / "changed.uff").frfs
    assert frfs is not None
    return frfs


LABELS = {
    "mm/s2": 1e-3, "cm/s^2": 1e-2, "in/s2": 0.0254, "ft/s2": 0.3048, "mg": 9.80665e-3, "g's": 9.80665, "gn": 9.80665,
    "m/s**2": 1.0, "m/s/s": 1.0,
}  # fmt: skip


@pytest.mark.parametrize("label", LABELS)
def test_the_unit_of_a_response_is_used(label: str, file_of_frfs: tuple[str, FrfSet], tmp_path: Path) -> None:
    text, frfs = file_of_frfs
    read = changed(text, "m/s2    ", f"{label:<8}", tmp_path)
    np.testing.assert_allclose(read.values, LABELS[label] * frfs.values, rtol=1e-6)


@pytest.mark.parametrize(("label", "factor"), [("kHz", 1e3), ("1/min", 1 / 60), ("rpm", 1 / 60), ("cps", 1.0)])
def test_the_unit_of_the_lines_is_used(
    label: str, factor: float, file_of_frfs: tuple[str, FrfSet], tmp_path: Path
) -> None:
    text, frfs = file_of_frfs
    read = changed(text, "Hz   ", f"{label:<5}", tmp_path)
    np.testing.assert_allclose(read.freq_hz, factor * frfs.freq_hz, rtol=1e-6)
