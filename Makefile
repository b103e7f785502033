# make demo    install, then run the workflow on data_samples
# make test    install, then check the code and run the tests
# make studies [QUICK=true]   error against cost, and where methods fail
# make evidence [QUICK=true]   measure anew what README and documentation state, with planted faults: docs/evidence.md
# make docs-ledger   compute the claims of the paper and copy their ledger to docs/
# make check   linters, types and the import contracts alone; make pytest   the tests alone
# make accuracy CAMPAIGN=...   run a campaign that has truth files, and print the errors against the truth
# make tables  the must-reach tables of calibration and tracking on synthetic scenes, with their seeds
# make mutants   which tuned constants of tracking and calibration the tests notice, each halved and doubled
# make docs    the documentation as a site that opens offline, with the tutorial executed
# make damage  thousands of damaged campaigns and files, killed runs, full disks, odd surroundings (SECURITY.md)
# make lock, make sbom, make audit   dependencies: lock them, list them, ask for known vulnerabilities (requirements/)
# make bench [CAMPAIGN=...]    what costs what, side by side

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
CORES ?= 2
BIN := $(VENV)/bin
VIEWERS := $(VENV)/viewers
# Every package with the hash of its file, from requirements/. The ends of pyproject.toml's ranges: LOCKED= takes the
# newest, OLDEST=true the oldest (with a VENV of its own).
LOCKED ?= true
OLDEST ?=
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
install = $(if $(OLDEST),$(PIP) --constraint requirements/oldest.txt --editable '$(2)',$(if $(LOCKED),$(PIP) \
	--require-hashes --requirement requirements/$(1).txt && $(PIP) --no-deps --no-build-isolation --editable .,$(PIP) \
	--editable '$(2)'))
SOURCES := src studies tests
# Where PYTHONDONTWRITEBYTECODE is set, as in many images, each process would compile all it imports: 0.3 s of its start.
compile = $(BIN)/python -m compileall -q src studies

.PHONY: demo test pytest check viewers studies evidence docs-ledger accuracy tables mutants bench docs damage lock sbom audit clean

$(VENV)/installed: pyproject.toml requirements/run.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "towval needs Python 3.11 or newer: make PYTHON=/path/to/python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(call install,run,.)
	$(compile)
	touch $@

$(VENV)/installed-dev: $(VENV)/installed requirements/dev.txt
	$(call install,dev,.[dev])
	touch $@

# The programs that have to open our files, apart from our own packages: they are called, never imported, and two are GPL.
$(VENV)/installed-viewers: $(VENV)/installed
	$(PYTHON) -m venv $(VIEWERS)
	$(VIEWERS)/bin/python -m pip install --quiet --disable-pip-version-check 'evo>=1.30,<2' 'pymcap-cli>=0.30,<1' 'rerun-sdk>=0.30,<1'
	touch $@

viewers: $(VENV)/installed
	@$(MAKE) --no-print-directory $(VENV)/installed-viewers || echo "evo, pymcap-cli or Rerun cannot be installed here: what calls them is skipped"

$(VENV)/installed-bench: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	touch $@

demo: $(VENV)/installed
	$(BIN)/snakemake --cores $(CORES)
	@echo
	@echo "The report: $(CURDIR)/results/lab_small/report.html"

check: $(VENV)/installed-dev
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/snakefmt --check Snakefile src/towval/workflow/rules studies/rules src/towval/workflow/Snakefile
	$(BIN)/snakemake --lint

test: $(VENV)/installed-dev
	@$(MAKE) --no-print-directory --jobs 2 check viewers
	@$(MAKE) --no-print-directory pytest

pytest: $(VENV)/installed-dev
	$(compile)
	OMP_NUM_THREADS=1 TOWVAL_VIEWERS="$${TOWVAL_VIEWERS:-$(CURDIR)/$(VIEWERS)/bin}" $(BIN)/python -m pytest -n $(CORES) --dist loadfile --durations 10

CAMPAIGN ?= data_samples/lab_small

accuracy: $(VENV)/installed
	$(BIN)/snakemake --cores $(CORES) --quiet all --config campaign=$(CAMPAIGN)
	$(BIN)/python -m studies.tables.accuracy results/$(notdir $(CAMPAIGN:/=)) $(CAMPAIGN)

tables: $(VENV)/installed
	OMP_NUM_THREADS=1 $(BIN)/python -m studies.tables.calibration_table
	OMP_NUM_THREADS=1 $(BIN)/python -m studies.tables.tracking_accuracy

mutants: $(VENV)/installed-dev
	OMP_NUM_THREADS=1 $(BIN)/python -m studies.tables.mutants --jobs $(CORES)

bench: $(VENV)/installed-bench
	$(BIN)/python -m studies.tables.workflow_time $(CAMPAIGN)

QUICK ?= false

studies: $(VENV)/installed
	$(BIN)/snakemake tradeoff stability --cores $(CORES) --quiet rules --config quick=$(QUICK)
	@echo "The charts: $(CURDIR)/results/study/study.html"

evidence: $(VENV)/installed-dev $(VENV)/installed-bench
	OMP_NUM_THREADS=1 $(BIN)/snakemake evidence --cores $(CORES) --quiet rules --config quick=$(QUICK)

docs-ledger: $(VENV)/installed
	$(BIN)/snakemake claims --cores $(CORES) --quiet rules
	cp results/figures/claims.md results/figures/claims.json docs/

CAMPAIGNS ?= 2000
REWRITES ?= 500
READS ?= 2000
KILLS ?= 50
DISKS ?= 20
SEED ?= 1

damage: $(VENV)/installed
	$(BIN)/snakemake --cores $(CORES) --quiet all
	OMP_NUM_THREADS=1 $(BIN)/python -m studies.tables.damage --campaigns $(CAMPAIGNS) --rewrites $(REWRITES) --reads $(READS) --kills $(KILLS) --disks $(DISKS) --surroundings --names --seed $(SEED)

TOOLS := $(VENV)/tools/bin

$(VENV)/installed-tools:
	$(PYTHON) -m venv $(VENV)/tools
	$(TOOLS)/python -m pip install --quiet --disable-pip-version-check 'uv>=0.8,<1' 'cyclonedx-bom>=7,<8' 'pip-audit>=2.9,<3' 'pip-licenses>=5,<6'
	touch $@

LOCK := compile --quiet --universal --generate-hashes --python-version 3.11 --no-header --no-annotate

lock: $(VENV)/installed $(VENV)/installed-tools
	$(TOOLS)/uv pip $(LOCK) pyproject.toml requirements/build.in --output-file requirements/run.txt
	$(TOOLS)/uv pip $(LOCK) --extra dev --constraint requirements/run.txt pyproject.toml requirements/build.in --output-file requirements/dev.txt
	$(TOOLS)/uv pip compile --quiet --upgrade --resolution lowest-direct --python-version 3.11 --no-header --no-annotate --extra dev pyproject.toml --output-file requirements/oldest.txt
	printf '# Licences of what is installed\n\nAs each package of `run.txt` states it; written by `make lock`.\n\n' > requirements/licences.md
	$(TOOLS)/pip-licenses --python $(BIN)/python --packages $$(sed -n 's/==.*//p' requirements/run.txt) --format markdown --from mixed >> requirements/licences.md

sbom: $(VENV)/installed $(VENV)/installed-tools
	mkdir -p results
	$(TOOLS)/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible --output-file results/sbom.cdx.json $(BIN)/python

audit: $(VENV)/installed-tools
	$(TOOLS)/pip-audit --requirement requirements/run.txt --require-hashes --disable-pip --vulnerability-service osv || \
		{ echo 'make audit: a package is vulnerable, or the database at api.osv.dev cannot be reached: see above' >&2; exit 1; }

$(VENV)/installed-docs: $(VENV)/installed
	$(PIP) --editable '.[docs]'
	touch $@

docs: $(VENV)/installed-docs
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m sphinx -q -c docs/site -d site/.doctrees docs site
	@echo "The documentation: $(CURDIR)/site/index.html"

clean:
	rm -rf site jupyter_execute docs/generated $(VENV) results .snakemake
