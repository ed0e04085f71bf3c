// SPDX-License-Identifier: Apache-2.0
#include "export/block_fields.h"

#include <cmath>

#include "core/error.h"
#include "export/marching_cubes.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// Three blocks along x, 16 units of the first's coarsest voxels high.
BlockGrid threeBlocks() { return cutIntoBlocks({{0, 0, 0}, {120, 40, 16}}, 2, 3, 1); }

/// log of the extinction at a place: a wave, the same whichever block looks.
float wave(const Vec3d& at) { return static_cast<float>(1.5 + std::sin(0.2 * at.x()) + 0.5 * std::cos(0.3 * at.y() + 0.1 * at.z())); }

/// A block as training leaves it, at 2^level voxels per coarsest one: every cell of its box, and of one shell around it.
Model blockModel(const BlockGrid& grid, const BlockId& block, int level, const std::function<float(const Vec3d&)>& raw) {
    const Box box = grid.box(block);
    const double voxel_size = std::ldexp(grid.voxel_size, -level);
    Shells shells;
    for (int axis = 0; axis < 3; ++axis) shells.extent[axis] = static_cast<int>(std::lround(box.size()[axis] / voxel_size));
    shells.count = 2;
    shells.stride = (shells.extent.x() + 31) / 16 * 16;
    Vec3i dims = shells.extent + Vec3i::Constant(kLeafDim);
    dims.x() = 2 * shells.stride;
    std::vector<Topology::LeafCells> cells;
    for (int x = 0; x < shells.extent.x() / 8; ++x)
        for (int y = 0; y < shells.extent.y() / 8; ++y)
            for (int z = 0; z < shells.extent.z() / 8; ++z) {
                LeafMask all;
                all.fill(~std::uint64_t{0});
                cells.push_back({{x, y, z}, all});
            }
    cells.push_back({{shells.stride / 8, 0, 0}, {1, 0, 0, 0, 0, 0, 0, 0}});  // a cell of the shell around it
    Model model;
    model.field = VoxelField(Topology(dims, cells), {box.min, voxel_size}, shells, 8, 2.0);
    const Topology& topology = model.field.topology();
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const Vec3i voxel = topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            model.field.density()[leaf * kLeafVoxels + offset] =
                raw(model.field.frame().worldFromIndex(voxel.cast<double>()));
        });
    model.decoder = Decoder(8, 1);
    return model;
}

/// Raw density of a voxel of a field, or nothing.
std::optional<float> rawAt(const VoxelField& field, const Vec3d& world) {
    const Vec3d index = field.frame().indexFromWorld(world);
    const Vec3i voxel = (index + Vec3d::Constant(0.5)).array().floor().cast<int>();
    if ((voxel.array() < 0).any()) return std::nullopt;
    const int leaf = field.topology().findLeaf(voxel / kLeafDim);
    const int offset = brickOffset(voxel.x() & 7, voxel.y() & 7, voxel.z() & 7);
    if (leaf < 0 || !testBit(field.topology().voxels()[static_cast<std::size_t>(leaf)], offset)) return std::nullopt;
    return field.density()[static_cast<std::size_t>(leaf) * kLeafVoxels + static_cast<std::size_t>(offset)];
}

}  // namespace

TEST_CASE("blocks that fade add up to the scene", "[export]") {
    const BlockGrid grid = threeBlocks();
    std::vector<Model> faded;
    for (const BlockId& block : grid.blocks()) faded.push_back(fadedBlock(grid, block, blockModel(grid, block, 0, wave)));
    for (const Model& model : faded) CHECK(model.field.shells().count == 1);
    int n_shared = 0;
    for (double x = 0; x <= 120; x += grid.voxel_size)
        for (const double y : {0.0, 8.0, 31.0}) {
            const Vec3d at = grid.origin + grid.voxel_size * ((Vec3d(x, y, 5) / grid.voxel_size).array().floor().matrix());
            double sigma = 0;
            int n = 0;
            for (const Model& model : faded)
                if (const auto raw = rawAt(model.field, at)) {
                    sigma += sigmaFromRaw(*raw, model.field.densityScale());
                    ++n;
                }
            REQUIRE(n >= 1);
            n_shared += n > 1;
            CHECK(sigma == Approx(sigmaFromRaw(wave(at), 2.0)).epsilon(1e-5));  // logarithms in single precision
        }
    CHECK(n_shared > 10);
}

TEST_CASE("joined blocks are the field that each of them has a part of, also of different levels", "[export]") {
    const BlockGrid grid = threeBlocks();
    std::vector<BlockDensity> parts;
    for (const BlockId& block : grid.blocks())
        parts.push_back(densityOfBlock(grid, block, blockModel(grid, block, block.i == 1 ? 1 : 0, wave)));
    const Model joined = joinBlocks(grid, std::move(parts));
    CHECK(joined.field.channels() == 0);
    CHECK(joined.field.frame().voxel_size == grid.voxel_size / 2);
    for (double x = 0; x <= 120; x += grid.voxel_size / 2) {
        const Vec3d at =
            grid.origin + grid.voxel_size / 2 * ((Vec3d(x, 8, 5) / (grid.voxel_size / 2)).array().floor().matrix());
        const auto raw = rawAt(joined.field, at);
        REQUIRE(raw);
        // Half-way between coarse voxels the wave is a mean: half a voxel squared times its curvature, 0.04 / 2 at most.
        CHECK(*raw == Approx(wave(at)).margin(0.02));
    }
}

TEST_CASE("a body across the borders of blocks has one closed surface and no wall inside", "[export]") {
    const BlockGrid grid = threeBlocks();
    const Vec3d centre = grid.region().center();
    const auto bar = [&](const Vec3d& at) {  // 90 long, 6 thick: through both borders
        const Vec3d apart = (at - centre).cwiseAbs() - Vec3d(45, 3, 3);
        return static_cast<float>(-4 * apart.maxCoeff());
    };
    std::vector<BlockDensity> parts;
    for (const BlockId& block : grid.blocks()) parts.push_back(densityOfBlock(grid, block, blockModel(grid, block, 1, bar)));
    const Model joined = joinBlocks(grid, std::move(parts));
    MeshOptions options;
    options.colours = false;
    options.iso = 2.0;  // where the logarithm is zero
    Report silent;
    const Mesh mesh = extractSurface(joined, options, silent);
    const MeshMeasures measures = measureMesh(mesh);
    CHECK(measures.closed());
    CHECK(measures.pieces == 1);
    CHECK(measures.euler == 2);
    CHECK(measures.volume == Approx(90 * 6 * 6).epsilon(0.05));  // corners are rounded by a voxel of 0.5
}

TEST_CASE("a model that is no block of the grid is refused", "[export]") {
    const BlockGrid grid = threeBlocks();
    const Model first = blockModel(grid, {0, 0}, 0, wave);
    CHECK_THROWS_AS(fadedBlock(grid, {1, 0}, first), DataError);
    CHECK_THROWS_AS(densityOfBlock(grid, {2, 0}, first), DataError);
    CHECK_THROWS_AS(joinBlocks(grid, {}), DataError);
    const BlockGrid other = cutIntoBlocks({{0, 0, 0}, {130, 40, 16}}, 2, 3, 1);
    CHECK_THROWS_AS(fadedBlock(other, {0, 0}, first), DataError);
}
