// SPDX-License-Identifier: Apache-2.0
// Layout, little-endian:
//   uint32 lenses, uint32 cameras
//   each lens:   int32 width, height; double fx, fy, cx, cy, k1, k2, k3, p1, p2
//   each camera: uint32 lens, uint8 held_out (0 or 1), double world_from_camera (9, column by column), position (3),
//                uint32 length of the name, the name (UTF-8)
#include "vdb/camera_codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <filesystem>
#include <type_traits>

#include "core/error.h"

namespace nerfvdb {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");

constexpr std::size_t kMaxNameBytes = 4096;

/// Everything of a camera but its pose.
struct Lens {
    std::int32_t width, height;
    std::array<double, 9> numbers;
    bool operator==(const Lens& other) const {  // bit by bit: -0.0 is not 0.0
        return width == other.width && height == other.height &&
               std::memcmp(numbers.data(), other.numbers.data(), sizeof numbers) == 0;
    }
};

constexpr std::size_t kLensBytes = 2 * sizeof(std::int32_t) + 9 * sizeof(double);
constexpr std::size_t kLeastCameraBytes = 2 * sizeof(std::uint32_t) + 1 + 12 * sizeof(double);  // without a name

Lens lensOf(const Camera& c) {
    const Distortion& d = c.distortion;
    return {c.width, c.height, {c.fx, c.fy, c.cx, c.cy, d.k1, d.k2, d.k3, d.p1, d.p2}};
}

Camera cameraOf(const Lens& lens) {
    const auto& [fx, fy, cx, cy, k1, k2, k3, p1, p2] = lens.numbers;
    Camera camera;
    camera.width = lens.width;
    camera.height = lens.height;
    camera.fx = fx, camera.fy = fy;
    camera.cx = cx, camera.cy = cy;
    camera.distortion = {k1, k2, k3, p1, p2};
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

/// Takes numbers from the front of bytes; too few are a DataError.
class ByteReader {
public:
    ByteReader(std::span<const std::uint8_t> bytes, const std::string& where) : rest_(bytes), where_(where) {}

    std::span<const std::uint8_t> take(std::size_t count, const char* what) {
        if (rest_.size() < count)
            throw DataError(where_, std::to_string(rest_.size()) + " bytes at the end",
                            std::to_string(count) + " of " + what);
        const auto taken = rest_.first(count);
        rest_ = rest_.subspan(count);
        return taken;
    }
    template <typename T>
    T number(const char* what) {
        T value;
        std::memcpy(&value, take(sizeof value, what).data(), sizeof value);
        return value;
    }
    std::size_t left() const { return rest_.size(); }

private:
    std::span<const std::uint8_t> rest_;
    const std::string& where_;
};

Lens readLens(ByteReader& in) {
    Lens lens;
    lens.width = in.number<std::int32_t>("an image's width");
    lens.height = in.number<std::int32_t>("an image's height");
    for (double& value : lens.numbers) value = in.number<double>("a lens");
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
    append(out, static_cast<std::uint32_t>(lenses.size()));
    append(out, static_cast<std::uint32_t>(cameras.size()));
    for (const Lens& lens : lenses) {
        append(out, lens.width);
        append(out, lens.height);
        append(out, lens.numbers);
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
    const auto lens_count = in.number<std::uint32_t>("a count of lenses");
    const auto camera_count = in.number<std::uint32_t>("a count of cameras");
    // Before anything is allocated for them.
    if (in.left() / kLensBytes < lens_count || (in.left() - lens_count * kLensBytes) / kLeastCameraBytes < camera_count)
        throw DataError(where, std::to_string(bytes.size()) + " bytes",
                        "enough for " + std::to_string(camera_count) + " cameras with " + std::to_string(lens_count) +
                            " lenses");
    std::vector<Lens> lenses;
    for (std::uint32_t i = 0; i < lens_count; ++i) lenses.push_back(readLens(in));
    std::vector<ModelCamera> cameras;
    for (std::uint32_t i = 0; i < camera_count; ++i)
        cameras.push_back(readCamera(in, lenses, where + "[" + std::to_string(i) + "]"));
    if (in.left() > 0)
        throw DataError(where, std::to_string(in.left()) + " bytes after the last camera", "none");
    return cameras;
}

}  // namespace nerfvdb
