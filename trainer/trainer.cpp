// SPDX-License-Identifier: Apache-2.0
#include "trainer/trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "core/error.h"
#include "core/metrics.h"
#include "trainer/ray_source.h"
#include "trainer/scene_box.h"
#include "trainer/schedule.h"
#include "trainer/train_step.h"
#include "vdb/adapt.h"

namespace nerfvdb {
namespace {

constexpr int kChannels = 16;
constexpr double kFinalRate = 0.1;        // learning rates fall to this share, exponentially
constexpr int kWarmUpSteps = 20;          // rates rise linearly at the very start
constexpr float kMinAlpha = 0.01f;        // cells that stop less over a voxel are not looked at
constexpr double kUnitsPerBox = 260;      // density is learned per 1/260 of the box's longest side
constexpr float kInitialRaw = -4.19f;     // alpha 0.03 over two such units

class Clock {
public:
    double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Training from start to finish; each function is one move of the story.
class Training {
public:
    Training(const Dataset& dataset, const TrainOptions& options, Report& report,
             const std::function<void(const TrainProgress&)>& on_interval)
        : dataset_(dataset), options_(options), report_(report), on_interval_(on_interval),
          source_(dataset, options.seed) {}

    void start();
    bool runStage(std::size_t stage);  // false: the user asked to stop
    void refine();
    TrainResult finish(bool interrupted);
    std::vector<Stage>& stages() { return stages_; }

private:
    StepRates ratesAt(double progress) const;
    void updateOccupancy();
    void tell(bool force);

    const Dataset& dataset_;
    const TrainOptions& options_;
    Report& report_;
    const std::function<void(const TrainProgress&)>& on_interval_;
    Clock clock_;
    RaySource source_;
    TrainState state_;
    TrainStepper stepper_;
    std::vector<Stage> stages_;
    std::size_t stage_ = 0;
    std::int64_t step_ = 0;
    TraceOptions trace_;

    // of the current interval
    double interval_error_ = 0, last_told_ = 0, psnr_ = 0;
    std::uint64_t interval_rays_ = 0, rays_ = 0;
};

void Training::start() {
    const Box box = findSceneBox(dataset_, options_.bounds);
    const BoxGrid grid = gridOver(box, kCoarsestResolution);
    Topology topology(grid.dims, possibleCells(dataset_, grid, std::min<std::size_t>(2, dataset_.views.size())));
    if (topology.cellCount() == 0)
        throw DataError(dataset_.root.string(), "no point of the scene's box in view of two cameras",
                        "cameras that look at a common scene", "check the poses, or give --bounds");

    state_.decoder = Decoder(kChannels, options_.seed);
    state_.field = VoxelField(std::move(topology), grid.frame, kChannels, kUnitsPerBox / box.size().maxCoeff());
    for (std::size_t leaf = 0; leaf < state_.field.topology().leafCount(); ++leaf)
        for (int offset = 0; offset < kLeafVoxels; ++offset)
            if (testBit(state_.field.topology().voxels()[leaf], offset))
                state_.field.density()[leaf * kLeafVoxels + offset] = kInitialRaw;
    state_.density_moment = HugeArray<float>(state_.field.density().size());
    state_.feature_moment = HugeArray<float>(state_.field.density().size());
    state_.seen.assign(state_.field.topology().leafCount(), {});
    updateOccupancy();

    const std::int64_t total = options_.steps.empty() ? 4000 : options_.steps.front();
    stages_ = defaultStages(3);
    planSteps(stages_, total);
    report_.begin("training", total);
}

void Training::updateOccupancy() {
    state_.occupancy = findOccupied(state_.field, kMinAlpha);
    source_.update(state_.field, state_.occupancy);
    if (source_.tileCount() == 0)
        throw NumericError("training: no occupied voxel is left in any view; everything became transparent");
}

StepRates Training::ratesAt(double progress) const {
    StepRates rates;
    const float warm_up = std::min(1.0f, static_cast<float>(step_ + 1) / kWarmUpSteps);
    const float factor = warm_up * static_cast<float>(std::pow(kFinalRate, progress));
    rates.density *= factor;
    rates.features *= factor;
    rates.network *= factor;
    return rates;
}

bool Training::runStage(std::size_t stage) {
    stage_ = stage;
    std::int64_t next_update = 32, half = stages_[stage].steps / 2;
    for (std::int64_t i = 0; i < stages_[stage].steps; ++i, ++step_) {
        if (report_.cancelled()) return false;
        if (i == next_update) {
            updateOccupancy();
            next_update += std::clamp<std::int64_t>(i / 2, 32, 512);
        }
        if (i == half) std::fill(state_.seen.begin(), state_.seen.end(), LeafMask{});
        const StepReport result = stepper_.step(state_, source_, static_cast<std::uint64_t>(step_), stages_[stage].batch,
                                                ratesAt(progressAt(stages_, stage, i)), trace_);
        if (!result.is_finite)
            throw NumericError("training: a colour that is not finite at step " + std::to_string(step_) + ", image " +
                               dataset_.views[result.bad_view].path.string() + ", pixel (" +
                               std::to_string(result.bad_x) + ", " + std::to_string(result.bad_y) + ")");
        interval_error_ += result.squared_error;
        interval_rays_ += result.rays;
        tell(false);
    }
    return true;
}

void Training::tell(bool force) {
    const double now = clock_.seconds();
    if (!force && now - last_told_ < 2.0) return;
    last_told_ = now;
    if (interval_rays_ == 0) return;
    const double mse = interval_error_ / (3.0 * static_cast<double>(interval_rays_));
    psnr_ = psnrFromMse(mse);
    rays_ += interval_rays_;
    interval_error_ = 0;
    interval_rays_ = 0;
    TrainProgress progress;
    progress.step = step_;
    for (const Stage& stage : stages_) progress.total_steps += stage.steps;
    progress.stage = static_cast<int>(stage_);
    progress.loss = mse;
    progress.psnr = psnr_;
    progress.rays = rays_;
    progress.voxels = state_.field.topology().voxelCount();
    progress.seconds = now;
    if (on_interval_) on_interval_(progress);
    char note[64];
    std::snprintf(note, sizeof note, "%.2f dB", psnr_);
    report_.update(step_, note);
}

void Training::refine() {
    updateOccupancy();
    std::vector<LeafMask> keep = state_.occupancy.cells;
    for (std::size_t leaf = 0; leaf < keep.size(); ++leaf)
        for (int word = 0; word < kLeafWords; ++word) keep[leaf][word] &= state_.seen[leaf][word];
    const Topology coarse = state_.field.topology();
    VoxelField fine = refineField(state_.field, subdivide(coarse, keep));
    HugeArray<float> density_moment(fine.density().size()), feature_moment(fine.density().size());
    refineValues(coarse, fine.topology(), 1, state_.density_moment.span(), density_moment.span());
    refineValues(coarse, fine.topology(), 1, state_.feature_moment.span(), feature_moment.span());
    state_.field = std::move(fine);
    state_.density_moment = std::move(density_moment);
    state_.feature_moment = std::move(feature_moment);
    state_.seen.assign(state_.field.topology().leafCount(), {});
    updateOccupancy();
}

TrainResult Training::finish(bool interrupted) {
    tell(true);
    report_.end();
    TrainResult result;
    const Occupancy occupancy = findOccupied(state_.field, kMinAlpha);
    result.model.field = copyField(state_.field, prune(state_.field.topology(), occupancy.cells));
    result.model.decoder = state_.decoder;
    result.model.background = state_.background;
    result.model.info = {scheduleText(stages_), options_.seed, "", psnr_};
    result.steps = step_;
    result.interrupted = interrupted;
    result.active_voxels = result.model.field.topology().voxelCount();
    return result;
}

}  // namespace

TrainResult train(const Dataset& dataset, const TrainOptions& options, Report& report,
                  const std::function<void(const TrainProgress&)>& on_interval, const std::filesystem::path&, bool) {
    Training training(dataset, options, report, on_interval);
    training.start();
    for (std::size_t stage = 0; stage < training.stages().size(); ++stage) {
        if (stage > 0 && training.stages()[stage].level != training.stages()[stage - 1].level) training.refine();
        if (!training.runStage(stage)) return training.finish(/*interrupted=*/true);
    }
    return training.finish(/*interrupted=*/false);
}

}  // namespace nerfvdb
