// SPDX-License-Identifier: Apache-2.0
#include "trainer/evaluate.h"

#include "core/error.h"
#include "core/metrics.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// A model of nothing: every picture of it is its background.
Model emptyModel(const Vec3f& background) {
    Model model;
    const Topology topology(Vec3i(8, 8, 8), {});
    model.field = VoxelField(topology, {Vec3d(-1, -1, -1), 0.25}, 4, 1.0);
    model.decoder = Decoder(4, 1);
    model.background = background;
    return model;
}

View flatView(int size, const std::array<std::uint8_t, 4>& colour) {
    View view;
    view.path = "flat.png";
    view.camera = lookAt(Vec3d(0, -4, 0), Vec3d::Zero(), Vec3d::UnitZ(), 0.7, size, size);
    view.photo.width = view.photo.height = size;
    view.photo.has_alpha = colour[3] != 255;
    view.photo.pixels.assign(static_cast<std::size_t>(size) * size, colour);
    return view;
}

}  // namespace

TEST_CASE("a photograph's straight alpha is composited on the background", "[trainer]") {
    const View view = flatView(2, {255, 0, 102, 51});  // alpha 0.2
    const Image image = photoOver(view.photo, Vec3f(0.5f, 1.0f, 0.0f));
    REQUIRE(image.channels == 3);
    CHECK(image.at(1, 1)[0] == Approx(0.2 * 1.0 + 0.8 * 0.5));
    CHECK(image.at(1, 1)[1] == Approx(0.8));
    CHECK(image.at(1, 1)[2] == Approx(0.2 * 0.4));
}

TEST_CASE("scores are means over views", "[trainer]") {
    const Model model = emptyModel(Vec3f(1, 1, 1));
    Dataset dataset;
    dataset.root = "flat";
    // Against white: errors of 0, 0.2 and 0.4 in every channel.
    for (const std::uint8_t grey : {255, 204, 153})
        dataset.views.push_back(flatView(16, {grey, grey, grey, 255}));
    Report silent;

    std::vector<std::size_t> seen;
    const Evaluation all = evaluate(model, dataset, {}, silent, [&](const ViewScore& score, const RenderedImage& picture, const Image& truth) {
        seen.push_back(score.index);
        CHECK(psnr(picture.rgb, truth) == score.psnr);
        CHECK(picture.depth.width == 16);
    });
    CHECK(seen == std::vector<std::size_t>{0, 1, 2});
    // The mean of the views' PSNR, not the PSNR of the mean error.
    const double expected = (psnrFromMse(0) + psnrFromMse(0.04) + psnrFromMse(0.16)) / 3;
    CHECK(all.psnr == Approx(expected).epsilon(1e-5));
    CHECK(all.views[0].ssim == Approx(1.0));
    CHECK(all.counters.rays == 3 * 16 * 16);
    CHECK(all.counters.rays_skipped == all.counters.rays);

    const Evaluation some = evaluate(model, dataset, {.render = {}, .every = 2}, silent);
    REQUIRE(some.views.size() == 2);
    CHECK(some.views[1].index == 2);
}

TEST_CASE("anything that makes pictures can be scored, over its own background", "[trainer]") {
    Dataset dataset;
    dataset.root = "flat";
    for (const std::uint8_t grey : {51, 102, 153}) dataset.views.push_back(flatView(16, {grey, grey, grey, 51}));
    for (std::size_t i = 0; i < 3; ++i) dataset.views[i].camera.position.x() = static_cast<double>(i);
    // Grey of alpha 0.2 over a background of 0.5, missed by 0.1 in view 0 and by 0.01 in view 2.
    std::vector<double> asked;
    const RenderView render = [&](const Camera& camera) {
        asked.push_back(camera.position.x());
        RenderedImage picture;
        picture.rgb = Image(camera.width, camera.height, 3);
        const double view = camera.position.x();
        const double truth = 0.2 * (0.2 + 0.2 * view) + 0.8 * 0.5;
        for (float& value : picture.rgb.pixels) value = static_cast<float>(truth + (view == 0 ? 0.1 : 0.01));
        picture.counters.rays = 7;
        return picture;
    };
    Report silent;
    const Evaluation scores = evaluate(render, Vec3f::Constant(0.5f), dataset, 2, silent);
    CHECK(asked == std::vector<double>{0, 2});
    REQUIRE(scores.views.size() == 2);
    CHECK(scores.views[0].psnr == Approx(20).margin(1e-3));
    CHECK(scores.views[1].psnr == Approx(40).margin(1e-2));
    CHECK(scores.psnr == Approx(30).margin(1e-2));
    CHECK(scores.counters.rays == 14);
    CHECK_THROWS_AS(evaluate(render, Vec3f::Zero(), dataset, 0, silent), UsageError);
}

TEST_CASE("what cannot be scored is refused", "[trainer]") {
    const Model model = emptyModel(Vec3f(1, 1, 1));
    Report silent;
    Dataset dataset;
    dataset.root = "nothing";
    CHECK_THROWS_AS(evaluate(model, dataset, {}, silent), DataError);
    dataset.views.push_back(flatView(16, {0, 0, 0, 255}));
    CHECK_THROWS_AS(evaluate(model, dataset, {.render = {}, .every = 0}, silent), UsageError);
    dataset.views[0].photo.width = 8;
    CHECK_THROWS_WITH(evaluate(model, dataset, {}, silent), Catch::Matchers::Contains("flat.png"));

    struct Stop : Report {
        bool cancelled() const override { return true; }
    } stop;
    dataset.views[0] = flatView(16, {0, 0, 0, 255});
    CHECK_THROWS_AS(evaluate(model, dataset, {}, stop), Interrupted);
}

TEST_CASE("pixels that a mask leaves out are not compared, and their share is said", "[trainer]") {
    Dataset dataset;
    dataset.root = "flat";
    dataset.views = {flatView(32, {204, 204, 204, 255}), flatView(32, {255, 255, 255, 255})};
    PixelMask mask(32, 32);
    // The left half counts; the right half is as wrong as can be.
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x) {
            if (x < 16) mask.keep(x, y);
            else dataset.views[0].photo.pixels[static_cast<std::size_t>(32 * y + x)] = {0, 0, 0, 255};
        }
    dataset.views[0].mask = mask;
    dataset.views[0].mask_path = "hide.png";
    const Model model = emptyModel(Vec3f(1, 1, 1));
    Report silent;
    const Evaluation scores = evaluate(model, dataset, {}, silent);
    CHECK(scores.views[0].psnr == Approx(psnrFromMse(0.04)).epsilon(1e-5));
    // Flat pictures: the similarity of their means alone.
    CHECK(scores.views[0].ssim == Approx((2 * 0.8 + 1e-4) / (1 + 0.64 + 1e-4)).epsilon(1e-5));
    CHECK(scores.views[0].masked_share == 0.5);
    CHECK(scores.views[1].masked_share == 0);
    CHECK(scores.masked_share == 0.25);

    PixelMask narrow(32, 32);
    for (int y = 0; y < 32; ++y) narrow.keep(20, y);
    dataset.views[0].mask = narrow;
    CHECK_THROWS_AS(evaluate(model, dataset, {}, silent), DataError);
    CHECK_THROWS_WITH(evaluate(model, dataset, {}, silent), Catch::Matchers::Contains("hide.png"));
}
