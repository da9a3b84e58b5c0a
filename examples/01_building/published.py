"""Numbers of the benchmark building, as published: geometry, masses, measured modes, updated models.

Source: the paper on robust model updating of a large-scale benchmark building structure (two-storey steel frame
with composite floors, University of Basilicata). Tables 1 to 5 and 8; comments say where a printed number was mended.
"""

from __future__ import annotations

# Table 2: nominal parameters, SI units
LENGTH_X, LENGTH_Y, STOREY = 4.0, 3.0, 2.0
YOUNG = 206e9
SLAB_MASS, SLAB_INERTIA = 3539.0, 7702.0
COLUMN_X, COLUMN_Y = 1.509e-5, 0.550e-5
BEAM = 1.317e-5
COLUMN_TORSION, BEAM_TORSION = 2.000e-7, 0.480e-7

# Steel that a floor carries (beams, half of the columns on each side, braces): the paper gives no number. These
# (kg, kg m²) reproduce its nominal and updated frequencies.
STEEL = {1: (530.0, 2740.0), 2: (473.0, 2290.0)}

# Table 1: block, floor, mass (kg), e_x, e_y (m), configurations in which it is there
BLOCKS = (
    ("MA-I", 1, 338.0, -0.95, -1.00, "NC SC"),
    ("MB-I", 1, 340.0, 0.95, -1.00, "NC SC"),
    ("MC-I", 1, 336.0, -0.95, 1.00, "SC"),
    ("MD-I", 1, 336.0, 0.95, 1.00, "SC"),
    ("MA-II", 2, 336.0, -0.95, -1.00, "NC SC"),
    ("MB-II", 2, 340.0, 0.95, -1.00, "NC SC"),
    ("MC-II", 2, 338.0, -0.95, 1.00, "SC"),
    ("MD-II", 2, 330.0, 0.95, 1.00, "SC"),
)

MODES = ("1", "2", "3", "4a", "4b", "5", "6")

# Table 3: frequency (Hz) and shape (x, y, rotation of floor 1, then of floor 2); seven rows a configuration (the
# printed table labels the last row of BC as NC's and the last of NC as SC's)
MEASURED = {
    "BC": (
        (3.37, (-0.009, 0.507, 0.001, -0.005, 0.862, 0.004)),
        (4.23, (0.445, -0.004, -0.002, 0.895, 0.006, 0.000)),
        (5.89, (0.057, 0.053, 0.478, 0.054, -0.011, 0.873)),
        (9.39, (0.026, 0.777, 0.006, -0.038, -0.627, -0.029)),
        (11.3, (-0.031, 0.913, 0.006, -0.020, -0.405, -0.010)),
        (14.6, (0.876, 0.000, 0.004, -0.483, 0.005, -0.005)),
        (18.7, (-0.006, -0.071, 0.828, -0.006, 0.011, -0.555)),
    ),
    "NC": (
        (3.08, (-0.004, 0.510, 0.005, -0.007, 0.860, 0.004)),
        (3.85, (0.448, -0.004, 0.027, 0.892, 0.002, 0.049)),
        (5.51, (-0.120, 0.010, 0.470, -0.276, -0.032, 0.829)),
        (8.90, (0.012, 0.825, 0.000, 0.004, -0.565, -0.017)),
        (10.7, (0.020, 0.927, 0.011, 0.022, -0.372, -0.023)),
        (12.9, (0.868, -0.081, 0.084, -0.475, 0.027, -0.082)),
        (17.6, (-0.247, -0.011, 0.806, 0.196, 0.021, -0.501)),
    ),
    "SC": (
        (2.85, (-0.004, 0.505, -0.001, -0.004, 0.863, 0.005)),
        (3.57, (0.447, -0.002, -0.001, 0.894, 0.007, -0.001)),
        (5.11, (-0.005, 0.012, 0.495, 0.019, -0.015, 0.868)),
        (8.43, (0.003, 0.840, 0.002, -0.004, -0.542, -0.012)),
        (10.5, (-0.001, 0.944, 0.008, -0.001, -0.329, -0.011)),
        (12.4, (0.880, -0.005, 0.002, -0.474, -0.002, -0.004)),
        (16.2, (-0.016, -0.062, 0.851, 0.022, 0.008, -0.520)),
    ),
}

# The twelve potential parameters p1 … p12: name, deck field, bounds of the factor
PARAMETERS = (
    ("Icx1", "PBAR 1 I1", 0.2, 3.0),
    ("Icy1", "PBAR 1 I2", 0.2, 3.0),
    ("Icx2", "PBAR 2 I1", 0.2, 3.0),
    ("Icy2", "PBAR 2 I2", 0.2, 3.0),
    ("Ibx1", "PBAR 11 I1", 0.2, 4.0),
    ("Iby1", "PBAR 12 I1", 0.2, 4.0),
    ("Ibx2", "PBAR 21 I1", 0.2, 4.0),
    ("Iby2", "PBAR 22 I1", 0.2, 4.0),
    ("m1", "CONM2 901 M", 0.4, 1.6),
    ("m2", "CONM2 902 M", 0.4, 1.6),
    ("J1", "CONM2 901 I33", 0.4, 1.6),
    ("J2", "CONM2 902 I33", 0.4, 1.6),
)

# Table 4: which parameter each of the twelve follows ("" is nominal, its own name is free)
_N = ""
MODELS = {
    "M0": (_N,) * 12,
    "M1": ("Icx1", "Icx1", _N, _N, _N, _N, _N, _N, "m1", "m1", "m1", "m1"),
    "M2": ("Icx1", "Icy1", _N, _N, _N, _N, _N, _N, "m1", "m1", "m1", "m1"),
    "M3": ("Icx1", "Icx1", _N, _N, _N, _N, _N, _N, "m1", "m2", "m1", "m2"),
    "M4": ("Icx1", "Icy1", _N, _N, _N, _N, _N, _N, "m1", "m2", "m1", "m2"),
    "M5": ("Icx1", "Icy1", _N, _N, _N, _N, _N, _N, "m1", "m2", "J1", "J2"),
    "M6": ("Icx1", "Icy1", "Icx2", "Icy2", _N, _N, _N, _N, "m1", "m2", "J1", "J2"),
    "M7": ("Icx1", "Icy1", _N, _N, "Ibx1", "Iby1", "Ibx1", "Iby1", "m1", "m2", "J1", "J2"),
    "M8": ("Icx1", "Icy1", "Icx2", "Icy2", "Ibx1", "Iby1", "Ibx1", "Iby1", "m1", "m2", "J1", "J2"),
    "M12": tuple(name for name, *_ in PARAMETERS),
}

# Table 5: p1 … p12 and the objective in % (p3 and p4 of M6 and M8 are printed in exchanged columns; here mended)
UPDATED = {
    "M0": ((1.0,) * 12, 4.26),
    "M1": ((0.751, 0.751, 1, 1, 1, 1, 1, 1, 0.770, 0.770, 0.770, 0.770), 2.48),
    "M2": ((0.623, 0.731, 1, 1, 1, 1, 1, 1, 0.710, 0.710, 0.710, 0.710), 1.90),
    "M3": ((0.830, 0.830, 1, 1, 1, 1, 1, 1, 0.932, 0.742, 0.932, 0.742), 1.08),
    "M4": ((0.755, 0.795, 1, 1, 1, 1, 1, 1, 0.878, 0.716, 0.878, 0.716), 1.01),
    "M5": ((0.756, 0.792, 1, 1, 1, 1, 1, 1, 0.887, 0.716, 0.830, 0.694), 0.856),
    "M6": ((0.782, 0.778, 0.915, 1.07, 1, 1, 1, 1, 0.862, 0.726, 0.834, 0.707), 0.843),
    "M7": ((0.629, 0.755, 1, 1, 1.25, 1.19, 1.25, 1.19, 0.816, 0.777, 0.790, 0.740), 0.780),
    "M8": ((0.620, 0.739, 0.964, 0.956, 1.28, 1.28, 1.28, 1.28, 0.794, 0.783, 0.757, 0.749), 0.775),
}

# Table 6: distance of two models in %, row by row above the diagonal
DISTANCES = (
    (16.7, 21.4, 12.9, 15.6, 16.3, 16.2, 22.3, 24.8),
    (5.10, 7.44, 5.07, 4.80, 5.21, 13.6, 16.7),
    (11.3, 8.04, 7.48, 8.09, 13.7, 16.6),
    (3.42, 4.32, 5.28, 15.4, 18.7),
    (1.54, 3.63, 14.0, 17.4),
    (3.45, 13.9, 17.3),
    (14.3, 17.6),
    (4.18,),
)

# Table 9: ratio of the stiffness of upper to lower beams, and p1 … p8 of models that reproduce M8's matrices
RATIOS = {
    0.01: (0.539, 0.690, 3.44, 3.55, 2.69, 2.51, 0.027, 0.025),
    0.1: (0.549, 0.704, 2.73, 2.30, 2.29, 1.92, 0.229, 0.192),
    0.2: (0.560, 0.715, 2.20, 1.70, 1.99, 1.63, 0.399, 0.327),
    0.5: (0.589, 0.731, 1.41, 1.15, 1.54, 1.37, 0.771, 0.685),
    2.0: (0.646, 0.743, 0.728, 0.862, 1.14, 1.23, 2.28, 2.46),
    5.0: (0.665, 0.746, 0.600, 0.809, 1.06, 1.21, 5.32, 6.03),
    10.0: (0.672, 0.747, 0.562, 0.792, 1.04, 1.20, 10.4, 12.0),
    100.0: (0.679, 0.748, 0.529, 0.776, 1.02, 1.19, 102.0, 119.0),
}

# Section 5.3: uniform thickness and sagging of the slabs of floors 1 and 2 from M7, cm
SAGGING = {1: (6.3, 4.2), 2: (6.8, 3.7)}

# Table 8: frequency error (%) and MAC of modes 1, 2, 3, 5, 6 of the updated ten-parameter model
RESIDUALS_M8 = {
    "BC": ((0.21, 1.000), (0.21, 1.000), (-0.26, 0.991), (-0.74, 1.000), (-0.55, 0.991)),
    "NC": ((-0.03, 1.000), (-0.24, 1.000), (0.24, 0.998), (1.65, 0.991), (-0.27, 0.995)),
    "SC": ((-0.22, 1.000), (-0.01, 1.000), (0.36, 0.999), (-0.90, 1.000), (0.61, 0.995)),
}
