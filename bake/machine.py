"""The libraries and the machine that a baked result depends on; nothing heavy is imported."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable
from functools import cache

# Where the distribution is not called what the import is
DISTRIBUTIONS = {
    "PIL": "pillow",
    "cv2": "opencv-python",
    "png": "pypng",
    "skimage": "scikit-image",
    "sklearn": "scikit-learn",
}

# Settings that choose other kernels, hence other bits
KERNEL_SETTINGS = ("OPENBLAS_CORETYPE", "MKL_CBWR", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES")


def versions(libraries: Iterable[str]) -> dict[str, str | None]:
    """Return the version of each library, by the name it is imported by; None if not installed."""
    return {library: _version(DISTRIBUTIONS.get(library, library)) for library in libraries}


@cache
def _version(distribution: str) -> str | None:
    known = _installed().get(_normal(distribution))
    if known:
        return known
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


@cache
def _installed() -> dict[str, str]:
    """Read versions off the names of dist-info folders (PEP 427): importlib.metadata does that as
    well, but takes 35 ms to import."""
    found: dict[str, str] = {}
    for place in sys.path:
        if not os.path.isdir(place):
            continue
        for entry in os.listdir(place):
            stem, _, suffix = entry.rpartition(".")
            distribution, dash, version = stem.partition("-")
            if suffix == "dist-info" and dash:
                found.setdefault(_normal(distribution), version)
    return found


def _normal(distribution: str) -> str:
    """Spell a distribution as PEP 503 does."""
    return re.sub(r"[-_.]+", "-", distribution).lower()


@cache
def name() -> str:
    """Name the class of machine within which the same bake gives the same bits.

    OpenBLAS chooses its kernels by the processor's maker and vector units, numpy by the latter;
    both take some functions from the C library.
    """
    libc = os.confstr("CS_GNU_LIBC_VERSION") if sys.platform == "linux" else None
    settings = [f"{key}={os.environ[key]}" for key in KERNEL_SETTINGS if key in os.environ]
    python = f"python {sys.version_info.major}.{sys.version_info.minor}"
    architecture = os.uname().machine if hasattr(os, "uname") else ""
    return " ".join([python, sys.platform, architecture, libc or "", *_processor(), *settings])


def _processor() -> list[str]:
    """Return maker, family and vector units from Linux's first processor."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            lines = file.read(8192).split("\n\n")[0].splitlines()
    except OSError:
        return []
    facts = {key.strip(): value.strip() for key, _, value in (x.partition(":") for x in lines)}
    flags = (facts.get("flags") or facts.get("Features") or "").split()
    units = [f for f in flags if f.startswith(("avx", "fma", "sse4", "amx", "asimd", "sve"))]
    return [facts.get("vendor_id", ""), facts.get("cpu family", ""), *sorted(units)]
