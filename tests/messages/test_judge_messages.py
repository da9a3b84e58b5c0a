"""Messages of the verdict: each is the example that its page shows."""

from __future__ import annotations

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, Notice

_CASES: dict[str, Notice] = {
    "judge.curved": Notice("judge.curved", axis="+Iby1, −Icx2", step=1.5, true=508.5, linear=2.25, count=3, of=20),
    "judge.curved, unsolved": Notice("judge.curved/unsolved", axis="+Iby1, −Icx2", step=1.5, count=3, of=20),
    "judge.lower-beside": Notice("judge.lower-beside", axis="+Iby1", step=1.5, decrease=12.31),
    "judge.not-looked-further": Notice("judge.not-looked-further"),
    "judge.better-minimum": Notice(
        "judge.better-minimum", tried="as built: test mode 8 with model mode 8", first=344.21, now=30.512
    ),
    "judge.pairing-open": Notice(
        "judge.pairing-open",
        pairs="as built: test mode 4 with model mode 5 and test mode 5 with model mode 4",
        before=161.2,
        held=129.4,
    ),
    "judge.pairing-not-tried": Notice(
        "judge.pairing-not-tried",
        pairs="as built: test mode 8 with model mode 8; as built: test mode 9 with model mode 8",
    ),
    "judge.frequencies-worse": Notice("judge.frequencies-worse", before=1.42, after=2.63),
    "judge.frequency-worse": Notice("judge.frequency-worse", modes="as built: mode 5 (+0.40 % before, −2.10 % after)"),
    "judge.missing": Notice(
        "judge.missing",
        field="PSHELL 2 T (or what looks like it: MAT1 1 E)",
        change="an increase by 11.6 %",
        before="1025",
        after="181",
    ),
    "judge.missing, limit": Notice(
        "judge.missing/at-limit", field="PSHELL 2 T", change="an increase by 25 %", before="1025", after="181"
    ),
    "judge.missing, one mode": Notice(
        "judge.missing/one-mode", field="PSHELL 1 T, 15 elements around (0.38, 0.22, 0.4)", mode="8 (as built)",
        change="an increase by 2.15 %", before="44.75", after="34.19", chance="p = 0.41",
    ),
    "judge.missing, mass and one mode": Notice(
        "judge.missing/mass-one-mode", position="at grid point 306", mode="8 (as built)", mass="0.23 kg",
        before="44.75", after="34.19", chance="p = 0.41",
    ),
    "judge.missing, support and one mode": Notice(
        "judge.missing/support-one-mode", position="at grid point 102 in DOF 2", mode="8 (as built)",
        stiffness="4e+05 N/m", before="44.75", after="34.19", chance="p = 0.41",
    ),
    "judge.missing, mass": Notice(
        "judge.missing/mass", position="at grid point 306", mass="0.23 kg", before="301.6", after="177"
    ),
    "judge.missing, mass at its limit": Notice(
        "judge.missing/mass-at-limit", position="near (0.8, 0.6, 0.9), grid points 304, 305", mass="0.9 kg",
        before="301.6", after="177",
    ),
    "judge.missing, mass suspected": Notice(
        "judge.missing/mass-suspected", position="at grid point 306", chance="p = 0.03", tested="105 candidates"
    ),
    "judge.missing, beyond bound": Notice(
        "judge.missing/beyond-bound", field="spring beyond its bound", chance="p = 0.004", tested="105 fields"
    ),
    "judge.missing, suspected": Notice(
        "judge.missing/suspected", field="CELAS2 903 K", chance="p = 0.03", tested="105 fields"
    ),
    "judge.missing, implausible": Notice("judge.missing/implausible", chance="p = 0.003", tested="105 fields"),
    "judge.misfit": Notice(
        "judge.misfit", part="the shape residual of mode 6 (free)", ratio=3.2,
        numbers="chi-square 113 on 11 degrees of freedom, p = 2.1e-09",
    ),
    "judge.misfit, prior": Notice("judge.misfit/prior", part="the prior of E", ratio=25.0, numbers="p < 1e-12"),
    "judge.misfit, held": Notice(
        "judge.misfit/held", part="what the bounds keep", numbers="chi-square 41 on 1 degree of freedom, p = 4.5e-09"
    ),
    "judge.misfit, whole": Notice(
        "judge.misfit/whole", outcome="the residuals have the stated size, but they are not random"
    ),
    "judge.fit-not-tested": Notice(
        "judge.fit-not-tested", kinds="MAC", why="a MAC near 1 has no normal distribution"
    ),
    "judge.fit-not-tested, large": Notice(
        "judge.fit-not-tested/large", kind="frf", ratio=5.1, error=76.7,
        why="the values come from one identified test, so that the errors of different lines are not independent",
    ),
    "judge.neighbour": Notice("judge.neighbour", sentence="mode 6 contains 7 % of mode 8", chance="p = 0.0003"),
    "judge.overstated": Notice("judge.overstated", kind="frequency", times=112.0),
    "judge.overstated, key": Notice(
        "judge.overstated/with-key", kind="frequency", times=112.0, key="frequency_sd", stated=0.1, fits=0.00089
    ),
    "judge.larger-than-assumed": Notice("judge.larger-than-assumed", kind="shape", ratio=2.4),
    "judge.larger-than-assumed, key": Notice(
        "judge.larger-than-assumed/with-key", kind="shape", ratio=2.4, key="shape_sd", stated=0.03, fits=0.072
    ),
    "judge.deck-differs": Notice(
        "judge.deck-differs", difference="MAT1 1 E is 2.1e+11 instead of 1.7e+11 for 4 elements"
    ),
    "judge.between-runs": Notice("judge.between-runs", percent=0.83, mode=2, limit=0.5),
    "judge.outside-runs": Notice(
        "judge.outside-runs", parameter="k", value=212.4, side="below", low=500.0, high=4000.0
    ),
    "judge.too-few-modes": Notice("judge.too-few-modes", test="shaker", last_hz=812.0, highest_hz=2000.0),
    "judge.truncated": Notice("judge.truncated", test="shaker", last_hz=5820.0, percent=1.8),
    "judge.no-optimum": Notice("judge.no-optimum", ending="the largest number of iterations was reached"),
    "judge.not-computed": Notice("judge.not-computed", failure="scatter: no frequency is known"),
    "judge.modes-not-compared": Notice(
        "judge.modes-not-compared", compared=3, total=8, modes="4 (79.848 Hz) and 5 (139.99 Hz)", suspension=""
    ),
    "judge.target-mode": Notice("judge.target-mode", mode="2", hz="18.300"),
    "judge.model-mode-unpaired": Notice(
        "judge.model-mode-unpaired",
        modes="4 (BC, 10.047 Hz, 6.07 % of the mass) and 4 (NC, 9.162 Hz, 6.09 % of the mass)",
    ),
    "judge.no-standard": Notice("judge.no-standard"),
    "judge.criterion-fails": Notice(
        "judge.criterion-fails", quantity="frequency error", measured="7.2 %", required="at most 5 %",
        standard="NASA-STD-5002", remark=" (test mode 2 with model mode 2)",
    ),
    "judge.criterion-not-tested": Notice(
        "judge.criterion-not-tested", quantity="cross-orthogonality, diagonal", standard="NASA-STD-5002",
        why="the mass is reduced to one DOF",
    ),
    "judge.held-out-fails": Notice(
        "judge.held-out-fails", data="modified structure", quantity="MAC", measured="0.62", required="at least 0.9",
        standard="ECSS-E-ST-32-11C", remark="",
    ),
    "judge.nothing-held-out": Notice("judge.nothing-held-out"),
    "judge.nothing-held-out, no criterion": Notice("judge.nothing-held-out/no-criterion"),
    "judge.not-independent": Notice("judge.not-independent", data="held-out modes and held-out sensors"),
    "judge.scatter": Notice("judge.scatter", pairs=6, error="0.9", test="0.1"),
    "judge.mesh": Notice("judge.mesh", mesh="−1.56", error="0.21"),
    "judge.beyond-usual": Notice("judge.beyond-usual", parameters="m2 (0.766; 0.9 to 1.1)"),
    "judge.undetermined-changed": Notice("judge.undetermined-changed", parameters="k1 and k2"),
    "study.validation-used": FemtuneError(
        "study.validation-used", configuration="check", used="free", shared="modes 1, 2 and 3"
    ),
    "study.bounds-beyond-runs": Notice(
        "study.bounds-beyond-runs", parameter="k1", variable="k1", value=3.2e4, low=5e3, high=1.6e4
    ),
    "study.test-counted-twice": Notice(
        "study.test-counted-twice", first="a", second="b", shared="modes 1, 2 and 3"
    ),
}  # fmt: skip


@pytest.mark.parametrize("code", sorted(_CASES))
def test_the_page_shows_the_message(code: str) -> None:
    check_shown(code, _CASES[code])
