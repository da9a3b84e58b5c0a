"""Finished runs as a table: effects without any fit, further responses, and other samples of a surrogate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from structures import rack_tables as rack

HEAD = '[study]\ntitle = "rack"\nunits = "m-kg-s"\n[runs]\nfile = "runs.csv"\ndegree = 1\n'


def study(folder: Path, more: str = "", gap: bool = False) -> Path:
    """The published array of a rack, with a further response that depends on X5 and, by interaction, on X1."""
    x = rack.RUNS
    rms = 3.0 - 1e-4 * x[:, 4] + 1e-6 * (x[:, 4] - 7850.0) * (x[:, 0] - 71.0)
    heads = [*rack.NAMES, *(f"f{i}_hz" for i in range(1, 7)), "rms_g"]
    lines = [[f"{v:g}" for v in row] for row in np.column_stack([x, rack.FREQUENCIES, rms])]
    if gap:
        lines[4][-1] = ""
    (folder / "runs.csv").write_text("\n".join(map(",".join, [heads, *lines])) + "\n")
    parameters = "".join(
        f'[[parameter]]\nname = "{name}"\nabsolute = true\nnominal = {v[1]}\nlower = {v[0]}\nupper = {v[2]}\n'
        for name, v in zip(rack.NAMES, rack.VALUES)
    )
    (folder / "study.toml").write_text(HEAD + parameters + more)
    return folder / "study.toml"


def test_f_values_of_the_published_array(tmp_path: Path) -> None:
    found = ft.screen(study(tmp_path), design="table", responses=["rms_g"], csv=tmp_path / "table.csv")
    record = found.record
    assert (record.design, record.runs, record.error_freedom) == ("finished runs", 18, 7)
    assert [m.response for m in record.modes] == [""] * 6 + ["rms_g"]
    f = np.array([e.f_value for e in record.effects if e.mode <= 6]).reshape(5, 6)
    last_digit = np.where(rack.F_VALUES % 1.0 == 0.0, 1.0, 0.1)
    assert np.all(np.abs(f - rack.F_VALUES) <= 0.5 * last_digit)
    # the range analysis: means of the six runs of each level
    first = next(e for e in record.effects if (e.parameter, e.mode) == ("X3", 2))
    means = [rack.FREQUENCIES[rack.LEVELS[:, 2] == level, 1].mean() for level in range(3)]
    assert first.means_hz == pytest.approx(means)
    assert first.range_hz == pytest.approx(np.ptp(means))
    by_name = {e.parameter: e for e in record.effects if e.mode == 7}
    assert by_name["X5"].contribution > 0.95
    assert by_name["X2"].contribution < 0.01
    assert record.modes[0].freq_hz == rack.FREQUENCIES[np.abs(rack.LEVELS - 1).sum(axis=1).argmin(), 0]
    lines = (tmp_path / "table.csv").read_text().splitlines()
    assert lines[0] == "X1,X2,X3,X4,X5," + ",".join(f'"baseline, mode {i}, Hz"' for i in range(1, 7)) + ",rms_g"
    assert len(lines) == 19


def test_finished_runs_need_no_fit(tmp_path: Path) -> None:
    """18 runs are not enough for the default polynomials in five parameters, and are analysed nevertheless."""
    path = study(tmp_path)
    path.write_text(path.read_text().replace("degree = 1\n", ""))
    with pytest.raises(FemtuneError, match="too-few"):
        ft.modes(path)
    asked, by_default = ft.screen(path, design="table"), ft.screen(path)
    assert asked.record == by_default.record
    assert asked.record.error_freedom == 7
    assert [f.path for f in asked.results.provenance.input_files] == ["runs.csv"]
    # as a study of a fit says it, whose middle run is the same
    assert asked.record == ft.screen(study(tmp_path), design="table").record


def test_runs_at_no_levels_are_screened_by_their_fit(tmp_path: Path) -> None:
    path = study(tmp_path)
    heads, *lines = (tmp_path / "runs.csv").read_text().splitlines()
    moved = np.random.default_rng(1).uniform(0.999, 1.001, rack.RUNS.shape) * rack.RUNS
    rows = [",".join([*(f"{v:.6g}" for v in x), *line.split(",")[5:]]) for x, line in zip(moved, lines)]
    (tmp_path / "runs.csv").write_text("\n".join([heads, *rows]) + "\n")
    assert ft.screen(path).record.design == "L18"


def test_values_that_are_no_frequencies_are_not_called_modes(tmp_path: Path) -> None:
    found = ft.screen(study(tmp_path), design="table", responses=["rms_g", "rms_g"], report=tmp_path / "page.html")
    assert [m.response for m in found.record.modes] == [""] * 6 + ["rms_g"]
    assert all(m.least_mac is None for m in found.record.modes)
    assert "of each value" in " ".join(found.record.sentences)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "mode rms_g" not in page
    assert "mode 2, Hz" in page


def test_a_constant_column_has_no_effects(tmp_path: Path) -> None:
    path = study(tmp_path)
    lines = (tmp_path / "runs.csv").read_text().splitlines()
    (tmp_path / "runs.csv").write_text("\n".join([lines[0] + ",mass", *(line + ",2.3" for line in lines[1:])]) + "\n")
    record = ft.screen(path, design="table", responses=["mass"]).record
    assert [e.contribution for e in record.effects if e.mode == 7] == [0.0] * 5
    assert record.modes[6].error_contribution == 0.0
    (told,) = [a for a in record.alerts if a.code == "screen.constant"]
    check_shown("screen.constant", f"[{told.code}] {told.sentence}")


def test_runs_with_gaps_are_left_out(tmp_path: Path) -> None:
    text = '[screen]\ndesign = "table"\nresponses = ["rms_g"]\n'
    record = ft.screen(study(tmp_path, text, gap=True), report=tmp_path / "page.html").record
    assert [f.run for f in record.failed] == [5]
    (told,) = [a for a in record.alerts if a.code == "screen.gaps"]
    check_shown("screen.gaps", f"[{told.code}] {told.sentence}")
    assert record.error_freedom == 6
    assert "rms_g" in (tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("screen.no-response", {"design": "table", "responses": ["rms"]}),
        ("screen.design, key of table", {"design": "sobol", "responses": ["rms_g"]}),
        ("screen.design, composite", {"design": "sobol", "sample": "central-composite", "runs": 30}),
        ("screen.design, parameter", {"levels": {"X7": 2}}),
        ("screen.design, one-level", {"design": "morris", "levels": {"X1": 2}}),
    ],
)
def test_refusals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, options: dict[str, object]) -> None:
    study(tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FemtuneError) as caught:
        ft.screen(Path("study.toml"), **options)  # type: ignore[arg-type]
    check_shown(name, caught.value)


def test_a_table_needs_runs(tmp_path: Path) -> None:
    from femtune.testing import example_deck  # noqa: PLC0415

    free = [ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.8, upper=1.2)]
    with pytest.raises(FemtuneError) as caught:
        ft.screen(ft.read_deck(example_deck(tmp_path), units="m-kg-s"), parameters=free, design="table")
    check_shown("screen.design, table", caught.value)


def test_levels_of_single_parameters(tmp_path: Path) -> None:
    """A mixed-level array: two levels of one parameter, three of the others."""
    record = ft.screen(study(tmp_path), levels={"X1": 2}).record
    assert record.design == "L18"
    assert [len(p.values) for p in record.parameters] == [2, 3, 3, 3, 3]


@pytest.mark.parametrize(("sample", "runs"), [("central-composite", 43), ("nested-latin-hypercube", 30), ("sobol", 30)])
def test_samples_of_a_surrogate(tmp_path: Path, sample: str, runs: int) -> None:
    options = {} if sample == "central-composite" else {"runs": runs}
    found = ft.screen(study(tmp_path), design="sobol", sample=sample, points=256, **options)
    assert found.record.runs == runs
    share = {s.parameter: s.total for s in found.record.indices if s.mode == 1}
    # as the contributions of the published array say
    assert share["X5"] > share["X1"] > share["X4"]
    if sample == "nested-latin-hypercube":
        bins = np.floor(15 * (found.runs[:15, 0] - 56.8) / (85.2 - 56.8)).astype(int)
        assert sorted(bins) == list(range(15))
