"""The processor that code is compiled for: a baseline, so that results are the same on all machines that reach it.

On x86-64 the baseline is the level v3 (AVX2 and fused multiply-add: Intel from 2013, AMD from 2015). A processor below
it, one of another architecture, and ``BILAYER_JIT_TARGET=native`` have code for the present processor instead.
numba has one target for all that a process compiles, so functions of other programs in it are compiled for the same.
"""

from __future__ import annotations

import os
import platform
from functools import cache
from importlib.metadata import version

import llvmlite
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
    name, features = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    if name or features:
        return name or binding.get_host_cpu_name(), features or ""
    if os.environ.get(SWITCH, "") != NATIVE and reaches_baseline():
        return BASELINE, ""
    return binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()


@cache
def compilers() -> dict[str, str]:
    """Return the versions of what makes machine code; numba is not imported for it."""
    return {"numba": version("numba"), "llvmlite": llvmlite.__version__}


@cache
def machine() -> binding.TargetMachine:
    """Return what makes objects for the target, whose code may lie anywhere in memory."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = target()
    of = binding.Target.from_triple(binding.get_process_triple())
    return of.create_target_machine(cpu=name, features=features, opt=3, reloc="pic", codemodel="small")
