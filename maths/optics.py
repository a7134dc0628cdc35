"""The thin lens: circle of confusion on the sensor, in pixels, in texels, and as a level of detail.

Twins of the same names in `runtime/glsl/optics.glsl`.

References
----------
Potmesil, Chakravarty 1981, A Lens and Aperture Camera Model for Synthetic Image Generation.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def circle_of_confusion(
    distance: ArrayLike,
    focal_length: ArrayLike,
    f_number: ArrayLike,
    focus_distance: ArrayLike,
) -> NDArray[np.float64]:
    """Blur circle on the sensor, metres across: `A f |d - d_f| / (d (d_f - f))`, `A = f / N`.

    distance : (...) metres along the view axis, any value; nearer than the focal length (or behind
        the lens) counts as the focal length, where the circle is the aperture itself; infinity is
        allowed.
    focal_length : (...) metres, > 0.  f_number : (...) > 0.  focus_distance : (...) metres, beyond
        the focal length.
    Returns (...) metres in [0, A max(1, f / (d_f - f))], 0 at focus. Raises ValueError where a lens
    cannot be or a distance is NaN.

    >>> float(circle_of_confusion(2.0, 0.05, 2.0, 2.0))
    0.0
    >>> round(float(circle_of_confusion(np.inf, 0.05, 2.0, 1.05)), 6)  # A f / (d_f - f)
    0.00125
    """
    d, f, number, focus = (
        np.asarray(v, np.float64) for v in (distance, focal_length, f_number, focus_distance)
    )
    if np.any(np.isnan(d)):
        raise ValueError("The distance to a lens is not a number.")
    if not np.all((f > 0) & (number > 0) & np.isfinite(f) & np.isfinite(number)):
        raise ValueError("A lens needs a finite focal length and f-number above 0.")
    if not np.all((focus > f) & np.isfinite(focus)):
        raise ValueError("A lens focuses at a finite distance beyond its focal length.")
    aperture = f / number
    return np.asarray(aperture * f / (focus - f) * np.abs(1.0 - focus / np.maximum(d, f)))


def pixels(
    coc: ArrayLike, image_height: ArrayLike, sensor_height: ArrayLike
) -> NDArray[np.float64]:
    """Circle of confusion in pixels from metres on the sensor.

    coc : (...) metres.  image_height : pixels.  sensor_height : metres.

    >>> float(pixels(0.001, 720, 0.024))
    30.0
    """
    return np.asarray(
        np.asarray(coc, np.float64) * np.asarray(image_height) / np.asarray(sensor_height)
    )


def texels(
    coc: ArrayLike, distance: ArrayLike, focal_length: ArrayLike, metres_per_texel: ArrayLike
) -> NDArray[np.float64]:
    """Circle of confusion in texels of a sprite at `distance`, from metres on the sensor.

    A metre at distance d covers f / d metres of the sensor (the projection of
    `transforms.perspective`). coc, distance, focal_length, metres_per_texel : (...) metres.

    >>> round(float(texels(0.001, 5.0, 0.05, 0.01)), 9)
    10.0
    """
    d, f = np.asarray(distance, np.float64), np.asarray(focal_length, np.float64)
    return np.asarray(
        np.asarray(coc, np.float64) * np.maximum(d, f) / (f * np.asarray(metres_per_texel))
    )


def lod(
    coc_texels: ArrayLike, scale: ArrayLike, max_lod: ArrayLike = 1000.0
) -> NDArray[np.float64]:
    """Level of detail with a filter as wide as the circle: `clamp(log2(scale * coc), 0, max_lod)`.

    coc_texels : (...) diameter in texels of level 0, >= 0.  scale : fitted for the mip filter.
    max_lod : the coarsest level that may be asked for.

    >>> lod([0.0, 1.0, 8.0, 1e9], 1.0, 6.0).tolist()
    [0.0, 0.0, 3.0, 6.0]
    """
    wide = np.maximum(np.asarray(coc_texels, np.float64) * np.asarray(scale), 1.0)
    return np.asarray(np.minimum(np.log2(wide), max_lod))


def vertical_field_of_view(focal_length: float, sensor_height: float) -> float:
    """Angle that the sensor's height sees, radians: `2 atan(h / 2f)`; lengths in one unit.

    >>> round(float(np.degrees(vertical_field_of_view(50.0, 24.0))), 2)
    26.99
    """
    return float(2.0 * np.arctan2(0.5 * sensor_height, focal_length))
