// SPDX-License-Identifier: Apache-2.0
#include "export/vertex_faces.h"

#include <numeric>

namespace nerfvdb {

VertexFaces::VertexFaces(const Mesh& mesh) : begin_(mesh.positions.size() + 2, 0), faces_(mesh.triangles.size() * 3) {
    // Counts stand two places late, so that filling moves each begin to where it belongs.
    for (const Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) ++begin_[t[k] + 2];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
        for (int k = 0; k < 3; ++k) faces_[begin_[mesh.triangles[i][k] + 1]++] = i;
    begin_.pop_back();
}

}  // namespace nerfvdb
