"""What the reader of a deck warns of is said by the steps that write nothing, once a kind."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

import femtune as ft
from femtune.cli.commands import main
from femtune.errors import FemtuneError

from .cantilever import EI, Bench, measured


@pytest.mark.slow
@pytest.mark.parametrize("step", ["modes", "correlate", "select"])
def test_a_deck_without_its_end_is_told(beam: Bench, step: str) -> None:
    path = beam.folder / "beam.bdf"
    path.write_text(path.read_text().replace("ENDDATA\n", ""))
    (told,) = [str(r) for r in getattr(ft, step)(beam.study()).remarks if r.code == "deck.no-enddata"]
    assert told.endswith(f" at {path}:21")


@pytest.mark.slow
def test_the_terminal_says_it_and_quiet_says_it_on_standard_error(bench: Bench) -> None:
    path = bench.folder / "beam.bdf"
    path.write_text(path.read_text().replace("ENDDATA\n", ""))
    for word in ("modes", "info"):
        found = CliRunner().invoke(main, [word, str(path)])
        assert "has no ENDDATA" in " ".join(found.output.split())
    quiet = CliRunner().invoke(main, ["modes", str(path), "--quiet"])
    assert "ENDDATA" not in quiet.stdout
    assert "has no ENDDATA" in " ".join(quiet.stderr.split())


@pytest.mark.slow
def test_validate_shows_the_warnings_on_the_deck(beam: Bench) -> None:
    path = beam.folder / "beam.bdf"
    path.write_text(path.read_text().replace("ENDDATA\n", ""))
    found = CliRunner().invoke(main, ["validate", str(beam.study())])
    assert "has no ENDDATA" in " ".join(found.output.split())


def test_a_shape_of_one_sensor_is_an_error_at_the_standard_deviation_of_shapes(beam: Bench) -> None:
    """At the table of the residual where there are such tables, whatever the residuals before it."""
    keys = "[residuals]\nfrequency_sd = 0.01\nshape_sd = 0.05\n"
    tables = '[[residual]]\nkind = "frequency"\nsd = 0.01\n[[residual]]\nkind = "shape"\nsensors = ["5Z+"]\nsd = 0.05\n'
    beam.uff(measured(beam.folder / "beam.bdf", ("5Z+",), count=2))
    for text, record in ((keys, "residuals.shape_sd"), (tables, "residual[2]")):
        with pytest.raises(FemtuneError) as caught:
            ft.update(beam.study(EI + text))
        assert caught.value.code == "residual.unmeasured"
        assert caught.value.where is not None
        assert caught.value.where.record == record


def test_negative_densities_are_named_once_a_kind(bench: Bench) -> None:
    text = bench.text.replace("0.3     7850.", "0.3     -7850.").replace("ENDDATA", "MAT1,2,1.+9,,.3,-5.\nENDDATA")
    path = bench.write("light.bdf", text)
    notices = [n for n in ft.info(path).record.notices if n.code == "deck.negative-density"]
    assert [n.sentence.partition(",")[0] for n in notices] == [
        "the density of MAT1 1 is negative (-7850)",
        "the density of MAT1 2 is negative (-5)",
    ]
    assert notices[0].where == f"{path}:13 (MAT1 1)"
    assert "the density of MAT1 1 " in " ".join(CliRunner().invoke(main, ["info", str(path)]).output.split())
    with pytest.raises(FemtuneError, match="mass") as failed:
        ft.modes(path)
    assert failed.value.__notes__[0].endswith("; and 1 more of this kind")
