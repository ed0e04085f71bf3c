// SPDX-License-Identifier: Apache-2.0
// A model in another place: what is written in 32-bit floats needs an origin nearby.
#pragma once

#include "vdb/model.h"

namespace nerfvdb {

/// The model with `origin`, a point of its world, where 0, 0, 0 was: its field and its cameras.
Model movedModel(Model model, const Vec3d& origin);

}  // namespace nerfvdb
