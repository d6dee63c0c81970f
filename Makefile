# Everything a developer runs. Each target makes what it needs: python3 (3.11 or later), make and a
# C compiler are enough.

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready

# Many tests wait for processes: half as many again as there are processors keep those busy.
WORKERS ?= $(shell $(PYTHON) -c 'import os; print(3 * (os.cpu_count() or 1) // 2)')

# The tests start many processes, and each would compile what it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-fast test-lowest test-kill test-net test-net-full test-browser test-viewer check bench soak pictures prove spec format lock wheel clean

demo: $(READY)
	rm -rf reports/out/demo
	$(BIN)/scaraspec demo --out reports/out/demo

test: check
	$(BIN)/pytest -n $(WORKERS) --dist worksteal

# Without subprocesses and network: for every change while you work. Less than a minute.
FAST := $(addprefix conformance/tests/,protocol traffic judge report mutants) conformance/tests/test_*.py
test-fast: $(READY)
	$(BIN)/pytest -q -n $(WORKERS) --dist worksteal $(FAST)

# The same tests with the oldest versions that pyproject.toml allows, in an environment of their own.
test-lowest: LOWEST := .venv/lowest/bin/python
test-lowest: $(READY)
	$(BIN)/pip install --quiet uv
	$(BIN)/uv venv --quiet --clear .venv/lowest
	$(BIN)/uv pip install --quiet --python $(LOWEST) --resolution lowest-direct \
	  --editable '.[all]' 'pytest-xdist>=3.6'
	$(LOWEST) -m pytest -n $(WORKERS) --dist worksteal

# Kills the recorder's processes at 200 random moments under traffic, and 40 certifications inside their
# cases; SCARASPEC_KILLS sets another number for both. Takes an hour.
test-kill: $(READY)
	SCARASPEC_KILLS=$${SCARASPEC_KILLS:-200} $(BIN)/pytest -s -m campaign recorder/tests/endurance
	$(BIN)/pytest -s -m campaign conformance/tests/cli/test_certify_killed.py

# On machines and disks made of namespaces, which root may make, and whoever may make a user namespace.
# The full one moves a gigabyte each way and 10,000 connections, in every mode, and takes minutes.
test-net-full: export SCARASPEC_FULL := 1
test-net test-net-full: export PATH := $(PATH):/usr/sbin:/sbin
test-net test-net-full: $(READY)
	@for tool in ip nft tcpdump; do command -v $$tool >/dev/null || \
	  { echo "make $@ wants iproute2, nftables and tcpdump installed: there is no $$tool" >&2; exit 1; }; done
	$$(test $$(id -u) = 0 || echo unshare --user --map-current-user --keep-caps --net) \
	  $(BIN)/pytest -m network recorder/tests

# The report as Chromium shows it, headless.
test-browser: $(READY)
	@command -v chromium >/dev/null || { echo "make $@ wants Chromium installed" >&2; exit 1; }
	$(BIN)/pytest -m browser conformance/tests/report

# The Rerun viewer without a screen; it wants a driver of Vulkan, of which Mesa has one in software.
test-viewer: $(READY)
	$(BIN)/pytest -m viewer conformance/tests/cli

check: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/mypy bench docs spec
	$(BIN)/mypy conformance/tests
	$(BIN)/mypy recorder/tests
	$(BIN)/lint-imports

bench: $(READY)
	$(BIN)/python bench/frames.py
	$(BIN)/python -m bench.forwarding
	$(BIN)/python -m bench.suite
	$(BIN)/python -m bench.soak --hours 0.2 --rotate 144s

# Hours of traffic, at speed; a whole day, `make soak HOURS=24`, takes some hours.
HOURS ?= 1.25
soak: $(READY)
	$(BIN)/python -m bench.soak --hours $(HOURS)

# Every seeded fault against the cases of what it violates, and every dialect: about half an hour on
# two cores. Without --quick each fault meets the whole suite, which takes hours.
prove: $(READY)
	$(BIN)/scaraspec prove --quick --out reports
	$(BIN)/scaraspec prove --dialects

# Wants Chromium and a software renderer; no other target does.
pictures: demo
	$(BIN)/python docs/pictures.py reports/out/demo

# The pages that are generated from the register and the catalogue.
spec: $(READY)
	$(BIN)/python spec/generate.py

format: $(READY)
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

wheel: $(READY)
	rm -rf dist
	$(BIN)/python -m build --no-isolation --wheel

# The lock is made anew only on purpose; it names versions and hashes, and no index.
lock: $(READY)
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-header \
	  --python-version 3.11 --all-extras --group dev pyproject.toml -o requirements.lock

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "scaraspec needs Python 3.11 or later: make PYTHON=python3.12")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

clean:
	rm -rf .venv dist reports/out
