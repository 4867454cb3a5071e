"""The processor that code is compiled for: a baseline, so that results are the same on all machines that reach it.

On x86-64 the baseline is the level v3 (AVX2 and fused multiply-add: Intel from 2013, AMD from 2015). A processor below
it, one of another architecture, and ``BILAYER_JIT_TARGET=native`` have code for the present processor instead.
numba has one target for all that a process compiles, so functions of other programs in it are compiled for the same.
"""

from __future__ import annotations

import os
import platform
from functools import cache

import numba
from llvmlite import binding

BASELINE = "x86-64-v3"
FEATURES = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
"""Of a processor that runs code for the baseline, by LLVM's names."""
SWITCH = "BILAYER_JIT_TARGET"
NATIVE = "native"


def reaches_baseline() -> bool:
    """Return whether the present processor runs code for the baseline."""
    present = binding.get_host_cpu_features()
    return platform.machine().lower() in ("x86_64", "amd64") and all(present.get(name, False) for name in FEATURES)


@cache
def target() -> tuple[str, str]:
    """Return the processor and its features, by LLVM's names; numba's own settings come first."""
    if numba.config.CPU_NAME is not None or numba.config.CPU_FEATURES is not None:
        name = numba.config.CPU_NAME or binding.get_host_cpu_name()
        return name, numba.config.CPU_FEATURES or ""
    if os.environ.get(SWITCH, "") != NATIVE and reaches_baseline():
        return BASELINE, ""
    return binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()


def set_target() -> None:
    """Have numba compile for the target: it takes this when it compiles its first function, and optimises for it."""
    numba.config.reload_config()  # which would undo this if it came later, after a change of the environment
    numba.config.CPU_NAME, numba.config.CPU_FEATURES = target()


@cache
def machine() -> binding.TargetMachine:
    """Return what makes objects for the target, whose code may lie anywhere in memory."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = target()
    of = binding.Target.from_triple(binding.get_process_triple())
    return of.create_target_machine(cpu=name, features=features, opt=3, reloc="pic", codemodel="small")
