# The whole project in a few words: make book, make test, make lab.
# Each target calls ordinary tools; README.md gives the same commands for Windows.

SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
READY := $(VENV)/ready
# PINS=requirements.lock takes only files with the hashes written there; a mirror that has built its
# own cannot serve it.
PINS ?= requirements.txt

# Jupyter looks for its own programs on PATH.
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export PYTHONHASHSEED := 0
# What Python compiles is kept: else every process would compile the package and the tests anew.
unexport PYTHONDONTWRITEBYTECODE
# Matplotlib keeps its list of fonts here, and warns in the notebooks where a home is missing.
export MPLCONFIGDIR := $(CURDIR)/$(VENV)/matplotlib

# Two tests at a time; those of one file in one process, each with one thread of BLAS. The files come
# in the order of tests/conftest.py, the longest first, not by the number of their tests.
PYTEST := OPENBLAS_NUM_THREADS=1 $(PY) -m pytest -q -n 2 --dist loadfile --no-loadscope-reorder
EVERY_DAY := -m "not thorough"
UNITS := tests nrdob book/nrdob_course
NBVAL := --nbval --nbval-current-env --nbval-cell-timeout 300 \
	--nbval-sanitize-with tests/nbval-sanitize.cfg
# Another processor rounds otherwise: the oldest kernels of OpenBLAS and of NumPy's own loops.
OLD_PROCESSOR := OPENBLAS_CORETYPE=Nehalem \
	NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX512_ICL AVX512_SPR"

.PHONY: help env book pdf zip ledger quick test lint types layers map unit notebooks old-notebooks thorough execute check \
	bench bench-table pages slides paper lab release grade report test-exercises test-site clean

help: ## show this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /	/' | expand -t 16

env: $(READY) ## make the environment in .venv (the other targets do it when needed)

$(READY): $(PINS) pyproject.toml book/pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, e.g.: make PYTHON=python3.12" if sys.version_info < (3, 11) else 0)'
	@echo "Making the environment in $(VENV); this takes about a minute, once."
	$(PYTHON) -m venv $(VENV)
	@# The pins name all that is needed; Python compiles what it reads when it first reads it.
	$(PY) -m pip install --quiet --no-compile --no-deps -r $(PINS)
	$(PY) -m pip install --quiet --no-compile --no-deps -e . -e ./book
	@# The paths of these folders as pip notes them are UTF-8; Python before 3.13 reads them in the
	@# encoding of the locale. Relative ones need no letters.
	@cd $(VENV)/lib/python3*/site-packages && echo ../../../.. > _editable_impl_nrdob.pth
	@cd $(VENV)/lib/python3*/site-packages && echo ../../../../book > _editable_impl_nrdob_course.pth
	@$(PY) -c 'import matplotlib.font_manager' 2> /dev/null
	@touch $(READY)

book: $(READY) ## run every notebook and build the web book
	$(PY) book/make/notebooks.py --output build/notebooks
	$(PY) book/make/ledger.py --notebooks build/notebooks
	$(PY) -m sphinx -W --keep-going -n -q -D nrdob_notebooks=../build/notebooks -d build/doctrees -b html book build/html
	@echo "The book is ready. Open $(CURDIR)/build/html/index.html"

pdf: book ## write the book as one PDF (needs Chromium; takes some minutes)
	$(PY) book/make/pdf.py

zip: book ## pack the site, the notebooks and the package into one file
	$(PY) book/make/bundle.py

ledger: $(READY) ## run every check of the ledger, and write its two pages into the book
	$(PY) book/make/ledger.py

# The outputs stored in the notebooks are those of a current processor, and are compared with those
# of an old one: the notebooks run once. `make notebooks` runs them as this machine computes.
test: $(READY) ## run the checks of every change, the notebooks among them
	@$(MAKE) --jobs=2 lint types layers unit
	@$(MAKE) old-notebooks

thorough: $(READY) ## run what takes longer: browsers, graded classes, wide random searches
	@# Three at a time, as some wait for a browser.
	$(PYTEST) -n 3 -m thorough tests
	$(OLD_PROCESSOR) $(PYTEST) $(NBVAL) notebooks/class nrdob book/nrdob_course --doctest-modules

lint: $(READY) layers ## style and formatting, and whether everything stands, and is told, where it belongs
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m tests.structure
	$(PY) book/make/teaching.py --check
	$(PY) book/make/predictions.py --check
	$(PY) book/make/trust.py --check

types: $(READY) ## static types
	$(PY) -m mypy

layers: $(READY) ## imports between the modules run one way
	@# Not by the program in bin, whose first line holds this path in the letters of the locale;
	@# and in UTF-8, which is all that the reader of the imports takes a path for.
	PYTHONUTF8=1 $(PY) -c 'from importlinter.cli import lint_imports_command as lint; lint()'

map: $(READY) ## print the layers of the package, each module with its lines
	$(PY) -m tests.structure.map

# Without the slow tests, those of the course (make test-exercises) and most random examples.
quick: $(READY) ## the checks of the working day, in about a minute
	@$(MAKE) --jobs=2 lint types layers unit \
		EVERY_DAY='-m "not slow" --ignore=tests/course --hypothesis-profile=quick' \
		UNITS='tests nrdob'

unit: $(READY) ## unit tests, doctests and the rules for notebooks
	$(PYTEST) $(EVERY_DAY) $(UNITS) --doctest-modules

test-site: $(READY) ## build the book and open every page in a browser, at the width of a phone
	$(PYTEST) tests/book/test_site.py

notebooks: $(READY) ## run every notebook and compare with the outputs stored in it
	$(PYTEST) $(NBVAL) notebooks

# The cells of the notebooks for class are in the chapters, too, as lint makes sure.
old-notebooks: $(READY) ## run every chapter in the arithmetic of an old processor
	$(OLD_PROCESSOR) $(PYTEST) $(NBVAL) notebooks --ignore=notebooks/class

pages: $(READY) ## write what is made and stored: pages for teachers, questions in the chapters, the runs
	$(PY) book/make/teaching.py
	$(PY) book/make/predictions.py
	$(PY) book/make/trust.py

execute: $(READY) ## run every notebook in place, store its outputs, draw the README picture
	$(PY) book/make/notebooks.py --in-place --report
	$(PY) book/make/predictions.py
	$(PY) book/make/readme_picture.py

check: $(READY) ## run every notebook and compare byte for byte, figures included (same machine only)
	$(PY) book/make/notebooks.py --check

bench: $(READY) ## time nrdob against python-control, and the notebooks (takes some minutes)
	$(PY) -m pytest -q --benchmark-quiet tests/bench

bench-table: $(READY) ## time the public calls beside python-control, and the editions before, in one table
	OPENBLAS_NUM_THREADS=1 $(PY) tests/bench/table.py

slides: $(READY) ## make slides of the questions for class, which need no network
	$(PY) book/make/slides.py

paper: $(READY) ## write sets, solutions and boards as pages to be printed
	$(PY) book/make/paper.py

lab: $(READY) ## open the notebooks in JupyterLab
	$(PY) -m jupyterlab notebooks

release: $(READY) ## make the students' copies of the problem sets, and the solutions (SETS="set1 set2")
	$(PY) -m nrdob_course.grading release $(SETS)

grade: $(READY) ## grade what students handed in: make grade SUBMISSIONS=folder
	@test -n "$(SUBMISSIONS)" || { echo "Say where they are: make grade SUBMISSIONS=folder"; exit 2; }
	$(PY) -m nrdob_course.grading grade "$(SUBMISSIONS)"

report: $(READY) ## take over the points filled into grading/written.csv
	$(PY) -m nrdob_course.grading report

test-exercises: $(READY) ## test the problem sets, their graders, and the way from a submission to its points
	$(PYTEST) tests/course

clean: ## remove what the other targets made, except the environment
	rm -rf build book/chapters book/ledger.md book/errata.md
