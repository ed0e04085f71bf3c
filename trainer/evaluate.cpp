// SPDX-License-Identifier: Apache-2.0
#include "trainer/evaluate.h"

#include <chrono>
#include <cstdio>

#include "core/error.h"
#include "core/metrics.h"

namespace nerfvdb {
namespace {

std::string sizeOf(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

std::string decibels(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f dB", value);
    return text;
}

double maskedSsim(const Image& picture, const Image& truth, const View& view) {
    try {
        return ssim(picture, truth, view.mask);
    } catch (const UsageError& error) {
        if (view.mask.empty()) throw;
        throw DataError(view.mask_path.string(), "a mask that leaves nothing to compare (" + std::string(error.what()) + ")",
                        "some part of the photograph that counts as a whole", "use --no-masks");
    }
}

}  // namespace

Image photoOver(const Photo& photo, const Vec3f& background) {
    Image image(photo.width, photo.height, 3);
    for (int y = 0; y < photo.height; ++y)
        for (int x = 0; x < photo.width; ++x) {
            const Photo::Pixel& pixel = photo.at(x, y);
            const float alpha = static_cast<float>(pixel[3]) / 255.0f;
            for (int c = 0; c < 3; ++c) {
                const float value = static_cast<float>(pixel[c]) / 255.0f;
                image.at(x, y)[c] = alpha * value + (1.0f - alpha) * background[c];
            }
        }
    return image;
}

Evaluation evaluate(const Model& model, const Dataset& dataset, const EvaluateOptions& options, Report& report,
                    const OnView& on_view) {
    const Renderer renderer(model, options.render);
    return evaluate([&](const Camera& camera) { return renderer.render(camera); }, model.background, dataset,
                    options.every, report, on_view);
}

Evaluation evaluate(const RenderView& render, const Vec3f& background, const Dataset& dataset, int every_nth,
                    Report& report, const OnView& on_view) {
    if (every_nth < 1) throw UsageError("every", std::to_string(every_nth), "a positive number of views");
    if (dataset.views.empty()) throw DataError(dataset.root.string(), "no views", "at least one view to score");
    for (const View& view : dataset.views)
        if (view.photo.width != view.camera.width || view.photo.height != view.camera.height)
            throw DataError(view.path.string(),
                            "a photograph of " + sizeOf(view.photo.width, view.photo.height),
                            "its camera's " + sizeOf(view.camera.width, view.camera.height));

    const auto every = static_cast<std::size_t>(every_nth);
    Evaluation result;
    report.begin("evaluate", static_cast<std::int64_t>((dataset.views.size() + every - 1) / every));
    for (std::size_t index = 0; index < dataset.views.size(); index += every) {
        if (report.cancelled()) throw Interrupted("evaluation was interrupted");
        const View& view = dataset.views[index];

        const auto begin = std::chrono::steady_clock::now();
        const RenderedImage picture = render(view.camera);
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;

        const Image truth = photoOver(view.photo, background);
        ViewScore score;
        score.index = index;
        score.psnr = psnr(picture.rgb, truth, view.mask);
        score.ssim = maskedSsim(picture.rgb, truth, view);
        score.masked_share = view.mask.empty() ? 0 : 1 - static_cast<double>(view.mask.count()) /
                                                             (static_cast<double>(truth.width) * truth.height);
        score.seconds = seconds.count();
        score.counters = picture.counters;

        result.psnr += score.psnr;
        result.ssim += score.ssim;
        result.masked_share += score.masked_share;
        result.seconds_per_frame += score.seconds;
        result.counters += score.counters;
        if (on_view) on_view(score, picture, truth);
        result.views.push_back(score);
        const auto n = static_cast<double>(result.views.size());
        report.update(static_cast<std::int64_t>(result.views.size()), decibels(result.psnr / n));
    }
    report.end();

    const auto n = static_cast<double>(result.views.size());
    result.psnr /= n;
    result.ssim /= n;
    result.masked_share /= n;
    result.seconds_per_frame /= n;
    return result;
}

}  // namespace nerfvdb
