// SPDX-License-Identifier: Apache-2.0
// Surfaces of densities that are known at every point: how far the mesh is from the truth, and the truth from
// the mesh.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

using Distance = std::function<double(const Vec3d&)>;  // world units, negative inside

constexpr double kPi = 3.14159265358979323846;
constexpr double kDensityScale = 30;  // 1 / world unit
constexpr double kHalfBox = 1.0;

/// raw = -8 distance / voxel_size, in a band of four voxels and inside: as steep in voxels at any resolution,
/// so that only the shape's bending counts.
Model sampled(const Distance& distance, double voxel_size) {
    const int n = static_cast<int>(std::ceil(2 * kHalfBox / voxel_size / kLeafDim)) * kLeafDim;
    const GridFrame frame{Vec3d::Constant(-kHalfBox), voxel_size};
    Model model;
    model.field = VoxelField(
        makeTopology(
            Vec3i::Constant(n), Vec3i::Zero(), Vec3i::Constant(n - 1),
            [&](const Vec3i& c) { return distance(frame.worldFromIndex(c.cast<double>())) < 4 * voxel_size; }),
        frame, 0, kDensityScale);
    setDensity(model.field, [&](const Vec3i& p) {
        return static_cast<float>(-8 * distance(frame.worldFromIndex(p.cast<double>())) / voxel_size);
    });
    return model;
}

Mesh surfaceOf(const Model& model) { return extract(model, {.iso = kDensityScale, .colours = false}); }

double distanceToTriangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const Vec3d normal = (b - a).cross(c - a);
    const auto isLeft = [&](const Vec3d& from, const Vec3d& to) {
        return (to - from).cross(p - from).dot(normal) >= 0;
    };
    if (isLeft(a, b) && isLeft(b, c) && isLeft(c, a)) return std::abs((p - a).dot(normal)) / normal.norm();
    const auto toSegment = [&](const Vec3d& from, const Vec3d& to) {
        const double t = std::clamp((p - from).dot(to - from) / (to - from).squaredNorm(), 0.0, 1.0);
        return (from + t * (to - from) - p).norm();
    };
    return std::min({toSegment(a, b), toSegment(b, c), toSegment(c, a)});
}

/// Triangles by the cells of a grid that their boxes touch.
class NearTriangles {
public:
    NearTriangles(const Mesh& mesh, double cell) : mesh_(mesh), cell_(cell) {
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
            Vec3d low = corner(t, 0), high = low;
            for (int k = 1; k < 3; ++k) low = low.cwiseMin(corner(t, k)), high = high.cwiseMax(corner(t, k));
            forCells(low, high, [&](const Key& key) { cells_[key].push_back(t); });
        }
    }
    /// Distance from a point to the mesh, right if it is below a cell's edge.
    double distance(const Vec3d& p) const {
        double least = cell_;
        const Vec3d reach = Vec3d::Constant(cell_);
        forCells(p - reach, p + reach, [&](const Key& key) {
            const auto found = cells_.find(key);
            if (found == cells_.end()) return;
            for (const std::size_t t : found->second)
                least = std::min(least, distanceToTriangle(p, corner(t, 0), corner(t, 1), corner(t, 2)));
        });
        return least;
    }

private:
    using Key = std::array<int, 3>;
    Vec3d corner(std::size_t t, int k) const { return mesh_.positions[mesh_.triangles[t][k]].cast<double>(); }
    template <typename Visit>
    void forCells(const Vec3d& low, const Vec3d& high, const Visit& visit) const {
        const Vec3i first = (low / cell_).array().floor().cast<int>(),
                    last = (high / cell_).array().floor().cast<int>();
        for (int x = first.x(); x <= last.x(); ++x)
            for (int y = first.y(); y <= last.y(); ++y)
                for (int z = first.z(); z <= last.z(); ++z) visit(Key{x, y, z});
    }

    const Mesh& mesh_;
    double cell_;
    std::map<Key, std::vector<std::size_t>> cells_;
};

struct Torus {
    double ring, tube;
    double operator()(const Vec3d& p) const {
        return std::hypot(std::hypot(p.x() - 0.013, p.y() + 0.021) - ring, p.z() - 0.017) - tube;
    }
    Vec3d at(double u, double v) const {
        const double r = ring + tube * std::cos(v);
        return {0.013 + r * std::cos(u), -0.021 + r * std::sin(u), 0.017 + tube * std::sin(v)};
    }
};

double unit(std::uint64_t stream, std::uint64_t i) {
    return unitFloat(static_cast<std::uint32_t>(randomBits(11, stream, i) >> 32));
}

struct Chamfer {
    double from_mesh = 0, from_truth = 0;  // mean distances, world units
};

Chamfer chamfer(const Mesh& mesh, const Torus& torus, double voxel_size) {
    constexpr int kPoints = 4000;
    Chamfer result;
    // Triangles differ in size, so that they are drawn by area.
    std::vector<double> sum_of_areas;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.positions[t[0]].cast<double>(), b = mesh.positions[t[1]].cast<double>(),
                    c = mesh.positions[t[2]].cast<double>();
        sum_of_areas.push_back((sum_of_areas.empty() ? 0 : sum_of_areas.back()) + (b - a).cross(c - a).norm());
    }
    const NearTriangles near(mesh, 2 * voxel_size);
    for (int i = 0; i < kPoints; ++i) {
        const std::size_t drawn =
            std::upper_bound(sum_of_areas.begin(), sum_of_areas.end(), unit(0, i) * sum_of_areas.back()) -
            sum_of_areas.begin();
        const Triangle& t = mesh.triangles[std::min(drawn, mesh.triangles.size() - 1)];
        const double s = std::sqrt(unit(1, i)), w = unit(2, i);
        const Vec3d p = (1 - s) * mesh.positions[t[0]].cast<double>() +
                        s * (1 - w) * mesh.positions[t[1]].cast<double>() +
                        s * w * mesh.positions[t[2]].cast<double>();
        result.from_mesh += std::abs(torus(p)) / kPoints;
        result.from_truth += near.distance(torus.at(2 * kPi * unit(3, i), 2 * kPi * unit(4, i))) / kPoints;
    }
    return result;
}

}  // namespace

TEST_CASE("vertices of a known density lie within a twentieth of a voxel of its surface", "[export]") {
    const double voxel = 1.0 / 32;
    const std::map<std::string, Distance> shapes = {
        {"ball", [](const Vec3d& p) { return (p - Vec3d(0.01, 0.02, -0.013)).norm() - 0.7; }},
        {"torus", Torus{0.6, 0.22}},
        {"rod",
         [](const Vec3d& p) {  // at an angle, with round ends
             const Vec3d along = Vec3d(1, 0.7, 0.4).normalized();
             return (p - std::clamp(p.dot(along), -0.6, 0.6) * along).norm() - 0.15;
         }},
        {"gyroid in a ball", [](const Vec3d& p) {  // distance to first order
             const Vec3d q = 5.0 * p;
             const double value = std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) +
                                  std::sin(q.z()) * std::cos(q.x());
             return std::max(value / 8, p.norm() - 0.85);
         }}};
    for (const auto& [name, distance] : shapes) {
        const Mesh mesh = surfaceOf(sampled(distance, voxel));
        INFO(name);
        REQUIRE(complaint(mesh) == "");
        std::size_t n_near = 0;
        double worst = 0;
        for (const Vec3f& v : mesh.positions) {
            const Vec3d p = v.cast<double>();
            Vec3d slope;
            for (int axis = 0; axis < 3; ++axis) {
                const Vec3d step = 1e-5 * Vec3d::Unit(axis);
                slope[axis] = (distance(p + step) - distance(p - step)) / 2e-5;
            }
            const double off = std::abs(distance(p)) / slope.norm() / voxel;
            // Where the gyroid meets the ball there is an edge, of which no voxel knows.
            if (name == "gyroid in a ball" && std::abs(p.norm() - 0.85) < 2 * voxel) continue;
            worst = std::max(worst, off);
            ++n_near;
        }
        CHECK(worst < 0.05);
        CHECK(n_near > 1000);
    }
}

TEST_CASE("the Chamfer distance of a torus falls to a quarter when the voxel halves", "[export]") {
    const Torus torus{0.6, 0.25};
    Chamfer before;
    for (const double voxel : {1.0 / 16, 1.0 / 32, 1.0 / 64}) {
        const Mesh mesh = surfaceOf(sampled(torus, voxel));
        REQUIRE(complaint(mesh) == "");
        REQUIRE(measureMesh(mesh).euler == 0);
        const Chamfer error = chamfer(mesh, torus, voxel);
        INFO("voxel " << voxel);
        CHECK(error.from_mesh < 0.05 * voxel);
        CHECK(error.from_truth < 0.05 * voxel);
        if (before.from_mesh > 0) {
            CHECK(before.from_mesh / error.from_mesh == Approx(4).margin(0.4));
            CHECK(before.from_truth / error.from_truth == Approx(4).margin(0.4));
        }
        before = error;
    }
}

TEST_CASE("thin rings and plates keep their shape down to two voxels across", "[export]") {
    const double voxel = 1.0 / 32;
    for (const double radius_in_voxels : {1.0, 1.5, 2.5}) {
        const Torus ring{0.7, radius_in_voxels * voxel};
        const Mesh mesh = surfaceOf(sampled(ring, voxel));
        INFO("radius " << radius_in_voxels);
        REQUIRE(complaint(mesh) == "");
        CHECK(measureMesh(mesh).euler == 0);
        CHECK(measureMesh(mesh).pieces == 1);
        // Linear between voxels: 1 / (8 r) of a voxel off at most, and as much again of chords across the
        // faces.
        double worst = 0;
        for (const Vec3f& v : mesh.positions) worst = std::max(worst, std::abs(ring(v.cast<double>())) / voxel);
        CHECK(worst < 1 / (8 * radius_in_voxels) + 0.01);
        const Chamfer error = chamfer(mesh, ring, voxel);
        CHECK(error.from_mesh < 0.25 / radius_in_voxels * voxel);
        CHECK(error.from_truth < 0.25 / radius_in_voxels * voxel);
    }
    const Vec3d across = Vec3d(1, 2, 3).normalized();
    for (const double half_in_voxels :
         {0.75, 1.0, 2.0}) {  // a plate at an angle, a voxel and a half thick and more
        const double half = half_in_voxels * voxel;
        const auto plate = [&](const Vec3d& p) {
            const double off = std::abs(p.dot(across)), radius = (p - p.dot(across) * across).norm();
            return std::max(off - half, radius - 0.7);
        };
        const Mesh mesh = surfaceOf(sampled(plate, voxel));
        INFO("half a plate " << half_in_voxels);
        REQUIRE(complaint(mesh) == "");
        CHECK(measureMesh(mesh).euler == 2);
        CHECK(measureMesh(mesh).volume == Approx(2 * half * kPi * 0.7 * 0.7).epsilon(0.1));
    }
}
