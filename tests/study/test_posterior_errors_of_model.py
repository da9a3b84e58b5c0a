"""[posterior] with discrepancy = "properties": what no parameter represents may be wrong, within sizes of the data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from structures.wrong_property import FRAME

TRUTH = {"PBAR 1 I2": 1.1, "PBAR 3 I2": 0.9, "PBAR 4 I2": 1.15}
RULES = {"noise": "stated", "draws": 120, "starts": 0, "seed": 3, "discrepancy": "properties"}


@pytest.mark.slow
def test_intervals_hold_beside_a_wrong_property(tmp_path: Path) -> None:
    """The stiffness of the upper columns is 20 % off and no parameter; intervals of the data alone miss the truth."""
    study = FRAME.study(tmp_path, TRUTH | {"PBAR 2 I2": 1.2})
    result = ft.posterior(study, posterior=RULES, update={"look_further": False})
    record = result.results.posterior
    assert record is not None
    truth = [TRUTH[field] for field in FRAME.parameters]

    def hits(ends: list[tuple[float, float]]) -> int:
        return sum(low < value < high for (low, high), value in zip(ends, truth, strict=True))

    assert hits([p.interval_95 for p in record.parameters]) == 3
    alone = [p.of_data_interval_95 for p in record.parameters if p.of_data_interval_95 is not None]
    assert hits(alone) < 3
    # the data tell that one value of its class is wrong and the others are not
    assert [c.what for c in record.model_errors] == [
        "stiffnesses", "parts of properties", "masses", "PBAR 2 I2", "masses that the deck lacks",
        "supports that give way",
    ]  # fmt: skip
    sizes = {c.what: c.sd_percent for c in record.model_errors}
    assert sizes["PBAR 2 I2"] > 10.0 * sizes["stiffnesses"]
    first = record.wanted[0]
    assert first.what == "PBAR 2 I2"
    assert first.change_percent == pytest.approx(20.0, abs=5.0)
    assert any("Errors of the model widen the intervals" in sentence for sentence in record.sentences)
    sampled = result.arrays[record.sizes_key]
    assert sampled.shape == (record.draws, 6)
    weighted = np.average(np.log(sampled[:, 3]), weights=result.arrays[record.weights_key])
    assert 100.0 * np.exp(weighted) == pytest.approx(sizes["PBAR 2 I2"], rel=0.3)


@pytest.mark.slow
def test_a_model_of_matrices_has_no_properties_that_could_change(tmp_path: Path) -> None:
    K = 1e4 * (2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    parts = [{"name": "K", "file": K}, {"name": "M", "file": 2.0 * np.eye(4)}]
    model = ft.read_matrices([parts[0]], [parts[1]], dofs=["1Z", "2Z", "3Z", "4Z"], units="m-kg-s")
    true = ft.read_matrices(1.1 * K, 2.0 * np.eye(4), dofs=["1Z", "2Z", "3Z", "4Z"], units="m-kg-s")
    test = ft.simulate(true, ["1 THRU 4:3"], count=4, frequency_scatter=0.01, seed=1)
    result = ft.posterior(
        model, test, parameters=[ft.Parameter("k", fields=["MATRIX K"], lower=0.5, upper=2.0)],
        residuals={"frequency_sd": 0.01}, posterior=RULES, sensors={"by_id": True},
        output=tmp_path / "run",
    )  # fmt: skip
    record = result.results.posterior
    assert record is not None
    assert record.model_errors == ()
    assert "the model has no elements" in record.no_model_errors
    assert any("Errors of the model are not in the intervals" in sentence for sentence in record.sentences)
