"""Studies with components: configurations of some of them, and stages on assemblies of reduced components."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.reporting.html import html_text
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult
from femtune.study.study import load_study

from .two_spans import TRUTH, write_spans

_COMPONENTS = """
[[component]]
name = "left"
elements = "1 THRU 3, 90"

[[component]]
name = "right"
elements = [5, 6, 7]
max_hz = 30.0

[reduction]
tolerance = 1e-5

[sensors]"""
_OFF = "elements_off = [5, 6, 7, 9]"
_LEFT = 'components = ["left"]'


@pytest.fixture(scope="module")
def spans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study of two spans with components."""
    own = write_spans(tmp_path_factory.mktemp("spans"))
    text = (own / "study.toml").read_text()
    (own / "study.toml").write_text(text.replace("[sensors]", _COMPONENTS[1:], 1).replace(_OFF, _LEFT))
    return own


def _changed(spans: Path, tmp_path: Path, *pairs: tuple[str, str]) -> Path:
    own = tmp_path / "spans"
    shutil.copytree(spans, own, ignore=shutil.ignore_patterns("run"))
    text = (own / "study.toml").read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    (own / "study.toml").write_text(text)
    return own / "study.toml"


@pytest.fixture(scope="module")
def run(spans: Path) -> RunResult:
    return ft.update(spans / "study.toml")


@pytest.mark.slow
def test_the_truth_is_found_with_reduced_components(run: RunResult) -> None:
    update = run.results.update
    assert update is not None
    assert update.ok
    found = {p.name: p for p in update.parameters}
    for name, (_, _, truth) in TRUTH.items():
        assert found[name].value == pytest.approx(truth, rel=2e-3), name


@pytest.mark.slow
def test_every_stage_that_compares_modes_or_frfs_is_certified(run: RunResult) -> None:
    assert run.results.update is not None
    stages = {s.name: s for s in run.results.update.stages}
    assert all(s.reduction is not None and s.reduction.certified for s in stages.values())
    # one component alone is no assembly
    (alone,) = stages["left, stiffness"].reduction.models
    assert alone.components == ()
    assert alone.truncation_percent is None
    (joint,) = stages["joint, stiffness"].reduction.models
    assert [c.name for c in joint.components] == ["left", "right"]
    assert joint.interface_dofs == 4
    assert [c.interface_dofs for c in joint.components] == [2, 2]
    assert joint.certified_error_percent <= 1e-3
    # the right component has too few modes: modes of the full model, divided into components, make up for them
    assert joint.truncation_percent > 0.1
    right = joint.components[1]
    assert right.max_hz == 30.0
    assert right.coordinates > right.modes
    # the joint is of no component, so that its parameters change none
    assert [c.builds for c in joint.components] == [1, 1]
    assert not [a for a in run.results.alerts if a.code == "update.not-certified"]


@pytest.mark.slow
def test_the_report_shows_the_components_of_each_stage(run: RunResult) -> None:
    text = html_text(build_report(run.results, run.arrays))
    assert "joint, stiffness: components" in text
    assert "Modes up to Hz" in text
    assert "4 interface DOFs, largest error of a frequency at the initial values" in text


@pytest.mark.slow
def test_a_configuration_has_the_elements_of_its_components(spans: Path, tmp_path: Path) -> None:
    study = load_study(spans / "study.toml")
    left = study.cases[0].configured.configuration
    assert left.elements_off == {5, 6, 7, 9}
    assert left.supports_added == ()
    fixed = _changed(spans, tmp_path, (_LEFT, _LEFT + '\ninterface = "fixed"'))
    held = load_study(fixed).cases[0].configured
    # the bush acts on all directions; Z and RY of grid point 4 were free
    assert dict(held.configuration.supports_added) == {4: "35"}
    assert held.n_free == study.cases[0].configured.n_free - 2


@pytest.mark.slow
def test_an_update_without_stages_uses_the_components_too(spans: Path, tmp_path: Path) -> None:
    text = (spans / "study.toml").read_text()
    stages = text[text.index("[[stage]]") :]
    names = ("mass", "eta", "b")
    entries = [f"[[parameter]]{e}" for e in text[: text.index("[[stage]]")].split("[[parameter]]")[1:]]
    pairs = [(stages, ""), *((e, "") for e in entries if any(f'name = "{n}"' in e for n in names))]
    mass = text[text.index("[[residual]]") : text.index("[[parameter]]")]
    path = _changed(spans, tmp_path, *pairs, (mass, ""))
    found = ft.update(path).results.update
    assert found is not None
    assert found.reduction is not None
    assert found.reduction.certified
    by_name = {m.configuration: m for m in found.reduction.models}
    assert by_name["left"].components == ()
    assert len(by_name["whole"].components) == 2


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('elements = "1 THRU 3, 90"\n', "", "component left has neither elements nor a region"),
        ("elements = [5, 6, 7]", "elements = [3, 5, 6, 7]", "components left and right have common elements"),
        ("elements = [5, 6, 7]", "elements = [5, 66]", "component right: no element has number 66"),
        ("elements = [5, 6, 7]", "region = { properties = [77] }", "component right: no element has property 77"),
        ("elements = [5, 6, 7]", "region = {}", "component right: its region has no condition"),
        ("elements = [5, 6, 7]", 'elements = "200 THRU 300"', "component right has no element"),
        ("max_hz = 30.0", "max_hz = 0.0", "max_hz"),
        ("elements = [5, 6, 7]", "elements = [5, 6, 7]\nmodes = 3", "modes"),
        ('name = "right"\nelements', 'name = "left"\nelements', "entry on line"),
        ('components = ["left"]', 'components = ["lefft"]', "the study has no component 'lefft'"),
        ('components = ["left"]', "components = []", "'components' is empty"),
        ('components = ["left"]', 'components = ["left", "right"]', "lists all components"),
        ('components = ["left"]', 'interface = "fixed"', "'interface' needs 'components'"),
        ('components = ["left"]', 'components = ["left"]\ninterface = "glued"', "interface"),
    ],
)
def test_what_components_cannot_be_is_refused(spans: Path, tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        load_study(_changed(spans, tmp_path, (old, new)))
    assert says in str(caught.value)
    assert "study.toml" in str(caught.value)


def test_components_that_nothing_uses_are_refused(spans: Path, tmp_path: Path) -> None:
    path = _changed(spans, tmp_path, (_LEFT, _OFF), ("[reduction]\ntolerance = 1e-5\n", ""))
    with pytest.raises(FemtuneError) as caught:
        load_study(path)
    check_shown("study.component", str(caught.value).replace(f"{path.parent}/", ""))


def test_an_interface_of_nothing_cannot_be_fixed(spans: Path, tmp_path: Path) -> None:
    path = _changed(spans, tmp_path, (_LEFT, _LEFT + '\ninterface = "fixed"'))
    deck = path.parent / "spans.bdf"
    deck.write_text("\n".join(line for line in deck.read_text().splitlines() if not line.startswith("CBUSH")) + "\n")
    text = path.read_text()
    for name in ("k", "b"):
        entry = next(e for e in text.split("[[parameter]]") if e.startswith(f'\nname = "{name}"'))
        text = text.replace("[[parameter]]" + entry.split("[[stage]]")[0], "")
    path.write_text(text[: text.index("[[stage]]")])
    with pytest.raises(FemtuneError) as caught:
        load_study(path)
    assert "have no interface to absent elements" in str(caught.value)


@pytest.mark.slow
def test_components_without_connection_are_named(spans: Path, tmp_path: Path) -> None:
    path = _changed(spans, tmp_path, ('name = "whole"', 'name = "whole"\nelements_off = [9]'))
    with pytest.raises(FemtuneError) as caught:
        ft.update(path)
    assert "component left " in str(caught.value)
    assert "configuration whole" in str(caught.value)


@pytest.mark.slow
def test_a_stage_that_is_not_certified_is_a_problem(spans: Path, tmp_path: Path) -> None:
    path = _changed(spans, tmp_path, ("tolerance = 1e-5", "tolerance = 1e-16\nfull_solutions = 4"))
    found = ft.update(path)
    alerts = [a for a in found.results.alerts if a.code == "update.not-certified"]
    assert any(a.sentence.startswith("stage joint, stiffness: ") for a in alerts)
    assert {a.level for a in alerts} == {"problem"}
