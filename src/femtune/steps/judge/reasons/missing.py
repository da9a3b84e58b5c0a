"""Reasons from fields of the deck that no parameter represents and that the residuals ask for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.document.numbers import counted, listed, short, with_unit
from femtune.steps.judge.record.missing import PARAMETER
from femtune.steps.judge.record.parts import NOT_ACCEPTED, RESERVED
from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.judge.record.missing import MissingField, MissingResults, RefittedField
    from femtune.steps.results import Results

_PLAUSIBLE_SHARE = 0.5
"""Part of the statistic that a change inside the usual range must reach, for a field to be named as the cause."""
_MOST_ALIKE = 2
"""Fields that look alike, in a sentence; the table has all."""


def missing_reasons(results: Results) -> Iterable[ReasonRecord]:
    """One reason, for the field that explains most."""
    missing = results.judgement and results.judgement.missing
    if not missing or missing.p_value is None or missing.p_value >= RESERVED or not missing.fields:
        return
    first = missing.fields[0]
    if first.what == PARAMETER:
        yield reason(
            "reservation", "judge.missing/beyond-bound", first.name, field=first.field, chance=chance(first.p_value),
            tested=_tested(missing),
        )  # fmt: skip
    elif results.judgement and results.judgement.parts and results.judgement.parts.only_prior:
        # with another prior, which has a reason of its own, nothing may be missing
        yield _suspected(missing, first)
    elif first.largest_mass is not None and first.share >= _PLAUSIBLE_SHARE:
        yield _of_mass(missing, first, first.largest_mass)
    elif first.stiffness is not None and first.share >= _PLAUSIBLE_SHARE:
        yield _of_support(missing, first, first.stiffness)
    elif confirmed(missing, first):
        assert first.refit is not None
        yield _of_field(missing, first, first.refit)
    elif first.share < _PLAUSIBLE_SHARE:
        yield reason(
            "reservation", "judge.missing/implausible", chance=chance(missing.p_value), tested=_tested(missing)
        )
    else:
        yield _suspected(missing, first)


def _suspected(found: MissingResults, first: MissingField) -> ReasonRecord:
    """A field without a refit that confirms it."""
    return reason(
        "reservation", "judge.missing/suspected", first.name,
        name=first.name, field=_named(first), chance=chance(first.p_value), tested=_tested(found),
    )  # fmt: skip


def _of_field(found: MissingResults, first: MissingField, refit: RefittedField) -> ReasonRecord:
    """A field that a refit confirms."""
    change = 100.0 * (refit.factor - 1.0)
    words = f"{'an increase' if change > 0.0 else 'a decrease'} by {abs(change):.3g} %"
    if refit.mode:
        limit = ", the limit of its usual range," if refit.at_bound else ""
        return reason(
            "not accepted", "judge.missing/one-mode", first.name,
            name=first.name, field=_named(first), change=words + limit, **_of_one_mode(found, refit),
        )  # fmt: skip
    return reason(
        "not accepted", "judge.missing/at-limit" if refit.at_bound else "judge.missing", first.name,
        name=first.name, field=_named(first), change=words,
        before=f"{found.chi_square:.4g}", after=f"{refit.chi_square:.4g}",
    )  # fmt: skip


def _of_one_mode(found: MissingResults, refit: RefittedField) -> dict[str, str]:
    """Facts of a refit that explains one mode."""
    assert refit.p_without_mode is not None
    return {
        "mode": refit.mode, "chance": chance(refit.p_without_mode),
        "before": f"{found.chi_square:.4g}", "after": f"{refit.chi_square:.4g}",
    }  # fmt: skip


def _of_mass(found: MissingResults, first: MissingField, largest: float) -> ReasonRecord:
    """A mass that the deck does not have; a refit that does not confirm it leaves the suspicion."""
    place = _named(first).removeprefix("mass, ")
    if confirmed(found, first):
        assert first.refit is not None
        mass = with_unit(f"{first.refit.factor * largest:.2g}", first.mass_unit)
        if first.refit.mode:
            limit = ", the largest that is plausible," if first.refit.at_bound else ""
            return reason(
                "not accepted", "judge.missing/mass-one-mode", first.name,
                position=place, spot=first.place, mass=mass + limit, **_of_one_mode(found, first.refit),
            )  # fmt: skip
        return reason(
            "not accepted", "judge.missing/mass-at-limit" if first.refit.at_bound else "judge.missing/mass", first.name,
            position=place, spot=first.place, mass=mass,
            before=f"{found.chi_square:.4g}", after=f"{first.refit.chi_square:.4g}",
        )  # fmt: skip
    return reason(
        "reservation", "judge.missing/mass-suspected", first.name, position=place, spot=first.place,
        chance=chance(first.p_value), tested=_tested(found),
    )  # fmt: skip


def _of_support(found: MissingResults, first: MissingField, least: float) -> ReasonRecord:
    """A support that gives way; a refit that does not confirm it leaves the suspicion."""
    place = _named(first).removeprefix("support ").removeprefix("support, ")
    if confirmed(found, first):
        assert first.refit is not None
        stiffness = with_unit(f"{least / max(first.refit.factor, 1e-6):.2g}", first.stiffness_unit)
        if first.refit.mode:
            limit = ", the least that is plausible," if first.refit.at_bound else ""
            return reason(
                "not accepted", "judge.missing/support-one-mode", first.name,
                position=place, spot=first.place, stiffness=stiffness + limit, **_of_one_mode(found, first.refit),
            )  # fmt: skip
        return reason(
            "not accepted", "judge.missing/support-at-limit" if first.refit.at_bound else "judge.missing/support",
            first.name, position=place, spot=first.place, stiffness=stiffness,
            before=f"{found.chi_square:.4g}", after=f"{first.refit.chi_square:.4g}",
        )  # fmt: skip
    return reason(
        "reservation", "judge.missing/support-suspected", first.name, position=place, spot=first.place,
        chance=chance(first.p_value), tested=_tested(found),
    )  # fmt: skip


def confirmed(found: MissingResults, field: MissingField) -> bool:
    """Whether something is missing, and the update with the field as a parameter confirms it."""
    refit = field.refit
    return (
        found.p_value is not None
        and found.p_value < NOT_ACCEPTED
        and refit is not None
        and refit.p_value is not None
        and refit.p_value < NOT_ACCEPTED
    )


def chance(p_value: float) -> str:
    """The probability of such a finding where nothing is missing: "p = 0.02"."""
    return f"p = {short(p_value)}"


def _tested(found: MissingResults) -> str:
    return counted(found.tested, "candidate" if any(f.points for f in found.fields) else "field")


def _named(field: MissingField) -> str:
    """The field, and those that look like it."""
    others = [*field.alike[:_MOST_ALIKE]]
    more = len(field.alike) - len(others)
    others += [f"{more} more"] if more > 0 else []
    return f"{field.name} (or what looks like it: {listed(others)})" if others else field.name
