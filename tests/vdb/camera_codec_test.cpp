// SPDX-License-Identifier: Apache-2.0
#include "vdb/camera_codec.h"

#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;
using Catch::Matchers::Contains;

namespace {

/// Cameras around the origin; every third has a lens of its own, the last is held out.
std::vector<ModelCamera> someCameras(int count = 7) {
    std::vector<ModelCamera> cameras;
    for (int i = 0; i < count; ++i) {
        ModelCamera entry;
        entry.name = "train/r_" + std::to_string(i) + ".png";
        entry.camera = lookAt({3 * std::cos(0.7 * i), 3 * std::sin(0.7 * i), 0.1 * i}, Vec3d::Zero(), Vec3d::UnitZ(),
                              0.7, 640, 480);
        if (i % 3 == 1) entry.camera.cx += 0.1 * i, entry.camera.distortion = {0.01 * i, -0.02, 0.003, 1e-4, -2e-4};
        if (i == 5) entry.camera.distortion = {0.1, 0.02, 0.003, 1e-4, -2e-4, 0.11, 0.01, 0.001};
        if (i == 6) entry.camera.distortion = {0.1, 0.02, 0.003, 0, 0, -0.001, 0, 0, LensModel::fisheye};
        entry.held_out = i + 1 == count;
        cameras.push_back(entry);
    }
    return cameras;
}

bool sameCamera(const Camera& a, const Camera& b) {
    const Distortion &d = a.distortion, &e = b.distortion;
    return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx &&
           a.cy == b.cy && d.k1 == e.k1 && d.k2 == e.k2 && d.k3 == e.k3 && d.p1 == e.p1 && d.p2 == e.p2 &&
           d.k4 == e.k4 && d.k5 == e.k5 && d.k6 == e.k6 && d.model == e.model &&
           a.world_from_camera == b.world_from_camera && a.position == b.position;
}

std::vector<ModelCamera> decoded(const std::string& bytes) {
    return decodeCameras({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "m.vdb: nerfvdb_cameras");
}

std::string refusal(const std::string& bytes) {
    try {
        decoded(bytes);
    } catch (const DataError& error) {
        return error.what();
    }
    return "no error";
}

constexpr std::size_t kFirstLens = 16, kLensBytes = 105;

}  // namespace

TEST_CASE("cameras come back bit by bit, and encode to the same bytes") {
    const std::vector<ModelCamera> cameras = someCameras();
    const std::string bytes = encodeCameras(cameras);
    const std::vector<ModelCamera> back = decoded(bytes);
    REQUIRE(back.size() == cameras.size());
    for (std::size_t i = 0; i < back.size(); ++i) {
        CHECK(back[i].name == cameras[i].name);
        CHECK(back[i].held_out == cameras[i].held_out);
        CHECK(sameCamera(back[i].camera, cameras[i].camera));
    }
    CHECK(encodeCameras(back) == bytes);
    CHECK(decoded(encodeCameras({})).empty());
}

TEST_CASE("a lens that cameras share is written once") {
    std::vector<ModelCamera> cameras = someCameras(1);
    const std::size_t one = encodeCameras(cameras).size();
    cameras.push_back(cameras[0]);
    const std::size_t two = encodeCameras(cameras).size();
    cameras.back().camera.fx += 1;
    CHECK(encodeCameras(cameras).size() == two + kLensBytes);
    CHECK(two - one == one - kFirstLens - kLensBytes);
}

TEST_CASE("cameras as they were written before fisheyes load still") {
    // Version 1: counts, a lens that ends with p2, a camera.
    std::string bytes;
    const auto add = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
    add(std::uint32_t{1}), add(std::uint32_t{1});
    add(std::int32_t{640}), add(std::int32_t{480});
    for (const double value : {500.0, 501.0, 320.0, 240.0, 0.01, -0.02, 0.003, 1e-4, -2e-4}) add(value);
    add(std::uint32_t{0}), add(std::uint8_t{1});
    for (const double value : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 4.0, 5.0, 6.0}) add(value);
    add(std::uint32_t{5});
    bytes += "a.png";
    for (std::size_t size = 0; size < bytes.size(); ++size)
        CHECK_THAT(refusal(bytes.substr(0, size)), Contains("m.vdb: nerfvdb_cameras"));

    const std::vector<ModelCamera> cameras = decoded(bytes);
    REQUIRE(cameras.size() == 1);
    CHECK(cameras[0].name == "a.png");
    CHECK(cameras[0].held_out);
    Camera expected;
    expected.width = 640, expected.height = 480;
    expected.fx = 500, expected.fy = 501, expected.cx = 320, expected.cy = 240;
    expected.distortion = {0.01, -0.02, 0.003, 1e-4, -2e-4};
    expected.position = Vec3d(4, 5, 6);
    CHECK(sameCamera(cameras[0].camera, expected));
}

TEST_CASE("cameras that are none, and names that tell of a machine, are not written") {
    std::vector<ModelCamera> cameras = someCameras(3);
    for (const char* name : {"/home/someone/r_0.png", "../r_0.png", "train/../../r_0.png", "a\nb.png"}) {
        cameras[1].name = name;
        CHECK_THROWS_AS(encodeCameras(cameras), UsageError);
    }
    cameras[1].name = std::string(5000, 'a');
    CHECK_THROWS_WITH(encodeCameras(cameras), Contains("cameras[1]") && Contains("5000 bytes"));
    cameras[1].name = "";  // no file's
    CHECK(decoded(encodeCameras(cameras))[1].name.empty());
    cameras[1].name = "images/..a..b.png";
    CHECK(decoded(encodeCameras(cameras))[1].name == "images/..a..b.png");
    cameras[1].camera.fx = NAN;
    CHECK_THROWS_WITH(encodeCameras(cameras), Contains("cameras[1]") && Contains("focal length"));
}

TEST_CASE("wrong bytes are refused, with the field and what was found") {
    const std::string good = encodeCameras(someCameras(3));  // two lenses
    for (std::size_t size = 0; size < good.size(); ++size)
        CHECK_THAT(refusal(good.substr(0, size)), Contains("m.vdb: nerfvdb_cameras") && Contains("expected"));
    CHECK_THAT(refusal(good + "x"), Contains("1 bytes after the last camera"));

    const auto with = [&](std::size_t at, const auto& value) {
        std::string bytes = good;
        std::memcpy(&bytes[at], &value, sizeof value);
        return refusal(bytes);
    };
    const std::uint32_t many = 0xffffffffu;
    CHECK_THAT(with(8, many), Contains("enough for 3 cameras with 4294967295 lenses"));
    CHECK_THAT(with(12, many), Contains("enough for 4294967295 cameras"));
    CHECK_THAT(with(4, std::uint32_t{3}), Contains("nerfvdb_cameras.version: found 3, expected 2 or none; a newer nerfvdb"));
    CHECK_THAT(with(kFirstLens + 104, std::uint8_t{2}), Contains("nerfvdb_cameras.lens_model: found 2, expected 0 or 1"));
    CHECK_THAT(with(kFirstLens + 104, std::uint8_t{1}), !Contains("found"));  // without terms any lens is a fisheye
    CHECK_THAT(with(kFirstLens, std::int32_t{-640}), Contains("nerfvdb_cameras[0]: found image size -640x480"));
    CHECK_THAT(with(kFirstLens + 8, double{NAN}), Contains("nerfvdb_cameras[0]: found focal length"));
    CHECK_THAT(with(kFirstLens + 40, double{INFINITY}), Contains("distortion is not finite"));
    const std::size_t camera = kFirstLens + 2 * kLensBytes;
    CHECK_THAT(with(camera, std::uint32_t{2}), Contains("nerfvdb_cameras[0].lens: found 2, expected less than 2"));
    CHECK_THAT(with(camera + 4, std::uint8_t{2}), Contains("nerfvdb_cameras[0].held_out: found 2, expected 0 or 1"));
    CHECK_THAT(with(camera + 5, double{2}), Contains("pose is not rigid"));
    CHECK_THAT(with(camera + 5 + 72, double{NAN}), Contains("pose is not finite"));
    const std::size_t name = camera + 5 + 96 + 4;
    CHECK_THAT(with(name, '/'), Contains("nerfvdb_cameras[0].name: found the name '/rain/r_0.png'"));
    CHECK_THAT(with(name, '\0'), Contains("control characters"));
    CHECK_THAT(with(name - 4, many), Contains("expected 4294967295 of a name"));
}

TEST_CASE("random damage never does worse than a DataError") {
    const std::string good = encodeCameras(someCameras(4));
    int refused = 0;
    for (std::uint64_t i = 0; i < 2000; ++i) {
        std::string bytes = good;
        bytes[randomBits(3, i, 0) % bytes.size()] ^= static_cast<char>(1 + randomBits(3, i, 1) % 255);
        refused += refusal(bytes) != "no error";
    }
    CHECK(refused > 100);  // low bits of numbers and letters of names make other cameras that are as good
}
