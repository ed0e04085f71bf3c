// SPDX-License-Identifier: Apache-2.0
#include "trainer/demo_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "trainer/light_grid.h"
#include "trainer/solid_scene.h"

namespace nerfvdb {
namespace {

const Box kBounds{{-1.06, -1.06, -0.76}, {1.06, 1.06, 1.04}};
const Vec3d kCentre(0, 0, 0.30);     // of the ornament
constexpr double kRadius = 0.66;     // of the ornament
constexpr double kHollow = 0.40;     // radius of the space around the core
constexpr double kFrequency = 8.6;   // of the gyroid: phase per world unit
constexpr double kThickness = 0.30;  // of its sheet, as a value of the gyroid's function
// The plinth: a drum on a wider foot.
constexpr double kPlinthTop = -0.44;
constexpr double kFootRadius = 1.0, kFootHalf = 0.06, kDrumRadius = 0.86, kDrumHalf = 0.10, kEdgeRound = 0.025;
const Vec3d kFoot(0, 0, kPlinthTop - 0.22), kDrum(0, 0, kPlinthTop - kDrumHalf);

/// sin x cos y + sin y cos z + sin z cos x (Schoen's gyroid is where it vanishes), x = kFrequency * q.x and so
/// on, and its derivative in x, y, z: |slope| <= sqrt(3), reached where all phases are zero.
struct Gyroid {
    double value;
    Vec3d slope;
};
Gyroid gyroid(const Vec3d& q) {
    // One by one: the compiler then makes a single call of each sine and cosine.
    const double x = kFrequency * q.x(), y = kFrequency * q.y(), z = kFrequency * q.z();
    const double sx = std::sin(x), cx = std::cos(x), sy = std::sin(y), cy = std::cos(y);
    const double sz = std::sin(z), cz = std::cos(z);
    return {sx * cy + sy * cz + sz * cx, {cx * cy - sz * sx, cy * cz - sx * sy, cz * cx - sy * sz}};
}

class DemoScene final : public SolidScene {
public:
    DemoScene() : SolidScene(kBounds, 150.0, 0.012), light_(*this) {}

    double distance(const Vec3d& p) const override { return nearest(p).distance; }
    Vec3d slope(const Vec3d& p) const override { return slope(p, nearest(p).body); }
    Vec3d diffuse(const Vec3d& p) const override { return display(shade(p).light); }
    Vec3d radiance(const Vec3d& p, const Vec3d& direction) const override {
        const Shaded s = shade(p);
        return display(s.light + s.gloss * sunHighlight(s.normal, direction));
    }

private:
    enum class Body { ornament, core, foot, drum, holder, rim };
    struct Nearest {
        double distance;
        Body body;
    };
    Nearest nearest(const Vec3d& p) const {
        Nearest best{ornament(p), Body::ornament};
        const auto consider = [&](double d, Body body) {
            if (d < best.distance) best = {d, body};
        };
        consider(ballDistance(p - kCentre, 0.27), Body::core);
        consider(discDistance(p - kFoot, kFootRadius, kFootHalf, kEdgeRound), Body::foot);
        consider(discDistance(p - kDrum, kDrumRadius, kDrumHalf, kEdgeRound), Body::drum);
        consider(torusDistance(p - Vec3d(0, 0, kPlinthTop + 0.035), 0.36, 0.055), Body::holder);
        consider(torusDistance(p - Vec3d(0, 0, kPlinthTop - 0.005), 0.835, 0.024), Body::rim);
        return best;
    }
    static Vec3d slope(const Vec3d& p, Body body) {
        const double r = std::max(length(p.x(), p.y()), 1e-12);
        const auto fromRing = [&](double ring_radius, double height) {
            const double outwards = 1.0 - ring_radius / r;
            return Vec3d(p.x() * outwards, p.y() * outwards, p.z() - height).normalized();
        };
        switch (body) {
            case Body::ornament:
                return ornamentSlope(p - kCentre, gyroid(p - kCentre));
            case Body::core:
                return (p - kCentre).normalized();
            case Body::holder:
                return fromRing(0.36, kPlinthTop + 0.035);
            case Body::rim:
                return fromRing(0.835, kPlinthTop - 0.005);
            case Body::foot:
                return discSlope(p - kFoot, kFootRadius, kFootHalf, kEdgeRound);
            case Body::drum:
                return discSlope(p - kDrum, kDrumRadius, kDrumHalf, kEdgeRound);
        }
        return Vec3d::UnitZ();
    }

    /// A gyroid sheet, cut to a ball and hollowed around the core, its edges rounded.
    static double ornament(const Vec3d& p) {
        const Vec3d q = p - kCentre;
        const double r = q.norm();
        if (r > kRadius + 0.1) return r - kRadius;  // a lower bound is all that rays need out there
        if (r < kHollow - 0.1) return kHollow - r;
        const double sheet = sheetDistance(gyroid(q).value);
        return smoothIntersection(smoothIntersection(sheet, r - kRadius, kRound), kHollow - r, kRound);
    }
    static Vec3d ornamentSlope(const Vec3d& q, const Gyroid& g) {
        const double r = q.norm();
        if (r == 0.0) return Vec3d::Zero();
        if (r > kRadius + 0.1) return q / r;
        if (r < kHollow - 0.1) return -q / r;
        const double sheet = sheetDistance(g.value), cut = smoothIntersection(sheet, r - kRadius, kRound);
        const double of_ball = smoothIntersectionShare(sheet, r - kRadius, kRound);
        const double of_hollow = smoothIntersectionShare(cut, kHollow - r, kRound);
        const Vec3d sheet_slope = (g.value < 0.0 ? -1.0 : 1.0) / std::numbers::sqrt3 * g.slope;
        return (1.0 - of_hollow) * ((1.0 - of_ball) * sheet_slope + of_ball * q / r) - of_hollow * q / r;
    }
    static constexpr double kRound = 0.05;
    static double sheetDistance(double gyroid_value) {
        return (std::abs(gyroid_value) - kThickness) / (kFrequency * std::numbers::sqrt3);
    }

    struct Shaded {
        Vec3d light;  // scene-linear, before display()
        Vec3d gloss;  // what a full highlight adds
        Vec3d normal;
    };

    Shaded shade(const Vec3d& p) const {
        const Body body = nearest(p).body;
        const LightGrid::Light share = light_.at(p);
        Vec3d n, albedo, gloss, glow = Vec3d::Zero();
        if (body == Body::ornament) {
            const Vec3d q = p - kCentre;
            const Gyroid g = gyroid(q);
            const double r = q.norm();
            n = ornamentSlope(q, g).normalized();
            albedo = porcelain(r, g.value);
            gloss = Vec3d::Constant(0.35);
            // Light that the golden core throws back on the inner walls.
            const double inwards = std::max(-n.dot(q / r), 0.0);
            glow = albedo.cwiseProduct(Vec3d(0.50, 0.24, 0.06)) * inwards * smoothStep((0.64 - r) / 0.26);
        } else {
            n = slope(p, body);
            const bool is_enamel = body == Body::foot || body == Body::drum;
            albedo = is_enamel ? enamel(p) : Vec3d(0.80, 0.46, 0.12);
            gloss = is_enamel ? Vec3d::Constant(0.15) : Vec3d(0.9, 0.62, 0.25);
        }
        const double sun = 2.0 * share.sun * std::max(n.dot(sunDirection()), 0.0);
        const double up = 0.5 + 0.5 * n.z();
        const Vec3d sky = share.sky * (up * Vec3d(0.58, 0.66, 0.80) + (1.0 - up) * Vec3d(0.30, 0.24, 0.20));
        return {albedo.cwiseProduct(sun * Vec3d(1.0, 0.93, 0.82) + sky) + glow, share.sun * gloss, n};
    }

    /// White at the outside; inwards coral on one side of the sheet, teal on the other.
    static Vec3d porcelain(double r, double gyroid_value) {
        const Vec3d white(0.86, 0.82, 0.74), coral(0.84, 0.19, 0.09), teal(0.02, 0.34, 0.42);
        const double depth = smoothStep((kRadius - 0.02 - r) / 0.20);
        const double side = smoothStep(0.5 + 4.0 * gyroid_value);
        return (1.0 - depth) * white + depth * (side * coral + (1.0 - side) * teal);
    }

    /// Night-blue, with a band of coloured tiles around the drum and a rosette on top.
    static Vec3d enamel(const Vec3d& p) {
        const Vec3d night(0.018, 0.042, 0.12), ivory(0.78, 0.72, 0.58);
        const double angle = std::atan2(p.y(), p.x()), r = length(p.x(), p.y());
        if (p.z() < kPlinthTop - 0.165) return night;
        if (p.z() < kPlinthTop - 0.03) {
            const double height = (p.z() - kPlinthTop + 0.095) / 0.055;
            const double tile = smoothStep(0.5 + 3.0 * (0.75 - std::abs(height))) *
                                smoothStep(0.5 + 2.5 * std::sin(18.0 * angle));
            const double hue = 0.5 + 0.5 * std::sin(2.0 * angle);
            const Vec3d tint = hue * Vec3d(0.80, 0.20, 0.09) + (1.0 - hue) * Vec3d(0.04, 0.42, 0.46);
            return (1.0 - tile) * night + tile * tint;
        }
        const double petals = 0.62 + 0.09 * std::cos(12.0 * angle);
        const double inlay = smoothStep(0.5 + 30.0 * (0.018 - std::abs(r - petals)));
        const double field = smoothStep(0.5 + 30.0 * (petals - r));
        const Vec3d ground = (1.0 - field) * night + field * Vec3d(0.03, 0.22, 0.28);
        return (1.0 - inlay) * ground + inlay * ivory;
    }

    /// From light without a ceiling to sRGB values: a soft shoulder, then a square root for sRGB's curve.
    static Vec3d display(const Vec3d& light) { return (1.0 - (-1.35 * light.array()).exp()).sqrt(); }

    LightGrid light_;
};

}  // namespace

std::unique_ptr<SyntheticScene> makeDemoScene() { return std::make_unique<DemoScene>(); }

}  // namespace nerfvdb
