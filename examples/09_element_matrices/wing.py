"""A deck of our own: the upright web of a spar, ribs of bars in the direction of its normal, a rigid tip."""

from __future__ import annotations

BAYS = 12
LENGTH, HEIGHT = 1.2, 0.06

_HEAD = """SOL 103
CEND
METHOD = 1
SPC = 1
BEGIN BULK
PARAM,K6ROT,{k6rot}
EIGRL,1,,,12
MAT1,1,7.+10,,.3,2700.
PSHELL,1,1,.0015,1,,1
PBAR,2,1,6.-5,4.-10,4.-10,7.-10
SPC1,1,123456,100,101,102
"""


def wing_deck(k6rot: float) -> str:
    """Two rows of CQUAD4, at every third station a bar to each side with a mass at its end, a mass on an RBE2.

    The bars stand on the web: what turns them about the web's normal is its drilling stiffness alone, and so it is for
    the tip.
    """
    cards = []
    for i in range(BAYS + 1):
        x = LENGTH * i / BAYS
        cards += [f"GRID,{100 + 10 * i + j},,{x:.3f},0.,{HEIGHT * (j - 1) / 2.0:.3f}" for j in range(3)]
        if i and i % 3 == 0:
            for side, y in enumerate((-0.08, 0.12)):
                end = 500 + 10 * i + side
                cards += [f"GRID,{end},,{x:.3f},{y},0.", f"CBAR,{end},2,{101 + 10 * i},{end},0.,0.,1."]
                cards += [f"CONM2,{end + 500},{end},,.02"]
    for i in range(BAYS):
        first = 100 + 10 * i
        cards += [f"CQUAD4,{a},1,{a},{a + 10},{a + 11},{a + 1}" for a in (first, first + 1)]
    tip = 101 + 10 * BAYS
    cards += [f"GRID,900,,{LENGTH + 0.05},.03,0.", f"RBE2,901,{tip},123456,900", "CONM2,902,900,,.1"]
    return _HEAD.format(k6rot=k6rot) + "\n".join([*cards, "ENDDATA", ""])
