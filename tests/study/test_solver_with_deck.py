"""An external solver whose derivatives come from femtune's own model of a deck that differs from it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from tests.messages.shown import check_shown

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.journal.runs import open_run_journal
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI
from structures import two_solvers

# a chain of eight masses on springs in five groups; the solver has springs to the second neighbour that the deck lacks,
# and masses that are 2 % larger
N, GROUPS = 8, (0, 0, 1, 1, 2, 3, 3, 4)
MODEL = """
import numpy as np
N, GROUPS, FAR, HEAVY = 8, (0, 0, 1, 1, 2, 3, 3, 4), FAR_VALUE, 1.02
def modes(k):
    K = np.zeros((N + 1, N + 1))
    for i, g in enumerate(GROUPS):
        K[np.ix_([i, i + 1], [i, i + 1])] += k[g] * np.array([[1.0, -1.0], [-1.0, 1.0]])
    for i in range(N - 1):
        K[np.ix_([i, i + 2], [i, i + 2])] += FAR * np.array([[1.0, -1.0], [-1.0, 1.0]])
    m = HEAVY * (1.0 + 0.1 * np.arange(N))
    values, y = np.linalg.eigh(K[1:, 1:] / np.sqrt(np.outer(m, m)))
    return np.sqrt(values) / (2 * np.pi), y / np.sqrt(m)[:, None]
"""
SCRIPT = (
    MODEL
    + """
import os, time
os.close(os.open("%s/started-%d" % (os.environ["FAKE_STATE"], time.time_ns()), os.O_CREAT))
hz, shapes = modes([float(x) for x in open("in.txt")])
with open("modes.txt", "w") as out:
    print(*("%.12e" % f for f in hz), file=out)
    for i, row in enumerate(shapes):
        print("%dX" % (i + 1), *("%.12e" % v for v in row), file=out)
    print("end", file=out)
"""
)


def deck() -> str:
    """The chain of the deck."""
    lines = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,8"]
    for i in range(N):
        lines += [f"GRID,{i + 1},,{i}.0,0.,0.", f"CONM2,{100 + i},{i + 1},,{1.0 + 0.1 * i}", f"SPC1,1,23456,{i + 1}"]
        ends = f"{i + 1},1" if i == 0 else f"{i},1,{i + 1},1"
        lines.append(f"CELAS2,{i + 1},1000.,{ends}")
    return "\n".join([*lines, "ENDDATA", ""])


def study_text(folder: Path, extra: str) -> str:
    """The study."""
    command = str([sys.executable, "-I", "solve.py"]).replace("'", '"')
    parameters = "".join(
        f'[[parameter]]\nname = "k{g}"\nabsolute = true\nlower = 500.0\nupper = 2000.0\n'
        f"fields = {[f'CELAS2 {i + 1} K' for i in range(N) if GROUPS[i] == g]}\n".replace("'", '"')
        for g in range(5)
    )
    return f"""[study]
title = "Chain"
deck = "chain.bdf"
units = "m-kg-s"
[modes]
count = {N}
[solver]
command = {command}
templates = ["in.txt"]
files = ["solve.py"]
result = "modes.txt"
format = "table"
environment = {{ FAKE_STATE = "{folder / "state"}" }}
{extra}[sensors]
by_id = true
[test]
file = "test.uff"
{parameters}[residuals]
frequency_sd = 0.002
"""


class Chain:
    """The solver's own formulas, and what they give for the truth with errors of the test."""

    def __init__(self, folder: Path, far: float) -> None:
        self.folder = folder
        (folder / "state").mkdir()
        (folder / "solve.py").write_text(SCRIPT.replace("FAR_VALUE", repr(far)))
        (folder / "in.txt").write_text("".join(f"{{{{k{g}}}}}\n" for g in range(5)))
        (folder / "chain.bdf").write_text(deck())
        names: dict = {}
        exec(MODEL.replace("FAR_VALUE", repr(far)), names)
        self.modes = names["modes"]
        hz, shapes = self.modes([1300.0, 800.0, 1150.0, 900.0, 1400.0])
        self.measured = hz * (1.0 + 0.004 * np.random.default_rng(0).standard_normal(N))
        frame = WireFrame(np.arange(1, N + 1), np.column_stack([np.arange(N), np.zeros((N, 2))]).astype(float))
        dofs = DofSet.parse([f"{i + 1}X+" for i in range(N)])
        modes = ModeSet(self.measured, shapes, dofs)
        ft.write_test(ModalTest("chain", SI, frame, modes=modes), folder / "test.uff")

    def study(self, extra: str = 'derivatives = "deck"\n') -> Path:
        """The study file."""
        (self.folder / "study.toml").write_text(study_text(self.folder, extra))
        return self.folder / "study.toml"

    @property
    def started(self) -> int:
        """Number of runs."""
        return len(list((self.folder / "state").glob("started-*")))

    def optimum(self) -> np.ndarray:
        """Least squares by another program."""
        return least_squares(
            lambda k: (self.modes(k)[0] / self.measured - 1.0) / 0.002, np.full(5, 1000.0), bounds=(500.0, 2000.0),
            xtol=1e-12, ftol=1e-12, gtol=1e-12, x_scale=1000.0,
        ).x  # fmt: skip


def values(result: ft.RunResult) -> np.ndarray:
    """The updated parameters."""
    table = result.parameters
    found = dict(zip(table.column("name"), table.column("value")))
    return np.array([found[f"k{g}"] for g in range(5)])


@pytest.mark.slow
def test_the_optimum_is_that_of_the_solver_with_fewer_runs(tmp_path: Path) -> None:
    """The deck lacks springs of 4 %: its own optimum is elsewhere."""
    chain = Chain(tmp_path, 40.0)
    best = chain.optimum()
    result = ft.run(chain.study())
    with_deck = chain.started
    np.testing.assert_allclose(values(result), best, rtol=2e-4)
    assert result.results.update is not None
    assert result.results.update.ok
    codes = {a.code: a.sentence for a in result.results.alerts}
    said_of_way = re.sub(r"in \d+ further", "in 3 further", codes["external.by-deck"])
    check_shown("external.by-deck", f"[external.by-deck] {said_of_way}")
    assert result.results.model is not None
    said = next(n for n in result.results.model.notices if n.code == "external.deck")
    assert "MAC 0.9" in said.sentence
    # the same study without the deck; its initial values are those of the deck
    study = chain.study("")
    text = study.read_text().replace('deck = "chain.bdf"\n', "")
    text = "\n".join(line for line in text.splitlines() if not line.startswith("fields"))
    study.write_text(text.replace("absolute = true", "absolute = true\nnominal = 1000.0"))
    plain = ft.run(study, fresh=True)
    np.testing.assert_allclose(values(plain), best, rtol=2e-4)
    print("runs", with_deck, chain.started - with_deck)
    assert with_deck < 0.75 * (chain.started - with_deck)
    sd, other = (np.array(r.parameters.column("sd"), float) for r in (result, plain))
    np.testing.assert_allclose(sd, other, rtol=1e-3)


@pytest.mark.slow
def test_templates_of_calculix_with_the_derivatives_of_a_deck(tmp_path: Path) -> None:
    """Beams of CalculiX that yield in shear, and bars that do not with a section that is 3 % too high."""
    program = two_solvers.calculix()
    if program is None:
        pytest.skip("CalculiX is not here: put ccx on the path or its place in $FEMTUNE_CALCULIX")
    two_solvers.measure(tmp_path, program)
    (tmp_path / "frame.bdf").write_text(two_solvers.deck(two_solvers.DeckErrors(height=1.03)))
    (tmp_path / "study.toml").write_text(two_solvers.study(program, with_deck=True))
    result = ft.run(tmp_path / "study.toml")
    assert result.results.update is not None
    assert result.results.update.ok
    assert "external.by-deck" in {a.code for a in result.results.alerts}
    # one run at the initial values, one for the noise, one at each of two or three points and 11 around each end
    journal = open_run_journal(tmp_path / "run")
    assert sum(journal.states().values()) < 30
    journal.close()
    names, found, sd = (result.parameters.column(c) for c in ("name", "value", "sd"))
    for name, value, deviation in zip(names, found, sd):
        assert abs(value - two_solvers.TRUE[name]) < 3.0 * deviation, (name, value, deviation)
    # both models at the initial values: of a higher section the bars are stiffer, of the same shapes
    assert result.results.model is not None
    (beside,) = result.results.model.beside_deck
    assert beside.derivatives
    assert len(beside.modes) == two_solvers.MODES
    for mode in beside.modes:
        assert mode.alike
        assert mode.mac is not None
        assert mode.mac > 0.99
        assert mode.difference_percent == pytest.approx(100.0 * (mode.deck_hz / mode.freq_hz - 1.0))


@pytest.mark.slow
def test_a_deck_that_is_too_different_is_not_used(tmp_path: Path) -> None:
    """Springs that are three times those of the deck: differences are taken, and the result is the same."""
    chain = Chain(tmp_path, 3000.0)
    result = ft.run(chain.study())
    np.testing.assert_allclose(values(result), chain.optimum(), rtol=2e-3)
    assert result.results.model is not None
    said = next(n for n in result.results.model.notices if n.code == "external.deck")
    assert said.level == "warning"
    assert "not used" in said.sentence
    check_shown("external.deck, misleading", f"[external.deck] {re.sub(r'mode 2 at.*', 'mode 2 …', said.sentence)}")


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("external.study, no deck", 'deck = "chain.bdf"\n', ""),
        ("external.study, no fields", 'fields = ["CELAS2 8 K"]\n', ""),
        ("external.study, input of both", 'derivatives = "deck"\n', ""),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, name: str, old: str, new: str) -> None:
    study = Chain(tmp_path, 0.0).study()
    assert old in study.read_text()
    study.write_text(study.read_text().replace(old, new))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    check_shown(name, str(caught.value).replace(str(tmp_path), "FOLDER"))


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ('derivatives = "deck"', 'derivatives = "decks"', "study.value"),
        ("CELAS2 8 K", "CELAS2 9 K", "study.unknown-field"),
        ("chain.bdf", "other.bdf", "study.missing-file"),
    ],
)
def test_other_mistakes_have_the_errors_of_every_study(tmp_path: Path, old: str, new: str, code: str) -> None:
    study = Chain(tmp_path, 0.0).study()
    assert old in study.read_text()
    study.write_text(study.read_text().replace(old, new))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    assert caught.value.code == code


@pytest.mark.slow
def test_both_models_are_compared_and_nothing_is_differenced(tmp_path: Path) -> None:
    """The nominal run and its repetition; frequencies of the deck are those of its formula."""
    chain = Chain(tmp_path, 0.0)
    info = ft.info(chain.study())
    notices = {n.code: n for n in info.notices}
    assert chain.started == 2
    said = notices["external.deck"].sentence
    # the same springs, and masses of 1/1.02
    assert said.count(f"{100 * (1.02**0.5 - 1):+.2g} % (MAC 1.000)") == N
    # the record says the same
    (beside,) = info.record.beside_deck
    assert beside.derivatives
    assert [m.mac for m in beside.modes] == pytest.approx([1.0] * N)
    assert [m.difference_percent for m in beside.modes] == pytest.approx([100 * (1.02**0.5 - 1)] * N)
    check_shown("external.deck", f"[external.deck] {re.sub(r'mode 2 at.*', 'mode 2 …', said)}")
    runs = notices["external.runs"].sentence
    check_shown("external.runs, deck", f"[external.runs] {runs}")
