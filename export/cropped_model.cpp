// SPDX-License-Identifier: Apache-2.0
#include "export/cropped_model.h"

#include <algorithm>

#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {

Model croppedModel(const Model& model, const Box& bounds) {
    const VoxelField& field = model.field;
    const Topology& topology = field.topology();
    std::vector<Topology::LeafCells> cells(topology.leafCount());
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        const Vec3i coord = topology.leafCoords()[leaf];
        cells[leaf] = {coord, {}};
        forEachBit(topology.cells()[leaf], [&](int offset) {
            const Vec3i cell = coord * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            if (bounds.contains(field.frame().worldFromIndex(cell.cast<double>())) &&
                bounds.contains(field.frame().worldFromIndex((cell + Vec3i::Ones()).cast<double>())))
                setBit(cells[leaf].cells, offset);
        });
    });
    std::erase_if(cells, [](const Topology::LeafCells& entry) { return entry.cells == LeafMask{}; });
    if (cells.empty())
        throw DataError("bounds", "a box without any of the scene", "a box that holds a part of it",
                        "'nerfvdb info' says where the scene lies");

    Model cropped;
    cropped.field = VoxelField(Topology(topology.dims(), cells), field.frame(), field.channels(), field.densityScale());
    const auto channels = static_cast<std::size_t>(field.channels());
    const Topology& kept = cropped.field.topology();
    parallelFor(kept.leafCount(), [&](std::size_t leaf) {
        const auto from = static_cast<std::size_t>(topology.findLeaf(kept.leafCoords()[leaf])) * kLeafVoxels;
        forEachBit(kept.voxels()[leaf], [&](int offset) {
            const std::size_t to = leaf * kLeafVoxels + offset;
            cropped.field.density()[to] = field.density()[from + offset];
            std::copy_n(&field.features()[(from + offset) * channels], channels, &cropped.field.features()[to * channels]);
        });
    });
    cropped.decoder = model.decoder;
    cropped.background = model.background;
    cropped.info = model.info;
    cropped.cameras = model.cameras;
    return cropped;
}

}  // namespace nerfvdb
