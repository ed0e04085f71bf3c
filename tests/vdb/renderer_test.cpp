// SPDX-License-Identifier: Apache-2.0
#include "vdb/renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;

namespace {

constexpr double kVoxel = 0.1;
const Vec3i kDims(24, 24, 24);
const Vec3d kOrigin = Vec3d::Constant(-1.2);  // so that the world's origin is voxel 12

/// A model whose colour is what its features say, from everywhere: sigmoid(feature), no network.
Model plainModel(const std::function<bool(const Vec3i&)>& has_cell,
                 const std::function<double(const Vec3i&)>& raw, const Vec3f& colour) {
    Model model;
    model.field = VoxelField(test::makeTopology(kDims, Vec3i::Zero(), kDims - Vec3i::Ones(), has_cell),
                             {kOrigin, kVoxel}, 4, 1 / kVoxel);
    VoxelField& field = model.field;
    test::forEachVoxel(field.topology(), [&](const Vec3i& ijk, std::size_t i) {
        field.density()[i] = static_cast<float>(raw(ijk));
        for (int c = 0; c < 3; ++c) field.features()[4 * i + c] = std::log(colour[c] / (1 - colour[c]));
    });
    model.decoder = Decoder(4, 1);
    for (float& parameter : model.decoder.parameters()) parameter = 0;
    model.background = Vec3f(0.9f, 0.6f, 0.1f);
    return model;
}

/// Looks along +x at the middle of the box; far away and narrow, so that all rays are nearly parallel.
Camera narrowCamera(int size = 9) {
    return lookAt(Vec3d(-20, 0.03, 0.04), Vec3d(0, 0.03, 0.04), Vec3d::UnitZ(), 0.02, size, size);
}

bool everywhere(const Vec3i&) { return true; }

RenderOptions everyCell() {
    RenderOptions options;
    options.min_alpha = 0;
    return options;
}

}  // namespace

TEST_CASE("an opaque medium of one colour shows exactly that colour") {
    const Vec3f colour(0.2f, 0.5f, 0.85f);
    const Model model = plainModel(
        everywhere, [](const Vec3i&) { return 6.0; }, colour);
    const RenderedImage image = Renderer(model, {}).render(narrowCamera());
    for (int i = 0; i < 9 * 9; ++i) {
        CHECK(image.opacity.pixels[i] == Approx(1).margin(1e-6));
        // The first sample takes all light, but for rounding of the logarithm, the sum and the sigmoid.
        for (int c = 0; c < 3; ++c) CHECK(image.rgb.pixels[3 * i + c] == Approx(colour[c]).margin(2e-6));
    }
}

TEST_CASE("an empty model shows its background, and depth and opacity of nothing") {
    const Model model =
        plainModel([](const Vec3i&) { return false; }, [](const Vec3i&) { return 0.0; }, Vec3f::Ones() / 2);
    RenderOptions options;
    options.normals = true;
    const RenderedImage image = Renderer(model, options).render(narrowCamera());
    for (int i = 0; i < 9 * 9; ++i) {
        for (int c = 0; c < 3; ++c) {
            CHECK(image.rgb.pixels[3 * i + c] == model.background[c]);
            CHECK(image.normal.pixels[3 * i + c] == 0);
        }
        CHECK(image.opacity.pixels[i] == 0);
        CHECK(image.depth.pixels[i] == 0);
    }
    CHECK(image.counters.rays == 81);
    CHECK(image.counters.rays_skipped == 81);
    CHECK(image.counters.samples_density == 0);
}

TEST_CASE("rays that meet nothing show the background, and their decoding changes nothing") {
    const auto ball = [](const Vec3i& cell) { return (cell - Vec3i::Constant(12)).squaredNorm() < 20; };
    Model model = plainModel(
        ball, [](const Vec3i&) { return 1.0; }, Vec3f(0.2f, 0.3f, 0.4f));
    model.decoder = Decoder(4, 7);
    RenderOptions decode_all;
    decode_all.trace.skip_unlit = false;
    const Camera camera = lookAt(Vec3d(-8, 0, 0), Vec3d::Zero(), Vec3d::UnitZ(), 0.3, 40, 40);
    const RenderedImage few = Renderer(model, {}).render(camera), all = Renderer(model, decode_all).render(camera);
    CHECK(few.rgb.pixels == all.rgb.pixels);
    CHECK(few.opacity.pixels == all.opacity.pixels);
    CHECK(few.counters.rays_skipped > 400);
    CHECK(few.counters.rays_skipped < 1500);
    for (int c = 0; c < 3; ++c) CHECK(few.rgb.at(0, 0)[c] == model.background[c]);
    CHECK(*few.opacity.at(0, 0) == 0);
    CHECK(*few.opacity.at(20, 20) > 0.5f);

    // A broken model shows where it is broken, and there alone, whichever tiles a thread did before.
    for (float& feature : model.field.features()) feature = std::numeric_limits<float>::quiet_NaN();
    const ThreadLimit one_thread(1);
    const RenderedImage broken = Renderer(model, {}).render(camera);
    CHECK(std::isnan(broken.rgb.at(20, 20)[0]));
    for (int c = 0; c < 3; ++c) CHECK(broken.rgb.at(39, 39)[c] == model.background[c]);
}

TEST_CASE("without view-dependence a pixel has its mean features' colour, averaged over directions, as if opaque") {
    const auto ball = [](const Vec3i& cell) { return (cell - Vec3i::Constant(12)).squaredNorm() < 20; };
    Model model = plainModel(
        ball, [](const Vec3i&) { return -2.0; }, Vec3f(0.2f, 0.3f, 0.4f));
    for (std::size_t i = 0; i < model.field.features().size(); ++i)
        model.field.features()[i] = test::randomIn(-2, 2, 71, i);
    model.decoder = Decoder(4, 7);
    for (std::size_t i = 0; i < model.decoder.parameters().size(); ++i)
        model.decoder.parameters()[i] = test::randomIn(-0.3f, 0.3f, 72, i);  // a fresh network's output is zero
    RenderOptions options;
    options.view_dependent = false;
    const Camera camera = lookAt(Vec3d(-8, 0.3, 0.1), Vec3d::Zero(), Vec3d::UnitZ(), 0.15, 20, 20);
    const RenderedImage flat = Renderer(model, options).render(camera), viewed = Renderer(model, {}).render(camera);
    CHECK(flat.opacity.pixels == viewed.opacity.pixels);

    const Occupancy occupancy = findOccupied(model.field, 0);
    const TraceScene scene(model.field, occupancy);
    RayTracer tracer(1);
    KeptSamples kept;
    int n_background = 0, n_thin = 0;
    double difference = 0;
    for (int y = 0; y < 20; ++y)
        for (int x = 0; x < 20; ++x) {
            tracer.clear();
            tracer.addRay(scene, cameraRay(camera, x + 0.5, y + 0.5), options.trace.step_voxels, 0.5f);
            tracer.trace(scene, options.trace, kept);
            float colour[3];
            model.decoder.diffuse(1, tracer.rayFeatures(), colour);
            const float opacity = 1 - tracer.transmittance()[0];
            n_background += opacity == 0;
            n_thin += opacity > 0.1f && opacity < 0.9f;
            for (int c = 0; c < 3; ++c) {
                // Batches of another size may round differently in the last bits.
                CHECK(flat.rgb.at(x, y)[c] ==
                      Approx(opacity * colour[c] + (1 - opacity) * model.background[c]).margin(2e-6));
                difference = std::max<double>(difference, std::abs(flat.rgb.at(x, y)[c] - viewed.rgb.at(x, y)[c]));
            }
        }
    CHECK(n_background > 20);
    CHECK(n_thin > 20);
    CHECK(difference > 0.02);
}

TEST_CASE("depth of a slab: its face where it is opaque, its light's centre where it is thin") {
    const auto slab = [](const Vec3i& cell) { return cell.x() >= 10 && cell.x() < 14; };  // world x -0.2 to 0.2
    for (const double sigma_per_voxel : {200.0, 0.3, 0.004}) {
        CAPTURE(sigma_per_voxel);
        const Model model = plainModel(
            slab, [&](const Vec3i&) { return std::log(sigma_per_voxel); }, Vec3f::Ones() / 2);
        const RenderedImage image = Renderer(model, everyCell()).render(narrowCamera(1));
        // Mean distance of exp(-sigma t) dt over the 4 voxels, behind the face at distance 19.8.
        const double tau = 4 * sigma_per_voxel;
        const double opacity = -std::expm1(-tau);
        const double mean = 1 / sigma_per_voxel - 4 * std::exp(-tau) / opacity;
        // A sample stands for half a voxel, from anywhere inside it, and a few that carry 1 % of the light are
        // dropped. The opaque slab's depth is that of its first sample.
        CHECK(*image.depth.at(0, 0) == Approx(19.8 + kVoxel * mean).margin(0.5 * kVoxel));
        CHECK(*image.opacity.at(0, 0) == Approx(opacity).epsilon(1e-4));
    }
}

TEST_CASE("depth of faint fog lies in the fog, though a third of its samples are dropped") {
    // 46 samples of weight 7.5e-4, of which the first 13 sum to the allowance of 1 %.
    const Model model = plainModel(
        everywhere, [](const Vec3i&) { return std::log(0.0015); }, Vec3f::Ones() / 2);
    const RenderedImage image = Renderer(model, everyCell()).render(narrowCamera(1));
    CHECK(*image.opacity.at(0, 0) == Approx(-std::expm1(-23 * 0.0015)).epsilon(1e-3));
    // The others are spread over voxels 6.5 to 23, whose first lies at distance 18.8: their middle.
    CHECK(*image.depth.at(0, 0) == Approx(18.8 + kVoxel * 14.75).margin(0.5 * kVoxel));
}

TEST_CASE("normals of a ramp are its slope, turned outward, whatever the ramp's direction") {
    for (const Vec3d& outward : {Vec3d(-1, 0, 0), Vec3d(-0.8, 0.6, 0), Vec3d(-0.5, -0.5, 0.7)}) {
        const Vec3d normal = outward.normalized();
        const Model model = plainModel(
            everywhere,
            [&](const Vec3i& ijk) { return -2 * normal.dot(ijk.cast<double>() - Vec3d::Constant(12)); },
            Vec3f::Ones() / 2);
        RenderOptions options;
        options.normals = true;
        const RenderedImage image = Renderer(model, options).render(narrowCamera(3));
        for (int i = 0; i < 9; ++i)
            for (int axis = 0; axis < 3; ++axis)  // differences of raw values up to 40, rounded to 4e-6
                CHECK(image.normal.pixels[3 * i + axis] == Approx(normal[axis]).margin(2e-5));
    }
}

TEST_CASE("pictures are the same bits on 1, 2 and 4 threads") {
    Model model;
    model.field = test::randomField(kDims, 4, 0.4, -3.0f, 3.0f, 44);
    model.decoder = Decoder(4, 2);
    const Camera camera = lookAt(Vec3d(-3, 4, 5), model.field.worldBox().center(), Vec3d::UnitZ(), 0.6, 70, 50);
    const auto rendered = [&](int threads) {
        const ThreadLimit limit(threads);
        return Renderer(model, {}).render(camera);
    };
    const RenderedImage one = rendered(1);
    for (const int threads : {2, 4}) {
        const RenderedImage many = rendered(threads);
        CHECK(many.rgb.pixels == one.rgb.pixels);
        CHECK(many.depth.pixels == one.depth.pixels);
        CHECK(many.counters.samples_features == one.counters.samples_features);
    }
}

TEST_CASE("a camera of NaN, or without focal length, is refused by name") {
    const Model model = plainModel(
        everywhere, [](const Vec3i&) { return 0.0; }, Vec3f::Ones() / 2);
    const Renderer renderer(model, {});
    Camera camera = narrowCamera();
    camera.position.x() = std::numeric_limits<double>::quiet_NaN();
    CHECK_THROWS_AS(renderer.render(camera), DataError);
    camera = narrowCamera();
    camera.fx = 0;
    CHECK_THROWS_WITH(renderer.render(camera), Catch::Contains("camera") && Catch::Contains("focal"));
}

TEST_CASE("steps that are none, or more along a ray than a float can number, are refused") {
    const Model model = plainModel(
        everywhere, [](const Vec3i&) { return 0.0; }, Vec3f::Ones() / 2);
    const auto least = static_cast<float>(std::ldexp(model.field.shells().extent.cast<double>().norm(), -24));
    for (const float step : {0.0f, -1.0f, 0.9f * least, std::numeric_limits<float>::quiet_NaN(),
                             std::numeric_limits<float>::infinity()}) {
        CAPTURE(step);
        RenderOptions options;
        options.trace.step_voxels = step;
        const Renderer renderer(model, options);
        CHECK_THROWS_WITH(renderer.render(narrowCamera()), Catch::Contains("step") && Catch::Contains("at least"));
    }
}
