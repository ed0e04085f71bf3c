// SPDX-License-Identifier: Apache-2.0
#include "trainer/scene_shells.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/median.h"
#include "core/parallel.h"
#include "trainer/scene_box.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {
namespace {

constexpr double kInward = 0.75;   // of the cameras have what all look at in this middle part of their pictures
constexpr double kMiddlePart = 0.5;
constexpr double kOneWay = 0.8;    // length of the mean of the viewing directions: half of them within 35 degrees
constexpr double kMargin = 0.1;    // around cameras, of the longest side of their box

Vec3d axisOf(const Camera& camera) { return -camera.world_from_camera.col(2); }

/// Whether a point is in the middle `part` of a picture's width and height, 1: anywhere in it.
bool isInPicture(const Camera& camera, const Vec3d& point, double part = 1) {
    const std::optional<Vec2d> pixel = projectPoint(camera, point);
    return pixel && std::abs(2 * pixel->x() - camera.width) < part * camera.width &&
           std::abs(2 * pixel->y() - camera.height) < part * camera.height;
}

template <typename Value>
double medianOfCameras(const Dataset& dataset, const Value& value) {
    std::vector<double> values;
    for (const View& view : dataset.views) values.push_back(value(view.camera));
    return medianOf(std::move(values));
}

Box grown(const Box& box, double margin) {
    return {box.min - Vec3d::Constant(margin), box.max + Vec3d::Constant(margin)};
}

/// A sparse point, and how wide the pixels are there that show it best, world units.
struct SeenPoint {
    Vec3d position;
    double distance, pixel;
};

/// Some thousands of the points, evenly chosen, those nearest to a camera that sees them first.
std::vector<SeenPoint> seenPoints(const Dataset& dataset) {
    constexpr std::size_t kMost = 5000;
    const std::size_t stride = (dataset.points.size() + kMost - 1) / kMost;
    std::vector<SeenPoint> seen(stride > 0 ? (dataset.points.size() + stride - 1) / stride : 0);
    parallelFor(seen.size(), [&](std::size_t n) {
        SeenPoint& point = seen[n];
        point = {dataset.points[n * stride], std::numeric_limits<double>::infinity(), 0};
        for (const View& view : dataset.views) {
            const double distance = (point.position - view.camera.position).norm();
            if (distance >= point.distance || !isInPicture(view.camera, point.position)) continue;
            point.distance = distance;
            point.pixel = distance / view.camera.fx;
        }
    });
    std::erase_if(seen, [](const SeenPoint& point) { return !std::isfinite(point.distance); });
    std::stable_sort(seen.begin(), seen.end(),
                     [](const SeenPoint& a, const SeenPoint& b) { return a.distance < b.distance; });
    return seen;
}

/// The box of the first `count` points but for the outermost hundredth on each side, which may be errors.
Box boxOfFirst(const std::vector<SeenPoint>& points, std::size_t count) {
    Box box;
    std::vector<double> values(count);
    for (int axis = 0; axis < 3; ++axis) {
        for (std::size_t n = 0; n < count; ++n) values[n] = points[n].position[axis];
        const auto at = [&](std::size_t rank) {
            std::nth_element(values.begin(), values.begin() + rank, values.end());
            return values[rank];
        };
        box.min[axis] = at(count / 100);
        box.max[axis] = at(count - 1 - count / 100);
    }
    return grown(box, 0.05 * box.size().maxCoeff());
}

/// Mean over the points of how often voxels in and around a box would have to be halved to be no larger than pixels.
double missingHalvings(const std::vector<SeenPoint>& points, const Box& box) {
    constexpr double kFinest = 512;  // voxels along the longest side
    const double voxel = box.size().maxCoeff() / kFinest;
    const Vec3d center = box.center(), half = 0.5 * box.size();
    double sum = 0;
    for (const SeenPoint& point : points) {
        const double beyond = ((point.position - center).cwiseAbs().array() / half.array()).maxCoeff();
        const double shell = std::ceil(std::log2(std::max(1.0, beyond)));
        sum += std::max(0.0, std::log2(voxel / point.pixel) + shell);
    }
    return sum / static_cast<double>(points.size());
}

}  // namespace

std::optional<Box> boxOfPoints(const Dataset& dataset) {
    constexpr std::size_t kEnough = 100;
    constexpr int kParts = 10;
    constexpr double kEqual = 0.02;  // halvings
    const std::vector<SeenPoint> points = seenPoints(dataset);
    if (points.size() < kEnough) return {};
    std::optional<Box> best;
    double least = std::numeric_limits<double>::infinity();
    for (int part = kParts; part > 0; --part) {
        const Box box = boxOfFirst(points, points.size() * part / kParts);
        if (!((box.size().array() > 0).all())) continue;
        const double missing = missingHalvings(points, box);
        if (missing >= least - kEqual) continue;
        least = missing;
        best = box;
    }
    return best;
}

double distanceAhead(const Dataset& dataset, const Vec3d& axis) {
    constexpr double kSharedBy = 10, kSharedByStrip = 4;  // photographs that show a point
    const Vec3d u = axis.unitOrthogonal(), v = axis.cross(u);
    // Along the direction in which the cameras are furthest apart, and across it.
    Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
    Vec2d mean = Vec2d::Zero();
    std::vector<Vec2d> places;
    for (const View& view : dataset.views) {
        places.emplace_back(u.dot(view.camera.position), v.dot(view.camera.position));
        mean += places.back() / static_cast<double>(dataset.views.size());
    }
    for (const Vec2d& place : places) moments += (place - mean) * (place - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(moments);
    Vec2d lower = Vec2d::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
    for (const Vec2d& place : places) {
        const Vec2d turned = eigen.eigenvectors().transpose() * place;
        lower = lower.cwiseMin(turned);
        upper = upper.cwiseMax(turned);
    }
    const Vec2d extent = upper - lower;  // the longer one comes last
    const double n = static_cast<double>(dataset.views.size());
    const double pixels = medianOfCameras(dataset, [](const Camera& camera) { return std::sqrt(double(camera.width) * camera.height); });
    const double focal_length = medianOfCameras(dataset, [](const Camera& camera) { return camera.fx; });
    const double picture = std::max(std::sqrt(kSharedBy * extent.prod() / n), kSharedByStrip * extent[1] / n);  // world units
    return picture * focal_length / pixels;
}

SceneShells findSceneShells(const Dataset& dataset, const std::optional<Box>& given) {
    const Vec3d focus = commonFocus(dataset);
    const Box cameras = boxOfCameras(dataset);
    const double distance = medianOfCameras(dataset, [&](const Camera& camera) { return (focus - camera.position).norm(); });
    const double focal_length = medianOfCameras(dataset, [](const Camera& camera) { return camera.fx; });
    const auto n_inward = std::count_if(dataset.views.begin(), dataset.views.end(),
                                        [&](const View& view) { return isInPicture(view.camera, focus, kMiddlePart); });
    const bool is_inward = static_cast<double>(n_inward) >= kInward * static_cast<double>(dataset.views.size());
    Vec3d axis = Vec3d::Zero();
    for (const View& view : dataset.views) axis += axisOf(view.camera) / static_cast<double>(dataset.views.size());

    SceneShells scene;
    if (given) {
        scene.inner = findSceneBox(dataset, given);
    } else if (is_inward && distance > 0) {
        scene.inner = {focus - Vec3d::Constant(0.5 * distance), focus + Vec3d::Constant(0.5 * distance)};
    } else if (const std::optional<Box> of_points = boxOfPoints(dataset)) {
        scene.inner = *of_points;
    } else {
        Box box = cameras;
        if (axis.norm() > kOneWay) {
            constexpr double kBeyond = 1.6;  // of the distance: photographs may overlap more
            const Vec3d reach = kBeyond * distanceAhead(dataset, axis.normalized()) * axis.normalized();
            box = {cameras.min.cwiseMin(cameras.min + reach), cameras.max.cwiseMax(cameras.max + reach)};
        }
        scene.inner = grown(box, kMargin * box.size().maxCoeff());
    }
    if (!(scene.inner.size().maxCoeff() > 0))
        throw DataError(dataset.root.string(), "cameras that all stand at one place", "cameras at several places",
                        "check the poses, or give --bounds");
    constexpr double kFewPixels = 8;
    constexpr int kMostShells = 8;
    const double reach = cameras.size().norm() * focal_length / kFewPixels;
    const double half = 0.5 * scene.inner.size().maxCoeff();
    scene.count = 1;
    while (scene.count < kMostShells && half * Shells::scale(scene.count - 1) < reach) ++scene.count;
    return scene;
}

}  // namespace nerfvdb
