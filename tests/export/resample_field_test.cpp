// SPDX-License-Identifier: Apache-2.0
#include "export/resample_field.h"

#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

const GridFrame kFrame{Vec3d(-3, 5, 1), 0.25};

/// raw = sharpness * distance (old voxels, positive inside) in a band of voxels around the surface and all
/// inside.
template <typename Distance>
Model solid(int dim, double sharpness, const Distance& distance) {
    Model model = modelOf(
        makeTopology(Vec3i::Constant(dim), Vec3i::Zero(), Vec3i::Constant(dim - 1),
                     [&](const Vec3i& c) { return distance(c.cast<double>() + Vec3d::Constant(0.5)) > -3; }),
        kFrame);
    setDensity(model.field,
               [&](const Vec3i& p) { return static_cast<float>(sharpness * distance(p.cast<double>())); });
    return model;
}

MeshOptions at(int resolution, bool fill = false) {
    MeshOptions options = kPlain;
    options.resolution = resolution;
    options.fill_inside = fill;
    return options;
}

}  // namespace

TEST_CASE("at any resolution a ball is a ball: closed, in place, of its volume", "[export]") {
    const Vec3d centre(23.7, 24.2, 24.9);
    const double radius = 17.3;
    for (const double sharpness : {0.3, 2.0, 30.0}) {  // fog, a usual edge, a cliff
        const Model model = solid(56, sharpness, [&](const Vec3d& p) { return radius - (p - centre).norm(); });
        for (const int resolution : {9, 17, 23, 40, 54, 55, 56, 80, 131}) {
            const double ratio = 55.0 / resolution;  // new voxel, in old ones
            const Mesh mesh = extract(model, at(resolution));
            INFO("sharpness " << sharpness << ", resolution " << resolution);
            REQUIRE(complaint(mesh) == "");
            const MeshMeasures m = measureMesh(mesh);
            CHECK(m.euler == 2);
            CHECK(m.pieces == 1);
            double worst = 0, bend = 0;
            for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
                const Vec3d from = kFrame.indexFromWorld(mesh.positions[v].cast<double>()) - centre;
                worst = std::max(worst, std::abs(from.norm() - radius));
                bend = std::max(bend, 1 - from.normalized().dot(mesh.normals[v].cast<double>()));
            }
            // A tent blurs by a coarse voxel, and a ball's share of it differs from a plane's by ratio^2 / (8
            // r).
            CHECK(worst < (ratio > 1 ? 0.13 * ratio + ratio * ratio / (4 * radius) : 0.025));
            CHECK(bend < (ratio > 1 ? 0.03 + ratio / radius / 4 : 0.001));
            const double volume = 4.0 / 3 * 3.14159265 * std::pow(radius * kFrame.voxel_size, 3);
            // Chords cut off about 0.3 ratio^2 / r of depth, the blur another sixth.
            CHECK(m.volume == Approx(volume).epsilon(3 * (0.5 * ratio * ratio + 0.25) / (radius * radius)));
            CHECK(mesh.triangles.size() == Approx(18.85 * radius * radius * 2 / (ratio * ratio)).epsilon(0.15));
        }
    }
}

TEST_CASE("coarse planes lie where they lay, wherever voxels are", "[export]") {
    for (const double place : {20.0, 20.3, 20.77}) {
        const Model model = solid(48, 50, [&](const Vec3d& p) { return place - p.x(); });
        for (const int resolution : {10, 13, 31}) {
            const Mesh mesh = extract(model, at(resolution));
            REQUIRE(complaint(mesh) == "");
            std::size_t n_on_plane = 0;
            for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
                const Vec3d p = kFrame.indexFromWorld(mesh.positions[v].cast<double>());
                const double ratio = 47.0 / resolution;
                if (p.x() < 10 || p.y() < 2 * ratio || p.y() > 47 - 2 * ratio || p.z() < 2 * ratio ||
                    p.z() > 47 - 2 * ratio)
                    continue;
                ++n_on_plane;
                REQUIRE(p.x() == Approx(place).margin(0.07 * ratio));  // of a tent's sum at so many places
                REQUIRE(mesh.normals[v].x() > 0.999f);
            }
            CHECK(n_on_plane > 16);
        }
    }
}

TEST_CASE("thin shells hold at a coarse resolution when they are filled before they are blurred", "[export]") {
    // A shell two voxels thick around a hollow that nothing is known of.
    const Vec3d centre(28, 28, 28);
    Model model = modelOf(
        makeTopology(Vec3i::Constant(56), Vec3i::Zero(), Vec3i::Constant(55),
                     [&](const Vec3i& c) { return std::abs((c.cast<double>() - centre).norm() - 20) < 3; }),
        kFrame);
    setDensity(model.field, [&](const Vec3i& p) {
        return static_cast<float>(5 * (1.0 - std::abs((p.cast<double>() - centre).norm() - 20)));
    });
    const Mesh solid_ball = extract(model, at(10, true));
    CHECK(complaint(solid_ball) == "");
    CHECK(measureMesh(solid_ball).euler == 2);
    const double volume = 4.0 / 3 * 3.14159265 * std::pow(21 * kFrame.voxel_size, 3);
    CHECK(measureMesh(solid_ball).volume == Approx(volume).epsilon(0.1));
    CHECK_THROWS_WITH(extract(model, at(10)), Catch::Contains("resolution") && Catch::Contains("higher"));

    const Mesh fine = extract(model, at(100, true));  // finer: filled on the fine lattice
    CHECK(complaint(fine) == "");
    CHECK(measureMesh(fine).euler == 2);
    CHECK(measureMesh(fine).volume == Approx(volume).epsilon(0.01));
}

TEST_CASE("a finer field interpolates: the same surface, between the same voxels", "[export]") {
    const Model model = solid(32, 1, [](const Vec3d& p) {
        return std::sin(0.5 * p.x()) + std::cos(0.4 * p.y() + 0.3 * p.z()) + 6 -
               0.4 * (p - Vec3d(15, 16, 15)).norm();
    });
    const Mesh fine = extract(model, at(31 * 4));
    REQUIRE(complaint(fine) == "");
    const auto trilinear = [&](const Vec3d& p) {
        const Vec3i low = p.array().floor().cast<int>();
        double sum = 0;
        for (int c = 0; c < 8; ++c) {
            const Vec3i step(c >> 2, c >> 1 & 1, c & 1);
            double weight = 1;
            for (int a = 0; a < 3; ++a) weight *= step[a] ? p[a] - low[a] : 1 - (p[a] - low[a]);
            sum += weight * rawAt(model.field, low + step);
        }
        return sum;
    };
    for (const Vec3f& v : fine.positions)  // linear along an edge of a quarter voxel, inside of one cell
        REQUIRE(trilinear(kFrame.indexFromWorld(v.cast<double>())) == Approx(0).margin(0.01));
    CHECK(fine.positions.size() > 12 * extract(model).positions.size());

    // With twice the voxels all old ones are among the new: where both know something, they say the same.
    const Surface surface = cutField(model.field, 0);
    const VoxelField twice = finerField(surface, kFrame.voxel_size / 2);
    std::size_t n_same = 0;
    forEachVoxel(twice.topology(), [&](const Vec3i& p, std::size_t i) {
        const Vec3d old = kFrame.indexFromWorld(twice.frame().worldFromIndex(p.cast<double>()));
        if ((old - old.array().round().matrix()).norm() > 1e-9) return;
        REQUIRE(twice.density()[i] == rawAt(model.field, old.array().round().cast<int>()));
        ++n_same;
    });
    CHECK(n_same > 1000);
}

TEST_CASE("coarse colours are those of what is inside; resampling does not depend on threads", "[export]") {
    const Vec3d centre(15.5, 15.2, 15.8);
    constexpr int kChannels = 4;
    Model model;
    model.field =
        VoxelField(makeTopology(Vec3i::Constant(32), Vec3i::Zero(), Vec3i::Constant(31),
                                [&](const Vec3i& c) { return (c.cast<double>() - centre).norm() < 14; }),
                   kFrame, kChannels, 1.0);
    model.decoder = Decoder(kChannels, 7);
    forEachVoxel(model.field.topology(), [&](const Vec3i& p, std::size_t i) {
        const double r = (p.cast<double>() - centre).norm();
        model.field.density()[i] = static_cast<float>(4 * (11.3 - r));
        for (int c = 0; c < kChannels; ++c)  // two halves, and nonsense outside
            model.field.features()[i * kChannels + c] = r > 11.3 ? 10.0f : p.x() > 15 ? 1.0f : -1.0f;
    });
    MeshOptions options = at(9);
    options.colours = true;
    const Mesh mesh = extract(model, options);
    REQUIRE(mesh.colours.size() == mesh.positions.size());
    for (const float value : {1.0f, -1.0f}) {
        const std::array<float, kChannels> features{value, value, value, value};
        float rgb[3];
        model.decoder.diffuse(1, features.data(), rgb);
        std::size_t n = 0;
        for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
            const Vec3d p = kFrame.indexFromWorld(mesh.positions[v].cast<double>());
            if ((p.x() - 15.5) * value < 7) continue;  // two coarse voxels from the other half
            ++n;
            for (int c = 0; c < 3; ++c) REQUIRE(std::abs(mesh.colours[v][c] - 255 * rgb[c]) < 6);
        }
        CHECK(n > 5);
    }
    for (const int resolution : {9, 20, 50}) {
        options.resolution = resolution;
        const ThreadLimit limit(1);
        const Mesh one = extract(model, options);
        const ThreadLimit four(4);
        CHECK(sameBytes(one, extract(model, options)));
    }
    for (const int resolution : {-1, kMostResolution + 1})
        CHECK_THROWS_AS(extract(model, at(resolution)), UsageError);
}
