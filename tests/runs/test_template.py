"""Placeholders: what is written in their place, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.lines import parse_real
from femtune.runs import Template, Templates, read_template
from femtune.runs.template import check_names

_CARD = "MAT1    1       {{E:n8}}        .3      {{rho:n8}}\n"


def test_a_fixed_field_card_keeps_its_columns() -> None:
    line = Template.of_text("a.bdf", _CARD).fill({"E": 2.1e11, "rho": -7.85e-9})
    assert [line[at : at + 8].strip() for at in (0, 8, 16, 24, 32, 40)] == [
        "MAT1", "1", "2.1+11", "", ".3", "-7.85-9"
    ]  # fmt: skip


@given(st.floats(allow_nan=False, allow_infinity=False, width=64))
def test_a_value_never_leaves_its_field(value: float) -> None:
    line = Template.of_text("a.bdf", "{{E:n8}}|{{E:n16}}|").fill({"E": value})
    small, large, _ = line.split("|")
    assert (len(small), len(large)) == (8, 16)
    assert parse_real(large.strip()) == pytest.approx(value, rel=1e-8, abs=0.0)
    assert "\n" not in line


@pytest.mark.parametrize(("format", "text"), [("", "12345.678"), (".3e", "1.235e+04"), ("12.4f", "  12345.6780")])
def test_formats(format: str, text: str) -> None:
    assert Template.of_text("a", f"<{{{{x:{format}}}}}>" if format else "<{{x}}>").fill({"x": 12345.678}) == f"<{text}>"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_no_numbers_are_refused(value: float) -> None:
    with pytest.raises(FemtuneError) as caught:
        Template.of_text("beam.inp", "1\n{{E}}").fill({"E": value})
    assert caught.value.code == "external.placeholder"
    assert caught.value.where == Where("beam.inp", 2)


def test_a_number_wider_than_its_field_is_refused() -> None:
    with pytest.raises(FemtuneError) as caught:
        Template.of_text("beam.inp", "{{E:8.5f}}").fill({"E": -123456.0})
    check_shown("external.placeholder, too wide", caught.value)


@pytest.mark.parametrize(
    ("text", "name"), [("\n{{E:9d}}", "format"), ("{{E; rm -rf}}\n{{ok}}", "malformed"), ("{{E", "unfinished")]
)
def test_what_is_no_placeholder_is_refused(text: str, name: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        Template.of_text("beam.inp", text)
    check_shown(f"external.placeholder, {name}", caught.value)


@pytest.mark.parametrize(("placeholders", "name"), [(("Emod", "rho"), "unknown"), (("rho",), "unused")])
def test_placeholders_and_parameters_must_be_the_same(placeholders: tuple[str, ...], name: str) -> None:
    wanted = ("rho",) if name == "unknown" else ("E_mod", "rho")
    with pytest.raises(FemtuneError) as caught:
        check_names(placeholders, ("E_mod", "rho"), wanted, Where("study.toml", 7))
    check_shown(f"external.placeholder, {name}", caught.value)


def test_bytes_that_are_no_utf8_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "a.inp").write_bytes(b"** \xe9\xff\r\n{{E}}\r\n")
    assert Templates((read_template(tmp_path / "a.inp"),)).files({"E": 2.0})["a.inp"] == b"** \xe9\xff\r\n2\r\n"


def test_an_absent_template(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        read_template(tmp_path / "a.inp")
    check_shown("external.unreadable", str(caught.value).replace(str(tmp_path), "FOLDER"))
