"""Colours and materials of a .vox file.

Index 0 is empty; a file's first colour has index 1. What glows: a material of type `_emit`, with

    radiance = colour * weight * 10^flux

colour linear, weight `_emit` (`_weight` in older files; 1 where neither is given), flux `_flux` (0
where it is not given), in W/(m2 sr) times a scale that the user chooses. The editor's renderer has
no unit and no published formula; a step of its power slider, 0 to 4, makes light about ten times
as strong. `_ldr` only says how bright the camera shows the cell, and so does not count. Other types
keep `_emit` and `_flux` from earlier edits: they do not glow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.files.vox_chunks import Cursor

COLOURS = 256
LARGEST = 1e6
"""Largest number in a material."""
STRONGEST_FLUX = 8.0
"""Largest power of ten, and smallest negative one."""

_TYPES = ("_diffuse", "_metal", "_glass", "_emit")  # numbers of MATT
_OLD_POWER_BIT, _OLD_STEPS = 5, 4.0  # its power is normalised: 1 is the slider's end


@dataclass(frozen=True)
class Material:
    """type : `_diffuse`, `_metal`, `_glass`, `_emit`, `_blend`, `_media`, or what a file says.

    weight : of the emission, 0 to 1. flux : power of ten of the emission.
    """

    type: str = "_diffuse"
    weight: float = 0.0
    flux: float = 0.0

    @property
    def emission(self) -> float:
        """Radiance over linear colour: 0 for what does not glow."""
        return self.weight * 10**self.flux if self.type == "_emit" else 0.0


def default() -> NDArray[np.uint8]:
    """Return the palette (256, 4) of files that hold none; row 0 is empty.

    A cube of six steps a channel, blue fastest, without black, then ten steps of red, of green, of
    blue and of grey.
    """
    steps = np.arange(255, -1, -51)
    cube = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)[:-1]
    # Ramps have the multiples of 17 that the cube lacks
    ramp = np.array([17 * k for k in range(14, 0, -1) if k % 3])
    palette = np.zeros((COLOURS, 4), np.uint8)
    palette[1:216, :3] = cube
    for part, channels in enumerate(([0], [1], [2], [0, 1, 2])):
        palette[216 + 10 * part : 226 + 10 * part, channels] = ramp[:, None]
    palette[1:, 3] = 255
    return palette


def colours(cursor: Cursor) -> NDArray[np.uint8]:
    """Read a chunk RGBA: the palette (256, 4), black where the file has fewer colours.

    Row 0 is empty, and a file's 256th colour is never used.
    """
    stored = np.frombuffer(cursor.rest(), np.uint8).reshape(-1, 4)
    if not 0 < len(stored) <= COLOURS:
        raise ValueError(f"the palette has {len(stored)} colours")
    palette = np.zeros((COLOURS, 4), np.uint8)
    palette[1 : len(stored) + 1] = stored[: COLOURS - 1]
    return palette


def shown(cursor: Cursor) -> NDArray[np.uint8] | None:
    """Read a chunk IMAP: (256,) stored indices in the order in which the editor shows them.

    Index i + 1 of the editor is index `map[i]` of the file; the empty one is last. Returned by the
    editor's index, so that `palette[shown]` is the palette as shown. None where it is no
    reordering.
    """
    order = np.roll(np.frombuffer(cursor.bytes(COLOURS), np.uint8), 1)
    whole = np.array_equal(np.sort(order), np.arange(COLOURS)) and order[0] == 0
    return order if whole else None


def material(cursor: Cursor) -> tuple[int, Material]:
    """Read a chunk MATL: the stored index, and the material. Unknown keys are left out."""
    index, table = cursor.integer(), cursor.table()
    if not 0 <= index <= COLOURS:
        raise ValueError(f"a material has the index {index}")
    kind = table.get("_type", "_diffuse")
    weight = _number(table, "_emit" if "_emit" in table else "_weight", 1.0)
    flux = _number(table, "_flux", 0.0)
    return index % COLOURS, checked(
        Material(kind, weight, flux) if kind == "_emit" else Material(kind)
    )


def old_material(cursor: Cursor) -> tuple[int, Material]:
    """Read a chunk MATT, which older files have; its power from 0 to 1 counts as a flux to 4."""
    index, kind = cursor.integers(2)
    weight, bits = cursor.real(), cursor.integer()
    if not (0 < index < COLOURS and 0 <= kind < len(_TYPES)):
        raise ValueError(f"a material has the index {index} and the type {kind}")
    values = {bit: cursor.real() for bit in range(7) if bits >> bit & 1}
    flux = _OLD_STEPS * values.get(_OLD_POWER_BIT, 0.0)
    name = _TYPES[kind]
    return index, checked(Material(name, weight, flux) if name == "_emit" else Material(name))


def checked(found: Material) -> Material:
    """Return the material; ValueError where its numbers are out of range."""
    if not (0 <= found.weight <= LARGEST and abs(found.flux) <= STRONGEST_FLUX):
        raise ValueError(f"a material has the emission {found.weight} and the power {found.flux}")
    return found


def _number(table: dict[str, str], key: str, otherwise: float) -> float:
    value = float(table.get(key, otherwise))
    if not math.isfinite(value):
        raise ValueError(f"{key} of a material is {value}")
    return value
