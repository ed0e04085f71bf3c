// SPDX-License-Identifier: Apache-2.0
#include "bench/error_curves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>
#include <string>

#include "bench/half_precision.h"
#include "bench/number_text.h"
#include "bench/repeat.h"
#include "bench/result_plot.h"
#include "bench/voxel_scene.h"
#include "vdb/adapt.h"
#include "vdb/volume.h"

namespace nerfvdb {
namespace {

constexpr double kLevels = 255;  // of 8 bits in a colour's range
constexpr double kBackground = 1;
constexpr int kTileRays = 64;  // traced at a time, as in a picture

/// A ball with a hard surface, and fog that thins out from the middle.
struct CurveScene {
    const char* name;
    VoxelScene scene;
};

std::vector<CurveScene> curveScenes() {
    const Vec3i dims = Vec3i::Constant(64);
    const auto radius = [](const Vec3i& v) { return (v.cast<double>() - Vec3d(31.3, 31.6, 31.1)).norm(); };
    const auto stripes = [](const Vec3i& v, int c) { return 0.5 + 0.5 * std::sin(0.35 * v[c] + c); };
    std::vector<CurveScene> scenes;
    const auto ball = [=](const Vec3i& v) { return radius(v) < 20 ? 3.0 : 1e-7; };
    const auto fog = [=](const Vec3i& v) { return 0.02 * std::exp(-radius(v) * radius(v) / 200); };
    scenes.push_back({"ball", VoxelScene(dims, ball, stripes)});
    scenes.push_back({"fog", VoxelScene(dims, fog, stripes)});
    return scenes;
}

std::vector<Ray> curveRays(int n) {
    std::vector<Ray> rays;
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(n); ++i) {
        const auto onSphere = [&](std::uint64_t seed, double size) {
            const double z = randomBetween(-1, 1, seed, i), turn = randomBetween(0, 2 * M_PI, seed + 1, i);
            return Vec3d(size * std::sqrt(1 - z * z) * std::cos(turn),
                         size * std::sqrt(1 - z * z) * std::sin(turn), size * z);
        };
        const Vec3d middle(31.5, 31.5, 31.5), eye = middle + onSphere(80, 90),
                                              target = middle + onSphere(82, 18);
        rays.push_back({eye, (target - eye).normalized()});
    }
    return rays;
}

using Colours = std::vector<std::array<double, 3>>;  // of each ray

struct Errors {
    double largest = 0, mean = 0, density_samples = 0, feature_samples = 0;
};

Errors errorsOf(const TraceScene& scene, const std::vector<Ray>& rays, const TraceOptions& options,
                const Colours& truth) {
    Errors errors;
    for (std::size_t r = 0; r < rays.size(); ++r) {
        const RaySight seen = look(scene, rays[r], options);
        double error = 0;
        for (int c = 0; c < 3; ++c)
            error = std::max(
                error, std::abs(seen.colour(c, kBackground) - truth[r][static_cast<std::size_t>(c)]));
        errors.largest = std::max(errors.largest, kLevels * error);
        errors.mean += kLevels * error / static_cast<double>(rays.size());
        errors.density_samples +=
            static_cast<double>(seen.counters.samples_density) / static_cast<double>(rays.size());
        errors.feature_samples +=
            static_cast<double>(seen.counters.samples_features) / static_cast<double>(rays.size());
    }
    return errors;
}

Colours coloursOf(const TraceScene& scene, const std::vector<Ray>& rays, const TraceOptions& options) {
    Colours colours;
    for (const Ray& ray : rays) {
        const RaySight seen = look(scene, ray, options);
        colours.push_back({seen.colour(0, kBackground), seen.colour(1, kBackground), seen.colour(2, kBackground)});
    }
    return colours;
}

TraceOptions withStep(double step) {
    TraceOptions options = nothingSkipped();
    options.step_voxels = static_cast<float>(step);
    return options;
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
            std::copy_n(&field.features()[voxel * VoxelScene::kChannels], 3,
                        &volume.color()[to * Volume::kChannels]);
        });
    }
    return volume;
}

/// The points of one scene's curves: their errors at once, their times when all of them are known, in turn.
class ScenePoints {
public:
    ScenePoints(std::string name, const std::vector<Ray>& rays, BenchResult& result)
        : name_(std::move(name)), rays_(rays), result_(result), first_row_(result.rows.size()) {}

    /// Borrows the scene until timeAll() is over.
    double add(const char* knob, double value, const TraceScene& scene, const TraceOptions& options, const Colours& truth,
               std::optional<double> bound) {
        const Errors errors = errorsOf(scene, rays_, options, truth);
        result_.rows.push_back({name_ + ", " + knob,
                                numberText(value),
                                {{value},
                                 {},
                                 {errors.density_samples},
                                 {errors.feature_samples},
                                 {errors.largest},
                                 {errors.mean},
                                 bound ? std::vector<double>{*bound} : std::vector<double>{}}});
        bodies_.push_back([this, &scene, options] { traceAll(scene, options); });
        return errors.mean;
    }

    void timeAll(const RepeatOptions& options, Report& report) {
        const std::vector<Timing> timings = timeInTurn(bodies_, options, "time a ray, " + name_, report);
        for (std::size_t p = 0; p < timings.size(); ++p)
            for (const double seconds : timings[p].cpu_s)
                result_.rows[first_row_ + p].cells[result_.column("microseconds")].push_back(
                    1e6 * seconds / static_cast<double>(rays_.size()));
    }

private:
    void traceAll(const TraceScene& scene, const TraceOptions& options) {
        for (std::size_t first = 0; first < rays_.size(); first += kTileRays) {
            tracer_.clear();
            for (std::size_t r = first; r < std::min(first + kTileRays, rays_.size()); ++r)
                tracer_.addRay(scene, rays_[r], options.step_voxels, 0.5f);
            tracer_.trace(scene, options, kept_);
        }
    }

    std::string name_;
    const std::vector<Ray>& rays_;
    BenchResult& result_;
    std::size_t first_row_;
    std::vector<std::function<void()>> bodies_;
    RayTracer tracer_{kTileRays};
    KeptSamples kept_;
};

void addCurves(const CurveScene& curve, const std::vector<Ray>& rays, const RepeatOptions& repeats, BenchResult& result,
               Report& report) {
    const std::string name = curve.name;
    const VoxelField& field = curve.scene.field;
    const Occupancy everything = curve.scene.everything();
    const TraceScene full(field, everything);
    ScenePoints points(name, rays, result);

    const Colours fine = coloursOf(full, rays, withStep(1.0 / 64));
    double last = 0;
    for (const double step : {4.0, 2.0, 1.0, 0.5, 0.25, 0.125}) {
        const double error = points.add("step", step, full, withStep(step), fine, std::nullopt);
        if (last > 0)
            result.figures.push_back({name + ": order from step " + numberText(2 * step) + " to " + numberText(step),
                                      std::log2(last / error)});
        last = error;
    }

    const Colours truth = coloursOf(full, rays, nothingSkipped());
    for (const double stop : {0.0, 1e-5, 1e-4, 1e-3, 1e-2, 5e-2}) {
        TraceOptions options = nothingSkipped();
        options.stop_transmittance = static_cast<float>(stop);
        points.add("stop", stop, full, options, truth, kLevels * stop);
    }
    const TraceOptions defaults;
    for (const double weight : {0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2}) {
        TraceOptions options = nothingSkipped();
        options.min_weight = static_cast<float>(weight);
        options.max_dropped = static_cast<float>(weight) * (defaults.max_dropped / defaults.min_weight);
        points.add("least weight", weight, full, options, truth, kLevels * static_cast<double>(options.max_dropped));
    }
    std::deque<Occupancy> occupied;
    std::deque<TraceScene> sparse;
    const double longest = field.topology().dims().cast<double>().norm();
    for (const double alpha : {0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
        occupied.push_back(findOccupied(field, static_cast<float>(alpha)));
        sparse.emplace_back(field, alpha > 0 ? occupied.back() : everything);
        points.add("least alpha of a cell", alpha, sparse.back(), nothingSkipped(), truth,
                   kLevels * -std::expm1(longest * std::log1p(-alpha)));
    }
    points.add("all at their defaults", static_cast<double>(defaults.step_voxels), full, defaults, truth,
               kLevels * (static_cast<double>(defaults.max_dropped) + static_cast<double>(defaults.stop_transmittance)));

    constexpr double kHalfBits = 16;
    VoxelField half = copyField(field, field.topology());
    storeInHalfPrecision(half.density());
    storeInHalfPrecision(half.features());
    const TraceScene half_scene(half, everything);
    points.add("bits of learned values", kHalfBits, half_scene, nothingSkipped(), truth, std::nullopt);
    Volume volume = plainVolume(field);
    const Occupancy cells = allCells(volume);
    const TraceScene volume_scene(volume, cells);
    const Colours single = coloursOf(volume_scene, rays, nothingSkipped());
    storeInHalfPrecision(volume.sigma());
    storeInHalfPrecision(volume.color());
    points.add("bits of an export's values", kHalfBits, volume_scene, nothingSkipped(), single, std::nullopt);

    points.timeAll(repeats, report);
}

}  // namespace

BenchResult errorCurves(const ErrorCurveOptions& options, Report& report) {
    BenchResult result;
    result.kind = "stress-error";
    result.title = "Error of a ray's colour against its time";
    result.facts = gatherFacts();
    result.columns = {{"value"},
                      {"microseconds", "us", Better::lower, Noise::timed, 0.03, 0},
                      {"density_samples", "", Better::lower, Noise::exact, 0.01, 0},
                      {"feature_samples", "", Better::lower, Noise::exact, 0.01, 0},
                      {"largest_error", "levels", Better::lower, Noise::exact, 0.02, 1e-3},
                      {"mean_error", "levels", Better::lower, Noise::exact, 0.02, 1e-3},
                      {"bound", "levels"}};
    const std::vector<Ray> rays = curveRays(options.rays);
    for (const CurveScene& curve : curveScenes())
        addCurves(curve, rays, {.repeats = options.repeats, .min_sample_s = options.min_sample_s}, result, report);
    result.notes.push_back(
        "ball: a hard surface; fog: 0.02 a voxel at its densest; colours in [0, 1], sines; white behind; " +
        std::to_string(rays.size()) + " rays, jitter 1/2, traced on one thread in tiles of " + std::to_string(kTileRays));
    result.notes.push_back("the bound of the least alpha holds for the longest way through the box");
    result.notes.push_back(
        "16 bits: half precision, as exports are written, against single, as all is kept that learns; the network is never "
        "decoded in bf16");
    return result;
}

Plot errorCurvePlot(const BenchResult& result) {
    Plot plot = plotColumns(result, "microseconds", "mean_error");
    plot.x.label = "microseconds a ray";
    plot.y.label = "mean error, levels of 8 bits";
    plot.x.is_log = true;
    return plot;
}

}  // namespace nerfvdb
