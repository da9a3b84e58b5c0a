"""Poles whose fit leaves their cluster: true modes that are lost, false ones that are told. in_place.py [COUNT]

Random systems of 2 to 8 modes, damping ratios of 0.1 to 8 %, 1 to 12 sensors, one or two references, noise of 20 to 60
dB; half of the systems have a mode just outside the band. The same systems with the leakage of a Hann window over a
decaying response show the power. An end is true if it is within two half bandwidths or 2 % of a mode inside the band,
to which no other end is nearer.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.identification import InputKnown, identify_frfs
from femtune.identification.input_known import IdentifiedModes
from femtune.modal import FrfSet, freq_and_damping, pole_of

LINES = 400


def system(rng: np.random.Generator) -> tuple[NDArray, NDArray, int]:
    """Poles, residues (n, u, m) of accelerances in a band of 20 to 100 Hz, and the number of references."""
    m, n, u = int(rng.integers(2, 9)), int(rng.integers(1, 13)), int(rng.integers(1, 3))
    u = min(u, n)
    freq = np.sort(rng.uniform(24.0, 96.0, m))
    if rng.random() < 0.5:
        freq = np.append(freq, rng.choice([18.5, 19.5, 101.0, 104.0]))
    damping = 10.0 ** rng.uniform(-3.0, np.log10(0.08), len(freq))
    shapes = rng.standard_normal((n, len(freq)))
    poles = pole_of(freq, damping)
    return poles, np.einsum("ir,jr,r->ijr", shapes, shapes[:u], 1.0 / (2j * poles.imag)), u


def functions(poles: NDArray, residues: NDArray, leakage: bool, rng: np.random.Generator) -> FrfSet:
    """Accelerances at the lines with noise; with leakage each line is mixed with its neighbours as by a Hann window."""
    lines = np.linspace(20.0, 100.0, LINES if not leakage else 120)
    s = 2j * np.pi * lines
    values = residues @ (1.0 / (s - poles[:, None])) + residues.conj() @ (1.0 / (s - poles.conj()[:, None]))
    values = values * s**2
    if leakage:
        values[:, :, 1:-1] = values[:, :, 1:-1] - 0.5 * values[:, :, :-2] - 0.5 * values[:, :, 2:]
    size = np.sqrt(np.mean(np.abs(values) ** 2))
    noise = 10.0 ** -rng.uniform(1.0, 3.0) * size / np.sqrt(2.0)
    values = values + noise * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
    n, u, _ = values.shape
    dofs = DofSet.parse(f"{i + 1}Z+" for i in range(n))
    return FrfSet(lines, values, dofs, dofs.select(range(u)), "accelerance")


def true_ends(ends: NDArray, poles: NDArray) -> NDArray:
    """Which ends are modes inside the band, each mode once."""
    poles = poles[(np.abs(poles) > 2.0 * np.pi * 20.0) & (np.abs(poles) < 2.0 * np.pi * 100.0)]
    away = np.abs(ends[:, None] - poles) / np.maximum(2.0 * np.abs(poles.real), 0.02 * np.abs(poles))
    good = np.zeros(len(ends), bool)
    for j in range(len(poles)):
        if len(ends):
            i = int(away[:, j].argmin())
            good[i] |= away[i, j] <= 1.0
    return good


def main() -> None:
    """Counts of both kinds of data."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for leakage in (False, True):
        counts, refused = np.zeros((2, 2), int), 0
        for seed in range(count):
            rng = np.random.default_rng(seed)
            poles, residues, _ = system(rng)
            frfs = functions(poles, residues, leakage, rng)
            try:
                found: IdentifiedModes = identify_frfs(frfs, InputKnown(largest_order=40))
            except FemtuneError:
                refused += 1
                continue
            fit = found.fit
            good = true_ends(fit.poles, poles)
            for i in np.flatnonzero(fit.left & good | fit.reported & ~good):
                what = "lost" if good[i] else "false"
                hz, ratio = (float(x[0]) for x in freq_and_damping(fit.poles[[i]]))
                print(f"   {seed} {what} {hz:.2f} Hz {100 * ratio:.2f} %")
            for row, mask in enumerate((good, ~good)):
                counts[row] += [np.sum(fit.reported & mask), np.sum(fit.left & mask)]
        name, (true, false) = "leakage" if leakage else "noise", counts
        print(f"{name}: true kept {true[0]}, lost {true[1]}; false kept {false[0]}, told {false[1]}; refused {refused}")


if __name__ == "__main__":
    main()
