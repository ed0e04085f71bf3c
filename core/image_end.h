// SPDX-License-Identifier: Apache-2.0
// Does a picture's file go on to its end? Decoders are lenient there: libjpeg paints what is missing grey and
// calls that a warning. So the container itself is walked, without decoding anything.
#pragma once

#include <string_view>

namespace nerfvdb {

/// True if the file's bytes are a PNG or JPEG that stops before its end mark (IEND, EOI). Bytes after the mark
/// are fine, as some cameras append data. Other formats give false: their decoders notice by themselves.
bool isTruncatedImage(std::string_view bytes);

}  // namespace nerfvdb
