"""What is damaged: files of each kind, how they are read, and a second opinion on what was read.

A judge returns True where another parser, or the text itself, gives the same values, False where it gives others, and
None where it cannot read the file or finds nothing to compare.
"""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import math
import tempfile
import tomllib
import warnings
from collections.abc import Callable, Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyuff
import scipy.io
from pydantic import BaseModel
from tests.files.nastran.test_mutated_decks import OWN
from tests.files.test_deviations import bare, identified
from tests.files.test_mutated_files import AXES, DMIG, IDENTIFY, KINDS, LAYOUT, TABLE
from tests.files.uff.small_case import sample_test

import femtune as ft
from femtune.fem.fields import FieldRef
from femtune.files.deviations import deviations_text, with_deviations
from femtune.files.identification_file import read_identify_file
from femtune.files.matrices.read import read_matrix
from femtune.files.nastran import build_structure, read_deck
from femtune.files.records import read_frfs, read_record
from femtune.files.repeats_table import read_repeats_table
from femtune.files.uff import read_uff, write_uff_modes
from femtune.steps.run_folder import read_results
from femtune.testing import example_deck, example_test
from femtune.units import SI

ROOT = Path(__file__).resolve().parents[2]
Judge = Callable[[Path, Any], bool | None]


@dataclass(frozen=True)
class Kind:
    """Files of one kind.

    Parameters
    ----------
    group : row of the table
    files : by name; the first is read
    read : what femtune makes of the first
    judge : see the module
    share : mutants of this kind relative to those of the others
    deck : whether the whole way of a deck is tried, to its modes and back to a file
    """

    group: str
    files: Mapping[str, bytes]
    read: Callable[[Path], Any]
    judge: Judge
    share: int = 1
    deck: bool = False


def nothing(path: Path, found: Any) -> None:
    """There is no other parser."""


def same(found: Any, expected: Any) -> bool | None:
    """True for equal arrays up to round-off; None if there is nothing to compare."""
    a, b = np.asarray(found), np.asarray(expected)
    return None if not b.size else a.shape == b.shape and bool(np.allclose(a, b, rtol=1e-6, atol=0.0, equal_nan=True))


# ----------------------------------------------------------------------------------------------------
# Decks: pyNastran reads coordinates, materials, thicknesses and masses.


def judge_deck(path: Path, _: Any) -> bool | None:
    """The values of the fields that both have."""
    np.in1d = np.isin  # type: ignore[attr-defined]  numpy 2 lacks what pyNastran imports
    from pyNastran.bdf.bdf import BDF  # noqa: PLC0415  # type: ignore[import-not-found]

    ours = build_structure(read_deck(path))
    other = BDF(debug=None)
    try:
        # it prints, and leaves files where it runs
        with chdir(path.parent), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            other.read_bdf(path.name, xref=False, encoding="latin-1")
    except (Exception, SystemExit):
        return None
    values = dict(zip(ours.structure.values.refs, ours.structure.values.values, strict=True))
    pairs = []
    for name, key, table, attribute in (
        ("MAT1", "E", other.materials, "e"), ("MAT1", "RHO", other.materials, "rho"),
        ("PSHELL", "T", other.properties, "t"), ("CONM2", "M", other.masses, "mass"),
        ("PBAR", "A", other.properties, "A"), ("PBAR", "I1", other.properties, "i1"),
    ):  # fmt: skip
        for number, card in table.items():
            ref = FieldRef(name, number, key)
            if card.type == name and ref in values and getattr(card, attribute) is not None:
                pairs.append((values[ref], getattr(card, attribute)))
    nodes = ours.structure.nodes
    for number, card in other.nodes.items():
        if card.type == "GRID" and not card.cp and nodes.has_grid(number):
            pairs += list(zip(nodes.xyz[nodes.position(number)], card.xyz, strict=True))
    if not pairs:
        return None
    a, b = np.array(pairs, dtype=float).T
    return bool(np.allclose(a, b, rtol=1e-6, atol=1e-300))


# ----------------------------------------------------------------------------------------------------
# Universal Files: pyuff.


def read_universal(path: Path) -> Any:
    return read_uff(path, units=SI, file_units=SI)


def judge_universal(path: Path, found: Any) -> bool | None:
    """Frequencies of the modes and the values of their shapes, or the values of functions that were not converted."""
    if any(notice.code in ("uff.unit-label", "uff.byte-order", "uff.mode-numbers") for notice in found.notices):
        return None
    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except BaseException:
        return None
    sets = [sets] if isinstance(sets, dict) else sets
    modes = [s for s in sets if s.get("type") == 55 and s.get("analysis_type") == 2]
    test = found.test
    if test.modes is not None and modes and len(modes) == len(test.modes):
        if same(test.modes.freq_hz, [s["freq"] for s in modes]) is not True:
            return False
        return _same_shapes(test.modes, modes)
    functions = [s for s in sets if s.get("type") == 58 and np.iscomplexobj(s.get("data")) and _has_directions(s)]
    if len(found.frf_sets) == 1 and functions:
        frfs = found.frf_sets[0]
        ours = {complex(v) for v in np.round(frfs.values.ravel(), 12)}
        return all(abs(v) < 1e-300 or _near(v, ours) for v in functions[0]["data"][:3])
    return None


def _has_directions(one: dict[str, Any]) -> bool:
    """Without them, or over another quantity than frequency (18), a function is kept with a notice and is no FRF."""
    return one["abscissa_spec_data_type"] == 18 and all(1 <= abs(int(one[key])) <= 6 for key in ("rsp_dir", "ref_dir"))


def _near(value: complex, all_of_them: set[complex]) -> bool:
    values = np.array(list(all_of_them))
    return bool((np.abs(np.abs(values) - abs(value)) <= 1e-5 * abs(value)).any())


def _same_shapes(modes: Any, sets: list[dict[str, Any]]) -> bool | None:
    pairs = []
    for j, one in enumerate(sets):
        row = {int(n): i for i, n in enumerate(one["node_nums"])}
        for i, dof in enumerate(modes.dofs):
            column = one.get(f"r{dof.component}")
            if column is not None and dof.node in row:
                pairs.append((dof.sign * modes.shapes[i, j], column[row[dof.node]]))
    if not pairs:
        return None
    a, b = np.array(pairs).T
    return bool(np.allclose(a, b, rtol=1e-5, atol=1e-12))


# ----------------------------------------------------------------------------------------------------
# Arrays and tables: NumPy, SciPy, h5py, csv.


def judged(kind: str) -> Judge:
    """The judge of the tests, which raises AssertionError."""
    check = KINDS[kind][3]

    def judge(path: Path, found: Any) -> bool | None:
        try:
            check(path, found)
        except AssertionError:
            return False
        except Exception:
            return None
        return True

    return judge


def judge_record(load: Callable[[Path], Any], path: Path, found: Any) -> bool | None:
    """An array with channels along one of its axes."""
    try:
        expected = np.asarray(load(path), dtype=float)
    except Exception:
        return None
    values = np.asarray(found.values)
    return any(same(values, one) is True for one in (expected, expected.T, np.atleast_2d(expected)))


def judge_functions(load: Callable[[Path], Any], path: Path, found: Any) -> bool | None:
    """Functions (lines, responses) under the name H."""
    try:
        expected = np.asarray(load(path)["H"])
    except Exception:
        return None
    return bool(expected.size) and same(found.values[:, 0, :].T, expected)


def _wave(path: Path) -> Any:
    values = scipy.io.wavfile.read(path)[1]
    return values / (32768.0 if values.dtype == np.int16 else 1.0)


def _tdms(path: Path) -> None:
    """A file of LabVIEW, as its library writes it."""
    nptdms = importlib.import_module("nptdms")
    force, motion = np.random.default_rng(5).normal(size=(2, 60))
    properties = {"wf_increment": 0.005, "wf_samples": 60}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([
            nptdms.ChannelObject("run", "Hammer", force, {**properties, "unit_string": "N"}),
            nptdms.ChannelObject("run", "Acc 2Z+", motion, {**properties, "unit_string": "g"}),
        ])  # fmt: skip


def _hdf5(path: Path) -> Any:
    with h5py.File(path) as file:
        return {name: file[name][...] for name in file}


def judge_table(path: Path, found: Any) -> bool | None:
    """csv and float, for tables with commas."""
    text = path.read_text("utf-8-sig")
    rows = [row for row in csv.reader(io.StringIO(text)) if any(cell.strip() for cell in row)]
    if len(rows[0]) < 2:
        return None
    gaps = {"", "-", "nan", "na", "n/a"}
    values = [[math.nan if c.strip().lower() in gaps else float(c) for c in row] for row in rows[1:]]
    return same(found.values, values)


# ----------------------------------------------------------------------------------------------------
# Text with keys: tomllib, json.


def judge_study(path: Path, found: BaseModel) -> bool | None:
    """Every number and text of the file is in the tables that were read."""
    return _all_in(tomllib.loads(path.read_text("utf-8")), found)


def _all_in(data: Mapping[str, Any], found: Any) -> bool | None:
    compared = False
    for key, value in data.items():
        own = getattr(found, {"validate": "validation"}.get(key, key), None)
        parts = [(value, own)]
        if isinstance(value, list) and isinstance(own, tuple) and len(own) == len(value):
            parts = list(zip(value, own, strict=True))
        for one, other in parts:
            if isinstance(one, dict) and isinstance(other, BaseModel):
                if _all_in(one, other) is False:
                    return False
                compared = True
            elif isinstance(one, int | float | str) and isinstance(other, int | float | str):
                if one != other:
                    return False
                compared = True
    return True if compared else None


def judge_deviations(path: Path, found: Any) -> bool | None:
    """The frequencies' deviations as json has them."""
    data = json.loads(path.read_bytes())
    stated = data.get("freq_sd_hz")
    if stated is None:
        return found.freq_sd_hz is None
    return same(found.freq_sd_hz, [math.nan if v is None else v for v in stated])


def judge_results(path: Path, found: Any) -> bool | None:
    """The title and the frequencies as json has them."""
    data = json.loads(path.read_bytes())
    results = found[0]
    if data["study"]["title"] != results.study.title or len(data["modes"]) != len(results.modes):
        return False
    return all(same(m.freq_hz, d["freq_hz"]) is not False for m, d in zip(results.modes, data["modes"], strict=True))


# ----------------------------------------------------------------------------------------------------
# All kinds.


def _written(write: Callable[[Path], Any], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def _frfs(path: Path) -> None:
    lines = {"from_hz": 5.0, "to_hz": 60.0, "step_hz": 2.5, "ratio": 0.01}
    ft.respond(example_deck(path.parent), inputs=["5Z+"], outputs=["3Z+", "5Z+"], uff=path, units="m-kg-s", **lines)


def _complex_modes(path: Path) -> None:
    modes = replace(sample_test().modes, shapes=sample_test().modes.shapes * np.exp(0.3j), normalisation="unknown")
    write_uff_modes(path, replace(sample_test(), modes=modes))


def _hdf5_file(path: Path) -> None:
    lines = np.arange(1.0, 9.0)
    with h5py.File(path, "w") as file:
        file["H"], file["f"] = np.stack([lines + 1j, 2j * lines], axis=1), lines


def _run_folder() -> dict[str, bytes]:
    folder = ROOT / "tests" / "study" / "written_before"
    return {name: (folder / name).read_bytes() for name in ("results.json", "arrays.npz")}


def _of_tests(group: str, name: str, judge: Judge | None = None, share: int = 1) -> Kind:
    file, content, read, _ = KINDS[name]
    return Kind(group, {file: content()}, read, judge or judged(name), share)


def _repeats() -> bytes:
    chance = np.random.default_rng(4)
    rows = ["f1,f2,m"] + [",".join(f"{v:.6g}" for v in chance.normal([10.0, 25.0, 3.0])) for _ in range(12)]
    return ("\n".join(rows) + "\n").encode()


@lru_cache
def all_kinds() -> dict[str, Kind]:
    """By name."""
    warnings.simplefilter("ignore")
    modes = _written(lambda p: write_uff_modes(p, sample_test()), "a.uff")
    random = np.random.default_rng(3).normal(size=(3, 60))
    int16 = (1000.0 * random.T).astype(np.int16)
    kinds = {f"deck: {name}": Kind("decks", files, read_deck, judge_deck, 1, True) for name, files in OWN.items()}
    kinds |= {
        "modes": Kind("UFF", {"a.uff": modes}, read_universal, judge_universal, 4),
        "complex modes": Kind("UFF", {"a.uff": _written(_complex_modes, "a.uff")}, read_universal, judge_universal, 2),
        "test of a beam": Kind("UFF", {"a.uff": example_test_bytes()}, read_universal, judge_universal, 2),
        "FRFs": Kind("UFF", {"a.uff": _written(_frfs, "a.uff")}, read_universal, judge_universal, 4),
        "MatrixMarket": _of_tests("matrices", "MatrixMarket", share=4),
        "DMIG": Kind("matrices", {"a.pch": DMIG}, lambda p: read_matrix(p, format="dmig"), nothing, 2),
        "punch": _of_tests("matrices", "modes of a punch file", nothing),
        "listing": _of_tests("matrices", "listed modes", nothing),
        "table of functions": Kind("records", {"a.csv": TABLE}, partial(_table_of_functions), judged(
            "functions of a table"), 2),
        "numpy": Kind("records", {"a.npy": _written(lambda p: np.save(p, random), "a.npy")},
            lambda p: read_record(p, (), 10.0), partial(judge_record, np.load), 2),
        "archive": _of_tests("records", "numpy archive", partial(judge_functions, np.load)),
        "matlab": _of_tests("records", "matlab", partial(judge_functions, scipy.io.loadmat), 2),
        "packed matlab": _of_tests("records", "packed matlab", partial(judge_functions, scipy.io.loadmat)),
        "HDF5": Kind("records", {"a.h5": _written(_hdf5_file, "a.h5")}, lambda p: read_frfs(p, AXES),
            partial(judge_functions, _hdf5)),
        "sound": Kind("records", {"a.wav": _written(lambda p: scipy.io.wavfile.write(p, 100, int16), "a.wav")},
            lambda p: read_record(p, (), None), partial(judge_record, _wave)),
        "headings": _of_tests("records", "headings and dates", nothing, 2),
        "labview": _of_tests("records", "labview text", nothing, 2),
        "labview segments": _of_tests("records", "labview segments", nothing, 2),
        "MDF": _of_tests("records", "mdf", nothing, 2),
        "packed MDF": _of_tests("records", "packed mdf", nothing, 2),
        "text": _of_tests("records", "record", nothing, 2),
        "unit labels": _of_tests("UFF", "functions with unit labels", nothing, 2),
        "binary": _of_tests("UFF", "binary functions", nothing, 2),
        "2414": _of_tests("UFF", "modes of data set 2414", nothing, 2),
        "points": _of_tests("tables", "points", share=2),
        "repeats": Kind("tables", {"a.csv": _repeats()}, read_repeats_table, judge_table, 2),
        "study": _of_tests("studies", "study", judge_study, 4),
        "identification": Kind("studies", {"a.toml": IDENTIFY}, read_identify_file, judge_study, 2),
        "deviations": Kind("JSON", {"a.json": str(deviations_text(identified())).encode()},
            lambda p: with_deviations(bare(), p), judge_deviations, 3),
        "results": Kind("JSON", _run_folder(), lambda p: read_results(p.parent), judge_results),
    }  # fmt: skip
    if importlib.util.find_spec("nptdms") is not None:
        kinds["TDMS"] = Kind(
            "records", {"a.tdms": _written(_tdms, "a.tdms")}, lambda p: read_record(p, (), None), nothing, 2
        )
    return {n: k if k.deck else replace(k, share=3 * k.share) for n, k in reversed(kinds.items())}


def _table_of_functions(path: Path) -> Any:
    return read_frfs(path, LAYOUT)


def example_test_bytes() -> bytes:
    """The Universal File of the example."""
    with tempfile.TemporaryDirectory() as folder:
        return example_test(Path(folder)).read_bytes()
