# The commands of a developer. Each target creates what it needs; python3 (3.11 or later), make and
# a C compiler are sufficient.

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready

# Many tests wait for processes: two workers per processor keep the processors busy.
WORKERS ?= $(shell $(PYTHON) -c 'import os; print(2 * (os.cpu_count() or 1))')

# The tests start many processes; without bytecode files each would compile its imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-fast test-runs test-lowest test-kill test-faults test-net test-net-full test-browser test-viewer test-wireshark test-archive test-captures test-tutorial check bench soak trust site pictures prove spec messages format lock wheel clean test-windows wheelhouse release licences

demo: $(READY)
	rm -rf reports/out/demo
	$(BIN)/scaraspec demo --out reports/out/demo

# Under five minutes on two processors without other load.
test: check
	$(BIN)/pytest -n $(WORKERS) --dist worksteal

# Tests without subprocesses and network, for every change during the work. Less than a minute.
FAST := $(addprefix conformance/tests/,protocol traffic judge report mutants) conformance/tests/test_*.py
test-fast: $(READY)
	$(BIN)/pytest -q -n $(WORKERS) --dist worksteal $(FAST)

# Tests with long runs that few changes concern: the tutorial, the examples of the documentation, the
# installation of the wheel, a foreign repository, killed runs and recorders, scripts that repeat a
# failure, and the whole suite with less than all hazards allowed.
test-runs: $(READY)
	$(BIN)/pytest -n $(WORKERS) --dist worksteal -m runs

# All tests with the oldest versions that pyproject.toml allows, in a separate environment.
test-lowest: LOWEST := .venv/lowest/bin/python
test-lowest: $(READY)
	$(BIN)/pip install --quiet uv
	$(BIN)/uv venv --quiet --clear .venv/lowest
	$(BIN)/uv pip install --quiet --python $(LOWEST) --resolution lowest-direct --group docs \
	  --editable '.[all]' 'codespell>=2.4' 'jsonschema>=4.23' 'junitparser>=3.2' 'pytest-html>=4.1' \
	  'pytest-randomly>=3.16' 'pytest-timeout>=2.3' 'pytest-xdist>=3.6' 'pyyaml>=6.0.2'
	$(LOWEST) -m pytest -n $(WORKERS) --dist worksteal
	$(LOWEST) -m pytest -n $(WORKERS) --dist worksteal -m runs

# Kills the recorder's processes at 200 random moments under traffic, and 40 certifications during
# their cases, and tries 40 examples of the user's files; SCARASPEC_KILLS sets another number for
# all. Takes an hour.
test-kill: $(READY)
	SCARASPEC_KILLS=$${SCARASPEC_KILLS:-200} $(BIN)/pytest -s -m campaign recorder/tests/endurance/test_kills.py
	$(BIN)/pytest -s -m campaign conformance/tests/cli/test_certify_killed.py
	SCARASPEC_KILLS=$${SCARASPEC_KILLS:-40} $(BIN)/pytest conformance/tests/suite/test_user_files.py

# Random faults of processes, files, disk, clock and memory under traffic, on a disk of its own as for
# test-net; needs a C compiler. SCARASPEC_SEED repeats the faults of another run. 300 rounds take a
# quarter of an hour.
ROUNDS ?= 300
test-faults: $(READY)
	SCARASPEC_ROUNDS=$(ROUNDS) \
	  $$(test $$(id -u) = 0 || echo unshare --user --map-current-user --keep-caps) \
	  $(BIN)/pytest -s -m campaign recorder/tests/endurance/test_faults.py

# Tests on simulated machines and disks (namespaces); need root or permission for user namespaces.
# test-net-full sends a gigabyte in each direction and opens 10,000 connections in every mode, which
# takes minutes.
test-net-full: export SCARASPEC_FULL := 1
test-net test-net-full: export PATH := $(PATH):/usr/sbin:/sbin
test-net test-net-full: $(READY)
	@for tool in ip nft tcpdump; do command -v $$tool >/dev/null || \
	  { echo "make $@ needs iproute2, nftables and tcpdump: $$tool is not installed" >&2; exit 1; }; done
	$$(test $$(id -u) = 0 || echo unshare --user --map-current-user --keep-caps --net) \
	  $(BIN)/pytest -m network recorder/tests

# Tests of the report in headless Chromium.
test-browser: $(READY)
	@command -v chromium >/dev/null || { echo "make $@ needs Chromium, which is not installed" >&2; exit 1; }
	$(BIN)/pytest -m browser conformance/tests/report

# Tests in the Rerun viewer without a screen; they need a Vulkan driver, such as the software driver
# of Mesa.
test-viewer: $(READY)
	$(BIN)/pytest -m viewer conformance/tests/cli

# The commands of docs/tutorial-certify.md: a whole certification with a package. Four minutes on a
# machine without other load.
test-tutorial: $(READY)
	$(BIN)/pytest -m campaign conformance/tests/test_documented_commands.py

# Captures that are cut at many places, with lost packets, or damaged: nothing fails that does not
# fail in the whole capture, and no file causes a traceback. Takes a quarter of an hour.
test-captures: $(READY)
	$(BIN)/python conformance/tests/support/lost_packets.py --seeds 100
	$(BIN)/python conformance/tests/support/damaged_captures.py --count 5000

# Tests of the dissector in tshark.
test-wireshark: $(READY)
	@command -v tshark >/dev/null || { echo "make $@ needs tshark, which is not installed" >&2; exit 1; }
	$(BIN)/pytest -m wireshark conformance/tests/dissectors

# Each command in a Windows CPython under Wine, which is set up in .wine (CONTRIBUTING.md).
test-windows: export SCARASPEC_WINE := $(CURDIR)/.wine
test-windows: wheel
	@for tool in wine mvn script; do command -v $$tool >/dev/null || \
	  { echo "make $@ needs Wine, Maven and script: $$tool is not installed" >&2; exit 1; }; done
	rm -rf .wine/wheels
	$(MAKE) --no-print-directory wheelhouse PLATFORM=windows WHEELS=.wine/wheels
	conformance/tests/windows/set_up.sh $(SCARASPEC_WINE) $(SCARASPEC_WINE)/wheels
	$(BIN)/pytest -m windows conformance/tests/windows

# Tests of archives on an S3 server with Dask workers, all on loopback.
test-archive: $(READY)
	$(BIN)/pytest -m archive conformance/tests/cli

# Both folders of tests have a module tests.conftest, so that mypy checks them one after the other.
check: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy --num-workers 2 conformance recorder/scaraspec_recorder bench docs spec release
	$(BIN)/mypy recorder/tests
	$(BIN)/lint-imports

bench: $(READY)
	$(BIN)/python bench/frames.py
	$(BIN)/python -m bench.forwarding
	$(BIN)/python -m bench.suite
	$(BIN)/python -m bench.audit
	$(BIN)/python -m bench.archive
	$(BIN)/python -m bench.soak --hours 0.2 --rotate 144s

# Simulates hours of traffic; a whole day, `make soak HOURS=24`, takes some hours.
HOURS ?= 1.25
soak: $(READY)
	$(BIN)/python -m bench.soak --hours $(HOURS)

# Certifications on a busy machine: conforming subjects never fail, mutants always do, and findings
# can be reproduced. Delays one message at many places in simulated time, too. Takes about five
# hours; docs/mutants.md has smaller numbers.
RUNS ?= 20
CLIENT_RUNS ?= 5
MUTANTS ?= 20
REPRODUCTIONS ?= 50
GATES ?= 30
RED_GATES ?= 10
trust: $(READY)
	SCARASPEC_DELAYS=1 $(BIN)/pytest -q conformance/tests/suite/controller/test_delays.py
	$(BIN)/python -m bench.trust --runs $(RUNS) --client-runs $(CLIENT_RUNS) --mutants $(MUTANTS) \
	  --reproductions $(REPRODUCTIONS) --gates $(GATES) --red-gates $(RED_GATES)

# Runs every mutant with the cases of the requirements that it violates, and every dialect: about
# half an hour on two cores. Without --quick each mutant runs with the whole suite, which takes hours.
prove: $(READY)
	$(BIN)/scaraspec prove --quick --out reports
	$(BIN)/scaraspec prove --role client --quick --out reports
	$(BIN)/scaraspec prove --dialects

# The documentation site. A broken link or anchor is an error; --quiet would hide it. The page to open is
# reports/out/site/index.html; it needs no server.
site: export NO_MKDOCS_2_WARNING := 1
site: $(READY)
	$(BIN)/python -m docs.assemble reports/out/docs
	$(BIN)/mkdocs build --strict

# Needs Chromium and a software renderer.
pictures: demo
	$(BIN)/python docs/pictures.py reports/out/demo

# Generates the pages of the register and the catalogue, records what each case of the suite does, and
# writes a list of mandatory cases if they changed.
spec: $(READY)
	$(BIN)/python spec/generate.py
	$(BIN)/python -m scaraspec.mutants.recorded_runs
	$(BIN)/python spec/mandatory.py

# Brings the catalogues of translations and docs/translation.md up to date with the code.
messages: $(READY)
	$(BIN)/python docs/messages.py

format: $(READY)
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# Builds, checks and installs a release; publishes nothing.
release: $(READY)
	PYTHON=$(CURDIR)/$(BIN)/python release/release.sh

# Writes docs/licences.md from the installed packages.
licences: $(READY)
	$(BIN)/python release/licences.py

wheel: $(READY)
	rm -f dist/scaraspec-*
	$(BIN)/python -m build --no-isolation --wheel

# A folder with everything that a machine without internet needs: `make wheelhouse PLATFORM=windows`
# (docs/install.md).
PLATFORM ?= linux
PLATFORM_PYTHON ?= 3.12
EXTRAS ?= pcap,serial
WHEELS ?= dist/wheels-$(PLATFORM)
wheelhouse: wheel
	$(BIN)/pip install --quiet uv
	$(BIN)/python release/wheelhouse.py dist/scaraspec-*.whl --platform $(PLATFORM) \
	  --python $(PLATFORM_PYTHON) --extras "$(EXTRAS)" --out $(WHEELS)

# Updates the lock file, only on request; it contains versions and hashes, and no index.
lock: $(READY)
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --no-header \
	  --python-version 3.11 --all-extras --group dev --group docs pyproject.toml -o requirements.lock

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "scaraspec needs Python 3.11 or later: make PYTHON=python3.12")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

clean:
	rm -rf .venv dist reports/out
