// SPDX-License-Identifier: Apache-2.0
#include "export/fill_inside.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

#include "core/parallel.h"
#include "core/random.h"
#include "export/mesh_cleanup.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

const MeshOptions kFilled{.iso = 1.0, .colours = false, .fill_inside = true};

/// A model of n^3 voxels whose raw density is a function of the voxel, known within `reach` of the surface.
template <typename Raw>
Model modelNear(int n, float reach, const Raw& raw) {
    Model model = modelOf(makeTopology(Vec3i::Constant(n), Vec3i::Zero(), Vec3i::Constant(n - 1),
                                       [&](const Vec3i& c) { return std::abs(raw(c)) < reach; }));
    setDensity(model.field, raw);
    return model;
}

double distanceTo(const Vec3d& centre, const Vec3i& ijk) { return (ijk.cast<double>() - centre).norm(); }

/// Raw density of a hollow ball: the distance to its nearer wall, positive between the two radii.
struct Shell {
    Vec3d centre;
    double outer, inner;
    float operator()(const Vec3i& ijk) const {
        const double r = distanceTo(centre, ijk);
        return static_cast<float>(std::min(outer - r, r - inner));
    }
};

/// The piece with the most triangles; a cavity's wall is smaller than that of its body.
Mesh largestPiece(Mesh mesh) {
    removeIslands(mesh, {/*keep_largest=*/1, /*min_faces=*/0});
    return mesh;
}

/// The plain definition, on every voxel of a box that the field fits into with room to spare.
class DenseInside {
public:
    DenseInside(const VoxelField& field, float iso) : n_(field.topology().dims() + Vec3i::Constant(2)) {
        is_inside_.assign(static_cast<std::size_t>(n_.prod()), true);
        std::vector<Vec3i> waiting{-Vec3i::Ones()};
        while (!waiting.empty()) {
            const Vec3i at = waiting.back();
            waiting.pop_back();
            if ((at.array() < -1).any() || (at.array() > n_.array() - 2).any()) continue;
            if (!is_inside_[place(at)] || rawAt(field, at) >= iso) continue;
            is_inside_[place(at)] = false;
            for (int axis = 0; axis < 3; ++axis)
                for (const int step : {-1, 1}) waiting.push_back(at + step * Vec3i::Unit(axis));
        }
    }
    bool operator()(const Vec3i& at) const { return is_inside_[place(at)]; }

private:
    std::size_t place(const Vec3i& at) const {
        return static_cast<std::size_t>(((at.x() + 1) * n_.y() + at.y() + 1) * n_.z() + at.z() + 1);
    }
    Vec3i n_;
    std::vector<bool> is_inside_;
};

/// Voxels in which the filled surface differs from the plain definition.
int countDifferences(const Surface& surface) {
    const Topology& topology = surface.field.topology();
    const DenseInside expected(surface.field, surface.iso);
    int n = 0;
    for (int x = 0; x < topology.dims().x(); ++x)
        for (int y = 0; y < topology.dims().y(); ++y)
            for (int z = 0; z < topology.dims().z(); ++z) {
                const Vec3i leaf(x >> 3, y >> 3, z >> 3);
                const int number = topology.findLeaf(leaf);
                const bool is_inside = number < 0
                                           ? surface.enclosed.contains(leaf)
                                           : testBit(surface.inside[number], brickOffset(x & 7, y & 7, z & 7));
                n += is_inside != expected(Vec3i(x, y, z));
            }
    return n;
}

/// Signed volume of each piece: negative for the wall of a cavity.
std::vector<double> volumesOfPieces(const Mesh& mesh) {
    const std::vector<std::uint32_t> piece = piecesOfVertices(mesh);
    std::vector<double> volumes;
    for (const Triangle& t : mesh.triangles) {
        volumes.resize(std::max(volumes.size(), piece[t[0]] + std::size_t{1}), 0.0);
        const auto corner = [&](int i) { return mesh.positions[t[i]].cast<double>().eval(); };
        volumes[piece[t[0]]] += corner(0).dot(corner(1).cross(corner(2))) / 6;
    }
    return volumes;
}

}  // namespace

TEST_CASE("a hollow ball becomes solid, and its outside stays where it was", "[export]") {
    // The cavity spans whole leaves: known ones, absent ones, and those that the walls run through.
    const Shell shell{Vec3d(31.2, 32.1, 30.7), 27, 20};
    const Model model = modelNear(64, 3, shell);
    REQUIRE(model.field.topology().findLeaf(Vec3i(4, 4, 4)) < 0);

    const Mesh hollow = extract(model);
    CHECK(measureMesh(hollow).pieces == 2);
    const Mesh solid = extract(model, kFilled);
    CHECK(complaint(solid) == "");
    const MeshMeasures measures = measureMesh(solid);
    CHECK(measures.euler == 2);
    CHECK(measures.pieces == 1);
    // An inscribed polyhedron of edges h < 1.5 voxels misses about h^2 / (8 r) of depth all over.
    const double volume = 4.0 / 3 * std::numbers::pi * std::pow(shell.outer, 3);
    CHECK(measures.volume == Approx(volume).epsilon(3 * 1.5 * 1.5 / (8 * shell.outer * shell.outer)));
    CHECK(sameBytes(solid, largestPiece(hollow)));

    const ThreadLimit one(1);
    CHECK(sameBytes(solid, extract(model, kFilled)));
}

TEST_CASE("a cavity that is open to the outside is not filled", "[export]") {
    const Shell shell{Vec3d(31.2, 32.1, 30.7), 27, 20};
    const Model model = modelNear(64, 3, [&](const Vec3i& ijk) {
        const bool is_channel = ijk.x() > 31 && ijk.y() == 32 && ijk.z() == 31;  // one voxel wide
        return is_channel ? -2.0f : shell(ijk);
    });
    const Mesh plain = extract(model);
    CHECK(measureMesh(plain).pieces == 1);
    CHECK(sameBytes(extract(model, kFilled), plain));
}

TEST_CASE("bodies inside of cavities, and cavities inside of these, vanish with them", "[export]") {
    // Walls at four radii, once with every voxel known, once near the walls only: then the deep inside of a
    // body is unknown, and makes more cavities.
    const auto raw = [](const Vec3i& ijk) {
        const double r = distanceTo(Vec3d(30.3, 31.6, 32.4), ijk);
        return static_cast<float>(r > 18 ? std::min(28 - r, r - 22) : std::min(14 - r, r - 5));
    };
    for (const float reach : {1000.0f, 2.0f}) {
        const Model model = modelNear(64, reach, raw);
        const Mesh nested = extract(model);
        const std::size_t n_pieces = measureMesh(nested).pieces;
        CHECK((reach > 2 ? n_pieces == 4 : n_pieces > 4));
        const Mesh solid = extract(model, kFilled);
        CHECK(complaint(solid) == "");
        CHECK(measureMesh(solid).euler == 2);
        CHECK(sameBytes(solid, largestPiece(nested)));
    }
}

TEST_CASE("a body at the border of the box is filled; what the border opens is not", "[export]") {
    const Model closed = modelNear(32, 1000, Shell{Vec3d(0, 16, 16), 12, 8});
    // The border of the box cuts the cavity open: nothing is known beyond, and that is outside.
    CHECK(sameBytes(extract(closed, kFilled), extract(closed)));
    const Model touching = modelNear(32, 1000, Shell{Vec3d(10, 16, 16), 12, 8});
    CHECK(measureMesh(extract(touching)).pieces == 2);
    CHECK(measureMesh(extract(touching, kFilled)).pieces == 1);
}

TEST_CASE("a leak through the diagonal of a face is stopped up", "[export]") {
    Model model = modelOf(
        makeTopology(Vec3i(16, 16, 16), Vec3i(3, 3, 3), Vec3i(12, 12, 12), [](const Vec3i&) { return true; }));
    // A voxel (7, 7, 7), and a channel that ends at its diagonal neighbour: in different leaves.
    setDensity(model.field, [](const Vec3i& ijk) {
        const bool is_channel = ijk.x() == 8 && ijk.y() >= 8 && ijk.z() == 7;
        return is_channel || ijk == Vec3i(7, 7, 7) ? -3.0f : 1.0f;
    });
    Surface surface = cutField(model.field, 0.0f);
    CHECK(fillInside(surface) == 1);
    CHECK(countDifferences(surface) == 0);
    const Mesh mesh = extract(model, kFilled);
    CHECK(complaint(mesh) == "");
    CHECK(measureMesh(mesh).euler == 2);
    for (const Vec3f& position : mesh.positions) CHECK((position - Vec3f(7, 7, 7)).norm() > 1);
}

TEST_CASE("normals of a filled skin look out", "[export]") {
    // Two voxels thick: half of the neighbours that a normal could be taken from are filled.
    const Shell shell{Vec3d(15.3, 16.2, 15.6), 12, 10};
    const Mesh mesh = extract(modelNear(32, 3, shell), kFilled);
    double worst = 1;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const double cosine =
            (mesh.positions[v].cast<double>() - shell.centre).normalized().dot(mesh.normals[v].cast<double>());
        worst = std::min(worst, cosine);
    }
    CHECK(worst > std::cos(6.0 / 180 * std::numbers::pi));  // measured 5 degrees: differences to one side only
}

TEST_CASE("random fields are filled as the definition says, and keep no sheet of a cavity", "[export]") {
    std::size_t n_filled = 0;
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
        const auto unit = [&](const Vec3i& v, std::uint64_t stream) {
            return unitFloat(static_cast<std::uint32_t>(
                randomBits(seed, stream, static_cast<std::uint64_t>((v.x() * 64 + v.y()) * 64 + v.z())) >> 32));
        };
        const float share_of_cells = 0.5f + 0.5f * unit(Vec3i(40, 0, 0), 0);
        const float share_inside = 0.55f + 0.4f * unit(Vec3i(40, 0, 0), 1);  // from open froth to closed pores
        Model model = modelOf(makeTopology(Vec3i::Constant(24), Vec3i::Constant(2), Vec3i::Constant(21),
                                           [&](const Vec3i& c) { return unit(c, 2) < share_of_cells; }));
        setDensity(model.field, [&](const Vec3i& v) {
            const float value = unit(v, 4);
            return unit(v, 3) < share_inside ? value : -1e-6f - value;
        });
        Surface surface = cutField(model.field, 0.0f);
        n_filled += fillInside(surface);
        INFO("seed " << seed);
        REQUIRE(countDifferences(surface) == 0);

        const Mesh mesh = extract(model, kFilled);
        REQUIRE(complaint(mesh) == "");
        const std::vector<double> volumes = volumesOfPieces(mesh);
        REQUIRE(*std::min_element(volumes.begin(), volumes.end()) > 0);
    }
    CHECK(n_filled > 10000);
}
