"""The table *Basis of the report* states nothing that was not computed."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.testing import example_deck, example_test


def _basis(page: Path) -> str:
    text = page.read_text(encoding="utf-8")
    text = text[text.index("Basis of the report") : text.index("</section>")]
    text = re.sub(r"<(style|script|svg)[^>]*>.*?</\1>", "", text, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", text)).split())


def _chain(values: dict[str, float]) -> tuple[Any, Any]:
    """Two masses on springs between walls."""
    k = values["k"]
    eigen, shapes = np.linalg.eigh(np.array([[2 * k, -k], [-k, 2 * k]]))
    return np.sqrt(eigen) / (2 * np.pi), shapes * np.sign(shapes[:1])


@pytest.mark.slow
def test_of_a_function_no_size_support_count_or_mass_is_claimed(tmp_path: Path) -> None:
    hz, shapes = _chain({"k": 1.2e4})
    test = ft.modal_test(hz, shapes, dofs=["1Z", "2Z"], units="m-kg-s")
    model = ft.own_model(_chain, count=2, dofs=["1Z", "2Z"], units="m-kg-s")
    spring = ft.Parameter("k", absolute=True, nominal=1e4, lower=5e3, upper=2e4)
    done = ft.run(model, test, parameters=[spring], residuals=[ft.FrequencyResidual(sd=0.01)], output=tmp_path / "run")
    assert done.report is not None
    said = _basis(done.report)
    assert "units m-kg-s: modes computed outside femtune" in said
    assert "Sturm check not possible: the modes were computed outside femtune" in said
    assert "Supports of the model those of the model outside femtune, which are not known here" in said
    assert "the masses of the model modes are not known" in said
    for claimed in ("free DOFs", "no mode was missed", "Effective masses", "carry the mass", "as in the deck", "dense"):
        assert claimed not in said


@pytest.mark.slow
def test_frfs_are_not_said_to_be_undamped(tmp_path: Path) -> None:
    deck = example_deck(tmp_path)
    lines: dict[str, Any] = {"from_hz": 10.0, "to_hz": 60.0, "step_hz": 1.0}
    uff = tmp_path / "frfs.uff"
    ft.respond(deck, inputs=["5Y+"], outputs=["5Y+"], ratio=0.01, uff=uff, units="m-kg-s", **lines)
    zeta = ft.Parameter("zeta", fields=["MODAL ZETA"], absolute=True, nominal=0.02, lower=0.001, upper=0.1)
    residual = ft.FrfResidual(form="log-complex", sd=0.02, to_hz=60.0)
    model = ft.read_deck(deck, units="m-kg-s")
    done = ft.run(model, ft.read_test(uff), parameters=[zeta], residuals=[residual], output=tmp_path / "run")
    assert done.report is not None
    said = _basis(done.report)
    assert re.search(r"Damping used in the comparison of kind frf: zeta 0\.02, updated 0\.01(;|\d)", said), said
    assert "undamped" not in said
    assert "Target modes" not in said
    assert "(the update does not change it)" in said


@pytest.mark.slow
def test_the_mass_after_an_update_of_a_mass(tmp_path: Path) -> None:
    model = ft.read_deck(example_deck(tmp_path), units="m-kg-s")
    tip = ft.Parameter("tip", fields=["CONM2 9 M"], lower=0.2, upper=2.0)
    done = ft.run(
        model, example_test(tmp_path), parameters=[tip], residuals=[ft.FrequencyResidual(sd=0.01)],
        output=tmp_path / "run",
    )  # fmt: skip
    assert done.report is not None
    found = re.search(r"at the initial values \(the update changes it by ([+−][\d.]+) %\)", _basis(done.report))
    assert found is not None
    before, after = (
        next(m for m in done.results.modes if m.stage == stage).effective_masses for stage in ("before", "after")
    )
    assert before is not None
    assert after is not None
    # the mass at the free points is known: the tip is two of 8.87 kg
    expected = 100.0 * 2.0 * (done.values["tip"] - 1.0) / before.total[1]
    assert abs(float(found[1].replace("−", "-")) - expected) < 0.02
    sums = 100.0 * np.sum(np.array(after.fractions)[:, :3], axis=0)
    said = re.search(r"sums of their effective masses in X, Y, Z ([\d.]+), ([\d.]+), ([\d.]+) %", _basis(done.report))
    assert said is not None
    assert [float(part) for part in said.groups()] == pytest.approx(sums.tolist(), abs=0.06)


@pytest.mark.slow
def test_the_damping_of_computed_responses_is_stated(tmp_path: Path) -> None:
    model = ft.read_deck(example_deck(tmp_path), units="m-kg-s")
    tip = ft.Parameter("tip", fields=["CONM2 9 M"], lower=0.2, upper=2.0)
    asked: dict[str, Any] = {
        "inputs": ["5Y+"],
        "outputs": ["5Y+"],
        "from_hz": 10.0,
        "to_hz": 60.0,
        "step_hz": 5.0,
        "ratio": 0.03,
    }
    done = ft.run(
        model,
        example_test(tmp_path),
        parameters=[tip],
        residuals=[ft.FrequencyResidual(sd=0.01)],
        response=asked,
        output=tmp_path / "run",
    )
    assert done.report is not None
    said = _basis(done.report)
    frfs = done.results.responses[0].frfs
    assert frfs is not None
    assert "0.03" in frfs.damping
    assert f"Damping used none: undamped modes are compared; for the computed responses {frfs.damping}" in said
