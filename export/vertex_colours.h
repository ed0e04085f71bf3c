// SPDX-License-Identifier: Apache-2.0
// Colours for the vertices of any mesh near the surface of a model, also after it was cleaned or simplified.
#pragma once

#include "export/mesh.h"
#include "vdb/model.h"

namespace nerfvdb {

/// Sets mesh.colours to the model's diffuse colour (Decoder::diffuse) at each vertex, sRGB. Features are read
/// trilinearly; corners that are not active have no features and no say.
/// A vertex that touches no active voxel gets what zero features decode to. Threads: parallel over vertices.
void colourVertices(const Model& model, Mesh& mesh);

/// The same from another field's features, such as that of a resampled model.
void colourVertices(const Decoder& decoder, const VoxelField& field, Mesh& mesh);

}  // namespace nerfvdb
