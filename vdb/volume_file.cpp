// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume_file.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <new>

#include "core/error.h"
#include "core/parallel.h"
#include "vdb/openvdb_grids.h"
#include "vdb/topology_tree.h"
#include "vdb/vdb_file.h"

namespace nerfvdb {
namespace {

using FloatLeaf = openvdb::FloatTree::LeafNodeType;
using ColorLeaf = openvdb::Vec3STree::LeafNodeType;
constexpr const char* kBackground = "background_srgb";
constexpr double kSameVoxel = 1e-3;  // voxels between two grids that do not matter
constexpr std::uint64_t kMostVoxels = std::uint64_t{1} << 31;  // a file of constant tiles can claim any number

// ---- Writing ----

openvdb::math::Transform::Ptr volumeTransform(const Volume& volume) {
    // Voxel coordinates in the file are those that the volume was made with.
    openvdb::math::Transform::Ptr transform = gridTransform(volume.givenFrame());
    const Similarity& placed = volume.worldFromGrid();
    if (placed.rotation != Mat3d::Identity() || placed.translation != Vec3d::Zero()) {
        // OpenVDB multiplies rows from the left: its matrices are transposed.
        openvdb::Mat4d matrix = openvdb::Mat4d::identity();
        for (int row = 0; row < 3; ++row)
            for (int column = 0; column < 3; ++column) matrix(row, column) = placed.rotation(column, row);
        matrix.setTranslation(openvdb::Vec3d(placed.translation.data()));
        transform->postMult(matrix);
    }
    return transform;
}

/// Of values that are not negative, whole leaves of them.
float largestOf(std::span<const float> values) {
    std::array<float, 16> largest{};  // side by side: a maximum need not wait for the one before
    for (std::size_t i = 0; i < values.size(); i += largest.size())
        for (std::size_t lane = 0; lane < largest.size(); ++lane)
            largest[lane] = std::max(largest[lane], values[i + lane]);
    return *std::max_element(largest.begin(), largest.end());
}

/// A grid whose leaves `makeLeaf(leaf number, origin)` gives, null where there is none.
template <typename Grid, typename MakeLeaf>
typename Grid::Ptr gridOfLeaves(const Volume& volume, const typename Grid::ValueType& zero, const MakeLeaf& makeLeaf) {
    using Leaf = typename Grid::TreeType::LeafNodeType;
    const Topology& topology = volume.topology();
    std::vector<Leaf*> leaves(topology.leafCount(), nullptr);
    parallelFor(leaves.size(), [&](std::size_t i) {
        leaves[i] = makeLeaf(i, leafOrigin(topology.leafCoords()[i] + volume.firstVoxel() / kLeafDim));
    });
    auto grid = Grid::create(zero);
    for (Leaf* leaf : leaves)
        if (leaf) grid->tree().addLeaf(leaf);
    grid->setCreator("nerfvdb");
    return grid;
}

/// Active is what is larger than zero; everything else is zero (Volume::sigma), as it must be beside active values.
openvdb::FloatGrid::Ptr densityGrid(const Volume& volume) {
    return gridOfLeaves<openvdb::FloatGrid>(volume, 0.0f, [&](std::size_t leaf, const openvdb::Coord& origin) {
        const std::span<const float> sigma = volume.sigma().subspan(leaf * kLeafVoxels, kLeafVoxels);
        LeafMask mask{};
        for (int offset = 0; offset < kLeafVoxels; ++offset)
            mask[offset >> 6] |= std::uint64_t{sigma[offset] > 0} << (offset & 63);
        if (mask == LeafMask{}) return static_cast<FloatLeaf*>(nullptr);
        auto* const made = new FloatLeaf(origin, 0.0f);
        std::copy(sigma.begin(), sigma.end(), made->buffer().data());
        made->setValueMask(nodeMask(mask));
        return made;
    });
}

openvdb::Vec3SGrid::Ptr colorGrid(const Volume& volume) {
    return gridOfLeaves<openvdb::Vec3SGrid>(
        volume, openvdb::Vec3s(0.0f), [&](std::size_t leaf, const openvdb::Coord& origin) {
            const float* const color = &volume.color()[leaf * kLeafVoxels * Volume::kChannels];
            ColorLeaf* made = nullptr;
            forEachBit(volume.topology().voxels()[leaf], [&](int offset) {
                const openvdb::Vec3s value(color + offset * Volume::kChannels);
                if (value == openvdb::Vec3s(0.0f)) return;
                if (!made) made = new ColorLeaf(origin, openvdb::Vec3s(0.0f));
                made->setValueOn(offset, value);
            });
            return made;
        });
}

// ---- Reading ----

openvdb::FloatGrid::Ptr findDensity(const openvdb::GridPtrVec& grids, const std::string& path) {
    std::vector<openvdb::FloatGrid::Ptr> fogs;
    std::string names;
    bool has_density = false;  // of a type that is none
    for (const openvdb::GridBase::Ptr& grid : grids) {
        const bool is_level_set = grid->getGridClass() == openvdb::GRID_LEVEL_SET;
        const bool is_density = grid->getName() == "density";
        if (is_density && is_level_set)
            throw DataError(path + ": density", "a level set, which holds distances", "a fog volume",
                            "convert it, for example with OpenVDB's sdfToFogVolume");
        const auto found = openvdb::gridPtrCast<openvdb::FloatGrid>(grid);
        if (found && is_density) return found;
        if (found && !is_level_set) fogs.push_back(found);
        has_density |= is_density;
        names += (names.empty() ? "'" : ", '") + grid->getName() + "' (" + grid->valueType() +
                 (is_level_set ? ", level set)" : ")");
    }
    if (fogs.size() == 1 && !has_density) return fogs.front();
    throw DataError(path, grids.empty() ? "no grids" : "the grids " + names, "a float grid 'density'",
                    grids.empty() ? "" : "rename or convert the grid that holds the extinction");
}

openvdb::Vec3SGrid::Ptr findColor(const openvdb::GridPtrVec& grids) {
    for (const char* name : {"color", "Cd"})
        for (const openvdb::GridBase::Ptr& grid : grids)
            if (auto found = openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid); found && grid->getName() == name)
                return found;
    return nullptr;
}

/// The frame and the place of a grid whose voxels are cubes, perhaps turned.
void readTransform(const openvdb::math::Transform& transform, const std::string& where, GridFrame& frame,
                   Similarity& placed) {
    Mat3d axes;
    const openvdb::Vec3d origin = transform.indexToWorld(openvdb::Vec3d(0.0));
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d unit(0.0);
        unit[axis] = 1;
        axes.col(axis) = Vec3d((transform.indexToWorld(unit) - origin).asPointer());
    }
    const double size = axes.col(0).norm();
    const Mat3d rotation = axes / size;
    const double bend = (rotation.transpose() * rotation - Mat3d::Identity()).cwiseAbs().maxCoeff();
    if (!transform.isLinear() || !std::isfinite(size) || !(bend < 1e-6) || !(rotation.determinant() > 0))
        throw DataError(where, "voxels that are no cubes (stretched, sheared, mirrored or in perspective)",
                        "cubes, perhaps turned", "resample the grid, for example with OpenVDB's resampleToMatch");
    frame.voxel_size = size;
    const Vec3d first(origin.asPointer());
    if ((rotation - Mat3d::Identity()).cwiseAbs().maxCoeff() < 1e-12) {
        frame.origin = first;
    } else {
        placed.rotation = rotation;
        placed.translation = first;
    }
}

/// True if a voxel of one grid is the voxel of the other with the same index, wherever `density` has something.
/// OpenVDB's own comparison of transforms takes those that differ by single precision's rounding for different.
bool haveSameVoxels(const openvdb::FloatGrid& density, const openvdb::Vec3SGrid& color) {
    if (!color.transform().isLinear()) return false;
    const openvdb::CoordBBox box = density.evalActiveVoxelBoundingBox();
    for (int corner = 0; corner < 8 && !box.empty(); ++corner) {
        const openvdb::Vec3d at(corner & 4 ? box.max().x() : box.min().x(), corner & 2 ? box.max().y() : box.min().y(),
                                corner & 1 ? box.max().z() : box.min().z());
        if (!((color.worldToIndex(density.indexToWorld(at)) - at).length() < kSameVoxel)) return false;
    }
    return true;
}

void checkDensity(const openvdb::FloatGrid& density, const std::string& where) {
    if (density.activeVoxelCount() > kMostVoxels)
        throw DataError(where, std::to_string(density.activeVoxelCount()) + " active voxels", "at most 2^31",
                        "resample the volume coarser");
    if (density.background() != 0)
        throw DataError(where, "a grid background of " + std::to_string(density.background()) + ", so endless fog",
                        "a grid background of 0", "change it, for example with OpenVDB's changeBackground");
}

std::vector<Topology::LeafCells> activeLeaves(const openvdb::MaskTree& tree) {
    std::vector<Topology::LeafCells> leaves;
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        const openvdb::Coord origin = leaf->origin();
        leaves.push_back({Vec3i(origin.x() >> 3, origin.y() >> 3, origin.z() >> 3), leafMask(leaf->getValueMask())});
    }
    return leaves;
}

/// Volume's constructor, with the file's name before its complaints.
Volume volumeOf(const std::vector<Topology::LeafCells>& active, const GridFrame& frame, const std::string& path) {
    try {
        return Volume(active, frame);
    } catch (const DataError& error) {
        throw DataError(path + ": " + error.what());
    }
}

void fillValues(const openvdb::FloatGrid& density, const openvdb::Vec3SGrid& color, const std::string& path,
                Volume& volume) {
    const Topology& topology = volume.topology();
    std::vector<char> is_bad(topology.leafCount(), 0);
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        const Vec3i first = topology.leafCoords()[leaf] * kLeafDim + volume.firstVoxel();
        const auto sigma_at = density.getConstUnsafeAccessor();
        const auto color_at = color.getConstUnsafeAccessor();
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const Vec3i ijk = first + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            const openvdb::Coord at(ijk.x(), ijk.y(), ijk.z());
            const std::size_t voxel = leaf * kLeafVoxels + offset;
            const float sigma = sigma_at.getValue(at);
            is_bad[leaf] |= !(sigma >= 0) || !std::isfinite(sigma);
            volume.sigma()[voxel] = sigma;
            const openvdb::Vec3s value = color_at.getValue(at);
            for (int c = 0; c < 3; ++c) {
                is_bad[leaf] |= !(value[c] >= 0) || !std::isfinite(value[c]);
                volume.color()[voxel * Volume::kChannels + c] = value[c];
            }
        });
    });
    const auto bad = std::find(is_bad.begin(), is_bad.end(), 1);
    if (bad == is_bad.end()) return;
    const Vec3i leaf = topology.leafCoords()[bad - is_bad.begin()] * kLeafDim + volume.firstVoxel();
    throw DataError(path + ": a voxel of the leaf at index (" + std::to_string(leaf.x()) + ", " +
                        std::to_string(leaf.y()) + ", " + std::to_string(leaf.z()) + ")",
                    "a density or colour that is negative or not finite", "finite values from zero on");
}

}  // namespace

WrittenVolume writeVolume(const std::filesystem::path& path, const Volume& volume, const WriteVolumeOptions& options) {
    openvdb::initialize();
    const openvdb::FloatGrid::Ptr density = densityGrid(volume);
    density->setTransform(volumeTransform(volume));
    density->setName("density");
    density->setGridClass(openvdb::GRID_FOG_VOLUME);
    density->setSaveFloatAsHalf(options.half &&
                                halfSuffices(largestOf(volume.sigma()), volume.frame().voxel_size));
    openvdb::GridCPtrVec grids{density};
    if (options.color) {
        const openvdb::Vec3SGrid::Ptr color = colorGrid(volume);
        color->setTransform(volumeTransform(volume));
        color->setName(options.color_name);
        color->setVectorType(openvdb::VEC_INVARIANT);  // a colour does not turn with the grid
        color->setSaveFloatAsHalf(options.half && largestOf(volume.color()) <= kLargestHalf);
        grids.push_back(color);
    }

    openvdb::MetaMap facts;
    facts.insertMeta("creator", openvdb::StringMetadata("nerfvdb"));
    facts.insertMeta("density_unit", openvdb::StringMetadata("1 / world unit"));
    if (options.color) facts.insertMeta("color_space", openvdb::StringMetadata("linear Rec. 709"));
    if (options.background)
        facts.insertMeta(kBackground, openvdb::Vec3SMetadata(openvdb::Vec3s(options.background->data())));
    writeVdb(path, grids, facts);
    return {density->activeVoxelCount(), std::filesystem::file_size(path), density->saveFloatAsHalf()};
}

VolumeFile readVolume(const std::filesystem::path& path) {
    try {
        const VdbContent file = readVdb(path);
        const openvdb::FloatGrid::Ptr density = findDensity(*file.grids, path.string());
        const openvdb::Vec3SGrid::Ptr color = findColor(*file.grids);
        GridFrame frame;
        Similarity placed;
        readTransform(density->transform(), path.string() + ": " + density->getName(), frame, placed);
        checkDensity(*density, path.string() + ": " + density->getName());
        if (color && !haveSameVoxels(*density, *color))
            throw DataError(path.string() + ": " + color->getName(), "another transform than the density's",
                            "the same voxels", "resample one to the other");

        openvdb::MaskTree active(density->tree(), false, true, openvdb::TopologyCopy());
        active.voxelizeActiveTiles();
        VolumeFile read;
        read.volume = volumeOf(activeLeaves(active), frame, path.string());
        read.volume.place(placed);
        read.has_color = color != nullptr;
        const openvdb::Vec3SGrid white(openvdb::Vec3s(1.0f));
        fillValues(*density, color ? *color : white, path.string(), read.volume);
        if (const auto background = file.metadata->getMetadata<openvdb::Vec3SMetadata>(kBackground)) {
            const Vec3f values(background->value().asPointer());
            if (values.allFinite()) read.background = values.cwiseMax(0.0f).cwiseMin(1.0f);
        }
        return read;
    } catch (const openvdb::Exception& error) {
        throw DataError(path.string(), std::string("OpenVDB's error \"") + error.what() + "\"", "a .vdb volume");
    } catch (const std::bad_alloc&) {
        // Of constant tiles a few bytes make any number of voxels.
        throw DataError(path.string(), "voxels for which there is not enough memory", "a .vdb volume that fits",
                        "copy or export the file again if it is damaged, else resample it coarser");
    }
}

}  // namespace nerfvdb
