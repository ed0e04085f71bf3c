// SPDX-License-Identifier: Apache-2.0
#include "cli/debug_ray.h"

#include <charconv>
#include <optional>
#include <string_view>

#include "cli/text.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

template <typename Number>
std::optional<Number> numberOf(std::string_view text) {
    Number value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || text.empty()) return std::nullopt;
    return value;
}

}  // namespace

DebugPixel parseDebugPixel(const std::string& text, const Dataset& dataset) {
    const auto complain = [&](const std::string& expected) {
        throw UsageError("--debug-ray", "'" + text + "'", expected, "such as 12:81:40, or r_12.png:81:40");
    };
    // From the back: a path may hold colons. What has a point is a jitter, for pixels are whole.
    std::string_view image = text;
    const auto takeLast = [&] {
        const std::size_t colon = image.rfind(':');
        if (colon == std::string_view::npos) complain("IMAGE:X:Y or IMAGE:X:Y:JITTER");
        const std::string_view last = image.substr(colon + 1);
        image = image.substr(0, colon);
        return last;
    };
    DebugPixel pixel;
    pixel.view = dataset.views.size();
    std::string_view last = takeLast();
    if (last.find('.') != std::string_view::npos) {
        const std::optional<float> jitter = numberOf<float>(last);
        if (!jitter || !(*jitter >= 0 && *jitter < 1)) complain("a jitter from 0.0 to below 1.0");
        pixel.jitter = *jitter;
        last = takeLast();
    }
    const std::optional<int> y = numberOf<int>(last), x = numberOf<int>(takeLast());
    if (!x || !y) complain("IMAGE:X:Y or IMAGE:X:Y:JITTER");
    pixel.x = *x, pixel.y = *y;
    if (const std::optional<int> number = numberOf<int>(image)) {
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
    return replayRay(model, cameraRay(dataset.views[pixel.view].camera, pixel.x + 0.5, pixel.y + 0.5), {}, pixel.jitter);
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
