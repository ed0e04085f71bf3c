// SPDX-License-Identifier: Apache-2.0
#include "bench/surface_scene.h"

#include <cmath>

#include "core/parallel.h"
#include "core/random.h"

namespace nerfvdb {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kSharpness = 4;  // raw density a voxel
constexpr double kReach = 0.87;  // half the diagonal of a cell: what a surface in it is from its middle at most

Vec3i coordOf(const Vec3i& leaf, int offset) {
    return leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
}

/// A sheet of all points less than half_thickness from where `distance` (voxels, smooth) is zero. Active are
/// the corners of cells that the sheet or its surfaces run through.
template <typename Distance>
Model sheetOf(int resolution, int channels, double half_thickness, const Distance& distance) {
    const int leaves = resolution / kLeafDim;
    const std::size_t n_places = static_cast<std::size_t>(leaves) * leaves * leaves;
    const auto leafAt = [&](std::size_t i) -> Vec3i {
        return Vec3i(static_cast<int>(i / leaves / leaves), static_cast<int>(i / leaves % leaves),
                     static_cast<int>(i % leaves));
    };
    std::vector<LeafMask> masks(n_places, LeafMask{});
    parallelRanges(n_places, 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Vec3d middle = (leafAt(i) * kLeafDim).template cast<double>() + Vec3d::Constant(4);
            if (std::abs(distance(middle)) > half_thickness + kLeafDim * 1.5) continue;
            for (int offset = 0; offset < kLeafVoxels; ++offset) {
                const Vec3i cell = coordOf(leafAt(i), offset);
                if (cell.maxCoeff() >= resolution - 1) continue;
                if (std::abs(distance(cell.template cast<double>() + Vec3d::Constant(0.5))) <
                    half_thickness + kReach)
                    setBit(masks[i], offset);
            }
        }
    });
    std::vector<Topology::LeafCells> cells;
    for (std::size_t i = 0; i < n_places; ++i)
        if (masks[i] != LeafMask{}) cells.push_back({leafAt(i), masks[i]});

    Model model;
    model.field = VoxelField(Topology(Vec3i::Constant(resolution), cells), {}, channels, 1.0);
    if (channels > 0) model.decoder = Decoder(channels, 1);
    const Topology& topology = model.field.topology();
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const std::size_t voxel = leaf * kLeafVoxels + offset;
            const double d = distance(coordOf(topology.leafCoords()[leaf], offset).cast<double>());
            model.field.density()[voxel] = static_cast<float>(kSharpness * (half_thickness - std::abs(d)));
            for (int c = 0; c < channels; ++c)
                model.field.features()[voxel * channels + c] =
                    2 * unitFloat(static_cast<std::uint32_t>(randomBits(1, c, voxel))) - 1;
        });
    });
    return model;
}

}  // namespace

SurfaceScene bumpyShell(int resolution, int channels) {
    const Vec3d centre = Vec3d::Constant(0.5 * resolution - 0.37);
    const double radius = 0.4 * resolution, bump = 0.02 * resolution, waves = 9;
    const auto distance = [=](const Vec3d& p) {
        const Vec3d q = p - centre;
        const double r = q.norm();
        if (r < 0.5 * radius) return r - radius;
        const Vec3d u = q * (waves / r);
        return r - radius - bump * std::sin(u.x()) * std::sin(u.y()) * std::sin(u.z());
    };
    const std::string size = std::to_string(resolution);
    return {"bumpy shell in " + size + "^3", sheetOf(resolution, channels, 1.5, distance)};
}

SurfaceScene gyroidBall(int resolution, int channels) {
    const Vec3d centre = Vec3d::Constant(0.5 * resolution - 0.37);
    const double radius = 0.47 * resolution, per_voxel = 2 * kPi / 118;
    const auto distance = [=](const Vec3d& p) {
        const Vec3d q = (p - centre) * per_voxel;
        const double sx = std::sin(q.x()), sy = std::sin(q.y()), sz = std::sin(q.z());
        const double cx = std::cos(q.x()), cy = std::cos(q.y()), cz = std::cos(q.z());
        const double value = sx * cy + sy * cz + sz * cx;
        const Vec3d slope(cx * cy - sz * sx, cy * cz - sx * sy, cz * cx - sy * sz);
        const double sheet = std::abs(value) / (per_voxel * std::max(slope.norm(), 0.2));
        return std::max(sheet, (p - centre).norm() - radius);
    };
    const std::string size = std::to_string(resolution);
    return {"gyroid in a ball in " + size + "^3", sheetOf(resolution, channels, 0.6, distance)};
}

}  // namespace nerfvdb
