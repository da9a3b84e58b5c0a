"""A reason for the verdict."""

from __future__ import annotations

from typing import Any, Literal

from femtune.errors import Notice, wording
from femtune.study.record import Record

Weight = Literal["not accepted", "reservation"]


class ReasonRecord(Record):
    """A reason not to accept a run, or not without a reservation."""

    code: str
    """Stable code ``area.problem``; docs/errors has a page for each."""
    weight: Weight
    """"not accepted" or "reservation"."""
    sentence: str
    """The reason, without a full stop."""
    brief: str = ""
    """The reason in a few words, for the line of the verdict; "" where the sentence is brief enough."""
    place: str = ""
    """What it is about: a configuration, mode, parameter or kind of residual; "" for the whole run."""

    @property
    def text(self) -> str:
        """The reason with its place and its code."""
        place = f" ({self.place})" if self.place and self.place not in self.sentence else ""
        return f"[{self.code}] {self.sentence}{place}"


def reason(weight: Weight, code: str, place: str = "", **facts: Any) -> ReasonRecord:
    """A reason in the wording of the registry."""
    said = Notice(code, **facts)
    return ReasonRecord(
        code=said.code, weight=weight, sentence=said.what, brief=brief_of(code).format_map(facts), place=place
    )  # fmt: skip


def brief_of(code: str) -> str:
    """The variant "brief" of a code in the registry, or that of its variant ("…-brief"); "" without one."""
    try:
        return wording(f"{code}-brief" if "/" in code else f"{code}/brief")[1].what
    except KeyError:
        return ""
