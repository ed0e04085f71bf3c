// SPDX-License-Identifier: Apache-2.0
#include "vdb/sky.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "core/range_coder.h"

namespace nerfvdb {
namespace {

constexpr int kMinWidth = 4, kMaxWidth = 8192;
constexpr float kMaxValue = 8;     // its sigmoid is 0.9997: beyond it 8 bits show nothing new
constexpr float kCodeStep = 1.0f / 64;  // at most 0.002 of colour

constexpr std::size_t kRowsATask = 16;

bool isWidth(int width) { return width >= kMinWidth && width <= kMaxWidth && width % 2 == 0; }

}  // namespace

Sky::Sky(int width, const Vec3f& color) : width_(width) {
    if (!isWidth(width)) throw UsageError("sky", "a width of " + std::to_string(width), "an even number, 4 to 8192");
    values_.resize(static_cast<std::size_t>(width) * height() * 3);
    for (std::size_t i = 0; i < values_.size(); ++i) {
        const float c = std::clamp(color[static_cast<int>(i % 3)], 1e-3f, 1 - 1e-3f);
        values_[i] = std::log(c / (1 - c));
    }
}

Sky::Sight Sky::look(const float* direction) const {
    constexpr auto kPi = static_cast<float>(M_PI);
    const float longitude = std::atan2(direction[1], direction[0]) / (2 * kPi) + 0.5f;
    const float latitude = std::acos(std::clamp(direction[2], -1.0f, 1.0f)) / kPi;
    const float x = longitude * static_cast<float>(width_) - 0.5f;
    const float y = std::clamp(latitude * static_cast<float>(height()) - 0.5f, 0.0f, static_cast<float>(height() - 1));
    const int x0 = static_cast<int>(std::floor(x)), y0 = std::min(static_cast<int>(y), height() - 2);
    const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
    const auto texel = [&](int column, int row) {
        return 3 * static_cast<std::uint32_t>(row * width_ + (column + width_) % width_);
    };
    Sight sight{{texel(x0, y0), texel(x0 + 1, y0), texel(x0, y0 + 1), texel(x0 + 1, y0 + 1)},
              {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy},
              {}};
    for (int c = 0; c < 3; ++c) {
        float value = 0;
        for (int t = 0; t < 4; ++t) value += sight.weight[t] * values_[sight.texel[t] + c];
        sight.color[c] = 1 / (1 + std::exp(-value));
    }
    return sight;
}

void Sky::backward(const Sight& sight, const Vec3f& dl_dcolor, std::span<float> dl_dvalues) {
    for (int c = 0; c < 3; ++c) {
        const float dl_dvalue = dl_dcolor[c] * sight.color[c] * (1 - sight.color[c]);
        for (int t = 0; t < 4; ++t) dl_dvalues[sight.texel[t] + c] += sight.weight[t] * dl_dvalue;
    }
}

void Sky::smooth(float pull, std::vector<float>& scratch) {
    const std::size_t row = static_cast<std::size_t>(width_) * 3, n_rows = static_cast<std::size_t>(height());
    scratch.resize(values_.size());
    parallelRanges(n_rows, kRowsATask, [&](std::size_t first, std::size_t last) {
        for (std::size_t y = first; y < last; ++y) {
            const float* const here = &values_[y * row];
            const float* const above = y > 0 ? here - row : here;
            const float* const below = y + 1 < n_rows ? here + row : here;
            float* const moved = &scratch[y * row];
            const auto move = [&](std::size_t i, float left, float right) {
                const float mean = 0.25f * (left + right + above[i] + below[i]);
                moved[i] = std::clamp(here[i] + pull * (mean - here[i]), -kMaxValue, kMaxValue);
            };
            for (std::size_t i = 0; i < 3; ++i) move(i, here[row - 3 + i], here[i + 3]);
            for (std::size_t i = 3; i + 3 < row; ++i) move(i, here[i - 3], here[i + 3]);
            for (std::size_t i = row - 3; i < row; ++i) move(i, here[i - 3], here[i + 3 - row]);
        }
    });
    values_.swap(scratch);
}

std::string Sky::encode() const {
    RangeEncoder out;
    std::array<IntegerModel, 3> models;
    IntegerModel width_model;
    width_model.encode(out, width_);
    std::array<int, 3> last{};
    for (std::size_t i = 0; i < values_.size(); ++i) {
        const int code = static_cast<int>(std::lround(values_[i] / kCodeStep));
        models[i % 3].encode(out, code - last[i % 3]);
        last[i % 3] = code;
    }
    return out.finish();
}

Sky Sky::decode(std::span<const std::uint8_t> bytes, const std::string& where) {
    RangeDecoder in(bytes);
    std::array<IntegerModel, 3> models;
    IntegerModel width_model;
    const std::int64_t width = width_model.decode(in);
    if (width < kMinWidth || width > kMaxWidth || width % 2)
        throw DataError(where, "a sky " + std::to_string(width) + " texels wide", "an even number, 4 to 8192");
    // A value costs 1/64 bit at the very least (BitModel); more cannot be true and must not be allocated.
    const std::int64_t n_values = width * (width / 2) * 3;
    if (n_values / 1024 > static_cast<std::int64_t>(bytes.size()))
        throw DataError(where, std::to_string(bytes.size()) + " bytes", "enough for a sky " + std::to_string(width) +
                                                                          " texels wide");
    Sky sky(static_cast<int>(width), Vec3f::Zero());
    std::array<std::int64_t, 3> last{};
    for (std::size_t i = 0; i < sky.values_.size() && !in.ranDry(); ++i) {
        last[i % 3] += models[i % 3].decode(in);
        sky.values_[i] = std::clamp(static_cast<float>(last[i % 3]) * kCodeStep, -kMaxValue, kMaxValue);
    }
    if (!in.atEnd()) throw DataError(where, "a sky of another length", "the one that was coded");
    return sky;
}

}  // namespace nerfvdb
