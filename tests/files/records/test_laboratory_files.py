"""What laboratories hand over: headings with units, unnamed times, dates, LabVIEW, an array for each channel."""

from __future__ import annotations

import re
import struct
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from tests.messages.shown import check_shown

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.files.records import (
    ChannelColumn,
    FunctionColumn,
    FunctionLayout,
    read_frfs,
    read_function_files,
    read_record,
    read_record_told,
)
from femtune.files.records.headings import stated_channel
from femtune.files.records.mdf import read_mdf
from femtune.identification.averaging import no_lost_samples
from femtune.identification.operational import Operational
from femtune.modal import TimeSeries
from femtune.steps.identify.from_record import read_asked
from femtune.steps.identify.request import asked_of, check_length, check_usable
from femtune.units import unit_system

T = np.arange(64) / 200.0
RNG = np.random.default_rng(4)
FORCE, ONE, TWO = RNG.standard_normal((3, len(T)))
G = 9.80665


def table(tmp_path: Path, heading: str, *columns: object, separator: str = ",", name: str = "r.csv") -> Path:
    rows = [separator.join(x if isinstance(x, str) else f"{x:.9g}" for x in row) for row in zip(*columns)]  # type: ignore[call-overload]
    (tmp_path / name).write_text("\n".join([heading, *rows, ""]) if heading else "\n".join([*rows, ""]))
    return tmp_path / name


def check(found: TimeSeries, values: object, hz: float = 200.0) -> None:
    assert found.values == pytest.approx(np.array(values), rel=1e-6, abs=1e-8)
    assert found.sampling_hz == pytest.approx(hz)


# ----------------------------------------------------------------------------------------------------
# Headings.


@pytest.mark.parametrize(
    "heading", ["force", "Force (N)", "F [N]", "hammer", "Kraft / N", "load cell [lbf]", "in_force"]
)
def test_a_force_is_the_input(tmp_path: Path, heading: str) -> None:
    found = read_record(table(tmp_path, f"time,{heading},top,base", T, FORCE, ONE, TWO))
    assert [c.role for c in found.channels] == ["input", "response", "response"]
    assert [c.quantity for c in found.channels] == ["force", "acceleration", "acceleration"]
    factor = 4.4482216152605 if "lbf" in heading else 1.0
    check(found, [factor * FORCE, ONE, TWO])


@pytest.mark.parametrize("heading", ["workforce", "gforce_index", "a1", "temperature"])
def test_other_words_are_no_force(heading: str) -> None:
    assert stated_channel(heading).quantity == "unknown"


def test_degrees_of_freedom_and_units_of_headings(tmp_path: Path) -> None:
    path = table(tmp_path, "t,1Z+,Acc 12X- [m/s^2],3:+Y (g)", T, FORCE, ONE, TWO)
    found = read_record(path)
    assert [str(c.dof) for c in found.channels] == ["1Z+", "12X-", "3Y+"]
    assert [c.quantity for c in found.channels] == ["unknown", "acceleration", "acceleration"]
    assert found.channels[2].unit == "m/s2"
    check(found, [FORCE, ONE, G * TWO])
    millimetres = read_record(path, units=unit_system("mm-t-s"))
    check(millimetres, [FORCE, 1e3 * ONE, 1e3 * G * TWO])


def test_what_the_user_states_comes_first(tmp_path: Path) -> None:
    path = table(tmp_path, "time,force [lbf],acc [g]", T, FORCE, ONE)
    columns = [ChannelColumn("force [lbf]", Dof(1, "Z"), "acceleration"), ChannelColumn(2, Dof(2, "Z"), factor=2.0)]
    found = read_record(path, columns)
    assert [c.role for c in found.channels] == ["response", "response"]
    check(found, [FORCE, 2.0 * ONE])


def test_equal_degrees_of_freedom_are_numbered(tmp_path: Path) -> None:
    found = read_record(table(tmp_path, "time,1Z+,1Z+", T, ONE, TWO))
    assert [str(c.dof) for c in found.channels] == ["1S+", "2S+"]
    driven = read_record(table(tmp_path, "time,force 1Z+,acc 1Z+", T, ONE, TWO))
    assert [(str(c.dof), c.role) for c in driven.channels] == [("1Z+", "input"), ("1Z+", "response")]


def test_a_force_by_its_heading_is_told(tmp_path: Path) -> None:
    file = asked_of(table(tmp_path, "time,force [lbf],2Z+ [g],top", T, FORCE, ONE, TWO), {"band_hz": (1.0, 50.0)})
    ((_, (clock, notice)),) = read_asked(file)
    check_shown("record.headings", notice)
    check_shown("record.clock", clock)
    quiet = asked_of(table(tmp_path, "time,a,b", T, ONE, TWO), {"band_hz": (1.0, 50.0)})
    assert [one.code for one in read_asked(quiet)[0][1]] == ["record.clock"]


@pytest.mark.parametrize(
    ("headings", "level"),
    [
        ("time,Force,2Z+ [g],Acc 3Z+", "info"),
        ("time,Hammer 1Z+ [N],Acc 2Z+ [m/s^2],vel 3Z+", "info"),
        ("time,Force,a,Acc 3Z+", "warning"),
        ("time,Force [N],strain [um/m],Acc 3Z+", "warning"),
    ],
)
def test_headings_that_state_every_quantity_are_no_warning(tmp_path: Path, headings: str, level: str) -> None:
    file = asked_of(table(tmp_path, headings, T, FORCE, ONE, TWO), {"band_hz": (1.0, 50.0)})
    assert [(one.code, one.level) for one in read_asked(file)[0][1]][1:] == [("record.headings", level)]


def test_the_rate_is_told_with_its_source(tmp_path: Path) -> None:
    plain = table(tmp_path, "a,b", ONE, TWO)
    stated = tmp_path / "stated.csv"
    stated.write_text("Sample rate: 40 Hz\n" + plain.read_text())
    told = read_asked(asked_of(stated, {"band_hz": (1.0, 10.0)}))[0][1][0]
    assert (told.facts["rate"], told.facts["source"]) == (40.0, "stated in the file")
    assert told.facts["samples"] == len(ONE)
    assert told.facts["seconds"] == pytest.approx(len(ONE) / 40.0)
    told = read_asked(asked_of(plain, {"band_hz": (1.0, 10.0), "sampling_hz": 64.0}))[0][1][0]
    assert (told.facts["rate"], told.facts["source"]) == (64.0, "stated in the settings")


def test_a_rate_in_the_header_that_the_times_contradict_is_told(tmp_path: Path) -> None:
    plain = table(tmp_path, "time,a,b", T, ONE, TWO)
    rate = (len(T) - 1) / float(T[-1] - T[0])
    headed = tmp_path / "headed.csv"
    headed.write_text(f"Sample rate: {2.0 * rate:g} Hz\n" + plain.read_text())
    record, (notice,) = read_record_told(headed)
    assert record.even_hz == pytest.approx(rate)
    check_shown("record.rate, header and times", notice)
    headed.write_text(f"Sample rate: {1.004 * rate:g} Hz\n" + plain.read_text())
    assert read_record_told(headed)[1] == ()


# ----------------------------------------------------------------------------------------------------
# Times.


@pytest.mark.parametrize(
    ("times", "name", "words"),
    [
        ({10: T[9]}, "record.times, repeated", "the time of sample 11 is that of the sample before it: 0.045 s"),
        ({10: 0.02}, "record.times, back", "the time of sample 11 goes back from 0.045 s to 0.02 s"),
        ({10: np.nan}, "record.times, not a number", "the time of sample 11 is not a number: nan"),
    ],
)
def test_times_that_do_not_increase_are_told_with_their_line_and_values(
    tmp_path: Path, times: dict[int, float], name: str, words: str
) -> None:
    wrong = T.copy()
    for at, value in times.items():
        wrong[at] = value
    path = table(tmp_path, "# a line of words\ntime,a,b", wrong, ONE, TWO)
    with pytest.raises(FemtuneError) as error:
        read_record(path)
    assert error.value.what == words
    assert error.value.where is not None
    assert (error.value.where.file, error.value.where.line) == (str(path), 13)
    error.value.where = None
    check_shown(name, error.value)


def test_an_infinite_sample_is_told_with_its_line(tmp_path: Path) -> None:
    wrong = TWO.copy()
    wrong[[20, 30]] = np.inf
    with pytest.raises(FemtuneError, match="the first of them in sample 21") as error:
        read_record(table(tmp_path, "time,a,b", T, ONE, wrong))
    assert error.value.where is not None
    assert error.value.where.line == 22


def test_a_force_that_is_zero_and_a_band_whose_limits_are_exchanged_are_told(tmp_path: Path) -> None:
    path = table(tmp_path, "time,force [N],acc [g]", T, 0.0 * FORCE, ONE)
    ((record, _),) = read_asked(asked_of(path, {"band_hz": (1.0, 50.0)}))
    with pytest.raises(FemtuneError, match="the force is zero or constant") as error:
        check_usable(record)
    check_shown("record.dead, force", error.value)
    with pytest.raises(FemtuneError, match="the limits of the band are exchanged") as error:
        asked_of(path, {"band_hz": (50.0, 1.0)})
    error.value.where = None
    check_shown("identify.record-band, exchanged", error.value)
    with pytest.raises(FemtuneError, match="the band is empty"):
        asked_of(path, {"band_hz": (50.0, 50.0)})


@pytest.mark.parametrize("heading", [",a,b", "X_Value,a,b", ""])
@pytest.mark.parametrize("start", [0.0, 17.25])
def test_times_without_a_name(tmp_path: Path, heading: str, start: float) -> None:
    check(read_record(table(tmp_path, heading, np.round(start + T, 4), ONE, TWO)), [ONE, TWO])


def test_a_count_of_samples_is_no_time(tmp_path: Path) -> None:
    path = table(tmp_path, "", np.arange(1.0, 65.0), ONE, TWO)
    with pytest.raises(FemtuneError, match="neither a sampling rate nor times"):
        read_record(path)
    check(read_record(path, sampling_hz=200.0), [ONE, TWO])
    # columns that are given by number are counted as they stand in the file
    check(read_record(path, [ChannelColumn(3, Dof(1, "Z"))], sampling_hz=200.0), [TWO])


def test_signals_are_no_times(tmp_path: Path) -> None:
    found = read_record(table(tmp_path, "", np.cumsum(np.abs(FORCE)), ONE), sampling_hz=200.0)
    assert len(found) == 2
    np.save(tmp_path / "a.npy", np.vstack([T, ONE, TWO]).T)
    check(read_record(tmp_path / "a.npy"), [ONE, TWO])


STAMPS = {
    "iso": [f"2024-05-03T12:00:{t:09.6f}" for t in 30.0 + T],
    "zone": [f"2024-05-03T12:00:{t:06.3f}+02:00" for t in T],
    "blank": [f"2024-05-03 12:00:{t:09.6f}" for t in T],
    "two columns": [f"03.05.2024,12:00:{t:09.6f}" for t in T],
    "time of day": [f"9:05:{t:06.3f}" for t in T],
    "midnight": [f"23:59:{59.9 + t:06.3f}" if 59.9 + t < 59.9999 else f"00:00:{t - 0.1:06.3f}" for t in T],
    "dates at midnight": [
        f"2024-02-28T23:59:{59.9 + t:06.3f}" if 59.9 + t < 59.9999 else f"2024-02-29T00:00:{t - 0.1:06.3f}" for t in T
    ],
}


@pytest.mark.parametrize("kind", STAMPS)
def test_dates_and_times_of_day(tmp_path: Path, kind: str) -> None:
    heading = "date,time,a,force" if kind == "two columns" else "stamp,a,force"
    found = read_record(table(tmp_path, heading, STAMPS[kind], ONE, TWO))
    check(found, [ONE, TWO])
    assert [c.name for c in found.channels] == ["a", "force"]


def test_dates_with_decimal_commas(tmp_path: Path) -> None:
    stamps = [f"12:00:{t:06.3f}".replace(".", ",") for t in T]
    text = "\n".join(["Zeit;a;b", *(f"{s};{a:.9g};{b:.9g}".replace(".", ",") for s, a, b in zip(stamps, ONE, TWO))])
    (tmp_path / "r.csv").write_text(text)
    check(read_record(tmp_path / "r.csv"), [ONE, TWO])


def test_gaps_have_a_place_and_a_size(tmp_path: Path) -> None:
    kept = np.r_[0:20, 45:64]
    found = read_record(table(tmp_path, "time,a", T[kept], ONE[kept]))
    with pytest.raises(FemtuneError) as caught:
        assert found.even_hz
    assert caught.value.code == "record.uneven"
    assert caught.value.values["longest step"] == "0.13 s after 0.095 s (sample 20)"
    values = ONE.copy()
    values[10:14] = np.nan
    holed = read_record(table(tmp_path, "time,a,b", T, TWO, values))
    with pytest.raises(FemtuneError) as caught:
        no_lost_samples(holed)
    assert caught.value.values["first gap"] == "b: 4 samples from 0.05 s"


def test_no_rate_of_a_test(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"acc": np.vstack([ONE, TWO]).T, "fs": 1e308})
    with pytest.raises(FemtuneError) as caught:
        read_record(tmp_path / "a.mat")
    assert caught.value.code == "record.rate"


def test_a_rate_that_leaves_no_line_in_the_band(tmp_path: Path) -> None:
    """1e9 Hz in place of 1e3: a message at once, before anything is filtered."""
    np.save(tmp_path / "a.npy", RNG.standard_normal((2, 6000)))
    file = asked_of(tmp_path / "a.npy", {"band_hz": (1.0, 30.0), "sampling_hz": 1e9})
    with pytest.raises(FemtuneError) as caught:
        check_length(read_asked(file)[0][0], Operational((1.0, 30.0)), file)
    assert caught.value.code == "identify.short-record"


# ----------------------------------------------------------------------------------------------------
# An array for each channel, a file for each function.


@pytest.mark.parametrize("column", [True, False])
def test_an_array_for_each_channel(tmp_path: Path, column: bool) -> None:
    shape = (-1, 1) if column else (-1,)
    arrays = {"time": T.reshape(shape), "force": FORCE.reshape(shape), "acc_2Z": ONE.reshape(shape)}
    savemat(tmp_path / "a.mat", {**arrays, "note": "hello"})
    np.savez(tmp_path / "a.npz", **{**arrays, "fs": np.array(200.0)})
    for name in ("a.mat", "a.npz"):
        found = read_record(tmp_path / name)
        check(found, [FORCE, ONE])
        assert [(c.name, c.role) for c in found.channels] == [("force", "input"), ("acc_2Z", "response")]


def test_times_beside_a_table(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"t": T, "acc": np.vstack([ONE, TWO]).T})
    check(read_record(tmp_path / "a.mat"), [ONE, TWO])
    savemat(tmp_path / "b.mat", {"dt": 1 / 200.0, "acc": np.vstack([ONE, TWO]).T})
    check(read_record(tmp_path / "b.mat"), [ONE, TWO])


def test_a_file_for_each_function(tmp_path: Path) -> None:
    hz = 1.0 + np.arange(9.0)
    values = RNG.standard_normal((2, 9)) + 1j * RNG.standard_normal((2, 9))
    paths = [table(tmp_path, "hz,re,im", hz, v.real, v.imag, name=f"h{i}.csv") for i, v in enumerate(values)]
    functions = tuple(FunctionColumn(Dof(i + 1, "Z"), Dof(1, "Z"), "re", "im") for i in range(2))
    layout = FunctionLayout("mobility", functions=functions, frequency="hz", factor=2.0)
    found = read_function_files(paths, layout)
    assert found.values[:, 0] == pytest.approx(2.0 * values, rel=1e-8)
    assert (found.kind, found.responses.labels()) == ("mobility", ["1Z+", "2Z+"])
    other = table(tmp_path, "hz,re,im", hz + 0.5, values[1].real, values[1].imag, name="h1.csv")
    with pytest.raises(FemtuneError, match="frequency lines"):
        read_function_files([paths[0], other], layout)
    savemat(tmp_path / "h.mat", {"H11": values[0], "H21re": values[1].real, "H21im": values[1].imag, "f": hz})
    arrays = (
        FunctionColumn(Dof(1, "Z"), Dof(1, "Z"), "H11"),
        FunctionColumn(Dof(2, "Z"), Dof(1, "Z"), "H21re", "H21im"),
    )
    named = read_frfs(tmp_path / "h.mat", FunctionLayout("mobility", functions=arrays, frequency="f"))
    assert named.values[:, 0] == pytest.approx(values)
    assert named.freq_hz == pytest.approx(hz)


# ----------------------------------------------------------------------------------------------------
# LabVIEW.


def lvm(
    x_columns: str = "One", *, comma: bool = False, separator: str = "Tab", units: str = "N\tg", steps: str = ""
) -> str:
    mark = "\t" if separator == "Tab" else ","
    step = steps or "5.0E-3\t5.0E-3"
    general = [
        "LabVIEW Measurement", "Writer_Version\t2", f"Separator\t{separator}", "Multi_Headings\tNo",
        f"Decimal_Separator\t{',' if comma else '.'}", f"X_Columns\t{x_columns}", "Time_Pref\tRelative",
        "Date\t2024/05/03", "Time\t12:00:00.125", "***End_of_Header***\t", "\t",
    ]  # fmt: skip
    gap = "\t\t" if x_columns == "Multi" else "\t"
    header = [
        "Channels\t2", f"Samples\t64{gap}64", f"Y_Unit_Label\t{units.replace(chr(9), gap)}",
        f"X_Dimension\tTime{gap}Time", f"X0\t0.0E+0{gap}0.0E+0", f"Delta_X\t{step.replace(chr(9), gap)}",
        "***End_of_Header***\t\t",
    ]  # fmt: skip
    names = {"One": "Hammer\tTop\tComment", "No": "Hammer\tTop\tComment", "Multi": "Hammer\tX_Value\tTop\tComment"}
    cells = {
        "One": [f"{t:.6f}\t{a:.9f}\t{b:.9f}" for t, a, b in zip(T, FORCE, ONE)],
        "No": [f"\t{a:.9f}\t{b:.9f}" for a, b in zip(FORCE, ONE)],
        "Multi": [f"{t:.6f}\t{a:.9f}\t{t:.6f}\t{b:.9f}" for t, a, b in zip(T, FORCE, ONE)],
    }[x_columns]
    body = [row.replace(".", ",") if comma else row for row in cells]
    head = [line.replace(".", ",") if comma and line.startswith(("Delta", "X0")) else line for line in header]
    return "\n".join([*general, *head, f"X_Value\t{names[x_columns]}", *body, ""]).replace("\t", mark)


@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
@pytest.mark.parametrize(("comma", "separator"), [(False, "Tab"), (True, "Tab"), (False, "Comma")])
def test_labview_text(tmp_path: Path, x_columns: str, comma: bool, separator: str) -> None:
    path = tmp_path / "a.lvm"
    path.write_text(lvm(x_columns, comma=comma, separator=separator))
    found = read_record(path)
    check(found, [FORCE, G * ONE])
    assert [(c.name, c.role, c.quantity) for c in found.channels] == [
        ("Hammer", "input", "force"), ("Top", "response", "acceleration"),
    ]  # fmt: skip


def test_labview_text_that_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    whole = lvm()
    header = whole.index("Channels")
    for text in (
        whole[:100],
        lvm(steps="0\t0"),
        whole + whole[header:].replace("Top", "Bottom"),
        whole.replace("Channels\t2", "Channels\tx"),
        whole.replace(f"{FORCE[7]:.9f}", "1.2x"),
        whole[: whole.rindex("\t")],
        whole[: whole.index(f"{T[40]:.6f}\t")],
    ):
        path.write_text(text)
        with pytest.raises(FemtuneError) as caught:
            read_record(path)
        assert caught.value.code.startswith("record.")


def test_labview_text_without_an_empty_column(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    path.write_text("\n".join(line.removeprefix("\t") for line in lvm("No").split("\n")))
    check(read_record(path), [FORCE, G * ONE])


def test_units_that_are_no_motion(tmp_path: Path) -> None:
    """A pressure beside a force is no acceleration."""
    path = tmp_path / "a.lvm"
    path.write_text(lvm(units="N\tpsi"))
    assert [c.quantity for c in read_record(path).channels] == ["force", "pressure"]
    path.write_text(lvm(units="N\tdegC"))
    assert [c.quantity for c in read_record(path).channels] == ["force", "unknown"]


def test_labview_text_without_header(tmp_path: Path) -> None:
    check(read_record(table(tmp_path, "", T, ONE, TWO, separator="\t", name="a.lvm")), [ONE, TWO])


def test_channels_without_numbers_are_none(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    path.write_text(re.sub(r"^(\d.*\t)[-\d.]+$", r"\1", lvm(), flags=re.MULTILINE))
    assert [c.name for c in read_record(path).channels] == ["Hammer"]


def segment(begin: str, first: float, rows: slice, step: str = "0.005") -> str:
    header = [
        "Channels\t2\t", f"Samples\t{rows.stop - rows.start}\t{rows.stop - rows.start}\t",
        f"Date\t{begin[:10]}\t{begin[:10]}\t", f"Time\t{begin[11:]}\t{begin[11:]}\t", "Y_Unit_Label\tN\tg\t",
        f"X0\t{first}\t{first}\t", f"Delta_X\t{step}\t{step}\t", "***End_of_Header***\t\t\t",
        "X_Value\tHammer\tTop\tComment",
    ]  # fmt: skip
    cells = zip(T[: rows.stop - rows.start], FORCE[rows], ONE[rows])
    return "\n".join([*header, *(f"{first + t:.6f}\t{a:.9f}\t{b:.9f}\tok" for t, a, b in cells), "", ""])


GENERAL = "LabVIEW Measurement\t\nSeparator\tTab\nMulti_Headings\tYes\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
SEGMENTS = "".join(segment("2024/05/03 12:00:00.125", 0.0, slice(32 * k, 32 * k + 32)) for k in (0, 1))


@pytest.mark.parametrize(
    ("begins", "firsts", "gap_s"),
    [
        (("2024/05/03 12:00:00.125", "2024/05/03 12:00:00.285"), (0.0, 0.0), 0.0),
        (("2024/05/03 12:00:00.125", "2024/05/03 12:00:00.125"), (0.0, 0.16), 0.0),
        (("2024/05/03 23:59:59,9", "2024/05/04 00:00:01,9"), (0.0, 0.0), 1.84),
        (("2024/05/03 12:00:00.125", "2024/05/03 12:00:00.125"), (0.0, 0.0), 0.005),
        (("1903/12/31 19:00:00", "1903/12/31 19:00:05"), (0.0, 0.0), 0.005),
    ],
)
def test_segments_follow_by_their_times(
    tmp_path: Path, begins: tuple[str, str], firsts: tuple[float, float], gap_s: float
) -> None:
    """One signal, a gap, or a distance that is not known."""
    path = tmp_path / "a.lvm"
    parts = [segment(begin, first, rows) for begin, first, rows in zip(begins, firsts, (slice(0, 32), slice(32, 64)))]
    path.write_text(GENERAL + "".join(parts))
    found, told = read_record_told(path)
    assert found.values == pytest.approx(np.array([FORCE, G * ONE]), rel=1e-6, abs=1e-8)
    steps = np.diff(found.time_s)
    assert steps[31] == pytest.approx(0.005 + gap_s, abs=1e-7)
    assert np.delete(steps, 31) == pytest.approx(0.005, abs=1e-7)
    untimed = [notice for notice in told if notice.code == "record.segments-untimed"]
    assert bool(untimed) == (gap_s == 0.005)
    if untimed:
        check_shown("record.segments-untimed", untimed[0])


def test_times_in_the_table_are_more_exact_than_a_rounded_step(tmp_path: Path) -> None:
    """3000 Hz: a step of 0.000333 is 3003 Hz."""
    path = tmp_path / "a.lvm"
    times, count = np.arange(4000) / 3000.0, 4000
    values = RNG.standard_normal((2, count))
    header = lvm(steps="0.000333\t0.000333").split("X_Value")[0].replace("64", str(count))
    rows = [f"{t:.6f}\t{a:.6f}\t{b:.6f}" for t, a, b in zip(times, *values)]
    path.write_text(header + "\n".join(["X_Value\tHammer\tTop\tComment", *rows, ""]))
    found, told = read_record_told(path)
    assert found.sampling_hz == pytest.approx(3000.0, rel=1e-6)
    assert not told
    rows = ["\t" + row.partition("\t")[2] for row in rows]
    path.write_text(
        header.replace("X_Columns\tOne", "X_Columns\tNo") + "\n".join(["X_Value\ta\tb\tComment", *rows, ""])
    )
    rounded, told = read_record_told(path)
    assert rounded.sampling_hz == pytest.approx(1.0 / 0.000333)
    check_shown("record.rate, rounded", told[0])
    assert read_record(path, sampling_hz=3000.0).sampling_hz == 3000.0


def test_uneven_times_of_a_table_are_not_overruled_by_the_step(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    times = np.cumsum(0.005 + 0.002 * RNG.random(64))
    head, *rows = lvm().split("Comment\n")[1].split("\n"), *()
    rows = [f"{t:.6f}\t" + row.partition("\t")[2] for t, row in zip(times, [r for r in head if r])]
    path.write_text(lvm().split("Comment\n")[0] + "Comment\n" + "\n".join([*rows, ""]))
    with pytest.raises(FemtuneError) as caught:
        assert read_record(path).even_hz
    assert caught.value.code == "record.uneven"


def test_slower_channels_have_a_clock_of_their_own(tmp_path: Path) -> None:
    """A temperature in the rows of each second, beside accelerations."""
    path = tmp_path / "a.lvm"
    head, rows = lvm(steps="5.0E-3\t0.16").replace("Top\tComment", "Heat\tComment").split("Comment\n")
    table = [row for row in rows.split("\n") if row]
    slow = [row if i % 32 == 0 else row.rpartition("\t")[0] + "\t" for i, row in enumerate(table)]
    path.write_text(head + "Comment\n" + "\n".join([*slow, ""]))
    with pytest.raises(FemtuneError) as caught:
        read_record(path)
    check_shown("record.clocks", str(caught.value).replace(str(path), "a.lvm"))
    (name,) = [name.strip("'") for name, words in caught.value.values.items() if "Hammer" in str(words)]
    check(read_record(path, variable=name), [FORCE])
    heat = read_record(path, [ChannelColumn("Heat", Dof(1, "Z"))])
    check(heat, [ONE[::32]], 6.25)
    with pytest.raises(FemtuneError) as caught:
        read_record(path, variable="201 Hz")
    check_shown("record.variable, group", str(caught.value).replace(str(path), "a.lvm"))


# ----------------------------------------------------------------------------------------------------
# Files of loggers with several groups: TDMS by its library, MDF, whose files another program has written.


def write_tdms(path: Path, **channels: tuple[np.ndarray, dict[str, object]]) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    with nptdms.TdmsWriter(path) as writer:
        objects = [nptdms.ChannelObject("run", name, *of) for name, of in channels.items()]
        writer.write_segment(objects)


def even(unit: str, step_s: float = 0.005) -> dict[str, object]:
    return {"wf_increment": step_s, "wf_samples": 64, "unit_string": unit}


def test_labview_text_with_a_plain_table(tmp_path: Path) -> None:
    heading = lvm().split("Channels")[0] + "Time\tHammer\tTop"
    path = table(tmp_path, heading, T, FORCE, ONE, separator="\t", name="a.lvm")
    check(read_record(path), [FORCE, ONE])


def test_tdms(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.tdms"
    write_tdms(path, **{"Hammer": (FORCE, even("N")), "Acc 2Z+": (ONE, even("g")), "note": (np.array(["a", "b"]), {})})
    found = read_record(path)
    check(found, [FORCE, G * ONE])
    assert [c.role for c in found.channels] == ["input", "response"]
    whole = path.read_bytes()
    for cut in (60, len(whole) - 8, len(whole) - 8 * len(T)):
        path.write_bytes(whole[:cut])
        with pytest.raises(FemtuneError):
            read_record(path)
    # the library's log is ours: nothing is shown
    assert capfd.readouterr() == ("", "")


def test_times_in_tdms(tmp_path: Path) -> None:
    stamps = np.datetime64("2024-05-03T12:00:00") + (1e6 * T).astype("timedelta64[us]")
    for name, times in (("Time", T), ("stamps", stamps)):
        write_tdms(tmp_path / "a.tdms", **{name: (times, {}), "acc": (ONE, {"unit_string": "g"})})
        check(read_record(tmp_path / "a.tdms"), [G * ONE])


def test_clocks_in_tdms(tmp_path: Path) -> None:
    path = tmp_path / "a.tdms"
    write_tdms(path, acc=(ONE, even("g")), heat=(TWO[:10], even("degC", 1.0)))
    with pytest.raises(FemtuneError) as caught:
        read_record(path)
    assert set(caught.value.values) == {"'run, 200 Hz'", "'run, 1 Hz'"}
    check(read_record(path, variable="run, 200 Hz"), [G * ONE])
    check(read_record(path, [ChannelColumn("acc", Dof(1, "Z"))]), [ONE])


def test_a_size_in_tdms_is_not_trusted(tmp_path: Path) -> None:
    """A count of 2^50 values, or a text of 4 GB, in a file of some hundred bytes."""
    path = tmp_path / "a.tdms"
    write_tdms(path, acc=(ONE, even("g")))
    whole = path.read_bytes()
    count = np.uint64(64).tobytes()
    assert whole.count(count) == 1
    # a count of values, and the length of a text
    long_text = whole.replace(b"\x0c\x00\x00\x00wf_increment", b"\xf0\xff\xff\xffwf_increment")
    assert long_text != whole
    for content in (whole.replace(count, np.uint64(2**50).tobytes()), long_text):
        path.write_bytes(content)
        tracemalloc.start()
        with pytest.raises(FemtuneError) as caught:
            read_record(path)
        assert tracemalloc.get_traced_memory()[1] < 1e8
        tracemalloc.stop()
        assert caught.value.code.startswith("record.")


def test_tdms_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (tmp_path / "a.tdms").write_bytes(b"TDSm")
    with pytest.raises(FemtuneError, match=r"femtune\[tdms\]"):
        read_record(tmp_path / "a.tdms")


def write_mdf(path: Path, *groups: dict[str, tuple[np.ndarray, str]], compression: int = 0, **signal: object) -> None:
    """By asammdf: each group with its own times."""
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    with asammdf.MDF(version="4.10") as file:
        for number, group in enumerate(groups):
            times = np.arange(len(next(iter(group.values()))[0])) / (200.0 if number == 0 else 2.0)
            signals = [asammdf.Signal(v, times, name=n, unit=u, **signal) for n, (v, u) in group.items()]
            file.append(signals, acq_name=f"group {number}")
        file.save(path, overwrite=True, compression=compression)


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_mdf(tmp_path: Path, compression: int) -> None:
    """Reals and integers of several sizes and byte orders, plain, compressed, and transposed before that."""
    counts = np.arange(64) * 1000 - 32_000
    channels = {
        "Hammer": (FORCE, "N"), "Acc 2Z+": (ONE.astype(np.float32), "g"), "a": (counts.astype(np.int16), ""),
        "b": (np.arange(64).astype(np.uint8), ""), "c": (counts.astype(">i4"), ""), "d": (TWO.astype(">f8"), "m/s^2"),
    }  # fmt: skip
    write_mdf(tmp_path / "a.mf4", channels, compression=compression)
    found = read_record(tmp_path / "a.mf4")
    check(found, [FORCE, G * ONE, counts, np.arange(64), counts, TWO])
    assert [(c.name, c.role) for c in found.channels[:2]] == [("Hammer", "input"), ("Acc 2Z+", "response")]


def test_conversions_of_mdf(tmp_path: Path) -> None:
    kinds: dict[str, tuple[dict[str, object], np.ndarray]] = {
        "line": ({"a": 0.5, "b": -3.0}, 0.5 * np.arange(64.0) - 3.0),
        "quotient": ({"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0}, 0.5 * np.arange(64.0) + 0.25),
        "table": (
            {"raw_0": 0, "raw_1": 32, "phys_0": 1.0, "phys_1": 3.0, "interpolation": True},
            np.interp(np.arange(64.0), [0, 32], [1.0, 3.0]),
        ),
    }
    for name, (conversion, expected) in kinds.items():
        write_mdf(tmp_path / "a.mf4", {name: (np.arange(64, dtype=np.uint16), "")}, conversion=conversion)
        check(read_record(tmp_path / "a.mf4"), [expected])
    write_mdf(tmp_path / "a.mf4", {"x": (np.arange(64, dtype=np.uint16), "")}, conversion={"formula": "X1*2"})
    with pytest.raises(FemtuneError, match="no channels"):
        read_record(tmp_path / "a.mf4")


def test_groups_of_mdf(tmp_path: Path) -> None:
    path = tmp_path / "a.mf4"
    write_mdf(path, {"acc": (ONE, "g")}, {"heat": (TWO[:8], "degC")})
    with pytest.raises(FemtuneError) as caught:
        read_record(path)
    assert caught.value.code == "record.clocks"
    assert caught.value.values["'group 1'"] == "8 samples at 2 Hz: heat"
    check(read_record(path, variable="group 0"), [G * ONE])


def blocks_of_mdf(
    times: bool = True, cycles: int = 64, bits: int = 16, data: str = "DT", formula: bool = False
) -> bytes:
    """An MDF file by hand: 16-bit integers with a bit of validity; `data` is the block in which they are."""
    raw = b"".join(struct.pack("<hhB", i - 32, 0, 8 * (i == 5)) for i in range(64))
    packed = zlib.compress(raw)
    blocks: list[tuple[bytes, list[str], bytes]] = [
        (b"HD", ["DG", "", "", "", "", ""], bytes(32)),
        (b"DG", ["", "CG", data, ""], struct.pack("<B7x", 0)),
        (b"CG", ["", "CN", "", "", "", ""], struct.pack("<QQHH4xII", 0, cycles, 0, 0, 4, 1)),
        (b"CN", ["", "", "TX", "", "CC", "", "", ""], struct.pack("<BBBBIIII", 0, 0, 2, 0, 0, bits, 2, 3) + bytes(48)),
        (b"TX", [], b"12Z+ [g]\0"),
        (b"CC", ["", "", "", ""], struct.pack("<BBHHHddd d", 3 if formula else 1, 0, 0, 0, 2, 0.0, 0.0, 1.0, 0.5)),
        (b"DT", [], raw),
        (b"HL", ["DL"], bytes(8)),
        (b"DL", ["", "DZ"], struct.pack("<B3xI", 0, 1)),
        (b"DZ", [], struct.pack("<2sBxIQQ", b"DT", 0, 0, len(raw), len(packed)) + packed),
    ]
    if times:
        blocks[3][1][0] = "CN2"
        blocks.append(
            (b"CN", ["", "", "TX", "", "CC2", "", "", ""], struct.pack("<BBBBIIII", 3, 1, 0, 0, 0, 0, 0, 0) + bytes(48))
        )
        blocks.append((b"CC", ["", "", "", ""], struct.pack("<BBHHHddd d", 1, 0, 0, 0, 2, 0.0, 0.0, 7.0, 0.005)))
    places, at = dict[str, int](), 64
    names = ["HD", "DG", "CG", "CN", "TX", "CC", "DT", "HL", "DL", "DZ", "CN2", "CC2"]
    for name, (_, links, body) in zip(names, blocks):
        places[name] = at
        at += -(-(24 + 8 * len(links) + len(body)) // 8) * 8
    out = b"MDF     4.10    femtune " + bytes(4) + struct.pack("<H", 410) + bytes(34)
    for kind, links, body in blocks:
        length = 24 + 8 * len(links) + len(body)
        to = struct.pack(f"<{len(links)}Q", *(places[link] if link else 0 for link in links))
        out += (b"##" + kind + bytes(4) + struct.pack("<QQ", length, len(links)) + to + body).ljust(
            -(-length // 8) * 8, b"\0"
        )
    return out


@pytest.mark.parametrize("data", ["DT", "HL", "DL", "DZ"])
def test_mdf_with_virtual_times_and_samples_that_are_not_valid(tmp_path: Path, data: str) -> None:
    path = tmp_path / "a.mf4"
    path.write_bytes(blocks_of_mdf(data=data))
    found = read_record(path)
    expected = G * (1.0 + 0.5 * (np.arange(64.0) - 32.0))
    expected[5] = np.nan
    assert found.values == pytest.approx(expected[None], nan_ok=True)
    assert (found.sampling_hz, found.t0_s, str(found.channels[0].dof)) == (pytest.approx(200.0), 7.0, "12Z+")
    path.write_bytes(blocks_of_mdf(times=False, data=data))
    with pytest.raises(FemtuneError) as caught:
        read_record(path)
    assert caught.value.code == "record.no-rate"
    assert read_record(path, sampling_hz=200.0).samples == 64


def test_formulas_of_mdf_are_not_evaluated(tmp_path: Path) -> None:
    path = tmp_path / "a.mf4"
    path.write_bytes(blocks_of_mdf(formula=True))
    with pytest.raises(FemtuneError) as caught:
        read_record(path)
    check_shown("record.file, no channels", str(caught.value).replace(str(path), "a.mf4"))
    (table,) = [group.table for group in read_mdf(path)]
    assert not table.names
    check_shown("record.left-out", table.notices[0])


@pytest.mark.parametrize(
    "content",
    [
        b"MDF     4.10",
        blocks_of_mdf(cycles=2**60),
        blocks_of_mdf(cycles=65),
        blocks_of_mdf(bits=40),
        blocks_of_mdf(data="DG"),
        blocks_of_mdf()[:700],
        blocks_of_mdf().replace(b"MDF     ", b"UnFinMF "),
        blocks_of_mdf().replace(b"MDF     ", b"MD      "),
    ],
)
def test_damaged_mdf(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.MF4").write_bytes(content)
    with pytest.raises(FemtuneError) as caught:
        read_record(tmp_path / "a.MF4")
    assert caught.value.code in ("record.file", "record.too-large")


@pytest.mark.parametrize("name", ["a.txt", "a.dat", "a"])
def test_the_first_bytes_tell_the_format(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(lvm())
    check(read_record(tmp_path / name), [FORCE, G * ONE])
    (tmp_path / name).write_bytes(blocks_of_mdf())
    assert read_record(tmp_path / name).samples == 64


def test_mdf_of_version_3(tmp_path: Path) -> None:
    path = tmp_path / "a.mdf"
    path.write_bytes(blocks_of_mdf().replace(struct.pack("<H", 410), struct.pack("<H", 330), 1))
    with pytest.raises(FemtuneError) as caught:
        read_record(path)
    check_shown("record.format, mdf", str(caught.value).replace(str(path), "a.mdf"))


def test_a_compressed_block_of_mdf_does_not_fill_the_memory(tmp_path: Path) -> None:
    """A megabyte that inflates to a gigabyte, with the size stated as it is or not."""
    packed = zlib.compress(bytes(2**30), 9)
    plain = blocks_of_mdf(cycles=2**30 // 5)
    at = plain.index(b"##DT")
    for stated in (2**30, 320):
        block = struct.pack("<2sBxIQQ", b"DT", 0, 0, stated, len(packed)) + packed
        header = b"##DZ" + bytes(4) + struct.pack("<QQ", 24 + len(block), 0)
        # where the data were, to which the group points
        (tmp_path / "a.mf4").write_bytes(plain[:at] + header + block)
        with pytest.raises(FemtuneError) as caught:
            read_record(tmp_path / "a.mf4")
        assert caught.value.code in ("record.file", "record.too-large")
