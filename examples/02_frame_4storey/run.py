"""Four-storey laboratory frame, a real test: python run.py [--quick] [--evidence DIR].

Storey stiffnesses from modes 1 and 2 at the three lower floors by the MAC residual, beside the published changes;
modes 3 and 4 are kept for validation. The measured modes are read from the folder of shared measurements
(../shared/data beside the checkout, or $FEMTUNE_SHARED_DATA); without it the example says so and does nothing.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import numpy as np
import scipy.io

from femtune import steps
from femtune.dofs import Dof, DofSet
from femtune.files.nastran.reals import format_real
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.steps import RunFolder
from femtune.testdata import ModalTest, WireFrame
from femtune.units import unit_system

WEIGHT_LBF, GRAVITY, STOREY_LBF_IN, HEIGHT_IN = 12.060, 386.088, 10.0, 12.0
PUBLISHED = {"mac": (-0.2603, -0.2159, -0.1283, 0.5327), "difference": (-0.2477, -0.2689, -0.1188, 0.5775)}
PREDICTED_HZ = {"mac": (4.283, 5.571), "difference": (4.214, 5.626)}
TOLERANCE = 1e-3
KEPT = "kept for validation"


def shared_file() -> Path:
    """The measured frequencies and shapes."""
    root = Path(__file__).resolve().parents[2]
    folder = Path(os.environ.get("FEMTUNE_SHARED_DATA", root.parent / "shared" / "data"))
    return folder / "frame_4storey" / "FourStoryStructure.mat"


def deck() -> str:
    """A chain of four floors that move along X; every other motion has no stiffness and is held (AUTOSPC)."""
    mass = format_real(WEIGHT_LBF / GRAVITY, 16)
    lines = ["SOL 103", "CEND", "TITLE = FOUR-STOREY LABORATORY FRAME", "BEGIN BULK", "$ units: in, slinch, s"]
    for floor in range(1, 5):
        lines.append(f"GRID    {floor:<8d}        0.      0.      {format_real(floor * HEIGHT_IN, 8)}")
        below = "" if floor == 1 else f"{floor - 1:<8d}1"
        lines.append(f"CELAS2  {100 + floor:<8d}{format_real(STOREY_LBF_IN, 8):8s}{floor:<8d}{1:<8d}{below}".rstrip())
        lines.append(f"CMASS2* {200 + floor:<16d}{mass:16s}{floor:<16d}{1:<16d}\n*")
    return "\n".join([*lines, "ENDDATA", ""])


def measured(path: Path) -> ModalTest:
    """All four modes at floors 1 to 3."""
    data = scipy.io.loadmat(path)
    dofs = DofSet(Dof(i, "X") for i in (1, 2, 3))
    modes = ModeSet(data["test_frequency"].ravel(), data["test_mode"][:3], dofs)
    floors = np.array([[0.0, 0.0, i * HEIGHT_IN] for i in (1, 2, 3)])
    return ModalTest("frame", unit_system("in-slinch-s"), WireFrame(np.array([1, 2, 3]), floors), modes=modes)


def study(form: str) -> str:
    """The study of one shape residual: unit weights, stiffness factors between 0 and 2."""
    lines = [
        '[study]\ntitle = "Four-storey laboratory frame"\ndeck = "frame.bdf"\nunits = "in-slinch-s"\n',
        "[modes]\ncount = 4\n",
        _configuration("update", ("3", "4"), "update"),
        _configuration("upper modes", ("1", "2"), "validation"),
        "[sensors]\nby_id = true\n",
        *(
            f'[[parameter]]\nname = "k{i}"\nfields = ["CELAS2 {100 + i} K"]\nlower = 0.0\nupper = 2.0\n'
            for i in range(1, 5)
        ),
        '[residuals]\nfrequency_form = "eigenvalue"\nfrequency_sd = 1.0\nshape_sd = 1.0\n'
        f'shape_form = "{form}"\nshape_scaling = "largest-entry"\n',
        '[update]\nmax_iterations = 100\n\n[output]\nfolder = "run"\n',
    ]
    return "\n".join(lines)


def _configuration(name: str, left_out: tuple[str, ...], use: str) -> str:
    entries = ", ".join(f'{{ mode = "{m}", reason = "{KEPT if use == "update" else "used"}" }}' for m in left_out)
    return f'[[configuration]]\nname = "{name}"\ntest = "frame.uff"\nuse = "{use}"\nleave_out = [{entries}]\n'


def solve(form: str, source: Path, folder: Path) -> RunFolder:
    """Write deck, test and study, and run them."""
    folder.mkdir(parents=True)
    (folder / "frame.bdf").write_text(deck())
    write_uff_modes(folder / "frame.uff", [measured(source)], ["four-storey frame", "shake table"])
    (folder / "study.toml").write_text(study(form))
    return steps.update(folder / "study.toml")


def changes(run: RunFolder) -> list[float]:
    """Relative changes of the storey stiffnesses."""
    assert run.results.update is not None
    return [p.value - 1.0 for p in run.results.update.parameters]


def upper_modes(run: RunFolder) -> list[float]:
    """Modes 3 and 4 of the updated model, Hz."""
    (after,) = [m for m in run.results.modes if m.stage == "after" and m.configuration == "upper modes"]
    return [float(f) for f in after.freq_hz[2:4]]


def check(form: str, run: RunFolder) -> None:
    """Assert the published numbers."""
    np.testing.assert_allclose(changes(run), PUBLISHED[form], atol=TOLERANCE)
    np.testing.assert_allclose(upper_modes(run), PREDICTED_HZ[form], atol=TOLERANCE)


def page(runs: dict[str, RunFolder], source: Path) -> str:
    """Ours beside the published numbers."""
    hz = measured(source).modes
    assert hz is not None
    lines = ["# Four-storey laboratory frame (real test)", ""]
    lines += ["| residual | k1 | k2 | k3 | k4 | mode 3 Hz | mode 4 Hz |", "|---" * 7 + "|"]
    for form, run in runs.items():
        for who, alpha, upper in (
            (f"**{form}**", changes(run), upper_modes(run)),
            ("published", PUBLISHED[form], PREDICTED_HZ[form]),
        ):
            lines.append(
                f"| {who} | " + " | ".join([*(f"{a:.4f}" for a in alpha), *(f"{f:.3f}" for f in upper)]) + " |"
            )
    lines.append(f"| measured | | | | | {hz.freq_hz[2]:.3f} | {hz.freq_hz[3]:.3f} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run both residuals, compare, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same: the whole example takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the table that the documentation shows")
    arguments = parser.parse_args()
    source = shared_file()
    if not source.is_file():
        print(f"skipped: the measured modes are not here ({source})")
        return
    with tempfile.TemporaryDirectory() as work:
        runs = {form: solve(form, source, Path(work) / form) for form in PUBLISHED}
    for form, run in runs.items():
        check(form, run)
    text = page(runs, source)
    print(text)
    if arguments.evidence:
        (arguments.evidence / "02_frame_4storey.md").write_text(text)


if __name__ == "__main__":
    main()
