# make serve   sets everything up and serves on HOST:PORT; make worker runs jobs for services that share DATABASE_URL
# make test    sets everything up and runs the tests; make test-fast runs the fast ones, make test-long the full counts
# make help    the other targets

# TLS=1 serves HTTPS to the network, with a certificate of its own: what a phone needs for its camera.
TLS ?=
HOST ?= $(if $(TLS),0.0.0.0,127.0.0.1)
PORT ?= 8000
export HOST PORT

# Compiled modules are kept: a process that compiles the service anew starts two CPU seconds later, and tests start many.
unexport PYTHONDONTWRITEBYTECODE

# The first Python of 3.11 or later; override with `make PYTHON=/path/to/python serve`.
ifdef PYTHON
PYTHON_GIVEN := $(PYTHON)
else
PYTHON := $(shell for python in python3.11 /usr/bin/python3.11 /usr/local/bin/python3.11 \
	python3 python3.12 python3.13 python3.14; do \
	"$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& command -v "$$python" && break; done)
endif

# HEIC=without leaves out what reads photos in HEIC: its wheel holds an encoder under the GPL (deploy/licences.md).
HEIC ?= with

# SECOND_READER=without leaves out what reads poor pages again: 115 MB, and up to 0.45 GB of a worker's memory.
SECOND_READER ?= with

# KERNELS=without compiles nothing: the plain versions do the same, slower.
KERNELS ?= with

# Languages that the service shall read besides English, by Tesseract's names: make serve LANGUAGES="fra deu"
LANGUAGES ?=

VENV := .venv
BENCH_VENV := .venv-bench
BIN := $(VENV)/bin
PIP_INSTALL := -m pip install --quiet --quiet --no-input --disable-pip-version-check --no-deps --require-hashes

# An environment is good for one place, one lock, and the Python that was asked for by name, if one was: their
# digest is in the name of its stamp. One whose Python has gone is made anew.
digest = $(shell { echo '$(PYTHON_GIVEN)' '$(CURDIR)'; cat $(1); } 2>/dev/null | sha256sum | cut -c 1-16)
works = $(shell $(1)/bin/python -c 'print("yes")' 2>/dev/null)
ifneq ($(call works,$(VENV)),yes)
$(shell rm -f $(VENV)/created-*)
endif
ifneq ($(call works,$(BENCH_VENV)),yes)
$(shell rm -f $(BENCH_VENV)/created-*)
endif
CREATED := $(VENV)/created-$(call digest,/dev/null)
RUNTIME := $(VENV)/runtime-$(HEIC)-heic-$(SECOND_READER)-second-$(call digest,requirements.lock)
DEVELOPMENT := $(VENV)/development-$(call digest,requirements-dev.lock)
BENCH_CREATED := $(BENCH_VENV)/created-$(call digest,/dev/null)
BENCH := $(BENCH_VENV)/peers-$(call digest,requirements-bench.lock)

# For example BENCH_OPTIONS='--limit 6 --reader rapidocr'.
BENCH_OPTIONS ?=
PEERS := --page-dewarp $(BENCH_VENV)/bin/page-dewarp --rapidocr-python $(BENCH_VENV)/bin/python

.PHONY: help serve worker test test-fast test-long lint format check lock bench-rectify bench-photos bench-speed bench-attack bench-jobs bench-mosaic bench-layout bench-learning bench-review bench-reading \
	system-packages kernels postgresql chromium java licences client-models api-tables api-answers typescript python venv venv-dev venv-bench data-folder clean
.NOTPARALLEL:

help:
	@echo 'make serve            set up, then serve on HOST:PORT (now $(HOST):$(PORT))'
	@echo '             TLS=1 serves HTTPS to the network, for phones: their cameras need it'
	@echo '             LANGUAGES="fra deu" installs what is needed to read these languages too'
	@echo 'make worker           set up, then run jobs, without HTTP, for services that share DATABASE_URL and BLOB_URL'
	@echo 'make test             set up, then run all tests (TEST_PROCESSES=3, TEST_OPTIONS=...)'
	@echo 'make test-fast        the tests of single steps: no service, no whole photo'
	@echo 'make test-long        tests that repeat (fuzzing, races, kills) with their full counts'
	@echo 'make lint             formatting, lint and types'
	@echo 'make check            lint and test'
	@echo 'make format           format the code'
	@echo 'make lock             pin the dependencies anew'
	@echo 'make bench-rectify    the experiments on simulated photos, clean and degraded (BENCH_OPTIONS=...)'
	@echo 'make bench-photos     the real photos, page-dewarp and UVDoc side by side (BENCH_OPTIONS=...)'
	@echo 'make bench-speed      time of an upload as a ratio to decode, remap and encode; page-dewarp and UVDoc in the same run; then of every kind of answer'
	@echo 'make bench-attack     hostile files, bodies and clients against the running service, and what each must be answered'
	@echo 'make bench-jobs       accepted jobs while workers, services and PostgreSQL are killed and restarted (BENCH_OPTIONS=...)'
	@echo 'make bench-mosaic     mosaics of simulated photos, peers on the same photos; then the checks (BENCH_OPTIONS=...)'
	@echo 'make bench-layout     labels and classes of pages with labelled zones, a random forest beside; zones; matching'
	@echo 'make bench-learning   models that learn: rounds, feedback page by page, wrong classes, servers that are killed; documents, many models, discovery'
	@echo 'make bench-review     the order of the review queue, and what goes through without a person'
	@echo 'make bench-reading    text of photos, app scans, receipts and flat pages beside Tesseract alone; then ten languages'
	@echo 'make client-models    types of answers and options in clients/, written anew from the OpenAPI document'
	@echo 'make api-tables       tables of docs/api (operations, limits, problems), written anew from the code'
	@echo 'make api-answers      one real answer of each operation in docs/api, asked anew'
	@echo 'make licences         what the image holds under which licence, written anew (deploy/licences.md, sbom.cdx.json)'
	@echo 'make system-packages  what is needed from Debian (root, or sudo without a password)'
	@echo 'make kernels          what is in C, compiled (KERNELS=without does without)'
	@echo 'make venv             the environment that the service runs in'
	@echo 'make clean            remove what these targets made'

CERTIFICATE = $(DATA_DIR)/certificate.pem
serve: venv
ifdef TLS
	@$(BIN)/python -m app.http.own_certificate '$(CERTIFICATE)'
	@TLS_CERTIFICATE='$(CERTIFICATE)' exec $(BIN)/python -m app
else
	@exec $(BIN)/python -m app
endif

worker: venv
	@exec $(BIN)/python -m app worker

# One more than processors of a small machine: many tests wait for other processes.
TEST_PROCESSES := 3
PYTEST := $(BIN)/python -m pytest -n $(TEST_PROCESSES) \
	--dist loadgroup --no-loadscope-reorder
test: venv-dev postgresql chromium typescript
	@$(PYTEST) $(TEST_OPTIONS)

test-fast: venv-dev
	@$(PYTEST) -m fast $(TEST_OPTIONS)

# Tests that are marked `long` or read their counts from tests/counts.py.
test-long: venv-dev postgresql java
	@LONG_TESTS=1 $(PYTEST) -m long $(TEST_OPTIONS)

lint: venv-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: venv-dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

check: lint test

bench-rectify: venv-dev venv-bench
	@$(BIN)/python -m benchmarks rectify_simulated --experiment all --both --peers $(PEERS) $(BENCH_OPTIONS)

bench-photos: venv-dev venv-bench
	@$(BIN)/python -m benchmarks rectify_photos $(PEERS) --uvdoc-python $(BENCH_VENV)/bin/python $(BENCH_OPTIONS)

bench-speed: venv-dev venv-bench
	@$(BIN)/python -m benchmarks rectify_speed --page-dewarp $(BENCH_VENV)/bin/page-dewarp \
		--uvdoc-python $(BENCH_VENV)/bin/python $(BENCH_OPTIONS)
	@$(BIN)/python -m benchmarks speed

bench-attack: venv-dev
	@$(BIN)/python -m benchmarks attack $(BENCH_OPTIONS)

bench-jobs: venv-dev postgresql
	@$(BIN)/python -m benchmarks jobs $(BENCH_OPTIONS)

bench-mosaic: venv-dev
	@$(BIN)/python -m benchmarks mosaic_simulated --peers $(BENCH_OPTIONS)
	@$(BIN)/python -m benchmarks mosaic_checks

bench-layout: venv-dev
	@$(BIN)/python -m benchmarks layout_recognition $(BENCH_OPTIONS)
	@$(BIN)/python -m benchmarks layout_words
	@$(BIN)/python -m benchmarks layout_segmentation
	@$(BIN)/python -m benchmarks layout_hard_pages
	@$(BIN)/python -m benchmarks layout_matching --two-steps

bench-learning: venv-dev
	@$(BIN)/python -m benchmarks learning $(BENCH_OPTIONS)
	@$(BIN)/python -m benchmarks learning_store
	@$(BIN)/python -m benchmarks learning_store --database postgresql --kills 20
	@$(BIN)/python -m benchmarks layout_documents
	@$(BIN)/python -m benchmarks layout_hierarchy
	@$(BIN)/python -m benchmarks layout_discovery

bench-review: venv-dev
	@$(BIN)/python -m benchmarks review $(BENCH_OPTIONS)

# App scans are Russian; what ten languages need is said by their benchmark.
bench-reading: LANGUAGES += rus
bench-reading: venv-dev
	@$(BIN)/python -m benchmarks reading $(BENCH_OPTIONS)
	@$(BIN)/python -m benchmarks languages

# `$(call install_packages,NAMES,CONSEQUENCE)` installs Debian's packages, as root or by sudo without a password. Where
# it may not, it says so with the consequence, and succeeds.
define install_packages
	if ! command -v apt-get >/dev/null; then \
		echo "Please install what Debian calls$(1). $(2)" >&2; exit 0; \
	fi; \
	if [ "$$(id -u)" = 0 ]; then root=''; \
	elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then root='sudo -n'; \
	else echo "Not root: please run  sudo apt-get install$(1). $(2)" >&2; exit 0; \
	fi; \
	echo "Installing$(1)"; \
	export DEBIAN_FRONTEND=noninteractive; \
	install="$$root apt-get install --quiet=2 --yes --no-install-recommends -o Dpkg::Use-Pty=0$(1)"; \
	$$install >/dev/null 2>&1 || { $$root apt-get update --quiet=2 && $$install >/dev/null; } || \
		echo "These could not be installed:$(1). $(2)" >&2
endef

# Tesseract's language data, and python3-venv where this Python cannot make environments without it.
system-packages:
	@missing=''; \
	for language in eng osd $(LANGUAGES); do \
		name="$$language.traineddata"; package="tesseract-ocr-$$(printf %s "$$language" | tr _ -)"; \
		for folder in "$$TESSDATA_PREFIX" /usr/share/tesseract-ocr/5/tessdata \
			/usr/share/tesseract-ocr/4.00/tessdata /usr/share/tesseract-ocr/tessdata \
			/usr/share/tessdata /usr/local/share/tessdata; do \
			[ -n "$$folder" ] && [ -f "$$folder/$$name" ] && continue 2; \
		done; \
		missing="$$missing $$package"; \
	done; \
	if [ -z '$(PYTHON)' ]; then missing="$$missing python3 python3-venv"; \
	elif ! '$(PYTHON)' -c 'import ensurepip, venv' 2>/dev/null; then missing="$$missing python3-venv"; fi; \
	[ -z "$$missing" ] && exit 0; \
	$(call install_packages,$$missing,Without the tesseract packages the service works without OCR.)

# The tests start a server of their own from these programs. It needs no cluster of Debian's.
postgresql:
	@command -v initdb >/dev/null && exit 0; \
	for program in /usr/lib/postgresql/*/bin/initdb; do [ -x "$$program" ] && exit 0; done; \
	$(call install_packages, postgresql,The tests of the store run on SQLite only.)

# The tests of browser apps and of /docs.
chromium:
	@for program in chromium chromium-browser google-chrome; do command -v $$program >/dev/null && exit 0; done; \
	$(call install_packages, chromium,The tests with a real browser are left out.)

# What openapi-generator runs on, which makes clients in Kotlin and Swift for `make test-long`.
java:
	@command -v java >/dev/null && exit 0; \
	$(call install_packages, default-jre-headless,Tests of clients in Kotlin and Swift are left out.)

# The programs that make and check TypeScript types, and axe-core, which checks the accessibility of the page.
# By itself npm tries for a quarter of an hour where its registry does not answer.
TYPESCRIPT := tests/end_to_end
NPM_CI := npm ci --silent --no-audit --no-fund --fetch-retries=1 --fetch-retry-mintimeout=1000 --fetch-timeout=30000
typescript:
	@[ -x $(TYPESCRIPT)/node_modules/.bin/openapi-typescript ] && [ -f $(TYPESCRIPT)/node_modules/axe-core/axe.min.js ] && exit 0; \
	command -v npm >/dev/null && $(NPM_CI) --prefix $(TYPESCRIPT) >/dev/null 2>&1 || \
		echo 'openapi-typescript and axe-core could not be installed (they need npm). Tests of TypeScript types and accessibility are left out.' >&2

python: system-packages
	@if [ -z '$(PYTHON)' ] && ! command -v python3 >/dev/null; then \
		echo 'Python 3.11 or later was not found; say where it is: make PYTHON=/path/to/python ...' >&2; exit 1; \
	fi

# What the service has in C, compiled; it needs no environment.
kernels: python
	@[ '$(KERNELS)' = without ] && exit 0; \
	{ command -v cc || command -v gcc || command -v clang; } >/dev/null || { $(call install_packages, gcc libc6-dev,Kernels are not compiled without them.) ; }; \
	'$(or $(PYTHON),python3)' -m services.kernels.build

venv: system-packages kernels $(RUNTIME)
venv-dev: system-packages kernels $(DEVELOPMENT)
venv-bench: $(BENCH)

$(CREATED) $(BENCH_CREATED): | python
	@echo 'Creating $(@D)'
	@rm -rf $(@D)
	@'$(or $(PYTHON),python3)' -m venv $(@D)
	@touch $@

$(RUNTIME): $(CREATED)
	@echo 'Installing requirements.lock'
	@rm -f $(VENV)/runtime-*
	@$(BIN)/python $(PIP_INSTALL) -r requirements.lock
	@[ '$(HEIC)' != without ] || $(BIN)/python -m pip uninstall --quiet --yes --disable-pip-version-check pillow-heif
	@[ '$(SECOND_READER)' != without ] || $(BIN)/python -m pip uninstall --quiet --yes --disable-pip-version-check \
		rapidocr onnxruntime
	@touch $@

$(DEVELOPMENT): $(CREATED)
	@echo 'Installing requirements-dev.lock'
	@$(BIN)/python $(PIP_INSTALL) -r requirements-dev.lock
	@touch $@

$(BENCH): $(BENCH_CREATED)
	@echo 'Installing requirements-bench.lock'
	@$(BENCH_VENV)/bin/python $(PIP_INSTALL) -r requirements-bench.lock
	@touch $@

# Where the service keeps what it remembers; in the container it belongs to the user that the service runs as.
DATA_DIR ?= data
DATA_OWNER ?= 10001:10001
data-folder:
	@mkdir -p -m 700 '$(DATA_DIR)'
	@[ "$$(id -u)" != 0 ] || chown '$(DATA_OWNER)' '$(DATA_DIR)'

# Versions that are pinned stay where the .in files allow it; `make lock UPGRADE=--upgrade` moves them.
COMPILE := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --no-header \
	--no-emit-index-url --no-emit-find-links --generate-hashes $(UPGRADE)
# Of rapidocr the models are used and none of its code: what only that needs is left out.
WITHOUT := --no-emit-package=
OF_RAPIDOCR := $(addprefix $(WITHOUT),colorlog omegaconf pyclipper shapely tqdm)
lock: venv-dev
	$(COMPILE) $(OF_RAPIDOCR) $(addprefix $(WITHOUT),colorama pyyaml six) requirements.in --output-file requirements.lock
	$(COMPILE) $(OF_RAPIDOCR) requirements-dev.in --constraints requirements.lock --output-file requirements-dev.lock
	$(COMPILE) requirements-bench.in --overrides requirements-bench.overrides \
		--output-file requirements-bench.lock
	@echo 'Now: make licences'

client-models: venv-dev typescript
	@$(BIN)/python -m deploy.client_models

api-tables: venv-dev
	@$(BIN)/python -m deploy.api_tables

api-answers: venv-dev
	@$(BIN)/python -m deploy.api_answers

licences: venv-dev
	@$(BIN)/python -m deploy.licences

clean:
	rm -rf $(VENV) $(BENCH_VENV) services/kernels/compiled-*.library .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find $(wildcard app benchmarks models services simulation tests clients) -name __pycache__ -type d -prune -exec rm -rf {} +
