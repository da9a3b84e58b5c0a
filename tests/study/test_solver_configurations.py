"""Several configurations with runs of their own: the same masses free and bolted, in a solver and in tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.runs_table import RunsTable, write_runs_table

from .two_masses import SCRIPT, TRUTH, exact, of_both_masses, prepared, started

BOLT = 430.0
DOFS = DofSet.parse(["1Z+", "2Z+"])
PARAMETER = """
[[parameter]]
name = "bolt"
absolute = true
lower = 100.0
upper = 900.0

[residuals]
"""
CONFIGURATIONS = """[[configuration]]
name = "free"
test = "free.uff"

[[configuration]]
name = "bolted"
test = "bolted.uff"
{own}
"""


def bolted(k1: float, k2: float, bolt: float) -> tuple[np.ndarray, np.ndarray]:
    """A bolt is a spring to ground at the first mass."""
    return exact(k1 + bolt, k2)


def with_configurations(path: Path, own: str) -> None:
    """Two tests and a parameter that the second configuration has alone."""
    for name, modes in (("free", exact(*TRUTH)), ("bolted", bolted(*TRUTH, BOLT))):
        ft.write_test(of_both_masses(modes, name), path.parent / f"{name}.uff")
    text = path.read_text().replace('[test]\nfile = "test.uff"\n', CONFIGURATIONS.format(own=own))
    path.write_text(text.replace("\n[residuals]\n", PARAMETER))


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = prepared(tmp_path)
    (tmp_path / "bolted.txt").write_text("{{k1}}\n{{k2}}\n{{bolt}}\n")
    script = SCRIPT.replace('k1, k2 = (float(x) for x in open("in.txt"))', _READ)
    (tmp_path / "bolted.py").write_text(script)
    command = path.read_text().split("command = ")[1].split("\n")[0].replace("solve.py", "bolted.py")
    own = f'solver = {{ command = {command}, templates = ["bolted.txt"], files = ["bolted.py"] }}'
    with_configurations(path, own)
    return path


_READ = 'k1, k2, bolt = (float(x) for x in open("bolted.txt"))\nk1 += bolt'


@pytest.mark.slow
def test_each_configuration_has_its_own_modes_and_a_foreign_parameter_costs_no_run(study: Path) -> None:
    found = ft.modes(study)
    hz = {name: modes.freq_hz for name, modes in found.mode_sets.items()}
    np.testing.assert_allclose(hz["free"], exact(800.0, 1000.0)[0], rtol=1e-6)
    np.testing.assert_allclose(hz["bolted"], bolted(800.0, 1000.0, 500.0)[0], rtol=1e-6)
    # the initial values, twice, and two runs for each of two and of three parameters
    assert started(study) == (2 + 4) + (2 + 6)


@pytest.mark.slow
def test_a_missing_program_is_said_of_its_configuration(study: Path) -> None:
    whole = study.read_text()
    before, own = whole.split("solver = {")
    rest = own.split("]", 1)[1]
    study.write_text(f'{before}solver = {{ command = ["absent-program"]{rest}')
    with pytest.raises(FemtuneError) as caught:
        ft.modes(study)
    assert caught.value.code == "external.no-program"
    assert "configuration[2].solver.command" in str(caught.value)


def test_a_run_that_fails_is_said_of_its_configuration_with_the_last_line_of_the_solver(study: Path) -> None:
    script = study.parent / "bolted.py"
    lines = "import sys\nprint('reading', flush=True)\nprint('card 17 is not known', file=sys.stderr)\nsys.exit(3)\n"
    script.write_text(lines)
    with pytest.raises(FemtuneError) as caught:
        ft.modes(study)
    shown = str(caught.value).replace(str(study.parent), "FOLDER")
    check_shown("external.failed, configuration", "\n".join(p.partition("/external/")[0] for p in shown.splitlines()))


def test_a_placeholder_that_is_no_parameter_is_said_of_the_templates_of_its_configuration(study: Path) -> None:
    (study.parent / "bolted.txt").write_text("{{k1}}\n{{k2}}\n{{blot}}\n")
    with pytest.raises(FemtuneError) as caught:
        ft.modes(study)
    check_shown("external.placeholder, configuration", str(caught.value).replace(str(study.parent), "FOLDER"))


@pytest.mark.slow
def test_an_update_with_both_configurations(study: Path) -> None:
    result = ft.run(study)
    table = result.parameters
    found = dict(zip(table.column("name"), table.column("value")))
    np.testing.assert_allclose([found["k1"], found["k2"], found["bolt"]], [*TRUTH, BOLT], rtol=1e-5)
    updated = study.parent / "run" / "external" / "updated"
    assert sorted(p.name for p in updated.iterdir()) == ["1-free", "2-bolted"]
    values = (updated / "2-bolted" / "bolted.txt").read_text().split()
    np.testing.assert_allclose([float(v) for v in values], [*TRUTH, BOLT], rtol=1e-5)


@pytest.mark.long
def test_screening_and_candidates_with_both_configurations(study: Path) -> None:
    found = ft.screen(study)
    effects = {(e.parameter, e.configuration): e.contribution for e in found.record.effects if e.mode == 1}
    # nothing but the product of the other two, with which it is confounded
    assert effects["bolt", "free"] < 1e-4
    sets = {"without the bolt": ["k1", "k2"], "with the bolt": ["k1", "k2", "bolt"]}
    listed = (f"\n[[candidate]]\nname = {name!r}\nparameters = {of}\n" for name, of in sets.items())
    text = study.read_text() + "".join(listed)
    study.write_text(text)
    records = {c.parameters: c for c in ft.candidates(study).record.candidates}
    assert [names for names, c in records.items() if c.admissible] == [("k1", "k2", "bolt")]
    # without the bolted test nothing tells of the bolt, and its initial value predicts that test
    left = records["k1", "k2", "bolt"].left_out
    assert [entry.configuration for entry in left] == ["free", "bolted"]


TABLES = """[study]
title = "Two masses"
units = "m-kg-s"

[runs]
file = "free.csv"

[sensors]
by_id = true

[test]
file = "test.uff"

[[parameter]]
name = "k1"
absolute = true
lower = 1100.0
upper = 1400.0

[[parameter]]
name = "k2"
absolute = true
lower = 800.0
upper = 1050.0

[residuals]
frequency_sd = 0.001
shape_sd = 0.01
"""


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    rng = np.random.default_rng(4)
    points = rng.uniform([1100.0, 800.0, 100.0], [1400.0, 1050.0, 900.0], (40, 3))
    for name, solve, count in (("free", exact, 2), ("bolted", bolted, 3)):
        found = [solve(*p[:count]) for p in points]
        columns = dict(zip(("k1", "k2", "bolt")[:count], points.T))
        runs = RunsTable(columns, np.array([hz for hz, _ in found]), np.array([phi for _, phi in found]), DOFS)
        write_runs_table(tmp_path / f"{name}.csv", runs)
    path = tmp_path / "study.toml"
    path.write_text(TABLES)
    with_configurations(path, 'runs = "bolted.csv"')
    return path


@pytest.mark.slow
def test_tables_of_two_configurations(tables: Path) -> None:
    """Stiffness and mass of two masses in the basis of their own modes are polynomials up to the weak coupling."""
    result = ft.run(tables)
    table = result.parameters
    found = dict(zip(table.column("name"), table.column("value")))
    np.testing.assert_allclose([found["k1"], found["k2"], found["bolt"]], [*TRUTH, BOLT], rtol=1e-3)


def test_a_missing_table_is_said_of_its_configuration(tables: Path) -> None:
    (tables.parent / "bolted.csv").unlink()
    with pytest.raises(FemtuneError) as caught:
        ft.info(tables)
    check_shown(
        "study.missing-file, table of runs of a configuration", str(caught.value).replace(str(tables.parent), "FOLDER")
    )


def test_several_tables_need_shapes(tables: Path) -> None:
    text = (tables.parent / "bolted.csv").read_text().splitlines()
    keep = [i for i, head in enumerate(text[0].split(",")) if not head.startswith("shape")]
    lines = [",".join(line.split(",")[i] for i in keep) for line in text]
    (tables.parent / "bolted.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(FemtuneError) as caught:
        ft.info(tables)
    check_shown("runs.study, shapes", str(caught.value).replace(str(tables.parent), "FOLDER"))


@pytest.mark.parametrize(("name", "own"), [("other", 'solver = { command = "x" }'), ("alone", 'runs = "bolted.csv"')])
def test_runs_of_a_configuration_belong_to_a_table(tables: Path, name: str, own: str) -> None:
    text = tables.read_text().replace('runs = "bolted.csv"', own)
    if name == "alone":
        (tables.parent / "a.bdf").write_text("ENDDATA\n")
        text = text.replace('[runs]\nfile = "free.csv"\n', "").replace('units = "m', 'deck = "a.bdf"\nunits = "m')
    tables.write_text(text)
    with pytest.raises(FemtuneError) as caught:
        ft.info(tables)
    check_shown(f"runs.study, {name}", str(caught.value).replace(str(tables.parent), "FOLDER"))
