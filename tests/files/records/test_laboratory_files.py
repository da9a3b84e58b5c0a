"""What laboratories hand over: headings with units, unnamed times, dates, LabVIEW, an array for each channel."""

from __future__ import annotations

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
)
from femtune.files.records.headings import stated_channel
from femtune.identification.averaging import no_lost_samples
from femtune.identification.operational import Operational
from femtune.modal import TimeSeries
from femtune.steps.identify.from_record import heading_notices, read_asked
from femtune.steps.identify.request import asked_of, check_length
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
    (notice,) = heading_notices(*read_asked(file), file)
    check_shown("record.headings", notice)
    quiet = asked_of(table(tmp_path, "time,a,b", T, ONE, TWO), {"band_hz": (1.0, 50.0)})
    assert not list(heading_notices(*read_asked(quiet), quiet))


# ----------------------------------------------------------------------------------------------------
# Times.


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
        check_length(*read_asked(file), Operational((1.0, 30.0)), file)
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
        lvm(steps="5.0E-3\t1.0E-3"),
        lvm(steps="0\t0"),
        whole + whole[header:],
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


def test_tdms(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    path = tmp_path / "a.tdms"
    with nptdms.TdmsWriter(path) as writer:
        properties = {"wf_increment": 0.005, "wf_samples": len(T)}
        writer.write_segment([
            nptdms.ChannelObject("run", "Hammer", FORCE, {**properties, "unit_string": "N"}),
            nptdms.ChannelObject("run", "Acc 2Z+", ONE, {**properties, "unit_string": "g"}),
        ])  # fmt: skip
    found = read_record(path)
    check(found, [FORCE, G * ONE])
    assert [c.role for c in found.channels] == ["input", "response"]
    whole = path.read_bytes()
    for cut in (60, len(whole) - 8, len(whole) - 8 * len(T)):
        path.write_bytes(whole[:cut])
        with pytest.raises(FemtuneError):
            read_record(path)


@pytest.mark.parametrize("name", ["a.mf4", "A.MDF"])
def test_mdf_files_are_refused_with_the_way_out(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"MDF     4.10")
    with pytest.raises(FemtuneError, match="export the record"):
        read_record(tmp_path / name)


def test_tdms_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (tmp_path / "a.tdms").write_bytes(b"TDSm")
    with pytest.raises(FemtuneError, match="npTDMS"):
        read_record(tmp_path / "a.tdms")
