// SPDX-License-Identifier: Apache-2.0
// Line and dot plots as SVG: no dependency, readable by eye on light and on dark pages, and by a diff.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace nerfvdb {

struct PlotPoint {
    double x = 0, y = 0;
    std::string label = {};        // shown when the pointer rests on the point
    double y_low = 0, y_high = 0;  // a bar from low to high, where low < high
};

enum class Stroke { solid, dashed, none };

struct PlotSeries {
    std::string name;
    std::vector<PlotPoint> points;
    Stroke stroke = Stroke::solid;
    bool has_markers = true;
    int drawn_like =
        -1;  // number of a series that it belongs to: takes its colour, and no line of its own in the legend
};

struct PlotAxis {
    std::string label;  // with its unit
    bool is_log = false;
    bool begins_at_zero = false;
    std::vector<double> ticks = {};  // instead of round numbers
    std::vector<std::string> categories =
        {};  // instead of numbers: names of 0, 1, 2, ...; y axis only, from the top
};

struct Plot {
    std::string title;
    std::string footer;  // machine, commit: small print beneath
    PlotAxis x, y;
    std::vector<PlotSeries> series;
    std::vector<std::pair<double, double>> front;  // a line through these points, marked as the Pareto front
};

/// The plot as one SVG document. The legend stands beside the data, never over it. Points that cannot be drawn
/// (not finite; not positive on a log axis) are left out. Equal plots give equal bytes.
std::string svgText(const Plot& plot);

/// Round numbers that cover [low, high] with about `wanted` ticks: multiples of 1, 2 or 5 times a power of ten;
/// on a log axis powers of ten, with 2 and 5 between them where there are few. low < high, both positive on a
/// log axis.
std::vector<double> roundTicks(double low, double high, bool is_log, int wanted);

}  // namespace nerfvdb
