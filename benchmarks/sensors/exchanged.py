"""How often two exchanged sensors are named: python exchanged.py [--each N] [--evidence DIR].

The ten decks of the benchmark of health give mode shapes. A test has 8 to 30 of their points, the first four to eight
modes of a structure that differs from the model at random, and noise. Two channels are exchanged, or none.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

import femtune as ft
from femtune.correlation import correlate
from femtune.dofs import DofSet
from femtune.modal import ModeSet

sys.path.insert(0, str(Path(__file__).parents[1] / "health"))
from decks import DECKS, Model

NAME = "benchmark_exchanged.md"
MODES = 12
SPREADS = (0.0, 0.05, 0.1, 0.2)
"""Standard deviation of the modal stiffness of the structure from that of the model, as a part of it."""
USUAL = 0.1
"""Largest of these differences with which shapes of a test still resemble those of the model (mean MAC above 0.9)."""
NOISES = (0.01, 0.03)
"""Standard deviation of a measured shape, as a part of its largest value."""
OTHERS = ("none", "gain", "dead", "inverted", "noisy", "mass")
"""What is wrong in the tests without an exchange."""
VISIBLE = 0.02
"""Least fall of the mean MAC of the modes by an exchange that the shapes can show."""

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trial:
    """One test: what was exchanged, by how much the mean MAC falls by it, and what was told."""

    deck: str
    spread: float
    noise: float
    exchanged: tuple[str, str] | None
    fall: float
    told: str
    fault: str

    @property
    def found(self) -> bool:
        """The two sensors are named."""
        first, second = self.exchanged or ("", "")
        return f"{first} with {second}" in self.told or f"{second} with {first}" in self.told


def modes_of(model: Model, folder: Path) -> ModeSet:
    """The modes of a deck at all points that are free, in the directions that its test measures."""
    deck = folder / f"{model.name.replace(' ', '_')}.bdf"
    deck.write_text(model.text())
    held = {int(card[3]) for card in model.named("SPC1")}
    sensors = [f"{n}:{model.measured}" for n in model.places if n not in held]
    test = ft.simulate(deck, sensors, units=model.units, count=MODES + 6 * (not model.case))
    assert test.modes is not None
    return test.modes.select_modes(range(len(test.modes) - MODES, len(test.modes)))


def differing(modes: ModeSet, spread: float, random: np.random.Generator, mass: bool) -> ModeSet:
    """Modes of a structure whose modal stiffness is Λ½ (1 + spread R) Λ½ with R random and symmetric.

    With `mass` a mass that the model lacks is at one point: it adds up to half of a modal mass.
    """
    root = 2.0 * np.pi * np.maximum(modes.freq_hz, 1.0)
    noise = random.standard_normal((len(root), len(root)))
    relative = np.eye(len(root)) + spread * (noise + noise.T) / 2.0
    added = np.zeros((len(root), len(root)))
    if mass:
        row = modes.shapes[int(random.integers(len(modes.dofs)))]
        added = np.outer(row, row) * 0.5 / np.max(row**2)
    values, vectors = eigh(root[:, None] * relative * root[None, :], np.eye(len(root)) + added)
    vectors *= np.where(np.diag(vectors) < 0.0, -1.0, 1.0)
    freq = np.sqrt(np.maximum(values, 1.0)) / (2.0 * np.pi)
    return replace(modes, freq_hz=freq, shapes=modes.shapes @ vectors)


def other_fault(shapes: Reals, kind: str, random: np.random.Generator) -> Reals:
    """Test shapes with a fault of one channel that is no exchange, or with none."""
    changed = shapes.copy()
    k = int(random.integers(len(shapes)))
    if kind == "gain":
        changed[k] *= float(random.choice([0.5, 2.0]))
    elif kind == "dead":
        changed[k] = 0.0
    elif kind == "inverted":
        changed[k] *= -1.0
    elif kind == "noisy":
        changed[k] += 0.5 * np.abs(shapes).max(axis=0) * random.standard_normal(shapes.shape[1])
    return changed


def trial(deck: str, modes: ModeSet, seed: int, spread: float, noise: float, fault: str) -> Trial:
    """One test of a deck, compared with its model."""
    random = np.random.default_rng(seed)
    size = min(int(random.integers(8, 31)), len(modes.dofs))
    rows = np.sort(random.choice(len(modes.dofs), size, replace=False))
    model = modes.select_dofs(DofSet(modes.dofs[int(k)] for k in rows)).select_modes(range(MODES - 2))
    real = (
        differing(modes, spread, random, fault == "mass")
        .select_dofs(model.dofs)
        .select_modes(range(int(random.integers(4, 9))))
    )
    scale = np.abs(real.shapes).max(axis=0)
    shapes = real.shapes + noise * scale * random.standard_normal(real.shapes.shape)
    swap = fault == "exchange"
    a, b = sorted(int(k) for k in random.choice(size, 2, replace=False))
    changed = shapes.copy()
    changed[[a, b]] = changed[[b, a]]
    fall = float(np.mean(_self_mac(shapes, shapes) - _self_mac(shapes, changed)))
    test = replace(real, shapes=changed if swap else other_fault(shapes, fault, random))
    codes = [n for n in correlate(test, model).notices if n.code == "correlate.sensors-exchanged"]
    told = codes[0].what if codes else ""
    return Trial(deck, spread, noise, (str(model.dofs[a]), str(model.dofs[b])) if swap else None, fall, told, fault)


def _self_mac(a: Reals, b: Reals) -> Reals:
    products = np.einsum("ij,ij->j", a, b) ** 2
    return np.asarray(products / (np.einsum("ij,ij->j", a, a) * np.einsum("ij,ij->j", b, b)))


def page(tried: list[Trial]) -> str:
    """The table."""
    swapped = [t for t in tried if t.exchanged]
    visible = [t for t in swapped if t.fall >= VISIBLE]
    right = [t for t in tried if not t.exchanged]
    lines = [
        "# Exchanged sensors that are named",
        "",
        f"Written by `make bench-sensors`: {len(swapped)} tests with two exchanged channels and {len(right)} without,",
        "of 8 to 30 points of ten small decks and four to eight modes. The structure differs from the model by a",
        "random symmetric matrix in modal coordinates; noise is a part of the largest value of a shape. Tests without",
        "an exchange have nothing wrong, one channel that is dead, inverted, noisy or has a wrong factor, or a mass",
        f"that the model lacks. {len(visible)} exchanges lower the mean MAC by {VISIBLE} or more; others change the",
        "shapes too little.",
        "",
        f"**Where the stiffness differs by at most {100 * USUAL:.0f} %,",
        f"{_part([t for t in visible if t.spread <= USUAL])} of the visible exchanges are named;",
        f"{_part(visible)} with all differences, {_part(swapped)} of all exchanges.",
        f"{sum(bool(t.told) for t in right)} of {len(right)} tests without an exchange raise an alarm.**",
        f"{sum(bool(t.told) and not t.found for t in swapped)} of the tests with an exchange name another pair only.",
        "",
        "| stiffness differs by | noise | visible exchanges named | all | alarms without an exchange |",
        "| ---: | ---: | ---: | ---: | ---: |",
    ]
    for spread in SPREADS:
        for noise in NOISES:
            of = [t for t in tried if (t.spread, t.noise) == (spread, noise)]
            lines.append(
                f"| {100 * spread:.0f} % | {100 * noise:.0f} % | {_part([t for t in of if t in visible])} "
                f"| {_part([t for t in of if t.exchanged])} | {sum(bool(t.told) for t in of if not t.exchanged)} |"
            )
    for what, counts in (
        ("Alarms by what is wrong instead", Counter(t.fault for t in right if t.told)),
        ("Missed visible exchanges", Counter(t.deck for t in visible if not t.found)),
    ):
        lines += ["", f"{what}: {', '.join(f'{name} {n}' for name, n in counts.most_common()) or 'none'}."]
    lines.append("")
    return "\n".join(lines)


def _part(trials: list[Trial]) -> str:
    found = sum(t.found for t in trials)
    return f"{found} of {len(trials)} ({100.0 * found / max(1, len(trials)):.1f} %)"


def main() -> None:
    """Run all trials and write the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--each", type=int, default=12, help="tests of each deck, spread and noise, with and without")
    options.add_argument("--evidence", type=Path, help="folder of the page")
    asked = options.parse_args()
    tried = []
    with tempfile.TemporaryDirectory() as folder:
        for i, make in enumerate(DECKS):
            model = make()
            modes = modes_of(model, Path(folder))
            for j, (spread, noise) in enumerate((s, n) for s in SPREADS for n in NOISES):
                for k in range(2 * asked.each):
                    fault = "exchange" if k % 2 == 0 else OTHERS[k // 2 % len(OTHERS)]
                    tried.append(trial(model.name, modes, 100_000 * i + 1000 * j + k, spread, noise, fault))
            print(model.name, flush=True)
    text = page(tried)
    print(text)
    if asked.evidence:
        (asked.evidence / NAME).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
