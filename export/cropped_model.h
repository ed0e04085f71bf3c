// SPDX-License-Identifier: Apache-2.0
// A part of a scene, as if there were nothing else.
#pragma once

#include "vdb/model.h"

namespace nerfvdb {

/// The model on those of its cells that lie in the box, world units, whole: pictures of it show what is in there, even
/// where something else stood before it. Throws DataError if nothing does.
Model croppedModel(const Model& model, const Box& bounds);

}  // namespace nerfvdb
