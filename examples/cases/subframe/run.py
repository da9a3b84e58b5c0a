"""Calibrate three subframes of one kind in a simulated laboratory: python run.py [--quick] [--evidence DIR].

Three components of a subframe with rubber bushings, with other moduli and thicknesses than the deck and than each
other, are tested with two inputs and 47 channels, with noise and uneven damping. Their parameters are calibrated
jointly, with the moduli of the steel in common, and separately, with one damping ratio on both sides and without
pairing any mode. 18 channels are held out; the measured damping is mapped on the paired modes afterwards. The full
form repeats this with one input and 56 channels, of which 21 are held out, on a smaller mesh.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from studies import Effort, family, single, specimen

import femtune as ft
from femtune.modal import FrfSet
from femtune.steps.equalise.record import MappedMode
from femtune.steps.run.result import RunResult
from femtune.steps.specimens.record import SpecimenParameter, SpecimenResults
from femtune.steps.validate.record.frf_deviation import DeviationSum
from structures.subframe_campaign import FREE, Laboratory, Measured
from structures.subframe_study import (
    FLOOR,
    LIMIT,
    MAC,
    SHARE,
    WEIGHT,
    WITHIN,
    Compared,
    Estimate,
    held_out,
    risen,
    verdict,
)

HERE = Path(__file__).resolve().parent
COMMON = ("E_sides", "E_crosses")
TEST = Compared(FREE, Measured((60.0, 450.0), 1.0), (100.0, 350.0))
SMALL, LARGE = (5_000, Effort(60, 1.0, bootstraps=10)), (20_000, Effort(60, 2.0, 3, 20, 1000))


@dataclass(frozen=True, eq=False)
class Family:
    """All components: their tests, and the run of their study."""

    lab: Laboratory
    effort: Effort
    tests: dict[str, FrfSet]
    run: RunResult
    compared: Compared = field(default=TEST)

    @property
    def found(self) -> SpecimenResults:
        """The specimens of the study."""
        assert self.run.results.specimens is not None
        return self.run.results.specimens

    def truth(self, component: int, name: str) -> float:
        """A parameter of a component, as a factor on the deck."""
        return 1.0 + float(self.lab.truth(component)[self.lab.names.index(name)])

    def joint(self) -> list[Estimate]:
        """Values of the joint calibration; the common ones once."""
        return [
            Estimate(i, p.name, self.truth(i, p.name), v.value, v.sd or np.nan)
            for p in self.found.parameters
            for i, v in enumerate(p.values)
            if p.individual or i == 0
        ]

    def separate(self) -> list[Estimate]:
        """Values of the separate calibrations."""
        return [
            Estimate(i, p.name, self.truth(i, p.name), v.separate_value or np.nan, v.separate_sd or np.nan)
            for p in self.found.parameters
            for i, v in enumerate(p.values)
        ]

    def true_sd(self, parameter: SpecimenParameter) -> float:
        """Standard deviation of the truths over the components."""
        return float(np.std([self.truth(i, parameter.name) for i in range(self.effort.components)], ddof=1))

    def modes(self) -> dict[str, list[MappedMode]]:
        """Identified modes in the band that is compared, by component."""
        low, high = self.compared.band_hz
        return {
            of.configuration: [m for m in of.modes if m.test_hz is not None and low <= m.test_hz <= high]
            for of in self.run.results.mapped_damping
        }

    def sums(self) -> list[DeviationSum]:
        """δ before and after by component and set."""
        found = self.run.results.validation
        assert found is not None
        assert found.deviations is not None
        return list(found.deviations.by_configuration)

    def risen(self) -> list[str]:
        """Held-out FRFs whose δ has risen beyond its noise."""
        return risen(self.run, {name: (self.compared, test) for name, test in self.tests.items()})


def calibrated(lab: Laboratory, effort: Effort, folder: Path) -> Family:
    """Test the components, and run their study."""
    folder.mkdir(exist_ok=True, parents=True)
    lab.write(folder / "subframe.bdf")
    tests = {specimen(i): TEST.test(lab, i) for i in range(effort.components)}
    for name, test in tests.items():
        lab.write_test(folder / f"{name}.uff", test)
    (folder / "study.toml").write_text(family(lab, TEST, effort), encoding="utf-8")
    return Family(lab, effort, tests, ft.run(folder / "study.toml", output=folder / "run"))


# ----------------------------------------------------------------------------------------------------
# What the calibration has to show.


@dataclass(frozen=True)
class Criterion:
    """One criterion, what was found, whether it is met, and whether the example relies on it.

    The share of errors within two standard deviations is stated only: errors of identified tests are systematic.
    """

    text: str
    found: str
    met: bool
    needed: bool = True


def criteria(one: Family) -> list[Criterion]:
    """All of them."""
    macs = [m.mac or 0.0 for modes in one.modes().values() for m in modes]
    validation = [s for s in one.sums() if s.data == "validation"]
    missed = [p for p in one.found.parameters if p.spread is None or (p.spread.verdict == "real") != p.individual]
    common = one.found.common
    return [
        Criterion("the joint and the separate calibrations have converged", one.run.message,
                  one.run.ok and all(s.ok for s in one.found.separate)),
        *_errors("joint", one.joint()), *_errors("separate", one.separate()),
        *(Criterion(f"{s.configuration}: δ of the held-out FRFs at least halved", _percent(s), s.after < 0.5 * s.before)
          for s in validation),
        Criterion("no δ of a held-out FRF has risen by more than 2 σ of its noise", str(len(one.risen())),
                  not one.risen()),
        Criterion(f"all {len(macs)} pairs of modes have a MAC above {MAC:g}", f"least {min(macs):.3f}",
                  min(macs) > MAC),
        Criterion("the spread of individual parameters is real, that of common ones is not",
                  f"otherwise: {', '.join(p.name for p in missed) or 'none'}", not missed),
        Criterion("the common parameters are common (p above 5 %)",
                  "not tested" if common is None else f"p = {common.p_value:.2g}",
                  common is not None and common.p_value > 0.05),
    ]  # fmt: skip


def _errors(which: str, found: Sequence[Estimate]) -> Iterator[Criterion]:
    errors = np.abs([e.z for e in found])
    beyond, share = int((errors > LIMIT).sum()), float((errors <= WITHIN).mean())
    yield Criterion(f"{which}: at most one of {len(errors)} errors above {LIMIT:g} σ", str(beyond), beyond <= 1)
    yield Criterion(
        f"{which}: at least {100 * SHARE:g} % of the errors within {WITHIN:g} σ", f"{100 * share:.0f} %",
        share >= SHARE, needed=False,
    )  # fmt: skip


def _percent(one: DeviationSum) -> str:
    return "none" if one.change_percent is None else f"{one.change_percent:+.0f} %"


# ----------------------------------------------------------------------------------------------------
# The page.


def page(one: Family, other: Family | None) -> str:
    """The page of the documentation, with verdicts on a family that was tested otherwise."""
    parts = [_head(one), _verdicts(one), _parameters(one), _spreads(one), _deviations(one), _modes(one)]
    return "\n".join(line for part in [*parts, *([] if other is None else [_tested_otherwise(other)])] for line in part)


def _head(one: Family) -> Iterator[str]:
    lab, noise, effort = one.lab, one.compared.measured, one.effort
    low, high = one.compared.band_hz
    yield "# Three subframes of one kind, calibrated in a simulated laboratory\n"
    yield (
        f"{effort.components} components of a generated subframe of welded sheets with rubber bushings, "
        f"{lab.configured[FREE.name].n_free:,} degrees of freedom, are tested with {len(lab.inputs)} inputs and "
        f"{lab.channels} channels from {noise.band_hz[0]:g} to {noise.band_hz[1]:g} Hz. Their moduli and thicknesses "
        f"differ from the deck by up to half of their bounds; {' and '.join(COMMON)} are those of one sheet and the "
        "same in all, the others differ from component to component. Noise of real and imaginary part: "
        f"{100 * noise.relative:g} % of the magnitude and {100 * noise.floor:g} % of the largest magnitude of each "
        "FRF. The damping ratios are those of the rubber (3 %) by its part of the strain energy, and of the steel, "
        "uneven by mode (0.1 to 1 %).\n"
    )
    yield (
        "The components are specimens of one study, calibrated jointly and separately. All lines of a test are "
        "identified, and those from "
        f"{low:g} to {high:g} Hz are compared with one damping ratio on both sides (`[equalise]`), on reduced models: "
        "the modes between the compared band and the last line are identified too, and get the same damping ratio as "
        f"those of the model. No mode is paired. {len(held_out(lab.outputs))} channels are held "
        f"out. The weights, {100 * WEIGHT:g} % of a value and {100 * FLOOR:g} % of the largest of its FRF, allow for "
        f"the errors of the identified test; they are chosen, not derived. {effort.bootstraps} bootstrap runs.\n"
    )


def _tested_otherwise(one: Family) -> Iterator[str]:
    lab = one.lab
    yield (
        f"\n## {lab.channels} channels and {len(lab.inputs)} input\n\nThe same components on a mesh of "
        f"{lab.configured[FREE.name].n_free:,} degrees of freedom, tested with {len(lab.inputs)} input and "
        f"{lab.channels} channels, of which {len(held_out(lab.outputs))} are held out.\n"
    )
    yield from _table_of_verdicts(one)
    for name, errors in (("joint", one.joint()), ("separate", one.separate())):
        yield f"\nRoot mean square of the {name} errors: {np.sqrt(np.mean([e.z**2 for e in errors])):.2f} σ."


def _verdicts(one: Family) -> Iterator[str]:
    yield "## Verdicts\n"
    yield from _table_of_verdicts(one)
    yield ""


def _table_of_verdicts(one: Family) -> Iterator[str]:
    yield "| criterion | found | verdict |\n| --- | --- | --- |"
    for c in criteria(one):
        yield f"| {c.text} | {c.found} | {verdict(c.met)} |"
    if not all(c.met for c in criteria(one)):
        yield (
            "\nThe errors of an identified test, such as those by heavily damped modes above the band, are systematic: "
            "they move several parameters together, and the standard deviations, which follow the noise and are "
            "increased by the size of the residuals, contain them in part."
        )


def _parameters(one: Family) -> Iterator[str]:
    yield "## Parameters\n"
    yield (
        "Factors on the deck. The bootstrap draws frequency lines of the measured FRFs; its coefficient of variation "
        "(COV) is that of the joint calibration.\n"
    )
    yield (
        "| parameter | component | truth | joint | σ | error / σ | separate | σ | error / σ | bootstrap mean "
        "| bootstrap COV, % |"
    )
    yield "| --- " * 11 + "|"
    bootstrap = one.run.results.bootstrap
    drawn = {} if bootstrap is None else {p.parameter: p for p in bootstrap.parameters}
    joint = {(e.name, e.component): e for e in one.joint()}
    separate = {(e.name, e.component): e for e in one.separate()}
    for p in one.found.parameters:
        for i, v in enumerate(p.values):
            e, alone, again = joint.get((p.name, i)), separate[p.name, i], drawn.get(v.parameter)
            own = "| | | " if e is None else f"| {e.value:.4f} | {e.sd:.1e} | {e.z:+.1f} "
            spread = "| | " if e is None or again is None else f"| {again.mean:.4f} | {again.cov_percent or 0.0:.2g} "
            yield (
                f"| {p.name} | {v.specimen} | {alone.truth:.4f} {own}| {alone.value:.4f} | {alone.sd:.1e} "
                f"| {alone.z:+.1f} {spread}|"
            )
    update = one.run.results.update
    assert update is not None
    assert update.fisher is not None
    for name, errors in (("joint", one.joint()), ("separate", one.separate())):
        yield f"\nRoot mean square of the {name} errors: {np.sqrt(np.mean([e.z**2 for e in errors])):.2f} σ."
    yield (
        f"The residuals of the joint calibration are {update.fisher.misfit:.2g} times as large as the noise makes "
        "them, by errors of the identified tests, and increase the standard deviations by this factor.\n"
    )


def _spreads(one: Family) -> Iterator[str]:
    yield "## Is the spread of the parameters real?\n"
    yield ("| parameter | standard deviation of the truths | found | by uncertainty alone | p, adjusted | spread |")
    yield "| --- " * 6 + "|"
    for p in one.found.parameters:
        s = p.spread
        if s is None:
            yield f"| {p.name} | {one.true_sd(p):.4f} | | | | not tested |"
            continue
        stated = "" if s.stated_sd is None else f"{s.stated_sd:.1e}"
        chance = "" if s.p_adjusted is None else f"{s.p_adjusted:.2g}"
        yield f"| {p.name} | {one.true_sd(p):.4f} | {s.sd:.4f} | {stated} | {chance} | {s.verdict} |"
    yield "\nIndividual parameters by their joint values, common ones by their separate ones.\n"
    if one.found.common is not None:
        yield f"All common parameters together: {one.found.common.sentence}.\n"


def _deviations(one: Family) -> Iterator[str]:
    yield "## Deviation δ of the FRFs\n"
    yield "| component | set | compared | FRFs | before | after | change, % |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for s in one.sums():
        row = f"| {s.configuration} | {s.data} | {s.compared} | {s.frfs} | {s.before:.3g} | {s.after:.3g} "
        yield f"{row}| {_percent(s)} |"
    yield "\nMeasured FRFs are compared with those of the model with mapped damping.\n"


def _modes(one: Family) -> Iterator[str]:
    names = list(one.modes())
    yield "## Frequencies of the components\n"
    yield "Modes in the band, paired after the calibration, in Hz.\n"
    heads = [f"{of} {n}" for of in ("test", "model") for n in (*names, "mean", "COV, %")]
    yield "| mode | deck | " + " | ".join(heads) + " | least MAC | identified damping, % |"
    yield "| --- " * (len(heads) + 4) + "|"
    paired = {name: {m.mode: m for m in modes if m.mode is not None} for name, modes in one.modes().items()}
    before = one.run.results.modes[0].freq_hz
    for mode in sorted(set.intersection(*(set(of) for of in paired.values()))):
        modes = [paired[name][mode] for name in names]
        cells = [*_family_cells([m.test_hz for m in modes]), *_family_cells([m.model_hz for m in modes])]
        damping = ", ".join(f"{m.measured_percent:.2f}" for m in modes)
        yield (
            f"| {mode} | {before[mode - 1]:.2f} | {' | '.join(cells)} | {min(m.mac or 0.0 for m in modes):.3f} "
            f"| {damping} |"
        )


def _family_cells(hertz: Sequence[float | None]) -> list[str]:
    """Values, mean and coefficient of variation."""
    values = np.array([np.nan if f is None else f for f in hertz])
    mean = values.mean()
    return [*(f"{f:.2f}" for f in values), f"{mean:.2f}", f"{100 * values.std(ddof=1) / mean:.2f}"]


def measured_afterwards(lab: Laboratory, folder: Path) -> list[str]:
    """The first component calibrated with equal damping, then with its measured FRFs: a section of the page."""
    folder.mkdir(exist_ok=True, parents=True)
    lab.write(folder / "subframe.bdf")
    lab.write_test(folder / f"{specimen(0)}.uff", TEST.test(lab, 0))
    (folder / "study.toml").write_text(single(lab, TEST, SMALL[1].order), encoding="utf-8")
    update = ft.update(folder / "study.toml", output=folder / "run").results.update
    assert update is not None
    assert update.raw is not None
    truth = {name: 1.0 + float(v) for name, v in zip(lab.names, lab.truth(0))}
    rows, errors = [], []
    for one, p in zip(update.raw.values, update.parameters, strict=True):
        assert one.equalised_sd is not None
        assert p.sd is not None
        z = ((one.equalised - truth[p.name]) / one.equalised_sd, (p.value - truth[p.name]) / p.sd)
        errors.append(z)
        rows.append(f"| {p.name} | {one.equalised_sd:.1e} | {z[0]:+.2f} | {p.sd:.1e} | {z[1]:+.2f} |")
        assert p.sd < one.equalised_sd
    assert np.abs(errors).max() < LIMIT
    return [
        "\n## With the measured FRFs afterwards\n",
        f"The first component on a mesh of {lab.mesh.n_dofs:,} degrees of freedom, alone, with 2 inputs and "
        '47 channels: calibrated with equal damping, then with its measured FRFs (`then = "raw"`), on reduced models. '
        "The families above end with equal damping.\n",
        "| parameter | σ, equal damping | error / σ | σ, measured FRFs | error / σ |\n| --- | --- | --- | --- | --- |",
        *rows,
    ]


def main() -> None:
    """Simulate, calibrate, report, check."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two components, 5,000 degrees of freedom, 10 bootstraps")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    # two of a kind are the fewest that have a spread
    dofs, effort = (SMALL[0], replace(SMALL[1], components=2)) if options.quick else LARGE
    one = calibrated(Laboratory(dofs, common=COMMON), effort, HERE / "run" / f"family_{dofs}")
    other = None
    if not options.quick:
        lab = Laboratory(SMALL[0], channels=56, exciters=1, common=COMMON)
        other = calibrated(lab, SMALL[1], HERE / "run" / "one_input")
    text = page(one, other)
    if not options.quick:
        text += "\n".join(measured_afterwards(Laboratory(SMALL[0], common=COMMON), HERE / "run" / "measured"))
    print(text)
    if options.evidence:
        (options.evidence / "cases_subframe.md").write_text(text + "\n", encoding="utf-8")
    families = [one] if other is None else [one, other]
    missed = [f"{c.text}: {c.found}" for family in families for c in criteria(family) if c.needed and not c.met]
    assert not missed, missed


if __name__ == "__main__":
    main()
