// SPDX-License-Identifier: Apache-2.0
// The five small scenes, one question each: solid and textured, hollow, thin, glossy, soft. The composite scene
// is in demo_scene.cpp. All fit into a ball of radius 1.3 about the origin; z is up.
#include "trainer/synthetic_scene.h"

#include <array>
#include <numbers>

#include "core/error.h"
#include "trainer/demo_scene.h"
#include "trainer/solid_scene.h"

namespace nerfvdb {

Vec3d SolidScene::slope(const Vec3d& point) const {
    const double h = 0.2 * edge_;
    Vec3d slope;
    for (int axis = 0; axis < 3; ++axis) {
        const Vec3d step = h * Vec3d::Unit(axis);
        slope[axis] = (distance(point + step) - distance(point - step)) / (2.0 * h);
    }
    return slope;
}

Vec3d SolidScene::normal(const Vec3d& point) const {
    const Vec3d along = slope(point);
    const double length = along.norm();
    return length > 0.0 ? Vec3d(along / length) : Vec3d::UnitZ();
}

namespace {

constexpr double kPi = std::numbers::pi;

Box cube(double half_size) { return {Vec3d::Constant(-half_size), Vec3d::Constant(half_size)}; }

/// A smooth wheel of pleasant colours with period 1: a + b cos(2 pi (x + phase)) per channel.
Vec3d colourWheel(double x) {
    return Vec3d(0.58, 0.50, 0.48) + Vec3d(0.30 * std::cos(2 * kPi * x), 0.28 * std::cos(2 * kPi * (x + 0.30)),
                                           0.34 * std::cos(2 * kPi * (x + 0.58)));
}

/// Solid ball of radius 0.8 with a colourful pattern that depends on the direction from its centre.
class BallScene final : public SolidScene {
public:
    BallScene() : SolidScene(cube(0.85), 120.0, 0.02) {}
    double distance(const Vec3d& p) const override { return ballDistance(p, 0.8); }
    Vec3d diffuse(const Vec3d& p) const override {
        const double r = p.norm();
        if (r == 0.0) return Vec3d::Constant(0.5);  // no direction here, and no eye sees so deep
        const Vec3d n = p / r;
        const double swirl = n.z() + 0.25 * std::sin(4.0 * n.x() + 2.0 * n.z()) * std::cos(5.0 * n.y());
        const double stripes = 0.90 + 0.10 * std::sin(26.0 * swirl);
        return softLight(n) * stripes * colourWheel(0.8 * swirl);
    }
};

/// Hollow bumpy ball, open above: its inside shows another colour than its outside.
class ShellScene final : public SolidScene {
public:
    ShellScene() : SolidScene(cube(0.98), 120.0, 0.015) {}
    double distance(const Vec3d& p) const override {
        // The bumps slope by at most 0.05 * 7 * sqrt(3) along each axis: dividing restores the Lipschitz bound.
        const double wall = (std::abs(p.norm() - 0.78 - bump(p)) - 0.035) / kSteepest;
        return smoothIntersection(wall, p.z() - 0.42, 0.05);
    }
    Vec3d diffuse(const Vec3d& p) const override {
        const bool is_outside = p.norm() > 0.78 + bump(p);
        const Vec3d albedo = is_outside
                                 ? Vec3d(0.24, 0.53, 0.62) + bump(p) * Vec3d(5.0, 4.0, 1.5)
                                 : Vec3d(0.95, 0.62, 0.30) + 0.12 * std::sin(9.0 * p.z()) * Vec3d(0.2, 1, 1);
        return (softLight(normal(p)) * albedo).cwiseMin(1.0).cwiseMax(0.0);
    }

private:
    static constexpr double kSteepest = 1.62;
    static double bump(const Vec3d& p) {
        return 0.05 * std::sin(7.0 * p.x()) * std::sin(7.0 * p.y()) * std::sin(7.0 * p.z());
    }
};

/// Rods, a ladder, a fan of wires and a grid; the thinnest are about one pixel wide at 200 x 200.
class ThinScene final : public SolidScene {
public:
    ThinScene() : SolidScene({{-1.0, -1.0, -0.85}, {1.0, 1.0, 0.95}}, 300.0, 0.006) {
        const auto add = [&](const Vec3d& a, const Vec3d& b, double radius, double hue) {
            rods_.push_back({a, b - a, 1.0 / (b - a).squaredNorm(), radius, colourWheel(hue)});
        };
        // Four posts and their frame.
        for (int i = 0; i < 4; ++i) {
            const double a = kPi * (0.25 + 0.5 * i), c = kPi * (0.75 + 0.5 * i);
            const Vec3d foot(1.2 * 0.7 * std::cos(a), 1.2 * 0.7 * std::sin(a), -0.8);
            const Vec3d next(1.2 * 0.7 * std::cos(c), 1.2 * 0.7 * std::sin(c), -0.8);
            add(foot, foot + Vec3d(0, 0, 1.6), 0.035, 0.03);
            add(foot, next, 0.035, 0.03);
            add(foot + Vec3d(0, 0, 1.6), next + Vec3d(0, 0, 1.6), 0.022, 0.10);
        }
        // A ladder that leans across the frame.
        const Vec3d up(0.55, 0.1, 1.5), left(-0.45, -0.4, -0.75), right(-0.25, 0.35, -0.75);
        add(left, left + up, 0.022, 0.55);
        add(right, right + up, 0.022, 0.55);
        for (int i = 1; i < 8; ++i) add(left + up * (i / 8.0), right + up * (i / 8.0), 0.014, 0.40 + 0.05 * i);
        // A fan of wires between the top of one post and the opposite foot rail.
        for (int i = 0; i < 9; ++i) {
            const double s = -0.5 + i * 0.125;
            add({0.59, 0.59, 0.8}, {s, -0.594, -0.8}, 0.008, 0.62 + 0.04 * i);
        }
        // A grid across one side.
        for (int i = 1; i < 6; ++i) {
            const double s = -0.594 + 1.188 * i / 6.0;
            add({-0.594, s, -0.8}, {-0.594, s, 0.8}, 0.009, 0.80);
            add({-0.594, -0.594, s * 1.3}, {-0.594, 0.594, s * 1.3}, 0.009, 0.90);
        }
    }
    double distance(const Vec3d& p) const override { return nearest(p).distance; }
    Vec3d diffuse(const Vec3d& p) const override {
        const Nearest rod = nearest(p);
        return softLight(rod.from_axis.normalized()) * rods_[rod.index].albedo;
    }

private:
    struct Rod {
        Vec3d begin, along;
        double inverse_length_squared, radius;
        Vec3d albedo;
    };
    struct Nearest {
        double distance = 1e30;
        std::size_t index = 0;
        Vec3d from_axis = Vec3d::UnitZ();
    };
    Nearest nearest(const Vec3d& p) const {
        Nearest best;
        for (std::size_t i = 0; i < rods_.size(); ++i) {
            const Rod& rod = rods_[i];
            const Vec3d from_begin = p - rod.begin;
            const double share = std::clamp(from_begin.dot(rod.along) * rod.inverse_length_squared, 0.0, 1.0);
            const Vec3d from_axis = from_begin - share * rod.along;
            // Compared as squares: most rods are not the nearest, and need no root.
            const double reach = best.distance + rod.radius;
            const double squared = from_axis.squaredNorm();
            if (reach > 0.0 && squared < reach * reach) best = {std::sqrt(squared) - rod.radius, i, from_axis};
        }
        return best;
    }
    std::vector<Rod> rods_;
};

/// A lacquered ball, ring and cushion: radiance = diffuse + a lobe that follows the eye.
class GlossyScene final : public SolidScene {
public:
    GlossyScene() : SolidScene({{-1.05, -1.05, -0.75}, {1.05, 1.05, 0.80}}, 120.0, 0.02) {}
    double distance(const Vec3d& p) const override { return std::min({ball(p), ring(p), cushion(p)}); }
    Vec3d diffuse(const Vec3d& p) const override {
        const double b = ball(p), r = ring(p), c = cushion(p);
        const Vec3d albedo = b < std::min(r, c) ? Vec3d(0.62, 0.09, 0.13)
                             : r < c            ? Vec3d(0.80, 0.58, 0.20)
                                                : Vec3d(0.10, 0.24, 0.42);
        return softLight(normal(p)) * albedo;
    }
    Vec3d radiance(const Vec3d& p, const Vec3d& direction) const override {
        const Vec3d n = normal(p);
        // The sun's highlight, and a sky that grazing angles reflect more (Schlick 1994).
        const double facing = std::clamp(-n.dot(direction), 0.0, 1.0), grazing = std::pow(1.0 - facing, 5.0);
        const Vec3d mirrored = direction - 2.0 * n.dot(direction) * n;
        const double sky = 0.25 + 0.25 * mirrored.z();
        return (diffuse(p) + 0.75 * sunHighlight(n, direction) * Vec3d(1.0, 0.97, 0.90) +
                (0.12 + 0.5 * grazing) * sky * Vec3d(0.80, 0.90, 1.0))
            .cwiseMin(1.0);
    }

private:
    static double ball(const Vec3d& p) { return ballDistance(p - Vec3d(0, 0, 0.20), 0.50); }
    static double ring(const Vec3d& p) { return torusDistance(p - Vec3d(0, 0, -0.28), 0.62, 0.13); }
    static double cushion(const Vec3d& p) {
        return boxDistance(p - Vec3d(0, 0, -0.52), {0.92, 0.92, 0.16}, 0.14);
    }
};

/// Soft Gaussian blobs of optical depth about 1, in colours that change slowly from place to place.
class FogScene final : public SyntheticScene {
public:
    Box bounds() const override { return {{-1.3, -1.3, -1.1}, {1.3, 1.3, 1.1}}; }
    double maxDensity() const override {
        double sum = 0.0;  // an upper bound: no blob peaks where another does
        for (const Blob& blob : kBlobs) sum += amplitude(blob);
        return sum;
    }
    double density(const Vec3d& p) const override {
        if (!bounds().contains(p)) return 0.0;
        double sigma = 0.0;
        for (const Blob& blob : kBlobs) {
            const double r2 = (p - Vec3d(blob.x, blob.y, blob.z)).squaredNorm();
            sigma += amplitude(blob) * std::exp(-0.5 * r2 / (blob.width * blob.width));
        }
        return sigma;
    }
    Vec3d radiance(const Vec3d& p, const Vec3d&) const override { return diffuse(p); }
    Vec3d diffuse(const Vec3d& p) const override {
        return Vec3d(0.60 + 0.35 * std::sin(1.9 * p.x() + 0.4),
                     0.50 + 0.30 * std::sin(2.1 * p.y() - 0.7 * p.x()),
                     0.62 + 0.33 * std::sin(2.3 * p.z() + 1.1 * p.y() + 1.0));
    }
    double emptyRadius(const Vec3d&) const override { return 0.0; }
    double featureLength() const override { return 0.2; }

private:
    struct Blob {
        double x, y, z, width, optical_depth;
    };
    static constexpr std::array<Blob, 4> kBlobs = {{{-0.35, -0.15, 0.05, 0.24, 1.2},
                                                    {0.38, -0.20, -0.15, 0.20, 1.0},
                                                    {0.05, 0.42, 0.10, 0.22, 0.9},
                                                    {0.05, 0.00, 0.48, 0.14, 0.8}}};
    /// The integral of a Gaussian along a line through its centre is amplitude * width * sqrt(2 pi).
    static double amplitude(const Blob& blob) { return blob.optical_depth / (blob.width * std::sqrt(2 * kPi)); }
};

}  // namespace

const std::vector<std::string>& syntheticSceneNames() {
    static const std::vector<std::string> names = {"sphere", "shell", "thin", "glossy", "fog", "demo"};
    return names;
}

std::unique_ptr<SyntheticScene> makeSyntheticScene(const std::string& name) {
    if (name == "sphere") return std::make_unique<BallScene>();
    if (name == "shell") return std::make_unique<ShellScene>();
    if (name == "thin") return std::make_unique<ThinScene>();
    if (name == "glossy") return std::make_unique<GlossyScene>();
    if (name == "fog") return std::make_unique<FogScene>();
    if (name == "demo") return makeDemoScene();
    std::string known;
    for (const std::string& each : syntheticSceneNames()) known += (known.empty() ? "" : ", ") + each;
    throw UsageError("synthetic scene", "'" + name + "'", "one of " + known);
}

}  // namespace nerfvdb
