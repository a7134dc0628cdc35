"""`relight` of domes and rings: light adds up, maps are their suns, coverage is the alpha."""

from pathlib import Path

import numpy as np
import pytest

from formats import report, seal
from formats.errors import InputError
from formats.files import exr, rgbe
from maths.sampling import fibonacci_sphere
from maths.transforms import latlong_direction, latlong_uv
from pipelines import relit, single
from pipelines.cli import cli, run
from tests.runtime import domes
from tests.runtime.conftest import sphere_asset

single.add_to(cli)
SUN, OTHER = relit.parse_light("0.3,0.4,0.8,1,2,3"), relit.parse_light("-2,1,1")


def sealed(asset: object, folder: Path) -> Path:
    """Save an asset as the store does."""
    folder.mkdir()
    asset.save(folder)  # type: ignore[attr-defined]
    seal.seal(folder)
    return folder


@pytest.fixture(params=["dome", "ring"])
def sprite(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A matt ball under either kind of lights."""
    asset = domes.matt_ball(size=32, views=2) if request.param == "dome" else sphere_asset(size=32)
    return sealed(asset, tmp_path / request.param)


@pytest.fixture
def dome(tmp_path: Path) -> Path:
    return sealed(domes.matt_ball(size=32), tmp_path / "matt")


def radiance(directions: np.ndarray) -> np.ndarray:
    """A smooth sky, 0.3 to 2, brightest to the upper left in front."""
    x, y, z = np.moveaxis(directions, -1, 0)
    warm = 1 + 0.5 * y - 0.3 * x + 0.2 * z * y
    return np.stack([warm, 1 + 0.4 * y, 1 - 0.3 * z], axis=-1)


def sky(height: int) -> np.ndarray:
    u, v = (np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height
    return radiance(latlong_direction(np.stack(np.meshgrid(u, v), axis=-1)))


def test_two_lights_are_the_sum_of_each(sprite: Path) -> None:
    """Before the clamp at 0, exactly; after it, wherever neither picture was clamped."""
    maps = [sky(16)]
    apart = [
        relit.relight(sprite, [SUN], clamped=False),
        relit.relight(sprite, [OTHER], clamped=False),
        relit.relight(sprite, [], maps, clamped=False),
    ]
    together = relit.relight(sprite, [SUN, OTHER], maps, clamped=False)
    total = np.sum(apart, axis=0, dtype=np.float64)[..., :3]
    # Four roundings to float32 of values up to the largest
    limit = 4 * 2.0**-24 * max(np.abs(p).max() for p in [*apart, together])
    np.testing.assert_allclose(together[..., :3], total, rtol=0, atol=limit)
    shown = relit.relight(sprite, [SUN, OTHER], maps)
    np.testing.assert_array_equal(shown, np.maximum(together, 0))
    assert apart[1].min() < 0 <= shown.min()
    assert shown[..., :3].max() > 0.5


def test_a_map_is_its_quadrature_by_a_thousand_suns(dome: Path) -> None:
    count = 1000
    d = fibonacci_sphere(count)
    power = radiance(d) * (4 * np.pi / count)
    suns = relit.relight(dome, list(zip(d, power, strict=True)), clamped=False)
    found = relit.relight(dome, [], [sky(128)], clamped=False)
    # The points see the kinks of the fade at the horizon; 128 rows of the map hold it to 6e-5
    np.testing.assert_allclose(found, suns, rtol=0, atol=ERROR * found[..., :3].max())
    assert found[..., :3].max() > 0.3


# Of the brightest pixel, measured 9.6e-5 (4,000 suns: 5.8e-5, 250: 5.1e-4)
ERROR = 2e-4


def test_coverage_is_the_alpha_and_the_border_is_cut(dome: Path, tmp_path: Path) -> None:
    asset = domes.matt_ball(size=32)
    picture = relit.relight(dome, [SUN])
    np.testing.assert_array_equal(picture[..., 3], asset.alpha())
    assert np.all(picture[picture[..., 3] == 0] == 0)
    assert 0.2 < picture[..., 3].mean() < 0.6
    bordered = domes.matt_ball(size=32, views=2)
    bordered.quality["border"] = 3
    folder = sealed(bordered, tmp_path / "bordered")
    del bordered.quality["border"]
    front, second = (relit.relight(folder, [SUN], view=v) for v in (0, 1))
    np.testing.assert_allclose(front, picture[3:-3, 3:-3], atol=1e-6)
    lit = front[..., 0] > 0.05
    # The second side is two thirds as light, to a code of 8 bits in each channel
    np.testing.assert_allclose(second[lit][:, 0], front[lit][:, 0] * 2 / 3, atol=0.01)
    with pytest.raises(InputError, match="--view"):
        relit.relight(folder, [SUN], view=2)


def test_padding_of_mip_levels_is_cut_where_the_size_is_told(sprite: Path) -> None:
    whole = relit.relight(sprite, [SUN])
    data = report.read(sprite)
    data["quality"] |= {"border": 2, "size": [17, 11]}
    (sprite / "seal.json").unlink()
    report.write(sprite, data)
    np.testing.assert_array_equal(relit.relight(sprite, [SUN]), whole[2:13, 2:19])


def test_stored_codes_refuse_sums_and_maps(tmp_path: Path) -> None:
    folder = sealed(domes.matt_ball(size=16, space="stored", coverage=False), tmp_path / "stored")
    assert np.all(relit.relight(folder, [SUN])[..., 3] == 1)
    for lights, maps in (([SUN, OTHER], []), ([SUN], [sky(4)]), ([], [sky(4)])):
        with pytest.raises(InputError, match="--space linear"):
            relit.relight(folder, lights, maps)


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
def test_the_command_takes_maps(
    dome: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], suffix: str
) -> None:
    """A bright spot in a map, turned and scaled, is a sun there."""
    image = np.full((32, 64, 3), 0.0, np.float32)
    image[10, 22:24] = [4.0, 2.0, 1.0]
    source = tmp_path / f"map, one{suffix}"
    if suffix == ".hdr":
        rgbe.write(source, image)
    else:
        exr.write(source, {"map": image})
    out = tmp_path / "lit.exr"
    command = ["relight", str(dome), "--environment", f"{source},2.5,-220", "--exposure", "0"]
    assert run([*command, "-o", str(out)]) == 0
    capfd.readouterr()
    # Counter-clockwise from above by -220 degrees: u grows clockwise as it is seen from above
    turned = relit.parse_environment(f"{source},2.5,-220")
    towards = latlong_direction(np.array([23 / 64 + 220 / 360, 10.5 / 32]))
    row, column = np.unravel_index(turned.sum(axis=2).argmax(), turned.shape[:2])
    assert latlong_uv(towards) * [64, 32] == pytest.approx([column + 0.5, row + 0.5], abs=1.0)
    found = exr.read(out)["beauty"][..., :3]
    expected = relit.relight(dome, [], [turned])[..., :3]
    # Half floats
    np.testing.assert_allclose(found, expected, rtol=2.0**-10, atol=1e-6)
    assert expected.max() > 0.005


def test_maps_are_turned_as_those_of_a_scene() -> None:
    """`rotate` of a light and ROTATE turn a map alike: the player's yaw of - rotate."""
    from bake import environment
    from maths.hemispherical_lights import project_environment

    image = sky(64).astype(np.float32)
    params = environment.Params(width=128, rotate=np.radians(67.5))
    turned = environment.resample(image, params=params).radiance
    seen = project_environment(image, 4, yaw=-np.radians(67.5))
    # 67.5 degrees are 24 whole texels
    np.testing.assert_allclose(project_environment(turned, 4), seen, atol=1e-5)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("none.hdr", "no such file"),
        ("none.hdr,2", "no such file"),
        ("none.hdr,-1", "--environment"),
        ("none.hdr,1,400", "--environment"),
        ("none.hdr,x", "--environment"),
        ("none.hdr,nan", "--environment"),
        ("", "no such file"),
    ],
)
def test_maps_that_are_none(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        relit.parse_environment(text)


def test_no_light_at_all_is_one_line(
    dome: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["relight", str(dome), "-o", str(tmp_path / "x.png")]) == 2
    said = capfd.readouterr().err.strip()
    assert "--environment" in said
    assert said.count("\n") == 0
