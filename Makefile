# `make demo` and `make test` install everything they need into .venv inside this checkout.
# Another interpreter: `make demo PYTHON=python3.12`.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
PYTHON ?= python3
JOBS ?= 2
VENV := .venv
BIN := $(VENV)/bin

# A ROS 2 environment that is already sourced is used as it is; otherwise ROS 2 comes as pinned wheels.
SOURCED_ROS := $(shell test -n "$$AMENT_PREFIX_PATH" && $(PYTHON) -c 'import rclpy' 2>/dev/null && echo yes)
ifeq ($(SOURCED_ROS),yes)
ROS := sourced
EXTRAS := viewer,test
VENV_OPTIONS := --system-site-packages
else
ROS := wheels
EXTRAS := ros,viewer,test
endif
STAMP := $(VENV)/installed-with-ros-$(ROS)

help:  ## Show what can be made.
	@sed -n 's/^\([a-z]*\):.*## /make \1	/p' $(MAKEFILE_LIST)

demo: $(STAMP) vulkan  ## Run the gripper: simulation node, controller, log, picture.
	$(BIN)/python -m bilayer_sim_ros.demo

test: $(STAMP) vulkan  ## Run every test, the slow ones as well.
	$(BIN)/python -m pytest -m "" -n $(JOBS)

lint: $(STAMP)  ## Check the code's style.
	$(BIN)/ruff check .

install: $(STAMP)  ## Install into .venv only.

clean:  ## Remove .venv and what runs and tests left.
	rm -rf $(VENV) build install log runs .pytest_cache .ruff_cache .hypothesis *.egg-info

# What Debian and Ubuntu must supply: installed where this command may, else the line to paste is printed.
define debian_packages
	if test "$$(id -u)" = 0; then root=; elif sudo -n true 2>/dev/null; then root=sudo; else root=no; fi; \
	if test "$$root" = no || ! command -v apt-get >/dev/null || ! { echo "Installing $(1) with apt-get ..."; \
	    $$root apt-get update -qq && DEBIAN_FRONTEND=noninteractive $$root apt-get install -qq --no-install-recommends $(1); }; then \
	    printf '\n%s is missing. Install it with this line, then run make again:\n\n    sudo apt-get update && sudo apt-get install %s\n\n' \
	        "$(2)" "$(1)" >&2; exit 1; \
	fi
endef

$(STAMP): setup.py pyproject.toml
	@command -v $(PYTHON) >/dev/null || { $(call debian_packages,python3 python3-venv,Python); }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "Python 3.11 or newer is needed, $(PYTHON) is $$($(PYTHON) -V 2>&1). Name another: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	    package=$$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'); \
	    $(call debian_packages,$$package,The part of Python that makes environments); }
	@test -z "$$(ls $(VENV)/installed-with-ros-* 2>/dev/null | grep -vx '$(STAMP)')" || rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV_OPTIONS) $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --editable '.[$(EXTRAS)]'
	@touch $@

# Pictures are drawn by the viewer on Mesa's software Vulkan.
vulkan:
	@ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json 2>/dev/null | grep -q . && ldconfig -p | grep -q libvulkan.so.1 || { \
	    $(call debian_packages,mesa-vulkan-drivers libvulkan1,A Vulkan driver (for pictures)); }

.PHONY: help demo test lint install clean vulkan
