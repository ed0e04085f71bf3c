// SPDX-License-Identifier: Apache-2.0
// Do a photograph's EXIF directories come to an end? They point to each other, and OpenImageIO follows them, through a
// Canon's maker note into whatever that points to, for as long as there is stack.
#pragma once

#include <iosfwd>
#include <string>

namespace nerfvdb {

/// What is wrong with the EXIF of the JPEG or PNG in `file` (seekable, binary), in a few words: its
/// directories are nested deeper than any camera's (in a circle, for example), or have more entries altogether. Empty:
/// nothing, or no EXIF. Reads no pixels; leaves the stream anywhere.
std::string exifProblem(std::istream& file);

}  // namespace nerfvdb
