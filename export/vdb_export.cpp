// SPDX-License-Identifier: Apache-2.0
#include "export/vdb_export.h"

#include <openvdb/tools/Morphology.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/error.h"
#include "core/image.h"
#include "core/parallel.h"
#include "vdb/topology_tree.h"
#include "vdb/vdb_file.h"

namespace nerfvdb {
namespace {

using FloatLeaf = openvdb::FloatTree::LeafNodeType;
using ColorLeaf = openvdb::Vec3STree::LeafNodeType;

double alphaOverVoxel(double sigma, double voxel_size) { return -std::expm1(-sigma * voxel_size); }

/// [leaf] voxels that are worth writing.
std::vector<LeafMask> visibleVoxels(const VoxelField& field, double min_alpha) {
    const Topology& topology = field.topology();
    std::vector<LeafMask> kept(topology.leafCount(), LeafMask{});
    parallelFor(topology.leafCount(), [&](std::size_t i) {
        forEachBit(topology.voxels()[i], [&](int offset) {
            const float sigma = sigmaFromRaw(field.density()[i * kLeafVoxels + offset], field.densityScale());
            if (sigma > 0 && alphaOverVoxel(sigma, field.frame().voxel_size) >= min_alpha) setBit(kept[i], offset);
        });
    });
    return kept;
}

/// The largest opacity that left-out voxels sum to along any line of voxels parallel to an axis.
double lostOpacity(const VoxelField& field, std::span<const LeafMask> kept) {
    const Topology& topology = field.topology();
    const Vec3i dims = topology.dims();
    double largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        std::vector<float> column(static_cast<std::size_t>(dims[u]) * dims[v], 0.0f);  // optical depth
        for (std::size_t i = 0; i < topology.leafCount(); ++i)
            forEachBit(topology.voxels()[i], [&](int offset) {
                if (testBit(kept[i], offset)) return;
                const Vec3i ijk = topology.leafCoords()[i] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
                const float sigma = sigmaFromRaw(field.density()[i * kLeafVoxels + offset], field.densityScale());
                column[static_cast<std::size_t>(ijk[u]) * dims[v] + ijk[v]] +=
                    sigma * static_cast<float>(field.frame().voxel_size);
            });
        for (const float tau : column) largest = std::max(largest, -std::expm1(-static_cast<double>(tau)));
    }
    return largest;
}

openvdb::FloatGrid::Ptr densityGrid(const VoxelField& field, std::span<const LeafMask> kept, bool half) {
    std::vector<FloatLeaf*> leaves(kept.size(), nullptr);
    std::vector<float> largest(kept.size(), 0.0f);
    parallelFor(kept.size(), [&](std::size_t i) {
        if (kept[i] == LeafMask{}) return;
        leaves[i] = new FloatLeaf(leafOrigin(field.topology().leafCoords()[i]), 0.0f);
        forEachBit(kept[i], [&](int offset) {
            const float sigma = volumeSigma(field.density()[i * kLeafVoxels + offset], field.densityScale(),
                                            field.frame().voxel_size);
            leaves[i]->setValueOn(offset, sigma);
            largest[i] = std::max(largest[i], sigma);
        });
    });
    auto grid = openvdb::FloatGrid::create(0.0f);
    for (FloatLeaf* leaf : leaves)
        if (leaf) grid->tree().addLeaf(leaf);
    const float top = largest.empty() ? 0.0f : *std::max_element(largest.begin(), largest.end());
    grid->setName("density");
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setSaveFloatAsHalf(half && halfSuffices(top, field.frame().voxel_size));
    return grid;
}

/// The voxels of `density` and their neighbours, as far as the model has values there.
openvdb::MaskTree colorVoxels(const openvdb::FloatTree& density, const Topology& topology) {
    openvdb::MaskTree wanted(density, false, true, openvdb::TopologyCopy());
    openvdb::tools::dilateActiveValues(wanted, 1, openvdb::tools::NN_FACE_EDGE_VERTEX,
                                       openvdb::tools::IGNORE_TILES);
    wanted.topologyIntersection(voxelTree(topology));
    return wanted;
}

openvdb::Vec3SGrid::Ptr colorGrid(const Model& model, const openvdb::MaskTree& voxels, bool half) {
    const VoxelField& field = model.field;
    const auto channels = static_cast<std::size_t>(field.channels());
    std::vector<const openvdb::MaskTree::LeafNodeType*> masks;
    for (auto leaf = voxels.cbeginLeaf(); leaf; ++leaf)
        if (!leaf->isEmpty()) masks.push_back(&*leaf);

    struct Scratch {
        std::vector<float> features, rgb;
        std::vector<int> offsets;
    };
    PerThread<Scratch> scratch;
    std::vector<ColorLeaf*> leaves(masks.size());
    parallelFor(masks.size(), [&](std::size_t i) {
        Scratch& work = scratch.local();
        work.features.clear();
        work.offsets.clear();
        const openvdb::Coord origin = masks[i]->origin();
        const int brick = field.topology().findLeaf(Vec3i(origin.x(), origin.y(), origin.z()) / kLeafDim);
        forEachBit(leafMask(masks[i]->getValueMask()), [&](int offset) {
            const std::size_t voxel = static_cast<std::size_t>(brick) * kLeafVoxels + offset;
            const auto in = field.features().subspan(voxel * channels, channels);
            work.features.insert(work.features.end(), in.begin(), in.end());
            work.offsets.push_back(offset);
        });
        const std::size_t n = work.offsets.size();
        work.rgb.resize(n * 3);
        model.decoder.diffuse(static_cast<int>(n), work.features.data(), work.rgb.data());
        leaves[i] = new ColorLeaf(origin, openvdb::Vec3s(0.0f));
        for (std::size_t k = 0; k < n; ++k)
            leaves[i]->setValueOn(work.offsets[k], openvdb::Vec3s(linearFromSrgb(work.rgb[k * 3]),
                                                                  linearFromSrgb(work.rgb[k * 3 + 1]),
                                                                  linearFromSrgb(work.rgb[k * 3 + 2])));
    });
    auto grid = openvdb::Vec3SGrid::create(openvdb::Vec3s(0.0f));
    for (ColorLeaf* leaf : leaves) grid->tree().addLeaf(leaf);
    grid->setName("color");
    grid->setVectorType(openvdb::VEC_INVARIANT);  // a colour does not turn with the grid
    grid->setSaveFloatAsHalf(half);
    return grid;
}

std::string percent(double share) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2g %%", 100 * share);
    return text;
}

}  // namespace

ExportVdbReport exportVdb(const Model& model, const std::filesystem::path& path, const ExportVdbOptions& options) {
    if (!(options.min_alpha >= 0 && options.min_alpha < 1))
        throw UsageError("min_alpha", std::to_string(options.min_alpha), "a number in [0, 1)");
    const VoxelField& field = model.field;
    openvdb::initialize();

    const std::vector<LeafMask> kept = visibleVoxels(field, options.min_alpha);
    openvdb::FloatGrid::Ptr density = densityGrid(field, kept, options.half);
    density->setTransform(gridTransform(field.frame()));
    density->setCreator("nerfvdb");
    openvdb::GridCPtrVec grids{density};
    if (options.color == ExportVdbOptions::Color::diffuse) {
        auto color = colorGrid(model, colorVoxels(density->tree(), field.topology()), options.half);
        color->setTransform(density->transformPtr()->copy());
        color->setCreator("nerfvdb");
        grids.push_back(color);
    }

    openvdb::MetaMap facts;
    facts.insertMeta("creator", openvdb::StringMetadata("nerfvdb"));
    facts.insertMeta("density_unit", openvdb::StringMetadata("1 / world unit"));
    if (grids.size() > 1) facts.insertMeta("color_space", openvdb::StringMetadata("linear Rec. 709"));
    writeVdb(path, grids, facts);

    ExportVdbReport report;
    report.active_voxels = density->activeVoxelCount();
    report.left_out = field.topology().voxelCount() - report.active_voxels;
    report.lost_opacity = lostOpacity(field, kept);
    report.bytes = std::filesystem::file_size(path);
    report.half = density->saveFloatAsHalf();
    if (report.active_voxels > 0) {
        const openvdb::CoordBBox box = density->evalActiveVoxelBoundingBox();
        const auto world = [&](const openvdb::Coord& ijk) {
            return field.frame().worldFromIndex(Vec3d(ijk.x(), ijk.y(), ijk.z()));
        };
        report.bounds = {world(box.min()), world(box.max())};
    }
    if (report.left_out > 0)
        report.lost.push_back(std::to_string(report.left_out) + " voxels of alpha below " +
                              percent(options.min_alpha) + " are left out; along a line they add up to an opacity of " +
                              percent(report.lost_opacity) + " at most");
    report.lost.push_back(options.color == ExportVdbOptions::Color::none
                              ? "colour is left out"
                              : "colour is the mean over all directions: reflections do not move with the eye");
    report.lost.push_back("other programs interpolate density itself, not its logarithm: borders turn out softer");
    return report;
}

}  // namespace nerfvdb
