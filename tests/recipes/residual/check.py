"""A study compares logarithms of frequencies, and finds the truth with them."""

import sys
from pathlib import Path

import numpy as np

import femtune as ft
from femtune.study.study import load_study
from femtune.testing import check_residual, example_deck, example_test
from femtune.testing.examples import TRUTH

assert Path(ft.__file__).parent == Path(sys.argv[1])
example_deck()
example_test()
Path("study.toml").write_text("""
[study]
title = "logarithms"
deck = "cantilever.bdf"
units = "m-kg-s"

[test]
file = "cantilever.uff"

[[parameter]]
name = "root"
fields = ["PBAR 1 I1"]
lower = 0.5
upper = 2.0

[[parameter]]
name = "tip"
fields = ["PBAR 2 I1"]
lower = 0.5
upper = 2.0

[[residual]]
kind = "log-frequency"
sd = 0.002
""")
result = ft.update("study.toml")
values = {name: value * 2e-7 for name, value in result.values.items()}
for name, true in zip(("root", "tip"), TRUTH.values(), strict=True):
    # the Universal File has five digits of the frequencies
    assert abs(values[name] / true - 1.0) < 1e-4, values
assert [count.count for count in result.results.update.residual_counts] == [4]
assert result.status == "CONVERGED"
check_residual(load_study("study.toml").problem(), np.zeros(2))
