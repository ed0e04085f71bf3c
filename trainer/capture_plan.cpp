// SPDX-License-Identifier: Apache-2.0
#include "trainer/capture_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <set>

#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kExhaustiveLimit = 60;  // photographs: 1770 pairs, a quarter of an hour on two cores
constexpr std::size_t kLongRun = 20;          // photographs
constexpr double kNumberedShare = 0.8;        // of all photographs, for a sequence
constexpr long long kLargestGap = 4;          // strides

// Measured with COLMAP 3.8 without CUDA on one core (AMD EPYC, Zen 5), 504x378 to 1080x1920.
constexpr double kExtractSecondsPerMegapixel = 1.1;
constexpr double kVerifySecondsPerPair = 0.2;
constexpr double kCompareSecondsPerMillion = 0.011;
constexpr double kPixelsPerFeature = 200;  // of a photograph with some texture
constexpr double kFeatureOverrun = 1.25;   // of max_features: a place may count twice, once per orientation

/// "walk_00012.jpg" -> "walk_", 12, ".jpg": the last digits of the name.
struct NumberedName {
    std::string before, after;
    long long number = 0;
};

std::optional<NumberedName> splitNumber(const std::string& name) {
    const std::size_t dot = std::min(name.rfind('.'), name.size());
    const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
    std::size_t end = dot;
    while (end > 0 && !is_digit(name[end - 1])) --end;
    std::size_t begin = end;
    while (begin > 0 && is_digit(name[begin - 1])) --begin;
    constexpr std::size_t kMostDigits = 15;  // longer ones are no counters
    if (begin == end || end - begin > kMostDigits) return std::nullopt;
    return NumberedName{name.substr(0, begin), name.substr(end), std::stoll(name.substr(begin, end - begin))};
}

/// The commonest difference of neighbours in a run; the smallest of equally common ones.
long long commonestStride(const std::vector<long long>& numbers, std::size_t begin, std::size_t end) {
    std::vector<long long> strides;
    for (std::size_t i = begin + 1; i < end; ++i) strides.push_back(numbers[i] - numbers[i - 1]);
    std::sort(strides.begin(), strides.end());
    long long best = 1;
    std::size_t most = 0;
    for (std::size_t i = 0; i < strides.size();) {
        const std::size_t next = static_cast<std::size_t>(
            std::upper_bound(strides.begin(), strides.end(), strides[i]) - strides.begin());
        if (next - i > most) most = next - i, best = strides[i];
        i = next;
    }
    return best;
}

std::size_t allPairs(std::size_t n) { return n * (n - 1) / 2; }

std::size_t sequentialPairs(std::size_t n) {
    std::set<std::size_t> offsets;
    for (int i = 1; i < kSequentialOverlap; ++i) offsets.insert(static_cast<std::size_t>(i));
    for (int i = 0; i < kSequentialOverlap; ++i) offsets.insert(std::size_t{1} << i);
    std::size_t pairs = 0;
    for (const std::size_t offset : offsets) pairs += n > offset ? n - offset : 0;
    return pairs;
}

std::string percentText(double share) { return std::to_string(std::lround(100 * share)) + " %"; }

void chooseMatching(const std::vector<std::string>& names, const std::vector<PhotoOrigin>& origins, Matching asked,
                    CapturePlan& plan) {
    const std::size_t n = names.size();
    const auto n_placed = static_cast<std::size_t>(
        std::count_if(origins.begin(), origins.end(), [](const PhotoOrigin& origin) { return origin.has_position; }));
    plan.matching = asked;
    plan.matching_reason = "as asked";
    if (asked == Matching::spatial && n_placed < n)
        throw UsageError("--matching", "spatial, but only " + std::to_string(n_placed) + " of " + std::to_string(n) +
                                           " photographs with latitude and longitude in their EXIF",
                         "a place for each", "choose sequential or exhaustive");
    if (asked != Matching::automatic) return;

    if (n_placed == n) {
        plan.matching = Matching::spatial;
        plan.matching_reason = "every photograph has a place in its EXIF";
        return;
    }
    plan.matching = Matching::exhaustive;
    if (n <= kExhaustiveLimit) {
        plan.matching_reason = "few enough for all pairs";
        return;
    }
    const double numbered = numberedShare(names);
    if (numbered >= kNumberedShare) {
        plan.matching = Matching::sequential;
        plan.matching_reason = percentText(numbered) + " have names that are numbered in long runs, as frames of a "
                                                       "video or photographs of a walk are";
        return;
    }
    plan.matching_reason = "places are not known, and only " + percentText(numbered) +
                           " have names that are numbered in long runs";
}

void chooseCamera(const std::vector<PhotoOrigin>& origins, CameraSharing asked, CapturePlan& plan) {
    const PhotoOrigin& first = origins.front();
    const auto all = [&](auto is_same) { return std::all_of(origins.begin(), origins.end(), is_same); };
    const bool same_size = all(
        [&](const PhotoOrigin& o) { return o.width == first.width && o.height == first.height; });
    const bool same_camera = all([&](const PhotoOrigin& o) { return o.camera == first.camera; });
    const bool same_focus = all([&](const PhotoOrigin& o) { return o.focal_length_mm == first.focal_length_mm; });
    if (asked == CameraSharing::shared && !same_size)
        throw UsageError("--camera", "shared, but photographs of several sizes", "one size for one camera",
                         "choose per-image, or leave out those that differ");
    plan.camera = asked;
    plan.camera_reason = "as asked";
    if (asked != CameraSharing::automatic) return;
    plan.camera = same_size && same_camera && same_focus ? CameraSharing::shared : CameraSharing::per_image;
    if (plan.camera == CameraSharing::shared)
        plan.camera_reason = first.camera.empty() ? "all of one size" : "all of one size, by " + first.camera;
    else
        plan.camera_reason = std::string("they differ in ") + (!same_size     ? "size"
                                                               : !same_camera ? "camera"
                                                                              : "focal length");
}

}  // namespace

const char* nameOf(Matching matching) {
    switch (matching) {
        case Matching::automatic:
            return "auto";
        case Matching::exhaustive:
            return "exhaustive";
        case Matching::sequential:
            return "sequential";
        case Matching::spatial:
            return "spatial";
    }
    return "";
}

double numberedShare(const std::vector<std::string>& names) {
    if (names.empty()) return 0;
    std::size_t n_in_runs = 0;
    for (std::size_t begin = 0; begin < names.size();) {
        // Names of one kind, in the order of their numbers.
        const std::optional<NumberedName> first = splitNumber(names[begin]);
        std::vector<long long> numbers;
        std::size_t end = begin;
        while (first && end < names.size()) {
            const std::optional<NumberedName> next = splitNumber(names[end]);
            if (!next || next->before != first->before || next->after != first->after) break;
            if (!numbers.empty() && next->number <= numbers.back()) break;
            numbers.push_back(next->number);
            ++end;
        }
        // Runs without a large gap.
        if (numbers.size() >= kLongRun) {
            const long long stride = commonestStride(numbers, 0, numbers.size());
            std::size_t run = 0;
            for (std::size_t i = 1; i <= numbers.size(); ++i)
                if (i == numbers.size() || numbers[i] - numbers[i - 1] > kLargestGap * stride) {
                    if (i - run >= kLongRun) n_in_runs += i - run;
                    run = i;
                }
        }
        begin = std::max(end, begin + 1);
    }
    return static_cast<double>(n_in_runs) / static_cast<double>(names.size());
}

double matchingSeconds(std::size_t pairs, double features, int threads) {
    return static_cast<double>(pairs) * (kVerifySecondsPerPair + kCompareSecondsPerMillion * features * features / 1e6) /
           threads;
}

std::string roughTime(double seconds) {
    const auto text = [](const char* pattern, double value) {
        char words[48];
        std::snprintf(words, sizeof words, pattern, value);
        return std::string(words);
    };
    if (seconds < 7.5) return "a few seconds";
    if (seconds < 90) return text("about %.0f seconds", std::round(seconds / 5) * 5);
    if (seconds < 90 * 60) return text("about %.0f minutes", seconds / 60);
    return text(seconds < 10 * 3600 ? "about %.1f hours" : "about %.0f hours", seconds / 3600);
}

CapturePlan planCapture(const std::vector<std::string>& names, const std::vector<PhotoOrigin>& origins,
                        const CaptureOptions& options, int threads) {
    CapturePlan plan;
    chooseMatching(names, origins, options.matching, plan);
    chooseCamera(origins, options.camera, plan);

    const std::size_t n = names.size(), all = allPairs(n);
    plan.pairs = plan.matching == Matching::sequential ? sequentialPairs(n)
                 : plan.matching == Matching::spatial  ? std::min(all, n * kSpatialNeighbours)
                                                       : all;
    double megapixels = 0, features = 0;
    for (const PhotoOrigin& origin : origins) {
        const double scale = std::min(1.0, static_cast<double>(options.max_size) / std::max(origin.width, origin.height));
        const double pixels = scale * scale * origin.width * origin.height;
        megapixels += pixels / 1e6;
        features += std::min(pixels / kPixelsPerFeature, kFeatureOverrun * options.max_features) / static_cast<double>(n);
    }
    plan.features_seconds = kExtractSecondsPerMegapixel * megapixels / threads;
    plan.matching_seconds = matchingSeconds(plan.pairs, features, threads);
    return plan;
}

}  // namespace nerfvdb
