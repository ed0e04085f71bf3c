// SPDX-License-Identifier: Apache-2.0
// Marching cubes on leaf blocks. One pass over the leaves says which voxels are inside (surface_cells.h); a
// survey of each block counts its vertices and triangles, and prefix sums give every block its place in the
// mesh (surface_blocks.h); a last pass, here, fills the places.
#include "export/marching_cubes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "export/dual_mesh.h"
#include "export/fill_inside.h"
#include "export/resample_field.h"
#include "export/surface_blocks.h"
#include "export/surface_crossing.h"
#include "export/vertex_colours.h"

namespace nerfvdb {
namespace {

/// Writes one block's vertices and triangles to their places.
class BlockWriter {
public:
    BlockWriter(const Surface& surface, const BlockList& blocks, const Block& block, Mesh& mesh)
        : surface_(surface), blocks_(blocks), block_(block), crossings_(surface, block.leaf), mesh_(mesh) {
        for (int edge = 0; edge < kCubeEdges; ++edge) {
            const CubeEdge& e = cubeTable().edges[edge];
            edge_places_[edge] = e.axis * 729 + e.x * 81 + e.y * 9 + e.z;
        }
    }

    void write() {
        writeCrossings();
        numberNeighbours();
        std::uint32_t centre = block_.first_vertex + block_.n_edges;
        std::uint32_t triangle = block_.first_triangle;
        const auto writeCell = [&](int x, int y, int z, const CubeTriangles& cube) {
            const std::uint32_t* const cell = &numbers_[x * 81 + y * 9 + z];
            const auto number = [&](int edge) { return edge == kCubeCentre ? centre : cell[edge_places_[edge]]; };
            for (int i = 0; i < cube.count; ++i) {
                const auto& [a, b, c] = cube.triangles[i];
                mesh_.triangles[triangle++] = Triangle(number(a), number(b), number(c));
            }
            if (cube.has_centre) writeCentre(centre++, x, y, z, cube);
        };
        forEachCrossedCell(BlockCorners(surface_, block_.leaf), surface_.iso, writeCell);
    }

private:
    void writeVertex(std::uint32_t number, const SurfacePoint& point) {
        const Vec3d index = (block_.leaf * kLeafDim).cast<double>() + point.position.cast<double>();
        mesh_.positions[number] = surface_.field.frame().worldFromIndex(index).cast<float>();
        mesh_.normals[number] = point.normal;
    }

    void writeCrossings() {
        std::uint32_t number = block_.first_vertex;
        for (int x = 0; x < kLeafDim; ++x)
            for (int axis = 0; axis < 3; ++axis)
                forEachBit(block_.crossed[axis][x], [&](int bit) {
                    numbers_[axis * 729 + x * 81 + (bit >> 3) * 9 + (bit & 7)] = number;
                    writeVertex(number++, crossings_.at(x, bit >> 3, bit & 7, axis));
                });
    }

    /// The upper edges of the block's cells belong to its neighbours, and so do the vertices there.
    void numberNeighbours() {
        for (int corner = 1; corner < 8; ++corner) {
            const Vec3i step = cornerStep(corner);
            const Block* owner = blocks_.find(block_.leaf + step);
            if (!owner) continue;
            const std::uint64_t border =
                (step.y() ? 0xffull : ~0ull) & (step.z() ? 0x0101010101010101ull : ~0ull);
            for (int axis = 0; axis < 3; ++axis) {
                if (step[axis]) continue;  // starts at the far side and leads away
                std::uint32_t* place = &numbers_[axis * 729 + 8 * (step.x() * 81 + step.y() * 9 + step.z())];
                for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x) {
                    const std::uint64_t word = owner->crossed[axis][x];
                    forEachBit(word & border, [&](int bit) {
                        const int before = std::popcount(word & ((std::uint64_t{1} << bit) - 1));
                        place[x * 81 + (bit >> 3) * 9 + (bit & 7)] =
                            owner->first_vertex + owner->rank[x][axis] + before;
                    });
                }
            }
        }
    }

    /// A centre is the mean of the loop around it: inside the cell, because no face holds the whole loop.
    void writeCentre(std::uint32_t number, int x, int y, int z, const CubeTriangles& cube) {
        SurfacePoint mean{Vec3f::Zero(), Vec3f::Zero()};
        int n = 0;
        for (int i = 0; i < cube.count; ++i) {
            if (cube.triangles[i][2] != kCubeCentre) continue;
            const CubeEdge& e = cubeTable().edges[cube.triangles[i][0]];
            const SurfacePoint point = crossings_.at(x + e.x, y + e.y, z + e.z, e.axis);
            mean.position += point.position;
            mean.normal += point.normal;
            ++n;
        }
        mean.position /= static_cast<float>(n);
        const float length = mean.normal.norm();
        mean.normal =
            length > 1e-3f ? Vec3f(mean.normal / length) : Vec3f::UnitZ();  // a saddle may have no side
        writeVertex(number, mean);
    }

    const Surface& surface_;
    const BlockList& blocks_;
    const Block& block_;
    BlockCrossings crossings_;
    Mesh& mesh_;
    std::array<int, kCubeEdges> edge_places_;      // in numbers_, from those of a cell's first corner
    std::array<std::uint32_t, 3 * 729> numbers_;  // [axis][x][y][z], 9 a side; only crossed edges are filled
};

Mesh marchCubes(const Surface& surface, Report& report) {
    const BlockList blocks(surface);
    Mesh mesh;
    mesh.positions.resize(blocks.vertexCount());
    mesh.normals.resize(blocks.vertexCount());
    mesh.triangles.resize(blocks.triangleCount());
    std::atomic<bool> is_cancelled = false;
    parallelRanges(blocks.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
        if (is_cancelled || report.cancelled()) {
            is_cancelled = true;
            return;
        }
        for (std::size_t b = begin; b < end; ++b) BlockWriter(surface, blocks, blocks[b], mesh).write();
    });
    if (is_cancelled) throw Interrupted("mesh: stopped on request; nothing was written");
    return mesh;
}

/// Infinite and absurd densities are left to cutField.
double largestSigma(const VoxelField& field) {
    float largest = kEmptyRaw;
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        forEachBit(field.topology().voxels()[leaf], [&](int offset) {
            largest = std::max(largest, field.density()[leaf * kLeafVoxels + offset]);
        });
    return sigmaFromRaw(largest, field.densityScale());
}

double halfLightIso(const VoxelField& field) { return std::log(2.0) / field.frame().voxel_size; }

float rawFromSigma(double sigma, double density_scale) {
    return static_cast<float>(std::log(sigma / density_scale));
}

std::string text(double value) {
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.4g", value);
    return buffer;
}

void checkIso(double iso, float iso_raw, double density_scale) {
    if (!(iso > 0) || !std::isfinite(iso))
        throw UsageError("mesh: iso", text(iso), "a positive density in 1 / world unit");
    if (!(iso_raw > kEmptyRaw))
        throw UsageError(
            "mesh: iso", text(iso),
            "more than the density of an empty voxel, " + text(sigmaFromRaw(kEmptyRaw, density_scale)));
}

/// Float positions far from the origin are too coarse for the distance that keeps vertices apart.
void warnIfCoarse(const VoxelField& field, Report& report) {
    const Box box = field.worldBox();
    const double largest = std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
    if (largest * 0x1p-24 > kOffCorner * field.frame().voxel_size)
        report.warn(
            "mesh: coordinates up to " + text(largest) + " with voxels of " + text(field.frame().voxel_size) +
            " exceed what 32-bit floats tell apart; vertices may coincide. Move the scene to the origin");
}

std::string text(const Vec3d& p) { return text(p.x()) + ", " + text(p.y()) + ", " + text(p.z()); }

/// Closes the surface at the voxel planes nearest to the box's faces.
void closeAt(const Box& box, Surface& surface, Report& report) {
    const GridFrame& frame = surface.field.frame();
    // Beyond the field there is nothing to close; kept small, so that coordinates are no overflow.
    const Vec3d dims = surface.field.topology().dims().cast<double>();
    const auto plane = [&](const Vec3d& world) -> Vec3i {
        const Vec3d index = frame.indexFromWorld(world).array().round();
        return index.cwiseMax(-2.0 * Vec3d::Ones()).cwiseMin(dims + Vec3d::Ones()).cast<int>();
    };
    const VoxelBox bounds{plane(box.min), plane(box.max)};
    if ((bounds.max.array() <= bounds.min.array()).any())
        throw UsageError("mesh: bounds", text(box.min) + " to " + text(box.max),
                         "a box inside of the field that holds two planes of voxels along each axis");
    report.info("mesh: closed at the voxel planes " + text(frame.worldFromIndex(bounds.min.cast<double>())) + " and " +
                text(frame.worldFromIndex(bounds.max.cast<double>())));
    clipSurface(surface, bounds);
}

/// The field of a surface at the resolution that is asked for, unless that is its own.
std::optional<VoxelField> resampledField(Surface& surface, const MeshOptions& options) {
    if (options.resolution == 0) return std::nullopt;
    if (options.resolution < 1 || options.resolution > kMostResolution)
        throw UsageError("mesh: resolution", std::to_string(options.resolution),
                         "from 1 to " + std::to_string(kMostResolution) + " voxels along the longest side");
    const VoxelField& field = surface.field;
    const double voxel_size = field.worldBox().size().maxCoeff() / options.resolution;
    if (voxel_size == field.frame().voxel_size) return std::nullopt;
    if (voxel_size < field.frame().voxel_size) return finerField(surface, voxel_size);
    if (options.fill_inside) fillInside(surface);  // before walls become too thin to hold
    return coarserField(surface, voxel_size, options.colours);
}

}  // namespace

double automaticIso(const VoxelField& field) {
    return std::min(halfLightIso(field), 0.5 * largestSigma(field));
}

Mesh extractSurface(const Model& model, const MeshOptions& options, Report& report) {
    const VoxelField& field = model.field;
    if (field.topology().voxelCount() == 0)
        throw NumericError("mesh", "an empty field", "at least one active voxel", "train the model first");
    if (!(options.adaptivity >= 0 && options.adaptivity <= 1))
        throw UsageError("mesh: adaptivity", text(options.adaptivity), "a number from 0 to 1");
    const double iso = options.iso ? *options.iso : automaticIso(field);
    const float iso_raw = rawFromSigma(iso, field.densityScale());
    if (options.iso)
        checkIso(iso, iso_raw, field.densityScale());
    else if (!(iso_raw > kEmptyRaw))
        throw NumericError("mesh", "only empty voxels", "density somewhere", "train the model first");
    Surface cut = cutField(field, iso_raw);
    // The activation clamps: sigma never exceeds its value at kMaxRaw.
    if (iso_raw > std::min(cut.largest_raw, kMaxRaw))
        throw NumericError(
            "mesh: iso", text(iso) + " per world unit",
            "at most the field's maximum, " + text(sigmaFromRaw(cut.largest_raw, field.densityScale())),
            "choose a lower iso");
    const char* reason = options.iso ? ""
                         : iso < halfLightIso(field)
                             ? " (half of the field's maximum, which stops little light over one voxel)"
                             : " (half of the light stopped over one voxel)";
    report.info("mesh: surface at density " + text(iso) + " per world unit" + reason);
    warnIfCoarse(field, report);
    const std::optional<VoxelField> resampled = resampledField(cut, options);
    Surface surface = resampled ? cutField(*resampled, iso_raw) : std::move(cut);
    if (resampled && surface.largest_raw < iso_raw)
        throw NumericError("mesh: resolution", std::to_string(options.resolution), "voxels that are no larger than what they shall show",
                           "choose a higher resolution or a lower iso");
    if (options.fill_inside)
        report.info("mesh: " + std::to_string(fillInside(surface)) +
                    " voxels inside of closed surfaces are filled");
    if (options.bounds) closeAt(*options.bounds, surface, report);

    Mesh mesh = options.method == SurfaceMethod::dual ? dualSurface(surface, options.adaptivity)
                                                      : marchCubes(surface, report);
    if (mesh.triangles.empty())
        throw NumericError("mesh: bounds", "nothing inside of them at density " + text(iso),
                           "a part of the scene", "look at its box with 'nerfvdb info'");
    // A coarse surface may leave the voxels that the model has features for.
    const bool is_coarser = resampled && resampled->channels() > 0;
    if (options.colours) colourVertices(model.decoder, is_coarser ? *resampled : field, mesh);
    return mesh;
}

}  // namespace nerfvdb
