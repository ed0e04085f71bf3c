// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_training.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>

#include "bench/scene.h"
#include "bench/scratch_folder.h"
#include "core/error.h"
#include "core/parallel.h"
#include "trainer/even_color.h"
#include "trainer/evaluate.h"
#include "trainer/possible_cells.h"
#include "trainer/schedule.h"
#include "trainer/train_step.h"
#include "trainer/trainer.h"
#include "vdb/model_file.h"
#include "vdb/renderer.h"

namespace nerfvdb {
namespace {

Dataset smallScene(const std::string& name, Report& report) {
    SyntheticDatasetOptions pictures;
    pictures.train_views = 10, pictures.val_views = 0, pictures.test_views = 1;
    pictures.width = pictures.height = 40;
    return proceduralScene(name, pictures, report).load(Split::train, report);
}

Dataset smallSphere(Report& report) { return smallScene("sphere", report); }

/// Everything that was learned, as bytes.
std::string bytesOf(const Model& model) {
    std::string bytes;
    const auto add = [&](const auto& values) {
        const auto raw = std::as_bytes(std::span(values));
        bytes.append(reinterpret_cast<const char*>(raw.data()), raw.size());
    };
    add(model.field.topology().leafCoords());
    add(model.field.topology().cells());
    add(model.field.density());
    add(model.field.features());
    add(model.decoder.parameters());
    return bytes;
}

bool isFinite(const Model& model) {
    const auto holds = [](std::span<const float> values) {
        return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
    };
    return holds(model.field.density()) && holds(model.field.features()) && holds(model.decoder.parameters()) &&
           model.background.allFinite();
}

TrainOptions shortTraining(std::int64_t steps) {
    TrainOptions options;
    options.preset = Preset::fast;
    options.steps = {steps};
    return options;
}

/// A field half transparent everywhere, over the sphere, and what it takes to learn.
TrainState freshState(const Dataset& dataset) {
    const BoxGrid grid = gridOver({Vec3d::Constant(-0.9), Vec3d::Constant(0.9)}, 32);
    TrainState state;
    state.decoder = Decoder(8, 3, 64);
    state.field = VoxelField(Topology(grid.dims, possibleCells(dataset, grid, 2)), grid.frame, 8, 140.0);
    std::fill(state.field.density().begin(), state.field.density().end(), -3.0f);
    state.density_moment = HugeArray<float>(state.field.density().size());
    state.feature_moment = HugeArray<float>(state.field.density().size());
    state.seen.assign(state.field.topology().leafCount(), {});
    state.occupancy = findOccupied(state.field, 0.0f);
    return state;
}

Model untrainedModel(const Dataset& dataset) {
    TrainState state = freshState(dataset);
    Model model;
    model.field = std::move(state.field);
    model.decoder = state.decoder;
    return model;
}

/// Mean squared error of the last ten of `n` steps at rates of `factor` times the usual, as a share of a one-coloured
/// picture's; nothing if not finite.
std::optional<double> learnAtRates(const Dataset& dataset, float factor, int n) {
    TrainState state = freshState(dataset);
    RaySource source(dataset, 11);
    source.update(state.field, state.occupancy);
    TrainStepper stepper;
    double sum = 0;
    for (int step = 0; step < n; ++step) {
        StepRates rates;
        const float all = factor * static_cast<float>(rateFactor(static_cast<double>(step) / n));
        rates.density *= all, rates.features *= all, rates.network *= all;
        const StepReport report = stepper.step(state, source, static_cast<std::uint64_t>(step), 300, rates, {});
        if (!report.is_finite) return std::nullopt;
        if (step >= n - 10) sum += report.squared_error / (3.0 * 300 * 10);
    }
    // Pixels that show the background alone count in both.
    return sum / evenColorError(source, static_cast<std::uint64_t>(n), state.background);
}

/// A data set of constant pictures.
Dataset painted(Dataset dataset, std::array<std::uint8_t, 4> rgba) {
    dataset.has_alpha = rgba[3] < 255;
    for (View& view : dataset.views) {
        view.photo.has_alpha = dataset.has_alpha;
        std::fill(view.photo.pixels.begin(), view.photo.pixels.end(), rgba);
    }
    return dataset;
}

Dataset onePixel(Dataset dataset) {
    for (View& view : dataset.views) {
        const std::size_t middle =
            view.photo.pixels.size() / 2 + static_cast<std::size_t>(view.photo.width) / 2;
        view.photo.pixels = {view.photo.pixels[middle]};
        view.photo.width = view.photo.height = 1;
        view.camera = resized(view.camera, 1, 1);
    }
    return dataset;
}

/// The same pictures with linear values up to 1e4, through an .exr on disk.
Dataset brightened(Dataset dataset, const std::filesystem::path& scratch) {
    const ScratchFolder folder(scratch);
    for (std::size_t v = 0; v < dataset.views.size(); ++v) {
        Photo& photo = dataset.views[v].photo;
        Image image(photo.width, photo.height, 4);
        for (std::size_t i = 0; i < photo.pixels.size(); ++i) {
            for (int c = 0; c < 3; ++c)
                image.pixels[4 * i + static_cast<std::size_t>(c)] =
                    photo.pixels[i][static_cast<std::size_t>(c)] > 128 ? 1e4f : 0.01f;
            image.pixels[4 * i + 3] = static_cast<float>(photo.pixels[i][3]) / 255;
        }
        const std::filesystem::path path = folder / (std::to_string(v) + ".exr");
        writeImage(path, image);
        photo = readPhoto(path);
    }
    return dataset;
}

/// Trains; a sentence of what came of it goes to the row.
class InputJudge {
public:
    explicit InputJudge(Report& report) : report_(report) {}

    /// Must learn, to `least_db` on its own rays where there are kEnoughSteps.
    void learns(const std::string& name, const Dataset& dataset, const TrainOptions& options, double least_db) {
        train(name, dataset, options, [&](const TrainResult& result) {
            const double db = result.model.info.train_psnr;
            return isFinite(result.model) && std::isfinite(db) && (result.steps < kEnoughSteps || db >= least_db);
        });
    }

    /// Must end with one of the house's errors that says `word`.
    void stops(const std::string& name, const Dataset& dataset, const TrainOptions& options, const std::string& word) {
        train(name, dataset, options, [](const TrainResult&) { return false; }, word);
    }

    /// Nothing can be learned, which only a person could know before: the training must say so at its end.
    void warns(const std::string& name, const Dataset& dataset, TrainOptions options, const std::string& word) {
        options.steps = {500};
        train(name, dataset, options, [&](const TrainResult& result) {
            const auto says = [&](const std::string& note) { return note.find(word) != std::string::npos; };
            return isFinite(result.model) && std::any_of(result.notes.begin(), result.notes.end(), says);
        });
    }

    /// `enter` must throw one of the house's errors, and name `place`.
    template <typename Enter>
    void refuse(const std::string& name, const std::string& place, const Enter& enter) {
        StressRow row("bad input", name, "");
        try {
            enter();
            row.reason = "was taken";
            row.check(false, [] { return std::string("was taken"); });
        } catch (const Error& error) {
            row.reason = std::string("refused: ") + error.what();
            row.check(std::string(error.what()).find(place) != std::string::npos, [&] { return row.reason; });
        }
        rows_.push_back(row);
    }

    const std::vector<StressRow>& rows() const { return rows_; }

private:
    void train(const std::string& name, const Dataset& dataset, const TrainOptions& options,
               const std::function<bool(const TrainResult&)>& holds, const std::string& word = {}) {
        StressRow row("hard input", name, "");
        try {
            Report silent;
            const TrainResult result = nerfvdb::train(dataset, options, silent, {});
            char text[96];
            std::snprintf(text, sizeof text, "learned: %.1f dB on its own rays, %zu voxels",
                          result.model.info.train_psnr, result.active_voxels);
            row.reason = text;
            for (const std::string& note : result.notes) row.reason += "; " + note;
            row.check(holds(result), [&] { return row.reason; });
        } catch (const Error& error) {
            row.reason = std::string("stopped: ") + error.what();
            row.check(!word.empty() && row.reason.find(word) != std::string::npos, [&] { return row.reason; });
        } catch (const std::exception& error) {
            row.reason = std::string("not one of the house's errors: ") + error.what();
            row.check(false, [&] { return row.reason; });
        }
        rows_.push_back(row);
        report_.update(static_cast<std::int64_t>(rows_.size()), name);
    }

    Report& report_;
    std::vector<StressRow> rows_;
};

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

}  // namespace

std::vector<StressRow> stressDeterminism(Report& report) {
    const Dataset dataset = smallSphere(report);
    constexpr std::int64_t kSteps = 60;
    report.begin("determinism", 4);
    StressRow same("training", "other bytes of a model on 1, 2, 4 threads, and again",
                   "none: sums have one order");
    std::string first;
    int done = 0;
    for (const int threads : {1, 2, 4, 2}) {
        const ThreadLimit limit(threads);
        Report silent;
        const std::string bytes = bytesOf(train(dataset, shortTraining(kSteps), silent, {}).model);
        if (first.empty())
            first = bytes;
        else
            same.check(bytes == first, [&] { return std::to_string(threads) + " threads"; });
        report.update(++done, std::to_string(threads) + " threads");
    }
    constexpr int kRateSteps = 150;
    StressRow fast("training", "squared error at learning rates 10 times too high, as a share of a one-coloured picture's",
                   "sphere, glossy, thin, shell: it learns less, but it learns");
    for (const char* name : {"sphere", "glossy", "thin", "shell"}) {
        const std::optional<double> share = learnAtRates(smallScene(name, report), 10, kRateSteps);
        fast.add(share.value_or(std::numeric_limits<double>::quiet_NaN()), 1, [&] { return std::string(name); });
    }
    report.end();
    return {same, fast};
}

std::vector<StressRow> stressInput(const std::filesystem::path& scratch, std::int64_t steps, Report& report) {
    const TrainOptions usual = shortTraining(steps);
    const Dataset sphere = smallSphere(report);
    InputJudge judge(report);
    report.begin("hard input", 0);
    const std::string no_object = "alpha masks that agree on no point", no_view = "no point of the scene's box in view of two";
    judge.learns("all black", painted(sphere, {0, 0, 0, 255}), usual, 22);
    judge.learns("all white", painted(sphere, {255, 255, 255, 255}), usual, 22);
    judge.learns("one colour everywhere", painted(sphere, {200, 30, 90, 255}), usual, 26);
    judge.stops("fully transparent", painted(sphere, {90, 90, 90, 0}), usual, no_object);
    judge.learns("one percent opaque everywhere", painted(sphere, {90, 90, 90, 3}), usual, 24);
    {
        Dataset one = sphere;
        one.views.resize(1);
        judge.learns("one image", one, usual, 28);
        judge.stops("one image of one pixel", onePixel(one), usual, no_object);
        Dataset none = sphere;
        none.views.clear();
        judge.stops("no image", none, usual, "no views");
    }
    judge.stops("images of one pixel", onePixel(sphere), usual, no_object);
    judge.learns("linear values of 1e4 (.exr)", brightened(sphere, scratch), usual, 25);
    {
        Dataset twins = sphere;
        twins.views.insert(twins.views.end(), sphere.views.begin(), sphere.views.end());
        judge.learns("every camera twice", twins, usual, 28);
        for (View& view : twins.views) view.camera = sphere.views.front().camera;
        judge.stops("one camera for all pictures", twins, usual, no_object);
    }
    {
        Dataset inside = sphere;
        for (View& view : inside.views) view.camera.position *= 0.05;
        judge.learns("cameras inside the object", inside, usual, 28);
        inside = painted(inside, {120, 90, 60, 255});
        judge.learns("cameras inside the object, no alpha", inside, usual, 30);
        Dataset outward = sphere;
        for (View& view : outward.views) view.camera.position = -view.camera.position;
        judge.stops("cameras that look away from the object", outward, usual, no_object);
    }
    const auto bounded = [&](double low, double high) {
        TrainOptions options = usual;
        options.bounds = Box{Vec3d::Constant(low), Vec3d::Constant(high)};
        return options;
    };
    judge.warns("bounds a thousandth of the object", sphere, bounded(-1e-3, 1e-3), "nothing was learned");
    judge.stops("bounds a million times the object", sphere, bounded(-1e6, 1e6), no_view);
    judge.stops("bounds beside the object", sphere, bounded(100, 101), no_view);
    judge.stops("bounds behind the cameras", sphere, bounded(5, 6), no_view);
    {
        Dataset scaled = sphere;
        for (View& view : scaled.views) view.camera.position *= 1e6;
        judge.warns("cameras a million times too far", scaled, bounded(-1, 1), "nothing was learned");
    }
    {
        Dataset shifted = sphere;
        for (View& view : shifted.views) view.camera.position += Vec3d::Constant(1e7);
        judge.learns("a scene at 1e7", shifted, usual, 28);
    }
    report.end();

    const double nan = std::numeric_limits<double>::quiet_NaN(),
                 infinity = std::numeric_limits<double>::infinity();
    judge.refuse("a camera of NaN to learn from", sphere.views[3].path.string(), [&] {
        Dataset bad = sphere;
        bad.views[3].camera.position.x() = nan;
        Report silent;
        train(bad, usual, silent, {});
    });
    judge.refuse("an infinite focal length to learn from", sphere.views[2].path.string(), [&] {
        Dataset bad = sphere;
        bad.views[2].camera.fx = infinity;
        Report silent;
        train(bad, usual, silent, {});
    });
    judge.refuse("a box of NaN", "--bounds", [&] {
        Report silent;
        train(sphere, bounded(nan, 1), silent, {});
    });
    const Model model = untrainedModel(sphere);
    judge.refuse("a camera of NaN to render from", "camera", [&] {
        Camera camera = sphere.views.front().camera;
        camera.world_from_camera(0, 0) = nan;
        Renderer(model, {}).render(camera);
    });
    for (const float step : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()})
        judge.refuse(std::string("samples ") +
                         (step == 0  ? "0"
                          : step < 0 ? "-1"
                                     : "NaN") +
                         " voxels apart",
                     "step", [&] {
                         RenderOptions options;
                         options.trace.step_voxels = step;
                         Renderer(model, options).render(sphere.views.front().camera);
                     });
    const ScratchFolder folder(scratch);
    const auto save = [&](const char* name, const char* place, const std::function<void(Model&)>& spoil) {
        judge.refuse(name, place, [&] {
            Model bad = untrainedModel(sphere);
            spoil(bad);
            saveModel(bad, folder / "bad.vdb");
        });
    };
    const float nan_float = std::numeric_limits<float>::quiet_NaN();
    save("a model with a feature of NaN", "nan", [&](Model& bad) {
        for (float& value : bad.field.features()) value = nan_float;
    });
    save("a model with a density of NaN", "nan", [&](Model& bad) {
        for (float& value : bad.field.density()) value = nan_float;
    });
    save("a model with a weight of NaN", "decoder",
         [&](Model& bad) { bad.decoder.parameters()[7] = nan_float; });
    save("a background of NaN", "background", [&](Model& bad) { bad.background[1] = nan_float; });
    judge.refuse("a photograph with a pixel of NaN", "nan.exr", [&] {
        Image image(4, 4, 3);
        image.pixels[17] = nan_float;
        writeImage(folder / "nan.exr", image);
        readPhoto(folder / "nan.exr");
    });
    // Where the images lay for a moment is nobody's business.
    std::vector<StressRow> rows = judge.rows();
    const std::string place = (folder / "").string();
    for (StressRow& row : rows)
        if (const std::size_t at = row.reason.find(place); at != std::string::npos)
            row.reason.erase(at, place.size());
    return rows;
}

std::vector<StressRow> stressSeeds(const SeedStressOptions& options, Report& report) {
    SyntheticDatasetOptions pictures;
    pictures.train_views = pictures.test_views = options.views, pictures.val_views = 0;
    pictures.width = pictures.height = options.size;
    std::vector<StressRow> rows;
    for (const std::string& name : options.scenes) {
        const BenchScene scene = proceduralScene(name, pictures, report);
        const Dataset learned = scene.load(Split::train, report), held_out = scene.load(Split::test, report);
        report.begin(name, options.seeds);
        std::vector<double> scores;
        for (int seed = 1; seed <= options.seeds; ++seed) {
            if (report.cancelled()) throw Interrupted("stopped between seeds, as asked");
            TrainOptions training;
            training.steps = {options.steps};  // with the network of the default preset, as users have it
            training.seed = static_cast<std::uint64_t>(seed);
            Report silent;
            const TrainResult result = train(learned, training, silent, {});
            scores.push_back(evaluate(result.model, held_out, {}, silent).psnr);
            report.update(seed, name);
        }
        report.end();
        const double middle = median(scores);
        char reason[160];
        std::snprintf(reason, sizeof reason,
                      "asked for; median %.2f dB, lowest %.2f, highest %.2f after %lld steps", middle,
                      *std::min_element(scores.begin(), scores.end()),
                      *std::max_element(scores.begin(), scores.end()), static_cast<long long>(options.steps));
        StressRow row("seeds", name + ": distance from the median, dB", reason);
        for (std::size_t i = 0; i < scores.size(); ++i)
            row.add(std::abs(scores[i] - middle), 0.3, [&] { return "seed " + std::to_string(i + 1); });
        rows.push_back(row);
    }
    return rows;
}

}  // namespace nerfvdb
