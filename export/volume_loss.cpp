// SPDX-License-Identifier: Apache-2.0
#include "export/volume_loss.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/metrics.h"
#include "export/paired_rays.h"
#include "vdb/renderer.h"
#include "vdb/volume_renderer.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kMostViews = 8;
constexpr int kMostPixels = 400;

Camera reduced(const Camera& camera) {
    const double scale = std::min(1.0, static_cast<double>(kMostPixels) / std::max(camera.width, camera.height));
    return resized(camera, std::max(1, static_cast<int>(std::lround(camera.width * scale))),
                   std::max(1, static_cast<int>(std::lround(camera.height * scale))));
}

double meanDifference(const Image& a, const Image& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
    return sum / static_cast<double>(a.pixels.size());
}

}  // namespace

VolumeLoss measureLoss(const Model& model, const Volume& volume, std::span<const Camera> cameras, Report& report) {
    if (cameras.empty()) throw UsageError("cameras", "none", "at least one to judge the volume from");
    const Renderer renderer(model, {});
    const Renderer diffuse_renderer(model, {.trace = {}, .min_alpha = 0, .normals = false, .view_dependent = false});
    VolumeRenderOptions options;
    options.background = model.background;
    const VolumeRenderer volume_renderer(volume, options);

    const std::size_t n = std::min(kMostViews, cameras.size());
    VolumeLoss loss;
    report.begin("measure", static_cast<std::int64_t>(n));
    for (std::size_t i = 0; i < n; ++i) {
        throwIfCancelled(report);
        const Camera camera = reduced(cameras[i * cameras.size() / n]);
        const RenderedImage truth = renderer.render(camera), picture = volume_renderer.render(camera);
        loss.psnr += psnr(picture.rgb, truth.rgb);
        loss.psnr_diffuse += psnr(diffuse_renderer.render(camera).rgb, truth.rgb);
        loss.opacity_error += meanDifference(picture.opacity, truth.opacity);
        report.update(static_cast<std::int64_t>(i) + 1, "");
    }
    report.end();
    loss.views = static_cast<int>(n);
    for (double* sum : {&loss.psnr, &loss.psnr_diffuse, &loss.opacity_error}) *sum /= static_cast<double>(n);
    return loss;
}

}  // namespace nerfvdb
