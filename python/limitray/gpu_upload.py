"""The buffers of a scene on a GPU, kept up to date with the C++ scene that builds."""

from __future__ import annotations

from typing import Any

import numpy as np

from limitray import _core
from limitray.gpu_layout import (
    STRIDES,
    Words,
    geometry_record,
    instance_record,
    mesh_arrays,
    tree_arrays,
)
from limitray.gpu_tracer import Tracer


class SceneBuffers:
    """What kernels read of `core`, as the members of the Slang struct SceneView.

    `changed` are the meshes to upload again; None: everything.
    """

    def __init__(self, tracer: Tracer, core: _core.Scene) -> None:
        self._tracer, self._core = tracer, core
        self._buffers: dict[str, Any] = {}
        self._first: list[tuple[int, int, int]] = []  # patch, bump and node of each mesh
        self._records: list[Words] = []  # GeometryRecord of each mesh
        self._top_node = 0
        self.changed: set[int] | None = None

    def view(self, use_newton: bool) -> dict[str, Any]:
        """The Slang struct SceneView, after `synchronise`."""
        settings = np.array([self._core.geometry_count(), use_newton], np.uint32)
        return {**self._buffers, "settings": self._tracer.buffer(settings)}

    def synchronise(self) -> None:
        """Brings the buffers up to the scene."""
        if self.changed is None:
            self._upload_all()
        elif self.changed:
            for mesh in self.changed:
                patch, bump, node = self._first[mesh]
                data = self._core.mesh_data(mesh)
                arrays = mesh_arrays(data, patch, bump, node)
                # All that depends on the points; the tree keeps its shape.
                places = {"nets": patch, "models": patch, "bumps": bump, "nodes": node}
                for name, row in places.items():
                    self._overwrite(name, row, arrays[name])
                self._records[mesh] = geometry_record(data, node)
            self._upload_top()
        self.changed = set()

    def _upload_all(self) -> None:
        self._first, self._records, parts = [], [], []
        patch = bump = node = 0
        for mesh in range(self._core.mesh_count()):
            data = self._core.mesh_data(mesh)
            self._first.append((patch, bump, node))
            parts.append(mesh_arrays(data, patch, bump, node))
            self._records.append(geometry_record(data, node))
            patch, bump = patch + len(data["nets"]), bump + len(data["bumps"])
            node += len(data["nodes"])
        self._top_node = node
        # Room for a tree over the instances: never more nodes than these.
        room = self._core.geometry_count() + 1
        empty = tree_arrays(np.zeros((room, 56), np.float32), 0, 0)
        parts.append({name: empty[name] for name in ("nodes", "children", "parents")})
        for name in ("nets", "bumps", "infos", "models", "patch_ids", *empty):
            arrays = [part[name] for part in parts if name in part]
            array = np.concatenate(arrays) if arrays else np.zeros(0, np.uint32)
            self._buffers[name] = self._tracer.buffer(array, STRIDES[name])
        instances = [self._core.instance_data(i) for i in range(self._core.geometry_count())]
        records = np.array([instance_record(data) for data in instances])
        self._buffers["instances"] = self._tracer.buffer(records, STRIDES["instances"])
        self._upload_top()

    def _overwrite(self, name: str, row: int, rows: Words) -> None:
        if len(rows) > 0:
            self._tracer.overwrite(self._buffers[name], row * rows[0].nbytes, rows)

    def _upload_top(self) -> None:
        top = self._core.top_data()
        if len(top["nodes"]) > 0:
            for name, array in tree_arrays(top["nodes"], self._top_node, 0).items():
                self._overwrite(name, self._top_node, array)
        records = [geometry_record(top, self._top_node), *self._records]
        self._buffers["geometries"] = self._tracer.buffer(np.array(records), STRIDES["geometries"])
