"""The run folder: what is written is read back; what is damaged is refused with its place."""

from __future__ import annotations

import io
import json
import os
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune
from femtune.errors import FemtuneError
from femtune.files import whole_file
from femtune.steps.migration import is_known
from femtune.steps.results import SCHEMA_VERSION, Results
from femtune.steps.run_folder import check_writable, read_results, write_results

_FILE = {"path": "study.toml", "sha256": "0" * 64}
_PROVENANCE = {
    "femtune_version": "0.1.0", "started_at": "2026-01-02T03:04:05+00:00", "command": "femtune run study.toml",
    "study_file": _FILE, "input_files": [_FILE], "python_version": "3.11", "numpy_version": "2.0",
    "scipy_version": "1.14", "eigen_solver": "block Lanczos",
}  # fmt: skip
_SELECTION = {
    "jacobian_key": "jacobian", "row_labels": ["f1", "f2"], "column_labels": ["k"], "singular_values": [2.0],
    "rank": 1, "rank_threshold": 1e-7, "undetermined": [], "weakly_determined": [], "correlation_key": None,
    "parameters": [],
}  # fmt: skip


def _results(**more: Any) -> Results:
    study = {"title": "Frame – größer", "units": "m-kg-s", "deck_file": "a.bdf", "configurations": ["BC"]}
    data = {"provenance": _PROVENANCE, "study": study, "selection": _SELECTION, **more}
    return Results.model_validate_json(json.dumps(data))


_QUANTIFY = {
    "configuration": "BC", "method": "perturbation", "status": "converged", "message": "converged", "ok": True,
    "estimate": "mean and covariance", "repeats": 5, "solutions": 9, "samples": 100, "covariance_error_percent": 1.0,
    "chance_error_percent": 2.0, "unexplained_percent": 0.0, "agrees": True, "outputs": [], "sentences": ["It agrees."],
    "repeats_key": None, "covariance_key": None, "cloud_key": None, "parameter_covariance_key": None,
    "parameters": [{"parameter": "root", "start": 1.0, "mean": 1.1, "sd": 0.1, "correlation": [1.0],
                    "outside_bounds": False}],
}  # fmt: skip
"""Of the first layout: its parameter has no `cosine_distance`."""

_ARRAYS = {"jacobian": np.array([[1.0], [-2.5]])}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_results(tmp_path / "run", _results(), _ARRAYS)
    return tmp_path / "run"


def _change(folder: Path, **keys: Any) -> None:
    data = json.loads((folder / "results.json").read_text("utf-8"))
    (folder / "results.json").write_text(json.dumps({**data, **keys}), "utf-8")


def _code(folder: Path) -> FemtuneError:
    with pytest.raises(FemtuneError) as caught:
        read_results(folder)
    return caught.value


def test_what_was_written_is_read_back(folder: Path) -> None:
    results, arrays = read_results(folder)
    assert results == _results()
    assert list(arrays) == ["jacobian"]
    np.testing.assert_array_equal(arrays["jacobian"], _ARRAYS["jacobian"])


def test_numpy_reads_the_archive_without_pickle(folder: Path) -> None:
    with np.load(folder / "arrays.npz", allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["jacobian"], _ARRAYS["jacobian"])


def test_only_the_two_files_are_left(folder: Path) -> None:
    assert sorted(p.name for p in folder.iterdir()) == ["arrays.npz", "results.json"]


def test_equal_results_make_equal_bytes(folder: Path, tmp_path: Path) -> None:
    write_results(tmp_path / "again", _results(), _ARRAYS)
    for name in ("results.json", "arrays.npz"):
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes()


def test_a_failure_while_renaming_keeps_the_old_results(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(whole_file.os, "replace", refuse)
    with pytest.raises(FemtuneError, match="No space left") as caught:
        write_results(folder, _results(alerts=[]), _ARRAYS)
    assert caught.value.code == "run.unwritable"
    monkeypatch.undo()
    assert read_results(folder)[0] == _results()
    assert len(list(folder.iterdir())) == 2


@pytest.mark.parametrize("write", [check_writable, lambda f: write_results(f, _results(), _ARRAYS)])
def test_a_file_in_the_place_of_the_folder_is_unwritable(tmp_path: Path, write: Any) -> None:
    (tmp_path / "run").write_text("a file")
    with pytest.raises(FemtuneError) as caught:
        write(tmp_path / "run")
    assert caught.value.code == "run.unwritable"
    assert str(tmp_path / "run") in str(caught.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_unwritable(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(FemtuneError, match="cannot be written"):
        check_writable(tmp_path)


def test_check_writable_makes_the_folder_and_leaves_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_an_empty_folder_is_no_run_folder(tmp_path: Path) -> None:
    assert _code(tmp_path).code == "run.missing"


@pytest.mark.parametrize(
    ("name", "cut"),
    [*(("results.json", cut) for cut in (0, 1, 10, 500, -2)), *(("arrays.npz", cut) for cut in (0, 10, 60, -5))],
)
def test_a_truncated_file_is_damaged(folder: Path, name: str, cut: int) -> None:
    path = folder / name
    path.write_bytes(path.read_bytes()[:cut])
    assert _code(folder).code == "run.damaged"


@pytest.mark.parametrize("text", ["[" * 100_000, "null", "3", "[]", "{}", '{"schema_version": 1}'])
def test_other_json_is_damaged(folder: Path, text: str) -> None:
    (folder / "results.json").write_text(text)
    assert _code(folder).code == "run.damaged"


def test_bytes_that_are_no_text_are_damaged(folder: Path) -> None:
    (folder / "results.json").write_bytes(b"\xff\xfe\x00{")
    assert _code(folder).code == "run.damaged"


def test_a_wrong_value_is_named_by_its_place(folder: Path) -> None:
    _change(folder, selection={**_SELECTION, "singular_values": ["two"]})
    error = _code(folder)
    assert error.code == "run.damaged"
    assert "selection.singular_values.0" in str(error)


@pytest.mark.parametrize("number", ["NaN", "Infinity"])
def test_not_a_number_is_damaged(folder: Path, number: str) -> None:
    path = folder / "results.json"
    path.write_text(path.read_text("utf-8").replace(" 2.0\n", f" {number}\n"), "utf-8")
    assert _code(folder).code == "run.damaged"


def test_an_unknown_key_is_damaged(folder: Path) -> None:
    _change(folder, surprise=1)
    assert "surprise" in str(_code(folder))


@pytest.mark.parametrize(
    ("version", "said"),
    [("3", "reads versions up to"), ("0", "which no femtune writes"), ("1.1", "which no femtune writes")],
)
def test_another_version_is_said(folder: Path, version: str, said: str) -> None:
    _change(folder, schema_version=version)
    error = _code(folder)
    assert error.code == "run.version"
    assert error.facts["version"] == version
    assert said in error.what


def _archive(folder: Path, name: str, content: bytes) -> None:
    with zipfile.ZipFile(folder / "arrays.npz", "w") as archive:
        archive.writestr(name, content)


def test_a_pickled_array_is_refused(folder: Path) -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    _archive(folder, "jacobian.npy", buffer.getvalue())
    assert _code(folder).code == "run.damaged"


def test_a_header_that_claims_too_much_is_damaged(folder: Path) -> None:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": (10**15, 1)})
    _archive(folder, "jacobian.npy", buffer.getvalue() + b"\0" * 64)
    assert _code(folder).code == "run.damaged"


def test_a_missing_array_is_named(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(FemtuneError, match="refer to arrays") as caught:
        write_results(tmp_path / "other", _results(), {})
    assert caught.value.code == "run.arrays"
    assert not (tmp_path / "other").exists()
    _archive(folder, "readme.txt", b"")
    assert _code(folder).code in {"run.arrays", "run.damaged"}


def test_an_array_of_objects_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        write_results(tmp_path, _results(), {"jacobian": np.array([{}], dtype=object)})
    assert caught.value.code == "run.arrays"


def test_arrays_that_unpack_to_more_than_memory_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("femtune.steps.run_folder.MOST_ARRAY_BYTES", 1000)
    folder = tmp_path / "run"
    write_results(folder, _results(), _ARRAYS)
    with zipfile.ZipFile(folder / "arrays.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", bytes(2000))
    with pytest.raises(FemtuneError) as caught:
        read_results(folder)
    assert caught.value.code == "run.damaged"
    assert "arrays are larger" in str(caught.value)


@pytest.fixture
def first_layout(tmp_path: Path) -> Path:
    """A run folder as femtune wrote it before records had a misfit, a ratio of standard deviations, or a distance."""
    folder = tmp_path / "first"
    shutil.copytree(Path(__file__).parent / "written_before", folder)
    data = json.loads((folder / "results.json").read_text("utf-8"))
    counts = data["update"]["residual_counts"]
    data["update"]["residual_counts"] = [{"kind": r["kind"], "count": r["count"]} for r in counts]
    for combination in data["selection"]["undetermined"] + data["selection"]["weakly_determined"]:
        del combination["sd_ratio"]
    data["quantify"] = _QUANTIFY
    (folder / "results.json").write_text(json.dumps(data), "utf-8")
    return folder


def test_results_of_the_first_layout_are_migrated(first_layout: Path, tmp_path: Path) -> None:
    text = (first_layout / "results.json").read_bytes()
    results, arrays = read_results(first_layout)
    assert results.schema_version == SCHEMA_VERSION
    assert results.update is not None
    assert results.selection is not None
    assert [(r.count > 0, r.misfit) for r in results.update.residual_counts] == [(True, None)]
    assert results.selection.undetermined[0].sd_ratio is None
    assert results.quantify is not None
    assert [p.cosine_distance for p in results.quantify.parameters] == [None]
    assert (first_layout / "results.json").read_bytes() == text
    # written again they are of the present version
    write_results(tmp_path / "again", results, arrays)
    assert read_results(tmp_path / "again")[0] == results


@pytest.mark.slow
def test_a_report_of_the_first_layout(first_layout: Path) -> None:
    page = femtune.report(first_layout)
    assert "Beam" in Path(page).read_text("utf-8")


def test_each_version_leads_to_the_next() -> None:
    last = int(SCHEMA_VERSION)
    assert [version for version in range(-1, last + 2) if is_known(str(version))] == list(range(1, last + 1))


@pytest.mark.parametrize(
    "content", [{}, {"update": 3, "selection": {"undetermined": {}}}, {"update": {"residual_counts": [1]}}]
)
def test_what_is_no_result_is_damaged_in_an_earlier_version_too(folder: Path, content: dict[str, object]) -> None:
    (folder / "results.json").write_text(json.dumps({"schema_version": "1", **content}), "utf-8")
    assert _code(folder).code == "run.damaged"


def test_results_of_an_earlier_state_still_load():
    """The files are those of a whole run, written before classes of records were renamed."""
    results, arrays = read_results(Path(__file__).parent / "written_before")
    assert results.update is not None
    assert results.selection is not None
    assert results.model is not None
    assert [c.stage for c in results.correlations] == ["before", "after", "after as written"]
    assert {p.name: round(p.value, 3) for p in results.update.parameters if p.name != "torsion"} == {
        "root": 1.3,
        "tip": 0.85,
    }
    assert [share.parameter for share in results.selection.undetermined[0].shares] == ["torsion"]
    assert results.model.deck_parameters[0].name == "GRDPNT"
    assert set(results.array_keys()) <= set(arrays)
