// SPDX-License-Identifier: Apache-2.0
#include "trainer/model_cameras.h"

#include <algorithm>
#include <string>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// `path` as seen from `folder`; lexically, since a link to elsewhere is named by where it lies.
std::string nameIn(const std::filesystem::path& folder, const std::filesystem::path& path) {
    if (path.empty()) return {};
    const std::filesystem::path base = (folder.empty() ? std::filesystem::path(".") : folder).lexically_normal();
    const std::filesystem::path name = path.lexically_normal().lexically_relative(base);
    const bool is_inside = !name.empty() && *name.begin() != "..";
    std::string text = (is_inside ? name : path.filename()).generic_string();
    std::replace_if(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
    return text;
}

}  // namespace

std::vector<ModelCamera> modelCameras(const Dataset& dataset, bool held_out) {
    const std::filesystem::path& root = dataset.root;
    const std::filesystem::path folder = root.extension() == ".json" ? root.parent_path() : root;
    std::vector<ModelCamera> cameras;
    for (const View& view : dataset.views) cameras.push_back({nameIn(folder, view.path), view.camera, held_out});
    return cameras;
}

std::vector<ModelCamera> heldOutCameras(const std::filesystem::path& path, Report& report) {
    try {
        Report silent;  // what there is to warn of was said of the training split
        return modelCameras(readDataset(path, Split::test, {.strict = false, .load_photos = false}, silent),
                            /*held_out=*/true);
    } catch (const Error& error) {
        report.info(std::string("no held-out views: ") + error.what());
        return {};
    }
}

}  // namespace nerfvdb
