// SPDX-License-Identifier: Apache-2.0
#include "bench/capture_plot.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "bench/number_text.h"
#include "bench/plot.h"
#include "bench/svg_text.h"

namespace nerfvdb {
namespace {

constexpr double kPanel = 440;  // pixels, each way
constexpr double kLeft = 24, kTop = 76, kGap = 24, kBottom = 64;
constexpr double kAir = 0.08;          // around the cameras, share of the panel
constexpr double kFrustum = 0.05;      // length of a camera's pyramid, share of the panel; less where there are many
constexpr double kManyCameras = 60;
constexpr double kBoxMost = 3;         // a box wider than so many times the cameras' extent does not set the scale
constexpr const char* kTrained = "#2f7fd6";
constexpr const char* kHeldOut = "#e0832a";
constexpr const char* kBox = "#2a9d6f";

/// A parallel projection: world to the panel's own axes, right and up, in world units.
struct Projection {
    Vec3d right, up;
    std::string right_name, up_name;
    Vec2d at(const Vec3d& p) const { return {right.dot(p), up.dot(p)}; }
};

std::string axisName(const Vec3d& direction) {
    constexpr double kAligned = 1 - 1e-9;
    for (int axis = 0; axis < 3; ++axis)
        if (std::abs(direction[axis]) > kAligned)
            return std::string(direction[axis] < 0 ? "-" : "") + "xyz"[axis];
    return {};
}

/// From above, and from the side: the horizontal direction is a world axis where up is one.
std::array<Projection, 2> projections(const Vec3d& up) {
    int next = 0;  // the world axis that is the most horizontal; x before y before z
    for (int axis = 1; axis < 3; ++axis)
        if (std::abs(up[axis]) < std::abs(up[next]) - 1e-9) next = axis;
    const Vec3d right = (Vec3d::Unit(next) - up * up[next]).normalized();
    const Vec3d ahead = up.cross(right);
    const std::string across = axisName(right).empty() ? "across" : axisName(right);
    return {Projection{right, ahead, across, axisName(ahead).empty() ? "ahead" : axisName(ahead)},
            Projection{right, up, across, axisName(up).empty() ? "up" : axisName(up)}};
}

/// Range of projected points along both axes.
struct Range {
    Vec2d low = Vec2d::Constant(std::numeric_limits<double>::infinity());
    Vec2d high = Vec2d::Constant(-std::numeric_limits<double>::infinity());
    void add(const Vec2d& p) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
    double extent() const { return (high - low).maxCoeff(); }
};

std::array<Vec3d, 8> cornersOf(const Box& box) {
    std::array<Vec3d, 8> corners;
    for (int c = 0; c < 8; ++c)
        corners[static_cast<std::size_t>(c)] = Vec3d(c & 4 ? box.max.x() : box.min.x(), c & 2 ? box.max.y() : box.min.y(),
                                                     c & 1 ? box.max.z() : box.min.z());
    return corners;
}

/// World units to pixels of one panel.
class Panel {
public:
    Panel(const Projection& projection, const Vec2d& center, double scale, double left, std::size_t number)
        : projection_(projection), center_(center), scale_(scale), left_(left), number_(number) {}

    Vec2d at(const Vec3d& point) const {
        const Vec2d offset = scale_ * (projection_.at(point) - center_);
        return {left_ + 0.5 * kPanel + offset.x(), kTop + 0.5 * kPanel - offset.y()};
    }
    std::string line(const Vec3d& a, const Vec3d& b, const std::string& attributes) const {
        const Vec2d from = at(a), to = at(b);
        return lineBetween(from.x(), from.y(), to.x(), to.y(), attributes);
    }
    std::string begin(const std::string& name) const {
        const std::string id = "panel" + std::to_string(number_);
        const std::string place = "x=\"" + px(left_) + "\" y=\"" + px(kTop) + "\" width=\"" + px(kPanel) + "\" height=\"" +
                                  px(kPanel) + "\"";
        return textAt(left_, kTop - 10, "", name + ": " + projection_.right_name + " to the right, " +
                                                projection_.up_name + " up") +
               "<clipPath id=\"" + id + "\"><rect " + place + "/></clipPath>\n<rect class=\"frame\" " + place +
               "/>\n<g clip-path=\"url(#" + id + ")\">\n";
    }

private:
    const Projection& projection_;
    Vec2d center_;
    double scale_, left_;
    std::size_t number_;
};

std::string boxLines(const Panel& panel, const Box& box) {
    const std::array<Vec3d, 8> corners = cornersOf(box);
    const std::string style = std::string("stroke=\"") + kBox + "\" stroke-dasharray=\"5 4\"";
    std::string text = "<g class=\"box\">\n";
    for (std::size_t c = 0; c < 8; ++c)
        for (const std::size_t bit : {1u, 2u, 4u})
            if (!(c & bit)) text += panel.line(corners[c], corners[c | bit], style);
    return text + "</g>\n";
}

/// Tip to corners, and the picture's rim; the upper edge is stronger, to tell how the camera is held.
std::string cameraLines(const Panel& panel, const CaptureView& view, double length) {
    const Camera& camera = view.camera;
    std::array<Vec3d, 4> rim;
    const std::array<Vec2d, 4> pixels{Vec2d(0, 0), Vec2d(camera.width, 0), Vec2d(camera.width, camera.height),
                                      Vec2d(0, camera.height)};
    for (std::size_t i = 0; i < 4; ++i) {
        // The pyramid of a pinhole: a wide lens would bend it out of shape.
        const Vec3d in_camera((pixels[i].x() - camera.cx) / camera.fx, (camera.cy - pixels[i].y()) / camera.fy, -1);
        rim[i] = camera.position + length * (camera.world_from_camera * in_camera);
    }
    std::string text = "<g stroke=\"" + std::string(view.held_out ? kHeldOut : kTrained) + "\"><title>" +
                       escaped(view.name) + (view.held_out ? " (held out)" : "") + "</title>\n";
    for (std::size_t i = 0; i < 4; ++i) {
        text += panel.line(camera.position, rim[i], "stroke-opacity=\".55\"");
        text += panel.line(rim[i], rim[(i + 1) % 4], i == 0 ? "stroke-width=\"2\"" : "stroke-opacity=\".8\"");
    }
    return text + "</g>\n";
}

std::string crossAt(const Vec2d& p) {
    constexpr double kArm = 5;
    return lineBetween(p.x() - kArm, p.y(), p.x() + kArm, p.y(), "class=\"front\" style=\"stroke-width:2\"") +
           lineBetween(p.x(), p.y() - kArm, p.x(), p.y() + kArm, "class=\"front\" style=\"stroke-width:2\"");
}

/// A bar of a round number of world units, about a quarter of a panel long, and what the colours mean.
std::string legend(double scale, bool has_held_out, bool has_box) {
    const double most = 0.3 * kPanel / scale;
    const double length = roundTicks(0, most, false, 3).back();
    const double y = kTop + kPanel + 26;
    std::string text = lineBetween(kLeft, y, kLeft + length * scale, y, "class=\"frame\" style=\"stroke-width:3\"");
    text += textAt(kLeft + length * scale + 8, y + 4, "", tickText(length) + " world units");
    double x = kLeft + kPanel + kGap;
    const auto entry = [&](const char* colour, const std::string& name, const char* more) {
        text += lineBetween(x, y, x + 22, y, std::string("stroke=\"") + colour + "\" stroke-width=\"2\"" + more);
        text += textAt(x + 28, y + 4, "", name);
        x += 118;
    };
    entry(kTrained, "trained on", "");
    if (has_held_out) entry(kHeldOut, "held out", "");
    if (has_box) entry(kBox, "scene box", " stroke-dasharray=\"5 4\"");
    return text;
}

}  // namespace

Vec3d upOfCameras(std::span<const CaptureView> views) {
    constexpr double kNearAxis = 0.866;  // cosine of 30 degrees
    Vec3d sum = Vec3d::Zero();
    for (const CaptureView& view : views)
        if (cameraProblem(view.camera).empty()) sum += view.camera.world_from_camera.col(1);
    if (sum.norm() < 1e-3 * static_cast<double>(views.size()) || views.empty()) return Vec3d::UnitZ();
    const Vec3d mean = sum.normalized();
    for (const int axis : {2, 1, 0})
        if (std::abs(mean[axis]) > kNearAxis) return mean[axis] > 0 ? Vec3d::Unit(axis) : Vec3d(-Vec3d::Unit(axis));
    return mean;
}

std::string svgText(const CapturePlot& plot, std::span<const CaptureView> views) {
    std::vector<const CaptureView*> drawn;
    for (const CaptureView& view : views)
        if (cameraProblem(view.camera).empty()) drawn.push_back(&view);
    // Held-out ones last: they are few, and lie on top.
    std::stable_sort(drawn.begin(), drawn.end(),
                     [](const CaptureView* a, const CaptureView* b) { return a->held_out < b->held_out; });

    const std::array<Projection, 2> sides = projections(upOfCameras(views));
    std::array<Range, 2> ranges;
    double extent = 0;
    for (std::size_t side = 0; side < 2; ++side) {
        for (const CaptureView* view : drawn) ranges[side].add(sides[side].at(view->camera.position));
        if (drawn.empty()) ranges[side].add(Vec2d::Zero());
        Range with_box = ranges[side];
        with_box.add(sides[side].at(plot.middle));
        if (plot.scene_box)
            for (const Vec3d& corner : cornersOf(*plot.scene_box)) with_box.add(sides[side].at(corner));
        if (with_box.extent() <= kBoxMost * ranges[side].extent()) ranges[side] = with_box;
        extent = std::max(extent, ranges[side].extent());
    }
    if (!(extent > 0)) extent = plot.scene_box ? plot.scene_box->size().maxCoeff() : 1;
    const double scale = kPanel * (1 - 2 * kAir) / extent;

    const double crowd = std::max(1.0, static_cast<double>(drawn.size()) / kManyCameras);
    const double frustum = kFrustum * kPanel / scale / std::sqrt(crowd);
    const double width = 2 * kLeft + 2 * kPanel + kGap, height = kTop + kPanel + kBottom;
    std::string svg = svgBegin(width, height, plot.title) + textAt(kLeft, 34, "class=\"title\"", plot.title);
    for (std::size_t side = 0; side < 2; ++side) {
        const Panel panel(sides[side], 0.5 * (ranges[side].low + ranges[side].high), scale,
                          kLeft + static_cast<double>(side) * (kPanel + kGap), side);
        svg += panel.begin(side == 0 ? "from above" : "from the side");
        if (plot.scene_box) svg += boxLines(panel, *plot.scene_box);
        svg += crossAt(panel.at(plot.middle));
        for (const CaptureView* view : drawn) svg += cameraLines(panel, *view, frustum);
        svg += "</g>\n";
    }
    svg += legend(scale, std::any_of(drawn.begin(), drawn.end(), [](const CaptureView* v) { return v->held_out; }),
                  plot.scene_box.has_value());
    return svg + "</svg>\n";
}

}  // namespace nerfvdb
