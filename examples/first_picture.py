"""A cube with four semi-sharp edges, from numpy arrays to a picture.

usage: first_picture.py [OUTPUT.png]
"""

import sys

import limitray as lr

points = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]

mesh = lr.Mesh(
    points,
    face_vertex_counts=[4] * 6,
    face_vertex_indices=[vertex for face in faces for vertex in face],
    crease_indices=[2, 3, 7, 6, 2],  # one chain of edges around the top
    crease_lengths=[5],
    crease_sharpnesses=[2.5],
)
scene = lr.Scene()
scene.add_mesh(mesh)
image = lr.render(scene, width=320, height=240, spp=16)
image.save(sys.argv[1] if len(sys.argv) > 1 else "cube.png")
