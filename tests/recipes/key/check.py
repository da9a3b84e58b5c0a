"""The key is in the schema, a wrong value is refused, and an update begins with the damping that a study states."""

import sys
from pathlib import Path

import femtune as ft
from femtune.files.study_file.json_schema import schema_text
from femtune.testing import example_deck, example_test

assert Path(ft.__file__).parent == Path(sys.argv[1])
assert '"first_damping"' in schema_text("study")
model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
root = ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.5, upper=2.0)


def first_step(**update: float) -> float:
    """Length of the first step of an update."""
    found = ft.update(model, test, parameters=[root], update=update, fresh=True)
    return found.results.update.history[1].step_length


assert first_step(first_damping=100.0) < 0.1 * first_step()
refused = ""
try:
    first_step(first_damping=-1.0)
except ft.FemtuneError as error:
    refused = str(error)
assert "first_damping" in refused
