"""Reasons that other steps have found already: their alerts, by code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from femtune.steps.judge.record.reason import ReasonRecord, brief_of

if TYPE_CHECKING:
    from femtune.steps.judge.record.reason import Weight
    from femtune.steps.results import Results
    from femtune.study.record import Alert

WEIGHTS: Mapping[str, Weight] = {
    "update.misfit": "not accepted",
    "update.not-certified": "not accepted",
    "update.not-unique": "reservation",
    "update.starts-differ": "reservation",
    "update.stage-misfit": "reservation",
    "update.no-weight": "reservation",
    "update.at-bound": "reservation",
    "update.undetermined": "reservation",
    "update.few-data": "reservation",
    "update.few-samples": "reservation",
    "update.no-raw": "reservation",
    "update.raw-misfit": "reservation",
    "update.raw-moved": "reservation",
    "update.raw-open": "reservation",
    "update.mode-not-identified": "reservation",
    "quantify.no-distribution": "reservation",
    "quantify.held-out-differ": "not accepted",
    "quantify.disagrees": "reservation",
    "quantify.order-dependence": "reservation",
    "quantify.outlier": "reservation",
    "model.mesh-coarse": "not accepted",
    "model.mass-differs": "reservation",
    "model.lumped-mass": "reservation",
    "model.grounded": "reservation",
    "model.element-degenerate": "reservation",
    "residual.frf-truncated": "reservation",
    "response.truncated": "reservation",
    "residual.left-out-mode-lost": "reservation",
    "write.rounding": "reservation",
    "study.test-counted-twice": "reservation",
    "study.heavy-masses": "reservation",
    "deck.coincident-points": "reservation",
    "deck.free-part": "reservation",
    "deck.repeated-elements": "reservation",
    "deck.alternating-normals": "reservation",
    "deck.far-ends": "reservation",
    "deck.negative-value": "reservation",
    "correlate.sensor-inverted": "reservation",
    "correlate.sensors-exchanged": "reservation",
    "correlate.unit-factor": "reservation",
    "correlate.without-shapes": "reservation",
    "correlate.order-doubtful": "not accepted",
    "correlate.axes": "reservation",
}
"""Weight of the alerts that bear on the verdict, by code. Other alerts do, as reservations, if they are problems."""
_SAID_ELSEWHERE = ("update.no-optimum", "update.stage-unfinished", "write.differs")
"""Problems for which another topic has a reason of its own."""


def alert_reasons(results: Results) -> Iterable[ReasonRecord]:
    """Alerts of all steps that bear on the verdict; several with one code are one reason, in the words of the first."""
    judged_in_parts = results.judgement is not None and results.judgement.parts is not None
    elsewhere = (*_SAID_ELSEWHERE, *(["update.misfit"] if judged_in_parts else []))
    return reasons_of_alerts([a for a in results.alerts if a.code not in elsewhere])


def reasons_of_alerts(alerts: Iterable[Alert]) -> Iterable[ReasonRecord]:
    """One reason for each code that bears on the verdict."""
    by_code: dict[str, list[Alert]] = {}
    for a in alerts:
        if a.level != "info" and (a.code in WEIGHTS or a.level == "problem"):
            by_code.setdefault(a.code, []).append(a)
    for code, same_code in by_code.items():
        more = f"; and {len(same_code) - 1} more of this kind" if len(same_code) > 1 else ""
        weight = WEIGHTS.get(code, "reservation")
        yield ReasonRecord(
            code=code, weight=weight, sentence=same_code[0].sentence + more,
            brief=brief_of(code), place=same_code[0].where,
        )  # fmt: skip
