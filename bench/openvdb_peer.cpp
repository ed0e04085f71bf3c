// SPDX-License-Identifier: Apache-2.0
#include <openvdb/tools/VolumeToMesh.h>

#include <memory>
#include <vector>

#include "bench/mesh_peers.h"
#include "vdb/openvdb_grids.h"

namespace nerfvdb {

MeshPeer volumeToMeshPeer(const VoxelField& field, float iso) {
    openvdb::initialize();
    auto grid = openvdb::FloatGrid::create(kEmptyRaw);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    const Topology& topology = field.topology();
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        const Vec3i origin = topology.leafCoords()[leaf] * kLeafDim;
        auto* node = grid->tree().touchLeaf({origin.x(), origin.y(), origin.z()});
        forEachBit(topology.voxels()[leaf],
                   [&](int offset) { node->setValueOn(offset, field.density()[leaf * kLeafVoxels + offset]); });
    }
    return {"OpenVDB volumeToMesh", [grid, iso] {
                std::vector<openvdb::Vec3s> points;
                std::vector<openvdb::Vec3I> triangles;
                std::vector<openvdb::Vec4I> quads;
                openvdb::tools::volumeToMesh(*grid, points, triangles, quads, iso, 0.0);
                return PeerMesh{triangles.size() + 2 * quads.size(),
                                points.size() * sizeof(points[0]) + triangles.size() * sizeof(triangles[0]) +
                                    quads.size() * sizeof(quads[0])};
            }};
}

std::function<void()> plainWriter(const std::filesystem::path& from, const std::filesystem::path& to) {
    openvdb::initialize();
    openvdb::io::File file(from.string());
    file.open(false);
    const auto grids = file.getGrids();
    const auto facts = file.getMetadata();
    return [grids, facts, to] {
        openvdb::io::File out(to.string());
        out.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
        out.write(*grids, *facts);
    };
}

}  // namespace nerfvdb
