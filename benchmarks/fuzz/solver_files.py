"""Files of other programs that are damaged: what femtune reads through a library, and what solvers write.

Seeds are written by the libraries and solvers themselves: h5py, NumPy, pyarrow and pyYeti write theirs, the .rst and
.full files come with the library that reads them, a Nastran-compatible solver ($FEMTUNE_MYSTRAN) and CalculiX
($FEMTUNE_CALCULIX) solve a cantilever. Kinds whose program is not here are left out and named.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from binary_mutations import binary_mutant
from tests.files.matrices.conftest import ccx_beam
from tests.files.matrices.matrices_by_hand import symmetric_example
from tests.files.modes import test_solved_modes as listings
from tests.files.nastran import mutant_trial
from tests.files.nastran import test_superelements as parts
from tests.files.nastran.mutations import mutant
from tests.files.nastran.whole_decks import PARTS
from tests.files.test_mutated_files import AXES, DMIG, LISTED
from tests.model import test_prestress as preloaded
from tests.runs.solver_beam import BDF, INP

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.files.ansys_process import write_arrays
from femtune.files.formats import MODES_FORMATS
from femtune.files.matrices.ansys import matrices_of, read_ansys
from femtune.files.matrices.listed_modes import read_listed_modes
from femtune.files.matrices.read import read_matrix
from femtune.files.modes.ansys_rst import modes_of, read_rst
from femtune.files.modes.read import read_modes
from femtune.files.records import FunctionLayout, read_frfs, read_record
from femtune.files.runs_table import read_runs_table
from femtune.steps.run_folder import read_results

ROOT = Path(__file__).resolve().parents[2]
_DECKS = ROOT.parent / "shared" / "data" / "nastran_decks"
"""Decks and results of public tests beside the checkout, where they are there."""
_read_op2_modes = partial(read_modes, format="nastran-op2")


@dataclass(frozen=True)
class Kind:
    """Files of one kind.

    Parameters
    ----------
    group : row of the table
    files : by name; the first is read
    read : what femtune makes of the first
    share : mutants of this kind relative to those of the others
    text : whether it is damaged as text is
    deck : whether the whole way of a deck is tried, to its modes and back to a file
    crashes : whether femtune reads it in a process of its own, whose crash is a message
    """

    group: str
    files: Mapping[str, bytes]
    read: Callable[[Path], Any]
    share: int = 2
    text: bool = False
    deck: bool = False
    crashes: bool = False

    def mutant(self, number: int) -> dict[str, bytes]:
        """The damaged files."""
        return (mutant if self.text else binary_mutant)(self.files, number)

    def trial(self, number: int, folder: Path) -> str:
        """The code of the error, or "result"; what is raised besides is a failure."""
        if self.deck:
            outcome, why = mutant_trial.trial(self.files, number)
            assert outcome != "FAILURE", why
            return outcome
        changed = self.mutant(number)
        for name, content in changed.items():
            (folder / name).write_bytes(content)
        try:
            self.read(folder / next(iter(changed)))
        except FemtuneError as error:
            return error.code
        return "result"


def _written(write: Callable[[Path], Any], name: str) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


# ----------------------------------------------------------------------------------------------------
# Arrays: HDF5, NumPy, Parquet.

_LINES = np.arange(1.0, 9.0)
_H = np.stack([_LINES + 1j, 2j * _LINES], axis=1)


def _hdf5_plain(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["H"], file["f"] = _H, _LINES


def _hdf5_packed(path: Path) -> None:
    with h5py.File(path, "w", libver="latest") as file:
        group = file.create_group("test")
        group.create_dataset("H", data=_H, chunks=(2, 2), compression="gzip", shuffle=True, fletcher32=True)
        group.create_dataset("f", data=_LINES, chunks=(3,), maxshape=(None,))
        file["H"], file["f"], file["soft"] = group["H"], group["f"], h5py.SoftLink("/test/H")
        file.attrs["by"] = "a program"


def _hdf5_matlab(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        pair = np.zeros(_H.T.shape, dtype=[("real", float), ("imag", float)])
        pair["real"], pair["imag"] = _H.T.real, _H.T.imag
        file["H"], file["f"] = pair, _LINES[None]
        for name in ("H", "f"):
            file[name].attrs["MATLAB_class"] = np.bytes_("double")


def _hdf5_elsewhere(path: Path) -> None:
    """Values in another file, in each of the ways that HDF5 has; the seed is refused."""
    (path.parent / "secret.bin").write_bytes(_LINES.tobytes())
    with h5py.File(path.parent / "secret.h5", "w") as file:
        file["H"] = _H
    layout = h5py.VirtualLayout(shape=_H.shape, dtype=complex)
    layout[:] = h5py.VirtualSource("secret.h5", "H", shape=_H.shape)
    with h5py.File(path, "w") as file:
        file.create_dataset("f", shape=(8,), dtype=float, external=[("secret.bin", 0, 64)])
        file.create_virtual_dataset("H", layout)
        file["G"] = h5py.ExternalLink("secret.h5", "/H")


def _read_functions(path: Path) -> Any:
    return read_frfs(path, AXES)


def _read_linked(path: Path) -> Any:
    return read_frfs(path, FunctionLayout(
        "accelerance", (Dof(1, "X"), Dof(2, "X")), (Dof(1, "X"),), variable="G", frequency="f"
    ))  # fmt: skip


def _parquet(path: Path, **options: Any) -> None:
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    chance = np.random.default_rng(2)
    table = pa.table({
        "k1": chance.uniform(1.0, 2.0, 40), "k2": chance.uniform(1.0, 2.0, 40).astype("f4"), "case": ["a", "b"] * 20,
        "f1_hz": chance.uniform(5.0, 6.0, 40), "f2_hz": chance.uniform(9.0, 12.0, 40), "n": np.arange(40),
        **{f"shape{mode}_{node}X+": chance.normal(size=40) for mode in (1, 2) for node in (1, 2)},
    })  # fmt: skip
    pq.write_table(table, path, **options)


def _run_folder() -> dict[str, bytes]:
    folder = ROOT / "tests" / "study" / "written_before"
    return {name: (folder / name).read_bytes() for name in ("arrays.npz", "results.json")}


def _of_arrays() -> Iterator[tuple[str, Kind]]:
    for name, write in (("plain", _hdf5_plain), ("packed", _hdf5_packed)):
        yield f"HDF5 {name}", Kind("HDF5", _written(write, "a.h5"), _read_functions)
    yield "HDF5 of MATLAB", Kind("HDF5", _written(_hdf5_matlab, "a.mat"), _read_functions)
    for name, read in (("values", _read_functions), ("link", _read_linked)):
        yield f"HDF5 with {name} elsewhere", Kind("HDF5", _written(_hdf5_elsewhere, "a.h5"), read, share=1)
    arrays = {"H": _H, "f": _LINES}
    yield "NPZ", Kind("NPZ", _written(lambda p: np.savez(p, **arrays), "a.npz"), _read_functions)
    yield "NPZ packed", Kind("NPZ", _written(lambda p: np.savez_compressed(p, **arrays), "a.npz"), _read_functions)
    record = _written(lambda p: np.save(p, np.arange(600.0).reshape(3, 200)), "a.npy")
    yield "NPY", Kind("NPZ", record, lambda p: read_record(p, (), 10.0), share=1)
    yield "NPZ of results", Kind("NPZ", _run_folder(), lambda p: read_results(p.parent))
    yield "Parquet", Kind("Parquet", _written(_parquet, "a.parquet"), read_runs_table)
    plain = _written(partial(_parquet, compression="none", use_dictionary=False, version="1.0"), "a.parquet")
    yield "Parquet plain", Kind("Parquet", plain, read_runs_table)


# ----------------------------------------------------------------------------------------------------
# Matrices and modes of Nastran and Ansys.


def _op4(path: Path, **how: Any) -> None:
    np.in1d = np.isin  # type: ignore[attr-defined]  numpy 2 lacks what pyYeti may import
    from pyyeti.nastran import op4  # noqa: PLC0415

    op4.write(str(path), {"K": symmetric_example(8), "M": symmetric_example(8, 2)}, **how)


def _of_matrices() -> Iterator[tuple[str, Kind]]:
    for name, how in (
        ("binary", {"sparse": "dense"}), ("binary, big", {"sparse": "bigmat", "endian": ">"}),
        ("binary, sparse", {"sparse": "nonbigmat"}),
    ):  # fmt: skip
        yield f"OP4 {name}", Kind("OP4", _written(partial(_op4, **how), "a.op4"), read_matrix)
    text = _written(partial(_op4, binary=False, sparse="nonbigmat"), "a.op4")
    yield "OP4 text", Kind("OP4", text, read_matrix, text=True)
    examples = _ansys()
    if examples:
        for name, made, whole in (("full", matrices_of, read_ansys), ("rst", modes_of, read_rst)):
            files = {f"a.{name}": examples[name]}
            yield name, Kind(f".{name}", files, partial(_in_library, made), 6, crashes=True)
            # the whole way, in a process of its own
            yield f"{name}, whole way", Kind(f".{name}", files, whole, share=0)
    for name, read in (("static_solid_shell_bar_kelm", read_matrix), ("mode_solid_shell_bar", _read_op2_modes)):
        path = _DECKS / "solid_shell_bar" / f"{name}.op2"
        if path.exists():
            yield f"OP2 {name}", Kind("OP2", {"a.op2": path.read_bytes()}, read, 4)
    yield "DMIG", Kind("solver outputs", {"a.pch": DMIG}, lambda p: read_matrix(p, format="dmig"), 1, text=True)


def _in_library(convert: Callable[[Any], Any], path: Path) -> None:
    """What femtune does in a process that it starts for each file."""
    with suppress(Exception):
        write_arrays(str(path), str(path.parent / "arrays.npz"), convert.__module__, convert.__name__)
        return
    raise FemtuneError("matrices.ansys", reason="the library failed")


def _ansys() -> dict[str, bytes]:
    try:
        from ansys.mapdl.reader import examples  # noqa: PLC0415
    except ImportError:
        return {}
    return {"full": Path(examples.fullfile).read_bytes(), "rst": Path(examples.rstfile).read_bytes()}


# ----------------------------------------------------------------------------------------------------
# Outputs of solvers.


def _solved(command: list[str], name: str, text: str) -> dict[str, bytes]:
    """What a solver leaves."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / name).write_text(text)
        one = {**os.environ, "OMP_NUM_THREADS": "1"}
        subprocess.run(command, cwd=folder, env=one, capture_output=True, check=False, timeout=300)
        return {path.suffix.lower(): path.read_bytes() for path in Path(folder).iterdir()}


def _nastran() -> dict[str, bytes]:
    program = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    return (
        _solved([str(program), "beam.bdf"], "beam.bdf", BDF.replace("{{E:n8}}", "2.1+11  ")) if program.exists() else {}
    )


def _calculix(text: str) -> dict[str, bytes]:
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    return _solved([program, "beam"], "beam.inp", text) if program else {}


def _of_outputs() -> Iterator[tuple[str, Kind]]:
    texts = {
        "abaqus-dat": listings._ABAQUS, "calculix-dat": listings._DAT, "calculix-frd": listings._frd(),
        "nastran-f06": listings._f06(), "nastran-punch": listings._punch(),
        "table": "1.5 2.5\n1X+ 0.5 0.1\n2X+ -0.5 0.2\nmass 12.5\nparticipation X 1.2 0.3\nend\n",
    }  # fmt: skip
    for format in MODES_FORMATS.keys:
        if format in texts:
            files = {"modes": texts[format].encode("latin-1")}
            yield format, Kind("solver outputs", files, partial(read_modes, format=format), 2, text=True)
    yield "listing", Kind("solver outputs", {"a.f06": LISTED}, read_listed_modes, 1, text=True)
    written = _nastran()
    if ".op2" in written:
        yield "OP2 of a solver", Kind("OP2", {"a.op2": written[".op2"]}, _read_op2_modes, 4)
        for end, format in ((".f06", "nastran-f06"), (".pch", "nastran-punch")):
            if len(written.get(end, b"")) > 100:
                files, read = {f"a{end}": written[end]}, partial(read_modes, format=format)
                yield f"{end} of a solver", Kind("solver outputs", files, read, 1, text=True)
    beam = _calculix(INP.replace("{{E:.6e}}", "2.1e11"))
    for end, format in ((".frd", "calculix-frd"), (".dat", "calculix-dat")):
        if end in beam:
            files, read = {f"a{end}": beam[end]}, partial(read_modes, format=format)
            yield f"{end} of a solver", Kind("solver outputs", files, read, 1, text=True)
    stored = _calculix(ccx_beam(2, 1) + "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n4\n*END STEP\n")
    if {".sti", ".mas", ".dof"} <= set(stored):
        files = {f"a{end}": stored[end] for end in (".sti", ".dof", ".mas")}
        yield "matrices of CalculiX", Kind("solver outputs", files, read_matrix, 2, text=True)


# ----------------------------------------------------------------------------------------------------
# Decks of parts, and under a load.


def _of_decks() -> Iterator[tuple[str, Kind]]:
    second = "BEGIN SUPER = 3\n" + parts.second()
    decks = {
        "parts": PARTS, "strips": f"{parts.MAIN}{second}ENDDATA\n",
        "strips by hand": f"{parts.MAIN}{parts.MANUAL}{second}ENDDATA\n",
    }  # fmt: skip
    for name, text in decks.items():
        yield f"superelements: {name}", Kind("superelements", {"deck.bdf": text.encode()}, repr, 2, True, True)
    case = "SOL 103\nCEND\nSUBCASE 1\nSPC=1\nLOAD=3\nSUBCASE 2\nSPC=1\nMETHOD=5\nSTATSUB(PRELOAD)=1\nBEGIN BULK\n"
    for name, kind, load in (("column", "CBAR", -0.4), ("beam", "CBEAM", 2.0), ("rods", "CROD", 0.5)):
        cards = preloaded.column(preloaded.pinned(4), 4, kind)
        force = preloaded.force(5, (load * preloaded.EULER, 0.0, 0.0))
        text = case + "\n".join([*cards, force, "EIGRL,5,,,4", "ENDDATA", ""])
        yield f"prestress: {name}", Kind("prestress", {"deck.bdf": text.encode()}, repr, 2, True, True)


@lru_cache
def all_kinds() -> dict[str, Kind]:
    """By name."""
    warnings.simplefilter("ignore")
    return dict(one for made in (_of_arrays, _of_matrices, _of_outputs, _of_decks) for one in made())
