// SPDX-License-Identifier: Apache-2.0
// Layout, little-endian:
//   uint32 0xffffffff, uint32 version (2), uint32 lenses, uint32 cameras
//   each lens:   int32 width, height; double fx, fy, cx, cy, k1, k2, k3, p1, p2, k4, k5, k6; uint8 lens model
//                (0 perspective, 1 fisheye)
//   each camera: uint32 lens, uint8 held_out (0 or 1), double world_from_camera (9, column by column), position (3),
//                uint32 length of the name, the name (UTF-8)
// Version 1, which is still read, begins with the count of lenses, and its lenses end with p2: all are perspective.
#include "vdb/camera_codec.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <type_traits>

#include "core/byte_reader.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kMaxNameBytes = 4096;
constexpr std::uint32_t kIsVersioned = 0xffffffffu;  // where version 1 has its count of lenses
constexpr std::uint32_t kVersion = 2;

/// Everything of a camera but its pose.
struct Lens {
    std::int32_t width, height;
    std::array<double, 12> numbers;
    LensModel model = LensModel::perspective;
    bool operator==(const Lens& other) const {  // bit by bit: -0.0 is not 0.0
        return width == other.width && height == other.height && model == other.model &&
               std::memcmp(numbers.data(), other.numbers.data(), sizeof numbers) == 0;
    }
};

constexpr std::size_t kNumbersInVersion1 = 9;
constexpr std::size_t kLeastCameraBytes = 2 * sizeof(std::uint32_t) + 1 + 12 * sizeof(double);  // without a name

constexpr std::size_t lensBytes(std::uint32_t version) {
    return 2 * sizeof(std::int32_t) + (version == 1 ? kNumbersInVersion1 * sizeof(double) : sizeof Lens::numbers + 1);
}

Lens lensOf(const Camera& c) {
    const Distortion& d = c.distortion;
    return {c.width, c.height, {c.fx, c.fy, c.cx, c.cy, d.k1, d.k2, d.k3, d.p1, d.p2, d.k4, d.k5, d.k6}, d.model};
}

Camera cameraOf(const Lens& lens) {
    const auto& [fx, fy, cx, cy, k1, k2, k3, p1, p2, k4, k5, k6] = lens.numbers;
    Camera camera;
    camera.width = lens.width;
    camera.height = lens.height;
    camera.fx = fx, camera.fy = fy;
    camera.cx = cx, camera.cy = cy;
    camera.distortion = {k1, k2, k3, p1, p2, k4, k5, k6, lens.model};
    return camera;
}

/// What is wrong with a name, or nothing. An empty one is no file's.
std::string nameProblem(const std::string& name) {
    if (name.size() > kMaxNameBytes) return "a name of " + std::to_string(name.size()) + " bytes";
    if (std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
        return "a name with control characters";
    const std::filesystem::path path(name);
    if (path.is_absolute() || std::find(path.begin(), path.end(), "..") != path.end()) return "the name '" + name + "'";
    return {};
}

constexpr const char* kNameExpected = "a path inside the data set's folder, of at most 4096 bytes";

template <typename T>
void append(std::string& out, const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

Lens readLens(ByteReader& in, std::uint32_t version, const std::string& where) {
    Lens lens{};
    lens.width = in.number<std::int32_t>("an image's width");
    lens.height = in.number<std::int32_t>("an image's height");
    const std::size_t n_numbers = version == 1 ? kNumbersInVersion1 : lens.numbers.size();
    for (std::size_t i = 0; i < n_numbers; ++i) lens.numbers[i] = in.number<double>("a lens");
    if (version == 1) return lens;
    const auto model = in.number<std::uint8_t>("a lens model");
    if (model > static_cast<std::uint8_t>(LensModel::fisheye))
        throw DataError(where + ".lens_model", std::to_string(model), "0 or 1");
    lens.model = static_cast<LensModel>(model);
    return lens;
}

ModelCamera readCamera(ByteReader& in, std::span<const Lens> lenses, const std::string& where) {
    const auto lens = in.number<std::uint32_t>("a lens index");
    if (lens >= lenses.size())
        throw DataError(where + ".lens", std::to_string(lens), "less than " + std::to_string(lenses.size()));
    const auto held_out = in.number<std::uint8_t>("a mark");
    if (held_out > 1) throw DataError(where + ".held_out", std::to_string(held_out), "0 or 1");

    ModelCamera result;
    result.held_out = held_out == 1;
    result.camera = cameraOf(lenses[lens]);
    for (double& value : result.camera.world_from_camera.reshaped()) value = in.number<double>("a pose");
    for (double& value : result.camera.position) value = in.number<double>("a position");
    if (const std::string problem = cameraProblem(result.camera); !problem.empty())
        throw DataError(where, problem, "a usable camera");

    const auto length = in.number<std::uint32_t>("a name's length");
    const auto name = in.take(length, "a name");
    result.name.assign(name.begin(), name.end());
    if (const std::string problem = nameProblem(result.name); !problem.empty())
        throw DataError(where + ".name", problem, kNameExpected);
    return result;
}

}  // namespace

std::string encodeCameras(std::span<const ModelCamera> cameras) {
    std::vector<Lens> lenses;
    std::vector<std::uint32_t> lens_of;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        const std::string where = "model: cameras[" + std::to_string(i) + "]";
        if (const std::string problem = cameraProblem(cameras[i].camera); !problem.empty())
            throw UsageError(where, problem, "a usable camera");
        if (const std::string problem = nameProblem(cameras[i].name); !problem.empty())
            throw UsageError(where, problem, kNameExpected);
        const Lens lens = lensOf(cameras[i].camera);
        // Most often the one before; captures of many lenses have few all the same.
        auto known = std::find(lenses.rbegin(), lenses.rend(), lens);
        if (known == lenses.rend()) {
            lenses.push_back(lens);
            known = lenses.rbegin();
        }
        lens_of.push_back(static_cast<std::uint32_t>(lenses.rend() - known - 1));
    }

    std::string out;
    append(out, kIsVersioned);
    append(out, kVersion);
    append(out, static_cast<std::uint32_t>(lenses.size()));
    append(out, static_cast<std::uint32_t>(cameras.size()));
    for (const Lens& lens : lenses) {
        append(out, lens.width);
        append(out, lens.height);
        append(out, lens.numbers);
        append(out, lens.model);
    }
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        const Camera& camera = cameras[i].camera;
        append(out, lens_of[i]);
        append(out, static_cast<std::uint8_t>(cameras[i].held_out));
        for (const double value : camera.world_from_camera.reshaped()) append(out, value);
        for (const double value : camera.position) append(out, value);
        append(out, static_cast<std::uint32_t>(cameras[i].name.size()));
        out += cameras[i].name;
    }
    return out;
}

std::vector<ModelCamera> decodeCameras(std::span<const std::uint8_t> bytes, const std::string& where) {
    ByteReader in(bytes, where);
    auto lens_count = in.number<std::uint32_t>("a count of lenses");
    std::uint32_t version = 1;
    if (lens_count == kIsVersioned) {
        version = in.number<std::uint32_t>("a version");
        if (version != kVersion)
            throw DataError(where + ".version", std::to_string(version), std::to_string(kVersion) + " or none",
                            "a newer nerfvdb wrote these cameras: update this program");
        lens_count = in.number<std::uint32_t>("a count of lenses");
    }
    const auto camera_count = in.number<std::uint32_t>("a count of cameras");
    // Before anything is allocated for them.
    const std::size_t lens_bytes = lensBytes(version);
    if (in.left() / lens_bytes < lens_count || (in.left() - lens_count * lens_bytes) / kLeastCameraBytes < camera_count)
        throw DataError(where, std::to_string(bytes.size()) + " bytes",
                        "enough for " + std::to_string(camera_count) + " cameras with " + std::to_string(lens_count) +
                            " lenses");
    std::vector<Lens> lenses;
    for (std::uint32_t i = 0; i < lens_count; ++i) lenses.push_back(readLens(in, version, where));
    std::vector<ModelCamera> cameras;
    for (std::uint32_t i = 0; i < camera_count; ++i)
        cameras.push_back(readCamera(in, lenses, where + "[" + std::to_string(i) + "]"));
    if (in.left() > 0)
        throw DataError(where, std::to_string(in.left()) + " bytes after the last camera", "none");
    return cameras;
}

}  // namespace nerfvdb
