// SPDX-License-Identifier: Apache-2.0
#include "trainer/trainer.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/clock.h"
#include "core/error.h"
#include "core/machine_memory.h"
#include "core/metrics.h"
#include "core/parallel.h"
#include "core/photo_cache.h"
#include "trainer/checkpoint_keeper.h"
#include "trainer/dataset_hash.h"
#include "trainer/even_color.h"
#include "trainer/faint_cells.h"
#include "trainer/level_change.h"
#include "trainer/looks.h"
#include "trainer/memory_plan.h"
#include "trainer/model_cameras.h"
#include "trainer/object_box.h"
#include "trainer/plain_background.h"
#include "trainer/possible_cells.h"
#include "trainer/resolved_regions.h"
#include "trainer/scene_box.h"
#include "trainer/scene_shells.h"
#include "trainer/seen_cells.h"
#include "trainer/step_guard.h"
#include "trainer/train_plan.h"
#include "trainer/view_neighbours.h"
#include "vdb/adapt.h"

namespace nerfvdb {
namespace {

constexpr int kWarmUpSteps = 20;            // rates rise linearly at the very start
constexpr double kUnitsPerBox = 260;        // density is learned per 1/260 of the box's longest side ...
constexpr float kInitialRaw = -5;           // ... and starts at alpha 0.013 over two such units; ...
// ... but an open scene near empty: a ray crosses many shells, and fog in the near ones would hide what stands behind.
constexpr float kOpenInitialRaw = -6;
constexpr float kOpenMinSeen = 0.05f;       // there a cell no sample of which gave a ray this share of its light is not divided
// Beyond kMaxLevels a surface that stayed as thick as it was would be twice as many voxels thick at every level, each with
// half the share of a ray's light: voxels would grow eightfold in number, and kOpenMinSeen would tear holes. So density
// doubles with every such level, that a surface be as many voxels thick.
constexpr float kSharper = 0.69314718f;     // ln 2, in raw density
constexpr float kOpenDensitySmoothing = 0.075f;  // and photographs of places bear, and need, smoother surfaces
constexpr int kSkyWidth = 512;              // texels around the horizon
constexpr double kMostLooks = 4e6;          // rays of a look through the photographs, or as many as are enough
constexpr double kErrorMemory = 0.99;       // of the running mean of the error, per step
constexpr double kTellSeconds = 2;          // between progress reports
constexpr std::int64_t kFirstOccupancy = 32, kLastOccupancy = 512;  // steps between updates, growing inside a stage
constexpr std::int64_t kProbeSteps = 40;    // of a stage, before its cost is believed
constexpr std::int64_t kCarvedSteps = 150;  // ... and of the first in an open scene, before it is believed at last
constexpr double kSameExposure = 0.05;      // Exposures::ownSpread that is not worth learning (docs/quality.md)
constexpr double kSaveSeconds = 0.3, kSaveSecondsPerVoxel = 0.5e-6;  // pruning, writing checkpoint and model: measured half of it

/// Of voxels smaller than are chosen by themselves.
bool isAskedFor(const Stage& stage) { return stage.level >= kMaxLevels; }

/// Training from start to finish; each function is one move of the story.
class Training {
public:
    Training(const Dataset& dataset, const TrainOptions& options, Report& report,
             const std::function<void(const TrainProgress&)>& on_interval, const std::filesystem::path& checkpoint)
        : dataset_(dataset), options_(options), report_(report), on_interval_(on_interval), checkpoint_(checkpoint),
          checkpoints_(checkpoint, options.checkpoint_s, report), source_(dataset, options.seed) {
        if (options.skip_nothing) trace_ = {.stop_transmittance = 0, .min_weight = 0, .max_dropped = 0, .skip_unlit = false};
    }

    void start();
    void resume();
    TrainResult run();

private:
    bool isOpen() const;
    bool keepsUnseen() const { return options_.keep_unseen || options_.skip_nothing; }
    /// What shells hold against one box: each leaves out an eighth of its own.
    double carvedSpace() const { return 1 + 0.875 * (state_.field.shells().count - 1); }
    bool carvesShells() const { return place_.stage == 0 && state_.field.shells().count > 1; }
    bool photosOnDisk() const { return !dataset_.views.empty() && dataset_.views.front().photo.tiles != nullptr; }
    std::size_t mappedPhotoBytes() const;  // of photographs on disk that may stand in memory at once
    MemoryPlan memoryPlan() const;
    std::size_t memoryLimit() const { return options_.max_memory_bytes.value_or(machineMemory()); }
    void checkMemory(const std::string& voxels, const std::string& advice) const;
    void chooseBackground();
    Box findBox() const;
    void checkFinestVoxel(const Box& box, double coarsest_voxel) const;
    void replanForTime();
    bool runStage();  // false: the user asked to stop, or numeric_error_ says why
    void stepOnce();
    void enterStage();
    void settleExposure();
    void refine();
    void sharpen(float by);
    void halveNearCameras();
    void stayCoarse(const std::string& what, std::size_t bytes);
    void lookAgain();
    void updateSource();
    void updateOccupancy();
    StepRates rates() const;
    void tell(bool force);
    void saveMeanwhile();
    TrainResult finish(bool interrupted);
    Stage& stage() { return place_.stages[place_.stage]; }
    std::int64_t totalSteps() const;

    const Dataset& dataset_;
    const TrainOptions& options_;
    Report& report_;
    const std::function<void(const TrainProgress&)>& on_interval_;
    const std::filesystem::path& checkpoint_;
    CheckpointKeeper checkpoints_;

    const std::size_t mapped_before_ = mappedFileBytes();  // by the program itself
    std::optional<Vec3f> plain_;  // the photographs' own background
    RaySource source_;
    TrainState state_;
    TrainPlace place_;
    TrainStepper stepper_;
    StepGuard guard_;
    std::string numeric_error_;
    TraceOptions trace_;
    int max_levels_ = kMaxLevels;
    bool plans_time_ = false;
    std::vector<std::string> notes_;

    // Of the clock; nothing that is learned depends on these.
    Clock clock_;
    double step_seconds_ = 0;  // running mean on the current level; 0: unknown
    double last_told_ = 0;
    StepReport interval_;  // its sums over rays
};

void Training::start() {
    if (dataset_.views.empty())
        throw DataError(dataset_.root.string(), "no views to train on", "at least one posed photograph");
    if (!dataset_.has_alpha && options_.extent != SceneExtent::open) plain_ = plainBackground(dataset_);
    const SceneShells scene = isOpen() ? findSceneShells(dataset_, options_.bounds)
                                       : SceneShells{findBox(), 1};
    const Box& box = scene.inner;
    const double side = box.size().maxCoeff();
    const int asked_levels = options_.voxel_size ? levelsForVoxel(side, *options_.voxel_size) : 0;
    const double coarsest = options_.voxel_size ? std::ldexp(*options_.voxel_size, asked_levels - 1)
                            : isOpen()          ? side / kCoarsestResolution
                                                : side / (kCoarsestResolution - 1);
    const BoxGrid grid = isOpen() ? gridAround(box, coarsest, scene.count) : gridOfVoxels(box, coarsest);
    // Without a view nothing is ruled out.
    Topology topology(grid.dims, keepsUnseen()
                                     ? possibleCells({}, grid, 0)
                                     : possibleCells(dataset_, grid, std::min<std::size_t>(2, dataset_.views.size())));
    if (topology.cellCount() == 0)
        throw DataError(dataset_.root.string(), "no point of the scene's box in view of two cameras",
                        "cameras that look at a common scene", "check the poses, or give --bounds");

    if (photosOnDisk()) source_.limitMapped(mapped_before_ + mappedPhotoBytes() / 2);  // more is mapped until the next look
    const PresetPlan preset = presetPlan(options_);
    state_.decoder = Decoder(preset.channels, options_.seed, preset.decoder_width);
    state_.decoder.clearOutputLayer();  // what a seed happens to say of directions need not be unlearned
    state_.field = VoxelField(std::move(topology), grid.frame, grid.shells, preset.channels,
                              kUnitsPerBox / box.size().maxCoeff());
    // Alpha says already what is not the scene: no fog hides anything, and there is no sky.
    const bool has_sky = isOpen() && !dataset_.has_alpha;
    const float initial_raw = has_sky ? kOpenInitialRaw : kInitialRaw;
    const Topology& cells = state_.field.topology();
    for (std::size_t leaf = 0; leaf < cells.leafCount(); ++leaf)
        for (int offset = 0; offset < kLeafVoxels; ++offset)
            if (testBit(cells.voxels()[leaf], offset)) state_.field.density()[leaf * kLeafVoxels + offset] = initial_raw;
    state_.density_moment = HugeArray<float>(state_.field.density().size());
    state_.feature_moment = HugeArray<float>(state_.field.density().size());
    state_.seen.assign(cells.leafCount(), {});
    if (has_sky) state_.min_seen = kOpenMinSeen;
    if (has_sky) state_.sky = Sky(kSkyWidth, meanColour(dataset_));
    place_.seed = options_.seed;
    place_.n_views = static_cast<int>(dataset_.views.size());
    place_.data_hash = datasetHash(dataset_);
    place_.next_occupancy = kFirstOccupancy;
    chooseBackground();
    place_.has_asked_voxels = options_.voxel_size.has_value();
    place_.tries_exposure = options_.exposure == ExposureMode::automatic && !dataset_.has_alpha;
    if (place_.tries_exposure || options_.exposure == ExposureMode::on)
        state_.exposures = Exposures(dataset_.views.size(), /*with_background=*/!dataset_.has_alpha);
    max_levels_ = options_.voxel_size ? asked_levels
                                      : std::min(preset.max_levels, usefulLevels(dataset_, box, grid.frame.voxel_size));
    place_.stages = planStages(options_, max_levels_, carvedSpace());
    plans_time_ = plansTime(options_);
    if (!plans_time_) report_.info("plan: " + scheduleText(place_.stages) + " steps");
    checkFinestVoxel(box, grid.frame.voxel_size);
    checkMemory("the coarsest voxels", "allow more, or use fewer or smaller photographs");
    updateOccupancy();
}

void Training::checkMemory(const std::string& voxels, const std::string& advice) const {
    const std::size_t needed = memoryPlan().training(state_.field.topology().leafCount());
    if (!options_.max_memory_bytes || needed <= *options_.max_memory_bytes) return;
    throw UsageError("--max-memory", std::to_string(*options_.max_memory_bytes >> 20) + " MiB",
                     "at least " + std::to_string((needed >> 20) + 1) + " MiB, for the program, the photographs and " + voxels,
                     advice);
}

void Training::resume() {
    loadCheckpoint(checkpoint_, state_, place_,
                   [&] { checkMemory("the voxels of " + checkpoint_.string(), "allow more, or train without --resume"); });
    checkpoints_.setHasFile();
    if (place_.n_views != static_cast<int>(dataset_.views.size()))
        throw DataError(checkpoint_.string(), "training on " + std::to_string(place_.n_views) + " views",
                        std::to_string(dataset_.views.size()) + " as in the data set",
                        "resume with the data that it was made from, or train without --resume");
    if (place_.data_hash != datasetHash(dataset_))
        throw DataError(checkpoint_.string(), "training on other cameras or photographs",
                        "those of " + dataset_.root.string(),
                        "resume with the data that it was made from, or train without --resume");
    source_ = RaySource(dataset_, place_.seed);
    if (photosOnDisk()) source_.limitMapped(mapped_before_ + mappedPhotoBytes() / 2);  // more is mapped until the next look
    updateSource();
    report_.info("resuming at step " + std::to_string(place_.step) + " of " + std::to_string(totalSteps()));
}

bool Training::isOpen() const {
    if (options_.extent != SceneExtent::automatic) return options_.extent == SceneExtent::open;
    return !dataset_.has_alpha && !options_.bounds && options_.background == BackgroundMode::automatic && !plain_;
}

std::size_t Training::mappedPhotoBytes() const {
    constexpr std::size_t kShare = 8;  // of the memory allowed
    return options_.max_memory_bytes.value_or(std::size_t{8} << 30) / kShare;
}

MemoryPlan Training::memoryPlan() const {
    std::size_t photographs = 0;
    for (const View& view : dataset_.views) photographs += view.photo.pixelCount() * sizeof(Photo::Pixel);
    if (photosOnDisk()) photographs = std::min(photographs, mappedPhotoBytes());
    int largest_batch = 0;
    for (const Stage& stage : place_.stages) largest_batch = std::max(largest_batch, stage.batch);
    return {photographs, state_.decoder.channels(), largest_batch, threadCount()};
}

Box Training::findBox() const {
    const bool is_plain = !dataset_.has_alpha && (plain_ || options_.background != BackgroundMode::automatic);
    if (!is_plain || options_.bounds || dataset_.aabb_scale) return findSceneBox(dataset_, options_.bounds);
    return findObject(dataset_, findCommonView(dataset_), options_, report_);
}

void Training::chooseBackground() {
    switch (options_.background) {
        case BackgroundMode::white:
        case BackgroundMode::black:
            state_.background = Vec3f::Constant(options_.background == BackgroundMode::white ? 1.0f : 0.0f);
            state_.behind = dataset_.has_alpha ? Behind::fixed : Behind::plain;
            break;
        case BackgroundMode::automatic:
            // Where opacity is known it is learned as such: no fog can hide in the colour of the background.
            state_.background = dataset_.has_alpha ? Vec3f(Vec3f::Ones()) : plain_ ? *plain_ : meanColour(dataset_);
            state_.behind = dataset_.has_alpha ? Behind::random : plain_ ? Behind::plain : Behind::fixed;
            break;
        case BackgroundMode::random:
            if (!dataset_.has_alpha)
                throw UsageError("--background random", "photographs without alpha", "alpha masks",
                                 "use --background auto, white or black");
            state_.background = Vec3f::Ones();
            state_.behind = Behind::random;
            break;
    }
    if (!state_.sky.isEmpty()) state_.behind = Behind::fixed;  // the sky is there instead
}

/// What could never be saved is not trained.
void Training::checkFinestVoxel(const Box& box, double coarsest_voxel) const {
    const int level = plans_time_ ? max_levels_ - 1 : place_.stages.back().level;
    const double finest = coarsest_voxel / (1 << level);
    if (finest >= kSmallestVoxel) return;
    char found[96], expected[64];
    std::snprintf(found, sizeof found, "a box %.3g world units long, with voxels of %.3g", box.size().maxCoeff(), finest);
    std::snprintf(expected, sizeof expected, "voxels of at least %g, as a .vdb can say", kSmallestVoxel);
    throw DataError(options_.bounds ? "--bounds" : dataset_.root.string() + ": scene box", found, expected,
                    "scale the positions of the cameras (and the bounds) up");
}

void Training::replanForTime() {
    const double voxels = static_cast<double>(state_.field.topology().voxelCount());
    const double reserve = kSaveSeconds + kSaveSecondsPerVoxel * voxels;
    const double left = *options_.time_s - options_.elapsed_s - clock_.seconds() - reserve;
    // The first rays, in fog, cost twice what later ones do: whether there is time for the finest voxels is asked again where
    // voxels become small. In an open scene they cost five times that, and how long to carve at 128 voxels is asked again where
    // that begins. In a box the time that it gets by the first answer is well spent (docs/quality.md, "Time to carve").
    const bool enters_level = place_.stage == 0 || place_.stages[place_.stage - 1].level != stage().level;
    const bool is_open = state_.field.shells().count > 1;
    if (place_.stage == 0 || (enters_level && (stage().level == kMaxLevels - 2 || (is_open && stage().level == 1)))) {
        const auto raysAt = [&](int level) {
            return left * stage().batch * relativeRayCost(stage().level) / (step_seconds_ * relativeRayCost(level));
        };
        const int planned = place_.stages.back().level + 1;
        const int paid = options_.voxel_size ? max_levels_ : levelsForRays(raysAt(kMaxLevels - 2), max_levels_);
        const int most = stage().level == 1 ? kMaxLevels - 1 : kMaxLevels;  // to be added
        const int levels = place_.stage == 0 ? paid : std::max(planned, std::min(paid, most));
        if (stage().level < 2 || levels > planned) {
            std::vector<Stage> stages = defaultStages(levels, raysAt(levels - 1), carvedSpace());
            std::copy_n(place_.stages.begin(), place_.stage, stages.begin());
            place_.stages = std::move(stages);
        }
    }
    if (carvesShells()) leaveTimeToCarve(place_.stages, step_seconds_, left);
    planTime(place_.stages, place_.stage, place_.step_in_stage, step_seconds_, left, carvedSpace());
    report_.replan(totalSteps());
    report_.info("plan: " + scheduleText(place_.stages) + " steps");
}

std::int64_t Training::totalSteps() const {
    std::int64_t total = 0;
    for (const Stage& stage : place_.stages) total += stage.steps;
    return total;
}

void Training::updateSource() {
    if (state_.sky.isEmpty() && !options_.skip_nothing) source_.update(state_.field, state_.occupancy);
    else source_.useAll();  // a pixel without anything in front of it shows the sky, and teaches it
}

void Training::updateOccupancy() {
    const Topology& topology = state_.field.topology();
    if (options_.skip_nothing)
        state_.occupancy = occupancyFromCells(topology, {topology.cells().begin(), topology.cells().end()});
    else
        state_.occupancy = findOccupied(
            state_.field, chooseMinAlpha(state_.field, source_, static_cast<std::uint64_t>(place_.step)));
    updateSource();
    if (source_.tileCount() == 0)
        throw NumericError(
            "training: nothing is left in any view, every voxel became transparent; are the images empty, or the "
            "poses wrong?");
}

StepRates Training::rates() const {
    StepRates rates;
    const double progress = progressAt(place_.stages, place_.stage, place_.step_in_stage);
    const double warm_up = std::min(1.0, static_cast<double>(place_.step + 1) / kWarmUpSteps);
    const float factor = static_cast<float>(warm_up * rateFactor(progress));
    rates.density *= factor;
    rates.features *= factor;
    rates.network *= factor;
    rates.sky *= factor;
    rates.sky_smoothing *= factor * static_cast<float>(skySmoothingFactor(progress));
    rates.exposure *= factor;
    if (!state_.sky.isEmpty()) rates.density_smoothing = kOpenDensitySmoothing;
    // As smooth per world unit at every level: at large voxels neighbours differ more, and smoothing helps less.
    rates.density_smoothing *= static_cast<float>(std::exp2(std::min(0, place_.stages[place_.stage].level - (kMaxLevels - 1))));
    return rates;
}

TrainResult Training::run() {
    report_.begin("training", totalSteps());
    for (;;) {
        if (!runStage()) {
            if (numeric_error_.empty()) checkpoints_.saveNow(state_, place_);
            return finish(/*interrupted=*/numeric_error_.empty());
        }
        if (place_.stage + 1 == place_.stages.size()) break;
        enterStage();
    }
    checkpoints_.saveNow(state_, place_);
    return finish(/*interrupted=*/false);
}

void Training::enterStage() {
    const int level = stage().level;
    // After the first stage fog still bends what photographs are told to differ by.
    if (place_.tries_exposure && (place_.stage > 0 || place_.stages.size() == 2)) settleExposure();
    ++place_.stage;
    place_.step_in_stage = 0;
    place_.next_occupancy = kFirstOccupancy;
    if (stage().level != level) refine();
    else if (plans_time_ && step_seconds_ > 0) replanForTime();
}

/// Photographs that hardly differ from their neighbours are better learned as they are: a model shows such differences by
/// itself, as it does what changes with direction, and held-out photographs, between them, have them too.
void Training::settleExposure() {
    place_.tries_exposure = false;
    const double spread = state_.exposures.ownSpread(nearestViews(dataset_.views));
    char text[128];
    std::snprintf(text, sizeof text, "exposure: photographs differ by %.1f %% from those taken nearest: %s", 100 * spread,
                  spread < kSameExposure ? "taken as equal (--exposure on learns it)" : "learned for each");
    notes_.push_back(text);
    report_.info(text);
    if (spread < kSameExposure) state_.exposures = Exposures();
}

bool Training::runStage() {
    while (place_.step_in_stage < stage().steps) {
        if (report_.cancelled()) return false;
        if (place_.step_in_stage == place_.next_occupancy) {
            updateOccupancy();
            place_.next_occupancy += std::clamp(place_.step_in_stage / 2, kFirstOccupancy, kLastOccupancy);
        }
        stepOnce();
        if (!numeric_error_.empty()) return false;
        const bool is_new_level = place_.stage == 0 || place_.stages[place_.stage - 1].level != stage().level;
        if (plans_time_ && is_new_level && place_.step_in_stage == std::min(kProbeSteps, stage().steps))
            replanForTime();
        // The first looks at what is empty make a step in shells five times cheaper.
        if (plans_time_ && carvesShells() && place_.step_in_stage == kCarvedSteps) replanForTime();
        // Steps become cheaper while space empties: what that saves is used.
        const bool is_last = place_.stage + 1 == place_.stages.size();
        if (plans_time_ && is_last && (place_.step_in_stage == stage().steps / 2 ||
                                       place_.step_in_stage == stage().steps * 3 / 4))
            replanForTime();
        tell(/*force=*/false);
        saveMeanwhile();
    }
    return true;
}

void Training::stepOnce() {
    const double begin = clock_.seconds();
    const double progress = progressAt(place_.stages, place_.stage, place_.step_in_stage);
    state_.distortion = kDistortion * static_cast<float>(distortionFactor(progress));
    state_.alpha = dataset_.has_alpha ? kAlpha : 0;
    // Alpha says already what is fog.
    state_.entropy = dataset_.has_alpha ? 0 : kEntropy * static_cast<float>(entropyFactor(progress));
    const StepReport result = guard_.step(stepper_, state_, source_, static_cast<std::uint64_t>(place_.step),
                                          stage().batch, rates(), trace_);
    if (!result.is_finite) {
        numeric_error_ = StepGuard::complaint(result, place_.step, dataset_);
        return;
    }
    const double mean = result.squared_error / (3.0 * static_cast<double>(result.rays));
    place_.mean_error = place_.step == 0 ? mean : kErrorMemory * place_.mean_error + (1 - kErrorMemory) * mean;
    place_.rays += result.rays;
    ++place_.step;
    ++place_.step_in_stage;

    interval_.squared_error += result.squared_error;
    interval_.distortion += state_.distortion > 0 ? result.distortion : 0;
    interval_.entropy += result.entropy;
    interval_.alpha_error += result.alpha_error;
    interval_.rays += result.rays;
    constexpr double kMemory = 0.98;  // the first step of a level, on cold memory, counts little
    const double seconds = clock_.seconds() - begin;
    step_seconds_ = step_seconds_ == 0 ? seconds : kMemory * step_seconds_ + (1 - kMemory) * seconds;
}

/// Adds to raw density. What training saw was of the field before.
void Training::sharpen(float by) {
    for (float& raw : state_.field.density()) raw = std::min(raw + by, kMaxRaw);
    state_.seen.assign(state_.field.topology().leafCount(), {});
}

/// Looks through all photographs for what they see, unless training has drawn rays enough at this level to meet each cell.
void Training::lookAgain() {
    constexpr double kEnough = 4;  // rays for each occupied cell: one in fifty is still missed
    const int level = place_.stages[place_.stage - 1].level;
    double drawn = 0, cells = 0;
    for (std::size_t s = 0; s < place_.stage; ++s)
        if (place_.stages[s].level == level) drawn += static_cast<double>(place_.stages[s].steps) * place_.stages[s].batch;
    for (const LeafMask& mask : state_.occupancy.cells) forEachBit(mask, [&](int) { ++cells; });
    if (drawn >= kEnough * cells && !isAskedFor(stage())) return;
    int stride = strideOfLooks(dataset_, state_.field);
    while (static_cast<double>(raysOfLooks(dataset_, stride)) > std::max(kMostLooks, kEnough * cells)) ++stride;
    markSeenCells(dataset_, state_.field, state_.occupancy, std::max(state_.min_seen, trace_.min_weight), stride, state_.seen);
}

/// Voxels become half as large where photographs resolve more than those of the last level will hold.
void Training::halveNearCameras() {
    constexpr int kFirstLevel = 1;      // before, haze stands where nothing is, and regions are smaller than leaves
    constexpr std::size_t kGrowth = 4;  // of leaves from level to level: surfaces
    const int level = place_.stages[place_.stage - 1].level;
    if (state_.min_seen <= 0 || keepsUnseen() || place_.has_asked_voxels || level < kFirstLevel) return;
    if (raysOf(place_.stages) < options_.rays_to_halve) return;
    Shells shells = state_.field.shells();
    // As if the plan went on to the finest voxels: one that does not has too few rays for small ones.
    shells.regions = resolvedRegions(dataset_, state_.field, state_.occupancy, state_.min_seen,
                                     std::ldexp(1.0, kMaxLevels - 1 - level));
    if (!shells.regions) return;
    Topology halved = halveRegions(state_.field.topology(), state_.field.shells(), shells);
    std::size_t leaves = halved.leafCount();  // before the last level
    for (int n = level + 1; n < place_.stages.back().level; ++n) leaves *= kGrowth;
    if (const std::size_t bytes = memoryPlan().refining(leaves, kGrowth * leaves); bytes > memoryLimit())
        return stayCoarse("near cameras voxels were not halved: with the levels to come they might need ", bytes);
    halveState(state_, std::move(halved), shells);
    const std::vector<std::uint8_t>& halvings = shells.regions->halvings;
    report_.info("regions: photographs resolve more in " +
                 std::to_string(std::count_if(halvings.begin(), halvings.end(), [](int n) { return n > 0; })) + " of " +
                 std::to_string(halvings.size()) + ", whose voxels are halved");
    step_seconds_ = 0;
    updateOccupancy();
}

/// Says why voxels stay as large as they are.
void Training::stayCoarse(const std::string& what, std::size_t bytes) {
    notes_.push_back(what + std::to_string(bytes >> 20) + " MiB, " +
                     (options_.max_memory_bytes ? "--max-memory allows " : "this machine has ") +
                     std::to_string(memoryLimit() >> 20));
    report_.warn(notes_.back());
}

void Training::refine() {
    updateOccupancy();
    halveNearCameras();
    std::vector<LeafMask> keep = state_.occupancy.cells;
    if (!keepsUnseen()) {
        if (isAskedFor(stage())) sharpen(kSharper);
        // Levels that were asked for have few rays in scenes of any kind.
        if (state_.min_seen > 0 || isAskedFor(place_.stages.back())) lookAgain();
        // There a look through all photographs decides; neighbours of what it met would be most of the voxels.
        const std::vector<LeafMask> seen = isAskedFor(stage()) ? state_.seen
                                                               : dilateCells(state_.field.topology(), state_.seen);
        for (std::size_t leaf = 0; leaf < keep.size(); ++leaf)
            for (int word = 0; word < kLeafWords; ++word) keep[leaf][word] &= seen[leaf][word];
    }
    const std::size_t leaves = state_.field.topology().leafCount();
    Topology fine = subdivide(state_.field.topology(), keep);
    if (const std::size_t bytes = memoryPlan().refining(leaves, fine.leafCount()); bytes > memoryLimit()) {
        stayCoarse("stayed at voxels of " + std::to_string(state_.field.frame().voxel_size) + ": finer ones need ", bytes);
        if (isAskedFor(stage()) && !keepsUnseen()) sharpen(-kSharper);
        return;
    }
    refineState(state_, std::move(fine));
    step_seconds_ = 0;
    updateOccupancy();
}

void Training::tell(bool force) {
    const double now = clock_.seconds();
    if (interval_.rays == 0 || (!force && now - last_told_ < kTellSeconds)) return;
    last_told_ = now;
    TrainProgress progress;
    progress.step = place_.step;
    progress.total_steps = totalSteps();
    progress.stage = static_cast<int>(place_.stage);
    const auto rays = static_cast<double>(interval_.rays);
    progress.loss = interval_.squared_error / (3 * rays);
    progress.psnr = psnrFromMse(progress.loss);
    progress.distortion = interval_.distortion / rays;
    progress.entropy = interval_.entropy / rays;
    progress.alpha_error = interval_.alpha_error / rays;
    progress.rays = place_.rays;
    progress.voxels = state_.field.topology().voxelCount();
    progress.seconds = now + options_.elapsed_s;
    progress.has_checkpoint = checkpoints_.hasFile();
    interval_ = {};
    if (on_interval_) on_interval_(progress);
    char note[64];
    std::snprintf(note, sizeof note, "%.2f dB, %.2f M voxels", progress.psnr,
                  static_cast<double>(progress.voxels) * 1e-6);
    report_.update(place_.step, note);
}

void Training::saveMeanwhile() {
    if (!checkpoints_.isDue()) return;
    const bool has_room =
        memoryPlan().training(state_.field.topology().leafCount()) + checkpointBytes(state_, place_) <= memoryLimit();
    checkpoints_.saveMeanwhile(state_, place_, has_room);
}

TrainResult Training::finish(bool interrupted) {
    checkpoints_.finish();
    tell(/*force=*/true);
    report_.end();
    TrainResult result;
    updateOccupancy();
    state_.density_moment = {};
    state_.feature_moment = {};
    Topology kept = prune(state_.field.topology(), state_.occupancy.cells);
    result.model.field = pruneField(std::move(state_.field), std::move(kept));
    result.model.decoder = state_.decoder;
    result.model.background = state_.background;
    result.model.sky = state_.sky;
    result.model.info.schedule = scheduleText(place_.stages);
    result.model.info.seed = place_.seed;
    result.model.info.train_psnr = psnrFromMse(place_.mean_error);
    result.model.cameras = modelCameras(dataset_, /*held_out=*/false);
    result.steps = place_.step;
    result.interrupted = interrupted;
    result.active_voxels = result.model.field.topology().voxelCount();
    result.gains = state_.exposures.gains();
    result.undone_steps = guard_.undone();
    result.numeric_error = numeric_error_;
    result.checkpoint_error = checkpoints_.error();
    result.checkpoints = checkpoints_.count();
    result.checkpoint_seconds = checkpoints_.haltedSeconds();
    if (const std::string nothing = nothingLearned(source_, place_.step, state_.background, place_.mean_error); !nothing.empty()) {
        notes_.push_back(nothing);
        report_.warn(nothing);
    }
    result.notes = notes_;
    if (photosOnDisk()) result.notes.push_back("photographs were read from a cache on disk, not from memory");
    return result;
}

}  // namespace

TrainResult train(const Dataset& dataset, const TrainOptions& options, Report& report,
                  const std::function<void(const TrainProgress&)>& on_interval,
                  const std::filesystem::path& checkpoint, bool resume) {
    for (const View& view : dataset.views)
        if (const std::string problem = cameraProblem(view.camera); !problem.empty())
            throw DataError(view.path.string() + ": camera: " + problem);
    Training training(dataset, options, report, on_interval, checkpoint);
    if (resume) training.resume();
    else training.start();
    return training.run();
}

}  // namespace nerfvdb
