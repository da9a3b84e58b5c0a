"""One sample, or more, of every card whose values a study may update, with decks that use it.

A sample spells its card field by field: ``E=2.+11`` is the field of the value E, ``-`` a blank one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from femtune.files.nastran.catalogue import CATALOGUE


class Field(NamedTuple):
    """Text of a field, and the value that it holds ("" for none)."""

    text: str
    value: str


@dataclass(frozen=True)
class Sample:
    """A card with its number, the cards around it, and two elements that share it.

    `alone` marks a card that is an element itself, so that nothing shares it; `needed` are values whose fields cannot
    be blank, or are no values of their own then, and `beside` those that need what stands beside them on their line.
    """

    card: str
    number: int
    spec: str
    context: tuple[str, ...]
    alone: bool = False
    needed: str = ""
    beside: str = ""

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields after the card's name."""
        return tuple(map(_field, self.spec.split()))

    @property
    def values(self) -> dict[str, tuple[int, ...]]:
        """Indices of the fields of each value."""
        found: dict[str, tuple[int, ...]] = {}
        for index, one in enumerate(self.fields):
            if one.value:
                found[one.value] = (*found.get(one.value, ()), index)
        return found

    @property
    def name(self) -> str:
        """Name for the list of tests."""
        return f"{self.card}-{self.number}" + ("-stations" if "YES" in self.spec else "")

    @property
    def deck(self) -> str:
        """Bulk data of the card and the cards around it, in free field."""
        texts = [one.text for one in self.fields]
        lines = [texts[i : i + 8] for i in range(0, len(texts), 8)]
        card = [",".join((self.card if i == 0 else "", *line)) for i, line in enumerate(lines)]
        return "\n".join((*self.context, *card, ""))


def names_in(text: str) -> set[str]:
    """Names of the cards of a deck."""
    return {line.split(",")[0][:8].strip().rstrip("*") for line in text.splitlines()}


def decks_of_samples(known: set[str]) -> dict[str, str]:
    """A deck of the first sample that has a card beyond the known ones, for each such card."""
    decks: dict[str, str] = {}
    for sample in SAMPLES:
        if new := names_in(sample.deck) & set(CATALOGUE) - known:
            decks[f"sample {sample.card}"] = sample.deck
            known = known | new
    return decks


def _field(token: str) -> Field:
    value, equals, text = token.rpartition("=")
    return Field("", "") if token == "-" else Field(text, value if equals else "")


GRIDS = ("GRID,1,,0.,0.,0.", "GRID,2,,1.,0.,0.", "GRID,3,,1.,1.,0.", "GRID,4,,0.,1.,0.", "GRID,5,,2.,0.,0.",
         "GRID,6,,2.,1.,0.", "SPOINT,50,51")  # fmt: skip
STEEL = "MAT1,1,2.+11,,.3,7800."
BARS = (*GRIDS, STEEL, "CBAR,11,7,1,2,0.,1.,0.", "CBAR,12,7,2,5,0.,1.,0.")
BEAMS = (*GRIDS, STEEL, "CBEAM,11,7,1,2,0.,1.,0.", "CBEAM,12,7,2,5,0.,1.,0.")
SHELLS = (*GRIDS, "CQUAD4,11,7,1,2,3,4", "CQUAD4,12,7,2,5,6,3")
LAMINA = (*SHELLS, "PSHELL,7,9,.1,9,,9")
PLIES = (*SHELLS, STEEL, "MAT8,9,140.,10.,.3,5.,4.,3.,2.")
RODS = (*GRIDS, STEEL, "CROD,11,7,1,2", "CROD,12,7,2,5")
SPRINGS = (*GRIDS, "CELAS1,11,7,1,1", "CELAS1,12,7,2,1,5,1")
DASHPOTS = (*GRIDS, "CDAMP1,11,7,1,1", "CDAMP1,12,7,2,1,5,1")
VISCOUS = (*GRIDS, "CVISC,11,7,1,2", "CVISC,12,7,2,5")
BUSHES = (*GRIDS, "CBUSH,11,7,1,2,,,,0", "CBUSH,12,7,2,5,,,,0")
GAPS = (*GRIDS, "CGAP,11,7,1,2,0.,1.,0.", "CGAP,12,7,2,5,0.,1.,.3")
MASSES = (*GRIDS, "CMASS1,11,7,1,1", "CMASS1,12,7,2,1")
SOLIDS = (*GRIDS, "GRID,21,,0.,0.,1.", "GRID,22,,1.,0.,1.", "GRID,23,,1.,1.,1.", "GRID,25,,2.,0.,1.",
          "CTETRA,11,7,1,2,4,21", "CPENTA,12,7,2,5,3,22,25,23")  # fmt: skip
LUMPS = (*SOLIDS, "PSOLID,7,9")
WEBS = (*GRIDS, STEEL, "CSHEAR,11,7,1,2,3,4", "CSHEAR,12,7,2,5,6,3")
SKINS = (*GRIDS, STEEL, "PSHELL,7,1,.1,1,,1")
LAPS = (*SKINS, "CQUAD4,13,7,1,2,3,4", "CQUAD4,14,7,31,32,33,34", "GRID,31,,0.,0.,.2", "GRID,32,,1.,0.,.2",
        "GRID,33,,1.,1.,.2", "GRID,34,,0.,1.,.2", "GRID,35,,.4,.6,0.")  # fmt: skip
WELDS = (*LAPS, "CWELD,11,7,35,ELEMID", ",13,14", "CWELD,12,7,,ALIGN,3,32")
FASTENERS = (*LAPS, "CFAST,11,7,ELEM,13,14,35", "CFAST,12,7,ELEM,13,14,,,", ",.5,.3,.1")

SAMPLES = (
    Sample("MAT1", 9, "9 E=2.+11 G=8.+10 NU=.3 RHO=7800. - - GE=.02", LAMINA, needed="E G NU"),
    Sample("MAT2", 9, "9 G11=2. G12=.5 G13=.1 G22=3. G23=.2 G33=1. RHO=7. - - - - GE=.02", LAMINA,
           needed="G11 G22 G33"),
    Sample("MAT8", 9, "9 E1=140. E2=10. NU12=.3 G12=5. G1Z=4. G2Z=3. RHO=2. - - - - - - - - GE=.03", LAMINA,
           needed="E1 E2 NU12 G12 G1Z G2Z"),
    Sample("MAT9", 9, "9 G11=9. G12=.5 G13=.4 G14=.1 G15=.2 G16=.3 G22=8. G23=.6 G24=.11 G25=.12 G26=.13 G33=7. "
           "G34=.14 G35=.15 G36=.16 G44=3. G45=.17 G46=.18 G55=2. G56=.19 G66=1. RHO=5. - - - - - - - GE=.04", LUMPS,
           needed="G11 G12 G13 G14 G15 G16 G22 G23 G24 G25 G26 G33 G34 G35 G36 G44 G45 G46 G55 G56 G66", beside="RHO"),
    Sample("MAT11", 9, "9 E1=140. E2=10. E3=12. NU12=.3 NU13=.25 NU23=.2 G12=5. G13=4. G23=3. RHO=2. - - - - GE=.03",
           LUMPS, needed="E1 E2 E3 G12 G13 G23", beside="RHO GE"),
    Sample("MAT1", 9, "9 E=2.+11 - NU=.3 RHO=7800. - - GE=.02", LUMPS, needed="E NU"),
    Sample("PSHEAR", 7, "7 1 T=.1 NSM=.5 F1=.9 F2=30.", WEBS, needed="T"),
    Sample("PSHELL", 7, "7 1 T=.1 1 RI=1.1 1 TS=.8 NSM=.5 .05 -.05", (*SHELLS, STEEL), needed="T"),
    Sample("PCOMP", 7, "7 Z0=-.1 NSM=.5 - - - GE=.02 - 9 T1=.1 THETA1=30. - 1 T2=.05 20. - 9 T3=.02 THETA3=60.", PLIES,
           needed="Z0 T1 T2 T3", beside="GE THETA1 THETA3"),
    Sample("PCOMPG", 7, "7 Z0=-.1 NSM=.5 - - - GE=.02 SYM 101 9 T101=.1 THETA101=30. - - - - 5 9 T5=.05 THETA5=20.",
           PLIES, needed="Z0 T101 T5", beside="GE THETA101 THETA5"),
    Sample("CQUAD4", 11, "11 7 1 2 3 4 - ZOFFS=.01 - - T1=.1 T2=.11 T3=.12 T4=.13", SKINS, True,
           needed="ZOFFS T1 T2 T3 T4"),
    Sample("CTRIA3", 11, "11 7 1 2 3 - ZOFFS=.01 - - - T1=.1 T2=.11 T3=.12", SKINS, True, needed="ZOFFS T1 T2 T3"),
    Sample("CQUADR", 11, "11 7 1 2 3 4 - ZOFFS=.01 - - T1=.1 T2=.11 T3=.12 T4=.13", SKINS, True,
           needed="ZOFFS T1 T2 T3 T4"),
    Sample("CTRIAR", 11, "11 7 1 2 3 - ZOFFS=.01 - - - T1=.1 T2=.11 T3=.12", SKINS, True, needed="ZOFFS T1 T2 T3"),
    Sample("CQUAD8", 11, "11 7 1 2 3 4 - - - - T1=.1 T2=.11 T3=.12 T4=.13 - ZOFFS=.01", SKINS, True,
           needed="ZOFFS T1 T2 T3 T4"),
    Sample("CTRIA6", 11, "11 7 1 2 3 - - - - ZOFFS=.01 T1=.1 T2=.11 T3=.12", SKINS, True, needed="ZOFFS T1 T2 T3"),
    Sample("PBAR", 7, "7 1 A=.01 I1=2.-5 I2=1.-5 J=1.-5 NSM=.5 - .1 - - - - - - - K1=.8 K2=.7 I12=1.-6", BARS),
    Sample("PBARL", 7, "7 1 - I - - - - DIM1=.2 DIM2=.1 DIM3=.12 DIM4=.01 DIM5=.02 DIM6=.021 NSM=3.", BARS,
           needed="DIM1 DIM2 DIM3 DIM4 DIM5 DIM6", beside="NSM"),
    Sample("PBARL", 7, "7 1 - ROD - - - - DIM1=.05 NSM=3.", BARS, needed="DIM1", beside="NSM"),
    Sample("PBEAM", 7, "7 1 A=.01 I1=2.-5 I2=1.-5 I12=1.-6 J=1.-5 NSM=.5 .1 - - - - - - - "
           "K1=.8 K2=.7 - - NSIA=.1 NSIB=.2 - - M1A=.01 M2A=.02 M1B=.03 M2B=.04 N1A=.01 N2A=.02 N1B=.03 N2B=.04", BEAMS,
           needed="A I1 I2 NSIB M1B M2B N1B N2B"),
    Sample("PBEAM", 7, "7 1 A=.01 I1=2.-5 I2=1.-5 I12=1.-6 J=1.-5 NSM=.5 - - - - - - - - "
           "NO .5 - - - - - - "
           "YES 1. AB=.02 I1B=3.-5 I2B=2.-5 I12B=2.-6 JB=2.-5 NSMB=.6 - - - - - - - - K1=.8", BEAMS,
           needed="A I1 I2 AB I1B I2B I12B JB NSMB"),
    Sample("PBEAM", 7, "7 1 A=.01 I1=2.-5 I2=1.-5 - J=1.-5 NSM=.5 - - - - - - - - "
           "YES 1. A=.01 I1=2.-5 I2=1.-5 - J=1.-5 NSM=.5", BEAMS),
    Sample("PBEAML", 7, "7 1 - I - - - - DIM1=.2 DIM2=.1 DIM3=.12 DIM4=.01 DIM5=.02 DIM6=.021 NSM=3. "
           "YES 1. DIM1B=.21 DIM2B=.11 DIM3B=.13 DIM4B=.011 DIM5B=.023 DIM6B=.024 NSMB=4.", BEAMS,
           needed="DIM1 DIM2 DIM3 DIM4 DIM5 DIM6 "
           "DIM1B DIM2B DIM3B DIM4B DIM5B DIM6B NSMB", beside="NSM"),
    Sample("PBEAML", 7, "7 1 - BOX - - - - DIM1=.2 DIM2=.1 DIM3=.01 DIM4=.02 NSM=3.", BEAMS,
           needed="DIM1 DIM2 DIM3 DIM4", beside="NSM"),
    Sample("PBCOMP", 7, "7 1 A=.01 I1=2.-5 I2=1.-5 I12=1.-6 J=1.-5 NSM=.5 "
           "K1=.8 K2=.7 M1=.01 M2=.02 N1=.03 N2=.04", BEAMS, needed="A I1 I2"),
    Sample("PROD", 7, "7 1 A=.01 J=1.-5 - NSM=.5", RODS),
    Sample("PBEND", 7, "7 1 A=.01 I1=2.-5 I2=1.-5 J=1.-5 - - - - - - - - - - K1=.8 K2=.7 NSM=.5",
           (*GRIDS, STEEL, "CBEND,11,7,1,2,0.,1.,0.,2", "CBEND,12,7,2,5,0.,1.,.3,2"), needed="A I1 I2 J"),
    Sample("PGAP", 7, "7 - - KA=1.+5 - KT=1.+4", GAPS, needed="KA KT"),
    Sample("PGAP", 7, "7 .1 - 1.+5 KB=10.", GAPS),
    Sample("PWELD", 7, "7 1 D=.1", WELDS, needed="D"),
    Sample("PFAST", 7, "7 .1 - - KT1=5. KT2=4. KT3=3. KR1=2. KR2=1. KR3=6. MASS=3. GE=.1", FASTENERS),
    Sample("PTUBE", 7, "7 1 OD=.1 T=.01 NSM=.5", (*GRIDS, STEEL, "CTUBE,11,7,1,2", "CTUBE,12,7,2,5"), needed="OD T",
           beside="NSM"),
    Sample("CONROD", 11, "11 1 2 1 A=.01 J=1.-5 - NSM=.5", (*GRIDS, STEEL), True),
    Sample("PELAS", 7, "7 K=1000. GE=.1 - 8 2. .2", SPRINGS),
    Sample("PELAS", 7, "6 2. .2 - 7 K=1000. GE=.1", SPRINGS),
    Sample("CELAS2", 11, "11 K=1000. 1 1 2 1 GE=.1", GRIDS, True),
    Sample("CELAS4", 11, "11 K=1000. 50 51", GRIDS, True),
    Sample("PDAMP", 7, "7 B=.5 8 2.", DASHPOTS),
    Sample("PDAMP", 7, "4 1. 5 2. 6 3. 7 B=.5", DASHPOTS),
    Sample("CDAMP2", 11, "11 B=.5 1 1 2 1", GRIDS, True),
    Sample("CDAMP4", 11, "11 B=.5 50 51", GRIDS, True),
    Sample("PVISC", 7, "7 CE=.5 CR=.6 - 8 2. 3.", VISCOUS),
    Sample("PVISC", 7, "6 2. 3. - 7 CE=.5 CR=.6", VISCOUS),
    Sample("PBUSH1D", 7, "7 K=1000. C=.5", (*GRIDS, "CBUSH1D,11,7,1,2", "CBUSH1D,12,7,2,5")),
    Sample("PBUSH", 7, "7 K K1=1. K2=2. K3=3. K4=4. K5=5. K6=6. - B B1=.1 B2=.2 B3=.3 B4=.4 B5=.5 B6=.6 "
           "- GE GE1=.01 GE2=.02 GE3=.03 GE4=.04 GE5=.05 GE6=.06", BUSHES, beside="GE2 GE3 GE4 GE5 GE6"),
    Sample("PMASS", 7, "7 M=5. 8 2.", MASSES),
    Sample("PMASS", 7, "4 1. 5 2. 6 3. 7 M=5.", MASSES),
    Sample("CMASS2", 11, "11 M=5. 1 1 2 1", GRIDS, True),
    Sample("CMASS4", 11, "11 M=5. 50 51", GRIDS, True),
    Sample("CONM1", 11, "11 1 - M11=9. M21=.1 M22=9. M31=.1 M32=.2 M33=9. M41=.1 M42=.2 M43=.3 M44=9. M51=.1 M52=.2 "
           "M53=.3 M54=.4 M55=9. M61=.1 M62=.2 M63=.3 M64=.4 M65=.5 M66=9.", GRIDS, True),
    Sample("CONM2", 11, "11 1 - M=5. .1 - - - I11=.3 I21=.01 I22=.4 I31=.02 I32=.03 I33=.5", GRIDS, True),
)  # fmt: skip
