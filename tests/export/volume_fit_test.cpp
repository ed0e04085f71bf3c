// SPDX-License-Identifier: Apache-2.0
#include "export/volume_fit.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "export/volume_colors.h"
#include "export/volume_loss.h"
#include "export/volume_of_model.h"
#include "tests/support/catch.h"
#include "tests/support/seen_model.h"

using namespace nerfvdb;

namespace {

Report silent;

Volume collected(const Model& model) {
    Volume volume = volumeOfModel(model.field, {});
    collectColors(model, test::trainingCameras(model), {}, volume, silent);
    return volume;
}

/// Where a gradient is large, it must be the slope of the loss.
void checkSlopes(VolumeFit& fit, std::span<float> values, std::span<const double> gradient, float step) {
    std::vector<std::size_t> order(values.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::partial_sort(order.begin(), order.begin() + 40, order.end(), [&](std::size_t a, std::size_t b) {
        return std::abs(gradient[a]) > std::abs(gradient[b]);
    });
    REQUIRE(std::abs(gradient[order[39]]) > 0);
    for (int k = 0; k < 40; k += 3) {
        float& value = values[order[k]];
        const float before = value;
        const float reach = step * std::max(before, 0.05f);
        value = before + reach;
        const double above = fit.differentiate(0);
        const double reached = value;
        value = before - reach;
        const double below = fit.differentiate(0);
        const double slope = (above - below) / (reached - value);
        value = before;
        // Samples of less than 2e-4 are dropped, and where the ray becomes opaque it ends: both are steps of the loss.
        CHECK(slope == Approx(gradient[order[k]]).epsilon(0.02));
    }
}

}  // namespace

TEST_CASE("the gradient of a fit is the slope of its loss, in sigma and in colour") {
    Model model = test::seenModel(24);
    for (float& raw : model.field.density()) raw -= 2;  // seen through: every voxel has a say
    Volume volume = collected(model);
    for (float& sigma : volume.sigma()) sigma *= 0.8f;  // not the optimum, where nothing could be measured
    FitOptions options;
    options.batch = 2048;
    const std::vector<Camera> cameras = test::trainingCameras(model);
    VolumeFit fit(model, cameras, options, volume);
    const double rays = 2048;
    fit.differentiate(0);
    std::vector<double> dl_dsigma(volume.sigma().size(), 0.0), dl_dcolor(volume.color().size(), 0.0);
    fit.gradients([&](std::int32_t leaf, const LeafGradient& gradient, const LeafMask&) {
        const std::size_t first = static_cast<std::size_t>(leaf) * kLeafVoxels;
        for (int i = 0; i < kLeafVoxels; ++i) dl_dsigma[first + i] = std::exchange(gradient.density[i], 0.0f) / rays;
        for (int i = 0; i < kLeafVoxels * Volume::kChannels; ++i)
            dl_dcolor[first * Volume::kChannels + i] = std::exchange(gradient.features[i], 0.0f) / rays;
        std::fill_n(gradient.touched, kLeafWords, 0);
    });
    checkSlopes(fit, volume.sigma(), dl_dsigma, 0.02f);
    checkSlopes(fit, volume.color(), dl_dcolor, 0.02f);
}

TEST_CASE("a fit brings the volume closer to the model, on views that it did not see") {
    const Model model = test::seenModel(32);
    std::vector<Camera> held_out;
    for (const ModelCamera& camera : model.cameras)
        if (camera.held_out) held_out.push_back(camera.camera);
    Volume volume = collected(model);
    const VolumeLoss before = measureLoss(model, volume, held_out, silent);
    FitOptions options;
    options.steps = 150;
    options.batch = 2048;
    VolumeFit(model, test::trainingCameras(model), options, volume).run(silent);
    const VolumeLoss after = measureLoss(model, volume, held_out, silent);
    CHECK(after.views == 2);
    CHECK(after.psnr > before.psnr + 2);
    CHECK(after.opacity_error < before.opacity_error);
    for (const float sigma : volume.sigma()) REQUIRE((sigma >= 0 && sigma * volume.frame().voxel_size < 16.01));
    for (const float value : volume.color()) REQUIRE((value >= 0 && value <= 1));
}

TEST_CASE("a fit does not depend on the number of threads") {
    const Model model = test::seenModel(24);
    FitOptions options;
    options.steps = 10;
    options.batch = 1024;
    Volume many = collected(model), one = collected(model);
    VolumeFit(model, test::trainingCameras(model), options, many).run(silent);
    const ThreadLimit limit(1);
    VolumeFit(model, test::trainingCameras(model), options, one).run(silent);
    CHECK(std::equal(many.sigma().begin(), many.sigma().end(), one.sigma().begin()));
    CHECK(std::equal(many.color().begin(), many.color().end(), one.color().begin()));
}

TEST_CASE("a fit stops when asked to") {
    struct Stop : Report {
        bool cancelled() const override { return true; }
    } stop;
    const Model model = test::seenModel(24);
    Volume volume = volumeOfModel(model.field, {});
    const std::vector<Camera> cameras = test::trainingCameras(model);
    CHECK_THROWS_AS(VolumeFit(model, cameras, {}, volume).run(stop), Interrupted);
    CHECK_THROWS_AS(collectColors(model, cameras, {}, volume, stop), Interrupted);
    CHECK_THROWS_AS(measureLoss(model, volume, cameras, stop), Interrupted);
    CHECK_THROWS_AS(measureLoss(model, volume, {}, silent), UsageError);
}
