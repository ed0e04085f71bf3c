// SPDX-License-Identifier: Apache-2.0
#include "export/vertex_colours.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "export/diffuse_colors.h"

namespace nerfvdb {
namespace {

std::uint8_t byteFromUnit(float value) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
}

}  // namespace

void colourVertices(const Model& model, Mesh& mesh) {
    constexpr std::size_t kBatch = 256;  // a network's activations for so many samples stay in the L2 cache
    mesh.colours.resize(mesh.positions.size());
    parallelRanges(mesh.positions.size(), kBatch, [&](std::size_t begin, std::size_t end) {
        std::vector<Vec3d> points;
        for (std::size_t v = begin; v < end; ++v) points.push_back(mesh.positions[v].cast<double>());
        std::vector<float> rgb(points.size() * 3);
        diffuseColors(model, points, rgb);
        for (std::size_t v = begin; v < end; ++v)
            for (int c = 0; c < 3; ++c) mesh.colours[v][c] = byteFromUnit(rgb[(v - begin) * 3 + c]);
    });
}

}  // namespace nerfvdb
