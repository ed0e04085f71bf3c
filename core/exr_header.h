// SPDX-License-Identifier: Apache-2.0
// Is an EXR's header what its file can hold? OpenEXR takes memory for whatever length a header states, and reads some
// attributes by what they contain, past the length that they state.
#pragma once

#include <iosfwd>
#include <string>

namespace nerfvdb {

/// What is wrong with the header of the OpenEXR file in `stream` (seekable, binary), in a few words: it ends with the file,
/// an attribute's value is not as long as it states, or its lines or tiles would be absurdly wide. Empty: nothing. Leaves the stream anywhere.
std::string exrHeaderProblem(std::istream& stream);

}  // namespace nerfvdb
