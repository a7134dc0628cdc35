"""Mesh files of one triangle, written by a test."""

import json

import numpy as np
from PIL import Image

from formats.files import glb

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


RGB = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [188, 188, 188]]], np.uint8)


def write(folder, name, text):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def texture(folder, name):
    Image.fromarray(RGB).save(folder / name)
    return folder / name


def glb_of(path, nodes):
    glb.write(path, nodes)
    return path


def triangle(**kwargs):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    return glb.Primitive(points, np.array([[0, 1, 2]], np.uint32), **kwargs)


def gltf_of(folder, **changes):
    """A glTF of nested nodes: a mirror in x within a shift in x; its buffer is a side file."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    write(folder, "a buffer.bin", points)
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"translation": [10, 0, 0], "children": [1]}, {"scale": [-1, 1, 1], "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 1, 0]}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": "a%20buffer.bin", "byteLength": 36}],
    }  # fmt: skip
    return write(folder, "nested.gltf", json.dumps(tree | changes))
