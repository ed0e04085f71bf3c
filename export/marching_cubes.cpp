// SPDX-License-Identifier: Apache-2.0
// Marching cubes on leaf blocks. The work is told by bit masks: one pass over the leaves says which voxels are
// inside; a survey of each block counts its vertices and triangles; prefix sums give every block its place in
// the mesh; a last pass fills the places. No table of shared vertices is needed: a crossed edge belongs to the
// block of its lower voxel, and its number is its rank among the block's crossed edges.
#include "export/marching_cubes.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "export/marching_cubes_table.h"
#include "export/vertex_colours.h"

namespace nerfvdb {
namespace {

// Crossings keep this share of an edge away from its ends, so that no two vertices meet at a voxel: a
// thousandth of a voxel, far below what a voxel resolves and above the rounding of float positions (see
// warnIfCoarse).
constexpr float kOffCorner = 0x1p-10f;
// Densities beyond this are no densities; below it, squares and sums of differences stay finite in float.
constexpr float kAbsurdRaw = 1e15f;
constexpr std::size_t kBlocksPerTask = 32;

struct Surface {
    const VoxelField& field;
    float iso;                     // raw density
    std::vector<LeafMask> inside;  // [leaf] voxels with raw >= iso
};

/// Cells and edges whose lower voxel lies in one leaf's place, whether that leaf exists or not: a surface that
/// closes at the border of the known region reaches one voxel into absent leaves below.
struct Block {
    Vec3i leaf;  // leaf coordinate; -1 is possible
    // Edges that cross the surface, [axis][x], bit y * 8 + z of the lower voxel.
    std::array<LeafMask, 3> crossed{};
    std::array<std::array<std::uint16_t, 3>, kLeafDim> rank{};  // [x][axis] crossed edges of the block before
    std::uint32_t n_edges = 0, n_centres = 0, n_triangles = 0;
    std::uint32_t first_vertex = 0, first_triangle = 0;

    bool isEmpty() const { return n_edges == 0 && n_triangles == 0; }
};

Vec3i offsetOf(int corner) { return {corner >> 2 & 1, corner >> 1 & 1, corner & 1}; }

template <typename Visit>
void forEachBit(std::uint64_t word, const Visit& visit) {
    for (; word; word &= word - 1) visit(std::countr_zero(word));
}

/// Inside bits of the 9^3 corners of a block's cells: for each (x, y) a row of nine bits along z.
class CornerRows {
public:
    CornerRows(const Surface& surface, const Vec3i& leaf) {
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3i step = offsetOf(corner);
            const int number = surface.field.topology().findLeaf(leaf + step);
            if (number < 0) continue;
            const LeafMask& mask = surface.inside[number];
            for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x)
                for (int y = 0; y < (step.y() ? 1 : kLeafDim); ++y) {
                    const unsigned bits = mask[x] >> (8 * y) & 0xff;
                    row(x + 8 * step.x(), y + 8 * step.y()) |= step.z() ? (bits & 1) << 8 : bits;
                }
        }
    }
    unsigned& row(int x, int y) { return rows_[x * 9 + y]; }
    unsigned row(int x, int y) const { return rows_[x * 9 + y]; }

private:
    std::array<unsigned, 81> rows_{};
};

/// Raw densities of a block and one voxel around its cells: coordinates -1 to 9. Gathered on first use.
class BlockValues {
public:
    BlockValues(const Surface& surface, const Vec3i& leaf) : surface_(surface), leaf_(leaf) {}

    /// Pointer to the value at (x, y, z); neighbours lie at +-kStride[axis].
    const float* at(int x, int y, int z) {
        if (!is_gathered_) gather();
        return &values_[(x + 1) * kStride[0] + (y + 1) * kStride[1] + z + 1];
    }

    static constexpr int kStride[3] = {121, 11, 1};

private:
    void gather() {
        const Topology& topology = surface_.field.topology();
        // Along each axis: the last voxel of the block before, the block, the first two of the block after.
        constexpr int kFirst[3] = {7, 0, 0}, kCount[3] = {1, 8, 2}, kPlace[3] = {0, 1, 9};
        values_.fill(kEmptyRaw);
        for (int i = 0; i < 27; ++i) {
            const int block[3] = {i / 9, i / 3 % 3, i % 3};
            const int number = topology.findLeaf(leaf_ + Vec3i(block[0] - 1, block[1] - 1, block[2] - 1));
            if (number < 0) continue;
            const float* brick = &surface_.field.density()[static_cast<std::size_t>(number) * kLeafVoxels];
            const LeafMask& active = topology.voxels()[number];
            for (int x = 0; x < kCount[block[0]]; ++x)
                for (int y = 0; y < kCount[block[1]]; ++y) {
                    const int offset =
                        brickOffset(kFirst[block[0]] + x, kFirst[block[1]] + y, kFirst[block[2]]);
                    float* row = &values_[(kPlace[block[0]] + x) * kStride[0] +
                                          (kPlace[block[1]] + y) * kStride[1] + kPlace[block[2]]];
                    for (int z = 0; z < kCount[block[2]]; ++z)
                        if (testBit(active, offset + z)) row[z] = brick[offset + z];
                }
        }
        is_gathered_ = true;
    }

    const Surface& surface_;
    Vec3i leaf_;
    bool is_gathered_ = false;
    std::array<float, 11 * 11 * 11> values_;
};

/// Answers for the ambiguous faces of a cell: bit i is set if the inside corners of the i-th are joined.
/// On a face, the bilinear field has its saddle at (a c - b d) / (a + c - b - d), with a, c the inside corners
/// and b, d the outside ones, relative to iso: they are joined if the saddle is inside. Products of two floats
/// are exact in double, so both cells at a face give the same answer. Source: Nielson and Hamann 1991.
unsigned joinedFaces(const CubeTable& table, unsigned faces, const float* corner, float iso) {
    unsigned answers = 0;
    int n = 0;
    for (int face = 0; face < 6; ++face) {
        if (!(faces >> face & 1)) continue;
        double value[4];
        for (int i = 0; i < 4; ++i) {
            const Vec3i step = offsetOf(table.face_corners[face][i]);
            value[i] =
                corner[step.x() * BlockValues::kStride[0] + step.y() * BlockValues::kStride[1] + step.z()] -
                iso;
        }
        const double even = value[0] * value[2], odd = value[1] * value[3];
        const bool is_even_inside = value[0] >= 0;
        answers |= static_cast<unsigned>(is_even_inside ? even >= odd : odd >= even) << n++;
    }
    return answers;
}

/// Calls visit(x, y, z, triangles) for every cell of a block that the surface runs through.
template <typename Visit>
void forEachCrossedCell(const CornerRows& rows, BlockValues& values, float iso, const Visit& visit) {
    const CubeTable& table = cubeTable();
    for (int x = 0; x < kLeafDim; ++x)
        for (int y = 0; y < kLeafDim; ++y) {
            const unsigned row[4] = {rows.row(x, y), rows.row(x, y + 1), rows.row(x + 1, y),
                                     rows.row(x + 1, y + 1)};
            const unsigned any = row[0] | row[1] | row[2] | row[3], all = row[0] & row[1] & row[2] & row[3];
            forEachBit((any | any >> 1) & ~(all & all >> 1) & 0xff, [&](int z) {
                // Bits z and z + 1 of a row are the corners (., ., 0) and (., ., 1) of the cell.
                unsigned corners = 0;
                for (int i = 0; i < 4; ++i) corners |= (row[i] >> z & 3) << (2 * i);
                const CubePattern& pattern = table.patterns[corners];
                const unsigned answers = pattern.ambiguous_faces ? joinedFaces(table, pattern.ambiguous_faces,
                                                                               values.at(x, y, z), iso)
                                                                 : 0;
                visit(x, y, z, table.variants[pattern.first_variant + answers]);
            });
        }
}

/// Finds the voxels inside, and the largest raw density of all active voxels.
float markInside(Surface& surface) {
    const Topology& topology = surface.field.topology();
    surface.inside.resize(topology.leafCount());
    std::vector<float> largest(topology.leafCount(), -std::numeric_limits<float>::infinity());
    std::atomic<bool> is_absurd = false;
    parallelRanges(topology.leafCount(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t leaf = begin; leaf < end; ++leaf) {
            const float* brick = &surface.field.density()[leaf * kLeafVoxels];
            LeafMask inside{};
            for (int x = 0; x < kLeafWords; ++x)
                forEachBit(topology.voxels()[leaf][x], [&](int bit) {
                    const float raw = brick[x * 64 + bit];
                    if (!(std::abs(raw) < kAbsurdRaw)) is_absurd = true;  // written so that NaN is absurd, too
                    largest[leaf] = std::max(largest[leaf], raw);
                    inside[x] |= static_cast<std::uint64_t>(raw >= surface.iso) << bit;
                });
            surface.inside[leaf] = inside;
        }
    });
    if (is_absurd)
        throw NumericError("mesh: raw density", "a value that is infinite, not a number or beyond 1e15",
                           "finite values", "the model is damaged or its training diverged");
    return *std::max_element(largest.begin(), largest.end());
}

/// All leaves, in their order, then the absent places below leaves into which the surface reaches, sorted.
std::vector<Block> listBlocks(const Surface& surface) {
    const Topology& topology = surface.field.topology();
    constexpr std::uint64_t kFirstY = 0xff, kFirstZ = 0x0101010101010101;
    std::vector<Vec3i> absent;
    std::vector<Block> blocks;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        const Vec3i coord = topology.leafCoords()[leaf];
        blocks.emplace_back().leaf = coord;
        for (int corner = 1; corner < 8; ++corner) {
            const Vec3i step = offsetOf(corner);
            const std::uint64_t border = (step.y() ? kFirstY : ~0ull) & (step.z() ? kFirstZ : ~0ull);
            std::uint64_t bits = 0;
            for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x) bits |= surface.inside[leaf][x] & border;
            if (bits && topology.findLeaf(coord - step) < 0) absent.push_back(coord - step);
        }
    }
    const auto key = [](const Vec3i& v) { return std::array{v.x(), v.y(), v.z()}; };
    std::sort(absent.begin(), absent.end(), [&](const Vec3i& a, const Vec3i& b) { return key(a) < key(b); });
    absent.erase(std::unique(absent.begin(), absent.end()), absent.end());
    for (const Vec3i& coord : absent) blocks.emplace_back().leaf = coord;
    return blocks;
}

void surveyBlock(const Surface& surface, Block& block) {
    const CornerRows rows(surface, block.leaf);
    for (int x = 0; x < kLeafDim; ++x) {
        for (int y = 0; y < kLeafDim; ++y) {
            const unsigned row = rows.row(x, y);
            const unsigned crossed[3] = {row ^ rows.row(x + 1, y), row ^ rows.row(x, y + 1), row ^ row >> 1};
            for (int axis = 0; axis < 3; ++axis)
                block.crossed[axis][x] |= std::uint64_t{crossed[axis] & 0xff} << (8 * y);
        }
        for (int axis = 0; axis < 3; ++axis) {
            block.rank[x][axis] = static_cast<std::uint16_t>(block.n_edges);
            block.n_edges += std::popcount(block.crossed[axis][x]);
        }
    }
    BlockValues values(surface, block.leaf);
    forEachCrossedCell(rows, values, surface.iso, [&](int, int, int, const CubeTriangles& cube) {
        block.n_centres += cube.has_centre;
        block.n_triangles += cube.count;
    });
}

/// The blocks that the surface runs through, with their places in the mesh, and how to find them.
class BlockList {
public:
    explicit BlockList(const Surface& surface) : topology_(surface.field.topology()) {
        std::vector<Block> all = listBlocks(surface);
        parallelRanges(all.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
            for (std::size_t b = begin; b < end; ++b) surveyBlock(surface, all[b]);
        });
        number_of_leaf_.assign(topology_.leafCount(), -1);
        for (std::size_t b = 0; b < all.size(); ++b) {
            if (all[b].isEmpty()) continue;
            if (b < number_of_leaf_.size()) {
                number_of_leaf_[b] = static_cast<std::int32_t>(blocks_.size());
                first_absent_ = blocks_.size() + 1;
            }
            blocks_.push_back(all[b]);
        }
        placeBlocks();
    }

    std::size_t size() const { return blocks_.size(); }
    const Block& operator[](std::size_t i) const { return blocks_[i]; }
    std::size_t vertexCount() const { return n_vertices_; }
    std::size_t triangleCount() const { return n_triangles_; }

    /// The block at a leaf coordinate, or null if the surface does not meet it.
    const Block* find(const Vec3i& coord) const {
        if (const int leaf = topology_.findLeaf(coord); leaf >= 0)
            return number_of_leaf_[leaf] >= 0 ? &blocks_[number_of_leaf_[leaf]] : nullptr;
        const auto key = [](const Vec3i& v) { return std::array{v.x(), v.y(), v.z()}; };
        const auto found =
            std::lower_bound(blocks_.begin() + first_absent_, blocks_.end(), coord,
                             [&](const Block& block, const Vec3i& c) { return key(block.leaf) < key(c); });
        return found != blocks_.end() && found->leaf == coord ? &*found : nullptr;
    }

private:
    void placeBlocks() {
        for (Block& block : blocks_) {
            block.first_vertex = static_cast<std::uint32_t>(n_vertices_);
            block.first_triangle = static_cast<std::uint32_t>(n_triangles_);
            n_vertices_ += block.n_edges + block.n_centres;
            n_triangles_ += block.n_triangles;
        }
        // Mesh files count in signed 32-bit numbers; twice as many triangles as vertices is normal.
        constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
        if (n_vertices_ > kMost || n_triangles_ > kMost)
            throw NumericError("mesh", std::to_string(n_triangles_) + " triangles",
                               "at most " + std::to_string(kMost),
                               "choose a higher iso or mesh a part of the scene");
    }

    const Topology& topology_;
    std::vector<Block> blocks_;
    std::vector<std::int32_t> number_of_leaf_;  // [leaf] in blocks_, or -1
    std::size_t first_absent_ = 0;              // in blocks_: the places without a leaf, sorted
    std::size_t n_vertices_ = 0, n_triangles_ = 0;
};

/// Slope of the raw density at a voxel along an axis, per voxel. `is_known_only`: differences with voxels that
/// hold nothing are left out: their kEmptyRaw tells where the known region ends, not how the surface is turned.
float slopeAt(const float* value, int axis, bool is_known_only) {
    const float below = value[-BlockValues::kStride[axis]], above = value[BlockValues::kStride[axis]];
    const bool use_below = !is_known_only || below != kEmptyRaw;
    const bool use_above = !is_known_only || above != kEmptyRaw;
    const float sum = (use_above ? above - *value : 0) + (use_below ? *value - below : 0);
    return use_above && use_below ? 0.5f * sum : sum;
}

struct SurfacePoint {
    Vec3f position;  // voxels from the block's first voxel
    Vec3f normal;    // unit, towards falling density
};

/// Where the edge from voxel (x, y, z) of a block along `axis` crosses the surface.
SurfacePoint crossingOf(BlockValues& values, int x, int y, int z, int axis, float iso) {
    const float* low = values.at(x, y, z);
    const float* high = low + BlockValues::kStride[axis];
    const float t = std::clamp((iso - *low) / (*high - *low), kOffCorner, 1 - kOffCorner);
    SurfacePoint point{Vec3f(x, y, z), Vec3f::Zero()};
    point.position[axis] += t;

    // Central differences at both voxels, linear between them: second order, unlike the trilinear field's own
    // slope, which jumps from cell to cell. On an edge that leaves the known region the surface is the region's
    // border: there, the voxel inside decides, and what holds nothing counts.
    const bool is_border = *low == kEmptyRaw || *high == kEmptyRaw;
    Vec3f slope;
    for (int a = 0; a < 3; ++a)
        slope[a] = is_border ? slopeAt(*low < *high ? high : low, a, false)
                             : (1 - t) * slopeAt(low, a, true) + t * slopeAt(high, a, true);
    // The edge itself says which way is out; differences over two voxels can miss that on thin sheets.
    const float along = *high - *low;
    if (slope[axis] * along <= 0) slope[axis] = along;
    point.normal = -slope.normalized();
    return point;
}

/// Writes one block's vertices and triangles to their places.
class BlockWriter {
public:
    BlockWriter(const Surface& surface, const BlockList& blocks, const Block& block, Mesh& mesh)
        : surface_(surface), blocks_(blocks), block_(block), values_(surface, block.leaf), mesh_(mesh) {}

    void write() {
        writeCrossings();
        numberCrossings();
        std::uint32_t centre = block_.first_vertex + block_.n_edges;
        std::uint32_t triangle = block_.first_triangle;
        const auto writeCell = [&](int x, int y, int z, const CubeTriangles& cube) {
            const auto number = [&](int edge) {
                return edge == kCubeCentre ? centre : numbers_[edgePlace(edge) + x * 81 + y * 9 + z];
            };
            for (int i = 0; i < cube.count; ++i) {
                const auto& [a, b, c] = cube.triangles[i];
                mesh_.triangles[triangle++] = Triangle(number(a), number(b), number(c));
            }
            if (cube.has_centre) writeCentre(centre++, x, y, z, cube);
        };
        forEachCrossedCell(CornerRows(surface_, block_.leaf), values_, surface_.iso, writeCell);
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
                    writeVertex(number++, crossingOf(values_, x, bit >> 3, bit & 7, axis, surface_.iso));
                });
    }

    /// Fills numbers_ with the vertices on the edges of the block's cells; the upper ones belong to its
    /// neighbours.
    void numberCrossings() {
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3i step = offsetOf(corner);
            const Block* owner = corner == 0 ? &block_ : blocks_.find(block_.leaf + step);
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

    static int edgePlace(int edge) {
        const CubeEdge& e = cubeTable().edges[edge];
        return e.axis * 729 + e.x * 81 + e.y * 9 + e.z;
    }

    /// A centre is the mean of the loop around it: inside the cell, because no face holds the whole loop.
    void writeCentre(std::uint32_t number, int x, int y, int z, const CubeTriangles& cube) {
        SurfacePoint mean{Vec3f::Zero(), Vec3f::Zero()};
        int n = 0;
        for (int i = 0; i < cube.count; ++i) {
            if (cube.triangles[i][2] != kCubeCentre) continue;
            const CubeEdge& e = cubeTable().edges[cube.triangles[i][0]];
            const SurfacePoint point = crossingOf(values_, x + e.x, y + e.y, z + e.z, e.axis, surface_.iso);
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
    BlockValues values_;
    Mesh& mesh_;
    std::array<std::uint32_t, 3 * 729> numbers_;  // [axis][x][y][z], 9 a side; only crossed edges are filled
};

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

}  // namespace

double automaticIso(const VoxelField& field) { return std::log(2.0) / field.frame().voxel_size; }

Mesh extractSurface(const Model& model, const MeshOptions& options, Report& report) {
    const VoxelField& field = model.field;
    if (field.topology().voxelCount() == 0)
        throw NumericError("mesh", "an empty field", "at least one active voxel", "train the model first");
    const double iso = options.iso.value_or(automaticIso(field));
    Surface surface{field, rawFromSigma(iso, field.densityScale()), {}};
    checkIso(iso, surface.iso, field.densityScale());
    const float largest_raw = markInside(surface);
    // The activation clamps: sigma never exceeds its value at kMaxRaw.
    if (surface.iso > std::min(largest_raw, kMaxRaw))
        throw NumericError(
            "mesh: iso", text(iso) + " per world unit",
            "at most the field's maximum, " + text(sigmaFromRaw(largest_raw, field.densityScale())),
            "choose a lower iso");
    report.info("mesh: surface at density " + text(iso) + " per world unit" +
                (options.iso ? "" : " (half of the light stopped over one voxel)"));
    warnIfCoarse(field, report);

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
    if (options.colours) colourVertices(model, mesh);
    return mesh;
}

}  // namespace nerfvdb
