"""Tests of the true rack: modal test in ropes, resonance search, sine sweep and random vibration on a table.

Nothing here is taken from the models that are updated, nor from the functions of femtune for sweeps and random
vibration. The response of the true rack is calculated with the damping of its joints (hysteretic, so that it couples
the modes). Sweep and random vibration are time histories that pass through this response, with noise of the sensors;
amplitudes, spectral densities and damping ratios are measured on them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from geometry import sensors
from mixed import Joints, deck_text
from scipy.signal import csd, welch

from femtune.dofs import DofSet, parse_dof
from femtune.fem.checks import rigid_body_modes
from femtune.files.uff import write_uff_modes
from femtune.identification import InputKnown, identify_frfs
from femtune.modal import FrfSet, ModeSet
from femtune.model import EigenSolution, solve_modes
from femtune.model.response import make_ports
from femtune.model.response.mass import inertial_forces
from femtune.study.study import load_study
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

TRUE = {"E1": 68.5e9, "E2": 205.0e9, "E3": 68.5e9, "E4": 205.0e9, "D1": 2690.0, "D2": 7900.0}
"""Materials of the true rack; those of drawings and models are `geometry.NOMINAL`."""
JOINTS = Joints()
FREQUENCY_NOISE, SHAPE_NOISE, SENSOR_NOISE, MASS_NOISE = 0.001, 0.01, 0.003, 0.001
"""Relative, of frequencies, shapes (of the largest entry), sensors on the table (of the RMS), and scales."""
RIGID, ELASTIC = 6, 8
SWEEP_HZ, RATE, LEVEL = (4.0, 200.0), 2.0, 0.1
"""Band, octaves per minute, and amplitude in g."""
SPECTRUM_HZ, SPECTRUM = (10.0, 50.0, 2000.0), (0.0005, 0.002, 0.002)
"""Random vibration, g²/Hz."""
SEARCH_LEVEL = 1e-5
"""Flat spectrum of the resonance search, g²/Hz."""
AVERAGES = 200
_LINES = 20_000
"""Frequencies at a time, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class OnTable:
    """The true rack on the table: what its joints make of its modes.

    Parameters
    ----------
    eigenvalues : (m,) of the undamped modes
    damping : (m, m) hysteretic damping in modal coordinates
    pushed : (m,) inertia forces of the modes per acceleration of the table
    seen : (o, m) shapes at the outputs
    carried : (o,) motion of the outputs with the table
    """

    eigenvalues: np.ndarray
    damping: np.ndarray
    pushed: np.ndarray
    seen: np.ndarray
    carried: np.ndarray

    def at(self, freq_hz: np.ndarray) -> np.ndarray:
        """(o, n) absolute accelerations over that of the table."""
        # complex modes of the coupled problem make it cheap at many lines
        values, left = np.linalg.eig(np.diag(self.eigenvalues) + 1j * self.damping)
        driven = np.linalg.solve(left, self.pushed.astype(complex))
        shapes, out = (self.seen @ left) * driven, np.empty((len(self.seen), len(freq_hz)), complex)
        for start in range(0, len(freq_hz), _LINES):
            square = (2.0 * np.pi * freq_hz[start : start + _LINES]) ** 2
            relative = shapes @ (square / (values[:, None] - square))
            out[:, start : start + _LINES] = self.carried[:, None] + relative
        return out


def solved(folder: Path, text: str, modes: int) -> EigenSolution:
    """Modes of a deck."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "true.bdf").write_text(text)
    (folder / "true.toml").write_text(
        f'[study]\ntitle = "True rack"\ndeck = "true.bdf"\nunits = "m-kg-s"\n[modes]\ncount = {modes}\n'
    )
    study = load_study(folder / "true.toml")
    return solve_modes(study.cases[0].configured.at(np.zeros(0)), modes)


def on_table(folder: Path, outputs: list[str], modes: int) -> OnTable:
    """The true rack on its bolts, excited along X."""
    found = solved(folder / "table", deck_text(TRUE, JOINTS, table=True, modes=modes), modes)
    configured, shapes = found.point.configured, found.shapes[:, : found.wanted]
    motions = rigid_body_modes(configured.model.structure.nodes)
    forces = inertial_forces(found.point, motions)[:, 0]
    ports = make_ports(configured, outputs[:1], outputs)
    return OnTable(
        found.eigenvalues[: found.wanted],
        shapes.T @ (found.point.hysteretic @ shapes),
        (configured.transformation @ shapes).T @ forces,
        np.asarray(ports.outputs @ shapes),
        np.asarray(ports.outputs @ motions[configured.free, 0]),
    )


def modal_test(folder: Path, seed: int) -> float:
    """Write the modal test of the rack in ropes to rack.uff; its weighed mass, kg."""
    chance = np.random.default_rng(seed)
    found = solved(folder / "free", deck_text(TRUE, JOINTS, modes=RIGID + ELASTIC), RIGID + ELASTIC)
    dofs = DofSet(parse_dof(f"{number}{axis}+") for number in sensors() for axis in "XYZ")
    ports = make_ports(found.point.configured, [dofs[0]], dofs)
    shapes = np.asarray(ports.outputs @ found.shapes[:, RIGID : RIGID + ELASTIC])
    true = np.sqrt(found.eigenvalues[RIGID : RIGID + ELASTIC]) / (2.0 * np.pi)
    freq = true * (1.0 + FREQUENCY_NOISE * chance.standard_normal(ELASTIC))
    shapes = shapes + SHAPE_NOISE * np.abs(shapes).max(axis=0) * chance.standard_normal(shapes.shape)
    frame = WireFrame(np.array(list(sensors())), np.array([outside for _, outside in sensors().values()]))
    write_uff_modes(folder / "rack.uff", [ModalTest("in ropes", SI, frame, modes=ModeSet(freq, shapes, dofs))])
    motions = rigid_body_modes(found.point.configured.model.structure.nodes)
    mass = float(motions[:, 0] @ inertial_forces(found.point, motions)[:, 0])
    return mass * (1.0 + MASS_NOISE * chance.standard_normal())


def resonance_search(rack: OnTable, dofs: list[str], seed: int) -> ModeSet:
    """Modes and damping ratios on the table, identified from a random vibration test of a low level."""
    chance, rate, length = np.random.default_rng(seed), 1280.0, 20480
    base, seen = _random(rack, ((5.0, 600.0), (SEARCH_LEVEL, SEARCH_LEVEL)), rate, length * 40, chance)
    options = {"fs": rate, "nperseg": length, "noverlap": length // 2}
    hz, density = welch(base, **options)
    values = np.array([csd(base, y, **options)[1] / density for y in seen])[:, None, :]
    band = (hz > 15.0) & (hz < 260.0)
    frfs = FrfSet(hz[band], values[:, :, band], DofSet(map(parse_dof, dofs)), DofSet([parse_dof("8000X+")]),
                  "accelerance")  # fmt: skip
    return identify_frfs(frfs, InputKnown((20.0, 250.0), largest_order=40)).modes


def sweep(rack: OnTable, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies of a sweep and the amplitudes (o, n) that a tracking filter shows, g."""
    chance, rate = np.random.default_rng(seed), 1024.0
    low, high = SWEEP_HZ
    growth = RATE * np.log(2.0) / 60.0
    time = np.arange(0.0, np.log(high / low) / growth, 1.0 / rate)
    phase = 2.0 * np.pi * low * np.expm1(growth * time) / growth
    # the analytic signal of the table; zeros after it let the response decay
    signal = np.fft.fft(np.exp(1j * phase), 2 * len(time))
    hz = np.fft.fftfreq(len(signal), 1.0 / rate)
    positive = np.where(hz > 0.0, signal, 0.0)
    amplitude = LEVEL * np.abs(np.fft.ifft(positive * rack.at(np.abs(hz)))[:, : len(time)])
    at = np.arange(round(2.0 * rate), len(time) - round(rate), round(0.05 * rate))
    shown = amplitude[:, at] * (1.0 + SENSOR_NOISE * chance.standard_normal((len(amplitude), len(at))))
    return low * np.exp(growth * time[at]), shown


def random_vibration(rack: OnTable, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, and power spectral densities (o, n) of the responses, g²/Hz."""
    chance, rate, length = np.random.default_rng(seed), 5120.0, 20480
    _, seen = _random(rack, (SPECTRUM_HZ, SPECTRUM), rate, length * AVERAGES // 2, chance)
    hz, density = welch(seen, fs=rate, nperseg=length, noverlap=length // 2)
    band = (hz >= SPECTRUM_HZ[0]) & (hz <= SPECTRUM_HZ[-1])
    return hz[band], density[:, band]


def _random(
    rack: OnTable,
    spectrum: tuple[tuple[float, ...], tuple[float, ...]],
    rate: float,
    samples: int,
    chance: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Time histories of the table (n,) and of the outputs (o, n), with the noise of the sensors."""
    hz = np.fft.rfftfreq(samples, 1.0 / rate)
    given = np.log(np.array(spectrum))
    inside = (hz >= spectrum[0][0]) & (hz <= spectrum[0][-1])
    density = np.where(inside, np.exp(np.interp(np.log(np.maximum(hz, 1e-9)), *given)), 0.0)
    white = chance.standard_normal(len(hz)) + 1j * chance.standard_normal(len(hz))
    line = white * np.sqrt(0.25 * density * rate * samples)
    base, seen = np.fft.irfft(line, samples), np.fft.irfft(line * rack.at(hz), samples)
    noise = chance.standard_normal(seen.shape)
    return base, seen + SENSOR_NOISE * seen.std(axis=1, keepdims=True) * noise


def write_curves(path: Path, freq_hz: np.ndarray, values: np.ndarray, outputs: list[str]) -> None:
    """A table as `measured` of [[vibration]] reads it."""
    np.savetxt(path, np.vstack([freq_hz, values]).T, "%.6g", ",", header=",".join(["Hz", *outputs]), comments="")
