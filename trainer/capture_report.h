// SPDX-License-Identifier: Apache-2.0
// What a set of posed photographs is worth, from its cameras alone: where they stand, what they see in common, and
// what a person would want to know before hours of training.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/camera.h"

namespace nerfvdb {

struct CaptureView {
    std::string name;  // of the photograph
    Camera camera;     // also an unusable one
    bool held_out = false;
};

/// Photographs of one size.
struct SizeCount {
    int width = 0, height = 0;
    std::size_t views = 0;
};

struct CaptureReport {
    std::size_t usable = 0;        // views; all below is about them
    std::size_t lenses = 0;        // different intrinsics
    std::vector<SizeCount> sizes;  // the most frequent first
    Box camera_bounds;

    /// Standard deviations of the positions along their principal axes, the largest first, world units, and how many
    /// of these axes count (0: one point, 1: a line, 2: a plane or an arc, 3).
    Vec3d position_spread = Vec3d::Zero();
    int position_rank = 0;

    /// The point nearest to all optical axes (commonFocus); of parallel ones, as far ahead of the cameras as their
    /// bounds are large.
    Vec3d middle = Vec3d::Zero();
    std::size_t see_middle = 0;      // views that have it in their picture
    double mean_angle_deg = 0;       // between optical axes and their mean direction
    double widest_angle_deg = 0;     // between the directions from which two of the views that see the middle look at it

    std::vector<std::string> unusable;    // "NAME: what is wrong", as cameraProblem says it
    std::vector<std::string> alone;       // names of views that share nothing with any other
    std::vector<std::string> duplicates;  // "NAME and NAME": the same pose twice

    std::vector<std::string> warnings;  // for a person, with advice
};

/// Views share something when one has a point in its picture that the other has too: of a grid of rays through it, at
/// distances from an eighth to 32 times the size of the camera path.
/// Cost: O(views^2) at worst; views that share something with a neighbour are found in O(1).
CaptureReport reportCapture(std::span<const CaptureView> views);

}  // namespace nerfvdb
