"""A study file in which every table stands."""

from __future__ import annotations

STUDY = """\
[study]
title = "Two-storey steel building"
deck = "building.bdf"
units = "m-kg-s"
allow_ignored = ["CQUADR"]

[modes]
count = 8

[[configuration]]
name = "BC"
test = "building.uff"
records = "BC"
test_units = "mm-kg-s"
mode_labels = ["1", "2", "3", "4a", "4b", "5", "6"]
rotation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
origin = [0.0, 0.0, 0.5]
elements_off = "201 THRU 208 EXCEPT 203, 301"
spc = 1
mpc = 2
supports_added = ["12:123", "13 THRU 15:3"]
supports_removed = ["9:0"]
masses = [{ node = 11, mass = 0.35, offset = [0, 0, 0.1], inertia = [1, 2, 3.5], label = "sensor" },
          { node = 12, mass = 1, inertia = [[2, 0.5, 0], [0.5, 2, 0], [0, 0, 3]] }]
weighed_mass = 7500.0
weighed_centre = [0.25, 0.4, 0.0]
weighed_inertia = [1.2, 3.4, 4.5]
leave_out = [{ mode = "4a", reason = "braces" }, { hz = 9.39, reason = "noise" }]
pairs = [{ test = "1", model = 1 }]
use = "update"

[[configuration]]
name = "NC"
elements_off = [7, 8]
use = "validation"

[sensors]
tolerance = 0.05
by_id = false
nodes = { "101" = 12 }

[[sensor]]
name = "11X+"
terms = [{ node = 3, component = "X", factor = 0.5 }, { node = 4, component = "S" }]

[[rigid_floor]]
test_node = 1
nodes = [11, 12, 13, 14]
origin = [0, 0, 2]
components = ["X", "Y", "RZ"]

[correlate]
frequency_gate = 0.30
mac_gate = 0.50
cluster_gap = 0.01

[[parameter]]
name = "Icx1"
fields = ["PBAR 1 I1", "MAT1 2 E"]
elements = "1 THRU 4"
lower = 0.3
upper = 3
nominal = 1.0
absolute = false
sd = 0.2
mean = 1.0
unit = ""

[[parameter]]
name = "Icx2"
elements = [5, 6]
tie = "2*Icx1"

[residuals]
frequency_sd = "test"
shape_sd = 0.1
shape_form = "mac"
frequency_form = "eigenvalue"
shape_scaling = "largest-entry"

[update]
max_iterations = 20
regularisation = "minimum-change"
weight = 0.1
tolerance = 1e-6

[write]
wide = true
split = true

[output]
folder = "out/run"
"""
