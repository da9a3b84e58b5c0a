# GNU make and a Python of 3.11 or newer are all that a fresh machine needs.
# Every target makes the environment .venv that it wants; stamp files follow pyproject.toml.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
SHELL := /bin/bash
VENV := .venv
BIN := $(VENV)/bin
# Modules are compiled once, also where the environment forbids it: Python is started many times.
export PYTHONDONTWRITEBYTECODE :=
# Modules are compiled when they are first imported: compiling all at once would take as long as a third of the installation.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
CANDIDATES := python3.13 python3.12 python3.11 python3 python
# Neighbours in a file stay with one process where they can, and share what their fixtures have made.
PYTEST_ARGS ?= -n auto --dist worksteal
# One thread a process: tests share the cores among themselves, and small matrices gain nothing from more.
ONE_THREAD := OMP_NUM_THREADS=$${OMP_NUM_THREADS:-1} OPENBLAS_NUM_THREADS=$${OPENBLAS_NUM_THREADS:-1} \
	MKL_NUM_THREADS=$${MKL_NUM_THREADS:-1}
PYTEST := $(ONE_THREAD) $(BIN)/python -m pytest
# RUN_TESTS marks, options: in a new checkout pytest would take a quarter of a minute to prepare the assertions, so that
# they show their values. Only tests that failed are run with such assertions, once more.
RUN_TESTS = $(PYTEST) -m "$(1)" --assert=plain $(2) $(PYTEST_ARGS) || { code=$$?; \
	[ $$code -ne 1 ] || $(PYTEST) -m "$(1)" --last-failed --last-failed-no-failures none --maxfail 20; exit $$code; }
SPHINX := $(BIN)/python -m sphinx -q -W --keep-going -j auto -b html
EXAMPLES := $(sort $(wildcard examples/*/run.py) $(wildcard examples/cases/*/run.py))
# Rates over many simulated tests, of which the few tests of a quick form would show little, and a second study of the subframe.
NOT_QUICK := $(addprefix examples/cases/,$(addsuffix /run.py,bootstrap_identified chi_square coverage coverage_bounds \
	coverage_of_runs near_band_modes subframe_bushings))

# The first candidate that starts and is new enough. A name on the path may be a launcher without a Python
# behind it, so each is tried.
FIND_PYTHON = for p in $(PYTHON) $(CANDIDATES); do \
	  "$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { echo "$$p"; exit; }; done

.PHONY: help demo test test-slow test-long check-all lint format types contract docs internals pictures evidence notebooks examples-quick web web-check browser firefox bench bench-small bench-identification bench-laboratory bench-surrogates bench-search bench-optimise bench-chain bench-posterior bench-building bench-calibration bench-judge bench-health bench-sensors bench-page bench-live bench-newcomer bench-fuzz fuzz-records bench-solver-files bench-stories mutants readers release-check cluster-check container-check clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1 \t/' | expand -t 24

demo: $(VENV)/.stamp-test  ## update the model of the benchmark building; prints the path of the report
	@$(BIN)/python examples/01_building/make_inputs.py
	@$(BIN)/femtune run examples/01_building/study.toml

# More than four processes would spend more time on the import of the tests than they save.
test: $(VENV)/.stamp-test  ## the quick tests: a selection of the cases of each family; requires only Python and make
	@export HYPOTHESIS_PROFILE=$${HYPOTHESIS_PROFILE:-quick}; $(call RUN_TESTS,not slow,--maxprocesses 4)

test-slow: $(VENV)/.stamp-test  ## the tests that make test omits, except those that take minutes; more random examples
	@export HYPOTHESIS_PROFILE=$${HYPOTHESIS_PROFILE:-gate}; $(call RUN_TESTS,(slow or hypothesis) and not long)

test-long: $(VENV)/.stamp-test  ## the tests that take minutes each: coverage of intervals, levels of tests, thousands of mutants
	@$(PYTEST) -m "long or hypothesis" $(PYTEST_ARGS)

check-all: $(VENV)/.stamp-test  ## all tests with all cases
	@$(PYTEST) $(PYTEST_ARGS)

lint: $(VENV)/.stamp-lint  ## ruff: rules and format
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

format: $(VENV)/.stamp-lint  ## format the code
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

types: $(VENV)/.stamp-lint  ## mypy
	@$(BIN)/mypy -p femtune

contract: $(VENV)/.stamp-lint  ## check that packages import only from the layers below
	@$(BIN)/lint-imports

docs: $(VENV)/.stamp-docs  ## build the documentation and check its links; warnings are errors
	@$(SPHINX) -d docs/_build/doctrees docs docs/_build/html
	@$(BIN)/python .ci/check_links.py docs/_build/html *.md examples/README.md
	@echo "docs/_build/html/index.html"

internals: $(VENV)/.stamp-docs  ## build the documentation with the reference of all modules
	@$(SPHINX) -t internals -d docs/_build/internals-doctrees docs docs/_build/internals
	@$(BIN)/python .ci/check_links.py docs/_build/internals
	@echo "docs/_build/internals/index.html"

pictures: $(VENV)/.stamp-test  ## draw the pictures of the landing page and the tutorial again
	@$(ONE_THREAD) $(BIN)/python docs/_ext/pictures.py
	@$(ONE_THREAD) $(BIN)/python docs/_ext/page_pictures.py
	@$(ONE_THREAD) $(BIN)/python docs/_ext/guide_pictures.py

evidence: $(VENV)/.stamp-test  ## run the full examples, which write the tables of the documentation
	@set -e; for example in $(EXAMPLES); do echo "== $$example"; $(ONE_THREAD) $(BIN)/python $$example --evidence docs/evidence; done

notebooks: $(VENV)/.stamp-notebooks  ## execute the notebooks as Jupyter does
	@$(ONE_THREAD) $(BIN)/python examples/notebooks/execute.py

# Two at a time: an example has one thread. What it prints stays together. The longest (subframe, rack) are late in the
# alphabet, and begin first.
examples-quick: $(VENV)/.stamp-test  ## run the quick form of the examples, except those that measure rates
	@printf '%s\n' $(filter-out $(NOT_QUICK),$(EXAMPLES)) | sort -r | $(ONE_THREAD) xargs -P 2 -I '{}' bash -c \
	  'printed="$$($(BIN)/python "$$1" --quick 2>&1)"; code=$$?; printf "== %s, %d s\n%s\n" "$$1" $$SECONDS "$$printed"; exit $$code' run '{}'

web/node_modules/.stamp: web/package-lock.json web/package.json
	@cd web && npm ci --silent --no-audit --no-fund
	@touch $@

web: web/node_modules/.stamp  ## build the scripts of the report from web/; requires Node and npm
	@cd web && npm run --silent types && npm run --silent build

web-check: web/node_modules/.stamp  ## types and tests of the scripts, and whether the committed bundle is that of its source
	@cd web && npm run --silent types && npm run --silent test
	@built="$$(mktemp -d)"; trap 'rm -rf "$$built"' EXIT; (cd web && node build.mjs "$$built") && \
	  diff -rq "$$built" src/femtune/reporting/bundle || { echo "the bundle is not that of its source: run 'make web'" >&2; exit 1; }

# Beside the report of the building: responses with real and with complex modes, modes identified from the latter, and
# what the examples have left.
PAGES := ../examples/01_building/run/report.html:../build/responses.html:../build/damped.html:../build/identified/report.html:../build/live/report.html
LEFT_PAGES = $(shell for page in examples/cases/subframe/run/family_5000/run/report.html \
	examples/cases/aeroplane_frfs/run/run/report.html; do [ -f "$$page" ] && printf ':../%s' "$$page"; done)
# a study of measured FRFs, which its live model follows
LIVE_STUDY := '[study]' 'title = "FRFs"' 'deck = "building.bdf"' 'units = "m-kg-s"' '[test]' 'file = "functions.uff"' \
	'[[parameter]]' 'name = "Icx1"' 'fields = ["PBAR 1 I1"]' 'lower = 0.5' 'upper = 2.0' \
	'[[residual]]' 'kind = "frf"' 'ratio = 0.01' '[write]' 'deck = false'
RESPOND := $(BIN)/femtune respond --quiet --input 301X+ --from 1 --to 20 --step 0.05

browser: $(VENV)/.stamp-test  ## check the newest report (or REPORT=path) in headless Chromium
	@$(BIN)/python .ci/check_page.py $(REPORT)
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory web/node_modules/.stamp && mkdir -p build && \
	  $(RESPOND) examples/01_building/building.bdf --output 301X+ --output 202Y+ --ratio 0.01 --report build/responses.html && \
	  sed 's/^ENDDATA/CDAMP2,9001,4000.,301,1\nCDAMP2,9002,6000.,303,2\nENDDATA/' examples/01_building/building.bdf > build/damped.bdf && \
	  $(RESPOND) build/damped.bdf $(addprefix --output ,201X+ 201Y+ 203X+ 203Y+ 301X+ 301Y+ 303X+ 303Y+) --units m-kg-s \
	    --uff build/damped.uff --report build/damped.html && \
	  $(BIN)/femtune identify build/damped.uff --order 20 --output build/identified --quiet && \
	  $(RESPOND) examples/01_building/building.bdf --output 301X+ --output 202Y+ --output 203X+ --ratio 0.01 --units m-kg-s \
	    --uff build/functions.uff && cp examples/01_building/building.bdf build/ && printf '%s\n' $(LIVE_STUDY) > build/live.toml && \
	  $(BIN)/femtune run build/live.toml --output build/live --quiet && cd web && \
	  FEMTUNE_PAGES="$(or $(REPORT),$(PAGES)$(LEFT_PAGES))" npm run --silent browser; \
	else echo "SKIPPED: no npm on this machine, the page was not used in a browser"; fi

firefox: web/node_modules/.stamp  ## the tests of both browsers in headless Firefox (firefox-esr), on the pages that `make browser` has left
	@cd web && FEMTUNE_FIREFOX="$${FEMTUNE_FIREFOX:-$$(command -v firefox-esr)}" FEMTUNE_PAGES="$(or $(REPORT),$(PAGES))" npm run --silent browser

bench: $(VENV)/.stamp-test  ## time and memory against model size; takes hours and can be interrupted (BENCH_ARGS=--quick: a minute)
	@$(BIN)/python benchmarks/size/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-small: $(VENV)/.stamp-test  ## one evaluation of small models beside dense NumPy; takes a minute
	@$(ONE_THREAD) $(BIN)/python benchmarks/small/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

# Peers that are compared live in a folder of their own: what they depend on must not reach the environment of femtune.
PEERS := pyOMA-2 koma-python sdypy-EMA pandas openpyxl et_xmlfile scikit-learn joblib threadpoolctl requests tqdm plotly \
	narwhals python-dateutil pytz tzdata six urllib3 idna certifi charset_normalizer

bench-identification: $(VENV)/.stamp-test  ## identification compared with three libraries; takes minutes (BENCH_ARGS=--quick: two)
	@test -d $(VENV)/peers/pyoma2 || $(PIP) --target $(VENV)/peers --no-deps $(PEERS)
	@$(ONE_THREAD) PYTHONPATH=$(VENV)/peers \
	  $(BIN)/python benchmarks/identification/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-laboratory: $(VENV)/.stamp-test  ## identification of hits, bursts, sweeps and ambient records; an hour, can be interrupted (BENCH_ARGS="--minutes 10")
	@test -d $(VENV)/peers/pyoma2 || $(PIP) --target $(VENV)/peers --no-deps $(PEERS)
	@$(ONE_THREAD) PYTHONPATH=$(VENV)/peers \
	  $(BIN)/python benchmarks/identification/laboratory/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

SURROGATE_PEERS := smt scikit-learn openturns joblib threadpoolctl narwhals cloudpickle jenn jsonpointer orjson pydoe \
	SALib multiprocess dill pandas python-dateutil six

bench-surrogates: $(VENV)/.stamp-test  ## surrogates compared with four libraries; takes minutes
	@test -d $(VENV)/peers/smt || $(PIP) --target $(VENV)/peers --no-deps $(SURROGATE_PEERS)
	@$(ONE_THREAD) PYTHONPATH=$(VENV)/peers \
	  $(BIN)/python benchmarks/surrogates/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)
	@$(ONE_THREAD) PYTHONPATH=$(VENV)/peers \
	  $(BIN)/python benchmarks/surrogates/coverage.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-search: $(VENV)/.stamp-test  ## runs of the model that a search needs with derivatives, a surrogate, or without both; takes minutes
	@$(ONE_THREAD) $(BIN)/python benchmarks/search/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-optimise: $(VENV)/.stamp-test  ## the search compared with general solvers; takes an hour and can be interrupted (BENCH_ARGS=--quick: minutes)
	@$(ONE_THREAD) $(BIN)/python benchmarks/optimise/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-newcomer: $(VENV)/.stamp-test  ## commands and seconds of a first user, from the README to a report; takes a minute
	@$(ONE_THREAD) $(BIN)/python benchmarks/newcomer/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-chain: $(VENV)/.stamp-test  ## from measured FRFs to parameters, on simulated tests; takes an hour and can be interrupted (BENCH_ARGS="--each 2": minutes)
	@$(ONE_THREAD) $(BIN)/python benchmarks/chain/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-posterior: $(VENV)/.stamp-test  ## how often intervals of the posterior hold beside wrong models; takes many hours and can be interrupted (BENCH_ARGS="--each 4": an hour)
	@$(ONE_THREAD) $(BIN)/python benchmarks/posterior/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-building: $(VENV)/.stamp-test  ## the posterior of the benchmark building beside a sequential Monte Carlo method; takes a quarter of an hour
	@$(ONE_THREAD) $(BIN)/python benchmarks/posterior/building.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-calibration: $(VENV)/.stamp-test  ## simulation-based calibration of the posterior; takes hours and can be interrupted (BENCH_ARGS="--each 10": minutes)
	@$(ONE_THREAD) $(BIN)/python benchmarks/posterior/calibration.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-judge: $(VENV)/.stamp-test  ## how often the judge of a fit is right, on 1000 models; takes hours and can be interrupted (BENCH_ARGS="--each 12": minutes)
	@$(ONE_THREAD) $(BIN)/python benchmarks/judge/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-health: $(VENV)/.stamp-test  ## how often faults of decks, studies and tests are told; takes two minutes (BENCH_ARGS="--decks DIR": with sound decks of a folder)
	@$(ONE_THREAD) $(BIN)/python benchmarks/health/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-sensors: $(VENV)/.stamp-test  ## how often the places of test points are found, on 200 random layouts; takes minutes
	@$(ONE_THREAD) $(BIN)/python benchmarks/sensors/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)
	@$(ONE_THREAD) $(BIN)/python benchmarks/sensors/exchanged.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-page: $(VENV)/.stamp-test web/node_modules/.stamp  ## size, load time and frames a second of the page against model size; takes minutes
	@$(ONE_THREAD) $(BIN)/python benchmarks/page/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-live: $(VENV)/.stamp-test web/node_modules/.stamp  ## errors and times of the live model of the report; takes many minutes (BENCH_ARGS=--quick: without the frame)
	@$(ONE_THREAD) $(BIN)/python benchmarks/page/live.py $(or $(BENCH_ARGS),--evidence docs/evidence)

FUZZ_PEERS := pyNastran cpylog docopt-ng

bench-fuzz: $(VENV)/.stamp-test $(VENV)/.stamp-readers  ## twenty thousand damaged files of all kinds, judged by other parsers; takes half an hour and can be interrupted
	@test -d $(VENV)/fuzz/pyNastran || $(PIP) --target $(VENV)/fuzz --no-deps $(FUZZ_PEERS)
	@$(ONE_THREAD) PYTHONPATH=$(VENV)/fuzz $(BIN)/python benchmarks/fuzz/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

fuzz-records: $(VENV)/.stamp-test $(VENV)/.stamp-readers  ## two thousand damaged records: text, .lvm, .tdms, .mf4, .wav, .mat and arrays; takes minutes and can be interrupted
	@$(ONE_THREAD) $(BIN)/python benchmarks/fuzz/run.py --group records --count 2000 $(BENCH_ARGS)

bench-solver-files: $(VENV)/.stamp-test $(VENV)/.stamp-readers  ## five thousand damaged files of other programs, with their system calls recorded; takes minutes and can be interrupted
	@$(ONE_THREAD) $(BIN)/python benchmarks/fuzz/solver_files_run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

bench-stories: $(VENV)/.stamp-test  ## 500 stories of runs that are killed, starved, locked and edited: the numbers of a quiet run; takes hours and can be interrupted
	@$(ONE_THREAD) $(BIN)/python benchmarks/stories/run.py $(or $(BENCH_ARGS),--evidence docs/evidence)

mutants: $(VENV)/.stamp-test  ## mutation test of the numerical code; takes half an hour and can be interrupted
	@$(PIP) coverage
	@HYPOTHESIS_PROFILE=quick $(ONE_THREAD) $(BIN)/python benchmarks/mutation/run.py --marked "not slow" $(or $(BENCH_ARGS),--evidence docs/evidence)

readers: $(VENV)/.stamp-readers  ## install the libraries for OP2, Ansys, HDF5, Parquet and VTU files, CMA-ES, and the light factorisation

release-check:  ## the check-list of a release: build, metadata, empty environments of every Python, tutorial, licences
	@python="$$($(FIND_PYTHON))"; "$$python" .ci/release.py

cluster-check: $(VENV)/.stamp-test  ## the commands of the documentation for Slurm and dask-jobqueue; takes minutes
	@$(PIP) -e ".[cluster]" dask-jobqueue
	@$(ONE_THREAD) $(BIN)/python .ci/cluster_commands.py $(or $(CHECK_ARGS),--evidence docs/evidence)

container-check: $(VENV)/.stamp-test  ## the commands of the documentation for podman, Docker and Apptainer; takes minutes, needs root or podman for this user
	@$(ONE_THREAD) $(BIN)/python .ci/container_commands.py $(or $(CHECK_ARGS),--evidence docs/evidence)

clean:  ## remove all generated files and the environment
	rm -rf $(VENV) build dist src/*.egg-info docs/_build web/node_modules .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/bin/python:
	@python="$$($(FIND_PYTHON))"; \
	if [ -z "$$python" ]; then \
	  echo "femtune needs Python 3.11 or newer; none of these is: $(PYTHON) $(CANDIDATES)." >&2; \
	  echo "hint: install one, or name it: make PYTHON=/path/to/python3.12 <target>" >&2; exit 1; fi; \
	echo "making $(VENV) with $$("$$python" --version)"; \
	"$$python" -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "hint: this Python cannot make environments; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }

$(VENV)/.stamp-test: pyproject.toml | $(VENV)/bin/python
	@echo "installing femtune and its test tools into $(VENV)"
	@$(PIP) -e '.[fast,test]'
	@touch $@

$(VENV)/.stamp-lint: pyproject.toml $(VENV)/.stamp-test
	@echo "installing ruff, mypy and import-linter into $(VENV)"
	@$(PIP) -e '.[lint]'
	@touch $@

# the library that MDF files of the tests are written with
READER_PEERS := asammdf

$(VENV)/.stamp-readers: pyproject.toml $(VENV)/.stamp-test
	@echo "installing the libraries for OP2, Ansys, HDF5, TDMS, Parquet and VTU files, CMA-ES, ArviZ and the light factorisation into $(VENV)"
	@$(PIP) -e '.[light,op2,ansys,hdf5,tdms,parquet,vtu,search,arviz]' $(READER_PEERS)
	@touch $@

$(VENV)/.stamp-notebooks: pyproject.toml $(VENV)/.stamp-test
	@echo "installing what executes notebooks, pandas and xarray into $(VENV)"
	@$(PIP) -e '.[notebooks,xarray]'
	@touch $@

$(VENV)/.stamp-docs: pyproject.toml $(VENV)/.stamp-test
	@echo "installing the documentation tools into $(VENV)"
	@$(PIP) -e '.[docs]'
	@touch $@
