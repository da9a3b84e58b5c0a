"""The same mesh as a Nastran deck with four-node shells."""

from __future__ import annotations

from calculix import DENSITY, POISSON, YOUNG
from meshes import Mesh


def deck_text(mesh: Mesh, clamped: list[int], modes: int) -> str:
    """The deck; coupled mass, as the solid elements that it is compared with have it."""
    corners = mesh.corners()
    used = set(corners)
    lines = ["SOL 103", "CEND", "METHOD = 1", "SPC = 1", "BEGIN BULK", f"EIGRL,1,,,{modes}", "PARAM,COUPMASS,1"]
    lines.append(f"MAT1,1,{YOUNG:.4E},,{POISSON:g},{DENSITY:.1f}")
    numbers = {group: k + 1 for k, group in enumerate(mesh.groups)}
    lines += [f"PSHELL,{numbers[group]},1,{thickness:g},1,,1" for group, thickness in mesh.groups.items()]
    for n in corners:
        x, y, z = mesh.xyz[n - 1]
        lines += [f"GRID*   {n:<16d}{'':16s}{x:<16.9E}{y:<16.9E}", f"*       {z:<16.9E}"]
    for i, quad in enumerate(mesh.quads):
        lines.append(f"CQUAD4,{i + 1},{numbers[mesh.group_of[i]]}," + ",".join(map(str, quad[:4])))
    lines += [f"SPC1,1,123456,{n}" for n in clamped if n in used]
    return "\n".join([*lines, "ENDDATA", ""])
