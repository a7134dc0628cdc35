"""Composition: includes, defines, line numbers, and the errors that keep flags honest."""

from __future__ import annotations

import pytest

from runtime.shader import HEADERS, Programs, ShaderError, compose, set_uniforms


@pytest.fixture
def shader(tmp_path):
    """Return write(name, text) -> path."""

    def write(name, text):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_includes_nest_and_come_once(shader):
    shader("inner.glsl", "float inner() { return 1.0; }\n")
    shader("outer.glsl", '#include "inner.glsl"\nfloat outer() { return inner(); }\n')
    text = '#include "inner.glsl"\n#include "outer.glsl"\nvoid main() {}\n'
    source = compose(shader("a.frag", text))
    assert source.text.count("float inner()") == 1
    assert source.text.index("float inner()") < source.text.index("float outer()")
    assert [f.name for f in source.files] == ["a.frag", "inner.glsl", "outer.glsl"]


def test_defines_are_written_in_order_and_typed(shader):
    path = shader("a.frag", "int a = N; float b = S;\n#if ON\n#endif\n")
    text = compose(path, {"S": 2.0, "N": 3, "ON": True}).text
    assert text.startswith(HEADERS["desktop"] + "#define N 3\n#define ON 1\n#define S 2.0\n")


def test_unknown_include_names_file_and_line(shader):
    with pytest.raises(ShaderError, match=r'a\.frag:2: unknown include "missing\.glsl"'):
        compose(shader("a.frag", '// first\n#include "missing.glsl"\n'))


def test_a_flag_that_no_line_mentions_is_an_error(shader):
    path = shader("a.frag", "// LENS is only spoken of\nvoid main() {}\n")
    with pytest.raises(ShaderError, match="flag LENS is given but never used"):
        compose(path, {"LENS": 1})


@pytest.mark.parametrize(
    "condition", ["#if LENS", "#if 0\n#elif LENS > 1", "# if defined(GL_ES) && LENS"]
)
def test_a_flag_that_is_tested_but_not_given_is_an_error(shader, condition):
    with pytest.raises(ShaderError, match="flag LENS is tested but not given"):
        compose(shader("a.frag", f"{condition}\n#endif\nvoid main() {{}}\n"))


def test_a_flag_defined_by_the_text_itself_is_known(shader):
    assert (
        "#if SIZE > 2" in compose(shader("a.frag", "#define SIZE 3\n#if SIZE > 2\n#endif\n")).text
    )


def test_the_same_text_is_composed_once(shader):
    path = shader("a.frag", "int n = N;\n")
    assert compose(path, {"N": 1}) is compose(path, {"N": 1})
    assert compose(path, {"N": 1}) is not compose(path, {"N": 2})


@pytest.mark.gpu
def test_compile_errors_name_the_included_file_and_its_line(ctx, shader):
    shader("broken.glsl", "float fine() { return 1.0; }\n\nfloat broken() { return absent; }\n")
    vertex = shader("v.vert", "void main() { gl_Position = vec4(0.0); }\n")
    fragment = shader(
        "f.frag", '#include "broken.glsl"\nout vec4 c;\nvoid main() { c = vec4(broken()); }\n'
    )
    with pytest.raises(ShaderError, match=r"broken\.glsl:3.*absent"):
        Programs(ctx).get(vertex, fragment)


@pytest.mark.gpu
def test_lines_after_an_include_keep_their_numbers(ctx, shader):
    shader("lib.glsl", "float one() { return 1.0; }\n" * 1)
    vertex = shader("v.vert", "void main() { gl_Position = vec4(0.0); }\n")
    fragment = shader(
        "f.frag", '#include "lib.glsl"\nout vec4 c;\nvoid main() {\n  c = vec4(absent);\n}\n'
    )
    with pytest.raises(ShaderError, match=r"f\.frag:4"):
        Programs(ctx).get(vertex, fragment)


@pytest.mark.gpu
def test_programs_are_linked_once_per_text(ctx, shader):
    vertex = shader("v.vert", "void main() { gl_Position = vec4(0.0); }\n")
    fragment = shader(
        "f.frag", "uniform vec3 u[2];\nout vec4 c;\nvoid main() { c = vec4(u[N], 1.0); }\n"
    )
    programs = Programs(ctx)
    first = programs.get(vertex, fragment, {"N": 1}, {})
    assert programs.get(vertex, fragment, {"N": 1}, {}) is first
    assert programs.get(vertex, fragment, {"N": 0}, {}) is not first
    assert programs.count == 2
    set_uniforms(first, {"u": [(1, 2, 3), (4, 5, 6)], "absent": 1.0})
    programs.release()
