"""The node tree of a glTF scene, flattened (glTF 2.0, section 3.5)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.files.glb_buffers import item, whole


def placed(gltf: dict[str, Any]) -> Iterator[tuple[dict[str, Any], NDArray[np.float64]]]:
    """Nodes of the default scene with their world_from_node (4, 4), parents first.

    Raises ValueError for a node with two parents (so for cycles too) and for wild transforms.
    """
    if "scenes" in gltf:
        roots = item(gltf, "scenes", gltf.get("scene", 0)).get("nodes", [])
    else:
        children = {c for node in gltf.get("nodes", []) for c in node.get("children", [])}
        roots = [i for i in range(len(gltf.get("nodes", []))) if i not in children]
    stack = [(whole(i), np.eye(4)) for i in reversed(roots)]
    seen: set[int] = set()
    while stack:
        index, world_from_parent = stack.pop()
        if index in seen:
            raise ValueError(f"node {index} has two parents")
        seen.add(index)
        node = item(gltf, "nodes", index)
        matrix = world_from_parent @ _local(node)
        if not np.all(np.isfinite(matrix)):
            raise ValueError(f"the transform of node {index} is not finite")
        yield node, matrix
        stack += [(whole(child), matrix) for child in reversed(node.get("children", []))]


def _local(node: dict[str, Any]) -> NDArray[np.float64]:
    """parent_from_node: the matrix (column-major), or translation, rotation (x, y, z, w), scale."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), np.float64)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), np.float64)
    return matrix
