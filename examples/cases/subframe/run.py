"""Calibrate a subframe with rubber bushings in a simulated laboratory: python run.py [--quick] [--evidence DIR].

A component of the subframe with other moduli and thicknesses than the deck is tested with two inputs and 47 channels,
with noise and uneven damping. Nine parameters are calibrated with one damping ratio on both sides, without pairing any
mode. 18 channels are held out; the measured damping is mapped on the paired modes afterwards.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from studies import FLOOR, WEIGHT, Compared, Effort, equalised, held_out

from femtune import steps
from femtune.modal import FrfSet
from femtune.results.frf_deviation import ChannelDeviation
from femtune.results.mapped_damping import MappedDamping, MappedMode
from femtune.results.step_results import RunResult
from structures.subframe_campaign import FREE, Laboratory, Measured, deviation_sd

HERE = Path(__file__).resolve().parent
MAC, WITHIN, LIMIT = 0.95, 2.0, 3.0
FREE_TEST = Compared(FREE, Measured((60.0, 450.0), 1.0), (100.0, 350.0))
N_DOFS, EFFORT = 5_000, Effort(30, 2.0, 1, 0)


@dataclass(frozen=True)
class Estimate:
    """A parameter of one component, as a factor on the deck."""

    component: int
    name: str
    truth: float
    value: float
    sd: float
    noise_sd: float

    @property
    def z(self) -> float:
        """Error in stated standard deviations."""
        return (self.value - self.truth) / self.sd


@dataclass(frozen=True, eq=False)
class Calibrated:
    """One component: its run and its test."""

    lab: Laboratory
    component: int
    compared: Compared
    test: FrfSet
    run: RunResult

    @property
    def estimates(self) -> list[Estimate]:
        """The physical parameters."""
        update = self.run.results.update
        assert update is not None
        assert update.fisher is not None
        found = {p.name: p for p in update.parameters}
        # without the factor by which the residuals of the identified test increase it
        noise = {p.parameter: (p.sd_percent or 0.0) / update.fisher.misfit for p in update.fisher.parameters}
        truth = dict(zip(self.lab.names, (1.0 + self.lab.truth(self.component)).tolist()))
        return [
            Estimate(self.component, n, t, found[n].value, found[n].sd or 0.0, 0.01 * found[n].value * noise[n])
            for n, t in truth.items()
        ]

    @property
    def damping(self) -> MappedDamping:
        """Identified damping ratios on the modes of the model."""
        (found,) = self.run.results.mapped_damping
        return found

    @property
    def modes(self) -> list[MappedMode]:
        """Identified modes in the band that is compared."""
        low, high = self.compared.band_hz
        return [m for m in self.damping.modes if m.test_hz is not None and low <= m.test_hz <= high]

    @property
    def held_out(self) -> list[tuple[ChannelDeviation, float]]:
        """Held-out FRFs, and σ of δ by the noise."""
        sd = deviation_sd(self.test, self.compared.measured, self.compared.band_hz)
        noise = dict(zip(self._labels, sd.ravel().tolist()))
        return [(c, noise[c.output, c.input]) for c in _channels(self.run, "validation")]

    @property
    def _labels(self) -> list[tuple[str, str]]:
        outputs, inputs = self.test.responses.labels(), self.test.references.labels()
        return [(o, i) for o in outputs for i in inputs]

    def sums(self) -> dict[str, tuple[float, float]]:
        """Mean δ before and after: equalised FRFs of the calibration set, measured ones of the validation set."""
        sets = {name: _channels(self.run, name) for name in ("calibration", "validation")}
        return {
            n: (float(np.mean([c.before for c in s])), float(np.mean([c.after for c in s]))) for n, s in sets.items()
        }


def calibrated(lab: Laboratory, component: int, compared: Compared, effort: Effort, folder: Path) -> Calibrated:
    """Test a component, and run the study."""
    folder.mkdir(exist_ok=True, parents=True)
    lab.write(folder / "subframe.bdf")
    test = lab.test(FREE, component, compared.measured)
    lab.write_test(folder / f"{FREE.name}.uff", test)
    (folder / "study.toml").write_text(equalised(lab, compared, effort), encoding="utf-8")
    return Calibrated(lab, component, compared, test, steps.run(folder / "study.toml", output=folder / "run"))


def _channels(run: RunResult, data: str) -> list[ChannelDeviation]:
    found = run.results.validation
    assert found is not None
    assert found.deviations is not None
    return [c for c in found.deviations.channels if c.data == data]


def check(found: Sequence[Calibrated]) -> None:
    """What the calibration has to show."""
    errors = np.abs([e.z for one in found for e in one.estimates])
    assert (errors > LIMIT).sum() <= 1, errors
    assert (errors <= WITHIN).mean() >= 0.9, errors
    for one in found:
        assert one.run.ok, one.run.message
        before, after = one.sums()["validation"]
        assert after < 0.5 * before, (before, after)
        risen = [(c.output, c.input) for c, sd in one.held_out if c.after > c.before + 2.0 * sd]
        assert not risen, risen
        macs = [m.mac for m in one.modes]
        assert macs
        assert min(m or 0.0 for m in macs) > MAC, macs


def page(found: Sequence[Calibrated]) -> str:
    """The page of the documentation."""
    return "\n".join(_page(found))


def _page(found: Sequence[Calibrated]) -> Iterator[str]:
    lab, compared = found[0].lab, found[0].compared
    low, high = compared.band_hz
    noise = compared.measured
    yield "# A subframe calibrated in a simulated laboratory\n"
    yield (
        f"A generated subframe of welded sheets with rubber bushings, {lab.configured[FREE.name].n_free:,} degrees of "
        f"freedom, is tested with {len(lab.inputs)} inputs and {lab.channels} channels from {noise.band_hz[0]:g} to "
        f"{noise.band_hz[1]:g} Hz. Its moduli and thicknesses differ from the deck by up to half of their bounds. "
        f"Noise of real and imaginary part: {100 * noise.relative:g} % of the magnitude and {100 * noise.floor:g} % of "
        "the largest magnitude of each FRF. The damping ratios are those of the rubber (3 %) by its part of the strain "
        "energy, and of the steel, uneven by mode (0.1 to 1 %).\n"
    )
    yield (
        "The test is identified and compared with one damping ratio on both sides (`[equalise]`) from "
        f"{low:g} to {high:g} Hz, on reduced models; no mode is paired. The band ends below close modes that the "
        f"identification does not separate. {len(held_out(lab.outputs))} channels are held out. The weights, "
        f"{100 * WEIGHT:g} % of a value and {100 * FLOOR:g} % of the largest of its FRF, allow for the errors of the "
        "identified test, which are systematic. They are chosen, not derived: in another simulated component, with a "
        "mode at the edge of the band, three of nine errors were 2.7 to 2.9 σ.\n"
    )
    yield "## Parameters\n"
    yield "| component | parameter | truth | calibrated | σ | error / σ | σ of the noise |"
    yield "| --- " * 7 + "|"
    for one in found:
        for e in one.estimates:
            yield (
                f"| {1 + e.component} | {e.name} | {e.truth:.4f} | {e.value:.4f} | {e.sd:.1e} "
                f"| {e.z:+.1f} | {e.noise_sd:.1e} |"
            )
    errors = np.abs([e.z for one in found for e in one.estimates])
    yield (
        f"\n{(errors > LIMIT).sum()} of {len(errors)} errors are larger than {LIMIT:g} σ (at most one), "
        f"{100 * (errors <= WITHIN).mean():.0f} % are within {WITHIN:g} σ (at least 90 %). The last column is "
        "the noise followed through identification and equalisation; the errors are several times larger than it, "
        "because the identified test has systematic errors, too.\n"
    )
    yield "## Deviation δ of the FRFs\n"
    yield "| component | set | before | after | change, % |\n| --- | --- | --- | --- | --- |"
    for one in found:
        for name, (before, after) in one.sums().items():
            yield (f"| {1 + one.component} | {name} | {before:.3g} | {after:.3g} | {100 * (after / before - 1):+.0f} |")
    yield "\nThe calibration set are equalised FRFs, the validation set measured ones with mapped damping."
    yield "No δ of a held-out FRF has risen by more than 2 σ of its noise.\n"
    yield "## Modes, paired afterwards\n"
    yield "| component | test, Hz | model, Hz | MAC | identified damping, % |\n| --- | --- | --- | --- | --- |"
    for one in found:
        for m in one.modes:
            yield (
                f"| {1 + one.component} | {m.test_hz:.2f} | {m.model_hz:.2f} | {m.mac:.3f} | {m.measured_percent:.2f} |"
            )


def main() -> None:
    """Simulate, calibrate, check, report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same; it takes some 20 s of processor time")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    found = [calibrated(Laboratory(N_DOFS), 0, FREE_TEST, EFFORT, HERE / "run" / "component_1")]
    print(page(found))
    check(found)
    if options.evidence:
        (options.evidence / "cases_subframe.md").write_text(page(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
