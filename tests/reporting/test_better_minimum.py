"""A better minimum, pairs that are merged and frequencies that are worse: what is said in report and verdict."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from tests.messages.shown import check_shown

from femtune.steps.judge.reasons.minimum import minimum_reasons
from femtune.steps.run.alerts import pairing_alerts
from femtune.steps.update.page.convergence import minimum_sentences
from femtune.steps.update.record.search import MinimumResults, TrialFacts
from femtune.steps.update.record.update import PairingEvent

PAIRS = "as built: test mode 8 with model mode 8"


def searched(*trials: TrialFacts, chi_square: float = 344.0, left: tuple[str, ...] = ()) -> MinimumResults:
    return MinimumResults(
        reasons=("the lowest MAC of a pair is 0.58",), first_chi_square=344.0, chi_square=chi_square, trials=trials,
        improved=any(t.better for t in trials), left=left, iterations=sum(t.iterations for t in trials),
        update_iterations=14,
    )  # fmt: skip


def trial(kind: Any, sentence: str, chi_square: float, better: bool, held: float | None = None) -> TrialFacts:
    return TrialFacts(
        kind=kind, sentence=sentence, chi_square=chi_square, before=344.0, iterations=9, better=better, held=held
    )


def results(minimum: MinimumResults | None = None, before: Any = (), after: Any = (), looked: bool = True) -> Any:
    """Results with what the reasons read: the search, and frequency errors in % by mode."""
    compared = [
        SimpleNamespace(
            configuration="as built", stage=stage,
            pairs=[SimpleNamespace(test_label=str(i), freq_error_percent=e) for i, e in enumerate(errors, start=1)],
        )
        for stage, errors in (("before", before), ("after", after))
    ]  # fmt: skip
    return SimpleNamespace(update=SimpleNamespace(minimum=minimum, looked_further=looked), correlations=compared)


def said(
    minimum: MinimumResults | None = None, before: Any = (), after: Any = (), looked: bool = True
) -> list[tuple[str, str]]:
    return [(r.weight, r.code) for r in minimum_reasons(results(minimum, before, after, looked))]


def test_that_nothing_was_looked_for_is_a_reservation() -> None:
    assert said(None, looked=False) == [("reservation", "judge.not-looked-further")]


def test_a_better_minimum_is_told_with_what_led_to_it() -> None:
    found = searched(
        trial("pairing", PAIRS, 30.5, True, 30.5), trial("start", "start 1 of 6", 200.0, False), chi_square=30.5
    )
    (text,) = minimum_sentences(SimpleNamespace(minimum=found))  # type: ignore[arg-type]
    assert "1 other pairing and 1 start, 18 iterations beside 14 of the update" in text
    assert f"A better minimum was found: χ² 30.5 instead of 344 ({PAIRS})." in text
    assert said(found) == [("reservation", "judge.better-minimum")]


def test_nothing_is_said_where_nothing_suggests_another_minimum() -> None:
    none = searched().model_copy(update={"reasons": ()})
    assert not minimum_sentences(SimpleNamespace(minimum=none))  # type: ignore[arg-type]
    assert said(none) == said(None) == []


def test_trials_without_gain_are_told_and_are_no_reason() -> None:
    found = searched(trial("start", "start 1 of 6", 500.0, False))
    (text,) = minimum_sentences(SimpleNamespace(minimum=found))  # type: ignore[arg-type]
    assert text.endswith("none ended at a lower χ².")
    assert said(found) == []


def test_pairs_that_are_better_while_they_are_held_are_a_reason_not_to_accept() -> None:
    assert said(searched(trial("pairing", PAIRS, 344.0, False, 129.0))) == [("not accepted", "judge.pairing-open")]
    # the gain of another trial is larger
    both = searched(
        trial("pairing", PAIRS, 344.0, False, 129.0), trial("start", "start 1 of 6", 30.5, True), chi_square=30.5
    )
    assert said(both) == [("reservation", "judge.better-minimum")]


def test_pairings_that_were_not_tried_are_named() -> None:
    found = searched(left=(PAIRS, "b", "c", "d"))
    assert said(found) == [("reservation", "judge.pairing-not-tried")]
    (text,) = minimum_sentences(SimpleNamespace(minimum=found))  # type: ignore[arg-type]
    assert f"Other pairings that were not tried: {PAIRS}; b; c; and 1 more." in text


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        ((0.5, -0.5), []),
        ((0.5, -1.4), [("reservation", "judge.frequency-worse")]),
        ((2.5, -1.4), [("not accepted", "judge.frequencies-worse")]),
        # all within a per cent
        ((-0.9, 0.9), []),
    ],
)
def test_frequencies_are_compared_with_the_start(after: tuple[float, ...], expected: list[tuple[str, str]]) -> None:
    assert said(None, (2.0, -0.4), after) == expected


def test_merged_pairs_are_a_warning() -> None:
    sentence = "test modes 4 and 5 are compared as one subspace from here on, because their pairing alternated"
    events = [
        PairingEvent(iteration=3, configuration="as built", sentence="test mode 4 with model mode 4 before, 5 now"),
        PairingEvent(iteration=9, configuration="as built", sentence=sentence, merged=True),
    ]
    change, merged = pairing_alerts(events)
    assert (change.level, merged.level) == ("info", "warning")
    assert not [a for a in pairing_alerts(events[:1]) if a.level == "warning"]
    check_shown("update.pairs-merged", f"[{merged.code}] {merged.sentence}")
