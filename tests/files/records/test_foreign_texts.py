"""Tables of text as programs of many origins write them: units of time, stated rates, dates, words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.files.records import ChannelColumn, read_record, read_record_told
from femtune.files.records.headings import stated_rate
from femtune.files.records.table import time_unit

T = np.arange(64) / 200.0
VALUES = np.random.default_rng(7).standard_normal((2, 64))


def rows(first: list[str], separator: str = ",", comma: bool = False) -> list[str]:
    lines = [separator.join([t, *(f"{v:.7f}" for v in column)]) for t, column in zip(first, VALUES.T)]
    return [line.replace(".", ",") for line in lines] if comma else lines


def times(form: str = "{:.4f}", factor: float = 1.0, start: float = 0.0) -> list[str]:
    return [form.format(start + factor * t) for t in T]


NS = 1_700_000_000_000_000_000
COUNT = [str(i) for i in range(64)]
BARE = [",".join(f"{v:.7f}" for v in column) for column in VALUES.T]
FORMS: dict[str, list[str]] = {
    "milliseconds in brackets": ["Time [ms],Acc X,Acc Y", *rows(times("{:.0f}", 1e3))],
    "microseconds": ["Time (µs),Acc X,Acc Y", *rows(times("{:.0f}", 1e6))],
    "minutes": ["Time [min],Acc X,Acc Y", *rows(times("{:.12f}", 1.0 / 60.0))],
    "units below, in brackets": ["Time,A,B", "(ms),(mV),(V)", "", *rows(times("{:.1f}", 1e3, -50.0))],
    "units below": ["Time;A;B", "ms;V;V", *rows(times("{:.0f}", 1e3), ";")],
    "unit in the name": ["time_ms,ax,ay", *rows(times("{:.0f}", 1e3))],
    "unit alone": ["millis,ax,ay", *rows(times("{:.0f}", 1e3))],
    "seconds in the name": ["t_s,ax,ay", *rows(times())],
    "since 1970 in ms": ["timestamp,ax,ay", *rows(times("{:.0f}", 1e3, 1.7e12))],
    "since 1970 in ns": ["time,seconds_elapsed,ax,ay", *rows([f"{NS + i * 5_000_000},{t}" for i, t in enumerate(T)])],
    "hash": ["##{'a': 1}", "#time,accel_x,accel_y", *rows(times("{:.6f}", 1.0, 123.4))],
    "quotes and decimal commas": ['"Time (s)";"Acc x (m/s^2)";"Acc y (m/s^2)"', *rows(times(), ";", comma=True)],
    "number of the time": ["Zeit  1 - Standardmessrate [s];B1 [m/s²];B2 [m/s²]", *rows(times(), ";", comma=True)],
    "abscissa": ["X (s),a,b", *rows(times())],
    "names of a program": ["Var1,Var2,Var3", *rows(times())],
    "index before the times": [",time,a,b", *rows([f"{i},{t:.4f}" for i, t in enumerate(T)])],
    "rate above": ["Sample rate: 200 Hz", "Filter: 80 Hz", "", "A,B", *BARE],
    "rate above in kHz": ["Sampling Frequency [kHz],0.2", "A,B", *BARE],
    "step above": ["Model,X1", "Sample Interval,5e-3", "A,B", *BARE],
    "rate in a comment": ["# Config: data_rate = 200.0 Hz, filter = 488 Hz", "count,a,b", *rows(COUNT)],
    "rate below": ["Sample,X,Y", *rows(COUNT), "Rate 200, overflows 0"],
    "times with colons only": ["time,a,b", *rows([f"12:50:05:{1e3 * t:03.0f}" for t in T])],
    "noon": ["time,a,b", *rows([f"5/3/2024 11:59:59.{900 + 1e3 * t:.0f} AM" for t in T[:20]] + [
        f"5/3/2024 12:00:00.{1e3 * t - 100:03.0f} PM" for t in T[20:]
    ])],
    "words in a column": ["time,state,a,b", *rows([f"{t:.4f},ok" for t in T])],
    "comment between": ["time,a,b", *rows(times())[:30], "# pause", *rows(times())[30:]],
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_rate_and_channels(tmp_path: Path, form: str, encoding: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*FORMS[form], ""]), encoding=encoding)
    found = read_record(path)
    assert found.sampling_hz == pytest.approx(200.0, rel=1e-5)
    assert found.values == pytest.approx(VALUES, abs=1e-6)


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*FORMS["words in a column"], "end of measurement", ""]))
    found, (words, footer) = read_record_told(path)
    assert [c.name for c in found.channels] == ["a", "b"]
    check_shown("record.left-out, words", words)
    check_shown("record.left-out, footer", footer)


def test_units_below_the_names_are_those_of_the_channels(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["Time,Hammer,Top", "ms,N,g", *rows(times("{:.0f}", 1e3)), ""]))
    found = read_record(path)
    assert [(c.name, c.quantity, c.role) for c in found.channels] == [
        ("Hammer", "force", "input"), ("Top", "acceleration", "response"),
    ]  # fmt: skip
    assert found.values[1] == pytest.approx(9.80665 * VALUES[1], rel=1e-6, abs=1e-6)
    by_name = read_record(path, [ChannelColumn("Top", Dof(1, "Z"))])
    assert by_name.values[0] == pytest.approx(VALUES[1], abs=1e-6)


@pytest.mark.parametrize("name", ["T [degC]", "Accel X", "a [ms]", "force time", "min", "tension", "time lag x"])
def test_no_times(name: str) -> None:
    assert time_unit(name) is None


@pytest.mark.parametrize(
    "lines",
    [
        ["Sample rate: 100", "data rate: 200"],
        ["rate of descent 7"],
        ["Sample rate: off"],
        ["fs: 1e400"],
        ["sampl_" * 10**6],
    ],
)
def test_no_rate_is_stated(lines: list[str]) -> None:
    assert stated_rate(lines) is None


def test_a_sample_that_is_missing_is_no_footer(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["time,a,b", *rows(times())[:-1], f"{T[-1]:.4f},NaN,NaN", ""]))
    assert np.isnan(read_record(path).values[:, -1]).all()
    path.write_text("\n".join(["a,b", *BARE[:-1], "nan,nan", ""]))
    assert read_record(path, sampling_hz=200.0).samples == 64
    path.write_text("\n".join(["time,a,b", *rows(times())[:-1], f"{T[-1]:.4f},0.1", ""]))
    with pytest.raises(FemtuneError, match="the last line is incomplete"):
        read_record(path)


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_time_records_of_a_universal_file_that_only_labels_say(tmp_path: Path, encoding: str) -> None:
    """Data types "general" and no nodes: what was measured where is in label and unit of the axis."""
    sets = []
    for label, unit, values in (("12x", "m/s²", VALUES[0]), ("hammer", "N", VALUES[1])):
        head = ["    -1", "    58", *["NONE"] * 5]
        head += ["    1         0    0         0 NONE               0   0 NONE               0   0"]
        head += ["         2        64         1 0.00000E+000 5.00000E-003 0.00000E+000"]
        head += [f"        {17}    0    0    0 Time                 s"]
        head += [
            f"         1    0    0    0 {label:<20} {unit}",
            *["         0    0    0    0 NONE                 NONE"] * 2,
        ]
        sets += [*head, *("".join(f"{v:13.5E}" for v in values[i : i + 6]) for i in range(0, 64, 6)), "    -1"]
    (tmp_path / "a.uff").write_text("\n".join([*sets, ""]), encoding=encoding)
    found = read_record(tmp_path / "a.uff")
    assert [(str(c.dof), c.quantity, c.role) for c in found.channels] == [
        ("12X+", "acceleration", "response"), ("2S+", "force", "input"),
    ]  # fmt: skip
    assert found.values == pytest.approx(VALUES, abs=1e-4)
