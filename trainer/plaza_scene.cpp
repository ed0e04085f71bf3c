// SPDX-License-Identifier: Apache-2.0
#include "trainer/plaza_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "trainer/house_row.h"
#include "trainer/lamp_post.h"
#include "trainer/signed_distance.h"
#include "trainer/solid_scene.h"

namespace nerfvdb {
namespace {

constexpr double kFronts = 20.0;                // of the houses, from the middle
constexpr int kPlots = 3;                       // on each side
constexpr double kPlot = 12.0;
constexpr double kPosts = 12.0;                 // lamp posts stand on the diagonals, so far along x and y
constexpr double kRing = 7.0, kEyeLevel = 1.7;  // of the cameras
constexpr double kFieldOfView = 60.0 * std::numbers::pi / 180.0;  // vertical or horizontal, the smaller
const Vec3d kMiddle(0, 0, 1.3);                 // what the cameras look at

class PlazaScene final : public OpenScene {
public:
    PlazaScene() {
        for (int side = 0; side < 4; ++side) rows_.emplace_back(kPlots, kPlot, 31 + static_cast<std::uint64_t>(side));
    }

    double distance(const Vec3d& p) const override {
        return std::min({monument(p).first, houses(p), lampPostDistance(atPost(p))});
    }

    SurfaceHit ground(const Ray& ray) const override {
        const double t = -ray.origin.z() / ray.direction.z();
        return ray.direction.z() < 0 && t > 0 ? SurfaceHit{t, Vec3d::UnitZ()} : SurfaceHit{};
    }

    Vec3d bodyColour(const Vec3d& p, const Vec3d& normal) const override {
        const auto [of_monument, part] = monument(p);
        const double post = lampPostDistance(atPost(p)), house = houses(p);
        if (of_monument < std::min(post, house)) {
            const double veins = 0.10 * metreNoise(3.0 * p) + 0.06 * std::sin(14.0 * p.z() + 3.0 * metreNoise(2.0 * p));
            const Vec3d albedo[3] = {{0.70, 0.66, 0.58}, {0.30, 0.46, 0.40}, {0.74, 0.52, 0.24}};
            return lit(albedo[part] + Vec3d::Constant(veins), normal);
        }
        if (post < house) return lit(lampPostAlbedo(atPost(p)), normal);
        const Place place = placeOf(p);
        return lit(rows_[static_cast<std::size_t>(place.side)].albedo(place.point, turned(normal, place.side)), normal);
    }

    Vec3d groundColour(const Vec3d& p, const Vec3d& normal) const override {
        const Vec3d grass(0.36, 0.42, 0.24);
        const double r = length(p.x(), p.y()), angle = std::atan2(p.y(), p.x()), far = (r - 1.5 * kFronts) / 10.0;
        if (far >= 1) return lit(grass, normal);
        const double stone = hashedUnit(7, static_cast<std::int64_t>(std::floor(p.x() / 0.6)),
                                        static_cast<std::int64_t>(std::floor(p.y() / 0.6)));
        Vec3d near = Vec3d(0.60, 0.54, 0.46) + Vec3d::Constant(0.16 * (stone - 0.5) + 0.06 * metreNoise(0.8 * p));
        const double rose = smoothStep(0.5 + 2.0 * std::sin(16.0 * angle)) * smoothStep((6.0 - r) / 0.3);
        near += rose * (Vec3d(0.36, 0.28, 0.26) - near);
        return lit(near + (grass - near) * smoothStep(far), normal);
    }

    std::vector<Camera> cameras(Split split, const SyntheticDatasetOptions& options) const override {
        const int n = viewCount(split, options);
        const double turn = hashedUnit(options.seed, 0, 0);
        const double aspect = static_cast<double>(options.height) / options.width;
        const double fov_y = 2 * std::atan(std::tan(kFieldOfView / 2) * std::max(aspect, 1.0));
        const double phase = split == Split::train ? 0.0 : split == Split::test ? 0.37 : 0.71;
        std::vector<Camera> cameras;
        for (int i = 0; i < n; ++i) {
            const double around = 2 * std::numbers::pi * (turn + (i + phase) / n);
            // Up and down and to and fro on the way round, so that no two splits take the same path.
            const double wave = std::sin(5 * around + 2 * std::numbers::pi * phase);
            const double radius = kRing + 0.8 * std::cos(3 * around + 7 * phase);
            const Vec3d eye(radius * std::cos(around), radius * std::sin(around), kEyeLevel + 0.7 * wave);
            cameras.push_back(lookAt(eye, kMiddle, Vec3d::UnitZ(), fov_y, options.width, options.height));
        }
        return cameras;
    }

private:
    static Vec3d lit(const Vec3d& albedo, const Vec3d& normal) {
        return (softLight(normal) * albedo).cwiseMax(0.0).cwiseMin(1.0);
    }

    /// A vector turned by quarters about the vertical, so that the side's houses lie towards +y.
    static Vec3d turned(const Vec3d& v, int side) {
        switch (side) {
            case 0: return v;
            case 1: return {-v.y(), v.x(), v.z()};
            case 2: return {-v.x(), -v.y(), v.z()};
            default: return {v.y(), -v.x(), v.z()};
        }
    }
    struct Place {
        int side;
        Vec3d point;  // in the frame of the side's row
    };
    static Place placeOf(const Vec3d& p) {
        const int side = std::abs(p.y()) >= std::abs(p.x()) ? (p.y() >= 0 ? 0 : 2) : (p.x() >= 0 ? 1 : 3);
        const Vec3d q = turned(p, side);
        return {side, {q.x() + 0.5 * kPlots * kPlot, q.y() - kFronts, q.z()}};
    }
    /// Only the own side's houses are looked at: the others begin behind the diagonal, and this far from it.
    double houses(const Vec3d& p) const {
        const Place place = placeOf(p);
        constexpr double kBehind = (kFronts - 0.5 * kPlots * kPlot) / std::numbers::sqrt2;
        const double diagonal = std::abs(std::abs(p.x()) - std::abs(p.y())) / std::numbers::sqrt2;
        return std::min(rows_[static_cast<std::size_t>(place.side)].distance(place.point), diagonal + kBehind);
    }

    static Vec3d atPost(const Vec3d& p) {
        return {std::abs(p.x()) - kPosts, kPosts - std::abs(p.y()), p.z()};
    }

    /// Steps, a drum, a ball in a ring; and which of their materials is nearest.
    static std::pair<double, int> monument(const Vec3d& p) {
        const double steps = std::min(discDistance(p - Vec3d(0, 0, 0.1), 1.6, 0.12, 0.02),
                                      discDistance(p - Vec3d(0, 0, 0.3), 1.2, 0.12, 0.02));
        const double drum = discDistance(p - Vec3d(0, 0, 0.9), 0.6, 0.6, 0.04);
        const double ball = ballDistance(p - Vec3d(0, 0, 2.05), 0.55);
        const double ring = torusDistance(p - Vec3d(0, 0, 2.05), 0.85, 0.09);
        const double stone = std::min(steps, drum);
        if (stone <= std::min(ball, ring)) return {stone, 0};
        return ball <= ring ? std::pair{ball, 1} : std::pair{ring, 2};
    }

    std::vector<HouseRow> rows_;
};

}  // namespace

std::unique_ptr<OpenScene> makePlazaScene() { return std::make_unique<PlazaScene>(); }

}  // namespace nerfvdb
