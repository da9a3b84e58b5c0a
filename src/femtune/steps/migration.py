"""Results of earlier schema versions, converted version by version to the current one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from femtune.steps.results import SCHEMA_VERSION


def _from_1(data: dict[str, Any]) -> None:
    """Version 2 always has `misfit`, `sd_ratio` and `cosine_distance`; the first files of version 1 lack them."""
    for residuals in _records(data, "update", "residual_counts"):
        residuals.setdefault("misfit", None)
    for kind in ("undetermined", "weakly_determined"):
        for combination in _records(data, "selection", kind):
            combination.setdefault("sd_ratio", None)
    for parameter in _records(data, "quantify", "parameters"):
        parameter.setdefault("cosine_distance", None)


_MIGRATIONS: Mapping[str, Callable[[dict[str, Any]], None]] = {"1": _from_1}
"""By version: what turns its data, in place, into those of the next version."""


def is_known(version: str) -> bool:
    """True for the present version and for all that can be migrated to it."""
    return version == SCHEMA_VERSION or version in _MIGRATIONS


def migrate(data: dict[str, Any]) -> None:
    """Change the data of a ``results.json`` of a known version, in place, into those of the present version.

    What an earlier version did not record is None afterwards, or has the default of its field once it is read. Data
    that are no results stay as they are: the check against the schema reports them.
    """
    while (version := data["schema_version"]) != SCHEMA_VERSION:
        _MIGRATIONS[version](data)
        data["schema_version"] = str(int(version) + 1)


def _records(data: Mapping[str, Any], step: str, field: str) -> list[dict[str, Any]]:
    stored = data.get(step)
    records = stored.get(field) if isinstance(stored, dict) else None
    return [r for r in records if isinstance(r, dict)] if isinstance(records, list) else []
