// SPDX-License-Identifier: Apache-2.0
// What is so far behind the scene that only its direction counts: a small learned panorama (environment map).
// Latitude and longitude about the world's z axis, values bilinear between texels, colours their sigmoid.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

class Sky {
public:
    /// No sky: what is behind the scene has one colour, and at() and look() must not be called.
    Sky() = default;
    /// height = width / 2 texels, all of one colour (sRGB values). Throws UsageError unless width is even, 4 to 8192.
    Sky(int width, const Vec3f& color);

    bool isEmpty() const { return values_.empty(); }
    int width() const { return width_; }
    int height() const { return width_ / 2; }
    /// sRGB values in (0, 1) in a direction (unit, world).
    Vec3f at(const float* direction) const { return look(direction).color; }
    /// What is seen in a direction, and the four texels that it is made of.
    struct Sight {
        std::array<std::uint32_t, 4> texel;  // numbers of their first values
        std::array<float, 4> weight;
        Vec3f color;
    };
    /// at(direction) with what the way back needs.
    Sight look(const float* direction) const;
    /// Adds to dl_dvalues [height][width][3] what a loss says that changes with sight.color by dl_dcolor.
    static void backward(const Sight& sight, const Vec3f& dl_dcolor, std::span<float> dl_dvalues);
    /// Moves each texel the share `pull` of the way to the mean of its neighbours: what no ray sees follows what is
    /// seen. `scratch` is working memory; what values() gave before is of the old values.
    void smooth(float pull, std::vector<float>& scratch);

    /// [height][width][3], before the sigmoid.
    std::span<float> values() { return values_; }
    std::span<const float> values() const { return values_; }

    /// Values rounded to 1/64, as bytes; and back. `where` names the place for the DataError that wrong bytes raise.
    /// What was decoded encodes to the same bytes again.
    std::string encode() const;
    static Sky decode(std::span<const std::uint8_t> bytes, const std::string& where);

private:
    int width_ = 0;
    std::vector<float> values_;
};

}  // namespace nerfvdb
