"""G of an isotropic MAT1 is written with E after an update."""

from __future__ import annotations

import pytest

import femtune as ft
from femtune.files.nastran.lines import parse_real

from .cantilever import Bench, bounded

MATERIAL, GIVEN = "MAT1    1       2.1+11          0.3     7850.", "MAT1    1       2.1+11  8.08+10 0.3     7850."
E = bounded("E", "MAT1 1 E")


def _numbers(line: str) -> list[float]:
    """E and G of a MAT1 in small or large field."""
    width = 16 if line.startswith("MAT1*") else 8
    texts = (line[8 + i * width :][:width].strip() for i in (1, 2))
    return [value for value in map(parse_real, texts) if value is not None]


@pytest.mark.slow
def test_g_is_written_with_e(bench: Bench) -> None:
    text = bench.text.replace(MATERIAL, GIVEN)
    bench.write("beam.bdf", text)
    bench.uff(bench.measure(bench.truth((("2.1+11  8.08+10", "2.52+11 9.696+10"),), text)))
    run = ft.run(bench.study(E))
    assert run.results.update is not None
    (parameter,) = run.results.update.parameters
    assert parameter.value == pytest.approx(1.2, rel=1e-5)
    assert {w.field: w.value for w in parameter.written} == pytest.approx(
        {"MAT1 1 E": 2.52e11, "MAT1 1 G": 9.696e10}, rel=1e-5
    )
    (line,) = [x for x in (run.folder / "updated.bdf").read_text().splitlines() if x.startswith("MAT1")]
    assert [float(line[at : at + 8].replace("+", "e+")) for at in (16, 24)] == pytest.approx(
        [2.52e11, 9.696e10], rel=1e-4
    )


@pytest.mark.slow
def test_of_a_region_too(bench: Bench) -> None:
    """The copy of the material for two of the bars has both values."""
    text = bench.text.replace(MATERIAL, GIVEN)
    bench.write("beam.bdf", text)
    two = text.replace("ENDDATA", "MAT1    7       2.52+11 9.696+10 0.3     7850.\nENDDATA")
    bench.uff(bench.measure(bench.truth((("PBAR    2       1", "PBAR    2       7"),), two)))
    run = ft.run(bench.study(E + "elements = [3, 4]\n"))
    lines = [x for x in (run.folder / "updated.bdf").read_text().splitlines() if x.startswith("MAT1")]
    values = sorted(value for line in lines for value in _numbers(line))
    assert values == pytest.approx([8.08e10, 9.696e10, 2.1e11, 2.52e11], rel=1e-4)
