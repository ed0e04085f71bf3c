// SPDX-License-Identifier: Apache-2.0
// Marching cubes on leaf blocks. One pass over the leaves says which voxels are inside (surface_cells.h); a
// survey of each block counts its vertices and triangles, and prefix sums give every block its place in the
// mesh (surface_blocks.h); a last pass fills the places (block_mesh.h), all at once or part by part.
#include "export/marching_cubes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "export/block_mesh.h"
#include "export/dual_mesh.h"
#include "export/fill_inside.h"
#include "export/mesh_cleanup.h"
#include "export/resample_field.h"
#include "export/surface_blocks.h"
#include "export/surface_crossing.h"
#include "export/vertex_colours.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kBlocksPerPart = 8192;  // of a stream: some 30 MB

/// Calls body(block) for the blocks [begin, end), on all threads.
template <typename Body>
void forEachBlock(const BlockList& blocks, std::size_t begin, std::size_t end, Report& report,
                  const Body& body) {
    std::atomic<bool> is_cancelled = false;
    parallelRanges(end - begin, kBlocksPerTask, [&](std::size_t from, std::size_t to) {
        if (is_cancelled || report.cancelled()) {
            is_cancelled = true;
            return;
        }
        for (std::size_t b = begin + from; b < begin + to; ++b) body(blocks[b]);
    });
    if (is_cancelled) throw Interrupted("mesh: stopped on request; nothing was written");
}

Mesh marchCubes(const Surface& surface, Report& report) {
    const BlockList blocks(surface);
    Mesh mesh;
    mesh.positions.resize(blocks.vertexCount());
    mesh.normals.resize(blocks.vertexCount());
    mesh.triangles.resize(blocks.triangleCount());
    forEachBlock(blocks, 0, blocks.size(), report, [&](const Block& block) {
        writeBlockVertices(surface, block, mesh.positions.data() + block.first_vertex,
                           mesh.normals.data() + block.first_vertex);
        writeBlockTriangles(surface, blocks, block, mesh.triangles.data() + block.first_triangle);
    });
    return mesh;
}

/// Takes away the triangles that only close the surface, and the vertices that are left over.
void openSurface(const Surface& surface, Mesh& mesh, Report& report) {
    const BlockList blocks(surface);
    std::vector<std::uint8_t> is_closing(mesh.triangles.size());
    forEachBlock(blocks, 0, blocks.size(), report, [&](const Block& block) {
        markClosingTriangles(surface, block, is_closing.data() + block.first_triangle);
    });
    std::size_t n = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        if (!is_closing[t]) mesh.triangles[n++] = mesh.triangles[t];
    mesh.triangles.resize(n);
    if (mesh.triangles.empty())
        throw NumericError("mesh: open", "no surface but the border of what is known", "a surface within it",
                           "choose a higher iso, or let it be closed");
    removeIslands(mesh, {});  // no piece, but such vertices
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
    if (largest * 0x1p-24 <= kOffCorner * field.frame().voxel_size) return;
    report.warn("mesh: coordinates up to " + text(largest) + " with voxels of " + text(field.frame().voxel_size) +
                " exceed what 32-bit floats tell apart; vertices may coincide. 'nerfvdb mesh --origin X,Y,Z', with a point of the "
                "scene, keeps them apart");
}

std::string text(const Vec3d& p) { return text(p.x()) + ", " + text(p.y()) + ", " + text(p.z()); }

[[noreturn]] void throwNothing(const MeshOptions& options) {
    const Box box = options.bounds.value_or(Box{});
    throw NumericError("mesh: bounds", "nothing inside of " + text(box.min) + " to " + text(box.max),
                       "a part of the scene", "look at its box with 'nerfvdb info'");
}

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
    report.info("mesh: closed at the voxel planes " + text(frame.worldFromIndex(bounds.min.cast<double>())) +
                " and " + text(frame.worldFromIndex(bounds.max.cast<double>())));
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
    if (std::abs(voxel_size / field.frame().voxel_size - 1) < 1e-9) return std::nullopt;
    if (voxel_size < field.frame().voxel_size) return finerField(surface, voxel_size);
    if (options.fill_inside) fillInside(surface);  // before walls become too thin to hold
    return coarserField(surface, voxel_size, options.colours);
}

/// What is to be meshed.
struct Cut {
    std::optional<VoxelField> resampled;
    std::optional<Surface> surface;  // of `resampled` or of the model's field

    /// Where colours come from: a coarse surface may leave the voxels that the model has features for.
    const VoxelField& featured(const Model& model) const {
        return resampled && resampled->channels() > 0 ? *resampled : model.field;
    }
};

/// Fills `made`, in place: the surface refers to the field beside it.
void cutModel(const Model& model, const MeshOptions& options, Report& report, Cut& made) {
    const VoxelField& field = model.field;
    if (field.topology().leafCount() == 0)
        throw NumericError("mesh", "an empty field", "at least one active voxel", "train the model first");
    if (!(options.adaptivity >= 0 && options.adaptivity <= 1))
        throw UsageError("mesh: adaptivity", text(options.adaptivity), "a number from 0 to 1");
    if (options.open && options.method != SurfaceMethod::marching_cubes)
        throw UsageError("mesh: open", "the dual method", "marching cubes, whose vertices tell where they lie");
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
    made.resampled = resampledField(cut, options);
    Surface& surface =
        made.surface.emplace(made.resampled ? cutField(*made.resampled, iso_raw) : std::move(cut));
    if (made.resampled && surface.largest_raw < iso_raw)
        throw NumericError("mesh: resolution", std::to_string(options.resolution),
                           "voxels no larger than what they shall show",
                           "choose a higher resolution or a lower iso");
    if (options.fill_inside)
        report.info("mesh: " + std::to_string(fillInside(surface)) +
                    " voxels inside of closed surfaces are filled");
    if (options.bounds) closeAt(*options.bounds, surface, report);
}

}  // namespace

double largestSigma(const VoxelField& field) {
    float largest = kEmptyRaw;
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        forEachBit(field.topology().voxels()[leaf], [&](int offset) {
            largest = std::max(largest, field.density()[leaf * kLeafVoxels + offset]);
        });
    return sigmaFromRaw(largest, field.densityScale());
}

double automaticIso(const VoxelField& field) {
    return std::min(halfLightIso(field), 0.5 * largestSigma(field));
}

Mesh extractSurface(const Model& model, const MeshOptions& options, Report& report) {
    Cut cut;
    cutModel(model, options, report, cut);
    Mesh mesh = options.method == SurfaceMethod::dual ? dualSurface(*cut.surface, options.adaptivity)
                                                      : marchCubes(*cut.surface, report);
    if (mesh.triangles.empty()) throwNothing(options);
    if (options.open) openSurface(*cut.surface, mesh, report);
    if (options.colours) colourVertices(model.decoder, cut.featured(model), mesh);
    return mesh;
}

void streamSurface(const Model& model, const MeshOptions& options, MeshSink& sink, Report& report) {
    if (options.method != SurfaceMethod::marching_cubes)
        throw UsageError("mesh: stream", "the dual method", "marching cubes, which alone is made part by part");
    if (options.open) throw UsageError("mesh: stream", "an open surface", "a closed one, whose triangles are counted before they are made");
    Cut cut;
    cutModel(model, options, report, cut);
    const Surface& surface = *cut.surface;
    const BlockList blocks(surface);
    if (blocks.triangleCount() == 0) throwNothing(options);
    sink.begin(blocks.vertexCount(), blocks.triangleCount());
    const auto forEachPart = [&](const auto& body) {
        for (std::size_t begin = 0; begin < blocks.size(); begin += kBlocksPerPart)
            body(begin, std::min(begin + kBlocksPerPart, blocks.size()));
    };
    forEachPart([&](std::size_t begin, std::size_t end) {
        const std::size_t first = blocks[begin].first_vertex;
        const std::size_t last = end < blocks.size() ? blocks[end].first_vertex : blocks.vertexCount();
        Mesh part;
        part.positions.resize(last - first);
        part.normals.resize(last - first);
        forEachBlock(blocks, begin, end, report, [&](const Block& block) {
            writeBlockVertices(surface, block, part.positions.data() + (block.first_vertex - first),
                               part.normals.data() + (block.first_vertex - first));
        });
        if (options.colours) colourVertices(model.decoder, cut.featured(model), part);
        sink.addVertices(part);
    });
    forEachPart([&](std::size_t begin, std::size_t end) {
        const std::size_t first = blocks[begin].first_triangle;
        const std::size_t last = end < blocks.size() ? blocks[end].first_triangle : blocks.triangleCount();
        std::vector<Triangle> part(last - first);
        forEachBlock(blocks, begin, end, report, [&](const Block& block) {
            writeBlockTriangles(surface, blocks, block, part.data() + (block.first_triangle - first));
        });
        sink.addTriangles(part);
    });
}

}  // namespace nerfvdb
