"""Small decks that hold every card that is understood, each in a use that gives modes."""

from __future__ import annotations

_GRIDS = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
GRID,4,,3.,0.,.1
GRID,5,,4.,0.,0.
GRID,6,,5.,0.,0.
"""

FRAME = (
    """SOL 103
CEND
TITLE = frame
METHOD = 10
SPC = 3
BEGIN BULK
EIGRL,10,,,6
PARAM,GRDPNT,0
PARAM,WTMASS,1.
PARAM,COUPMASS,1
PARAM,AUTOSPC,YES
GRDSET  ,,,,,,,,
CORD2R  5               0.      0.      0.      0.      0.      1.
        1.      0.      0.
CORD2C  6       5       0.      0.      0.      0.      0.      1.      +A
+A      1.      0.      1.
CORD2S* 7                               0.              0.              *B
*B      0.              0.              0.              1.
*       1.              0.              1.
*
CORD1R  8       21      22      23
CORD1C,9,21,22,23
CORD1S,10,21,22,23
GRID    21              0.      0.      5.
GRID    22              0.      0.      6.
GRID    23              1.      0.      5.
"""
    + _GRIDS
    + """GRID,7,6,5.,90.,0.
GRID,8,5,6.,1.,0.,6
GRID,9,,7.,1.,0.
GRID,10,,8.,1.,0.
GRID,11,8,1.,2.,3.,9
GRID,12,7,4.,30.,20.
GRID,13,,9.,1.,1.
GRID,14,,9.,2.,1.
GRID,15,,9.,2.,2.
BAROR                                   0.      1.      0.      GGG
MAT1    1       2.+11           .3      7800.   1.2-5   20.     .01     $ steel
MAT1*                  2         7.2E+10                             .33
*                  2.7D3
PBAR    3       1       1.-2    2.-5    1.-5    1.5-5   .5              +P3
+P3     .1      .1      -.1     .1                                      +P4
+P4     .8      .7      1.-6
PBARL,4,2,,TUBE
,.1,.08,3.
CBAR    1       3       1       2
CBAR    2       4       2       3       1.      1.      0.
        5               0.      .01     0.      0.      .01     0.
CBAR    3       3       3       4
CBAR    4       4       4       5       0.      0.      1.
CBAR,5,3,5,6,21
INCLUDE 'more.inc'
CONM2   31      6               5.      .1      0.      0.              +
+       .3      .01     .4      0.      0.      .5
CONM1,32,5,,9.,,9.,,
,9.,,,,1.,,,
,,1.,,,,,,1.
SPC1    1       123456  1       21      THRU    23
SPC     2       11      123456  0.      12      123456
SPCADD  3       1       2
ENDDATA
"""
)

BEAMS = (
    """SOL SEMODES
CEND
METHOD = 10
SPC = 1
BEGIN BULK
EIGRL,10,,,3
BEAMOR                                  0.      1.      .1
"""
    + _GRIDS
    + """MAT1    1       2.+11           .3      7800.   1.2-5   20.     .01     $ steel
MAT1*                  2         7.2E+10                             .33
*                  2.7D3
PBEAM   5       1       1.-2    2.-5    1.-5    1.-6    1.-5    .5      $
+       .1                                                              $
+       YES     .5      1.1-2   2.1-5   1.1-5   1.-6    1.-5    .5
+       .1
+       YES     1.      1.2-2   2.2-5   1.2-5   1.-6    1.1-5   .6
+
+       .8      .8                      .1      .1
+       .01     .0      .01     .0      .02     .0      .02
PBEAML  6       2               BOX
        .2      .1      .01     .02     3.      YES     1.      .22
        .11     .01     .02     3.
PBCOMP  7       1       1.-2    2.-5    1.-5            1.-5    .5
        .8      .8                                      1
        .05     .05     .25     2
PBARL,8,1,,I
,.2,.1,.12,.01,.02,.021,3.
CBEAM   3       5       3       4
CBEAM   4       6       4       5       0.      0.      1.
CBEAM,5,7,5,6,0.,0.,1.
CBEAM,6,5,2,3,0.,0.,1.
CBAR,7,8,1,2,0.,1.,0.
GRID,7,,6.,0.,0.
CONM2,8,7,,3.
RBE2,9,6,123456,7
GRID,8,,7.,1.,0.
GRID,9,,8.,1.,0.
GRID,10,,9.,1.,0.
PBEND   10      1       1.-2    2.-5    1.-5    1.5-5
+
+       .8      .8      .5
CBEND   21      10      7       8       0.      1.      0.      2
PTUBE,11,1,.1,.01,.5
CTUBE   22      11      8       9
CBAR,24,8,8,10,0.,1.,0.
RSPLINE 23      .1      8       9       123456  10
SPC1,1,123456,1
ENDDATA
"""
)

MORE = """$ rigid elements, caf\u00e9
RBE2    41      6       123456  7       8
RBAR    42      8       9       123456                  123456
RBAR1   43      9       10      123456  1.2-5
RBE1    44      10      123456
        UM      13      123
RBE3    45              14      123     1.      123     10      13
        2
RROD    46      14      15              3
CBAR    51      3       13      15
CBAR    52      3       10      13
"""

SHELLS = """SOL 103
CEND
METHOD = 10
SPC = 1
MPC = 5
NSM = 9
SDAMPING = 4
BEGIN BULK
EIGR    10      LAN                             6
PARAM,K6ROT,100.
PARAM,SNORM,20.
TABDMP1 4       CRIT
        0.      .01     100.    .02     ENDT
GRID    1               0.      0.      0.
GRID    2               1.      0.      0.
GRID    3               2.      0.      .1
GRID    4               0.      1.      0.
GRID    5               1.      1.      0.
GRID    6               2.      1.      .1
GRID    7               1.      2.      .0
GRID    8               0.      1.      1.
GRID    9               1.      1.      1.
GRID    10              0.      2.      1.
GRID    11              0.      3.      1.
GRID    12              1.      3.      1.
CORD2R,5,,0.,0.,0.,0.,0.,1.
,1.,0.,0.
MAT1,1,2.+11,,.3,7800.,,,.01
MAT2    2       2.+11   5.+10           2.+11           8.+10   7000.
        1.-5    1.-5                    .02
MAT8*                  3           1.+11           1.+10              .3
*                   5.+9            4.+9            3.+9           1600.
PSHELL  11      1       .01     1       1.1     1       .8      .5
PSHELL,12,2,.02,2,,1
PSHELL  13      3       .01     3               3
PSHELL,14,1,.005
CQUAD4  1       11      1       2       5       4       30.     .01     $ skin
                        .01     .011    .01     .011
CQUAD4  2       12      2       3       6       5       5
CTRIA3  3       13      4       5       7       0.      -.01
                        .01     .01     .012
CTRIA3,4,11,5,6,7
CQUAD4,5,11,4,5,9,8
CQUAD4,6,14,10,11,12,9
GRID,18,,.5,2.,1.
CQUAD8  7       11      8       9       12      11                      $ roof
                        .01     .011                    5       -.01
CTRIA6,8,12,7,9,12
,45.,.01,.02,,.022
GRID    13              3.      0.      1.
GRID    14              3.      1.      1.
GRID    15              3.      0.      2.
GRID    16              3.      1.      2.
GRID    17              3.      2.      2.
CONM2,31,15,,2.
RTRPLT  21      6       13      14      123456
                123456  123456
RTRPLT1 22      14      15      16      123456  123456
RBAR    23      16      17      123456
CONM2,32,17,,2.
GRID,51,,3.,2.,2.5
GRID,52,,3.5,2.,2.
GRID,53,,3.,2.5,2.
GRID,54,,4.,2.,2.,,23456
CRIGD1,51,17,51
CRIGD2,52,17,52,123456
CRIGD3,53,17,123456
,MSET,53,123456
CRIGDR,54,17,54,1
CONM2,51,51,,.1
CONM2,52,52,,.1
CONM2,53,53,,.1
CQUADR,9,11,13,14,16,15
CTRIAR  10      12      14      16      17      0.
GRID    41              .2      .2      .3
GRID    42              .9      .2      .3
GRID    43              .9      .9      .3
GRID    44              .2      .9      .3
GRID    45              .5      .5      .1
CQUAD4  11      12      41      42      43      44
PWELD   21      1       .2                                      SPOT
        .3      4.
CWELD   41      21      45      ELEMID
        1       11
CWELD   42      22      45      GRIDID                  QQ
        1       2       5       4
        41      42      43      44
CWELD   43      23              PARTPAT
        11      12
        .6      .6      .1
CWELD,44,22,,ALIGN,1,41
PWELD   22      1       .1
PWELD   23      1       .1
PFAST   24      .1      5       1       2.+7    1.+7    1.+7    1.+5
        1.+5    1.+5    2.      .02
CFAST   45      24      ELEM    1       11      45
CFAST,46,24,PROP,11,12,,,,
,.4,.6,.1
MPC     2       6       3       1.      3       3       -1.             +
+               9       3       .5
MPC     3       12      1       1.      11      1       -1.
MPCADD  5       2       3
NSM     1       PSHELL  11      .5
NSM1    2       PSHELL  1.      12      13
NSML    3       ELEMENT 4       2.
NSML1   4       ELEMENT 5.      5       THRU    6
NSMADD  9       1       2       3       4
SPC1    1       123456  1       4
ENDDATA
"""

SOLIDS = """SOL 103
CEND
METHOD = 10
SPC = 1
BEGIN BULK
EIGRL   10                      6
CORD2C  5               0.      0.      0.      0.      0.      1.
        1.      0.      0.
GRID    1               0.      0.      0.
GRID    2               1.      0.      0.
GRID    3               1.      1.      0.
GRID    4               0.      1.      0.
GRID    5               0.      0.      1.
GRID    6               1.      0.      1.
GRID    7               1.      1.      1.1
GRID    8               0.      1.      1.
GRID    9               2.      0.      0.
GRID    10              2.      0.      1.
GRID    11              .5      .5      2.      5
GRID    12              -1.     .5      .5
GRID    13              1.05    .5      .0
GRID    14              1.      0.      .5
GRID    15              1.      2.      0.
GRID    16              2.      2.      0.
GRID    17              2.      1.      .1
MAT1    1       2.+11           .3      7800.                   .01     $ steel
MAT9    2       2.5+11  1.+11   1.+11                           2.5+11
        1.+11                           2.5+11
        8.+10                   8.+10           8.+10   7000.
                                                        .02
MAT11*                 3           1.+11           1.+10           2.+10
*                     .3             .25              .2            5.+9
*                   4.+9            3.+9           1600.
*
PSOLID,11,1
PSOLID  12      2       5       TWO     GRID
PSOLID,13,3,-1
PSHEAR  14      1       .01     .5      .9      30.
CHEXA   1       11      1       2       3       4       5       6
        7       8
CPENTA  2       12      2       9       3       6       10      7
CPYRAM  3       11      5       6       7       8       11
CTETRA  4       11      1       5       4       12
CTETRA,5,12,1,2,3,6,,13
,,,14
CHEXA   6       13      1       2       3       4       5       6       +
+       7       8
CSHEAR  7       14      3       15      16      17
CSHEAR  8       14      2       9       17      3
SPC1    1       123456  1       4       5       8
SPC1    1       3       15      16      17
ENDDATA
"""

SPRINGS = (
    """SOL 111
CEND
METHOD = 10
BEGIN BULK
PARAM,AUTOSPC,YES
EIGRL   10                      5
PARAM,G,.02
PARAM,W3,100.
PARAM,W4,100.
SPOINT,50,51,52
SPOINT,60,THRU,63
"""
    + _GRIDS
    + """MAT1,1,2.+11,,.3,7800.,,,.01
PROD    3       1       1.-3    1.-6            .5
CROD    1       3       1       2
CONROD  2       2       3       1       1.-3    1.-6            .5
PELAS   5       1000.   .1              6       2000.   .2
CELAS1  11      5       1       2       2       2
CELAS2  12      500.    2       3                       .1
CELAS3  13      6       50      51
CELAS4,14,300.,51,52
CORD2R,1,,0.,0.,0.,0.,0.,1.
,1.,0.,0.
PDAMP   7       .5      8       .6      9       .7      10      .8
CDAMP1  21      7       1       1       2       1
CDAMP2  22      .4      3       1
CDAMP3  23      8       50      51
CDAMP4  24      .3      52
PVISC   11      .5      .6              12      .7      .8
CVISC   25      12      3       4
PBUSH1D 13      1000.   .5
CBUSH1D 26      13      4       5
PBUSH   14      K       1.+5    1.+5    1.+5    1.+4    1.+4    1.+4
                B       1.      1.      1.
                GE      .01
CBUSH   27      14      5       6                               0
CBUSH   28      14      4       5       0.      1.      0.              .4
CBUSH,43,14,4,3,,,,0
CELAS2,44,900.,60,,61
CMASS4,37,1.,61
CELAS2,46,900.,62,,63
CMASS4,38,1.,63
CMASS4,39,1.,60
CBUSH,29,14,3,,,,,0
CBUSH,30,14,1,,,,,0
,.5,0,.1,.1,.1
PGAP    17                      1.+5            1.+4
CGAP    45      17      1       2       0.      1.      0.
GENEL   47              60      0       62      0
        K       50.     -20.    40.
PMASS   15      5.      16      6.
CMASS1  31      15      1       1
CMASS2  32      4.      2       1       1       1
CMASS3  33      16      50
CMASS4  34      3.      51      52
CONM2,35,6,,4.
CONM2,36,3,,4.
ASET    1       123     2       123
ASET1   123     3       THRU    5
OMIT    6       4
OMIT1   5       6
BSET    1       4
BSET1   4       2
CSET    1       5
CSET1   5       2
QSET    60      0       61      0
QSET1   0       62      63
BNDFIX  3       4
BNDFIX1 4       4
BNDFREE 3       5
BNDFRE1 5       4
SUPORT  1       1
SUPORT1 7       2       1
USET    U1      1       1
USET1   U2      2       3
ENDDATA
"""
)

LAMINATES = """SOL 103
CEND
METHOD = 10
SPC = 1
BEGIN BULK
EIGRL   10                      3
GRID    1               0.      0.      0.
GRID    2               1.      0.      0.
GRID    3               2.      0.      0.
GRID    4               0.      1.      0.
GRID    5               1.      1.      0.
GRID    6               2.      1.      .1
GRID    7               3.      0.      0.
CORD2R,5,,0.,0.,0.,0.,0.,1.
,1.,0.,0.
MAT1,1,2.+11,,.3,7800.,,,.01
MAT2    2       2.+11   5.+10           2.+11           8.+10   7000.
MAT8*                  3           1.+11           1.+10              .3
*                   5.+9            4.+9            3.+9           1600.
PCOMP   11      -.02    1.5                             .02
        3       .01     30.     YES     3       .01     -30.    NO
        1       .02                             90.
PCOMP   12                                                      SYM
        3       .005    0.              3       .005    45.
PCOMP,13,,,,,,,SMCORE
,2,.002,,,1,.03
PCOMPG  14      -.01    .5                              .03
        101     3       .01     30.     YES
        7       1       .02
        5               .01     60.
CQUAD4  1       11      1       2       5       4       30.
CQUAD4  2       12      2       3       6       5       5       .01
CTRIA3  3       14      3       7       6       0.
CTRIA3,4,13,2,7,5
NSM1    2       PCOMP   1.      11      12
SPC1    1       123456  1       4
ENDDATA
"""

PARTS = """SOL 103
CEND
METHOD = 1
SPC = 1
SUBCASE 1
SUPER = 0
SUBCASE 2
SUPER = 3
BEGIN BULK
EIGRL,1,,,4
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
CBAR,1,1,1,2,0.,1.,0.
CBAR,2,1,2,3,1.,0.,0.
PBAR,1,1,1.-3,1.-6,2.-6,2.-6
MAT1,1,2.1+11,,.3,7850.
SPC1,1,123456,1
POINT,11,,1.,0.,0.
POINT,12,,2.,0.,0.
POINT,13,,1.,0.,1.
SELOC,3,1,2,9,11,12,13
SEBULK,3,PRIMARY,,AUTO,1.-4
SEBULK,5,PRIMARY,,MANUAL
SECONCT,5,0,1.-3,NO,,,,
,1,3,2,2
SEBNDRY,3,0,1,THRU,2
SEEXCLD,3,5,ALL
BEGIN SUPER = 3
GRID,1,,0.,5.,0.
GRID,2,,0.,6.,0.
GRID,9,,0.,5.,1.
GRID,4,,0.,7.,.5
CBAR,1,1,1,2,1.,0.,0.
CBAR,2,1,2,4,1.,0.,0.
RBE2,3,2,123456,9
PBAR,1,1,2.-3,1.-6,2.-6,2.-6
MAT1,1,2.1+11,,.3,7850.
SPC1,1,123,4
EXTRN,1,123456
BEGIN BULK SUPER = 5
GRID,1,,1.,1.,0.
GRID,2,,1.,0.,0.
CROD,1,7,1,2
PROD,7,1,1.-4
MAT1,1,7.+10,,.3,2700.
ENDDATA
"""

DECKS = {
    "parts": {"deck.bdf": PARTS},
    "frame": {"deck.bdf": FRAME, "more.inc": MORE},
    "beams": {"deck.bdf": BEAMS},
    "shells": {"deck.bdf": SHELLS},
    "solids": {"deck.bdf": SOLIDS},
    "springs": {"deck.bdf": SPRINGS},
    "laminates": {"deck.bdf": LAMINATES},
}
