"""What a render refuses before it bakes, and what its files are called."""

from pathlib import Path

import pytest
from PIL import Image

from formats.errors import DamagedError, InputError, MachineError
from pipelines.cli import run
from pipelines.render_scene import render_scene

BIG = "9" * 5000  # more digits than Python turns into a number


@pytest.mark.parametrize(
    ("out", "options", "says"),
    [
        ("x.jpg", {}, "x.jpg"),
        ("x.GIF", {}, "movie"),
        ("x", {"frames": f"0:{BIG}"}, "--frames"),
        ("x", {"frames": "0:99999999999"}, "at most"),
        ("x", {"times": (1e300,)}, "--time"),
    ],
)
def test_nothing_is_baked_for_a_render_that_cannot_be(
    assets: Path, tmp_path: Path, out: str, options: dict[str, object], says: str
) -> None:
    build = tmp_path / "build"
    with pytest.raises(InputError, match=says):
        render_scene(
            assets / "scenes/plain.toml",
            tmp_path / out,
            build_folder=build,
            **options,  # type: ignore[arg-type]
        )
    assert not build.exists()


@pytest.mark.gpu
def test_times_close_together_get_files_of_their_own(assets: Path, tmp_path: Path) -> None:
    job = render_scene(
        assets / "scenes/plain.toml",
        tmp_path / "stills",
        size="8x8",
        times=(0.001, 0.0012, 0.001),
        build_folder=tmp_path / "build",
    )
    assert [f.name for f in job.files] == ["plain-000.0010.png", "plain-000.0012.png"]
    assert all(f.is_file() for f in job.files)


@pytest.mark.gpu
def test_a_movie_of_every_second_frame_lasts_as_long(assets: Path, tmp_path: Path) -> None:
    out = tmp_path / "m.GIF"
    render_scene(
        assets / "scenes/plain.toml",
        out,
        size="8x8",
        frames="0:4:2",
        build_folder=tmp_path / "build",
    )
    with Image.open(out) as movie:
        # 4 frames a second: two of them stand half a second each
        assert movie.info["duration"] == 500


@pytest.mark.gpu
def test_a_file_in_the_way_is_one_line(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "taken").write_text("mine")
    scene, out = assets / "scenes/plain.toml", tmp_path / "taken" / "x.png"
    flags = ["-o", out, "--size", "8x8", "--build", tmp_path / "build"]
    assert run([str(a) for a in ["render", scene, *flags]]) == 2
    said = capfd.readouterr().err
    assert "taken" in said
    assert said.count("\n") == 1


@pytest.mark.gpu
def test_a_picture_that_the_card_cannot_hold_is_a_machine_error(
    assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import moderngl

    def refuse(*_: object) -> None:
        raise moderngl.Error("the framebuffer is not complete")

    monkeypatch.setattr(moderngl.Context, "framebuffer", refuse)
    with pytest.raises(MachineError, match="smaller picture"):
        render_scene(
            assets / "scenes/plain.toml",
            tmp_path / "x.png",
            size="8x8",
            build_folder=tmp_path / "build",
        )


@pytest.mark.gpu
def test_an_asset_that_was_deleted_is_baked_again(
    assets: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    import shutil

    from runtime.player import Player

    scene, build = assets / "scenes/all.toml", tmp_path / "build"
    render_scene(scene, tmp_path / "a.png", size="8x8", build_folder=build)
    shutil.rmtree(build / "scenes/all/assets")
    with pytest.raises(DamagedError, match="missing"):
        Player(build / "scenes/all", size=(8, 8))
    render_scene(scene, tmp_path / "b.png", size="8x8", build_folder=build)
    assert "baking it again" in capfd.readouterr().err
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
