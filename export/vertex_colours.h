// SPDX-License-Identifier: Apache-2.0
// Colours for the vertices of any mesh near the surface of a model, also after it was cleaned or simplified.
#pragma once

#include "core/report.h"
#include "export/mesh.h"
#include "vdb/model.h"

namespace nerfvdb {

/// Sets mesh.colours, sRGB, to what the training views saw there (collectColors), for a vertex that none of them saw,
/// and for a model that names no cameras, to the model's diffuse colour (below). The mesh is in the model's world.
/// The same for any number of threads. Throws Interrupted.
void colourVertices(const Model& model, Mesh& mesh, Report& report);

/// Sets mesh.colours to the diffuse colour (Decoder::diffuse) of a field at each vertex, sRGB. Features are read
/// trilinearly; corners that are not active have no features and no say. A vertex that touches no active voxel gets
/// what zero features decode to.
void colourVertices(const Decoder& decoder, const VoxelField& field, Mesh& mesh);

}  // namespace nerfvdb
