"""Trials: a structure with its truth, a test of it, and studies that state different standard deviations.

Everything that is drawn follows from the kind and the number of a trial.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from decks import RANGES, STRUCTURES, Hidden, Structure, kind_of

import femtune as ft
from femtune.files.study_file.residual import FrfResidual
from femtune.steps.init.proposed_parameters import FREQUENCY_SD, SHAPE_SD

TrialKind = Literal["right", "candidate", "hidden"]
"""A right model; a wrong one whose wrong value is a field of the deck; one whose error is no field of it."""
KINDS: tuple[TrialKind, ...] = ("right", "candidate", "hidden")

UNITS = "m-kg-s"
DAMPING_RATIO = 0.02
"""Of the FRFs, in structure and model."""
FURTHER_MODES = 5
"""Model modes beyond those of the test, where modes that move may come from."""


@dataclass(frozen=True)
class Deviations:
    """Relative standard deviations of frequencies, shape entries (of the largest of their mode) and FRFs.

    `assumed` marks guesses, as `femtune init` does where the test states none.
    """

    frequency: float
    shape: float
    frf: float
    assumed: bool = False

    def times(self, factor: float) -> Deviations:
        """All of them larger by a factor."""
        return Deviations(factor * self.frequency, factor * self.shape, factor * self.frf)


NOISE = Deviations(0.003, 0.02, 0.02)
"""Of the simulated tests."""
EXACT = NOISE.times(1e-6)
"""Of tests that are simulated without noise."""
_FRF_WITHOUT_SD = 0.05
"""What `FrfResidual` states if the study does not."""
STATED: dict[str, Deviations] = {
    "true": NOISE,
    "default": Deviations(FREQUENCY_SD, SHAPE_SD, _FRF_WITHOUT_SD, assumed=True),
    "small": NOISE.times(1.0 / 3.0),
    "large": NOISE.times(3.0),
}
"""What studies state; the default is what `femtune init` writes, marked as guesses."""


@dataclass(frozen=True)
class Fault:
    """The wrong value of a wrong model.

    Parameters
    ----------
    field : its field, or the key of a hidden error
    factor : true value over that of the deck; of a hidden error its value in the structure
    """

    field: str
    factor: float


@dataclass(frozen=True)
class Trial:
    """A structure whose parameters are to be found, with or without an error in the model.

    Parameters
    ----------
    truth : true value over that of the deck, by field that the study updates
    seed : of the noise
    """

    kind: TrialKind
    number: int
    structure: Structure
    truth: dict[str, float]
    fault: Fault | None
    seed: int

    @property
    def name(self) -> str:
        """Kind and number."""
        return f"{self.kind} {self.number}"


def trial(kind: TrialKind, number: int, seed: int = 1) -> Trial:
    """The trial of a kind with a number; structures take turns."""
    rng = np.random.default_rng([seed, KINDS.index(kind), number])
    structure = STRUCTURES[number % len(STRUCTURES)]
    truth = {field: float(_truth(field, rng)) for field in structure.parameters}
    fault = _fault(kind, structure, number // len(STRUCTURES), rng)
    return Trial(kind, number, structure, truth, fault, int(rng.integers(1, 2**31)))


def _truth(field: str, rng: np.random.Generator) -> float:
    """Uniform in the logarithm."""
    return float(RANGES[kind_of(field)].truth ** rng.uniform(-1.0, 1.0))


def _fault(kind: TrialKind, structure: Structure, turn: int, rng: np.random.Generator) -> Fault | None:
    """Fields take turns; sizes are uniform in the logarithm."""
    if kind == "right":
        return None
    if kind == "hidden":
        hidden: Hidden = structure.hidden[turn % len(structure.hidden)]
        return Fault(hidden.key, float(np.exp(rng.uniform(np.log(hidden.smallest), np.log(hidden.largest)))))
    field = structure.fixed[turn % len(structure.fixed)]
    sizes = RANGES[kind_of(field)]
    size = np.exp(rng.uniform(np.log(sizes.smallest_error), np.log(sizes.largest_error)))
    return Fault(field, float(size if rng.integers(2) else 1.0 / size))


def write_data(one: Trial, folder: Path, noise: Deviations = NOISE) -> None:
    """The deck as the analyst has it, and the test of the structure."""
    structure = one.structure
    changed = one.truth | ({} if one.fault is None else {one.fault.field: one.fault.factor})
    (folder / "model.bdf").write_text(structure.deck({}), encoding="utf-8")
    true = folder / "true.bdf"
    true.write_text(structure.deck(changed), encoding="utf-8")
    if structure.inputs:
        first, last, step = structure.band_hz
        ft.respond(
            true, inputs=list(structure.inputs), outputs=list(structure.sensors), from_hz=first, to_hz=last,
            step_hz=step, ratio=DAMPING_RATIO, scatter=noise.frf, seed=one.seed, uff=folder / "test.uff", units=UNITS,
        )  # fmt: skip
        return
    test = ft.simulate(
        true, list(structure.sensors), units=UNITS, count=structure.rigid + structure.modes,
        frequency_scatter=noise.frequency, shape_scatter=noise.shape, seed=one.seed,
    )  # fmt: skip
    ft.write_test(test, folder / "test.uff")


def write_study(one: Trial, folder: Path, stated: Deviations, name: str) -> Path:
    """A study of the data in a folder; its run folder has the name of the study."""
    path = folder / f"{name}.toml"
    path.write_text("\n".join(_study(one.structure, stated, name)) + "\n", encoding="utf-8")
    return path


def _study(structure: Structure, stated: Deviations, name: str) -> Iterator[str]:
    count = structure.rigid + structure.modes + FURTHER_MODES
    yield from ("[study]", f'title = "{structure.name}"', 'deck = "model.bdf"', f'units = "{UNITS}"', "")
    yield from ("[modes]", f"count = {count}", "", "[test]", 'file = "test.uff"', "")
    yield from ("[output]", f'folder = "{name}"', "live = false", "")
    # the structure has the mesh of the model
    yield from ("[checks]", "refinement = false", "")
    for field in structure.parameters:
        bounds = RANGES[kind_of(field)]
        yield from ("[[parameter]]", f'name = "{field.replace(" ", "_")}"', f'fields = ["{field}"]')
        yield from (f"lower = {bounds.lower}", f"upper = {bounds.upper}", "")
    if structure.inputs:
        kind = FrfResidual.model_fields["kind"].default
        yield from ("[[residual]]", f'kind = "{kind}"', f"sd = {stated.frf!r}", f"ratio = {DAMPING_RATIO}")
        yield f"to_hz = {structure.band_hz[1]}"
        if stated.assumed:
            yield "assumed = true"
    else:
        yield from ("[residuals]", f"frequency_sd = {stated.frequency!r}", f"shape_sd = {stated.shape!r}")
        if stated.assumed:
            yield 'assumed = ["frequency_sd", "shape_sd"]'
