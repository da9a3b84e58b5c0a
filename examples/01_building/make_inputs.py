"""Write the benchmark building's deck, its measured modes and the study: building.bdf, building.uff, study.toml."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import published as p

from femtune.dofs import DofSet
from femtune.files.nastran.lines import format_real
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

HERE = Path(__file__).parent
CORNERS = ((1, -1, -1), (2, 1, -1), (3, 1, 1), (4, -1, 1))
REASON = (
    "4a and 4b are one frame mode split by the upper V-braces, which work as tuned appendages; "
    "the model has no braces, so it cannot repeat either"
)

TARGETS = ("1", "2", "3", "5", "6")
"""Modes that the paper compares."""


def card(name: str, *fields: int | float | str | None) -> str:
    """A card in small field, eight columns each; blank for None, continued after eight fields."""
    texts = [_text(f).ljust(8) for f in fields]
    rows = [texts[i : i + 8] for i in range(0, len(texts), 8)]
    return "\n".join("".join([(name if i == 0 else "").ljust(8), *row]).rstrip() for i, row in enumerate(rows))


def _text(field: float | str | None) -> str:
    if field is None:
        return ""
    return format_real(field, 8) if isinstance(field, float) else str(field)


def deck() -> str:
    """The structure as the paper idealises it, the three configurations' blocks included."""
    lines = [
        "SOL 103",
        "CEND",
        "TITLE = TWO-STOREY STEEL BUILDING, SCALE 2:3",
        "SPC = 1",
        "METHOD = 1",
        "BEGIN BULK",
        "$ units: m, kg, s. Floors are rigid in their plane, columns inextensible, members massless:",
        "$ their mass is with the floors, at the slab centroids (grid points 10 and 20).",
        card("EIGR", 1, "MGIV", None, None, 1, 6),
        card("PARAM", "GRDPNT", 0),
        *_grids(),
        *_members(),
        *_properties(),
        *_floors(),
        *_supports(),
        "ENDDATA",
    ]
    return "\n".join(lines) + "\n"


def _grids() -> list[str]:
    half_x, half_y = p.LENGTH_X / 2, p.LENGTH_Y / 2
    lines = ["$ joints: 100 + corner at the base, 200 + at floor 1, 300 + at floor 2"]
    for level in range(3):
        for corner, x, y in CORNERS:
            place = (x * half_x, y * half_y, level * p.STOREY)
            lines.append(card("GRID", 100 * (level + 1) + corner, None, *map(float, place)))
    lines += [card("GRID", 10 * floor, None, 0.0, 0.0, floor * p.STOREY) for floor in (1, 2)]
    return lines


def _members() -> list[str]:
    lines = ["$ columns: plane 1 of a bar is x, so I1 resists motion along x and I2 along y"]
    for storey in (1, 2):
        for corner, *_ in CORNERS:
            ends = (100 * storey + corner, 100 * (storey + 1) + corner)
            lines.append(card("CBAR", 100 * storey + corner, storey, *ends, 1.0, 0.0, 0.0))
    lines.append("$ beams along x (11, 21) and along y (12, 22): plane 1 is vertical")
    for floor in (1, 2):
        base = 100 * (floor + 1)
        for number, (a, b) in enumerate(((1, 2), (4, 3), (1, 4), (2, 3)), start=1):
            section = 10 * floor + (1 if number <= 2 else 2)
            lines.append(card("CBAR", 100 * floor + 10 + number, section, base + a, base + b, 0.0, 0.0, 1.0))
    return lines


def _properties() -> list[str]:
    column, beam = 4.296e-3, 2.395e-3
    lines = [card("MAT1", 1, p.YOUNG, None, 0.3)]
    lines += [card("PBAR", storey, 1, column, p.COLUMN_X, p.COLUMN_Y, p.COLUMN_TORSION) for storey in (1, 2)]
    for floor in (1, 2):
        for direction in (1, 2):
            lines.append(card("PBAR", 10 * floor + direction, 1, beam, p.BEAM, 1.009e-6, p.BEAM_TORSION))
    return lines


def _floors() -> list[str]:
    lines = ["$ slabs, steel carried by the floors, and the added blocks (on in NC and SC as the study says)"]
    for floor in (1, 2):
        joints = [100 * (floor + 1) + corner for corner, *_ in CORNERS]
        lines.append(card("RBE2", 700 + floor, 10 * floor, 126, *joints))
        mass, inertia = p.STEEL[floor]
        lines.append(_mass(900 + floor, floor, p.SLAB_MASS, p.SLAB_INERTIA))
        lines.append(_mass(910 + floor, floor, mass, inertia))
    for number, (_, floor, mass, e_x, e_y, _) in enumerate(p.BLOCKS, start=1):
        lines.append(card("CONM2", 800 + number, 10 * floor, 0, mass, e_x, e_y, 0.0))
    return lines


def _mass(number: int, floor: int, mass: float, inertia: float) -> str:
    return card("CONM2", number, 10 * floor, 0, mass, None, None, None, None, None, None, None, None, None, inertia)


def _supports() -> list[str]:
    return [
        "$ columns clamped at the base; floors move in their plane only",
        card("SPC1", 1, 123456, 101, "THRU", 104),
        card("SPC1", 1, 3, 201, "THRU", 204),
        card("SPC1", 1, 3, 301, "THRU", 304),
        card("SPC1", 1, 345, 10, 20),
    ]


def measured_modes() -> list[ModalTest]:
    """Table 3 as three modal tests at the slab centroids."""
    frame = WireFrame(np.array([10, 20]), np.array([[0.0, 0.0, p.STOREY], [0.0, 0.0, 2 * p.STOREY]]))
    dofs = DofSet.parse(["10X+", "10Y+", "10RZ+", "20X+", "20Y+", "20RZ+"])
    tests = []
    for name, rows in p.MEASURED.items():
        shapes = np.array([shape for _, shape in rows]).T
        modes = ModeSet(np.array([f for f, _ in rows]), shapes, dofs, normalisation="unit-norm")
        tests.append(ModalTest(name, SI, frame, modes=modes))
    return tests


def study(model: str = "M8", folder: str = "run") -> str:
    """The study of one of the models of Table 4 (M8 is the ten-parameter set), or of all twelve parameters (M12)."""
    parts = [
        "# The objective of the paper: relative frequency errors, and a tenth of the distance of unit-norm shapes.",
        f'[study]\ntitle = "Two-storey steel building, model {model}"\ndeck = "building.bdf"\nunits = "m-kg-s"',
        "[modes]\ncount = 6",
        *(_configuration(name) for name in p.MEASURED),
        "[sensors]\nby_id = true",
        *_parameters(p.MODELS[model]),
        '[residuals]\nfrequency_sd = 0.01\nshape_sd = 0.1\nshape_sd_of = "scaled-shape"',
        # 4a and 4b are the second mode along x, with 6 % of the mass
        f'[validate]\nprofile = "ECSS"\ntarget_modes = [{_labels(TARGETS)}]\ntarget_mass = 0.1',
        '[report]\ndocument = "EX-01"\nrevision = "A"\nauthor = "femtune, example 01"\n'
        'standard = "ECSS-E-ST-32-11C (31 July 2008)"\nexcitation = "ambient vibration"',
        f'[output]\nfolder = "{folder}"',
    ]
    return "\n\n".join(parts) + "\n"


def _labels(modes: Sequence[str]) -> str:
    return ", ".join(f'"{m}"' for m in modes)


def _configuration(name: str) -> str:
    off = [800 + i for i, block in enumerate(p.BLOCKS, start=1) if name not in block[-1].split()]
    labels = _labels(p.MODES)
    left_out = ",\n".join(f'  {{ mode = "{m}", reason = "{REASON}" }}' for m in p.MODES if m not in TARGETS)
    return (
        f'[[configuration]]\nname = "{name}"\ntest = "building.uff"\nrecords = "{name}"\n'
        f"mode_labels = [{labels}]\nelements_off = {off}\nleave_out = [\n{left_out},\n]"
    )


def _parameters(model: tuple[str, ...]) -> list[str]:
    entries = []
    for (name, field, lower, upper), follows in zip(p.PARAMETERS, model):
        if follows == name:
            entries.append(f'[[parameter]]\nname = "{name}"\nfields = ["{field}"]\nlower = {lower}\nupper = {upper}')
        elif follows:
            entries.append(f'[[parameter]]\nname = "{name}"\nfields = ["{field}"]\ntie = "{follows}"')
    return entries


def candidates(ratios: Sequence[float] = tuple(p.RATIOS), folder: str = "run") -> str:
    """The study of all twelve parameters with the models of Tables 4 and 9 as candidates."""
    models = [_candidate(name, follows) for name, follows in p.MODELS.items() if name != "M0"]
    models += [_candidate(f"ratio {ratio:g}", p.MODELS["M8"], ratio) for ratio in ratios]
    return _compared(["[candidates]\nthreshold = 1.12", *models], folder)


def populations(models: Sequence[str], starts: int, folder: str = "run") -> str:
    """The study with models of Table 4 as candidates, each updated from genetic algorithms of random populations."""
    search = f'starts = {starts}\nsearch = "genetic"\npopulation = 16\ngenerations = 6'
    table = f"[candidates]\nthreshold = 1.12\nleave_one_out = false\n{search}"
    return _compared([table, *(_candidate(name, p.MODELS[name]) for name in models)], folder)


def _compared(tables: Sequence[str], folder: str) -> str:
    text = "\n\n".join([study("M12", folder), *tables]) + "\n"
    # the models of Table 9 need columns up to 3.55 times as stiff
    return text.replace("upper = 3.0", "upper = 4.0").replace("shape_sd = 0.1", 'shape_sd = 0.1\nscatter = "estimated"')


def _candidate(model: str, follows: tuple[str, ...], ratio: float | None = None) -> str:
    names = [name for name, *_ in p.PARAMETERS]
    free = ", ".join(f'"{name}"' for name, other in zip(names, follows) if other == name)
    factor = "" if ratio is None else f"{ratio:g}*"
    ties = [
        f'{name} = "{factor if name.startswith("Ib") else ""}{other}"'
        for name, other in zip(names, follows)
        if other not in ("", name)
    ]
    text = f'[[candidate]]\nname = "{model}"\nparameters = [{free}]'
    return text + (f"\nties = {{ {', '.join(ties)} }}" if ties else "")


def write_inputs(folder: Path, model: str = "M8") -> Path:
    """Write the three files; returns the study's path."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "building.bdf").write_text(deck())
    write_uff_modes(folder / "building.uff", measured_modes(), ["benchmark building, Table 3", "ambient vibration"])
    (folder / "study.toml").write_text(study(model))
    return folder / "study.toml"


if __name__ == "__main__":
    print(f"wrote {write_inputs(HERE)} with its deck and test")
