// SPDX-License-Identifier: Apache-2.0
#include "export/diffuse_colors.h"

#include <algorithm>

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

/// False, and zeros, where no active voxel is around.
bool readFeatures(const VoxelField& field, const Vec3d& point_in_world, float* features) {
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
    if (!(total > 0)) return false;
    for (int c = 0; c < field.channels(); ++c) features[c] /= total;
    return true;
}

}  // namespace

std::vector<bool> diffuseColors(const Decoder& decoder, const VoxelField& field, std::span<const Vec3d> points,
                                std::span<float> rgb) {
    const auto channels = static_cast<std::size_t>(field.channels());
    std::vector<float> features(points.size() * channels);
    std::vector<bool> known(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        known[i] = readFeatures(field, points[i], &features[i * channels]);
    decoder.diffuse(static_cast<int>(points.size()), features.data(), rgb.data());
    return known;
}

}  // namespace nerfvdb
