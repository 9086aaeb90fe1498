# make setup   everything in .venv: the cardbox command, the nodes, the tools of the tests
# make demo    a film of a real person, then the live chain, nodes on a synthetic recording; results in demo_output/
# make dist    wheel and sdist in dist/
# make example   a small recording, its measured person and their posture, in example/
# make test    set-up, lint, types, all tests
# make benchmark   measure the speed on this machine; writes docs/benchmarks.md
# make experiments   repeat the paper's experiments (hours); writes docs/evaluation/report.md
# make sessions    track the recorded sessions in ../shared/data; writes docs/evaluation/sessions.md
# make people      track the films of real people in ../shared/data; writes docs/evaluation/real-people.md
# make wrong-inputs   shape and place where a given number is wrong; writes docs/evaluation/wrong-inputs.md
# make reliability   hours of faults and hostile input; writes docs/reliability.md
# make reliability-quick   the same in ten minutes, without running nodes; writes nothing
# make bounds  tests of compiled code with bounds checks; the first run compiles for minutes
# make bounds-long   110,400 calls of compiled code with bounds checks, a quarter of an hour
# make docs    the documents as a site, with their links checked; in build/docs
# make links   check the addresses of other sites in the documents
# make lint    ruff and mypy alone
# make colcon  proof that colcon builds and tests the package as a ROS workspace would
# make clean   remove the results of the targets above
#
# PYTHON=python3.12 chooses the interpreter of a new .venv (3.11 or later). No venv has to be active.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

# Another venv or a sourced ROS installation would add its libraries, its packages, or a DDS
# implementation that the wheels lack.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH PYTHONHOME VIRTUAL_ENV
unexport AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH RMW_IMPLEMENTATION

PYTHON ?= python3
VENV := .venv
BIN := $(CURDIR)/$(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

# Spaces in a path would break the rules of make; no file here has any.
SOURCES := $(shell find cardbox_tracker config launch resource -type f \
	-not -path '*/__pycache__/*' -not -path '*/.*')
# A deleted or renamed file is no newer than the stamp, so the name of the stamp has a checksum.
NAMES := $(VENV)/sources-$(firstword $(shell printf '%s\n' $(sort $(SOURCES)) | cksum))

.PHONY: help
help:
	@sed -n 's/^# \(make .*\)/\1/p' Makefile

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "$(PYTHON) is $$($(PYTHON) --version 2>&1); expected Python 3.11 or later:" \
			"make setup PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)

# Dependencies change seldom and take long; the package itself changes often and takes seconds.
$(VENV)/dependencies: setup.py | $(VENV)/bin/python
	$(PIP) install --quiet 'setuptools>=70.1,<80' .[ros,test]
	@touch $@

$(NAMES): | $(VENV)/bin/python
	@rm -f $(VENV)/sources-*
	@touch $@

# Setuptools builds in the tree and would pick up the files of an earlier build.
$(VENV)/package: $(VENV)/dependencies $(NAMES) $(SOURCES) setup.py setup.cfg pyproject.toml package.xml
	@rm -rf build/lib build/bdist.* *.egg-info
	$(PIP) install --quiet --no-deps --no-build-isolation --force-reinstall .
	@rm -rf build/lib build/bdist.* *.egg-info
	@touch $@

$(VENV)/compiled: $(VENV)/package
	@echo "compiling the tracker's inner loop, once, for one to two minutes"
	cd $(VENV) && $(BIN)/python -m cardbox_tracker.tracking.precompile
	@touch $@

.PHONY: setup
setup: $(VENV)/compiled

# The tests compile the tree, so the installed copy need not be.
.PHONY: lint
lint: $(VENV)/package
	$(BIN)/ruff check .
	$(BIN)/mypy

# Their tests would be skipped without these optional libraries, 170 MB for 'view'
# and 60 for 'detector', whose network files may be missing. They are installed by name, because '.[view]' would install the package once more.
NEEDED = import importlib.metadata, re; print(*(line.split(";")[0] for line in \
	importlib.metadata.requires("cardbox_tracker") \
	if re.search("extra == .(view|detector|parquet|export|docs)", line)), sep="\n")
$(VENV)/extras: setup.py | $(VENV)/package
	$(BIN)/python -I -c '$(NEEDED)' > $@.txt
	$(PIP) install --quiet --requirement $@.txt
	-XDG_DATA_HOME=$(CURDIR)/$(VENV)/data $(BIN)/cardbox detector --install
	@touch $@

# The tests run the tree, whose kernels compile while the types are checked.
.PHONY: kernels
kernels: $(VENV)/package
	$(BIN)/python -m cardbox_tracker.tracking.precompile

.PHONY: test
test:
	@$(MAKE) --no-print-directory --jobs=3 lint kernels $(VENV)/extras
	XDG_DATA_HOME=$(CURDIR)/$(VENV)/data $(BIN)/python -m pytest

# A warning is an error, so every link inside the documents leads somewhere.
SPHINX := $(BIN)/python -m sphinx --fail-on-warning --nitpicky --keep-going --quiet docs
.PHONY: docs
docs: $(VENV)/extras
	$(SPHINX) build/docs
	@echo "wrote build/docs/README.html"

.PHONY: links
links: $(VENV)/extras
	$(SPHINX) -b linkcheck build/links

.PHONY: demo
demo: setup
	$(BIN)/cardbox demo --output demo_output/film
	$(BIN)/cardbox demo --live --output demo_output/live
	@echo "look at demo_output/film/overlay.mp4, space.png and error.png: a woman in a film"
	@echo "look at demo_output/live/overlay.mp4 and angles.png: the nodes, live"

# This needs nothing of what the package needs: no ROS, no tools of the tests.
.PHONY: dist
dist: | $(VENV)/bin/python
	$(PIP) install --quiet 'setuptools>=70.1,<80'
	rm -rf build/lib build/bdist.* *.egg-info
	$(BIN)/python setup.py --quiet sdist bdist_wheel
	rm -rf build/lib build/bdist.* *.egg-info

# These are the commands of the tutorial, with the times of the synthetic session.
.PHONY: example
example: setup
	@mkdir -p example
	$(BIN)/cardbox synthesize --motion wave --compressed --force --output example/session
	$(BIN)/cardbox initialize example/session --background 0:3.9 --front 6.8:8.2 --side 9.8:11.2 \
		--arms 12.8:14.2 --distance 2.0 --force --output example/person.yaml
	$(BIN)/cardbox track example/session --model example/person.yaml --background 0:3.9 \
		--start 15.6 --force --csv example/person.csv --video example/person.mp4 --bag example/results

.PHONY: benchmark
benchmark: setup
	$(BIN)/cardbox benchmark --json docs/benchmarks.json --report docs/benchmarks.md \
		$(patsubst %/ground_truth.json,--session %,$(wildcard $(DATA)/person_a/ground_truth.json))

# Fewer runs: make experiments RUNS=2
RUNS ?= 100
.PHONY: experiments
experiments: setup
	@for name in person_a person_b; do if [ -d $(DATA)/$$name ]; then \
		$(BIN)/cardbox evaluate --runs $$(($(RUNS) < 20 ? $(RUNS) : 20)) --session $(DATA)/$$name \
			--output docs/evaluation/$$name --force; \
		else echo "skipped: no $(DATA)/$$name"; fi; done
	$(BIN)/cardbox evaluate --runs $(RUNS) --output docs/evaluation --force
	$(BIN)/python -m lab.tools.readme_figures

# This compares the recorded sessions of one camera beside the checkout with their ground truth.
DATA ?= ../shared/data
FIGURES = $(BIN)/python -m lab.tools.keypoint_states && $(BIN)/python -m lab.tools.readme_figures
SESSIONS = $(filter-out $(DATA)/real_% $(DATA)/stereo_% $(DATA)/two_%,\
	$(patsubst %/ground_truth.json,%,$(wildcard $(DATA)/*/ground_truth.json)))
.PHONY: sessions
sessions: setup
	@if [ -z "$(SESSIONS)" ]; then echo "skipped: no recorded sessions in $(DATA)"; else \
		$(BIN)/cardbox evaluate --sessions $(SESSIONS) --recovery --output docs/evaluation --force; \
		$(FIGURES); fi

# The pictures come first, because the document shows them.
# The evaluation reads one person.
PEOPLE = $(filter-out $(DATA)/real_two_people,$(patsubst %/ground_truth.json,%,\
	$(wildcard $(DATA)/real_gestures/*/ground_truth.json $(DATA)/real_*/ground_truth.json)))
.PHONY: people
people: export XDG_DATA_HOME := $(CURDIR)/$(VENV)/data
people: setup $(VENV)/extras
	@if [ -z "$(PEOPLE)" ]; then echo "skipped: no films of people in $(DATA)"; else \
		$(BIN)/python -m lab.tools.people_sheet $(PEOPLE) --output docs/images/real-people.jpg; \
		$(BIN)/cardbox evaluate --sessions $(PEOPLE) --detector none mediapipe --output docs/evaluation --force; \
		$(FIGURES); fi

# This compares shape and place with the truth where stature, distance or pitch is wrong.
.PHONY: wrong-inputs
wrong-inputs: export XDG_DATA_HOME := $(CURDIR)/$(VENV)/data
wrong-inputs: setup $(VENV)/extras
	$(BIN)/python -m lab.tools.wrong_inputs $(DATA)/person_a $(DATA)/cmu_gestures $(PEOPLE) --output docs/evaluation/wrong-inputs.md

# Fewer examples: make reliability EXAMPLES=1000
EXAMPLES ?= 100000
.PHONY: reliability
reliability: $(VENV)/package
	$(BIN)/python -m lab.tools.reliability --examples $(EXAMPLES)

.PHONY: reliability-quick
reliability-quick: $(VENV)/package
	$(BIN)/python -m lab.tools.reliability --quick

# Only some: make bounds TESTS=test/segmentation
TESTS ?= test/reliability test/person test/camera test/segmentation test/terms test/search test/measuring test/tracking
.PHONY: bounds
bounds: $(VENV)/extras
	XDG_DATA_HOME=$(CURDIR)/$(VENV)/data NUMBA_BOUNDSCHECK=1 \
		$(BIN)/python -m pytest --timeout 7200 $(TESTS)

# There are 23 functions.
.PHONY: bounds-long
bounds-long: export RELIABILITY_EXAMPLES := 4800
bounds-long: TESTS := test/reliability/test_kernels.py
bounds-long: bounds

# The build uses a copy, like a workspace of its own. 'make test' runs the slow tests.
COLCON := build/colcon
.PHONY: colcon
colcon: setup
	$(PIP) install --quiet .[colcon]
	rm -rf $(COLCON)
	mkdir -p $(COLCON)/src/cardbox_tracker
	git ls-files -z --cached --others --exclude-standard \
		| while IFS= read -r -d '' file; do if [[ -e $$file ]]; then printf '%s\0' "$$file"; fi; done \
		| tar --create --null --files-from=- | tar --extract --directory=$(COLCON)/src/cardbox_tracker
	cd $(COLCON) && export AMENT_PREFIX_PATH=$(CURDIR)/$(VENV) PATH=$(BIN):$$PATH && \
		colcon build --event-handlers console_direct+ && \
		for name in cardbox background initializer tracker camera play_bag stereo_depth rula retarget teleoperation cardbox_nodes; do \
			test -x install/cardbox_tracker/lib/cardbox_tracker/$$name || \
				{ echo "colcon installed no $$name" >&2; exit 1; }; \
		done && \
		colcon test --event-handlers console_direct+ --return-code-on-test-failure \
			--pytest-args -m 'not slow'

.PHONY: clean
clean:
	rm -rf $(VENV) build dist *.egg-info demo_output example .pytest_cache .mypy_cache .ruff_cache .hypothesis
