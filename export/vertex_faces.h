// SPDX-License-Identifier: Apache-2.0
// Which triangles meet at each vertex of a mesh.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "export/mesh.h"

namespace nerfvdb {

/// The triangles of a vertex stand in rising order, so that sums over them do not depend on threads.
class VertexFaces {
public:
    /// Needs triangles that name vertices of the mesh. Time and memory are linear; 4 bytes a corner.
    explicit VertexFaces(const Mesh& mesh);

    std::span<const std::uint32_t> of(std::size_t vertex) const {
        return {faces_.data() + begin_[vertex], begin_[vertex + 1] - begin_[vertex]};
    }

private:
    std::vector<std::size_t> begin_;    // [vertices + 1]
    std::vector<std::uint32_t> faces_;  // [3 * triangles]
};

}  // namespace nerfvdb
