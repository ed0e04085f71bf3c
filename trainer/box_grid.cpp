// SPDX-License-Identifier: Apache-2.0
#include "trainer/box_grid.h"

#include <cmath>

#include "vdb/topology.h"

namespace nerfvdb {

BoxGrid gridOver(const Box& box, int resolution) {
    return gridOfVoxels(box, box.size().maxCoeff() / (resolution - 1));
}

BoxGrid gridOfVoxels(const Box& box, double voxel_size) {
    BoxGrid grid;
    const Vec3d size = box.size();
    grid.frame.voxel_size = voxel_size;
    for (int axis = 0; axis < 3; ++axis) {
        const int voxels = static_cast<int>(std::ceil(size[axis] / grid.frame.voxel_size - 1e-6)) + 1;
        grid.dims[axis] = (voxels + kLeafDim - 1) / kLeafDim * kLeafDim;
    }
    const Vec3d covered = grid.frame.voxel_size * (grid.dims - Vec3i::Ones()).cast<double>();
    grid.frame.origin = box.center() - 0.5 * covered;
    grid.shells.extent = grid.dims - Vec3i::Ones();
    return grid;
}

BoxGrid gridAround(const Box& box, double voxel_size, int shells) {
    constexpr int kMultiple = 8;  // what a shell leaves out ends between its cells, now and at every finer voxel size
    constexpr int kGap = 16;      // between shells: a leaf of a model's preview
    BoxGrid grid;
    const Vec3d size = box.size();
    grid.frame.voxel_size = voxel_size;
    for (int axis = 0; axis < 3; ++axis)
        grid.shells.extent[axis] =
            static_cast<int>(std::ceil(size[axis] / grid.frame.voxel_size / kMultiple - 1e-6)) * kMultiple;
    grid.shells.count = shells;
    grid.shells.stride = (grid.shells.extent.x() + 2 * kGap - 1) / kGap * kGap;
    grid.dims = grid.shells.extent + Vec3i::Constant(kLeafDim);
    grid.dims.x() = shells * grid.shells.stride;
    grid.frame.origin = box.center() - 0.5 * grid.frame.voxel_size * grid.shells.extent.cast<double>();
    return grid;
}

}  // namespace nerfvdb
