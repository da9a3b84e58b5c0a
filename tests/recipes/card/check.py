"""A deck with a CBUSH2D is solved; its stiffness is updated and written."""

import sys
from math import pi, sqrt
from pathlib import Path

import femtune as ft

assert Path(ft.__file__).parent == Path(sys.argv[1])
deck = Path("bush.bdf")
deck.write_text(
    "SOL 103\nCEND\nSPC=1\nMETHOD=1\nBEGIN BULK\nEIGRL,1,,,2\nGRID,1,,0.,0.,0.,,123456\nGRID,2,,0.1,0.,0.\n"
    "SPC1,1,2456,2\nCONM2,9,2,,2.\nCBUSH2D,5,3,1,2,,ZX\nPBUSH2D,3,8.+4,18.+4\nENDDATA\n"
)
stiffness = (8e4, 18e4)
hertz = ft.modes(deck).freq_hz
assert all(abs(f / (sqrt(k / 2.0) / (2.0 * pi)) - 1.0) < 1e-9 for f, k in zip(hertz, stiffness, strict=True)), hertz

true = ft.write_deck(deck, {"PBUSH2D 3 K1": 9e4}, "true.bdf")
test = ft.simulate(true, ["2:13"], units="m-kg-s", count=2)
# K1 is along Z, K2 along X
assert abs(test.modes.shapes).argmax(axis=0).tolist() == [1, 0], test.modes.shapes
bush = ft.Parameter("bush", fields=["PBUSH2D 3 K1"], lower=0.5, upper=2.0)
result = ft.update(ft.read_deck(deck, units="m-kg-s"), test, parameters=[bush])
assert abs(result.values["bush"] / 1.125 - 1.0) < 1e-6, result.values
assert result.physical[0].unit == "N/m", result.physical
assert "PBUSH2D,3,90000." in result.deck.read_text(), result.deck.read_text()
