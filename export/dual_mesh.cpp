// SPDX-License-Identifier: Apache-2.0
#include "export/dual_mesh.h"

#include <openvdb/tools/VolumeToMesh.h>

#include <Eigen/Geometry>

#include "vdb/openvdb_grids.h"
#include "vdb/topology_tree.h"
#include "vdb/vdb_file.h"

namespace nerfvdb {
namespace {

/// Raw densities with the surface's inside: filled voxels are dense, those beyond its bounds hold nothing.
openvdb::FloatGrid::Ptr gridOf(const Surface& surface) {
    const VoxelField& field = surface.field;
    const Topology& topology = field.topology();
    const float filled = surface.iso + (surface.iso - kEmptyRaw);
    auto grid = openvdb::FloatGrid::create(kEmptyRaw);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);  // else values below iso would count as inside
    grid->setTransform(gridTransform(field.frame()));
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        auto* node = grid->tree().touchLeaf(leafOrigin(topology.leafCoords()[leaf]));
        const auto valueAt = [&](int offset) {
            const float raw = field.density()[leaf * kLeafVoxels + offset];
            const bool is_active = testBit(topology.voxels()[leaf], offset);
            if (testBit(surface.inside[leaf], offset)) return is_active && raw >= surface.iso ? raw : filled;
            return is_active && raw < surface.iso ? raw : kEmptyRaw;
        };
        for (int offset = 0; offset < kLeafVoxels; ++offset) node->setValueOn(offset, valueAt(offset));
    }
    Vec3i leaf;
    const Vec3i leaves = topology.dims() / kLeafDim;
    if (!surface.is_filled) return grid;
    for (leaf.x() = 0; leaf.x() < leaves.x(); ++leaf.x())
        for (leaf.y() = 0; leaf.y() < leaves.y(); ++leaf.y())
            for (leaf.z() = 0; leaf.z() < leaves.z(); ++leaf.z()) {
                if (!surface.enclosed.contains(leaf)) continue;
                auto* node = grid->tree().touchLeaf(leafOrigin(leaf));
                forEachBit(surface.bounds.maskOf(leaf), [&](int offset) { node->setValueOn(offset, filled); });
            }
    return grid;
}

void addNormals(Mesh& mesh) {
    mesh.normals.assign(mesh.positions.size(), Vec3f::Zero());
    for (const Triangle& t : mesh.triangles) {
        const Vec3f& a = mesh.positions[t[0]];
        const Vec3f twice_area = (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a);
        for (int k = 0; k < 3; ++k) mesh.normals[t[k]] += twice_area;
    }
    for (Vec3f& normal : mesh.normals) {
        const float length = normal.norm();
        normal = length > 0 ? Vec3f(normal / length) : Vec3f::UnitZ();  // faces that cancel have no side
    }
}

}  // namespace

Mesh dualSurface(const Surface& surface, double adaptivity) {
    openvdb::initialize();
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*gridOf(surface), points, triangles, quads, surface.iso, adaptivity);

    Mesh mesh;
    mesh.positions.reserve(points.size());
    for (const openvdb::Vec3s& p : points) mesh.positions.emplace_back(p.x(), p.y(), p.z());
    mesh.triangles.reserve(triangles.size() + 2 * quads.size());
    // OpenVDB's faces run clockwise seen from outside.
    for (const openvdb::Vec3I& t : triangles) mesh.triangles.emplace_back(t[2], t[1], t[0]);
    const auto length = [&](std::uint32_t a, std::uint32_t b) {
        return (mesh.positions[a] - mesh.positions[b]).squaredNorm();
    };
    for (const openvdb::Vec4I& q : quads) {
        const int first = length(q[0], q[2]) <= length(q[1], q[3]) ? 0 : 1;
        const auto corner = [&](int i) { return q[(first + i) % 4]; };
        mesh.triangles.emplace_back(corner(2), corner(1), corner(0));
        mesh.triangles.emplace_back(corner(3), corner(2), corner(0));
    }
    addNormals(mesh);
    return mesh;
}

}  // namespace nerfvdb
