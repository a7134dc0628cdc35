"""A graphics context without a window: EGL, software or hardware."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from formats.errors import MachineError

REMEDY = "apt-get install libegl1 libgl1 libgl1-mesa-dri"


def make_context() -> Any:
    """Return a headless `moderngl.Context` of OpenGL 3.3 core or later.

    The loader of raw entry points is kept as `context.extra["load"]` for runtime.upload.
    Raises MachineError with the packages to install where no context can be made.
    """
    prepare()
    import moderngl

    try:
        backend = _headless()
        context = moderngl.create_context(context=backend)
    except Exception as error:
        raise MachineError(
            "OpenGL", "no context", f"{type(error).__name__}: {error}", REMEDY
        ) from None
    context.extra = {"load": backend.load}
    return context


def prepare() -> None:
    """Make Mesa's software rasteriser filter 8-bit textures in float; call before any context.

    By default llvmpipe filters RGBA8 in 8-bit fixed point, 5.6/255 off in a shadow pass.
    """
    flags = [f for f in os.environ.get("GALLIVM_PERF", "").split(",") if f]
    if "no_aos_sampling" not in flags:
        os.environ["GALLIVM_PERF"] = ",".join([*flags, "no_aos_sampling"])


def _headless() -> Any:
    # Name the libraries: searching for them starts ldconfig and costs tens of milliseconds
    from glcontext import egl

    index = int(os.environ.get("GLCONTEXT_DEVICE_INDEX", "0"))
    return egl.create_context(
        mode="standalone",
        glversion=330,
        libgl="libGL.so.1",
        libegl="libEGL.so.1",
        device_index=index,
    )


class Window:
    """A context that a window toolkit has made current, as moderngl wants it.

    load : its function from a name to the address of an entry point.
    """

    def __init__(self, load: Callable[[str], int | None]) -> None:
        self._load = load

    def load(self, name: str) -> int:
        """Return the address of an entry point, 0 where there is none."""
        return self._load(name) or 0

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing: the window owns its context."""

    def release(self) -> None:
        """Nothing: the window owns its context."""


def window_context(load: Callable[[str], int | None]) -> Any:
    """Return a `moderngl.Context` on the OpenGL context that a window has made current."""
    import moderngl

    backend = Window(load)
    context = moderngl.create_context(context=backend)
    context.extra = {"load": backend.load}
    return context


def loader(context: Any) -> Callable[[str], int]:
    """Return `load(name) -> address` of a context of ours, or of the one that is current in EGL."""
    extra = context.extra
    if isinstance(extra, dict) and "load" in extra:
        found: Callable[[str], int] = extra["load"]
        return found
    import ctypes

    try:
        address = ctypes.CDLL("libEGL.so.1").eglGetProcAddress
    except OSError as error:
        remedy = "make the context with runtime.capture, or install libegl1"
        raise MachineError("OpenGL", "context", str(error), remedy) from None
    address.restype, address.argtypes = ctypes.c_void_p, (ctypes.c_char_p,)
    return lambda name: address(name.encode()) or 0
