"""The tables of a published update of an experiment rack: an orthogonal array of runs, and runs that check a surrogate.

Source: "High-Accuracy Finite Element Model Updating a Framed Structure Based on Response Surface Method and Partition
Modification", tables 2 to 6, A1(a) and A2(a) of the solid model, A1(b) and A2(b) of the mixed
one. Moduli in GPa, densities in kg/m³, frequencies in
Hz. X1: modulus of the beams outside their connections, X2: of everything but beams, X3: of the connected parts of the
beams, X4: density of the beams, X5: of everything else. Tables A1 and A2 call X3 "E2", X2 "E3" and X5 "D1".
"""

from __future__ import annotations

import numpy as np

NAMES = ("X1", "X2", "X3", "X4", "X5")
ORDERS = tuple(f"f{i}" for i in range(1, 7))
VALUES = np.array(
    [[56.8, 71.0, 85.2], [168.0, 210.0, 252.0], [56.8, 71.0, 85.2], [2216.0, 2770.0, 3324.0], [6280.0, 7850.0, 9420.0]]
)
"""(5, 3) values of the levels 1 to 3."""
_L18 = """11111 12222 13333 21122 22233 23311 31213 32321 33132 11332 12113 13221 21231 22312 23123 31323 32131 33212"""
LEVELS = np.array([[int(digit) - 1 for digit in run] for run in _L18.split()])
"""(18, 5) levels from 0: the first five columns of an L18 of three levels."""
FREQUENCIES = np.array(
    [
        [48.59, 74.18, 108.44, 137.97, 178.98, 204.38],
        [45.56, 70.19, 102.09, 131.06, 169.95, 199.07],
        [43.10, 66.92, 96.89, 125.46, 162.36, 193.54],
        [46.00, 69.55, 102.36, 129.38, 167.72, 185.40],
        [44.18, 67.33, 98.70, 125.67, 163.20, 185.35],
        [56.05, 85.94, 125.66, 161.56, 209.49, 243.31],
        [46.83, 70.48, 105.21, 127.75, 169.34, 175.77],
        [56.64, 85.42, 125.58, 159.93, 208.27, 232.17],
        [48.68, 74.06, 107.86, 142.55, 179.60, 210.00],
        [44.91, 68.57, 99.34, 126.00, 166.29, 189.44],
        [41.78, 64.53, 94.50, 120.19, 154.92, 179.99],
        [50.42, 78.06, 112.23, 148.44, 189.49, 226.97],
        [50.74, 76.38, 111.55, 143.02, 185.28, 209.34],
        [50.44, 76.97, 113.62, 141.73, 186.71, 207.67],
        [44.10, 67.79, 99.01, 128.58, 163.52, 191.62],
        [47.29, 71.04, 105.80, 128.35, 171.34, 178.49],
        [52.18, 78.66, 114.58, 151.38, 190.83, 221.34],
        [52.30, 79.72, 117.56, 149.96, 193.32, 218.22],
    ]
)
"""(18, 6) the first six frequencies of the runs (table 5)."""
RUNS = np.take_along_axis(VALUES, LEVELS.T, axis=1).T
"""(18, 5) values of the parameters in the runs."""
FLAGS = np.array([[1, 1, 1, 1, 1, 1], [0, 0, 0, 1, 0, 1], [1, 1, 1, 0, 1, 1], [0, 0, 0, 0, 0, 0], [1, 1, 1, 1, 1, 1]])
"""(5, 6) effects that the source calls significant (table 6)."""
BEAM_DENSITY = 2770.0
FRESH_RUNS = np.array(
    [
        [77.45, 177.75, 72.71, BEAM_DENSITY, 8271.90],
        [55.17, 193.31, 90.77, BEAM_DENSITY, 7009.00],
        [62.84, 218.67, 56.63, BEAM_DENSITY, 7859.90],
    ]
)
"""(3, 5) runs that were not part of the design (table A2(a)); the density of the beams is the nominal one."""
FRESH_FREQUENCIES = np.array(
    [
        [48.00, 72.48, 107.21, 133.28, 175.23, 189.44],
        [48.39, 74.46, 108.33, 137.56, 180.92, 209.93],
        [45.65, 70.09, 102.06, 132.36, 169.26, 198.57],
    ]
)
SAMPLE_RUNS = np.array(
    [
        [72.15, 204.05, 81.14, BEAM_DENSITY, 7769.58],
        [76.95, 216.93, 66.05, BEAM_DENSITY, 8525.61],
        [56.29, 188.10, 79.29, BEAM_DENSITY, 7369.89],
        [51.30, 169.11, 68.65, BEAM_DENSITY, 7336.70],
    ]
)
"""(4, 5) the four published runs of the 150 of the source's surrogate (table A1(a))."""
SAMPLE_FREQUENCIES = np.array(
    [
        [49.61, 75.46, 110.98, 139.85, 183.30, 204.86],
        [47.44, 72.20, 106.22, 135.20, 174.78, 196.96],
        [46.93, 72.03, 105.04, 133.18, 174.63, 200.84],
        [44.69, 68.63, 99.90, 126.68, 165.80, 190.96],
    ]
)
MEASURED = np.array([42.90, 69.82, 96.42, 119.26, 153.47, 186.89])
"""(6,) measured frequencies (table 2)."""
BOUNDS = np.array([[50.0, 78.0], [168.0, 230.0], [55.0, 95.0], [BEAM_DENSITY, BEAM_DENSITY], [7000.0, 8600.0]])
"""(5, 2) bounds of the search."""
PUBLISHED_OPTIMUM = np.array([55.04, 172.40, 71.55, BEAM_DENSITY, 7822.0])
"""(5,) the values of the source after its update."""
F_VALUES = np.array(
    [
        [476, 369, 361, 362, 255, 25.8],
        [58, 134, 64, 297, 107, 272],
        [158, 183, 144, 78, 145, 36.8],
        [80, 106, 117, 45, 63, 6.1],
        [1218, 1341, 864, 1541, 971, 737],
    ]
)
"""(5, 6) F with 2 and 7 degrees of freedom, recomputed from table 5 with another program."""
MIXED_RUNS = np.array(
    [
        [72.15, 204.05, 81.15, BEAM_DENSITY, 7769.58],
        [76.92, 216.94, 66.06, BEAM_DENSITY, 8525.61],
        [56.30, 188.10, 79.29, BEAM_DENSITY, 7369.89],
        [51.30, 169.12, 68.65, BEAM_DENSITY, 7336.70],
        *FRESH_RUNS,
    ]
)
"""(7, 5) runs of the mixed model: four of table A1(b), three of table A2(b)."""
MIXED_FREQUENCIES = np.array(
    [
        [45.48, 70.46, 102.28, 123.10, 169.50, 192.58],
        [42.51, 67.07, 96.35, 118.67, 160.61, 190.04],
        [42.35, 67.39, 96.34, 120.20, 161.02, 192.95],
        [40.75, 64.55, 92.54, 114.28, 154.21, 183.45],
        [42.13, 65.62, 94.64, 115.09, 157.37, 182.14],
        [47.81, 73.94, 107.47, 128.89, 177.86, 200.79],
        [41.41, 65.81, 94.22, 116.98, 157.17, 187.94],
    ]
)
MIXED_OPTIMUM = np.array([53.18, 169.27, 79.04, BEAM_DENSITY, 8140.0])
"""(5,) the published values of the mixed model after its update."""
MIXED_NAMES = ("A1(b) X1", "A1(b) X2", "A1(b) X149", "A1(b) X150", "A2(b) X1", "A2(b) X2", "A2(b) X3")
