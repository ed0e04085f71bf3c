// SPDX-License-Identifier: Apache-2.0
#include "bench/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bench/result_plot.h"
#include "core/atomic_file.h"
#include "tests/bench/made_up_result.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"
#include "tests/support/xml_check.h"

using namespace nerfvdb;

namespace {

int countOf(const std::string& text, const std::string& part) {
    int n = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++n;
    return n;
}

/// Three series, one with a hostile name and one with points that cannot be drawn.
Plot awkwardPlot() {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    Plot plot;
    plot.title = "Error & <time>";
    plot.footer = "Imaginary \"CPU\", 2 of 8 cores";
    plot.x = {.label = "seconds", .is_log = true};
    plot.y = {.label = "PSNR, dB"};
    plot.series = {{"plain", {{0.1, 30, "first"}, {0.2, 31, "second", 30.5, 31.5}, {0.4, 31.2}}},
                   {"a <b> & \"c\"", {{0.1, 29}, {10, 35}}, Stroke::dashed},
                   {"holes", {{0, 30}, {-1, 30}, {1, kNan}, {kNan, 1}, {2, 33}}, Stroke::none},
                   {"shadow", {{0.1, 29}, {10, 34}}, Stroke::dashed, false, 0}};
    plot.front = {{0.1, 30}, {0.2, 31}, {2, 33}, {10, 35}};
    return plot;
}

}  // namespace

TEST_CASE("the checker of XML knows good from bad") {
    CHECK(test::xmlProblem("<?xml version=\"1.0\"?>\n<a x=\"1\"><b/>text &amp; more</a>\n").empty());
    for (const char* bad : {"", "text", "<a>", "<a></b>", "<a/><b/>", "<a>&</a>", "<a x=1/>", "<a x=\"<\"/>",
                            "<a x=\"1\" x=\"2\"/>", "<a", "<a x=\"1/>", "<a></a></a>"}) {
        CAPTURE(bad);
        CHECK(!test::xmlProblem(bad).empty());
    }
}

TEST_CASE("a plot is well-formed XML and holds each series once, in the picture and in the legend") {
    const std::string svg = svgText(awkwardPlot());
    CHECK(test::xmlProblem(svg) == "");
    CHECK(countOf(svg, "<g class=\"series\"") == 4);
    CHECK(countOf(svg, "data-name=\"shadow\"") == 1);
    CHECK(countOf(svg, ">shadow</text>") == 0);  // it belongs to the first
    CHECK(countOf(svg, "data-name=\"plain\"") == 1);
    CHECK(countOf(svg, "data-name=\"a &lt;b&gt; &amp; &quot;c&quot;\"") == 1);
    CHECK(countOf(svg, ">plain</text>") == 1);
    CHECK(countOf(svg, ">holes</text>") == 1);
    CHECK(countOf(svg, ">Pareto front</text>") == 1);
    CHECK(countOf(svg, "<polyline class=\"front\"") == 1);
    CHECK(countOf(svg, "<title>second</title>") == 1);
    CHECK(svg.find("nan") == std::string::npos);
    CHECK(svg.find("inf") == std::string::npos);
    CHECK(svg == svgText(awkwardPlot()));
}

TEST_CASE("a plot of nothing is still a plot") {
    CHECK(test::xmlProblem(svgText({})) == "");
    Plot log;
    log.x.is_log = log.y.is_log = true;
    log.series = {{"empty", {}}, {"one", {{3, 3}}}, {"impossible", {{0, -1}}}};
    CHECK(test::xmlProblem(svgText(log)) == "");
}

TEST_CASE("the legend lies to the right of the data") {
    const std::string svg = svgText(awkwardPlot());
    const auto number = [&](const std::string& attribute, std::size_t from) {
        const std::size_t at = svg.find(attribute + "=\"", from) + attribute.size() + 2;
        return std::stod(svg.substr(at));
    };
    const std::size_t frame = svg.find("<rect class=\"frame\"");
    const double frame_right = number("x", frame) + number("width", frame);
    const std::size_t legend = svg.find("<g class=\"legend\">");
    CHECK(number("x1", legend) > frame_right);
    CHECK(number("x", svg.find("<text", legend)) > frame_right);
    // And nothing that is drawn lies outside the frame.
    for (std::size_t at = svg.find("<circle"); at < legend; at = svg.find("<circle", at + 1))
        CHECK((number("cx", at) > number("x", frame) && number("cx", at) < frame_right));
}

TEST_CASE("round ticks") {
    using Ticks = std::vector<double>;
    CHECK(roundTicks(0, 10, false, 5) == Ticks{0, 2, 4, 6, 8, 10});
    CHECK(roundTicks(28.3, 33.9, false, 6) == Ticks{29, 30, 31, 32, 33});
    CHECK(roundTicks(1, 1000, true, 8) == Ticks{1, 2, 5, 10, 20, 50, 100, 200, 500, 1000});
    CHECK(roundTicks(0.09, 12, true, 3) == Ticks{0.1, 1, 10});
    CHECK(roundTicks(101, 109, true, 4) == Ticks{102, 104, 106, 108});
    CHECK(roundTicks(0.7, 3.2, true, 5) == Ticks{1, 1.5, 2, 2.5, 3});
    // Any range: sorted, inside, at least two, round.
    for (const double low : {-17.3, 0.0, 1e-6, 5.01, 12345.6})
        for (const double size : {1e-3, 0.7, 3.0, 99.0, 1e7}) {
            CAPTURE(low, size);
            const Ticks ticks = roundTicks(low, low + size, false, 7);
            CHECK(ticks.size() >= 3);
            CHECK(ticks.size() <= 12);
            CHECK(std::is_sorted(ticks.begin(), ticks.end()));
            CHECK(ticks.front() >= low - 1e-6 * size);
            CHECK(ticks.back() <= low + size * (1 + 1e-6));
        }
}

TEST_CASE("a result becomes a plot of two of its columns, and three files") {
    const BenchResult result = test::madeUpResult();
    Plot plot = plotColumns(result, "seconds", "psnr");
    REQUIRE(plot.series.size() == 1);  // the other series has no psnr
    REQUIRE(plot.series[0].points.size() == 2);
    CHECK(plot.series[0].points[0].x == 0.2);
    CHECK(plot.series[0].points[0].y == 41.25);
    CHECK(plot.series[0].points[0].label == "0,5");
    CHECK(plot.x.label == "seconds, s");
    CHECK(plot.footer.find("Imaginary CPU") != std::string::npos);
    CHECK(plot.footer.find("2030") == std::string::npos);  // no date: equal runs, equal plots
    markFront(plot);
    CHECK(plot.front == std::vector<std::pair<double, double>>{{0.1, 38.5}, {0.2, 41.25}});

    const Plot by_label = plotByLabel(result, "seconds");
    CHECK(by_label.y.categories == std::vector<std::string>{"0,5", "1", "2"});
    REQUIRE(by_label.series.size() == 2);
    CHECK(by_label.series[1].points[0].y == 2);
    CHECK(test::xmlProblem(svgText(by_label)) == "");

    TempDir folder;
    writeResult(result, plot, folder.path());
    CHECK(readFile(folder / "render.json") == jsonText(result));
    CHECK(readFile(folder / "render.csv") == csvText(result));
    CHECK(readFile(folder / "render.svg") == svgText(plot));
}
