"""Provenance of numbers: code, machine and versions, stated on every row."""

from __future__ import annotations

import os
import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

# For a reader; what a task depends on is found from the source: see benchmarks.fingerprint.dependencies.
PACKAGES = (
    "numpy", "scipy", "numba", "torch", "h5py", "scikit-fem", "libigl", "cvxopt", "pymetis", "ipctk",
    "pyvista", "pyacvd",
)  # fmt: skip


@cache  # that of the first call, which is nearer to the code that was loaded than a later one
def commit() -> str:
    """Return the commit of the checkout, "+changes" where tracked files differ; else the package version."""
    root = Path(__file__).resolve().parent.parent

    def git(*arguments: str) -> str:
        # No lock on the index: one would stay there where the disk is full.
        command = ["git", "--no-optional-locks", "-C", str(root), *arguments]
        answer = subprocess.run(command, capture_output=True, text=True, timeout=20)
        return answer.stdout.strip() if answer.returncode == 0 else ""

    try:
        if (root / ".git").exists() and (head := git("rev-parse", "--short=10", "HEAD")):
            return head + ("+changes" if git("status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.TimeoutExpired):
        pass  # no git on this machine: the installed version is what can be said
    return f"version {package_version('neural-garment-benchmark')}"


def package_version(name: str) -> str:
    """Return the installed version of a distribution, read without importing it, or "absent"."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "absent"


def processor_name() -> str:
    """Return the processor's name, family, model and stepping, or the architecture where it has no name.

    Clouds give processors of several generations one name, which run times and last bits are not the same of.
    """
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("\n\n")[0].splitlines()
    except OSError:
        lines = []  # not Linux
    facts = {name.strip(): " ".join(value.split()) for name, _, value in (s.partition(":") for s in lines)}
    name = facts.get("model name") or platform.processor() or platform.machine()
    which = [f"{key.split()[-1]} {facts[key]}" for key in ("cpu family", "model", "stepping") if key in facts]
    return f"{name} ({', '.join(which)})" if which else name


def usable_cores() -> int:
    """Return the number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def hardware(device: str = "cpu") -> dict[str, Any]:
    """Return processor, cores, memory [GB], system and, for cuda, the accelerator's name."""
    facts: dict[str, Any] = {
        "processor": processor_name(),
        "cores": usable_cores(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "device": device,
    }
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        facts["memory_gb"] = round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9, 1)
    if device == "cuda":
        import torch

        facts["accelerator"] = torch.cuda.get_device_name()
    return facts


def hardware_line(facts: dict[str, Any]) -> str:
    """Return one short line for the hardware column of a row."""
    parts = (facts.get("accelerator"), f"{facts['processor']} ({facts['cores']} cores)")
    return ", ".join(part for part in parts if part)


def versions() -> dict[str, str]:
    """Return the installed version of each package that computes."""
    return {name: package_version(name) for name in PACKAGES}
