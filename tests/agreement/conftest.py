"""Runs a GLSL function over arrays on the card, for comparison with its numpy twin."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.shader import compose

SUFFIX = {1: "", 2: "2", 3: "3", 4: "4"}


@pytest.fixture(scope="session")
def context():
    """One headless context for the whole run."""
    from runtime.capture import make_context

    made = make_context()
    # A context without a surface has no default framebuffer, and draws nowhere without one
    made.extra["nowhere"] = made.simple_framebuffer((1, 1))
    yield made
    made.release()


@pytest.fixture(autouse=True)
def drawing_nowhere(request):
    """Bind a framebuffer for each test on the card: what the one before left bound is freed."""
    if "context" in request.fixturenames:
        context = request.getfixturevalue("context")
        context.__enter__()
        context.extra["nowhere"].use()


@pytest.fixture
def glsl(context, tmp_path):
    """Return evaluate(libraries, expression, inputs, components, defines) -> (n,) or (n, c).

    inputs : name -> (n,) or (n, c) floats, or (n,) unsigned integers; `expression` uses those
    names. The function runs once a vertex, and transform feedback brings its value back.
    """
    # Players of other tests have made contexts of their own current
    context.__enter__()
    context.extra["nowhere"].use()
    assert context.error == "GL_NO_ERROR"

    def evaluate(libraries, expression, inputs, components=1, defines=None):
        libraries = [libraries] if isinstance(libraries, str) else libraries
        arrays = {k: np.ascontiguousarray(np.asarray(v)) for k, v in inputs.items()}
        declared, content = [], []
        for name, values in arrays.items():
            whole = values.dtype.kind in "ui"
            c = 1 if values.ndim == 1 else values.shape[1]
            kind = "uint" if whole else "float" if c == 1 else f"vec{c}"
            declared.append(f"in {kind} {name};")
            raw = values.astype("u4" if whole else "f4").tobytes()
            content.append((context.buffer(raw), f"{c}{'u' if whole else 'f'}", name))
        out = "float" if components == 1 else f"vec{components}"
        text = "\n".join(
            [f'#include "{library}.glsl"' for library in libraries]
            + declared
            + [f"out {out} value;", "void main() {", f"value = {expression};", "}"]
        )
        path = tmp_path / f"f{abs(hash(text))}.vert"
        path.write_text(text)
        program = context.program(vertex_shader=compose(path, defines).text, varyings=["value"])
        n = len(next(iter(arrays.values())))
        result = context.buffer(reserve=4 * components * n)
        array = context.vertex_array(program, [c for c in content if c[2] in program])
        array.transform(result, mode=context.POINTS, vertices=n)
        found = np.frombuffer(result.read(), np.float32).reshape(n, components)
        for made in (array, program, result, *(buffer for buffer, _, _ in content)):
            made.release()
        return found[:, 0] if components == 1 else found

    yield evaluate
    assert context.error == "GL_NO_ERROR"
