// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_skips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "bench/half_precision.h"
#include "bench/number_text.h"
#include "bench/ray_reference.h"
#include "bench/result_plot.h"
#include "core/error.h"
#include "core/random.h"
#include "vdb/adapt.h"
#include "vdb/decoder.h"
#include "vdb/volume.h"

namespace nerfvdb {
namespace {

constexpr int kChannels = 4;
constexpr double kLevels = 255;  // of 8 bits in a colour's range
constexpr double kRounding = 0x1p-24;
constexpr float kStep = 0.5f;  // voxels

double random(double low, double high, std::uint64_t seed, std::uint64_t index) {
    return low + (high - low) * unitFloat(static_cast<std::uint32_t>(randomBits(seed, 14, index)));
}

/// A dense field of values given by voxel: density scale 1, voxel size 1, so that sigma is per voxel.
struct Scene {
    VoxelField field;
    template <typename Sigma, typename Colour>
    Scene(const Vec3i& dims, const Sigma& sigma, const Colour& colour) {
        std::vector<Topology::LeafCells> leaves;
        for (int x = 0; x < dims.x() / kLeafDim; ++x)
            for (int y = 0; y < dims.y() / kLeafDim; ++y)
                for (int z = 0; z < dims.z() / kLeafDim; ++z) {
                    Topology::LeafCells leaf{Vec3i(x, y, z), {}};
                    for (int i = 0; i < kLeafVoxels; ++i)
                        if (((leaf.leaf * kLeafDim + Vec3i(i >> 6, i >> 3 & 7, i & 7)).array() <
                             dims.array() - 1)
                                .all())
                            setBit(leaf.cells, i);
                    leaves.push_back(leaf);
                }
        field = VoxelField(Topology(dims, leaves), {}, kChannels, 1.0);
        for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
            for (int i = 0; i < kLeafVoxels; ++i) {
                const Vec3i at =
                    field.topology().leafCoords()[leaf] * kLeafDim + Vec3i(i >> 6, i >> 3 & 7, i & 7);
                const std::size_t voxel = leaf * kLeafVoxels + static_cast<std::size_t>(i);
                field.density()[voxel] = static_cast<float>(std::log(std::max(sigma(at), 1e-8)));
                for (int c = 0; c < 3; ++c)
                    field.features()[voxel * kChannels + static_cast<std::size_t>(c)] =
                        static_cast<float>(colour(at, c));
            }
    }
    Occupancy everything() const {
        return occupancyFromCells(field.topology(),
                                  {field.topology().cells().begin(), field.topology().cells().end()});
    }
};

TraceOptions nothingSkipped() {
    TraceOptions options;
    options.step_voxels = kStep;
    options.stop_transmittance = 0, options.min_weight = 0, options.max_dropped = 0;
    return options;
}

struct Seen {
    std::array<double, 3> mean{};  // F of the first three channels
    double opacity = 0;
    KeptSamples kept;
    TraceCounters counters;
    double colour(int c, double background) const { return opacity * mean[c] + (1 - opacity) * background; }
};

Seen look(const TraceScene& scene, const Ray& ray, const TraceOptions& options) {
    RayTracer tracer(1);
    Seen seen;
    tracer.addRay(scene, ray, options.step_voxels, 0.5f);
    tracer.trace(scene, options, seen.kept);
    for (int c = 0; c < 3; ++c) seen.mean[c] = tracer.rayFeatures()[c];
    seen.opacity = 1 - static_cast<double>(tracer.transmittance()[0]);
    seen.counters = tracer.counters();
    return seen;
}

/// A scene, rays through it, and what is behind it.
struct Trial {
    std::string name;
    Scene scene;
    std::vector<Ray> rays;
    double background;
};

/// Along x through the middle of cells, and aslant.
std::vector<Ray> raysThrough(const Vec3i& dims, std::uint64_t seed) {
    std::vector<Ray> rays{{Vec3d(-3, 0.5 * dims.y() + 0.3, 0.5 * dims.z() - 0.4), Vec3d::UnitX()}};
    for (std::uint64_t i = 0; i < 3; ++i) {
        const Vec3d eye(-3, random(1, dims.y() - 2, seed, 2 * i), random(1, dims.z() - 2, seed, 2 * i + 1));
        const Vec3d target(dims.x(), random(1, dims.y() - 2, seed + 1, 2 * i),
                           random(1, dims.z() - 2, seed + 1, 2 * i + 1));
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
                     Scene(dims, sigmaAt,
                           [=](const Vec3i& v, int) { return v.x() < end + 10 ? fog_colour : 1 - fog_colour; }),
                     {{Vec3d(-3, 8.3, 7.6), Vec3d::UnitX()}},
                     0.5});
            }
    // Nothing but fog, so thin that it hides in every threshold.
    for (const double sigma : {1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 2e-3, 1e-2})
        trials.push_back({"fog of sigma " + numberText(sigma) + " a voxel",
                          Scene(
                              dims, [=](const Vec3i&) { return sigma; }, [](const Vec3i&, int) { return 1.0; }),
                          raysThrough(dims, 60), 0.0});
    // As much light as the stop leaves behind, on a white wall before black.
    for (const double left : {0.2, 0.9, 0.999, 1.001, 5.0}) {
        const double sigma = -std::log(left * static_cast<double>(defaults.stop_transmittance)) / 20;
        trials.push_back(
            {"a black slab that leaves " + numberText(left) + " times the stop, before a white wall",
             Scene(
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
    const double thin = std::pow(10.0, random(-6, 0, 62, seed)),
                 thick = std::pow(10.0, random(-2, 2, 63, seed));
    const double share = random(0, 1, 64, seed);
    const auto voxel = [](const Vec3i& v) {
        return static_cast<std::uint64_t>((v.x() * 64 + v.y()) * 64 + v.z());
    };
    return {
        "random scene " + std::to_string(seed),
        Scene(
            dims,
            [=](const Vec3i& v) {
                return random(0, 1, 65 + seed, voxel(v)) < share ? thin
                                                                 : thick * random(0, 1, 66 + seed, voxel(v));
            },
            [=](const Vec3i& v, int c) {
                return random(0, 1, 67 + seed, 4 * voxel(v) + static_cast<std::uint64_t>(c)) < 0.5 ? 0.0 : 1.0;
            }),
        raysThrough(dims, 68 + seed), random(0, 1, 69, seed)};
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
                const Seen whole = look(full, ray, nothingSkipped());
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
                    const Seen seen = look(scene, ray, options);
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
        const Seen seen = look(scene, ray, options);
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

        const auto decode = [&](const std::array<float, kChannels>& features, double transmittance, int c) {
            const std::array<float, 3> direction = {1, 0, 0};
            const auto light = static_cast<float>(transmittance);
            std::array<float, 3> rgb;
            decoder_.forward(1, features.data(), direction.data(), &light, rgb.data(), work_);
            return (1 - transmittance) * rgb[static_cast<std::size_t>(c)] + transmittance * trial.background;
        };
        std::array<float, kChannels> found{}, truth{};
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

    const Decoder decoder_{kChannels, 5, 32};
    const DecoderSlopes slopes_{decoder_};
    Decoder::Workspace work_;
    StressRow stop_, dropped_, cells_, together_, defaults_, decoded_;
};

// --- curves
// ---------------------------------------------------------------------------------------------------

/// A ball with a hard surface, and fog that thins out from the middle.
struct CurveScene {
    const char* name;
    Scene scene;
};

std::vector<CurveScene> curveScenes() {
    const Vec3i dims = Vec3i::Constant(64);
    const auto radius = [](const Vec3i& v) { return (v.cast<double>() - Vec3d(31.3, 31.6, 31.1)).norm(); };
    const auto stripes = [](const Vec3i& v, int c) { return 0.5 + 0.5 * std::sin(0.35 * v[c] + c); };
    std::vector<CurveScene> scenes;
    scenes.push_back({"ball", Scene(
                                  dims, [=](const Vec3i& v) { return radius(v) < 20 ? 3.0 : 1e-7; }, stripes)});
    scenes.push_back(
        {"fog",
         Scene(
             dims, [=](const Vec3i& v) { return 0.02 * std::exp(-radius(v) * radius(v) / 200); }, stripes)});
    return scenes;
}

std::vector<Ray> curveRays(int n) {
    std::vector<Ray> rays;
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(n); ++i) {
        const auto onSphere = [&](std::uint64_t seed, double size) {
            const double z = random(-1, 1, seed, i), turn = random(0, 2 * M_PI, seed + 1, i);
            return Vec3d(size * std::sqrt(1 - z * z) * std::cos(turn),
                         size * std::sqrt(1 - z * z) * std::sin(turn), size * z);
        };
        const Vec3d middle(31.5, 31.5, 31.5), eye = middle + onSphere(80, 90),
                                              target = middle + onSphere(82, 18);
        rays.push_back({eye, (target - eye).normalized()});
    }
    return rays;
}

struct Truth {
    std::vector<std::array<double, 3>> colours;
};

constexpr double kBackground = 1;

struct Errors {
    double largest = 0, mean = 0, density_samples = 0, feature_samples = 0;
};

Errors errorsOf(const TraceScene& scene, const std::vector<Ray>& rays, const TraceOptions& options,
                const Truth& truth) {
    Errors errors;
    for (std::size_t r = 0; r < rays.size(); ++r) {
        const Seen seen = look(scene, rays[r], options);
        double error = 0;
        for (int c = 0; c < 3; ++c)
            error = std::max(
                error, std::abs(seen.colour(c, kBackground) - truth.colours[r][static_cast<std::size_t>(c)]));
        errors.largest = std::max(errors.largest, kLevels * error);
        errors.mean += kLevels * error / static_cast<double>(rays.size());
        errors.density_samples +=
            static_cast<double>(seen.counters.samples_density) / static_cast<double>(rays.size());
        errors.feature_samples +=
            static_cast<double>(seen.counters.samples_features) / static_cast<double>(rays.size());
    }
    return errors;
}

Truth truthOf(const TraceScene& scene, const std::vector<Ray>& rays, double step) {
    TraceOptions options = nothingSkipped();
    options.step_voxels = static_cast<float>(step);
    Truth truth;
    for (const Ray& ray : rays) {
        const Seen seen = look(scene, ray, options);
        truth.colours.push_back(
            {seen.colour(0, kBackground), seen.colour(1, kBackground), seen.colour(2, kBackground)});
    }
    return truth;
}

/// The same sigma and colours as an export has them: at voxels, and linear between them.
Volume plainVolume(const VoxelField& field) {
    std::vector<Topology::LeafCells> voxels;
    const Topology& from = field.topology();
    for (std::size_t leaf = 0; leaf < from.leafCount(); ++leaf)
        voxels.push_back({from.leafCoords()[leaf], from.voxels()[leaf]});
    Volume volume(voxels, field.frame());
    for (std::size_t leaf = 0; leaf < from.leafCount(); ++leaf) {
        const Vec3i coord = from.leafCoords()[leaf] - volume.firstVoxel() / kLeafDim;
        const auto target = static_cast<std::size_t>(volume.topology().findLeaf(coord));
        forEachBit(from.voxels()[leaf], [&](int offset) {
            const std::size_t voxel = leaf * kLeafVoxels + static_cast<std::size_t>(offset);
            const std::size_t to = target * kLeafVoxels + static_cast<std::size_t>(offset);
            volume.sigma()[to] = sigmaFromRaw(field.density()[voxel], field.densityScale());
            std::copy_n(&field.features()[voxel * kChannels], 3, &volume.color()[to * Volume::kChannels]);
        });
    }
    return volume;
}

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

BenchResult errorCurves(const SkipStressOptions& options, Report& report) {
    BenchResult result;
    result.kind = "stress-error";
    result.title = "Error of a ray's colour against samples read";
    result.facts = gatherFacts();
    result.columns = {{"value"},
                      {"density_samples", "", Better::lower, Noise::exact, 0.01, 0},
                      {"feature_samples", "", Better::lower, Noise::exact, 0.01, 0},
                      {"largest_error", "levels", Better::lower, Noise::exact, 0.02, 1e-3},
                      {"mean_error", "levels", Better::lower, Noise::exact, 0.02, 1e-3},
                      {"bound", "levels"}};
    const std::vector<Ray> rays = curveRays(options.rays);
    const std::vector<CurveScene> scenes = curveScenes();
    report.begin("error against work", static_cast<std::int64_t>(scenes.size()));
    for (const CurveScene& scene : scenes) {
        if (report.cancelled()) throw Interrupted("stopped while errors were measured, as asked");
        const Occupancy everything = scene.scene.everything();
        const TraceScene full(scene.scene.field, everything);
        const std::string name = scene.name;
        const auto add = [&](const char* knob, double value, const Errors& errors,
                             std::optional<double> bound) {
            result.rows.push_back({name + ", " + knob,
                                   numberText(value),
                                   {{value},
                                    {errors.density_samples},
                                    {errors.feature_samples},
                                    {errors.largest},
                                    {errors.mean},
                                    bound ? std::vector<double>{*bound} : std::vector<double>{}}});
        };
        const Truth fine = truthOf(full, rays, 1.0 / 64);
        double last = 0;
        for (const double step : {4.0, 2.0, 1.0, 0.5, 0.25, 0.125}) {
            TraceOptions trace = nothingSkipped();
            trace.step_voxels = static_cast<float>(step);
            const Errors errors = errorsOf(full, rays, trace, fine);
            add("step", step, errors, std::nullopt);
            if (last > 0)
                result.figures.push_back(
                    {name + ": order from step " + numberText(2 * step) + " to " + numberText(step),
                     std::log2(last / errors.mean)});
            last = errors.mean;
        }
        const Truth truth = truthOf(full, rays, kStep);
        for (const double stop : {0.0, 1e-5, 1e-4, 1e-3, 1e-2, 5e-2}) {
            TraceOptions trace = nothingSkipped();
            trace.stop_transmittance = static_cast<float>(stop);
            add("stop", stop, errorsOf(full, rays, trace, truth), kLevels * stop);
        }
        const TraceOptions defaults;
        for (const double weight : {0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2}) {
            TraceOptions trace = nothingSkipped();
            trace.min_weight = static_cast<float>(weight);
            trace.max_dropped = static_cast<float>(weight) * (defaults.max_dropped / defaults.min_weight);
            add("least weight", weight, errorsOf(full, rays, trace, truth),
                kLevels * static_cast<double>(trace.max_dropped));
        }
        for (const double alpha : {0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
            const Occupancy occupied = findOccupied(scene.scene.field, static_cast<float>(alpha));
            const TraceScene sparse(scene.scene.field, alpha > 0 ? occupied : everything);
            const double longest = scene.scene.field.topology().dims().cast<double>().norm();
            add("least alpha of a cell", alpha, errorsOf(sparse, rays, nothingSkipped(), truth),
                kLevels * -std::expm1(longest * std::log1p(-alpha)));
        }
        constexpr double kHalfBits = 16;
        VoxelField field = copyField(scene.scene.field, scene.scene.field.topology());
        storeInHalfPrecision(field.density());
        storeInHalfPrecision(field.features());
        add("bits of learned values", kHalfBits, errorsOf(TraceScene(field, everything), rays, nothingSkipped(), truth),
            std::nullopt);
        Volume volume = plainVolume(scene.scene.field);
        const Occupancy cells = allCells(volume);
        const Truth single = truthOf(TraceScene(volume, cells), rays, kStep);
        storeInHalfPrecision(volume.sigma());
        storeInHalfPrecision(volume.color());
        add("bits of an export's values", kHalfBits, errorsOf(TraceScene(volume, cells), rays, nothingSkipped(), single),
            std::nullopt);
        report.update(static_cast<std::int64_t>(&scene - scenes.data()) + 1, "");
    }
    report.end();
    result.notes.push_back(
        "ball: a hard surface; fog: 0.02 a voxel at its densest; colours in [0, 1], sines; white behind; " +
        std::to_string(rays.size()) + " rays, jitter 1/2");
    result.notes.push_back("the bound of the least alpha holds for the longest way through the box");
    result.notes.push_back(
        "16 bits: half precision, as exports are written, against single, as all is kept that learns; the network is never "
        "decoded in bf16");
    return result;
}

Plot errorCurvePlot(const BenchResult& result) {
    Plot plot = plotColumns(result, "density_samples", "mean_error");
    plot.x.label = "samples read a ray";
    plot.y.label = "mean error, levels of 8 bits";
    plot.x.is_log = true;
    return plot;
}

}  // namespace nerfvdb
