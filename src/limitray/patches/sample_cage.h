// Stage: patches (S0). Comes in: a cage. Goes out: a small cage that holds the faces where Gregory
// patches are probably farthest from the limit, with all that their surface depends on.
#pragma once

#include <cstdint>
#include <vector>

#include "limitray/cage/cage.h"

namespace limitray {

/// A few faces of a cage and the two rings of faces around them; the rings are holes, so that only
/// the chosen faces have a surface. It is the same surface as in the whole cage.
struct SampleCage {
  ControlCage cage;  // no faces if no vertex and no face can be irregular
  /// One a point: the kind (counted from 0) of a vertex that faces were chosen for, else -1.
  std::vector<std::int32_t> kinds;
};

/// Chosen are, of each kind of irregular vertex (by faces, boundary, sharp edges, and the sides of
/// a face that is no quad), some faces at the vertices whose faces are farthest from their tangent
/// plane (in the quadratic mean): a Gregory patch of a plane is exact. `cage` must be valid.
SampleCage sample_cage(const ControlCage& cage);

}  // namespace limitray
