# Everything is installed into .venv from the package registries alone.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := $(shell find crates -name '*.rs' -o -name 'Cargo.toml') Cargo.toml pyproject.toml

.PHONY: setup build test
setup: $(VENV)/.built ## installs everything into .venv

build: $(VENV)/.built

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q 'maturin>=1.9,<2' numpy typer rich pillow matplotlib pytest hypothesis ruff mypy scipy
	touch $@

$(VENV)/.built: $(VENV)/.installed $(SOURCES)
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release -q
	touch $@

test: build ## runs all tests
	cargo test --workspace --exclude siloscope-py -q
	$(BIN)/pytest
