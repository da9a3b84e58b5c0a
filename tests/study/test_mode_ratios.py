"""Damping ratios of modes as fields of parameters: read, started, computed with, refused where they make no sense."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.study.study import load_study

from .cantilever import Bench

TWO = """SOL 111
CEND
BEGIN BULK
SPOINT  1       2
CELAS2  1       1000.   1       0
CELAS2  2       800.    1       0       2       0
CMASS2  3       2.5     1       0
CMASS2  4       2.0     2       0
ENDDATA
"""
STUDY = """
[study]
title = "two masses"
deck = "two.bdf"
units = "m-kg-s"

[response]
kind = "receptance"
inputs = ["1S+"]
outputs = ["1S+", "2S+"]
from_hz = 0.5
to_hz = 8.0
step_hz = 0.25
method = "METHOD"
RATIOS

[[parameter]]
name = "first"
fields = ["MODAL 1 ZETA"]
lower = 0.5
upper = 2.0

[[parameter]]
name = "others"
fields = ["MODAL ZETA"]
lower = 0.001
upper = 0.1
absolute = true
nominal = 0.03
"""


def study_of(bench: Bench, method: str = "direct", ratios: str = "ratios = [0.02, 0.05]", **more: str) -> Path:
    bench.write("two.bdf", TWO)
    text = STUDY.replace("METHOD", method).replace("RATIOS", ratios)
    for old, new in more.items():
        assert old.replace("_", " ") in text
        text = text.replace(old.replace("_", " "), new)
    return bench.write("study.toml", text)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["real modes", "complex modes", "direct"])
def test_responses_at_the_start_have_the_ratios_of_the_parameters(bench: Bench, method: str) -> None:
    """A factor starts at the ratio of [response], an absolute one at its own nominal value."""
    result = ft.respond(study_of(bench, method))
    (found,), arrays = result, result.arrays
    assert found.frfs is not None
    K, M = np.array([[1800.0, -800.0], [-800.0, 800.0]]), np.diag([2.5, 2.0])
    values, shapes = np.linalg.eig(np.linalg.solve(M, K))
    order = np.argsort(values)
    omega, phi = np.sqrt(values[order]), shapes[:, order]
    phi = phi / np.sqrt(np.einsum("ij,ik,kj->j", phi, M, phi))
    s = 2j * np.pi * arrays[found.frfs.freq_key]
    single = 1.0 / (s[:, None] ** 2 + 2 * np.array([0.02, 0.03]) * omega * s[:, None] + omega**2)
    exact = np.einsum("im,km,m->ik", phi, single, phi[0])
    np.testing.assert_allclose(arrays[found.frfs.values_key][:, 0], exact, rtol=1e-9)
    assert found.frfs.damping.endswith("updated damping ratios 0.03 of others, 0.02 of mode 1")


def test_a_factor_needs_a_ratio_to_start_from(bench: Bench) -> None:
    with pytest.raises(FemtuneError) as error:
        load_study(study_of(bench, ratios=""))
    assert error.value.code == "parameter.zero-nominal"
    assert "MODAL 1 ZETA is zero" in str(error.value)


@pytest.mark.parametrize("text", ["MODAL 1 FREQ", "MODAL 1 ETA", "MODAL K"])
def test_modes_have_no_other_field(bench: Bench, text: str) -> None:
    with pytest.raises(FemtuneError) as error:
        load_study(study_of(bench, MODAL_1_ZETA=text))
    assert error.value.code == "study.unknown-field"
    assert 'write "MODAL 3 ZETA"' in error.value.hint


def test_two_parameters_of_one_ratio_are_refused(bench: Bench) -> None:
    with pytest.raises(FemtuneError) as error:
        load_study(study_of(bench, ratios="ratio = 0.02", MODAL_1_ZETA="MODAL ZETA"))
    assert error.value.code == "parameter.field-twice"
