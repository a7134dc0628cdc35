"""How many objects live on the card, by asking OpenGL about each name."""

from __future__ import annotations

import ctypes
import gc
from typing import Any

from runtime.capture import loader

KINDS = ("Texture", "Buffer", "Framebuffer", "Renderbuffer", "VertexArray", "Program", "Shader")
NAMES = 20_000  # beyond any name that a test gives out


def counted(context: Any) -> dict[str, int]:
    """Kind -> objects alive on a context that is current."""
    gc.collect()
    load = loader(context)
    found = {}
    for kind in KINDS:
        ask = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(load(f"glIs{kind}"))
        found[kind] = sum(bool(ask(name)) for name in range(1, NAMES))
    return found
