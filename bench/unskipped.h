// SPDX-License-Identifier: Apache-2.0
// Ways not to skip: occupancies that make rays walk where they would have jumped. Pictures stay right; only
// time and samples are lost.
#pragma once

#include <optional>

#include "trainer/ray_source.h"
#include "vdb/model.h"
#include "vdb/occupancy.h"

namespace nerfvdb {

/// Occupancies of one model at a threshold of min_alpha. Keeps a reference to the model.
class Unskipped {
public:
    explicit Unskipped(const Model& model, float min_alpha = 0);

    /// For the model itself: leaves without occupied cells are walked sample by sample, and each sample finds
    /// its cell's bit cleared.
    Occupancy walkedLeaves() const;

    /// The model with every cell of its occupied leaves, the added ones empty: what the next two are made for.
    const Model& full() const { return full_; }

    /// For full(): every cell of an occupied leaf is looked at; other leaves are jumped.
    Occupancy wholeLeaves() const;

    /// For full(): a dense march; density is read at every sample in the box. One empty leaf stands for all
    /// empty ones, so the memory of a dense grid is not paid for. Nothing if the box has no place for that
    /// leaf.
    std::optional<Occupancy> wholeBox() const;

private:
    const Model& model_;
    Occupancy occupancy_;
    Model full_;
    int empty_leaf_ = -1;  // in full_: all its cells exist, and neither they nor their neighbours hold anything
};

/// Makes a source draw from every pixel that shows the field's box, occupied or not.
void aimAtWholeBox(RaySource& source, const VoxelField& field);

}  // namespace nerfvdb
