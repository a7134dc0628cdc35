"""Clay: triangles of one plant gathered by material, and the shapes that are pressed into it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from formats.files.glb import Material, Node, Primitive

Array = NDArray[np.float64]
LARGEST_INDEX = 65535


def unit(vectors: Array) -> Array:
    """Vectors (..., 3) scaled to length one; a null vector becomes +y."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), vectors.shape)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), up)


def across(directions: Array, reference: Array) -> Array:
    """Unit vectors (..., 3) across unit `directions`, as near to `reference` as can be."""
    directions, reference = np.broadcast_arrays(directions, reference)
    flat = reference - directions * np.sum(reference * directions, axis=-1, keepdims=True)
    short = np.linalg.norm(flat, axis=-1, keepdims=True) < 1e-6
    spare = np.where(np.abs(directions[..., :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    spare = spare - directions * np.sum(spare * directions, axis=-1, keepdims=True)
    return unit(np.where(short, spare, flat))


@dataclass
class Clay:
    """Triangles by material name: positions in metres, ground point at the origin, +y up."""

    double_sided: frozenset[str] = frozenset({"leaf", "paper"})
    parts: dict[str, list[tuple[Array, Array, Array, NDArray[np.int64]]]] = field(
        default_factory=dict
    )

    def press(
        self, part: str, positions: Array, normals: Array, colours: Array, triangles: Array
    ) -> None:
        """Add vertices (n, 3), unit normals (n, 3), linear albedo (n, 3) and triangles (m, 3).

        Nothing stays under the ground; triangles without area are dropped."""
        positions = np.maximum(positions, [-np.inf, 0.0, -np.inf])
        triangles = np.asarray(triangles, dtype=np.int64)
        a, b, c = (positions[triangles[:, k]] for k in range(3))
        triangles = triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9]
        colours = np.broadcast_to(colours, positions.shape)
        self.parts.setdefault(part, []).append((positions, normals, colours, triangles))

    def nodes(self, name: str) -> list[Node]:
        """One node with a primitive for each material and each 65,535 vertices."""
        primitives: list[Primitive] = []
        for part in sorted(self.parts):
            material = Material(
                name=part,
                base_color=(1.0, 1.0, 1.0, 1.0),
                roughness=0.9,
                double_sided=part in self.double_sided,
            )
            for block in _blocks(self.parts[part]):
                positions, normals, colours, triangles = block
                code = np.rint(np.clip(colours, 0.0, 1.0) * 255.0).astype(np.uint8)
                alpha = np.full((len(code), 1), 255, np.uint8)
                # Rounding to 0.1 mm hides the last bits in which machines' sines differ.
                primitives.append(
                    Primitive(
                        positions=(np.round(positions, 4) + 0.0).astype(np.float32),
                        indices=triangles.astype(np.uint16),
                        normals=(np.round(unit(normals), 3) + 0.0).astype(np.float32),
                        colours=np.concatenate([code, alpha], axis=1),
                        material=material,
                    )
                )
        return [Node(name=name, primitives=tuple(primitives), matrix=np.eye(4))]

    def merged(self, part: str) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """All vertices, normals, colours and triangles of one material."""
        return _join(self.parts[part])


def _join(
    pieces: list[tuple[Array, Array, Array, NDArray[np.int64]]],
) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    starts = np.cumsum([0] + [len(p[0]) for p in pieces[:-1]])
    return (
        np.concatenate([p[0] for p in pieces]),
        np.concatenate([p[1] for p in pieces]),
        np.concatenate([p[2] for p in pieces]),
        np.concatenate([p[3] + s for p, s in zip(pieces, starts, strict=True)]),
    )


def _blocks(
    pieces: list[tuple[Array, Array, Array, NDArray[np.int64]]],
) -> list[tuple[Array, Array, Array, NDArray[np.int64]]]:
    """Group pieces so that no group has more vertices than uint16 can index."""
    groups: list[list[tuple[Array, Array, Array, NDArray[np.int64]]]] = [[]]
    count = 0
    for piece in pieces:
        if count + len(piece[0]) > LARGEST_INDEX and groups[-1]:
            groups.append([])
            count = 0
        groups[-1].append(piece)
        count += len(piece[0])
    return [_join(group) for group in groups]
