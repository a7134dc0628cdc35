"""Golden frames: a tiny scene with every effect, against the pictures of tests/images.

BAKELIGHT_REGENERATE=1 writes them again, on purpose and with a line in the changelog.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from formats.files import image
from pipelines.render_scene import render_scene

GOLDEN = Path(__file__).parents[1] / "images"
# Other versions of Mesa round filtered texels and edges otherwise: two codes, and a pixel in five
# hundred along the silhouettes, where a sample falls on the other side of an edge
CODES, SHARE = 2, 1 / 500


@pytest.mark.gpu
@pytest.mark.parametrize("scene", ["plain", "all"])
def test_frame_is_the_golden_one(assets: Path, tmp_path: Path, scene: str) -> None:
    out, golden = tmp_path / f"{scene}.png", GOLDEN / f"{scene}.png"
    path = assets / "scenes" / f"{scene}.toml"
    job = render_scene(path, out, size="96x54", times=(0.5,), build_folder=tmp_path / "build")
    found = np.asarray(image.read(out, space="stored") * 255).astype(np.int64)
    if os.environ.get("BAKELIGHT_REGENERATE"):
        GOLDEN.mkdir(exist_ok=True)
        golden.write_bytes(out.read_bytes())
    if "llvmpipe" not in job.profile["renderer"]:
        assert found.std() > 5
        return
    expected = np.asarray(image.read(golden, space="stored") * 255).astype(np.int64)
    off = np.abs(found - expected).max(axis=-1) > CODES
    if off.mean() > SHARE:
        amplified = np.clip(np.abs(found - expected) * 8, 0, 255)
        row = np.concatenate([expected, found, amplified], axis=1).astype(np.uint8)
        Image.fromarray(row).save(tmp_path / "expected-found-difference.png")
    assert off.mean() <= SHARE, f"see {tmp_path / 'expected-found-difference.png'}"
