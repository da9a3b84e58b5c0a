"""Auto and cross spectra of responses as input of output-only identification, from files of several formats."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.modal.shape_criteria import mac

FREQ, RATIO = np.array([3.1, 8.7, 16.4]), np.array([0.01, 0.02, 0.005])
SHAPES = np.array([[0.4, 0.6, 0.3], [0.7, 0.2, -0.6], [0.7, -0.4, 0.5], [0.4, -0.6, -0.3]])
STEP_HZ, LINES = 0.05, 801
HZ = STEP_HZ * np.arange(LINES)
PAIRS = tuple((i, j) for i in range(4) for j in range(4))
NAMES = tuple(f"{i + 1}Z+" for i in range(4))


def exact_spectra(window: bool, machine: bool = False) -> np.ndarray:
    """(4, 4, lines) spectra of displacements under white modal forces that are independent of each other.

    The correlation function of a mode is e^{-ζω|τ|}(cos ω_d τ + ζ/√(1−ζ²) sin ω_d |τ|). Averaged periodograms of Hann
    segments of T seconds have it times the correlation of the window, repeated after T.
    """
    freq, ratio, shapes = FREQ, RATIO, SHAPES
    if machine:
        freq, ratio = np.append(FREQ, 5.0), np.append(RATIO, 1e-5)
        shapes = np.column_stack([SHAPES, [0.01, 0.005, -0.007, 0.003]])
    n = 2 * (LINES - 1)
    x = np.arange(n) / n
    own = (1.0 - x) * (2.0 + np.cos(2.0 * np.pi * x)) / 3.0 + np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
    weights = own if window else (x <= 0.5).astype(float)
    omega = 2.0 * np.pi * freq[:, None]
    damped, tau = omega * np.sqrt(1.0 - ratio[:, None] ** 2), x / STEP_HZ
    sine = (ratio[:, None] * omega / damped) * np.sin(damped * tau)
    modes = np.exp(-ratio[:, None] * omega * tau) * (np.cos(damped * tau) + sine) / (ratio * freq**3)[:, None] * weights
    modes[:, 1:] += modes[:, :0:-1]
    return np.einsum("im,mk,jm->ijk", shapes, np.fft.rfft(modes, axis=1).real, shapes).astype(complex)


@pytest.fixture(scope="module")
def hann() -> np.ndarray:
    return exact_spectra(window=True)


def write_uff(path: Path, values: np.ndarray, pairs: tuple[tuple[int, int], ...], kind: int | None = None) -> Path:
    lines = []
    for i, j in pairs:
        lines += ["    -1", "    58", *["NONE"] * 5]
        own = kind or (2 if i == j else 3)
        lines.append(f"{own:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{i + 1:10d}{3:4d} {'NONE':<10}{j + 1:10d}{3:4d}")
        lines.append(f"{6:10d}{LINES:10d}{1:10d}{0.0:13.5e}{STEP_HZ:13.5e}{0.0:13.5e}")
        for code, name, unit in ((18, "Frequency", "Hz"), (8, "Disp", "m"), (8, "Disp", "m"), (0, "NONE", "NONE")):
            lines.append(f"{code:10d}{0:5d}{0:5d}{0:5d} {name:<20} {unit:<20}")
        own_values = values[i, j]
        lines += ["".join(f"{v.real:20.11e}{v.imag:20.11e}" for v in own_values[k : k + 2]) for k in range(0, LINES, 2)]
        lines.append("    -1")
    path.write_text("\n".join(lines) + "\n")
    return path


def check(found: ft.IdentifyResult) -> None:
    modes = found.modes
    assert modes.freq_hz == pytest.approx(FREQ, rel=1e-4)
    assert modes.damping_ratio == pytest.approx(RATIO, rel=0.01)
    assert modes.freq_sd_hz is None
    assert np.diag(mac(modes.shapes, SHAPES)).min() > 0.9999


OPTIONS = {"band_hz": (1.0, 20.0), "largest_order": 16}


@pytest.mark.parametrize(
    ("pairs", "kind"),
    [(PAIRS, None), (tuple((i, j) for i, j in PAIRS if i <= j), 9), (tuple((i, 0) for i in range(4)), None)],
)
def test_modes_of_a_universal_file_are_those_of_the_spectra(
    tmp_path: Path, hann: np.ndarray, pairs: tuple[tuple[int, int], ...], kind: int | None
) -> None:
    found = ft.identify(write_uff(tmp_path / "s.unv", hann, pairs, kind), **OPTIONS)
    check(found)
    methods = set(found.record.modes[0].by_method)
    assert methods == ({"SSI-cov", "ERA", "FDD"} if len(pairs) > 4 else {"SSI-cov", "ERA"})
    assert any("lines 0.05 Hz apart" in str(notice) for notice in found.found.notices)


def toml(tmp_path: Path, keys: str, functions: str, table: str = "") -> Path:
    path = tmp_path / "identify.toml"
    path.write_text(f"[identify]\nband_hz = [1.0, 20.0]\nlargest_order = 16\n{keys}\n[functions]\n{functions}\n{table}")
    return path


def test_modes_of_an_array_with_the_window_that_was_used(tmp_path: Path, hann: np.ndarray) -> None:
    names = json.dumps(NAMES)
    layout = f'variable = "S"\nfrequency = "f"\nresponses = {names}\nreferences = {names}\n'
    layout += 'axes = ["response", "reference", "frequency"]'
    np.savez(tmp_path / "s.npz", S=hann, f=HZ)
    check(ft.identify(toml(tmp_path, 'spectra = "s.npz"', layout)))
    # without its correction the window adds damping, most to the mode with the least
    plain = ft.identify(toml(tmp_path, 'spectra = "s.npz"\nspectra_window = "none"', layout)).modes.damping_ratio
    assert plain is not None
    assert plain[2] > 1.03 * RATIO[2]
    np.savez(tmp_path / "c.npz", S=exact_spectra(window=False), f=HZ)
    check(ft.identify(toml(tmp_path, 'spectra = "c.npz"\nspectra_window = "none"', layout)))


def test_modes_of_a_table_whose_auto_spectra_are_real(tmp_path: Path, hann: np.ndarray) -> None:
    columns = [HZ, hann[0, 0].real, *(part for i in (1, 2, 3) for part in (hann[i, 0].real, hann[i, 0].imag))]
    head = "f,auto," + ",".join(f"re{i},im{i}" for i in (2, 3, 4))
    np.savetxt(tmp_path / "s.csv", np.transpose(columns), delimiter=",", header=head, comments="")
    entries = '[[function]]\ncolumn = "auto"\nresponse = "1Z+"\nreference = "1Z+"\n'
    for i in (2, 3, 4):
        entries += f'[[function]]\ncolumn = "re{i}"\nimaginary = "im{i}"\nresponse = "{i}Z+"\nreference = "1Z+"\n'
    check(ft.identify(toml(tmp_path, 'spectra = "s.csv"', 'frequency = "f"', entries)))


def test_a_line_of_a_machine_is_doubtful(tmp_path: Path) -> None:
    values = exact_spectra(window=True, machine=True)
    found = ft.identify(write_uff(tmp_path / "s.unv", values, PAIRS), **OPTIONS)
    assert [(round(m.freq_hz, 1), m.doubtful) for m in found.record.modes] == [
        (3.1, False), (5.0, True), (8.7, False), (16.4, False),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("pairs", "options", "said"),
    [
        (tuple((i, i) for i in range(4)), {}, "no phases"),
        (((0, 1), (2, 3)), {}, "no response has cross spectra with all the others"),
        (PAIRS, {"band_hz": (1.0, 60.0)}, "do not reach over the band"),
        (PAIRS, {"remove_hz": (5.0,)}, "remove_hz is for time records"),
        (PAIRS, {"methods": ("SSI-data",)}, "cannot use spectra"),
    ],
)
def test_spectra_that_give_no_modes_are_refused(
    tmp_path: Path, hann: np.ndarray, pairs: tuple[tuple[int, int], ...], options: dict[str, object], said: str
) -> None:
    path = write_uff(tmp_path / "s.unv", hann, pairs)
    with pytest.raises(FemtuneError, match=said):
        ft.identify(path, **{**OPTIONS, **options})
