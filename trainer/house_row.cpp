// SPDX-License-Identifier: Apache-2.0
#include "trainer/house_row.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/random.h"
#include "trainer/signed_distance.h"

namespace nerfvdb {
namespace {

constexpr double kStorey = 3.0, kPlinth = 0.6, kDepth = 9.0;
constexpr double kMostSetback = 1.2;         // behind the plot's front
constexpr double kWindowHalfWidth = 0.5, kWindowHalfHeight = 0.75, kRecess = 0.18;
constexpr double kSill = 1.7;                // of a window's middle above its floor

/// Of the nearest of `count` places, `spacing` apart and symmetric about 0: the offset to it.
double fromNearest(double x, double spacing, int count) {
    const double first = -0.5 * spacing * (count - 1);
    return x - first - spacing * std::clamp(std::round((x - first) / spacing), 0.0, count - 1.0);
}

}  // namespace

double hashedUnit(std::uint64_t key, std::int64_t i, std::int64_t j) {
    return (randomBits(key, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(j)) >> 11) * 0x1p-53;
}

double metreNoise(const Vec3d& point) {
    const Vec3d low = point.array().floor(), share = (point - low).unaryExpr([](double x) { return smoothStep(x); });
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d bit(corner >> 2, corner >> 1 & 1, corner & 1);
        const Vec3d weight = (bit.array() > 0).select(share, Vec3d::Ones() - share);
        const Vec3d at = low + bit;
        sum += weight.prod() * hashedUnit(static_cast<std::uint64_t>(static_cast<std::int64_t>(at.z())),
                                          static_cast<std::int64_t>(at.x()), static_cast<std::int64_t>(at.y()));
    }
    return 2.0 * sum - 1.0;
}

HouseRow::House HouseRow::house(int number) const {
    const auto chance = [&](int what) { return hashedUnit(key_, number, what); };
    House house;
    house.half_width = 0.5 * plot_ - kHalfAlley - 0.6 * chance(0);
    house.front = kMostSetback * chance(1);
    house.back = house.front + kDepth;
    const int storeys = 2 + static_cast<int>(3 * chance(2));
    house.eaves = kPlinth + kStorey * storeys;
    const double pitch = chance(3) < 0.3 ? 0.0 : 0.35 + 0.25 * chance(4);  // flat, or 20 to 34 degrees
    house.roof_sine = std::sin(pitch), house.roof_cosine = std::cos(pitch);
    house.windows = std::max(1, static_cast<int>(2 * house.half_width / (2.0 + chance(5))));
    house.hue = chance(6);
    return house;
}

int HouseRow::plotOf(double x) const {
    return static_cast<int>(std::clamp(std::floor(x / plot_), 0.0, count_ - 1.0));
}

double HouseRow::distanceTo(int number, const Vec3d& point) const {
    const House h = house(number);
    const double x = point.x() - (number + 0.5) * plot_, y = point.y(), z = point.z();
    // Walls and the two slopes of the roof; the ridge runs along the row.
    const double walls = std::max({std::abs(x) - h.half_width, h.front - y, y - h.back});
    const double roof = h.roof_cosine * (z - h.eaves) + h.roof_sine * std::max(h.front - y, y - h.back);
    const double body = std::max(walls, roof);
    // Windows are cut into the front; the walls alone decide further away than a recess is deep.
    if (body > 2 * kRecess || y - h.front > 2 * kRecess) return body;
    const double across = fromNearest(x, 2 * h.half_width / h.windows, h.windows);
    const int storeys = static_cast<int>(std::round((h.eaves - kPlinth) / kStorey));
    const double middle = kPlinth + kSill + 0.5 * kStorey * (storeys - 1);
    const double up = fromNearest(z - middle, kStorey, storeys);
    const double recess =
        std::max({std::abs(across) - kWindowHalfWidth, std::abs(up) - kWindowHalfHeight, y - h.front - kRecess});
    return std::max(body, -recess);
}

double HouseRow::distance(const Vec3d& point) const {
    const int number = plotOf(point.x());
    double border = std::numeric_limits<double>::infinity();
    if (number > 0) border = point.x() - number * plot_;
    if (number + 1 < count_) border = std::min(border, (number + 1) * plot_ - point.x());
    const Vec3d to_others(border + kHalfAlley, std::max(-point.y(), 0.0), std::max(point.z() - kHighest, 0.0));
    return std::min(distanceTo(number, point), to_others.norm());
}

double HouseRow::distanceToAll(const Vec3d& point) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (int number = 0; number < count_; ++number) nearest = std::min(nearest, distanceTo(number, point));
    return nearest;
}

Vec3d HouseRow::albedo(const Vec3d& point, const Vec3d& normal) const {
    const int number = plotOf(point.x());
    const House h = house(number);
    const double x = point.x() - (number + 0.5) * plot_;
    if (normal.z() > 0.5) {  // roof: rows of tiles
        const double tile = 0.04 * std::sin(20.0 * point.y()) + 0.08 * metreNoise(2.0 * point);
        return Vec3d(0.55, 0.30, 0.22) + Vec3d::Constant(tile) + 0.15 * (h.hue - 0.5) * Vec3d(0.2, 0.8, 1.0);
    }
    if (point.y() - h.front > 0.5 * kRecess && point.y() - h.front < 2 * kRecess && normal.y() < -0.5) {
        const double across = fromNearest(x, 2 * h.half_width / h.windows, h.windows);
        const double up = std::fmod(point.z() - kPlinth, kStorey) - kSill;
        const bool is_frame = std::abs(across) < 0.04 || std::abs(up - 0.2) < 0.04;
        return is_frame ? Vec3d(0.85, 0.84, 0.80) : Vec3d(Vec3d(0.16, 0.22, 0.28) + 0.12 * (up + 0.75) * Vec3d(1, 1.2, 1.4));
    }
    const double pi2 = 6.283185307179586;
    const Vec3d wall = Vec3d(0.66, 0.58, 0.48) + 0.16 * Vec3d(std::cos(pi2 * h.hue), std::cos(pi2 * (h.hue + 0.3)),
                                                              std::cos(pi2 * (h.hue + 0.6)));
    // Courses of stone, each shifted by half a stone, each stone a little different.
    const double along = std::abs(normal.x()) > 0.5 ? point.y() : x;
    const auto course = static_cast<std::int64_t>(std::floor(point.z() / 0.4));
    const double stone = std::floor(along / 0.8 + 0.5 * static_cast<double>(course & 1));
    const double tint = hashedUnit(key_ + 1, static_cast<std::int64_t>(stone), course) - 0.5;
    const double dirt = 0.08 * metreNoise(0.7 * point) - (point.z() < kPlinth ? 0.15 : 0.0);
    return (wall + Vec3d::Constant(0.10 * tint + dirt)).cwiseMax(0.05).cwiseMin(0.95);
}

}  // namespace nerfvdb
