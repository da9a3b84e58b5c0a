"""The table of understood cards: the names of their fields by position, and which of them a study may update."""

from __future__ import annotations

from dataclasses import dataclass

ELEMENT, PROPERTY, MATERIAL, OTHER = "element", "property", "material", "other"

NAMESPACES = ("elastic", "damper", "mass", "rigid")
"""Groups of elements within each of which numbers are unique; Nastran lets those of different groups coincide."""


@dataclass(frozen=True)
class CardKind:
    """What is known of a card.

    Parameters
    ----------
    name : card name
    role : "element", "property", "material" or "other"
    fields : field names by position from the first field after the card's name; "-" where there is none
    values : names of the fields that element matrices are functions of; of fields that repeat with a number, the first
    starts : positions at which the sequence of names starts (a PELAS card holds two properties)
    properties : names of the property cards that the PID of an element may refer to
    length : number of fields that a card may have; None where it ends with a list
    """

    name: str
    role: str
    fields: tuple[str, ...]
    values: tuple[str, ...] = ()
    starts: tuple[int, ...] = (0,)
    properties: tuple[str, ...] = ()
    length: int | None = None

    @property
    def namespace(self) -> str:
        """Group of elements in which the number of an element is unique."""
        if self.name.startswith("R"):
            return "rigid"
        if self.name.startswith(("CMASS", "CONM")):
            return "mass"
        return "damper" if self.name.startswith(("CDAMP", "CVISC")) else "elastic"

    @property
    def blanks(self) -> tuple[int, ...]:
        """Positions below `length` that hold nothing."""
        if self.length is None or len(self.starts) > 1 or self.name in _RESERVED_USED:
            return ()
        return tuple(i for i, name in enumerate(self.fields) if name == "-" and i < self.length)

    def holds(self, name: str) -> bool:
        """Whether it has a value of that name; plies have any number."""
        base = name.rstrip("0123456789")
        return name in self.values or (self.name in PLY_CARDS and base != name and f"{base}1" in self.values)


PLY_CARDS = ("PCOMP", "PCOMPG")
"""Cards whose values are those of plies, as many as there are: T1, THETA1, T2 …"""

_DIMENSIONS = " ".join(f"DIM{i}" for i in range(1, 11))
_DIMENSIONS_B = " ".join(f"DIM{i}B" for i in range(1, 11))

# one line for each card: name, role and fields; an element's property cards follow PID=, the values of a card follow |
_LAYOUT = f"""
GRID      other     ID CP X1 X2 X3 CD PS SEID
GRDSET    other     - CP - - - CD PS SEID
SPOINT    other     ID
POINT     other     ID CP X1 X2 X3
SELOC     other     SEID PA1 PA2 PA3 PB1 PB2 PB3
CORD1R    other     CID G1 G2 G3
CORD1C    other     CID G1 G2 G3
CORD1S    other     CID G1 G2 G3
CORD2R    other     CID RID A1 A2 A3 B1 B2 B3 C1 C2 C3
CORD2C    other     CID RID A1 A2 A3 B1 B2 B3 C1 C2 C3
CORD2S    other     CID RID A1 A2 A3 B1 B2 B3 C1 C2 C3
MAT1      material  MID E G NU RHO A TREF GE | E G NU RHO GE
MAT2      material  MID G11 G12 G13 G22 G23 G33 RHO A1 A2 A3 TREF GE | G11 G12 G13 G22 G23 G33 RHO GE
MAT8      material  MID E1 E2 NU12 G12 G1Z G2Z RHO A1 A2 TREF XT XC YT YC S GE | E1 E2 NU12 G12 G1Z G2Z RHO GE
MAT9      material  MID G11 G12 G13 G14 G15 G16 G22 G23 G24 G25 G26 G33 G34 G35 G36 G44 G45 G46 G55 G56 G66 RHO A1 A2 \
A3 A4 A5 A6 TREF GE \
| G11 G12 G13 G14 G15 G16 G22 G23 G24 G25 G26 G33 G34 G35 G36 G44 G45 G46 G55 G56 G66 RHO GE
MAT11     material  MID E1 E2 E3 NU12 NU13 NU23 G12 G13 G23 RHO A1 A2 A3 TREF GE \
| E1 E2 E3 NU12 NU13 NU23 G12 G13 G23 RHO GE
CQUAD4    element   EID PID=PSHELL,PCOMP,PCOMPG G1 G2 G3 G4 THETA ZOFFS - TFLAG T1 T2 T3 T4 | ZOFFS T1 T2 T3 T4
CTRIA3    element   EID PID=PSHELL,PCOMP,PCOMPG G1 G2 G3 THETA ZOFFS - - TFLAG T1 T2 T3 | ZOFFS T1 T2 T3
CQUADR    element   EID PID=PSHELL,PCOMP,PCOMPG G1 G2 G3 G4 THETA ZOFFS - TFLAG T1 T2 T3 T4 | ZOFFS T1 T2 T3 T4
CTRIAR    element   EID PID=PSHELL,PCOMP,PCOMPG G1 G2 G3 THETA ZOFFS - - TFLAG T1 T2 T3 | ZOFFS T1 T2 T3
CQUAD8    element   EID PID=PSHELL,PCOMP,PCOMPG G1 G2 G3 G4 G5 G6 G7 G8 T1 T2 T3 T4 THETA ZOFFS TFLAG \
| ZOFFS T1 T2 T3 T4
CTRIA6    element   EID PID=PSHELL,PCOMP,PCOMPG G1 G2 G3 G4 G5 G6 THETA ZOFFS T1 T2 T3 TFLAG | ZOFFS T1 T2 T3
CHEXA     element   EID PID=PSOLID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10 G11 G12 G13 G14 G15 G16 G17 G18 G19 G20
CPENTA    element   EID PID=PSOLID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10 G11 G12 G13 G14 G15
CTETRA    element   EID PID=PSOLID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10
CPYRAM    element   EID PID=PSOLID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10 G11 G12 G13
PSOLID    property  PID MID CORDM IN STRESS ISOP FCTN
CSHEAR    element   EID PID=PSHEAR G1 G2 G3 G4
PSHEAR    property  PID MID T NSM F1 F2 | T NSM F1 F2
PSHELL    property  PID MID1 T MID2 RI MID3 TS NSM Z1 Z2 MID4 | T RI TS NSM
PCOMP     property  PID Z0 NSM SB FT TREF GE LAM | Z0 NSM GE T1 THETA1
PCOMPG    property  PID Z0 NSM SB FT TREF GE LAM | Z0 NSM GE T1 THETA1
CBAR      element   EID PID=PBAR,PBARL GA GB X1 X2 X3 OFFT PA PB W1A W2A W3A W1B W2B W3B | W1A W2A W3A W1B W2B W3B
CBEAM     element   EID PID=PBEAM,PBEAML,PBCOMP GA GB X1 X2 X3 OFFT PA PB W1A W2A W3A W1B W2B W3B SA SB \
| W1A W2A W3A W1B W2B W3B
BAROR     other     - PID - - X1 X2 X3 OFFT
BEAMOR    other     - PID - - X1 X2 X3 OFFT
PBAR      property  PID MID A I1 I2 J NSM - C1 C2 D1 D2 E1 E2 F1 F2 K1 K2 I12 | A I1 I2 J NSM K1 K2 I12
PBEAM     property  PID MID A I1 I2 I12 J NSM C1 C2 D1 D2 E1 E2 F1 F2 \
| A I1 I2 I12 J NSM AB I1B I2B I12B JB NSMB K1 K2 NSIA NSIB M1A M2A M1B M2B N1A N2A N1B N2B
PBARL     property  PID MID GROUP TYPE - - - - | {_DIMENSIONS} NSM
PBEAML    property  PID MID GROUP TYPE - - - - | {_DIMENSIONS} NSM {_DIMENSIONS_B} NSMB
PBCOMP    property  PID MID A I1 I2 I12 J NSM K1 K2 M1 M2 N1 N2 SYMOPT | A I1 I2 I12 J NSM K1 K2 M1 M2 N1 N2
CBEND     element   EID PID=PBEND GA GB X1 X2 X3 GEOM
PBEND     property  PID MID A I1 I2 J RB THETAB C1 C2 D1 D2 E1 E2 F1 F2 K1 K2 NSM RC ZC DELTAN \
| A I1 I2 J NSM K1 K2
CROD      element   EID PID=PROD G1 G2
CONROD    element   EID G1 G2 MID A J C NSM | A J NSM
PROD      property  PID MID A J C NSM | A J NSM
CTUBE     element   EID PID=PTUBE G1 G2
PTUBE     property  PID MID OD T NSM OD2 | OD T NSM
CELAS1    element   EID PID=PELAS G1 C1 G2 C2
CELAS2    element   EID K G1 C1 G2 C2 GE S | K GE
CELAS3    element   EID PID=PELAS S1 S2
CELAS4    element   EID K S1 S2 | K
PELAS     property  PID K GE S | K GE
CDAMP1    element   EID PID=PDAMP G1 C1 G2 C2
CDAMP2    element   EID B G1 C1 G2 C2 | B
CDAMP3    element   EID PID=PDAMP S1 S2
CDAMP4    element   EID B S1 S2 | B
PDAMP     property  PID B | B
CVISC     element   EID PID=PVISC G1 G2
PVISC     property  PID CE CR | CE CR
CBUSH1D   element   EID PID=PBUSH1D GA GB CID
PBUSH1D   property  PID K C M | K C
CBUSH     element   EID PID=PBUSH GA GB X1 X2 X3 CID S OCID S1 S2 S3
PBUSH     property  PID - K1 K2 K3 K4 K5 K6 | K1 K2 K3 K4 K5 K6 B1 B2 B3 B4 B5 B6 GE1 GE2 GE3 GE4 GE5 GE6
CGAP      element   EID PID=PGAP GA GB X1 X2 X3 CID
PGAP      property  PID U0 F0 KA KB KT MU1 MU2 TMAX MAR TRMIN | KA KB KT
CWELD     element   EID PID=PWELD GS TYPE GA GB SPTYP MCID
PWELD     property  PID MID D - - MSET - TYPE LDMIN LDMAX | D
CFAST     element   EID PID=PFAST TYPE IDA IDB GS GA GB XS YS ZS
PFAST     property  PID D MCID MFLAG KT1 KT2 KT3 KR1 KR2 KR3 MASS GE | KT1 KT2 KT3 KR1 KR2 KR3 MASS GE
CMASS1    element   EID PID=PMASS G1 C1 G2 C2
CMASS2    element   EID M G1 C1 G2 C2 | M
CMASS3    element   EID PID=PMASS S1 S2
CMASS4    element   EID M S1 S2 | M
PMASS     property  PID M | M
CONM1     element   EID G CID M11 M21 M22 M31 M32 M33 M41 M42 M43 M44 M51 M52 M53 M54 M55 M61 M62 M63 M64 M65 M66 \
| M11 M21 M22 M31 M32 M33 M41 M42 M43 M44 M51 M52 M53 M54 M55 M61 M62 M63 M64 M65 M66
CONM2     element   EID G CID M X1 X2 X3 - I11 I21 I22 I31 I32 I33 | M I11 I21 I22 I31 I32 I33
RBE2      element   EID GN CM
RBAR      element   EID GA GB CNA CNB CMA CMB ALPHA
RBAR1     element   EID GA GB CB ALPHA
RBE1      element   EID
RBE3      element   EID - REFGRID REFC
RROD      element   EID GA GB CMA CMB ALPHA
RTRPLT    element   EID GA GB GC CNA CNB CNC - CMA CMB CMC ALPHA
RTRPLT1   element   EID GA GB GC CMB CMC ALPHA
RSPLINE   element   EID DL G1
GENEL     other     EID
MPC       other     SID
MPCADD    other     SID
SPC       other     SID G1 C1 D1 G2 C2 D2
SPC1      other     SID C
SPCADD    other     SID
ASET      other     ID C
OMIT      other     ID C
BSET      other     ID C
CSET      other     ID C
QSET      other     ID C
BNDFIX    other     ID C
BNDFREE   other     ID C
SUPORT    other     ID C
ASET1     other     C
OMIT1     other     C
BSET1     other     C
CSET1     other     C
QSET1     other     C
BNDFIX1   other     C
BNDFRE1   other     C
SUPORT1   other     SID
USET      other     SNAME
USET1     other     SNAME C
EXTRN     other     ID C
SEBULK    other     SEID TYPE RSEID METHOD TOL LOC UNITNO
SECONCT   other     SEIDA SEIDB TOL LOC - - - -
SEBNDRY   other     SEIDA SEIDB
SEEXCLD   other     SEIDA SEIDB
NSM       other     SID TYPE
NSM1      other     SID TYPE VALUE
NSML      other     SID TYPE
NSML1     other     SID TYPE VALUE
NSMADD    other     SID
EIGR      other     SID METHOD F1 F2 NE ND - - NORM G C
EIGRL     other     SID V1 V2 ND MSGLVL MAXSET SHFSCL NORM
PARAM     other     NAME VALUE
TABDMP1   other     TID TYPE FLAT
"""

_STARTS = {
    **dict.fromkeys(("PELAS", "PVISC", "CORD1R", "CORD1C", "CORD1S"), (0, 4)),
    **dict.fromkeys(("PMASS", "PDAMP"), (0, 2, 4, 6)),
}


# cards with a list at their end
_OPEN_NAMES = """
    SPOINT CORD1R CORD1C CORD1S PCOMP PCOMPG PBEAM PBARL PBEAML PBCOMP PBUSH PBUSH1D RSPLINE GENEL RBE2 RBE1 RBE3 MPC
    MPCADD SPC1 SPCADD ASET1 OMIT1 BSET1 CSET1 QSET1 BNDFIX1 BNDFRE1 USET1 NSM NSM1 NSML NSML1 NSMADD EIGRL TABDMP1
    EXTRN SECONCT SEBNDRY SEEXCLD
"""
_OPEN = frozenset(_OPEN_NAMES.split())
# numbers of fields where a card has more than those that are read: allowable stresses, thermal expansion, pairs
_LENGTHS = {
    "MAT1": 12,
    "MAT2": 17,
    "MAT8": 19,
    "RBAR": 9,
    "RBAR1": 6,
    "RROD": 7,
    "RTRPLT": 13,
    "RTRPLT1": 8,
    "PARAM": 3,
    "CWELD": 24,
    **dict.fromkeys(("PELAS", "PVISC", "PMASS", "PDAMP"), 8),
    **dict.fromkeys(("ASET", "OMIT", "BSET", "CSET", "QSET", "BNDFIX", "BNDFREE", "SUPORT"), 8),
    **dict.fromkeys(("SUPORT1", "USET"), 7),
}
# "-" of these holds what was read by older programs
_RESERVED_USED = ("EIGR",)


def _kind(line: str) -> CardKind:
    layout, _, values = line.partition("|")
    name, role, *words = layout.split()
    fields = tuple(word.partition("=")[0] for word in words)
    properties = tuple(card for word in words for card in word.partition("=")[2].split(",") if card)
    length = None if name in _OPEN else _LENGTHS.get(name, len(fields))
    return CardKind(name, role, fields, tuple(values.split()), _STARTS.get(name, (0,)), properties, length)


CATALOGUE: dict[str, CardKind] = {kind.name: kind for kind in map(_kind, _LAYOUT.strip().splitlines())}
"""Understood cards by name."""

NODE_FIELDS = frozenset({"GA", "GB", "G", *(f"G{i}" for i in range(1, 21))})
"""Names of the fields of elements that refer to grid points."""
