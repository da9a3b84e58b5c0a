"""Small structures of which one property is wrong: a frame of beams and a plate of six patches, as decks.

The true structure has other values of some fields than the model. Some of these fields are parameters of the model; a
wrong one that is not is what a judge of the update must find.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import femtune as ft


@dataclass(frozen=True)
class WrongProperty:
    """A structure with properties that may be wrong.

    Parameters
    ----------
    deck : of the model
    fields : value in the deck of each field that may be wrong, and size of its usual errors
    parameters : fields that an update changes
    sensors : as of `femtune.simulate`
    modes : number of elastic modes of the test
    """

    name: str
    deck: str
    fields: Mapping[str, tuple[float, float]]
    parameters: tuple[str, ...]
    sensors: tuple[str, ...]
    modes: int

    def study(
        self,
        folder: Path,
        factors: Mapping[str, float],
        noise: tuple[float, float] = (0.003, 0.02),
        stated: tuple[float, float] = (0.003, 0.02),
        seed: int = 1,
        more: tuple[str, ...] = (),
    ) -> ft.Study:
        """The study of the model beside a simulated test of the true structure.

        Parameters
        ----------
        factors : of the true structure on some fields of the model
        noise : standard deviations of the test's frequencies, relative, and of its shapes, relative to the largest
            entry
        stated : those that the study states
        more : further fields as parameters
        """
        folder.mkdir(parents=True, exist_ok=True)
        model, true = folder / "model.bdf", folder / "true.bdf"
        model.write_text(self.deck)
        ft.write_deck(model, {name: self.fields[name][0] * factor for name, factor in factors.items()}, true, wide=True)
        test = ft.simulate(
            true, self.sensors, units="m-kg-s", count=self.modes, frequency_scatter=noise[0], shape_scatter=noise[1],
            seed=seed,
        )  # fmt: skip
        parameters = [
            ft.Parameter(f"p{i}", fields=[name], lower=0.5, upper=2.0)
            for i, name in enumerate((*self.parameters, *more))
        ]
        return ft.Study(
            model=ft.read_deck(model, units="m-kg-s"), test=test, parameters=parameters,
            residuals={"frequency_sd": stated[0], "shape_sd": stated[1]}, modes={"count": self.modes + 5},
            output=str(folder / "results"),
        )  # fmt: skip


def _frame() -> str:
    """Two storeys of 1 m and a span of 1.6 m in the plane xz, feet on rotational springs."""
    grids, bars = [], []
    for first, x in ((1, 0.0), (6, 1.6)):
        grids += [f"GRID,{first + i},,{x},0.,{0.5 * i}" for i in range(5)]
        bars += [(first + i, 1 if i < 2 else 2, first + i, first + i + 1) for i in range(4)]
    for storey, (left, right, z) in enumerate(((3, 8, 1.0), (5, 10, 2.0))):
        inner = [21 + 5 * storey + i for i in range(4)]
        grids += [f"GRID,{n},,{0.32 * (i + 1):.2f},0.,{z}" for i, n in enumerate(inner)]
        chain = [left, *inner, right]
        bars += [(101 + 10 * storey + i, 3 + storey, a, b) for i, (a, b) in enumerate(pairwise(chain))]
    cards = ["SOL 103", "CEND", "METHOD = 1", "SPC = 1", "BEGIN BULK", "EIGRL,1,,,12", *grids]
    cards += [f"CBAR,{n},{pid},{a},{b},0.,1.,0." for n, pid, a, b in bars]
    cards += [f"PBAR,{pid},1,4.-4,3.-8,1.333-8,4.-8" for pid in (1, 2)]
    cards += [f"PBAR,{pid},1,6.-4,5.-8,2.-8,5.-8" for pid in (3, 4)]
    cards += ["MAT1,1,2.1+11,,.3,7850.", "CELAS2,901,2000.,1,5", "CELAS2,902,2000.,6,5"]
    cards += ["CONM2,911,22,,1.5", "CONM2,912,28,,1.", "SPC1,1,123,1,6", "SPC1,1,246,1,THRU,10"]
    cards += ["SPC1,1,246,21,THRU,24", "SPC1,1,246,26,THRU,29", "ENDDATA"]
    return "\n".join(cards) + "\n"


FRAME = WrongProperty(
    "frame",
    _frame(),
    {
        **{f"PBAR {i} I2": (1.333e-8 if i < 3 else 2.0e-8, 0.2) for i in range(1, 5)},
        "MAT1 1 E": (2.1e11, 0.1), "MAT1 1 RHO": (7850.0, 0.06), "CELAS2 901 K": (2000.0, 0.5),
        "CELAS2 902 K": (2000.0, 0.5), "CONM2 911 M": (1.5, 0.15), "CONM2 912 M": (1.0, 0.15),
    },
    ("PBAR 1 I2", "PBAR 3 I2", "PBAR 4 I2"),
    ("2 THRU 5:1", "7 THRU 10:1", "21 THRU 24:3", "26 THRU 29:3"),
    7,
)  # fmt: skip
"""22 bars on 4 properties, 2 springs, 2 masses."""


def _plate() -> str:
    """0.6 × 0.36 m, 10 × 6 elements in six patches, on springs in the middle of its edges."""
    cards = ["SOL 103", "CEND", "METHOD = 1", "SPC = 1", "BEGIN BULK", "EIGRL,1,,,16"]
    cards += [f"GRID,{1 + i + 11 * j},,{0.06 * i:.2f},{0.06 * j:.2f},0." for j in range(7) for i in range(11)]
    for j in range(6):
        for i in range(10):
            a, patch = 1 + i + 11 * j, 1 + min(i // 4, 2) + 3 * (j // 3)
            cards.append(f"CQUAD4,{1 + i + 10 * j},{patch},{a},{a + 1},{a + 12},{a + 11}")
    cards += [f"PSHELL,{i},1,3.-3,1" for i in range(1, 7)]
    cards += ["MAT1,1,7.+10,,.33,2700.", "CELAS2,901,4000.,34,3", "CELAS2,902,4000.,44,3"]
    cards += ["CELAS2,903,20000.,6,3", "CELAS2,904,20000.,72,3", "CONM2,911,19,,.15"]
    return "\n".join([*cards, "SPC1,1,126,1,THRU,77", "ENDDATA"]) + "\n"


PLATE = WrongProperty(
    "plate",
    _plate(),
    {
        **{f"PSHELL {i} T": (0.003, 0.1) for i in range(1, 7)},
        "MAT1 1 E": (7.0e10, 0.1), "MAT1 1 RHO": (2700.0, 0.06), "CELAS2 901 K": (4000.0, 0.5),
        "CELAS2 903 K": (20000.0, 0.5), "CONM2 911 M": (0.15, 0.3),
    },
    ("PSHELL 1 T", "PSHELL 3 T", "PSHELL 5 T", "MAT1 1 E"),
    ("1 THRU 77 BY 3:3",),
    8,
)  # fmt: skip
"""60 shells on 6 properties, 4 springs, a mass."""
