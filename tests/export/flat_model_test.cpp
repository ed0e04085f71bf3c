// SPDX-License-Identifier: Apache-2.0
#include "export/flat_model.h"

#include <cmath>
#include <set>
#include <tuple>

#include "core/atomic_file.h"
#include "core/error.h"
#include "export/marching_cubes.h"
#include "export/vdb_export.h"
#include "tests/support/catch.h"
#include "tests/support/nested_field.h"
#include "tests/support/seen_model.h"
#include "tests/support/temp_dir.h"
#include "vdb/model_file.h"
#include "vdb/renderer.h"
#include "vdb/volume_file.h"

using namespace nerfvdb;

namespace {

const Vec3i kExtent(16, 24, 8);

/// Three shells; a slope that trilinear interpolation repeats exactly in voxels of any size.
Model slopingModel() {
    Model model;
    model.field = test::nestedField(kExtent, 3, 4);
    test::setNested(model.field, [](const Vec3d& p) { return 0.3 * p.x() - 0.2 * p.y() + 0.1 * p.z() - 1; });
    model.decoder = Decoder(4, 3);
    model.sky = Sky(8, Vec3f(0.2f, 0.4f, 0.8f));
    return model;
}

/// A ball about the middle, dense inside, in so many shells.
Model ballModel(double radius, int shells) {
    Model model;
    model.field = test::nestedField(Vec3i::Constant(16), shells, 4);
    const Vec3d centre = model.field.shellBox(0).center();
    // Sigma falls by e in one inner voxel.
    test::setNested(model.field, [&](const Vec3d& p) { return (radius - (p - centre).norm()) / 0.05 + std::log(1.386); });
    model.decoder = Decoder(4, 3);
    return model;
}

double opacityOf(const Model& model, const Camera& camera) {
    const RenderedImage image = Renderer(model, {}).render(camera);
    double sum = 0;
    for (const float opacity : image.opacity.pixels) sum += opacity;
    return sum / static_cast<double>(image.opacity.pixels.size());
}

}  // namespace

TEST_CASE("a flat model has the field's values at every voxel of the box, and no cell twice or left out") {
    const Model model = slopingModel();
    for (int shells = 1; shells <= 3; ++shells) {
        const Model flat = flatModel(model, shells);
        const VoxelField& field = flat.field;
        REQUIRE(field.shells().count == 1);
        CHECK(field.frame().voxel_size == model.field.frame().voxel_size);
        CHECK(field.densityScale() == model.field.densityScale());
        CHECK(flat.sky.isEmpty());
        const Vec3i edge = kExtent * (1 << (shells - 1));
        CHECK(field.topology().cellCount() == static_cast<std::size_t>(edge.prod()));
        CHECK(field.topology().voxelCount() == static_cast<std::size_t>((edge + Vec3i::Ones()).prod()));
        CHECK(flatSize(model.field, shells).cells == edge.prod());
        const Box box = model.field.shellBox(shells - 1);
        double worst = 0, worst_feature = 0;
        std::size_t n_outside = 0;
        test::forEachVoxel(field.topology(), [&](const Vec3i& ijk, std::size_t i) {
            const Vec3d p = field.frame().worldFromIndex(ijk.cast<double>());
            n_outside += !Box{box.min - Vec3d::Constant(1e-9), box.max + Vec3d::Constant(1e-9)}.contains(p);
            worst = std::max(worst, std::abs(field.density()[i] - (0.3 * p.x() - 0.2 * p.y() + 0.1 * p.z() - 1)));
            for (int c = 0; c < 4; ++c)
                worst_feature = std::max(worst_feature, std::abs(field.features()[i * 4 + c] - std::sin(0.9 * p[c % 3] + c)));
        });
        CHECK(n_outside == 0);
        CHECK(worst < 2e-6);  // raw values near 3 in single precision, eight of them summed
        // Between voxels of 0.2 a sine of 0.9 radians a unit leaves its chord by at most (0.9 * 0.2)^2 / 8.
        CHECK(worst_feature < (shells == 1 ? 1e-6 : 0.0042));
    }
}

TEST_CASE("what a shell halves leaves in its own voxels, as the mean of their sigma") {
    Model model;
    const Vec3i extent(32, 16, 48);
    const auto logSigma = [](const Vec3d& p) { return 0.3 * p.x() - 0.2 * p.y() + 0.1 * p.z() - 1; };
    model.field = test::nestedField(extent, 2, 4);
    const Vec3i dims(4, 2, 6);
    std::vector<std::uint8_t> halvings(static_cast<std::size_t>(2 * dims.prod()));
    for (std::size_t i = 0; i < halvings.size(); ++i) halvings[i] = static_cast<std::uint8_t>(i * 5 / 3 % (kMostHalvings + 1));
    model.field = test::halvedField(std::move(model.field), dims, halvings);
    test::setNested(model.field, logSigma);
    model.decoder = Decoder(4, 3);
    const auto check = [&](const Model& flat, double own_voxel) {
        const VoxelField& field = flat.field;
        REQUIRE(field.shells().count == 1);
        CHECK(field.frame().voxel_size == Approx(own_voxel));
        double worst = 0, worst_feature = 0;
        test::forEachVoxel(field.topology(), [&](const Vec3i& ijk, std::size_t i) {
            const Vec3d p = field.frame().worldFromIndex(ijk.cast<double>());
            worst = std::max(worst, std::abs(field.density()[i] + std::log(field.densityScale() / 10) - logSigma(p)));
            for (int c = 0; c < 4; ++c)
                worst_feature = std::max(worst_feature, std::abs(field.features()[i * 4 + c] - std::sin(0.9 * p[c % 3] + c)));
        });
        // A cube that a layer owns only in part has its middle up to half a voxel (of 0.1) elsewhere.
        CHECK(worst < 0.3 * 0.05 + 0.2 * 0.05 + 0.1 * 0.05);
        CHECK(worst_feature < 0.9 * 0.05 + 0.0042);
    };
    const Model inner = flatModel(model, 1), both = flatModel(model, 2);
    CHECK(inner.field.topology().cellCount() == static_cast<std::size_t>(extent.prod()));
    CHECK(both.field.topology().cellCount() == static_cast<std::size_t>(8 * extent.prod()));
    CHECK(flatSize(model.field, 1).cells >= extent.prod());
    check(inner, 0.05);
    check(both, 0.05);
    const Model outer = shellModel(model, 1);
    CHECK(outer.field.topology().cellCount() == static_cast<std::size_t>(extent.prod() - extent.prod() / 8));
    check(outer, 0.1);
}

TEST_CASE("an opaque sheet in halved cells stays opaque, and about as thick, in voxels twice as large") {
    Model model;
    model.field = test::halvedField(test::nestedField(Vec3i::Constant(16), 2, 4), Vec3i::Constant(2),
                                    std::vector<std::uint8_t>(16, 1));
    const Vec3d centre = model.field.shellBox(0).center();
    test::forEachNested(model.field, [&](int, const Vec3d& p, std::size_t i) {
        model.field.density()[i] = std::abs(p.z() - centre.z() - 0.025) < 0.01 ? kMaxRaw : kEmptyRaw;  // one voxel
    });
    model.decoder = Decoder(4, 3);
    const Model flat = flatModel(model, 1);
    const Camera camera = lookAt(centre + Vec3d(0, 0, 3), centre, Vec3d::UnitY(), 0.1, 8, 8);
    CHECK(opacityOf(flat, camera) > 0.99);
    double most = -100;
    test::forEachVoxel(flat.field.topology(), [&](const Vec3i& ijk, std::size_t i) {
        const double z = flat.field.frame().worldFromIndex(ijk.cast<double>()).z() - centre.z();
        if (std::abs(z - 0.025) > 0.051) most = std::max<double>(most, flat.field.density()[i]);
    });
    CHECK(most < -5);  // nothing where the sheet is not
}

TEST_CASE("where shells meet, a flat model has the finer one's values") {
    Model model = slopingModel();
    test::forEachNested(model.field, [&](int shell, const Vec3d&, std::size_t i) {
        model.field.density()[i] = static_cast<float>(shell);
        for (int c = 0; c < 4; ++c) model.field.features()[i * 4 + c] = static_cast<float>(shell);
    });
    const Model flat = flatModel(model, 2);
    const Box inner = model.field.shellBox(0);
    std::size_t n_inner = 0, wrong = 0;
    test::forEachVoxel(flat.field.topology(), [&](const Vec3i& ijk, std::size_t i) {
        const Vec3d p = flat.field.frame().worldFromIndex(ijk.cast<double>());
        const bool is_inner = Box{inner.min - Vec3d::Constant(1e-9), inner.max + Vec3d::Constant(1e-9)}.contains(p);
        n_inner += is_inner;
        wrong += flat.field.features()[i * 4] != (is_inner ? 0.0f : 1.0f);
        wrong += std::abs(flat.field.density()[i] - (is_inner ? 0.0 : 1.0 - std::log(2.0))) > 1e-6;
    });
    CHECK(n_inner == static_cast<std::size_t>((kExtent + Vec3i::Ones()).prod()));
    CHECK(wrong == 0);
}

TEST_CASE("what is opaque in an outer shell stays as opaque") {
    Model model = slopingModel();
    for (float& raw : model.field.density()) raw = kMaxRaw + 3;
    const Model flat = flatModel(model, 2);
    const int leaf = flat.field.topology().findLeaf(Vec3i::Zero());
    REQUIRE(leaf >= 0);
    const float sigma = sigmaFromRaw(flat.field.density()[static_cast<std::size_t>(leaf) * kLeafVoxels], 10.0);
    CHECK(sigma == Approx(sigmaFromRaw(kMaxRaw, 5.0)).epsilon(1e-5));  // e^15 in single precision
}

TEST_CASE("a ball that goes through shells has one closed surface and no wall inside") {
    // The inner box reaches to 0.4, the next to 0.8, the third to 1.6.
    const double radius = GENERATE(0.3, 0.5, 1.1);
    const Model model = ballModel(radius, 3);
    Report silent;
    MeshOptions options;
    options.iso = 13.86;  // where the ball ends
    const Mesh mesh = extractSurface(flatModel(model, 3), options, silent);
    const MeshMeasures measures = measureMesh(mesh);
    CHECK(measures.closed());
    CHECK(measures.pieces == 1);
    CHECK(measures.euler == 2);
    // Voxels of the shell that holds the surface are 0.05, 0.1 and 0.2: flat between points of the ball, they lack
    // up to h^2 / (4 r) of its radius.
    const double h = radius < 0.4 ? 0.05 : radius < 0.8 ? 0.1 : 0.2, lack = 3 * h * h / (4 * radius * radius);
    CHECK(measures.volume == Approx(4.0 / 3 * M_PI * radius * radius * radius).epsilon(lack + 0.01));
}

TEST_CASE("pictures of a flat model are those of its shells") {
    Model model = slopingModel();
    model.sky = {};
    const Vec3d centre = model.field.worldBox().center();
    const Model flat = flatModel(model, 3), inner = flatModel(model, 1);
    for (const Vec3d& eye : {Vec3d(6, 3, 2), Vec3d(0.1, 0.1, 0.05), Vec3d(-1.2, 0.3, 0.4)}) {
        const Camera camera = lookAt(centre + eye, centre, Vec3d::UnitZ(), 0.7, 24, 24);
        // Steps of half a voxel begin anew in each shell: up to one of 0.1 a border, at sigma about 4.
        CHECK(opacityOf(flat, camera) == Approx(opacityOf(model, camera)).margin(0.03));
        CHECK(opacityOf(inner, camera) < opacityOf(model, camera));
    }
}

TEST_CASE("a shell alone has its own cells and values, and what the others stop is not in it") {
    const Model model = slopingModel();
    const VoxelField& field = model.field;
    std::size_t cells = 0, wrong = 0;
    for (int shell = 0; shell < 3; ++shell) {
        const Model alone = shellModel(model, shell);
        const VoxelField& own = alone.field;
        CHECK(own.frame().voxel_size == field.frame().voxel_size * (1 << shell));
        CHECK(own.densityScale() == field.densityScale() / (1 << shell));
        CHECK((own.frame().origin - field.shellBox(shell).min).norm() < 1e-12);
        cells += own.topology().cellCount();
        test::forEachVoxel(own.topology(), [&](const Vec3i& ijk, std::size_t i) {
            const Vec3i there = ijk + Vec3i(shell * field.shells().stride, 0, 0);
            wrong += own.density()[i] != test::rawAt(field, there);
        });
        CHECK(own.topology().findLeaf(Vec3i(own.topology().dims() / kLeafDim)) == -1);
    }
    CHECK(cells == field.topology().cellCount());
    CHECK(wrong == 0);

    // Light that passes one passes on to the next. Steps begin anew at borders: see above.
    const Vec3d eye = field.worldBox().center() + Vec3d(5, 2, 3);
    const Camera camera = lookAt(eye, field.worldBox().center(), Vec3d::UnitZ(), 0.01, 1, 1);
    double left = 1;
    for (int shell = 0; shell < 3; ++shell) left *= 1 - opacityOf(shellModel(model, shell), camera);
    // Half a step of up to 0.1 at five borders, sigma up to 5.
    CHECK(-std::log(left) == Approx(-std::log(1 - opacityOf(model, camera))).margin(0.6));
}

TEST_CASE("shells in files of their own share no voxel, and lie in one world") {
    const Model model = slopingModel();  // of no cameras: every voxel is written
    const TempDir folder;
    Report silent;
    std::set<std::tuple<long, long, long>> places;
    std::size_t n_voxels = 0;
    ExportVdbOptions options;
    options.placement.origin = PlacementOptions::Origin::middle;
    for (int shell = 0; shell < 3; ++shell) {
        const std::filesystem::path path = folder / (std::to_string(shell) + ".vdb");
        if (shell > 0) options.outside = model.field.shellBox(shell - 1);
        const ExportVdbReport written = exportVdb(shellModel(model, shell), path, options, silent);
        if (shell == 0) options.placed_by = written.bounds;
        n_voxels += written.active_voxels;
        const Volume volume = readVolume(path).volume;
        CHECK((volume.worldFromGrid().apply(volume.frame().origin) - volume.frame().origin).norm() < 1e-9);
        for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
            forEachBit(volume.active()[leaf], [&](int offset) {
                const Vec3d p =
                    volume.frame().worldFromIndex(test::voxelOf(volume.topology(), leaf, offset).cast<double>()) / 0.025;
                // Voxels lie on the lattice of the inner ones' halves about the middle.
                CHECK((p - p.array().round().matrix()).norm() < 1e-3);
                places.insert({std::lround(p.x()), std::lround(p.y()), std::lround(p.z())});
            });
    }
    CHECK(places.size() == n_voxels);
    // All voxels but those on the two borders, which only the inner shell has.
    const Vec3i half = kExtent / 2 + Vec3i::Ones();
    CHECK(n_voxels == model.field.topology().voxelCount() - 2 * (half.prod() - (half - Vec3i::Constant(2)).prod()));
}

TEST_CASE("a model in one box stays as it is") {
    const Model model = test::seenModel();
    const TempDir folder;
    saveModel(model, folder / "a.vdb");
    saveModel(flatModel(model, 1), folder / "b.vdb");
    saveModel(shellModel(model, 0), folder / "c.vdb");
    const std::string before = readFile(folder / "a.vdb");
    const bool flat_is_same = before == readFile(folder / "b.vdb"), shell_is_same = before == readFile(folder / "c.vdb");
    CHECK(flat_is_same);
    CHECK(shell_is_same);
}

TEST_CASE("shells that are none, and boxes too large, are refused with advice") {
    using Catch::Matchers::Contains;
    const Model model = slopingModel();
    CHECK_THROWS_WITH(flatModel(model, 0), Contains("1 to 3"));
    CHECK_THROWS_WITH(flatModel(model, 4), Contains("1 to 3"));
    CHECK_THROWS_AS(shellModel(model, 3), UsageError);
    CHECK_THROWS_AS(shellModel(model, -1), UsageError);
    const double bytes = flatSize(model.field, 3).bytes;
    CHECK(flatModel(model, 3, bytes).field.bytes() < 2 * bytes);
    CHECK_THROWS_WITH(flatModel(model, 3, bytes - 1), Contains("fewer shells") && Contains("voxels"));
}
