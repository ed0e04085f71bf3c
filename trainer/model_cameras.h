// SPDX-License-Identifier: Apache-2.0
// Who photographed a scene, as its model remembers it.
#pragma once

#include <filesystem>
#include <vector>

#include "core/report.h"
#include "trainer/dataset.h"
#include "vdb/model.h"

namespace nerfvdb {

/// The cameras of a data set in its order. Names are paths relative to the folder of the data set, with '/'; a photo
/// outside of it keeps only its file name, and a view without a file has none: no model tells where it was made.
/// Control characters become '?', which no model takes exception to.
std::vector<ModelCamera> modelCameras(const Dataset& dataset, bool held_out);

/// The cameras of the test split, without reading its photographs. A data set that has none gives none, and one that
/// cannot be read neither: `report` is told why, since training needs it not.
std::vector<ModelCamera> heldOutCameras(const std::filesystem::path& path, Report& report);

}  // namespace nerfvdb
