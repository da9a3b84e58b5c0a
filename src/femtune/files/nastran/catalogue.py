"""The catalogue of understood cards: one declaration for each, from which all that is known of a card is derived.

The inventory of a deck, references and units of fields, the check of surplus fields, writing back and the table in the
guide are made from the declarations. A new function that reads elements is added to `ELEMENT_READERS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

ELEMENT = "element"
PROPERTY = "property"
MATERIAL = "material"
OTHER = "other"
"""Roles of cards."""

NAMESPACES = ("elastic", "damper", "mass", "rigid")
"""Groups of elements within each of which numbers are unique; Nastran permits equal numbers in different groups."""

ELEMENT_READERS = (
    "bars.read_bars",
    "bends.read_bends",
    "scalar_elements.read_rods",
    "shells.read_shells",
    "shear_panels.read_shear_panels",
    "solids.read_solids",
    "scalar_elements.read_scalars",
    "bushes.read_bushes",
    "bushes.read_gaps",
    "connectors.read_connectors",
    "scalar_elements.read_dampers",
    "masses.read_masses",
)
"""Functions of this package that read elements, in the order of their batches; connectors come after shells."""


@dataclass(frozen=True)
class CardKind:
    """Properties of a card.

    Parameters
    ----------
    name : card name
    role : "element", "property", "material" or "other"
    fields : field names by position from the first field after the card's name; "-" for a reserved field
    units : unit of each field that element matrices are functions of, of plies that of the first: letters F, L, M, P
        (force, length, mass, pressure), "1" without unit, "?" for a translation or rotation; preceded by "±" if the
        value may be negative, "" if nothing is known
    starts : positions at which the sequence of names starts (a PELAS card holds two properties)
    properties : names of the property cards that the PID of an element may refer to
    length : number of fields that a card may have; None if it ends with a list
    has_plies : True for any number of plies: T1, THETA1, T2 …
    has_old_fields : True if older programs read reserved fields
    description : what cards of this kind are for, in the guide
    """

    name: str
    role: str
    fields: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    starts: tuple[int, ...] = (0,)
    properties: tuple[str, ...] = ()
    length: int | None = None
    has_plies: bool = False
    has_old_fields: bool = False
    description: str = ""

    @property
    def values(self) -> tuple[str, ...]:
        """Names of the fields that element matrices are functions of; of plies those of the first."""
        return tuple(self.units)

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
        """Reserved positions below `length`, which must be blank."""
        if self.length is None or len(self.starts) > 1 or self.has_old_fields:
            return ()
        return tuple(i for i, name in enumerate(self.fields) if name == "-" and i < self.length)

    def unit(self, name: str) -> str | None:
        """Unit of a value, of any ply; None if the card has no such value."""
        base = name.rstrip("0123456789")
        first = f"{base}1" if self.has_plies and base != name else name
        return self.units.get(name, self.units.get(first))

    def holds(self, name: str) -> bool:
        """Whether the card has a value of this name."""
        return self.unit(name) is not None


def _card(
    name: str,
    role: str,
    fields: str,
    *,
    values: str = "",
    properties: str = "",
    starts: tuple[int, ...] = (0,),
    length: int | None = None,
    has_list: bool = False,
    has_plies: bool = False,
    has_old_fields: bool = False,
) -> CardKind:
    """A declaration: names separated by blanks, values as "NAME=unit"; without `length` all fields are named.

    `has_list` is for a card that ends with a list; `length` for one with more fields than those that are read.
    """
    names = tuple(fields.split())
    units = {value.partition("=")[0]: value.partition("=")[2] for value in values.split()}
    count = None if has_list else len(names) if length is None else length
    return CardKind(
        name,
        role,
        names,
        units,
        starts=starts,
        properties=tuple(properties.split()),
        length=count,
        has_plies=has_plies,
        has_old_fields=has_old_fields,
    )


def _group(description: str, *cards: CardKind) -> Sequence[CardKind]:
    """Cards with a common description."""
    return [replace(card, description=description) for card in cards]


_DIMENSIONS = " ".join(f"DIM{i}=L" for i in range(1, 11))
_DIMENSIONS_AT_B = " ".join(f"DIM{i}B=L" for i in range(1, 11))

_CARDS = (
    *_group(
        "grid points and coordinate systems",
        _card("GRID", OTHER, "ID CP X1 X2 X3 CD PS SEID"),
        _card("GRDSET", OTHER, "- CP - - - CD PS SEID"),
        _card("SPOINT", OTHER, "ID", has_list=True),
    ),
    *_group(
        "superelements",
        _card("POINT", OTHER, "ID CP X1 X2 X3"),
        _card("SELOC", OTHER, "SEID PA1 PA2 PA3 PB1 PB2 PB3"),
    ),
    *_group(
        "grid points and coordinate systems",
        _card("CORD1R", OTHER, "CID G1 G2 G3", starts=(0, 4), has_list=True),
        _card("CORD1C", OTHER, "CID G1 G2 G3", starts=(0, 4), has_list=True),
        _card("CORD1S", OTHER, "CID G1 G2 G3", starts=(0, 4), has_list=True),
        _card("CORD2R", OTHER, "CID RID A1 A2 A3 B1 B2 B3 C1 C2 C3"),
        _card("CORD2C", OTHER, "CID RID A1 A2 A3 B1 B2 B3 C1 C2 C3"),
        _card("CORD2S", OTHER, "CID RID A1 A2 A3 B1 B2 B3 C1 C2 C3"),
    ),
    *_group(
        "materials",
        _card("MAT1", MATERIAL, "MID E G NU RHO A TREF GE", values="E=P G=P NU RHO=M/L³ GE=1", length=12),
        _card(
            "MAT2",
            MATERIAL,
            "MID G11 G12 G13 G22 G23 G33 RHO A1 A2 A3 TREF GE",
            values="G11=P G12=±P G13=±P G22=P G23=±P G33=P RHO=M/L³ GE=1",
            length=17,
        ),
        _card(
            "MAT8",
            MATERIAL,
            "MID E1 E2 NU12 G12 G1Z G2Z RHO A1 A2 TREF XT XC YT YC S GE",
            values="E1=P E2=P NU12 G12=P G1Z=P G2Z=P RHO=M/L³ GE=1",
            length=19,
        ),
        _card(
            "MAT9",
            MATERIAL,
            "MID G11 G12 G13 G14 G15 G16 G22 G23 G24 G25 G26 G33 G34 G35 G36 G44 G45 G46 G55 G56 G66 RHO A1 "
            "A2 A3 A4 A5 A6 TREF GE",
            values=(
                "G11=P G12=±P G13=±P G14=±P G15=±P G16=±P G22=P G23=±P G24=±P G25=±P G26=±P G33=P G34=±P G35=±P "
                "G36=±P G44=P G45=±P G46=±P G55=P G56=±P G66=P RHO=M/L³ GE=1"
            ),
        ),
        _card(
            "MAT11",
            MATERIAL,
            "MID E1 E2 E3 NU12 NU13 NU23 G12 G13 G23 RHO A1 A2 A3 TREF GE",
            values="E1=P E2=P E3=P NU12 NU13 NU23 G12=P G13=P G23=P RHO=M/L³ GE=1",
        ),
    ),
    *_group(
        "shells, with or without mid-side grid points",
        _card(
            "CQUAD4",
            ELEMENT,
            "EID PID G1 G2 G3 G4 THETA ZOFFS - TFLAG T1 T2 T3 T4",
            values="ZOFFS=±L T1=L T2=L T3=L T4=L",
            properties="PSHELL PCOMP PCOMPG",
        ),
        _card(
            "CTRIA3",
            ELEMENT,
            "EID PID G1 G2 G3 THETA ZOFFS - - TFLAG T1 T2 T3",
            values="ZOFFS=±L T1=L T2=L T3=L",
            properties="PSHELL PCOMP PCOMPG",
        ),
        _card(
            "CQUADR",
            ELEMENT,
            "EID PID G1 G2 G3 G4 THETA ZOFFS - TFLAG T1 T2 T3 T4",
            values="ZOFFS=±L T1=L T2=L T3=L T4=L",
            properties="PSHELL PCOMP PCOMPG",
        ),
        _card(
            "CTRIAR",
            ELEMENT,
            "EID PID G1 G2 G3 THETA ZOFFS - - TFLAG T1 T2 T3",
            values="ZOFFS=±L T1=L T2=L T3=L",
            properties="PSHELL PCOMP PCOMPG",
        ),
        _card(
            "CQUAD8",
            ELEMENT,
            "EID PID G1 G2 G3 G4 G5 G6 G7 G8 T1 T2 T3 T4 THETA ZOFFS TFLAG",
            values="ZOFFS=±L T1=L T2=L T3=L T4=L",
            properties="PSHELL PCOMP PCOMPG",
        ),
        _card(
            "CTRIA6",
            ELEMENT,
            "EID PID G1 G2 G3 G4 G5 G6 THETA ZOFFS T1 T2 T3 TFLAG",
            values="ZOFFS=±L T1=L T2=L T3=L",
            properties="PSHELL PCOMP PCOMPG",
        ),
    ),
    *_group(
        "solids, with or without mid-side grid points",
        _card(
            "CHEXA",
            ELEMENT,
            "EID PID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10 G11 G12 G13 G14 G15 G16 G17 G18 G19 G20",
            properties="PSOLID",
        ),
        _card("CPENTA", ELEMENT, "EID PID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10 G11 G12 G13 G14 G15", properties="PSOLID"),
        _card("CTETRA", ELEMENT, "EID PID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10", properties="PSOLID"),
        _card("CPYRAM", ELEMENT, "EID PID G1 G2 G3 G4 G5 G6 G7 G8 G9 G10 G11 G12 G13", properties="PSOLID"),
        _card("PSOLID", PROPERTY, "PID MID CORDM IN STRESS ISOP FCTN"),
    ),
    *_group(
        "shear panels",
        _card("CSHEAR", ELEMENT, "EID PID G1 G2 G3 G4", properties="PSHEAR"),
        _card("PSHEAR", PROPERTY, "PID MID T NSM F1 F2", values="T=L NSM=M/L² F1 F2"),
    ),
    *_group(
        "shells, with or without mid-side grid points",
        _card("PSHELL", PROPERTY, "PID MID1 T MID2 RI MID3 TS NSM Z1 Z2 MID4", values="T=L RI=1 TS=1 NSM=M/L²"),
    ),
    *_group(
        "layered shells",
        _card(
            "PCOMP",
            PROPERTY,
            "PID Z0 NSM SB FT TREF GE LAM",
            values="Z0=±L NSM=M/L² GE=1 T1=L THETA1",
            has_list=True,
            has_plies=True,
        ),
        _card(
            "PCOMPG",
            PROPERTY,
            "PID Z0 NSM SB FT TREF GE LAM",
            values="Z0=±L NSM=M/L² GE=1 T1=L THETA1",
            has_list=True,
            has_plies=True,
        ),
    ),
    *_group(
        "bars and beams",
        _card(
            "CBAR",
            ELEMENT,
            "EID PID GA GB X1 X2 X3 OFFT PA PB W1A W2A W3A W1B W2B W3B",
            values="W1A=±L W2A=±L W3A=±L W1B=±L W2B=±L W3B=±L",
            properties="PBAR PBARL",
        ),
        _card(
            "CBEAM",
            ELEMENT,
            "EID PID GA GB X1 X2 X3 OFFT PA PB W1A W2A W3A W1B W2B W3B SA SB",
            values="W1A=±L W2A=±L W3A=±L W1B=±L W2B=±L W3B=±L",
            properties="PBEAM PBEAML PBCOMP",
        ),
        _card("BAROR", OTHER, "- PID - - X1 X2 X3 OFFT"),
        _card("BEAMOR", OTHER, "- PID - - X1 X2 X3 OFFT"),
        _card(
            "PBAR",
            PROPERTY,
            "PID MID A I1 I2 J NSM - C1 C2 D1 D2 E1 E2 F1 F2 K1 K2 I12",
            values="A=L² I1=L⁴ I2=L⁴ J=L⁴ NSM=M/L K1=1 K2=1 I12=±L⁴",
        ),
        _card(
            "PBEAM",
            PROPERTY,
            "PID MID A I1 I2 I12 J NSM C1 C2 D1 D2 E1 E2 F1 F2",
            values=(
                "A=L² I1=L⁴ I2=L⁴ I12=±L⁴ J=L⁴ NSM=M/L AB=L² I1B=L⁴ I2B=L⁴ I12B=±L⁴ JB=L⁴ NSMB=M/L K1=1 K2=1 "
                "NSIA=M·L NSIB=M·L M1A=±L M2A=±L M1B=±L M2B=±L N1A=±L N2A=±L N1B=±L N2B=±L"
            ),
            has_list=True,
        ),
        _card(
            "PBARL",
            PROPERTY,
            "PID MID GROUP TYPE - - - -",
            values=f"{_DIMENSIONS} NSM=M/L",
            has_list=True,
        ),
        _card(
            "PBEAML",
            PROPERTY,
            "PID MID GROUP TYPE - - - -",
            values=f"{_DIMENSIONS} NSM=M/L {_DIMENSIONS_AT_B} NSMB=M/L",
            has_list=True,
        ),
        _card(
            "PBCOMP",
            PROPERTY,
            "PID MID A I1 I2 I12 J NSM K1 K2 M1 M2 N1 N2 SYMOPT",
            values="A=L² I1=L⁴ I2=L⁴ I12=±L⁴ J=L⁴ NSM=M/L K1=1 K2=1 M1=±L M2=±L N1=±L N2=±L",
            has_list=True,
        ),
    ),
    *_group(
        "curved bars",
        _card("CBEND", ELEMENT, "EID PID GA GB X1 X2 X3 GEOM", properties="PBEND"),
        _card(
            "PBEND",
            PROPERTY,
            "PID MID A I1 I2 J RB THETAB C1 C2 D1 D2 E1 E2 F1 F2 K1 K2 NSM RC ZC DELTAN",
            values="A=L² I1=L⁴ I2=L⁴ J=L⁴ NSM=M/L K1=1 K2=1",
        ),
    ),
    *_group(
        "rods",
        _card("CROD", ELEMENT, "EID PID G1 G2", properties="PROD"),
        _card("CONROD", ELEMENT, "EID G1 G2 MID A J C NSM", values="A=L² J=L⁴ NSM=M/L"),
        _card("PROD", PROPERTY, "PID MID A J C NSM", values="A=L² J=L⁴ NSM=M/L"),
        _card("CTUBE", ELEMENT, "EID PID G1 G2", properties="PTUBE"),
        _card("PTUBE", PROPERTY, "PID MID OD T NSM OD2", values="OD=L T=L NSM=M/L"),
    ),
    *_group(
        "springs",
        _card("CELAS1", ELEMENT, "EID PID G1 C1 G2 C2", properties="PELAS"),
        _card("CELAS2", ELEMENT, "EID K G1 C1 G2 C2 GE S", values="K=? GE=1"),
        _card("CELAS3", ELEMENT, "EID PID S1 S2", properties="PELAS", starts=(0, 4), length=8),
        _card("CELAS4", ELEMENT, "EID K S1 S2", values="K=?", starts=(0, 4), length=8),
        _card("PELAS", PROPERTY, "PID K GE S", values="K=? GE=1", starts=(0, 4), length=8),
    ),
    *_group(
        "dashpots",
        _card("CDAMP1", ELEMENT, "EID PID G1 C1 G2 C2", properties="PDAMP"),
        _card("CDAMP2", ELEMENT, "EID B G1 C1 G2 C2", values="B=?"),
        _card("CDAMP3", ELEMENT, "EID PID S1 S2", properties="PDAMP", starts=(0, 4), length=8),
        _card("CDAMP4", ELEMENT, "EID B S1 S2", values="B=?", starts=(0, 4), length=8),
        _card("PDAMP", PROPERTY, "PID B", values="B=?", starts=(0, 2, 4, 6), length=8),
        _card("CVISC", ELEMENT, "EID PID G1 G2", properties="PVISC"),
        _card("PVISC", PROPERTY, "PID CE CR", values="CE=F·s/L CR=F·L·s", starts=(0, 4), length=8),
    ),
    *_group(
        "springs and dashpots in several directions or along a line",
        _card("CBUSH1D", ELEMENT, "EID PID GA GB CID", properties="PBUSH1D"),
        _card("PBUSH1D", PROPERTY, "PID K C M", values="K=F/L C=F·s/L", has_list=True),
        _card("CBUSH", ELEMENT, "EID PID GA GB X1 X2 X3 CID S OCID S1 S2 S3", properties="PBUSH"),
        _card(
            "PBUSH",
            PROPERTY,
            "PID - K1 K2 K3 K4 K5 K6",
            values=(
                "K1=F/L K2=F/L K3=F/L K4=F·L K5=F·L K6=F·L B1=F·s/L B2=F·s/L B3=F·s/L B4=F·L·s B5=F·L·s B6=F·L·s "
                "GE1=1 GE2=1 GE3=1 GE4=1 GE5=1 GE6=1"
            ),
            has_list=True,
        ),
    ),
    *_group(
        "gaps, as linear springs",
        _card("CGAP", ELEMENT, "EID PID GA GB X1 X2 X3 CID", properties="PGAP"),
        _card("PGAP", PROPERTY, "PID U0 F0 KA KB KT MU1 MU2 TMAX MAR TRMIN", values="KA=F/L KB=F/L KT=F/L"),
    ),
    *_group(
        "welds between shells",
        _card("CWELD", ELEMENT, "EID PID GS TYPE GA GB SPTYP MCID", properties="PWELD", length=24),
        _card("PWELD", PROPERTY, "PID MID D - - MSET - TYPE LDMIN LDMAX", values="D=L"),
    ),
    *_group(
        "fasteners between shells",
        _card("CFAST", ELEMENT, "EID PID TYPE IDA IDB GS GA GB XS YS ZS", properties="PFAST"),
        _card(
            "PFAST",
            PROPERTY,
            "PID D MCID MFLAG KT1 KT2 KT3 KR1 KR2 KR3 MASS GE",
            values="KT1=F/L KT2=F/L KT3=F/L KR1=F·L KR2=F·L KR3=F·L MASS=M GE=1",
        ),
    ),
    *_group(
        "masses",
        _card("CMASS1", ELEMENT, "EID PID G1 C1 G2 C2", properties="PMASS"),
        _card("CMASS2", ELEMENT, "EID M G1 C1 G2 C2", values="M=?"),
        _card("CMASS3", ELEMENT, "EID PID S1 S2", properties="PMASS", starts=(0, 4), length=8),
        _card("CMASS4", ELEMENT, "EID M S1 S2", values="M=?", starts=(0, 4), length=8),
        _card("PMASS", PROPERTY, "PID M", values="M=?", starts=(0, 2, 4, 6), length=8),
        _card(
            "CONM1",
            ELEMENT,
            "EID G CID M11 M21 M22 M31 M32 M33 M41 M42 M43 M44 M51 M52 M53 M54 M55 M61 M62 M63 M64 M65 M66",
            values=(
                "M11=M M21 M22=M M31 M32 M33=M M41 M42 M43 M44=M·L² M51 M52 M53 M54 M55=M·L² M61 M62 M63 M64 M65 "
                "M66=M·L²"
            ),
        ),
        _card(
            "CONM2",
            ELEMENT,
            "EID G CID M X1 X2 X3 - I11 I21 I22 I31 I32 I33",
            values="M=M I11=M·L² I21=±M·L² I22=M·L² I31=±M·L² I32=±M·L² I33=M·L²",
        ),
    ),
    *_group(
        "rigid and averaging elements",
        _card("RBE2", ELEMENT, "EID GN CM", has_list=True),
        _card("RBAR", ELEMENT, "EID GA GB CNA CNB CMA CMB ALPHA", length=9),
        _card("RBAR1", ELEMENT, "EID GA GB CB ALPHA", length=6),
        _card("RBE1", ELEMENT, "EID", has_list=True),
        _card("RBE3", ELEMENT, "EID - REFGRID REFC", has_list=True),
        _card("RROD", ELEMENT, "EID GA GB CMA CMB ALPHA", length=7),
        _card("RTRPLT", ELEMENT, "EID GA GB GC CNA CNB CNC - CMA CMB CMC ALPHA", length=13),
        _card("RTRPLT1", ELEMENT, "EID GA GB GC CMB CMC ALPHA", length=8),
        _card("RSPLINE", ELEMENT, "EID DL G1", has_list=True),
        _card("CRIGD1", ELEMENT, "EID IG", has_list=True),
        _card("CRIGD2", ELEMENT, "EID IG", has_list=True),
        _card("CRIGD3", ELEMENT, "EID", has_list=True),
        _card("CRIGDR", ELEMENT, "EID GA GB CMB", length=4),
    ),
    *_group(
        "a stiffness or flexibility matrix",
        _card("GENEL", OTHER, "EID", has_list=True),
    ),
    *_group(
        "constraints",
        _card("MPC", OTHER, "SID", has_list=True),
        _card("MPCADD", OTHER, "SID", has_list=True),
        _card("SPC", OTHER, "SID G1 C1 D1 G2 C2 D2"),
        _card("SPC1", OTHER, "SID C", has_list=True),
        _card("SPCADD", OTHER, "SID", has_list=True),
    ),
    *_group(
        "sets without effect on the constraints",
        _card("ASET", OTHER, "ID C", length=8),
        _card("OMIT", OTHER, "ID C", length=8),
        _card("BSET", OTHER, "ID C", length=8),
        _card("CSET", OTHER, "ID C", length=8),
        _card("QSET", OTHER, "ID C", length=8),
        _card("BNDFIX", OTHER, "ID C", length=8),
        _card("BNDFREE", OTHER, "ID C", length=8),
        _card("SUPORT", OTHER, "ID C", length=8),
        _card("ASET1", OTHER, "C", has_list=True),
        _card("OMIT1", OTHER, "C", has_list=True),
        _card("BSET1", OTHER, "C", has_list=True),
        _card("CSET1", OTHER, "C", has_list=True),
        _card("QSET1", OTHER, "C", has_list=True),
        _card("BNDFIX1", OTHER, "C", has_list=True),
        _card("BNDFRE1", OTHER, "C", has_list=True),
        _card("SUPORT1", OTHER, "SID", length=7),
        _card("USET", OTHER, "SNAME", length=7),
        _card("USET1", OTHER, "SNAME C", has_list=True),
    ),
    *_group(
        "superelements",
        _card("EXTRN", OTHER, "ID C", has_list=True),
        _card("SEBULK", OTHER, "SEID TYPE RSEID METHOD TOL LOC UNITNO"),
        _card("SECONCT", OTHER, "SEIDA SEIDB TOL LOC - - - -", has_list=True),
        _card("SEBNDRY", OTHER, "SEIDA SEIDB", has_list=True),
        _card("SEEXCLD", OTHER, "SEIDA SEIDB", has_list=True),
    ),
    *_group(
        "non-structural mass selected in case control",
        _card("NSM", OTHER, "SID TYPE", has_list=True),
        _card("NSM1", OTHER, "SID TYPE VALUE", has_list=True),
        _card("NSML", OTHER, "SID TYPE", has_list=True),
        _card("NSML1", OTHER, "SID TYPE VALUE", has_list=True),
        _card("NSMADD", OTHER, "SID", has_list=True),
    ),
    *_group(
        "number and frequency range of the modes, selected by METHOD",
        _card("EIGR", OTHER, "SID METHOD F1 F2 NE ND - - NORM G C", has_old_fields=True),
        _card("EIGRL", OTHER, "SID V1 V2 ND MSGLVL MAXSET SHFSCL NORM", has_list=True),
    ),
    *_group(
        "settings",
        _card("PARAM", OTHER, "NAME VALUE", length=3),
    ),
    *_group(
        "modal damping selected in case control",
        _card("TABDMP1", OTHER, "TID TYPE FLAT", has_list=True),
    ),
)

CATALOGUE: dict[str, CardKind] = {card.name: card for card in _CARDS}
"""Understood cards by name."""

PLY_CARDS = tuple(card.name for card in _CARDS if card.has_plies)
"""Cards whose values are those of any number of plies."""

NODE_FIELDS = frozenset({"GA", "GB", "G", *(f"G{i}" for i in range(1, 21))})
"""Names of the fields of elements that refer to grid points."""
