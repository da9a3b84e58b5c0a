"""The aeroplane as a Nastran deck: shells, four stiff links, four masses."""

from __future__ import annotations

from collections.abc import Iterator

from structures.aeroplane_mesh import AeroplaneMesh

ALUMINIUM, STEEL = 1, 2
THICKNESS = {1: 0.050, 2: 0.010, 3: 0.010, 4: 0.010, 5: 0.010, 6: 0.011, 7: 0.010, 8: 0.016}
LINK_STIFFNESS, LINK_TURN = 1e12, 1e8
"""N/m and Nm/rad."""
MASS = 0.5
"""kg at each node of group 10."""
CLAMPED_NODE = 58


def deck_text(mesh: AeroplaneMesh, clamped: bool = False) -> str:
    """The deck, free or clamped at one node; units m, kg, s."""
    return "\n".join([*_case(clamped), *_bulk(mesh), "ENDDATA", ""])


def _case(clamped: bool) -> Iterator[str]:
    yield "SOL 103"
    yield "CEND"
    yield "TITLE = GARTEUR SM-AG19 aeroplane"
    yield "METHOD = 1"
    if clamped:
        yield "SPC = 1"
    yield "BEGIN BULK"
    yield "PARAM,POST,-1"
    yield "EIGRL,1,,,20"
    if clamped:
        yield f"SPC1,1,123456,{CLAMPED_NODE}"


def _bulk(mesh: AeroplaneMesh) -> Iterator[str]:
    yield f"MAT1,{ALUMINIUM},72.+9,,.34,2700."
    yield f"MAT1,{STEEL},210.+9,,.29,7800."
    for group, thickness in THICKNESS.items():
        material = STEEL if group == 8 else ALUMINIUM
        yield f"$ shells of group {group}"
        yield f"PSHELL,{group},{material},{thickness:g},{material},,{material}"
    stiff, turn = (f"{k:.1E}".replace("E+", "+") for k in (LINK_STIFFNESS, LINK_TURN))
    yield "$ links of group 9"
    yield f"PBUSH,9,K,{stiff},{stiff},{stiff},{turn},{turn},{turn}"
    for node, xyz in sorted(mesh.nodes.items()):
        # the coordinates went through single precision on their way into the mesh
        x, y, z = (f"{round(c, 6):g}" if round(c, 6) else "0." for c in xyz)
        yield f"GRID,{node},,{_real(x)},{_real(y)},{_real(z)}"
    for shell, corners in sorted(mesh.shells.items()):
        yield f"CQUAD4,{shell},{mesh.thickness_group(shell)}," + ",".join(map(str, corners))
    for link, (a, b) in sorted(mesh.links.items()):
        yield f"CBUSH,{link},9,{a},{b},,,,0"
    for k, node in enumerate(mesh.groups[10]):
        yield f"CONM2,{1001 + k},{node},,{MASS:g}"


def _real(text: str) -> str:
    return text if "." in text or "e" in text else text + "."
