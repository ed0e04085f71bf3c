// SPDX-License-Identifier: Apache-2.0
#include "export/marching_cubes.h"

#include <algorithm>
#include <set>
#include <tuple>

#include "core/error.h"
#include "core/parallel.h"
#include "export/vertex_colours.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

/// raw = sharpness * (radius - distance to centre), voxels; cells of a band around the surface and inside it.
Model sphereModel(int dim, const Vec3d& centre, double radius, double voxel_size, double origin,
                  double sharpness = 2) {
    const auto distance = [&](const Vec3i& ijk) {
        return (Vec3d::Constant(origin) + voxel_size * ijk.cast<double>() - centre).norm() - radius;
    };
    Model model = modelOf(makeTopology(Vec3i::Constant(dim), Vec3i::Zero(), Vec3i::Constant(dim - 1),
                                       [&](const Vec3i& c) { return distance(c) < 3 * voxel_size; }),
                          {Vec3d::Constant(origin), voxel_size});
    setDensity(model.field, [&](const Vec3i& ijk) { return static_cast<float>(-sharpness * distance(ijk)); });
    return model;
}

}  // namespace

TEST_CASE("surfaces close at the border of the box and at that of the known region", "[export]") {
    for (const double c : {0.0, 4.0, 15.0}) {  // centre at a corner of the box, inside it, at the far corner
        const Mesh mesh = extract(sphereModel(16, Vec3d(c, c, c), 6.3, 1, 0));
        INFO("centre " << c);
        CHECK(complaint(mesh) == "");
        CHECK(measureMesh(mesh).euler == 2);
        CHECK(measureMesh(mesh).pieces == 1);
    }
    // A full block of leaf (0, 0, 0) to (1, 1, 1): only the border of what is known makes the surface.
    Model model = modelOf(
        makeTopology(Vec3i(16, 16, 16), Vec3i(0, 0, 0), Vec3i(15, 15, 15), [](const Vec3i&) { return true; }));
    setDensity(model.field, [](const Vec3i&) { return 5.0f; });
    const Mesh mesh = extract(model);
    CHECK(complaint(mesh) == "");
    const double edge = 15 + 2 * 5.0 / (5.0 - kEmptyRaw);  // each side crosses towards kEmptyRaw
    // Edges and corners of the box are bevelled by less than a voxel: 12 edges of 15 * (0.2)^2 / 2.
    CHECK(measureMesh(mesh).volume == Approx(edge * edge * edge).margin(12 * 15 * 0.02 + 1));
    const std::size_t n_face_on = std::count_if(mesh.normals.begin(), mesh.normals.end(), [](const Vec3f& n) {
        return n.cwiseAbs().maxCoeff() > 0.9999f;
    });
    CHECK(n_face_on == 6 * 14 * 14);  // all but those at edges of the box look straight out
}

TEST_CASE("an open surface lacks what only closes it, and nothing else", "[export]") {
    // A ground that goes on to all sides: the surface of its known part is its top, the rest closes.
    const auto height = [](const Vec3i& v) { return 8.3 + 0.02 * v.x(); };
    Model ground = modelOf(makeTopology(Vec3i(32, 32, 24), Vec3i(0, 0, 0), Vec3i(30, 30, 20), [](const Vec3i&) { return true; }));
    setDensity(ground.field, [&](const Vec3i& v) { return static_cast<float>(2 * (height(v) - v.z())); });
    MeshOptions options;
    options.iso = ground.field.densityScale();  // raw 0
    options.colours = false;
    Report silent;
    const Mesh closed = extractSurface(ground, options, silent);
    options.open = true;
    const Mesh open = extractSurface(ground, options, silent);
    CHECK(measureMesh(closed).closed());
    const MeshMeasures measures = measureMesh(open);
    CHECK(measures.pieces == 1);
    CHECK(measures.bad_edges == 0);
    CHECK(measures.open_edges == 4 * 30);
    CHECK(measures.euler == 1);  // a sheet
    CHECK(open.positions.size() == open.normals.size());
    for (const Vec3f& p : open.positions) CHECK(std::abs(p.z() - 8.3f - 0.02f * p.x()) < 1e-3f);
    CHECK(measures.area == Approx(30 * 30 * std::sqrt(1 + 0.02 * 0.02)).epsilon(1e-4));

    // A ball inside the known region has nothing to open; bounds that cut it do.
    Model ball = sphereModel(32, Vec3d(15, 15, 15), 9.3, 1, 0);
    options = {};
    options.iso = ball.field.densityScale();
    options.colours = false;
    const Mesh whole = extractSurface(ball, options, silent);
    options.open = true;
    CHECK(extractSurface(ball, options, silent).triangles.size() == whole.triangles.size());
    options.bounds = Box{Vec3d(0, 0, 0), Vec3d(31, 31, 15)};
    const Mesh half = extractSurface(ball, options, silent);
    CHECK(measureMesh(half).euler == 1);
    CHECK(measureMesh(half).area == Approx(2 * M_PI * 9.3 * 9.3).epsilon(0.02));

    // Nothing but the border of what is known.
    setDensity(ground.field, [](const Vec3i&) { return 5.0f; });
    options.bounds.reset();
    CHECK_THROWS_AS(extractSurface(ground, options, silent), NumericError);
    options.method = SurfaceMethod::dual;
    CHECK_THROWS_AS(extractSurface(ball, options, silent), UsageError);
}

TEST_CASE("the mesh is the same for any number of threads", "[export]") {
    const Model model = sphereModel(64, Vec3d(31, 32, 30), 25, 1, 0);
    const auto with = [&](int threads) {
        const ThreadLimit limit(threads);
        return extract(model);
    };
    const Mesh one = with(1);
    CHECK(one.triangles.size() > 10000);
    CHECK(sameBytes(one, with(4)));
    CHECK(sameBytes(one, with(3)));
}

TEST_CASE("a sphere has its radius, its normals, and second-order convergence", "[export]") {
    double error[3];
    for (int level = 0; level < 3; ++level) {
        const int dim = 24 << level;
        const double voxel = 1.0 / (1 << level), radius = 8.2;
        const Vec3d centre(0.13, -0.21, 0.37);
        const Mesh mesh = extract(sphereModel(dim, centre, radius, voxel, -12, 2 / voxel));
        CHECK(complaint(mesh) == "");
        error[level] = 0;
        double worst_cosine = 1;
        for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
            const Vec3d from_centre = mesh.positions[v].cast<double>() - centre;
            error[level] = std::max(error[level], std::abs(from_centre.norm() - radius));
            worst_cosine = std::min(worst_cosine, from_centre.normalized().dot(mesh.normals[v].cast<double>()));
        }
        CHECK(error[level] < 0.05 * voxel);
        CHECK(worst_cosine > std::cos(1.0 / 180 * 3.14159265));  // one degree
        const MeshMeasures m = measureMesh(mesh);
        CHECK(m.euler == 2);
        CHECK(m.pieces == 1);
        // An inscribed polyhedron of edges h < 1.5 voxels misses about h^2 / (8 r) of depth all over.
        const double volume = 4.0 / 3 * 3.14159265 * radius * radius * radius;
        CHECK(m.volume == Approx(volume).epsilon(3 * 1.5 * 1.5 * voxel * voxel / (8 * radius * radius)));
    }
    // Linear interpolation of a distance errs by h^2 / (8 r) at most: a quarter for half the voxel. The worst
    // vertex depends on how the grid lies, hence 3.5.
    CHECK(error[0] / error[1] > 3.5);
    CHECK(error[1] / error[2] > 3.5);
}

TEST_CASE("bounds close the surface at voxel planes; what adjoins them lines up with the whole", "[export]") {
    const GridFrame frame{Vec3d(-3, 5, 1), 0.5};
    Model model = modelOf(makeTopology(Vec3i(32, 32, 32), Vec3i(1, 1, 1), Vec3i(30, 30, 30),
                                       [](const Vec3i& c) { return (c - Vec3i(15, 15, 15)).norm() < 14.5; }),
                          frame);
    setDensity(model.field, [](const Vec3i& p) {  // a ball with a wavy hollow
        const double r = (p.cast<double>() - Vec3d(15.3, 15.1, 14.8)).norm();
        return static_cast<float>(std::min(11.4 - r, r - 5 - std::sin(1.3 * p.x()) * std::cos(1.1 * p.y() + p.z())));
    });
    using Corners = std::array<std::array<float, 3>, 3>;
    const auto corners = [](const Triangle& t, const std::vector<Vec3f>& of) {
        Corners key;
        for (int k = 0; k < 3; ++k) key[k] = {of[t[k]].x(), of[t[k]].y(), of[t[k]].z()};
        return key;
    };
    std::multiset<std::pair<Corners, Corners>> whole, tiled;  // positions and normals
    const Mesh all = extract(model);
    for (const Triangle& t : all.triangles)
        whole.insert({corners(t, all.positions), corners(t, all.normals)});

    double volume = 0;
    const auto planes = [&](int axis, int i) {  // of three tiles; the second plane lies on a leaf's border
        const double index[4] = {-1, axis == 0 ? 13.0 : 16.0, axis == 2 ? 16.0 : 20.0, 32};
        return frame.origin[axis] + frame.voxel_size * index[i];
    };
    for (int tile = 0; tile < 27; ++tile) {
        const int i[3] = {tile / 9, tile / 3 % 3, tile % 3};
        Box box;
        bool is_empty = false;
        for (int axis = 0; axis < 3; ++axis) {
            box.min[axis] = planes(axis, i[axis]) + 0.2 * frame.voxel_size;  // to be rounded
            box.max[axis] = planes(axis, i[axis] + 1) - 0.3 * frame.voxel_size;
            is_empty |= i[axis] == 1 && planes(axis, 1) == planes(axis, 2);
        }
        MeshOptions options = kPlain;
        options.bounds = box;
        if (is_empty) {
            CHECK_THROWS_AS(extract(model, options), UsageError);
            continue;
        }
        const Mesh mesh = extract(model, options);
        INFO("tile " << tile);
        REQUIRE(complaint(mesh) == "");
        volume += measureMesh(mesh).volume;
        const auto isCap = [&](const Vec3f& p) {
            for (int axis = 0; axis < 3; ++axis)
                if (p[axis] < planes(axis, i[axis]) - 1e-5 || p[axis] > planes(axis, i[axis] + 1) + 1e-5) return true;
            return false;
        };
        for (const Triangle& t : mesh.triangles) {
            if (isCap(mesh.positions[t[0]]) || isCap(mesh.positions[t[1]]) || isCap(mesh.positions[t[2]])) continue;
            tiled.insert({corners(t, mesh.positions), corners(t, mesh.normals)});
        }
        for (const Vec3f& p : mesh.positions)
            for (int axis = 0; axis < 3; ++axis) {  // nowhere further out than a thousandth of a voxel
                REQUIRE(p[axis] > planes(axis, i[axis]) - 0.001 * frame.voxel_size - 1e-5);
                REQUIRE(p[axis] < planes(axis, i[axis] + 1) + 0.001 * frame.voxel_size + 1e-5);
            }
    }
    CHECK(whole.size() > 3000);
    CHECK(tiled == whole);
    CHECK(volume == Approx(measureMesh(all).volume).epsilon(0.005));  // tiles overlap by a 500th of a voxel

    MeshOptions away = kPlain;
    away.bounds = Box{frame.worldFromIndex(Vec3d(1, 1, 1)), frame.worldFromIndex(Vec3d(3, 3, 3))};
    CHECK_THROWS_WITH(extract(model, away), Catch::Contains("nothing inside"));
}

TEST_CASE("bounds cut through what was filled, far from any leaf", "[export]") {
    // A shell of one layer of leaves around a hollow of 3^3 absent leaves: filled, then cut in the middle.
    const auto isShell = [](const Vec3i& c) { return (c.array() < 8).any() || (c.array() >= 32).any(); };
    Model model = modelOf(makeTopology(Vec3i(40, 40, 40), Vec3i(2, 2, 2), Vec3i(37, 37, 37), isShell));
    setDensity(model.field, [](const Vec3i&) { return 1.0f; });
    MeshOptions options = kPlain;
    options.fill_inside = true;
    const auto planes = GENERATE(table<double, double>({{12, 28}, {16, 24}, {15, 23}, {17, 25}, {-1, 20}, {16, 41}}));
    const auto [low, high] = planes;
    options.bounds = Box{Vec3d::Constant(low), Vec3d::Constant(high)};
    const Mesh mesh = extract(model, options);
    INFO("from " << low << " to " << high);
    CHECK(complaint(mesh) == "");
    CHECK(measureMesh(mesh).euler == 2);
    const double first = std::max(low, 2 - 0.05), last = std::min(high, 37 + 0.05);
    CHECK(measureMesh(mesh).volume == Approx(std::pow(last - first, 3)).epsilon(0.01));
}

TEST_CASE("crossings of a linear field are exact, in world units, for a given iso", "[export]") {
    // raw = x - 6.25 falls through ln(iso / density_scale) at x = 6.25 + that, rising to the right.
    Model model;
    const GridFrame frame{Vec3d(-3, 5, 100), 0.5};
    model.field = VoxelField(
        makeTopology(Vec3i(16, 16, 16), Vec3i(0, 0, 0), Vec3i(15, 15, 15), [](const Vec3i&) { return true; }),
        frame, 0, 40.0);
    setDensity(model.field, [](const Vec3i& ijk) { return ijk.x() - 6.25f; });
    const double iso = 40 * std::exp(2.125);
    const Mesh mesh = extract(model, {.iso = iso, .colours = false});
    std::size_t n_on_plane = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec3d index = frame.indexFromWorld(mesh.positions[v].cast<double>());
        if (index.x() > 9 || index.y() < 0 || index.y() > 15 || index.z() < 0 || index.z() > 15) continue;
        ++n_on_plane;
        REQUIRE(index.x() == Approx(8.375).margin(1e-5));  // float positions near 100 are 8e-6 apart
        REQUIRE(mesh.normals[v].x() == Approx(-1));
    }
    CHECK(n_on_plane == 16 * 16);
    CHECK(automaticIso(model.field) == Approx(std::log(2.0) / 0.5));
}

TEST_CASE("vertices take the diffuse colour of the features between their voxels", "[export]") {
    Model model;
    constexpr int kChannels = 4;
    model.field = VoxelField(
        makeTopology(Vec3i(16, 16, 16), Vec3i(2, 2, 2), Vec3i(13, 13, 13), [](const Vec3i&) { return true; }),
        {}, kChannels, 1.0);
    model.decoder = Decoder(kChannels, 7);
    const auto feature = [](const Vec3d& p, int c) { return static_cast<float>(0.3 * p[c % 3] - 2 + 0.1 * c); };
    forEachVoxel(model.field.topology(), [&](const Vec3i& ijk, std::size_t index) {
        model.field.density()[index] =
            static_cast<float>(4.3 - (ijk.cast<double>() - Vec3d(7.5, 7.4, 7.6)).norm());
        for (int c = 0; c < kChannels; ++c)
            model.field.features()[index * kChannels + c] = feature(ijk.cast<double>(), c);
    });
    const Mesh mesh = extract(model, {.iso = 1.0});
    REQUIRE(mesh.colours.size() == mesh.positions.size());
    for (std::size_t v = 0; v < mesh.positions.size(); v += 17) {
        float features[kChannels], rgb[3];
        for (int c = 0; c < kChannels; ++c) features[c] = feature(mesh.positions[v].cast<double>(), c);
        model.decoder.diffuse(1, features, rgb);
        // Features are linear in space, so interpolation is exact; rounding to 8 bits may fall to either side.
        for (int c = 0; c < 3; ++c) REQUIRE(std::abs(mesh.colours[v][c] - 255 * rgb[c]) < 0.51);
    }
    // Beyond the known region only voxels inside it count: the same colour as at its border.
    Mesh probe;
    probe.positions = {Vec3f(2, 5, 5), Vec3f(1.5f, 5, 5)};
    colourVertices(model.decoder, model.field, probe);
    CHECK(probe.colours[0] == probe.colours[1]);
}

TEST_CASE("fog that nowhere stops half of the light is cut at half of its maximum, and that is said",
          "[export]") {
    struct Notes : Report {
        void info(const std::string& line) override { lines += line + "\n"; }
        std::string lines;
    } notes;
    Model fog = sphereModel(24, Vec3d(12, 12, 12), 9, 1, 0, 0.5);
    forEachVoxel(fog.field.topology(), [&](const Vec3i&, std::size_t i) { fog.field.density()[i] -= 6; });
    // In the middle raw = 0.5 * 9 - 6 = -1.5; half of that density is ln 2 less, 2 ln 2 voxels off the middle.
    CHECK(automaticIso(fog.field) == Approx(0.5 * std::exp(-1.5)));
    const Mesh mesh = extractSurface(fog, {.iso = {}, .colours = false}, notes);
    CHECK_THAT(notes.lines, Catch::Contains("half of the field's maximum"));
    CHECK(complaint(mesh) == "");
    for (const Vec3f& position : mesh.positions)  // edges bend the cone's circles: 1 / (8 * 1) of a voxel
        CHECK((position - Vec3f(12, 12, 12)).norm() == Approx(2 * std::log(2.0)).margin(0.25));
    CHECK_THROWS_WITH(extract(fog, {.iso = 0.3, .colours = false}),
                      Catch::Contains("the field's maximum, 0.2231"));

    setDensity(fog.field, [](const Vec3i&) { return kEmptyRaw; });
    CHECK_THROWS_WITH(extract(fog, {.iso = {}, .colours = false}), Catch::Contains("only empty voxels"));
}

TEST_CASE("what cannot be meshed is said", "[export]") {
    Report silent;
    CHECK_THROWS_AS(extract(modelOf(Topology(Vec3i(8, 8, 8), {}))), NumericError);

    Model model = sphereModel(16, Vec3d(8, 8, 8), 4, 1, 0);
    CHECK_THROWS_WITH(extract(model, {.iso = 1e6, .colours = false}),
                      Catch::Contains("maximum, 2981") && Catch::Contains("1e+06"));  // exp(2 * 4) = 2981
    for (const double iso : {0.0, -1.0, 1e-12, std::nan(""), HUGE_VAL})
        CHECK_THROWS_AS(extract(model, {.iso = iso, .colours = false}), UsageError);
    model.field
        .density()[static_cast<std::size_t>(model.field.topology().findLeaf(Vec3i(1, 1, 1))) * kLeafVoxels] =
        std::nanf("");
    CHECK_THROWS_AS(extract(model), NumericError);

    struct Stop : Report {
        bool cancelled() const override { return true; }
    } stop;
    CHECK_THROWS_AS(extractSurface(sphereModel(16, Vec3d(8, 8, 8), 4, 1, 0), kPlain, stop), Interrupted);
}
