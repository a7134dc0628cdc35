"""Making a context, and the one line that a machine without OpenGL gets."""

from __future__ import annotations

import os

import pytest

from formats.errors import MachineError
from runtime import capture

pytestmark = pytest.mark.gpu


def test_the_context_has_a_loader_of_raw_entry_points(ctx):
    assert capture.loader(ctx)("glTexImage3D") != 0


def test_the_loader_is_found_again_for_a_context_of_others(ctx):
    kept, ctx.extra = ctx.extra, None
    try:
        assert capture.loader(ctx)("glTexImage3D") != 0
    finally:
        ctx.extra = kept


def test_a_machine_without_opengl_is_told_what_to_install(monkeypatch):
    def refuse():
        raise OSError("libEGL.so.1 not loaded")

    monkeypatch.setattr(capture, "_headless", refuse)
    with pytest.raises(
        MachineError, match=r"apt-get install libegl1 libgl1 libgl1-mesa-dri"
    ) as caught:
        capture.make_context()
    assert caught.value.exit_code == 3
    assert "libEGL.so.1 not loaded" in str(caught.value)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (None, "no_aos_sampling"),
        ("no_rho_approx", "no_rho_approx,no_aos_sampling"),
        ("no_aos_sampling", "no_aos_sampling"),
    ],
)
def test_the_rasteriser_is_told_to_filter_in_float(monkeypatch, before, after):
    if before is None:
        monkeypatch.delenv("GALLIVM_PERF", raising=False)
    else:
        monkeypatch.setenv("GALLIVM_PERF", before)
    capture.prepare()
    assert os.environ["GALLIVM_PERF"] == after
