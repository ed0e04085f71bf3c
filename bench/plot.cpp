// SPDX-License-Identifier: Apache-2.0
#include "bench/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bench/number_text.h"
#include "bench/svg_text.h"

namespace nerfvdb {
namespace {

// The sheet, in pixels. Margins are what titles and labels need; the legend's width follows from its names.
constexpr double kPlotWidth = 560, kPlotHeight = 380;
constexpr double kTop = 64, kBottom = 92, kRight = 24;
constexpr double kCategoryHeight = 30;  // of a row of a categorical axis
constexpr double kLegendRow = 20;
constexpr double kCharWidth = 6.6;  // of 12 px text, on the wide side

// Colours that hold on white and on near-black and that the colour-blind can tell apart, with marker shapes
// beside them (after Okabe and Ito 2008, "Color universal design", lightened or darkened to middle luminance).
constexpr const char* kColours[] = {"#2f7fd6", "#e0832a", "#2a9d6f", "#c95ba0",
                                    "#8b6fd6", "#b8971f", "#d64545", "#3fa9b8"};
constexpr int kShapes = 4;

/// Where a quantity lies along an axis, and its ticks.
class Scale {
public:
    Scale(const PlotAxis& axis, const std::vector<double>& values, double begin, double end, int wanted_ticks)
        : is_log_(axis.is_log), begin_(begin), end_(end) {
        low_ = std::numeric_limits<double>::infinity(), high_ = -low_;
        for (const double value : values)
            if (canShow(value)) low_ = std::min(low_, value), high_ = std::max(high_, value);
        if (!axis.categories.empty()) {
            low_ = -0.5, high_ = static_cast<double>(axis.categories.size()) - 0.5;
            return;
        }
        if (!(low_ <= high_)) low_ = is_log_ ? 1 : 0, high_ = is_log_ ? 10 : 1;  // nothing to show
        if (axis.begins_at_zero && !is_log_) low_ = std::min(low_, 0.0);
        widen();
        ticks_ = axis.ticks.empty() ? roundTicks(low_, high_, is_log_, wanted_ticks) : axis.ticks;
        std::erase_if(ticks_, [&](double tick) { return tick < low_ || tick > high_; });
    }

    bool canShow(double value) const { return std::isfinite(value) && (!is_log_ || value > 0); }
    double at(double value) const {
        const double share =
            is_log_ ? std::log(value / low_) / std::log(high_ / low_) : (value - low_) / (high_ - low_);
        return begin_ + share * (end_ - begin_);
    }
    const std::vector<double>& ticks() const { return ticks_; }

private:
    /// Some air around the data, so that no marker sits on the frame; zero stays the edge.
    void widen() {
        constexpr double kAir = 0.06;
        if (is_log_) {
            const double air = high_ > low_ ? std::pow(high_ / low_, kAir) : 1.5;
            low_ /= air, high_ *= air;
            return;
        }
        const double air = high_ > low_ ? kAir * (high_ - low_) : std::max(0.5 * std::abs(high_), 0.5);
        if (low_ != 0) low_ -= air;
        high_ += air;
    }

    bool is_log_;
    double begin_, end_, low_ = 0, high_ = 1;
    std::vector<double> ticks_;
};

std::string marker(std::size_t series, double x, double y, const std::string& label) {
    const std::string colour = std::string("fill=\"") + kColours[series % std::size(kColours)] + "\"";
    const std::string title = label.empty() ? "/>\n" : "><title>" + escaped(label) + "</title>";
    const auto closed = [&](const char* tag) { return label.empty() ? title : title + "</" + tag + ">\n"; };
    const auto polygon = [&](std::initializer_list<std::pair<double, double>> corners) {
        std::string points;
        for (const auto& [dx, dy] : corners)
            points += (points.empty() ? "" : " ") + px(x + dx) + "," + px(y + dy);
        return "<polygon points=\"" + points + "\" " + colour + closed("polygon");
    };
    switch (series % kShapes) {
        case 0:
            return "<circle cx=\"" + px(x) + "\" cy=\"" + px(y) + "\" r=\"4\" " + colour + closed("circle");
        case 1:
            return polygon({{-3.6, -3.6}, {3.6, -3.6}, {3.6, 3.6}, {-3.6, 3.6}});
        case 2:
            return polygon({{0, -5}, {5, 0}, {0, 5}, {-5, 0}});
        default:
            return polygon({{0, -4.8}, {4.8, 3.8}, {-4.8, 3.8}});
    }
}

std::string lineStyle(std::size_t series, Stroke stroke) {
    std::string style = std::string("fill=\"none\" stroke=\"") + kColours[series % std::size(kColours)] +
                        "\" stroke-width=\"2\" stroke-linejoin=\"round\"";
    if (stroke == Stroke::dashed) style += " stroke-dasharray=\"5 4\"";
    return style;
}

/// One group: the line, the bars of repeats, the markers.
std::string seriesGroup(std::size_t number, const PlotSeries& series, const Scale& x, const Scale& y) {
    std::string line, marks;
    for (const PlotPoint& point : series.points) {
        if (!x.canShow(point.x) || !y.canShow(point.y)) continue;
        const double px_x = x.at(point.x), px_y = y.at(point.y);
        line += (line.empty() ? "" : " ") + px(px_x) + "," + px(px_y);
        if (point.y_low < point.y_high && y.canShow(point.y_low) && y.canShow(point.y_high))
            marks += lineBetween(px_x, y.at(point.y_low), px_x, y.at(point.y_high),
                                 lineStyle(number, Stroke::solid) + " stroke-opacity=\".5\"");
        if (series.has_markers) marks += marker(number, px_x, px_y, point.label);
    }
    std::string text = "<g class=\"series\" data-name=\"" + escaped(series.name) + "\">\n";
    if (series.stroke != Stroke::none && !line.empty())
        text += "<polyline points=\"" + line + "\" " + lineStyle(number, series.stroke) + "/>\n";
    return text + marks + "</g>\n";
}

std::string legend(const Plot& plot, double left, double top) {
    std::string text = "<g class=\"legend\">\n";
    double y = top + 6;
    for (std::size_t s = 0; s < plot.series.size(); ++s) {
        const PlotSeries& series = plot.series[s];
        if (series.drawn_like >= 0) continue;
        if (series.stroke != Stroke::none)
            text += lineBetween(left, y, left + 24, y, lineStyle(s, series.stroke));
        if (series.has_markers) text += marker(s, left + 12, y, "");
        text += textAt(left + 32, y + 4, "", series.name);
        y += kLegendRow;
    }
    if (!plot.front.empty()) {
        text += lineBetween(left + 2, y, left + 22, y, "class=\"front\"");
        text += textAt(left + 32, y + 4, "", "Pareto front");
    }
    return text + "</g>\n";
}

double legendWidth(const Plot& plot) {
    std::size_t longest = plot.front.empty() ? 0 : 12;
    for (const PlotSeries& series : plot.series)
        if (series.drawn_like < 0) longest = std::max(longest, series.name.size());
    return 32 + kCharWidth * static_cast<double>(longest);
}

double longestText(const std::vector<std::string>& texts) {
    std::size_t longest = 0;
    for (const std::string& text : texts) longest = std::max(longest, text.size());
    return kCharWidth * static_cast<double>(longest);
}

/// The small print, broken between words so that it fits the sheet.
std::vector<std::string> brokenLines(const std::string& text, double width) {
    const std::size_t most = static_cast<std::size_t>(width / 5.6);
    std::vector<std::string> lines;
    std::string line, word;
    const auto flushWord = [&] {
        if (!line.empty() && line.size() + 1 + word.size() > most) lines.push_back(line), line.clear();
        line += (line.empty() ? "" : " ") + word;
        word.clear();
    };
    for (const char c : text) {
        if (c == ' ')
            flushWord();
        else
            word += c;
    }
    flushWord();
    lines.push_back(line);
    return lines;
}

}  // namespace

std::vector<double> roundTicks(double low, double high, bool is_log, int wanted) {
    std::vector<double> ticks;
    if (is_log) {
        const int first = static_cast<int>(std::floor(std::log10(low))),
                  last = static_cast<int>(std::ceil(std::log10(high)));
        const double decades = std::log10(high / low);
        const int stride = std::max(1, static_cast<int>(std::ceil(decades / wanted)));
        for (int power = first; power <= last; ++power)
            for (const double factor : {1.0, 2.0, 5.0}) {
                if (factor > 1 && decades * 3 > wanted + 1) continue;
                if (factor == 1 && (power - first) % stride != 0) continue;
                const double tick = factor * std::pow(10.0, power);
                if (tick >= low && tick <= high) ticks.push_back(tick);
            }
        if (ticks.size() >= 3) return ticks;
        ticks.clear();  // less than a decade: plain round numbers serve better
    }
    const double rough = (high - low) / std::max(1, wanted);
    const double power = std::pow(10.0, std::floor(std::log10(rough)));
    double step = 10 * power;
    for (const double factor : {5.0, 2.0, 1.0})
        if (factor * power >= rough) step = factor * power;
    for (double n = std::ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; ++n)
        ticks.push_back(n * step + 0.0);
    return ticks;
}

std::string svgText(const Plot& plot) {
    const bool has_categories = !plot.y.categories.empty();
    const double height =
        has_categories ? kCategoryHeight * static_cast<double>(plot.y.categories.size()) : kPlotHeight;
    const double left = has_categories ? 24 + longestText(plot.y.categories) : 76;
    const double right = left + kPlotWidth, bottom = kTop + height;
    const double plain_width = right + 20 + legendWidth(plot) + kRight;
    const double sheet_width = std::max(plain_width, 24 + 9.2 * static_cast<double>(plot.title.size()));
    const std::vector<std::string> footer = brokenLines(plot.footer, sheet_width - 48);
    const double sheet_height = bottom + kBottom + 14 * static_cast<double>(footer.size() - 1);

    std::vector<double> xs, ys;
    for (const PlotSeries& series : plot.series)
        for (const PlotPoint& point : series.points) {
            xs.push_back(point.x), ys.push_back(point.y);
            if (point.y_low < point.y_high) ys.push_back(point.y_low), ys.push_back(point.y_high);
        }
    const Scale x(plot.x, xs, left, right, 8);
    const Scale y(plot.y, ys, has_categories ? kTop : bottom, has_categories ? bottom : kTop, 7);

    std::string svg = svgBegin(sheet_width, sheet_height, plot.title);
    svg += textAt(24, 34, "class=\"title\"", plot.title);

    for (const double tick : x.ticks()) {
        svg += lineBetween(x.at(tick), kTop, x.at(tick), bottom, "class=\"grid\"");
        svg += textAt(x.at(tick), bottom + 18, "text-anchor=\"middle\"", tickText(tick));
    }
    for (const double tick : y.ticks()) {
        svg += lineBetween(left, y.at(tick), right, y.at(tick), "class=\"grid\"");
        svg += textAt(left - 8, y.at(tick) + 4, "text-anchor=\"end\"", tickText(tick));
    }
    for (std::size_t c = 0; c < plot.y.categories.size(); ++c) {
        const double at = y.at(static_cast<double>(c));
        svg += lineBetween(left, at, right, at, "class=\"grid\"");
        svg += textAt(left - 8, at + 4, "text-anchor=\"end\"", plot.y.categories[c]);
    }
    svg += "<rect class=\"frame\" x=\"" + px(left) + "\" y=\"" + px(kTop) + "\" width=\"" + px(kPlotWidth) +
           "\" height=\"" + px(height) + "\"/>\n";
    svg += textAt(0.5 * (left + right), bottom + 42, "text-anchor=\"middle\"", plot.x.label);
    if (!plot.y.label.empty()) svg += textAt(left, kTop - 10, "", plot.y.label);

    std::string front;
    for (const auto& [fx, fy] : plot.front)
        if (x.canShow(fx) && y.canShow(fy))
            front += (front.empty() ? "" : " ") + px(x.at(fx)) + "," + px(y.at(fy));
    if (!front.empty()) svg += "<polyline class=\"front\" points=\"" + front + "\"/>\n";
    for (std::size_t s = 0; s < plot.series.size(); ++s) {
        const int like = plot.series[s].drawn_like;
        svg += seriesGroup(like >= 0 ? static_cast<std::size_t>(like) : s, plot.series[s], x, y);
    }
    svg += legend(plot, right + 20, kTop);
    for (std::size_t l = 0; l < footer.size(); ++l)
        svg += textAt(24, bottom + 74 + 14 * static_cast<double>(l), "class=\"small\"", footer[l]);
    return svg + "</svg>\n";
}

}  // namespace nerfvdb
