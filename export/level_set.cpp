// SPDX-License-Identifier: Apache-2.0
#include "export/level_set.h"

#include <openvdb/tools/MeshToVolume.h>

#include <string>

#include "core/error.h"
#include "vdb/openvdb_grids.h"
#include "vdb/vdb_file.h"

namespace nerfvdb {

std::size_t writeLevelSet(const std::filesystem::path& path, const Mesh& mesh, double voxel_size,
                          const Similarity& placement) {
    constexpr float kHalfWidth = 3;  // voxels; what OpenVDB's level-set tools expect
    if (mesh.triangles.empty()) throw DataError("level set", "a mesh without triangles", "a surface");
    if (const MeshMeasures measures = measureMesh(mesh); !measures.closed())
        throw DataError("level set",
                        "a mesh with " + std::to_string(measures.open_edges + measures.bad_edges) + " edges that are not shared by two triangles",
                        "a closed surface, which has an inside");
    openvdb::initialize();
    std::vector<openvdb::Vec3s> points;
    points.reserve(mesh.positions.size());
    for (const Vec3f& position : mesh.positions) {
        const Vec3d placed = placement.apply(position.cast<double>());
        points.emplace_back(static_cast<float>(placed.x()), static_cast<float>(placed.y()),
                            static_cast<float>(placed.z()));
    }
    std::vector<openvdb::Vec3I> triangles;
    triangles.reserve(mesh.triangles.size());
    for (const Triangle& triangle : mesh.triangles) triangles.emplace_back(triangle.x(), triangle.y(), triangle.z());

    const auto transform = gridTransform({Vec3d::Zero(), voxel_size * placement.scale});
    const auto grid =
        openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, points, triangles, kHalfWidth);
    grid->setName("surface");
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    grid->setCreator("nerfvdb");
    openvdb::MetaMap facts;
    facts.insertMeta("creator", openvdb::StringMetadata("nerfvdb"));
    writeVdb(path, {grid}, facts);
    return grid->activeVoxelCount();
}

}  // namespace nerfvdb
