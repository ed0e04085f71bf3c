// SPDX-License-Identifier: Apache-2.0
#include "bench/scene.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "core/error.h"
#include "core/parallel.h"
#include "trainer/exact_ray.h"
#include "trainer/synthetic_scene.h"
#include "trainer/trainer.h"
#include "vdb/model_file.h"
#include "vdb/renderer.h"

namespace nerfvdb {
namespace {

/// A picture of 3 or 4 channels, rounded to what a file of 8 bits keeps.
Photo photoFrom(const Image& image) {
    Photo photo;
    photo.width = image.width, photo.height = image.height;
    photo.has_alpha = image.channels == 4;
    photo.pixels.resize(static_cast<std::size_t>(image.width) * image.height, {0, 0, 0, 255});
    for (std::size_t i = 0; i < photo.pixels.size(); ++i)
        for (int c = 0; c < image.channels; ++c)
            photo.pixels[i][c] = static_cast<std::uint8_t>(
                std::lround(255 * std::clamp(image.pixels[i * image.channels + c], 0.0f, 1.0f)));
    return photo;
}

Dataset photographed(const SyntheticScene& scene, Split split, const SyntheticDatasetOptions& options,
                     Report& report) {
    const std::vector<Camera> cameras = syntheticCameras(split, options);
    Dataset dataset;
    dataset.has_alpha = true;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        if (report.cancelled()) throw Interrupted("stopped while photographing the scene, as asked");
        dataset.views.push_back(
            {cameras[i], "view " + std::to_string(i), photoFrom(exactImage(scene, cameras[i]))});
        report.update(static_cast<std::int64_t>(i) + 1, "");
    }
    return dataset;
}

/// Box of the leaves that hold something.
Box occupiedBox(const VoxelField& field) {
    const auto leaves = field.topology().leafCoords();
    if (leaves.empty()) return field.worldBox();
    Vec3i low = leaves.front(), high = leaves.front();
    for (const Vec3i& leaf : leaves) low = low.cwiseMin(leaf), high = high.cwiseMax(leaf);
    const Vec3i end = (high + Vec3i::Ones()) * kLeafDim;
    return {field.frame().worldFromIndex((low * kLeafDim).cast<double>()),
            field.frame().worldFromIndex(end.cast<double>())};
}

/// The model's own pictures, from a circle around it at 25 degrees above its middle.
Dataset selfPortraits(const Model& model, int n_views, double turn) {
    constexpr int kPixels = 400;
    constexpr double kFov = 40 * std::numbers::pi / 180, kElevation = 25 * std::numbers::pi / 180;
    const Box box = occupiedBox(model.field);
    const double distance = 0.5 * box.size().norm() / std::sin(0.5 * kFov);
    const RenderOptions nothing_skipped{.trace = {.stop_transmittance = 0, .min_weight = 0, .max_dropped = 0},
                                        .min_alpha = 0,
                                        .normals = false};
    const Renderer renderer(model, nothing_skipped);
    Dataset dataset;
    for (int i = 0; i < n_views; ++i) {
        const double azimuth = 2 * std::numbers::pi * (i + turn) / n_views;
        const Vec3d outward(std::cos(kElevation) * std::cos(azimuth), std::cos(kElevation) * std::sin(azimuth),
                            std::sin(kElevation));
        const Camera camera =
            lookAt(box.center() + distance * outward, box.center(), Vec3d::UnitZ(), kFov, kPixels, kPixels);
        dataset.views.push_back({camera, "view " + std::to_string(i), photoFrom(renderer.render(camera).rgb)});
    }
    return dataset;
}

}  // namespace

BenchScene sceneOnDisk(const std::filesystem::path& path) {
    std::filesystem::path named = path.has_filename() ? path : path.parent_path();
    if (named.extension() == ".json") named = named.has_parent_path() ? named.parent_path() : named.stem();
    return {named.filename().string(), [path](Split split, Report& report) {
                return readDataset(path, split, {.strict = false, .load_photos = true}, report);
            }};
}

BenchScene proceduralScene(const std::string& name, const SyntheticDatasetOptions& options, Report& report) {
    const auto scene = makeSyntheticScene(name);
    report.begin(name, options.train_views + options.test_views);
    const auto train = std::make_shared<Dataset>(photographed(*scene, Split::train, options, report));
    const auto test = std::make_shared<Dataset>(photographed(*scene, Split::test, options, report));
    report.end();
    train->root = test->root = name;
    return {name, [train, test](Split split, Report&) { return split == Split::train ? *train : *test; }};
}

void limitViews(Dataset& dataset, int n) {
    const std::size_t all = dataset.views.size(), most = static_cast<std::size_t>(n);
    if (n <= 0 || all <= most) return;
    std::vector<View> kept;
    for (std::size_t i = 0; i < most; ++i) kept.push_back(std::move(dataset.views[i * all / most]));
    dataset.views = std::move(kept);
}

Subject learnSubject(const BenchScene& scene, const SubjectOptions& options, Report& report) {
    Subject subject;
    subject.name = scene.name;
    subject.train = scene.load(Split::train, report);
    subject.test = scene.load(Split::test, report);
    limitViews(subject.test, options.test_views);
    TrainOptions training;
    training.time_s = options.learn_seconds;
    TrainResult learned = train(subject.train, training, report, {});
    if (learned.interrupted) throw Interrupted("stopped while learning the scene, as asked");
    subject.model = std::move(learned.model);
    return subject;
}

Subject makeSubject(const SubjectOptions& options, Report& report) {
    const bool has_model = !options.model.empty(), has_data = !options.data.empty();
    if (!has_model)
        return learnSubject(has_data ? sceneOnDisk(options.data)
                                     : proceduralScene(options.procedural, options.pictures, report),
                            options, report);
    Subject subject;
    subject.model = loadModel(options.model);
    subject.name = options.model.stem().string();
    if (!has_data) {
        subject.train = selfPortraits(subject.model, 2 * options.test_views, 0.0);
        subject.test = selfPortraits(subject.model, options.test_views, 0.5);
        return subject;
    }
    const BenchScene scene = sceneOnDisk(options.data);
    subject.train = scene.load(Split::train, report);
    subject.test = scene.load(Split::test, report);
    limitViews(subject.test, options.test_views);
    return subject;
}

}  // namespace nerfvdb
