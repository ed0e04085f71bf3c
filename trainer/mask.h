// SPDX-License-Identifier: Apache-2.0
// Masks on disk: where they lie beside the photographs, and how their grey becomes pixels that count.
#pragma once

#include <filesystem>
#include <string>

#include "core/image.h"
#include "core/pixel_mask.h"

namespace nerfvdb {

/// The mask of a photograph by the habits of nerfstudio and COLMAP, in a folder `masks` beside one of those that the
/// photograph lies in: for DATA/images/01.jpg the first that exists of DATA/masks/images/01.png, DATA/masks/01.png and
/// DATA/images/masks/01.png; each also as 01.jpg.png and 01.jpg. Empty: there is none. `folder` is the data set's.
std::filesystem::path findMask(const std::filesystem::path& image, const std::filesystem::path& folder);

/// Reads a mask for a photograph of that size: pixels darker than mid grey do not count. A mask of another size but the
/// same aspect is scaled, each pixel taking the nearest one's word; `was_scaled` tells.
/// Throws as readImage; DataError for a mask of another aspect and for one that leaves no pixel.
PixelMask readMask(const std::filesystem::path& path, int width, int height, bool& was_scaled);

/// Alpha taken for a mask: pixels that are more than half transparent do not count, nor those that `mask` leaves out already;
/// the photograph is opaque afterwards. `path` names it. Throws DataError when no pixel is left.
void maskByAlpha(Photo& photo, PixelMask& mask, const std::filesystem::path& path);

}  // namespace nerfvdb
