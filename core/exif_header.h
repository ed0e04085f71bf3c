// SPDX-License-Identifier: Apache-2.0
// Do a photograph's EXIF directories come to an end? They point to each other, and OpenImageIO follows them, through a
// Canon's maker note into whatever that points to, for as long as there is stack.
#pragma once

#include <string>
#include <string_view>

namespace nerfvdb {

/// What is wrong with the EXIF in a JPEG's or PNG's bytes, in a few words: its directories are nested deeper than any
/// camera's (in a circle, for example), or have more entries altogether. Empty: nothing, or no EXIF.
std::string exifProblem(std::string_view file);

}  // namespace nerfvdb
