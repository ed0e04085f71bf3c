// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_skips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "bench/number_text.h"
#include "bench/ray_reference.h"
#include "bench/voxel_scene.h"
#include "core/error.h"
#include "vdb/decoder.h"

namespace nerfvdb {
namespace {

constexpr double kLevels = 255;  // of 8 bits in a colour's range
constexpr double kRounding = 0x1p-24;
constexpr float kStep = 0.5f;  // voxels

/// A scene, rays through it, and what is behind it.
struct Trial {
    std::string name;
    VoxelScene scene;
    std::vector<Ray> rays;
    double background;
};

/// Along x through the middle of cells, and aslant.
std::vector<Ray> raysThrough(const Vec3i& dims, std::uint64_t seed) {
    std::vector<Ray> rays{{Vec3d(-3, 0.5 * dims.y() + 0.3, 0.5 * dims.z() - 0.4), Vec3d::UnitX()}};
    for (std::uint64_t i = 0; i < 3; ++i) {
        const Vec3d eye(-3, randomBetween(1, dims.y() - 2, seed, 2 * i), randomBetween(1, dims.z() - 2, seed, 2 * i + 1));
        const Vec3d target(dims.x(), randomBetween(1, dims.y() - 2, seed + 1, 2 * i),
                           randomBetween(1, dims.z() - 2, seed + 1, 2 * i + 1));
        rays.push_back({eye, (target - eye).normalized()});
    }
    return rays;
}

/// Made to lose as much as the thresholds allow: light that is dropped, passed by or behind the stop has the
/// colour that differs most from what takes its place.
std::vector<Trial> adversaries() {
    const Vec3i dims(256, 16, 16);
    const TraceOptions defaults;
    std::vector<Trial> trials;
    // Each sample of the fog weighs a little less than min_weight, all of it a little less than max_dropped, or
    // much more; behind it a wall of the other colour.
    for (const double share : {0.5, 0.9, 0.99, 1.01})
        for (const double whole : {0.97, 20.0})
            for (const double fog_colour : {0.0, 1.0}) {
                const double sigma =
                    share * static_cast<double>(defaults.min_weight) / static_cast<double>(kStep);
                const int end =
                    20 + static_cast<int>(whole * static_cast<double>(defaults.max_dropped) / sigma);
                const auto sigmaAt = [=](const Vec3i& v) {
                    return v.x() < 20                        ? 1e-8
                           : v.x() < end                     ? sigma
                           : v.x() < std::min(end + 20, 240) ? 1e-8
                                                             : 50.0;
                };
                trials.push_back(
                    {"fog of " + numberText(share) + " times the least weight before a wall",
                     VoxelScene(dims, sigmaAt,
                           [=](const Vec3i& v, int) { return v.x() < end + 10 ? fog_colour : 1 - fog_colour; }),
                     {{Vec3d(-3, 8.3, 7.6), Vec3d::UnitX()}},
                     0.5});
            }
    // Nothing but fog, so thin that it hides in every threshold.
    for (const double sigma : {1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 2e-3, 1e-2})
        trials.push_back({"fog of sigma " + numberText(sigma) + " a voxel",
                          VoxelScene(
                              dims, [=](const Vec3i&) { return sigma; }, [](const Vec3i&, int) { return 1.0; }),
                          raysThrough(dims, 60), 0.0});
    // As much light as the stop leaves behind, on a white wall before black.
    for (const double left : {0.2, 0.9, 0.999, 1.001, 5.0}) {
        const double sigma = -std::log(left * static_cast<double>(defaults.stop_transmittance)) / 20;
        trials.push_back(
            {"a black slab that leaves " + numberText(left) + " times the stop, before a white wall",
             VoxelScene(
                 dims,
                 [=](const Vec3i& v) {
                     return v.x() < 100 ? 1e-8 : v.x() < 120 ? sigma : v.x() < 160 ? 1e-8 : 50.0;
                 },
                 [](const Vec3i& v, int) { return v.x() < 140 ? 0.0 : 1.0; }),
             raysThrough(dims, 61), 0.0});
    }
    return trials;
}

Trial randomTrial(std::uint64_t seed) {
    const Vec3i dims(64, 16, 16);
    const double thin = std::pow(10.0, randomBetween(-6, 0, 62, seed)),
                 thick = std::pow(10.0, randomBetween(-2, 2, 63, seed));
    const double share = randomBetween(0, 1, 64, seed);
    const auto voxel = [](const Vec3i& v) {
        return static_cast<std::uint64_t>((v.x() * 64 + v.y()) * 64 + v.z());
    };
    return {
        "random scene " + std::to_string(seed),
        VoxelScene(
            dims,
            [=](const Vec3i& v) {
                return randomBetween(0, 1, 65 + seed, voxel(v)) < share ? thin
                                                                 : thick * randomBetween(0, 1, 66 + seed, voxel(v));
            },
            [=](const Vec3i& v, int c) {
                return randomBetween(0, 1, 67 + seed, 4 * voxel(v) + static_cast<std::uint64_t>(c)) < 0.5 ? 0.0 : 1.0;
            }),
        raysThrough(dims, 68 + seed), randomBetween(0, 1, 69, seed)};
}

/// How far a decoder's colour moves at most: per unit of features (largest change of any), and of opacity.
/// Products of the layers' largest row sums; ReLU does not stretch, the sigmoid's slope is at most 1/4.
struct DecoderSlopes {
    double features, opacity;
    explicit DecoderSlopes(const Decoder& decoder) {
        const std::vector<int>& widths = decoder.shape().widths;
        const float* weights = decoder.parameters().data();
        double first_features = 0, first_opacity = 0, rest = 1;
        for (std::size_t l = 0; l + 1 < widths.size(); ++l) {
            const int n_in = widths[l], n_out = widths[l + 1];
            double most = 0;
            for (int o = 0; o < n_out; ++o) {
                double sum = 0;
                for (int i = 0; i < (l == 0 ? decoder.channels() : n_in); ++i)
                    sum += std::abs(static_cast<double>(weights[o * n_in + i]));
                most = std::max(most, sum);
                if (l == 0)
                    first_opacity =
                        std::max(first_opacity, std::abs(static_cast<double>(weights[o * n_in + n_in - 1])));
            }
            if (l == 0)
                first_features = most;
            else
                rest *= most;
            weights += (n_in + 1) * n_out;
        }
        features = 0.25 * (1 + first_features * rest);
        opacity = 0.25 * first_opacity * rest;
    }
};

class SkipJudge {
public:
    SkipJudge()
        : stop_{"skipping", "early stop alone, levels", "255 stop_transmittance"},
          dropped_{"skipping", "dropped weights alone, levels", "255 max_dropped"},
          cells_{"skipping", "cells passed by alone, levels",
                 "255 (1 - exp(-delta)), delta = voxels passed by times -log(1 - min_alpha)"},
          together_{"skipping", "all at once, levels", "the sum of the three"},
          defaults_{"skipping", "the defaults of TraceOptions, levels",
                    "255 (max_dropped + stop_transmittance) = 2.58"},
          decoded_{
              "skipping", "the defaults, colours decoded by a network, levels",
              "255 (L max_dropped + (1 + L + L_A) stop_transmittance), L and L_A from the network's row sums"} {
    }

    void run(const Trial& trial) {
        const Occupancy everything = trial.scene.everything();
        const TraceScene full(trial.scene.field, everything);
        const auto describe = [&] { return trial.name; };
        for (const float min_alpha : {0.0f, 1e-4f, 1e-3f, 1e-2f}) {
            const Occupancy occupied = findOccupied(trial.scene.field, min_alpha);
            const TraceScene sparse(trial.scene.field, min_alpha > 0 ? occupied : everything);
            for (const Ray& ray : trial.rays) {
                const RaySight whole = look(full, ray, nothingSkipped());
                std::vector<ExactSample> samples;
                double passed_by = 0;
                for (int i = 0; i < whole.kept.n; ++i) {
                    samples.push_back({whole.kept.leaf[i], whole.kept.cell[i], whole.kept.x[i], whole.kept.y[i],
                                       whole.kept.z[i], whole.kept.t[i]});
                    const auto leaf = static_cast<std::size_t>(whole.kept.leaf[i]);
                    if (min_alpha > 0 && !testBit(occupied.cells[leaf], whole.kept.cell[i])) passed_by += kStep;
                }
                const ExactLight exact = exactLight(full, kStep, samples);
                const double rounding = (8.0 * whole.kept.n + 400) * kRounding;
                const double hidden = -std::expm1(passed_by * std::log1p(-static_cast<double>(min_alpha)));
                const auto judge = [&](StressRow& row, const TraceScene& scene, const TraceOptions& options,
                                       double bound) {
                    const RaySight seen = look(scene, ray, options);
                    double error = 0;
                    for (int c = 0; c < 3; ++c) {
                        const Exact truth =
                            (1 - exact.transmittance) * exact.mean[c] + exact.transmittance * trial.background;
                        error = std::max(
                            error, static_cast<double>(std::abs(seen.colour(c, trial.background) - truth)));
                    }
                    row.add(kLevels * error, kLevels * (bound + rounding), describe);
                };
                if (min_alpha > 0)
                    judge(cells_, sparse, nothingSkipped(), hidden);
                else
                    judgeDefaults(trial, full, ray, exact, rounding);
                for (const float stop : {1e-4f, 1e-2f, 0.2f}) {
                    TraceOptions options = nothingSkipped();
                    options.stop_transmittance = stop;
                    if (min_alpha == 0) judge(stop_, full, options, stop);
                    for (const float dropped : {1e-3f, 1e-2f, 0.1f}) {
                        options.max_dropped = dropped;
                        options.min_weight = 0.1f * dropped;
                        judge(together_, sparse, options, stop + dropped + (min_alpha > 0 ? hidden : 0.0));
                    }
                }
                if (min_alpha > 0) continue;
                for (const float min_weight : {1e-3f, 1e-2f, 1.0f})
                    for (const float dropped : {0.0f, 1e-3f, 1e-2f, 0.1f}) {
                        TraceOptions options = nothingSkipped();
                        options.min_weight = min_weight, options.max_dropped = dropped;
                        judge(dropped_, full, options, dropped);
                    }
            }
        }
    }

    std::vector<StressRow> rows() const { return {stop_, dropped_, cells_, together_, defaults_, decoded_}; }

private:
    void judgeDefaults(const Trial& trial, const TraceScene& scene, const Ray& ray, const ExactLight& exact,
                       double rounding) {
        TraceOptions options;
        options.step_voxels = kStep;
        const RaySight seen = look(scene, ray, options);
        const double bound =
            static_cast<double>(options.max_dropped) + static_cast<double>(options.stop_transmittance);
        double error = 0;
        for (int c = 0; c < 3; ++c) {
            const Exact truth =
                (1 - exact.transmittance) * exact.mean[c] + exact.transmittance * trial.background;
            error = std::max(error, static_cast<double>(std::abs(seen.colour(c, trial.background) - truth)));
        }
        const auto describe = [&] { return trial.name; };
        defaults_.add(kLevels * error, kLevels * (bound + rounding), describe);

        const auto decode = [&](const std::array<float, VoxelScene::kChannels>& features, double transmittance, int c) {
            const std::array<float, 3> direction = {1, 0, 0};
            const auto light = static_cast<float>(transmittance);
            std::array<float, 3> rgb;
            decoder_.forward(1, features.data(), direction.data(), &light, rgb.data(), work_);
            return (1 - transmittance) * rgb[static_cast<std::size_t>(c)] + transmittance * trial.background;
        };
        std::array<float, VoxelScene::kChannels> found{}, truth{};
        for (int c = 0; c < 3; ++c)
            found[static_cast<std::size_t>(c)] = static_cast<float>(seen.mean[static_cast<std::size_t>(c)]),
            truth[static_cast<std::size_t>(c)] = static_cast<float>(exact.mean[static_cast<std::size_t>(c)]);
        error = 0;
        for (int c = 0; c < 3; ++c)
            error = std::max(error, std::abs(decode(found, 1 - seen.opacity, c) -
                                             decode(truth, static_cast<double>(exact.transmittance), c)));
        const double stop = options.stop_transmittance;
        decoded_.add(kLevels * error,
                     kLevels * (slopes_.features * static_cast<double>(options.max_dropped) +
                                (1 + slopes_.features + slopes_.opacity) * stop +
                                (1 + slopes_.features + slopes_.opacity) * rounding),
                     describe);
    }

    const Decoder decoder_{VoxelScene::kChannels, 5, 32};
    const DecoderSlopes slopes_{decoder_};
    Decoder::Workspace work_;
    StressRow stop_, dropped_, cells_, together_, defaults_, decoded_;
};

}  // namespace

std::vector<StressRow> stressSkips(const SkipStressOptions& options, Report& report) {
    SkipJudge judge;
    const std::vector<Trial> hostile = adversaries();
    report.begin("skipping", static_cast<std::int64_t>(hostile.size()) + options.scenes);
    for (const Trial& trial : hostile) judge.run(trial);
    for (int i = 0; i < options.scenes; ++i) {
        if (report.cancelled()) throw Interrupted("stopped while skipping was judged, as asked");
        judge.run(randomTrial(static_cast<std::uint64_t>(i)));
        report.update(static_cast<std::int64_t>(hostile.size()) + i + 1, "");
    }
    report.end();
    return judge.rows();
}

}  // namespace nerfvdb
