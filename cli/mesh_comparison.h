// SPDX-License-Identifier: Apache-2.0
// A comparison of meshes as people and programs read it: in world units and in voxels.
#pragma once

#include <string>

#include "cli/json_output.h"
#include "export/mesh_compare.h"

namespace nerfvdb {

Json comparisonJson(const MeshComparison& comparison, double voxel_size);

std::string comparisonText(const MeshComparison& comparison, double voxel_size);

}  // namespace nerfvdb
