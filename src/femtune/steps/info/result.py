"""The result of `info`: facts of the model and of its configurations, for Python users."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from femtune.study.rows import Rows

if TYPE_CHECKING:
    from femtune.steps.info.record.model import ModelFacts
    from femtune.study.record import Alert
from femtune.steps.result import StepResult


@dataclass(frozen=True, eq=False, repr=False)
class InfoResult(StepResult):
    """Summary of a deck: cards, mass, supports, rigid-body check, elements out of shape, errors due to the mesh.

    `record` is that of results.json, ``model``.
    """

    record: ModelFacts

    @property
    def cards(self) -> Rows:
        """Kinds of cards: `name`, `count`, `used`, and the `reason` why a kind is not used."""
        read = [{"name": c.name, "count": c.count, "used": True, "reason": ""} for c in self.record.cards_read]
        left = (
            {"name": c.name, "count": c.count, "used": False, "reason": c.reason} for c in self.record.cards_ignored
        )
        return Rows.of([*read, *left])

    @property
    def configurations(self) -> Rows:
        """Grid points, DOFs, mass (units of the study) and outcome of the rigid-body check, by configuration."""
        return Rows.of(
            {
                "configuration": c.configuration,
                "grids": c.grids,
                "free_dofs": c.free_dofs,
                "mass": c.mass,
                "weighed_mass": c.weighed_mass,
                "mass_difference_percent": c.mass_difference_percent,
                "rigid_body_check": c.rigid_body_check.verdict,
            }
            for c in self.record.configurations
        )

    @property
    def notices(self) -> tuple[Alert, ...]:
        """Notices of the study (units, tests, sensors) and of the deck reader."""
        return self.record.notices

    def _sentences(self) -> list[str]:
        used = sum(c.count for c in self.record.cards_read)
        ignored = sum(c.count for c in self.record.cards_ignored)
        each = [
            f"{c.configuration}: {c.grids} points, {c.free_dofs} free DOFs, "
            f"mass {'not known' if c.mass is None else f'{c.mass:.6g}'}, "
            f"rigid-body check: {c.rigid_body_check.verdict}"
            for c in self.record.configurations
        ]
        return [f"{used} cards used, {ignored} not used", *each, *(f"{a.level}: {a.sentence}" for a in self.notices)]

    def _table(self) -> Rows:
        return self.configurations
