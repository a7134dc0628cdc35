"""How far fog moves the finished picture at most: at the farthest thing seen, of any brightness."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from formats import film_bounds
from formats.lens_bounds import UNKNOWN_REACH, Reports, balls, clouds
from formats.poses import WIDEST, cube_ball, mesh_balls, rays
from formats.scene import Fog, Scene

Array = NDArray[np.float64]
DEEPEST = 80.0  # of optical depth: nothing passes


def codes(scene: Scene, described: Fog, distance: float, low: float) -> float:
    """The most codes that fog moves anything within a distance, metres, not lower than y = low."""
    # The density where it is highest, all along the way
    thickest = np.exp(np.clip(-described.falloff * low, -DEEPEST, DEEPEST))
    density = float(described.extinction.extremes[1] * thickest)
    passing = float(np.exp(-min(DEEPEST, density * distance)))
    radiance = float(np.max(described.radiance.extremes[1]))
    return film_bounds.veiled(scene.picture.film, passing, radiance, scene.picture.bloom)


def reach(scene: Scene, reports: Reports) -> tuple[float, str, float]:
    """What is seen farthest away: metres, its name, and the lowest y of anything seen.

    Infinity where a ray may meet nothing: towards what is behind everything, and along the ground,
    a uniform fog lets nothing through at the horizon.
    """
    camera = scene.camera.position.values
    distance, what, low = 0.0, "nothing", float(camera[:, 1].min())
    box = np.stack([camera.min(axis=0), camera.max(axis=0)])
    for name, middles, radii in _balls(scene, reports):
        # No point of a keyed way is outside the box of its keys
        away = np.maximum(np.abs(middles - box[0]), np.abs(middles - box[1]))
        far = float((np.linalg.norm(away, axis=-1) + radii).max())
        low = min(low, float((middles[:, 1] - radii).min()))
        if far > distance:
            distance, what = far, name
    ground = _ground(scene)
    if ground is None:
        return np.inf, "the horizon", low
    low = min(low, scene.ground.height if scene.ground else low)
    return (ground, "the ground", low) if ground > distance else (distance, what, low)


def _balls(scene: Scene, reports: Reports) -> Iterator[tuple[str, Array, Array]]:
    for billboards in scene.billboards:
        found = balls(billboards, reports)
        if len(found.middles):
            yield f"a sprite of {billboards.name}", found.middles, found.radii
    yield from clouds(scene, reports)
    for name, middle, radius in mesh_balls(scene, reports, UNKNOWN_REACH):
        yield f"the mesh {name}", middle[None], np.array([radius])
    for middle, radius in cube_ball(scene, reports, UNKNOWN_REACH):
        yield "the cubes", middle[None], np.array([radius])


def _ground(scene: Scene) -> float | None:
    """Metres to the farthest ground seen where it fills the picture, None where it does not."""
    if hides_sky(scene):
        along, camera = rays(scene), scene.camera
        assert along is not None
        assert scene.ground is not None
        fall = scene.ground.height - float(camera.position.at(0.0)[1])
        slope = 0.5 * camera.sensor_height_mm / camera.focal_length_mm.extremes[0]
        return float(fall / min(along, key=abs) * np.hypot(1.0, slope * np.hypot(1.0, WIDEST)))
    return None


def hides_sky(scene: Scene) -> bool:
    """Whether the ground lies behind every pixel of a still camera: all rays go down to it."""
    along = rays(scene)
    if along is None or scene.ground is None or scene.force.get("ground") is False:
        return False
    fall = scene.ground.height - float(scene.camera.position.at(0.0)[1])
    # Single precision in the shader
    return (fall < -1e-4 and along[1] < -1e-4) or (fall > 1e-4 and along[0] > 1e-4)


def sees_ground(scene: Scene) -> bool:
    """Whether a ray of the camera may meet the plane of the ground."""
    along = rays(scene)
    if along is None or scene.ground is None:
        return scene.ground is not None
    fall = scene.ground.height - float(scene.camera.position.at(0.0)[1])
    return fall == 0.0 or (along[0] < 1e-4 if fall < 0.0 else along[1] > -1e-4)
