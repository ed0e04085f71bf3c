// SPDX-License-Identifier: Apache-2.0
// What the readers of posed photographs do alike: find images, leave out absent ones, hold out every 8th, fit a lens
// to the image that is there.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "trainer/dataset.h"

namespace nerfvdb {

/// A frame as a data set lists it, and the image that belongs to it if there is one.
struct ListedFrame {
    std::size_t index = 0;  // in the list
    std::string name;       // as written there
    std::filesystem::path image;
    bool has_image = false;
};

/// "train", "val" or "test".
const char* nameOf(Split split);

/// A relative path in its normal form; nothing for one that is empty or leads out of the folder it is relative to.
std::optional<std::filesystem::path> pathInside(const std::string& name);

/// Whether a name, backslashes between folders or not, leads out of its folder: upwards, absolute, or with a drive.
bool leadsOut(const std::string& name);

/// Where a file of such a name would lie in its folder: at the name, or, if that leads out, at its last part. Nothing if it has none.
std::optional<std::filesystem::path> placeExpected(const std::string& name);

/// Where in its folder a file lies that a list names, if `is_there` finds it: as named, backslashes between folders or
/// not. Of a path that is absolute or leads out of the folder, as lists from other machines have, the longest end that is there.
std::optional<std::filesystem::path> placeInside(const std::string& name,
                                                 const std::function<bool(const std::filesystem::path&)>& is_there);

/// True for a regular file; false too where nobody can tell (a name that no file can have, a forbidden folder).
bool isFile(const std::filesystem::path& path);

/// True for the extensions of PNG, JPEG and EXR, in small or capital letters.
bool isImageName(const std::filesystem::path& path);

/// The folder of a capture's images: ROOT/images, else the smaller versions that tools lay beside it, images_2, images_4
/// and images_8, whichever is there first. Throws DataError when there is none.
std::filesystem::path findImageFolder(const std::filesystem::path& root);

/// Warns of images that were found by the end of a path of another machine.
void warnOfMoved(const std::vector<ListedFrame>& frames, const std::string& where, std::vector<std::string>& warnings);

/// Warns of frames that share an image: all but one of their poses are wrong.
void warnOfSharedImages(const std::vector<ListedFrame>& frames, const std::string& where, std::vector<std::string>& warnings);

/// Removes the frames whose image is absent, with a warning: many data sets list a few that were never shipped.
/// Throws DataError when it is more than half of them, or any while `strict`. `where` names the list.
void dropAbsent(std::vector<ListedFrame>& frames, const std::string& where, bool strict,
                std::vector<std::string>& warnings);

/// The frames of a split where nobody says which: 0, 8, 16, ... of those given are test (and val), the others train.
std::vector<ListedFrame> everyEighthHeldOut(const std::vector<ListedFrame>& frames, Split split);

/// True if an image of width x height pixels is one of w x h, made smaller or larger and rounded to whole pixels.
bool isSameAspect(double w, double h, int width, int height);

/// What to do about an image of another aspect than its camera's.
const char* adviceOnAspect(double w, double h, int width, int height);

/// "640x480".
std::string sizeText(double width, double height);

/// The nearest rotation of an almost-rotation (polar factor by Newton-Schulz: an error e becomes about e^2).
Mat3d nearestRotation(Mat3d rotation);

}  // namespace nerfvdb
