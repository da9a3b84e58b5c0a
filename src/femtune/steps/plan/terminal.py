"""A planned test on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import AlertBox, Listing, Section
from femtune.steps.plan.page import (
    exciter_tables,
    method_sentences,
    mode_table,
    own_axes,
    parameter_blocks,
    plan_numbers,
    plan_verdict,
    sensor_table,
    setup_blocks,
)

if TYPE_CHECKING:
    from femtune.document.document import Document
    from femtune.steps.info.terminal import Subject
    from femtune.steps.plan.record import PlanResults


def plan_document(subject: Subject, plan: PlanResults) -> Document:
    """Numbers, sensors, target modes and method."""
    verdict, level = plan_verdict(plan)
    alerts = tuple(AlertBox(a.level, a.code, a.sentence, a.where) for a in plan.alerts)
    sections = (
        Section("plan", f"Test plan: {plan.configuration}", (plan_numbers(plan), *alerts)),
        Section(
            "sensors",
            "Sensors",
            (sensor_table(plan, subject.length_unit), *own_axes(plan), *exciter_tables(plan, subject.length_unit)),
        ),
        Section("modes", "Target modes", (mode_table(plan),)),
        Section("parameters", "Expected standard deviations of the parameters", tuple(parameter_blocks(plan))),
        Section("setup", "Frequency lines, masses, suspension", tuple(setup_blocks(plan, _units(subject)))),
        Section("method", "Method", (Listing(tuple(method_sentences(plan))),)),
    )
    return subject.document(verdict, level, sections)


def _units(subject: Subject) -> str:
    return f"{subject.length_unit}-{subject.mass_unit}-s" if subject.mass_unit else ""
