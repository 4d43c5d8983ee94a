"""USD: cages, scenes, cameras and materials from .usd, .usda, .usdc and .usdz files, and back.

This folder alone imports usd-core (the extra `limitray[usd]`).
"""

from limitray.usd.mesh import read_mesh
from limitray.usd.stage import Stage, load_scene, mesh_from_usd
from limitray.usd.write import write_usd

__all__ = ["Stage", "load_scene", "mesh_from_usd", "read_mesh", "write_usd"]
