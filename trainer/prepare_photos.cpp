// SPDX-License-Identifier: Apache-2.0
#include "trainer/prepare_photos.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <fstream>
#include <span>
#include <sstream>

#include "core/atomic_file.h"
#include "core/child_process.h"
#include "core/error.h"
#include "core/parallel.h"
#include "trainer/colmap_output.h"
#include "trainer/json_node.h"
#include "trainer/photo_folder.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;
using Line = ColmapLine::Kind;

constexpr std::size_t kLastLines = 8;  // told of a program that failed
constexpr std::size_t kNamesTold = 10;
constexpr double kFewFeatures = 400;  // of a photograph; two that overlap by a half then share some tens
constexpr const char* kMapperAdvice =
    "photographs may overlap too little, be blurred or too smooth; where not all pairs were matched, --matching "
    "exhaustive finds more";

/// Where things lie in the data set.
struct Layout {
    explicit Layout(const fs::path& folder)
        : out(folder),
          images(out / "images"),
          sparse(out / "sparse"),
          colmap(out / "colmap"),
          database(colmap / "database.db"),
          models(colmap / "models"),
          list(colmap / "photographs.txt"),
          state(colmap / "prepare.json") {}
    fs::path out, images, sparse, colmap, database, models, list, state;
};

// ---- What is done ----

/// prepare.json: the phases that are done, and what they were done with.
struct State {
    std::string photos;  // hash of names and sizes
    std::string camera, camera_model;
    int max_size = 0, max_features = 0;
    bool has_features = false;
    double features = 0;   // of a photograph, mean; 0: not known
    std::string matching;  // that was done; empty: none
    bool is_mapped = false;
};

State readState(const fs::path& path) {
    State state;
    if (!fs::exists(path)) return state;
    const Json json = parseJsonFile(path);
    const JsonNode node(json, path);
    state.photos = node.at("photos").text();
    state.camera = node.at("camera").text();
    state.camera_model = node.at("camera_model").text();
    state.max_size = node.at("max_size").wholeNumber(0, 1 << 30);
    state.max_features = node.at("max_features").wholeNumber(0, 1 << 30);
    state.has_features = node.at("has_features").isTrue();
    state.features = node.at("features").number();
    state.matching = node.at("matching").text();
    state.is_mapped = node.at("is_mapped").isTrue();
    return state;
}

void writeState(const fs::path& path, const State& state) {
    const Json json = {{"photos", state.photos},           {"camera", state.camera},
                       {"camera_model", state.camera_model}, {"max_size", state.max_size},
                       {"max_features", state.max_features}, {"has_features", state.has_features},
                       {"features", state.features},       {"matching", state.matching},
                       {"is_mapped", state.is_mapped}};
    writeAtomically(path, json.dump(1) + "\n");
}

std::string hashOfPhotos(const fs::path& folder, const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += name + '\0' + std::to_string(fs::file_size(folder / name)) + '\n';
    return contentHash(std::as_bytes(std::span(text.data(), text.size())));
}

/// The folder may hold other pictures too.
void writeNames(const fs::path& path, const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += name + '\n';
    writeAtomically(path, text);
}

[[noreturn]] void refuse(const fs::path& place, const std::string& found, const std::string& expected) {
    throw DataError(place.string(), found, expected, "choose another --out, or --force to begin this one anew");
}

/// What lies there already may be somebody's work: only what prepare made is gone on with or, with force, removed.
void checkOut(const Layout& layout, bool force) {
    for (const char* name : {"transforms.json", "transforms_train.json", "poses_bounds.npy"})
        if (fs::exists(layout.out / name))
            throw DataError((layout.out / name).string(), "a data set that has its poses already",
                            "a folder without poses", "choose another --out");
    if (force) {
        fs::remove_all(layout.sparse);
        fs::remove_all(layout.colmap);
    }
    if (fs::exists(layout.sparse) && !fs::exists(layout.state))
        refuse(layout.sparse, "a COLMAP model of another origin", "a folder without one");
}

/// Features and matches belong to the photographs and options that they were made with.
void checkState(const Layout& layout, const State& before, const State& now) {
    if (before.photos.empty()) return;
    const auto differ = [&](const std::string& what, const std::string& was, const std::string& is) {
        if (was != is) refuse(layout.colmap, "work begun with " + what + " " + was, "the same as now, " + is);
    };
    if (before.photos != now.photos)
        refuse(layout.colmap, "work begun on other photographs", "the same as now");
    differ("--camera", before.camera, now.camera);
    differ("--camera-model", before.camera_model, now.camera_model);
    differ("--max-size", std::to_string(before.max_size), std::to_string(now.max_size));
    differ("--max-features", std::to_string(before.max_features), std::to_string(now.max_features));
    if (before.is_mapped && before.matching != now.matching)
        refuse(layout.sparse, "a finished model by " + before.matching + " matching", now.matching + " matching");
}

// ---- Running COLMAP ----

/// Runs its sub-commands, one log for each.
class Colmap {
public:
    Colmap(const Layout& layout, Report& report) : layout_(layout), report_(report) {
        const std::optional<fs::path> program = findProgram("colmap");
        if (!program)
            throw IoError("colmap", "no such program on PATH", "COLMAP, which finds where photographs were taken",
                          "sudo apt install colmap");
        program_ = *program;
    }

    /// The first of several names of an option that this COLMAP knows: they changed between versions. Empty: none.
    std::string option(const std::string& command, std::initializer_list<const char*> names) {
        if (command != help_of_) {
            std::vector<std::string> help;
            runChild(this->command({command, "--help"}), [&](std::string_view line) { help.emplace_back(line); },
                     [&] { return report_.cancelled(); });
            options_ = colmapOptions(help);
            help_of_ = command;
        }
        for (const char* name : names)
            if (std::find(options_.begin(), options_.end(), name) != options_.end()) return name;
        return {};
    }

    /// Runs a sub-command to its good end. `stopped` says what is kept when the report asks to stop.
    void run(const std::vector<std::string>& words, const std::string& log_name,
             const std::function<void(std::string_view)>& listen, const std::string& stopped) {
        const fs::path log_path = layout_.colmap / (log_name + ".log");
        std::ofstream log(log_path, std::ios::app);
        for (const std::string& word : words) log << word << ' ';
        log << '\n';
        std::deque<std::string> last;
        const ChildEnd end = runChild(
            command(words),
            [&](std::string_view line) {
                log << line << '\n' << std::flush;
                if (line.find_first_not_of(" =\t") == std::string_view::npos) return;
                last.emplace_back(line);
                if (last.size() > kLastLines) last.pop_front();
                listen(line);
            },
            [&] { return report_.cancelled(); });
        // Ctrl-C reaches the child too: it may be gone before it is told.
        if (end.is_stopped || report_.cancelled()) throw Interrupted(stopped + "; the same command goes on");
        if (end.isGood()) return;
        report_.end();
        for (const std::string& line : last) report_.info("  colmap: " + line);
        fail(words.front(), end, log_path);
    }

private:
    ChildCommand command(std::vector<std::string> words) const {
        // Its Qt would look for a display, even where nothing is shown.
        return {program_, std::move(words), {"QT_QPA_PLATFORM=offscreen"}};
    }

    [[noreturn]] static void fail(const std::string& command, const ChildEnd& end, const fs::path& log_path) {
        constexpr int kKilled = 9;
        const std::string how =
            end.signal ? "signal " + std::to_string(end.signal) : "exit code " + std::to_string(end.exit_code);
        const char* advice = end.signal == kKilled ? "memory may have run out: try --max-size 1000 or --threads 1"
                             : command == "mapper" ? kMapperAdvice
                                                   : "see the log";
        throw DataError(log_path.string(), "that 'colmap " + command + "' ended with " + how, "a good end", advice);
    }

    const Layout& layout_;
    Report& report_;
    fs::path program_;
    std::string help_of_;
    std::vector<std::string> options_;
};

double secondsSince(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Adds `--NAME VALUE` where this COLMAP knows the option under one of its names.
void addOption(std::vector<std::string>& words, Colmap& colmap, std::initializer_list<const char*> names, int value) {
    const std::string name = colmap.option(words.front(), names);
    if (!name.empty()) words.insert(words.end(), {"--" + name, std::to_string(value)});
}

// ---- The phases ----

/// Mean number of features of a photograph, of those that this run looked at; 0 when it looked at none.
double findFeatures(Colmap& colmap, const Layout& layout, const PrepareOptions& options, const CapturePlan& plan,
                    std::size_t n_photos, Report& report) {
    report.begin("features", static_cast<std::int64_t>(n_photos));
    const char* sharing = plan.camera == CameraSharing::shared ? "--ImageReader.single_camera"
                                                               : "--ImageReader.single_camera_per_image";
    std::vector<std::string> words{"feature_extractor", "--database_path", layout.database.string(),
                                   "--image_path", layout.images.string(),
                                   "--image_list_path", layout.list.string(),
                                   "--ImageReader.camera_model", options.camera_model, sharing, "1"};
    addOption(words, colmap, {"SiftExtraction.use_gpu", "FeatureExtraction.use_gpu"}, 0);
    addOption(words, colmap, {"SiftExtraction.num_threads", "FeatureExtraction.num_threads"}, threadCount());
    addOption(words, colmap, {"SiftExtraction.max_image_size", "FeatureExtraction.max_image_size"}, options.max_size);
    addOption(words, colmap, {"SiftExtraction.max_num_features"}, options.max_features);
    double features = 0;
    std::int64_t n_counted = 0;
    colmap.run(
        words, "features",
        [&](std::string_view line) {
            const std::optional<ColmapLine> told = parseColmapLine(line);
            if (!told) return;
            if (told->kind == Line::features) features += static_cast<double>(told->done), ++n_counted;
            if (told->kind == Line::file_done) {
                report.replan(told->total);
                report.update(told->done, "");
            }
        },
        "stopped while finding features, which are kept");
    report.end();
    return n_counted > 0 ? features / static_cast<double>(n_counted) : 0;
}

void matchFeatures(Colmap& colmap, const Layout& layout, const CapturePlan& plan, std::size_t n_photos,
                   Report& report) {
    report.begin("matching", 0);
    std::vector<std::string> words{std::string(nameOf(plan.matching)) + "_matcher", "--database_path",
                                   layout.database.string()};
    addOption(words, colmap, {"SiftMatching.use_gpu", "FeatureMatching.use_gpu"}, 0);
    addOption(words, colmap, {"SiftMatching.num_threads", "FeatureMatching.num_threads"}, threadCount());
    if (plan.matching == Matching::exhaustive) {
        // It tells of each block of pairs: small blocks show progress, but the last pair of each keeps one core busy.
        const int block = std::clamp(static_cast<int>(n_photos) / 8, 4 + threadCount() / 4, 50);
        addOption(words, colmap, {"ExhaustiveMatching.block_size"}, block);
    } else if (plan.matching == Matching::sequential) {
        addOption(words, colmap, {"SequentialMatching.overlap"}, kSequentialOverlap);
        addOption(words, colmap, {"SequentialMatching.quadratic_overlap"}, 1);
    } else {
        addOption(words, colmap, {"SpatialMatching.max_num_neighbors"}, kSpatialNeighbours);
    }
    colmap.run(
        words, "matching",
        [&](std::string_view line) {
            const std::optional<ColmapLine> told = parseColmapLine(line);
            if (!told || (told->kind != Line::block_done && told->kind != Line::image_matched)) return;
            report.replan(told->total);
            report.update(told->done, "");
        },
        "stopped while matching; pairs that are matched are kept");
    report.end();
}

/// Models go to their place when all are written, the largest first.
void placeCameras(Colmap& colmap, const Layout& layout, std::size_t n_photos, Report& report) {
    report.begin("mapping", static_cast<std::int64_t>(n_photos));
    fs::remove_all(layout.models);
    fs::create_directories(layout.models);
    std::vector<std::string> words{"mapper",         "--database_path",      layout.database.string(), "--image_path",
                                   layout.images.string(), "--output_path", layout.models.string()};
    addOption(words, colmap, {"Mapper.num_threads"}, threadCount());
    int n_models = 0;
    colmap.run(
        words, "mapping",
        [&](std::string_view line) {
            const std::optional<ColmapLine> told = parseColmapLine(line);
            if (!told || (told->kind != Line::model_begun && told->kind != Line::image_registered)) return;
            n_models += told->kind == Line::model_begun;
            report.update(told->done, n_models > 1 ? "attempt " + std::to_string(n_models) : "");
        },
        "stopped while mapping, which will begin anew on the matches that are kept");
    const std::vector<ColmapModel> models = listColmapModels(layout.models);
    if (models.empty())
        throw DataError((layout.colmap / "mapping.log").string(), "that 'colmap mapper' made no model", "at least one",
                        kMapperAdvice);
    const fs::path ordered = layout.colmap / "sparse";
    fs::remove_all(ordered);
    fs::create_directories(ordered);
    for (std::size_t i = 0; i < models.size(); ++i) fs::rename(models[i].folder, ordered / std::to_string(i));
    fs::remove_all(layout.sparse);
    fs::rename(ordered, layout.sparse);
    fs::remove_all(layout.models);
    report.end();
}

/// "Mean reprojection error: 0.509961px", if COLMAP says so.
std::optional<double> reprojectionError(Colmap& colmap, const Layout& layout) {
    std::optional<double> error;
    colmap.run(
        {"model_analyzer", "--path", (layout.sparse / "0").string()}, "mapping",
        [&](std::string_view line) {
            constexpr std::string_view kWords = "Mean reprojection error: ";
            const std::size_t at = line.find(kWords);
            double value = 0;
            if (at != std::string_view::npos &&
                std::istringstream(std::string(line.substr(at + kWords.size()))) >> value)
                error = value;
        },
        "stopped after mapping");
    return error;
}

// ---- Saying it ----

std::string joined(const std::vector<std::string>& names) {
    std::string text;
    for (std::size_t i = 0; i < std::min(names.size(), kNamesTold); ++i) text += (i > 0 ? ", " : "") + names[i];
    if (names.size() > kNamesTold) text += " and " + std::to_string(names.size() - kNamesTold) + " more";
    return text;
}

std::vector<PhotoOrigin> readOrigins(const fs::path& folder, const std::vector<std::string>& names) {
    std::vector<PhotoOrigin> origins;
    for (const std::string& name : names) origins.push_back(readPhotoOrigin(folder / name));
    return origins;
}

void tellPlan(const std::vector<PhotoOrigin>& origins, const CapturePlan& plan, const State& state, int threads,
              Report& report) {
    const PhotoOrigin& first = origins.front();
    report.info(std::to_string(origins.size()) + " photographs, the first of " + std::to_string(first.width) + "x" +
                std::to_string(first.height) + "; " +
                (plan.camera == CameraSharing::shared ? "one camera for all" : "a camera for each") + " (" +
                plan.camera_reason + ")");
    report.info(std::string("matching: ") + nameOf(plan.matching) + ", " +
                (plan.matching == Matching::spatial ? "at most " : "") + std::to_string(plan.pairs) + " pairs (" +
                plan.matching_reason + ")");
    if (state.has_features) return;
    report.info("on " + std::to_string(threads) + (threads == 1 ? " core" : " cores") + ": features " + roughTime(plan.features_seconds) + ", matching " +
                roughTime(plan.matching_seconds) +
                ", then mapping, mostly shorter than both");
    constexpr double kLong = 3600;
    if (plan.matching == Matching::exhaustive && plan.matching_seconds > kLong)
        report.warn("matching all pairs will take long; names numbered in the order of taking allow --matching "
                    "sequential, and --max-features 2000 is about three times faster");
}

void tellResult(const PreparedPhotos& result, Report& report) {
    if (result.model_sizes.size() > 1) {
        std::string sizes;
        for (const std::size_t size : result.model_sizes) sizes += (sizes.empty() ? "" : ", ") + std::to_string(size);
        report.warn("the photographs fell apart into " + std::to_string(result.model_sizes.size()) + " models (of " +
                    sizes + " photographs); sparse/0, the largest, is what is trained on");
    }
    if (!result.unregistered.empty())
        report.warn(std::to_string(result.unregistered.size()) + " of " + std::to_string(result.photos) +
                    " photographs have no camera in it: " + joined(result.unregistered));
}

PreparedPhotos prepare(const fs::path& images, const fs::path& out, const PrepareOptions& options, Report& report) {
    const Layout layout(out);
    const std::vector<std::string> names = listPhotos(images, report);
    Colmap colmap(layout, report);
    const std::vector<PhotoOrigin> origins = readOrigins(images, names);
    const int threads = threadCount();

    PreparedPhotos result;
    result.photos = names.size();
    result.plan = planCapture(names, origins, options, threads);
    checkOut(layout, options.force);
    State state = readState(layout.state);
    const State now{hashOfPhotos(images, names),
                    result.plan.camera == CameraSharing::shared ? "shared" : "per-image",
                    options.camera_model,
                    options.max_size,
                    options.max_features,
                    false,
                    0,
                    nameOf(result.plan.matching),
                    false};
    checkState(layout, state, now);
    tellPlan(origins, result.plan, state, threads, report);

    placePhotos(images, names, layout.images, report);
    fs::create_directories(layout.colmap);
    writeNames(layout.list, names);
    if (state.photos.empty()) {
        state = now;
        state.matching.clear();
        writeState(layout.state, state);
    }
    if (!state.has_features) {
        const auto begin = Clock::now();
        state.features = findFeatures(colmap, layout, options, result.plan, names.size(), report);
        state.has_features = true;
        if (state.features > 0 && state.features < kFewFeatures)
            report.warn("only " + std::to_string(static_cast<long long>(state.features)) +
                        " features in a photograph: smooth, dark or blurred ones give COLMAP little to hold on to");
        writeState(layout.state, state);
        result.seconds.features = secondsSince(begin);
    }
    if (state.matching != now.matching) {
        const auto begin = Clock::now();
        if (state.features > 0) {
            result.predicted_matching_seconds = matchingSeconds(result.plan.pairs, state.features, threads);
            report.info(std::to_string(static_cast<long long>(state.features)) +
                        " features in a photograph: matching will take " +
                        roughTime(result.predicted_matching_seconds));
        }
        matchFeatures(colmap, layout, result.plan, names.size(), report);
        state.matching = now.matching;
        writeState(layout.state, state);
        result.seconds.matching = secondsSince(begin);
    }
    if (!state.is_mapped || !fs::exists(layout.sparse)) {
        const auto begin = Clock::now();
        placeCameras(colmap, layout, names.size(), report);
        state.is_mapped = true;
        writeState(layout.state, state);
        result.seconds.mapping = secondsSince(begin);
    }

    const std::vector<ColmapModel> models = listColmapModels(layout.sparse);
    if (models.empty()) refuse(layout.sparse, "no model", "those that mapping left there");
    for (const ColmapModel& model : models) result.model_sizes.push_back(model.registered.size());
    result.points = models.front().points;
    std::set_difference(names.begin(), names.end(), models.front().registered.begin(), models.front().registered.end(),
                        std::back_inserter(result.unregistered));
    result.reprojection_error = reprojectionError(colmap, layout);
    tellResult(result, report);
    return result;
}

}  // namespace

PreparedPhotos preparePhotos(const fs::path& images, const fs::path& out, const PrepareOptions& options,
                             Report& report) {
    try {
        return prepare(images, out, options, report);
    } catch (const fs::filesystem_error& error) {
        throw IoError(error.path1().string(), error.code().message(), "files that can be read and written",
                      "check permissions and the room on the disk");
    }
}

}  // namespace nerfvdb
