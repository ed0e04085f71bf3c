// SPDX-License-Identifier: Apache-2.0
// Smoothing that takes terraces and noise off a surface and leaves its volume.
#pragma once

#include "export/mesh.h"

namespace nerfvdb {

/// Moves vertices by so many rounds of Taubin's filter: a step towards the mean of the neighbours (lambda = 0.5) and a
/// slightly longer one away from it (mu = -0.508, so that waves longer than some 25 edges pass unchanged and nothing
/// shrinks). Triangles stay as they are; normals are computed anew; colours stay with their vertices.
///
/// Each neighbour of a vertex weighs the same, along an open border half as much.
/// Cost:    linear in triangles and rounds; 20 bytes a vertex and 12 a triangle beside the mesh.
/// Threads: parallel; the mesh is the same, byte for byte, for any number of threads.
/// Source:  Taubin 1995, "A signal processing approach to fair surface design".
void smoothMesh(Mesh& mesh, int rounds);

}  // namespace nerfvdb
