"""How a scene lies in GPU memory: numpy records as patches/patch_buffer.slang has them.

Comes in: what the C++ scene exports (`mesh_data`, `instance_data`, `top_data`). Goes out: arrays of
32-bit words, one for each buffer of the Slang struct SceneView.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Words = NDArray[Any]

MISS = 0xFFFFFFFF
LEAF = np.uint32(1 << 31)
LARGEST = np.float32(3e38)

INFO = np.dtype(
    [
        ("face", "u4"),
        ("sub_quad_and_level", "u4"),
        ("bump", "u4"),
        ("u0", "f4"),
        ("v0", "f4"),
        ("du", "f4"),
        ("dv", "f4"),
    ]
)
GEOMETRY = np.dtype(
    [
        ("first_node", "u4"),
        ("node_count", "u4"),
        ("padding", "u4", 2),
        ("center", "f4", 3),
        ("radius", "f4"),
        ("center_low", "f4", 3),
        ("left_handed", "f4"),
        ("half", "f4", 4),
    ]
)
INSTANCE = np.dtype(
    [
        ("to_object", "f4", (3, 4)),
        ("to_world", "f4", (3, 4)),
        ("geometry", "u4"),
        ("identity", "u4"),
        ("padding", "u4", 2),
    ]
)
HIT = np.dtype(
    [
        ("t", "f4"),
        ("instance", "u4"),
        ("leaf", "u4"),
        ("s", "f4"),
        ("t_patch", "f4"),
        ("spread", "f4"),
    ]
)
STRIDES = {
    "nets": 16,
    "bumps": 16,
    "infos": 28,
    "models": 4,
    "patch_ids": 4,
    "nodes": 16,
    "children": 4,
    "parents": 4,
    "geometries": GEOMETRY.itemsize,
    "instances": INSTANCE.itemsize,
    "settings": 4,
}
"""Bytes of an element of each buffer of SceneView."""


def tree_arrays(nodes: Words, first_node: int, first_leaf: int) -> dict[str, Words]:
    """Buffers of a tree whose root becomes node `first_node` and leaf 0 becomes `first_leaf`.

    `nodes` are the words (n, 56) of C++ BvhNodes.
    """
    boxes = np.clip(nodes[:, :48], -LARGEST, LARGEST)  # no infinities on a GPU
    child = np.ascontiguousarray(nodes[:, 48:]).view(np.uint32)
    present = nodes[:, :8] <= nodes[:, 24:32]
    inner = present & (child < LEAF)
    shift = np.where(inner, first_node, first_leaf).astype(np.uint32)
    node, place = np.nonzero(inner)
    parents = np.zeros(len(nodes), np.uint32)
    parents[child[inner]] = (first_node + node) * 8 + place
    return {"nodes": boxes, "children": np.where(present, child + shift, 0), "parents": parents}


def mesh_arrays(
    mesh: dict[str, Any], first_patch: int, first_bump: int, first_node: int
) -> dict[str, Words]:
    """Buffers of a mesh, with its numbers moved to its places among all meshes."""
    infos = mesh["infos"].copy()
    infos[:, 2] += np.where(infos[:, 2] == MISS, 0, first_bump).astype(np.uint32)
    arrays = {name: mesh[name] for name in ("nets", "bumps", "models", "patch_ids")}
    return {**arrays, "infos": infos, **tree_arrays(mesh["nodes"], first_node, first_patch)}


def geometry_record(data: dict[str, Any], first_node: int) -> NDArray[np.void]:
    """The GeometryRecord of a mesh, or of the tree over the instances. Sizes are rounded up."""
    record = np.zeros((), GEOMETRY)
    center = data["center"].astype(np.float32)
    record["first_node"], record["node_count"] = first_node, len(data["nodes"])
    record["center"], record["center_low"] = center, data["center"] - center
    record["radius"] = np.nextafter(np.float32(data["radius"]), LARGEST)
    record["half"][:3] = np.nextafter(data["half"].astype(np.float32), LARGEST)
    record["left_handed"] = data.get("left_handed", False)
    return record


def instance_record(data: dict[str, Any]) -> NDArray[np.void]:
    """The InstanceRecord of a placement; geometry record 0 is the tree over the instances."""
    record = np.zeros((), INSTANCE)
    record["to_object"], record["to_world"] = data["to_object"], data["to_world"]
    record["geometry"], record["identity"] = data["mesh"] + 1, data["identity"]
    return record
