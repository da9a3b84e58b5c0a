"""The step is a command, a function, a page, a table of the study and a record of the results."""

import json
import subprocess
import sys
from pathlib import Path

import femtune as ft
from femtune.files.study_file.json_schema import file_schema
from femtune.steps.results import json_schema
from femtune.testing import example_deck

assert Path(ft.__file__).parent == Path(sys.argv[1])
Path("plate.bdf").write_text(
    "SOL 103\nCEND\nSPC=1\nMETHOD=1\nBEGIN BULK\nEIGRL,1,,,1\nGRID,1,,0.,0.,0.\nGRID,2,,2.,0.,0.\nSPC1,1,12456,1,2\n"
    "CELAS2,7,1000.,1,3,2,3\nSPC1,1,3,1\nCONM2,8,1,,3.\nCONM2,9,2,,1.\nENDDATA\n"
)
STUDY = '[study]\ntitle = "masses"\ndeck = "plate.bdf"\nunits = "m-kg-s"\n\n[weigh]\nabout = [1.0, 0.0, 0.0]\n'
Path("study.toml").write_text(STUDY + "budget = 5.0\n")
Path("heavy.toml").write_text(STUDY + "budget = 3.5\n")


def command(*words: str, code: int = 0) -> str:
    """What the command line prints on standard output."""
    call = [sys.executable, "-W", "error", "-m", "femtune", *words]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done.stdout


# two masses on a line: 3 at x = 0 and 1 at x = 2, about x = 1
expected = {"mass": 4.0, "centre": [0.5, 0.0, 0.0], "moments": [0.0, 4.0, 4.0]}
record = json.loads(command("weigh", "study.toml", "--json"))
assert record["within"] is True
assert record["budget"] == 5.0
(found,) = record["configurations"]
assert all(abs(a - b) < 1e-12 for a, b in zip(found["centre"], expected["centre"], strict=True)), found
assert all(abs(a - b) < 1e-12 for a, b in zip(found["moments"], expected["moments"], strict=True)), found
assert abs(found["mass"] - expected["mass"]) < 1e-12, found

shown = command("weigh", "study.toml", "--report", "page.html")
assert "mass 4 of 5" in shown, shown
page = Path("page.html").read_text()
assert 'id="weigh_masses"' in page
assert "Moments of inertia about (1, 0, 0)" in page
assert "mass 4 of 3.5" in command("weigh", "heavy.toml", code=1)

assert "moments of inertia of each configuration" in command("weigh", "--help")
assert "weigh" in command("--help")

result = ft.weigh("study.toml", report="again.html")
assert "weigh" in dir(ft)
assert result.record.model_dump(mode="json") == record
assert result.masses[0]["mass"] == found["mass"]
assert ft.report(result, "third.html").read_text().count('id="weigh_masses"') == page.count('id="weigh_masses"')
assert str(ft.weigh(example_deck())) == "WeighResult: baseline: mass 9.85"

keys = file_schema("study")["$defs"]["WeighTable"]["properties"]
assert keys["budget"]["description"].startswith("Largest permitted mass")
assert keys["about"]["examples"] == [[0.0, 0.0, 1.5]]
described = json_schema()
assert described["properties"]["weigh"]["description"].startswith("Mass properties")
assert described["$defs"]["MassOfConfiguration"]["properties"]["moments"]["description"].startswith(
    "Moments of inertia"
)
refused = ""
try:
    Path("wrong.toml").write_text(STUDY + "budget = -1.0\n")
    ft.weigh("wrong.toml")
except ft.FemtuneError as error:
    refused = str(error)
assert "budget" in refused, refused
