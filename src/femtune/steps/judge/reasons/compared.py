"""Reasons from what was compared: n of N test modes, and model modes without a test partner."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.document.numbers import freq, listed, short
from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.correlate.record.correlation import CorrelationResults, LeftOutMode, UnpairedTestMode
    from femtune.steps.info.record.model import ModelModes
    from femtune.steps.judge.record.acceptance import AcceptanceResults
    from femtune.steps.judge.record.reason import Weight
    from femtune.steps.results import Results

_TRANSLATIONS = 3
"""The first of the six directions of effective masses; the others are rotations."""
_NEGLIGIBLE_MASS_PERCENT = 2.0
"""Effective mass below which a mode of the model may be without a partner, in %: a judgement."""
_MOST_NAMED = 6
"""Modes that are named in a reason; more are counted."""


def compared_reasons(results: Results) -> Iterable[ReasonRecord]:
    """Of the last model version."""
    acceptance = results.judgement and results.judgement.acceptance
    stages = [c.stage for c in results.correlations]
    last = [c for c in results.correlations if c.stage == stages[-1]]
    if acceptance:
        yield from reasons_of_comparisons(last, [m for m in results.modes if m.stage in stages[-1:]], acceptance)


def reasons_of_comparisons(
    correlations: Sequence[CorrelationResults], modes: Sequence[ModelModes], acceptance: AcceptanceResults
) -> Iterable[ReasonRecord]:
    """Test modes that were not compared, target modes among them, and model modes without a partner."""
    yield from _of_test_modes(correlations, acceptance)
    solved = {m.configuration: m for m in modes}
    heavy = [h for c in correlations if c.configuration in solved for h in _heavy(c, solved[c.configuration])]
    several = len(correlations) > 1
    by_weight: dict[Weight, list[_HeavyMode]] = {
        "not accepted": [h for h in heavy if h.percent > acceptance.target_mass_percent],
        "reservation": [h for h in heavy if h.percent <= acceptance.target_mass_percent],
    }
    for weight, sentences in by_weight.items():
        if sentences:
            names = [h.words(several) for h in sentences]
            code = "judge.model-mode-unpaired" if len(sentences) > 1 else "judge.model-mode-unpaired/one"
            yield reason(weight, code, modes=_some(names))


def _of_test_modes(correlations: Sequence[CorrelationResults], acceptance: AcceptanceResults) -> Iterable[ReasonRecord]:
    paired = sum(len(c.pairs) for c in correlations)
    missing: list[tuple[str, UnpairedTestMode | LeftOutMode]] = []
    for c in correlations:
        missing += [(c.configuration, m) for m in c.unpaired_test]
        missing += [(c.configuration, m) for m in c.left_out]
    if not missing:
        return
    missing.sort(key=lambda entry: (entry[0], entry[1].test_freq_hz))
    total, several = paired + len(missing), len(correlations) > 1
    targets = [(c, m) for c, m in missing if m.test_label in acceptance.target_modes]
    for configuration, mode in targets:
        yield reason(
            "not accepted", "judge.target-mode", configuration, mode=mode.test_label, hz=freq(mode.test_freq_hz)
        )  # fmt: skip
    # a study that names its target modes has said which modes count
    much = not acceptance.target_modes and 100.0 * len(missing) > acceptance.left_out_percent * total
    names = [f"{m.test_label} ({f'{c}, ' if several else ''}{freq(m.test_freq_hz)} Hz)" for c, m in missing]
    yield reason(
        "not accepted" if much else "reservation",
        "judge.modes-not-compared" if len(missing) > 1 else "judge.modes-not-compared/one",
        compared=paired, total=total, modes=_some(names), suspension=_of_the_suspension(correlations),
    )  # fmt: skip


def _of_the_suspension(correlations: Sequence[CorrelationResults]) -> str:
    """What is said of modes of the suspension beside those that count."""
    count = sum(len(c.suspension) for c in correlations)
    return f"; and {count} of the suspension" if count else ""


def _some(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMED
    return listed([*names[:_MOST_NAMED], *([f"{more} more"] if more > 0 else [])])


@dataclass(frozen=True)
class _HeavyMode:
    """A model mode without a partner, and its effective mass in % of the total mass in the direction of the largest."""

    configuration: str
    number: int
    hz: float
    percent: float

    def words(self, several: bool) -> str:
        """The mode with its frequency and mass, and its configuration if there are `several`."""
        of = f"{self.configuration}, " if several else ""
        return f"{self.number} ({of}{freq(self.hz)} Hz, {short(self.percent)} % of the mass)"


def _heavy(c: CorrelationResults, solved: ModelModes) -> Iterable[_HeavyMode]:
    """Model modes up to the highest test mode that was compared, heavy in a direction, and without a partner."""
    masses = solved.effective_masses
    if masses is None or not c.pairs:
        return
    top = max(p.test_freq_hz for p in c.pairs)
    for mode in c.unpaired_model:
        if mode.model_number > len(masses.fractions) or mode.model_number <= solved.rigid_body_modes:
            continue
        share = max((100.0 * f for f in masses.fractions[mode.model_number - 1][:_TRANSLATIONS] if f), default=0.0)
        if mode.model_freq_hz <= top and share >= _NEGLIGIBLE_MASS_PERCENT:
            yield _HeavyMode(c.configuration, mode.model_number, mode.model_freq_hz, share)
