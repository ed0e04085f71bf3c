// SPDX-License-Identifier: Apache-2.0
// A synthetic scene as a data set on disk, in the layout of NeRF-synthetic.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "core/report.h"
#include "trainer/dataset.h"
#include "trainer/synthetic_scene.h"

namespace nerfvdb {

struct SyntheticDatasetOptions {
    int train_views = 60, val_views = 10, test_views = 20;  // a split of no views is left out
    int width = 200, height = 200;                          // pixels
    std::uint64_t seed = 1;                                 // turns the cameras about the z axis
};

int viewCount(Split split, const SyntheticDatasetOptions& options);

/// Cameras at distance 4.03 that look at the origin, with NeRF-synthetic's field of view over the shorter side.
/// train: evenly spread over the upper half of the sphere and a little below; val: the same, turned; test: a
/// spiral from 5 to 65 degrees above the horizon, so that no test view repeats a training view.
std::vector<Camera> syntheticCameras(Split split, const SyntheticDatasetOptions& options);

/// Writes FOLDER/transforms_{train,val,test}.json and FOLDER/{train,val,test}/r_0.png ... (RGBA, straight
/// alpha). The folder is made; each file is replaced as a whole, and a split's JSON comes after its images.
/// Equal options give equal bytes, whatever the number of threads.
/// Throws UsageError (absurd options), IoError, or Interrupted when the report asks to stop.
void writeSyntheticDataset(const SyntheticScene& scene, const std::filesystem::path& folder,
                           const SyntheticDatasetOptions& options, Report& report);

/// The same of whatever `camerasOf` a split and `show` say.
void writePictures(const std::filesystem::path& folder, const SyntheticDatasetOptions& options,
                   const std::function<std::vector<Camera>(Split)>& camerasOf,
                   const std::function<Image(const Camera&)>& show, Report& report);

}  // namespace nerfvdb
