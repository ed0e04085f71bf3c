// SPDX-License-Identifier: Apache-2.0
#include "export/vertex_colours.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

/// Adds weight * features of a voxel; returns the weight that counted: zero if the voxel is not active.
float addFeatures(const VoxelField& field, const Vec3i& voxel, float weight, float* sum) {
    const int leaf = field.topology().findLeaf(
        voxel.unaryExpr([](int i) { return i >> 3; }));  // an arithmetic shift: floor for negatives, too
    const int offset = brickOffset(voxel.x() & 7, voxel.y() & 7, voxel.z() & 7);
    if (leaf < 0 || !testBit(field.topology().voxels()[leaf], offset)) return 0;
    const std::size_t channels = field.channels();
    const float* features =
        &field.features()[(static_cast<std::size_t>(leaf) * kLeafVoxels + offset) * channels];
    for (std::size_t c = 0; c < channels; ++c) sum[c] += weight * features[c];
    return weight;
}

void readFeatures(const VoxelField& field, const Vec3d& point_in_world, float* features) {
    const Vec3d point = field.frame().indexFromWorld(point_in_world);
    const Vec3d low = point.array().floor();
    const Vec3f u = (point - low).cast<float>();
    const Vec3i voxel = low.cast<int>();
    std::fill_n(features, field.channels(), 0.0f);
    float total = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
        float weight = 1;
        for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? u[axis] : 1 - u[axis];
        if (weight > 0) total += addFeatures(field, voxel + step, weight, features);
    }
    if (total > 0)
        for (int c = 0; c < field.channels(); ++c) features[c] /= total;
}

std::uint8_t byteFromUnit(float value) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
}

}  // namespace

void colourVertices(const Model& model, Mesh& mesh) { colourVertices(model.decoder, model.field, mesh); }

void colourVertices(const Decoder& decoder, const VoxelField& field, Mesh& mesh) {
    constexpr std::size_t kBatch = 256;  // a network's activations for so many samples stay in the L2 cache
    const std::size_t channels = field.channels();
    mesh.colours.resize(mesh.positions.size());
    parallelRanges(mesh.positions.size(), kBatch, [&](std::size_t begin, std::size_t end) {
        std::vector<float> features((end - begin) * channels), rgb((end - begin) * 3);
        for (std::size_t v = begin; v < end; ++v)
            readFeatures(field, mesh.positions[v].cast<double>(), &features[(v - begin) * channels]);
        decoder.diffuse(static_cast<int>(end - begin), features.data(), rgb.data());
        for (std::size_t v = begin; v < end; ++v)
            for (int c = 0; c < 3; ++c) mesh.colours[v][c] = byteFromUnit(rgb[(v - begin) * 3 + c]);
    });
}

}  // namespace nerfvdb
