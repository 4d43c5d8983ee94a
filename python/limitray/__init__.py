"""Exact ray tracing of Catmull-Clark subdivision surfaces: no tessellation, no cracks.

A control cage (`Mesh`) becomes Bezier and Gregory patches in a `Scene`; rays are answered with
exact hits, or a picture is made by `render`::

    import limitray as lr

    scene = lr.Scene()
    scene.add_mesh(lr.Mesh.from_file("model.obj"))
    lr.render(scene, width=640, height=480).save("model.png")
"""

from limitray.camera import Camera, create_rays_pinhole
from limitray.image import Image
from limitray.info import mesh_info
from limitray.light import RectangleLight, Sun
from limitray.material import Material
from limitray.mesh import FaceVarying, Mesh, Primvar
from limitray.render import RenderInterrupted, render
from limitray.scene import INVALID_ID, Scene
from limitray.sky import ConstantSky, GradientSky, ImageSky
from limitray.texture import Texture
from limitray.triangles import Triangles
from limitray.usd import Stage, load_scene

__all__ = [
    "INVALID_ID",
    "Camera",
    "ConstantSky",
    "FaceVarying",
    "GradientSky",
    "Image",
    "ImageSky",
    "Material",
    "Mesh",
    "Primvar",
    "RectangleLight",
    "RenderInterrupted",
    "Scene",
    "Stage",
    "Sun",
    "Texture",
    "Triangles",
    "create_rays_pinhole",
    "load_scene",
    "mesh_info",
    "render",
]
