// SPDX-License-Identifier: Apache-2.0
// Layout, little-endian. Each file begins with uint64, the number of its entries:
//   cameras:  uint32 id, int32 model, uint64 width, height, the model's parameters as doubles
//   images:   uint32 id, double w, x, y, z, double translation (3), uint32 camera, name and a zero byte,
//             uint64 features, each double x, y, uint64 point (all ones: none)
//   points3D: uint64 id, double position (3), uint8 colour (3), double error,
//             uint64 length of the track, each uint32 image, uint32 feature
#include "trainer/colmap_binary.h"

#include <algorithm>
#include <limits>

#include "core/atomic_file.h"
#include "core/byte_reader.h"
#include "core/error.h"
#include "trainer/colmap_lens.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAdvice = "the file is cut short or no COLMAP model: copy it again";
constexpr std::uint64_t kNoPoint = std::numeric_limits<std::uint64_t>::max();
constexpr std::size_t kFeatureBytes = 24, kTrackBytes = 8;

/// A count of things of at least so many bytes each; one that the rest of the file cannot hold is no count.
std::size_t readCount(ByteReader& in, std::size_t least_bytes, const char* what) {
    const auto count = in.number<std::uint64_t>(what);
    if (in.left() / least_bytes < count)
        throw DataError(in.where(), std::to_string(in.left()) + " bytes after " + what + " of " + std::to_string(count),
                        "at least " + std::to_string(least_bytes) + " for each", kAdvice);
    return static_cast<std::size_t>(count);
}

/// Reads a whole file of entries, each at least so long.
template <typename T, typename ReadEntry>
std::vector<T> readEntries(const fs::path& file, std::size_t least_bytes, const char* what, const ReadEntry& read) {
    const std::string bytes = readFile(file);
    ByteReader in({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, file.string(), kAdvice);
    const std::size_t count = readCount(in, least_bytes, what);
    std::vector<T> entries;
    for (std::size_t i = 0; i < count; ++i) entries.push_back(read(in));
    if (in.left() > 0)
        throw DataError(file.string(), std::to_string(in.left()) + " bytes after the last entry", "none",
                        "the file is no COLMAP model: copy it again");
    return entries;
}

Vec3d readVector(ByteReader& in, const char* what) {
    Vec3d vector;
    for (double& value : vector) value = in.number<double>(what);
    return vector;
}

ColmapCamera readCamera(ByteReader& in) {
    ColmapCamera camera;
    camera.id = in.number<std::uint32_t>("a camera's id");
    const auto model = in.number<std::int32_t>("a camera's model");
    const ColmapLensModel& lens =
        colmapLensModel(model, in.where() + ": camera " + std::to_string(camera.id));
    camera.model = lens.name;
    camera.width = in.number<std::uint64_t>("a width");
    camera.height = in.number<std::uint64_t>("a height");
    for (std::size_t i = 0; i < lens.n_parameters; ++i) camera.parameters.push_back(in.number<double>("a lens"));
    return camera;
}

ColmapImage readImage(ByteReader& in) {
    ColmapImage image;
    image.id = in.number<std::uint32_t>("an image's id");
    for (double& value : image.rotation) value = in.number<double>("a rotation");
    image.translation = readVector(in, "a translation");
    image.camera = in.number<std::uint32_t>("an image's camera");
    const auto rest = in.rest();
    const auto end = std::find(rest.begin(), rest.end(), std::uint8_t{0});
    image.name.assign(rest.begin(), end);
    in.take(image.name.size() + 1, "a name and its end");

    const std::size_t n_features = readCount(in, kFeatureBytes, "a count of features");
    for (std::size_t i = 0; i < n_features; ++i) {
        const auto x = in.number<double>("a feature"), y = in.number<double>("a feature");
        const auto point = in.number<std::uint64_t>("a feature's point");
        if (point != kNoPoint) image.observations.push_back({{x, y}, point});
    }
    return image;
}

ColmapPoint readPoint(ByteReader& in) {
    ColmapPoint point;
    point.id = in.number<std::uint64_t>("a point's id");
    point.position = readVector(in, "a position");
    in.take(3 + sizeof(double), "a colour and an error");
    point.track_length = readCount(in, kTrackBytes, "a track's length");
    in.take(point.track_length * kTrackBytes, "a track");
    return point;
}

}  // namespace

std::vector<ColmapCamera> readColmapCamerasBinary(const fs::path& file) {
    return readEntries<ColmapCamera>(file, 4 + 4 + 2 * 8 + 3 * 8, "a count of cameras", readCamera);
}

std::vector<ColmapImage> readColmapImagesBinary(const fs::path& file) {
    return readEntries<ColmapImage>(file, 4 + 7 * 8 + 4 + 1 + 8, "a count of images", readImage);
}

std::vector<ColmapPoint> readColmapPointsBinary(const fs::path& file) {
    return readEntries<ColmapPoint>(file, 8 + 3 * 8 + 3 + 8 + 8, "a count of points", readPoint);
}

}  // namespace nerfvdb
