// SPDX-License-Identifier: Apache-2.0
// What to do with photographs whose cameras are unknown: which pairs to match, how many cameras there are, and how
// long that will take. Decided from file names and EXIF alone, before anything is run.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/image.h"

namespace nerfvdb {

enum class Matching { automatic, exhaustive, sequential, spatial };
enum class CameraSharing { automatic, shared, per_image };

const char* nameOf(Matching matching);

struct CaptureOptions {
    Matching matching = Matching::automatic;
    CameraSharing camera = CameraSharing::automatic;
    int max_size = 1600;      // of the longer side in which features are sought, pixels
    int max_features = 4096;  // of a photograph; the time of matching grows with their square
};

struct CapturePlan {
    Matching matching = Matching::exhaustive;      // not automatic
    std::string matching_reason;
    CameraSharing camera = CameraSharing::shared;  // not automatic
    std::string camera_reason;
    std::size_t pairs = 0;        // of photographs to be matched, at most
    double features_seconds = 0;  // predicted, wall time
    double matching_seconds = 0;
};

/// Chooses what `options` leave open.
///   matching: spatial where every photograph has a place; else exhaustive up to 60 photographs; else sequential where
///   names are numbered in long runs (frames of a video, a walk); else exhaustive
///   camera: shared where all photographs have the same size, camera and focal length; else one for each
/// `names` [N] in order, `origins` [N]. Throws UsageError when what was asked for cannot be: spatial without places,
/// one camera for several sizes.
CapturePlan planCapture(const std::vector<std::string>& names, const std::vector<PhotoOrigin>& origins,
                        const CaptureOptions& options, int threads);

/// Share of photographs that stand in runs of at least 20 names which differ in a number alone, each number as much
/// above the one before (1, 2, 3 or 10, 20, 30; frames that were dropped leave gaps of up to four times that).
double numberedShare(const std::vector<std::string>& names);

/// Wall time for matching pairs of photographs with so many features each, seconds. A processor core of 2024 takes
/// 0.2 s to verify a pair and 0.011 s per million pairs of features to compare them (COLMAP 3.8, without CUDA).
double matchingSeconds(std::size_t pairs, double features, int threads);

/// "a few seconds", "about 40 seconds", "about 7 minutes", "about 2.5 hours": a prediction, not a measurement.
std::string roughTime(double seconds);

/// COLMAP's sequential matcher takes each photograph with those that come 1 to kSequentialOverlap - 1 later, and 1, 2,
/// 4, ... 2^(kSequentialOverlap - 1) later.
inline constexpr int kSequentialOverlap = 10;
inline constexpr int kSpatialNeighbours = 50;  // each photograph with so many nearest ones

}  // namespace nerfvdb
