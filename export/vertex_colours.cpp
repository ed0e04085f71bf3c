// SPDX-License-Identifier: Apache-2.0
#include "export/vertex_colours.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/image.h"
#include "core/parallel.h"
#include "export/diffuse_colors.h"
#include "export/volume_colors.h"
#include "export/volume_of_model.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kBatch = 256;  // a network's activations for so many samples stay in the L2 cache
constexpr double kVisibleAlpha = 1e-5;

std::uint8_t byteFromUnit(float value) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
}

/// The training views' colours at the voxels of a model.
class SeenColours {
public:
    SeenColours(const Model& model, std::span<const Camera> cameras, Report& report) {
        VolumeGridOptions grid;
        grid.min_alpha = kVisibleAlpha;
        volume_ = volumeOfModel(model.field, grid);
        collectColors(model, cameras, {}, volume_, report);
    }

    /// Linear RGB at a point of the world, trilinear between voxels that have a colour; nothing if none has.
    std::optional<Vec3f> at(const Vec3d& world) const {
        const Vec3d point = volume_.frame().indexFromWorld(world);
        const Vec3d low = point.array().floor();
        const Vec3f u = (point - low).cast<float>();
        Vec3f sum = Vec3f::Zero();
        float total = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
            const Vec3i voxel = low.cast<int>() + step;
            if ((voxel.array() < 0).any()) continue;
            const int leaf = volume_.topology().findLeaf(voxel / kLeafDim);
            if (leaf < 0) continue;
            const std::size_t i =
                static_cast<std::size_t>(leaf) * kLeafVoxels + brickOffset(voxel.x() & 7, voxel.y() & 7, voxel.z() & 7);
            const Eigen::Map<const Vec3f> color(&volume_.color()[i * Volume::kChannels]);
            if (color == Vec3f::Zero()) continue;  // none: what is black has a little
            float weight = 1;
            for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? u[axis] : 1 - u[axis];
            sum += weight * color;
            total += weight;
        }
        if (!(total > 0)) return std::nullopt;
        return Vec3f(sum / total);
    }

private:
    Volume volume_;
};

}  // namespace

void colourVertices(const Model& model, Mesh& mesh, Report& report) {
    colourVertices(model.decoder, model.field, mesh);
    std::vector<Camera> cameras;
    for (const ModelCamera& camera : model.cameras)
        if (!camera.held_out) cameras.push_back(camera.camera);
    if (cameras.empty()) return;
    const SeenColours seen(model, cameras, report);
    parallelRanges(mesh.positions.size(), kBatch, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v)
            if (const std::optional<Vec3f> color = seen.at(mesh.positions[v].cast<double>()))
                for (int c = 0; c < 3; ++c) mesh.colours[v][c] = byteFromUnit(srgbFromLinear((*color)[c]));
    });
}

void colourVertices(const Decoder& decoder, const VoxelField& field, Mesh& mesh) {
    mesh.colours.resize(mesh.positions.size());
    parallelRanges(mesh.positions.size(), kBatch, [&](std::size_t begin, std::size_t end) {
        std::vector<Vec3d> points;
        for (std::size_t v = begin; v < end; ++v) points.push_back(mesh.positions[v].cast<double>());
        std::vector<float> rgb(points.size() * 3);
        diffuseColors(decoder, field, points, rgb);
        for (std::size_t v = begin; v < end; ++v)
            for (int c = 0; c < 3; ++c) mesh.colours[v][c] = byteFromUnit(rgb[(v - begin) * 3 + c]);
    });
}

}  // namespace nerfvdb
