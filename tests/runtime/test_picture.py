"""What a notebook is given: bytes that decode to the frame, and movies that last as asked."""

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from runtime.picture import Movie, Picture
from runtime.player import Player


def test_a_picture_is_png_array_and_file(rng, tmp_path):
    codes = rng.integers(0, 256, (5, 7, 4), np.uint8)[..., :3]  # not contiguous
    picture = Picture(codes)
    shown = np.asarray(Image.open(io.BytesIO(picture._repr_png_())))
    assert np.array_equal(shown, codes)
    assert np.array_equal(np.asarray(picture), codes)
    assert np.asarray(picture, np.float32).dtype == np.float32
    assert np.array_equal(np.asarray(Image.open(picture.save(tmp_path / "a.png"))), codes)
    assert repr(picture) == "<Picture 7x5>"


def test_a_movie_is_an_animated_picture_of_a_page(rng, tmp_path):
    frames = [np.full((6, 8, 3), 40 * n, np.uint8) for n in range(5)]
    movie = Movie(frames, 24.0)
    data = re.search(r'base64,([^"]+)"', movie._repr_html_())[1]
    assert base64.b64decode(data) == movie.data == movie.save(tmp_path / "a.webp").read_bytes()
    with Image.open(io.BytesIO(movie.data)) as opened:
        assert opened.n_frames == 5
        times = []
        for n in range(5):
            opened.seek(n)
            # Flat grey at quality 80: measured within 2 codes
            assert abs(int(np.asarray(opened.convert("L"))[3, 4]) - 40 * n) <= 4
            times.append(opened.info["duration"])
    assert sum(times) == round(5000 / 24)


@pytest.mark.gpu
def test_a_player_returns_them(kit, write_scene, ctx):
    folder = write_scene(kit.scene_dict(), {"ball": kit.sphere_asset()})
    with Player(folder, size=(16, 9), context=ctx) as player:
        picture, movie = player.picture(0.0), player.movie([0.0, 0.5])
        assert np.array_equal(picture, player.frame(0.0)[..., :3])
        assert (movie.count, movie.size) == (2, (16, 9))
        assert movie.rate == player.scene.time.frame_rate
