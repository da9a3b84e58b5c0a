"""docs/study-file.md has every key of the models, with the default that the model has."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, get_args

import pytest

from femtune.files import study_file
from femtune.files.study_file.kinds import TomlTable
from femtune.files.study_file.residual import ResidualEntry

_PAGE = (Path(__file__).resolve().parents[3] / "docs" / "study-file.md").read_text()
_ROW = re.compile(r"^\| `(\w+)` \| (.+?) \| (.+) \| `(.+)` \|$", re.MULTILINE)

_SHARED = ("kind", "configuration", "modes")
"""Keys that the section of [[residual]] explains for all kinds."""

_KINDS = {get_args(m.model_fields["kind"].annotation)[0]: m for m in get_args(get_args(ResidualEntry)[0])}

_TABLES: dict[str, type[TomlTable]] = {
    "## `[study]`": study_file.StudyTable,
    "## `[model]`": study_file.ModelTable,
    "## `[[matrix]]`": study_file.MatrixEntry,
    "## `[[variable]]`": study_file.VariableEntry,
    "## `[runs]`": study_file.RunsModelTable,
    "## `[solver]`": study_file.SolverTable,
    "## `[modes]`": study_file.ModesTable,
    "## `[[configuration]]`": study_file.ConfigurationEntry,
    "## `[[component]]`": study_file.ComponentEntry,
    "### `masses`": study_file.MassEntry,
    "### `leave_out`": study_file.LeaveOutEntry,
    "### `pairs`": study_file.PairEntry,
    "## `[test]`": study_file.SingleTest,
    "## `[sensors]`": study_file.SensorsTable,
    "## `[[sensor]]`": study_file.SensorEntry,
    "### `terms`": study_file.SensorTerm,
    "## `[[rigid_floor]]`": study_file.RigidFloorEntry,
    "## `[correlate]`": study_file.CorrelateTable,
    "## `[[generic]]`": study_file.GenericEntry,
    "## `[[distribution]]`": study_file.DistributionEntry,
    "## `[[parameter]]`": study_file.ParameterEntry,
    "## `[[frequency_table]]`": study_file.FrequencyTableEntry,
    "## `[[derived]]`": study_file.DerivedEntry,
    "## `[residuals]`": study_file.ResidualsTable,
    "## `[update]`": study_file.UpdateTable,
    "## `[screen]`": study_file.ScreenTable,
    "## `[search]`": study_file.SearchTable,
    "## `[[candidate]]`": study_file.CandidateEntry,
    "## `[candidates]`": study_file.CandidatesTable,
    "## `[select]`": study_file.SelectTable,
    "## `[quantify]`": study_file.QuantifyTable,
    "## `[bootstrap]`": study_file.BootstrapTable,
    "## `[parallel]`": study_file.ParallelTable,
    "## `[equalise]`": study_file.EqualiseTable,
    "## `[reduction]`": study_file.ReductionTable,
    "## `[[stage]]`": study_file.StageEntry,
    "### `by_hand`": study_file.ByHandEntry,
    "## `[plan]`": study_file.PlanTable,
    "### `suspension`": study_file.SuspensionEntry,
    "## `[response]`": study_file.ResponseTable,
    "## `[[load]]`": study_file.LoadEntry,
    "## `[checks]`": study_file.ChecksTable,
    "## `[validate]`": study_file.ValidateTable,
    "## `[[hold_out]]`": study_file.HoldOutEntry,
    "## `[[vibration]]`": study_file.VibrationEntry,
    "## `[write]`": study_file.WriteTable,
    "## `[output]`": study_file.StudyOutputTable,
}


def _rows(heading: str) -> dict[str, tuple[str, str, str]]:
    section = re.split(r"^##+ ", _PAGE.partition(f"\n{heading}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]
    return {key: (default, meaning, example) for key, default, meaning, example in _ROW.findall(section)}


def _toml(text: str) -> Any:
    def frozen(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: frozen(one) for key, one in value.items()}
        return tuple(map(frozen, value)) if isinstance(value, list) else value

    return frozen(tomllib.loads(f"value = {text.strip('`')}")["value"])


def test_every_table_of_a_study_has_its_section() -> None:
    headings = {heading.strip("#` []") for heading in (*_TABLES, "## `[[residual]]`") if heading.startswith("## ")}
    keys = {field.alias or name for name, field in study_file.StudyFile.model_fields.items()}
    assert headings == keys - {"schema_version"}


@pytest.mark.parametrize("kind", _KINDS)
def test_a_kind_of_residual_has_its_keys_with_defaults_and_examples(kind: str) -> None:
    fields, rows = _KINDS[kind].model_fields, _rows(f"### `{kind}`")
    assert {*rows, *_SHARED} - set(fields) <= {"modes"}
    assert set(fields) <= {*rows, *_SHARED}
    for key, (default, _, _) in rows.items():
        assert fields[key].is_required() == (default == "*required*"), key
        if default != "*required*":
            assert fields[key].default == (None if default == "*none*" else _toml(default)), key
    examples = {key: _toml(example) for key, (_, _, example) in rows.items()}
    assert _KINDS[kind].model_validate({"kind": kind, **examples}).model_fields_set >= set(examples)


def test_the_section_of_residuals_lists_every_kind() -> None:
    rows = _rows("## `[[residual]]`")
    assert set(rows) == set(_SHARED)
    assert set(re.findall(r'`"([\w-]+)"`', rows["kind"][1])) == set(_KINDS)


@pytest.mark.parametrize("heading", _TABLES)
def test_section_has_the_keys_of_the_model(heading: str) -> None:
    assert set(_rows(heading)) == set(_TABLES[heading].model_fields)


@pytest.mark.parametrize("heading", _TABLES)
def test_defaults_are_those_of_the_model(heading: str) -> None:
    fields = _TABLES[heading].model_fields
    for key, (default, _, _) in _rows(heading).items():
        if default == "*required*":
            assert fields[key].is_required(), key
        else:
            actual = fields[key].get_default(call_default_factory=True)
            assert actual == (None if default == "*none*" else _toml(default)), key
            assert not fields[key].is_required(), key


@pytest.mark.parametrize("heading", _TABLES)
def test_examples_are_values_that_the_model_takes(heading: str) -> None:
    examples = {key: _toml(example) for key, (_, _, example) in _rows(heading).items()}
    assert _TABLES[heading].model_validate(examples).model_fields_set == set(examples)
