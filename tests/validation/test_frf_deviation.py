"""δ of FRFs: sums of both sets over all configurations, and of each."""

from __future__ import annotations

import pytest

from femtune.steps.validate.frf_deviation import deviations_of
from femtune.steps.validate.record.frf_deviation import ChannelDeviation, ComparedAs, DataSet


def _channel(
    configuration: str, data: DataSet, lines: int, before: float, after: float, compared: ComparedAs = "measured"
) -> ChannelDeviation:
    return ChannelDeviation(
        configuration=configuration, data=data, compared=compared, output="1Z+", input="2Z+", lines=lines,
        before=before, after=after,
    )  # fmt: skip


def test_each_configuration_has_sums_of_both_sets() -> None:
    """Means over the lines: an FRF of 300 lines weighs three times as much as one of 100."""
    found = deviations_of([
        _channel("free", "calibration", 100, 0.4, 0.1),
        _channel("free", "validation", 100, 0.2, 0.3),
        _channel("loaded", "calibration", 300, 0.8, 0.0),
        _channel("loaded", "validation", 100, 0.0, 0.1),
    ])  # fmt: skip
    rows = {(s.configuration, s.data): s for s in (*found.sums, *found.by_configuration)}
    assert len(rows) == 6
    whole = rows["", "calibration"]
    assert (whole.frfs, round(whole.before, 12), round(whole.after, 12)) == (2, 0.7, 0.025)
    assert [rows["free", d].change_percent for d in ("calibration", "validation")] == pytest.approx([-75.0, 50.0])
    assert [rows["free", d].risen for d in ("calibration", "validation")] == [0, 1]
    assert rows["loaded", "calibration"].change_percent == -100.0
    assert rows["loaded", "validation"].change_percent is None


def test_frfs_with_equal_damping_and_measured_ones_have_sums_of_their_own() -> None:
    found = deviations_of([
        _channel("free", "calibration", 100, 0.4, 0.1, "equal damping"),
        _channel("free", "calibration", 900, 0.8, 0.2),
        _channel("free", "validation", 900, 0.6, 0.3),
    ])  # fmt: skip
    assert [(s.data, s.compared, s.before, s.after) for s in found.sums] == [
        ("calibration", "equal damping", 0.4, 0.1),
        ("calibration", "measured", 0.8, 0.2),
        ("validation", "measured", 0.6, 0.3),
    ]
    assert ["with equal damping" in sentence for sentence in found.sentences] == [True, False, False]
