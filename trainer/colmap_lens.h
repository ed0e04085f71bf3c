// SPDX-License-Identifier: Apache-2.0
// COLMAP's lens models as ours. Source: colmap/src/colmap/sensor/models.h and https://colmap.github.io/cameras.html
#pragma once

#include <string>

#include "core/camera.h"
#include "trainer/colmap_model.h"

namespace nerfvdb {

struct ColmapLensModel {
    int id;                    // in binary files
    const char* name;          // in text files
    std::size_t n_parameters;  // focal length (one or two), principal point, lens terms
};

/// The model of a number or a name. Throws DataError at `where` for one that is not supported: those are
/// SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE and
/// RADIAL_FISHEYE.
const ColmapLensModel& colmapLensModel(int id, const std::string& where);
const ColmapLensModel& colmapLensModel(const std::string& name, const std::string& where);

/// Size, focal lengths, principal point and distortion; the pose is left alone. Throws DataError at `where` for a size
/// that no image has; what else is wrong, cameraProblem tells.
Camera cameraOf(const ColmapCamera& source, const std::string& where);

}  // namespace nerfvdb
