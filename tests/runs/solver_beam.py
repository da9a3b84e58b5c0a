"""A cantilever with a template for two solvers."""

from __future__ import annotations

LENGTH, WIDTH, HEIGHT, DENSITY = 0.8, 0.01, 0.02, 7850.0
INP = (
    "*NODE, NSET=NALL\n"
    + "".join(f"{i + 1},{LENGTH * i / 16:.6g},0.,0.\n" for i in range(17))
    + "*ELEMENT, TYPE=B32R, ELSET=EALL\n"
    + "".join(f"{i + 1},{2 * i + 1},{2 * i + 2},{2 * i + 3}\n" for i in range(8))
    + f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{{{{E:.6e}}}},.3\n*DENSITY\n{DENSITY}\n"
    + f"*BEAM SECTION, ELSET=EALL, MATERIAL=STEEL, SECTION=RECT\n{WIDTH},{HEIGHT}\n0.,1.,0.\n"
    + "*BOUNDARY\n1,1,6\n*STEP\n*FREQUENCY\n6\n*NODE FILE, OUTPUT=2D\nU\n*END STEP\n"
)
BDF = (
    "SOL 103\nCEND\nMETHOD = 10\nSPC = 1\nDISPLACEMENT(PRINT,PLOT) = ALL\nBEGIN BULK\nPARAM,COUPMASS,1\n"
    "PARAM,GRDPNT,0\nPARAM,POST,-1\nEIGRL,10,,,6\n"
    + "".join(f"GRID,{i + 1},,{LENGTH * i / 16:.5f},0.,0.\n" for i in range(17))
    + "".join(f"CBAR,{i + 1},1,{i + 1},{i + 2},0.,1.,0.\n" for i in range(16))
    + f"PBAR,1,1,{WIDTH * HEIGHT},{WIDTH * HEIGHT**3 / 12:.6e},{HEIGHT * WIDTH**3 / 12:.6e},4.58-9\n"
    + f"MAT1    1       {{{{E:n8}}}}        .3      {DENSITY}\nSPC1,1,123456,1\nENDDATA\n"
)
