"""What this machine is, and whether bakes and pictures on it are what they should be."""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from formats.errors import BakelightError
from pipelines.hard import matrix
from pipelines.hard.cells import Outcome

LIBRARIES = (
    "numpy",
    "scipy",
    "embreex",
    "trimesh",
    "OpenEXR",
    "PIL",
    "zstandard",
    "moderngl",
    "glfw",
)
LIMITS = (
    ("texture side", "GL_MAX_TEXTURE_SIZE", 8192), ("layers", "GL_MAX_ARRAY_TEXTURE_LAYERS", 256),
    ("volume side", "GL_MAX_3D_TEXTURE_SIZE", 256),
    ("texture units", "GL_MAX_TEXTURE_IMAGE_UNITS", 16),
)  # fmt: skip
"""Name, OpenGL's name, and the least that scenes of ours use."""
CHECKS = (
    ("CPU against GPU: twins of shaders", ("R1", "R2", "R3", "R4", "R5", "R6")),
    ("uploads, byte for byte", ("T10",)),
    ("white furnace, baked", ("V6",)),
    ("white furnace, on the card", ("V6c",)),
    ("leaks through closed meshes", ("G9",)),
    ("8-bit ladders", ("C8", "C9", "C14", "T12")),
)


def facts(folder: Path) -> dict[str, Any]:
    """Return what the machine is; free disk is that of `folder`."""
    from bake import machine, workers

    place = next(p for p in (folder.resolve(), *folder.resolve().parents) if p.exists())
    free = shutil.disk_usage(place).free
    return {
        "system": platform.platform(),
        "class": machine.name(),
        "cores": os.cpu_count() or 1,
        "threads": workers.count(),
        "free_gigabytes": round(free / 1e9, 1),
        "libraries": machine.versions(LIBRARIES),
        "opengl": _opengl(),
    }


def _opengl() -> dict[str, Any]:
    """Return driver and limits, or why there is no OpenGL."""
    from pipelines.hard.card import context

    try:
        ctx = context()
    except BakelightError as error:
        return {"error": str(error)}
    info = ctx.info
    renderer = str(info["GL_RENDERER"])
    return {
        "vendor": info["GL_VENDOR"],
        "renderer": renderer,
        "version": info["GL_VERSION"],
        "software": any(
            word in renderer.lower() for word in ("llvmpipe", "softpipe", "swiftshader")
        ),
        "limits": {name: int(info[key]) for name, key, _ in LIMITS if key in info},
    }


def run(told: dict[str, Any], progress: Callable[[int, int, str], None] | None) -> list[Outcome]:
    """Run the quick cells of the matrix; those of the card only where there is one."""
    card = "error" not in told["opengl"]
    return matrix.run([c for c in matrix.cells(slow=False) if card or not c.card], progress)


def short(told: dict[str, Any]) -> list[str]:
    """Return the limits of the driver that are below what scenes may use."""
    limits = told["opengl"].get("limits", {})
    return [f"{name} {limits[name]}, below {least}" for name, _, least in LIMITS
            if name in limits and limits[name] < least]  # fmt: skip


def checks(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Return the named checks: how many cells, how many failed, the value nearest to its bound."""
    from pipelines.hard.cubes import leak

    found = []
    for name, rows in CHECKS:
        chosen = [o for o in outcomes if o.cell.row.name in rows]
        if not chosen:
            continue
        nearest = max(chosen, key=lambda o: (o.result.value or 0) / (o.result.bound or 1)).result
        failed = sum(not o.result.good for o in chosen)
        found.append({"check": name, "cells": len(chosen), "failed": failed,
                      "value": nearest.value, "bound": nearest.bound})  # fmt: skip
    share = abs(leak())
    found.append({"check": "leak meter: share of rays lost in cubes", "cells": 1,
                  "failed": int(share > 5e-7), "value": share, "bound": 5e-7})  # fmt: skip
    return found


def lines(told: dict[str, Any], found: list[dict[str, Any]], outcomes: list[Outcome]) -> list[str]:
    """Return what a person reads."""
    gl = told["opengl"]
    if "error" in gl:
        driver = f"none: {gl['error']}"
    else:
        driver = f"{gl['version']}, {gl['renderer']}" + (" (software)" if gl["software"] else "")
    versions = ", ".join(f"{k} {v or 'not installed'}" for k, v in told["libraries"].items())
    text = [
        f"system      {told['system']}",
        f"cores       {told['cores']}, {told['threads']} threads bake",
        f"disk        {told['free_gigabytes']} GB free",
        f"libraries   {versions}",
        f"OpenGL      {driver}",
    ]
    if "limits" in gl:
        text.append("limits      " + ", ".join(f"{k} {v}" for k, v in gl["limits"].items()))
    text += [f"warning     {line}" for line in short(told)]
    text += ["", f"{'check':42}{'cells':>6}{'worst':>10}{'bound':>10}"]
    for row in found:
        value, bound = ("" if x is None else f"{x:.2g}" for x in (row["value"], row["bound"]))
        word = f"   {row['failed']} FAILED" if row["failed"] else ""
        text.append(f"{row['check']:42}{row['cells']:6}{value:>10}{bound:>10}{word}")
    counts = matrix.counts(outcomes)
    rows = len({o.cell.row.name for o in outcomes})
    seconds = sum(o.seconds for o in outcomes)
    text += [
        "",
        f"hard cases: {rows} rows, {len(outcomes)} cells: {counts['ok']} within bound, "
        f"{counts['refused']} refused in one line, {counts['failed']} failed; {seconds:.0f} s",
    ]
    text += [f"  FAILED {o.cell.name}: {o.result.said or o.result.value}" for o in outcomes
             if not o.result.good]  # fmt: skip
    return text
