// SPDX-License-Identifier: Apache-2.0
// Houses side by side, each on a plot of its own, with an alley to the next: what streets and squares are made of.
// Row frame, metres: x along the row from 0, y from the front plots inwards (no house reaches below 0), z up.
#pragma once

#include <cstdint>

#include "core/types.h"

namespace nerfvdb {

/// Width, height, roof, windows and colour of each house follow from the hash of its place in the row.
class HouseRow {
public:
    HouseRow(int count, double plot_width, std::uint64_t key) : count_(count), plot_(plot_width), key_(key) {}

    /// Never more than the distance to the nearest house, negative inside. Only the house of the point's own plot is
    /// looked at: the others are no nearer than the plot's border and half an alley.
    double distance(const Vec3d& point) const;
    /// The same by looking at every house; the slow and obvious reference.
    double distanceToAll(const Vec3d& point) const;

    /// Colour of the house at whose surface the point lies, without light: an albedo in [0, 1].
    Vec3d albedo(const Vec3d& point, const Vec3d& normal) const;

    double length() const { return count_ * plot_; }

    static constexpr double kHalfAlley = 0.6;  // of the plot, on each side of a house
    static constexpr double kHighest = 16.0;   // no house reaches above

private:
    struct House {
        double half_width, front, back, eaves;   // metres; front and back along y, eaves along z
        double roof_sine, roof_cosine;           // of the pitch
        int windows;                             // side by side
        double hue;                              // [0, 1)
    };
    House house(int number) const;
    int plotOf(double x) const;
    double distanceTo(int number, const Vec3d& point) const;

    int count_;
    double plot_;
    std::uint64_t key_;
};

/// Smooth noise in [-1, 1] with features of a metre, from hashed lattice values; the same on every machine.
double metreNoise(const Vec3d& point);

/// A number in [0, 1) from three whole ones.
double hashedUnit(std::uint64_t key, std::int64_t i, std::int64_t j);

}  // namespace nerfvdb
