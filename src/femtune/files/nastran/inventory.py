"""Use of each card: read, not needed for normal modes, not understood, or a missing element."""

from __future__ import annotations

import re
from dataclasses import dataclass

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.nastran.card import Card
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.loads import is_read

READ = "read"
NOT_NEEDED = "not needed for normal modes"
IGNORED = "not understood"
MISSING = "missing element"
"""Uses of a card; a missing element makes the modes wrong."""

# Loads, tables, dynamics, aeroelasticity, heat, optimisation, output: they do not affect K, M and the constraints.
_NOT_NEEDED_NAMES = """
    ACCEL ACCEL1 DAREA DEFORM DELAY DLOAD DPHASE FORCE FORCE1 FORCE2 FORCEAX GRAV LOAD LOADCYH LOADCYN LSEQ MOMENT
    MOMENT1 MOMENT2 MOMAX PLOAD PLOAD1 PLOAD2 PLOAD4 PLOADX1 PRESAX RANDPS RANDT1 RFORCE RLOAD1 RLOAD2 SLOAD SPCD
    TEMP TEMPD TEMPRB TEMPP1 TEMPP3 TEMPAX TLOAD1 TLOAD2 TIC SPCR DYNRED NOLIN1 NOLIN2 NOLIN3 NOLIN4 TF
    FREQ FREQ1 FREQ2 FREQ3 FREQ4 FREQ5 TSTEP TSTEPNL NLPARM NLPCI EIGB EIGC EIGP EPOINT EXTRN
    TABLED1 TABLED2 TABLED3 TABLED4 TABLEM1 TABLEM2 TABLEM3 TABLEM4 TABLES1 TABLEST TABRND1 TABRNDG DTI DTABLE
    AEDW AEFACT AEFORCE AELINK AELIST AEPARM AEPRESS AERO AEROS AESTAT AESURF AESURFS CAERO1 CAERO2 CAERO3 CAERO4
    CAERO5 CSSCHD DIVERG FLFACT FLUTTER GUST MKAERO1 MKAERO2 PAERO1 PAERO2 PAERO3 PAERO4 PAERO5 SET1 SET2 SET3 SPLINE1
    SPLINE2 SPLINE3 SPLINE4 SPLINE5 SPLINE6 SPLINE7 TRIM UXVEC
    BCONP BFRIC BLSEG BOUTPUT CHBDY CHBDYE CHBDYG CHBDYP CONV CONVM MAT4 MAT5 PCONV PCONVM PHBDY QBDY1 QBDY2 QBDY3 QHBDY
    QVECT QVOL RADBC RADM RADMT RADSET TEMPBC VIEW VIEW3D
    DCONADD DCONSTR DDVAL DEQATN DESVAR DLINK DOPTPRM DRESP1 DRESP2 DRESP3 DSCREEN DVCREL1 DVCREL2 DVGRID DVMREL1
    DVMREL2 DVPREL1 DVPREL2 DVBSHAP DVSHAP TOPVAR
    BAROR BEAMOR CBARAO PLOTEL PLOTEL3 PLOTEL4 MONPNT1 MONPNT2 MONPNT3 MDLPRM HDF5OUT ECHOON ECHOOFF SEQGP MFLUID
    CDAMP5 PDAMP5 PBUSHT PELAST PDAMPT SUPORT6
    SELABEL SETREE SESET SEELT SEQSET SEQSET1 SENQSET CMETHOD BGSET BCTSET BSURF BSURFS
"""
_NOT_NEEDED = frozenset(_NOT_NEEDED_NAMES.split()) - set(CATALOGUE)

# Elements and constraints without which the modes would be wrong, in addition to all other cards of the form C…
_ELEMENT_NAMES = "RJOINT RSSCON RBE2A RBE2GS RBE3D DMIAX"
_ELEMENTS = frozenset(_ELEMENT_NAMES.split())
_TEMPERATURE = "materials do not depend on temperature here; those on the material card are used"
_SINGULAR = "degrees of freedom without stiffness are constrained nevertheless"
_BY_FREQUENCY = "values do not depend on frequency or force here; those on the property card are used"
_SECTOR = "cyclic symmetry is not modelled; the modes are those of one segment, whose sides are free"
_REMARKS = {
    **dict.fromkeys(("CYAX", "CYJOIN", "CYSUP", "CYSYM"), _SECTOR),
    **dict.fromkeys(("PBUSHT", "PELAST", "PDAMPT"), _BY_FREQUENCY),
    **dict.fromkeys(("MATT1", "MATT2", "MATT3", "MATT8", "MATT9"), _TEMPERATURE),
    **dict.fromkeys(("SPCOFF", "SPCOFF1"), _SINGULAR),
    "SWLDPRM": "welds and fasteners have the default settings",
    "PFASTT": _BY_FREQUENCY,
    "DMIG": "case control selects none of these matrices as K2GG, M2GG, B2GG or K42GG",
}
_FEWEST_POINTS = 2
"""Grid points in its third and further fields from which a card C… of unknown name is an element."""
_ELEMENT_NAME = re.compile(
    r"C(A(ABS|CIN|XIF)|B(AR|EAM|ELT|END|USH|UTT)|C(ONE|RSF)|D(AMP|ISTEL|UM)|ELAS|F(AST|ILL|LUID)|GAP|H(AC|EX)|I(F|HEX|NTC|S2|S3)"
    r"|MASS|ON(EAX|M|ROD)|P(ENT|LST|YR)|Q(D|U)|R(AC|OD)|S(EAM|HEAR|LOT|PH|POT|PR|SHL)|T(ET|IRE|ORDRG|R|UBE|WIST)|VISC"
    r"|W(ED|ELD|SEAM))[A-Z0-9]*"
)
"""Names of the elements of MSC Nastran, Simcenter Nastran and NASTRAN-95, by their beginnings."""
_NO_ELEMENTS = (
    "CAALOAD", "CAERO", "CAMPBLL", "CBARAO", "CLOAD", "CMETHOD", "CMSMETH", "CNGRNT", "CNTNLSUB", "CNTSTB", "COHFRIC",
    "COMBWLD", "CONCTL", "CONNECT", "CONTACT", "CONTF", "CONTPRM", "CONTREL", "CONTRLT", "CONTX", "CONV", "CORD",
    "COUOPT", "COUP", "CRAKTP", "CREEP", "CROSSEC", "CSCHD", "CSET", "CSMSET", "CSPLIN", "CYAX", "CYC", "CYJOIN",
    "CYSUP", "CYSYM",
)  # fmt: skip
"""Beginnings of the names of other cards of the form C…: aerodynamics, contact, coordinates, loads, sets."""


@dataclass(frozen=True)
class CardUse:
    """Cards of one name: their number, the place of the first, and their use."""

    name: str
    count: int
    where: Where
    use: str


def take_inventory(deck: Deck) -> tuple[CardUse, ...]:
    """Every card name of the deck, in the order in which they occur."""
    return tuple(
        CardUse(name, len(cards), cards[0].where(), _use_in(deck, name, cards[0])) for name, cards in deck.names.items()
    )


def _use_in(deck: Deck, name: str, first: Card) -> str:
    """Use of the cards of a name in a deck: an unknown C… is an element if it refers to two grid points or more."""
    if _read_here(deck, name):
        return READ
    use = use_of(name)
    if use == IGNORED and name.startswith("C") and not name.startswith(_NO_ELEMENTS):
        points = {card.text(0) for card in deck.by_name("GRID")}
        if sum(first.text(at) in points for at in range(2, 10)) >= _FEWEST_POINTS:
            return MISSING
    return use


def _read_here(deck: Deck, name: str) -> bool:
    """Whether case control selects loads of a preload, or adds matrices of DMIG cards, or a superelement has them."""
    matrices = any(c.name in ("K2GG", "M2GG", "B2GG", "K42GG") for c in deck.case_control.effective) or any(
        card.text(1) == "EXTERNAL" for card in deck.by_name("SEBULK")
    )
    return is_read(deck, name) or (name == "DMIG" and matrices)


def use_of(name: str) -> str:
    """Use of the cards of a name."""
    if name in CATALOGUE:
        return READ
    if name in _NOT_NEEDED:
        return NOT_NEEDED
    element = _ELEMENT_NAME.fullmatch(name) and not name.startswith(_NO_ELEMENTS)
    return MISSING if element or name in _ELEMENTS else IGNORED


def ignored_notices(counts: tuple[CardUse, ...]) -> list[Notice]:
    """A notice for each card name that is not read."""
    levels = {NOT_NEEDED: "info", IGNORED: "warning"}
    return [
        Notice(
            "deck.ignored-cards",
            where=c.where,
            level=levels[c.use],
            cards=_cards(c),
            reason=_REMARKS.get(c.name, c.use),
        )
        for c in counts
        if c.use in levels
    ]


def missing_error(count: CardUse) -> FemtuneError:
    """Error for an element or constraint that is not read."""
    return FemtuneError(
        "deck.unsupported-element",
        where=count.where,
        cards=_cards(count),
        it_or_them="it" if count.count == 1 else "them",
        count_name=count.name,
    )


def missing_notice(count: CardUse) -> Notice:
    """The same as a warning, if missing elements are permitted."""
    return Notice("deck.unsupported-element/left-out", where=count.where, cards=_cards(count))


def _cards(count: CardUse) -> str:
    return f"{count.count} {count.name} card{'s are' if count.count > 1 else ' is'}"
