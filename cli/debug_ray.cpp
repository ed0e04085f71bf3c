// SPDX-License-Identifier: Apache-2.0
#include "cli/debug_ray.h"

#include <charconv>
#include <optional>

#include "cli/text.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

std::optional<int> wholeNumber(const std::string& text) {
    int value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || text.empty()) return std::nullopt;
    return value;
}

}  // namespace

DebugPixel parseDebugPixel(const std::string& text, const Dataset& dataset) {
    // From the back: a path may hold colons.
    const std::size_t second = text.rfind(':');
    const std::size_t first = second == std::string::npos || second == 0 ? second : text.rfind(':', second - 1);
    const auto complain = [&](const std::string& expected) {
        throw UsageError("--debug-ray", "'" + text + "'", expected, "such as 12:81:40, or r_12.png:81:40");
    };
    if (second == std::string::npos || first == std::string::npos || first == second) complain("IMAGE:X:Y");
    const std::optional<int> x = wholeNumber(text.substr(first + 1, second - first - 1)),
                             y = wholeNumber(text.substr(second + 1));
    if (!x || !y) complain("IMAGE:X:Y");
    const std::string image = text.substr(0, first);
    DebugPixel pixel{dataset.views.size(), *x, *y};
    if (const std::optional<int> number = wholeNumber(image)) {
        if (*number >= 0) pixel.view = static_cast<std::size_t>(*number);
    } else {
        for (std::size_t v = dataset.views.size(); v-- > 0;)
            if (!image.empty() && dataset.views[v].path.string().ends_with(image)) pixel.view = v;
    }
    if (pixel.view >= dataset.views.size())
        complain("one of the " + std::to_string(dataset.views.size()) + " views of this split");
    const Camera& camera = dataset.views[pixel.view].camera;
    if (pixel.x < 0 || pixel.y < 0 || pixel.x >= camera.width || pixel.y >= camera.height)
        complain("a pixel of an image of " + std::to_string(camera.width) + "x" +
                 std::to_string(camera.height));
    return pixel;
}

ReplayedRay replayPixel(const Model& model, const Dataset& dataset, const DebugPixel& pixel) {
    return replayRay(model, cameraRay(dataset.views[pixel.view].camera, pixel.x + 0.5, pixel.y + 0.5), {},
                     0.5f);
}

std::string replayText(const ReplayedRay& ray) {
    std::string text = formatted("%6s %12s %18s %10s %10s %10s %10s %12s  features\n", "sample", "t", "cell",
                                 "raw", "sigma", "tau", "weight", "left");
    for (std::size_t i = 0; i < ray.samples.size(); ++i) {
        const ReplayedSample& s = ray.samples[i];
        text += formatted("%6zu %12.6g %18s %10.4g %10.4g %10.4g %10.4g %12.6g ", i, s.t,
                          formatted("%d,%d,%d", s.cell.x(), s.cell.y(), s.cell.z()).c_str(), s.raw, s.sigma,
                          s.tau, s.weight, s.transmittance);
        for (const float f : s.features) text += formatted(" %.3g", f);
        text += "\n";
    }
    text +=
        formatted("%zu samples; light left %.6g; decoded %.4f %.4f %.4f, over the background %.4f %.4f %.4f\n",
                  ray.samples.size(), ray.transmittance, ray.rgb[0], ray.rgb[1], ray.rgb[2], ray.color[0],
                  ray.color[1], ray.color[2]);
    return text;
}

Json replayJson(const ReplayedRay& ray) {
    Json json = {{"command", "eval"},
                 {"transmittance", ray.transmittance},
                 {"mean_features", ray.mean},
                 {"decoded", {ray.rgb[0], ray.rgb[1], ray.rgb[2]}},
                 {"color", {ray.color[0], ray.color[1], ray.color[2]}},
                 {"samples", Json::array()}};
    for (const ReplayedSample& s : ray.samples)
        json["samples"].push_back({{"t", s.t},
                                   {"cell", {s.cell.x(), s.cell.y(), s.cell.z()}},
                                   {"raw", s.raw},
                                   {"sigma", s.sigma},
                                   {"tau", s.tau},
                                   {"weight", s.weight},
                                   {"transmittance", s.transmittance},
                                   {"features", s.features}});
    return json;
}

}  // namespace nerfvdb
