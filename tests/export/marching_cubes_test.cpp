// SPDX-License-Identifier: Apache-2.0
#include "export/marching_cubes.h"

#include <algorithm>
#include <map>
#include <set>

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "export/vertex_colours.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

/// Random numbers in order, for tests only.
struct Dice {
    std::uint64_t seed;
    std::uint64_t n = 0;
    float unit() { return unitFloat(static_cast<std::uint32_t>(randomBits(seed, 0, n++) >> 32)); }
    float between(float low, float high) { return low + (high - low) * unit(); }
};

/// Euler characteristic of the iso-surface at raw 0, from the field alone: crossed edges, minus segments on
/// faces, plus one disc per loop on each cube. A cube's loops are the borders between the pieces of its
/// surface: corners hang together along edges, and across an ambiguous face as its saddle says.
std::int64_t eulerOfField(const VoxelField& field, const Vec3i& low, const Vec3i& high) {
    std::int64_t n_edges = 0, n_segments = 0, n_loops = 0;
    for (int x = low.x(); x < high.x(); ++x)
        for (int y = low.y(); y < high.y(); ++y)
            for (int z = low.z(); z < high.z(); ++z) {
                const Vec3i ijk(x, y, z);
                double value[2][2][2];
                for (int c = 0; c < 8; ++c)
                    value[c >> 2][c >> 1 & 1][c & 1] = rawAt(field, ijk + Vec3i(c >> 2, c >> 1 & 1, c & 1));
                const auto at = [&](int c) { return value[c >> 2][c >> 1 & 1][c & 1]; };
                const auto isInside = [&](int c) { return at(c) >= 0; };
                std::array<int, 8> piece{0, 1, 2, 3, 4, 5, 6, 7};
                const auto join = [&](int a, int b) {
                    const int from = piece[a], to = piece[b];
                    for (int& p : piece) p = p == from ? to : p;
                };
                bool is_mixed = false;
                for (int c = 0; c < 8; ++c)
                    for (const int step : {4, 2, 1}) {
                        if (c & step) continue;
                        if (isInside(c) == isInside(c + step))
                            join(c, c + step);
                        else
                            is_mixed = true;
                    }
                for (const int step : {4, 2, 1}) {
                    n_edges += isInside(0) != isInside(step);
                    const int u = step == 4 ? 2 : 4, v = step == 1 ? 2 : 1;
                    for (const int base : {0, step}) {
                        const int a = base, b = base + u, c = base + u + v, d = base + v;
                        const int n_inside = isInside(a) + isInside(b) + isInside(c) + isInside(d);
                        const bool is_ambiguous = n_inside == 2 && isInside(a) == isInside(c);
                        if (base == 0) n_segments += is_ambiguous ? 2 : n_inside % 4 != 0;
                        if (!is_ambiguous) continue;
                        // The saddle's value has the sign of (a c - b d) / (a + c - b - d).
                        const double saddle = (at(a) * at(c) - at(b) * at(d)) / (at(a) + at(c) - at(b) - at(d));
                        if (isInside(a) == (saddle >= 0))
                            join(a, c);
                        else
                            join(b, d);
                    }
                }
                if (is_mixed) n_loops += std::set<int>(piece.begin(), piece.end()).size() - 1;
            }
    return n_edges - n_segments + n_loops;
}

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

TEST_CASE("one cell with any signs and any values gives a closed oriented manifold", "[export]") {
    Dice dice{1};
    // The cell (7, 7, 7) has its corners in eight leaves; the others are one leaf's inner cell.
    for (const Vec3i& cell : {Vec3i(3, 3, 3), Vec3i(7, 7, 7)}) {
        Model model = modelOf(
            makeTopology(Vec3i(16, 16, 16), cell, cell + Vec3i::Ones(), [](const Vec3i&) { return true; }));
        for (int pattern = 1; pattern < 256; ++pattern)
            for (int round = 0; round < 4; ++round) {
                setDensity(model.field, [&](const Vec3i& ijk) {
                    const Vec3i c = ijk - cell;
                    const bool is_inside = pattern >> (c.x() * 4 + c.y() * 2 + c.z()) & 1;
                    return is_inside ? dice.between(0, 3) : dice.between(-3, -1e-6f);
                });
                const Mesh mesh = extract(model);
                INFO("pattern " << pattern << ", round " << round);
                REQUIRE(complaint(mesh) == "");
                REQUIRE(measureMesh(mesh).euler ==
                        eulerOfField(model.field, cell - Vec3i::Ones(), cell + Vec3i::Constant(2)));
            }
    }
}

TEST_CASE("thousands of random sparse fields give closed oriented manifolds of the right topology",
          "[export]") {
    std::size_t n_meshes = 0, n_triangles = 0;
    for (std::uint64_t seed = 0; seed < 2400; ++seed) {
        Dice dice{seed};
        const float share_of_cells = dice.between(0.05f, 1), share_inside = dice.between(0.1f, 0.9f);
        const int kind = static_cast<int>(seed % 3);
        const Vec3i low(5, 5, 5), high(10, 10, 10);  // across the corner of eight leaves
        Model model = modelOf(makeTopology(Vec3i(16, 16, 16), low, high,
                                           [&](const Vec3i&) { return dice.unit() < share_of_cells; }));
        if (model.field.topology().voxelCount() == 0) continue;
        bool has_inside = false;
        setDensity(model.field, [&](const Vec3i& ijk) {
            const bool is_inside = dice.unit() < share_inside;
            float raw = is_inside ? dice.between(0, 2) : dice.between(-2, -1e-6f);  // noise: every ambiguity
            if (kind == 1) raw = is_inside ? 0.0f : -1.0f;                          // values on the iso itself
            if (kind == 2) raw = ijk.x() % 2 ? 1.0f : dice.between(-2, 0.1f);       // sheets that nearly touch
            has_inside |= raw >= 0;
            return raw;
        });
        if (!has_inside) continue;
        const Mesh mesh = extract(model);
        INFO("seed " << seed);
        REQUIRE(complaint(mesh) == "");
        REQUIRE(measureMesh(mesh).euler ==
                eulerOfField(model.field, low - Vec3i::Ones(), high + Vec3i::Ones()));
        ++n_meshes;
        n_triangles += mesh.triangles.size();
    }
    CHECK(n_meshes > 2000);
    CHECK(n_triangles > 500000);
}

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
    colourVertices(model, probe);
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
