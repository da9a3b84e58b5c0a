"""Reasons from the residuals in parts, from the shapes beside their neighbours, and from the errors by kind."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from femtune.document.numbers import listed
from femtune.steps.judge.record.parts import LEAST_SHARE, NOT_ACCEPTED, RESERVED, chance_words
from femtune.steps.judge.record.reason import reason

if TYPE_CHECKING:
    from femtune.steps.judge.record.parts import KindOfErrors, NeighbourRecord, PartRecord, PartsResults, UntestedKind
    from femtune.steps.judge.record.reason import ReasonRecord, Weight
    from femtune.steps.results import Results
    from femtune.steps.update.record.update import ResidualCount

_LEAST_TIMES = 1.5
"""Ratio of stated and actual standard deviation up to which the stated one is not called too large: deviations are
hardly known better than that, and many residuals show any difference."""


def parts_reasons(results: Results) -> Iterable[ReasonRecord]:
    """What noise of the stated size does not explain, and standard deviations that are stated too large."""
    parts = None if results.judgement is None else results.judgement.parts
    goodness = None if results.update is None else results.update.goodness
    if parts is None:
        return
    misfit = [*_misfit(parts), *_mixed(parts)]
    yield from misfit
    # the size of errors that are assumptions has a reason of its own
    stated = any(not kind.assumed for kind in parts.kinds) or not parts.kinds
    if stated and not misfit and goodness is not None and goodness.verdict == "fail":
        yield reason("reservation", "judge.misfit/whole", outcome=goodness.sentence)
    if parts.untested:
        yield _of_untested(parts.untested, () if results.update is None else results.update.residual_counts)
    for kind in parts.kinds:
        yield from _of_errors(kind)


def _of_untested(untested: Sequence[UntestedKind], counts: Sequence[ResidualCount]) -> ReasonRecord:
    """Kinds without a test; the largest of them with its size, if that alone is remarkable."""
    sizes = {c.kind: c for c in counts if c.rms_after is not None and c.error_after_percent is not None}
    largest = max((sizes[u.kind] for u in untested if u.kind in sizes), key=lambda c: c.rms_after or 0.0, default=None)
    if largest is None or (largest.rms_after or 0.0) < _LEAST_TIMES:
        kinds = listed([u.kind for u in untested])
        return reason("reservation", "judge.fit-not-tested", kinds=kinds, why=untested[0].reason)
    why = next(u.reason for u in untested if u.kind == largest.kind)
    return reason(
        "reservation", "judge.fit-not-tested/large", kind=largest.kind, ratio=largest.rms_after,
        error=largest.error_after_percent, why=why,
    )  # fmt: skip


def _weight(p: float) -> Weight:
    return "not accepted" if p < NOT_ACCEPTED else "reservation"


def _misfit(found: PartsResults) -> Iterable[ReasonRecord]:
    """The part that is named; others follow from the same cause, and stand in the table."""
    least = min((p.p_family_wise for p in found.parts), default=1.0)
    level = NOT_ACCEPTED if least < NOT_ACCEPTED else RESERVED
    part = found.named(level)
    if part is None:
        return
    code = {"priors": "judge.misfit/prior", "bounds": "judge.misfit/held", "side constraint": "judge.misfit/held"}
    size = next((k for k in found.kinds if (part.family, part.kind) == ("kinds", k.kind) and k.key), None)
    fits = {} if size is None or size.fits is None else {"key": size.key, "stated": size.stated, "fits": size.fits}
    yield reason(
        _weight(part.p_family_wise), code.get(part.family, "judge.misfit/with-key" if fits else "judge.misfit"),
        _place(part), part=part.words, ratio=part.ratio, numbers=part.numbers, **fits,
    )  # fmt: skip


def _place(part: PartRecord) -> str:
    return " ".join(word for word in (part.configuration, part.kind, part.mode, part.sensor) if word)


def _mixed(found: PartsResults) -> Iterable[ReasonRecord]:
    """The mode that is most clearly mixed with its neighbours."""
    felt = [n for n in found.neighbours if n.share >= LEAST_SHARE]
    worst = min(felt, key=lambda n: n.p_value, default=None)
    if worst is None or worst.p_family_wise >= RESERVED:
        return
    yield reason(
        _weight(worst.p_family_wise), "judge.neighbour", f"{worst.configuration} mode {worst.test_label}",
        sentence=mixed_sentence(worst), chance=chance_words(worst.p_family_wise),
    )  # fmt: skip


def mixed_sentence(n: NeighbourRecord) -> str:
    """Which mode contains how much of which other."""
    other = f"mode {n.other_label}" if n.other_label else f"model mode {n.other_number}"
    if n.share >= 1.0:
        return f"mode {n.test_label} contains {n.share:.1f} times as much of {other} as of its own model mode"
    return f"mode {n.test_label} contains {100.0 * n.share:.2g} % of {other}"


def _of_errors(kind: KindOfErrors) -> Iterable[ReasonRecord]:
    if not kind.factor:  # unknown, or 0: exact data have no errors of any size
        return
    facts = {"kind": kind.kind, "ratio": kind.factor, "times": 1.0 / kind.factor, "key": kind.key,
             "stated": kind.stated, "fits": kind.fits}  # fmt: skip
    keyed = kind.key and kind.fits is not None
    small = not kind.assumed and kind.p_small is not None and kind.p_small < NOT_ACCEPTED
    if small and kind.factor * _LEAST_TIMES < 1.0:
        yield reason("reservation", "judge.overstated/with-key" if keyed else "judge.overstated", kind.kind, **facts)
    if kind.assumed and kind.p_large is not None and kind.p_large < NOT_ACCEPTED:
        code = "judge.larger-than-assumed/with-key" if keyed else "judge.larger-than-assumed"
        yield reason("reservation", code, kind.kind, **facts)
