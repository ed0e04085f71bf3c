// SPDX-License-Identifier: Apache-2.0
#include "trainer/exact_ray.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr int kMaxHalvings = 12;
constexpr double kNegligible = 0.1;  // panels that add less than this share of the tolerance ask for one colour
constexpr double kHeavy = 0.03;      // panels with more of the ray's light than this ask for all five colours
constexpr double kBendShare = 0.2;   // the others ask for three; the finer rule errs far less than the coarser

/// The part of the ray inside a box, t0 >= 0; empty when t0 >= t1. Infinities sort themselves out; 0 * inf
/// cannot occur because an axis without direction is tested by position.
struct Interval {
    double t0 = 0, t1 = std::numeric_limits<double>::infinity();
};
Interval clipToBox(const Ray& ray, const Box& box) {
    Interval inside;
    for (int axis = 0; axis < 3; ++axis) {
        const double o = ray.origin[axis], d = ray.direction[axis];
        if (d == 0.0) {
            if (o < box.min[axis] || o > box.max[axis]) return {0, 0};
            continue;
        }
        const double ta = (box.min[axis] - o) / d, tb = (box.max[axis] - o) / d;
        inside.t0 = std::max(inside.t0, std::min(ta, tb));
        inside.t1 = std::min(inside.t1, std::max(ta, tb));
    }
    return inside;
}

class Integrator {
public:
    Integrator(const SyntheticScene& scene, const Ray& ray, const ExactRayOptions& options)
        : scene_(scene), ray_(ray), options_(options) {}

    RayColour run() {
        const Interval inside = clipToBox(ray_, scene_.bounds());
        const double panel = scene_.featureLength() * options_.panel_scale;
        // Below this, sphere tracing creeps; a panel over a little empty space costs less.
        const double shortest_skip = 0.25 * panel;
        double t = inside.t0;
        Sample first;
        bool have_first = false;
        while (t < inside.t1 && transmittance_ > options_.stop_transmittance) {
            if (!have_first || first.sigma == 0.0) {
                const double skip = scene_.emptyRadius(at(t));
                if (skip > shortest_skip) {
                    t += skip;
                    have_first = false;
                    continue;
                }
            }
            if (!have_first) first = sample(t);
            const double end = std::min(t + panel, inside.t1);
            Sample middle = sample(0.5 * (t + end)), last = sample(end);
            integrate(first, middle, last, 0);
            first = last;
            have_first = true;
            t = end;
        }
        return {colour_, 1.0 - transmittance_};
    }

private:
    struct Sample {
        double t = 0, sigma = 0;
        bool has_colour = false;  // colours cost more than densities: asked for only where they count
        Vec3d rgb = Vec3d::Zero();
    };

    Vec3d at(double t) const { return ray_.origin + t * ray_.direction; }
    Sample sample(double t) const { return {t, scene_.density(at(t)), false, Vec3d::Zero()}; }
    const Vec3d& colour(Sample& s) const {
        if (!s.has_colour) s.rgb = scene_.radiance(at(s.t), ray_.direction);
        s.has_colour = true;
        return s.rgb;
    }

    /// Shares of a panel's light that come from its first, middle and last point; they sum to 1 - exp(-tau).
    struct Weights {
        double tau_middle = 0, tau = 0;  // optical depth up to the middle, up to the end
        double first = 0, middle = 0, last = 0;
    };
    static Weights simpson(double length, double a, double m, double b) {
        Weights w;
        w.tau = length / 6.0 * (a + 4.0 * m + b);
        if (!(w.tau > 0.0)) return w;
        // The parabola may dip below zero beside a steep edge; optical depth never does.
        w.tau_middle = std::max(length / 24.0 * (5.0 * a + 8.0 * m - b), 0.0);
        const double wm = 4.0 * m * std::exp(-w.tau_middle), wb = b * std::exp(-w.tau);
        const double sum = a + wm + wb, alpha = -std::expm1(-w.tau);
        if (sum > 0.0) {
            const double scale = alpha / sum;  // makes the weights sum to alpha, whatever Simpson's error
            w.first = scale * a, w.middle = scale * wm, w.last = scale * wb;
        } else {
            (m > 0.0 ? w.middle : w.last) = alpha;  // so thick that the exponentials above are zero
        }
        return w;
    }

    void integrate(Sample& a, Sample& m, Sample& b, int halvings) {
        Sample am = sample(0.5 * (a.t + m.t)), mb = sample(0.5 * (m.t + b.t));
        const Weights whole = simpson(b.t - a.t, a.sigma, m.sigma, b.sigma);
        const Weights front = simpson(m.t - a.t, a.sigma, am.sigma, m.sigma);
        const Weights back = simpson(b.t - m.t, m.sigma, mb.sigma, b.sigma);
        const double tau = front.tau + back.tau;
        if (tau == 0.0 && whole.tau == 0.0) return;
        const double alpha = -std::expm1(-tau), behind_front = std::exp(-front.tau);

        // Compared in the middle too: at the end alone, two rules that are both wrong may agree by chance.
        double error = transmittance_ * std::max(std::abs(std::exp(-tau) - std::exp(-whole.tau)),
                                                 std::abs(behind_front - std::exp(-whole.tau_middle)));
        Vec3d rgb = Vec3d::Zero();
        if (transmittance_ * alpha <= options_.tolerance * kNegligible) {
            rgb = alpha * colour(m);
        } else if (error <= options_.tolerance || halvings >= kMaxHalvings) {
            const Vec3d ca = colour(a), cm = colour(m), cb = colour(b);
            // The parabola through three colours guesses those between.
            Vec3d cam = 0.375 * ca + 0.75 * cm - 0.125 * cb, cmb = 0.75 * cm + 0.375 * cb - 0.125 * ca;
            double miss = kBendShare * (cm - 0.5 * (ca + cb)).cwiseAbs().maxCoeff();
            if (transmittance_ * alpha > kHeavy) {
                miss = 0.5 * std::max((colour(am) - cam).cwiseAbs().maxCoeff(),
                                      (colour(mb) - cmb).cwiseAbs().maxCoeff());
                cam = am.rgb, cmb = mb.rgb;
            }
            rgb = front.first * ca + front.middle * cam + front.last * cm +
                  behind_front * (back.first * cm + back.middle * cmb + back.last * cb);
            // A thick panel may have its transmittance right and the place where its light comes from wrong.
            const Vec3d rgb_of_whole = whole.first * ca + whole.middle * cm + whole.last * cb;
            error = std::max({error, transmittance_ * alpha * miss,
                              transmittance_ * kBendShare * (rgb - rgb_of_whole).cwiseAbs().maxCoeff()});
        }
        if (error <= options_.tolerance || halvings >= kMaxHalvings) {
            colour_ += transmittance_ * rgb;
            transmittance_ *= std::exp(-tau);
            return;
        }
        integrate(a, am, m, halvings + 1);
        if (transmittance_ > options_.stop_transmittance) integrate(m, mb, b, halvings + 1);
    }

    const SyntheticScene& scene_;
    const Ray& ray_;
    const ExactRayOptions& options_;
    Vec3d colour_ = Vec3d::Zero();
    double transmittance_ = 1.0;
};

}  // namespace

RayColour exactRay(const SyntheticScene& scene, const Ray& ray, const ExactRayOptions& options) {
    return Integrator(scene, ray, options).run();
}

Image exactImage(const SyntheticScene& scene, const Camera& camera) {
    Image image(camera.width, camera.height, 4);
    parallelFor(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < camera.width; ++x) {
            const RayColour light = exactRay(scene, cameraRay(camera, x + 0.5, y + 0.5));
            if (light.opacity * 255.0 < 0.5) continue;
            float* pixel = image.at(x, y);
            for (int c = 0; c < 3; ++c) pixel[c] = static_cast<float>(light.rgb[c] / light.opacity);
            pixel[3] = static_cast<float>(light.opacity);
        }
    });
    return image;
}

}  // namespace nerfvdb
