// SPDX-License-Identifier: Apache-2.0
// Writing .vdb files that repeat byte for byte, are never half written, and carry their own checksum (vdb_seal.h);
// reading such files, and those of other programs. Included only by .cpp files that work on grids (OpenVDB's header is
// heavy).
#pragma once

#include <filesystem>
#include <string>

#include "vdb/openvdb_grids.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// Where a grid of this frame lies: voxel values sit at integer index coordinates, as in OpenVDB.
/// Throws DataError for voxels so small that OpenVDB takes their size for zero.
openvdb::math::Transform::Ptr gridTransform(const GridFrame& frame);

/// Density as plain volumes get it: sigma in 1 / world unit, but no denser than what makes one voxel opaque
/// (optical depth 16 over its edge, alpha = 1 - 1e-7). Training drives solid matter to the clamp at exp(15); other
/// programs interpolate sigma itself, and such walls would grow outward by a voxel in them (and overflow half).
float volumeSigma(float raw, double density_scale, double voxel_size);

inline constexpr float kLargestHalf = 65504;

/// True if half precision says every density that can be seen: `largest_sigma` does not overflow, and
/// what falls below half's normal range (6e-5) is invisible across a voxel. Else the world unit is unusual.
bool halfSuffices(float largest_sigma, double voxel_size);

/// Writes grids and file-level metadata atomically, Blosc-compressed, inactive values left out, sealed.
/// Half or float is a setting of each grid. Throws IoError; the file that stood at `path` is then untouched.
void writeVdb(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids,
              const openvdb::MetaMap& metadata);

struct VdbContent {
    openvdb::GridPtrVecPtr grids;
    openvdb::MetaMap::Ptr metadata;
};

/// Reads a whole file; ours only if its checksum is right. Throws IoError, or DataError: no .vdb, damaged, what OpenVDB
/// complains of, more than memory holds. A damaged file of another program may also end this one (cli/foreign_vdb.h).
VdbContent readVdb(const std::filesystem::path& path);

}  // namespace nerfvdb
