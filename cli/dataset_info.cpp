// SPDX-License-Identifier: Apache-2.0
#include "cli/dataset_info.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "bench/capture_plot.h"
#include "cli/text.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "trainer/capture_report.h"
#include "trainer/dataset.h"
#include "trainer/plain_background.h"
#include "trainer/scene_box.h"
#include "trainer/scene_shells.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kPhotosRead = 10;  // of a split, to say what it shows

/// Reads the split without pictures; an absent one gives nothing, unless it is the one that training needs.
std::optional<Dataset> readSplit(const std::filesystem::path& path, Split split) {
    Report silent;  // warnings are part of the answer here
    try {
        Dataset dataset = readDataset(path, split, {.strict = false, .load_photos = false, .check_poses = false}, silent);
        dataset.has_alpha = isTransparent(dataset, kPhotosRead);
        return dataset;
    } catch (const Error&) {
        if (split == Split::train) throw;
        return std::nullopt;
    }
}

bool haveSameViews(const Dataset& a, const Dataset& b) {
    return std::equal(a.views.begin(), a.views.end(), b.views.begin(), b.views.end(),
                      [](const View& u, const View& v) { return u.path == v.path; });
}

/// Reads like the data set's own file: relative to it.
std::string nameOf(const View& view, const std::filesystem::path& root) {
    const std::filesystem::path folder = std::filesystem::is_directory(root) ? root : root.parent_path();
    const std::filesystem::path relative = view.path.lexically_relative(folder);
    return relative.empty() || *relative.begin() == ".." ? view.path.string() : relative.generic_string();
}

std::vector<CaptureView> captureViews(const Dataset& dataset, bool held_out) {
    std::vector<CaptureView> views;
    for (const View& view : dataset.views) views.push_back({nameOf(view, dataset.root), view.camera, held_out});
    return views;
}

/// "60 of 800x800", or "60 of 800x800, 2 of 801x800".
std::string sizesText(const std::vector<SizeCount>& sizes) {
    constexpr std::size_t kMost = 3;
    std::string text;
    for (std::size_t i = 0; i < std::min(sizes.size(), kMost); ++i)
        text += formatted("%s%zu of %dx%d", i > 0 ? ", " : "", sizes[i].views, sizes[i].width, sizes[i].height);
    if (sizes.size() > kMost) text += formatted(" and %zu sizes more", sizes.size() - kMost);
    return text;
}

Json sizesJson(const std::vector<SizeCount>& sizes) {
    Json json = Json::array();
    for (const SizeCount& size : sizes)
        json.push_back({{"width", size.width}, {"height", size.height}, {"views", size.views}});
    return json;
}

void describeSplit(const char* name, const Dataset& dataset, Description& out) {
    const CaptureReport report = reportCapture(captureViews(dataset, false));
    const Camera& first = dataset.views.front().camera;
    const bool is_distorted = std::any_of(dataset.views.begin(), dataset.views.end(),
                                          [](const View& view) { return !view.camera.distortion.isZero(); });
    const auto n_masks = std::count_if(dataset.views.begin(), dataset.views.end(),
                                       [](const View& view) { return !view.mask_path.empty(); });
    out.json["splits"][name] = {{"views", dataset.views.size()},  {"sizes", sizesJson(report.sizes)},
                                {"width", first.width},           {"height", first.height},
                                {"lenses", report.lenses},        {"focal_length", first.fx},
                                {"alpha", dataset.has_alpha},     {"distorted", is_distorted},
                                {"masks", n_masks},
                                {"camera_bounds", boxJson(report.camera_bounds)}};
    out.text += formatted("%s: %s views%s%s%s, %s, focal length %.1f pixels\n    cameras in %s\n", name,
                          sizesText(report.sizes).c_str(), dataset.has_alpha ? ", alpha" : "",
                          n_masks > 0 ? formatted(", %td with masks", n_masks).c_str() : "",
                          is_distorted ? ", lens distortion" : "",
                          report.lenses == 1 ? "one lens" : formatted("%zu lenses", report.lenses).c_str(), first.fx,
                          boxText(report.camera_bounds).c_str());
}

/// Whether ten photographs, which are read for it, show an object before a plain background; masks do not count.
bool arePlain(const Dataset& dataset) {
    const std::size_t n_some = std::min(kPhotosRead, dataset.views.size());
    Dataset some;
    for (std::size_t n = 0; n < n_some; ++n) {
        some.views.push_back(dataset.views[n * dataset.views.size() / n_some]);
        some.views.back().photo = readPhoto(some.views.back().path);
    }
    return plainBackground(some).has_value();
}

struct NamedBox {
    std::string name;
    Box box;
};

/// The box that training would take, or look for an object in. With alpha it follows from the pixels, which are read for it.
std::optional<NamedBox> sceneBox(const std::filesystem::path& path, const Dataset& train, std::vector<std::string>& warnings) {
    Report silent;
    try {
        if (train.has_alpha)
            return NamedBox{"scene box", findSceneBox(readDataset(path, Split::train, {}, silent), std::nullopt)};
        if (arePlain(train)) {
            if (train.aabb_scale) return NamedBox{"scene box", findSceneBox(train, std::nullopt)};
            return NamedBox{"an object before a plain background, to be looked for in", findCommonView(train)};
        }
        return NamedBox{"inner box of the open scene", findSceneShells(train, std::nullopt).inner};
    } catch (const Error& error) {
        warnings.push_back(std::string("training would find no box: ") + error.what());
        return std::nullopt;
    }
}

void describeCoverage(const CaptureReport& report, Description& out) {
    out.json["coverage"] = {{"usable_views", report.usable},
                            {"middle", vectorJson(report.middle)},
                            {"see_middle", report.see_middle},
                            {"mean_angle_degrees", report.mean_angle_deg},
                            {"widest_angle_degrees", report.widest_angle_deg},
                            {"position_spread", vectorJson(report.position_spread)},
                            {"position_rank", report.position_rank}};
    out.json["unusable"] = report.unusable;
    out.json["alone"] = report.alone;
    out.json["duplicates"] = report.duplicates;
    constexpr const char* kShapes[] = {"in one point", "in a line", "in a plane", "all around in three dimensions"};
    out.text += formatted("cameras: they stand %s, and look %.0f degrees from their mean direction on average\n",
                          kShapes[report.position_rank], report.mean_angle_deg);
    // A middle at home is not where rounding puts it.
    const double rounding = 1e-6 * report.position_spread.norm();
    const Vec3d middle = report.middle.unaryExpr([&](double v) { return std::abs(v) < rounding ? 0.0 : v; });
    out.text += formatted("coverage: %zu of %zu see the middle, [%.4g, %.4g, %.4g], from directions up to %.0f degrees "
                          "apart\n",
                          report.see_middle, report.usable, middle.x(), middle.y(), middle.z(),
                          report.widest_angle_deg);
}

void addNew(std::vector<std::string>& all, const std::vector<std::string>& more) {
    for (const std::string& line : more)
        if (std::find(all.begin(), all.end(), line) == all.end()) all.push_back(line);
}

}  // namespace

Json vectorJson(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }
Json boxJson(const Box& box) { return {{"min", vectorJson(box.min)}, {"max", vectorJson(box.max)}}; }

std::string boxText(const Box& box) {
    // Four digits of its size, however far away it is.
    const double farthest = box.min.cwiseAbs().cwiseMax(box.max.cwiseAbs()).maxCoeff(), size = box.size().maxCoeff();
    const int more = farthest > size && size > 0 ? static_cast<int>(std::min(12.0, std::log10(farthest / size))) : 0;
    const int n = 4 + more;
    return formatted("[%.*g, %.*g, %.*g] to [%.*g, %.*g, %.*g]", n, box.min.x(), n, box.min.y(), n, box.min.z(), n, box.max.x(),
                     n, box.max.y(), n, box.max.z());
}

Description describeDataset(const std::filesystem::path& path, const std::filesystem::path& plot_path) {
    constexpr std::pair<Split, const char*> kSplits[] = {
        {Split::train, "train"}, {Split::val, "val"}, {Split::test, "test"}};
    Description out{{{"command", "info"}, {"kind", "data"}, {"splits", Json::object()}, {"warnings", Json::array()}},
                    "data set: " + path.string() + "\n"};
    std::vector<std::string> warnings;
    std::vector<CaptureView> views;
    const std::optional<Dataset> test = readSplit(path, Split::test);
    std::optional<Dataset> train;
    for (const auto& [split, name] : kSplits) {
        const std::optional<Dataset> dataset = split == Split::test ? test : readSplit(path, split);
        if (!dataset || dataset->views.empty()) {
            out.text += std::string(name) + ": none\n";
            continue;
        }
        if (split == Split::train) train = dataset;
        if (split == Split::val && test && haveSameViews(*dataset, *test)) {
            out.text += "val: none of its own; test serves\n";
            continue;
        }
        describeSplit(name, *dataset, out);
        const std::vector<CaptureView> more = captureViews(*dataset, split != Split::train);
        views.insert(views.end(), more.begin(), more.end());
        addNew(warnings, dataset->warnings);
    }
    if (train && train->aabb_scale) {
        out.json["aabb_scale"] = *train->aabb_scale;
        out.text += formatted("aabb_scale: %g\n", *train->aabb_scale);
    }

    const CaptureReport report = reportCapture(views);
    describeCoverage(report, out);
    addNew(warnings, report.warnings);
    std::optional<NamedBox> box;
    if (train && report.unusable.empty()) box = sceneBox(path, *train, warnings);
    out.json["scene_box"] = box ? boxJson(box->box) : Json(nullptr);
    if (box) out.text += box->name + ": " + boxText(box->box) + "\n";

    for (const std::string& warning : warnings) {
        out.json["warnings"].push_back(warning);
        out.text += "warning: " + warning + "\n";
    }
    const std::optional<Box> drawn = box ? std::optional(box->box) : std::nullopt;
    if (!plot_path.empty()) writeAtomically(plot_path, svgText({path.string(), drawn, report.middle}, views));
    return out;
}

}  // namespace nerfvdb
