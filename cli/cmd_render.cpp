// SPDX-License-Identifier: Apache-2.0
// nerfvdb render: pictures of a model or a volume from the cameras of a data set, of a path file, or around it.
#include <algorithm>
#include <chrono>
#include <numbers>

#include "cli/camera_path.h"
#include "cli/commands.h"
#include "cli/dataset_words.h"
#include "cli/output_path.h"
#include "cli/pictures_for_eyes.h"
#include "cli/process.h"
#include "cli/scene_words.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

struct RenderWords {
    SceneWords scene;
    std::string out = "renders", data, path, up = "z";
    int orbit = 0, width = 0, height = 0;
    double fov = 0;  // vertical, degrees
    bool depth = false, opacity = false, normals = false;
    DatasetWords dataset;
    SharedOptions shared;
};

/// Cameras of a data set at another size, if one was asked for; one edge alone keeps the aspect.
void resizeCameras(std::vector<Camera>& cameras, int width, int height) {
    if (width == 0 && height == 0) return;
    for (Camera& camera : cameras) {
        const int w = width ? width : std::max(1, (camera.width * height + camera.height / 2) / camera.height);
        const int h = height ? height : std::max(1, (camera.height * width + camera.width / 2) / camera.width);
        camera = resized(camera, w, h);
    }
}

std::vector<Camera> findCameras(const RenderWords& words, const Scene& scene, Report& report) {
    PictureSize size;
    if (words.width) size.width = words.width;
    if (words.height) size.height = words.height;
    if (words.fov > 0) size.fov_y_rad = words.fov * std::numbers::pi / 180;

    if (!words.path.empty()) return readCameraPath(words.path, size);
    if (words.orbit > 0)
        return orbitCameras(scene.occupiedBox(), words.orbit, words.up == "y" ? UpAxis::y : UpAxis::z,
                            size);
    std::vector<Camera> cameras;
    for (const View& view : words.dataset.read(words.data, {.load_photos = false}, report).views) cameras.push_back(view.camera);
    resizeCameras(cameras, words.width, words.height);
    return cameras;
}

void writePictures(const RenderWords& words, std::size_t index, const RenderedImage& rendered) {
    const std::filesystem::path folder = words.out;
    const std::string name = formatted("%04zu", index);
    writeImage(folder / (name + ".png"), rendered.rgb);
    const auto both = [&](const char* kind, const Image& numbers, const Image& picture) {
        writeImage(folder / (name + "." + kind + ".exr"), numbers);
        writeImage(folder / (name + "." + kind + ".png"), picture);
    };
    if (words.depth) both("depth", rendered.depth, depthForEyes(rendered.depth));
    if (words.opacity) both("opacity", rendered.opacity, rendered.opacity);
    if (words.normals) both("normals", rendered.normal, normalsForEyes(rendered.normal));
}

void runRender(const RenderWords& words) {
    const auto limit = words.shared.begin();
    if ((words.orbit > 0) + !words.path.empty() + !words.data.empty() != 1)
        throw UsageError("render", "not exactly one of them", "one of --data, --path and --orbit");
    if (words.fov > 0 && !words.data.empty())
        throw UsageError("--fov", "it together with --data", "--path or --orbit",
                         "a data set has its own lenses");
    prepareOutputFolder("--out", words.out);

    TerminalReport report;
    const std::unique_ptr<Scene> scene = words.scene.load(words.normals);
    const std::vector<Camera> cameras = findCameras(words, *scene, report);

    double seconds = 0;
    report.begin("render", static_cast<std::int64_t>(cameras.size()));
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        if (report.cancelled()) throw Interrupted("stopped after " + std::to_string(i) + " pictures, as asked");
        const auto begin = std::chrono::steady_clock::now();
        const RenderedImage rendered = scene->render(cameras[i]);
        seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        writePictures(words, i, rendered);
        report.update(static_cast<std::int64_t>(i) + 1, "");
    }
    report.end();

    const double per_frame = cameras.empty() ? 0 : seconds / static_cast<double>(cameras.size());
    words.shared.finish(
        {{"command", "render"},
         {"out", words.out},
         {"views", cameras.size()},
         {"seconds_per_frame", per_frame},
         {"peak_memory_bytes", peakMemoryBytes()}},
        formatted("%zu pictures in %s, %.3f s a frame\n", cameras.size(), words.out.c_str(), per_frame));
}

}  // namespace

Command addRender(CLI::App& program) {
    auto words = std::make_shared<RenderWords>();
    CLI::App& app = *program.add_subcommand("render", "Make pictures of a model or a volume");
    words->scene.add(app);
    app.add_option("--data", words->data, "Take the cameras of a data set")->type_name("DATA");
    words->dataset.add(app);
    app.add_option("--path", words->path, "Take the cameras of a nerfstudio camera path")
        ->type_name("FILE.json");
    app.add_option("--orbit", words->orbit, "Take N cameras on a circle around the model")
        ->check(CLI::Range(1, 100000))
        ->type_name("N");
    app.add_option("--up", words->up, "The axis that --orbit takes as up: y or z [z]")
        ->check(CLI::IsMember({"y", "z"}))
        ->type_name("AXIS");
    app.add_option("--width", words->width, "Pixels [the camera's; 800 for --orbit]")
        ->check(CLI::Range(1, 32768))
        ->type_name("N");
    app.add_option("--height", words->height, "Pixels [the camera's; 800 for --orbit]")
        ->check(CLI::Range(1, 32768))
        ->type_name("N");
    app.add_option("--fov", words->fov, "Vertical field of view in degrees [the path's; 40 for --orbit]")
        ->check(CLI::Range(0.1, 170.0))
        ->type_name("DEGREES");
    app.add_option("--out", words->out, "Folder for 0000.png, ... [renders]")->type_name("DIR");
    app.add_flag("--depth", words->depth, "Also distance along the ray: .depth.exr (world units), .depth.png (its logarithm: near is white)");
    app.add_flag("--opacity", words->opacity, "Also opacity: .opacity.exr, .opacity.png");
    app.add_flag("--normals", words->normals, "Also normals on world axes: .normals.exr, .normals.png");
    words->shared.add(app, "  nerfvdb render lego.vdb --orbit 60 --width 640 --height 480 --out turn --depth");
    return {&app, [words] { runRender(*words); }};
}

}  // namespace nerfvdb
