"""Constant membrane strain, curvature and transverse shear of a rectangle 3 by 2, and their energies per unit area.

E is 200, ν is 0.3, the thickness 0.2.
"""

from __future__ import annotations

import numpy as np

G = 200.0 / 2.6
D = 200.0 / 0.91
AREA = 3.0 * 2.0 * np.cos(0.3)
PATCHES = {
    "membrane": (
        lambda x, y: (0.3 * x + 0.1 * y, 0.5 * x - 0.2 * y, 0, 0, 0, 0.2),
        0.2 * (D * (0.3**2 + 0.2**2 - 2 * 0.3 * 0.3 * 0.2) + G * 0.6**2),
    ),
    "bending": (
        lambda x, y: (0, 0, 0.2 * x**2 - 0.1 * y**2 + 0.15 * x * y, -0.2 * y + 0.15 * x, -0.4 * x - 0.15 * y, 0),
        0.2**3 / 12 * (D * (0.4**2 + 0.2**2 - 2 * 0.3 * 0.4 * 0.2) + G * 0.3**2),
    ),
    "shear": (lambda x, y: (0, 0, 0.3 * x - 0.2 * y, 0, 0, 0), 5.0 / 6.0 * G * 0.2 * (0.3**2 + 0.2**2)),
}
