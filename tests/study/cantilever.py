"""The cantilever of two halves: its deck, its true values, and a bench on which studies of it are put together."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tests.deck_models import frame_at, model_of, structure_of

from femtune.dofs import DofSet
from femtune.files.uff import write_uff_frfs, write_uff_modes
from femtune.modal import FrfSet, ModeSet
from femtune.model import Configuration, solve_modes
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

CANTILEVER = """SOL 103
CEND
SPC = 1
METHOD = 1
BEGIN BULK
$ a cantilever of two halves, one metre, bending in two planes
EIGRL   1                       6
GRID    1               0.0     0.0     0.0
GRID    2               0.25    0.0     0.0
GRID    3               0.5     0.0     0.0
GRID    4               0.75    0.0     0.0
GRID    5               1.0     0.0     0.0
MAT1    1       2.1+11          0.3     7850.
PBAR    1       1       1.0-3   2.0-7   5.0-7   4.0-7           $ root
PBAR    2       1       1.0-3   2.0-7   5.0-7   4.0-7           $ tip
CBAR    1       1       1       2       0.0     1.0     0.0
CBAR    2       1       2       3       0.0     1.0     0.0
CBAR    3       2       3       4       0.0     1.0     0.0
CBAR    4       2       4       5       0.0     1.0     0.0
CONM2   9       5               2.0
SPC1    1       123456  1
ENDDATA
"""


def bounded(name: str, field: str, more: str = "") -> str:
    """The table of a parameter between half and twice the value of the deck."""
    return f'[[parameter]]\nname = "{name}"\nfields = ["{field}"]\n{more}lower = 0.5\nupper = 2.0\n'


EI = f"\n{bounded('root', 'PBAR 1 I1')}\n{bounded('tip', 'PBAR 2 I1')}"
LABELS = tuple(f"{node}{direction}+" for node in (2, 3, 4, 5) for direction in ("Y", "Z"))


def modes_of_deck(path: Path, count: int, configuration: Configuration | None = None) -> tuple[NDArray, NDArray]:
    """Frequencies (m,) and grid shapes (n_g, m) of a deck, past everything that a study does."""
    configured = model_of(path, configuration)
    solution = solve_modes(configured.at(np.zeros(0)), count)
    return solution.freq_hz, configured.transformation @ solution.shapes[:, : solution.wanted]


def measured(path: Path, labels: tuple[str, ...] = LABELS, count: int = 4, **options: object) -> ModalTest:
    """The modes of a deck at sensors on its grid points, as a test of them would give."""
    structure = structure_of(path)
    freq, shapes = modes_of_deck(path, count, options.get("configuration"))  # type: ignore[arg-type]
    dofs = DofSet.parse(labels)
    rows = np.array([structure.nodes.dof(d.node, d.component) for d in dofs])
    modes = ModeSet(freq[:count], shapes[rows][:, :count], dofs, normalisation="mass")
    return ModalTest(str(options.get("name", "test")), SI, frame_at(structure, (d.node for d in dofs)), modes=modes)


TRUE = (("PBAR    1       1       1.0-3   2.0-7 ", "PBAR    1       1       1.0-3   2.6-7 "),
        ("PBAR    2       1       1.0-3   2.0-7 ", "PBAR    2       1       1.0-3   1.7-7 "))  # fmt: skip
"""The root of the real beam is 1.3 times, its tip 0.85 times as stiff as in the deck."""


_ROOT, _TIP = ("1.0-3   2.0-7   5.0-7   4.0-7           $ root", "1.0-3   2.0-7   5.0-7   4.0-7           $ tip")


def fine(elements: int) -> str:
    """The cantilever as a mesh of bars."""
    grids = "".join(f"GRID    {i + 1:<8d}        {i / elements:<8.5f}0.0     0.0\n" for i in range(elements + 1))
    bars = "".join(
        f"CBAR    {i:<8d}{1 + (2 * i > elements):<8d}{i:<8d}{i + 1:<8d}0.0     1.0     0.0\n"
        for i in range(1, elements + 1)
    )
    return (
        f"SOL 103\nCEND\nSPC = 1\nBEGIN BULK\n{grids}MAT1    1       2.1+11          0.3     7850.\n"
        f"PBAR    1       1       {_ROOT}\nPBAR    2       1       {_TIP}\n{bars}"
        f"CONM2   99      {elements + 1:<8d}        2.0\nSPC1    1       123456  1\nENDDATA\n"
    )


def with_factors(text: str, root: float, tip: float) -> str:
    """A deck with both second moments of area times factors."""
    for old, factor in ((_ROOT, root), (_TIP, tip)):
        assert old in text
        text = text.replace(old, old.replace("2.0-7   ", f"{2.0 * factor:.3f}-7 ", 1))
    return text


@dataclass
class Bench:
    """A folder in which decks, tests and studies are put together."""

    folder: Path
    text: str = CANTILEVER
    parameters: str = EI
    deck_name: str = "beam.bdf"
    tests: list[ModalTest] = field(default_factory=list)

    def write(self, name: str, text: str) -> Path:
        """A file in the folder."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def truth(self, changes: tuple[tuple[str, str], ...] = TRUE, text: str = CANTILEVER) -> Path:
        """The deck with its true values, in a folder that the study never sees."""
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        return self.write("truth/true.bdf", text)

    def measure(self, deck: Path, *labels: str, **options: object) -> ModalTest:
        """What a modal test of a deck gives, at sensors on its grid points."""
        return measured(deck, labels or LABELS, **options)  # type: ignore[arg-type]

    def modes(self, deck: Path, count: int = 6) -> NDArray:
        """Frequencies of a deck in Hz, past everything that a study does."""
        return modes_of_deck(deck, count)[0]

    def uff(self, test: ModalTest | list[ModalTest], name: str = "beam.uff") -> Path:
        """A Universal File of measured modes."""
        write_uff_modes(self.folder / name, test)
        return self.folder / name

    def functions(self, frfs: FrfSet, name: str = "frfs.uff") -> Path:
        """A Universal File of measured FRFs at the grid points of the cantilever."""
        nodes = np.array([1, 2, 3, 4, 5])
        frame = WireFrame(nodes, np.column_stack([0.25 * (nodes - 1.0), np.zeros((5, 2))]))
        return write_uff_frfs(self.folder / name, ModalTest("frfs", SI, frame, frfs=frfs))

    def study(self, tail: str = EI, *, test: str | None = "beam.uff", head: str = "", deck: str = "") -> Path:
        """A study with one [test], or with whatever `tail` says."""
        tested = "" if test is None else f'[test]\nfile = "{test}"\n'
        text = f'[study]\ntitle = "Beam"\ndeck = "{deck or self.deck_name}"\nunits = "m-kg-s"\n{head}\n'
        return self.write("study.toml", f"{text}[modes]\ncount = 6\n{tested}{tail}")
