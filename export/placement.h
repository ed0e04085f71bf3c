// SPDX-License-Identifier: Apache-2.0
// Where an exported scene stands in the program that opens it: how large, which way up, around which origin.
#pragma once

#include <optional>

#include "core/similarity.h"

namespace nerfvdb {

struct PlacementOptions {
    double scale = 1;                  // exported units per world unit; > 0
    UpAxis source_up = UpAxis::z;      // the axis that points up in the model's world
    std::optional<UpAxis> up = {};     // the one that shall in the export; absent: as in the model

    /// What comes to lie in the origin.
    enum class Origin {
        keep,    // what lies there in the model's world
        middle,  // the middle of the bounds
        ground,  // the middle of the bounds' bottom: the scene stands on the ground
    };
    Origin origin = Origin::keep;
};

/// The map from the model's world to the exported one. First turned: y up from z up is (x, y, z) -> (x, z, -y), z up
/// from y up its inverse, so that x stays; then scaled; then moved. `bounds` is what the scene occupies, in the
/// model's world; only `origin` asks for it.
/// Throws UsageError for a scale that is not positive and finite, or bounds that are not when they are needed.
Similarity placementOf(const PlacementOptions& options, const Box& bounds);

}  // namespace nerfvdb
