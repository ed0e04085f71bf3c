// SPDX-License-Identifier: Apache-2.0
// Normals of a mesh from its triangles, for when those of the field no longer hold: after smoothing, say.
#pragma once

#include "export/vertex_faces.h"

namespace nerfvdb {

/// Sets mesh.normals: the unit mean of the normals of a vertex's triangles, each weighted by its angle there, so
/// that slivers and the way in which a plane is cut into triangles have no say. A vertex without triangles, or
/// whose triangles cancel, gets +z.
/// Source: Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal facets".
/// Threads: parallel over vertices; the same for any number of threads.
void computeNormals(Mesh& mesh, const VertexFaces& faces);

}  // namespace nerfvdb
