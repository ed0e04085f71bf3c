// SPDX-License-Identifier: Apache-2.0
// The cameras of a model as few bytes, exactly: lenses that many share are written once.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "vdb/model.h"

namespace nerfvdb {

/// Cameras as bytes. Throws UsageError for one that cameraProblem complains of, or whose name is no path inside a
/// folder (absolute, with "..", with control characters): a model goes places, and must not tell of this machine.
std::string encodeCameras(std::span<const ModelCamera> cameras);

/// And back, bit by bit. `where` names the place for the DataError that wrong bytes raise; what comes out is as
/// encodeCameras demands it.
std::vector<ModelCamera> decodeCameras(std::span<const std::uint8_t> bytes, const std::string& where);

}  // namespace nerfvdb
