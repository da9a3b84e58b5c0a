"""A JSON file of modes is read, the study knows the word, and damaged files are refused with a message."""

import sys
from pathlib import Path

import femtune as ft
from femtune.files.modes.read import read_modes
from femtune.files.study_file.json_schema import schema_text
from femtune.testing import check_reader

assert Path(ft.__file__).parent == Path(sys.argv[1])
path = Path("modes.json")
path.write_text('{"freq_hz": [12.5, 80.0]}')
assert read_modes(path, "json").freq_hz.tolist() == [12.5, 80.0]
assert '"json"' in schema_text("study")
check_reader(lambda file: read_modes(file, "json"), path)
