// SPDX-License-Identifier: Apache-2.0
// Posed photographs in memory, as every trainer and evaluation sees them; which format they came from is
// forgotten here. Readers: read_transforms.h, read_colmap.h, read_llff.h.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "core/pixel_mask.h"
#include "core/report.h"

namespace nerfvdb {

/// Depths along a camera's axis between which all that it saw lies, world units, 0 < near < far.
struct DepthRange {
    double near = 0, far = 0;
};

/// One frame: where it was taken and what it shows. `photo` and `mask` are empty unless photos were asked for.
struct View {
    Camera camera;
    std::filesystem::path path;
    Photo photo;
    std::filesystem::path mask_path = {};        // as the data set names it; else findMask looks for one
    PixelMask mask = {};                         // of the photo's size; empty: every pixel counts
    std::optional<DepthRange> depth_range = {};  // where the data set tells (LLFF)
};

enum class Split { train, val, test };

/// The frames of one split, in the order of the protocol: split files keep the JSON's order, a single file's
/// frames are sorted by file name and every 8th (0, 8, 16, ...) is held out as test (and val).
struct Dataset {
    std::filesystem::path root;           // as the user named it
    std::vector<View> views;
    bool has_alpha = false;               // of any photo; without photos: any image's header has a channel for it
    std::optional<double> aabb_scale;     // as in the file (instant-ngp); see sceneBoxFromAabbScale
    std::vector<Vec3d> points;            // sparse, world units: COLMAP's that two photographs show at least, nerfstudio's
    std::vector<std::string> warnings;    // for a person, also sent to the Report
};

struct DatasetOptions {
    bool strict = false;      // a frame whose image is absent is an error, not a warning
    bool load_photos = true;  // false: cameras only (info, render)
    bool check_poses = true;  // false: cameras come as they are written, also unusable ones (info)
    bool use_masks = true;
    bool has_alpha = false;   // as a whole: of photos chosen from it, none need be transparent
    bool alpha_masks = false; // what alpha says shows nothing of the scene does not count instead
    bool no_alpha = false;    // photographs are laid on white, and what alpha says is not known
    int downscale = 1;        // photos, masks and cameras of 1/N of the width and height; see downscale.h
    std::optional<std::size_t> max_photo_bytes = {};  // photos that take more are kept in a PhotoCache ...
    std::filesystem::path cache_folder = {};           // ... there
    std::function<bool(const Camera&)> choose = {};    // of the split only views with such cameras; none: all
};

/// Reads a split of a data set, from what its folder holds; the first of these that is there:
/// transforms_{train,val,test}.json (NeRF-synthetic; any of these files, or a JSON file of another name, stands for the
/// folder) or transforms.json, COLMAP's sparse model (read_colmap.h), LLFF's poses_bounds.npy (read_llff.h). An absent
/// val split falls back to test, with a warning.
/// Throws DataError / IoError naming file and field, Interrupted when the report is cancelled between photos.
/// What is wrong does not depend on threads: of several bad photos or masks the first is named.
Dataset readDataset(const std::filesystem::path& path, Split split, const DatasetOptions& options, Report& report);

/// Whether any of so many photographs, evenly chosen, whose header has a channel for alpha is transparent somewhere. Reads them,
/// mostly the first is. One that cannot be read may be.
bool isTransparent(const Dataset& dataset, std::size_t most);

/// Share of the pixels of all photographs that masks leave out, [0, 1].
double maskedShare(const Dataset& dataset);

/// Mean colour of what counts in all photographs (sRGB values): what an opaque scene shows where nothing is known.
Vec3f meanColour(const Dataset& dataset);

/// instant-ngp's box: its unit cube is 1 / 0.33 world units wide and aabb_scale multiplies it, centred at 0.
Box sceneBoxFromAabbScale(double aabb_scale);

}  // namespace nerfvdb
