// SPDX-License-Identifier: Apache-2.0
// The blobs of a model by themselves. The first byte chooses which: a field's cells and then its values (two bytes say
// how long the cells are), a sky, cameras. What was decoded is encoded and decoded again.
#include <algorithm>
#include <cmath>

#include "tests/fuzz/reader.h"
#include "vdb/camera_codec.h"
#include "vdb/field_codec.h"
#include "vdb/sky.h"

using namespace nerfvdb;

namespace {

void decodeField(std::span<const std::uint8_t> bytes) {
    if (bytes.size() < 2) return;
    const std::size_t n_cells = std::min<std::size_t>(bytes[0] | bytes[1] << 8, bytes.size() - 2);
    const std::span<const std::uint8_t> cells = bytes.subspan(2, n_cells);
    const Topology topology = decodeTopology(Vec3i::Constant(256), cells, "cells");
    const std::string again = encodeTopology(topology);
    const Topology same = decodeTopology(
        topology.dims(), {reinterpret_cast<const std::uint8_t*>(again.data()), again.size()}, "cells again");
    fuzz::require(std::equal(topology.cells().begin(), topology.cells().end(), same.cells().begin(),
                             same.cells().end()),
                  "cells come back");
    VoxelField field(topology, {}, 4, 1.0);
    decodeValues(bytes.subspan(2 + n_cells), "values", field);
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            for (int k = 0; k <= field.channels(); ++k)
                fuzz::require(std::isfinite(keptValue(field, leaf * kLeafVoxels + offset, k)), "finite values");
        });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    const std::span<const std::uint8_t> bytes(data + 1, size - 1);
    fuzz::isRead([&] {
        if (data[0] % 3 == 0) decodeField(bytes);
        if (data[0] % 3 == 1) Sky::decode(bytes, "sky");
        if (data[0] % 3 == 2) encodeCameras(decodeCameras(bytes, "cameras"));
    });
    return 0;
}
