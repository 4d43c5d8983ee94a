// Stage: control cage. The limit surface of a neighbourhood, where it has a closed form: in a face
// that is a uniform bicubic B-spline, and at a corner by the limit masks.
#pragma once

#include "limitray/cage/local_mesh.h"

namespace limitray {

/// Position relative to the neighbourhood's origin, derivatives with respect to (u,v) of face 0,
/// and the normal up to its length, on the side of counter-clockwise winding.
struct LocalSample {
  Vec3d point, normal, dp_du, dp_dv;
};

/// Whether face 0 is a bicubic B-spline patch: a quad, no semi-sharp feature at its corners, which
/// are regular inside, on a boundary or infinitely sharp crease, or at a corner of it.
bool is_regular(const LocalMesh& mesh);

/// The patch of a regular face 0 at (u,v). Points beyond sharp edges are mirrored (the boundary
/// rule of cubic B-splines).
LocalSample sample_regular(const LocalMesh& mesh, double u, double v);

/// Whether the limit at corner `corner` of the quad face 0 follows from masks: only quads and no
/// semi-sharp feature around it, and a smooth vertex of valence 3 or more, a crease vertex, or a
/// corner with this face alone between two sharp edges. Elsewhere (darts, valence 2, corners of
/// more faces) subdivision has other leading eigenvectors.
bool has_limit_masks(const LocalMesh& mesh, int corner);

/// The limit at a corner with masks, from the eigenvectors of subdivision (Halstead, Kass, DeRose:
/// Efficient, Fair Interpolation using Catmull-Clark Surfaces, 1993; beside creases derived in the
/// same way from the rules used here, which are not those of Biermann, Levin, Zorin 2000). At
/// extraordinary vertices the derivatives are tangents whose length is a convention, the regular
/// one for valence 4: the true ones are 0 or infinite.
LocalSample sample_corner(const LocalMesh& mesh, int corner);

/// The same where there are no masks, from a neighbourhood subdivided so often that face 0 is
/// small against its distance to other corners: the edges are the tangents.
LocalSample sample_tiny_corner(const LocalMesh& mesh, int corner);

}  // namespace limitray
