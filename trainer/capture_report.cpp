// SPDX-License-Identifier: Apache-2.0
#include "trainer/capture_report.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "core/parallel.h"
#include "trainer/scene_box.h"

namespace nerfvdb {
namespace {

constexpr double kFlat = 0.02;           // of the longest axis: what is shorter counts for nothing
constexpr double kSameRotation = 1e-6;   // poses are printed with six digits or more
constexpr double kSamePosition = 1e-6;   // of the cameras' extent
constexpr double kRounding = 1e-12;      // of the largest coordinate: a double's, through a rotation or two
constexpr std::size_t kNamesTold = 3;
constexpr std::size_t kFewViews = 20;
constexpr double kParallel_deg = 2;      // where commonFocus gives up
constexpr double kSmallAngle_deg = 10;   // less than a stride around a thing that stands a few metres away

using Views = std::vector<const CaptureView*>;

double degrees(double rad) { return rad * 180 / M_PI; }

double angleBetween(const Vec3d& a, const Vec3d& b) {
    return degrees(std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)));
}

Vec3d opticalAxis(const Camera& camera) { return -camera.world_from_camera.col(2); }

bool sees(const Camera& camera, const Vec3d& point) {
    const std::optional<Vec2d> pixel = projectPoint(camera, point);
    return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() <= camera.width && pixel->y() <= camera.height;
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (std::size_t i = 0; i < std::min(words.size(), kNamesTold); ++i) text += (i > 0 ? ", " : "") + words[i];
    if (words.size() > kNamesTold) text += " and " + std::to_string(words.size() - kNamesTold) + " more";
    return text;
}

std::string sizeName(const SizeCount& size) {
    return std::to_string(size.width) + "x" + std::to_string(size.height);
}

void countLenses(const Views& views, CaptureReport& report) {
    std::map<std::pair<int, int>, std::size_t> sizes;
    std::set<std::array<double, 11>> lenses;
    for (const CaptureView* view : views) {
        const Camera& c = view->camera;
        const Distortion& d = c.distortion;
        ++sizes[{c.width, c.height}];
        lenses.insert({static_cast<double>(c.width), static_cast<double>(c.height), c.fx, c.fy, c.cx, c.cy, d.k1, d.k2,
                       d.k3, d.p1, d.p2});
    }
    report.lenses = lenses.size();
    for (const auto& [size, count] : sizes) report.sizes.push_back({size.first, size.second, count});
    std::stable_sort(report.sizes.begin(), report.sizes.end(),
                     [](const SizeCount& a, const SizeCount& b) { return a.views > b.views; });
}

/// Where the cameras stand: bounds, and principal axes of the positions.
void measurePositions(const Views& views, CaptureReport& report) {
    Box& box = report.camera_bounds;
    box = {views.front()->camera.position, views.front()->camera.position};
    Vec3d mean = Vec3d::Zero();
    for (const CaptureView* view : views) {
        box.min = box.min.cwiseMin(view->camera.position);
        box.max = box.max.cwiseMax(view->camera.position);
        mean += view->camera.position / static_cast<double>(views.size());
    }
    Mat3d covariance = Mat3d::Zero();
    for (const CaptureView* view : views) {
        const Vec3d from_mean = view->camera.position - mean;
        covariance += from_mean * from_mean.transpose() / static_cast<double>(views.size());
    }
    const Vec3d variances = Eigen::SelfAdjointEigenSolver<Mat3d>(covariance).eigenvalues();  // the smallest first
    report.position_spread = variances.reverse().cwiseMax(0).cwiseSqrt();
    const double longest = report.position_spread[0];
    const double rounding = kRounding * box.min.cwiseAbs().cwiseMax(box.max.cwiseAbs()).maxCoeff();
    if (longest <= rounding) return;
    report.position_rank = 1;
    for (int axis = 1; axis < 3; ++axis) report.position_rank += report.position_spread[axis] > kFlat * longest;
}

void measureDirections(const Views& views, CaptureReport& report) {
    Dataset cameras;
    Vec3d mean = Vec3d::Zero(), positions = Vec3d::Zero();  // of the optical axes; of the positions
    for (const CaptureView* view : views) {
        cameras.views.push_back({view->camera, {}, {}});
        mean += opticalAxis(view->camera);
        positions += view->camera.position / static_cast<double>(views.size());
    }
    if (mean.norm() > 0)
        for (const CaptureView* view : views)
            report.mean_angle_deg += angleBetween(opticalAxis(view->camera), mean) / static_cast<double>(views.size());
    report.middle = commonFocus(cameras);
    // Axes that meet nowhere: what these cameras look at lies ahead, as far as can be told.
    const double extent = report.camera_bounds.size().norm();
    if (report.mean_angle_deg < kParallel_deg && (report.middle - positions).norm() <= kSamePosition * extent)
        report.middle += extent * mean.normalized();
    std::vector<Vec3d> lines_of_sight;
    for (const CaptureView* view : views)
        if (sees(view->camera, report.middle)) lines_of_sight.push_back(report.middle - view->camera.position);
    report.see_middle = lines_of_sight.size();
    for (std::size_t i = 0; i < lines_of_sight.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            report.widest_angle_deg = std::max(report.widest_angle_deg, angleBetween(lines_of_sight[i], lines_of_sight[j]));
}

/// Points in a view's picture, at distances that suit the capture.
std::vector<Vec3d> probes(const Camera& camera, double extent) {
    constexpr int kAcross = 3;
    std::vector<Vec3d> points;
    for (int y = 0; y < kAcross; ++y)
        for (int x = 0; x < kAcross; ++x) {
            const Ray ray = cameraRay(camera, camera.width * (x + 0.5) / kAcross, camera.height * (y + 0.5) / kAcross);
            for (double t = extent / 8; t <= 32 * extent; t *= 2) points.push_back(ray.origin + t * ray.direction);
        }
    return points;
}

void findLonely(const Views& views, CaptureReport& report) {
    const std::size_t n = views.size();
    if (n < 2) return;
    const double size = report.camera_bounds.size().norm();
    const double extent = size > 0 ? size : 1.0;
    std::vector<char> is_alone(n, 0);
    parallelFor(n, [&](std::size_t i) {
        const std::vector<Vec3d> points = probes(views[i]->camera, extent);
        const auto shares = [&](std::size_t j) {
            return std::any_of(points.begin(), points.end(),
                               [&](const Vec3d& point) { return sees(views[j]->camera, point); });
        };
        // Neighbours in the order of the files first: they mostly share something.
        for (std::size_t step = 1; step < n; ++step)
            if (shares((i + step) % n)) return;
        is_alone[i] = 1;
    });
    for (std::size_t i = 0; i < n; ++i)
        if (is_alone[i]) report.alone.push_back(views[i]->name);
}

void findDuplicates(const Views& views, CaptureReport& report) {
    const Box& box = report.camera_bounds;
    const double tolerance = std::max(kSamePosition * box.size().maxCoeff(),
                                      kRounding * box.min.cwiseAbs().cwiseMax(box.max.cwiseAbs()).maxCoeff());
    std::vector<std::size_t> order(views.size());  // along x: equal positions stand near each other
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return views[a]->camera.position.x() < views[b]->camera.position.x();
    });
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < order.size(); ++i)
        for (std::size_t j = i + 1; j < order.size(); ++j) {
            const Camera& a = views[order[i]]->camera;
            const Camera& b = views[order[j]]->camera;
            if (b.position.x() - a.position.x() > tolerance) break;
            if ((b.position - a.position).norm() <= tolerance &&
                (b.world_from_camera - a.world_from_camera).cwiseAbs().maxCoeff() <= kSameRotation)
                pairs.emplace_back(std::min(order[i], order[j]), std::max(order[i], order[j]));
        }
    std::sort(pairs.begin(), pairs.end());
    for (const auto& [a, b] : pairs) report.duplicates.push_back(views[a]->name + " and " + views[b]->name);
}

/// Fills the warnings from all the rest.
void addWarnings(std::size_t n_views, CaptureReport& report) {
    const std::size_t n = report.usable;
    const auto say = [&](const std::string& line) { report.warnings.push_back(line); };
    if (!report.unusable.empty())
        say(std::to_string(report.unusable.size()) + " of " + std::to_string(n_views) +
            " cameras are unusable, and training will refuse them: " + joined(report.unusable));
    if (n == 0) return;
    if (report.sizes.size() > 1) {
        std::vector<std::string> sizes;
        for (const SizeCount& size : report.sizes) sizes.push_back(std::to_string(size.views) + " of " + sizeName(size));
        say("images of " + std::to_string(report.sizes.size()) + " sizes: " + joined(sizes));
    }
    if (n < kFewViews) say("only " + std::to_string(n) + " views; 20 to 300 give a scene");
    if (n > 1 && report.position_rank == 0)
        say("all cameras stand in one point: nothing tells how far away things are; take pictures from different places");
    if (n > 2 && report.position_rank == 1)
        say("the cameras stand in a line: things are seen from one side only; take some from above and below it");
    if (!report.alone.empty() && n > 1)
        say(std::to_string(report.alone.size()) + " of " + std::to_string(n) +
            " views share nothing with any other: " + joined(report.alone) + "; are the poses camera to world?");
    else if (2 * report.see_middle < n && n > 2 && report.position_rank > 0)
        say("only " + std::to_string(report.see_middle) + " of " + std::to_string(n) +
            " views see the middle: they look outward or past each other; give --bounds for what matters");
    else if (n > 2 && report.position_rank > 0 && report.widest_angle_deg < kSmallAngle_deg)
        say("the middle is seen under angles that differ by less than 10 degrees: distances will be uncertain");
    if (!report.duplicates.empty())
        say(std::to_string(report.duplicates.size()) + " pairs of views have the same pose: " +
            joined(report.duplicates));
}

}  // namespace

CaptureReport reportCapture(std::span<const CaptureView> all_views) {
    CaptureReport report;
    Views views;
    for (const CaptureView& view : all_views) {
        const std::string problem = cameraProblem(view.camera);
        if (problem.empty())
            views.push_back(&view);
        else
            report.unusable.push_back(view.name + ": " + problem);
    }
    report.usable = views.size();
    if (!views.empty()) {
        countLenses(views, report);
        measurePositions(views, report);
        measureDirections(views, report);
        findLonely(views, report);
        findDuplicates(views, report);
    }
    addWarnings(all_views.size(), report);
    return report;
}

}  // namespace nerfvdb
