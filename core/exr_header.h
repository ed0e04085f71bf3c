// SPDX-License-Identifier: Apache-2.0
// Does an EXR's header fit into its file? OpenEXR takes memory for an attribute of any length that a header states.
#pragma once

#include <iosfwd>

namespace nerfvdb {

/// True if an attribute of the OpenEXR file in `stream` (seekable, binary) claims more bytes than the file goes on for,
/// or if the file ends within its header. Leaves the stream anywhere.
bool isTruncatedExrHeader(std::istream& stream);

}  // namespace nerfvdb
