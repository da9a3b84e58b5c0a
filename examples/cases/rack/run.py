"""Update an experiment rack and predict its sweep and random vibration tests: python run.py [--quick] [--evidence DIR].

A rack of aluminium tubes and steel panels, whose joints no model has, is weighed and tested in ropes. A model of beams
and shells is screened by an orthogonal array. It and a model of solids, which CalculiX solves (`ccx` on the path, or
$FEMTUNE_CALCULIX), are compared; the first one is updated, also by a genetic algorithm on a Kriging surrogate. It
then predicts a sine sweep and a random vibration test on a table, where the rack is bolted down. The program judges by
the limits of the studies. What it says of the updated models is not asserted; the initial ones must fail.

The model of solids is solved once only. `--solid update` of the full form updates it with some 50 runs of CalculiX, of
3 s each, and predicts the sweep; `--solid predict` adds random vibration, two runs of some minutes with the modes to
2000 Hz, and what decides over it, from matrices that CalculiX writes; `--solid search` also the search, 250 runs in
all. With --folder their journal is kept, so that an
interrupted run continues.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from causes import LOOKED_AT, Causes, Table, causes, conclusions, handbook_words
from causes import lines as lines_of_causes
from geometry import FIELDS, NOMINAL
from laboratory import (
    LEVEL,
    RATE,
    SPECTRUM,
    SPECTRUM_HZ,
    SWEEP_HZ,
    modal_test,
    on_table,
    random_vibration,
    resonance_search,
    sweep,
    write_curves,
)  # fmt: skip
from mixed import deck_text, foot_points
from scipy.optimize import linear_sum_assignment
from solid import SolidMesh
from with_calculix import FREE_MODES, beside_mixed, weighed_density, write_inputs

import femtune as ft
from femtune.document.figures.vibration import VibrationCurve, VibrationPanel, vibration_svg
from femtune.modal import ModeSet
from femtune.steps.correlate.record.correlation import CorrelationResults
from femtune.steps.run.result import RunResult
from femtune.steps.screen.result import ScreenResult
from femtune.steps.search.result import SearchResult
from femtune.steps.update.record.update import ParameterResult
from femtune.steps.vibration.record import VibrationResults

POINTS = {"A1": "913X+", "A2": "902X+", "A3": "903X+", "A4": "912X+"}
"""On the front posts at a quarter, half and all of the height, and at the top of the back."""
BOUNDS = {"E1": (50.0e9, 78.0e9), "E2": (168.0e9, 230.0e9), "E3": (40.0e9, 95.0e9), "E4": (40.0e9, 230.0e9),
          "D2": (7000.0, 8600.0)}  # fmt: skip
"""Of the parameters that are updated; D2 of the solid model follows from its mass."""
LIMITS = {"frequency_error": 0.05, "mac": 0.9, "sweep_frequency": 0.05, "sweep_amplitude": 0.05, "random_rms": 0.07}
OF_TESTS = {"sweep": ("sweep_frequency", "sweep_amplitude"), "random": ("random_rms",)}
"""The limits that a test on the table has."""
MODES_USED = 6
PARTS_HZ = (10.0, 60.0, 150.0, 300.0, 600.0, 1200.0, 2000.0)
"""Ends of the parts of the band in which RMS values of random vibration are shown."""
FREQUENCY_SD, MASS_SD = 0.01, 0.002
MOVES = 5
"""How often the update of the solid model moves to another point at most."""
AGREE = {"mixed": 2e-3, "solid": 2e-2}
"""Relative difference of the values of search and update; derivatives of the solid model are differences of runs."""


MIXED_MODES, SEARCH_MODES, TRUE_MODES = 230, 20, 230
"""Modes of the mixed model that vibration tests superpose, and that a search needs; those of the true rack. 230 modes
reach to 2.9 kHz in both."""


@dataclass(frozen=True)
class Size:
    """Effort: points of the Latin hypercube, generations and seeds of the search, and whether solids are updated."""

    runs: int
    generations: int
    seeds: int
    solid: bool


QUICK, FULL = Size(30, 60, 1, False), Size(150, 300, 3, True)


@dataclass(frozen=True, eq=False)
class Measured:
    """What the laboratory found: mass, modes with their damping ratios on the table, and random vibration.

    The latter is frequencies (n,) and power spectral densities (points, n).
    """

    mass: float
    on_table: ModeSet
    random: tuple[np.ndarray, np.ndarray]


def measure(folder: Path) -> Measured:
    """All tests of the true rack, as files."""
    mass = modal_test(folder, 1)
    outputs = list(POINTS.values())
    rack = on_table(folder, outputs, TRUE_MODES)
    write_curves(folder / "sweep.csv", *sweep(rack, 2), outputs)
    random = random_vibration(rack, 3)
    write_curves(folder / "random.csv", *random, outputs)
    return Measured(mass, resonance_search(rack, outputs, 4), random)


def mixed_study(measured: Measured, size: Size) -> str:
    """The study file of the mixed model."""
    feet = [f"{node}:123456" for node in foot_points()]
    parameters = "".join(_parameter(name, BOUNDS[name], fields=True) for name in BOUNDS)
    head = f"""[study]
title = "Experiment rack, mixed model"
deck = "mixed.bdf"
units = "m-kg-s"

[modes]
count = {MIXED_MODES}
"""
    table = f'[[configuration]]\nname = "table"\nsupports_added = {feet}\n'
    mass = f"""[[residual]]
kind = "mass"
configuration = "in ropes"
mass = {measured.mass:.3f}
sd = {MASS_SD}
"""
    tests = _vibrations(measured, dict.fromkeys(OF_TESTS, 'configuration = "table"'))
    parts = (head, _test(""), table, parameters, mass, _search(size), tests)
    return "\n".join(parts).replace("'", '"')


def for_search(study: str) -> str:
    """The study of the mixed model without its vibration tests, and with the modes that a search needs."""
    short = study[: study.index("[[vibration]]")]
    return short.replace(f"count = {MIXED_MODES}", f"count = {SEARCH_MODES}")


def solid_study(measured: Measured, size: Size, program: str, predict: bool) -> str:
    """The study file of the solid model, one folder below the tests; `predict` adds random vibration."""
    parameters = "".join(_parameter(name, BOUNDS[name], fields=False) for name in BOUNDS if name != "D2")
    head = f'''[study]
title = "Experiment rack, solid model"
units = "m-kg-s"

[model]
grid = "free.inp"

[modes]
count = {FREE_MODES}

[solver]
command = ["{program}", "free"]
templates = ["free.inp"]
result = "free.frd"
format = "calculix-frd"
environment = {{ OMP_NUM_THREADS = "1" }}
moves = {MOVES}

[parallel]
workers = 1
'''
    names = {"sweep": "swept", "random": "shaken"} if predict else {"sweep": "swept"}
    structures = {
        kind: f'solver = {{ command = ["{program}", "{name}"], templates = ["{name}.inp"], result = "{name}.frd" }}'
        for kind, name in names.items()
    }
    tests = _vibrations(measured, structures, "../")
    parts = (head, _test("../"), parameters, _search(size), tests)
    return "\n".join(parts).replace("'", '"')


def _test(above: str) -> str:
    """Modal test, sensors and weights."""
    unused = ", ".join(f'{{ mode = "{m}", reason = "above the band of interest" }}' for m in (7, 8))
    return f'''[[configuration]]
name = "in ropes"
test = "{above}rack.uff"
leave_out = [{unused}]

[sensors]
by_id = true

[residuals]
frequency_sd = {FREQUENCY_SD}
'''


def _search(size: Size) -> str:
    return f"""[search]
runs = {size.runs}
method = "genetic"
population = 100
generations = {size.generations}
seeds = {size.seeds}
"""


def _vibrations(measured: Measured, structures: dict[str, str], above: str = "") -> str:
    """Tests on the table, by kind with the key that names the structure on it, and the limits."""
    modes = measured.on_table
    assert modes.damping_ratio is not None
    common = f"""base = "X"
outputs = {list(POINTS.values())}
damping_ratio = {[round(float(r), 5) for r in modes.damping_ratio]}
damping_hz = {[round(float(f), 2) for f in modes.freq_hz]}
damping_source = "resonance search on the table at a low level, identified"
"""
    own = {
        "sweep": f'''from_hz = {SWEEP_HZ[0]}
to_hz = {SWEEP_HZ[1]}
rate = {RATE}
amplitude = {LEVEL}
measured = "{above}sweep.csv"
band_hz = [20.0, 60.0]
''',
        "random": f'''spectrum_hz = {list(SPECTRUM_HZ)}
spectrum = {list(SPECTRUM)}
measured = "{above}random.csv"
''',
    }
    tests = [
        f'[[vibration]]\nname = "{kind} X"\nkind = "{kind}"\n{structure}\n{common}{own[kind]}'
        for kind, structure in structures.items()
    ]
    unused = {key for kind, keys in OF_TESTS.items() if kind not in structures for key in keys}
    limits = [f"{key} = {value}" for key, value in LIMITS.items() if key not in unused]
    return "\n".join([*tests, "[validate]", 'profile = "own"', *limits, ""])


def screening() -> str:
    """The study file of the screening: six parameters at 80, 100 and 120 %."""
    levels = {name: (0.8 * value, 1.2 * value) for name, value in NOMINAL.items()}
    parameters = "".join(_parameter(name, bounds, fields=True) for name, bounds in levels.items())
    head = (
        '[study]\ntitle = "Experiment rack, screening"\ndeck = "mixed.bdf"\nunits = "m-kg-s"\n\n[modes]\ncount = 14\n\n'
    )
    return f'{head}{parameters}[screen]\narray = "L18"\n'


def _parameter(name: str, bounds: tuple[float, float], fields: bool) -> str:
    """A parameter of fields of the deck, or of a placeholder."""
    unit = "Pa" if name.startswith("E") else "kg/m^3"
    target = f"fields = {list(FIELDS[name])}" if fields else f"nominal = {NOMINAL[name]}"
    return (
        f'[[parameter]]\nname = "{name}"\n{target}\nabsolute = true\nunit = "{unit}"\n'
        f"lower = {bounds[0]}\nupper = {bounds[1]}\n\n"
    ).replace("'", '"')


@dataclass(frozen=True)
class Model:
    """Update of one of the models, and its search where it was made."""

    name: str
    searched: SearchResult | None
    run: RunResult


@dataclass(frozen=True, eq=False)
class Beside:
    """Frequencies of both models at the values of the drawings, and MAC (solid, mixed)."""

    solid_hz: np.ndarray
    mixed_hz: np.ndarray
    mac: np.ndarray


@dataclass(frozen=True)
class Found:
    """All steps: the mixed model first, and the solid one where it was updated, with what decides over its RMS."""

    measured: Measured
    screened: ScreenResult
    models: tuple[Model, ...]
    beside: Beside | None
    causes: Causes | None = None


def update(folder: Path, size: Size, solid: str) -> Found:
    """Tests, screening, search and update; with the solid model as far as `solid` says, where CalculiX is here."""
    measured = measure(folder)
    (folder / "mixed.bdf").write_text(deck_text())
    (folder / "screen.toml").write_text(screening())
    study = mixed_study(measured, size)
    (folder / "search.toml").write_text(for_search(study))
    (folder / "study.toml").write_text(study)
    screened = ft.screen(folder / "screen.toml")
    models = [Model("mixed", ft.search(folder / "search.toml"), ft.run(folder / "study.toml"))]
    program, beside = os.environ.get("FEMTUNE_CALCULIX") or (shutil.which("ccx") and "ccx"), None
    if program:
        beside = Beside(*beside_mixed(program, folder / "drawings"))
        if size.solid and solid != "drawings":
            write_inputs(folder / "solid", round(measured.mass, 3))
            path = folder / "solid" / "study.toml"
            path.write_text(solid_study(measured, size, program, solid != "update"))
            searched = ft.search(path) if solid == "search" else None
            models.append(Model("solid", searched, ft.run(path)))
    if program and len(models) > 1 and solid != "update":
        modes = measured.on_table
        assert modes.damping_ratio is not None
        table = Table(modes.damping_ratio, modes.freq_hz, tuple(POINTS.values()))
        mixed, of_solid = (_found_values(model) for model in models)
        of_solid["D2"] = weighed_density(round(measured.mass, 3))
        why = causes(program, folder, table, (mixed, of_solid), (FREQUENCY_SD, MODES_USED), BOUNDS)
        return Found(measured, screened, tuple(models), beside, why)
    return Found(measured, screened, tuple(models), beside)


def _parameters(model: Model) -> tuple[ParameterResult, ...]:
    update = model.run.results.update
    assert update is not None
    return update.parameters


def _found_values(model: Model) -> dict[str, float]:
    return {p.name: p.value for p in _parameters(model)}


def check(found: Found) -> None:
    """What does not depend on the verdicts: initial models fail, and the steps agree with each other."""
    assert found.screened.record.failed == ()
    for model in found.models:
        verdicts = _verdicts(model)
        assert verdicts["frequency error"][1] == "fail", verdicts
        assert verdicts["resonance frequency error in a sweep"][1] == "fail", verdicts
        assert all(v[2] in ("pass", "fail") for v in verdicts.values()), verdicts
        update = model.run.results.update
        assert update is not None
        # the moves of the solid model are limited; the page states how the update ended
        assert update.ok or model.name == "solid", update.status
        if model.searched is None:
            continue
        assert model.searched.record.surrogate is not None
        assert model.searched.record.failed == ()
        # search and update are two ways to one minimum
        for parameter in update.parameters:
            other = model.searched.values[parameter.name]
            assert abs(other / parameter.value - 1.0) < AGREE[model.name], (parameter.name, other, parameter.value)
    if found.beside is not None:
        pairs = linear_sum_assignment(-found.beside.mac)
        assert found.beside.mac[pairs][:MODES_USED].min() > 0.9, found.beside.mac


def _verdicts(model: Model) -> dict[str, tuple[str, str, str, str]]:
    """By quantity: value and verdict before and after the update, as the program states them."""
    out: dict[str, tuple[str, str, str, str]] = {}
    by_stage = _correlated(model)
    for one, other in zip(by_stage["before"].criteria, by_stage["after"].criteria, strict=True):
        name = one.name.partition(",")[0]
        out[name] = (_value(one.measured, one.unit), one.verdict, other.verdict, _value(other.measured, other.unit))
    validation = model.run.results.validation
    assert validation is not None
    for v in validation.verdicts:
        out[v.criterion.partition(",")[0]] = (
            _value(v.before, v.unit), v.before_verdict or "", v.verdict, _value(v.measured, v.unit)
        )  # fmt: skip
    return out


def _with_test(found: Found, kind: str) -> list[Model]:
    """The models that predict a kind of test."""
    validated = [(m, m.run.results.validation) for m in found.models]
    return [m for m, v in validated if v is not None and any(t.kind == kind for t in v.vibrations)]


def _correlated(model: Model) -> dict[str, CorrelationResults]:
    """Modal test and model, before and after the update."""
    return {c.stage: c for c in model.run.results.correlations if c.configuration == "in ropes"}


def _value(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.3g} {unit}".rstrip()


def text(found: Found) -> str:
    """The page."""
    return "\n".join([
        "# An experiment rack: screening, Kriging, genetic algorithm, and proof by sweep and random vibration", "",
        "A rack of 0.6 × 0.45 × 1 m: aluminium tubes, steel blocks at the corners, steel panels in the back and two "
        f"boards; {found.measured.mass:.2f} kg. The true rack is simulated. It has a mesh twice as fine, joints of "
        "tubes and blocks that yield, panels on single screws, feet on bolts, a cable, and other moduli and densities "
        "than on the drawings. No model has these joints: in both models joints are rigid, panels are held along their "
        "whole edges, and the feet are fixed on the table. The mixed model is of beams and shells and solved by "
        "femtune; the solid model is a continuum of hexahedra (C3D8I) and solved by CalculiX.", "",
        HISTORY, "",
        *_screening(found), *_beside(found), *(line for model in found.models for line in _updated(found, model)),
        *_judged(found), *_sweeps(found), *_randoms(found), *_why(found),
    ])  # fmt: skip


HISTORY = (
    "The truth was fixed before any update and has not changed since. The prediction is not blind in two respects. A "
    "first form of this example, without the parameter E4 and with random vibration to 500 Hz, failed: the error of "
    "the RMS was 35 % at A4, because the back moves in its plane at 263 Hz with the shear of screws and joints, which "
    "no parameter represented, and -30 % at A1, where resonances of the true rack near 506 Hz hold nearly half of the "
    "mean square to 500 Hz: this band ends on their flank. After that the edges of the panels became an area of their "
    "own, and the band became that of the paper that the example follows, 10 to 2000 Hz. With the new area alone the "
    "errors to 500 Hz were up to 11 %, above the limit of 7 %."
)


def _screening(found: Found) -> list[str]:
    record = found.screened.record
    modes = record.modes[:MODES_USED]
    lines = [
        "## Screening", "",
        f"{record.design}, {record.runs} runs of the mixed model, each parameter at 80, 100 and 120 %: E1 tubes, E2 "
        "steel, E3 tubes within 80 mm of a block, E4 panels within 80 mm of a tube, D1 aluminium, D2 steel. "
        "Contribution to each of the first six elastic frequencies in %.", "",
        "| parameter | " + " | ".join(f"{m.mean_hz:.0f} Hz" for m in modes) + " |", "| --- " * 7 + "|",
    ]  # fmt: skip
    for p in record.parameters:
        of = {e.mode: e for e in record.effects if e.parameter == p.name}
        lines.append(f"| {p.name} | " + " | ".join(f"{100 * of[m.mode].contribution:.1f}" for m in modes) + " |")
    lines.append("| not explained | " + " | ".join(f"{100 * m.error_contribution:.2f}" for m in modes) + " |")
    means = {
        p.name: float(np.mean([e.contribution for e in record.effects if e.parameter == p.name and e.mode in of]))
        for p in record.parameters
    }
    order = ", ".join(f"{name} {100 * value:.1f} %" for name, value in sorted(means.items(), key=lambda m: -m[1]))
    return [
        *lines, "",
        f"Means of the six: {order}. D1 keeps its nominal value: light alloys hardly differ in density. E2 and E4 "
        "contribute little to these frequencies, but the stiffness of the panels decides on the table: they are "
        "updated with the other three.", "",
    ]  # fmt: skip


def _beside(found: Found) -> list[str]:
    """Both models at the values of the drawings, where CalculiX solved the solid one."""
    if found.beside is None:
        return []
    b = found.beside
    rows = [
        f"| {i} | {hz:.2f} | " + " | ".join(f"{v:.3f}" for v in b.mac[i - 1, :MODES_USED]) + " |"
        for i, hz in enumerate(b.solid_hz[:MODES_USED], start=1)
    ]
    heads = " | ".join(f"{i}: {hz:.2f} Hz" for i, hz in enumerate(b.mixed_hz[:MODES_USED], start=1))
    return [
        "## The two models", "",
        f"MAC of the solid model ({len(SolidMesh().nodes)} nodes, rows) and the mixed one (columns) at the sensors, "
        "free, at the values of the drawings. Both have the same modes in the same order; the frequencies of the solid "
        "model are higher because its mesh is coarse: with quadratic elements (C3D20R) they are about 3 to 4 % lower.",
        "", f"| solid | Hz | {heads} |", "| --- " * (MODES_USED + 2) + "|", *rows, "",
        *(() if len(found.models) > 1 else (UPDATED_ALONE, "")),
    ]  # fmt: skip


UPDATED_ALONE = (
    "The mixed model alone is updated here. That of the solid model takes some 50 runs of CalculiX (`--solid update`), "
    "its random vibration and its search some more (`--solid predict`, `--solid search`)."
)


def _updated(found: Found, model: Model) -> list[str]:
    """Search, update and frequencies of a model."""
    how = {
        "mixed": "Six frequencies (σ 1 %) and the weighed mass (σ 0.2 %).",
        "solid": "Six frequencies (σ 1 %). The density of the steel follows from the weighed mass beforehand, since a "
        "model of a solver has no mass residual. Sweep and random vibration were predicted once, with all of the above "
        "fixed before.",
    }[model.name]
    missing = [] if model.searched else ["the search of 150 points (`--solid search`)"]
    missing += (
        [] if model in _with_test(found, "random") else ["the prediction of random vibration (`--solid predict`)"]
    )
    update = model.run.results.update
    assert update is not None
    if not update.ok:
        how += f" The update may move {MOVES} times, and had not settled then"
        stop = next((a.sentence for a in model.run.results.alerts if a.code == "external.not-settled"), "")
        how += f": {stop}." if stop else "."
    if missing:
        how += f" Not done with this model for this page: {', '.join(missing)}."
    by_stage = _correlated(model)
    lines = [f"## Update of the {model.name} model", "", how, "", *_values(model), ""]
    lines += ["| mode | test Hz | error before % | MAC before | error after % | MAC after |", "| --- " * 6 + "|"]
    for one, other in zip(by_stage["before"].pairs, by_stage["after"].pairs, strict=True):
        lines.append(
            f"| {one.test_label} | {one.test_freq_hz:.2f} | {one.freq_error_percent:+.2f} | {one.mac:.3f} "
            f"| {other.freq_error_percent:+.2f} | {other.mac:.3f} |"
        )
    return [*lines, ""]


def _values(model: Model) -> list[str]:
    """The search in words, and the parameters."""
    update = model.run.results.update
    assert update is not None
    lines, searched = [], {}
    if model.searched is not None:
        record = model.searched.record
        lines = [
            f"Search: {record.runs} runs of the model, Kriging, genetic algorithm with a population of 100, then least "
            "squares on the model. " + " ".join(_sentence(s) for s in record.sentences), "",
        ]  # fmt: skip
        searched = {p.name: (p.found, p.value) for p in record.parameters}
    heads = ["parameter", "bounds", "initial", *(("genetic algorithm", "least squares after it") if searched else ())]
    heads += ["`femtune update`", "standard deviation", "95 % interval"]
    lines += ["| " + " | ".join([*heads, "at a bound"]) + " |", "| --- " * (len(heads) + 1) + "|"]
    for p in update.parameters:
        scale = 1e9 if p.name.startswith("E") else 1.0
        low, high = BOUNDS[p.name]
        cells = " | ".join(f"{n / scale:.5g}" for n in (NOMINAL[p.name], *searched.get(p.name, ()), p.value))
        spread = f"{p.sd / scale:.3g}" if p.sd is not None else "–"
        interval = "–" if p.interval_95 is None else " to ".join(f"{v / scale:.4g}" for v in p.interval_95)
        lines.append(
            f"| {p.name} | {low / scale:g} to {high / scale:g} | {cells} | {spread} | {interval} "
            f"| {p.at_bound or '–'} |"
        )
    return [*lines, "", UNITS_AND_INTERVALS]


UNITS_AND_INTERVALS = (
    "Moduli in GPa, densities in kg/m³. Standard deviations and intervals are those of the data within the bounds: an "
    "interval nearly as wide as the bounds says that the data do not determine the parameter."
)


def _sentence(words: str) -> str:
    first = words[0] if words[0] == "χ" else words[0].upper()
    return f"{first}{words[1:].rstrip('.')}."


def _judged(found: Found) -> list[str]:
    lines = [
        "## Verdicts", "",
        "By `[validate]` of the studies. The updates used the frequencies of the modal test and the mass only; sweep "
        "and random vibration are predictions.", "",
        "| model | quantity | before | verdict | after | verdict |", "| --- " * 6 + "|",
    ]  # fmt: skip
    for model in found.models:
        for name, (before, first, last, after) in _verdicts(model).items():
            lines.append(f"| {model.name} | {name} | {before} | {first} | {after} | {last} |")
    return [*lines, "", *promises({model.name: _verdicts(model) for model in found.models})]


def promises(of_models: dict[str, dict[str, tuple[str, str, str, str]]]) -> list[str]:
    """Which promises of the paper are kept, from the verdicts of the models."""
    lines = [
        "The paper promises the first six frequencies within 5 %, the sweep within 5 % and the RMS within 7 %. Kept "
        "here:", "", "| model | six frequencies | sweep | RMS in random vibration |", "| --- " * 4 + "|",
    ]  # fmt: skip
    for model, verdicts in of_models.items():
        cells = []
        for names in PROMISES:
            some = [v for name, v in verdicts.items() if name in names]
            broken = [v[3] for v in some if v[2] != "pass"]
            otherwise = "kept" if some else "not predicted"
            cells.append(f"not kept: {', '.join(broken)}" if broken else otherwise)
        lines.append(f"| {model} | {' | '.join(cells)} |")
    return [*lines, ""]


PROMISES = (
    ("frequency error",),
    ("resonance frequency error in a sweep", "error of the largest response in a sweep"),
    ("RMS error in random vibration",),
)
"""Quantities of the verdicts, by promise."""


def _vibration(model: Model, kind: str) -> VibrationResults:
    assert model.run.results.validation is not None
    return next(v for v in model.run.results.validation.vibrations if v.kind == kind)


def _sweeps(found: Found) -> list[str]:
    swept = _vibration(found.models[0], "sweep")
    assert swept.compared_hz is not None
    names = {dof: name for name, dof in POINTS.items()}
    lines = [
        "## Sine sweep", "",
        f"{_sentence(swept.excitation + ' g')} Compared from {swept.compared_hz[0]:g} to {swept.compared_hz[1]:g} Hz, "
        f"around the first resonance. {_sentence(swept.damping)} {_sentence('source: ' + swept.damping_source)} Random "
        "vibration has the same damping.", "",
        "| model | point | test g | before g | after g | error after % | test Hz | before Hz | after Hz "
        "| error after % |", "| --- " * 10 + "|",
    ]  # fmt: skip
    for model in _with_test(found, "sweep"):
        for p in _vibration(model, "sweep").points:
            levels = " | ".join(f"{v:.3g}" for v in (p.test_peak, p.before_peak, p.peak))
            places = " | ".join(f"{v:.2f}" for v in (p.test_peak_hz, p.before_peak_hz, p.peak_hz))
            errors = _error(p.peak, p.test_peak), _error(p.peak_hz, p.test_peak_hz)
            lines.append(f"| {model.name} | {names[p.output]} | {levels} | {errors[0]} | {places} | {errors[1]} |")
    return [*lines, "", *_pictures(found, "sweep")]


def _randoms(found: Found) -> list[str]:
    names = {dof: name for name, dof in POINTS.items()}
    lines = [
        "## Random vibration", "",
        f"{_sentence(_vibration(found.models[0], 'random').excitation)} All of it is compared.", "",
        "| model | point | test g RMS | before | after | error before % | error after % |", "| --- " * 7 + "|",
    ]  # fmt: skip
    for model in _with_test(found, "random"):
        for p in _vibration(model, "random").points:
            levels = " | ".join(f"{v:.3g}" for v in (p.test_rms, p.before_rms, p.rms))
            errors = _error(p.before_rms, p.test_rms), _error(p.rms, p.test_rms)
            lines.append(f"| {model.name} | {names[p.output]} | {levels} | {errors[0]} | {errors[1]} |")
    return [*lines, "", *_parts(found), *_pictures(found, "random")]


def _parts(found: Found) -> list[str]:
    """Errors of the RMS in parts of the band: what the RMS over all of it may hide."""
    lines = [
        "The RMS over the whole band is a sum over many resonances, whose errors compensate each other in part. In "
        "parts of the band, the error of the RMS after the update in %, from the densities:", "",
        "| model | point | " + " | ".join(f"{a:g} to {b:g} Hz" for a, b in pairwise(PARTS_HZ)) + " |",
        "| --- " * (len(PARTS_HZ) + 1) + "|",
    ]  # fmt: skip
    for model in _with_test(found, "random"):
        updated = _curves(model, "random")["after"]
        for i, name in enumerate(POINTS):
            cells = [
                _error(_rms(updated, i, part), _rms(found.measured.random, i, part)) for part in pairwise(PARTS_HZ)
            ]
            lines.append(f"| {model.name} | {name} | " + " | ".join(cells) + " |")
    return [
        *lines, "",
        "The six modes of the modal test lie below 150 Hz. Above that single resonances are not predicted: at A4 the "
        "largest one, the back that moves in its plane on the feet, is at 263 Hz in the test and higher in the models. "
        "A verdict on the RMS over all of the band is a statement about this sum alone.", "",
        *(line for model in _with_test(found, "random") for line in _of_sum(found, model)),
    ]  # fmt: skip


def _of_sum(found: Found, model: Model) -> list[str]:
    """Whether the prediction of random vibration meets its limit, and where it fails most."""
    limit = 100.0 * LIMITS["random_rms"]
    before, verdict, value = (_verdicts(model)["RMS error in random vibration"][i] for i in (0, 2, 3))
    if verdict == "pass":
        return [f"The {model.name} model meets the limit of {limit:.0f} %, with {value} after {before}.", ""]
    curve, test = _curves(model, "random")["after"], found.measured.random
    errors = {
        (part, name): _rms(curve, i, part) / _rms(test, i, part) - 1.0
        for part in pairwise(PARTS_HZ)
        for i, name in enumerate(POINTS)
    }
    (part, name), most = max(errors.items(), key=lambda item: abs(item[1]))
    low = max(abs(error) for (band, _), error in errors.items() if band[1] <= PARTS_HZ[2])
    return [
        f"**The {model.name} model does not meet the limit of {limit:.0f} %: {value}** after {before}. Below "
        f"{PARTS_HZ[2]:.0f} Hz its errors are at most {100.0 * low:.0f} %; the largest is {100.0 * most:+.0f} % at "
        f"{name} from {part[0]:.0f} to {part[1]:.0f} Hz. The causes are examined below.", "",
    ]  # fmt: skip


def _why(found: Found) -> list[str]:
    """What decides over the RMS of the solid model."""
    if found.causes is None:
        return []
    measured = np.array([_rms(found.measured.random, i, (SPECTRUM_HZ[0], SPECTRUM_HZ[-1])) for i in range(len(POINTS))])
    hz, density = found.measured.random
    above = hz > LOOKED_AT[0]
    largest = hz[above][density[:, above].argmax(axis=1)]
    e4 = next(p for m in found.models if m.name == "mixed" for p in _parameters(m) if p.name == "E4")
    assert e4.sd is not None
    mixed = f"{e4.value / 1e9:.0f} ± {e4.sd / 1e9:.0f} GPa"
    high = [_rms(found.measured.random, i, (PARTS_HZ[2], SPECTRUM_HZ[-1])) for i in range(len(POINTS))]
    share = ", ".join(f"{100.0 * part:.0f} % at {name}" for part, name in zip((high / measured) ** 2, POINTS))
    above_modal = f"Of the mean square of the test, {share} lie above {PARTS_HZ[2]:.0f} Hz, beyond the modal test."
    return [
        "## What decides over the RMS", "",
        "The stiffness matrix of the solid model is a sum of the moduli times constant matrices. CalculiX writes these "
        "matrices, and other moduli need no further run of it. E4 of the mixed model: all other parameters stay. "
        f"Handbook: an update by the same six frequencies with prior knowledge, {handbook_words()}. Finer mesh: cells "
        "half as long along the tubes and in the planes of the panels, updated in the same way. The last columns have "
        "the frequency of the largest response above 40 Hz. All of this was done "
        "after the verdicts; none of it was chosen by them, and none goes into the verdicts.", "",
        *lines_of_causes(found.causes, measured, tuple(POINTS), LIMITS["random_rms"]),
        *conclusions(found.causes, measured, tuple(POINTS), largest, LIMITS["random_rms"], mixed, above_modal),
    ]  # fmt: skip


def _rms(curve: tuple[np.ndarray, np.ndarray], point: int, part: tuple[float, float]) -> float:
    hz = np.linspace(*part, 20_001)
    return float(np.sqrt(np.trapezoid(np.interp(hz, curve[0], curve[1][point]), hz)))


def _curves(model: Model, kind: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Lines (n,) and responses (points, n) of the test, and of the model before and after the update."""
    keys, arrays = _vibration(model, kind).curves, model.run.arrays
    assert keys is not None
    of = {"test": (keys.test_lines_key, keys.test_key), "before": (keys.before_lines_key, keys.before_key),
          "after": (keys.after_lines_key, keys.after_key)}  # fmt: skip
    return {look: (arrays[hz], arrays[values]) for look, (hz, values) in of.items() if hz and values}


def _error(model: float | None, test: float | None) -> str:
    assert model is not None
    assert test is not None
    return f"{100.0 * (model / test - 1.0):+.1f}"


def _pictures(found: Found, kind: str) -> list[str]:
    words = {"sweep": "Sine sweep", "random": "Random vibration"}
    return [f"![{words[kind]}, {model.name} model]({_file(model, kind)})\n" for model in _with_test(found, kind)]


def _file(model: Model, kind: str) -> str:
    return f"cases_rack_{model.name}_{kind}.svg"


def picture(model: Model, kind: str) -> str:
    """Curves of a vibration test."""
    curves, compared = _curves(model, kind), _vibration(model, kind).compared_hz
    panels = []
    for i, (name, dof) in enumerate(POINTS.items()):
        drawn = [VibrationCurve(look, hz, values[i]) for look, (hz, values) in curves.items()]
        unit = "amplitude, g" if kind == "sweep" else "density, g²/Hz"
        panels.append(VibrationPanel(f"{name}, {dof}", unit, tuple(drawn), compared))
    return vibration_svg(panels)


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer runs of the model, and one of the solid model")
    parser.add_argument("--solid", choices=("drawings", "update", "predict", "search"), default="drawings",
                        help="what is done with the solid model in the full form")  # fmt: skip
    parser.add_argument("--folder", type=Path, help="folder of the studies, where their journals are kept")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    size = QUICK if options.quick else FULL
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        found = update(folder, size, options.solid)
        check(found)
        page = text(found)
        print(page)
        if options.evidence:
            options.evidence.mkdir(parents=True, exist_ok=True)
            (options.evidence / "cases_rack.md").write_text(page, encoding="utf-8")
            for kind, model in ((k, m) for k in OF_TESTS for m in _with_test(found, k)):
                (options.evidence / _file(model, kind)).write_text(picture(model, kind), encoding="utf-8")


if __name__ == "__main__":
    main()
