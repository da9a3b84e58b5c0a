"""Lists of measured frequencies without shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.shape_table import is_shape_table


def _written(folder: Path, text: str, name: str = "list.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_and_units(tmp_path: Path) -> None:
    path = _written(tmp_path, "mode;Frequency [Hz];sd %;damping ratio\n1a;27,08;0,5;0,01\n1b;44,7;;\n")
    modes = ft.read_test(path).modes
    assert modes is not None
    assert modes.shapes.shape == (0, 2)
    assert modes.labels == ("1a", "1b")
    assert modes.freq_hz.tolist() == [27.08, 44.7]
    assert modes.freq_sd_hz is not None
    np.testing.assert_allclose(modes.freq_sd_hz, [0.1354, np.nan])
    assert modes.damping_ratio is not None
    np.testing.assert_allclose(modes.damping_ratio, [0.01, np.nan])
    assert ft.read_test(_written(tmp_path, "hz\n27.08\n", "one.txt")).modes.freq_sd_hz is None  # type: ignore[union-attr]


@pytest.mark.parametrize("heading", ["time,1Z+", "freq_hz,H11", "node,direction,27 Hz", "f1_hz,f2_hz", "27.08"])
def test_other_tables_are_no_list_of_frequencies(tmp_path: Path, heading: str) -> None:
    path = _written(tmp_path, heading + "\n1,2,3\n")
    assert not is_shape_table(path) or "node" in heading


_WRONG = {
    "number": "freq_hz,sd_hz\n27.08,0.1\n0,0.1\n",
    "gap": "freq_hz,sd_hz\n,0.1\n",
    "deviation": "freq_hz,sd_hz\n27.08,-1\n",
    "fields": "freq_hz,sd_hz\n27.08\n",
    "twice": "mode,freq_hz\nA,27.08\nA,30\n",
    "empty": "freq_hz\n",
    "two columns": "hz,freq_hz\n1,2\n",
}


@pytest.mark.parametrize("name", _WRONG)
def test_wrong_lists_are_refused_with_the_line(name: str, tmp_path: Path) -> None:
    path = _written(tmp_path, _WRONG[name])
    with pytest.raises(FemtuneError) as caught:
        ft.read_test(path)
    check_shown(f"test.frequencies, {name}", str(caught.value).replace(str(tmp_path), "FOLDER"))
