"""Find the stiffness of rubber bushings from two tests: python run.py [--quick] [--components N] [--evidence DIR].

A component of the subframe with other moduli and thicknesses than the deck is tested free, and with masses on its
mounts, by one input and 56 channels, with noise and uneven damping. Fifteen parameters are calibrated with one damping
ratio on both sides, without pairing any mode. Modes of the model that the test of the loaded state does not show are
left out. What the free test alone can tell of the bushings below 300 Hz is stated beside it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from readings import PUBLISHED, Reading, readings
from studies import Plan, study

import femtune as ft
from femtune.modal import FrfSet
from femtune.steps.equalise.record import MappedMode
from femtune.steps.run.result import RunResult
from femtune.steps.select.record.fisher import FisherResults
from femtune.steps.update.record.update import UpdateResults
from femtune.steps.validate.record.frf_deviation import DeviationSum
from structures.subframe_campaign import FREE, LOADED, Laboratory, Measured
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
)

HERE = Path(__file__).resolve().parent
NOT_MET = " The second target is not met: the errors of the identified tests are larger than stated."
BELOW_HZ = 300.0
"""What the free test alone can tell is stated up to here, as in the published study."""
FREE_TEST = Compared(FREE, Measured((60.0, 450.0), 1.0), (100.0, 390.0), (395.0, 450.0))
LOADED_TEST = Compared(LOADED, Measured((30.0, 300.0), 0.5), (55.0, 146.0), (148.0, 160.0))
LEFT_OUT = {5_000: (52.67, 52.69, 64.49, 64.53), 20_000: (50.67, 50.78, 62.04, 62.19)}
"""By the size of the mesh: pairs of modes of the loaded mounts that hardly move the frame; no test shows them."""
READ = (replace(FREE_TEST, band_hz=(60.0, BELOW_HZ)), replace(LOADED_TEST, band_hz=(40.0, 225.0)))
"""The bands of the published study."""
KNOWN = 1.0 / 3.0
"""A parameter can be known if its standard deviation is below this part of the prior's."""
RUBBER = ("E_rubber_front", "E_rubber_rear")


@dataclass(frozen=True, eq=False)
class Calibrated:
    """One component: its tests, its run, and what its free test alone can tell before the update."""

    plan: Plan
    component: int
    tests: dict[str, FrfSet]
    run: RunResult
    alone: FisherResults

    @property
    def update(self) -> UpdateResults:
        """The result of the update."""
        assert self.run.results.update is not None
        return self.run.results.update

    @property
    def both(self) -> FisherResults:
        """What both tests can tell before the update."""
        assert self.run.results.selection is not None
        assert self.run.results.selection.fisher is not None
        return self.run.results.selection.fisher

    @property
    def estimates(self) -> list[Estimate]:
        """All parameters, with the standard deviations of the table of the update."""
        lab, found = self.plan.lab, {p.name: p for p in self.update.parameters}
        truth = dict(zip(lab.names, (1.0 + lab.truth(self.component)).tolist()))
        return [Estimate(self.component, n, t, found[n].value, found[n].sd or np.nan) for n, t in truth.items()]

    @property
    def modes(self) -> list[tuple[str, MappedMode]]:
        """Identified modes in the bands that are compared, with their states."""
        bands = {test.state.name: test.band_hz for test in self.plan.tests}
        return [
            (of.configuration, m)
            for of in self.run.results.mapped_damping
            for m in of.modes
            if m.test_hz is not None and bands[of.configuration][0] <= m.test_hz <= bands[of.configuration][1]
        ]

    def sums(self) -> list[DeviationSum]:
        """δ before and after by state and set."""
        found = self.run.results.validation
        assert found is not None
        assert found.deviations is not None
        return list(found.deviations.by_configuration)

    def risen(self) -> list[str]:
        """Held-out FRFs whose δ has risen beyond its noise."""
        return risen(self.run, {test.state.name: (test, self.tests[test.state.name]) for test in self.plan.tests})


def simulated(plan: Plan, component: int, folder: Path) -> dict[str, FrfSet]:
    """Write the deck and the tests of a component."""
    folder.mkdir(exist_ok=True, parents=True)
    plan.lab.write(folder / "subframe.bdf")
    tests = {test.state.name: test.test(plan.lab, component) for test in plan.tests}
    for name, frfs in tests.items():
        plan.lab.write_test(folder / f"{name}.uff", frfs)
    return tests


def calibrated(plan: Plan, component: int, folder: Path) -> Calibrated:
    """Test a component, ask what its free test alone can tell, and run the study of both tests."""
    tests = simulated(plan, component, folder)
    only = replace(plan, tests=(replace(FREE_TEST, band_hz=(FREE_TEST.band_hz[0], BELOW_HZ)),))
    for name, one in (("free.toml", only), ("study.toml", plan)):
        (folder / name).write_text(study(one), encoding="utf-8")
    alone = ft.select(folder / "free.toml").record.fisher
    assert alone is not None
    run = ft.run(folder / "study.toml", output=folder / "run")
    return Calibrated(plan, component, tests, run, alone)


def check(found: Sequence[Calibrated]) -> None:
    """What the calibration shows; the page states which part of the errors is within two standard deviations."""
    errors = np.abs([e.z for one in found for e in one.estimates])
    assert (errors > LIMIT).sum() <= 1, errors
    for one in found:
        assert one.run.ok, one.run.message
        held = [s for s in one.sums() if s.data == "validation"]
        assert all(s.after < 0.5 * s.before for s in held), held
        assert not one.risen(), one.risen()
        macs = [m.mac or 0.0 for _, m in one.modes]
        assert macs
        assert min(macs) > MAC, macs
        both, alone = ({p.parameter: p for p in fisher.parameters} for fisher in (one.both, one.alone))
        for name in RUBBER:
            assert both[name].known
            sd = alone[name].sd_percent
            assert sd is None or sd > 5.0 * (both[name].sd_percent or np.inf), (name, sd)


def page(found: Sequence[Calibrated], read: Sequence[Reading]) -> str:
    """The page of the documentation; readings of the information where there are some."""
    of_information = _published(found[0].plan.lab, read) if read else ()
    return "\n".join(
        [*_head(found), *_readings(found), *of_information, *_parameters(found), *_deviations(found), *_modes(found)]
    )


def _head(found: Sequence[Calibrated]) -> Iterator[str]:
    plan = found[0].plan
    lab, free, loaded = plan.lab, *plan.tests
    n = lab.configured[FREE.name].n_free
    count = "One component" if len(found) == 1 else f"{len(found)} components"
    yield "# Rubber bushings from a free and a mass-loaded test\n"
    yield (
        f"{count} of a generated subframe of welded sheets with rubber bushings, {n:,} degrees of freedom, with "
        f"{lab.parameters} parameters, tested with {len(lab.inputs)} input and {lab.channels} channels: free from "
        f"{free.measured.band_hz[0]:g} to {free.measured.band_hz[1]:g} Hz, and with masses on its mounts from "
        f"{loaded.measured.band_hz[0]:g} to {loaded.measured.band_hz[1]:g} Hz. Moduli and thicknesses differ from the "
        "deck by up to half of their bounds. Noise of real and imaginary part: "
        f"{100 * free.measured.relative:g} % of the magnitude and {100 * free.measured.floor:g} % of the largest "
        "magnitude of each FRF. The damping ratios are those of the rubber (3 %) by its part of the strain energy, and "
        "of the steel, uneven by mode (0.1 to 1 %).\n"
    )
    yield (
        "Both tests are identified and compared with one damping ratio on both sides (`[equalise]`), free from "
        f"{free.band_hz[0]:g} to {free.band_hz[1]:g} Hz, loaded from {loaded.band_hz[0]:g} to "
        f"{loaded.band_hz[1]:g} Hz; no mode is paired. {len(held_out(lab.outputs))} channels are held out. In the "
        "loaded state, pairs of modes of the mounts move the frame so little that the identification misses them; the "
        f"model modes at {', '.join(f'{hz:g}' for hz in loaded.left_out_hz)} Hz are left out (`leave_out_modes_hz`). "
        "Each test is identified up to the smallest response above the band that is compared: free between "
        f"{free.end_hz[0]:g} and {free.end_hz[1]:g} Hz, loaded between {loaded.end_hz[0]:g} and "
        f"{loaded.end_hz[1]:g} Hz, below a group of four close modes of the mounts, which the identification takes for "
        "one: a mode just above the end of the lines biases the identified modes below it. "
        f"The weights, {100 * WEIGHT:g} % of a value and {100 * FLOOR:g} % of the largest of its FRF, are "
        "chosen, not derived.\n"
    )


def _readings(found: Sequence[Calibrated]) -> Iterator[str]:
    yield f"## What the free test alone can tell below {BELOW_HZ:g} Hz\n"
    yield (
        "Expected standard deviations before the update, from the Fisher information with the noise of the measured "
        "FRFs, in % of the value. A parameter can be known if its standard deviation is below a third of the prior's.\n"
    )
    yield "| component | parameter | free alone | can be known | both tests | can be known |"
    yield "| --- " * 6 + "|"
    for one in found:
        both, alone = ({p.parameter: p for p in fisher.parameters} for fisher in (one.both, one.alone))
        for name in one.plan.lab.names:
            first, second = alone[name], both[name]
            yield (
                f"| {1 + one.component} | {name} | {_percent(first.sd_percent)} | {_word(first.known)} "
                f"| {_percent(second.sd_percent)} | {_word(second.known)} |"
            )
        ratios = [(alone[n].sd_percent or np.inf) / (both[n].sd_percent or np.inf) for n in RUBBER]
        open_ = [n for n in RUBBER if not alone[n].known]
        yield (
            f"\nComponent {1 + one.component}: both tests reduce the standard deviations of the rubber by factors of "
            f"{ratios[0]:.0f} (front) and {ratios[1]:.0f} (rear). The free test alone leaves "
            f"{' and '.join(open_) or 'none of them'} unknown.\n"
        )


def _published(lab: Laboratory, read: Sequence[Reading]) -> Iterator[str]:
    yield f"## The published reading: no bushing is identifiable below {BELOW_HZ:g} Hz without masses\n"
    yield (
        "In a published study of a real subframe the bushings were not identifiable below 300 Hz without the "
        "mass-loaded test. Its residuals are differences of the logarithm of the FRFs without weights, and after its "
        f"calibration a deviation of δ = {PUBLISHED['free']:g} (free) and {PUBLISHED['mass-loaded']:g} (loaded) was "
        f"left. Expected standard deviations of the rubber in %, free from {READ[0].band_hz[0]:g} to "
        f"{READ[0].band_hz[1]:g} Hz and loaded from {READ[1].band_hz[0]:g} to {READ[1].band_hz[1]:g} Hz, at the values "
        "of the deck on a mesh of 5,000 degrees of freedom, for independent errors of all lines:\n"
    )
    yield "| residuals | parameter | free alone | can be known | both tests | can be known |"
    yield "| --- " * 6 + "|"
    prior = dict(zip(lab.names, (100.0 * lab.parameter_set.prior[1]).tolist()))
    for one in read:
        for name in RUBBER:
            free, both = one.free[name], one.both[name]
            known = [_word(sd < KNOWN * prior[name]) for sd in (free, both)]
            yield f"| {one.name} | {name} | {free:.2g} | {known[0]} | {both:.2g} | {known[1]} |"
    lost = {name: [one.name for one in read if one.free[name] >= KNOWN * prior[name]] for name in RUBBER}
    kept = [name for name in RUBBER if not lost[name]]
    yield ""
    for name in RUBBER:
        if lost[name]:
            yield f"The published reading holds for {name} with these residuals: {'; '.join(lost[name])}."
    if kept:
        yield f"It does not hold for {' and '.join(kept)}, which the free test alone determines in every case."
    yield (
        "It is a matter of the weights: without them the antiresonances, where the noise and the errors of a model are "
        "largest, rule the estimate.\n"
    )


def _percent(value: float | None) -> str:
    return "open" if value is None else f"{value:.2g}"


def _word(known: bool) -> str:
    return "yes" if known else "no"


def _parameters(found: Sequence[Calibrated]) -> Iterator[str]:
    yield "## Parameters\n"
    yield "| component | parameter | truth | calibrated | σ | error / σ |"
    yield "| --- " * 6 + "|"
    for one in found:
        for e in one.estimates:
            yield f"| {1 + e.component} | {e.name} | {e.truth:.4f} | {e.value:.4f} | {e.sd:.1e} | {e.z:+.1f} |"
    errors = np.abs([e.z for one in found for e in one.estimates])
    missed = "" if (errors <= WITHIN).mean() >= SHARE else NOT_MET
    yield (
        f"\n{(errors > LIMIT).sum()} of {len(errors)} errors are larger than {LIMIT:g} σ (at most one), "
        f"{100 * (errors <= WITHIN).mean():.0f} % are within {WITHIN:g} σ (at least 90 %); their root mean square is "
        f"{np.sqrt(np.mean(errors**2)):.2f} σ.{missed} The standard deviations are those of the table of the update."
    )
    for one in found:
        fisher = one.update.fisher
        assert fisher is not None
        if fisher.misfit > 1.0:
            yield (
                f"Component {1 + one.component}: the residuals are {fisher.misfit:.2g} times as large as the noise "
                "makes them; the standard deviations are increased by this factor."
            )
    yield ""


def _deviations(found: Sequence[Calibrated]) -> Iterator[str]:
    yield "## Deviation δ of the FRFs\n"
    yield "| component | state | set | compared | FRFs | before | after | change, % |"
    yield "| --- | --- | --- | --- | --- | --- | --- | --- |"
    for one in found:
        for s in one.sums():
            change = 0.0 if s.change_percent is None else s.change_percent
            yield (
                f"| {1 + one.component} | {s.configuration} | {s.data} | {s.compared} | {s.frfs} | {s.before:.3g} "
                f"| {s.after:.3g} | {change:+.0f} |"
            )
    yield "\nMeasured FRFs are compared with those of the model with mapped damping."
    for one in found:
        risen = one.risen()
        yield (
            f"Component {1 + one.component}: the δ of {len(risen) or 'no'} held-out FRF has risen by more than 2 σ of "
            f"its noise{': ' + ', '.join(risen) if risen else ''}."
        )
    yield ""


def _modes(found: Sequence[Calibrated]) -> Iterator[str]:
    yield "## Modes, paired afterwards\n"
    yield "| component | state | test, Hz | model, Hz | MAC | identified damping, % |"
    yield "| --- " * 6 + "|"
    for one in found:
        for name, m in one.modes:
            paired = m.mac is not None and m.model_hz is not None
            model = f"{m.model_hz:.2f} | {m.mac:.3f}" if paired else "not paired | "
            yield f"| {1 + one.component} | {name} | {m.test_hz:.2f} | {model} | {m.measured_percent:.2f} |"
    yield "\n## Modes that are left out\n"
    yield "| component | before, Hz | after, Hz | correlation |\n| --- | --- | --- | --- |"
    for one in found:
        for left in one.update.left_out_modes:
            yield f"| {1 + one.component} | {left.before_hz:.2f} | {left.after_hz:.2f} | {left.correlation:.3f} |"


def measured_afterwards(folder: Path, components: int = 2) -> list[str]:
    """Components calibrated with equal damping, then with their measured FRFs: a section of the page."""
    lab = Laboratory(5_000, 15, 56, 1)
    plan = Plan(lab, (FREE_TEST, replace(LOADED_TEST, left_out_hz=LEFT_OUT[5_000])), then="raw")
    rows = []
    for c in range(components):
        simulated(plan, c, folder / str(c + 1))
        (folder / str(c + 1) / "study.toml").write_text(study(plan), encoding="utf-8")
        update = ft.update(folder / str(c + 1) / "study.toml", output=folder / str(c + 1) / "run").results.update
        assert update is not None
        assert update.raw is not None
        truth = dict(zip(lab.names, (1.0 + lab.truth(c)).tolist()))
        for one, p in zip(update.raw.values, update.parameters, strict=True):
            assert one.equalised_sd is not None
            assert p.sd is not None
            before, after = (one.equalised - truth[p.name]) / one.equalised_sd, (p.value - truth[p.name]) / p.sd
            assert abs(after) < LIMIT, (c, p.name, after)
            rows.append((c + 1, p.name, one.equalised_sd, before, p.sd, after))
    each = [[row for row in rows if row[0] == c + 1] for c in range(components)]
    smaller = sum(row[4] < row[2] for row in rows)
    roots = [[float(np.sqrt(np.mean([row[k] ** 2 for row in some]))) for k in (3, 5)] for some in each]
    said = "; ".join(f"component {c + 1}: {a:.2f} and {b:.2f}" for c, (a, b) in enumerate(roots))
    return [
        "\n## With the measured FRFs afterwards\n",
        f"{components} components on a mesh of 5,000 degrees of freedom, calibrated with equal damping, then with "
        f'their measured FRFs (`then = "raw"`). Of {len(rows)} standard deviations {smaller} become smaller. Root mean '
        f"square of error / σ with equal damping and with the measured FRFs: {said}.\n",
        "| component | parameter | σ, equal damping | error / σ | σ, measured FRFs | error / σ |",
        "| --- " * 6 + "|",
        *(f"| {c} | {name} | {s:.1e} | {z:+.2f} | {sd:.1e} | {after:+.2f} |" for c, name, s, z, sd, after in rows),
    ]


def main() -> None:
    """Simulate, calibrate, check, report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one component with 5,000 degrees of freedom")
    parser.add_argument("--components", type=int, default=3, help="number of components")
    parser.add_argument("--dofs", type=int, default=20_000, choices=sorted(LEFT_OUT), help="size of the mesh")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    dofs, components = (5_000, 1) if options.quick else (options.dofs, options.components)
    plan = Plan(Laboratory(dofs, 15, 56, 1), (FREE_TEST, replace(LOADED_TEST, left_out_hz=LEFT_OUT[dofs])))
    found = [calibrated(plan, c, HERE / "run" / f"component_{c + 1}") for c in range(components)]
    text = page(found, () if options.quick else readings(Laboratory(5_000, 15, 56, 1), READ))
    if not options.quick:
        text += "\n".join(measured_afterwards(HERE / "run" / "measured"))
    print(text)
    if options.evidence:
        (options.evidence / "cases_subframe_bushings.md").write_text(text + "\n", encoding="utf-8")
    check(found)


if __name__ == "__main__":
    main()
