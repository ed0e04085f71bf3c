// SPDX-License-Identifier: Apache-2.0
#include "trainer/street_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/random.h"
#include "trainer/house_row.h"
#include "trainer/lamp_post.h"
#include "trainer/signed_distance.h"
#include "trainer/solid_scene.h"

namespace nerfvdb {
namespace {

constexpr double kKerb = 3.5, kPavement = 0.12;   // half the road's width; height of the pavement
constexpr double kFronts = 6.2;                   // where plots begin, from the middle
constexpr double kPlot = 12.0;                    // about
constexpr double kPostSpacing = 20.0, kPostLine = 4.0;
constexpr double kPlanterSpacing = 10.0, kPlanterLine = 5.0;
constexpr double kGrass = 8.0;                    // stone goes over into grass, so far from the street
constexpr double kEyeLevel = 1.6, kStation = 5.0;  // metres
constexpr int kViewsPerStation = 3;                // ahead, left, right
constexpr double kFieldOfView = 70.0 * std::numbers::pi / 180.0;  // vertical or horizontal, the smaller

int plotCount(double length) { return std::max(1, static_cast<int>(std::round(length / kPlot))); }

/// x as an offset from the nearest of the places `first`, `first + spacing`, ... within [0, length].
double fromNearest(double x, double first, double spacing, double length) {
    const double last = std::max(std::floor((length - first) / spacing), 0.0);
    return x - first - spacing * std::clamp(std::round((x - first) / spacing), 0.0, last);
}

class StreetScene final : public OpenScene {
public:
    explicit StreetScene(double length)
        : length_(length), left_(plotCount(length), length / plotCount(length), 11),
          right_(plotCount(length), length / plotCount(length), 23) {}

    double distance(const Vec3d& p) const override {
        return std::min({houses(p), lampPostDistance(atPost(p)), planter(atPlanter(p))});
    }

    SurfaceHit ground(const Ray& ray) const override {
        SurfaceHit first;
        const Vec3d &o = ray.origin, &d = ray.direction;
        const auto consider = [&](double t, const Vec3d& normal) {
            if (t > 0 && t < first.t) first = {t, normal};
        };
        const auto height = [&](double y) { return std::abs(y) > kKerb ? kPavement : 0.0; };
        if (d.z() < 0)
            for (const double level : {0.0, kPavement}) {
                const double t = (level - o.z()) / d.z();
                if (height(o.y() + t * d.y()) == level) consider(t, Vec3d::UnitZ());
            }
        if (d.y() != 0)
            for (const double side : {-1.0, 1.0}) {  // the faces of the kerbs, which look at the road
                const double t = (side * kKerb - o.y()) / d.y(), z = o.z() + t * d.z();
                if (side * d.y() > 0 && z > 0 && z < kPavement) consider(t, -side * Vec3d::UnitY());
            }
        return first;
    }

    Vec3d bodyColour(const Vec3d& p, const Vec3d& normal) const override {
        const double post = lampPostDistance(atPost(p)), box = planter(atPlanter(p)), house = houses(p);
        if (post < std::min(box, house)) return lit(lampPostAlbedo(atPost(p)), normal);
        if (box < house) {
            const bool is_box = atPlanter(p).z() < 0.55;
            return lit((is_box ? Vec3d(0.52, 0.47, 0.42) : Vec3d(0.20, 0.36, 0.14)) +
                           Vec3d::Constant(0.08 * metreNoise(5.0 * p)),
                       normal);
        }
        const bool is_left = p.y() > 0;
        const Vec3d n = is_left ? normal : Vec3d(normal.x(), -normal.y(), normal.z());
        return lit((is_left ? left_ : right_).albedo(inRow(p), n), normal);
    }

    Vec3d groundColour(const Vec3d& p, const Vec3d& normal) const override {
        const double far = std::max({-p.x(), p.x() - length_, std::abs(p.y()) - kFronts, 0.0});
        const Vec3d grass(0.36, 0.42, 0.24);
        if (far >= kGrass) return lit(grass, normal);
        Vec3d near;
        if (std::abs(p.y()) > kKerb) {  // slabs of stone
            const double slab = hashedUnit(5, static_cast<std::int64_t>(std::floor(p.x())),
                                           static_cast<std::int64_t>(std::floor(p.y() / 0.8)));
            near = Vec3d(0.58, 0.56, 0.52) + Vec3d::Constant(0.12 * (slab - 0.5));
        } else {  // asphalt, and a broken line in its middle
            const bool is_line = std::abs(p.y()) < 0.08 && p.x() - 4.0 * std::floor(p.x() / 4.0) < 2.0;
            near = is_line ? Vec3d(0.82, 0.81, 0.76) : Vec3d(0.34, 0.34, 0.36);
            near += Vec3d::Constant(0.06 * metreNoise(1.5 * p) + 0.03 * metreNoise(6.0 * p));
        }
        return lit(near + (grass - near) * smoothStep(far / kGrass), normal);
    }

    std::vector<Camera> cameras(Split split, const SyntheticDatasetOptions& options) const override {
        const int n = viewCount(split, options);
        const double shift = hashedUnit(options.seed, 0, 0);
        std::vector<Camera> cameras;
        const double phase = split == Split::train ? 0.5 : split == Split::test ? 0.15 : 0.85;
        for (int i = 0; i < n; ++i) {
            // As far apart as views are many; views of one station look different ways.
            const double share = (i + phase) / n;
            const double x = 2.0 + (length_ - 4.0) * share;
            const double sway = 1.2 * std::sin(2 * std::numbers::pi * (shift + x / 31.0));
            const double turn = (i % kViewsPerStation == 0 ? 0.0 : i % kViewsPerStation == 1 ? 1.1 : -1.1) +
                                0.15 * std::sin(2 * std::numbers::pi * (shift + x / 17.0));
            const Vec3d eye(x, sway, kEyeLevel + 0.1 * std::sin(x));
            const Vec3d ahead(std::cos(turn), std::sin(turn), 0.06);
            const double aspect = static_cast<double>(options.height) / options.width;
            const double fov_y = 2 * std::atan(std::tan(kFieldOfView / 2) * std::max(aspect, 1.0));
            cameras.push_back(lookAt(eye, eye + ahead, Vec3d::UnitZ(), fov_y, options.width, options.height));
        }
        return cameras;
    }

private:
    static Vec3d lit(const Vec3d& albedo, const Vec3d& normal) {
        return (softLight(normal) * albedo).cwiseMax(0.0).cwiseMin(1.0);
    }
    static Vec3d inRow(const Vec3d& p) { return {p.x(), std::abs(p.y()) - kFronts, p.z()}; }
    double houses(const Vec3d& p) const {
        // Those across the street are further than its middle by half its width.
        const double across = std::abs(p.y()) + kFronts;
        return std::min((p.y() > 0 ? left_ : right_).distance(inRow(p)), across);
    }
    Vec3d atPost(const Vec3d& p) const {
        return {fromNearest(p.x(), 0.5 * kPostSpacing, kPostSpacing, length_), kPostLine - std::abs(p.y()),
                p.z() - kPavement};
    }
    Vec3d atPlanter(const Vec3d& p) const {
        return {fromNearest(p.x(), 0.25 * kPlanterSpacing, kPlanterSpacing, length_), std::abs(p.y()) - kPlanterLine,
                p.z() - kPavement};
    }
    static double planter(const Vec3d& q) {
        return std::min(boxDistance(q - Vec3d(0, 0, 0.25), {0.4, 0.4, 0.25}, 0.03),
                        ballDistance(q - Vec3d(0, 0, 0.85), 0.45));
    }

    double length_;
    HouseRow left_, right_;
};

}  // namespace

std::unique_ptr<OpenScene> makeStreetScene(double length) {
    if (!(length >= kShortestStreet && length <= kLongestStreet))
        throw UsageError("--length", std::to_string(length) + " m",
                         std::to_string(static_cast<int>(kShortestStreet)) + " to " +
                             std::to_string(static_cast<int>(kLongestStreet)) + " m");
    return std::make_unique<StreetScene>(length);
}

int streetViews(double length) {
    return std::max(kViewsPerStation, static_cast<int>(std::round(kViewsPerStation * length / kStation)));
}

}  // namespace nerfvdb
