// SPDX-License-Identifier: Apache-2.0
#include "vdb/sky.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

Sky randomSky(int width, float spread = 3) {
    Sky sky(width, Vec3f::Constant(0.5f));
    for (std::size_t i = 0; i < sky.values().size(); ++i)
        sky.values()[i] = spread * (2 * unitFloat(static_cast<std::uint32_t>(randomBits(4, width, i))) - 1);
    return sky;
}

Vec3f toward(double longitude, double latitude) {
    return Vec3d(std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude), std::sin(latitude))
        .cast<float>();
}

std::span<const std::uint8_t> bytesOf(const std::string& text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

TEST_CASE("a new sky has one colour in every direction") {
    const Sky sky(16, Vec3f(0.1f, 0.5f, 0.9f));
    CHECK(sky.height() == 8);
    for (int i = 0; i < 50; ++i)
        CHECK((sky.at(toward(0.3 * i, -1.5 + 0.06 * i).data()) - Vec3f(0.1f, 0.5f, 0.9f)).norm() < 1e-6f);
    // Colours at the ends of the range, which no sigmoid reaches, come as near as 1 in 1000.
    CHECK(Sky(4, Vec3f(0, 1, 0.5f)).at(toward(0, 0).data()).isApprox(Vec3f(0.001f, 0.999f, 0.5f), 1e-4f));
}

TEST_CASE("texels of a sky lie about the z axis: columns by longitude from -x on, rows from above") {
    Sky sky(8, Vec3f::Constant(0.5f));
    const auto set = [&](int row, int column) { sky.values()[3 * (static_cast<std::size_t>(row) * 8 + column)] = 4; };
    set(0, 1);
    set(3, 6);
    const double texel = M_PI / 4;
    CHECK(sky.at(toward(-M_PI + 1.5 * texel, M_PI / 2 - 0.5 * texel).data()).x() == Approx(1 / (1 + std::exp(-4.0))));
    CHECK(sky.at(toward(-M_PI + 6.5 * texel, -M_PI / 2 + 0.5 * texel).data()).x() == Approx(1 / (1 + std::exp(-4.0))));
    CHECK(sky.at(toward(-M_PI + 6.5 * texel, M_PI / 2 - 0.5 * texel).data()).x() == Approx(0.5));
}

TEST_CASE("a sky has no seam, and at the poles no more than its texels tell") {
    const Sky sky = randomSky(32);
    // Values differ by up to 6 from texel to texel of 2 pi / 32, and the sigmoid's slope is 1/4: 7.6 a radian.
    constexpr double kStep = 1e-4, kSlope = 7.7;
    for (int i = 1; i < 40; ++i) {
        const double latitude = -M_PI / 2 + M_PI * i / 40;
        const Vec3f before = sky.at(toward(M_PI - kStep, latitude).data());
        const Vec3f behind = sky.at(toward(-M_PI + kStep, latitude).data());
        CHECK((before - behind).cwiseAbs().maxCoeff() < 2 * kStep * kSlope + 1e-5);
    }
    for (const double pole : {-M_PI / 2, M_PI / 2})
        for (int i = 0; i < 16; ++i) {
            // Along a meridian up to the pole nothing jumps.
            const double longitude = 0.4 * i;
            const Vec3f there = sky.at(toward(longitude, pole).data());
            const Vec3f near = sky.at(toward(longitude, pole * (1 - 1e-4)).data());
            CHECK(there.allFinite());
            CHECK((there - near).cwiseAbs().maxCoeff() < 0.01);  // half of a texel from the pole its row alone speaks
        }
    for (const Vec3f& axis : {Vec3f(0, 0, 1), Vec3f(0, 0, -1), Vec3f(-1, 0, 0), Vec3f(-1, -0.0f, 0), Vec3f(0, 0, 1.0000001f)})
        CHECK(sky.at(axis.data()).allFinite());
}

TEST_CASE("the slope of a sky's colour agrees with central differences") {
    Sky sky = randomSky(8, 1.5f);
    const Vec3f dl_dcolor(0.7f, -1.3f, 0.4f);
    for (const Vec3f& direction : {toward(0.3, 0.4), toward(3.1, -0.9), toward(-2.0, 1.5), toward(-3.1, 0.01)}) {
        std::vector<float> slopes(sky.values().size(), 1.0f);  // backward adds
        Sky::backward(sky.look(direction.data()), dl_dcolor, slopes);
        double sum = 0;
        for (std::size_t i = 0; i < slopes.size(); ++i) {
            // Colours are exact to 1e-7: over a step of 0.02 that is 1e-5; the sigmoid's bend adds 1e-5.
            const float h = 0.01f, before = sky.values()[i];
            sky.values()[i] = before + h;
            const double up = sky.at(direction.data()).dot(dl_dcolor);
            sky.values()[i] = before - h;
            const double down = sky.at(direction.data()).dot(dl_dcolor);
            sky.values()[i] = before;
            CHECK(slopes[i] - 1 == Approx((up - down) / (2 * h)).margin(5e-5));
            sum += std::abs(slopes[i] - 1);
        }
        CHECK(sum > 0.3);
    }
}

TEST_CASE("smoothing draws texels to their neighbours' mean and keeps values in range") {
    std::vector<float> scratch;
    Sky flat(16, Vec3f(0.2f, 0.4f, 0.6f));
    const std::vector<float> before(flat.values().begin(), flat.values().end());
    flat.smooth(0.7f, scratch);
    for (std::size_t i = 0; i < before.size(); ++i) CHECK(flat.values()[i] == Approx(before[i]).epsilon(1e-6));

    Sky sky(16, Vec3f::Constant(0.5f));
    sky.values()[3 * (3 * 16)] = 4;  // red, row 3, first column: the last one is beside it
    sky.smooth(0.5f, scratch);
    CHECK(sky.values()[3 * (3 * 16)] == 2);
    for (const int neighbour : {3 * 16 + 1, 3 * 16 + 15, 2 * 16, 4 * 16}) CHECK(sky.values()[3 * neighbour] == 0.5f);
    CHECK(sky.values()[3 * (3 * 16) + 1] == 0);

    // Rows of several tasks, against the formula.
    Sky tall = randomSky(96, 2);
    const std::vector<float> old(tall.values().begin(), tall.values().end());
    tall.smooth(0.3f, scratch);
    const auto at = [&](int x, int y, int c) { return old[3 * (std::clamp(y, 0, 47) * 96 + (x + 96) % 96) + c]; };
    for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 96; ++x)
            for (int c = 0; c < 3; ++c) {
                const float mean = 0.25f * (at(x - 1, y, c) + at(x + 1, y, c) + at(x, y - 1, c) + at(x, y + 1, c));
                CHECK(tall.values()[3 * (y * 96 + x) + c] == Approx(at(x, y, c) + 0.3f * (mean - at(x, y, c))).margin(1e-6));
            }

    Sky wild(8, Vec3f::Constant(0.5f));
    for (float& value : wild.values()) value = 1e6f;
    wild.smooth(0.1f, scratch);
    for (const float value : wild.values()) CHECK(value == 8);
}

TEST_CASE("what was decoded encodes to the same bytes, within a step of what went in") {
    const Sky sky = randomSky(64, 7);
    const std::string bytes = sky.encode();
    const Sky decoded = Sky::decode(bytesOf(bytes), "here");
    REQUIRE(decoded.width() == 64);
    double worst = 0;
    for (std::size_t i = 0; i < sky.values().size(); ++i)
        worst = std::max(worst, static_cast<double>(std::abs(decoded.values()[i] - sky.values()[i])));
    CHECK(worst <= 0.5 / 64);
    const bool same = decoded.encode() == bytes;
    CHECK(same);
}

TEST_CASE("bytes that are no sky are refused, with the place") {
    using Catch::Matchers::Contains;
    const std::string bytes = randomSky(16).encode();
    for (const std::size_t length : {std::size_t{0}, std::size_t{1}, bytes.size() / 2, bytes.size() - 3})
        CHECK_THROWS_WITH(Sky::decode(bytesOf(bytes.substr(0, length)), "model.vdb: sky"), Contains("model.vdb: sky"));
    CHECK_THROWS_AS(Sky::decode(bytesOf(bytes + std::string(40, '\7')), "here"), DataError);
    int n_refused = 0;
    for (int i = 0; i < 200; ++i) {
        std::string garbage(64, '\0');
        for (std::size_t k = 0; k < garbage.size(); ++k) garbage[k] = static_cast<char>(randomBits(9, i, k));
        try {
            const Sky sky = Sky::decode(bytesOf(garbage), "here");
            for (const float value : sky.values()) REQUIRE(std::abs(value) <= 8);
        } catch (const DataError&) {
            ++n_refused;
        }
    }
    CHECK(n_refused > 190);
}

TEST_CASE("a sky has an even width from 4 to 8192") {
    for (const int width : {0, -2, 2, 3, 7, 8194}) CHECK_THROWS_AS(Sky(width, Vec3f::Zero()), UsageError);
    for (const int width : {4, 6, 30}) {
        const Sky sky(width, Vec3f::Constant(0.3f));
        CHECK(sky.values().size() == static_cast<std::size_t>(width * width / 2 * 3));
        CHECK(sky.at(toward(1, 1.57).data()).allFinite());
    }
    CHECK(Sky().isEmpty());
}
